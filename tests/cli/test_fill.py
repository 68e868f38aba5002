"""interpose fill, recover and convert: what is written, what is not, and what they end with."""

from __future__ import annotations

import hashlib
import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from interpose.formats import load, save
from interpose.geometry import rotations
from interpose.methods import weights


def frame_lines(path: Path) -> list[str]:
    return path.read_text().splitlines()[-163:]


def test_a_gap_is_filled_beside_the_input_and_nothing_else_changes(run, take):
    before = take.read_bytes()
    done = run("fill", "take.bvh", "--gap", "60:80", "--method", "spline")
    assert done.code == 0
    assert done.err == ""
    assert sorted(path.name for path in take.parent.iterdir()) == [
        "take.bvh",
        "take.filled.bvh",
        "take.filled.json",
    ]
    assert take.read_bytes() == before
    old, new = frame_lines(take), frame_lines(take.with_name("take.filled.bvh"))
    assert new[:60] + new[80:] == old[:60] + old[80:]
    assert all(a != b for a, b in zip(new[60:80], old[60:80]))
    assert "60:80" in done.out
    assert "spline" in done.out
    assert "estimated from a leg" in done.out


def test_the_report_says_what_was_done(run, take):
    done = run("fill", "take.bvh", "--gap", "60:80", "--method", "spline", "--json")
    written = json.loads(take.with_name("take.filled.json").read_text())
    assert done.json == written
    assert written["input"] == "take.bvh"
    assert written["output"] == "take.filled.bvh"
    assert written["input_sha256"] == hashlib.sha256(take.read_bytes()).hexdigest()
    assert written["unit"] == pytest.approx(0.0254 / 0.45)
    (gap,) = written["gaps"]
    assert gap["number"] == 1
    assert gap["frames"] == "60:80"
    assert gap["method"] == "spline"
    assert gap["foot_travel"] > 0
    assert set(written["units"]) <= gap.keys()
    assert written["open"] == []


def test_existing_outputs_stay_without_force(run, take):
    for name in ("take.filled.bvh", "take.filled.json"):
        existing = take.with_name(name)
        existing.write_text("mine")
        done = run("fill", "take.bvh", "--gap", "60:80", "--method", "linear")
        assert done.code == 2
        assert name in done.err
        assert "--force" in done.err
        assert existing.read_text() == "mine"
        existing.unlink()
    take.with_name("take.filled.bvh").write_text("mine")
    assert run("fill", "take.bvh", "--gap", "60:80", "--method", "linear", "--force").code == 0
    assert take.with_name("take.filled.bvh").read_text().startswith("HIERARCHY")


@pytest.mark.parametrize("options", [["--force"], []])
def test_a_json_file_that_is_no_report_is_never_overwritten(run, take, options):
    gaps = take.with_name("g2.json")
    gaps.write_text('[{"frames": "60:80"}]')
    labels = take.with_name("labels.json")
    labels.write_text('{"gaps": [], "style": "walk"}')
    before = gaps.read_bytes(), labels.read_bytes()
    for name in ("g2.bvh", "labels.bvh"):
        command = ["fill", "take.bvh", "--gaps", "g2.json", "-o", name, "--method", "linear", *options]
        done = run(*command)
        assert done.code == 2
        assert len(done.err.splitlines()) == 3
        assert name.replace("bvh", "json") in done.err
        assert "That would end with" in run(*command, "--dry-run").out
        assert not take.with_name(name).exists()
    assert (gaps.read_bytes(), labels.read_bytes()) == before


def test_a_report_may_be_replayed_in_place(run, take):
    assert run("fill", "take.bvh", "--gap", "60:80", "--method", "linear").code == 0
    before = take.with_name("take.filled.json").read_bytes()
    assert run("fill", "take.bvh", "--gaps", "take.filled.json").code == 2
    assert run("fill", "take.bvh", "--gaps", "take.filled.json", "--force").code == 0
    assert take.with_name("take.filled.json").read_bytes() == before


def test_a_report_is_not_mixed_with_other_gaps(run, take):
    run("fill", "take.bvh", "--gap", "60:80", "--method", "linear")
    for more in (["--gap", "50:55"], ["--gap", "50:55", "--joints", "LeftArm"], ["--joints", "LeftArm"]):
        done = run("fill", "take.bvh", "--gaps", "take.filled.json", "-o", "again.bvh", *more)
        assert done.code == 2
        assert len(done.err.splitlines()) == 3
        assert "take.filled.json" in done.err or "--joints" in done.err
    assert not take.with_name("again.bvh").exists()
    take.with_name("gaps.json").write_text('[{"frames": "60:80"}]')
    done = run(
        "fill",
        "take.bvh",
        "--gaps",
        "gaps.json",
        "--gap",
        "20:30",
        "-o",
        "both.bvh",
        "--method",
        "linear",
        "--json",
    )
    assert [gap["frames"] for gap in done.json["gaps"]] == ["20:30", "60:80"]


