"""interpose's own networks as methods: whatever of a pose is missing, on the user's skeleton and back."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial, reduce

import numpy as np

from interpose.clip import Clip
from interpose.errors import RequestError, unknown
from interpose.geometry import kinematics, rotations
from interpose.geometry.time import (
    grid,
    runs,
    sample,
    sample_rotations,
    sample_rotations_smooth,
    sample_smooth,
)
from interpose.methods import repeating, weights
from interpose.methods.bodies import no_humanoid, observed_body, on_the_floor
from interpose.methods.classical import Spline
from interpose.methods.joining import joined
from interpose.methods.protocol import Raw
from interpose.observation import ROUGH, Gap, Observation, Pin
from interpose.skeletons import (
    ACROSS,
    ACROSS_TURN,
    FEET,
    JOINTS,
    PARENTS,
    SIDES,
    Humanoid,
    Mapping,
    find_mapping,
)
from interpose.skeletons.mirror import mirrored
from interpose.skeletons.performers import by_itself, performers

FEET_ACROSS = [FEET.index(SIDES[foot]) for foot in FEET]
AGREE = np.pi / 2  # how far a motion and its mirror image may be apart, in any joint
# Degrees a second by which joints turn against the one above in all but one frame of ten thousand (84,000 of
# LAFAN1's and Bandai-Namco's training and validation performers): what turns faster snaps. And the share of
# the one's haste below which the other of two answers is calmer.
HASTE = {"Hips": 500, "Spine": 150, "Spine1": 200, "Spine2": 220, "Neck": 520, "Head": 560}
HASTE |= {"Shoulder": 400, "Arm": 1250, "ForeArm": 1060, "Hand": 2000}
HASTE |= {"UpLeg": 800, "Leg": 1000, "Foot": 1200, "Toe": 900}
FASTEST = np.radians([HASTE[name.removeprefix("Left").removeprefix("Right")] for name in JOINTS]) / 30.0
CALMER = 0.8
CONTEXT = 10  # frames on both sides of a hole that are seen, as in training
# Frames that a window completes of a hole of the whole pose, and that the last one does between known sides:
# what is further away from known frames is a mean of all that may happen, and a body that hardly moves. Of 23
# gaps of LAFAN1's validation performer the middle moves 75, 45 and 34 % as much as the motion around it when
# all is said at once (80, 120 and 180 frames), and 92, 80 and 81 % so; joints are off by 11.6, 26 and 63 cm
# instead of 12.2, 25 and 72. Forecasts move 70, 31, 25 and 21 % as much as the truth in their first seconds
# when 60 frames are said at once, and 75, 56, 55 and 51 % so, and are off by 12.5, 60, 132 and 197 cm instead
# of 12.4, 57, 117 and 167: another motion, where nobody knows which, and no mean. Between lone keys 60 frames
# apart bodies glide in 8 % of the frames when all is said at once, and in 4 % so (people in 3).
STEP, MEET = 10, 30
# What it expects to be off by, in metres and in the mean, up to which it says all that is left of a hole of
# the whole pose at once, between known sides: there is little else that may happen. Of 60 windows of
# Bandai-Namco's validation performers gaps of 2 and 3 s are off by 1.8 and 2.2 cm so, by 2.0 and 2.8 when
# said in turn throughout; LAFAN1's, in which it is seldom as sure, by as much as ever.
SURE = 0.04
# What it has said itself of the whole pose, further than so many frames from what is known, counts as known
# to this share: taken for true, what is a mean by then leads to a mean that moves even less. In the third and
# fourth second of forecasts of LAFAN1's validation performer `small` moves 39 and 35 % as much as the truth
# so, and 29 and 24 % where all counts; in the middle of gaps of six seconds 87 and 95 % instead of 70 and 80.
# Feet travel 3.6 and 5.3 m instead of 3.1 and 5.0 (truth 3.6 and 5.5), and joints are off by 104 and 53 cm
# instead of 105 and 52.
FIRM, GUESSED = 30, 0.75
# Where more are left, ends that know nothing of each other would stray, and the body would run in between:
# its hips are led along a way that leaves and meets them as they go, which wears off by e in LEAD frames, and
# that is known as far as what is noisy. In 24 gaps of 8 s of LAFAN1's validation performer joints are off by
# 89 cm so (98 with half of LEAD), by 101 where nothing leads them (they run at 2.5 m/s, people at 2.2) and by
# 130 along a straight line; in gaps of 7 s by 85 so, and by 81 where nothing leads them.
ASTRAY, ROUGHLY, LEAD = 225, 0.5, 60.0
# So they are in shorter holes, too, that begin or end slower than STANDS (metres a frame) or at a lone frame,
# but whose ends are apart by more than GOES for every frame: who stands would stand for as long as he can,
# and then run.
STANDS, GOES = 0.4 / 30, 0.3 / 30
# Where somebody says where the hips go, they come back to it by e in about so many frames.
BACK = 5.0
# Of what follows nothing, or is followed by nothing: frames over which a pace is measured, and those of known
# motion in which it is, over as many; who goes steadily goes in each at such a share of the fastest, and at
# so many metres a frame. No window is slowed to less than a share.
BLOCK, STEADY, EVENLY, SLOWEST, LEAST = 15, 45, 0.3, 0.003, 0.6
# What weights count for that are asked beside others: `small` had far more steps for lost joints than `base`.
# On 16 windows of validation performers halves are 1 % worse there, and 1 % better in gaps of the whole pose;
# `small` alone is 1 to 5 % worse in these.
BESIDE = 2 / 3
# By what share it goes faster through a lone key between two gaps of a second than it says, and slower in
# between; in longer ones by as many frames. Knowing a pose alone it slows down there, as if each key were an
# end: joints go at 89, 88 and 82 % of their true speed through keys 15, 30 and 60 frames apart (`base`, 20
# windows of LAFAN1's validation performer), and at 97, 96 and 86 % so. They are off by 1 % less, 1 less, and
# as much.
THROUGH = 0.1
COLUMNS = len(PARENTS) + 1  # what can be known in a frame: a rotation for each joint, and where the hips are


@dataclass(frozen=True)
class Base:
    """Completes poses by what it has seen; thinks at 30 fps on 22 joints scaled to one leg.

    Attributes:
        name: of the weights: base, small, small-open, or the folder they lie in.
        action: a label of its card; "" leaves it open.
        trained: the weights; the installed ones without any.
        beside: the name of installed weights that are asked, too, unless others were trained: the mean of
            what both say counts, to the share BESIDE.
    """

    name: str = "base"
    action: str = ""
    trained: weights.Card | None = None
    beside: str = ""

    @property
    def card(self) -> weights.Card:
        return weights.of(self.name, self.trained)

    @property
    def asked(self) -> list[weights.Card]:
        """All weights that are asked, its own first."""
        return [self.card, *([weights.find(self.beside)] if self.beside and not self.trained else [])]

    def for_action(self, action: str) -> Base:
        """The same method, told what the motion is. RequestError lists the actions for an unknown one."""
        labels = [label for label in self.card.labels if label]
        if not labels:
            raise RequestError(
                f"cannot make it {action} with {self.name}", f"{self.name} knows no actions", "Leave it out."
            )
        if action not in labels:
            raise unknown("action", action, labels)
        return replace(self, action=action)

    def refuses(self, clip: Clip, gap: Gap) -> str | None:
        """Why not: no humanoid, or joints that it does not know."""
        mapping = find_mapping(clip.skeleton)
        if reason := no_humanoid(mapping):
            return reason
        if gap.joints is not None:
            bodies = [
                clip.skeleton,
                *(by_itself(clip.skeleton, one) for one in performers(clip.skeleton)[1:]),
            ]
            known = {body.names[joint] for body in bodies for joint in find_mapping(body).mapped[1]}
            return None if known & {*gap.joints} else "it knows none of these joints"
        return None

    @on_the_floor
    def complete(self, clip: Clip, observation: Observation, seed: int | None = None) -> Raw:
        """Rotations of the mapped joints and the way of the hips; a spline for all else."""
        cards, body = self.asked, observed_body(clip, observation)
        card = cards[0]
        base = Spline().complete(clip, observation).clip
        turned, root, bones = body.rotations(base), body.root(base) * body.scale, body.bones * body.scale
        known = knowledge(observation, body.mapping)
        times = grid(known, clip.fps / card.fps)
        before = np.floor(times).astype(int)
        after = np.minimum(np.ceil(times).astype(int), len(clip) - 1)
        local = kinematics.local_rotations(turned, PARENTS)
        across = card.labels[mirrored(card.labels)[card.labels.index(self.action)]] if self.action else ""
        seen = Seen(
            sample_rotations(local, times),
            sample(root, times),
            known[before] & known[after],
            np.isin(np.arange(COLUMNS), [*body.mapping.mapped[0], COLUMNS - 1]),
            (self.action, across),
            bones,
            *pinned(observation, body.mapping, times, body.scale * body.hand),
            way(observation, body.mapping, times, body.scale * body.hand),
            faces(observation, body, base, times),
        )
        answer = run_long(cards, seen)
        said = repeating.Motion(answer.local, answer.root)
        held = repeating.Motion(seen.local, seen.root)
        told = seen.known[:, seen.has]
        told[seen.pins.any(axis=1), 0] = True  # where it is to be there is more to it than that
        on, periods = repeating.carried_on(held, told, said, bones)
        answer.local, answer.root = on.local, on.root
        changes = np.flatnonzero((seen.known[1:] != seen.known[:-1]).any(axis=1)) + 1
        answer.local = joined(answer.local, seen.known[:, :-1], changes, card.fps)
        answer.root = joined(answer.root[:, None], seen.known[:, -1:], changes, card.fps)[:, 0]
        said = kinematics.global_rotations(answer.local, PARENTS)
        missing = ~known.all(axis=1)
        back = np.interp(through(observation, known[:, -1], clip.fps)[missing], times, np.arange(len(times)))
        # What is known of a frame is exactly so; only what is not is the network's.
        turns = rotations.normalize(sample_rotations_smooth(rotations.continuous(said), back))
        own = kinematics.local_rotations(turns, PARENTS)
        local[missing] = np.where(known[missing, : len(PARENTS), None], local[missing], own)
        root[missing] = np.where(known[missing, -1:], root[missing], sample_smooth(answer.root, back))
        done = body.to_clip(kinematics.global_rotations(local, PARENTS), root / body.scale, base)
        stands, expected = np.full((len(clip), len(FEET)), np.nan), np.full(len(clip), np.nan)
        stands[missing] = sample(answer.stands, back)
        expected[missing] = sample(answer.expected[:, None], back)[:, 0] / body.scale
        remarks = {}
        for gap in observation.gaps(clip.skeleton):
            for (start, stop), (what, period) in periods.items():
                if times[start] <= (gap.start + gap.stop - 1) / 2 <= times[stop - 1]:
                    every = f"{period / card.fps:.1f} s"
                    remarks[f"{gap.start}:{gap.stop}"] = [f"{what} every {every} goes on in it"]
        notes = {**weights.told(*cards), "remarks": remarks}
        return Raw(done, notes=notes, stands=stands, expected=expected)


@dataclass
class Answer:
    """What the network says of a motion at 30 fps.

    Attributes:
        local: (T, 22, 4) canonical rotations relative to the parent's; float64.
        root: (T, 3) metres, the hips.
        stands: (T, 4) how likely ankles and toes stand, 0 to 1, or NaN.
        expected: (T,) metres that joints are expected to be off, or NaN.
    """

    local: np.ndarray
    root: np.ndarray
    stands: np.ndarray
    expected: np.ndarray

    def backwards(self) -> Answer:
        """From its end to its beginning."""
        return Answer(self.local[::-1], self.root[::-1], self.stands[::-1], self.expected[::-1])


def base() -> Base:
    """The larger one, and `small` beside it: they err differently, and their mean less than either."""
    return Base("base", beside="small")


def small() -> Base:
    """The one that is small enough for everywhere."""
    return Base("small")


def small_open() -> Base:
    """The same network, of weights for any use."""
    return Base("small-open")


def knowledge(observation: Observation, mapping: Mapping) -> np.ndarray:
    """(F, 23) which canonical rotations, relative to the parent's, and last which hips' places are known.

    A rotation needs those of all joints between it and the canonical joint that it hangs from; joints that
    the skeleton does not have are known to turn with their parent.
    """
    skeleton, rows = mapping.skeleton, dict(zip(*mapping.mapped))
    found = np.ones((len(observation.rotation), COLUMNS), bool)
    ends = set(rows.values())
    for row, joint in rows.items():
        chain = [joint]
        while skeleton.parents[chain[-1]] >= 0 and skeleton.parents[chain[-1]] not in ends:
            chain.append(skeleton.parents[chain[-1]])
        found[:, row] = observation.rotation[:, chain].all(axis=1)
    hips = mapping["Hips"]
    assert hips is not None
    found[:, -1] = observation.positions(skeleton)[:, hips]
    return found


def pinned(
    observation: Observation, mapping: Mapping, times: np.ndarray, scale: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Where pins say that canonical joints are (T, 22, 3), in metres of the scaled body, and of which (T, 22)
    they do.

    times: of the network's frames (T), in frames of the clip; a pin speaks of the nearest one.
    scale: (3,) of the body to the canonical one, along each axis: negative where that is its mirror image's.
    """
    rows = {joint: row for row, joint in zip(*mapping.mapped)}
    places, said = np.zeros((len(times), len(PARENTS), 3)), np.zeros((len(times), len(PARENTS)), bool)
    for pin in observation.pins:
        row = rows.get(mapping.skeleton.index(pin.joint))
        if row is not None and pin.position is not None and not leads(pin, row):
            at = np.round(np.interp(pin.frames, times, np.arange(len(times)))).astype(int)
            places[at, row], said[at, row] = np.asarray(pin.position) * scale, True
    return places, said


