"""Whole frames that are shown more than once: dropped ones, and motion of fewer frames a second than the file
says."""

from __future__ import annotations

import numpy as np

from interpose.clip import Clip
from interpose.geometry.time import runs
from interpose.observation.finding import Finding
from interpose.observation.steps import Steps

# Runs of so many equal frames are repeated ones where that happens in such a share of all frames.
REPEATS, REPEATING = 3, 0.04
HOLDS, MOSTLY = 0.3, 0.5  # or runs of so many seconds, in such a share: motion that was animated in steps
LEAST = 5  # of either, in a clip
# Metres a second, in the mean over joints, at which a body moves before and after a frame that is doubled.
MOVES = 0.2


def repeats(clip: Clip) -> np.ndarray:
    """(F,) booleans: the frames that "repeated" of `scan` counts, which are the one before."""
    again, steps = np.zeros(len(clip), bool), Steps.of(clip)
    for start, stop in _holds(steps):
        again[steps.first + start + 1 : steps.first + stop + 1] = True
    return again


def repeated(steps: Steps) -> list[Finding]:
    """Frames that are the one before though the body moves: one finding."""
    brief = _holds(steps)
    if not brief:
        return []
    fps, again = steps.clip.fps, sum(stop - start for start, stop in brief)
    start, stop = brief[0][0], brief[-1][1]
    real = fps * (1 - again / (stop - start))
    note = f"{again} frames are the one before: {real:.0f} frames a second, in a file of {fps:.4g}"
    return [Finding("repeated", None, steps.first + start + 1, steps.first + stop + 1, note)]


def but_repeated(findings: list[Finding], again: list[Finding], fps: float) -> list[Finding]:
    """`findings` without what stands still for a moment, again and again, where frames are repeated."""
    brief = round(HOLDS * fps)
    for whole in again:
        findings = [
            one
            for one in findings
            if one.kind not in ("frozen", "still")
            or len(one) > brief
            or one.stop < whole.start - 1
            or one.start > whole.stop + 1
        ]
    return findings


def doubled(steps: Steps) -> list[Finding]:
    """Single frames, or a few, that are the one before though the body moves."""
    found, still = [], steps.resting
    for start, stop in runs(still):
        # The frame that is shown again, and the last that is it.
        before, after = steps.first + start, steps.first + stop
        if stop - start >= steps.shortest or start == 0 or stop == len(still):
            continue
        if min(pace(steps.clip, before - 1), pace(steps.clip, after)) >= MOVES:
            note = "the frame before once more, while the body moves"
            found.append(Finding("doubled", None, before + 1, after + 1, note))
    return found


def pace(clip: Clip, frame: int) -> float:
    """Metres a second, in the mean over all joints, from a frame to the next."""
    step = np.diff(clip.slice(frame, frame + 2).positions(), axis=0)
    return float(np.linalg.norm(step, axis=-1).mean() * clip.fps)


def _holds(steps: Steps) -> list[tuple[int, int]]:
    """Runs of steps in which nothing moves, again and again; none where that is the exception."""
    same = steps.resting
    for longest, often in ((REPEATS, REPEATING), (round(HOLDS * steps.clip.fps), MOSTLY)):
        brief = [run for run in runs(same) if run[1] - run[0] <= longest]
        inside = [run for run in brief if run[0] > 0 and run[1] < len(same)]
        again = sum(stop - start for start, stop in inside)
        if len(inside) >= LEAST and again >= often * (inside[-1][1] - inside[0][0]):
            return brief
    return []
