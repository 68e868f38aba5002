"""What no body does: knees that bend forwards or turn inside out, joints that whirl, bodies that spin.

Networks say rotations, and know of joints only what they have seen: between poses that face away from each
other some let a shin turn round its own axis, or take a wrist the long way round; and as they see no way
round they let the body turn in a few frames.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np

from interpose.clip import Clip
from interpose.finish.leading import led_over
from interpose.finish.span import Span, write
from interpose.finish.windows import rounded
from interpose.geometry import rotations
from interpose.geometry.ground import UP
from interpose.geometry.time import hermite, runs
from interpose.observation import Gap, Observation
from interpose.skeletons import JOINTS, find_humanoid
from interpose.skeletons.carrier import hips_of
from interpose.skeletons.humanoid import Humanoid

# Degrees. Shins turn against thighs about their own axis by up to 60, and bend forwards by none, in 44 clips
# of all data sets.
INSIDE_OUT = 80.0
ROUND = 3.0  # a bend is rounded off by so much
# Degrees by which knees bend backwards in a gap, further than they are seen to, from which on it is said:
# eased into a knee that is stretched at once some go there, and straightened they would jump instead. Of 948
# gaps of CMU's walks and runs nine have one that bends backwards by 2 degrees or more, at most by 15.
BACKWARDS = 5.0
# Degrees a second by which joints turn against the one above, and bodies about the vertical, at most, but for
# what is so many times as fast as they do nearby: in 180 pieces of LAFAN1's validation performer hips turn by
# up to 419, legs and arms by 1,200, where no tracker has lost them (a foot that strikes by 1,900).
WHIRLS, SPINS, OWN = 1500.0, 450.0, 1.5
# The same of those that turn slower than arms: 84,000 frames of LAFAN1's and Bandai-Namco's training and
# validation performers have each joint of three in a spine at 254 at most, necks at 653, heads at 785, collar
# bones at 760, thighs at 1,023, shins at 1,068, toes at 950 (99.99 % at 188, 514, 532, 339, 780, 962, 774).
SLOWER = {"Spine": 280.0, "Spine1": 280.0, "Spine2": 280.0, "Neck": 600.0, "Head": 640.0, "Shoulder": 500.0}
SLOWER |= {"UpLeg": 900.0, "Leg": 1050.0, "Toe": 950.0}
# Seconds on either side of a whirl that a spline takes over, as few as do.
MENDS = (0.1, 0.2, 0.4, 0.8)
ROUNDS = 20  # whirls that are looked after
# Degrees a second about the vertical to which a body is slowed that spins; beside a lone key, where nothing
# tells how fast it turns, from there on. Between 60 pairs of keys of LAFAN1's validation performer, half a
# turn and one to two seconds apart, joints are off by 24.6 cm so, 25.8 as `small` says, and 25.5 with `cmib`.
SLOWLY = 300.0
# Seconds on either side of where it turns fastest, as few as do, over which that is spread.
SPREADS = (0.2, 0.3, 0.4, 0.6, 0.8, 1.2, 1.6, np.inf)
# What quaternions of a joint that does not turn differ by, and the share of joints that do not beyond which
# the whole body stands still.
LOCKED, MOVING = 1e-6, 0.5
LEGS = [(JOINTS.index(side + "UpLeg"), JOINTS.index(side + "Leg")) for side in ("Left", "Right")]


def knees(turned: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Degrees (F, 2) by which shins are twisted against thighs, and by which they bend backwards.

    turned: (F, 22, 4) canonical rotations.
    """
    thighs, shins = (turned[:, list(rows)] for rows in zip(*LEGS))
    bend = rotations.relative(thighs, shins)
    twist = rotations.angle(rotations.twist_about(bend, UP.values), rotations.identity())
    way = rotations.rotate(bend, -UP.values)
    return np.degrees(twist), np.degrees(np.arctan2(-way[..., 2], -way[..., 1]))


