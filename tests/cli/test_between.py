"""interpose between: keys of one file, poses of several, actions, and what goes wrong."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import interpose
from interpose.formats import load, save
from interpose.geometry import rotations


def test_keys_come_back_and_the_rest_is_new(run, take):
    done = run("between", "take.bvh", "--keys", "10,40,90", "--method", "linear")
    assert done.code == 0
    before, after = load(take), load(take.with_name("take.between.bvh"))
    kept = [*range(11), 40, *range(90, len(before))]
    assert np.array_equal(after.rotation[kept], before.rotation[kept])
    assert np.array_equal(after.translation[kept], before.translation[kept])
    assert not np.allclose(after.rotation[60], before.rotation[60])
    report = json.loads(take.with_name("take.between.json").read_text())
    assert [gap["frames"] for gap in report["gaps"]] == ["11:40", "41:90"]
    assert report["verb"] == "between"


def test_an_action_is_told_to_what_fills_best_and_is_replayed(run, take):
    done = run("between", "take.bvh", "--keys", "10,40,90", "--action", "walk", "--json")
    assert done.json["method"] == "auto"
    assert {gap["method"] for gap in done.json["gaps"]} == {"base"}
    assert done.json["action"] == "walk"
    again = run("fill", "take.bvh", "--gaps", "take.between.json", "-o", "again.bvh")
    assert again.code == 0
    first, second = (take.with_name(name).read_bytes() for name in ("take.between.bvh", "again.bvh"))
    assert first == second


def test_a_joint_is_held_between_poses_of_several_files(run, take):
    """As it is in the first one, which is frame 0."""
    poses = ["between", "--start", "take.bvh#40", "--target", "take.bvh#60", "--frames", "20", "--pin"]
    assert run(*poses, "LeftHand@1:8:@0").code == 0
    hand = load(take).skeleton.index("LeftHand")
    turned, placed = load(take.with_name("take.between.bvh")).kinematics()
    assert np.abs(placed[1:8, hand] - placed[0, hand]).max() < 0.001
    assert np.degrees(rotations.angle(turned[1:8, hand], turned[0, hand])).max() < 0.1
    assert "is missing itself" in run(*poses, "LeftHand@1:8:@9", "--force").err


def test_a_path_and_pins_between_keys_are_met_and_replayed(run, take):
    clip = load(take)
    placed, hand = clip.positions(), clip.skeleton.index("LeftHand")
    led, pinned = placed[30, 0] + [0.2, 0, 0], placed[60, hand] + [0, 0.15, 0]
    x, _, z = led / clip.source.unit
    path, pin = f"30:{x},{z}", "LeftHand@60:" + ",".join(map(str, pinned / clip.source.unit))
    done = run("between", "take.bvh", "--keys", "10,45,90", "--path", path, "--pin", pin, "--json")
    assert done.code == 0
    made = load(take.with_name("take.between.bvh")).positions()
    assert np.allclose(made[30, 0, [0, 2]], led[[0, 2]], atol=0.01)
    assert np.allclose(made[60, hand], pinned, atol=0.001)
    assert [gap["path"] is not None for gap in done.json["gaps"]] == [True, False]
    assert [gap["pins"] is not None for gap in done.json["gaps"]] == [False, True]
    assert run("fill", "take.bvh", "--gaps", "take.between.json", "-o", "again.bvh").code == 0
    first, second = (take.with_name(name).read_bytes() for name in ("take.between.bvh", "again.bvh"))
    assert first == second


def test_a_path_between_poses_of_files_counts_from_the_first(run, take):
    clip = load(take)
    where = clip.positions()[35, 0] + [0.1, 0, 0]
    x, _, z = where / clip.source.unit
    words = [
        "between",
        "--start",
        "take.bvh#20",
        "--target",
        "take.bvh#60",
        "--frames",
        "39",
        "-o",
        "led.bvh",
    ]
    assert run(*words, "--path", f"15:{x},{z}").code == 0
    assert np.allclose(load(take.with_name("led.bvh")).positions()[15, 0, [0, 2]], where[[0, 2]], atol=0.01)


def test_a_rest_pose_that_leads_a_file_is_no_target_but_by_its_number(run, take):
    clip = load(take)
    rotation = clip.rotation.copy()
    rotation[0] = clip.skeleton.rest_rotation
    save(clip.with_motion(rotation, clip.translation), take.with_name("led.bvh"))
    words = ["between", "--start", "take.bvh#60", "--frames", "20"]
    done = run(*words, "--target", "led.bvh", "-o", "one.bvh")
    assert done.code == 0
    assert "frame 1 is taken" in done.out
    assert np.allclose(load(take.with_name("one.bvh")).rotation[-1], rotation[1], atol=1e-5)
    assert "is taken" not in run(*words, "--target", "led.bvh#0", "-o", "two.bvh").out


def test_what_lies_beside_a_blocked_pose_tells_no_velocity(run, take):
    """In a file of keys another pose may follow at once: it is as if none did."""
    clip = load(take)
    rotation, translation = clip.rotation.copy(), clip.translation.copy()
    rotation[61:], translation[61:] = rotation[20], translation[20]
    translation[61:, 0, 0] += 2.0
    save(clip.with_motion(rotation, translation), take.with_name("keys.bvh"))
    save(clip.slice(0, 61), take.with_name("ends.bvh"))
    made = []
    for name in ("keys", "ends"):
        words = ["between", "--start", "take.bvh#30", "--target", f"{name}.bvh#60", "--frames", "30"]
        assert run(*words, "-o", f"to_{name}.bvh").code == 0
        made.append(load(take.with_name(f"to_{name}.bvh")).rotation)
    assert np.allclose(*made, atol=1e-6)


def test_an_unknown_action_is_refused_with_the_choices(run, take):
    done = run("between", "take.bvh", "--keys", "10,40", "--action", "wlk")
    assert done.code == 2
    assert "walk" in done.err
    assert run("between", "take.bvh", "--keys", "10,40", "--action", "walk", "--method", "linear").code == 2


def test_poses_of_several_files(run, take):
    poses = ["--start", "take.bvh#10", "--target", "take.bvh", "--anchor", "take.bvh#30@20"]
    assert run("between", *poses, "--frames", "44", "-o", "new.bvh", "--method", "spline").code == 0
    source, made = load(take), load(take.with_name("new.bvh"))
    assert len(made) == 46
    assert made.fps == source.fps
    for frame, was in ((0, 10), (20, 30), (45, 0)):
        assert np.array_equal(made.rotation[frame], source.rotation[was])
        assert np.array_equal(made.translation[frame], source.translation[was])


def test_poses_of_several_clips_in_python(run, take):
    """As on the command line: how it leaves and meets them, anchors, points and pins count from the first."""
    clip = load(take)
    hand = clip.positions()[75, clip.skeleton.index("LeftHand")] + [0.0, 0.05, 0.0]
    place = ",".join(f"{value / clip.source.unit:.9f}" for value in hand)
    words = ["--start", "take.bvh#60", "--target", "take.bvh#90", "--anchor", "take.bvh#70@10"]
    options = ["--frames", "1s", "--pin", f"LeftHand@20:{place}", "--player"]
    assert run("between", *words, *options, "-o", "new.bvh").code == 0
    pin = interpose.Pin("LeftHand", np.array([20]), hand[None])
    done = interpose.pose_to_pose(
        clip.slice(0, 61), clip.slice(90, len(clip)), "1s", {10: clip.slice(70, 71)}, pins=pin
    )
    assert len(done.clip) == 32
    assert np.allclose(done.clip.positions(), load(take.with_name("new.bvh")).positions(), atol=1e-4)
    assert np.linalg.norm(done.clip.positions()[20, clip.skeleton.index("LeftHand")] - hand) < 0.002
    for frame, was in ((0, 60), (10, 70), (31, 90)):
        assert np.array_equal(done.clip.rotation[frame], clip.rotation[was])


def test_rest_poses_at_ends_are_no_keys_in_python(take):
    clip = load(take).slice(20, 80)
    rotation = clip.rotation.copy()
    rotation[[0, -1]] = clip.skeleton.rest_rotation
    odd = clip.with_motion(rotation, clip.translation)
    made = interpose.pose_to_pose(odd, odd, 20, method="spline").clip
    assert np.array_equal(made.rotation[[0, -1]], rotation[[-2, 1]])


def test_files_tell_how_the_motion_leaves_and_meets_poses(run, take):
    """Put back into its take it goes on as that did: between lone poses it would set off from a stand."""
    done = run("between", "--start", "take.bvh#60", "--target", "take.bvh#90", "--frames", "29", "--json")
    assert [gap["frames"] for gap in done.json["gaps"]] == ["1:30"]
    truth, made = load(take).positions(), load(take.with_name("take.between.bvh")).positions()
    assert len(made) == 31
    assert np.array_equal(made[[0, -1]].round(6), truth[[60, 90]].round(6))
    back = np.concatenate([truth[:60], made, truth[91:]])
    jumps = np.linalg.norm(back[2:] - 2 * back[1:-1] + back[:-2], axis=-1).max(axis=1)
    assert jumps[58:60].max() < 2 * jumps[30:55].max()
    assert jumps[88:90].max() < 2 * jumps[95:120].max()
    assert 100 * np.linalg.norm(made - truth[60:91], axis=-1).mean() < 6


def test_a_rest_pose_beside_a_pose_tells_nothing_of_its_motion(run, data, tmp_path):
    """As the first frame of CMU's files."""
    walk = load(data / "cmu_walk.bvh")
    rotation = walk.rotation.copy()
    rotation[0] = walk.skeleton.rest_rotation
    save(walk.with_motion(rotation, walk.translation), tmp_path / "walk.bvh")
    save(walk.slice(1, len(walk)), tmp_path / "cut.bvh")
    for name, start in (("walk", 1), ("cut", 0)):
        poses = ["--start", f"{name}.bvh#{start}", "--target", "cut.bvh#40", "--frames", "30"]
        assert run("between", *poses, "-o", f"{name}.new.bvh").code == 0
    one, other = (load(tmp_path / f"{name}.new.bvh").positions() for name in ("walk", "cut"))
    assert np.abs(one - other).max() < 1e-3


