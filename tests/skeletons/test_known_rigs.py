"""Rigs whose T-pose is known: found by names and zero pose together, and by nothing less."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from interpose.clip import Clip, Skeleton
from interpose.geometry import rotations
from interpose.skeletons import JOINTS, PARENTS, find_humanoid, find_mapping
from interpose.skeletons.rigs import RIGS, directions, known_rest


@pytest.fixture
def heap() -> Skeleton:
    """A skeleton with the names and the zero pose of LAFAN1's."""
    rig = next(rig for rig in json.loads(RIGS.read_text()) if rig["rig"] == "LAFAN1")
    bones = 0.2 * np.array(rig["directions"])
    return Skeleton(tuple(rig["names"]), PARENTS, bones, roles={"hand": "right"})


def known(skeleton: Skeleton) -> tuple[str, np.ndarray] | None:
    return known_rest(find_mapping(skeleton))


def test_few_frames_do_not_matter_for_a_known_rig(heap):
    """From a single frame comes the same T-pose as from any other."""
    rng = np.random.default_rng(0)
    rests = []
    for _ in range(2):
        turned = rotations.exp(0.5 * rng.standard_normal((1, 22, 3)))
        rests.append(find_humanoid(Clip(heap, turned, np.zeros((1, 1, 3)), 30.0)).rest)
    assert rests[0].how == rests[1].how == "rig"
    assert np.array_equal(rests[0].rotation, rests[1].rotation)
    assert np.allclose(np.linalg.norm(rests[0].rotation, axis=1), 1.0)


def test_a_rig_is_known_at_any_size(heap):
    assert known(heap)[0] == "LAFAN1"
    assert known(replace(heap, rest_translation=1.4 * heap.rest_translation))[0] == "LAFAN1"


def test_names_and_zero_pose_must_both_be_those_of_the_rig(heap):
    renamed = replace(heap, names=("Pelvis", *JOINTS[1:]))
    assert known(renamed) is None
    bent = heap.rest_translation.copy()
    bent[JOINTS.index("LeftForeArm")] = (0.0, -0.3, 0.0)
    assert known(replace(heap, rest_translation=bent)) is None
    assert (directions(heap)[0] == 0).all()


def test_what_tools_add_makes_no_other_rig(heap):
    """A namespace, a reference above the hips, a sword in the hand."""
    count, hand = len(heap), heap.index("RightHand")
    names = ("Bob:Reference", *(f"Bob:{name}" for name in heap.names), "Bob:Sword")
    parents = (-1, *(parent + 1 for parent in heap.parents), hand + 1)
    bones = np.concatenate([np.zeros((1, 3)), heap.rest_translation, [[0.1, 0.0, 0.0]]])
    exported = Skeleton(names, parents, bones, roles={"hand": "right"})
    assert len(exported) == count + 2
    assert np.array_equal(known(exported)[1], known(heap)[1])


@pytest.mark.parametrize("called", ["Bob_{}", "{}#2", "Bob:{}#2"])
def test_another_performers_names_are_those_of_the_rig(heap, called):
    other = replace(heap, names=tuple(called.format(name) for name in heap.names))
    assert np.array_equal(known(other)[1], known(heap)[1])


def test_a_joint_between_the_rigs_own_makes_another_rig(heap):
    arm, elbow = heap.index("RightArm"), heap.index("RightForeArm")
    parents = [parent + (parent >= elbow) for parent in heap.parents]
    names = (*heap.names[:elbow], "RightTwist", *heap.names[elbow:])
    bones = np.insert(heap.rest_translation, elbow, [0.1, 0.0, 0.0], axis=0)
    twisted = Skeleton(names, (*parents[:elbow], arm, elbow, *parents[elbow + 1 :]), bones)
    assert known(twisted) is None
