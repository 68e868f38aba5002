"""How much a motion trembles: fourth differences tell it, in which captured motion all but vanishes."""

from __future__ import annotations

import numpy as np
from scipy import ndimage
from scipy.special import gammaincinv

from interpose.clip import Clip
from interpose.geometry import rotations
from interpose.geometry.time import runs
from interpose.skeletons import find_mapping

# The fourth difference of a signal: weights, and how much it amplifies white noise.
DIFFERENCE = np.array([1.0, -4.0, 6.0, -4.0, 1.0])
GAIN = float(np.linalg.norm(DIFFERENCE))
# The median length of three coordinates of white noise of deviation 1: of a chi distribution.
LENGTH = float(np.sqrt(2 * gammaincinv(3 / 2, 0.5)))
FEWEST = 8  # frames: less motion cannot be told from noise
# Frames a second: with fewer, what is quick jumps from one to the next as noise does. Clean clips at 24 are
# moved by .4 cm at most, some at 20 by 24 cm.
SLOWEST = 23.0
# Metres by which joints of a body of usual size tremble, in the mean, in frames that are noisy by themselves:
# the median within so many seconds. Of 142 clips of all data sets one trembles by as much, in fits. A clip of
# which more is noisy is so all along, and the median of all of it tells its noise.
NOISY, WINDOW, MOSTLY = 0.006, 0.5, 0.6
# Radians by which a joint alone turns to and fro in such frames: at SLOW frames a second, less with more, and
# at least; and so many times as much as it does in the rest. Of 276 clips of all data sets 17 tremble so, ten
# of them of one set, in fits that can be seen; the others in hands, toes and thumbs.
TURNS, SLOW, FINEST, STANDS_OUT = np.radians(3.5), 30.0, np.radians(1.5), 5.0
# Fourth differences of white noise are 3.4 times its second ones (the roots of 70 and of 6), those of a
# smooth wave of four times a second, at 30 frames, .7: what has few of them is motion. Of 80 joints of
# Bandai-Namco's clips that tremble by 4 to 9 degrees the least has 2.95 times, of three that wave and drum in
# 500 of its clips the most has 2.65; one, at 2.97, is taken for noise.
TREMOR = 2.75


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
    if not _tells(clip):
        return []
    places = clip.positions()[:, body_of(clip)]
    limit = NOISY * find_mapping(clip.skeleton).size
    return _ranges(trembling(places).mean(axis=1, keepdims=True), limit, clip, 1.0)[0]


def body_of(clip: Clip) -> list[int]:
    """The joints whose mean tells of a body: without the fingers, props and lights that a file may have, too;
    all of what is no humanoid."""
    mapping = find_mapping(clip.skeleton)
    return list(mapping.mapped[1]) if mapping.usable else [*range(len(clip.skeleton))]


def restless(clip: Clip) -> list[tuple[int, int, tuple[int, ...]]]:
    """The frames start to stop - 1 in which some joints turn to and fro by themselves, and these joints.

    Of clips as for `bursts`, and outside of these: joints whose frames meet are told together. What trembles
    for the most part does so in all frames.
    """
    if not _tells(clip):
        return []
    turns = 2 * trembling(rotations.continuous(clip.rotation))
    least, usual = max(FINEST, TURNS * SLOW / clip.fps), np.median(turns, axis=0)
    known = bursts(clip)
    alone = [
        (start, stop, joint)
        for joint, found in enumerate(_ranges(turns, np.maximum(least, STANDS_OUT * usual), clip, 0.5))
        for start, stop in found
        if not any(start < b and a < stop for a, b in known) and _is_tremor(clip.rotation[start:stop, joint])
    ]
    together: list[tuple[int, int, tuple[int, ...]]] = []
    for start, stop, joint in sorted(alone):
        if together and start < together[-1][1]:
            first, last, others = together.pop()
            together.append((first, max(last, stop), tuple(sorted({*others, joint}))))
        else:
            together.append((start, stop, (joint,)))
    always = tuple(j for j in np.flatnonzero(usual > least).tolist() if _is_tremor(clip.rotation[:, j]))
    return [(0, len(clip), always)] * bool(always) + together


def _is_tremor(turns: np.ndarray) -> bool:
    """Whether rotations (F, 4) go to and fro from frame to frame, and not in waves."""
    own = rotations.continuous(turns)
    second, fourth = (np.linalg.norm(np.diff(own, order, axis=0), axis=-1) for order in (2, 4))
    return bool(np.median(fourth) > TREMOR * np.median(second[1:-1]))


def _window(clip: Clip) -> int:
    return max(FEWEST, round(WINDOW * clip.fps)) | 1


def _tells(clip: Clip) -> bool:
    """Whether what is noisy can be told from what is not."""
    return len(clip) >= 2 * _window(clip) and clip.fps >= SLOWEST


def _ranges(
    much: np.ndarray, limit: float | np.ndarray, clip: Clip, shortest: float
) -> list[list[tuple[int, int]]]:
    """For each signal that trembles so much (F - 4, n) the frames in which it does by more than the limit
    (n,), for longer than a share `shortest` of the window; none for one that does for the most part."""
    window, half = _window(clip), (len(clip) - len(much)) // 2
    local = ndimage.median_filter(much, size=(window, 1), mode="reflect")
    noisy = np.pad(local > limit, ((half, len(clip) - len(local) - half), (0, 0)), mode="edge")
    # Where the medians of a window begin to tell, half of it is noisy.
    noisy = ndimage.binary_dilation(noisy, np.ones((5, 1)))
    found = [[run for run in runs(column) if run[1] - run[0] > shortest * window] for column in noisy.T]
    return [some if sum(b - a for a, b in some) < MOSTLY * len(clip) else [] for some in found]