def test_the_input_is_never_overwritten(run, take):
    before = take.read_bytes()
    for verb in (
        ["fill", "take.bvh", "--gap", "60:80", "-o", "take.bvh"],
        ["convert", "take.bvh", "take.bvh"],
    ):
        done = run(*verb, "--force")
        assert done.code == 2
        assert "input" in done.err
    assert take.read_bytes() == before


def test_a_report_is_replayed_to_the_same_bytes(run, take):
    first = run(
        "fill", "take.bvh", "--gap", "20:26", "--gap", "60:100", "--gap", "120:150", "--max-gap", "35"
    )
    assert first.code == 4
    again = run("fill", "take.bvh", "--gaps", "take.filled.json", "-o", "again.bvh")
    assert again.code == 4
    assert take.with_name("again.bvh").read_bytes() == take.with_name("take.filled.bvh").read_bytes()
    mine, theirs = (
        json.loads(take.with_name(name).read_text()) for name in ("again.json", "take.filled.json")
    )
    assert mine | {"output": ""} == theirs | {"output": ""}


def test_all_turns_lost_are_not_the_whole_pose_in_a_report_and_its_replay(run, take):
    """Where the body is stays known: on the command line joints are rotations alone."""
    names = load(take).skeleton.names
    every = ("--gap", "60:100", "--joints", ",".join(names), "--method", "spline")
    done = run("fill", "take.bvh", *every, "--json").json
    assert done["gaps"][0]["joints"] == list(names)
    assert "splined" not in run("scan", "take.filled.bvh").out
    run("fill", "take.bvh", "--gaps", "take.filled.json", "-o", "again.bvh")
    assert take.with_name("again.bvh").read_bytes() == take.with_name("take.filled.bvh").read_bytes()
    assert np.array_equal(load(take.with_name("again.bvh")).translation, load(take).translation)
    run("recover", "take.bvh", *every[2:])
    assert run("fill", "take.bvh", "--gaps", "take.recovered.json", "-o", "third.bvh").code == 0
    third = load(take.with_name("third.bvh"))
    assert np.array_equal(third.rotation, load(take.with_name("take.recovered.bvh")).rotation)


def test_a_replay_says_once_more_what_stood_in_for_a_method(run, take):
    for method in ("stmi-gan", "cmib"):
        options = ("--gap", "30:70", "--joints", "LeftArm") if method == "cmib" else ("--gap", "30:70")
        run("fill", "take.bvh", *options, "--method", method, "-o", "one.bvh", "--force")
        run("fill", "take.bvh", "--gaps", "one.json", "-o", "two.bvh", "--force")
        one, two = (json.loads(take.with_name(f"{name}.json").read_text()) for name in ("one", "two"))
        assert any(" instead" in note for note in one["gaps"][0]["notes"])
        assert bool(one["weights"]) is (one["gaps"][0]["method"] == "base")
        assert one | {"output": ""} == two | {"output": ""}
        assert take.with_name("one.bvh").read_bytes() == take.with_name("two.bvh").read_bytes()


def test_a_replay_uses_the_method_and_the_unit_of_the_report(run, take):
    run("fill", "take.bvh", "--gap", "60:80", "--method", "linear", "--unit", "inch")
    done = run("fill", "take.bvh", "--gaps", "take.filled.json", "-o", "again.bvh", "--json").json
    assert done["gaps"][0]["method"] == "linear"
    assert done["unit"] == 0.0254
    other = run(
        "fill", "take.bvh", "--gaps", "take.filled.json", "-o", "other.bvh", "--method", "spline", "--json"
    ).json
    assert other["gaps"][0]["method"] == "spline"


def test_long_gaps_stay_open_and_are_listed(run, take):
    done = run(
        "fill", "take.bvh", "--gap", "20:30", "--gap", "60:120", "--max-gap", "40", "--method", "spline"
    )
    assert done.code == 4
    assert "gap 2 stays open: 60:120 (2.00 s), longer than --max-gap 40" in done.out
    old, new = frame_lines(take), frame_lines(take.with_name("take.filled.bvh"))
    assert new[30:] == old[30:]
    (left,) = json.loads(take.with_name("take.filled.json").read_text())["open"]
    assert (left["number"], left["frames"]) == (2, "60:120")


def test_only_one_gap(run, take):
    done = run(
        "fill",
        "take.bvh",
        "--gap",
        "100:110",
        "--gap",
        "20:30",
        "--only-gap",
        "2",
        "--method",
        "spline",
        "--json",
    )
    assert done.code == 4
    assert [gap["frames"] for gap in done.json["gaps"]] == ["100:110"]
    assert [(gap["number"], gap["frames"]) for gap in done.json["open"]] == [(1, "20:30")]
    assert run("fill", "take.bvh", "--gap", "20:30", "--only-gap", "2", "--force").code == 2


