"""Reliability: what it says of frames whose errors are made up."""

from __future__ import annotations

import numpy as np
import pytest

from interpose.evaluation.reliability import Reliability


def frames(scale=1.0):
    rng = np.random.default_rng(0)
    expected = rng.uniform(1, 20, 5000)
    return Reliability("some", "validation", 1, expected, scale * expected * rng.gamma(50, 1 / 50, 5000))


def test_what_expects_the_truth_is_calibrated():
    assert frames().off < 0.02
    assert frames().correlation > 0.9


def test_what_expects_too_little_is_off_by_as_much():
    assert frames(1.5).off == pytest.approx(1 / 3, abs=0.02)
    assert frames(1.5).correlation > 0.9


def test_tenths_go_from_the_safest_to_the_most_doubtful_frames(tmp_path):
    expected, measured = frames().parts
    assert (np.diff(expected) > 0).all()
    assert np.isclose(measured.mean(), frames().measured.mean())
    frames().plot(tmp_path / "r.svg")
    assert "calibrated" in (tmp_path / "r.svg").read_text()
    assert frames().table() in str(frames())