def _body(clip: Clip) -> tuple[Humanoid, list[int]] | None:
    """The humanoid, and the joints of its shins, if there are some."""
    body = find_humanoid(clip)
    rows = dict(zip(*body.mapping.mapped))
    if not body.mapping.usable or not all(row in rows for leg in LEGS for row in leg):
        return None
    return body, [rows[shin] for _, shin in LEGS]


def inside_out(opinion: Clip, known: Observation, spans: list[Span], instead: bool) -> None:
    """Say of spans that their motion is no person's where nothing is known and a knee is inside out.

    That is a problem if there is another network `instead`, and else a note: a curve from one end to the
    other is no person's motion either. Nor is anything gained by others of a leg that is lost alone.
    """
    if (found := _body(opinion)) is None:
        return
    body, joints = found
    twist, _ = knees(body.rotations(opinion))
    most = max(INSIDE_OUT, OWN * float(twist[known.rotation[:, joints]].max(initial=0.0)))
    worst = np.where(known.rotation.any(axis=1), 0.0, twist.max(axis=1))
    for span in spans:
        here = worst[span.start : span.stop]
        if here.max() <= most:
            continue
        frame, said = (
            span.start + int(here.argmax()),
            f"a knee turns inside out (by {here.max():.0f} degrees)",
        )
        if instead:
            span.problem = span.problem or said
        else:
            span.notes.append((frame, frame, f"flagged: {said}"))


def straightened(opinion: Clip, known: Observation) -> Clip:
    """A motion with knees that do not bend forwards where they are not observed, unless they do so elsewhere.

    Shins give way; thighs, and how feet lie, stay. Where a shin is twisted more than any is, nothing tells
    which way is forwards.
    """
    if (found := _body(opinion)) is None:
        return opinion
    body, joints = found
    turned = body.rotations(opinion)
    twist, bend = knees(turned)
    free = ~known.rotation[:, joints]
    sure = np.clip((INSIDE_OUT - twist) / (0.5 * INSIDE_OUT), 0.0, 1.0)
    least = np.minimum(np.where(free, 0.0, bend).min(axis=0), 0.0)
    more = np.where(free, sure * rounded(least - bend, ROUND), 0.0)
    if not (more > ROUND).any():
        return opinion
    for column, (_, shin) in enumerate(LEGS):
        thigh = turned[:, LEGS[column][0]]
        back = rotations.multiply(thigh, rotations.about("X", np.radians(more[:, column])))
        inner = rotations.relative(thigh, turned[:, shin])
        turned[:, shin] = rotations.multiply(back, inner)
    done = body.to_clip(turned, body.root(opinion), opinion)
    return opinion.with_motion(
        np.where(known.rotation[..., None], opinion.rotation, done.rotation), opinion.translation
    )


def bent_back(finished: Clip, known: Observation, gap: Gap, first: int) -> list[str]:
    """A note where a knee bends backwards in a gap, further than anywhere in what is known of it; the first
    frame of the clip is called `first`."""
    if (found := _body(finished)) is None:
        return []
    body, joints = found
    bend = knees(body.rotations(finished))[1]
    seen = known.rotation[:, joints]
    least = np.minimum(np.where(seen, bend, 0.0).min(axis=0), 0.0)
    over = np.where(seen, 0.0, least - bend)[gap.start : gap.stop]
    frame, leg = np.unravel_index(over.argmax(), over.shape)
    if over[frame, leg] <= BACKWARDS:
        return []
    degrees, at = -bend[gap.start + frame, leg], first + gap.start + frame
    name = finished.skeleton.names[joints[leg]]
    return [f"flagged: {name} bends backwards by {degrees:.0f} degrees at frame {at}"]


