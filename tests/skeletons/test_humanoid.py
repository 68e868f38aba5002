"""Canonical rotations: exact there and back, and the same numbers for the same motion on any skeleton."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.skeletons import rigs

from interpose import tasks
from interpose.clip import Clip
from interpose.errors import RequestError
from interpose.geometry import rotations
from interpose.observation import Gap
from interpose.skeletons import (
    BONES,
    JOINTS,
    PARENTS,
    SIDES,
    canonical_positions,
    find_humanoid,
    find_mapping,
    humanoid,
)
from interpose.skeletons.body import facing
from interpose.skeletons.humanoid import reflect
from interpose.skeletons.mirror import mirror
from interpose.skeletons.rest import find_rest

TOES = ("LeftToe", "RightToe")

HEAPS = ("unreal", "vicon", "makehuman", "rigify", "rigify_root")  # rigs whose zero pose is none


def degrees(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.degrees(rotations.angle(a, b))


@pytest.fixture(scope="module")
def walk(cmu_walk):  # type: ignore[no-untyped-def]
    return replace(cmu_walk, source=None)


@pytest.mark.parametrize("rig", ["cmu", *rigs.RIGS])
def test_there_and_back_is_exact(walk, rig):
    clip = walk if rig == "cmu" else rigs.build(rig, walk)[0]
    body = find_humanoid(clip)
    back = body.to_clip(body.rotations(clip), body.root(clip), clip)
    assert rotations.angle(back.rotation, clip.rotation).max() < 1e-5
    assert np.abs(back.positions() - clip.positions()).max() < 1e-9


@pytest.mark.parametrize("rig", [rig for rig in rigs.RIGS if rig not in (*HEAPS, "biped", "child")])
def test_the_same_motion_is_the_same_numbers(walk, rig):
    """Rigs that stand in a T-pose, an A-pose or with arms down give CMU's own canonical rotations."""
    clip, _ = rigs.build(rig, walk)
    body = find_humanoid(clip)
    assert body.rest.how == "zero pose"
    apart = degrees(body.rotations(clip), find_humanoid(walk).rotations(walk))
    assert apart.max() < (0.1 if body.mapping["Spine1"] is not None else 10)


@pytest.mark.parametrize("rig", HEAPS)
def test_the_motion_tells_the_t_pose_where_the_zero_pose_is_none(walk, rig):
    """Limbs within ten degrees, the curve of the back and the tilt of the head within fifteen."""
    clip, _ = rigs.build(rig, walk)
    body = find_humanoid(clip)
    assert body.rest.pose == "none"
    assert body.rest.how == "motion"
    apart = degrees(body.rotations(clip), find_humanoid(walk).rotations(walk)).mean(axis=0)
    limbs = [j for j, name in enumerate(JOINTS) if name.endswith(("Leg", "Foot", "Arm"))]
    assert apart[limbs].max() < 10
    assert apart.max() < 16


@pytest.mark.parametrize("rig", HEAPS)
def test_a_first_frame_that_is_a_t_pose_tells_it(walk, rig):
    """As files of rigs begin, and takes of some programs: better than what is worked out of the motion."""
    rotation = walk.rotation.copy()
    rotation[0] = walk.skeleton.rest_rotation
    clip, _ = rigs.build(rig, walk.with_motion(rotation, walk.translation))
    for some in (clip, clip.slice(0, 1)):
        body = find_humanoid(some)
        assert body.rest.how == "frame 0"
        apart = degrees(body.rotations(clip), find_humanoid(walk).rotations(walk))[1:]
        assert apart.max() < (0.1 if body.mapping["Spine1"] is not None else 10)


def test_in_the_t_pose_all_is_identity(walk):
    """A skeleton posed as its own T-pose says: no canonical rotation, bones along the axes."""
    clip, _ = rigs.build("character_creator", walk)
    body = find_humanoid(clip)
    still = np.tile([1.0, 0, 0, 0], (1, 22, 1))
    posed = body.to_clip(still, np.array([[0, 1.0, 0]]), clip.slice(0, 1))
    points = body.positions(posed)[0]
    arm = points[JOINTS.index("LeftHand")] - points[JOINTS.index("LeftArm")]
    leg = points[JOINTS.index("RightFoot")] - points[JOINTS.index("RightUpLeg")]
    assert rotations.normalize(arm)[0] > 0.999
    assert rotations.normalize(leg)[1] < -0.999
    assert abs(float(facing(points[None])[0])) < 0.05


