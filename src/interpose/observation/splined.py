"""Joints that turn along a curve of a program: eased, or splined from one real pose to another.

Curves of keys, whether of angles or quaternions, are polynomials or close to them; recorded motion trembles.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy import ndimage

from interpose.clip import Clip
from interpose.geometry import rotations
from interpose.geometry.time import runs

# A polynomial of this degree, over so many seconds, misses curves of programs by less than this share of the
# way that a joint turns meanwhile (RMS), and recorded motion by more: of 27 limbs, of all data sets, that
# were led over .5 to 1.2 s it finds 24 splined in angles, 24 splined in quaternions and 23 eased from pose to
# pose; in 420 clips, 203,000 frames, none that no one has put there.
DEGREE, WINDOW, OFF = 5, 0.4, 4e-4
LEAST = 9  # frames of a window: what six numbers draw tells nothing of fewer
SLOW = np.radians(4.0)  # that it turns in a window, at least
# A joint that does so in more than this share of the frames in which it turns was animated so; nor is a joint
# recorded that else is not off by so many times more, in the median.
ANIMATED, RECORDED = 0.5, 5.0
AGAIN = 0.03  # seconds for which windows must fit, one after the other
NEAR = 0.1  # seconds by which those of a limb may begin before, or end after, the one that does so longest
ALONE = 0.8  # seconds for which a joint must do so where none that it hangs from does: shins bend smoothly


def splined(clip: Clip) -> Iterator[tuple[tuple[int, ...], int, int]]:
    """Joints that turn along a curve of a program, and the frames start to stop - 1 in which they do."""
    window = max(round(WINDOW * clip.fps) // 2 * 2 + 1, LEAST)
    if len(clip) < window:
        return
    off, way = _off(rotations.continuous(clip.rotation), window)
    moves = way > SLOW
    fits = moves & (off < OFF * way)
    found = [
        (joint, start, stop + window - 1)
        for joint in np.flatnonzero(fits.sum(axis=0) <= ANIMATED * moves.sum(axis=0)).tolist()
        if _recorded(off[:, joint], way[:, joint], moves[:, joint] & ~fits[:, joint])
        for start, stop in runs(fits[:, joint])
        if stop - start >= max(2, round(AGAIN * clip.fps))
    ]
    near = max(3, round(NEAR * clip.fps))
    found.sort(key=lambda one: one[1] - one[2])
    while found:
        _, start, stop = found[0]
        alike = [one for one in found if one[1] >= start - near and one[2] <= stop + near]
        found = [one for one in found if one not in alike]
        joints = {one[0] for one in alike}
        limb = any(joints.intersection(clip.skeleton.ancestors(joint)) for joint in joints)
        if limb or stop - start >= ALONE * clip.fps:
            yield tuple(sorted(joints)), start, stop


def _recorded(off: np.ndarray, way: np.ndarray, windows: np.ndarray) -> bool:
    """Whether a joint trembles as bodies do in the windows that are meant; `off` and `way` as from `_off`."""
    return bool(windows.any() and np.median(off[windows] / way[windows]) > RECORDED * OFF)


def _off(turned: np.ndarray, window: int) -> tuple[np.ndarray, np.ndarray]:
    """What the best polynomials leave of rotations (F, J, 4) in each window, RMS in radians, and the way that
    they turn meanwhile: both (F - window + 1, J)."""
    frames = len(turned) - window + 1
    flat = turned.reshape(len(turned), -1)
    curves, _ = np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, window), DEGREE + 1))
    left = _sums(flat * flat, window)
    for curve in curves.T:
        share = ndimage.correlate1d(flat, curve, axis=0, mode="constant")[window // 2 :][:frames]
        left -= share * share
    left = left.reshape(frames, *turned.shape[1:]).sum(axis=-1)
    steps = 2.0 * np.linalg.norm(np.diff(turned, axis=0), axis=-1)
    return 2.0 * np.sqrt(np.maximum(left, 0.0) / window), _sums(steps, window - 1)


def _sums(values: np.ndarray, window: int) -> np.ndarray:
    """Sums of values (F, n) over windows of frames: (F - window + 1, n)."""
    along = np.cumsum(np.pad(values, ((1, 0), (0, 0))), axis=0)
    return np.asarray(along[window:] - along[:-window])
