"""Well-known humanoid rigs by their published joint names and hierarchy, moved by real motion.

`build(name, clip)` lets one of `RIGS` perform a clip of the CMU database and says which of its joints are
the canonical ones. A rig is a few lines of text, indentation is hierarchy::

    pelvis=Hips                                   pelvis is the canonical joint Hips
      thigh_l=UpLeg > calf_l=Leg > foot_l=Foot    a chain; the right side follows from the left one
      index ring: *_01_l > *_02_l                 a chain for each word, which stands for the star

Lines below a chain hang on its last joint.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from textwrap import indent

import numpy as np

from interpose.clip import Clip, Skeleton
from interpose.geometry import kinematics, rotations
from interpose.skeletons.canonical import JOINTS


@dataclass(frozen=True)
class Rig:
    """A published rig.

    Attributes:
        text: its joints, of both sides the left one.
        sides: a regular expression that finds "left" in a name, and what stands there on the right side.
        rest: the pose of zero rotations. "t": a T-pose; "a", "i": arms half and all the way down; "X", "Y",
            "Z": no pose at all, every bone along this axis and rolled arbitrarily.
        prefix: what every name begins with.
        size: height as a share of the performer's.
        carried: whether a root above the hips carries them; else it stands still at the origin.
    """

    text: str
    sides: tuple[str, str]
    rest: str
    prefix: str = ""
    size: float = 1.0
    carried: bool = False


MIXAMO = """
Hips=Hips
  Spine=Spine > Spine1=Spine1 > Spine2=Spine2
    Neck=Neck > Head=Head > HeadTop_End
    LeftShoulder=Shoulder > LeftArm=Arm > LeftForeArm=ForeArm > LeftHand=Hand
      Thumb Index Middle Ring Pinky: LeftHand*1 > LeftHand*2 > LeftHand*3 > LeftHand*4
  LeftUpLeg=UpLeg > LeftLeg=Leg > LeftFoot=Foot > LeftToeBase=Toe > LeftToe_End
"""

UNREAL = """
root
  pelvis=Hips
    spine_01=Spine > spine_02 > spine_03=Spine1 > spine_04 > spine_05=Spine2
      neck_01=Neck > neck_02 > head=Head
      clavicle_l=Shoulder > upperarm_l=Arm
        lowerarm_l=ForeArm
          hand_l=Hand
            thumb_01_l > thumb_02_l > thumb_03_l
            index middle ring pinky: *_metacarpal_l > *_01_l > *_02_l > *_03_l
          01 02: lowerarm_twist_*_l
        01 02: upperarm_twist_*_l
    thigh_l=UpLeg
      calf_l=Leg
        foot_l=Foot > ball_l=Toe
        01 02: calf_twist_*_l
      01 02: thigh_twist_*_l
  ik_foot_root > ik_foot_l
  ik_hand_root > ik_hand_gun > ik_hand_l
  interaction
  center_of_mass
"""

UNITY = """
Hips=Hips
  LeftUpperLeg=UpLeg > LeftLowerLeg=Leg > LeftFoot=Foot > LeftToes=Toe
  Spine=Spine > Chest=Spine1 > UpperChest=Spine2
    Neck=Neck > Head=Head
      LeftEye
      Jaw
    LeftShoulder=Shoulder > LeftUpperArm=Arm > LeftLowerArm=ForeArm > LeftHand=Hand
      Thumb Index Middle Ring Little: Left * Proximal > Left * Intermediate > Left * Distal
"""

VRM = """
Root
  J_Bip_C_Hips=Hips
    J_Bip_C_Spine=Spine > J_Bip_C_Chest=Spine1 > J_Bip_C_UpperChest=Spine2
      J_Sec_L_Bust1 > J_Sec_L_Bust2
      J_Bip_C_Neck=Neck > J_Bip_C_Head=Head
        J_Adj_L_FaceEye
        01 02 03: J_Sec_Hair1_* > J_Sec_Hair2_* > J_Sec_Hair3_*
      J_Bip_L_Shoulder=Shoulder > J_Bip_L_UpperArm=Arm > J_Bip_L_LowerArm=ForeArm > J_Bip_L_Hand=Hand
        Index Little Middle Ring Thumb: J_Bip_L_*1 > J_Bip_L_*2 > J_Bip_L_*3
    J_Bip_L_UpperLeg=UpLeg
      J_Bip_L_LowerLeg=Leg > J_Bip_L_Foot=Foot > J_Bip_L_ToeBase=Toe
      J_Sec_L_SkirtBack0_01 > J_Sec_L_SkirtBack1_01 > J_Sec_L_SkirtBack2_01
