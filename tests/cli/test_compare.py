"""interpose compare: what several methods make of a gap."""

from __future__ import annotations

import json
import shlex

import pytest

from interpose.formats import load


def test_methods_are_played_together_and_measured(run, take):
    before = take.read_bytes()
    done = run("compare", "take.bvh", "--gap", "60:90")
    assert done.code == 0
    page = take.with_name("take.compared.html").read_text()
    for name in ("spline", "base", "small", "cae", "cmib", "input"):
        assert f'"{name}"' in page
    lines = [line.split() for line in done.out.splitlines() if "60:90  " in line]
    assert [line[4] for line in lines] == ["spline", "base", "small", "cae", "cmib"]
    assert "base *" in done.out, "what auto takes"
    assert "interpose fill take.bvh --gap 60:90 --method NAME" in done.out
    assert take.read_bytes() == before
    assert not list(take.parent.glob("*.json"))


def test_each_does_what_fill_does_by_it(run, take):
    told = run("compare", "take.bvh", "--gap", "60:90", "--methods", "linear,spline", "--json").json
    assert [one["method"] for one in told["compared"]] == ["linear", "spline"]
    assert told["auto"] == {"1": "base"}
    for one in told["compared"]:
        filled = run(
            "fill", "take.bvh", "--gap", "60:90", "--method", one["method"], "--json", "--force"
        ).json
        assert one["weights"] == filled["weights"]
        assert one["gaps"][0].keys() == filled["gaps"][0].keys()
        for name in ("frames", "seam_after", "foot_slide", "foot_travel"):
            assert one["gaps"][0][name] == filled["gaps"][0][name]


def test_what_does_not_fill_a_gap_is_left_out(run, take):
    """cmib fills whole poses alone; where it is asked for by name it is shown who stood in."""
    gap = ["--gap", "60:90", "--joints", "LeftArm,LeftForeArm"]
    done = run("compare", "take.bvh", *gap)
    assert done.code == 0
    assert "cmib is left out" in done.out
    done = run("compare", "take.bvh", *gap, "--methods", "cmib", "--force")
    assert "cmib (by base)" in done.out


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--methods", "splin"], "spline"),
        (["--methods", "linear,spline,small,cae,cmib,kalman,zero-velocity,stmi-gan,small-open"], "9 methods"),
        (["-o", "take.bvh"], "it is a page"),
        (["-o", "nowhere/page.html"], "no folder"),
        (["-o", "there.html"], "exists already"),
    ],
)
def test_errors_have_three_lines(run, take, options, says):
    take.with_name("there.html").write_text("mine")
    done = run("compare", "take.bvh", "--gap", "60:90", *options)
    assert done.code == 2
    assert len(done.err.splitlines()) == 3
    assert says in done.err
    assert take.with_name("there.html").read_text() == "mine"
    assert not take.with_name("take.compared.html").exists()


def test_a_report_is_compared_with_its_path(run, take):
    clip = load(take)
    x, _, z = (clip.positions()[70, 0] + [0.2, 0, 0]) / clip.source.unit
    assert run("fill", "take.bvh", "--gap", "60:80", "--path", f"70:{x},{z}", "--method", "spline").code == 0
    done = run("compare", "take.bvh", "--gaps", "take.filled.json", "--methods", "linear,spline", "--json")
    assert [one["gaps"][0]["path"] is not None for one in done.json["compared"]] == [True, True]


def test_the_command_that_it_names_fills_what_was_compared(run, take):
    """All gaps of it, of the file as it was read, whatever its name is."""
    take = take.rename(take.with_name("my take.bvh"))
    listed = take.with_name("my gaps.json")
    listed.write_text('[{"frames": "20:30"}]')
    asked = ("--gaps", listed.name, "--gap", "50:60", "--unit", "0.05")
    done = run("compare", take.name, *asked, "--methods", "linear,spline")
    (line,) = (line for line in done.out.splitlines() if line.endswith("writes one of them."))
    words = shlex.split(line.replace("NAME", "spline").removesuffix(" writes one of them."))
    assert words[:2] == ["interpose", "fill"]
    report = json.loads(run(*words[1:], "--dry-run", "--json").out)
    assert [gap["frames"] for gap in report["would_fill"]] == ["20:30", "50:60"]
    assert (report["unit"], report["unit_how"]) == (0.05, "given")
