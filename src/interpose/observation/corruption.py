"""Making things missing, for training and tests: masks of what stays *observed* (True = known).

All masks are (batch, frames, joints) booleans from a NumPy generator, the same for the same seed; only noisy
transmission tells coordinates apart. They combine: `a & b` misses what either misses, `a | b` only what both
do (a limb within a gap).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from interpose.skeletons import JOINTS, PARENTS

# Legs and arms of the canonical skeleton, as joint indices.
LIMBS: tuple[tuple[int, ...], ...] = tuple(
    tuple(JOINTS.index(side + part) for part in parts)
    for side in ("Left", "Right")
    for parts in (("UpLeg", "Leg", "Foot", "Toe"), ("Shoulder", "Arm", "ForeArm", "Hand"))
)
# The same with the joint that each hangs from, head and trunk: chains that make up the whole body.
CHAINS: tuple[tuple[int, ...], ...] = (
    *((PARENTS[limb[0]], *limb) for limb in LIMBS),
    tuple(map(JOINTS.index, ("Spine2", "Neck", "Head"))),
    tuple(map(JOINTS.index, ("Hips", "Spine", "Spine1", "Spine2"))),
)


def gap_mask(
    rng: np.random.Generator, batch: int, frames: int, joints: int, mean: float, sigma: float
) -> np.ndarray:
    """One gap of whole poses per clip, its length drawn from N(mean, sigma^2), its place uniformly.

    Returns (batch, frames, joints) booleans; at least one frame is missing and the first and last stay.
    Source: Kaufmann et al. 2020, section 3.3.
    """
    length = np.clip(np.rint(rng.normal(mean, sigma, batch)), 1, frames - 2)
    start = rng.uniform(1, frames - length).astype(int)
    time = np.arange(frames)
    known = (time < start[:, None]) | (time >= start[:, None] + length[:, None])
    return np.repeat(known[:, :, None], joints, axis=2)


def joints_mask(
    rng: np.random.Generator, batch: int, frames: int, joints: int, most: int = 3, fewest: int = 1
) -> np.ndarray:
    """`fewest` to `most` joints per clip missing over all its frames; never the root (joint 0).

    Returns (batch, frames, joints) booleans. Source: Kaufmann et al. 2020, section 3.3.
    """
    order = np.argsort(rng.random((batch, joints - 1)), axis=1)
    known = np.ones((batch, joints), bool)
    known[:, 1:] = order >= rng.integers(fewest, most + 1, (batch, 1))
    return np.repeat(known[:, None, :], frames, axis=1)


def joints_per_frame_mask(
    rng: np.random.Generator, batch: int, frames: int, joints: int, probability: float
) -> np.ndarray:
    """Each joint but the root (joint 0) missing in each frame with `probability`, independently.

    Source: Kaufmann et al. 2020, section 4.1 (de-noising), with probabilities of .3 and .5.
    """
    known = rng.random((batch, frames, joints), dtype=np.float32) >= probability
    known[:, :, 0] = True
    return known


def occluded_joints_mask(
    rng: np.random.Generator,
    batch: int,
    frames: int,
    joints: int,
    share: float,
    per_frame: bool = False,
    repeats: bool = False,
) -> np.ndarray:
    """A share of the joints, the root too, missing in all frames but the first and last.

    Args:
        share: 0 to 1, of the joints, rounded to whole ones.
        per_frame: drawn anew for every frame; else for the clip.
        repeats: so many are drawn with replacement, as in the public code; with a share of .8 about .55 go.

    Source of this mask and the next three: Hernandez Ruiz et al. 2019, table 3. Its caption says that joints
    and limbs are drawn for each frame, its code draws them for the clip.
    """
    drawn = _drawn(rng, (batch, frames if per_frame else 1, joints), share, repeats)
    return _inside(~drawn, frames)


def occluded_chains_mask(
    rng: np.random.Generator,
    batch: int,
    frames: int,
    joints: int,
    share: float,
    per_frame: bool = False,
    chains: Sequence[Sequence[int]] = CHAINS,
) -> np.ndarray:
    """Whole chains of joints missing in all frames but the first and last: one after the other, in random
    order, until at least a share of all joints is.

    Args:
        share: 0 to 1, of the joints; no more than the chains hold.
        per_frame: drawn anew for every frame; else for the clip.
        chains: joint indices; they may share joints.
    """
    table = np.zeros((len(chains), joints), bool)
    for row, chain in zip(table, chains):
        row[list(chain)] = True
    order = rng.random((batch, frames if per_frame else 1, len(chains))).argsort(axis=-1)
    missing = np.logical_or.accumulate(table[order], axis=2)
    enough = (missing.sum(axis=-1) >= share * joints).argmax(axis=-1)
    return _inside(~np.take_along_axis(missing, enough[..., None, None], axis=2)[:, :, 0], frames)


def missing_frames_mask(
    rng: np.random.Generator, batch: int, frames: int, joints: int, share: float, repeats: bool = False
) -> np.ndarray:
    """A share of the frames between first and last missing; `repeats` as in `occluded_joints_mask`."""
    known = np.ones((batch, frames), bool)
    known[:, 1:-1] = ~_drawn(rng, (batch, frames - 2), share, repeats)
    return np.repeat(known[:, :, None], joints, axis=2)


def noisy_transmission_mask(
    rng: np.random.Generator, batch: int, frames: int, joints: int, share: float, by_joint: bool = False
) -> np.ndarray:
    """Single coordinates missing, a share of all between the first and the last frame.

    Args:
        share: 0 to 1.
        by_joint: joints are missing with all their coordinates, each in each frame with that probability, as
            in the public code.

    Returns:
        (batch, frames, joints, 3) booleans.
    """
    known = np.ones((batch, frames, joints, 3), bool)
    if by_joint:
        known[:, 1:-1] = rng.random((batch, frames - 2, joints, 1)) >= share
    else:
        drawn = _drawn(rng, (batch, (frames - 2) * joints * 3), share)
        known[:, 1:-1] = ~drawn.reshape(batch, frames - 2, joints, 3)
    return known


def _drawn(
    rng: np.random.Generator, shape: tuple[int, ...], share: float, repeats: bool = False
) -> np.ndarray:
    """Booleans of a shape (..., n): a share of the n True, exactly or drawn with replacement."""
    if not repeats:
        return np.less(rng.random(shape).argsort(axis=-1), round(share * shape[-1]))
    drawn = np.zeros(shape, bool)
    picked = rng.integers(shape[-1], size=(*shape[:-1], int(share * shape[-1])))
    np.put_along_axis(drawn, picked, True, axis=-1)
    return drawn


def _inside(known: np.ndarray, frames: int) -> np.ndarray:
    """The mask (B, T or 1, J) for all frames, with everything known in the first and the last."""
    known = np.broadcast_to(known, (len(known), frames, known.shape[2])).copy()
    known[:, [0, -1]] = True
    return known


def gaussian_noise(rng: np.random.Generator, positions: np.ndarray, sigma: float) -> np.ndarray:
    """Positions (..., 3) in metres with independent noise N(0, sigma^2) on every coordinate, same precision.

    Source: Kaufmann et al. 2020, section 4.1; a sigma of 1 there is .0625 m here.
    """
    noise = rng.standard_normal(positions.shape, dtype=np.float32)
    return positions + noise.astype(positions.dtype) * positions.dtype.type(sigma)
