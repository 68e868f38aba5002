"""Planted feet stay planted: find contacts in a gap, hold them, bend the legs accordingly.

Everything is relative to the stances that are observed near the gap, so that floors need not be flat. A foot
is its ankle and its toe; a contact of either holds that one in place on the floor.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from interpose.clip import Clip, Skeleton
from interpose.finish.swings import lifts
from interpose.finish.windows import envelope, ramp, rounded, spread
from interpose.geometry import measures, rotations
from interpose.geometry.time import runs
from interpose.observation import Observation
from interpose.skeletons import find_mapping
from interpose.skeletons.carrier import place_of

# A contact is slower than the first speed (metres a second) somewhere and nowhere faster than the second; it
# is no higher above the floor than HIGH and lasts at least SHORT seconds. What moves further than STEP in it
# is no stance that slides but a low step. The speeds are those of networks, whose stances slide; stances of
# real feet are ten times slower. Chosen on validation performers, by error, slide and travel of the feet.
SLOW, FAST, HIGH, SHORT, STEP = 0.50, 1.00, 0.05, 0.10, 0.50
# An observed stance is slower than this (metres a second), and no higher than this above the lowest one.
STILL, LEVEL = 0.30, 0.08
# Seconds over which a correction comes and goes outside of a contact, and vanishes towards a seam: firm, and
# softer ones for feet that would be torn into place.
BLENDS = (0.15, 0.25, 0.40)
# Metres that a foot may sink below the lowest stances nearby (the bound is rounded off over as much), and by
# which it clears the floor once it is twice as fast as QUICK (metres a second). A method that knows when feet
# stand also knows how high they go: lifted as far as others' they slide a third less than people's do; so, in
# gaps of 15, 30 and 60 frames of LAFAN1's validation performer, by 5.4, 5.1 and 6.1 cm/s (truth 5.7, 6.1 and
# 6.3), with .02 by 6.5, 6.5 and 7.6. Joints are off by the same.
OTHERS, KNOWING = (0.005, 0.03), (0.01, 0.025)
QUICK = 0.50
# A contact that the method takes for less likely than this is none; one that it takes for as likely as the
# second stands at a lone key, too, which does not tell itself how fast anything is.
LIKELY, SURE = 0.5, 0.8
# Metres a second by which holding may speed a foot up between two contacts.
LEAP = 1.5
# Metres a second at which a shift comes and goes, at most, in the mean. In 411 fills of validation performers
# the largest jerk of the feet is 785 m/s^3 so, and 820 where all shifts come in the same time (people's own:
# 1,105); feet slide by as much.
RUSH = 0.6
# Metres along the floor by which holding may take ankle and toe of a foot apart, or together.
APART = 0.10
# The share of its length at which a leg begins to be straight.
TAUT = 0.97
# Radians by which a leg that pushes off lifts its heel, at most, instead of straightening by more than such a
# share of its length; half of it where the hips are above the toe, all once they are half of so many metres
# beyond. Feet drifted by more than 8 cm in a stance in 18 of 150 gaps of 2 and 3 s, between known motion or
# lone keys (`bench artefacts --most 25`); so they did in 8, and joints were off by the same.
HEEL, STRAIGHTER, BEYOND = np.radians(40.0), 0.01, 0.10
# Radians by which holding may turn a foot: from the first on it lets go, at twice as much it has. Ankle and
# toe of one that swivels are led past each other.
SWIVEL = np.radians(30.0)
# Metres by which a foot may be under what it rests on.
STEP_UP = 0.02
# Metres by which a foot that stands on both sides of a gap may be higher or lower in between, and stands
# nevertheless: toes of people of Bandai-Namco who stand all the while sank by more than 4 mm in 18 of 45 gaps
# of one and two seconds, and in truth in none; so they do in none.
SAGS = 0.02
# Seconds of observed motion beside a gap in which stances are looked for.
NEARBY = 2.0


@dataclass(frozen=True)
class Leg:
    """Joint indices of one leg."""

    thigh: int
    knee: int
    ankle: int
    toe: int | None
    side: int = 0  # 0 for the left one, 1 for the right one

    @property
    def foot(self) -> list[int]:
        """Ankle and toe; where there is no toe the ankle stands for both."""
        return [self.ankle, self.ankle if self.toe is None else self.toe]


def legs(skeleton: Skeleton) -> tuple[Leg, ...]:
    """The legs that the skeleton has; none when they are not found."""
    mapping = find_mapping(skeleton)
    found = []
    for number, side in enumerate(("Left", "Right")):
        thigh, knee, ankle, toe = (mapping[side + part] for part in ("UpLeg", "Leg", "Foot", "Toe"))
        if thigh is None or knee is None or ankle is None:
            continue
        chain = [joint for joint in (thigh, knee, ankle, toe) if joint is not None]
        bones = np.linalg.norm(skeleton.rest_translation[[knee, ankle]], axis=1)
        if bones.min() > 1e-6 and all(a in skeleton.ancestors(b) for a, b in zip(chain, chain[1:])):
            found.append(Leg(thigh, knee, ankle, toe, number))
    return tuple(found)


def ends(skeleton: Skeleton) -> list[int]:
    """Ankles and toes: the joints by which slide and travel are judged."""
    return [joint for leg in legs(skeleton) for joint in dict.fromkeys(leg.foot)]


def size(skeleton: Skeleton) -> float:
    """How large a body is, 1 for the one for which the lengths and speeds above were chosen."""
    return find_mapping(skeleton).size


def pairs(skeleton: Skeleton) -> np.ndarray:
    """(L, 2) ankle and toe of each leg that the skeleton has."""
    return np.array([leg.foot for leg in legs(skeleton)], int).reshape(-1, 2)


def told(clip: Clip, known: Observation, start: int, stop: int) -> bool:
    """Whether it is known where all feet are in frames start to stop - 1, or there are none: what they do
    there is nobody's but the clip's own."""
    joints = pairs(clip.skeleton)
    return bool(known.slice(start, stop).positions(clip.skeleton)[:, joints.ravel()].all())


def untold(clip: Clip, known: Observation, start: int, stop: int) -> bool:
    """Whether nothing is known of legs, nor of where the body is, in frames start to stop - 1."""
    chains = [joint for leg in legs(clip.skeleton) for joint in (leg.thigh, leg.knee, leg.ankle)]
    placed = known.slice(start, stop).positions(clip.skeleton)
    return not (known.rotation[start:stop, [place_of(clip), *chains]].any() or placed.any())


def local_floor(feet: np.ndarray, known: np.ndarray, fps: float) -> np.ndarray:
    """(F, L, 2) the height at which each ankle and toe rests, or would: of observed stances beside a gap.

    On each side of a gap the low end of the heights of the joint while it is slow, within two seconds. One
    that is always on its way there rests where the same joint of another foot does, or, when none of them
    stands, where the lowest of them is: what is known may be a single pose with a foot in the air. Where the
    sides differ by more than LEVEL, there is a step between them: a joint rests on the upper one where it is
    no more than STEP_UP below it.

    Args:
        feet: (F, L, 2, 3) ankles and toes of L legs.
        known: (F, L, 2) where they are observed.
    """
    floor = np.empty(feet.shape[:3])
    slow = measures.speed(feet, fps) < STILL
    near = max(1, round(NEARBY * fps))
    for leg, end in np.ndindex(feet.shape[1:3]):
        found = runs(known[:, leg, end])
        sides = [(start, start, min(stop, start + near)) for start, stop in found]
        sides += [(stop - 1, max(start, stop - near), stop) for start, stop in found]
        at, *parts = np.array(sorted(sides), int).reshape(-1, 3).T
        heights, seen, still = (some[:, :, end] for some in (feet[..., 1], known, slow))
        rests = _rests(heights, seen, still & seen, leg, *parts)
        floor[:, leg, end] = _below(feet[:, leg, end, 1], at, rests)
    # What is never observed rests where the same joint of another foot does.
    told = np.asarray(known.any(axis=0))
    for leg, end in np.ndindex(told.shape):
        if told[:, end].any() and not told[leg, end]:
            floor[:, leg, end] = floor[:, int(np.argmax(told[:, end])), end]
    return floor


def _below(heights: np.ndarray, at: np.ndarray, rests: np.ndarray) -> np.ndarray:
    """(F,) on what a joint at `heights` (F,) rests, by where it rests, `rests` (n,), in frames `at` (n,)."""
    if not at.size:
        return np.full(len(heights), np.percentile(heights, 5))
    frames = np.arange(len(heights))
    before = rests[np.clip(np.searchsorted(at, frames, "right") - 1, 0, len(at) - 1)]
    after = rests[np.clip(np.searchsorted(at, frames), 0, len(at) - 1)]
    upper, lower = np.maximum(before, after), np.minimum(before, after)
    step = np.where(upper <= heights + STEP_UP, upper, lower)
    return np.where(upper - lower > LEVEL, step, np.interp(frames, at, rests))


def sunk(clip: Clip, known: Observation, start: int, stop: int) -> tuple[float, int, int] | None:
    """How far below the floor the deepest ankle or toe is that is not observed, in metres beyond those that
    are; which joint, and at which of the frames start to stop - 1. None without any.

    The floor is no higher than the lowest joint that is observed: on hands feet tell nothing of it.
    """
    joints = pairs(clip.skeleton)
    observed = known.positions(clip.skeleton)
    if not joints.size or not observed.any():
        return None
    positions, grown = clip.positions(), size(clip.skeleton)
    feet, seen = positions[:, joints], observed[:, joints]
    floor = np.minimum(grown * local_floor(feet / grown, seen, clip.fps), positions[observed, 1].min())
    depth = floor - feet[..., 1]
    usual = float(depth[seen].max(initial=0.0))
    free = np.where(seen, -np.inf, depth)[start:stop]
    if not np.isfinite(free).any():
        return None
    frame, leg, end = np.unravel_index(int(free.argmax()), free.shape)
    return float(free[frame, leg, end]) - usual, int(joints[leg, end]), start + int(frame)


def _rests(
    heights: np.ndarray, seen: np.ndarray, still: np.ndarray, leg: int, start: np.ndarray, stop: np.ndarray
) -> np.ndarray:
    """(n,) where a leg's joint rests in the frames start to stop - 1, both (n,): by heights (F, L) of it and
    its like in other legs, where they are seen, and where they are still, all (F, L)."""
    if not start.size:
        return np.empty(0)
    lengths = stop - start
    first = np.cumsum(lengths) - lengths
    part = np.repeat(np.arange(len(lengths)), lengths)
    frames = np.arange(len(part)) - first[part] + start[part]
    high = heights[frames]
    lowest = np.minimum.reduceat(np.where(seen[frames], high, np.inf), first)
    resting = still[frames] & (high < lowest[part] + LEVEL)
    own = _tenths(high[:, leg], part, resting[:, leg], len(lengths))
    legs = heights.shape[1]
    other = _tenths(high.reshape(-1), np.repeat(part, legs), resting.reshape(-1), len(lengths))
    other = np.where(np.isnan(other), lowest.min(axis=1), other)
    return np.where(np.isnan(own), np.minimum(other, lowest[:, leg]), own)


def _tenths(values: np.ndarray, part: np.ndarray, chosen: np.ndarray, parts: int) -> np.ndarray:
    """(parts,) the 10th percentile of those of the values (m,) that are chosen (m,), by the part (m,) that
    they are of; NaN where none is. NumPy's takes a hundred times as long for few values."""
    values, part = values[chosen], part[chosen]
    ordered, counts = values[np.lexsort((values, part))], np.bincount(part, minlength=parts)
    at, first = 0.1 * np.maximum(counts - 1, 0), np.cumsum(counts) - counts
    before = first + at.astype(int)
    ends = np.append(ordered, np.nan)
    low, high = (ends[np.minimum(row, first + np.maximum(counts, 1) - 1)] for row in (before, before + 1))
    return np.where(counts > 0, low + (at - at.astype(int)) * (high - low), np.nan)


