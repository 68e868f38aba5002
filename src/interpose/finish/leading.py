"""A spline leads over a place where a motion does what no body does, over as few frames as mend it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from interpose.clip import Clip
from interpose.methods.classical import Spline
from interpose.observation import Observation


class Led(NamedTuple):
    """A clip with a spline in frames start to stop - 1, and how far that is off: 1 or less is mended."""

    off: float
    clip: Clip
    start: int
    stop: int


def led_over(
    clip: Clip,
    known: Observation,
    inner: tuple[int, int],
    place: tuple[int, int],
    reaches: Sequence[float],
    off: Callable[[Clip, int, int], float],
    joints: Sequence[int] | None = None,
) -> Led | None:
    """The clip with a spline around a place where values are unknown, over as few frames as mend it, or else
    those with which it is off least; None where nothing is left to start from.

    Args:
        inner, place: frames start to stop - 1 of the gap, and of what is to be mended in it.
        reaches: seconds on either side, in order.
        off: how far a clip is off in which a spline leads over frames start to stop - 1; 1 is mended.
        joints: those that are led; None for the whole pose and its place.
    """
    found: list[Led] = []
    for seconds in reaches:
        half = max(1, round(seconds * clip.fps))
        start, stop = max(inner[0], place[0] - half), min(inner[1], place[1] + half)
        rotation, translation = np.ones_like(known.rotation), np.ones_like(known.translation)
        rotation[start:stop, slice(None) if joints is None else list(joints)] = False
        if joints is None:
            translation[start:stop] = False
        seen = Observation(known.rotation | rotation, known.translation | translation)
        if not (seen.rotation.any(axis=0).all() and seen.translation.any(axis=0).all()):
            break
        done = Spline().complete(clip, seen).clip
        found.append(Led(off(done, start, stop), done, start, stop))
        if found[-1].off <= 1:
            break
    return min(found, key=lambda one: one.off, default=None)