def test_a_dry_run_writes_nothing(run, take):
    done = run(
        "fill", "take.bvh", "--gap", "20:30", "--gap", "60:120", "--max-gap", "1.34s", "--dry-run", "--player"
    )
    assert done.code == 4
    assert [path.name for path in take.parent.iterdir()] == ["take.bvh"]
    assert "longer than --max-gap 40" in done.out
    assert "take.filled.html" in done.out
    (take.parent / "take.filled.bvh").write_text("mine")
    there = run("fill", "take.bvh", "--gap", "20:30", "--dry-run")
    assert "--force" in there.out
    assert there.code == 2
    nowhere = run("fill", "take.bvh", "--gap", "20:30", "-o", "new")
    assert "Or make the folder new first" in nowhere.err
    planned = run("fill", "take.bvh", "--gap", "20:30", "--method", "linear", "--dry-run", "--json").json
    assert planned["would_fill"] == [{"number": 1, "frames": "20:30", "joints": None, "method": "linear"}]


def test_a_dry_run_ends_as_the_run_would_and_tells_what_is_left_to_others(run, take):
    clip = load(take)
    rotation, translation = clip.rotation.copy(), clip.translation.copy()
    rotation[20:40], translation[20:40] = rotation[19], translation[19]
    translation[100:140] = translation[99]
    save(clip.with_motion(rotation, translation), take, force=True)
    planned = run("fill", "take.bvh", "--method", "spline", "--dry-run", "--json")
    done = run("fill", "take.bvh", "--method", "spline", "--json")
    assert planned.code == done.code == 4
    assert planned.json["left"] == done.json["left"]
    assert "recover" in planned.json["left"]


def test_joints_that_drop_out_for_moments_are_left_and_said_to_be(run, take):
    clip = load(take)
    rotation = clip.rotation.copy()
    elbow = clip.skeleton.index("LeftForeArm")
    rotation[100:103, elbow] = clip.skeleton.rest_rotation[elbow]
    rotation[20:40], translation = rotation[19], clip.translation.copy()
    translation[20:40] = translation[19]
    save(clip.with_motion(rotation, translation), take, force=True)
    done = run("fill", "take.bvh", "--method", "spline", "--json")
    assert done.code == 0
    assert "joints that drop out for moments" in done.json["dropped"]
    assert "left" not in done.json


def test_joints_in_a_range_and_in_the_whole_clip(run, take):
    ranged = run(
        "fill",
        "take.bvh",
        "--gap",
        "60:80",
        "--joints",
        "LeftArm, LeftForeArm",
        "--method",
        "spline",
        "--json",
    )
    assert ranged.code == 0
    assert ranged.json["gaps"][0]["joints"] == ["LeftArm", "LeftForeArm"]
    old, new = load(take), load(take.with_name("take.filled.bvh"))
    changed = (old.rotation != new.rotation).any(axis=(0, 2))
    assert {old.skeleton.names[j] for j in np.flatnonzero(changed)} <= {"LeftArm", "LeftForeArm"}
    assert changed.any()
    whole = run("fill", "take.bvh", "--joints", "LeftHand", "--method", "linear", "-o", "whole.bvh", "--json")
    assert whole.json["gaps"][0]["frames"] == "0:163"


def test_recover_finds_nothing_in_a_clean_clip(run, take):
    clip = load(Path("take.bvh")).slice(0, 9)
    save(clip, Path("clean.bvh"))
    done = run("recover", "clean.bvh")
    assert done.code == 2
    assert "--joints LeftArm" in done.err
    assert not Path("clean.recovered.bvh").exists()


def test_joints_of_which_nothing_is_known_are_flagged_where_only_the_rest_pose_is_left(run, take):
    assert (
        "has only the rest pose"
        in run("recover", "take.bvh", "--joints", "LeftArm", "--method", "spline").out
    )
    assert "rest pose" not in run("recover", "take.bvh", "--joints", "LeftArm", "--force").out


def test_recover_without_joints_finds_what_was_lost_for_moments(run, take):
    clip = load(Path("take.bvh"))
    elbow, rotation = clip.skeleton.index("LeftForeArm"), clip.rotation.copy()
    for frame in range(10, 80, 7):
        rotation[frame, elbow] = clip.skeleton.rest_rotation[elbow]
    save(clip.with_motion(rotation, clip.translation), Path("lost.bvh"))
    done = run("recover", "lost.bvh", "--player")
    assert done.code == 0
    assert "lost for moments and interpolated: 1" in done.out
    assert "LeftForeArm: 10:11, 17:18" in done.out
    moments = json.loads(Path("lost.recovered.json").read_text())["moments"]
    (elbow,) = (one["frames"] for one in moments if one["joint"] == "LeftForeArm")
    assert elbow == [f"{frame}:{frame + 1}" for frame in range(10, 80, 7)]
    off = load(Path("lost.recovered.bvh")).positions() - clip.positions()
    assert abs(off).max() < 0.02