def test_a_length_is_proposed_with_its_reason(run, take):
    """As long as the walk itself took for the way, about."""
    done = run(
        "between", "--start", "take.bvh#20", "--target", "take.bvh#80", "--frames", "auto", "-o", "a.bvh"
    )
    assert done.code == 0
    assert "m/s" in done.out
    assert 40 <= len(load(take.with_name("a.bvh"))) - 2 <= 80
    same = ("between", "--start", "take.bvh#20", "--target", "take.bvh#20", "-o", "b.bvh")
    assert run(*same).code == 0
    assert len(load(take.with_name("b.bvh"))) == 3


def test_a_proposal_begins_at_the_last_anchor(run, take):
    poses = ["--start", "take.bvh#20", "--anchor", "take.bvh#60@90", "--target", "take.bvh#80"]
    done = run("between", *poses, "-o", "a.bvh", "--method", "spline")
    assert done.code == 0
    assert "after the anchor at 90" in done.out
    made, source = load(take.with_name("a.bvh")), load(take)
    assert 100 <= len(made) - 2 <= 120
    # The file may have other angles of the same turns.
    assert np.abs(made.rotation[[90, -1]] - source.rotation[[60, 80]]).max() < 1e-12


def test_a_target_of_another_body_stands_on_the_floor(run, take):
    """A body twice as large, whose pose comes back on the one that the motion begins with."""
    source = load(take)
    skeleton = replace(source.skeleton, rest_translation=2 * source.skeleton.rest_translation)
    large = replace(source, skeleton=skeleton, translation=2 * source.translation, source=None)
    save(large, take.with_name("large.bvh"))
    run("between", "--start", "take.bvh#20", "--target", "large.bvh#80", "--frames", "30", "-o", "a.bvh")
    made = load(take.with_name("a.bvh"))
    assert made.root[-1, 1] == pytest.approx(source.root[80, 1], abs=1e-4)
    assert np.allclose(made.rotation[-1], source.rotation[80], atol=1e-5)