def contacts(positions: np.ndarray, floor: np.ndarray, fps: float, step: float = STEP) -> np.ndarray:
    """(F, n) True while an ankle or toe (F, n, 3) is planted: slow (with hysteresis), low, not too short."""
    speeds = measures.speed(positions, fps)
    low = positions[..., 1] < floor + HIGH
    possible, certain = low & (speeds < FAST), low & (speeds < SLOW)
    planted = np.zeros_like(low)
    for joint in range(low.shape[1]):
        for start, stop in runs(possible[:, joint]):
            stances = [(start + a, start + b) for a, b in runs(certain[start:stop, joint])]
            # Of what moves too far in all, what is slower may be a stance between two low steps.
            if stances and _gets(positions[start:stop, joint]) < step:
                stances = [(start, stop)]
            for first, last in stances:
                if last - first >= SHORT * fps and _gets(positions[first:last, joint]) < step:
                    planted[first:last, joint] = True
    return planted


def _lasting(planted: np.ndarray, fps: float) -> np.ndarray:
    """Contacts (F, n) without those that are too short."""
    lasting = np.zeros_like(planted)
    for joint in range(planted.shape[1]):
        for start, stop in runs(planted[:, joint]):
            lasting[start:stop, joint] = stop - start >= SHORT * fps
    return lasting


