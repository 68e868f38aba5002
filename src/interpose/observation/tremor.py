"""How much a motion trembles: fourth differences tell it, in which captured motion all but vanishes."""

from __future__ import annotations

import numpy as np
from scipy import ndimage
from scipy.special import gammaincinv

from interpose.clip import Clip
from interpose.geometry.time import runs

# The fourth difference of a signal: weights, and how much it amplifies white noise.
DIFFERENCE = np.array([1.0, -4.0, 6.0, -4.0, 1.0])
GAIN = float(np.linalg.norm(DIFFERENCE))
# The median length of three coordinates of white noise of deviation 1: of a chi distribution.
LENGTH = float(np.sqrt(2 * gammaincinv(3 / 2, 0.5)))
FEWEST = 8  # frames: less motion cannot be told from noise
# Frames a second: with fewer, what is quick jumps from one to the next as noise does. Clean clips at 24 are
# moved by .4 cm at most, some at 20 by 24 cm.
SLOWEST = 23.0
# Metres by which joints tremble, in the mean, in frames that are noisy by themselves: the median within so
# many seconds. Of 142 clips of all data sets one trembles by as much, in fits. A clip of which more is noisy
# is so all along, and the median of all of it tells its noise.
NOISY, WINDOW, MOSTLY = 0.006, 0.5, 0.6


def deviation(values: np.ndarray) -> np.ndarray:
    """(n,) the standard deviation of white noise in each coordinate of signals (F, n, d) of a motion.

    The median tells it, so that landings and other jolts do not count. Quaternions have three coordinates.
    """
    return np.asarray(np.median(trembling(values), axis=0))


def trembling(values: np.ndarray) -> np.ndarray:
    """(F - 4, n) by what signals (F, n, d) tremble: its median is the standard deviation of white noise."""
    fourth = sum(w * values[i : len(values) - 4 + i] for i, w in enumerate(DIFFERENCE))
    return np.asarray(np.linalg.norm(fourth, axis=-1) / GAIN / LENGTH)


def bursts(clip: Clip) -> list[tuple[int, int]]:
    """The frames start to stop - 1 of a clip that are noisy, where others are not.

    What trembles in all of it does not tell of them: there are none in a clip that is noisy for the most
    part, in a short one, and in one of too few frames a second.
    """
    window = max(FEWEST, round(WINDOW * clip.fps)) | 1
    if len(clip) < 2 * window or clip.fps < SLOWEST:
        return []
    local = ndimage.median_filter(trembling(clip.positions()).mean(axis=1), size=window, mode="nearest")
    half = (len(clip) - len(local)) // 2
    noisy = np.pad(local, (half, len(clip) - len(local) - half), mode="edge") > NOISY
    # Where the medians of a window begin to tell, half of it is noisy.
    found = [run for run in runs(ndimage.binary_dilation(noisy, iterations=2)) if run[1] - run[0] > window]
    return found if sum(stop - start for start, stop in found) < MOSTLY * len(clip) else []
