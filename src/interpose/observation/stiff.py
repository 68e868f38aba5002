"""Joints that are as good as still, and then jump; and joints that turn so evenly that nobody moved them.

Trackers that lose a limb hold it where it was, with the noise of whatever they see; other programs lead it
straight over what they miss. Neither is a run of equal values.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy import ndimage

from interpose.clip import Clip, Skeleton
from interpose.geometry import rotations
from interpose.geometry.time import runs
from interpose.observation.corruption import LIMBS
from interpose.skeletons import JOINTS, find_mapping
from interpose.skeletons.carrier import place_of

# What is held stays within so many radians of where it is in the mean, for at least so many seconds; where
# one joint alone is held, for longer. It usually goes further than that, by this factor, in the same time.
# Of 40 limbs of LAFAN1 that are held for half a second to 1.6 s and tremble by .3 degrees 31 are found, 29 at
# .5 degrees; seven of the others come back within 6 degrees of where they were held. In 532 clips of all
# sets, 530,000 frames, it finds ten, in seven clips, that no one has put there.
HELD, SECONDS, ALONE, USUAL = np.radians(2.0), 0.3, 0.6, 2.0
# It comes back, or went there, by a step of its own: of so many radians, so many times those beside it.
LEAP, OWN = np.radians(4.0), 2.0
WAY, AWAY = 0.02, 1.5  # metres that something goes in that step, and as much further than in those beside
# Metres a second from which no body comes to stand, to the last digit, from one frame to the next.
PACE = 0.3
MOST, NEARLY = 3, 0.9  # so many limbs, and such a share of all joints, are all of the pose
# A joint, against the hips, or the hips themselves go further than this (metres) from one frame to the next,
# and than so many times as far as in those around: of 112,000 frames of all data sets 18, which are glitches.
TELEPORTS, TIMES = 0.1, 5.0
PLACE, BRIEF = 0.01, 0.1  # metres within which a place is held with a tremble, and seconds for which at least
# Where so many of the other joints leap in the same step nothing was held before: the motion was cut there.
CUT = 0.25
ALIVE = 0.5  # of what the rest of the body usually turns, at least, meanwhile: who stands still is not held
# It ends where it stays further from its mean than by so many times what it trembles by in .3 s beside the
# leap, or by so much (radians): what moved slowly before is real.
NOISE, SURE = 1.3, np.radians(0.3)
REAL = 0.2  # seconds that are real on the other side of the leap
AT_FIRST = 4.0  # seconds in which the end of what is held is looked for at first
NEAR = 3  # frames by which joints of one limb may differ
# Turns from frame to frame are even if each differs from the one before by less than this share (at 30 fps)
# and all from their mean by less than the second: rotations that are interpolated, as such or as angles. Of
# 40 limbs that were led straight for .4 to 1.6 s 39 are found, and 38 where their angles were led; in all
# sets none that no one has put there. Slower turns (radians a second) tell nothing.
EACH, ALL, SLOW = 0.04, 0.25, 0.09
BENDS = 3.0  # times what even turns may differ by: before and after them they differ by more
KEYED = 4  # frames that are straight beyond the frame at an end
SAME = 1.5e-4  # radians: files round
# A joint that turns evenly in more than this share of the frames in which it turns was animated so.
ANIMATED = 0.7


# A limb: its joints, the frames start to stop - 1 in which it is held, and the step in which it leaps.
Group = tuple[tuple[int, ...], int, int, int]


def held(clip: Clip, lost: np.ndarray) -> Iterator[tuple[tuple[int, ...], int, int]]:
    """Limbs, or ends of them, that are held and tremble: their joints, and the frames start to stop - 1.

    lost: (F, J) what is known to be wrong; what leaps from there is real.
    """
    turned, places, skeleton = rotations.continuous(clip.rotation), clip.positions(), clip.skeleton
    steps = 2.0 * np.linalg.norm(np.diff(turned, axis=0), axis=-1)
    mapping = find_mapping(skeleton)
    groups: list[Group] = []
    for rows in LIMBS:
        joints = [mapping.joints[row] for row in rows if not JOINTS[row].endswith("Toe")]
        limb = [joint for joint in joints if joint is not None]
        found = [
            (joint, start, stop, step)
            for joint in limb
            for start, stop, step in _still(turned[:, joint], steps[:, joint], lost[:, joint], clip.fps)
            if _leaps(places, step, joint, skeleton)
        ]
        while found:
            alike = [
                one for one in found if abs(one[1] - found[0][1]) <= NEAR or abs(one[2] - found[0][2]) <= NEAR
            ]
            found = [one for one in found if one not in alike]
            start, stop, step = (int(np.median([one[side] for one in alike])) for side in (1, 2, 3))
            below = [
                j for j in range(len(skeleton)) if j == alike[0][0] or alike[0][0] in skeleton.ancestors(j)
            ]
            if len({one[0] for one in alike}) > 1 or stop - start >= ALONE * clip.fps:
                groups.append((tuple(below), start, stop, step))
    ends: list[int] = []
    for same in sorted(_at_once(groups), key=len, reverse=True):
        _, start, stop, _ = same[0]
        if len(same) >= MOST and _whole(turned[start:stop]):
            ends += [start, stop]
            before = np.linalg.norm(np.diff(places[max(0, start - NEAR) : start], axis=0), axis=-1) * clip.fps
            # The tracker lost all of it, amid motion. Who stood still before did so.
            if before.size and before.mean() > PACE:
                yield tuple(range(len(skeleton))), start, stop
            continue
        others = np.delete(steps, [joint for part, *_ in same for joint in part], axis=1)
        for part, start, stop, step in same:
            if _cut(others, step):
                continue
            # What leaps to a pose that is held, or from it, does not because it is held itself.
            if any(min(abs(end - start), abs(end - stop)) <= NEAR for end in ends):
                continue
            alive = np.delete(steps, part, axis=1).mean(axis=1)
            if np.median(alive[start:stop]) > ALIVE * np.median(alive):
                yield part, start, stop


def _cut(steps: np.ndarray, step: int) -> bool:
    """Whether joints that turn by `steps` (F - 1, n) from frame to frame leap in one of these."""
    part, at = steps[max(0, step - NEAR) : step + NEAR + 1], min(step, NEAR)
    beside = np.delete(part, at, axis=0).max(axis=0, initial=0.0)
    moving = steps.max(axis=0, initial=0.0) > LEAP
    leap = (part[at] > LEAP) & (part[at] > OWN * beside)
    return bool(leap[moving].sum() > CUT * moving.sum())


def _at_once(groups: list[Group]) -> Iterator[list[Group]]:
    """Limbs that are held, in lists of those that are so at the same time."""
    while groups:
        _, start, stop, _ = groups[0]
        same = [one for one in groups if max(abs(one[1] - start), abs(one[2] - stop)) <= NEAR]
        groups = [one for one in groups if one not in same]
        yield same


def held_place(clip: Clip) -> Iterator[tuple[int, int, int]]:
    """Where the place of a body is held with a tremble and then is elsewhere: the joint, and the frames start
    to stop - 1. It stops there from a pace at which nobody comes to stand at once."""
    where, least = place_of(clip), max(NEAR, round(BRIEF * clip.fps))
    places = clip.translation[:, clip.translated.index(where)]
    steps = np.linalg.norm(np.diff(places, axis=0), axis=-1)
    beside = ndimage.maximum_filter(steps, footprint=[1, 1, 1, 0, 1, 1, 1], mode="nearest")
    for step in np.flatnonzero((steps > TELEPORTS) & (steps > TIMES * beside)).tolist():
        far = np.linalg.norm(places[step::-1] - places[step], axis=-1) > PLACE
        start = step + 2 - (int(np.argmax(far)) if far.any() else len(far))
        pace = steps[max(0, start - 4) : max(0, start - 1)] * clip.fps
        if step + 1 - start >= least and len(pace) and np.median(pace) > PACE:
            yield where, start, step + 1


def _whole(turned: np.ndarray) -> bool:
    """Whether nearly all joints are held in frames with rotations (F, J, 4)."""
    off = rotations.angle(rotations.normalize(turned.mean(axis=0)), turned)
    return bool((np.percentile(off, 90, axis=0) < HELD).mean() > NEARLY)


def _leaps(places: np.ndarray, step: int, joint: int, skeleton: Skeleton) -> bool:
    """Whether something that hangs from a joint leaps in a step between frames, seen from the joint; places
    are (F, J, 3). Twists of an arm that its joints share out anew move nothing."""
    below = [j for j in range(len(skeleton)) if joint in skeleton.ancestors(j)]
    part = places[max(0, step - NEAR) : step + NEAR + 2]
    ways = np.linalg.norm(np.diff(part[:, below] - part[:, [joint]], axis=0), axis=-1)
    at = min(step, NEAR)
    beside = np.delete(ways, at, axis=0).max(axis=0, initial=0.0)
    return bool(((ways[at] > WAY) & (ways[at] > AWAY * beside)).any())


def _still(
    turned: np.ndarray, steps: np.ndarray, lost: np.ndarray, fps: float
) -> Iterator[tuple[int, int, int]]:
    """Frames start to stop - 1 in which a joint's rotations (F, 4), turned by `steps` (F - 1) from frame to
    frame, are held, and the step of its own beside, on the other side of which it is not lost (F,)."""
    least, longest = max(5, round(SECONDS * fps)), round(AT_FIRST * fps)
    real = max(NEAR, round(REAL * fps))
    ways = 2.0 * np.linalg.norm(turned[least:] - turned[:-least], axis=-1)
    if not (ways > USUAL * HELD).any():
        return
    beside = ndimage.maximum_filter(steps, footprint=[1] * NEAR + [0] + [1] * NEAR, mode="constant")
    for step in np.flatnonzero((steps > LEAP) & (steps >= OWN * beside)).tolist():
        for part, other, backwards in (
            (turned[step::-1], lost[step + 1 :][:real], True),
            (turned[step + 1 :], lost[max(0, step + 1 - real) : step + 1], False),
        ):
            if len(part) < least or len(other) < real or other.any():
                continue
            mean, sight = rotations.normalize(part[:least].mean(axis=0)), longest
            off = rotations.angle(mean, part[:sight])
            while sight < len(part) and (off <= HELD).all():
                sight *= 2
                off = rotations.angle(mean, part[:sight])
            length = int(np.argmax(off > HELD)) if (off > HELD).any() else len(off)
            if length < least:
                continue
            trembles = max(NOISE * float(np.percentile(off[:least], 90)), SURE)
            level = ndimage.median_filter(off[:length], 5, mode="nearest")
            length = max(least, int(np.flatnonzero(level <= trembles).max(initial=0)) + 1)
            # The frame before the tracker lost it, or after it was found, is one of them.
            start, stop = (step + 2 - length, step + 1) if backwards else (step + 1, step + length)
            # What it usually does is what it does apart from that.
            apart = np.delete(ways, slice(max(0, start - least), stop))
            if len(apart) and np.median(apart) >= USUAL * HELD:
                yield start, stop, step


def even(clip: Clip) -> Iterator[tuple[tuple[int, ...], int, int]]:
    """Joints that turn evenly, and the frames start to stop - 1 that lie between two real ones."""
    turned = rotations.continuous(clip.rotation)
    turns = rotations.log(
        rotations.normalize(rotations.multiply(turned[1:], rotations.conjugate(turned[:-1])))
    )
    size = np.linalg.norm(turns, axis=-1)
    changes = np.linalg.norm(np.diff(turns, axis=0), axis=-1)
    limit, goes = EACH * 30 / clip.fps * size[1:] + SAME, size[1:] > SLOW / clip.fps
    evenly, least = (changes < limit) & goes, max(6, round(SECONDS * clip.fps))
    # Beside what was put in the motion bends.
    bends = np.pad(changes > BENDS * limit, ((1, 1), (0, 0)), constant_values=True)
    straight = changes < limit
    found: list[tuple[int, int, int]] = []
    for joint in np.flatnonzero(evenly.sum(axis=0) <= ANIMATED * goes.sum(axis=0)).tolist():
        for start, stop in runs(evenly[:, joint]):
            part = turns[start : stop + 1, joint]
            off = np.linalg.norm(part - part.mean(axis=0), axis=-1).max()
            if stop - start < least - 2 or off >= ALL * np.linalg.norm(part.mean(axis=0)):
                continue
            # Straight on from the next key, or to it, it was animated so.
            before, after = (
                straight[max(0, start - 1 - KEYED) : max(0, start - 1), joint],
                straight[stop + 1 :, joint],
            )
            keyed = any(len(side) == KEYED and side.all() for side in (before, after[:KEYED]))
            if bends[[start, stop + 1], joint].all() and not keyed:
                found.append((joint, start + 1, stop + 1))
    alive = goes.any(axis=0)
    while found:
        alike = [one for one in found if max(abs(one[1] - found[0][1]), abs(one[2] - found[0][2])) <= NEAR]
        found = [one for one in found if one not in alike]
        start, stop = min(one[1] for one in alike), max(one[2] for one in alike)
        if len(alike) > 1 or stop - start >= ALONE * clip.fps:
            # Others that turn too slowly to tell, but as evenly.
            inside = slice(start + NEAR, stop - 1 - NEAR)
            also = np.flatnonzero(alive & straight[inside].all(axis=0)).tolist()
            yield tuple(sorted({*also, *(one[0] for one in alike)})), start, stop
