"""Finding single values that a tracker lost: joints that snap to their rest pose, spikes, and what is away
for a while, as arms that were taken for each other."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from scipy import ndimage

from interpose.clip import Clip
from interpose.geometry import measures, rotations
from interpose.geometry.time import ease, runs, sample, sample_rotations
from interpose.observation.corruption import LIMBS
from interpose.observation.observation import Observation
from interpose.skeletons import SIDES, find_mapping
from interpose.skeletons.carrier import hips_of, placed

# A value is the rest pose if it differs by less (radians, metres): files keep seven digits or so.
SAME = 1e-5
# A value that is lost for longer (seconds) is no snap: `scan` finds it, `fill` and `recover` complete it.
LONGEST = 1.0
# Seconds that a body may be elsewhere, or its hips face elsewhere: what it stands on, and what hangs from
# them, tells for longer where it was.
LONGEST_PLACE = 3.0
# A snap is further than this from what is around it (radians, metres), and than so many of the steps there:
# a hinge that reaches its limit, which files write as its rest pose, arrives there with its own speed.
JUMP, STEPS = 0.02, 2.0
# Where so many runs jump, and most do, all are lost: some just from near the rest pose.
MANY = 5
# A spike of a rotation is further than this (radians) from the median of the frames around it, and than so
# many of the median distances within a second on either side. One of a place is further than this (metres)
# from the cubic that leads over it, which is bent by less than this share of that: of 360 spikes of .15 and
# .3 m in one to three frames of LAFAN1's runs, walks and jumps 353 are found so, by medians half of them.
SPIKE, TIMES = 0.35, 10.0
SPIKE_WAY, BENT = 0.1, 0.4
SPIKES = 0.25  # share of the frames from which on there are more of them than spikes: data drops out there
AROUND = 3  # frames on either side: what lasts longer than these is no spike
# Which of the frames from the first to the last one are gone, of one run and of two near each other.
HOP = [np.ones(run, bool) for run in range(1, AROUND + 1)]
HOPS = [
    np.repeat([True, False, True], [first, between, second])
    for first in range(1, AROUND + 1)
    for between in (1, 2)
    for second in range(1, AROUND + 1)
]
NEAR = 0.7  # the product of two quaternions that are within a quarter turn
# What rises to its height over frames is motion (toes that push off, at 30 fps): beside a spike there is less
# than this share of it. Of 40 runs of Bandai-Namco 5 toes are taken for lost so, and 52 without it; of 498
# spikes put into clips of all sets 487 are found instead of 495.
SLOPE = 0.25
# What is away for longer than a spike jumps there and back by more than a spike, and so many times as far as
# its pace changes in the two frames before the jump and after it; and what it comes back to is where it was,
# or its second jump undoes the first one, but for this share of the jumps. Of 100 bodies that were put .15 to
# 1 m aside for up to 1.5 s in clips of all sets all are found so; where they come back to, within a second,
# tells of 36.
LEAP, BACK = 4.0, 0.5
# At the ends of a clip there is one side to tell by: a spike there is so many times as far.
ONE_SIDED = 1.5
# A spike of a joint is real if what it moves of the joints below comes nearer to its median without it, by
# this share of the way beyond the first metres. Noise on positions turns short bones by any angle, and what
# hangs below them is where it should be.
NEARER, SLIGHT = 0.5, 0.02
# What jumps further when it is interpolated than so many times what it does as it is, and so much (metres a
# second squared), was not lost.
ROUGHER, ROUGH = 1.5, 20.0
# Nor was what jumps less than so many times as far as it does interpolated, where that jumps by more than
# this (metres a second squared), and than so many times what it usually does: who kicks and throws is as
# quick beside such a spike. At 30 frames a second 11 of the 21 spikes in 150 kicks, throws and punches of
# HDM05 are none for that, half-turned hands most of the others; of 114 spikes of 25 to 70 degrees that were
# put into clips of three sets and found all are left.
PLAIN, QUICK, USUAL = 2.0, 40.0, 3.0
ROUNDS = 8  # in which a median is approached
BLOCK = 1024  # frames


def broken(clip: Clip) -> Observation:
    """What is left of a clip without values that were lost: an observation of it.

    Joints' rotations and the translations that place the body are looked at, each for itself: runs of up to
    LONGEST (LONGEST_PLACE of the hips and of places) in which it snaps to its rest value (or to no rotation,
    or to the origin) or jumps away and back, and spikes of up to three frames, also at the ends.
    """
    # Seen as that of a body of usual size, for which metres are chosen.
    clip = clip.scaled(1 / find_mapping(clip.skeleton).size)
    seen, skeleton, placing = Observation.full(clip), clip.skeleton, placed(clip)
    none = np.tile(rotations.identity(), (len(skeleton), 1))
    turned = rotations.continuous(clip.rotation)
    hips = hips_of(skeleton)
    longest = np.where(np.arange(len(skeleton)) == hips, LONGEST_PLACE, LONGEST)
    leaping = _leaping(turned, SPIKE, clip.fps)
    homes = [skeleton.rest_rotation, none]
    snaps, away, spikes, usual = _lost(turned, homes, SPIKE, clip.fps, longest, leaping)
    lost = snaps | _exchanged(clip, away)
    seen.rotation[lost | (spikes & _real(clip, lost, spikes, usual))] = False
    places = clip.translation[:, [clip.translated.index(joint) for joint in placing]]
    homes = [skeleton.rest_translation[placing], np.zeros((len(placing), 3))]
    longest = np.full(len(placing), LONGEST_PLACE)
    gone, away, spikes, _ = _lost(places, homes, SPIKE_WAY, clip.fps, longest, leaping)
    seen.translation[:, placing] = ~(gone | away | spikes | _left(places, snaps[:, hips]))
    again = (np.diff(snaps, axis=0, prepend=False) & snaps).sum(axis=0) >= MANY
    return _smoother(clip, seen, snaps & again)


def _smoother(clip: Clip, seen: Observation, sure: np.ndarray) -> Observation:
    """The observation, to which is known what would be rougher if it were interpolated; but not what is
    surely lost (F, J): where many joints snap again and again something is lost in every frame.

    Joints that turn at a hundred degrees a frame while all that hangs below them goes on smoothly, as those
    of some solvers do whose knee is straight, are no spikes: without one of them a leg is thrown about. Nor
    are feet that kick.
    """
    columns = list(clip.translated)
    lost = ~(seen.rotation & seen.translation)
    if not lost.any() or len(clip) < 3:
        return seen
    rotation, translation = clip.rotation.copy(), clip.translation.copy()
    frames = np.arange(len(clip))
    for joint in np.flatnonzero(lost.any(axis=0)).tolist():
        good = np.flatnonzero(~lost[:, joint])
        if not good.size:
            continue
        at = np.interp(frames, good, np.arange(len(good)))
        rotation[:, joint] = sample_rotations(rotation[good, joint], at)
        if joint in columns:
            column = columns.index(joint)
            translation[:, column] = sample(translation[good, column], at)
    cured = clip.with_motion(rotation, translation)
    kept = replace(seen, rotation=seen.rotation.copy(), translation=seen.translation.copy())
    usual = np.median(measures.acceleration(cured.positions()), axis=0)
    for start, stop, joints, (before, after) in roughness(lost, clip, cured):
        rougher = (after > ROUGHER * before + ROUGH / clip.fps**2).any()
        quick = (after > np.maximum(USUAL * usual[joints], QUICK / clip.fps**2)).any()
        quick = quick and before.max() < PLAIN * after.max()
        if rougher or (quick and stop - start <= AROUND):
            kept.rotation[start:stop] = ~sure[start:stop]
            kept.translation[start:stop] = True
    return kept


def roughness(lost: np.ndarray, *clips: Clip) -> Iterator[tuple[int, int, np.ndarray, list[np.ndarray]]]:
    """For each run of frames, start to stop - 1, in which something is lost (F, J) which joints (J,) hang on
    it, and the largest velocity jump (n,) of each of these, in metres per frame squared: of one clip and of
    others in which that is different."""
    jumps = [np.pad(measures.acceleration(one.positions()), ((1, 1), (0, 0))) for one in clips]
    below = clips[0].skeleton.below
    for start, stop in runs(np.asarray(lost.any(axis=1))):
        joints = np.asarray(below[:, lost[start:stop].any(axis=0)].any(axis=1))
        yield (
            start,
            stop,
            joints,
            [some[max(start - 1, 0) : stop + 1][:, joints].max(axis=0) for some in jumps],
        )


def _lost(
    values: np.ndarray,
    homes: list[np.ndarray],
    far: float,
    fps: float,
    longest: np.ndarray,
    leaping: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Which of the values (F, n, d) snap to one of the `homes` (n, d), which of the others are away, which of
    the rest are spikes, each (F, n), and the medians (F, n, d) of what is around each. `far` is SPIKE or
    SPIKE_WAY, `longest` (n,) the seconds that they may be away, `leaping` (F,) the frames at the ends in
    which the pose is another one, and none of them lost by itself."""
    snaps, away, spikes = (np.zeros(values.shape[:2], bool) for _ in range(3))
    usual = values.copy()
    ends = np.array([_ends(own, ONE_SIDED * far, fps) for own in values.swapaxes(0, 1)]).T
    ends &= ~leaping[:, None]
    for column in range(values.shape[1]):
        own = values[:, column]
        for home in homes:
            snaps[:, column] |= _snaps(own, home[column], max(1, round(LONGEST * fps)))
        good = np.flatnonzero(~(snaps | ends)[:, column])
        away[good, column] = _away(own[good], far, round(longest[column] * fps))
        good = np.flatnonzero(~(snaps | away)[:, column])
        if len(good) > 2 * AROUND:
            if values.shape[2] == 3:
                spikes[good, column] = _hops(own[good], far, HOP + HOPS)[0]
                continue
            near = np.searchsorted(good, np.arange(len(own))).clip(max=len(good) - 1)
            spikes[good, column], middle = _spikes(own[good], far, round(fps))
            twice, led = _hops(_continuous(own[good]), far, HOPS)
            middle = np.where(twice[:, None], led, middle)
            spikes[good, column] |= twice
            usual[:, column] = middle[near]
    ends &= ~(snaps | away)
    for column in np.flatnonzero(ends.any(axis=0)).tolist():
        good = np.flatnonzero(~ends[:, column])
        nearest = np.arange(len(values)).clip(good[0], good[-1])
        usual[ends[:, column], column] = values[nearest[ends[:, column]], column]
    spikes |= ends
    return snaps, away, spikes, usual


