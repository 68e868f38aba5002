"""Clips of different rigs together: the motion of one on the skeleton of the other."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

import interpose
from interpose.formats import load


@pytest.fixture
def rigs(tmp_path, data):
    """walk.bvh of CMU (209 frames, 31 joints), and hands.bvh, with other joints and fingers (163, 65)."""
    shutil.copy(data / "cmu_walk.bvh", tmp_path / "walk.bvh")
    shutil.copy(Path(interpose.__file__).parent / "examples" / "fingers.bvh", tmp_path / "hands.bvh")
    return tmp_path


def test_stitch_takes_what_is_of_another_rig(run, rigs):
    done = run("stitch", "hands.bvh", "walk.bvh#20:90", "--frames", "20")
    assert done.code == 0
    assert "walk.bvh is on another rig" in done.out
    made, hands = load(rigs / "hands.stitched.bvh"), load(rigs / "hands.bvh")
    assert made.skeleton.names == hands.skeleton.names
    assert len(made) == 163 + 20 + 70
    assert np.array_equal(made.rotation[:163], hands.rotation)
    first, second = json.loads((rigs / "hands.stitched.json").read_text())["clips"]
    assert second["retargeted"]
    assert "retargeted" not in first


def test_convert_puts_a_motion_onto_a_rig(run, rigs):
    done = run("convert", "walk.bvh", "mine.bvh", "--onto", "hands.bvh", "--fps", "60")
    assert done.code == 0
    assert "as in hands, in the mean" in done.out
    made, walk = load(rigs / "mine.bvh"), load(rigs / "walk.bvh")
    assert made.skeleton.names == load(rigs / "hands.bvh").skeleton.names
    assert made.fps == pytest.approx(60)
    assert made.seconds == pytest.approx(walk.seconds, abs=0.05)
    assert "JOINT mixamorig:LeftHandIndex4" in (rigs / "mine.bvh").read_text()


def test_convert_onto_the_same_rig_keeps_every_rotation(run, rigs, data):
    shutil.copy(data / "cmu_run.bvh", rigs / "run.bvh")
    assert run("convert", "run.bvh", "mine.bvh", "--onto", "walk.bvh").code == 0
    made, ran = load(rigs / "mine.bvh"), load(rigs / "run.bvh")
    assert np.allclose(made.rotation, ran.rotation, atol=1e-6)
    assert np.allclose(made.skeleton.rest_translation, load(rigs / "walk.bvh").skeleton.rest_translation)


def test_between_meets_a_pose_of_another_rig(run, rigs):
    done = run("between", "--start", "walk.bvh#60", "--target", "hands.bvh#100", "--frames", "30")
    assert done.code == 0
    assert "hands.bvh#100 is on another rig" in done.out
    made = load(rigs / "walk.between.bvh")
    assert made.skeleton.names == load(rigs / "walk.bvh").skeleton.names


def test_an_arm_of_another_rig_is_laid_over_the_motion(run, rigs):
    arm = ["--from", "hands.bvh", "--from-range", "60:90", "--at", "80", "--joints", "LeftArm,LeftForeArm"]
    assert run("fill", "walk.bvh", "--layer", *arm, "-o", "waves.bvh").code == 0
    made, there = load(rigs / "waves.bvh"), interpose.retarget(rigs / "hands.bvh", rigs / "walk.bvh")
    joints = [made.skeleton.index(name) for name in ("LeftArm", "LeftForeArm")]
    chord = np.abs((made.rotation[80:110, joints] * there.rotation[60:90, joints]).sum(-1))
    assert chord.min() > 1 - 1e-6
    again = run("fill", "walk.bvh", "--gaps", "waves.json", "-o", "again.bvh")
    assert again.code == 0
    assert (rigs / "again.bvh").read_text() == (rigs / "waves.bvh").read_text()


def test_what_is_no_humanoid_is_refused(run, rigs):
    (rigs / "snake.bvh").write_text(
        "HIERARCHY\nROOT a\n{\nOFFSET 0 0 0\nCHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation"
        " Yrotation\nEnd Site\n{\nOFFSET 0 1 0\n}\n}\nMOTION\nFrames: 2\nFrame Time: 0.033\n"
        + "0 " * 12
        + "\n"
    )
    done = run("stitch", "walk.bvh", "snake.bvh")
    assert done.code == 2
    assert "another skeleton" in done.err
    assert run("convert", "walk.bvh", "x.bvh", "--onto", "snake.bvh").code == 2
    assert not (rigs / "x.bvh").exists()
