"""Clips of different rigs together: the motion of one on the skeleton of the other."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.skeletons.rigs import TARGET, twice, under_root

import interpose
from interpose.formats import load, save
from interpose.geometry import rotations


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


def test_what_goes_along_with_a_body_is_not_said_to_stay(run, rigs):
    save(under_root(load(rigs / "walk.bvh"), True), rigs / "engine.bvh")
    done = run("convert", "hands.bvh", "mine.bvh", "--onto", "engine.bvh")
    assert done.code == 0
    made = load(rigs / "mine.bvh")
    assert np.ptp(made.translation[:, TARGET], axis=0).max() > 0.1
    notes = [line for line in done.out.splitlines() if "mean pose" in line]
    assert not any("ik_foot_l" in line or "root" in line for line in notes)


def test_convert_puts_a_motion_onto_a_rig(run, rigs):
    done = run("convert", "walk.bvh", "mine.bvh", "--onto", "hands.bvh", "--fps", "60")
    assert done.code == 0
    assert "43 joints keep their mean pose in hands" in done.out
    assert "hands.bvh: 163 frames" in done.out, "how the rig was understood, too"
    made, walk = load(rigs / "mine.bvh"), load(rigs / "walk.bvh")
    assert made.skeleton.names == load(rigs / "hands.bvh").skeleton.names
    assert made.fps == pytest.approx(60)
    assert made.seconds == pytest.approx(walk.seconds, abs=0.05)
    assert "JOINT mixamorig:LeftHandIndex4" in (rigs / "mine.bvh").read_text()


def test_of_two_bodies_one_is_brought_onto_a_rig_and_it_is_said_which(run, rigs):
    save(twice(load(rigs / "walk.bvh")), rigs / "two.bvh")
    first = load(rigs / "walk.bvh").skeleton.names[0]
    done = run("convert", "two.bvh", "mine.bvh", "--onto", "hands.bvh")
    assert f"the motion of {first} alone is brought onto it: --root takes B_{first} instead" in done.out
    assert "alone" not in run("convert", "walk.bvh", "mine2.bvh", "--onto", "hands.bvh").out


def test_convert_onto_the_same_rig_keeps_every_rotation(run, rigs, data):
    shutil.copy(data / "cmu_run.bvh", rigs / "run.bvh")
    assert run("convert", "run.bvh", "mine.bvh", "--onto", "walk.bvh").code == 0
    made, ran = load(rigs / "mine.bvh"), load(rigs / "run.bvh")
    assert np.allclose(made.rotation, ran.rotation, atol=1e-6)
    assert np.allclose(made.skeleton.rest_translation, load(rigs / "walk.bvh").skeleton.rest_translation)


def test_files_with_six_channels_on_every_joint_go_onto_bodies_and_rigs(run, rigs, data):
    """As with three, on a body of another size and on one that rests differently."""
    walk = replace(load(data / "cmu_walk.bvh"), source=None)
    child = replace(walk.skeleton, rest_translation=0.6 * walk.skeleton.rest_translation)
    small = replace(walk, skeleton=child, translation=0.6 * walk.translation)
    made = {"walk": walk, "child": small, "low": _arms_down(walk)}
    for name, clip in made.items():
        for channels, joints in ((3, clip.translated), (6, tuple(range(len(clip.skeleton))))):
            places = clip.local_translation()[:, list(joints)]
            save(replace(clip, translation=places, translated=joints), rigs / f"{name}{channels}.bvh")
    for name in ("child", "low"):
        for channels in (3, 6):
            words = f"walk{channels}.bvh made{channels}.bvh --onto {name}{channels}.bvh --unit cm --force"
            assert run("convert", *words.split()).code == 0
        there = [load(rigs / f"made{channels}.bvh", unit="cm").positions() for channels in (3, 6)]
        assert np.abs(there[0] - there[1]).max() < 1e-4


def _arms_down(clip):
    """The same motion of a rig that rests with its arms down."""
    skeleton, rotation = clip.skeleton, clip.rotation.copy()
    bones = skeleton.rest_translation.copy()
    for side, turned in (("Left", -1), ("Right", 1)):
        arm = skeleton.index(side + "Arm")
        down = rotations.about("Z", np.array(turned * np.pi / 2))
        for joint in np.flatnonzero(skeleton.below[:, arm]):
            back = rotations.multiply(rotation[:, joint], rotations.conjugate(down))
            rotation[:, joint] = back if joint == arm else rotations.multiply(down, back)
            if joint != arm:
                bones[joint] = rotations.rotate(down, bones[joint])
    return replace(clip, skeleton=replace(skeleton, rest_translation=bones), rotation=rotation)


def test_between_meets_a_pose_of_another_rig(run, rigs):
    done = run("between", "--start", "walk.bvh#60", "--target", "hands.bvh#100", "--frames", "30")
    assert done.code == 0
    assert "hands.bvh is on another rig" in done.out
    assert json.loads((rigs / "walk.between.json").read_text())["retargeted"] == ["hands.bvh"]
    made = load(rigs / "walk.between.bvh")
    assert made.skeleton.names == load(rigs / "walk.bvh").skeleton.names


def test_an_arm_of_another_rig_is_laid_over_the_motion(run, rigs):
    arm = ["--from", "hands.bvh", "--from-range", "60:90", "--at", "80", "--joints", "LeftArm,LeftForeArm"]
    done = run("fill", "walk.bvh", "--layer", *arm, "-o", "waves.bvh")
    assert done.code == 0
    assert "hands.bvh is on another rig" in done.out
    assert json.loads((rigs / "waves.json").read_text())["parts"][0]["retargeted"]
    made, there = load(rigs / "waves.bvh"), interpose.retarget(rigs / "hands.bvh", rigs / "walk.bvh")
    joint = made.skeleton.index("LeftForeArm")
    chord = np.abs((made.rotation[80:110, joint] * there.rotation[60:90, joint]).sum(-1))
    assert chord.min() > 1 - 1e-6
    # The arm is as steep as it is there, whatever the trunk does.
    arm, elbow = made.skeleton.index("LeftArm"), made.skeleton.index("LeftForeArm")
    heights = [p[:, elbow, 1] - p[:, arm, 1] for p in (made.positions()[80:110], there.positions()[60:90])]
    np.testing.assert_allclose(heights[0], heights[1], atol=1e-4)
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


def test_an_arm_at_another_rate_is_laid_in_as_long_as_it_took(run, rigs):
    run("convert", "hands.bvh", "fast.bvh", "--fps", "60")
    arm = ["--from", "fast.bvh", "--from-range", "120:181", "--at", "80", "--joints", "LeftArm,LeftForeArm"]
    assert run("fill", "walk.bvh", "--layer", *arm, "-o", "waves.bvh").code == 0
    made, there = load(rigs / "waves.bvh"), interpose.retarget(rigs / "hands.bvh", rigs / "walk.bvh")
    joint = made.skeleton.index("LeftForeArm")
    chord = np.abs((made.rotation[80:110, joint] * there.rotation[60:90, joint]).sum(-1))
    assert chord.min() > 1 - 1e-4


def test_what_another_rig_does_not_have_it_cannot_give(run, rigs):
    finger = "mixamorig:LeftHandIndex1"
    done = run(
        "fill",
        "hands.bvh",
        "--layer",
        "--from",
        "walk.bvh",
        "--from-range",
        "20:50",
        "--at",
        "60",
        "--joints",
        finger,
    )
    assert done.code == 2
    assert f"walk tells nothing of {finger}" in done.err
    done = run("fill", "walk.bvh", "--layer", "--from", "hands.bvh", "--at", "60", "--joints", "LeftArm")
    assert done.code == 2
    assert "beyond the end" in done.err


@pytest.mark.parametrize(
    "words",
    [
        "convert walk.bvh hands.bvh --onto hands.bvh",
        "between --start walk.bvh#60 --target hands.bvh#9 --frames 9 -o hands.bvh",
        "between --start walk.bvh#60 --target walk.bvh#9 --frames 9 --anchor hands.bvh#8@3 -o hands.bvh",
        "fill walk.bvh --layer --from hands.bvh --from-range 3:9 --at 9 --joints LeftArm -o hands.bvh",
        "stitch walk.bvh hands.bvh -o hands.bvh",
    ],
)
def test_no_file_that_was_read_is_written_over(run, rigs, words):
    before = (rigs / "hands.bvh").read_bytes()
    done = run(*words.split(), "--force")
    assert done.code == 2
    assert "the input" in done.err
    assert (rigs / "hands.bvh").read_bytes() == before


def test_a_map_is_of_the_file_whose_joints_it_names(run, rigs):
    """Of the one or of the other, whichever; of none it is a mistake."""
    assert run("skeleton", "walk.bvh", "--save-map", "walk.map.json").code == 0
    assert run("skeleton", "hands.bvh", "--save-map", "hands.map.json").code == 0
    plain = run("convert", "walk.bvh", "plain.bvh", "--onto", "hands.bvh")
    assert plain.code == 0
    for name in ("walk", "hands"):
        made = f"{name}.made.bvh"
        assert run("convert", "walk.bvh", made, "--onto", "hands.bvh", "--map", f"{name}.map.json").code == 0
        assert (rigs / made).read_text() == (rigs / "plain.bvh").read_text()
        stitched = run(
            "stitch",
            "walk.bvh",
            "hands.bvh",
            "--frames",
            "9",
            "--map",
            f"{name}.map.json",
            "-o",
            f"{name}.s.bvh",
        )
        assert stitched.code == 0
    odd = (rigs / "walk.map.json").read_text().replace("LeftFoot", "Hoof")
    (rigs / "odd.map.json").write_text(odd)
    assert run("convert", "walk.bvh", "x.bvh", "--onto", "hands.bvh", "--map", "odd.map.json").code == 2


def test_joints_are_known_without_their_namespace(run, rigs):
    """LeftArm is mixamorig:LeftArm; what is ambiguous, or nowhere, is refused as ever."""
    done = run("fill", "hands.bvh", "--gap", "40:60", "--joints", "LeftArm,LeftForeArm", "--json")
    assert done.code == 0
    assert done.json["gaps"][0]["joints"] == ["mixamorig:LeftArm", "mixamorig:LeftForeArm"]
    pinned = run("fill", "hands.bvh", "--gap", "40:60", "--pin", "LeftHand@50:0,100,0", "-o", "p.bvh")
    assert pinned.code == 0
    lost = run("recover", "hands.bvh", "--joints", "RightForeArm", "--frames", "40:60", "--json")
    assert lost.json["gaps"][0]["joints"] == ["mixamorig:RightForeArm"]
    assert "LeftWing" in run("fill", "hands.bvh", "--gap", "40:60", "--joints", "LeftWing").err


def test_a_folder_takes_the_format_of_the_rig(run, rigs, data):
    """An .amc cannot hold the motion of another skeleton than that of its .asf."""
    (rigs / "amcs").mkdir()
    for name in ("cmu_02_03.amc", "cmu_02.asf"):
        shutil.copy(data / name, rigs / "amcs" / name)
    reading = ("--skeleton", "amcs/cmu_02.asf")
    done = run("convert", "amcs", "out", "--onto", "hands.bvh", *reading)
    assert done.code == 0, done.err
    [made] = (rigs / "out").iterdir()
    assert made.name == "cmu_02_03.bvh"
    assert load(made).skeleton.names == load(rigs / "hands.bvh").skeleton.names
