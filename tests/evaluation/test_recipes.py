"""Runs beside each other: what differs, what they reached, and folders that are none."""

from __future__ import annotations

import json

import pytest

from interpose.errors import FileError, RequestError
from interpose.evaluation.recipes import compare


@pytest.fixture
def runs(tmp_path):
    """Two runs that differ in the loss, and in what does not count."""
    for name, settings, error in (
        ("plain", {"loss": "l1", "batch": 32, "commit": "a", "network": {"width": 3}}, 7.5),
        ("squared", {"loss": "l2", "batch": 32, "commit": "b", "network": {"width": 3}}, 8.25),
    ):
        folder = tmp_path / name
        folder.mkdir()
        (folder / "settings.json").write_text(json.dumps(settings))
        entries = [{"step": n, "hours": n / 100, "fraction": 1, "loss": 0.5, "gap15": error} for n in (5, 10)]
        (folder / "log.jsonl").write_text("".join(json.dumps(entry) + "\n" for entry in entries))
    return [tmp_path / "plain", tmp_path / "squared"]


def test_what_differs_and_what_came_of_it(runs):
    result = compare(runs)
    assert [result.differs(run) for run in result.runs] == [{}, {"loss": "l2"}]
    assert result.figures == ["gap15"]
    plain, squared = result.table().splitlines()[2:]
    assert plain == "| plain | - | 10 | 0.10 | 7.5 |"
    assert squared == "| squared | loss=l2 | 10 | 0.10 | 8.25 |"
    assert result.to_dict()["runs"][1]["gap15"] == 8.25
    assert compare(runs, ("gap15",)).table() == result.table()
    with pytest.raises(RequestError, match="unknown figure: gap30") as error:
        compare(runs, ("gap30",)).table()
    assert "gap15" in error.value.why


def test_a_run_that_saw_who_it_is_judged_on_is_no_measure(runs):
    for run, splits in zip(runs, (["train"], ["train", "validation"])):
        settings = json.loads((run / "settings.json").read_text())
        (run / "settings.json").write_text(json.dumps({**settings, "splits": splits}))
    result = compare(runs)
    assert result.differs(result.runs[1])["splits"] == "train+validation"
    assert "no measure: squared." in str(result)
    assert "no measure" not in str(compare(runs[:1]))


def test_a_run_that_is_not_at_its_end_is_named(runs):
    assert "budget" not in str(compare(runs))
    log = runs[1] / "log.jsonl"
    log.write_text(log.read_text() + json.dumps({"step": 11, "hours": 0.11, "fraction": 0.05, "gap15": 9}))
    assert "Not at the end of their budget yet: squared (5 %)." in str(compare(runs))


@pytest.mark.parametrize("spoil", ["no log", "empty", "no json", "another file", "no folder"])
def test_what_is_no_run(runs, spoil):
    log = runs[1] / "log.jsonl"
    if spoil == "no log":
        log.unlink()
    elif spoil == "no folder":
        runs[1] = runs[1] / "deeper"
    else:
        log.write_text({"empty": "", "no json": "{", "another file": "[1, 2]\n"}[spoil])
    with pytest.raises(FileError, match="cannot read the run"):
        compare(runs)
