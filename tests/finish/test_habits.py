"""How bodies move all along: told by the whole take, and of each by itself."""

import numpy as np
import pytest
from tests.finish.test_axes import off_axis
from tests.skeletons.rigs import twice

import interpose
from interpose.finish.habits import Habits
from interpose.geometry import rotations
from interpose.observation import Gap, Observation
from interpose.skeletons.performers import clip_of, performers


def test_an_axis_that_shows_elsewhere_in_the_take_is_kept_to(cmu_walk):
    """An elbow that hardly bends for seconds around a gap tells nothing of its axis there."""
    count = len(cmu_walk)
    to_and_fro = np.concatenate([np.arange(count), np.arange(count)[::-1]] * 2)
    long = cmu_walk.with_motion(cmu_walk.rotation[to_and_fro], cmu_walk.translation[to_and_fro])
    elbow, rotation = long.skeleton.index("LeftForeArm"), long.rotation.copy()
    rotation[300:560, elbow] = rotation[300, elbow]
    stiff = long.with_motion(rotation, long.translation)
    done = interpose.fill(stiff, [Gap(410, 450)], method="small").clip
    assert rotations.angle(done.rotation[410:450, elbow], rotation[300, elbow]).max() > np.radians(1)
    assert off_axis(done, elbow, stiff) < 0.01


@pytest.fixture
def pair(cmu_walk) -> tuple[interpose.Clip, Observation]:
    """A body that is known but for a gap, and another one of which there are lone keys."""
    two, count = twice(cmu_walk), len(cmu_walk.skeleton)
    seen = Observation.from_gaps(two, [Gap(60, 90, two.skeleton.names[:count])])
    lost = np.arange(len(two)) % 20 != 0
    seen.rotation[np.ix_(lost, np.arange(count, 2 * count))] = False
    seen.translation[np.ix_(lost, np.arange(count, 2 * count))] = False
    return two, seen


def test_a_body_has_its_own_habits(pair):
    two, seen = pair
    both = Habits.of(two, seen)
    for body in performers(two.skeleton):
        own = list(body)
        alone = Habits.of(clip_of(two, body), Observation(seen.rotation[:, own], seen.translation[:, own]))
        some = both.some(body)
        np.testing.assert_array_equal(some.limits, alone.limits)
        np.testing.assert_array_equal(some.still, alone.still)
        assert some.single.keys() == alone.single.keys()
    assert np.isnan(both.limits).tolist() == [False] * 31 + [True] * 31


def test_a_body_of_lone_keys_is_filled_as_if_it_were_alone(pair):
    two, seen = pair
    body = performers(two.skeleton)[1]
    own = list(body)
    alone = interpose.fill(
        clip_of(two, body), Observation(seen.rotation[:, own], seen.translation[:, own]), method="small"
    )
    both = interpose.fill(two, seen, method="small")
    np.testing.assert_allclose(both.clip.rotation[:, own], alone.clip.rotation, atol=1e-9)
