"""All tasks in one table: what each hides, and what is measured of it."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from interpose.errors import RequestError
from interpose.evaluation import every
from interpose.evaluation.windows import windows
from interpose.skeletons import JOINTS, PARENTS, find_humanoid


@pytest.fixture(autouse=True)
def alone(monkeypatch):  # type: ignore[no-untyped-def]
    monkeypatch.setattr(every, "DATASETS", ("lafan1",))


@pytest.fixture(scope="module")
def window(published: Path):  # type: ignore[no-untyped-def]
    return next(windows(published, ("lafan1",), "validation", most=1))


def test_what_tasks_hide(window):
    hidden = {name: hide(window, np.random.default_rng(0)) for name, hide in every.TASKS.items()}
    for name, task in hidden.items():
        frames = task.shown[1] - task.shown[0]
        assert task.observation.rotation.shape[0] == len(task.judged) == frames, name
        assert task.judged.any(), name
    keys = hidden["2 s between keys, one in the middle"]
    assert list(np.flatnonzero(keys.observation.frames)) == [0, 31, 61]
    assert keys.judged.all(axis=1).sum() == 59
    lone = hidden["1 s, five before, one after"]
    assert list(np.flatnonzero(~lone.observation.frames)) == list(range(5, 35))
    assert not hidden["forecast of 1 s"].observation.frames[-1]
    legs = hidden["legs from the upper body"]
    assert {JOINTS[j] for j in np.flatnonzero(legs.judged[0])} == {
        side + part for side in ("Left", "Right") for part in ("Leg", "Foot", "Toe")
    }


def above(row: int) -> set[int]:
    """The canonical joints that one hangs from."""
    return set() if row == 0 else {PARENTS[row], *above(PARENTS[row])}


def test_joints_that_the_skeleton_lacks_are_neither_lost_nor_measured(window):
    """Nothing is hidden of them: what hangs from them would count as right."""
    bones = window.clip.skeleton
    lacking = replace(bones, roles={"Spine1": "", "LeftShoulder": ""})
    body = find_humanoid(replace(window.clip, skeleton=lacking))
    assert {JOINTS[row] for row, joint in enumerate(body.mapping.joints) if joint is None} == {
        "Spine1",
        "LeftShoulder",
    }
    window = replace(window, clip=replace(window.clip, skeleton=lacking, source=None), body=body)
    for task in ("one joint lost", "three joints lost", "an arm or a leg lost"):
        for seed in range(20):
            hidden = every.TASKS[task](window, np.random.default_rng(seed))
            lost = {
                row
                for row, j in enumerate(body.mapping.joints)
                if j is not None and not hidden.observation.rotation[60, j]
            }
            assert len(lost) == {"one joint lost": 1, "three joints lost": 3}.get(task, len(lost)) > 0
            for row in np.flatnonzero(hidden.judged[60]):
                assert lost & above(row), (task, seed, JOINTS[row])


def test_what_all_refuse_is_said_and_keeps_no_one_from_the_table(published):
    result = every.run(published, ("cmib",), most=1)
    assert list(result.errors) == list(every.TASKS)
    assert "| forecast of 1 s | - |" in result.table()


def test_there_are_windows_or_it_is_said(published, tmp_path):
    shutil.copytree(published / "lafan1", tmp_path / "lafan1")
    (tmp_path / "lafan1" / "bvh" / "run1_subject4.bvh").unlink()
    with pytest.raises(RequestError, match="nothing to measure with") as said:
        every.run(tmp_path, ("linear",), most=1)
    assert "validation performer" in said.value.why


def test_a_row_a_task_and_a_column_a_method(published):
    result = every.run(published, ("linear", "spline", "cmib"), most=1)
    assert result.count == 1
    assert list(result.errors) == list(every.TASKS)
    assert result.mean("forecast of 1 s", "cmib") is None
    for task in every.TASKS:
        assert result.mean(task, "spline") is not None
    table = result.table().splitlines()
    assert table[0] == "|  | linear | spline | cmib |"
    assert len(table) == 2 + len(every.TASKS)
    assert all("**" in line for line in table[2:])
    assert result.to_dict()["errors"]["gap of 1 s"]["linear"] > 0
