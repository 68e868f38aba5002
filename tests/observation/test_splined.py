"""Joints that turn along a curve of a program."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline, CubicSpline

from interpose.clip import Clip
from interpose.geometry import rotations
from interpose.observation.finding import to_gaps
from interpose.observation.scan import scan
from interpose.observation.splined import splined

START, STOP = 60, 84  # .8 s


def below(clip: Clip, name: str) -> list[int]:
    top = clip.skeleton.index(name)
    return [j for j in range(len(clip.skeleton)) if j == top or top in clip.skeleton.ancestors(j)]


def led(clip: Clip, joints: list[int], how: str) -> Clip:
    """Joints are splined, or eased, from the frame before to the one after."""
    rotation, ends = clip.rotation.copy(), np.array([START - 1, STOP])
    for joint in joints:
        turned = rotations.continuous(clip.rotation[:, joint])
        if how == "splined":
            paces = (turned[ends] - turned[ends - 1], turned[ends + 1] - turned[ends])
            between = CubicHermiteSpline(ends, turned[ends], [paces[0][0], paces[1][1]])(
                np.arange(START, STOP)
            )
            rotation[START:STOP, joint] = rotations.normalize(between)
        else:
            share = np.arange(1, STOP - START + 1) / (STOP - START + 1)
            two = rotations.continuous(turned[ends])
            rotation[START:STOP, joint] = rotations.slerp(two[:1], two[1:], share * share * (3 - 2 * share))
    return clip.with_motion(rotation, clip.translation)


@pytest.mark.parametrize(
    ("limb", "how"), [("LeftArm", "splined"), ("RightUpLeg", "splined"), ("RightUpLeg", "eased")]
)
def test_a_limb_that_is_led_along_a_curve_is_found_and_is_no_gap(cmu_walk, limb, how):
    (found,) = [one for one in scan(led(cmu_walk, below(cmu_walk, limb), how)) if one.kind == "splined"]
    assert abs(found.start - START) <= 2
    assert abs(found.stop - STOP) <= 2
    assert found.joints is not None
    assert {*found.joints} <= {cmu_walk.skeleton.names[joint] for joint in below(cmu_walk, limb)}
    assert not to_gaps([found])


def test_a_pose_that_is_splined_is_one_finding_of_all_of_it(cmu_walk):
    found = scan(led(cmu_walk, [*range(len(cmu_walk.skeleton))], "splined"))
    assert [(one.kind, one.joints) for one in found] == [("splined", None)]


def test_recorded_motion_and_what_was_animated_throughout_are_not_splined(cmu_walk):
    assert not list(splined(cmu_walk))
    for every in (8, 40):
        keys = np.arange(0, len(cmu_walk), every)
        turned = rotations.continuous(cmu_walk.rotation)
        rotation = rotations.normalize(CubicSpline(keys, turned[keys])(np.arange(keys[-1] + 1)))
        animated = cmu_walk.slice(0, len(rotation))
        assert not list(splined(animated.with_motion(rotation, animated.translation)))


def test_a_clip_shorter_than_what_tells_has_none(cmu_walk):
    assert not list(splined(cmu_walk.slice(0, 12)))
