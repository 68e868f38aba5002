"""Networks complete a body alike on whatever floor it stands."""

from __future__ import annotations

import numpy as np
import pytest

import interpose
from interpose.clip import Clip
from interpose.methods.bodies import floor
from interpose.observation import Gap, Observation, Pin

GAPS = [Gap(140, 170)]


def raised(clip: Clip, by: float) -> Clip:
    return clip.with_motion(clip.rotation, clip.translation + np.array([0.0, by, 0.0]))


@pytest.mark.parametrize("method", ["small", "cae", "cmib", "stmi-gan"])
@pytest.mark.parametrize("height", [-0.8, 1.7])
def test_the_floor_may_be_anywhere(cmu_walk, method, height):
    gaps = [Gap(140, 170, ("LeftUpLeg", "LeftLeg", "LeftFoot"))] if method == "stmi-gan" else GAPS
    base = interpose.fill(cmu_walk, gaps, method=method)
    other = interpose.fill(raised(cmu_walk, height), gaps, method=method)
    # Not the same to the last digit: the walk's own floor is off by a centimetre, which counts as none.
    # A foot that takes a step for a shuffle in the one may be just quick enough without in the other.
    off = np.abs(raised(other.clip, -height).positions() - base.clip.positions())[140:170]
    assert off.mean() < 0.005
    assert off.max() < 0.1
    assert [gap.method for gap in other.report.gaps] == [method]


def test_pins_and_what_the_network_itself_said_are_on_that_floor(cmu_walk):
    high = raised(cmu_walk, 1.7)
    hand = high.positions()[155, high.skeleton.index("LeftHand")] + [0.0, 0.1, 0.0]
    done = interpose.fill(high, GAPS, method="small", pins=[Pin("LeftHand", (155,), hand[None])])
    assert np.linalg.norm(done.clip.positions()[155, high.skeleton.index("LeftHand")] - hand) < 0.001
    spoken = interpose.fill(high, GAPS, method="cmib").raw.clip.root[140:170, 1]
    assert np.abs(spoken - high.root[140:170, 1]).max() < 0.2


def test_where_the_floor_is(cmu_walk):
    seen = Observation.from_gaps(cmu_walk, GAPS)
    assert floor(cmu_walk, seen) == 0.0, "about there"
    assert floor(raised(cmu_walk, 0.5), seen) == pytest.approx(0.5, abs=0.05)
    # What is not known says nothing.
    translation = cmu_walk.translation.copy()
    translation[140:170] -= 5
    assert floor(cmu_walk.with_motion(cmu_walk.rotation, translation), seen) == 0.0
    # Two keys may be in the air, but not as high as this, nor under the floor.
    keys = Observation.from_gaps(cmu_walk, [Gap(1, 90), Gap(91, len(cmu_walk))])
    found = [floor(raised(cmu_walk, height), keys) for height in (0.4, 1.5, -0.4)]
    assert found == pytest.approx([0.0, 1.5, -0.4], abs=0.06)
