"""interpose stitch: clips of several files, parts of them, loops, and what goes wrong."""

from __future__ import annotations

import json
import re
import shlex
import shutil
from dataclasses import replace

import numpy as np
import pytest
from tests.skeletons.rigs import under_root

from interpose.formats import load, save
from interpose.geometry import rotations


@pytest.fixture
def takes(tmp_path, data):
    """walk.bvh (209 frames), run.bvh (42) and jump.bvh (121), of three performers, in the current folder."""
    for name in ("walk", "run", "jump"):
        shutil.copy(data / f"cmu_{name}.bvh", tmp_path / f"{name}.bvh")
    return tmp_path


def test_three_takes_on_one_timeline(run, takes):
    done = run("stitch", "walk.bvh", "run.bvh", "jump.bvh", "--frames", "20,45", "--player")
    assert done.code == 0
    made, walk = load(takes / "walk.stitched.bvh"), load(takes / "walk.bvh")
    assert len(made) == 209 + 20 + 42 + 45 + 121
    assert np.array_equal(made.rotation[:209], walk.rotation)
    assert np.array_equal(made.translation[:209], walk.translation)
    report = json.loads((takes / "walk.stitched.json").read_text())
    assert report["verb"] == "stitch"
    assert [clip["frames"] for clip in report["clips"]] == ["0:209", "229:271", "316:437"]
    assert [clip["file"] for clip in report["clips"]] == ["walk.bvh", "run.bvh", "jump.bvh"]
    assert list(report["others_sha256"]) == ["run.bvh", "jump.bvh"]
    assert [gap["frames"] for gap in report["gaps"]] == ["209:229", "271:316"]
    for clip in report["clips"][1:]:
        assert clip["yaw"] != 0
        assert clip["shift"][1] == 0
    for gap in report["gaps"]:
        assert gap["seam_after"] <= gap["seam_limit"]
    assert "<html" in (takes / "walk.stitched.html").read_text()
    assert "base and small: for research and non-commercial use" in done.out


def test_the_report_says_where_a_clip_lies(run, takes):
    """Turned and shifted as the report says, a clip is what is in the result."""
    report = run("stitch", "walk.bvh", "walk.bvh#100:200", "--json").json
    placed = report["clips"][1]
    assert placed["part"] == "100:200"
    assert "step" in placed["gap_before"] or "at" in placed["gap_before"]
    start, stop = map(int, placed["frames"].split(":"))
    turn = np.radians(placed["yaw"])
    assert placed["yaw"] != round(placed["yaw"], 3), "about the origin, from which a clip may lie far away"
    walk = load(takes / "walk.bvh")
    root, shift = walk.root[100:200], np.array(placed["shift"]) * walk.source.unit
    x = np.cos(turn) * root[:, 0] + np.sin(turn) * root[:, 2] + shift[0]
    z = np.cos(turn) * root[:, 2] - np.sin(turn) * root[:, 0] + shift[2]
    made = load(takes / "walk.stitched.bvh").root[start:stop]
    assert np.allclose(made, np.stack([x, root[:, 1], z], axis=1), atol=2e-3)


def test_a_shift_is_along_the_axes_of_the_file(run, takes):
    """The next round of a loop whose file has Z up begins where the numbers of the file, so moved, say."""
    walk, lying = load(takes / "walk.bvh").slice(0, 80), rotations.about("X", np.radians(90.0))
    skeleton = replace(
        walk.skeleton, rest_translation=rotations.rotate(lying, walk.skeleton.rest_translation)
    )
    turned = rotations.multiply(rotations.multiply(lying, walk.rotation), rotations.conjugate(lying))
    translation = rotations.rotate(lying, walk.translation)
    save(replace(walk, skeleton=skeleton, rotation=turned, translation=translation), takes / "up.bvh")
    loop = run("stitch", "up.bvh", "--up", "z", "--loop", "--json").json["loop"]
    rows = (takes / "up.stitched.bvh").read_text().splitlines()
    at = next(i for i, row in enumerate(rows) if row.startswith("Frame Time")) + 1
    first, last = (np.array(rows[i].split()[:3], float) for i in (at, -1))
    turn, (x, y, _) = np.radians(loop["yaw"]), first
    again = [np.cos(turn) * x - np.sin(turn) * y, np.sin(turn) * x + np.cos(turn) * y, first[2]]
    again = np.array(again) + loop["shift"]
    assert loop["shift"][2] == 0
    assert 0 < np.linalg.norm(again - last) < 8, "one step on, in centimetres"


