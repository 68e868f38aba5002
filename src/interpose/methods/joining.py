"""What a network says of a joint while knowledge of others comes or goes: one motion, without a step.

A network that hears of the rest of a body all at once, as where that comes back and an arm does not yet, may
think otherwise of the arm from one frame to the next.
"""

from __future__ import annotations

import numpy as np

from interpose.geometry.time import ease, runs
from interpose.geometry.values import moved, offset

# Seconds in which a step fades.
FADE = 0.3
# Frames by which changes of what is known are apart that are told from one another.
ALONE = 3


def joined(values: np.ndarray, known: np.ndarray, changes: np.ndarray, fps: float) -> np.ndarray:
    """The values, led on through changes at the velocity around, where they are missing on both sides; what
    that differs fades towards both ends of their run.

    Args:
        values: (T, n, 4) quaternions, or (T, n, 3) vectors.
        known: (T, n) which are known: they stay as they are.
        changes: (m,) frames before which it changes what is known, of anything.
        fps: of the T frames.
    """
    far = np.diff(changes, prepend=-ALONE, append=len(values) + ALONE) >= ALONE
    alone = changes[far[:-1] & far[1:]]
    done = values.copy()
    for column in range(values.shape[1]):
        for start, stop in runs(~known[:, column]):
            said, added = values[start:stop, column], np.zeros((stop - start, 3))
            for change in alone[(alone > start + 1) & (alone < stop - 1)] - start:
                near = said[change - 2 : change + 2]
                last, step, following = offset(near[:-1], near[1:])
                room = np.array([change, stop - start - change])
                shares = np.minimum(room, FADE * fps)
                before, after = (_fade(frames, fps) for frames in room)
                ways = np.concatenate([shares[0] * before[::-1], -shares[1] * after]) / shares.sum()
                added += ways[:, None] * (step - (last + following) / 2)
            done[start:stop, column] = moved(said, added)
    return done


def _fade(room: int, fps: float) -> np.ndarray:
    """(room,) from one to zero, smoothly."""
    x = np.minimum(np.arange(room) / min(room, FADE * fps), 1.0)
    return 1 - ease(x)
