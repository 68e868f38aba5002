"""Ranges of frames, and smooth steps over them."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from interpose.geometry.time import runs

# Share of the frames over which a lift comes that it is spread by.
SOFT = 0.5


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


def spread(lift: np.ndarray, over: float) -> np.ndarray:
    """A lift (F,) that is nowhere less but comes and goes over some frames."""
    reach = max(1, round(SOFT * over))
    wide = ndimage.maximum_filter1d(lift, 2 * reach + 1, mode="nearest")
    return ndimage.gaussian_filter1d(wide, reach / 2, mode="nearest")


def rounded(depth: np.ndarray, sink: float) -> np.ndarray:
    """How far to lift what lies `depth` below the floor: max(depth, 0), its corner rounded off by `sink`."""
    return np.where(depth > sink, depth, np.maximum(depth + sink, 0.0) ** 2 / (4 * sink))


def envelope(movable: np.ndarray, over: float) -> tuple[np.ndarray, np.ndarray]:
    """Two shares (F,): away from the seam before, and towards the one after, of each run of movable frames.

    0 where nothing may move, growing smoothly to 1 over `over` frames; an end of the clip is no seam.
    """
    frames = len(movable)
    away, towards = np.zeros(frames), np.zeros(frames)
    for start, stop in runs(movable):
        time = np.arange(start, stop)
        away[start:stop] = ramp((time - start + 1) / over) if start > 0 else 1.0
        towards[start:stop] = ramp((stop - time) / over) if stop < frames else 1.0
    return away, towards