"""

SMPL = """
Pelvis=Hips
  L_Hip=UpLeg > L_Knee=Leg > L_Ankle=Foot > L_Foot=Toe
  Spine1=Spine > Spine2=Spine1 > Spine3=Spine2
    Neck=Neck > Head=Head
    L_Collar=Shoulder > L_Shoulder=Arm > L_Elbow=ForeArm > L_Wrist=Hand > L_Hand
"""

SMPLX = """
pelvis=Hips
  left_hip=UpLeg > left_knee=Leg > left_ankle=Foot > left_foot=Toe
  spine1=Spine > spine2=Spine1 > spine3=Spine2
    neck=Neck > head=Head
      jaw
      left_eye_smplhf
    left_collar=Shoulder > left_shoulder=Arm > left_elbow=ForeArm > left_wrist=Hand
      index middle pinky ring thumb: left_*1 > left_*2 > left_*3
"""

ROKOKO = """
Hips=Hips
  LeftThigh=UpLeg > LeftShin=Leg > LeftFoot=Foot > LeftToe=Toe > LeftToeTip
  Spine1=Spine > Spine2 > Spine3=Spine1 > Spine4=Spine2
    LeftShoulder=Shoulder > LeftArm=Arm > LeftForeArm=ForeArm > LeftHand=Hand
      LeftFinger1: *Metacarpal > *Proximal > *Distal > *Tip
      LeftFinger2 LeftFinger3 LeftFinger4 LeftFinger5: *Metacarpal > *Proximal > *Medial > *Distal > *Tip
    Neck=Neck > Head=Head
"""

XSENS = """
Hips=Hips
  Chest=Spine > Chest2 > Chest3=Spine1 > Chest4=Spine2
    Neck=Neck > Head=Head
    LeftCollar=Shoulder > LeftShoulder=Arm > LeftElbow=ForeArm > LeftWrist=Hand
  LeftHip=UpLeg > LeftKnee=Leg > LeftAnkle=Foot > LeftToe=Toe
"""

XSENS_MVN = """
Pelvis=Hips
  L5=Spine > L3 > T12=Spine1 > T8=Spine2
    Neck=Neck > Head=Head
    LeftShoulder=Shoulder > LeftUpperArm=Arm > LeftForeArm=ForeArm > LeftHand=Hand
  LeftUpperLeg=UpLeg > LeftLowerLeg=Leg > LeftFoot=Foot > LeftToe=Toe
"""

VICON = """
Hips=Hips
  Spine=Spine > Spine1 > Spine2=Spine1 > Spine3=Spine2
    Neck=Neck > Neck1 > Head=Head
    LeftShoulder=Shoulder > LeftArm=Arm > LeftForeArm=ForeArm > LeftHand=Hand
      Thumb Index Middle Ring Pinky: LeftHand*1 > LeftHand*2 > LeftHand*3
  LeftUpLeg=UpLeg > LeftLeg=Leg > LeftFoot=Foot > LeftToeBase=Toe
"""

OPTITRACK = """
Hip=Hips
  Ab=Spine > Chest=Spine2
    Neck=Neck > Head=Head
    LShoulder=Shoulder > LUArm=Arm > LFArm=ForeArm > LHand=Hand
      Thumb Index Middle Ring Pinky: L*1 > L*2 > L*3
  LThigh=UpLeg > LShin=Leg > LFoot=Foot > LToe=Toe
