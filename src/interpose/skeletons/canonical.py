"""The 22 joints that networks know. Names and order are those of the LAFAN1 data set (Harvey et al. 2020)."""

from __future__ import annotations

import numpy as np

from interpose.geometry.constant import Constant

JOINTS = (
    "Hips",
    *("LeftUpLeg", "LeftLeg", "LeftFoot", "LeftToe"),
    *("RightUpLeg", "RightLeg", "RightFoot", "RightToe"),
    *("Spine", "Spine1", "Spine2", "Neck", "Head"),
    *("LeftShoulder", "LeftArm", "LeftForeArm", "LeftHand"),
    *("RightShoulder", "RightArm", "RightForeArm", "RightHand"),
)
PARENTS = (-1, 0, 1, 2, 3, 0, 5, 6, 7, 0, 9, 10, 11, 12, 11, 14, 15, 16, 11, 18, 19, 20)

# Ankles and toes: what a body stands on.
FEET = tuple(JOINTS.index(side + part) for side in ("Left", "Right") for part in ("Foot", "Toe"))

# The index of each joint's mirror image.
SIDES = tuple(
    JOINTS.index("Right" + n[4:] if n.startswith("Left") else "Left" + n[5:] if n.startswith("Right") else n)
    for n in JOINTS
)
# What positions and quaternions are multiplied with, once joints have changed sides, to be seen in a mirror
# that stands in the plane X = 0.
ACROSS = Constant([-1.0, 1.0, 1.0])
ACROSS_TURN = Constant([1.0, 1.0, -1.0, -1.0])

# Thigh plus shin in metres, of LAFAN1's actors: networks see every clip scaled to this leg.
LEG_LENGTH = 0.8587

# Bones of the canonical T-pose in metres: where a joint lies from its parent. The body faces along Z, its
# left is along X, palms look down; lengths are those of LAFAN1's actors.
_LEFT = {
    "UpLeg": (0.105, 0.0, 0.019),
    "Leg": (0.0, -0.435, 0.0),
    "Foot": (0.0, -0.4237, 0.0),
    "Toe": (0.0, -0.083, 0.152),
    "Shoulder": (0.06, 0.197, -0.015),
    "Arm": (0.113, 0.0, 0.0),
    "ForeArm": (0.33, 0.0, 0.0),
    "Hand": (0.252, 0.0, 0.0),
}
_MIDDLE = {
    "Hips": (0.0, 0.0, 0.0),
    "Spine": (0.0, 0.069, -0.026),
    "Spine1": (0.0, 0.126, 0.0),
    "Spine2": (0.0, 0.123, 0.0),
    "Neck": (0.0, 0.258, 0.0),
    "Head": (0.0, 0.118, 0.0),
}


def _bone(name: str) -> tuple[float, float, float]:
    if name in _MIDDLE:
        return _MIDDLE[name]
    x, y, z = _LEFT[name.removeprefix("Left").removeprefix("Right")]
    return (x if name.startswith("Left") else -x), y, z


BONES = np.array([_bone(name) for name in JOINTS])
