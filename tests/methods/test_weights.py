"""Trained weights on disk, and how their graphs are run."""

from __future__ import annotations

import numpy as np
import pytest

import interpose
from interpose.methods import weights


@pytest.mark.parametrize(("said", "threads"), [("3", 3), ("2,1", 2)])
def test_threads_are_as_many_as_is_said(monkeypatch, said, threads):
    monkeypatch.setenv("OMP_NUM_THREADS", said)
    assert weights.cores() == threads
    for nothing in ("", "many", "0"):
        monkeypatch.setenv("OMP_NUM_THREADS", nothing)
        assert 1 <= weights.cores() <= weights.MOST_THREADS


@pytest.mark.parametrize("gap", [(60, 90), (41, 158)])
def test_motion_is_the_same_to_the_last_bit_on_any_number_of_threads(cmu_walk, monkeypatch, gap):
    done = []
    for threads in (1, 2, 3, 4):
        monkeypatch.setenv("OMP_NUM_THREADS", str(threads))
        done.append(interpose.fill(cmu_walk, gap).clip)
    for other in done[1:]:
        np.testing.assert_array_equal(other.rotation, done[0].rotation)
        np.testing.assert_array_equal(other.translation, done[0].translation)
