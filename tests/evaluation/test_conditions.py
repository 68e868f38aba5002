"""CMIB's tables on small files in LAFAN1's format."""

from __future__ import annotations

import numpy as np
import pytest

from interpose.errors import RequestError
from interpose.evaluation import conditions
from interpose.geometry import rotations
from interpose.methods import weights


def test_a_moved_anchor_keeps_its_pose_and_the_ends_face_the_new_way(sequence):
    clip = sequence.slice(0, 80)
    moved = conditions.move_anchor(clip, 40, np.random.default_rng(0))
    step = moved.root[40] - clip.root[40]
    assert np.linalg.norm(step) == pytest.approx(conditions.MOVED)
    assert step[1] == 0
    rest = np.arange(80) != 40
    assert np.array_equal(moved.root[rest], clip.root[rest])
    assert np.array_equal(moved.rotation[1:79], clip.rotation[1:79])
    assert np.array_equal(moved.rotation[:, 1:], clip.rotation[:, 1:])
    for end, a, b in ((0, 0, 40), (79, 40, 79)):
        seen = []
        for one in (clip, moved):
            way = one.root[b] - one.root[a]
            heading = rotations.about("Y", -np.arctan2(way[0], way[2]))
            seen.append(rotations.multiply(heading, one.rotation[end, 0]))
        assert rotations.angle(*seen) < 1e-6, "seen along the way it is the same pose"


def test_tables_of_anchors_and_representations(published):
    card = weights.find("cmib")
    table = conditions.anchors(published, [card], most=2)
    (figures,) = table.rows.values()
    assert len(figures) == 3
    assert all(0 < v < conditions.MOVED for v in figures), "nearer than if it did not look"
    table = conditions.representations(published, [card], most=2)
    assert list(table.rows) == ["interpolation", f"quaternion ({card.training['device_hours']:.2f} h)"]
    assert "| interpolation |" in str(table)
    assert table.to_dict()["rows"]["interpolation"].keys() == {f"{n} frames" for n in conditions.LENGTHS}


def test_the_table_of_actions_has_the_themes_that_are_there(published):
    tables = conditions.actions(published, weights.find("cmib"), "test", most=1)
    assert [list(table.rows) for table in tables] == [["jumps"]] * len(conditions.LENGTHS)
    assert "in 1 of 1 rows" in str(tables[0])


def test_anchors_need_walks_or_runs(published):
    with pytest.raises(RequestError, match="neither walks nor runs"):
        conditions.anchors(published, [weights.find("cmib")], "test", most=1)
