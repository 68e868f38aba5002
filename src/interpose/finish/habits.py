"""How bodies move all along: a window of a clip tells less of it than the whole."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from interpose.clip import Clip
from interpose.finish import anatomy, seams
from interpose.finish.axes import Axes, Single
from interpose.observation import Observation
from interpose.skeletons.performers import Joints, clip_of, performers


@dataclass(frozen=True)
class Habits:
    """What is known of a clip tells of its joints, of several bodies by each as if it were alone.

    Attributes:
        limits: (J,) metres per frame squared, the largest velocity jumps allowed at a seam, see
            `seams.limits`; NaN where nothing tells.
        still: (J,) those that never turn, see `anatomy.still`.
        single: those that turn about one axis, see `Axes`.
    """

    limits: np.ndarray
    still: np.ndarray
    single: Single

    @classmethod
    def of(cls, clip: Clip, observation: Observation) -> Habits:
        """Of what is known of a clip, (F, J)."""
        joints = len(clip.skeleton)
        limits, still, single = np.full(joints, np.nan), np.zeros(joints, bool), Single()
        for body in performers(clip.skeleton) or (tuple(range(joints)),):
            own = list(body)
            part = clip_of(clip, body) if len(own) < joints else clip
            seen = Observation(observation.rotation[:, own], observation.translation[:, own])
            if (most := seams.limits(part, seen)) is not None:
                limits[own] = most
            still[own] = anatomy.still(part, seen)
            single |= {own[joint]: turns for joint, turns in Axes.of(part, seen, part.source).single.items()}
        return cls(limits, still, single)

    def some(self, body: Joints) -> Habits:
        """Of one body by itself."""
        own = list(body)
        single = {own.index(joint): turns for joint, turns in self.single.items() if joint in own}
        return Habits(self.limits[own], self.still[own], single)