"""

BIPED = """
Bip01
  Bip01_Footsteps
  Bip01_Pelvis=Hips
    Bip01_Spine=Spine > Bip01_Spine1=Spine1 > Bip01_Spine2=Spine2 > Bip01_Neck=Neck
      Bip01_Head=Head > Bip01_HeadNub
      Bip01_L_Clavicle=Shoulder > Bip01_L_UpperArm=Arm > Bip01_L_Forearm=ForeArm > Bip01_L_Hand=Hand
        0 1 2 3 4: Bip01_L_Finger* > Bip01_L_Finger*1 > Bip01_L_Finger*2 > Bip01_L_Finger*Nub
    Bip01_L_Thigh=UpLeg > Bip01_L_Calf=Leg > Bip01_L_Foot=Foot > Bip01_L_Toe0=Toe > Bip01_L_Toe0Nub
"""

CHARACTER_CREATOR = """
BoneRoot
  Hip=Hips
    Pelvis
      L_Thigh=UpLeg
        L_Calf=Leg
          L_Foot=Foot
            L_ToeBaseShareBone
            L_ToeBase=Toe
              Pinky Ring Mid Index Big: L_*Toe1
          L_CalfTwist01 > L_CalfTwist02
          L_KneeShareBone
        L_ThighTwist01 > L_ThighTwist02
    Waist=Spine > Spine01=Spine1 > Spine02=Spine2
      NeckTwist01=Neck > NeckTwist02 > Head=Head > FacialBone
        JawRoot
          Tongue01 > Tongue02 > Tongue03
          Teeth02
        L_Eye
        UpperJaw > Teeth01
      L_Clavicle=Shoulder > L_Upperarm=Arm
        L_Forearm=ForeArm
          L_ForearmTwist01 > L_ForearmTwist02
          L_ElbowShareBone
          L_Hand=Hand
            Pinky Ring Mid Index Thumb: L_*1 > L_*2 > L_*3
        L_UpperarmTwist01 > L_UpperarmTwist02
      L_RibsTwist > L_Breast
"""

MAKEHUMAN = """
root=Hips
  spine05=Spine > spine04 > spine03=Spine1
    spine02
      breast.L
      spine01=Spine2
        clavicle.L=Shoulder > shoulder01.L > upperarm01.L=Arm > upperarm02.L > lowerarm01.L=ForeArm
          lowerarm02.L > wrist.L=Hand
            finger1-1.L > finger1-2.L > finger1-3.L
            metacarpal1.L > finger2-1.L > finger2-2.L > finger2-3.L
            metacarpal2.L > finger3-1.L > finger3-2.L > finger3-3.L
            metacarpal3.L > finger4-1.L > finger4-2.L > finger4-3.L
            metacarpal4.L > finger5-1.L > finger5-2.L > finger5-3.L
        neck01=Neck > neck02 > neck03 > head=Head
          jaw
            special04
              oris02 > oris01
              oris06.L > oris07.L
            tongue00 > tongue01
              tongue02
                tongue03
                  tongue04
                  tongue07.L
                tongue06.L
              tongue05.L
          levator02.L > levator03.L > levator04.L > levator05.L
          special01
            oris04.L > oris03.L
            oris06 > oris05
          special03 > levator06.L
          special06.L > special05.L
            eye orbicularis03 orbicularis04: *.L
          temporalis01.L > oculi02.L > oculi01.L
          temporalis02.L > risorius02.L > risorius03.L
  pelvis.L > upperleg01.L=UpLeg > upperleg02.L > lowerleg01.L=Leg > lowerleg02.L > foot.L=Foot
    toe1-1.L=Toe > toe1-2.L
    2 3 4 5: toe*-1.L > toe*-2.L > toe*-3.L
"""

RIGIFY = """
spine=Hips
  spine.001=Spine > spine.002=Spine1 > spine.003=Spine2
    spine.004=Neck > spine.005 > spine.006=Head
    shoulder.L=Shoulder > upper_arm.L=Arm > upper_arm.L.001 > forearm.L=ForeArm > forearm.L.001 > hand.L=Hand
      palm.01.L
        f_index thumb: *.01.L > *.02.L > *.03.L
      palm.02.L > f_middle.01.L > f_middle.02.L > f_middle.03.L
      palm.03.L > f_ring.01.L > f_ring.02.L > f_ring.03.L
      palm.04.L > f_pinky.01.L > f_pinky.02.L > f_pinky.03.L
    breast.L
  pelvis.L
  thigh.L=UpLeg > thigh.L.001 > shin.L=Leg > shin.L.001 > foot.L=Foot > toe.L=Toe
