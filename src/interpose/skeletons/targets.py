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


def following(clip: Clip, known: np.ndarray, turns: np.ndarray) -> np.ndarray:
    """(F, J) True for known joints that sit on a joint of the body, as `seated` finds them, in frames in
    which it is not known where that is: they go along, or a foot would be pulled back to where it was.

    clip, known, turns: as in `seated`.
    """
    found, whole = np.zeros(known.shape, bool), known & turns
    turned, placed = clip.kinematics()
    for joint in _beside(clip, whole):
        if seats := _seats(turned, placed, joint, whole, clip.skeleton):
            # So does what hangs from one that goes along, though what it sits on stays.
            above = found[:, [*clip.skeleton.ancestors(joint)]].any(axis=1)
            lost = ~_both(joint, seats[0][0], whole, clip.skeleton)
            found[:, joint] = whole[:, joint] & (lost | above)
    return found


def seated(clip: Clip, known: np.ndarray, turns: np.ndarray) -> Clip:
    """The clip with joints beside the hips where they belong in frames in which they are unknown.

    What moves against its parent, and in all known frames keeps its place and turn against a joint of the
    body (the nearest such one), does so in the others, too. It needs translations of its own; all else stays
    as it is.

    known, turns: (F, J) which local translations, and which local rotations, are known.
    """
    whole, free = known & turns, np.logical_not(known | turns)
    # Parents come first: what hangs from a target goes along, and is then put where it belongs itself.
    for joint in _beside(clip, whole):
        if not free[:, joint].any():
            continue
        turned, placed = clip.kinematics()
        if seats := _seats(turned, placed, joint, whole, clip.skeleton):
            seat, turn, place = seats[0]
            turn = rotations.multiply(turned[:, seat], turn)
            place = placed[:, seat] + rotations.rotate(turned[:, seat], place)
            at = free[:, joint, None]
            there = np.where(at, turn, turned[:, joint]), np.where(at, place, placed[:, joint])
            clip = moved(clip, {joint: there})
    return clip


def _beside(clip: Clip, whole: np.ndarray) -> list[int]:
    """The joints beside the hips of a humanoid that move against their parents, parents first."""
    skeleton = clip.skeleton
    if not find_mapping(skeleton).usable:
        return []
    hips, found = hips_of(skeleton), []
    line = skeleton.below[:, hips] | skeleton.below[hips]
    for joint in sorted(clip.translated):
        local = clip.translation[whole[:, joint], clip.translated.index(joint)]
        if not line[joint] and len(local) > 1 and np.ptp(local, axis=0).max() >= STILL:
            found.append(joint)
    return found


def _seats(
    turned: np.ndarray, placed: np.ndarray, joint: int, whole: np.ndarray, skeleton: Skeleton
) -> list[tuple[int, np.ndarray, np.ndarray]]:
    """What a joint sits on, the nearest first; see `_against`."""
    joints = find_mapping(skeleton).mapped[1]
    against = (_against(turned, placed, joint, seat, whole, skeleton) for seat in joints)
    seats = [one for one in against if one is not None]
    return sorted(seats, key=lambda one: float(np.linalg.norm(one[2].mean(axis=0))))


def _both(joint: int, seat: int, whole: np.ndarray, skeleton: Skeleton) -> np.ndarray:
    """(F,) where it is known how one joint lies to another: what both hang from does not matter."""
    return np.asarray(whole[:, skeleton.below[joint] ^ skeleton.below[seat]].all(axis=1))


def _against(
    turned: np.ndarray, placed: np.ndarray, joint: int, seat: int, whole: np.ndarray, skeleton: Skeleton
) -> tuple[int, np.ndarray, np.ndarray] | None:
    """A joint to sit on, and how another one is turned (F, 4) and placed (F, 3) against it: led on from the
    frames in which both are known; None where it changes in these.

    Args:
        turned, placed: (F, J, 4) and (F, J, 3) global rotations and positions.
        whole: (F, J) which joints are known.
    """
    both = _both(joint, seat, whole, skeleton)
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
