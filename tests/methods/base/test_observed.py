"""Motion goes through lone keys, where networks would slow down."""

from __future__ import annotations

import numpy as np
import pytest

from interpose.methods.base.observed import through
from interpose.observation import Gap, Observation


def times(clip, gaps, fps=30.0):
    seen = Observation.from_gaps(clip, [Gap(*gap) for gap in gaps])
    return through(seen, seen.positions(clip.skeleton)[:, 0], fps)


@pytest.mark.parametrize("length", [2, 15, 30, 90])
def test_time_runs_faster_through_a_key_between_two_gaps(cmu_walk, length):
    key = 100
    found = times(cmu_walk, [(key + 1 - length, key), (key + 1, key + length)])
    steps, frames = np.diff(found), np.arange(len(cmu_walk))
    assert (found[: key + 1 - length] == frames[: key + 1 - length]).all(), "what is known stays"
    assert found[key] == key
    assert (found[key + length :] == frames[key + length :]).all()
    assert steps.min() > 0.94
    if length > 2:
        assert steps[key - 1] == steps[key] == pytest.approx(steps.max())
        assert 1.02 < steps[key] < 1.11
        # The other way round it is the same, and nowhere by half a frame or more.
        assert found[key + 1 : key + length] - key == pytest.approx(key - found[key - 1 : key - length : -1])
        assert np.abs(found - frames).max() < 0.45


def test_it_runs_as_ever_where_more_than_a_pose_tells_how_motion_goes(cmu_walk):
    frames = np.arange(len(cmu_walk))
    assert (times(cmu_walk, [(40, 70)]) == frames).all()
    assert (times(cmu_walk, [(40, 70), (72, 100)]) == frames).all(), "two known frames tell a velocity"
    assert (times(cmu_walk, [(1, len(cmu_walk) - 1)]) == frames).all(), "ends of the clip"
    assert (times(cmu_walk, [(40, 70), (71, 100, ("LeftArm",))]) == frames).all(), "the rest is known there"


def test_at_twice_the_frame_rate_it_is_the_same_in_seconds(cmu_walk):
    slow, fast = times(cmu_walk, [(41, 60), (61, 80)]), times(cmu_walk, [(81, 120), (121, 160)], 60.0)
    assert fast[80:161:2] / 2 == pytest.approx(slow[40:81])
