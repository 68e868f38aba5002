"""Making things missing, for training and tests: masks of what stays *observed* (True = known)."""

from __future__ import annotations

import numpy as np


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
