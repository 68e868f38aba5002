"""Ranges of frames, and smooth steps over them."""

from __future__ import annotations

import numpy as np


def grow(flags: np.ndarray, by: int) -> np.ndarray:
    """`flags` (F, ...) also True up to `by` frames before and after."""
    grown = flags.copy()
    for shift in range(1, min(by, len(flags) - 1) + 1):
        grown[shift:] |= flags[:-shift]
        grown[:-shift] |= flags[shift:]
    return grown


def ramp(x: np.ndarray) -> np.ndarray:
    """A smooth step: 0 up to x = 0, 1 from x = 1, with zero slope and curvature at both."""
    x = np.clip(x, 0.0, 1.0)
    return x * x * x * (x * (6.0 * x - 15.0) + 10.0)