"""

DAZ = """
hip=Hips
  pelvis > lThighBend=UpLeg > lThighTwist > lShin=Leg > lFoot=Foot
    lMetatarsals > lToe=Toe
      SmallToe4 SmallToe3 SmallToe2 SmallToe1 BigToe: l* > l*_2
    lHeel
  abdomenLower=Spine > abdomenUpper > chestLower=Spine1
    chestUpper=Spine2
      lCollar=Shoulder > lShldrBend=Arm > lShldrTwist > lForearmBend=ForeArm > lForearmTwist > lHand=Hand
        lThumb1 > lThumb2 > lThumb3
        lCarpal1 > lIndex1 > lIndex2 > lIndex3
        lCarpal2 > lMid1 > lMid2 > lMid3
        lCarpal3 > lRing1 > lRing2 > lRing3
        lCarpal4 > lPinky1 > lPinky2 > lPinky3
      neckLower=Neck > neckUpper > head=Head
        upperTeeth
        lowerJaw
          lowerTeeth
          tongue01 > tongue02 > tongue03 > tongue04
        lEye
        lEar
        upperFaceRig
    lPectoral
"""

# With joints of its semi-standard: twists within the arms, and legs once more.
MMD = """
全ての親
  センター=Hips
    上半身=Spine > 上半身2=Spine2
      首=Neck > 頭=Head
        左目
      左肩P > 左肩=Shoulder > 左肩C > 左腕=Arm > 左腕捩 > 左ひじ=ForeArm > 左手捩 > 左手首=Hand
        親指 人指 中指 薬指 小指: 左*１ > 左*２ > 左*３
    下半身
      左足=UpLeg > 左ひざ=Leg > 左足首=Foot > 左つま先=Toe
      腰キャンセル左 > 左足D > 左ひざD > 左足首D > 左足先EX
  左足IK親 > 左足ＩＫ > 左つま先ＩＫ
"""

CHILD = """
Hips=Hips
  LeftUpLeg=UpLeg > LeftLeg=Leg > LeftFoot=Foot
  Spine=Spine
    Head=Head
    LeftArm=Arm > LeftForeArm=ForeArm > LeftHand=Hand