def test_the_place_of_a_body_is_recovered_by_name_and_where_it_stands_still(run, take):
    clip = load(take)
    translation = clip.translation.copy()
    translation[60:120] = translation[59]
    save(clip.with_motion(clip.rotation, translation), Path("stuck.bvh"))
    assert "interpose recover stuck.bvh" in run("scan", "stuck.bvh").out
    assert "`interpose recover` restores" in run("fill", "stuck.bvh").err
    done = run("recover", "stuck.bvh")
    assert "what the body stands on tells where it is" in done.out
    assert np.linalg.norm(load(Path("stuck.recovered.bvh")).root - clip.root, axis=1).max() < 0.1
    named = run("recover", "stuck.bvh", "--place", "--frames", "60:120", "-o", "named.bvh")
    assert named.code == 0
    again = run("fill", "stuck.bvh", "--gaps", "stuck.recovered.json", "-o", "again.bvh")
    assert again.code == 2
    assert "Run interpose recover again" in again.err
    assert np.abs(load(Path("named.bvh")).root - load(Path("stuck.recovered.bvh")).root).max() < 1e-4
    assert run("recover", "stuck.bvh", "--place", "--joints", "LeftArm").code == 2
    suit = clip.slice(0, 9)
    suit.translation[:] = suit.translation[0]
    save(suit, Path("suit.bvh"))
    assert "recover suit.bvh --place" in run("recover", "suit.bvh").err
    assert "recover suit.bvh --place" in run("scan", "suit.bvh").out


def test_recover(run, take):
    done = run("recover", "take.bvh", "--joints", "LeftForeArm", "--frames", "60:80", "--method", "spline")
    assert done.code == 0
    assert sorted(path.name for path in take.parent.iterdir()) == [
        "take.bvh",
        "take.recovered.bvh",
        "take.recovered.json",
    ]


def test_gaps_from_a_file(run, take, tmp_path):
    (tmp_path / "gaps.json").write_text('[{"frames": "20:30"}, {"frames": [60, 70], "joints": ["LeftArm"]}]')
    done = run("fill", "take.bvh", "--gaps", "gaps.json", "--method", "spline", "--json")
    assert [(gap["frames"], gap["joints"]) for gap in done.json["gaps"]] == [
        ("20:30", None),
        ("60:70", ["LeftArm"]),
    ]


def test_without_gaps_a_scan_decides(run, take):
    nothing = run("fill", "take.bvh")
    assert nothing.code == 2
    assert "a scan finds nothing missing" in nothing.err
    assert "--gap 120:160" in nothing.err
    freeze(take)
    done = run("fill", "take.bvh", "--method", "spline")
    assert done.code == 0
    assert "what a scan finds is filled" in done.out
    # One of the equal frames may be the good one.
    assert json.loads(take.with_name("take.filled.json").read_text())["gaps"][0]["frames"] in (
        "60:80",
        "61:80",
    )


def test_scan(run, take):
    """A thumb of the walk is out of line in one frame."""
    first = run("scan", "take.bvh").out
    assert "lost" in first
    assert "interpose recover take.bvh restores" in first
    assert "interpose fill" not in first
    (thumb,) = run("scan", "take.bvh", "--json").json["findings"]
    assert (thumb["kind"], thumb["joints"]) == ("lost", ["RThumb"])
    run("recover", "take.bvh", "--method", "spline")
    assert "nothing looks missing" in run("scan", "take.recovered.bvh").out
    freeze(take)
    done = run("scan", "take.bvh")
    assert done.code == 0
    assert "interpose fill take.bvh" in done.out
    done = run("recover", "take.bvh", "--force")
    assert "left as it is: all 6" in done.out, "from frame 60 or 61 on"
    assert "interpose fill take.recovered.bvh fills it" in done.out
    found = run("scan", "take.bvh", "--json").json["findings"]
    assert [one["kind"] for one in found] == ["lost", "frozen"]
    assert found[1]["frames"] in ("60:80", "61:80")


def freeze(path: Path) -> None:
    """Frames 60 to 79 all like frame 60."""
    lines = path.read_text().splitlines(keepends=True)
    first = len(lines) - 163
    lines[first + 61 : first + 80] = [lines[first + 60]] * 19
    path.write_text("".join(lines))


def test_the_player_page_is_written(run, take):
    run("fill", "take.bvh", "--gap", "60:80", "--method", "linear", "-o", "out.bvh", "--player")
    page = take.with_name("out.html").read_text()
    assert "<html" in page
    assert "http://" not in page.replace("http://www.w3.org", "")


def test_convert(run, take):
    assert run("convert", "take.bvh", "take.npz").code == 0
    assert run("convert", "take.npz", "back.bvh").code == 0
    old, new = load(take), load(take.with_name("back.bvh"))
    np.testing.assert_allclose(new.positions(), old.positions(), atol=1e-5)
    assert run("convert", "take.bvh", "copy.bvh").code == 0
    assert take.with_name("copy.bvh").read_bytes() == take.read_bytes()
    assert run("convert", "take.bvh", "slow.bvh", "--fps", "15").code == 0
    slow = load(take.with_name("slow.bvh"))
    assert len(slow) == 82
    assert slow.fps == pytest.approx(15, abs=1e-3)
    assert run("convert", "take.bvh", "slow.bvh").code == 2


