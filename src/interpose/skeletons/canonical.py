"""The 22 joints that networks know. Names and order are those of the LAFAN1 data set (Harvey et al. 2020)."""

from __future__ import annotations

JOINTS = (
    "Hips",
    *("LeftUpLeg", "LeftLeg", "LeftFoot", "LeftToe"),
    *("RightUpLeg", "RightLeg", "RightFoot", "RightToe"),
    *("Spine", "Spine1", "Spine2", "Neck", "Head"),
    *("LeftShoulder", "LeftArm", "LeftForeArm", "LeftHand"),
    *("RightShoulder", "RightArm", "RightForeArm", "RightHand"),
)
PARENTS = (-1, 0, 1, 2, 3, 0, 5, 6, 7, 0, 9, 10, 11, 12, 11, 14, 15, 16, 11, 18, 19, 20)

# The index of each joint's mirror image.
SIDES = tuple(
    JOINTS.index("Right" + n[4:] if n.startswith("Left") else "Left" + n[5:] if n.startswith("Right") else n)
    for n in JOINTS
)

# Thigh plus shin in metres, of LAFAN1's actors: networks see every clip scaled to this leg.
LEG_LENGTH = 0.8587
