"""CMIB's tables on small files in LAFAN1's format."""

from __future__ import annotations

import re

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


def test_hdm05_is_judged_on_the_canonical_body(data, tmp_path):
    """A trial in its layout and names; interpolation is better the shorter the way."""
    folder = tmp_path / "hdm05"
    head, *frames = re.split(r"^\d+\n", (data / "cmu_02_03.amc").read_text(), flags=re.MULTILINE)
    there_and_back = [*frames, *frames[::-1]] * 10
    trial = head + "".join(f"{i + 1}\n{frame}" for i, frame in enumerate(there_and_back[:400]))
    for performer in ("bk", "mm"):
        (folder / performer).mkdir(parents=True)
        (folder / performer / f"HDM_{performer}.asf").write_bytes((data / "cmu_02.asf").read_bytes())
        (folder / performer / f"HDM_{performer}_walk_001_120.amc").write_text(trial)
    tables = conditions.hdm05(tmp_path, weights.find("cmib"), most=2)
    assert [table.title.split(",")[0] for table in tables] == ["L2P", "L2Q"]
    for table in tables:
        assert list(table.rows) == ["interpolation", "cmib"]
        assert all(0 < value < np.inf for row in table.rows.values() for value in row)


def test_a_cut_of_hdm05_turns_with_its_clip(sequence):
    clip = sequence.slice(0, 40)
    turn = rotations.about("Y", np.array(1.0))
    rotation = clip.rotation.copy()
    rotation[:, 0] = rotations.multiply(turn, rotation[:, 0])
    turned = clip.with_motion(rotation, rotations.rotate(turn, clip.translation) - np.array([5.0, 0, 3]))
    (placed, q), (other, r) = (conditions._Cut(one).see(one) for one in (clip, turned))
    assert np.abs(placed - other).max() < 1e-6
    assert np.abs(q - r).max() < 1e-6
