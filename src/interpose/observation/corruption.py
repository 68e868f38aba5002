"""Making things missing, for training and tests: masks of what stays *observed* (True = known).

All masks are (batch, frames, joints) booleans from a NumPy generator, the same for the same seed. They
combine: `a & b` misses what either misses, `a | b` only what both do (a limb within a gap).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from interpose.skeletons import JOINTS

# Legs and arms of the canonical skeleton, as joint indices.
LIMBS: tuple[tuple[int, ...], ...] = tuple(
    tuple(JOINTS.index(side + part) for part in parts)
    for side in ("Left", "Right")
    for parts in (("UpLeg", "Leg", "Foot", "Toe"), ("Shoulder", "Arm", "ForeArm", "Hand"))
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


def gaps_mask(
    rng: np.random.Generator, batch: int, frames: int, joints: int, mean: float, sigma: float, most: int = 3
) -> np.ndarray:
    """One to `most` gaps of whole poses per clip, each as in `gap_mask`; they may touch or overlap."""
    count = rng.integers(1, most + 1, batch)
    known = np.ones((batch, frames, joints), bool)
    for i in range(most):
        known &= gap_mask(rng, batch, frames, joints, mean, sigma) | (count <= i)[:, None, None]
    return known


def joints_per_frame_mask(
    rng: np.random.Generator, batch: int, frames: int, joints: int, probability: float
) -> np.ndarray:
    """Each joint but the root (joint 0) missing in each frame with `probability`, independently.

    Source: Kaufmann et al. 2020, section 4.1 (de-noising), with probabilities of .3 and .5.
    """
    known = rng.random((batch, frames, joints), dtype=np.float32) >= probability
    known[:, :, 0] = True
    return known


def limb_mask(
    rng: np.random.Generator,
    batch: int,
    frames: int,
    joints: int = len(JOINTS),
    limbs: Sequence[Sequence[int]] = LIMBS,
) -> np.ndarray:
    """One of the `limbs` (joint indices) per clip missing over all its frames."""
    table = np.ones((len(limbs), joints), bool)
    for row, limb in zip(table, limbs):
        row[list(limb)] = False
    return np.repeat(table[rng.integers(len(limbs), size=batch)][:, None, :], frames, axis=1)


def frames_mask(
    rng: np.random.Generator, batch: int, frames: int, joints: int, probability: float
) -> np.ndarray:
    """Each whole frame but the first and last missing with `probability`, independently."""
    known = rng.random((batch, frames), dtype=np.float32) >= probability
    known[:, [0, -1]] = True
    return np.repeat(known[:, :, None], joints, axis=2)


def gaussian_noise(rng: np.random.Generator, positions: np.ndarray, sigma: float) -> np.ndarray:
    """Positions (..., 3) in metres with independent noise N(0, sigma^2) on every coordinate, same precision.

    Source: Kaufmann et al. 2020, section 4.1; a sigma of 1 there is .0625 m here.
    """
    noise = rng.standard_normal(positions.shape, dtype=np.float32)
    return positions + noise.astype(positions.dtype) * positions.dtype.type(sigma)
