"""The body that a network sees: what methods ask of the skeleton of a partly observed clip."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from interpose.clip import Clip
from interpose.observation import Observation
from interpose.skeletons import Humanoid, Mapping, find_humanoid


def no_humanoid(mapping: Mapping) -> str | None:
    """Why a network of the canonical body cannot fill a skeleton, or None if it can."""
    if mapping.usable:
        return None
    lacking = ", ".join(mapping.lacking)
    return f"it fills humanoids only, and no joints were found for {lacking} (--map names them)"


def observed_body(clip: Clip, observation: Observation) -> Humanoid:
    """The humanoid, by what is observed of its motion; where no frame is whole, right-handed."""
    whole = np.flatnonzero(observation.frames)
    if whole.size:
        whole = whole[:: max(1, whole.size // 1000)]
        return find_humanoid(clip.with_motion(clip.rotation[whole], clip.translation[whole]))
    hand = {"hand": "right", **clip.skeleton.roles}
    return find_humanoid(replace(clip, skeleton=replace(clip.skeleton, roles=hand)))