"""

RIG = {
    "mixamo": Rig(MIXAMO, ("Left", "Right"), "t", prefix="mixamorig:"),
    "unreal": Rig(UNREAL, ("_l$", "_r"), "X", size=1.05),
    "unity": Rig(UNITY, ("Left", "Right"), "a", size=0.95),
    "vrm": Rig(VRM, ("_L_", "_R_"), "t", size=0.9),
    "smpl": Rig(SMPL, ("^L_", "R_"), "t"),
    "smplx": Rig(SMPLX, ("^left_", "right_"), "t", size=1.1),
    "rokoko": Rig(ROKOKO, ("Left", "Right"), "i"),
    "xsens": Rig(XSENS, ("Left", "Right"), "t"),
    "xsens_mvn": Rig(XSENS_MVN, ("Left", "Right"), "i"),
    "vicon": Rig(VICON, ("Left", "Right"), "X"),
    "optitrack": Rig(OPTITRACK, ("^L", "R"), "t", prefix="Skeleton1_"),
    "biped": Rig(BIPED, ("_L_", "_R_"), "X", carried=True),
    "character_creator": Rig(CHARACTER_CREATOR, ("^L_", "R_"), "a", prefix="CC_Base_"),
    "makehuman": Rig(MAKEHUMAN, (r"\.L$", ".R"), "Y"),
    "rigify": Rig(RIGIFY, (r"\.L", ".R"), "Y", prefix="DEF-"),
    "rigify_root": Rig("\nroot" + indent(RIGIFY, "  "), (r"\.L", ".R"), "Y"),
    "daz": Rig(DAZ, ("^l(?=[A-Z])", "r"), "a"),
    "mmd": Rig(MMD, ("左", "右"), "a", size=0.9),
    "child": Rig(CHILD, ("Left", "Right"), "Z", size=0.5),
}
RIGS: tuple[str, ...] = tuple(RIG)

# Where the canonical joints are in the CMU database's BVH files.
CMU = {joint: joint.replace("Toe", "ToeBase") for joint in JOINTS}
CMU |= {"Spine": "LowerBack", "Spine1": "Spine", "Spine2": "Spine1", "Neck": "Neck1"}

# How far arms hang down in the pose of zero rotations.
DOWN = {"t": 0.0, "a": np.pi / 4, "i": np.pi / 2}
X, Y, Z = np.eye(3)


class Tree:
    """The joints of a rig, both sides, depth first.

    Attributes:
        names, parents, children: as in a Skeleton.
        sides: 1 left, -1 right, 0 in the middle.
        canonical: the canonical name of each joint, or None.
        leader: the same, and where it is None that of the next joint above that has one.
        steps: how far below the next canonical joint is, 0 for those themselves, None where there is none.
    """

    def __init__(self, rig: Rig) -> None:
        self.names: list[str] = []
        self.parents: list[int] = []
        self.sides: list[int] = []
        self.canonical: list[str | None] = []
        self.leader: list[str | None] = []
        self._grow(rig, _read(rig.text), 0, -1, 0)
        self.children: list[list[int]] = [[] for _ in self.names]
        self.steps: list[int | None] = [None] * len(self.names)
        for joint in reversed(range(len(self.names))):
            below = [steps + 1 for child in self.children[joint] if (steps := self.steps[child]) is not None]
            self.steps[joint] = 0 if self.canonical[joint] else min(below, default=None)
            if joint:
                self.children[self.parents[joint]].insert(0, joint)

    def _grow(
        self, rig: Rig, written: list[tuple[str, str, int]], joint: int, parent: int, side: int
    ) -> None:
        name, canonical, _ = written[joint]
        right = re.sub(*rig.sides, name)
        if right != name and not side:
            self._grow(rig, written, joint, parent, 1)
            self._grow(rig, written, joint, parent, -1)
            return
        index = len(self.names)
        self.names.append(rig.prefix + (right if side < 0 else name))
        self.parents.append(parent)
        self.sides.append(side)
        self.canonical.append(("", "Left", "Right")[side] + canonical if canonical else None)
        self.leader.append(self.canonical[index] or (self.leader[parent] if index else None))
        for child, (_, _, above) in enumerate(written):
            if above == joint:
                self._grow(rig, written, child, index, side)

    def above(self, joint: int) -> list[int]:
        """The joint and all joints above it, upwards."""
        return [joint, *(self.above(self.parents[joint]) if joint else [])]

    def onward(self, joint: int) -> int | None:
        """The child on the way to canonical joints, one in the middle before those of the sides."""
        ways = [child for child in self.children[joint] if self.steps[child] is not None]
        return min(ways, key=lambda child: abs(self.sides[child]), default=None)

    def targets(self, joint: int) -> list[int]:
        """The next canonical joints below."""
        below = self.children[joint]
        return [at for child in below for at in ([child] if self.canonical[child] else self.targets(child))]


def _read(text: str) -> list[tuple[str, str, int]]:
    """The joints as written: name, canonical name or nothing, index of the parent."""
    joints: list[tuple[str, str, int]] = []
    above = [(-1, -1)]  # indentation of a line, its last joint
    for line in text.strip().splitlines():
        depth = len(line) - len(line.lstrip())
        above = [entry for entry in above if entry[0] < depth]
        words, _, chain = line.strip().rpartition(": ")
        for word in words.split() or [""]:
            last = above[-1][1]
            for joint in chain.replace("*", word).split(" > "):
                name, _, canonical = joint.partition("=")
                joints.append((name, canonical, last))
                last = len(joints) - 1
        above.append((depth, last))
    return joints


def build(name: str, clip: Clip) -> tuple[Clip, dict[str, str]]:
    """The rig `name` performing a CMU clip, and which joint of the rig each canonical joint is.

    Every canonical joint turns in the world as the performer's does, from the T-pose on. All others stay as
    they are on the joint above, but for fingers and faces, which move a little on their own.
    """
    rig = RIG[name]
    tree = Tree(rig)
    parents = tuple(tree.parents)
    source = {joint: clip.skeleton.index(cmu) for joint, cmu in CMU.items()}
    place = _t_pose(tree, rig, _performer(clip, source, rig.size))
    axes = _axes(tree, rig, place)
    up = rotations.conjugate(axes[[max(parent, 0) for parent in parents]])
    bones = np.concatenate([place[:1], rotations.rotate(up, place - place[list(parents)])[1:]])

    turned, positions = clip.kinematics()
    world = rotations.identity(len(clip), len(parents))
    for joint, leader in enumerate(tree.leader):
        if leader or rig.carried:
            world[:, joint] = turned[:, source[leader or "Hips"]]
    local = kinematics.local_rotations(rotations.multiply(world, axes), parents)
    seconds = np.arange(len(clip)) / clip.fps
    for joint, leader in enumerate(tree.leader):
        if tree.steps[joint] is None and leader and leader.endswith(("Hand", "Head")):
            sway = rotations.about("Z", 0.15 * np.sin(2.5 * seconds + joint))
            local[:, joint] = rotations.multiply(local[:, joint], sway)

    hips, travel = tree.canonical.index("Hips"), rig.size * positions[:, source["Hips"]]
    translated, translation = (0,), travel[:, None]
    if hips and not rig.carried:
        translated = (0, hips)
        translation = np.stack([np.zeros_like(travel), rotations.rotate(up[hips], travel)], axis=1)
    skeleton = Skeleton(tuple(tree.names), parents, bones)
    expected = {joint: tree.names[tree.canonical.index(joint)] for joint in JOINTS if joint in tree.canonical}
    return Clip(skeleton, local, translation, clip.fps, translated, name), expected


def _performer(clip: Clip, source: dict[str, int], size: float) -> dict[str, np.ndarray]:
    """Where the canonical joints are in the T-pose, scaled, toes on the floor.

    The spine is spread out from the hips to the chest and clavicles begin beside it: CMU has several of these
    joints at one place.
    """
    skeleton = clip.skeleton
    bones = skeleton.rest_translation * skeleton.scale_above[:, None]
    _, positions = kinematics.forward(rotations.identity(len(skeleton)), bones, skeleton.parents)
    place = {joint: positions[index] for joint, index in source.items()}
    hips, chest = place["Hips"], place["Spine2"]
    place |= {"Spine": hips + (chest - hips) / 3, "Spine1": hips + (chest - hips) * 2 / 3}
    place |= {side + "Shoulder": chest + 0.15 * (place[side + "Arm"] - chest) for side in ("Left", "Right")}
    floor = hips * [1, 0, 1] + Y * min(place["LeftToe"][1], place["RightToe"][1])
    return {joint: size * (position - floor) for joint, position in place.items()}


def _t_pose(tree: Tree, rig: Rig, performer: dict[str, np.ndarray]) -> np.ndarray:
    """(J, 3) all joints in the T-pose: canonical ones, those on the way to them, and then all others."""
    place = np.zeros((len(tree.names), 3))
    if rig.carried:
        place[0] = performer["Hips"]
    for joint, name in enumerate(tree.canonical):
        if name:
            place[joint] = performer[name]
    for joint, steps in enumerate(tree.steps):
        if joint and steps:
            start = place[tree.parents[joint]]
            place[joint] = start + (place[tree.targets(joint)].mean(axis=0) - start) / (steps + 1)
    for joint, steps in enumerate(tree.steps):
        if steps is None:
            place[joint] = place[tree.parents[joint]] + rig.size * _beside(tree, place, joint)
    return place


def _beside(tree: Tree, place: np.ndarray, joint: int) -> np.ndarray:
    """The way from the parent to a joint that leads nowhere: along its bone, side by side with its like."""
    parent, side = tree.parents[joint], tree.sides[joint]
    along = _along(tree, place, parent)
    like = [at for at in tree.children[parent] if tree.steps[at] is None and tree.sides[at] == side]
    spread = side * X if side and abs(along[0]) < 0.7 else Z
    way = (0.03 if tree.steps[parent] is None else 0.08) * along
    way = way + 0.02 * (like.index(joint) - (len(like) - 1) / 2) * spread
    return way if tree.sides[parent] else way + 0.03 * side * X


def _along(tree: Tree, place: np.ndarray, joint: int) -> np.ndarray:
    """Where a joint's bone points: to the next joint, toes ahead, other ends of limbs as the bone above."""
    onward = tree.onward(joint)
    if (tree.canonical[joint] or "").endswith("Toe"):
        return Z
    way = place[joint] - place[tree.parents[joint]] if onward is None else place[onward] - place[joint]
    return rotations.normalize(way) if np.linalg.norm(way) > 1e-6 else Y