def still(clip: Clip, known: Observation) -> np.ndarray:
    """(J,) True for joints that never turn where they are seen, for a second or longer, while others do.

    Toes of some rigs have never been captured, nor what stands between hips and thighs. Hips that a root
    turns do turn, though never against it.
    """
    still = np.zeros(len(clip.skeleton), bool)
    for joint in np.flatnonzero(known.rotation.sum(axis=0) >= clip.fps):
        seen = clip.rotation[known.rotation[:, joint], joint]
        still[joint] = (np.abs(rotations.alike(seen, seen[:1]) - seen[0]) < LOCKED).all()
    line = [hips_of(clip.skeleton), *clip.skeleton.ancestors(hips_of(clip.skeleton))]
    if not still[line].all():
        still[line] = False
    return still if still.mean() <= MOVING else np.zeros_like(still)


def locked(known: Observation, still: np.ndarray) -> Observation:
    """What is known, and that joints that are `still` (J,) stay as they are, where anything of them is."""
    return replace(known, rotation=known.rotation | (still & known.rotation.any(axis=0)))


def unspun(opinion: Clip, known: Observation) -> Clip:
    """A motion with bodies that take their time to turn where they spin, and nothing is known of the hips.

    Poses are turned about the vertical through the hips, which stay where they are. Ends of a clip are left
    as they are.
    """
    body, fps = find_humanoid(opinion), opinion.fps
    if not body.mapping.usable:
        return opinion
    hips = hips_of(opinion.skeleton)
    seen = np.asarray(known.rotation[:, [hips, *opinion.skeleton.ancestors(hips)]].all(axis=1))
    yaw, both = turning(opinion), seen[1:] & seen[:-1]
    usual = float(np.degrees(np.abs(np.diff(yaw)))[both].max(initial=0.0)) * fps
    most, slow = (np.radians(max(rate, share * usual)) / fps for rate, share in ((SPINS, OWN), (SLOWLY, 1.0)))
    even = yaw.copy()
    for start, stop in runs(~seen):
        if start == 0 or stop == len(yaw):
            continue
        lone = not seen[max(start - 2, 0) : start].sum() == seen[stop : stop + 2].sum() == 2
        # How fast it turns in the known frames beside, where nothing tells not at all.
        ends = (0.0, 0.0) if lone else (yaw[start - 1] - yaw[start - 2], yaw[stop + 1] - yaw[stop])
        part = slice(start - 1, stop + 1)
        # What jumps beside the gap does not go on as the motion did, and is no matter of turning.
        if np.abs(np.diff(yaw[start:stop])).max(initial=0.0) > (slow if lone else most):
            even[part] = _evened(yaw[part], slow, fps, ends)
    moved = np.abs(even - yaw) > 0
    if not moved.any():
        return opinion
    turn = rotations.about("Y", body.hand[0] * (even - yaw))
    done = body.to_clip(
        rotations.multiply(turn[:, None], body.rotations(opinion)), body.root(opinion), opinion
    )
    free = moved[:, None] & ~known.rotation
    return opinion.with_motion(
        np.where(free[..., None], done.rotation, opinion.rotation),
        np.where(moved[:, None, None], done.translation, opinion.translation),
    )


def _evened(yaw: np.ndarray, most: float, fps: float, ends: tuple[float, float]) -> np.ndarray:
    """Radians (n,) that change by no more than `most` from frame to frame, as far as the ends, which stay,
    allow: cubics of Hermite lead over where they do. `ends`: radians a frame before the first and after the
    last one."""
    even, last = yaw.copy(), len(yaw) - 1
    for _ in range(ROUNDS):
        rate = np.concatenate([ends[:1], np.diff(even), ends[1:]])
        fastest = int(np.abs(rate[1:-1]).argmax())
        before = abs(rate[1 + fastest])
        if before <= most:
            break
        for seconds in SPREADS:
            half = round(min(seconds * fps, last))
            a, b = max(0, fastest - half), min(last, fastest + 1 + half)
            y, other, v, w = np.array([even[a], even[b], rate[a], rate[b + 1]])[:, None]
            led = hermite(y, other, v, w, np.arange(b - a + 1.0), np.array(float(b - a)))[:, 0]
            if np.abs(np.diff(led)).max() <= most:
                break
        if np.abs(np.diff(led)).max() >= before:
            break  # there is no time for it
        even[a : b + 1] = led
    return even


