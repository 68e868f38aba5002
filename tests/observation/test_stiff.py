"""Limbs that are held with a tremble, and joints that are led straight."""

from __future__ import annotations

import numpy as np
import pytest

from interpose.clip import Clip
from interpose.geometry import rotations
from interpose.observation.scan import scan, to_gaps

START, STOP = 80, 110


def below(clip: Clip, name: str) -> list[int]:
    top = clip.skeleton.index(name)
    return [j for j in range(len(clip.skeleton)) if j == top or top in clip.skeleton.ancestors(j)]


def held(clip: Clip, name: str, degrees: float) -> Clip:
    """A limb stays where it was, as far as noise lets it."""
    rng, rotation = np.random.default_rng(0), clip.rotation.copy()
    for joint in below(clip, name):
        noise = rotations.exp(np.radians(degrees) * rng.standard_normal((STOP - START, 3)))
        rotation[START:STOP, joint] = rotations.multiply(noise, clip.rotation[START - 1, joint])
    return clip.with_motion(rotation, clip.translation)


def led(clip: Clip, joints: list[int]) -> Clip:
    """Joints are led straight from the frame before to the one after."""
    rotation, share = clip.rotation.copy(), np.arange(1, STOP - START + 1) / (STOP - START + 1)
    for joint in joints:
        ends = rotations.continuous(clip.rotation[[START - 1, STOP], joint])
        rotation[START:STOP, joint] = rotations.slerp(ends[:1], ends[1:], share)
    return clip.with_motion(rotation, clip.translation)


@pytest.mark.parametrize("degrees", [0.1, 0.3])
@pytest.mark.parametrize("limb", ["LeftArm", "RightUpLeg"])
def test_a_limb_that_is_held_and_trembles_is_frozen(cmu_walk, limb, degrees):
    (found,) = [one for one in scan(held(cmu_walk, limb, degrees)) if one.kind == "frozen"]
    assert found.joints is not None
    assert {*found.joints} <= {cmu_walk.skeleton.names[joint] for joint in below(cmu_walk, limb)}
    assert abs(found.start - START) <= 8
    assert found.stop == STOP
    assert to_gaps([found])


@pytest.mark.parametrize("limb", ["LeftArm", "RightUpLeg"])
def test_a_limb_that_is_led_straight_is_found_exactly(cmu_walk, limb):
    (found,) = [one for one in scan(led(cmu_walk, below(cmu_walk, limb))) if one.kind == "straight"]
    assert (found.start, found.stop) == (START, STOP)
    assert found.joints is not None
    assert limb in found.joints


def test_a_pose_that_is_led_straight_is_a_gap_of_the_whole_pose(cmu_walk):
    found = [one for one in scan(led(cmu_walk, [*range(len(cmu_walk.skeleton))])) if one.kind == "straight"]
    assert [(one.joints, one.start, one.stop) for one in found] == [(None, START, STOP)]


def test_what_was_animated_so_is_as_it_should_be(cmu_walk):
    """Keys every ten frames and straight lines between them: nothing is missing there."""
    keys = np.arange(len(cmu_walk)) / 10
    rotation = np.stack(
        [
            rotations.slerp(
                *(rotations.continuous(cmu_walk.rotation[[int(k) * 10, min(int(k) * 10 + 10, 208)]]))[
                    :, None
                ],
                np.full(1, k % 1),
            )[0]
            for k in keys
        ]
    )
    assert not [
        one for one in scan(cmu_walk.with_motion(rotation, cmu_walk.translation)) if one.kind == "straight"
    ]


def test_people_who_walk_run_and_jump_are_not_stiff(cmu_walk, data):
    from interpose.formats import load

    for clip in (cmu_walk, load(data / "cmu_run.bvh"), load(data / "cmu_jump.bvh")):
        assert not [one for one in scan(clip) if one.kind in ("straight", "frozen")]