def _gets(positions: np.ndarray) -> float:
    """Metres along the floor that a joint (F, 3) gets away from where it is at first."""
    return float(np.linalg.norm((positions - positions[0])[:, [0, 2]], axis=1).max())


def measure(clip: Clip, known: Observation, start: int, stop: int) -> tuple[float, float] | None:
    """Slide (centimetres a second) and travel (metres) of the feet from the frame before start to stop.

    The floor is that of the stances observed in the clip: some seconds around the range are enough. None for
    skeletons whose feet are not known by name.
    """
    return next(iter(measure_all(clip, known, [(start, stop)])), None)


def measure_all(clip: Clip, known: Observation, ranges: list[tuple[int, int]]) -> list[tuple[float, float]]:
    """`measure` for several ranges (start, stop) at once; an empty list where there are no feet."""
    joints = pairs(clip.skeleton)
    if not joints.size:
        return []
    # Seen as those of a body of usual size.
    grown = size(clip.skeleton)
    feet = clip.positions()[:, joints] / grown
    floor = local_floor(feet, known.positions(clip.skeleton)[:, joints], clip.fps)
    parts = [slice(max(start - 1, 0), stop + 1) for start, stop in ranges]
    slides = [grown * measures.foot_slide(feet[part], clip.fps, floor[part]) for part in parts]
    return list(zip(slides, [grown * measures.foot_travel(feet[part]) for part in parts]))


