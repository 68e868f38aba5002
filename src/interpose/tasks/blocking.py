"""Key poses of several clips, laid out in time: what `between` goes by."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from interpose.clip import Clip
from interpose.errors import RequestError, unfit
from interpose.finish import Completion, on_rig_of
from interpose.observation import Pin
from interpose.observation.observation import frame_number
from interpose.observation.scan import strays
from interpose.observation.timeline import Placement, bounded, plausible_length
from interpose.skeletons.carrier import carriers, hips_of
from interpose.skeletons.fitting import fit
from interpose.tasks.keys import between, block
from interpose.tasks.stitching import BESIDE

if TYPE_CHECKING:
    from interpose.methods.protocol import Method

FASTEST = 20.0  # metres a second: no hand goes so fast


@dataclass(frozen=True)
class Blocked:
    """A clip with poses of several clips at its `keys`; what lies between them is to be generated.

    Attributes:
        clip: before the first key and after the last one what their clips hold there, as it tells how the
            body moves.
        keys: frames of it.
        said: how long it takes, and why, if that was proposed.
    """

    clip: Clip
    keys: list[int]
    said: tuple[str, ...]

    def counted(self, path: Mapping[int, Any], pins: Sequence[Pin]) -> tuple[dict[int, Any], list[Pin]]:
        """A path and pins whose frames count from the first key on, by frames of the clip.

        Raises RequestError for frames that are not between the first key and the last one.
        """
        zero, last = self.keys[0], self.keys[-1] - self.keys[0]
        told = {frame_number(frame): point for frame, point in path.items()}
        pinned = [frame_number(frame) for pin in pins for frame in np.ravel(pin.frames).tolist()]
        keys = {key - zero for key in self.keys}
        # A joint may be held over a key.
        if wrong := [
            frame for frame in (*told, *pinned) if not 0 <= frame <= last or frame in {*told} & keys
        ]:
            why = f"the first pose is frame 0, and the last one frame {last}"
            raise RequestError(f"nothing is generated at frame {wrong[0]}", why, "Choose one between poses.")
        later = [replace(pin, frames=zero + np.asarray(pin.frames)) for pin in pins]
        return {zero + frame: point for frame, point in told.items()}, later


def edge(clip: Clip, last: bool) -> int:
    """The first frame of a clip, or the `last` one; the one beside where that has nothing to do with it."""
    frame = len(clip) - 1 if last else 0
    return frame + (0 if frame not in strays(clip) else -1 if last else 1)


def pose_to_pose(
    start: Clip,
    target: Clip,
    frames: int | None = None,
    anchors: Mapping[int, Clip] = {},
    action: str = "",
    method: str | Path | Method = "auto",
    seed: int | None = None,
    progress: Callable[[float], None] | None = None,
    path: Mapping[int, Any] | None = None,
    pins: Sequence[Pin] = (),
) -> Completion:
    """From the last pose of one clip to the first of another, which others may be met between; those two, and
    what lies between them, on the skeleton of the first one.

    Args:
        start, target: the clips; what lies before the one pose and after the other tells how the body moves.
        frames: how many lie between the two; None for as many as the way takes, and the report says why.
        anchors: clips whose first pose is met so many frames after the first one.
        action, method, seed, progress: as in `between`.
        path, pins: as in `fill`; their frames count from the first pose on, which is 0.

    Raises:
        RequestError: as `between`, and for clips that cannot be brought onto the first one's rig.
    """
    for name, clip in (
        ("start", start),
        ("target", target),
        *(("anchors", clip) for clip in anchors.values()),
    ):
        if not len(clip):
            raise unfit(name, clip, "a clip of one frame or more")
    on_rig = {frame_number(when): on_rig_of(clip, start) for when, clip in anchors.items()}
    if wrong := [when for when in on_rig if when < 1]:
        raise RequestError(
            f"cannot meet an anchor at frame {wrong[0]}",
            "the first pose is frame 0",
            "Choose a frame from 1 on.",
        )
    poses = {when: clip.slice(at, at + 1) for when, clip in on_rig.items() for at in [edge(clip, False)]}
    target = on_rig_of(target, start)
    laid = blocked(start, edge(start, True), target, edge(target, False), poses, frames)
    points, later = laid.counted(path or {}, pins)
    done = between(laid.clip, laid.keys, action, method, seed, progress, True, points, later)
    gaps = done.report.gaps
    told = [*gaps[:-1], *(replace(gap, notes=(*laid.said, *gap.notes)) for gap in gaps[-1:])]
    return replace(done, report=replace(done.report, gaps=told))


def blocked(
    before: Clip, last: int, after: Clip, first: int, anchors: Mapping[int, Clip], frames: int | None
) -> Blocked:
    """The way from a pose of one clip to a pose of another.

    Args:
        before, last: the clip it comes from, and its frame that is the first key.
        after, first: the clip it leads to, on the same skeleton, and its frame that is the last key.
        anchors: poses on the same skeleton that are met so many frames after the first key.
        frames: how many lie between the first and the last key; None for as many as the way takes from the
            last anchor on.

    Raises:
        RequestError: more frames than anything takes, an anchor after the last key.
    """
    held = before.slice(last, last + 1)
    poses = {0: held, **{when: fit(pose, held)[0] for when, pose in anchors.items()}}
    met, end = max(poses), fit(after.slice(first, first + 1), held)[0]
    beside = fit(after, before)[0]
    moment = min(round(first * before.fps / after.fps), len(beside) - 1)
    # Rest poses and the like at the ends of clips tell nothing of how it moves.
    (before, last), (beside, moment) = _sound(before, last), _sound(beside, moment)
    # The pose was laid on the body of the first one by itself, and where it is these frames are, too.
    hips = hips_of(held.skeleton)
    off = end.positions()[0, hips] - beside.slice(moment, moment + 1).positions()[0, hips]
    there = Placement(shift=(float(off[0]), 0.0, float(off[2])))
    beside = there.of(beside, carriers(beside))
    said: tuple[str, ...] = ()
    if frames is None:
        # On to the target from the last pose before it; when anchors are met was said.
        here = (poses[met], 0) if met else (before, last)
        frames, why = plausible_length(*here, beside, moment)
        frames += met
        later = f" after the anchor at {met}" if met else ""
        said = (f"{frames} frame{'s' * (frames > 1)}: {why}{later}",)
    bounded(frames, before.fps)
    if met > frames:
        why = f"the last key is frame {frames + 1}"
        raise RequestError(f"cannot meet an anchor @{met}", why, f"Choose a frame from 1 to {frames}.")
    poses[frames + 1] = end
    near, laid = round(BESIDE * before.fps), block(poses)
    since, until = max(0, last - near), min(moment + 1 + near, len(beside))
    # Another pose beside one that is blocked tells nothing of it either.
    since = since if since < last and _goes_on(before.slice(last - 1, last + 1)) else last
    until = until if until > moment + 1 and _goes_on(beside.slice(moment, moment + 2)) else moment + 1
    parts = [before.slice(since, last), laid, beside.slice(moment + 1, until)]
    return Blocked(laid.joined(parts), [len(parts[0]) + key for key in sorted(poses)], said)


def _sound(clip: Clip, frame: int) -> tuple[Clip, int]:
    """A clip without what has nothing to do with its motion at its ends, but for the frame that is meant, and
    which that is then."""
    odd = {*strays(clip)} - {frame}
    start, stop = int(0 in odd), len(clip) - int(len(clip) - 1 in odd)
    return clip.slice(start, stop), frame - start


def _goes_on(clip: Clip) -> bool:
    """Whether a body may have moved so from the one frame of a clip to the other."""
    return bool(np.linalg.norm(np.diff(clip.positions(), axis=0), axis=-1).max() * clip.fps < FASTEST)
