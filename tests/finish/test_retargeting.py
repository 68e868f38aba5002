"""Motion on another skeleton: poses stay, ways go by the legs, feet stand where they stood."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import interpose
from interpose.clip import Clip, Skeleton
from interpose.errors import RequestError
from interpose.finish import on_rig_of, penetration, retarget, retargeting
from interpose.geometry import rotations
from interpose.observation.timeline import Placement
from interpose.skeletons import JOINTS, find_humanoid, find_mapping
from interpose.skeletons.carrier import carriers


@pytest.fixture(scope="module")
def hands() -> Clip:
    """A walk of a rig with fingers: 65 joints, other names, bones and local axes than CMU's."""
    return interpose.load(Path(interpose.__file__).parent / "examples" / "fingers.bvh")


def test_there_and_back_it_is_the_same_motion(cmu_walk, hands):
    there = retarget(cmu_walk, hands)
    assert there.skeleton is hands.skeleton
    assert len(there) == len(cmu_walk)
    back = retarget(there, cmu_walk)
    mapped = list(find_mapping(cmu_walk.skeleton).mapped[1])
    away = np.linalg.norm(back.positions() - cmu_walk.positions(), axis=-1)[:, mapped]
    assert away.mean() < 0.01


def test_bodies_hold_themselves_alike_and_toes_go_by_the_legs(cmu_walk, hands):
    there = retarget(cmu_walk, hands)
    one, two = find_humanoid(cmu_walk), find_humanoid(hands)
    upper = [JOINTS.index(name) for name in ("Spine2", "LeftArm", "RightForeArm")]
    apart = np.degrees(rotations.angle(one.rotations(cmu_walk), two.rotations(there)))
    assert apart[:, upper].max() < 1e-4
    assert apart[:, 0].max() < 5, "hips lean the trunk as it leans"
    before, after = (body.positions(clip) * body.scale for body, clip in ((one, cmu_walk), (two, there)))
    neck = [points[:, JOINTS.index("Head")] - points[:, JOINTS.index("Neck")] for points in (before, after)]
    assert np.degrees(rotations.angle(rotations.identity(), rotations.between(*neck))).max() < 0.1
    toes = [JOINTS.index("LeftToe"), JOINTS.index("RightToe")]
    off = np.abs(np.diff(after[:, toes], axis=0) - np.diff(before[:, toes], axis=0))
    assert np.median(off) < 1e-4, "what stands, stands"
    assert off.max() < 5e-3, "but for legs that are as good as straight"


def test_bodies_stand_on_the_floor_whatever_they_do_and_wherever_the_rig_is(cmu_walk, hands):
    """A rig of one pose with its hips at the origin, and a motion on a box, change nothing."""
    low = retarget(cmu_walk, hands).positions()
    rest = np.broadcast_to(hands.skeleton.rest_rotation, (1, len(hands.skeleton), 4))
    rig = hands.with_motion(rest, np.zeros((1, 1, 3)))
    assert np.abs(retarget(cmu_walk, rig).positions() - low)[..., 1].max() < 0.04
    ratio = find_mapping(hands.skeleton).leg_length / find_mapping(cmu_walk.skeleton).leg_length
    on_a_box = Placement(shift=(0.0, 0.5, 0.0)).of(cmu_walk, carriers(cmu_walk))
    raised = retarget(on_a_box, hands).positions() - low
    assert np.abs(raised[..., 1] - 0.5 * ratio).max() < 0.03
    toes = [find_mapping(hands.skeleton)[name] for name in ("LeftToe", "RightToe")]
    stands = [np.percentile(p[:, toes, 1], 20) for p in (low, hands.positions())]
    assert stands[0] == pytest.approx(stands[1], abs=0.015)


def test_a_part_of_a_clip_is_where_it_is_in_the_whole(cmu_walk, hands):
    """But for the floor point over which it begins."""
    whole, part = retarget(cmu_walk, hands).positions(), retarget(cmu_walk.slice(100, 160), hands).positions()
    apart = whole[100:160] - part
    assert np.abs(apart - apart[0, 0] * [1.0, 0.0, 1.0]).max() < 0.02


