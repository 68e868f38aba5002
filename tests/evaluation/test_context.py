"""The studies of gap size and context on small files: what methods are given, and what is enough."""

from __future__ import annotations

import json
import shutil
from types import SimpleNamespace

import pytest

from interpose.evaluation import context
from interpose.evaluation.windows import windows
from interpose.observation import Gap


@pytest.fixture(autouse=True)
def small(monkeypatch):  # type: ignore[no-untyped-def]
    """Less of everything."""
    monkeypatch.setattr(context, "DATASETS", ("lafan1",))
    monkeypatch.setattr(context, "GAPS", (10, 40))
    monkeypatch.setattr(context, "CONTEXTS", (1, 5, 25))
    monkeypatch.setattr(context, "ROWS", (("cae", 40), ("auto", 40)))


def test_both_studies_on_a_walk(published, tmp_path):
    result = context.run(published, most=1)
    assert result.labels == ["lafan1 run"], "as its file is called"
    assert result.mean("cae", 10) < result.mean("cae", 40), "longer gaps are harder"
    for gap in (10, 40):
        assert result.mean("auto", gap) < result.mean("linear", gap)
    alone, _, most = result.curve("", "cae")
    assert most < 0.5 * alone, "single poses do not tell a walk"
    assert result.alive("truth", 40) == (1.0, 0.0)
    assert result.alive("spline", 40)[0] < result.alive("cae", 40)[0] < 1.2
    said = json.loads(json.dumps(result.to_dict()))
    assert said["gaps"]["10"]["liveliness"] == {}, "too short to tell"
    assert said["labels"]["lafan1 run"]["windows"] == 1
    assert [len(curve["errors"]) for curve in said["curves"]] == [3] * 2
    assert "| lafan1 run | 1 |" in str(result)
    assert result.plot(tmp_path / "context.svg").count('class="series"') == 1


def test_methods_see_the_context_and_the_truth_scores_zero(published, monkeypatch):
    seen = set()

    def perfect(clip, known, method):  # type: ignore[no-untyped-def]
        (gap,) = known.gaps(clip.skeleton)
        seen.add((gap.start, len(gap), len(clip) - gap.stop))
        return SimpleNamespace(clip=clip, report=SimpleNamespace(gaps=[SimpleNamespace(method="cae")]))

    monkeypatch.setattr(context, "complete", perfect)
    result = context.run(published, most=1)
    assert seen == {(25, 10, 25), (1, 40, 1), (5, 40, 5), (25, 40, 25)}
    assert all(e == [0.0] for held in result.errors.values() for some in held.values() for e in some.values())
    assert result.alive("auto", 40) == (1.0, 0.0)
    assert sum(result.fell_back.values()) == 0


def test_a_single_frame_beside_a_gap_is_a_key(published):
    (window,) = windows(published, ("lafan1",), "validation", most=1)
    assert context._method("auto", window, Gap(1, 3)).name == "base"
    assert context._method("auto", window, Gap(5, 45)).name == "base"
    assert context._method("auto", window, Gap(5, 6)).name == "spline"


@pytest.mark.parametrize(
    ("curve", "enough"),
    [((5.0, 2.1, 2.0), 5), ((2.1, 2.1, 2.0), 1), ((5.0, 2.3, 2.0), 25), ((2.0, 2.3, 2.0), 25)],
)
def test_enough_is_from_where_on_the_error_stays_near_the_last(curve, enough):
    assert context.needed(curve) == enough


def test_windows_of_each_label(published, tmp_path):
    folder = tmp_path / "lafan1" / "bvh"
    folder.mkdir(parents=True)
    for name in ("run1_subject4", "walk1_subject4", "walk2_subject4"):
        shutil.copy(published / "lafan1" / "bvh" / "run1_subject4.bvh", folder / f"{name}.bvh")

    def labels(**how):  # type: ignore[no-untyped-def]
        return [w.label for w in windows(tmp_path, ("lafan1",), "validation", 100, 100, **how)]

    assert labels(most=2, by_label=True) == ["run"] * 2 + ["walk"] * 2
    assert labels(most=3) == ["run", "walk", "walk"]
    assert labels() == ["run"] * 4 + ["walk"] * 8
    first, last = (w.clip.name for w in list(windows(tmp_path, ("lafan1",), "validation", most=2)))
    assert (first, last) == ("run1_subject4", "walk2_subject4")
