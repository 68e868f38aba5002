"""Who is in the air comes down, and nobody else does."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from interpose import formats
from interpose.clip import Clip
from interpose.finish import complete, falling, feet
from interpose.methods.classical import ZeroVelocity
from interpose.observation import Gap, Observation

AHEAD = 30  # frames


@pytest.fixture(scope="module")
def jump(data: Path) -> Clip:
    return formats.load(data / "cmu_jump.bvh")


def heights(clip: Clip) -> np.ndarray:
    """(F,) metres of the lowest joint above where it is in the clip's stances."""
    low = clip.positions()[..., 1].min(axis=1)
    return low - np.percentile(low, 10)


def takes_off(jump: Clip) -> int:
    """The third frame of a flight."""
    up = heights(jump) > 0.05
    return next(i for i in range(10, len(jump)) if up[i - 2 : i + 1].all() and not up[i - 3])


def cut(jump: Clip, last: int) -> tuple[Clip, Observation]:
    """The jump up to a frame, and a second in which that pose stays where it is."""
    frames = [*range(last + 1), *[last] * AHEAD]
    clip = jump.with_motion(jump.rotation[frames], jump.translation[frames])
    return clip, Observation.from_gaps(clip, [Gap(last + 1, len(clip))])


def test_a_jump_that_is_cut_in_the_air_lands_as_it_did(jump):
    last = takes_off(jump)
    clip, known = cut(jump, last)
    before, true = heights(jump)[last], heights(jump)
    done = complete(clip, known, ZeroVelocity()).clip
    floor = np.percentile(jump.positions()[..., 1].min(axis=1), 10)
    low = done.positions()[last:, :, 1].min(axis=1) - floor
    assert before > 0.05
    lands, truly = (int(np.argmax(some < 0.03)) for some in (low, true[last:]))
    assert abs(lands - truly) / jump.fps < 0.1
    assert low.min() > -0.03
    assert low[lands:].max() < 0.05, "and stays"
    # In between it falls, from as fast as it rose.
    way = np.diff(done.positions()[last - 1 : last + lands, :, 1].mean(axis=1)) * jump.fps
    assert np.diff(way).mean() * jump.fps == pytest.approx(-9.81, abs=3)
    # Legs give way, and the feet do not.
    hips = done.positions()[last + lands :, 0, 1]
    assert 0.02 < hips[0] - hips.min() < 0.3
    assert feet.measure(done, known, last + lands, len(done))[0] < 10
    assert (done.rotation[: last + 1] == clip.rotation[: last + 1]).all()


@pytest.mark.parametrize("later", [2, 3, 4, 5])
def test_who_lands_between_two_frames_does_not_stop_for_one(jump, later):
    """Hips fell by 8.7 cm, 3 and 6.6 in frames one after the other."""
    clip, known = cut(jump, takes_off(jump) + later)
    hips = complete(clip, known, ZeroVelocity()).clip.positions()[-AHEAD - 1 :, 0, 1]
    speed = np.diff(hips) * jump.fps
    lands = int(speed.argmin())
    assert (np.diff(speed)[lands : lands + 3] > 0).all()


def test_backwards_it_is_the_same(jump):
    clip, known = cut(jump, takes_off(jump))
    span = (len(clip) - AHEAD, len(clip))
    there = falling.landed(clip, known, span)
    back = clip.with_motion(clip.rotation[::-1], clip.translation[::-1])
    seen = Observation(known.rotation[::-1], known.translation[::-1])
    here = falling.landed(back, seen, (0, AHEAD))
    assert there is not clip
    np.testing.assert_allclose(here.positions()[::-1], there.positions(), atol=1e-9)


def test_who_stands_or_sits_somewhere_high_or_is_led_down_anyway_is_left_alone(jump):
    clip, known = cut(jump, 5)
    assert falling.landed(clip, known, (6, len(clip))) is clip
    # On a wall, with dangling feet: nothing falls.
    last = takes_off(jump)
    clip, _ = cut(jump, last)
    frames = [*range(last - 20), *[last] * (20 + AHEAD)]
    high = clip.with_motion(clip.rotation[frames], clip.translation[frames])
    seen = Observation.from_gaps(high, [Gap(len(high) - AHEAD, len(high))])
    assert falling.landed(high, seen, (len(high) - AHEAD, len(high))) is high
    # The truth, and where an end is known.
    span = (last + 1, last + 1 + AHEAD)
    part = jump.slice(0, span[1])
    assert falling.landed(part, Observation.from_gaps(part, [Gap(*span)]), span) is part
    assert falling.landed(jump, Observation.from_gaps(jump, [Gap(*span)]), span) is jump