def test_convert_takes_repeated_frames_out_as_scan_advises(run, take):
    clip = load(take)
    at = np.arange(len(clip)) // 2 * 2
    save(clip.with_motion(clip.rotation[at], clip.translation[at]), take, force=True)
    assert "take.even.bvh --drop-repeated" in run("scan", "take.bvh").out
    done = run("convert", "take.bvh", "take.even.bvh", "--drop-repeated")
    assert done.code == 0
    assert "moves evenly" in done.out
    even = load(take.with_name("take.even.bvh"))
    assert len(even) == len(clip)
    assert np.abs(even.positions()[:-2] - clip.positions()[:-2]).max() < 0.02
    again = run("convert", "take.even.bvh", "other.bvh", "--drop-repeated")
    assert again.code == 2
    assert not take.with_name("other.bvh").exists()


def test_convert_to_more_frames_leads_through_the_old_ones_without_corners(run, take):
    assert run("convert", "take.bvh", "fast.bvh", "--fps", "120").code == 0
    old, new = load(take), load(take.with_name("fast.bvh"))
    assert np.abs(new.positions()[::4] - old.positions()).max() < 1e-4
    # In a straight line all change of velocity would be at the old frames: a quarter of it is, and a little.
    jumps = np.linalg.norm(np.diff(new.root, 2, axis=0), axis=1)
    assert jumps[3::4].mean() < 2 * jumps.mean()


@pytest.mark.parametrize("options", [[], ["--up", "z"]])
def test_another_rate_keeps_the_layout(run, take, options):
    assert run("convert", "take.bvh", "slow.bvh", "--fps", "15", *options).code == 0
    old, new = take.read_text(), take.with_name("slow.bvh").read_text()
    assert new.partition("MOTION")[0] == old.partition("MOTION")[0]
    every_second = [line.split() for line in old.splitlines()[-163::2]]
    kept = [line.split() for line in new.splitlines()[-82:]]
    np.testing.assert_allclose(np.array(kept, float)[:, :3], np.array(every_second, float)[:, :3], atol=1e-3)
    clip, slow = (load(take.with_name(name), up="z" if options else "y") for name in ("take.bvh", "slow.bvh"))
    assert (slow.source.unit, slow.source.up) == (clip.source.unit, clip.source.up)
    np.testing.assert_allclose(slow.positions(), clip.positions()[::2], atol=1e-4)


def test_npz_in_npz_out(run, take):
    save(load(take), take.with_suffix(".npz"))
    done = run("fill", "take.npz", "--gap", "60:80", "--method", "spline")
    assert done.code == 0
    assert take.with_name("take.filled.npz").exists()
    assert "unit" not in json.loads(take.with_name("take.filled.json").read_text())


def test_an_arm_of_another_clip_in_a_gap_and_its_report_replayed(run, take, data, monkeypatch):
    take.with_name("jump.bvh").write_bytes((data / "cmu_jump.bvh").read_bytes())
    words = ["fill", "take.bvh", "--gap", "60:90", "--joints", "RightArm,RightHand", "--method", "spline"]
    given = ["--from", "jump.bvh", "--from-range", "40:48", "--at", "70"]
    done = run(*words, *given, "--json")
    assert done.code == 0
    assert done.json["parts"] == [
        {"file": "jump.bvh", "frames": "40:48", "at": 70, "joints": ["RightArm", "RightHand"]}
    ]
    other = hashlib.sha256(take.with_name("jump.bvh").read_bytes()).hexdigest()
    assert done.json["others_sha256"] == {"jump.bvh": other}
    first, jump = load(take.with_name("take.filled.bvh")), load(take.with_name("jump.bvh"))
    arm = first.skeleton.index("RightArm")
    assert np.abs(first.rotation[70:78, arm] - jump.rotation[40:48, arm]).max() < 1e-5
    assert run("fill", "take.bvh", "--gaps", "take.filled.json", "-o", "again.bvh").code == 0
    assert take.with_name("again.bvh").read_bytes() == take.with_name("take.filled.bvh").read_bytes()
    # From another folder: what the report names lies beside it.
    elsewhere = take.parent / "elsewhere"
    elsewhere.mkdir()
    monkeypatch.chdir(elsewhere)
    assert run("fill", take, "--gaps", take.with_name("take.filled.json"), "-o", "once_more.bvh").code == 0
    assert (elsewhere / "once_more.bvh").read_bytes() == take.with_name("again.bvh").read_bytes()
    monkeypatch.chdir(take.parent)
    assert run("fill", "take.bvh", "--gap", "60:90", *given, "-o", "x.bvh").err.startswith(
        "error: --from needs"
    )
    assert (
        "no other clip is named" in run("fill", "take.bvh", "--gap", "60:90", "--at", "70", "-o", "x.bvh").err
    )
    assert (
        "--from-range 4-8" in run(*words, *given[:2], "--from-range", "4-8", "--at", "70", "-o", "x.bvh").err
    )


