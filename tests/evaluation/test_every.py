"""All tasks in one table: what each hides, and what is measured of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from interpose.evaluation import every
from interpose.evaluation.windows import windows
from interpose.skeletons import JOINTS


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
