"""Left and right taken for each other: a limb has the turns of its like on the other side for a while."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from interpose.clip import Clip
from interpose.geometry import rotations
from interpose.observation.corruption import LIMBS
from interpose.skeletons import JOINTS, SIDES, find_mapping

# Seconds that limbs are exchanged for at most: of longer ones nobody knows which part is the wrong one.
LONGEST = 3.0
# The joints of both limbs turn by more than this from one frame to the next (radians, all together), and by
# less than this share of it if they change sides: of 200 clips of all data sets none does.
TURN, SHARE = 0.6, 0.35


@dataclass(frozen=True)
class Exchange:
    """The joints `left` and `right`, one for one, have each other's turns in the frames start to stop - 1."""

    start: int
    stop: int
    left: tuple[int, ...]
    right: tuple[int, ...]

    @property
    def joints(self) -> tuple[int, ...]:
        """All of them, in the skeleton's order."""
        return tuple(sorted(self.left + self.right))


def exchanges(clip: Clip) -> list[Exchange]:
    """Where arms, or legs, change sides and back, in order of time; none of what is no humanoid."""
    mapping, found = find_mapping(clip.skeleton), []
    for limb in LIMBS:
        pairs = [(mapping.joints[row], mapping.joints[SIDES[row]]) for row in limb]
        both = [(a, b) for a, b in pairs if a is not None and b is not None]
        if not JOINTS[limb[0]].startswith("Left") or not both:
            continue
        left, right = (clip.rotation[:, [pair[side] for pair in both]] for side in (0, 1))

        def turn(before: np.ndarray, after: np.ndarray) -> np.ndarray:
            return np.asarray(rotations.angle(before[:-1], after[1:]).sum(axis=1))

        stay = turn(left, left) + turn(right, right)
        across = turn(left, right) + turn(right, left)
        cuts = (np.flatnonzero((stay > TURN) & (across < SHARE * stay)) + 1).tolist()
        at = 0
        while at + 1 < len(cuts):
            start, stop = cuts[at : at + 2]
            if stop - start > LONGEST * clip.fps:
                at += 1
                continue
            found.append(Exchange(start, stop, *(tuple(pair[side] for pair in both) for side in (0, 1))))
            at += 2
    return sorted(found, key=lambda one: (one.start, one.joints))


def put_back(clip: Clip, found: Sequence[Exchange]) -> Clip:
    """The clip with the limbs on the sides that they belong to; what a file left in it stays."""
    if not found:
        return clip
    rotation = clip.rotation.copy()
    for one in found:
        part = slice(one.start, one.stop)
        rotation[part, one.left], rotation[part, one.right] = (
            clip.rotation[part, one.right],
            clip.rotation[part, one.left],
        )
    return clip.with_motion(rotation, clip.translation)