@pytest.mark.parametrize("gap", ["60:90", "60:110", "40:90"])
def test_an_arm_of_another_clip_beside_known_frames_is_replayed(run, take, data, gap):
    """Led on from these it leaves gaps before the frames that it gives, and after them."""
    take.with_name("jump.bvh").write_bytes((data / "cmu_jump.bvh").read_bytes())
    words = ["--gap", gap, "--joints", "RightArm,RightForeArm,RightHand", "--method", "spline"]
    part = ["--from", "jump.bvh", "--from-range", "40:70", "--at", "60"]
    assert run("fill", "take.bvh", *words, *part).code == 0
    assert run("fill", "take.bvh", "--gaps", "take.filled.json", "-o", "again.bvh").code == 0
    assert take.with_name("again.bvh").read_bytes() == take.with_name("take.filled.bvh").read_bytes()


def test_the_report_of_an_amc_has_the_checksum_of_its_skeleton(run, take, data):
    for name in ("cmu_02_03.amc", "cmu_02.asf"):
        shutil.copy(data / name, take.with_name(name))
    report = run("fill", "cmu_02_03.amc", "--gap", "15:22", "--skeleton", "cmu_02.asf", "--json").json
    assert report["skeleton_sha256"] == hashlib.sha256((data / "cmu_02.asf").read_bytes()).hexdigest()
    assert report["input_sha256"] == hashlib.sha256((data / "cmu_02_03.amc").read_bytes()).hexdigest()


def test_a_path_is_in_the_file_s_own_unit_and_its_report_is_replayed(run, take):
    clip = load(take)
    unit = clip.source.unit
    x, _, z = clip.root[75] / unit
    done = run("fill", "take.bvh", "--gap", "60:90", "--path", f"75:{x:.4f},{z + 2:.4f}", "--json")
    assert done.code == 0
    assert done.json["path"] == [f"75:{x:.4f},{z + 2:.4f}"]
    assert done.json["gaps"][0]["path"] < 1
    there = load(take.with_name("take.filled.bvh")).root[75]
    assert np.abs(there - clip.root[75] - [0, there[1] - clip.root[75, 1], 2 * unit]).max() < 0.01
    assert run("fill", "take.bvh", "--gaps", "take.filled.json", "-o", "again.bvh").code == 0
    assert take.with_name("again.bvh").read_bytes() == take.with_name("take.filled.bvh").read_bytes()


def test_a_pin_is_in_the_file_s_own_unit_and_its_report_is_replayed(run, take):
    clip = load(take)
    hand = clip.skeleton.index("LeftHand")
    there = clip.positions()[75, hand] / clip.source.unit + [0, 5, 0]
    text = "LeftHand@74:77:" + ",".join(f"{x:.4f}" for x in there)
    done = run("fill", "take.bvh", "--gap", "60:90", "--pin", text, "--json")
    assert done.code == 0
    assert done.json["pinned"] == [text]
    assert done.json["gaps"][0]["pins"] < 0.1
    met = load(take.with_name("take.filled.bvh")).positions()[74:77, hand]
    np.testing.assert_allclose(met / clip.source.unit, np.tile(there, (3, 1)), atol=0.02)
    assert run("fill", "take.bvh", "--gaps", "take.filled.json", "-o", "again.bvh").code == 0
    assert take.with_name("again.bvh").read_bytes() == take.with_name("take.filled.bvh").read_bytes()


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("method", 1),
        ("method", []),
        ("path", [1]),
        ("pinned", [{}]),
        ("path", 3),
        ("gaps", [{"method": True}]),
    ],
)
def test_a_report_that_was_spoilt_is_refused(run, take, key, value):
    assert run("fill", "take.bvh", "--gap", "60:90", "--method", "spline").code == 0
    report = take.with_name("take.filled.json")
    content = json.loads(report.read_text())
    content[key] = [content["gaps"][0] | value[0]] if key == "gaps" else value
    report.write_text(json.dumps(content))
    done = run("fill", "take.bvh", "--gaps", report.name, "-o", "again.bvh")
    assert done.code == 2
    assert "cannot repeat" in done.err
    assert not take.with_name("again.bvh").exists()


def test_a_joint_is_held_as_it_is_at_another_frame(run, take):
    """In place and turn, where that frame is known."""
    words = ["fill", "take.bvh", "--gap", "60:90", "--pin"]
    done = run(*words, "LeftFoot@60:75:@59", "--json")
    assert done.json["pinned"] == ["LeftFoot@60:75:@59"]
    foot = load(take).skeleton.index("LeftFoot")
    turned, placed = load(take.with_name("take.filled.bvh")).kinematics()
    assert np.abs(placed[60:75, foot] - placed[59, foot]).max() < 0.001
    assert np.degrees(rotations.angle(turned[60:75, foot], turned[59, foot])).max() < 0.1
    assert "is missing itself" in run(*words, "LeftFoot@60:75:@75", "--force").err
    assert "there is no frame" in run(*words, "LeftFoot@60:75:@999", "--force").err


