"""What sits on the body and is no part of it: targets of feet and hands beside the hips, in rigs of game
engines, and what is held in a hand."""

from __future__ import annotations

import numpy as np

from interpose.clip import Clip, Skeleton
from interpose.geometry import rotations
from interpose.geometry.time import sample, sample_rotations
from interpose.skeletons.carrier import STILL, hips_of, moved
from interpose.skeletons.mapping import find_mapping

# Metres, and radians, by which what sits on a joint moves against it, at most: files round, and at another
# frame rate what hangs from a root that turns is two millimetres off between its old frames.
LOOSE, TURNS = 5e-3, np.radians(3)


def seated(clip: Clip, known: np.ndarray, turns: np.ndarray) -> Clip:
    """The clip with joints beside the hips where they belong in frames in which they are unknown.

    What moves against its parent, and in all known frames keeps its place and turn against a joint of the
    body (the nearest such one), does so in the others, too. It needs translations of its own; all else stays
    as it is.

    known, turns: (F, J) which local translations, and which local rotations, are known.
    """
    skeleton, mapping = clip.skeleton, find_mapping(clip.skeleton)
    if not mapping.usable:
        return clip
    hips, whole = hips_of(skeleton), known & turns
    line = skeleton.below[:, hips] | skeleton.below[hips]
    free = np.logical_not(known | turns)
    # Parents come first: what hangs from a target goes along, and is then put where it belongs itself.
    for joint in sorted(clip.translated):
        local = clip.translation[whole[:, joint], clip.translated.index(joint)]
        if line[joint] or not free[:, joint].any() or len(local) < 2 or np.ptp(local, axis=0).max() < STILL:
            continue
        turned, placed = clip.kinematics()
        against = (_against(turned, placed, joint, seat, whole, skeleton) for seat in mapping.mapped[1])
        if seats := [one for one in against if one is not None]:
            seat, turn, place = min(seats, key=lambda one: float(np.linalg.norm(one[2].mean(axis=0))))
            turn = rotations.multiply(turned[:, seat], turn)
            place = placed[:, seat] + rotations.rotate(turned[:, seat], place)
            at = free[:, joint, None]
            there = np.where(at, turn, turned[:, joint]), np.where(at, place, placed[:, joint])
            clip = moved(clip, {joint: there})
    return clip


def _against(
    turned: np.ndarray, placed: np.ndarray, joint: int, seat: int, whole: np.ndarray, skeleton: Skeleton
) -> tuple[int, np.ndarray, np.ndarray] | None:
    """A joint to sit on, and how another one is turned (F, 4) and placed (F, 3) against it: led on from the
    frames in which both are known; None where it changes in these.

    Args:
        turned, placed: (F, J, 4) and (F, J, 3) global rotations and positions.
        whole: (F, J) which joints are known.
    """
    # What both hang from does not matter.
    both = np.asarray(whole[:, skeleton.below[joint] ^ skeleton.below[seat]].all(axis=1))
    if both.sum() < 2:
        return None
    back = rotations.conjugate(turned[both, seat])
    places = rotations.rotate(back, placed[both, joint] - placed[both, seat])
    if np.ptp(places, axis=0).max() > LOOSE:
        return None
    turns = rotations.multiply(back, turned[both, joint])
    if rotations.angle(turns[0], turns).max() > TURNS:
        return None
    at = np.interp(np.arange(len(both)), np.flatnonzero(both), np.arange(both.sum()))
    return seat, sample_rotations(turns, at), sample(places, at)
