"""From which length of gap on a network is the better one."""

from __future__ import annotations

import json

import pytest

from interpose.cli import main
from interpose.evaluation import threshold
from interpose.methods import registry


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
    found = threshold.measure(published, "zero-velocity", most=2)
    assert found.count == 2
    assert list(found.errors) == ["linear", "spline", "zero-velocity"]
    assert all(errors[0] < errors[-1] for errors in found.errors.values()), "longer gaps are harder"
    assert found.from_gap == 31
    assert "zero-velocity is better than the spline from 31 frames on" in str(found)


def test_on_the_command_line(published, tmp_path, monkeypatch, capsys):
    """Where the spline holds still, straight lines beat it everywhere."""
    plain = registry.get
    monkeypatch.setattr(registry, "get", lambda name: plain({"spline": "zero-velocity"}.get(name, name)))
    asked = ["bench", "threshold", "--data", str(published), "--network", "linear", "--most", "1", "--json"]
    assert main([*asked, "--plot", str(tmp_path / "curve.svg")]) == 0
    assert json.loads(capsys.readouterr().out)["from_gap"] == 4
    assert "<svg" in (tmp_path / "curve.svg").read_text()
