"""Where a body is, told by what it stands on: a foot that stands stays where it is, and carries the body on.

Of trackers that lose the hips' place alone, and of suits that know no places, every turn is known; then how a
standing foot, or the hand or knee of who crawls, moves against the hips is how the hips move over the floor.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import solveh_banded

from interpose.clip import Clip
from interpose.finish import feet
from interpose.geometry.time import bending
from interpose.observation import Observation
from interpose.skeletons import find_mapping
from interpose.skeletons.carrier import hips_of, moved

# A joint stands that is slower than this (metres a second, and this share of what the body does, whose way is
# not known well) and no higher than this above the lowest one (metres). Chosen, as the weights below, on
# validation performers.
SLOW, HURRY, HIGH = 0.5, 0.1, 0.05
# What counts beside a joint that stands: that the body goes on as it did, which in the air is all there is
# (and that it falls there), and that it stands on the floor. Places that are known are as good as fixed.
GOES_ON, FLOOR, FIXED = 1.0, 0.01, 1e6
RESTS = 1e-6  # what it counts that a body stays where it is, where nothing else says anything
GRAVITY = 9.81  # metres per second squared
TORN = 5.0  # metres a second, of all joints in the mean: no motion does that
PULL = 2.0  # times gravity: nobody comes down faster, as far as can be told
ROUNDS = 40  # at most, of finding what stands, and where that puts the body
# Metres a frame that what stands of a body of usual size moves at 30 fps, as far as noise on places counts
# beside it.
STEADY = 0.004


def alone(known: Observation, clip: Clip) -> np.ndarray:
    """(F,) where the place of the body is lost and all turns between it and the feet are known; nowhere where
    there are no feet, or hardly a frame."""
    skeleton, hips = clip.skeleton, hips_of(clip.skeleton)
    chains, legs = {hips, *skeleton.ancestors(hips)}, feet.legs(skeleton)
    if not legs or len(clip) < 3:
        return np.zeros(len(known.rotation), bool)
    for leg in legs:
        chains |= {leg.thigh, leg.knee, leg.ankle, *skeleton.ancestors(leg.thigh)}
    turned = known.rotation[:, sorted(chains)].all(axis=1)
    return np.logical_and(turned, np.logical_not(known.positions(skeleton)[:, hips]))


def stood(clip: Clip, known: Observation) -> Clip:
    """The motion with the body where its feet say, in frames of which its place is all that is lost.

    By least squares: a joint that stands does not move, and is on the floor; in the air a body goes on as it
    did, and falls. The way begins and ends at places that are known, or else at the first frame. At first the
    lowest joint is taken to stand.
    """
    lost = alone(known, clip)
    carrier = _carrier(clip)
    if carrier is None or not (lost & ~known.translation[:, carrier]).any():
        return clip
    fixed = ~lost if not lost.all() else np.arange(len(clip)) == 0
    # Between two known places floors need not be flat; from one on they had better be.
    level = not (fixed[0] and fixed[-1])
    return _placed(clip, carrier, _supports(known, lost, clip), FIXED * fixed, level)


def steadied(clip: Clip, noise: float) -> Clip:
    """The motion of which all turns are known and the place of the body is noisy, by `noise` metres along an
    axis: near where it is, and as what it stands on says."""
    carrier = _carrier(clip)
    if carrier is None or noise <= 0 or len(clip) < 3:
        return clip
    full = Observation.full(clip)
    joints = _supports(full, np.ones(len(clip), bool), clip)
    steady = STEADY * feet.size(clip.skeleton)
    weight = np.full(len(clip), 30 / clip.fps * (steady / noise) ** 2)
    return _placed(clip, carrier, joints, weight, False)


def _carrier(clip: Clip) -> int | None:
    """The joint whose translation says where the hips are."""
    hips = hips_of(clip.skeleton)
    return next((j for j in (hips, *clip.skeleton.ancestors(hips)) if j in clip.translated), None)


def _placed(clip: Clip, carrier: int, joints: list[int], trusted: np.ndarray, level: bool) -> Clip:
    """The motion with the body carried by those of the joints that stand.

    Args:
        carrier: the joint that is moved.
        trusted: (F,) how much the place counts where it is.
        level: whether the floor is.
    """
    if not joints:
        return clip
    turned, placed = clip.kinematics()
    hips, grown = hips_of(clip.skeleton), feet.size(clip.skeleton)
    root, against = placed[:, hips], placed[:, joints] - placed[:, None, hips]
    heights = against[..., 1]
    slow = SLOW * grown / clip.fps
    floor = _floor(root[:, None] + against, trusted > 0, slow) if level else None
    falls, torn = grown * GRAVITY / clip.fps**2, grown * TORN / clip.fps
    stands = _begun(root, against, trusted >= FIXED, falls, torn)
    for _ in range(ROUNDS):
        path = _carried(root, against, stands, trusted, floor, clip.fps, grown)
        pace = np.linalg.norm(np.gradient(path[:, None] + against, axis=0), axis=-1)
        hurry = HURRY * np.linalg.norm(np.gradient(path, axis=0), axis=-1)[:, None]
        still = (pace < slow + hurry) & (heights < heights.min(axis=1, keepdims=True) + HIGH * grown)
        before, stands = stands, still[1:] & still[:-1]
        if (stands == before).all():
            break
    return moved(clip, {carrier: (turned[:, carrier], placed[:, carrier] + path - root)})


def _supports(known: Observation, lost: np.ndarray, clip: Clip) -> list[int]:
    """The joints of the body of which all turns above are known in the `lost` frames."""
    whole = known.rotation[lost].all(axis=0)
    hips, mapping = hips_of(clip.skeleton), find_mapping(clip.skeleton)
    above = {joint: clip.skeleton.ancestors(joint) for joint in mapping.mapped[1]}
    return [j for j, chain in above.items() if hips in (j, *chain) and all(whole[k] for k in chain)]


def _begun(root: np.ndarray, against: np.ndarray, known: np.ndarray, falls: float, torn: float) -> np.ndarray:
    """(F - 1, n) what stands from each frame to the next, to begin with: the lowest joint, but in the air.

    The floor pushes and does not pull: what would hold a body back on its way up has left it, and the body
    flies until it is as low as it was there. Arguments as in `_carried`; `falls` in metres a frame squared.
    Where joints move by more than `torn` metres a frame against the hips, in the mean, two poses have nothing
    to do with each other, as a rest pose before the motion.
    """
    apart = np.linalg.norm(np.diff(against, axis=0), axis=-1).mean(axis=1) > torn
    steps, heights = -np.diff(against, axis=0), against[..., 1]
    lowest = (heights[1:] + heights[:-1]).argmin(axis=1)
    stands = np.zeros(steps.shape[:2], bool)
    place, pace, floor, flies = root[0], np.zeros(3), root[0, 1] + heights[0].min(), False
    for i, joint in enumerate(lowest):
        step = steps[i, joint]
        flown = pace - [0.0, falls, 0.0]
        if known[i + 1] and known[i]:
            step = root[i + 1] - root[i]
            flies = bool(abs(step[1] - flown[1]) < falls and pace[1] != 0)
        elif apart[i]:
            step, flies, floor = np.zeros(3), False, place[1] + heights[i + 1].min()
        elif not flies and step[1] < pace[1] - PULL * falls:
            flies, floor = True, place[1] + heights[i].min()
        elif flies and place[1] + flown[1] + heights[i + 1].min() < floor:
            flies = False
        stands[i, joint] = not (flies or apart[i])
        pace = flown if flies else step
        place = root[i + 1] if known[i + 1] else place + pace
        if known[i + 1]:
            floor = min(floor, place[1] + heights[i + 1].min())
    return stands


def _floor(points: np.ndarray, known: np.ndarray, slow: float) -> np.ndarray:
    """(F,) the height of the floor: of the lowest joint (F, n, 3) in the nearest `known` frames (F,) in which
    it stands; even in between.

    slow: metres a frame below which it stands.
    """
    lowest = points[..., 1].argmin(axis=1)
    pace = np.linalg.norm(np.gradient(points, axis=0), axis=-1)
    height, still = (np.take_along_axis(v, lowest[:, None], 1)[:, 0] for v in (points[..., 1], pace))
    sure = known & np.roll(known, 1) & np.roll(known, -1)
    at = np.flatnonzero(sure & (still < slow))
    if not len(at):
        return np.full(len(height), height[known].min())
    return np.interp(np.arange(len(height)), at, height[at])


def _carried(
    root: np.ndarray,
    against: np.ndarray,
    stands: np.ndarray,
    trusted: np.ndarray,
    floor: np.ndarray | None,
    fps: float,
    grown: float,
) -> np.ndarray:
    """The way (F, 3) of a body that feet which stand carry on.

    Args:
        root: (F, 3) where it is, as far as that is `trusted` (F,).
        against: (F, n, 3) where joints are from it.
        stands: (F - 1, n) which of them stand from a frame to the next.
        floor: (F,) height of the floor, where that is to count.
        grown: the size of the body.
    """
    count, held = len(root), RESTS + stands.sum(axis=1)
    step = -(stands[..., None] * np.diff(against, axis=0)).sum(axis=1)
    bands, right = np.zeros((3, count)), trusted[:, None] * root
    bands[0] = trusted
    bands[0, :-1] += held
    bands[0, 1:] += held
    bands[1, :-1] -= held
    right[:-1] -= step
    right[1:] += step
    # Weights are those of 30 frames a second; a step is as much shorter as there are more, and what changes
    # from one to the next as much more so.
    often = fps / 30
    goes_on, on_floor = GOES_ON * often**2, FLOOR / often**2
    air = np.logical_not(stands.any(axis=1))
    down = np.where(air[1:] & air[:-1], -grown * GRAVITY / fps**2, 0.0)
    bands += goes_on * bending(count)
    for i, weight in enumerate((1.0, -2.0, 1.0)):
        right[i : count - 2 + i, 1] += goes_on * weight * down
    path = np.asarray(solveh_banded(bands, right, lower=True))
    if floor is None:
        return path
    # The lowest of those that stand is on the floor.
    both = np.zeros((count, against.shape[1]), bool)
    both[1:] |= stands
    both[:-1] |= stands
    lowest = np.where(both, against[..., 1], np.inf).min(axis=1)
    on = np.isfinite(lowest)
    bands[0] += on_floor * on
    right[on, 1] += on_floor * (floor - lowest)[on]
    path[:, 1] = solveh_banded(bands, right[:, 1], lower=True)
    return path