def test_hips_sink_before_legs_are_torn_straight(cmu_walk, hands):
    """A rig that stands higher on its toes, of which the legs would have to be longer."""
    bones = hands.skeleton.rest_translation.copy()
    toes = [find_mapping(hands.skeleton)[name] for name in ("LeftToe", "RightToe")]
    bones[toes] *= 1.8
    made = retarget(cmu_walk, replace(hands, skeleton=replace(hands.skeleton, rest_translation=bones)))
    placed = made.positions()
    mapping = find_mapping(made.skeleton)
    for side in ("Left", "Right"):
        hip, knee, ankle = (placed[:, mapping[side + part]] for part in ("UpLeg", "Leg", "Foot"))
        way, bent = np.linalg.norm(ankle - hip, axis=-1), np.linalg.norm(knee - hip, axis=-1)
        assert (way / (bent + np.linalg.norm(ankle - knee, axis=-1))).max() < 0.9999
    own = np.linalg.norm(np.diff(cmu_walk.positions(), 2, axis=0), axis=-1).max()
    assert np.linalg.norm(np.diff(placed, 2, axis=0), axis=-1).max() < 1.5 * own


def on_the_belly(clip: Clip) -> Clip:
    """The same motion of a body that lies: turned by a quarter, its lowest joint 5 cm above the floor."""
    body = find_humanoid(clip)
    down = rotations.about("X", np.array(np.pi / 2))
    turned = rotations.multiply(down, body.rotations(clip))
    lying = body.to_clip(turned, body.root(clip), clip)
    moved = lying.translation.copy()
    moved[:, 0, 1] += 0.05 - lying.positions()[..., 1].min(axis=1)
    return lying.with_motion(lying.rotation, moved)


def test_who_lies_goes_neither_through_the_floor_nor_sinks(cmu_walk, hands):
    """On a rig with arms that are half as long again."""
    bones, mapping = hands.skeleton.rest_translation.copy(), find_mapping(hands.skeleton)
    bones[[mapping[side + part] for side in ("Left", "Right") for part in ("ForeArm", "Hand")]] *= 1.5
    rig = replace(hands, skeleton=replace(hands.skeleton, rest_translation=bones))
    lying = on_the_belly(cmu_walk)
    one, made = find_humanoid(lying), retarget(lying, rig)
    two = find_humanoid(made)
    before, after = (body.positions(clip) * body.scale for body, clip in ((one, lying), (two, made)))
    trunk = [JOINTS.index(name) for name in ("Hips", "Spine2", "LeftHand", "RightHand", "LeftForeArm")]
    near = before[:, trunk, 1] < 0.1
    assert near.any()
    assert (after[:, trunk, 1] - np.minimum(before[:, trunk, 1], 0.1)).min() > -0.03
    hips = JOINTS.index("Hips")
    assert np.abs((after - before)[:, hips, 1]).mean() < 0.03


def test_it_follows_turns_and_ways_of_the_motion(cmu_walk, hands):
    placement = Placement(0.7, (30.0, 0.0, -40.0))
    moved = placement.of(cmu_walk, carriers(cmu_walk))
    placed = placement.of(retarget(cmu_walk, hands), carriers(hands))
    assert np.allclose(retarget(moved, hands).positions(), placed.positions(), atol=1e-5)


def test_it_begins_over_the_same_floor_point(cmu_walk, hands):
    """On another rig and on a smaller body of its own, and the way from there goes by the legs."""
    far = Placement(shift=(30.0, 0.0, 40.0)).of(cmu_walk, carriers(cmu_walk))
    child = replace(far.skeleton, rest_translation=0.5 * far.skeleton.rest_translation)
    for like in (hands, replace(far, skeleton=child, translation=0.5 * far.translation)):
        ratio = find_mapping(like.skeleton).leg_length / find_mapping(far.skeleton).leg_length
        before, after = (
            clip.positions()[:, find_mapping(clip.skeleton)["Hips"]][:, [0, 2]]
            for clip in (far, retarget(far, like))
        )
        assert np.allclose(after[0], before[0], atol=1e-9)
        assert np.abs(after - after[0] - ratio * (before - before[0])).max() < 0.05