def test_a_target_that_lies_still_on_another_body_is_met_at_rest(run, take):
    """Frames of its file lie where the pose is laid, however far it is from where that file begins."""
    source = load(take)
    skeleton = replace(source.skeleton, rest_translation=1.1 * source.skeleton.rest_translation)
    translation = 1.1 * source.translation
    translation[60:] = translation[60]
    rotation = source.rotation.copy()
    rotation[60:] = rotation[60]
    save(
        replace(source, skeleton=skeleton, translation=translation, rotation=rotation, source=None),
        take.with_name("large.bvh"),
    )
    done = run(
        "between", "--start", "take.bvh#20", "--target", "large.bvh#90", "--frames", "60", "-o", "a.bvh"
    )
    assert done.code == 0
    steps = np.linalg.norm(np.diff(load(take.with_name("a.bvh")).root, axis=0), axis=1)
    assert steps[-1] * source.fps < 0.3


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["take.bvh"], "nothing between"),
        (["take.bvh", "--keys", "5,6"], "nothing between"),
        (["take.bvh", "--keys", "0,9000"], "no frame 9000"),
        (["take.bvh", "--keys", "0,ten"], "cannot read the frame ten"),
        (["take.bvh", "--keys", "0,9", "--start", "take.bvh"], "not clear"),
        (["--start", "take.bvh", "--frames", "5"], "not clear"),
        (["--start", "take.bvh", "--target", "take.bvh", "--frames", "0"], "cannot generate 0"),
        (["--start", "take.bvh", "--target", "take.bvh", "--frames", "1000000"], "cannot generate 1000000"),
        (["--start", "take.bvh#999", "--target", "take.bvh", "--frames", "5"], "no frame 999"),
        (["--start", "take.bvh", "--target", "take.bvh", "--frames", "5", "--anchor", "take.bvh@6"], "@6"),
        (["--start", "take.bvh", "--target", "none.bvh", "--frames", "5"], "none.bvh"),
        (
            [
                "--start",
                "take.bvh#0",
                "--target",
                "take.bvh",
                "--anchor",
                "take.bvh#9@5",
                "--anchor",
                "take.bvh#7@5",
            ],
            "cannot meet take.bvh#7 at frame 5",
        ),
    ],
)
def test_what_makes_no_sense_is_refused_in_three_lines(run, take, options, said):
    done = run("between", *options)
    assert done.code in (2, 3)
    assert len(done.err.splitlines()) == 3
    assert said in done.err
    assert not list(take.parent.glob("*.between.*"))


def test_files_are_described_as_they_are(run, take):
    done = run("between", "--start", "take.bvh#3", "--target", "take.bvh#60", "--frames", "20", "-o", "b.bvh")
    assert done.out.startswith(f"take.bvh: {len(load(take))} frames")
