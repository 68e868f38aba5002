"""The T-pose of a skeleton: how each of its mapped joints is turned when the body stands in it.

Where the zero pose of a skeleton is a pose (arms out, half down or down), it is brought into the T-pose by
the shortest turns. In others, such as LAFAN1 and Bandai-Namco, the zero pose is a heap in which all bones
point along one axis. There the bones tell where each axis points, and the motion tells the twist about it:
knees and elbows are hinges, all else is on average twisted like what it hangs from. Such rigs are mostly
built with their axes along the body's in the T-pose, so estimates are rounded to an axis that is near.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from interpose.clip import Clip
from interpose.errors import RequestError
from interpose.geometry import kinematics, rotations
from interpose.skeletons.canonical import BONES, JOINTS, PARENTS
from interpose.skeletons.mapping import TRUNK, Mapping
from interpose.skeletons.rigs import known_rest

X, Y, Z = np.eye(3)
# The joint that a limb's bone leads to.
ENDS = {
    side + one: side + other
    for side in ("Left", "Right")
    for one, other in (
        *(("UpLeg", "Leg"), ("Leg", "Foot"), ("Foot", "Toe")),
        *(("Arm", "ForeArm"), ("ForeArm", "Hand")),
    )
}
HINGES = {
    side + a: (side + a, side + b)
    for side in ("Left", "Right")
    for a, b in (("UpLeg", "Leg"), ("Arm", "ForeArm"))
}
# Cosines by which legs may be off the vertical and elbows bent in a zero pose, which somebody has modelled,
# in a first frame with arms out, with which people do not begin, and in a frame, which may be any.
LENIENT, FIRST, STRICT = 0.8, 0.9, 0.96
# An estimated axis that is nearer to one of the joint's own than this is that one.
AXIS = np.cos(np.radians(12.0))
# In the T-pose elbows do not bend straight ahead but a little downwards: the axis of the left one. Measured
# on the rest poses of CMU and HDM05 (their elbows are hinges, 18 to 28 degrees off) and on LAFAN1's arms.
ELBOW = np.array([0.0, -np.cos(np.radians(21.0)), np.sin(np.radians(21.0))])
UPRIGHT = 0.95  # how vertical the line from the hips to the head is in someone who stands or walks
STANDS = 5  # as many frames of it are needed
LOOK = 400  # frames of the motion that are looked at


@dataclass(frozen=True, eq=False)
class Rest:
    """The T-pose: the body upright, facing along Z, arms out along X, palms down.

    Attributes:
        rotation: (22, 4) global rotations of the skeleton's joints in it, by canonical joint; where a joint
            is missing that of the one above it.
        pose: what the skeleton's zero pose is: "T", "A", "arms down", or "none".
        how: where the T-pose comes from: "zero pose", "frame N", "rig" (one that is known) or "motion".
    """

    rotation: np.ndarray
    pose: str
    how: str


def find_rest(mapping: Mapping, clip: Clip | None = None, frame: int | None = None) -> Rest:
    """The T-pose of a mapped skeleton.

    Args:
        mapping: usable.
        clip: its motion; asked only where the zero pose is none.
        frame: a frame of the clip that is a rest pose; used instead of the zero pose.

    Raises:
        RequestError: the skeleton is no humanoid, or its T-pose cannot be found.
    """
    if not mapping.usable:
        raise RequestError(
            "the skeleton has no T-pose",
            f"it has no joints for {', '.join(mapping.lacking)}",
            "Say which joints they are: load(..., roles=...), or --map.",
        )
    skeleton = mapping.skeleton
    if frame is not None:
        if clip is None or not 0 <= frame < len(clip):
            raise RequestError(
                f"there is no frame {frame}",
                f"the clip has {len(clip) if clip is not None else 0} frames, counted from 0",
                "Name another one, or leave it out.",
            )
        turned, placed = (some[0] for some in clip.slice(frame, frame + 1).kinematics())
        rest, pose = _from_pose(mapping, turned, placed), _kind(mapping, placed, STRICT)
        if pose == "none":
            raise RequestError(
                f"frame {frame} is no rest pose",
                "the body does not stand upright with straight legs and arms",
                "Name another one, or leave it out.",
            )
        return Rest(rest, pose, f"frame {frame}")
    bones = skeleton.rest_translation * skeleton.scale_above[:, None]
    turned, placed = kinematics.forward(skeleton.rest_rotation, bones, skeleton.parents)
    pose = _kind(mapping, placed)
    if pose != "none":
        return Rest(_from_pose(mapping, turned, placed), pose, "zero pose")
    if known := known_rest(mapping):
        return Rest(known[1], pose, "rig")
    if clip is None or len(clip) == 0:
        raise RequestError(
            "the T-pose cannot be found",
            "the zero pose is none, and there is no motion to tell it",
            "Give a clip with some motion, or name a rest frame.",
        )
    turned, placed = (some[0] for some in clip.slice(0, 1).kinematics())
    if _kind(mapping, placed, FIRST) == "T":
        # Files of rigs, and takes of some programs, begin with it.
        return Rest(_from_pose(mapping, turned, placed), "T", "frame 0")
    return Rest(estimate(mapping, clip), pose, "motion")


def estimate(mapping: Mapping, clip: Clip) -> np.ndarray:
    """(22, 4) the T-pose of a skeleton whose zero pose is none, worked out from its bones and a motion."""
    return _Estimate(mapping, clip).rotation()


def _frame(mapping: Mapping, placed: np.ndarray) -> np.ndarray:
    """(4,) the turn that stands a pose upright, facing along Z: by its hips and its chest."""
    points = mapping.weights @ placed

    def at(name: str) -> np.ndarray:
        return points[JOINTS.index(name)]

    across = at("LeftUpLeg") - at("RightUpLeg")
    up = 0.5 * (at("LeftArm") + at("RightArm")) - 0.5 * (at("LeftUpLeg") + at("RightUpLeg"))
    return rotations.conjugate(_basis(across, up))


def _basis(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """(4,) the rotation that takes X along `x`, and Y as near to `y` as it goes."""
    x = rotations.normalize(x)
    y = rotations.normalize(y - (y @ x) * x)
    return rotations.from_matrix(np.stack([x, y, np.cross(x, y)], axis=1))


def _kind(mapping: Mapping, placed: np.ndarray, least: float = LENIENT) -> str:
    """Whether a pose (J, 3) is a rest pose, and which; `least` is the cosine by which limbs may be off."""
    if np.linalg.norm(np.ptp(placed, axis=0)) < 1e-6:
        return "none"
    points = rotations.rotate(_frame(mapping, placed), mapping.weights @ placed)

    def way(a: str, b: str) -> np.ndarray:
        return rotations.normalize(points[JOINTS.index(b)] - points[JOINTS.index(a)])

    down = []
    for side, sign in (("Left", 1.0), ("Right", -1.0)):
        legs = [way(side + "UpLeg", side + "Leg"), way(side + "Leg", side + "Foot")]
        arms = [way(side + "Arm", side + "ForeArm")]
        if mapping[side + "Hand"] is not None:
            arms.append(way(side + "ForeArm", side + "Hand"))
        if min(-leg[1] for leg in legs) < least or arms[0] @ arms[-1] < least or arms[0][1] > 0.4:
            return "none"
        if arms[0][0] * sign < -0.2:
            return "none"
        down.append(np.degrees(np.arcsin(np.clip(-arms[0][1], -1, 1))))
    return "T" if max(down) < 25 else "A" if max(down) < 70 else "arms down"


def _from_pose(mapping: Mapping, turned: np.ndarray, placed: np.ndarray) -> np.ndarray:
    """(22, 4) global rotations in the T-pose, from those of a rest pose (J, 4) and its positions (J, 3)."""
    stand = _frame(mapping, placed)
    points = rotations.rotate(stand, mapping.weights @ placed)
    rest = np.empty((len(JOINTS), 4))
    turns = np.tile([1.0, 0, 0, 0], (len(JOINTS), 1))
    for row, name in enumerate(JOINTS):
        above, joint = PARENTS[row], mapping.joints[row]
        end = JOINTS.index(ENDS[name]) if name in ENDS else None
        if name in TRUNK or name.endswith("Shoulder"):
            pass  # as it is: backs are curved and collar bones slanted, in every skeleton in its own way
        elif name.endswith("Foot"):
            # With the shin; a foot that points out is turned ahead, but stays as flat as it is.
            turns[row] = turns[above]
            if end is not None and end not in mapping.levers:
                level = rotations.rotate(turns[row], points[end] - points[row]) * [1, 0, 1]
                turns[row] = rotations.multiply(rotations.between(level, Z), turns[row])
        elif end is not None and end not in mapping.levers:
            turns[row] = rotations.between(points[end] - points[row], BONES[end])
        else:
            turns[row] = turns[above]
        own = rotations.multiply(stand, turned[joint]) if joint is not None else None
        rest[row] = rest[above] if own is None else rotations.multiply(turns[row], own)
    return rest


class _Estimate:
    """The T-pose of a skeleton whose zero pose is none, from its bones and its motion."""

    def __init__(self, mapping: Mapping, clip: Clip) -> None:
        self.mapping = mapping
        step = max(1, len(clip) // LOOK)
        some = clip.take(slice(None, None, step))
        self.turned, placed = some.kinematics()
        self.points = np.einsum("cj,fjx->fcx", mapping.weights, placed)
        self.rest = np.tile([1.0, 0, 0, 0], (len(JOINTS), 1))
        trunk = self._way("Hips", "Head")
        up = trunk[:, 1] / np.maximum(np.linalg.norm(trunk, axis=1), 1e-9)
        # The frames in which somebody stands or walks.
        self.upright = up >= UPRIGHT
        self.stands = self.upright.sum() >= STANDS

    def rotation(self) -> np.ndarray:
        """(22, 4)"""
        for row, name in enumerate(JOINTS):
            if self.mapping.joints[row] is None:
                self.rest[row] = self.rest[max(PARENTS[row], 0)]
            elif name == "Hips":
                self.rest[row] = self._hips()
            else:
                self.rest[row] = self._joint(row, name)
        return self.rest

    def _own(self, name: str, vectors: np.ndarray, frames: np.ndarray | slice = slice(None)) -> np.ndarray:
        """The mean (3,) of vectors of the world (F, 3) in a joint's own axes."""
        joint = self.mapping[name]
        assert joint is not None
        inside = rotations.rotate(rotations.conjugate(self.turned[frames, joint]), vectors[frames])
        return rotations.normalize(inside.mean(axis=0))

    @staticmethod
    def _near(axis: np.ndarray, least: float = AXIS) -> np.ndarray:
        """An axis (3,), rounded to the joint's own one if that is near."""
        best = int(np.argmax(np.abs(axis)))
        return np.sign(axis[best]) * np.eye(3)[best] if abs(axis[best]) > least else axis

    def _way(self, name: str, end: str) -> np.ndarray:
        """(F, 3) from one canonical joint to another."""
        return self.points[:, JOINTS.index(end)] - self.points[:, JOINTS.index(name)]

    def _hips(self) -> np.ndarray:
        # Hips are level from side to side, and upright on average in someone who stands.
        across = self._own("Hips", self._way("RightUpLeg", "LeftUpLeg"))
        if self.stands:
            up = self._near(self._own("Hips", np.broadcast_to(Y, (len(self.points), 3)), self.upright))
        else:
            chest = next(name for name in TRUNK[:0:-1] if self.mapping[name] is not None)
            middle = 0.5 * (self._way("LeftUpLeg", chest) + self._way("RightUpLeg", chest))
            up = self._near(self._own("Hips", middle), least=0.0)
        return self._turn(X, Y, self._near(across), up)

    def _canonical(self, row: int, vector: np.ndarray) -> np.ndarray:
        """(F, 3) where a vector of the T-pose points in the motion, seen by a joint that is done."""
        while self.mapping.joints[row] is None:
            row = PARENTS[row]
        inside = rotations.rotate(rotations.conjugate(self.rest[row]), vector)
        return rotations.rotate(self.turned[:, self.mapping.joints[row]], inside)

    def _joint(self, row: int, name: str) -> np.ndarray:
        above, end, side = PARENTS[row], ENDS.get(name), np.sign(BONES[row][0])
        if name in TRUNK:
            # A back is curved, in every skeleton in its own way: when someone stands, it is as in the T-pose.
            if self.stands:
                along = self._own(name, np.broadcast_to(Y, (len(self.points), 3)), self.upright)
            else:
                along = self._near(self._own(name, self._canonical(above, Y)))
            return self._turn(Y, X, along, self._own(name, self._canonical(above, X)))
        if name.endswith("Shoulder"):
            frames = self.upright if self.stands else slice(None)
            along, beside = (self._own(name, self._canonical(above, axis), frames) for axis in (X, Y))
            return self._turn(X, Y, along, beside)
        arm = name.endswith(("Arm", "Hand"))
        if end and JOINTS.index(end) not in self.mapping.levers:
            goal = rotations.normalize(BONES[JOINTS.index(end)])
            goal = self._flat(name, end) if name.endswith("Foot") else goal
            along = self._near(self._own(name, self._way(name, end)))
        elif name.endswith("Toe"):
            # Toes that are low lie flat.
            goal, along = Z, self._own(name, self._canonical(above, Z), self._low(name))
        else:
            # Nothing hangs below: on average it goes on like what it hangs from.
            goal = Z if name.endswith("Foot") else side * X
            along = self._near(self._own(name, self._canonical(above, goal)))
        if name in HINGES:
            world = X if name.endswith("UpLeg") else side * ELBOW
            beside = self._own(name, self._plane(*HINGES[name]))
        else:
            world = side * ELBOW if arm else X
            beside = self._own(name, self._canonical(above, world))
        return self._turn(goal, world, along, beside if name in HINGES else self._near(beside))

    @staticmethod
    def _turn(goal: np.ndarray, world: np.ndarray, along: np.ndarray, beside: np.ndarray) -> np.ndarray:
        """(4,) takes a joint's own axis `along` to `goal`, and `beside` as near to `world` as it goes."""
        return rotations.multiply(_basis(goal, world), rotations.conjugate(_basis(along, beside)))

    def _low(self, toe: str) -> np.ndarray:
        """(F,) the frames in which a toe is low."""
        height = self.points[:, JOINTS.index(toe), 1]
        return height <= np.percentile(height, 30)

    def _flat(self, foot: str, toe: str) -> np.ndarray:
        """(3,) where a foot points that stands: ahead, and as far down as it does when its toes are low."""
        low = self._way(foot, toe)[self._low(toe)]
        down = np.median(low[:, 1] / np.maximum(np.linalg.norm(low[:, [0, 2]], axis=1), 1e-9))
        return rotations.normalize(np.array([0.0, np.clip(down, -2.0, 0.0), 1.0]))

    def _plane(self, upper: str, lower: str) -> np.ndarray:
        """(F, 3) across the plane of a limb; the longer the more it is bent: a straight limb has no plane."""
        first, second = (rotations.normalize(self._way(name, ENDS[name])) for name in (upper, lower))
        return np.cross(first, second)