@dataclass(frozen=True)
class Whirl:
    """A joint that turns faster than any does: its index, the frame, degrees a second, and what is usual."""

    joint: int
    frame: int
    rate: float
    usual: float


def whirl(clip: Clip, known: Observation, start: int, stop: int, but: Collection[int] = ()) -> Whirl | None:
    """The joint that whirls most in frames start to stop - 1, by what joints do at most; None if none does.

    A joint turns against its parent, the hips and what carries them against the world. Some joints (`but`)
    may whirl.
    """
    hips = hips_of(clip.skeleton)
    carriers = [hips, *clip.skeleton.ancestors(hips)]
    turned = clip.rotation.copy()
    turned[:, carriers] = clip.kinematics()[0][:, carriers]
    rate = np.degrees(rotations.angle(turned[1:], turned[:-1])) * clip.fps
    seen = known.rotation.copy()
    seen[:, carriers] = known.rotation[:, carriers].all(axis=1, keepdims=True)
    both = seen[1:] & seen[:-1]
    usual = np.where(both, rate, 0.0).max(axis=0, initial=0.0)
    most = np.full(rate.shape, WHIRLS)
    mapped = dict(zip(*find_humanoid(clip).mapping.mapped))
    spine = [row for row in mapped if JOINTS[row].startswith("Spine")]
    # Not beside what is seen: where a method does not arrive there, a spline would only hide it.
    inside = ~(seen[1:] | seen[:-1])
    for row, joint in mapped.items():
        # What three joints of a spine do one may have to do alone.
        share = 3 / len(spine) if row in spine else 1.0
        slower = SLOWER.get(JOINTS[row].removeprefix("Left").removeprefix("Right"), WHIRLS) * share
        most[inside[:, joint], joint] = slower
    most[:, carriers] = SPINS
    steps = slice(max(start - 1, 0), stop)
    over = np.where(both, 0.0, rate / np.maximum(most, OWN * usual))[steps]
    over[:, list(but)] = 0.0
    if not over.size or over.max() <= 1:
        return None
    row, joint = (int(i) for i in np.unravel_index(int(over.argmax()), over.shape))
    return Whirl(joint, steps.start + row + 1, float(rate[steps][row, joint]), float(usual[joint]))


def unwhirl(current: Clip, known: Observation, span: Span) -> None:
    """Let a spline lead joints over frames of a span in which they whirl; not those that carry the body."""
    lo, hi, (start, stop) = span.around(len(current), round(MENDS[-1] * current.fps))
    led, seen = current.slice(lo, hi), known.slice(lo, hi)
    fixed = {(hips := hips_of(current.skeleton)), *current.skeleton.ancestors(hips)}
    stuck: set[int] = set()
    for _ in range(ROUNDS):
        found = whirl(led, seen, start, stop, fixed | stuck)
        if found is None:
            break

        def off(done: Clip, *_: int, found: Whirl = found) -> float:
            again = whirl(done, seen, start, stop, fixed | stuck)
            return 2.0 * (again is not None and again.joint == found.joint and not _milder(again, found))

        better = led_over(led, seen, (start, stop), (found.frame,) * 2, MENDS, off, [found.joint])
        if better is None or better.off > 1:
            stuck.add(found.joint)
        else:
            led = better.clip
    write(current, led, span.start, (start, stop))


def _milder(one: Whirl, other: Whirl) -> bool:
    """Whether a joint whirls elsewhere than before, and no faster."""
    return one.frame != other.frame and one.rate <= other.rate


def turning(clip: Clip) -> np.ndarray:
    """(F,) radians about the vertical by which the hips have turned since the first frame, to the left."""
    turned = clip.kinematics()[0][:, hips_of(clip.skeleton)]
    steps = rotations.twist_about(rotations.multiply(turned[1:], rotations.conjugate(turned[:-1])), UP.values)
    return np.concatenate([[0.0], np.cumsum(rotations.log(steps)[:, 1])])
