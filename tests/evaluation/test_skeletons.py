"""Gaps of held-out performers: which are cut, and what counts as met."""

from __future__ import annotations

import numpy as np
import pytest

from interpose import formats
from interpose.evaluation import skeletons


@pytest.fixture(autouse=True)
def few(monkeypatch):  # type: ignore[no-untyped-def]
    monkeypatch.setattr(skeletons, "DATASETS", ("lafan1",))
    monkeypatch.setattr(skeletons, "METHODS", ("linear", "spline", "auto"))


def test_gaps_lie_in_the_middle_of_windows_at_the_clips_own_rate(sequence, tmp_path):
    """Half a second at 120 fps in windows of four seconds; of short clips the whole, if that is enough."""
    fine = sequence.slice(0, 300).with_motion(
        np.repeat(sequence.rotation[:300], 4, axis=0), np.repeat(sequence.translation[:300], 4, axis=0)
    )
    (tmp_path / "lafan1" / "bvh").mkdir(parents=True)
    for name, clip in (("walk1", fine), ("run1", fine.slice(0, 400)), ("jumps1", fine.slice(0, 139))):
        fast = type(clip)(clip.skeleton, clip.rotation, clip.translation, 120.0, clip.translated)
        formats.save(fast, tmp_path / "lafan1" / "bvh" / f"{name}_subject4.bvh")
    found = list(skeletons._windows(tmp_path, "lafan1", "validation", None))
    half = [(len(clip), gap.start, gap.stop) for frames, (clip, gap) in found if frames == 15]
    assert sorted(half) == [(400, 170, 230), (480, 210, 270), (480, 210, 270)]
    assert len([frames for frames, _ in found if frames == 60]) == 3
    assert len(list(skeletons._windows(tmp_path, "lafan1", "validation", 1))) == len(skeletons.GAPS)


def test_the_table_of_a_split(published, monkeypatch):
    monkeypatch.setattr(skeletons, "GAPS", (15, 30))
    monkeypatch.setattr(skeletons.Skeletons, "targets", lambda self: iter([("all", True)]))
    result = skeletons.run(published, "validation", most=2)
    held = result.errors["lafan1"]
    assert {gap: len(some["auto"]) for gap, some in held.items()} == {15: 2, 30: 2}
    assert result.mean("lafan1", 15, "linear") < result.mean("lafan1", 30, "linear")
    assert result.to_dict()["errors"]["lafan1"]["30"]["windows"] == 2
    assert "| lafan1 | 30 | 15 | 2 |" in str(result)


def test_what_counts_is_to_be_ahead_of_both(monkeypatch):
    monkeypatch.setattr(skeletons, "METHODS", ("linear", "spline", "cae", "auto"))
    result = skeletons.Skeletons("test")
    for gap, errors in {15: (1, 1, 9, 9), 30: (4, 5, 6, 3), 60: (4, 5, 6, 4)}.items():
        for name, error in zip(skeletons.METHODS, errors):
            result.errors["cmu"][gap][name].append(error)
    assert [met for _, met in result.targets()] == [True, False], "at 15 frames nothing is asked"
    assert "missed  cmu, 60 frames: 4.00 cm, linear and spline 4.00" in str(result)