def drifts(
    clip: Clip, known: Observation, ranges: list[tuple[int, int]]
) -> list[tuple[float, int, int, int]]:
    """The furthest that a foot gets in one stance within the frames start to stop - 1 of each range, in
    metres; the joint, and the frames of it. An empty list for skeletons whose feet are not known by name; see
    `measures.stance_drift`."""
    joints = pairs(clip.skeleton)
    if not joints.size:
        return []
    feet, grown = clip.positions()[:, joints], size(clip.skeleton)
    floor = local_floor(feet / grown, known.positions(clip.skeleton)[:, joints], clip.fps)
    feet, floor = (feet / grown).reshape(len(clip), -1, 3), floor.reshape(len(clip), -1)
    found = []
    for start, stop in ranges:
        way, joint, first, last = measures.stance_drift(feet[start:stop], clip.fps, floor[start:stop])
        found.append((grown * way, int(joints.ravel()[joint]), start + first, start + last))
    return found


def plant(
    clip: Clip,
    known: Observation,
    span: tuple[int, int],
    blend: float = BLENDS[0],
    stands: np.ndarray | None = None,
    step: float = STEP,
    lift: bool = True,
    only: int | None = None,
) -> Clip:
    """Hold the feet during contacts in the span, and keep them above the floor.

    Only unobserved rotations of a leg move: where any of thigh, knee or ankle is observed, the leg is left
    alone, and towards such frames the correction fades out. Bones never stretch.

    Args:
        clip, known: the motion, and what of it is observed.
        span: the frames start to stop - 1 in which anything may move.
        blend: seconds over which a correction comes and goes.
        stands: (F, 4) how likely left ankle and toe, right ankle and toe stand, 0 to 1, by the method that
            made the motion: a foot is held where it is slow and low, unless this says that it does not stand.
            NaN, and None, where it says nothing.
        step: metres of a body of usual size; what moves further while it is slow and low is a step, and no
            stance.
        lift: whether feet are kept above the floor, and clear of it while they are quick; else they are held
            along it alone, and stay as high as they are.
        only: the number of the leg in `legs` whose foot is held; else all are.
    """
    skeleton, over = clip.skeleton, max(2.0, blend * clip.fps)
    start, stop = span
    chains = [[leg.thigh, leg.knee, leg.ankle] for leg in legs(skeleton)]
    free = [np.asarray((~known.rotation[:, chain]).all(axis=1)) for chain in chains]
    if not any(f[start:stop].any() for f in free):
        return clip
    sink, clear = OTHERS if stands is None else KNOWING
    rotation = clip.rotation.copy()
    turned, placed = clip.kinematics()
    joints, grown = pairs(skeleton), size(skeleton)
    # Seen as those of a body of usual size.
    both = placed[:, joints] / grown
    floors = local_floor(both, known.positions(skeleton)[:, joints], clip.fps)
    inside = np.zeros(len(clip), bool)
    inside[start:stop] = True
    for number, (leg, movable) in enumerate(zip(legs(skeleton), free)):
        movable = np.logical_and(movable, inside)
        if not movable.any() or only not in (None, number):
            continue
        feet, floor = both[:, number], floors[:, number]
        planted, still = contacts(feet, floor, clip.fps, step), measures.speed(feet, clip.fps) < STILL
        if stands is not None:
            said = stands[:, 2 * leg.side : 2 * leg.side + 2]
            planted = _lasting(planted & ~(said < LIKELY), clip.fps)
            still |= _lone(known.positions(skeleton)[:, leg.foot]) & (_beside(said) > SURE)
        shift = _hold(feet, planted, still, movable, clip.fps, over) * [1.0, float(lift), 1.0]
        shift[:, 0] += _heel_up(leg, placed / grown, shift)
        shift *= _let_go(leg, placed / grown, shift, over)[:, None, None]
        if lift:
            speeds = measures.speed(feet + shift, clip.fps)
            lowest = floor - sink + clear * ramp(speeds / QUICK - 1)
            raised = spread(rounded((lowest - (feet + shift)[..., 1]).max(axis=1), sink), over)
            shift[..., 1] += (raised * np.prod(envelope(movable, over), axis=0))[:, None]
            seen = np.asarray(known.positions(skeleton)[:, leg.foot].all(axis=1))
            shift[..., 1] += lifts(feet + shift, floor, planted, seen, movable)[:, None]
        moved = np.flatnonzero(np.abs(shift).max(axis=(1, 2)) > 1e-9)
        if moved.size:
            rotation[moved] = reach(
                skeleton, leg, rotation[moved], turned[moved], placed[moved], grown * (feet + shift)[moved]
            )
    return clip.with_motion(rotation, clip.translation)