def test_a_loop_of_one_clip(run, takes):
    done = run("stitch", "walk.bvh", "--loop", "-o", "round.bvh")
    assert done.code == 0
    assert "frame 0 follows" in done.out
    report = json.loads((takes / "round.json").read_text())
    assert report["loop"]["jump"] <= report["loop"]["limit"]
    # From the last frame it is one step to where frame 0 stands next.
    root, way = load(takes / "round.bvh").root, re.search(r"each time ([\d.]+) m on", done.out)
    assert way is not None
    assert abs(np.hypot(*(root[-1] - root[0])[::2]) - float(way[1])) < 0.1
    assert len(load(takes / "round.bvh")) == int(report["gaps"][-1]["frames"].split(":")[1])


def test_unaligned_takes_keep_their_place(run, takes):
    report = run("stitch", "walk.bvh#10:60", "walk.bvh#80:150", "--no-align", "--json").json
    assert [clip["yaw"] for clip in report["clips"]] == [0, 0]
    start = int(report["clips"][1]["frames"].split(":")[0])
    made, walk = load(takes / "walk.stitched.bvh"), load(takes / "walk.bvh")
    assert np.array_equal(made.root[:50], walk.root[10:60])
    assert np.allclose(made.rotation[:50], walk.rotation[10:60], rtol=0, atol=1e-12)
    assert np.array_equal(made.root[start:], walk.root[80:150])


def test_an_action_is_told(run, takes):
    report = run("stitch", "walk.bvh", "run.bvh", "--frames", "30", "--action", "run", "--json").json
    assert report["action"] == "run"
    assert {gap["method"] for gap in report["gaps"]} == {"base"}, "amid motion it needs less of a hint"


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ([], "no clips"),
        (["walk.bvh"], "--loop"),
        (["walk.bvh", "none.bvh"], "none.bvh"),
        (["walk.bvh", "run.bvh", "--frames", "5,6"], "2 lengths"),
        (["walk.bvh", "run.bvh", "--frames", "soon"], "soon"),
        (["walk.bvh", "run.bvh", "--frames", "0"], "0 frames"),
        (["walk.bvh", "run.bvh#30:50"], "30:50"),
        (["walk.bvh", "run.bvh#a:b"], "a:b"),
        (["walk.bvh", "run.bvh", "--method", "splin"], "spline"),
        (["walk.bvh", "run.bvh", "-o", "run.bvh", "--force"], "input"),
    ],
)
def test_what_makes_no_sense_is_refused_in_three_lines(run, takes, options, says):
    text = (takes / "run.bvh").read_text()
    done = run("stitch", *options)
    assert done.code in (2, 3)
    assert len(done.err.splitlines()) == 3
    assert says in done.err
    assert not list(takes.glob("*.stitched.*"))
    assert (takes / "run.bvh").read_text() == text


