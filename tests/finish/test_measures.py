"""What tells a motion from a mean pose."""

from __future__ import annotations

import numpy as np
import pytest

from interpose.finish import complete, measures
from interpose.methods import registry
from interpose.observation import Gap, Observation


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


def test_the_report_says_that_a_gap_is_a_mean_pose(cmu_walk):
    seen = Observation.from_gaps(cmu_walk, [Gap(75, 135)])
    still = registry.get("zero-velocity")
    (report,) = complete(cmu_walk, seen, still, fallback=still).report.gaps
    assert report.liveliness < 0.33
    assert any("A key near frame" in note for note in report.notes)
    (report,) = complete(cmu_walk, seen, still, fallback=still, first=500).report.gaps
    assert any("A key near frame 605 says" in note for note in report.notes), "as the whole clip counts"
    (report,) = complete(cmu_walk, seen, registry.get("cae")).report.gaps
    assert report.liveliness > 0.33
    assert not any("A key near" in note for note in report.notes)
