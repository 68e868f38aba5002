"""Trained weights on disk, and how their graphs are run."""

from __future__ import annotations

import json

import numpy as np
import pytest

import interpose
from interpose.errors import FileError
from interpose.methods import weights


@pytest.mark.parametrize(("said", "threads"), [("3", 3), ("2,1", 2)])
def test_threads_are_as_many_as_is_said(monkeypatch, said, threads):
    monkeypatch.setenv("OMP_NUM_THREADS", said)
    assert weights.cores() == threads
    for nothing in ("", "many", "0"):
        monkeypatch.setenv("OMP_NUM_THREADS", nothing)
        assert 1 <= weights.cores() <= weights.MOST_THREADS


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"licence": None}, "its licence is None"),
        ({"name": 7}, "its name is 7"),
        ({"labels": None}, "its labels is None"),
        ({"training": None}, "its training is None"),
        ({"joints": []}, "no joints"),
        ({"fps": 0}, "its fps is 0"),
        ({"fps": "30"}, "its fps is '30'"),
        ({"max_gap": -3}, "its max_gap is -3"),
        ({"later": 1}, "this version knows nothing"),
    ],
)
def test_cards_that_were_spoilt_are_refused(tmp_path, change, why):
    card = weights.find("small").to_dict()
    (tmp_path / "small.json").write_text(json.dumps(card | change))
    with pytest.raises(FileError) as error:
        weights.Card.load(tmp_path / "small.json")
    assert why in error.value.why
    with pytest.raises(FileError, match="there is no"):
        weights.Card.load(tmp_path / "other.json")


@pytest.mark.parametrize("gap", [(60, 90), (41, 158)])
def test_motion_is_the_same_to_the_last_bit_on_any_number_of_threads(cmu_walk, monkeypatch, gap):
    done = []
    for threads in (1, 2, 3, 4):
        monkeypatch.setenv("OMP_NUM_THREADS", str(threads))
        done.append(interpose.fill(cmu_walk, gap).clip)
    for other in done[1:]:
        np.testing.assert_array_equal(other.rotation, done[0].rotation)
        np.testing.assert_array_equal(other.translation, done[0].translation)
