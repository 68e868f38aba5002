"""Key poses of several clips, laid out in time: what `between` goes by."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from interpose.clip import Clip
from interpose.errors import RequestError
from interpose.observation.scan import strays
from interpose.observation.timeline import Placement, bounded, plausible_length
from interpose.skeletons.carrier import hips_of
from interpose.skeletons.fitting import fit
from interpose.tasks.keys import block
from interpose.tasks.stitching import BESIDE

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
    # Rest poses and the like at the ends of clips tell nothing of how it moves.
    since = max([0, last - near, *(stray + 1 for stray in strays(before) if stray < last)])
    until = min([moment + 1 + near, len(beside), *(stray for stray in strays(beside) if stray > moment)])
    # Nor does another pose beside one that is blocked.
    since = since if since < last and _goes_on(before.slice(last - 1, last + 1)) else last
    until = until if until > moment + 1 and _goes_on(beside.slice(moment, moment + 2)) else moment + 1
    # The pose was laid on the body of the first one by itself, and where it is these frames are, too.
    hips = hips_of(held.skeleton)
    off = end.positions()[0, hips] - beside.slice(moment, moment + 1).positions()[0, hips]
    on = Placement(shift=(float(off[0]), 0.0, float(off[2]))).of(beside.slice(moment + 1, until))
    parts = [before.slice(since, last), laid, on]
    return Blocked(laid.joined(parts), [len(parts[0]) + key for key in sorted(poses)], said)


def _goes_on(clip: Clip) -> bool:
    """Whether a body may have moved so from the one frame of a clip to the other."""
    return bool(np.linalg.norm(np.diff(clip.positions(), axis=0), axis=-1).max() * clip.fps < FASTEST)
