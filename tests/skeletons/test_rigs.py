"""The rigs that other tests map are what they claim to be."""

from __future__ import annotations

import numpy as np
import pytest
from tests.skeletons import rigs

from interpose.clip import Clip
from interpose.geometry import kinematics, rotations
from interpose.skeletons.canonical import JOINTS

JOINT_COUNTS = {"mixamo": 65, "smpl": 24, "smplx": 55, "xsens_mvn": 23, "character_creator": 101}
JOINT_COUNTS |= {"unity": 55, "makehuman": 163, "child": 15}
MISSING = {
    "optitrack": {"Spine1"},
    "mmd": {"Spine1"},
    "child": {"Spine1", "Spine2", "Neck", "LeftShoulder", "RightShoulder", "LeftToe", "RightToe"},
}
LEGS = [(side + a, side + b) for side in ("Left", "Right") for a, b in (("UpLeg", "Leg"), ("Leg", "Foot"))]
ARMS = [
    (side + a, side + b) for side in ("Left", "Right") for a, b in (("Arm", "ForeArm"), ("ForeArm", "Hand"))
]


def degrees(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The angles between vectors (..., 3)."""
    cosine = np.sum(rotations.normalize(a) * rotations.normalize(b), axis=-1)
    return np.degrees(np.arccos(np.clip(cosine, -1, 1)))


def canonical(clip: Clip, joints: dict[str, str]) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Global rotations and positions of a clip's canonical joints."""
    turned, placed = clip.kinematics()
    index = {joint: clip.skeleton.index(name) for joint, name in joints.items()}
    return {j: turned[:, i] for j, i in index.items()}, {j: placed[:, i] for j, i in index.items()}


@pytest.mark.parametrize("name", rigs.RIGS)
def test_rigs_are_sound(name, cmu_walk):
    clip, expected = rigs.build(name, cmu_walk)
    skeleton = clip.skeleton
    assert set(expected.values()) <= set(skeleton.names)
    assert len(set(expected.values())) == len(expected)
    assert set(JOINTS) - set(expected) == MISSING.get(name, set())
    assert len(skeleton) == JOINT_COUNTS.get(name, len(skeleton))
    np.testing.assert_allclose(np.linalg.norm(clip.rotation, axis=-1), 1)

    # The same pose, in the same place ...
    turned, placed = canonical(clip, expected)
    source_turned, source_placed = canonical(cmu_walk, rigs.CMU)
    np.testing.assert_allclose(placed["Hips"], rigs.RIG[name].size * source_placed["Hips"], atol=1e-6)
    for a, b in LEGS + ARMS:
        assert degrees(placed[b] - placed[a], source_placed[b] - source_placed[a]).max() < 2
    for joint in expected:
        held = rotations.multiply(rotations.conjugate(source_turned[joint]), turned[joint])
        np.testing.assert_allclose(np.abs(np.sum(held * held[:1], axis=-1)), 1, atol=1e-9)

    # ... on bones of its own: each canonical joint is carried rigidly by the next one above.
    for joint, at in expected.items():
        above = [skeleton.names[index] for index in skeleton.ancestors(skeleton.index(at))]
        leader = next((j for a in above for j, mapped in expected.items() if mapped == a), None)
        if leader:
            way = rotations.rotate(rotations.conjugate(source_turned[leader]), placed[joint] - placed[leader])
            np.testing.assert_allclose(way, np.broadcast_to(way[0], way.shape), atol=1e-6)
            assert np.linalg.norm(way[0]) > 0.01 * rigs.RIG[name].size


@pytest.mark.parametrize("name", rigs.RIGS)
def test_zero_rotations_are_the_pose_they_claim_to_be(name, cmu_walk):
    clip, expected = rigs.build(name, cmu_walk)
    skeleton, rest = clip.skeleton, rigs.RIG[name].rest
    _, zero = kinematics.forward(
        rotations.identity(len(skeleton)), skeleton.rest_translation, skeleton.parents
    )
    for a, b in LEGS + ARMS:
        bone = zero[skeleton.index(expected[b])] - zero[skeleton.index(expected[a])]
        if rest in rigs.DOWN:
            from_down = 90 - np.degrees(rigs.DOWN[rest]) if (a, b) in ARMS else 20
            assert degrees(bone, np.array([0.0, -1.0, 0.0])) == pytest.approx(from_down, abs=1)
        else:
            assert degrees(bone, np.eye(3)["XYZ".index(rest)]) < 1e-3


def test_fingers_and_faces_move_on_their_own(cmu_walk):
    clip, _ = rigs.build("character_creator", cmu_walk)
    for joint in ("CC_Base_L_Index2", "CC_Base_R_Eye"):
        assert np.ptp(clip.rotation[:, clip.skeleton.index(joint)], axis=0).max() > 0.05
    twist = clip.rotation[:, clip.skeleton.index("CC_Base_L_ForearmTwist01")]
    assert np.ptp(twist, axis=0).max() < 1e-9