@pytest.mark.parametrize("rig", ["smpl", "unreal"])
def test_turned_moved_and_scaled_motion(walk, rig):
    clip, _ = rigs.build(rig, walk)
    body, yaw = find_humanoid(clip), rotations.about("Y", np.array(0.8))
    root = list(clip.skeleton.roots)
    rotation, translation = clip.rotation.copy(), rotations.rotate(yaw, clip.translation)
    rotation[:, root] = rotations.multiply(yaw, rotation[:, root])
    if len(clip.translated) > 1:
        translation[:, 1:] = clip.translation[:, 1:]
    turned = clip.with_motion(rotation, translation)
    expected = rotations.multiply(yaw, body.rotations(clip))
    assert degrees(find_humanoid(turned).rotations(turned), expected).max() < 1e-3
    bigger = replace(
        clip,
        skeleton=replace(clip.skeleton, rest_translation=2.5 * clip.skeleton.rest_translation),
        translation=2.5 * clip.translation,
    )
    assert degrees(find_humanoid(bigger).rotations(bigger), body.rotations(clip)).max() < 1e-3
    assert find_humanoid(bigger).scale == pytest.approx(body.scale / 2.5)


def test_a_mirrored_clip_is_the_mirrored_humanoid(walk):
    body = find_humanoid(walk)
    own, other = body.rotations(walk), find_humanoid(mirror(walk)).rotations(mirror(walk))
    assert degrees(other, own[:, list(SIDES)] * [1, 1, -1, -1]).max() < 2


def test_forward_kinematics_of_the_humanoid(walk):
    """Bones, rotations and hips give back the joints, up to what moves between them (CMU's Neck)."""
    body = find_humanoid(walk)
    placed = canonical_positions(body.rotations(walk), body.root(walk), body.bones)
    assert np.linalg.norm(placed - body.positions(walk), axis=-1).max() < 0.02
    still = canonical_positions(np.tile([1.0, 0, 0, 0], (1, 22, 1)), np.zeros((1, 3)), BONES)[0]
    assert still[JOINTS.index("LeftHand")] == pytest.approx([0.755, 0.515, -0.041], abs=1e-3)


@pytest.mark.parametrize("rig", ["child", "optitrack"])
def test_derived_joints_are_where_they_would_be(walk, rig):
    clip, _ = rigs.build(rig, walk)
    body = find_humanoid(clip)
    points = body.positions(clip) * body.scale
    toes = points[:, [JOINTS.index("LeftToe"), JOINTS.index("RightToe")]]
    ankles = points[:, [JOINTS.index("LeftFoot"), JOINTS.index("RightFoot")]]
    assert 0.05 < np.linalg.norm(toes - ankles, axis=-1).mean() < 0.25
    assert (toes[..., 1].min(axis=1) < ankles[..., 1].min(axis=1) + 0.03).mean() > 0.9
    ahead = np.stack([np.sin(facing(points)), np.zeros(len(points)), np.cos(facing(points))], axis=-1)
    assert (((toes - ankles) * ahead[:, None]).sum(-1) > 0).mean() > 0.9
    trunk = points[:, [JOINTS.index(n) for n in ("Hips", "Spine", "Spine1", "Spine2", "Head")], 1]
    assert (np.diff(trunk, axis=1) > 0).mean() > 0.95


def test_a_frame_may_be_the_rest_pose(walk):
    """In front of the motion stands an A-pose, in a rig whose zero pose is none."""
    clip, _ = rigs.build("vicon", walk)
    body = find_humanoid(clip)
    pose = np.tile([1.0, 0, 0, 0], (1, 22, 1))
    for side, sign in (("Left", -1), ("Right", 1)):
        for part in ("Arm", "ForeArm", "Hand"):
            pose[0, JOINTS.index(side + part)] = rotations.about("Z", np.array(sign * 0.7))
    rest = body.to_clip(pose, np.array([[0, 1.0, 0]]), clip.slice(0, 1))
    longer = clip.with_motion(
        np.concatenate([rest.rotation, clip.rotation]), np.concatenate([rest.translation, clip.translation])
    )
    found = find_rest(body.mapping, longer, frame=0)
    assert found.pose == "A"
    assert found.how == "frame 0"
    assert degrees(found.rotation, body.rest.rotation).max() < 8
    heels = longer.positions()[:, body.mapping["LeftFoot"], 1]
    with pytest.raises(RequestError, match="no rest pose"):
        find_rest(body.mapping, longer, frame=int(np.argmax(heels)))
    with pytest.raises(RequestError, match="no frame 999"):
        find_rest(body.mapping, longer, frame=999)