def _leaping(turned: np.ndarray, far: float, fps: float) -> np.ndarray:
    """(F,) the first and the last frames, up to three, in which many rotations (F, J, 4) are elsewhere."""
    return np.sum([_ends(own, far / MANY, fps) for own in turned.swapaxes(0, 1)], axis=0) >= MANY


def _ends(values: np.ndarray, far: float, fps: float) -> np.ndarray:
    """(F,) the first and the last frames, up to three, of values (F, d) that leap right after, or before: by
    `far` at 30 frames a second, and further the fewer there are."""
    lost, far = np.zeros(len(values), bool), far * max(1.0, 30.0 / fps)
    if len(values) > 4 * AROUND:
        own = _continuous(values) * 2.0 if values.shape[1] == 4 else values
        for forward in (1, -1):
            # What it goes on with: four steps after the three that may leap.
            steps = np.diff(own[::forward][: 2 * AROUND + 2], axis=0)
            off = np.linalg.norm(steps - np.median(steps[AROUND:], axis=0), axis=-1)
            for frames in range(AROUND, 0, -1):
                others = np.delete(off, frames - 1)[: frames + 2]
                if off[frames - 1] > max(far, LEAP * others.max()):
                    lost[::forward][:frames] = True
                    break
    return lost


def _exchanged(clip: Clip, away: np.ndarray) -> np.ndarray:
    """(F, J) what is `away`; and where joints of both arms are, or of both legs, all of these limbs.

    They were taken for each other, also where a joint of one is turned much as that of the other.
    """
    joints, found = find_mapping(clip.skeleton).joints, away.copy()
    for limb in LIMBS:
        both = [
            [joint for row in rows if (joint := joints[row]) is not None]
            for rows in (limb, [SIDES[row] for row in limb])
        ]
        left, right = (away[:, side].any(axis=1, keepdims=True) for side in both)
        found[:, both[0] + both[1]] |= left & right
    return found