@pytest.mark.parametrize(
    "text",
    ["LeftHand", "LeftHand@75", "LeftHand@75:1,2", "LeftHand@77:75:1,2,3", "75:1,2,3", "LeftHand@75:@1,2"],
)
def test_a_pin_that_cannot_be_read(run, take, text):
    done = run("fill", "take.bvh", "--gap", "60:90", "--pin", text)
    assert done.code == 2
    assert f"cannot read --pin {text}" in done.err


def test_a_dry_run_checks_pins(run, take):
    words = ["fill", "take.bvh", "--gap", "60:90", "--dry-run", "--pin"]
    assert "cannot be pinned at frame 20" in run(*words, "LeftHand@20:1,2,3").err
    assert "no frame 9000" in run(*words, "LeftHand@9000:9000000000:1,2,3").err
    assert run(*words, "LeftHand@70:1,2,3").code == 0
    end = f"{len(load(take)) / load(take).fps}s"
    assert (
        run("fill", "take.bvh", "--gap", f"4s:{end}", "--dry-run", "--pin", f"LeftHand@5s:{end}:1,2,3").code
        == 0
    )


def test_two_points_of_a_path_at_one_frame_are_refused(run, take):
    points = ("--path", "75:1,2", "--path", f"{75 / load(take).fps}s:3,4")
    done = run("fill", "take.bvh", "--gap", "60:90", *points, "--dry-run")
    assert done.code == 2
    assert "two points at frame 75" in done.err
    assert run("fill", "take.bvh", "--gap", "60:90", *points[:2], *points[:2], "--dry-run").code == 0


@pytest.mark.parametrize("text", ["75", "75:1", "75:1,nan", "75:1,2,3", "a:1,2", "75:1,"])
def test_a_path_that_cannot_be_read(run, take, text):
    done = run("fill", "take.bvh", "--gap", "60:90", "--path", text)
    assert done.code == 2
    assert f"cannot read --path {text}" in done.err
    assert "x and z" in done.err


def test_a_path_in_a_file_with_z_up(run, take):
    from interpose.cli.request import path_of

    clip = load(take, up="z")
    (point,) = path_of(["75:3,4"], clip).values()
    assert np.allclose(point, np.array([3.0, -4.0]) * clip.source.unit), "x and y of the file"


def test_joints_of_another_clip_are_laid_over_the_motion_that_is_there(run, take, data):
    shutil.copy(data / "cmu_jump.bvh", "jump.bvh")
    part = ["--from", "jump.bvh", "--from-range", "20:50", "--at", "70", "--joints", "RightArm,RightForeArm"]
    assert "--layer" in run("fill", "take.bvh", *part).err
    assert run("fill", "take.bvh", *part, "--layer", "--method", "spline").code == 0
    before, after, jump = (load(Path(name)) for name in ("take.bvh", "take.filled.bvh", "jump.bvh"))
    arm = [before.skeleton.index(name) for name in ("RightArm", "RightForeArm")]
    np.testing.assert_allclose(after.rotation[70:100, arm[1]], jump.rotation[20:50, arm[1]], atol=1e-6)
    rest = [joint for joint in range(len(before.skeleton)) if joint not in arm]
    assert np.array_equal(after.rotation[:, rest], before.rotation[:, rest])
    assert np.array_equal(after.translation, before.translation)
    again = run("fill", "take.bvh", "--gaps", "take.filled.json", "-o", "again.bvh")
    assert again.code == 0
    assert Path("again.bvh").read_bytes() == Path("take.filled.bvh").read_bytes()
    assert "no other clip is named" in run("fill", "take.bvh", "--layer").err
    over = run("fill", "take.bvh", *part, "--layer", "-o", "jump.bvh", "--force", "--dry-run")
    assert "it is the input" in over.out
    assert over.code == 2


def test_times_in_seconds_and_where_joints_are(run, take):
    """What `skeleton --at` prints is what --pin takes: the hand pinned where it is stays there."""
    where = run("skeleton", "take.bvh", "--at", "3s", "--json").json
    assert where["frame"] == 90
    place = ",".join(map(str, where["positions"]["LeftHand"]))
    assert place in run("skeleton", "take.bvh", "--at", "90", "--json").out.replace(" ", "").replace("\n", "")
    done = run("fill", "take.bvh", "--gap", "80:100", "--pin", f"LeftHand@3s:{place}", "--json")
    assert done.json["gaps"][0]["pins"] < 0.1
    hand = load(take).skeleton.index("LeftHand")
    off = load(Path("take.filled.bvh")).positions()[90, hand] - load(take).positions()[90, hand]
    assert np.abs(off).max() < 0.002
    assert run("fill", "take.bvh", "--gap", "80:100", "--pin", f"LeftHand@99s:{place}").code == 2
    assert "there is no frame" in run("skeleton", "take.bvh", "--at", "99s").err
    far = load(take)
    save(far.with_motion(far.rotation, far.translation + np.array([123.0, 0.0, 0.0])), "far.bvh")
    exact = run("skeleton", "far.bvh", "--at", "90", "--json").json["positions"]
    told = run("skeleton", "far.bvh", "--at", "90").out.replace("\n", "")
    assert ",".join(f"{x:.10g}" for x in exact["LeftHand"]) in told, "not to four digits"


