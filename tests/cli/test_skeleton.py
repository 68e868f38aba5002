"""How a skeleton is understood, shown, saved, corrected, and obeyed by the other verbs."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from tests.skeletons import rigs

from interpose import formats
from interpose.clip import Clip


@pytest.fixture
def rig(tmp_path: Path, cmu_walk: Clip) -> Path:
    path = tmp_path / "hero.bvh"
    formats.save(rigs.build("unreal", cmu_walk)[0], path)
    return path


@pytest.fixture
def strange(rig: Path) -> Path:
    """The rig with names that say nothing, in a zero pose that is none: shape does not help either."""
    lines = rig.read_text().splitlines()
    for number, line in enumerate(lines):
        word, _, _ = line.strip().partition(" ")
        if word in ("ROOT", "JOINT"):
            lines[number] = f"{word} joint{number}"
    path = rig.with_name("strange.bvh")
    path.write_text("\n".join(lines) + "\n")
    return path


def test_the_tree_says_what_every_joint_is(run, rig):
    done = run("skeleton", rig)
    assert done.code == 0
    rows = {line.split()[0]: line.split()[1:] for line in done.out.splitlines() if "  " in line.strip()}
    assert rows["thigh_l"][0] == "LeftUpLeg"
    assert rows["spine_01"][0] == "Spine"
    assert rows["upperarm_twist_01_r"][1:] == ["carried", "along"]
    assert "a humanoid, 22 of 22 joints found by names" in done.out
    assert "the T-pose was worked out from the motion" in done.out
    assert rows["root"][1:] == ["above", "it"]
    assert rows["ik_hand_gun"][1:] == ["not", "part", "of", "this", "body"]


def test_json_for_programs(run, rig):
    found = run("skeleton", rig, "--json").json
    assert found["humanoid"] is True
    assert found["mapping"]["LeftHand"] == "hand_l"
    assert "ik_hand_gun" in found["carried_along"]
    assert found["zero_pose"] == "none"
    assert found["t_pose_from"] == "motion"
    assert found["missing"] == []
    assert {*found["t_pose"]} == {*found["mapping"].values()}
    np.testing.assert_allclose(np.linalg.norm([*found["t_pose"].values()], axis=1), 1, atol=1e-5)
    assert found["parents"]["LeftFoot"] == "LeftLeg"
    shin = np.array(found["bones"]["LeftFoot"]) / np.linalg.norm(found["bones"]["LeftFoot"])
    assert shin[1] < -0.99, "legs hang straight down in a T-pose"
    assert found["scale"] * found["leg"] == pytest.approx(0.8587, abs=1e-3)


def test_a_saved_map_is_corrected_and_obeyed(run, rig, tmp_path):
    assert run("skeleton", rig, "--save-map", "hero.map.json").code == 0
    content = json.loads((tmp_path / "hero.map.json").read_text())
    assert content["joints"]["LeftArm"] == "upperarm_l"
    content["joints"]["LeftToe"] = ""
    (tmp_path / "hero.map.json").write_text(json.dumps(content))
    found = run("skeleton", rig, "--map", "hero.map.json", "--json").json
    assert found["missing"] == ["LeftToe"]
    assert found["how"]["LeftArm"] == "given"
    again = run("skeleton", rig, "--save-map", "hero.map.json")
    assert again.code == 2
    assert "exists already" in again.err


def test_a_map_lets_the_network_fill_a_strange_skeleton_and_a_report_remembers_it(
    run, rig, strange, tmp_path
):
    assert run("skeleton", strange).code == 4
    plain = run("fill", strange, "--gap", "60:90", "--method", "cae", "--json", "-o", "plain.bvh")
    assert plain.json["gaps"][0]["method"] == "spline"
    assert "--map, or load(..., roles=...), names them" in json.dumps(plain.json)

    own = dict(zip(formats.load(rig).skeleton.names, formats.load(strange).skeleton.names))
    joints = run("skeleton", rig, "--json").json["mapping"]
    roles = {name: own[joint] for name, joint in joints.items()}
    (tmp_path / "map.json").write_text(json.dumps({"joints": roles}))
    mapped = ("fill", strange, "--gap", "60:90", "--map", "map.json", "-o", "mapped.bvh", "--json")
    assert run(*mapped).json["gaps"][0]["method"] == "base"
    (tmp_path / "map.json").unlink()
    assert run("fill", strange, "--gaps", "mapped.json", "-o", "again.bvh").code == 0
    assert (tmp_path / "again.bvh").read_bytes() == (tmp_path / "mapped.bvh").read_bytes()


def test_a_picture_of_the_t_pose(run, rig, tmp_path):
    assert run("skeleton", rig, "--picture", "pose.svg").code == 0
    assert (tmp_path / "pose.svg").read_text().startswith("<svg")


@pytest.mark.parametrize(
    ("options", "code", "says"),
    [
        (["--map", "no.json"], 3, "cannot read the map"),
        (["--root", "nobody"], 2, "no joint nobody"),
        (["--rest-frame", "9999"], 2, "no frame 9999"),
    ],
)
def test_bad_options(run, rig, options, code, says):
    done = run("skeleton", rig, *options)
    assert done.code == code
    assert says in done.err
    assert len(done.err.strip().splitlines()) == 3


def test_the_input_and_other_files_are_never_replaced(run, rig, tmp_path):
    before = rig.read_bytes()
    (tmp_path / "labels.json").write_text('{"content": "walk"}')
    (tmp_path / "copy.json").symlink_to(rig)
    for options in (
        ("--save-map", rig),
        ("--picture", rig),
        ("--save-map", "labels.json"),
        ("--save-map", "copy.json"),
        ("--picture", "pose.png"),
        ("--save-map", "no/such/map.json"),
    ):
        done = run("skeleton", rig, *options, "--force")
        assert done.code == 2, options
        assert len(done.err.strip().splitlines()) == 3
    assert rig.read_bytes() == before
    assert (tmp_path / "labels.json").read_text() == '{"content": "walk"}'


def test_what_is_no_humanoid_writes_no_picture_and_no_map(run, strange, tmp_path):
    done = run("skeleton", strange, "--save-map", "m.json", "--picture", "p.svg")
    assert done.code == 2
    assert "no T-pose to draw" in done.err
    assert not (tmp_path / "m.json").exists()


def test_fill_says_how_the_skeleton_is_understood(run, rig, strange):
    assert "a humanoid, 22 of 22 joints found by names" in run("fill", rig, "--gap", "60:90").out
    assert "skeleton: no humanoid" in run("fill", strange, "--gap", "60:90").out
