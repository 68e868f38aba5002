"""interpose denoise as it is typed."""

from __future__ import annotations

import json

import pytest

import interpose
from interpose.evaluation.denoising import drop, tremble


def _spoil(take, spoil):  # type: ignore[no-untyped-def]
    import numpy as np

    clip = interpose.load(take)
    interpose.save(spoil(clip, np.random.default_rng(0)), take, force=True)


def test_it_writes_a_clip_a_report_and_a_page(run, take):
    _spoil(take, lambda clip, rng: tremble(clip, 5.0, rng))
    done = run("denoise", take, "--player")
    assert done.code == 0, done.err
    assert "noise:" in done.out
    assert "moved:" in done.out
    report = json.loads((take.parent / "take.denoised.json").read_text())
    said = report["denoised"]
    assert report["verb"] == "denoise"
    assert said["noise"] > 1
    assert 0 < said["moved"] < said["moved_most"]
    assert len(said["joints"]) == report["joints"]
    assert report["units"]["moved"] == "cm"
    noisy, clean = take.read_text(), (take.parent / "take.denoised.bvh").read_text()
    assert noisy.partition("MOTION")[0] == clean.partition("MOTION")[0]
    assert len(noisy.splitlines()) == len(clean.splitlines())
    assert "denoised" in (take.parent / "take.denoised.html").read_text()
    assert run("denoise", take).code == 2  # the file exists
    assert run("denoise", take, "--player", "--force").code == 0


def test_joints_that_drop_out_are_counted(run, take):
    _spoil(take, lambda clip, rng: drop(clip, 0.1, rng))
    said = run("denoise", take, "--json").json["denoised"]
    assert said["broken"] > 100
    assert any(":" in span for joint in said["joints"] for span in joint["broken"])


def test_strength_0_writes_the_same_bytes(run, take):
    assert run("denoise", take, "--strength", "0").code == 0
    assert (take.parent / "take.denoised.bvh").read_bytes() == take.read_bytes()


def test_errors_have_three_lines(run, take):
    for tokens in (
        ["--strength", "-1"],
        ["--joints", "Tail"],
        ["--joints", ","],
        ["--frames", "now"],
        ["--frames", "4:6"],
        ["--frames", "50:50"],
        ["--frames", "90:50"],
        ["--frames", "100:900"],
        ["-o", "take.xyz"],
    ):
        done = run("denoise", take, *tokens)
        assert done.code == 2, tokens
        assert len(done.err.splitlines()) == 3, done.err
        assert done.err.startswith("error: ")
    assert not list(take.parent.glob("take.denoised*"))


def test_joints_at_the_ends_turn_without_moving(run, take):
    _spoil(take, lambda clip, rng: tremble(clip, 5.0, rng))
    done = run("denoise", take, "--joints", "LeftToeBase", "--json").json["denoised"]
    (toe,) = [one for one in done["joints"] if one["turned_most"] > 1e-6]
    assert toe["joint"] == "LeftToeBase"
    assert toe["moved_most"] == 0
    assert done["turned_most"] == toe["turned_most"] > toe["turned"] > 1
    assert "(LeftToeBase)" in run("denoise", take, "--joints", "LeftToeBase", "-o", "again.bvh").out


@pytest.mark.parametrize("verb", ["denoise", "recover"])
def test_a_dry_run_says_what_would_be_done_and_writes_nothing(run, take, verb):
    joints = ["--joints", "LeftHand"]
    before = sorted(path.name for path in take.parent.iterdir())
    dry = run(verb, "take.bvh", *joints, "--dry-run", "--player")
    assert dry.code == 0
    assert "a dry run: nothing is written" in dry.out
    assert run(verb, "take.bvh", "take.bvh", ".", *joints, "--dry-run", "-o", "made").code == 0
    assert sorted(path.name for path in take.parent.iterdir()) == before
    assert run(verb, "take.bvh", *joints, "--dry-run", "--json").json["dry_run"]
    done = run(verb, "take.bvh", *joints, "--player")
    assert done.out.splitlines()[:-1] == dry.out.splitlines()[:-1]