def _axes(tree: Tree, rig: Rig, place: np.ndarray) -> np.ndarray:
    """(J, 4) the joints' global rotations in the T-pose."""
    axes = rotations.identity(len(tree.names))
    for joint, side in enumerate(tree.sides):
        if rig.rest not in DOWN:
            roll = rotations.about(rig.rest, np.array(2.4 * joint))
            bone = {"X": X, "Y": Y, "Z": Z}[rig.rest]
            axes[joint] = rotations.multiply(rotations.between(bone, _along(tree, place, joint)), roll)
        elif {"LeftArm", "RightArm"} & {tree.canonical[at] for at in tree.above(joint)}:
            axes[joint] = rotations.about("Z", np.array(side * DOWN[rig.rest]))
    return axes


TARGET = 2  # of `under_root`: an IK target beside the hips, where the left foot is


def under_root(clip: Clip, goes: bool, hips_rest: float = 0.9) -> Clip:
    """The same motion on a rig whose hips, and a target of the left foot, hang from a root.

    The root is turned as programs with Z up write it. It stays at the origin, or `goes` below the hips.
    """
    old = clip.skeleton
    above = (-1, 0, 0, *(1 if parent == 0 else parent + 2 for parent in old.parents[1:]))
    names = ("root", old.names[0], "ik_foot_l", *old.names[1:])
    rest = np.insert(old.rest_translation, [0, 1], 0.0, axis=0)
    rest[1, 2] = hips_rest
    skeleton = Skeleton(names, above, rest)
    places = np.zeros((len(clip), 3, 3))
    if goes:
        places[:, 0] = clip.root * [1.0, 0.0, 1.0]
    back = rotations.about("x", np.array(np.pi / 2))
    turned, placed = clip.kinematics()
    rotation = np.insert(clip.rotation, [0, 1], rotations.identity(), axis=1)
    rotation[:, 0] = rotations.conjugate(back)
    for joint, like in ((1, 0), (TARGET, old.index("LeftFoot"))):
        places[:, joint] = rotations.rotate(back, placed[:, like] - places[:, 0])
        rotation[:, joint] = rotations.multiply(back, turned[:, like])
    return Clip(skeleton, rotation, places, clip.fps, (0, 1, TARGET), clip.name)


def six_channels(clip: Clip) -> Clip:
    """The clip with positions of every joint in every frame, as some programs write files."""
    joints = tuple(range(len(clip.skeleton)))
    return replace(clip, translation=clip.local_translation(), translated=joints, source=None)


def twice(clip: Clip) -> Clip:
    """Two bodies in one file, that do the same."""
    old, count = clip.skeleton, len(clip.skeleton)
    skeleton = Skeleton(
        (*old.names, *(f"B_{name}" for name in old.names)),
        (*old.parents, *(parent + count if parent >= 0 else -1 for parent in old.parents)),
        np.tile(old.rest_translation, (2, 1)),
    )
    translated = (*clip.translated, *(joint + count for joint in clip.translated))
    both = np.tile(clip.rotation, (1, 2, 1)), np.tile(clip.translation, (1, 2, 1))
    return Clip(skeleton, *both, clip.fps, translated)
