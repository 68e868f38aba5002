"""The body that a network sees: what methods ask of the skeleton of a partly observed clip."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import wraps
from typing import Any

import numpy as np

from interpose.clip import Clip
from interpose.methods.protocol import Raw
from interpose.observation import Observation
from interpose.skeletons import Humanoid, Mapping, find_humanoid, find_mapping

# Metres of a body with the canonical leg. Networks have learned on floors at height 0, and err by 20 to 150 %
# more a metre off. Toes rest at RESTS; where the lowest joint is elsewhere by more than LEVEL, the floor is.
# Who is seen for less than a second may be in the air, unless that is higher than people JUMP.
RESTS, LEVEL, JUMP = 0.03, 0.1, 0.6
LOW = 10  # percent of the frames that are lower than what counts as the floor


def no_humanoid(mapping: Mapping) -> str | None:
    """Why a network of the canonical body cannot fill a skeleton, or None if it can."""
    if mapping.usable:
        return None
    lacking = ", ".join(mapping.lacking)
    fix = "(--map, or load(..., roles=...), names them)"
    return f"it fills humanoids only, and no joints were found for {lacking} {fix}"


def observed_body(clip: Clip, observation: Observation) -> Humanoid:
    """The humanoid, by what is observed of its motion; where no frame is whole, right-handed."""
    whole = np.flatnonzero(observation.frames)
    if whole.size:
        whole = whole[:: max(1, whole.size // 1000)]
        return find_humanoid(clip.take(whole))
    hand = {"hand": "right", **clip.skeleton.roles}
    return find_humanoid(replace(clip, skeleton=replace(clip.skeleton, roles=hand)))


def floor(clip: Clip, observation: Observation) -> float:
    """Metres: the height of the floor under what is observed of a body; 0 where it is about there."""
    mapping = find_mapping(clip.skeleton)
    if not mapping.usable:
        return 0.0
    joints = list(mapping.mapped[1])
    feet = [joint for side in ("Left", "Right") if (joint := mapping[side + "Foot"]) is not None]
    known = observation.positions(clip.skeleton)
    frames = known[:, feet].all(axis=1)
    if not frames.any():
        return 0.0
    heights = np.where(known[:, joints], clip.positions()[:, joints, 1], np.inf)[frames].min(axis=1)
    low = float(np.percentile(heights, LOW)) - RESTS / mapping.scale
    high = LEVEL if frames.sum() >= clip.fps else JUMP
    return low if low * mapping.scale < -LEVEL or low * mapping.scale > high else 0.0


def on_the_floor(complete: Callable[..., Raw]) -> Callable[..., Raw]:
    """The `complete` of a method that has learned on floors at height 0, for clips on floors elsewhere."""

    @wraps(complete)
    def levelled(self: Any, clip: Clip, observation: Observation, seed: int | None = None) -> Raw:
        height = np.array([0.0, floor(clip, observation), 0.0])
        if not height.any():
            return complete(self, clip, observation, seed)
        pins = tuple(
            pin if pin.position is None else replace(pin, position=np.asarray(pin.position) - height)
            for pin in observation.pins
        )
        raw = complete(self, _raised(clip, -height), replace(observation, pins=pins), seed)
        positions, own = (None if some is None else some + height for some in (raw.positions, raw.own))
        return replace(raw, clip=_raised(raw.clip, height), positions=positions, own=own)

    return levelled


def _raised(clip: Clip, by: np.ndarray) -> Clip:
    """The clip with all of its roots moved by (3,) metres."""
    roots = [clip.translated.index(root) for root in clip.skeleton.roots]
    translation = clip.translation.copy()
    translation[:, roots] += by
    return clip.with_motion(clip.rotation, translation)