def test_fingers_keep_their_mean_pose(cmu_walk, hands):
    there = retarget(cmu_walk, hands)
    finger = hands.skeleton.index("mixamorig:LeftHandIndex2")
    assert np.ptp(there.rotation[:, finger], axis=0).max() < 1e-12


def test_fingers_of_one_name_that_rest_alike_move_along(hands):
    """Of a rig that is the same but for its feet; those that rest otherwise stay."""
    skeleton = hands.skeleton
    names = ["mixamorig:LeftHandIndex2", "mixamorig:RightHandIndex2"]
    left, right = (skeleton.index(name) for name in names)
    bend = rotations.about("Z", np.sin(np.arange(len(hands)) / 5))
    moving = hands.rotation.copy()
    for finger in (left, right):
        moving[:, finger] = rotations.multiply(moving[:, finger], bend)
    bones = skeleton.rest_translation.copy()
    toes = [find_mapping(skeleton)[side + "Toe"] for side in ("Left", "Right")]
    tilted = rotations.about("X", np.array(np.radians(25.0)))
    bones[toes] = rotations.rotate(tilted, bones[toes])
    bones[right] = rotations.rotate(rotations.about("Z", np.array(np.radians(40.0))), bones[right])
    other = replace(hands, skeleton=replace(skeleton, rest_translation=bones))
    there = retarget(hands.with_motion(moving, hands.translation), other)
    assert np.allclose(there.rotation[:, left], moving[:, left])
    assert np.ptp(there.rotation[:, right], axis=0).max() < 1e-12


def test_a_root_goes_along_if_it_does_so_there(cmu_walk, hands):
    """Game engines hang the hips from a root on the floor; with root motion it goes where the body goes."""
    skeleton = hands.skeleton
    parents = (-1, *(parent + 1 for parent in skeleton.parents))
    rest = np.concatenate([np.zeros((1, 3)), skeleton.rest_translation])
    rigged = Skeleton(("root", *skeleton.names), parents, rest)
    hips = hands.positions()[:, 0]
    floor = hips * [1.0, 0.0, 1.0]
    rotation = np.concatenate([np.tile([1.0, 0, 0, 0], (len(hands), 1, 1)), hands.rotation], axis=1)
    like = Clip(rigged, rotation, np.stack([floor, hips - floor], axis=1), hands.fps, (0, 1))
    made = retarget(cmu_walk, like).positions()
    assert np.abs((made[:, 0] - made[:, 1])[:, [0, 2]]).max() < 1e-3
    assert np.ptp(made[:, 0], axis=0).max() > 1.0


def test_clips_of_one_rig_keep_their_own_rotations(cmu_walk, hands, data):
    run = interpose.load(data / "cmu_run.bvh")
    assert on_rig_of(run, cmu_walk) is run
    assert np.array_equal(retarget(hands, hands).rotation, hands.rotation)
    assert np.array_equal(retarget(run, cmu_walk).rotation, run.rotation)


def test_what_is_no_humanoid_is_refused(cmu_walk):
    chain = Skeleton(("a", "b", "c"), (-1, 0, 1), np.eye(3))
    snake = Clip(chain, np.tile([1.0, 0, 0, 0], (4, 3, 1)), np.zeros((4, 1, 3)), 30.0, (0,))
    with pytest.raises(RequestError, match="another skeleton"):
        on_rig_of(snake, cmu_walk)
    with pytest.raises(RequestError, match="another skeleton") as caught:
        retarget(snake, cmu_walk)
    assert "no humanoid" in caught.value.why


