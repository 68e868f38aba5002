"""How bodies bend: knees and elbows about one axis, and trunks but a little.

It is what holds them so while a body is brought to where it should be. If the places of joints alone counted,
who reaches to the floor would fold up his spine, hips and head where they were.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from interpose.clip import Clip
from interpose.geometry import rotations
from interpose.skeletons import BONES, JOINTS, find_humanoid
from interpose.skeletons.rest import ELBOW, ENDS, HINGES

# Radians that joints of a trunk bend further than by themselves before they are held, and how many times as
# much as hinges they are then: in 34,000 frames of LAFAN1 no joint of a spine turns by more than 34 degrees.
SUPPLE, STIFFER = 0.2, 3.0


@dataclass(frozen=True)
class Hinge:
    """One knee or elbow.

    Attributes:
        joint, above: the shin, or forearm, and what it bends against.
        axis: (3,) about which it bends, in the axes of the one above.
        bone: (3,) along a forearm, in its own axes, as that may turn about it, too; None for a shin.
    """

    joint: int
    above: int
    axis: np.ndarray
    bone: np.ndarray | None


@dataclass(frozen=True)
class Hinges:
    """The hinges of a body, and what pulls back those that turn otherwise than by bending, and trunks.

    Attributes:
        hinges: some of the four.
        trunk: the joints of spine, neck and head.
        like: (F, J, 4) local rotations that are right, but for how far they bend.
        weight: square metres that a radian counts, squared.
    """

    hinges: tuple[Hinge, ...]
    trunk: tuple[int, ...]
    like: np.ndarray
    weight: float = 0.0

    @classmethod
    def of(cls, clip: Clip) -> Hinges | None:
        """Those of a clip, whose motion is right; None where it has no humanoid."""
        body = find_humanoid(clip)
        if not body.mapping.usable:
            return None
        back, found = rotations.conjugate(body.rest.rotation), []
        for above, (_, joint) in HINGES.items():
            own = body.mapping[above], body.mapping[joint]
            if own[0] is None or own[1] is None:
                continue
            arm = above.endswith("Arm")
            axis = ELBOW if arm else np.array([1.0, 0.0, 0.0])
            bone = rotations.normalize(BONES[JOINTS.index(ENDS[joint])])
            along = rotations.rotate(back[JOINTS.index(joint)], bone) * body.hand if arm else None
            axis = rotations.rotate(back[JOINTS.index(above)], axis) * body.hand
            found.append(Hinge(own[1], own[0], axis, along))
        trunk = (body.mapping[name] for name in ("Spine", "Spine1", "Spine2", "Neck", "Head"))
        return cls(tuple(found), tuple(joint for joint in trunk if joint is not None), clip.rotation)

    def at(self, frames: np.ndarray) -> Hinges:
        """Of some frames."""
        return replace(self, like=self.like[frames])

    def to(self, weight: float) -> Hinges:
        """Of another weight."""
        return replace(self, weight=weight)

    def pulls(self, clip: Clip, turned: np.ndarray) -> Iterator[tuple[int, np.ndarray, np.ndarray]]:
        """Of each hinge, and joint of the trunk, the joint, how stiff it is against turns about the axes of
        the world (F, 3, 3), and the turn by which it is pulled back, times that (F, 3).

        turned: (F, J, 4) the clip's global rotations.
        """

        def back(joint: int) -> np.ndarray:
            """(F, 3) the turn that would bring a joint to what it is like."""
            parent = turned[:, clip.skeleton.parents[joint]]
            own, like = clip.rotation[:, joint], self.like[:, joint]
            return rotations.rotate(parent, rotations.log(rotations.multiply(like, rotations.conjugate(own))))

        for joint in self.trunk:
            off = back(joint)
            size = np.linalg.norm(off, axis=1)
            beyond = np.maximum(1 - SUPPLE / np.maximum(size, 1e-9), 0.0)
            weight = STIFFER * self.weight
            stiff = np.where(beyond > 0, weight, 0.0)[:, None, None] * np.eye(3)
            yield joint, stiff, weight * beyond[:, None] * off
        for hinge in self.hinges:
            off = back(hinge.joint)
            axes = [rotations.rotate(turned[:, hinge.above], hinge.axis)]
            if hinge.bone is not None:
                axes.append(rotations.rotate(turned[:, hinge.joint], hinge.bone))
            free = np.linalg.qr(np.stack(axes, axis=-1))[0]
            stiff = self.weight * (np.eye(3) - free @ np.swapaxes(free, -1, -2))
            yield hinge.joint, stiff, (stiff @ off[..., None])[..., 0]
