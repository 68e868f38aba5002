"""Figures of a motion."""

from __future__ import annotations

import numpy as np
import pytest

from interpose.finish import feet
from interpose.geometry import measures
from interpose.geometry.ground import turn


def test_a_real_walk_is_lively_and_a_held_pose_is_not(cmu_walk):
    positions = cmu_walk.positions()
    alive = measures.liveliness(positions, 75, 135, 30.0)
    assert 0.7 < alive < 1.4
    held = positions.copy()
    held[75:135] = positions[74] + cmu_walk.root[75:135, None] - cmu_walk.root[74]
    assert measures.liveliness(held, 75, 135, 30.0) < 1e-9, "gliding is no life"
    assert measures.liveliness(positions * 1.2, 75, 135, 30.0) == pytest.approx(alive), "no matter how tall"


def test_it_is_not_measured_where_it_means_nothing(cmu_walk):
    positions = cmu_walk.positions()
    assert measures.liveliness(positions, 75, 100, 30.0) is None, "short"
    assert measures.liveliness(positions, 10, 60, 30.0) is None, "too little before it"
    assert measures.liveliness(np.repeat(positions[:1], 209, axis=0), 75, 135, 30.0) is None, "stillness"


def test_gliding_does_not_depend_on_the_place_nor_on_the_size(cmu_walk):
    pairs = feet.pairs(cmu_walk.skeleton)
    positions = cmu_walk.positions()
    positions[60:100] = positions[59] + np.linspace(0.0, 1.5, 40)[:, None, None] * [0.6, 0.0, 0.8]
    found = measures.glides(positions[:, pairs], positions[:, 0], 30.0)
    assert found[61:99].all()
    large = 2 * turn(positions, np.array(0.7)) + [5.0, 1.0, 2.0]
    assert np.array_equal(measures.glides(large[:, pairs], large[:, 0], 30.0, 2.0), found)


def test_at_a_frame_a_second_nothing_tells_how_lively_a_motion_is(cmu_walk):
    """A single frame beside a gap has no steps: no number comes of it, and no warning."""
    slow = cmu_walk.positions()[::30]
    assert measures.liveliness(slow, 2, 5, 1.0) is None