def test_a_left_handed_rig_moves_as_well(cmu_walk, hands):
    """Written with left-handed axes a body is its own mirror image."""
    from interpose.skeletons.humanoid import reflect

    mirrored = reflect(hands)
    skeleton = replace(mirrored.skeleton, roles={"hand": "left"})
    left = replace(mirrored, skeleton=skeleton)
    there, right = retarget(cmu_walk, left), retarget(cmu_walk, hands)
    assert np.allclose(there.positions() * [-1.0, 1.0, 1.0], right.positions(), atol=1e-6)


def test_clips_without_frames_are_refused(cmu_walk, hands):
    for clip, like in ((cmu_walk.slice(0, 0), hands), (cmu_walk, hands.slice(0, 0))):
        with pytest.raises(RequestError, match="another rig") as caught:
            retarget(clip, like)
        assert "no frames" in caught.value.why
    assert len(retarget(cmu_walk.slice(0, 1), hands.slice(0, 1))) == 1


@pytest.mark.parametrize("fps", [15.0, 120.0])
def test_motion_at_another_rate_is_brought_onto_a_rig(cmu_walk, hands, fps):
    """As that of CMU onto LAFAN1's: at its own rate, and stitched at that of the first."""
    other = hands
    quick = interpose.resample(cmu_walk, fps)
    mine = retarget(quick, other)
    assert (mine.fps, len(mine)) == (fps, len(quick))
    assert retarget(other, quick).fps == other.fps
    joined = interpose.stitch(
        [cmu_walk.slice(0, 60), interpose.resample(other, fps)], 10, method="spline"
    ).clip
    assert joined.fps == cmu_walk.fps


@pytest.mark.parametrize("joint", ["LowerBack", "Spine"])
def test_who_bows_bows_as_far_on_a_rig_that_bends_elsewhere(cmu_walk, hands, joint):
    """CMU's back bends at the hips, another one's at the waist."""
    rotation, back = cmu_walk.rotation.copy(), cmu_walk.skeleton.index(joint)
    rotation[:, back] = rotations.multiply(rotations.about("X", np.radians(50.0)), rotation[:, back])
    bowed, leans = cmu_walk.with_motion(rotation, cmu_walk.translation), []
    for clip in (bowed, retarget(bowed, hands)):
        body = find_humanoid(clip)
        placed = body.positions(clip)
        trunk = placed[:, JOINTS.index("Neck")] - placed[:, [1, 5]].mean(axis=1)
        leans.append(rotations.normalize(trunk))
    apart = np.degrees(np.arccos(np.clip((leans[0] * leans[1]).sum(axis=1), -1, 1)))
    assert apart.max() < 3.0, apart.max()


def test_forearms_stay_out_of_a_body_whose_shoulders_are_narrower(cmu_walk, hands):
    """As far as they did in the motion that is brought; and hands are not jerked for it."""
    rest = hands.skeleton.rest_translation.copy()
    for side in ("Left", "Right"):
        rest[find_mapping(hands.skeleton)[f"{side}Arm"]] *= 0.2
    narrow = replace(hands, skeleton=replace(hands.skeleton, rest_translation=rest), source=None)
    found = []
    for clear in (False, True):
        with pytest.MonkeyPatch.context() as patch:
            if not clear:
                patch.setattr(retargeting, "cleared", lambda clip, *_: clip)
            there = retarget(cmu_walk, narrow)
        pairs, deep = penetration.depths(there.skeleton, there.positions())
        arms = [row for row, pair in enumerate(pairs) if "forearm" in pair[0] and "forearm" not in pair[1]]
        hand = there.positions()[:, find_mapping(there.skeleton)["LeftHand"]]
        found.append((deep[:, arms].max(), np.abs(np.diff(hand, 2, axis=0)).max()))
    assert found[0][0] > 0.02
    assert found[1][0] < 0.008
    assert found[1][1] < 1.3 * found[0][1]
