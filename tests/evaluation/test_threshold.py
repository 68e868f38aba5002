"""From which length of gap on a network is the better one."""

from __future__ import annotations

import json

import pytest

from interpose.cli import main
from interpose.evaluation import threshold


@pytest.fixture(autouse=True)
def few(monkeypatch):  # type: ignore[no-untyped-def]
    monkeypatch.setattr(threshold, "DATASETS", ("lafan1",))
    monkeypatch.setattr(threshold, "GAPS", (4, 12, 30))


@pytest.mark.parametrize(
    ("network", "expected"),
    [
        ([0.5, 1.0, 2.0], 4),
        ([1.5, 1.0, 2.0], 12),
        ([0.5, 2.5, 2.0], 30),  # better at 4 frames, but not at 12
        ([0.5, 1.0, 3.0], 31),  # as good is not better
    ],
)
def test_better_from_there_on_at_every_length(network, expected):
    assert threshold.crossing([1.0, 2.0, 3.0], network) == expected


def test_a_method_is_measured_beside_the_spline(published):
    found = threshold.measure(published, "kalman", most=2)
    assert found.count == 2
    assert list(found.errors) == ["linear", "spline", "kalman"]
    assert all(errors[0] < errors[-1] for errors in found.errors.values()), "longer gaps are harder"
    assert found.from_gap == 31
    assert "kalman is better than the spline from 31 frames on" in str(found)


def test_on_the_command_line(published, tmp_path, capsys):
    asked = ["bench", "threshold", "--data", str(published), "--network", "small", "--most", "1", "--json"]
    assert main([*asked, "--plot", str(tmp_path / "curve.svg")]) == 0
    said = json.loads(capsys.readouterr().out)
    assert (said["gaps"], said["windows"]) == ([4, 12, 30], 1)
    assert said["errors"]["small"][-1] < said["errors"]["spline"][-1]
    assert "auto: network from here" in (tmp_path / "curve.svg").read_text()
