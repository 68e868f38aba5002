"""What a gap's report expects joints to be off by."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from interpose.finish import complete
from interpose.finish.gap_report import PARTS, _part
from interpose.methods.base import small
from interpose.observation import Gap, Observation
from interpose.skeletons import find_mapping

ARM = ("LeftArm", "LeftForeArm", "LeftHand")
HIPS_AND_ARM = ("Hips", *ARM)


@pytest.mark.parametrize(
    ("joints", "top", "share"),
    [
        (None, "Hips", 1.0),
        (ARM, "LeftArm", PARTS["Arm"]),
        (("RightFoot",), "RightFoot", PARTS["Foot"]),
        (("RightLeg",), "RightLeg", PARTS["Leg"]),
        (("Hips",), "Hips", PARTS["Hips"]),
        (HIPS_AND_ARM, "Hips", np.mean([1.0, PARTS["Arm"]])),
    ],
)
def test_errors_are_expected_of_the_joints_that_are_not_known(cmu_walk, joints, top, share):
    """And of a part as much of what the network says as such parts are off by."""
    gap = Gap(75, 120, joints)
    done = complete(cmu_walk, Observation.from_gaps(cmu_walk, [gap]), small())
    (report,) = done.report.gaps
    said = 100 * done.raw.expected[75:120].mean()
    canonical = list(find_mapping(cmu_walk.skeleton).mapped[1])
    below = cmu_walk.skeleton.below[canonical, cmu_walk.skeleton.index(top)]
    hidden = len(canonical) if joints is None else below.sum() - 1  # where it begins is known
    assert report.expected == pytest.approx(share * said * len(canonical) / hidden)
    off = np.linalg.norm(done.clip.positions() - cmu_walk.positions(), axis=-1)[75:120][:, canonical]
    assert 0.3 < report.expected / (100 * off.sum() / (45 * hidden)) < 3


def test_a_part_begins_where_it_does_also_on_a_rig_that_lacks_a_joint_of_it(cmu_walk):
    """Bandai-Namco's spine has one joint less: what is above it hangs from the one below."""
    lacking = replace(cmu_walk.skeleton, roles={"Spine1": ""})
    said = []
    for skeleton in (cmu_walk.skeleton, lacking):
        clip = replace(cmu_walk, skeleton=skeleton, source=None)
        mapping = find_mapping(skeleton)
        upper = tuple(np.array(skeleton.names)[skeleton.below[:, mapping["Spine"]]])
        seen = Observation.from_gaps(clip, [Gap(75, 120, upper)])
        said.append(_part(clip, seen.slice(75, 120)))
    assert said == [PARTS["Spine"]] * 2


def test_nothing_is_expected_of_methods_that_do_not_say_it(cmu_walk):
    from interpose.methods.classical import Spline

    done = complete(cmu_walk, Observation.from_gaps(cmu_walk, [Gap(75, 120, ARM)]), Spline())
    assert done.report.gaps[0].expected is None