@pytest.mark.parametrize("at", [40, 100, 160])
def test_what_jumped_is_put_where_the_body_was(run, takes, at):
    """As `scan` advises, walking on and amid a turn: all comes back, in as many frames, two of them new."""
    walk = load(takes / "walk.bvh")
    away = walk.translation.copy()
    away[at:] += [1.5, 0.0, -0.7]
    save(walk.with_motion(walk.rotation, away), takes / "jumps.bvh")
    advice = next(line for line in run("scan", "jumps.bvh").out.splitlines() if "interpose stitch" in line)
    words = [word.strip("'") for word in advice.split()[1:6]]
    assert words == ["stitch", f"jumps.bvh#:{at - 1}", f"jumps.bvh#{at + 1}:", "--frames", "2"]
    assert run(*words).code == 0
    made = load(takes / "jumps.stitched.bvh")
    assert len(made) == len(walk)
    known = np.r_[: at - 1, at + 1 : len(walk)]
    assert rotations.angle(made.rotation[known], walk.rotation[known]).max() < 1e-6
    assert np.linalg.norm(made.positions() - walk.positions(), axis=-1).max() < 0.03
    assert "jump" not in {one["kind"] for one in run("scan", "jumps.stitched.bvh", "--json").json["findings"]}


def test_a_rest_pose_that_is_stitched_in_is_said(run, takes):
    """Files of CMU's library begin with one; what the note says instead leaves it out."""
    jump = load(takes / "jump.bvh")
    rotation = jump.rotation.copy()
    rotation[0] = jump.skeleton.rest_rotation
    save(jump.with_motion(rotation, jump.translation), takes / "raw.bvh")
    done = run("stitch", "walk.bvh", "raw.bvh", "--frames", "9")
    (note,) = [line for line in done.out.splitlines() if "nothing to do with the rest" in line]
    (better,) = shlex.split(note.split(": ")[-1].removesuffix(" leaves it out"))
    assert better.startswith("raw.bvh#1:")
    told = run("stitch", "walk.bvh", "raw.bvh", "--frames", "9", "--force", "--json").json
    assert [one for one in told["notes"] if better in one], "in a pipeline, too"
    again = run("stitch", "walk.bvh", better, "--frames", "9", "--force")
    assert again.code == 0
    assert "nothing to do with the rest" not in again.out


def test_a_loop_of_the_part_that_goes_round_is_a_stride(run, takes):
    done = run("stitch", "walk.bvh#20:100", "--loop", "--trim", "--json")
    assert done.code == 0
    start, stop = map(int, done.json["clips"][0]["part"].split(":"))
    assert 20 <= start < stop <= 100
    made, walk = load(takes / "walk.stitched.bvh"), load(takes / "walk.bvh")
    assert 4 <= len(made) - (stop - start) <= 6
    assert rotations.angle(made.rotation[: stop - start], walk.rotation[start:stop]).max() < 1e-6
    # Round and round it is no further from itself than from one frame to the next.
    steps = np.degrees(rotations.angle(made.rotation, np.roll(made.rotation, 1, axis=0))).mean(axis=1)
    assert steps[0] < 2 * np.median(steps)
    loop = done.json["loop"]
    assert abs(loop["yaw"]) < 30
    assert 0.5 < loop["way"] < 2
    assert loop["jump"] <= loop["limit"]


@pytest.mark.parametrize("more", [[], ["--loop", "--frames", "4"], ["--loop", "run.bvh"]])
def test_what_is_trimmed_is_one_loop(run, takes, more):
    done = run("stitch", "walk.bvh", "--trim", *more)
    assert done.code == 2
    assert "--trim goes with --loop alone" in done.err


def test_what_never_comes_back_is_not_trimmed(run, takes):
    done = run("stitch", "jump.bvh#30:60", "--loop", "--trim")
    assert done.code == 2
    assert "goes round" in done.err


def test_roots_that_go_along_in_one_clip_alone_are_told(run, tmp_path, cmu_walk):
    for name, goes in (("goes", True), ("stays", False)):
        save(replace(under_root(cmu_walk, goes), source=None), tmp_path / f"{name}.bvh")
    done = run("stitch", "goes.bvh#0:60", "stays.bvh#10:70", "--frames", "10")
    assert done.code == 0
    assert "goes along in goes.bvh#0:60 and stays where it is in stays.bvh#10:70" in done.out
    same = run("stitch", "goes.bvh#0:60", "goes.bvh#60:120", "--frames", "10", "--force")
    assert "goes along" not in same.out