def test_what_cannot_be_known_is_said(walk):
    clip, _ = rigs.build("vicon", walk)
    with pytest.raises(RequestError, match="no motion to tell it"):
        find_rest(find_mapping(clip.skeleton))
    legless = replace(walk.skeleton, roles={"LeftLeg": ""})
    with pytest.raises(RequestError, match="no joints for LeftLeg"):
        find_rest(find_mapping(legless))


def test_a_clip_of_one_frame(walk):
    one: Clip = rigs.build("vicon", walk)[0].slice(30, 31)
    body = find_humanoid(one)
    assert np.isfinite(body.rotations(one)).all()
    assert np.isfinite(body.bones).all()


@pytest.mark.parametrize("rig", ["smpl", "unreal", "child"])
def test_left_handed_files_are_seen_in_a_mirror(walk, rig):
    """The same take written by a program with left-handed axes: the same numbers, and exact back."""
    clip, _ = rigs.build(rig, walk)
    written = reflect(clip)
    body = find_humanoid(written)
    assert body.left_handed
    assert not find_humanoid(clip).left_handed
    assert degrees(body.rotations(written), find_humanoid(clip).rotations(clip)).max() < 1e-3
    back = body.to_clip(body.rotations(written), body.root(written), written)
    assert rotations.angle(back.rotation, written.rotation).max() < 1e-6


@pytest.mark.parametrize("rig", ["smpl", "unreal"])
def test_a_left_handed_rest_pose_is_known_by_its_toes(walk, rig):
    """What `convert --onto` is given: straight knees bend neither way."""
    clip, _ = rigs.build(rig, walk)
    still = np.tile([1.0, 0, 0, 0], (1, 22, 1))
    pose = find_humanoid(clip).to_clip(still, np.array([[0, 1.0, 0]]), clip.slice(0, 1))
    written = reflect(pose)
    assert not find_humanoid(pose).left_handed
    assert humanoid.inside_out(find_mapping(written.skeleton), written) == "its toes point backwards"
    reference = find_humanoid(pose).rotations(pose)
    assert degrees(find_humanoid(written).rotations(written), reference).max() < 1e-3


def test_a_left_handed_take_is_filled_as_its_mirror_image(walk):
    clip, _ = rigs.build("smpl", walk)
    one, other = (tasks.fill(c, [Gap(60, 90)], "cae") for c in (clip, reflect(clip)))
    assert other.report.gaps[0].method == "cae"
    assert np.abs(reflect(other.clip).positions() - one.clip.positions()).max() < 0.01


def test_what_looks_mirrored_either_way_comes_to_an_end(walk, monkeypatch):
    """As rotations in the order x, y, z, w do: knees bend forward in the clip and in its mirror image."""
    monkeypatch.setattr(humanoid, "inside_out", lambda *of: "its knees bend forward")
    body = find_humanoid(walk)
    assert body.left_handed
    back = body.to_clip(body.rotations(walk), body.root(walk), walk)
    assert rotations.angle(back.rotation, walk.rotation).max() < 1e-6


def test_a_rest_frame_of_a_left_handed_take(walk):
    """The frame is looked at in the mirror, too."""
    clip, _ = rigs.build("smpl", walk)
    still = np.tile([1.0, 0, 0, 0], (1, 22, 1))
    pose = find_humanoid(clip).to_clip(still, np.array([[0, 1.0, 0]]), clip.slice(0, 1))
    longer = clip.with_motion(
        np.concatenate([pose.rotation, clip.rotation]), np.concatenate([pose.translation, clip.translation])
    )
    body = find_humanoid(reflect(longer), frame=0)
    assert body.left_handed
    assert degrees(body.rotations(reflect(longer))[0], still[0]).max() < 1


def test_frames_of_walking_are_no_rest_poses(walk):
    mapping = find_mapping(walk.skeleton)

    def fits(frame: int) -> bool:
        try:
            find_rest(mapping, walk, frame)
        except RequestError:
            return False
        return True

    assert np.mean([fits(frame) for frame in range(0, len(walk), 5)]) < 0.1