def test_a_dry_run_checks_and_lists_the_path(run, take):
    words = ["fill", "take.bvh", "--gap", "60:90", "--dry-run"]
    assert run(*words, "--path", "20:1,2").code == 2
    assert "70:1,2" in run(*words, "--path", "70:1,2").out
    assert run(*words, "--path", "70:1,2", "--json").json["path"] == ["70:1,2"]


def test_a_layer_of_nothing_is_refused(run, take):
    done = run("fill", "take.bvh", "--layer", "--gap", "60:90", "--joints", "RightArm")
    assert done.code == 2
    assert "--from" in done.err


def test_a_report_of_poses_of_several_files_is_refused(run, take):
    """Though the first of them has as many frames as what was made."""
    frames = ("--frames", str(len(load(take)) - 2))
    assert (
        run("between", "--start", "take.bvh", "--target", "take.bvh", *frames, "--method", "spline").code == 0
    )
    done = run("fill", "take.bvh", "--gaps", "take.between.json", "-o", "again.bvh")
    assert done.code == 2
    assert "Run interpose between again" in done.err
    assert not take.with_name("again.bvh").exists()


def test_a_report_of_a_clip_of_other_frames_is_refused(run, take):
    save(load(take).slice(0, 120), take.with_name("cut.bvh"))
    assert run("fill", "cut.bvh", "--gap", "60:90", "--method", "spline").code == 0
    done = run("fill", "take.bvh", "--gaps", "cut.filled.json")
    assert done.code == 2
    assert "it is of a clip of 120 frames" in done.err


def test_whose_weights_they_are_is_said(run, take):
    done = run("fill", "take.bvh", "--gap", "60:90", "--method", "small")
    assert "small: for research and non-commercial use" in done.out
    report = json.loads(take.with_name("take.filled.json").read_text())
    assert [one["name"] for one in report["weights"]] == ["small"]
    assert "research" in report["weights"][0]["licence"]
    done = run("fill", "take.bvh", "--gap", "60:90", "--method", "small-open", "--force")
    assert "non-commercial" not in done.out
    both = run("fill", "take.bvh", "--gap", "60:90", "--force", "--json").json
    assert [one["name"] for one in both["weights"]] == ["base", "small"]
    assert "weights" not in both["gaps"][0]


def test_weights_in_a_folder_are_told_by_their_own_card(run, take):
    """Not by that of installed ones that have their name."""
    card = weights.find("small-open")
    mine = take.with_name("mine")
    mine.mkdir()
    shutil.copy(card.onnx, mine / "small.onnx")
    replace(card, name="small", training={"commit": "1234567"}).save(mine / "small.json")
    done = run("fill", "take.bvh", "--gap", "60:90", "--method", "mine", "--license", "open", "--json")
    assert done.json["weights"] == [{"name": "small", "licence": card.licence, "commit": "1234567"}]
    assert "research" not in run("fill", "take.bvh", "--gap", "60:90", "--method", "mine", "--force").out


def test_limbs_that_change_sides_for_good_are_put_back_as_scan_and_recover_say(run, take):
    clip = load(take)
    left, right = (
        [clip.skeleton.index(side + part) for part in ("UpLeg", "Leg", "Foot", "ToeBase")]
        for side in ("Left", "Right")
    )
    rotation = clip.rotation.copy()
    rotation[90:, left + right] = clip.rotation[90:, right + left]
    save(clip.with_motion(rotation, clip.translation), Path("odd.bvh"))
    thumb = clip.skeleton.index("RThumb")
    rotation[:, thumb] = rotation[0, thumb]
    save(clip.with_motion(rotation, clip.translation), Path("walk.bvh"))
    part = f"90:{len(clip)}"
    said = run("scan", "odd.bvh").out
    assert f"recover odd.bvh --frames {part} puts limbs back there" in said
    assert "if they are wrong elsewhere, --frames 0:90." in said
    # With something else to recover, a thumb, and without.
    assert f"--frames {part} puts them back there" in run("recover", "odd.bvh", "--dry-run").out
    assert f"--frames {part} puts them back there" in run("recover", "walk.bvh").err
    assert run("recover", "odd.bvh", "--frames", part).code == 0
    assert np.abs(load(Path("odd.recovered.bvh")).positions() - clip.positions()).max() < 1e-4
