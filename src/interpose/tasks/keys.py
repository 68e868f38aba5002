"""The motion between key poses."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from interpose.clip import Clip
from interpose.errors import RequestError, is_number
from interpose.finish import Completion
from interpose.methods.protocol import Method
from interpose.observation import Gap, Observation, Pin
from interpose.observation.observation import frame_number
from interpose.tasks.filling import fill
from interpose.tasks.windows import raw_part


def between(
    clip: Clip,
    keys: Sequence[int],
    action: str = "",
    method: str | Path | Method = "auto",
    seed: int | None = None,
    progress: Callable[[float], None] | None = None,
    cut: bool = False,
    path: Mapping[int, Any] | None = None,
    pins: Sequence[Pin] = (),
) -> Completion:
    """Generate all that lies between key frames of a clip; the keys come back unchanged.

    Args:
        clip: its poses between the keys have no influence; what lies before the first and after the last key
            stays as it is.
        keys: frame numbers, two or more, in any order.
        action: what the motion is, for methods that know actions.
        method, seed, progress: as in `fill`.
        cut: give back what lies from the first key to the last alone.
        path, pins: as in `fill`.

    Raises:
        RequestError: too few keys, one outside of the clip, nothing between them, an unknown action.
    """
    chosen = sorted({frame_number(key) for key in ([keys] if is_number(keys) else keys)})
    if bad := [key for key in chosen if not 0 <= key < len(clip)]:
        raise RequestError(
            f"there is no frame {bad[0]}",
            f"the clip has {len(clip)} frames, counted from 0",
            f"Choose keys from 0 to {len(clip) - 1}.",
        )
    gaps = [Gap(a + 1, b) for a, b in zip(chosen, chosen[1:]) if b > a + 1]
    if not gaps:
        raise RequestError(
            "there is nothing between the keys",
            f"the keys are {', '.join(map(str, chosen))}" if chosen else "no keys are given",
            "Give keys with frames between them: --keys 0,30,75. For poses of two files: --start, --target.",
        )
    zero, stop = (chosen[0], chosen[-1] + 1) if cut else (0, len(clip))
    done = fill(
        clip,
        Observation.without(clip, gaps),
        method,
        seed=seed,
        progress=progress,
        action=action,
        path=path,
        pins=pins,
        zero=zero,
    )
    return _part(done, zero, stop) if cut else done


def _part(done: Completion, start: int, stop: int) -> Completion:
    """The frames start to stop - 1 of a completion, all of its gaps among them."""
    reports = [replace(gap, start=gap.start - start, stop=gap.stop - start) for gap in done.report.gaps]
    return Completion(
        done.clip.slice(start, stop),
        lambda: raw_part(done.raw, start, stop),
        done.provenance[start:stop],
        replace(done.report, gaps=reports),
    )


def block(poses: Mapping[int, Clip]) -> Clip:
    """A clip from poses by frame: the key frames that `between` goes by. Each pose holds until the next.

    Args:
        poses: clips of one frame on skeletons with the same joints, frame 0 among them: its skeleton, frame
            rate and file layout are the result's.

    Raises:
        RequestError: the skeletons differ.
    """
    first = poses[0]
    for frame, pose in poses.items():
        if pose.skeleton.names != first.skeleton.names or pose.translated != first.translated:
            odd = sorted({*pose.skeleton.names} ^ {*first.skeleton.names})
            raise RequestError(
                f"the pose at frame {frame} is on another skeleton than the first",
                f"joints that only one of them has: {', '.join(odd[:6])}" if odd else "joints differ in kind",
                "Use poses of one character.",
            )
    held = np.repeat(sorted(poses), np.diff([*sorted(poses), max(poses) + 1]))
    return first.joined([poses[frame] for frame in held.tolist()])
