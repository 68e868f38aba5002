"""Clips at other frame rates, and with the frames that a recorder dropped."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np

from interpose.clip import Clip
from interpose.errors import unfit
from interpose.geometry.time import (
    check_rate,
    sample,
    sample_rotations,
    sample_rotations_smooth,
    sample_smooth,
)

# Frames that are resampled at once.
BLOCK = 4096


def resample(clip: Clip, fps: float, smooth: bool = False) -> Clip:
    """The clip at another frame rate.

    The first frame stays the first, and the last sample is the last one that does not lie after the old
    last frame: (F - 1) / fps seconds apart when the rates divide. Rotations are interpolated by SLERP and
    translations linearly, or both with continuous velocities (`smooth`). Frames that fall on old ones are
    those, unchanged, and keep the text of their numbers where the clip is written again.

    Raises RequestError for what is no clip, and when `fps` is no frame rate.
    """
    if not hasattr(clip, "with_motion"):
        raise unfit("clip", clip, "a clip: interpose.load reads one")
    check_rate(fps)
    fps = float(fps)
    if not len(clip):
        return replace(clip, fps=fps)
    # Files round the frame time (0.033333 s): rates that are that close to a simple ratio mean it, or else
    # frames that belong together would drift apart. 29.97 and 30 are ten times as far from each other.
    step = clip.fps / fps
    simple = float(Fraction(step).limit_denominator(100))
    step = simple if abs(simple - step) < 1e-4 * step else step
    times = np.arange(int(np.floor((len(clip) - 1) / step + 1e-6)) + 1) * step
    nearest = np.round(times)
    times = np.where(abs(times - nearest) < 1e-6, nearest, times)
    turn, move = (sample_rotations_smooth, sample_smooth) if smooth else (sample_rotations, sample)
    rotation = np.empty((len(times), *clip.rotation.shape[1:]))
    translation = np.empty((len(times), *clip.translation.shape[1:]))
    # In blocks, so that what a long clip needs beside its result stays small. The frames that a block needs
    # reach one further than the neighbours: smooth sampling takes velocities from there.
    for start in range(0, len(times), BLOCK):
        some = slice(start, start + BLOCK)
        first = max(int(times[some][0]) - 1, 0)
        last = int(times[some][-1]) + 3
        rotation[some] = turn(clip.rotation[first:last], times[some] - first)
        translation[some] = move(clip.translation[first:last], times[some] - first)
    new = np.flatnonzero(times == nearest)
    old = nearest[new].astype(int)
    rotation[new], translation[new] = clip.rotation[old], clip.translation[old]
    kept = np.where(times == nearest, nearest, -1).astype(int)
    source = clip.source.take(kept) if clip.source is not None else None
    return replace(clip, rotation=rotation, translation=translation, fps=fps, source=source)


def spread(clip: Clip, again: np.ndarray) -> Clip:
    """The clip without the frames (F,) that are `again` what the one before is; as long as it was.

    Those left are laid evenly over the frames that they had, as of film in video; where they come too
    irregularly for that, as when a recorder drops frames, each stays where it is. In between the motion is
    interpolated with continuous velocities.
    """
    kept = np.flatnonzero(~again)
    held = np.flatnonzero(np.diff(kept) > 1) + 1  # those that come later than by one
    if not len(held):
        return clip
    times = np.interp(np.arange(len(clip)), _due(kept, int(held[0]), int(held[-1])), np.arange(len(kept)))
    rotation = sample_rotations_smooth(clip.rotation[kept], times)
    return replace(clip, rotation=rotation, translation=sample_smooth(clip.translation[kept], times))


def _due(kept: np.ndarray, first: int, last: int) -> np.ndarray:
    """When samples were due that are seen at frames `kept` (n,), of which some up to `first` and from `last`
    on may lie as close as frames do, and those in between do not."""
    line = kept[first] + (np.arange(len(kept)) - first) * (kept[last] - kept[first]) / max(last - first, 1)
    late = kept - line
    # Of samples that come at an even pace none is seen later than others by a whole frame.
    if np.ptp(late[first : last + 1]) >= 1.0:
        return kept.astype(float)
    start = 0 if np.ptp(late[: last + 1]) < 1.0 else first
    stop = len(kept) if np.ptp(late[start:]) < 1.0 else last + 1
    if stop - start == len(kept):
        line = line + late[0]  # the first frame stays the first
    return np.concatenate([kept[:start], line[start:stop], kept[stop:]])