def _left(places: np.ndarray, snaps: np.ndarray) -> np.ndarray:
    """(F, P) where places (F, P, 3) that move elsewhere are left as they were, to the last digit, while the
    hips snap to the rest pose (F,): a tracker that loses a body holds its place."""
    held = np.abs(np.diff(places, axis=0)).max(axis=-1) < SAME
    elsewhere = ~held[~snaps[1:]].all(axis=0)
    return np.pad(held & snaps[1:, None] & elsewhere, ((1, 0), (0, 0)))


def _apart(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """How far vectors (..., 3) are apart, or the angle between quaternions (..., 4)."""
    if a.shape[-1] == 3:
        return np.asarray(np.linalg.norm(a - b, axis=-1))
    chord = np.minimum(np.linalg.norm(a - b, axis=-1), np.linalg.norm(a + b, axis=-1))
    return 4.0 * np.arcsin(np.minimum(chord / 2, 1.0))


def _snaps(values: np.ndarray, home: np.ndarray, longest: int) -> np.ndarray:
    """(F,) the frames of short runs in which values (F, d) are suddenly `home` (d,)."""
    snapped = np.zeros(len(values), bool)
    far = _apart(values, home)
    away = np.flatnonzero(far > SAME)
    if not 4 <= len(away) < len(values):
        return snapped
    longest_away = max(stop - start for start, stop in runs(far > SAME))
    if longest_away <= AROUND and len(away) < SPIKES * len(values):
        return snapped  # it rests there, and what is elsewhere are spikes
    far = far[away]
    # The steps, a frame, between values that are not at home: before and after each of them.
    steps = _apart(values[away[1:]], values[away[:-1]]) / np.diff(away)
    into = far > JUMP + STEPS * np.append(steps[:1], steps)
    out = far > JUMP + STEPS * np.append(steps, steps[-1:])
    # Runs lie before each such value and after the last; an end of the clip is no end of a run.
    jumps = np.append(True, into) & np.append(out, True)
    lengths = np.diff(np.concatenate([[-1], away, [len(values)]])) - 1
    short = (lengths > 0) & (lengths <= longest)
    often = (short & jumps).sum() >= max(MANY, short.sum() / 2)
    for i in np.flatnonzero(short if often else short & jumps):
        stop = away[i] if i < len(away) else len(values)
        snapped[stop - lengths[i] : stop] = True
    return snapped


def _away(values: np.ndarray, far: float, longest: int) -> np.ndarray:
    """(F,) the frames of runs, longer than spikes, that values (F, d) jump into and back out of."""
    away = np.zeros(len(values), bool)
    if len(values) <= AROUND + 2:
        return away
    jumps = _jumps(values)
    sizes = np.linalg.norm(jumps, axis=-1)
    beside = ndimage.maximum_filter(sizes, footprint=[1, 1, 0, 1, 1], mode="nearest")
    leaps = np.flatnonzero((sizes > far) & (sizes > LEAP * beside))
    for before, last in zip(leaps[:-1], leaps[1:]):
        if not AROUND < last - before <= longest or away[before]:
            continue
        least = BACK * min(sizes[before], sizes[last])
        # Who walks meanwhile comes back to elsewhere, by a jump that undoes the first one.
        undone = float(np.linalg.norm(jumps[before] + jumps[last]))
        if values.shape[1] == 4:
            # Who turns meanwhile is turned back as far, in the axes around him or in his own.
            a, b, c, d = (values[at] for at in (before, before + 1, last, last + 1))
            there = rotations.multiply(b, rotations.conjugate(a)), rotations.relative(a, b)
            back = rotations.multiply(c, rotations.conjugate(d)), rotations.relative(d, c)
            undone = min(undone, *(float(_apart(one, other)) for one, other in zip(there, back)))
        if min(undone, _apart(values[last + 1], values[before])) < least:
            away[before + 1 : last + 1] = True
    return away


def _jumps(values: np.ndarray) -> np.ndarray:
    """(F - 1, d) by what each step of values (F, d) differs from the median of the four around it; of
    quaternions twice that, in radians."""
    steps = np.diff(_continuous(values) * 2.0 if values.shape[1] == 4 else values, axis=0)
    padded = np.pad(steps, ((2, 2), (0, 0)), mode="edge")
    around = np.stack([padded[i : i + len(steps)] for i in (0, 1, 3, 4)])
    return np.asarray(steps - np.median(around, axis=0))


def _continuous(values: np.ndarray) -> np.ndarray:
    """Rotations (F, 4) with signs that go on, also behind a spike of half a turn, through which they are
    anybody's guess: there they go on from before it."""
    own = rotations.continuous(values).copy()
    for run in range(1, AROUND + 1):
        turned = (own[run + 1 :] * own[: -run - 1]).sum(axis=1) < -NEAR
        own[run + 1 :] *= np.where(np.cumsum(turned) % 2, -1.0, 1.0)[:, None]
    return own


def _spikes(values: np.ndarray, far: float, second: int) -> tuple[np.ndarray, np.ndarray]:
    """The frames (F,) in which rotations (F, 4) are far from the median (F, 4) of those around them.

    Source: Hampel's identifier; the scale is the median within a second on either side.
    """
    own = _continuous(values)
    middle = medians(own, AROUND, "edge")
    middle = rotations.normalize(middle)
    off = _apart(own, middle)
    spikes = off > far + TIMES * ndimage.median_filter(off, size=2 * second + 1, mode="nearest")
    steps = _apart(own[1:], own[:-1])
    for start, stop in runs(spikes):
        height, beside = off[start:stop].max(), np.append(off[start - 1 : start], off[stop : stop + 1])
        if SLOPE * height < beside.max(initial=0.0):
            spikes[start:stop] = False
        # Beside what jumps and does not come back the median is of the other side.
        if start > 0 and stop < len(own):
            usual = max(
                steps[start - 2 : start - 1].max(initial=0.0), steps[stop : stop + 1].max(initial=0.0)
            )
            way = _apart(own[stop], own[start - 1])
            if way > BACK * height + (stop - start + 1) * usual:
                spikes[start:stop] = False
    for start, stop in runs(spikes):
        if start > 2 and stop < len(own) - 2:
            # Of one that rises and falls the medians beside it are its own first and last frames.
            bend = _bend(own, start, stop)
            wider = 2.0 * bend > far and _bend(own, start - 1, stop + 1) < BACK * bend
            spikes[start - wider : stop + wider] = True
    return spikes, middle


def _bend(values: np.ndarray, start: int, stop: int) -> float:
    """By how much the way over the frames start to stop - 1 differs, a frame, from the steps of values (F, d)
    that lead to it and from it."""
    across = (values[stop] - values[start - 1]) / (stop - start + 1)
    beside = values[[start - 1, stop + 1]] - values[[start - 2, stop]]
    return float(np.linalg.norm(beside - across, axis=-1).sum())


def _hops(values: np.ndarray, far: float, hops: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """The frames (F,) in which values (F, d) are far from a cubic of Hermite, and the values with that there.

    It leads over the runs of `hops` from the velocity before to the one after. Who runs rises and falls by as
    much as a spike within a moment: medians are lost on it, cubics are not. Two runs with one or two frames
    between them, which are near it, are found at once: neither has a velocity on both sides, and between two
    that went the same way the good frame would be the spike.
    """
    found, good = np.zeros((2, len(values)), bool)
    usual, steps = values.copy(), np.diff(values, axis=0)
    for gone in hops:
        count = len(gone)
        start = np.arange(2, len(values) - count - 1)
        # By their first frames nearly all are ruled out.
        for first in (True, False):
            some = np.arange(1 if first else count)
            share = ((some + 1) / (count + 1))[:, None, None]
            before, after = values[start - 1], values[start + count]
            leave, meet = (count + 1) * steps[start - 2], (count + 1) * steps[start + count]
            led = before + ease(share) * (after - before)
            led = led + share * (1 - share) * ((1 - share) * leave - share * meet)
            led = rotations.normalize(led) if values.shape[1] == 4 else led
            frames = start + some[:, None]
            apart = _apart(values[frames], led)
            if first:
                start = start[apart[0] > far]
        off, near = apart[gone].min(axis=0, initial=np.inf), apart[~gone].max(axis=0, initial=0.0)
        bent = np.maximum(near, _apart(after - before, (leave + meet) / 2))
        sure = (off > far) & (bent < BENT * off)
        found[frames[gone][:, sure]] = True
        good[frames[~gone][:, sure]] = True
        usual[frames[gone][:, sure]] = led[gone][:, sure]
    return found & ~good, usual


def _real(clip: Clip, lost: np.ndarray, spikes: np.ndarray, usual: np.ndarray) -> np.ndarray:
    """(F, J) where what is below a joint comes nearer to its usual place when its spikes (F, J) are gone."""
    if not spikes.any():
        return spikes
    base = clip.with_motion(np.where(lost[..., None], usual, clip.rotation), clip.translation)
    cured = clip.with_motion(np.where(spikes[..., None], usual, base.rotation), clip.translation)
    before, after = base.positions(), cured.positions()
    middle = medians(after, AROUND, "edge")
    below = clip.skeleton.below & ~np.eye(len(clip.skeleton), dtype=bool)
    nearer = _apart(before, middle) - _apart(after, middle)
    return np.asarray((nearer - NEARER * np.maximum(_apart(before, after) - SLIGHT, 0.0)) @ below >= -SAME)


def medians(values: np.ndarray, around: int, ends: str) -> np.ndarray:
    """(F, ..., d) the medians of vectors (F, ..., d) over `around` frames on either side of each.

    The point with the least sum of distances (Weiszfeld 1937): the same whichever way the axes point. `ends`
    says how the first and last frames go on: "edge" or "reflect", as in `numpy.pad`.
    """
    padded = np.pad(values, [(around, around)] + [(0, 0)] * (values.ndim - 1), mode=ends)  # type: ignore[call-overload]
    middle = np.empty_like(values)
    # In blocks that fit the cache, and coordinate by coordinate.
    for start in range(0, len(values), BLOCK):
        stop = min(start + BLOCK, len(values))
        piece = np.ascontiguousarray(np.moveaxis(padded[start : stop + 2 * around], -1, 0))
        near = [piece[:, first : first + stop - start] for first in range(2 * around + 1)]
        block = np.asarray(sum(near)) / len(near)
        for _ in range(ROUNDS):
            far = [np.sqrt(np.add.reduce((one - block) ** 2)) for one in near]
            weights = [1.0 / np.maximum(some, SAME) for some in far]
            weighed = [weight * one for weight, one in zip(weights, near)]
            block = np.asarray(sum(weighed)) / np.asarray(sum(weights))
        middle[start:stop] = np.moveaxis(block, 0, -1)
    return middle
