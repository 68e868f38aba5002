"""interpose forecast: what is added, what stays, and what goes wrong."""

from __future__ import annotations

import json
import shutil

import numpy as np
import pytest

import interpose
from interpose import formats
from interpose.formats import load


@pytest.fixture
def walk(tmp_path, data):
    """walk.bvh (209 frames at 30 fps), in the current folder."""
    shutil.copy(data / "cmu_walk.bvh", tmp_path / "walk.bvh")
    return tmp_path / "walk.bvh"


def test_two_seconds_are_added(run, walk):
    done = run("forecast", "walk.bvh", "--player")
    assert done.code == 0
    was, made = load(walk), load(walk.with_name("walk.forecast.bvh"))
    assert len(made) == len(was) + round(2 * was.fps)
    assert np.array_equal(made.rotation[: len(was)], was.rotation)
    assert np.array_equal(made.translation[: len(was)], was.translation)
    report = json.loads(walk.with_name("walk.forecast.json").read_text())
    assert report["verb"] == "forecast"
    assert report["method"] == "auto"
    assert report["start"] == len(was)
    assert [gap["frames"] for gap in report["gaps"]] == [f"{len(was)}:{len(made)}"]
    assert report["gaps"][0]["seam_after"] <= report["gaps"][0]["seam_limit"]
    assert "<html" in walk.with_name("walk.forecast.html").read_text()


def test_a_report_of_samples_says_what_they_were_drawn_with(run, walk):
    """So that the second can be drawn again."""
    assert run("forecast", "walk.bvh", "--method", "stmi-gan", "--samples", "2", "--frames", "15").code == 0
    report = json.loads(walk.with_name("walk.forecast.json").read_text())
    assert report["units"]["spread"] == "cm"
    seed = str(report["seed"] + 1)
    run("forecast", "walk.bvh", "--method", "stmi-gan", "--seed", seed, "--frames", "15", "-o", "again.bvh")
    second = walk.with_name("walk.forecast.2.bvh").read_bytes()
    assert walk.with_name("again.bvh").read_bytes() == second


def test_as_many_frames_as_asked_for(run, walk):
    assert run("forecast", "walk.bvh", "--frames", "7", "--method", "linear", "-o", "on.bvh").code == 0
    assert len(load(walk.with_name("on.bvh"))) == len(load(walk)) + 7
    assert run("forecast", "walk.bvh", "--frames", "0.5s", "--method", "linear", "-o", "for.bvh").code == 0
    assert len(load(walk.with_name("for.bvh"))) == len(load(walk)) + 15


def test_nothing_is_replaced_unasked(run, walk):
    assert run("forecast", "walk.bvh", "--method", "linear").code == 0
    again = run("forecast", "walk.bvh", "--method", "linear")
    assert again.code == 2
    assert "--force" in again.err
    assert run("forecast", "walk.bvh", "--method", "linear", "--force").code == 0


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--frames", "0"), "cannot generate 0 frames"),
        (("--frames", "100000000"), "are more than 10 minutes"),
        (("--samples", "0"), "--samples"),
        (("--samples", "0", "--skip-existing"), "--samples"),
        (("--samples", "3", "--method", "linear"), "it has one answer only"),
        (("--temperature", "2", "--method", "linear"), "linear has no temperature"),
        (("--temperature", "-1"), "cannot sample at temperature -1"),
        (("--temperature", "nan"), "cannot sample at temperature nan"),
        (("--samples", "1000"), "cannot write 1000 samples"),
        (("--method", "nonsense"), "unknown method: nonsense"),
    ],
)
def test_what_cannot_be_asked_for(run, walk, options, said):
    done = run("forecast", "walk.bvh", *options)
    assert done.code == 2
    assert said in done.err
    assert not walk.with_name("walk.forecast.bvh").exists()


def test_of_several_samples_all_are_replaced_or_none(run, walk, monkeypatch):
    """A report beside samples of two runs would tell of neither."""
    asked = ("forecast", "walk.bvh", "--method", "stmi-gan", "--samples", "2", "--frames", "15", "--player")
    assert run(*asked, "--seed", "1").code == 0
    files = sorted(walk.parent.glob("walk.forecast*"))
    assert len(files) == 4
    before, written = [path.read_bytes() for path in files], formats.FORMATS[".bvh"].write
    left = iter([True, False])

    def full(clip, stream):  # type: ignore[no-untyped-def]
        if next(left):
            return written(clip, stream)
        raise OSError(28, "No space left on device")

    monkeypatch.setitem(formats.FORMATS, ".bvh", formats.FORMATS[".bvh"]._replace(write=full))
    done = run(*asked, "--seed", "7", "--force")
    assert done.code == 3
    assert "No space left" in done.err
    assert [path.read_bytes() for path in files] == before
    assert sorted(walk.parent.iterdir()) == sorted([walk, *files])


def test_from_python(walk):
    clip = load(walk)
    one = interpose.forecast(clip, 20, method="linear")
    assert one.start == len(clip)
    assert len(one.clip) == len(clip) + 20
    assert one.samples == [one]
    assert np.array_equal(one.spread(), np.zeros(20))
    assert len(interpose.forecast(walk, method="zero-velocity").clip) == len(clip) + round(2 * clip.fps)


def test_its_report_is_none_that_fill_repeats(run, take):
    assert run("forecast", "take.bvh", "--frames", "10", "--method", "spline").code == 0
    done = run("fill", "take.bvh", "--gaps", "take.forecast.json", "-o", "again.bvh")
    assert done.code == 2
    assert "Run interpose forecast again." in done.err


def test_a_folder_goes_on_clip_by_clip_and_where_it_stopped(run, take):
    take.with_name("other.bvh").write_bytes(take.read_bytes())
    asked = [
        "forecast",
        ".",
        "-o",
        "out",
        "--method",
        "stmi-gan",
        "--samples",
        "2",
        "--seed",
        "1",
        "--frames",
        "5",
    ]
    assert run(*asked).code == 0
    made = [f"{name}{end}" for name in ("other", "take") for end in (".1.bvh", ".2.bvh", ".json")]
    assert sorted(path.name for path in (take.parent / "out").iterdir()) == made
    assert run(*asked).code == 2  # nothing is replaced
    (take.parent / "out" / "take.2.bvh").unlink()
    (take.parent / "out" / "take.1.bvh").unlink()
    (take.parent / "out" / "take.json").unlink()
    done = run(*asked, "--skip-existing")
    assert done.code == 0
    assert "skipped other.bvh" in done.out
    assert sorted(path.name for path in (take.parent / "out").iterdir()) == made
