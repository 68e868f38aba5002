"""Joints that turn about fewer than three axes, and a motion that keeps to these.

Files of AMC say which (`formats.axes`). In others the motion shows it: every knee of CMU's trials in BVH
turns about one axis, to a ten thousandth of a degree, and so it should where it was missing.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from interpose import formats
from interpose.clip import Clip, Skeleton
from interpose.geometry import rotations
from interpose.observation import Observation
from interpose.skeletons import find_mapping

# A joint turns about one axis where it is known to turn by so many degrees in so many different poses or
# more, and about no other by more than so great a share of that: in 78 clips of CMU, HDM05 and Bandai-Namco
# those that do are off by a ten thousandth of a degree, and others by a hundredth at least.
TURNED, POSES, OFF = 5.0, 10, 1e-3
BENDING = [f"{side}{name}" for side in ("Left", "Right") for name in ("Leg", "Toe", "ForeArm")]
EXACT = 1e-4  # radians about other axes that stay: files have a few digits
LOOKED_AT = 1000  # frames, spread over the clip


# Of joints that turn about one axis their rotation (4,) at some time, and the axis, a unit vector (3,) in the
# axes of the parent.
Single = dict[int, tuple[np.ndarray, np.ndarray]]


@dataclass(frozen=True)
class Axes:
    """The joints of a clip that turn about fewer than three axes.

    Attributes:
        source: that of the clip as it was read, see `formats.axes`.
        single: those that are seen to turn about one.
    """

    source: Any
    single: Single

    @classmethod
    def said(cls, source: Any) -> Axes:
        """Those that the file itself says."""
        return cls(source, {})

    @classmethod
    def of(cls, clip: Clip, known: Observation, source: Any) -> Axes:
        """Those of a clip from a `source`: of a file that does not say which, knees, elbows and toes, by what
        of their rotations is known, (F, J)."""
        own, mapping = cls.said(source), find_mapping(clip.skeleton)
        if own(clip.slice(0, 1)) or not mapping.usable:
            return own
        single = {}
        for joint in filter(None, (mapping[name] for name in BENDING)):
            frames = np.flatnonzero(known.rotation[:, joint])
            seen = clip.rotation[frames[:: -(-len(frames) // LOOKED_AT) or 1], joint]
            if (axis := _axis(seen)) is not None:
                single[joint] = seen[0], axis
        return cls(source, single)

    def __call__(self, motion: Clip) -> dict[int, np.ndarray]:
        """Of each such joint its axes (F, 3, k), as `formats.axes`."""
        found = formats.axes(motion, self.source)
        return found | {
            joint: np.broadcast_to(axis[:, None], (len(motion), 3, 1))
            for joint, (_, axis) in self.single.items()
        }

    def held(self, motion: Clip, known: Observation) -> Clip:
        """The motion with joints that turn about their axes alone, the same where there is nothing to do.

        A thigh that is not `known` turns so that the ankle comes back to where it was, about a knee that no
        longer brings it there. What hangs from the joints is turned in the world as it was, as nearly as it
        can.
        """
        motion = formats.held(motion, self.source)
        off = [
            rotations.angle(self._about(joint, at := motion.rotation[:, joint]), at) for joint in self.single
        ]
        frames = np.flatnonzero((np.array(off).reshape(-1, len(motion)) > EXACT).any(axis=0))
        if not len(frames):
            return motion
        rotation = motion.rotation.copy()
        part = motion.with_motion(rotation[frames], motion.translation[frames])
        rotation[frames] = self._turned(part, known.rotation[frames])
        return motion.with_motion(rotation, motion.translation)

    def _turned(self, motion: Clip, known: np.ndarray) -> np.ndarray:
        """The rotations (F, J, 4) of `held`."""
        skeleton, (wanted, placed) = motion.skeleton, motion.kinematics()
        made, rotation = wanted.copy(), motion.rotation.copy()
        for joint in map(int, np.flatnonzero(skeleton.below[:, list(self.single)].any(axis=1))):
            parent = skeleton.parents[joint]
            local = rotations.relative(made[:, parent], wanted[:, joint])
            if joint in self.single:
                local = self._about(joint, local)
                if self._brings(skeleton, joint):
                    bone = placed[:, skeleton.children[joint][0]] - placed[:, joint]
                    inside = rotations.rotate(rotations.conjugate(wanted[:, joint]), bone)
                    moved = rotations.rotate(rotations.multiply(made[:, parent], local), inside)
                    upper = placed[:, joint] - placed[:, parent]
                    back = rotations.multiply(rotations.between(upper + moved, upper + bone), made[:, parent])
                    made[:, parent] = np.where(known[:, parent, None], made[:, parent], back)
                    above = made[:, skeleton.parents[parent]]
                    rotation[:, parent] = rotations.relative(above, made[:, parent])
            rotation[:, joint] = local
            made[:, joint] = rotations.multiply(made[:, parent], local)
        return rotation

    def _about(self, joint: int, turned: np.ndarray) -> np.ndarray:
        """Rotations (F, 4) of a joint as near as they come to `turned` about its axis."""
        zero, axis = self.single[joint]
        turn = rotations.multiply(turned, rotations.conjugate(zero))
        return rotations.multiply(rotations.twist_about(turn, axis), zero)

    def _brings(self, skeleton: Skeleton, joint: int) -> bool:
        """Whether the joint above may turn for what hangs from this one: nothing else hangs from either."""
        parent = skeleton.parents[joint]
        free = parent not in self.single and skeleton.parents[parent] >= 0
        return free and skeleton.children[parent] == (joint,) and len(skeleton.children[joint]) == 1


def _axis(turned: np.ndarray) -> np.ndarray | None:
    """(3,) the one axis about which rotations (n, 4) turn, if there is one."""
    if len(np.unique(turned, axis=0)) < POSES:
        return None
    turns = rotations.log(rotations.multiply(turned, rotations.conjugate(turned[:1])))
    axis = np.linalg.eigh(turns.T @ turns)[1][:, -1]
    along = turns @ axis
    off = np.linalg.norm(turns - along[:, None] * axis, axis=-1).max()
    turned_by = np.ptp(along)
    return axis if turned_by >= np.radians(TURNED) and off <= OFF * turned_by else None
