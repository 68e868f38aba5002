"""What a gap's report expects joints to be off by."""

from __future__ import annotations

import numpy as np
import pytest

from interpose.finish import complete
from interpose.methods.base import small
from interpose.observation import Gap, Observation
from interpose.skeletons import find_mapping

ARM = ("LeftArm", "LeftForeArm", "LeftHand")


@pytest.mark.parametrize("joints", [None, ARM])
def test_errors_are_expected_of_the_joints_that_are_not_known(cmu_walk, joints):
    gap = Gap(75, 120, joints)
    done = complete(cmu_walk, Observation.from_gaps(cmu_walk, [gap]), small())
    (report,) = done.report.gaps
    said = 100 * done.raw.expected[75:120].mean()
    canonical = list(find_mapping(cmu_walk.skeleton).mapped[1])
    below = cmu_walk.skeleton.below[canonical, cmu_walk.skeleton.index("LeftArm")]
    hidden = len(canonical) if joints is None else below.sum() - 1  # where the arm begins is known
    assert report.expected == pytest.approx(said * len(canonical) / hidden)
    off = np.linalg.norm(done.clip.positions() - cmu_walk.positions(), axis=-1)[75:120][:, canonical]
    assert 0.3 < report.expected / (100 * off.sum() / (45 * hidden)) < 3


def test_nothing_is_expected_of_methods_that_do_not_say_it(cmu_walk):
    from interpose.methods.classical import Spline

    done = complete(cmu_walk, Observation.from_gaps(cmu_walk, [Gap(75, 120, ARM)]), Spline())
    assert done.report.gaps[0].expected is None