def test_lost_legs_neither_mirror_nor_sink_the_body(walk):
    """What is not observed says nothing of handedness, and nothing of the floor."""
    for joints in (("LeftLeg", "RightLeg"), ("LeftUpLeg", "RightUpLeg")):
        done = tasks.recover(walk, joints, method="cae")
        assert {gap.method for gap in done.report.gaps} == {"spline"}
        assert "where the floor is" in " ".join(done.report.gaps[0].notes)
    part = tasks.recover(walk, ("LeftLeg", "RightLeg"), (60, 120), method="cae")
    assert {gap.method for gap in part.report.gaps} == {"cae"}
    wrong = np.linalg.norm(part.clip.positions() - walk.positions(), axis=-1)
    assert wrong[60:120].mean() < 0.05
    one = tasks.recover(walk, ("LeftLeg",), method="cae")
    assert np.linalg.norm(one.clip.positions() - walk.positions(), axis=-1).mean() < 0.05


def test_a_still_without_toes_says_nothing_of_handedness(walk):
    still = walk.with_motion(walk.rotation[:1].copy(), walk.translation[:1])
    still.rotation[:] = [1.0, 0, 0, 0]
    names = [name.replace("Toe", "Prop") for name in still.skeleton.names]
    still = replace(
        still, skeleton=replace(still.skeleton, names=tuple(names), roles=dict.fromkeys(TOES, ""))
    )
    assert not find_humanoid(still).left_handed
    assert not find_humanoid(reflect(still)).left_handed
    said = replace(still, skeleton=replace(still.skeleton, roles={"hand": "left"}))
    assert find_humanoid(said).left_handed


def test_what_is_no_humanoid_is_said(walk):
    headless = replace(walk, skeleton=replace(walk.skeleton, roles={"Hips": "", "Spine": ""}))
    with pytest.raises(RequestError, match="no humanoid"):
        find_humanoid(headless).root(headless)


@pytest.mark.parametrize("rig", ["cmu", "mixamo", "unreal", "child", "makehuman"])
def test_the_canonical_body_and_back(walk, rig):
    """The same motion on bones of one size, feet on the ground; and back onto the clip's own bones."""
    clip = walk if rig == "cmu" else rigs.build(rig, walk)[0]
    body = find_humanoid(clip)
    points = body.as_canonical(clip)
    away = np.linalg.norm(points[:, 1:] - points[:, PARENTS[1:]], axis=-1)
    assert np.allclose(away, np.linalg.norm(BONES, axis=-1)[1:], atol=1e-9), "everyone's bones"
    back = body.from_canonical(points, body.rotations(clip))
    assert np.linalg.norm(back - body.positions(clip), axis=-1).max() < 0.03 / body.scale
    assert np.linalg.norm(back - body.positions(clip), axis=-1).mean() < 2e-3 / body.scale
    feet = [JOINTS.index(side + end) for side in ("Left", "Right") for end in ("Foot", "Toe")]
    lowest = points[:, feet, 1].min(axis=1)
    own = (body.positions(clip) * body.scale)[:, feet, 1].min(axis=1)
    assert np.abs(lowest - own).max() < 0.12
    assert np.std(lowest - own) < 0.02


def test_a_t_pose_that_was_worked_out_does_not_matter_for_the_canonical_body(walk):
    """Rigs without a rest pose: bones point where the clip's do, whatever the T-pose was taken for."""
    clip, _ = rigs.build("vicon", walk)
    body = find_humanoid(clip)
    other = find_humanoid(clip, find_humanoid(clip.slice(60, 100)).rest)
    assert degrees(body.rest.rotation, other.rest.rotation).max() > 5
    assert np.abs(body.as_canonical(clip) - other.as_canonical(clip)).max() < 1e-6


def test_points_tell_the_pose_near_another_one(walk):
    """From a pose that is off by some degrees, bones come to point where they should."""
    body = find_humanoid(walk)
    points, turned = body.as_canonical(walk), body.rotations(walk)
    rng = np.random.default_rng(0)
    like = rotations.multiply(rotations.exp(rng.normal(0, 0.15, (1, 22, 3))), turned)
    found = body.from_canonical(points, like)
    assert np.linalg.norm(found - body.positions(walk), axis=-1).mean() < 0.02