def _lone(seen: np.ndarray) -> np.ndarray:
    """(F, n) what is seen (F, n) in no frame beside."""
    beside = np.pad(seen, ((1, 1), (0, 0)))
    return seen & ~beside[:-2] & ~beside[2:]


def _beside(said: np.ndarray) -> np.ndarray:
    """(F, n) the larger of what is said (F, n) in the frames before and after; NaN where nothing is."""
    padded = np.pad(said, ((1, 1), (0, 0)), constant_values=np.nan)
    return np.asarray(np.fmax(padded[:-2], padded[2:]))


def _hold(
    feet: np.ndarray, planted: np.ndarray, still: np.ndarray, movable: np.ndarray, fps: float, over: float
) -> np.ndarray:
    """(F, 2, 3) shifts of ankle and toe that hold each of them during its contacts: along the floor, and as
    high as it is beside the gap where it stands all the while.

    feet: (F, 2, 3); planted, still: (F, 2); over: frames in which a shift comes and goes. A contact that is
    still in observed frames is tied to where it is at the seam (between the two places, when it is so at both
    ends), any other one is held at its mean. Outside of a contact a shift fades, and towards seams to which
    it is not tied; where only one of the two joints is held, the other moves with it.
    """
    frames = len(feet)
    blend = max(2, round(over))
    time = np.arange(frames)
    both: list[list[Contact]] = []
    for joint in range(2):
        held: list[Contact] = []
        for start, stop in runs(planted[:, joint]):
            inside = np.flatnonzero(movable[start:stop]) + start
            if not inside.size:
                continue
            first, last = inside[0], inside[-1]
            # What still moves, or moves already, at the seam is held as far from it as any other contact.
            before = feet[first - 1, joint] if first > start and still[first - 1, joint] else None
            after = feet[last + 1, joint] if last < stop - 1 and still[last + 1, joint] else None
            if before is None and after is None:
                anchor = np.broadcast_to(feet[inside, joint].mean(axis=0), (frames, 3))
            else:
                ends = (before if before is not None else after, after if after is not None else before)
                share = ramp((time - first + 1) / (last - first + 2))[:, None]
                anchor = (1 - share) * ends[0] + share * ends[1]
            tied = (before is not None, after is not None)
            held.append(Contact(start, stop, first, last, anchor - feet[:, joint], tied))
        both.append(_apart(held, fps))
    shifts, shares = np.zeros((frames, 2, 3)), np.zeros((frames, 2))
    for joint, held in enumerate(_in_one(both)):
        for k, one in enumerate(held):
            # No further than half way to the neighbouring contacts, so that their shifts do not add up.
            left = min(blend, (one.start - held[k - 1].stop) // 2 + 1) if k else blend
            right = min(blend, (held[k + 1].start - one.stop) // 2 + 1) if k + 1 < len(held) else blend
            share = one.share(movable, fps, over, (left, right))
            off = one.off[np.clip(time, one.start, one.stop - 1)]
            # Who stands all the while neither sinks nor rises.
            level = all(one.tied) and np.abs(one.off[one.start : one.stop, 1]).max() < SAGS
            shifts[:, joint] += share[:, None] * off * [1.0, float(level), 1.0]
            shares[:, joint] = np.maximum(shares[:, joint], share)
    return shifts + (1 - shares)[..., None] * shifts[:, ::-1]


@dataclass(frozen=True, eq=False)
class Contact:
    """One joint stands.

    Attributes:
        start, stop: the frames, start to stop - 1.
        first, last: those of them that may move.
        off: (F, 3) metres from the joint to where it is held.
        tied: whether it stands in observed frames before and after.
    """

    start: int
    stop: int
    first: int
    last: int
    off: np.ndarray
    tied: tuple[bool, bool]

    def share(self, movable: np.ndarray, fps: float, over: float, beside: tuple[int, int]) -> np.ndarray:
        """(F,) how much of the shift there is: it comes and goes in frames `beside` the contact, and reaches
        within `over` frames, with nothing left of it, a seam to which the contact is not tied.

        A long way takes longer: within the contact, and further from the seam.
        """
        frames = np.arange(len(movable))
        share = movable.astype(float)
        for tied, at, seam, since, room in zip(
            self.tied,
            (self.first, self.last),
            (0, 1),
            (frames - self.start, self.stop - 1 - frames),
            beside,
        ):
            if tied:
                share *= ramp(1 + since / (room + 1))
                continue
            need = float(np.linalg.norm(self.off[at, [0, 2]])) * fps / RUSH
            late = min(max(np.ceil(need) - room, 0), (self.stop - self.start) // 2)
            comes = ramp(1 + (since - late) / (room + late + 1))
            share *= np.minimum(comes, envelope(movable, max(over, need))[seam])
        return share


def _apart(held: list[Contact], fps: float) -> list[Contact]:
    """The contacts of a joint without those beside which it would have to leap: of two that follow each other
    at once, and are held in places far apart, the tied one stays, or else the longer one."""
    kept: list[Contact] = []
    for one in held:
        while kept:
            last = kept[-1]
            off = last.off[last.stop - 1] - one.off[one.start]
            if np.linalg.norm(off[[0, 2]]) * fps <= LEAP * (one.start - last.stop + 1):
                kept.append(one)
                break
            longer = last.stop - last.start >= one.stop - one.start
            if any(last.tied) or (longer and not any(one.tied)):
                break
            kept.pop()
        else:
            kept.append(one)
    return kept


def _in_one(both: list[list[Contact]]) -> list[list[Contact]]:
    """The contacts of ankle and toe without those that would take the two apart, as one of them slides while
    the other is held where it was: of two at once the tied one stays, or else the longer one."""
    kept = [[*held] for held in both]
    for pair in itertools.product(*both):
        ankle, toe = pair
        part = slice(max(ankle.start, toe.start), min(ankle.stop, toe.stop))
        if ankle not in kept[0] or toe not in kept[1] or part.start >= part.stop:
            continue
        if np.linalg.norm((ankle.off - toe.off)[part][:, [0, 2]], axis=1).max() > APART:
            firm = [(sum(one.tied), one.stop - one.start) for one in pair]
            looser = int(firm[1] <= firm[0])
            kept[looser].remove(pair[looser])
    return kept


def _heel_up(leg: Leg, placed: np.ndarray, shift: np.ndarray) -> np.ndarray:
    """(F, 3) by how much further than by shifts (F, 2, 3) the ankle of a leg that pushes off goes, so that
    its knee need not straighten for the toe to stay where it stands: the foot turns about the toe, heel up.

    placed: (F, J, 3).
    """
    hip, knee, ankle = (placed[:, joint] for joint in (leg.thigh, leg.knee, leg.ankle))
    if leg.toe is None:
        return np.zeros_like(hip)
    length = np.linalg.norm(knee - hip, axis=-1) + np.linalg.norm(ankle - knee, axis=-1)
    toe, goal = placed[:, leg.toe] + shift[:, 1], ankle + shift[:, 0]
    own, asked = (np.linalg.norm(some - hip, axis=-1) / length for some in (ankle, goal))
    foot, up = goal - toe, hip - toe
    # Only of a body that has gone on beyond its toe: at the other end of a step feet land on their heels.
    ahead = -foot[:, [0, 2]]
    ahead = ahead / np.maximum(np.linalg.norm(ahead, axis=1, keepdims=True), 1e-9)
    pushes = ramp((up[:, [0, 2]] * ahead).sum(axis=1) / BEYOND + 0.5)
    more = np.maximum(asked - own, 0.0)
    wanted = length * (asked - pushes * more**2 / (more + STRAIGHTER))
    # The angle at the toe between foot and hip with which they are so far apart.
    far, long = (np.linalg.norm(some, axis=1) for some in (up, foot))
    turn = rotations.log(rotations.between(foot, up))
    now = np.linalg.norm(turn, axis=1)
    cosine = (far**2 + long**2 - wanted**2) / np.maximum(2 * far * long, 1e-9)
    less = np.clip(now - np.arccos(np.clip(cosine, -1.0, 1.0)), 0.0, HEEL)
    return rotations.rotate(rotations.exp(turn * (less / np.maximum(now, 1e-9))[:, None]), foot) - foot


def _let_go(leg: Leg, placed: np.ndarray, shift: np.ndarray, over: float) -> np.ndarray:
    """(F,) the share of shifts (F, 2, 3) of ankle and toe that a leg follows: less where it would have to be
    straight for it, before which a foot lets go, or where its foot would turn far. Held until then, its knee
    would snap when the foot leaves, or the foot go round at once.

    placed: (F, J, 3); over: frames over which it lets go.
    """
    hip, knee, ankle = (placed[:, joint] for joint in (leg.thigh, leg.knee, leg.ankle))
    length = np.linalg.norm(knee - hip, axis=-1) + np.linalg.norm(ankle - knee, axis=-1)
    own, asked = (np.linalg.norm(some - hip, axis=-1) / length for some in (ankle, ankle + shift[:, 0]))
    taut = ramp((asked - np.maximum(own, TAUT)) / (1 - TAUT))
    foot = (placed[:, leg.foot[1]] - ankle)[:, [0, 2]]
    held = foot + (shift[:, 1] - shift[:, 0])[:, [0, 2]]
    across = foot[:, 0] * held[:, 1] - foot[:, 1] * held[:, 0]
    turned = ramp(np.abs(np.arctan2(across, (foot * held).sum(axis=-1))) / SWIVEL - 1)
    return np.asarray(1.0 - np.minimum(spread(np.maximum(taut, turned), over), 1.0))


def reach(
    skeleton: Skeleton,
    leg: Leg,
    rotation: np.ndarray,
    turned: np.ndarray,
    placed: np.ndarray,
    goal: np.ndarray,
) -> np.ndarray:
    """Local rotations (F, J, 4) by which ankle and toe reach `goal` (F, 2, 3) as far as the leg is long.

    Two bones: the knee bends or straightens in its own plane until hip and ankle are as far apart as they
    should be, the thigh turns the ankle there by the shortest way, and the foot keeps its direction or turns
    its toe to its goal.
    """
    hip, knee, ankle, toe = (placed[:, j] for j in (leg.thigh, leg.knee, *leg.foot))
    thigh, shin = knee - hip, ankle - knee
    a, b = (np.linalg.norm(v, axis=-1) for v in (thigh, shin))
    now = np.linalg.norm(ankle - hip, axis=-1)
    wanted = np.linalg.norm(goal[:, 0] - hip, axis=-1)
    # Close to full length the knee is slowed down; a leg that already is as straight may stay so.
    distance = np.clip(now + _soft(wanted, a + b) - _soft(now, a + b), np.abs(a - b) + 1e-4, a + b)
    # The knee's axis; a straight one has none of its own and takes the one across thigh and foot.
    axis = rotations.cross(thigh, shin) / (a * b)[:, None]
    axis = rotations.normalize(axis + 0.05 * rotations.normalize(rotations.cross(toe - ankle, thigh)))

    def corner(left: np.ndarray, right: np.ndarray, across: np.ndarray) -> np.ndarray:
        cosine = (left**2 + right**2 - across**2) / (2 * left * right)
        return np.arccos(np.clip(cosine, -1.0, 1.0))

    at_hip = corner(a, distance, b) - corner(a, now, b)
    at_knee = corner(a, b, now) - corner(a, b, distance)
    of_thigh = rotations.exp(-at_hip[:, None] * axis)
    of_shin = rotations.exp((at_knee - at_hip)[:, None] * axis)
    bent = rotations.rotate(of_thigh, thigh) + rotations.rotate(of_shin, shin)
    swing = rotations.between(bent, goal[:, 0] - hip)
    of_thigh, of_shin = rotations.multiply(swing, of_thigh), rotations.multiply(swing, of_shin)
    # The direction of the foot only: what the ankle falls short of, the toe falls short of, too.
    of_foot = rotations.between(toe - ankle, goal[:, 1] - goal[:, 0])

    done = rotation.copy()
    change = {leg.thigh: of_thigh, leg.knee: of_shin, leg.ankle: of_foot}
    above = rotations.identity(len(rotation), like=rotation)
    for joint, turn in change.items():
        # In the world the joint turns by `turn` and its parent by `above`: the rest is its own.
        parent = rotations.multiply(above, turned[:, skeleton.parents[joint]])
        turn_here = rotations.multiply(turn, turned[:, joint])
        done[:, joint] = rotations.normalize(rotations.relative(parent, turn_here))
        above = turn
    return done


def _soft(distance: np.ndarray, length: np.ndarray) -> np.ndarray:
    """The distance, slowed down over the last 3 % of the leg's length, which it never passes."""
    start = 0.97 * length
    over = np.maximum(distance - start, 0.0)
    room = length - start
    return np.minimum(distance, start) + room * (1.0 - np.exp(-over / room))