def leads(pin: Pin, row: int) -> bool:
    """Whether a pin of a canonical joint only says roughly where the body goes."""
    return row == 0 and pin.position is not None and pin.tolerance >= ROUGH


def way(observation: Observation, mapping: Mapping, times: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """(T, 3) metres of the scaled body, where the hips go roughly, NaN where nothing says so; arguments as in
    `pinned`."""
    found = np.full((len(times), 3), np.nan)
    for pin in observation.pins:
        if mapping.skeleton.index(pin.joint) == mapping["Hips"] and leads(pin, 0):
            assert pin.position is not None
            told = (times >= pin.frames[0]) & (times <= pin.frames[-1])
            places = [np.interp(times[told], pin.frames, one) for one in np.transpose(pin.position)]
            found[told] = np.transpose(places) * scale
    return found


def faces(observation: Observation, body: Humanoid, clip: Clip, times: np.ndarray) -> np.ndarray:
    """(T, 4) how the hips are turned roughly, canonical; NaN where nothing says so.

    clip: of the body, whose hips need be turned anyhow.
    """
    found, hips = np.full((len(times), 4), np.nan), body.mapping["Hips"]
    for pin in observation.pins:
        if body.mapping.skeleton.index(pin.joint) == hips and leads(pin, 0) and pin.orientation is not None:
            rotation, above = clip.rotation.copy(), clip.skeleton.parents[hips]
            beneath = clip.kinematics()[0][pin.frames, above] if above >= 0 else rotations.identity(1)
            rotation[pin.frames, hips] = rotations.relative(beneath, pin.orientation)
            turned = body.rotations(clip.with_motion(rotation, clip.translation))[:, 0]
            told = (times >= pin.frames[0]) & (times <= pin.frames[-1])
            found[told] = sample_rotations(rotations.continuous(turned[:, None]), times[told])[:, 0]
    return found


def through(observation: Observation, placed: np.ndarray, fps: float) -> np.ndarray:
    """(F,) at which of its frames to look for what happens in each frame of a clip, so that motion goes
    through lone keys between gaps of the whole pose, and does not slow down there.

    placed: (F,) in which it is known where the hips are.
    """
    whole, empty = observation.frames, ~(observation.rotation.any(axis=1) | placed)
    time = np.arange(len(whole), dtype=float)
    lone = whole.copy()
    lone[[0, -1]] = False
    lone[1:-1] &= empty[:-2] & empty[2:]
    for start, stop in runs(empty):
        if start > 0 and stop < len(whole):
            length = stop - start + 1
            share = np.arange(1, length) / length
            leave, meet = THROUGH * min(1.0, fps / length) * lone[[start - 1, stop]]
            time[start:stop] += length * share * (1 - share) * (leave * (1 - share) - meet * share)
    return time


@dataclass
class Seen:
    """What the network is given of a motion at 30 fps.

    Attributes:
        local: (T, 22, 4) canonical rotations relative to the parent's.
        root: (T, 3) metres, the hips.
        known: (T, 23) how far each is known: 0 not at all, 1 exactly.
        has: (23,) which of these the skeleton has; others count as known.
        actions: what it is told to be, and what the mirror image is; "" for nothing.
        bones: (22, 3) metres.
        places: (T, 22, 3) metres, where joints are to be.
        pins: (T, 22) of which joints that is said.
        way, faces: (T, 3) metres and (T, 4), where the hips go and how they are turned, roughly; NaN where
            that is not said.
    """

    local: np.ndarray
    root: np.ndarray
    known: np.ndarray
    has: np.ndarray
    actions: tuple[str, str]
    bones: np.ndarray
    places: np.ndarray
    pins: np.ndarray
    way: np.ndarray
    faces: np.ndarray

    def part(self, frames: slice) -> Seen:
        """Of some frames."""
        names = ("local", "root", "known", "places", "pins", "way", "faces")
        return replace(self, **{name: getattr(self, name)[frames] for name in names})

    def backwards(self) -> Seen:
        """From its end to its beginning."""
        return self.part(slice(None, None, -1))

    def mirrored(self) -> Seen:
        """The mirror image."""
        sides, across = list(SIDES), ACROSS.values
        return Seen(
            self.local[:, sides] * ACROSS_TURN.values,
            self.root * across,
            self.known[:, [*sides, len(sides)]],
            self.has[[*sides, len(sides)]],
            self.actions[::-1],
            self.bones[sides] * across,
            self.places[:, sides] * across,
            self.pins[:, sides],
            self.way * across,
            self.faces * ACROSS_TURN.values,
        )


def run(card: weights.Card, *motions: Seen) -> list[Answer]:
    """Run the graph of some weights on motions of one length."""
    # Far from the origin float32 would lose millimetres.
    origins = [one.root[np.argmax(one.known[:, -1])] * [1.0, 0.0, 1.0] for one in motions]
    feeds = [
        {
            "local": np.where(one.known[:, :-1, None] > 0, one.local, [1.0, 0.0, 0.0, 0.0]),
            "root": np.where(one.known[:, -1:] > 0, one.root - origin, 0.0),
            "known": one.known,
            "pinned": np.where(one.pins[..., None], one.places - origin, 0.0),
            "bones": one.bones,
        }
        for one, origin in zip(motions, origins)
    ]
    feed = {name: np.stack([one[name] for one in feeds]).astype(np.float32) for name in feeds[0]}
    feed["pins"] = np.stack([one.pins for one in motions])
    told = [one.actions[0] for one in motions]
    feed["label"] = np.array([card.labels.index(action) if action in card.labels else 0 for action in told])
    session = weights.session(card.onnx, weights.cores())
    said = session.run(["local_out", "root_out", "contact", "error"], feed)
    return [
        Answer(rotations.normalize(turned), placed + origin, stands, off / 100)
        for turned, placed, stands, off, origin in zip(*(out.astype(float) for out in said), origins)
    ]


def mean(one: Answer, other: Answer, own: slice, share: float = 0.5) -> Answer:
    """Of two answers, to a `share` of the other. Where they disagree by more than a right angle it would be
    neither: then the one counts that expects to err less. Where one of them snaps as nobody does, and the
    other does less, the other counts."""
    wild = haste(one, own), haste(other, own)
    if max(wild) > 1.0 and min(wild) < CALMER * max(wild):
        return one if wild[0] < wild[1] else other
    apart = rotations.angle(*(kinematics.global_rotations(said.local, PARENTS) for said in (one, other)))
    if apart.max(initial=0.0) > AGREE:
        return min(one, other, key=lambda said: float(said.expected.mean()))
    return Answer(
        rotations.normalize((1 - share) * one.local + share * rotations.alike(other.local, one.local)),
        *(a + share * (b - a) for a, b in zip(*((x.root, x.stands, x.expected) for x in (one, other)))),
    )


def haste(said: Answer, own: slice) -> float:
    """How fast the joint turns that does so most, in frames `own` and to those beside, by what joints do:
    beyond 1 it snaps."""
    local = said.local[max(own.start - 1, 0) : own.stop + 1]
    return float((rotations.angle(local[1:], local[:-1]) / FASTEST).max(initial=0.0))


def run_both(card: weights.Card, motion: Seen) -> tuple[Answer, Answer]:
    """What the graph says of a motion, and what it says of the mirror image: in the mean of both the mirror
    image of a clip is completed as the mirror image of what the clip is, and errors are 2 to 4 % smaller."""
    said, image = run(card, motion, motion.mirrored())
    sides, across = list(SIDES), ACROSS.values
    turned = image.local[:, sides] * ACROSS_TURN.values
    return said, Answer(turned, image.root * across, image.stands[:, FEET_ACROSS], image.expected)


def ask(cards: Sequence[weights.Card], motion: Seen, own: slice) -> list[tuple[Answer, Answer]]:
    """What each graph says of a motion and of its mirror image, for the sake of its frames `own`.

    They have learned how motion goes on, not how it came about: where only what follows is known it goes
    backwards, which errs by a third less in gaps of a second.
    """
    known = np.asarray((motion.known > ROUGHLY).all(axis=1))
    if known[: own.start].any() or not known[own.stop :].any():
        return [run_both(card, motion) for card in cards]
    said = [run_both(card, motion.backwards()) for card in cards]
    return [(one.backwards(), image.backwards()) for one, image in said]


def agreed(said: Sequence[tuple[Answer, Answer]], own: slice) -> Answer:
    """The mean of all that is said of frames `own`."""
    first, *others = (mean(*both, own) for both in said)
    return reduce(partial(mean, own=own, share=BESIDE), others, first)


def led(motion: Seen, begin: int, end: int) -> Seen:
    """The motion with the hips, from frame `begin` to before `end`, roughly on a way between the frames
    beside: the one that is said, or one that leaves and arrives as they go there, level, and is straight
    where that has worn off."""
    root, known = motion.root.copy(), motion.known.copy()
    known[begin:end, -1] = ROUGHLY
    since = np.arange(1.0, end - begin + 1)[:, None]
    until = since[::-1]
    if told(motion, begin, end):
        root[begin:end] = motion.way[begin:end]
        # What is completed already is beside it by some centimetres.
        for beside, away in ((begin - 1, since), (end, until)):
            root[begin:end] += (1 + away / BACK) * np.exp(-away / BACK) * (root[beside] - motion.way[beside])
        local = motion.local.copy()
        if np.isfinite(motion.faces[begin:end]).all():
            local[begin:end, 0], known[begin:end, 0] = motion.faces[begin:end], ROUGHLY
        return replace(motion, local=local, root=root, known=known)
    whole = end - begin + 1
    step = (root[end] - root[begin - 1]) / whole
    turns = np.zeros((end - begin, 3))
    for goes, away, back, side in (
        (velocity(motion, begin - 1, -1), since, until, 1.0),
        (velocity(motion, end, 1), until, since, -1.0),
    ):
        if goes is not None:
            turns += side * away * (back / whole) ** 2 * np.exp(-away / LEAD) * (goes - step)
    root[begin:end] = root[begin - 1] + since * step + turns * [1.0, 0.0, 1.0]
    return replace(motion, root=root, known=known)


def told(motion: Seen, begin: int, end: int) -> bool:
    """Whether it is said of a hole between known frames where the hips go."""
    return bool(np.isfinite(motion.way[begin - 1 : end + 1]).all())


def eased(said: np.ndarray, own: slice, motion: Seen, inside: slice) -> np.ndarray:
    """What a window says of the hips (n, 3), in its frames `own` moved so that they go on as they do in the
    known frames beside the frames `inside` of a motion."""
    root = said.copy()
    left = np.linspace(1.0, 0.0, own.stop - own.start + 1)[:-1, None]
    fade = left * left * (3 - 2 * left)
    for beside, way, share in ((inside.start - 1, -1, fade), (inside.stop, 1, fade[::-1])):
        if 0 < beside < len(motion.root) - 1 and (motion.known[[beside, beside + way], -1] > 0).all():
            first = own.start if way < 0 else own.stop - 1
            goes_on = 2 * motion.root[beside] - motion.root[beside + way]
            root[own] -= share * (said[first] - goes_on)
    return root


def velocity(motion: Seen, frame: int, way: int) -> np.ndarray | None:
    """How hips move, metres a frame (3,), in the known half second that begins (`way` 1) or ends (-1) with a
    frame; None where that frame is alone."""
    known = motion.known[:, -1] > 0
    part = slice(frame, frame + BLOCK + 1) if way > 0 else slice(max(frame - BLOCK, 0), frame + 1)
    count = int(np.logical_and.accumulate(known[part][::way]).sum())
    if count < 2:
        return None
    ahead: np.ndarray = (motion.root[frame + way * (count - 1)] - motion.root[frame]) / (way * (count - 1))
    return ahead


def strays(motion: Seen, begin: int, end: int, sight: int) -> bool:
    """Whether ends of a hole of the whole body that know nothing of each other, for more than a window on
    either side, would not meet."""
    if end - begin > ASTRAY:
        return True
    if end - begin <= sight + 2 * STEP:
        return False
    ways = [velocity(motion, begin - 1, -1), velocity(motion, end, 1)]
    stands = any(way is None or np.linalg.norm(way[::2]) < STANDS for way in ways)
    far = np.linalg.norm((motion.root[end] - motion.root[begin - 1])[::2])
    return stands and bool(far > GOES * (end - begin + 1))


def steps(known: np.ndarray, closed: bool, sight: int) -> tuple[int, int]:
    """How many frames of a hole each window completes, and how many the last one may: half of what the
    network can see where something is known in the hole, else as STEP and MEET say.

    known: (n, 23) or fewer, what is known in the hole; `closed` between known frames.
    """
    if known.any():
        return max(sight // 2, 1), sight
    return STEP, MEET if closed else STEP


def run_long(cards: Sequence[weights.Card], motion: Seen) -> Answer:
    """Run the graphs on a motion of any length, hole by hole.

    A hole is seen with what is around it, as far as the network can see. What a window completes is taken as
    known from then on: of single joints half of what it sees, of the whole pose STEP frames, between known
    frames from both sides in turn, unless it is SURE of all that is left, and more than FIRM frames from
    these to the share GUESSED. What it says of feet and errors it also says of the known frames around; far
    from any hole nothing does (NaN).
    """
    local, root, known = motion.local.copy(), motion.root.copy(), motion.known.astype(float)
    motion, frames = replace(motion, local=local, root=root, known=known), len(root)
    done = Answer(local, root, np.full((frames, len(FEET)), np.nan), np.full(frames, np.nan))
    for begin, end in runs(np.logical_not(motion.known.all(axis=1))):
        _complete_hole(cards, motion, done, begin, end)
    return done


def _complete_hole(cards: Sequence[weights.Card], motion: Seen, done: Answer, begin: int, end: int) -> None:
    """Complete the frames begin to end - 1 of a motion, window by window.

    motion: becomes known there; `done` has its rotations and places, and is told of feet and errors.
    """
    frames, sight = len(motion.root), cards[0].max_gap
    closed = begin > 0 and end < frames
    known = motion.known[begin:end, motion.has]
    whole = not known.any()
    step, last_step = steps(known, closed, sight)
    in_turn, sure = closed and whole, np.ones(frames)
    if whole:
        near, far = begin + FIRM * (begin > 0), end - FIRM * (end < frames)
        sure[near : max(near, far)] = GUESSED
    astray, backwards = in_turn and strays(motion, begin, end, sight), begin == 0 and end < frames
    leads = in_turn and told(motion, begin, end)
    if leads:
        sure[:] = 1.0  # it is said where it goes: it does not come to rest
    fastest = None
    if whole and not closed:
        fastest = steady_pace(motion.root[end:][::-1] if backwards else motion.root[:begin])
    # A body whose hips are known gets nowhere: limbs that hang from it are off by no more and more.
    errors = _Errors(done.expected, closed, not motion.known[begin:end, [0, -1]].all())
    hole = begin, end
    while begin < end:
        first, last = max(begin - CONTEXT, 0), min(end + CONTEXT, frames)
        if end - begin > sight:
            first, last = (end - sight, last) if backwards else (first, begin + sight)
        # The first window that sees all that is left tells the errors of all of it.
        sees_all = end - begin <= sight
        part, ahead = slice(first, last), slice(max(begin - first, 0), end - first)
        inside = slice(begin, end)
        if end - begin > last_step:
            inside = slice(end - step, end) if backwards else slice(begin, begin + step)
        own = slice(inside.start - first, inside.stop - first)
        each = ask(cards, (led(motion, begin, end) if leads else motion).part(part), own)
        said = agreed(each, own)
        if in_turn and sees_all and said.expected[ahead].mean() <= SURE:
            inside, own = slice(begin, end), ahead
            said = agreed(each, own)
        for held_back, new in ((done.stands, said.stands), (done.expected, said.expected)):
            held_back[part] = np.where(np.isnan(held_back[part]), new, held_back[part])
        if closed or not whole:
            errors.tell(said.expected, first, slice(begin, end) if sees_all else inside, backwards, sees_all)
        if whole and not (closed and sees_all):
            errors.open(said.expected[ahead], hole, backwards)
        if astray and not leads and not sees_all:
            said = agreed(ask(cards, led(motion, begin, end).part(part), own), own)
        if fastest is not None:
            beside = motion.root[end : end + BLOCK][::-1] if backwards else motion.root[begin - BLOCK : begin]
            said = at_pace(said, own, beside, fastest, backwards)
        if leads:
            said = replace(said, root=eased(said.root, own, motion, inside))
        _take(motion, inside, said, own, sure[inside])
        done.stands[inside] = said.stands[own]
        begin, end = (begin, inside.start) if backwards else (inside.stop, end)
        backwards = backwards != in_turn


def steady_pace(root: np.ndarray) -> float | None:
    """Metres a frame that hips (T, 3) went at most, in half a second, of the last two; None of who did not go
    steadily all the while."""
    ways = np.linalg.norm((root[BLOCK:] - root[:-BLOCK])[-STEADY:, ::2], axis=1) / BLOCK
    goes = len(ways) == STEADY and ways.min() > max(EVENLY * ways.max(), SLOWEST)
    return float(ways.max()) if goes else None


def at_pace(said: Answer, own: slice, root: np.ndarray, fastest: float, backwards: bool) -> Answer:
    """What is said, slowed in its frames `own` as far as hips go faster there than they did before.

    Each window goes on from what the one before said, a little faster: in three seconds who shuffles would
    run.

    root: (BLOCK, 3) where the hips were before, the last one beside `own`; that is before it, or after where
        it goes `backwards`.
    """
    length = own.stop - own.start
    ahead = np.arange(1.0, length + 1)
    edge, way = (own.stop, -1) if backwards else (own.start - 1, 1)
    far = said.root[edge + way * length] - root[length - BLOCK - 1]
    pace = float(np.linalg.norm(far[::2])) / BLOCK
    if pace <= fastest:
        return said
    at = np.arange(len(said.root), dtype=float)
    at[(edge + way * ahead).astype(int)] = edge + way * max(fastest / pace, LEAST) * ahead
    return replace(
        said,
        local=sample_rotations(said.local, at),
        root=sample(said.root, at),
        stands=sample(said.stands, at),
    )


def _take(motion: Seen, inside: slice, said: Answer, own: slice, sure: np.ndarray) -> None:
    """Take what is said, in its frames `own`, of the frames `inside` of a motion as known, to the shares
    `sure` (n,)."""
    held = motion.known[inside] >= 1
    motion.local[inside] = np.where(held[:, :-1, None], motion.local[inside], said.local[own])
    motion.root[inside] = np.where(held[:, -1:], motion.root[inside], said.root[own])
    motion.known[inside] = np.where(held, 1.0, sure[:, None])


@dataclass
class _Errors:
    """The errors that are expected in a hole. What the frames are off by that a window starts from goes on
    in what it completes, and wears off towards what is known, if both sides are (`closed`).

    Attributes:
        expected: (F,) metres, of the whole motion.
        adds: whether errors add up; else the larger one counts.
        carried: what the frames at both ends of what is left are expected to be off by themselves.
        told: whether all of it has been told.
        sides: what the first window from either side says that does not see the other one.
    """

    expected: np.ndarray
    closed: bool
    adds: bool
    carried: list[float] = field(default_factory=lambda: [0.0, 0.0])
    told: bool = False
    sides: dict[bool, np.ndarray] = field(default_factory=dict)

    def open(self, said: np.ndarray, hole: tuple[int, int], backwards: bool) -> None:
        """Note what the first window says that sees one side of a hole, from there on as far as it sees. What
        is further away is off by as much more: later windows start from what is a guess by then. Between
        two sides the nearer one, in effect, tells."""
        if self.told or backwards in self.sides:
            return
        begin, end = hole
        seen, frames = said[::-1] if backwards else said, np.arange(end - begin)
        wrong = np.concatenate([seen, seen[-1:] * (frames[len(seen) :] + 1) / max(len(seen), 1)])
        self.sides[backwards] = wrong[::-1] if backwards else wrong
        self.told = len(self.sides) == 1 + self.closed
        if self.told:
            self.expected[begin:end] = np.min([*self.sides.values()], axis=0)

    def tell(self, said: np.ndarray, first: int, over: slice, backwards: bool, all_left: bool) -> None:
        """Note what a window from frame `first` on says of the frames `over`, which may be `all_left`; it
        goes on from the beginning of the hole, or `backwards` from its end."""
        if self.told:
            return
        self.told = all_left
        near, far = self.carried if all_left and self.closed else [self.carried[backwards]] * 2
        wearing = np.linspace(near, far, over.stop - over.start)
        own = said[over.start - first : over.stop - first]
        self.expected[over] = own + wearing if self.adds else np.maximum(own, wearing)
        self.carried[backwards] = float(self.expected[over][0 if backwards else -1])
