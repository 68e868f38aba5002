"""Limbs that were taken for each other: found, and put back to the last bit."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.skeletons.rigs import build

import interpose
from interpose import formats, tasks
from interpose.clip import Clip, Skeleton
from interpose.geometry import kinematics, rotations
from interpose.observation import exchange
from interpose.observation.exchange import Bend, Crossing, Exchange, Flip, exchanges, put_back
from interpose.observation.finding import to_gaps
from interpose.observation.scan import OR, scan
from interpose.skeletons import JOINTS, PARENTS, SIDES, find_humanoid

LEG, ARM = ("UpLeg", "Leg", "Foot", "ToeBase"), ("Shoulder", "Arm", "ForeArm", "Hand")


def swapped(clip, parts, *ranges):
    left, right = ([clip.skeleton.index(side + part) for part in parts] for side in ("Left", "Right"))
    rotation = clip.rotation.copy()
    for start, stop in ranges:
        rotation[start:stop, left + right] = clip.rotation[start:stop, right + left]
    return clip.with_motion(rotation, clip.translation)


@pytest.mark.parametrize("parts", [LEG, ARM])
@pytest.mark.parametrize("ranges", [[(60, 65)], [(80, 104)], [(60, 75), (120, 170)]])
def test_limbs_are_found_and_put_back_exactly(cmu_walk, parts, ranges):
    clip = cmu_walk.slice(1, 209)
    odd = swapped(clip, parts, *ranges)
    found = exchanges(odd)
    assert [(one.start, one.stop) for one in found] == ranges
    assert put_back(odd, found).rotation.tobytes() == clip.rotation.tobytes()
    said = [one for one in scan(odd) if one.kind == "exchanged"]
    assert [(one.start, one.stop) for one in said] == ranges
    assert to_gaps(said) == []


@pytest.mark.parametrize("ranges", [[(19, 25)], [(44, 50)], [(19, 25), (44, 50)], [(5, 19), (26, 40)]])
def test_an_exchange_may_end_where_legs_pass_each_other(data, ranges):
    """There it turns them little; the other end is sure. What lies between two of them stays."""
    clip = formats.load(data / "cmu_jump.bvh")
    clip = clip.slice(1, len(clip))
    odd = swapped(clip, LEG, *ranges)
    found = exchanges(odd)
    assert [(one.start, one.stop) for one in found] == ranges
    assert put_back(odd, found).rotation.tobytes() == clip.rotation.tobytes()


def whole_arms(clip, names, start, stop):
    """The clip with both arms, and all that hangs from them, on the other side in some frames; `names` are
    pairs of what is called left and right."""
    left, right = ([clip.skeleton.index(pair[side]) for pair in names] for side in (0, 1))
    rotation = clip.rotation.copy()
    rotation[start:stop, left + right] = clip.rotation[start:stop, right + left]
    return clip.with_motion(rotation, clip.translation)


CMU_ARM = [(f"Left{part}", f"Right{part}") for part in (*ARM, "FingerBase", "HandIndex1")] + [
    ("LThumb", "RThumb")
]


@pytest.mark.parametrize("part", [(60, 66), (60, 100), (40, 120)])
def test_hands_and_fingers_change_sides_with_their_arms(cmu_walk, part):
    """Wherever they go, none is left on the other side, and none is interpolated."""
    clip = cmu_walk.slice(1, 209)
    odd = whole_arms(clip, CMU_ARM, *part)
    thumb = clip.skeleton.index("LThumb")
    away = rotations.angle(odd.rotation[slice(*part), thumb], clip.rotation[slice(*part), thumb])
    assert away.max() > 0.5
    done = tasks.recover(odd)
    assert done.clip.rotation.tobytes() == clip.rotation.tobytes()
    assert {one.joint for one in done.report.exchanged} == {name for pair in CMU_ARM for name in pair}
    assert [done.report.gaps, done.report.moments, done.report.unpaired] == [[], (), ()]


def test_all_fingers_of_a_game_rig_change_sides():
    clip = formats.load(Path(interpose.__file__).parent / "examples" / "fingers.bvh")
    hand = [name for name in clip.skeleton.names if "LeftHand" in name]
    arm = ["mixamorig:Left" + part for part in ARM[:-1]]
    pairs = [(name, name.replace("Left", "Right")) for name in arm + hand]
    assert len(pairs) == 24
    found = exchanges(odd := whole_arms(clip, pairs, 70, 100))
    assert [(one.start, one.stop, len(one.joints)) for one in found] == [(70, 100, 48)]
    assert put_back(odd, found).rotation.tobytes() == clip.rotation.tobytes()


def test_fingers_that_stayed_on_their_side_stay(cmu_walk):
    """As where only the 22 joints that networks know changed sides."""
    clip = cmu_walk.slice(1, 209)
    (found,) = exchanges(swapped(clip, ARM, (60, 100)))
    assert {clip.skeleton.names[joint] for joint in found.joints} == {
        side + part for side in ("Left", "Right") for part in ARM
    }


def test_what_has_no_like_on_the_other_side_is_left_and_told(cmu_walk):
    clip = cmu_walk.slice(1, 209)
    names = tuple("Racket" if name == "LThumb" else name for name in clip.skeleton.names)
    clip = replace(clip, skeleton=replace(clip.skeleton, names=names), source=None)
    done = tasks.recover(whole_arms(clip, CMU_ARM[:-1], 60, 100))
    assert done.clip.rotation.tobytes() == clip.rotation.tobytes()
    assert done.report.unpaired == ("Racket", "RThumb")
    assert "left, without a like on the other side: Racket, RThumb" in str(done.report)
    assert done.report.to_dict()["unpaired"] == ["Racket", "RThumb"]


def test_recover_puts_them_back_and_says_so(cmu_walk):
    clip = cmu_walk.slice(1, 209)
    done = tasks.recover(swapped(clip, LEG, (80, 104)))
    others = {one.joint for one in done.report.moments}
    kept = [joint for joint, name in enumerate(clip.skeleton.names) if name not in others]
    assert np.array_equal(done.clip.rotation[:, kept], clip.rotation[:, kept])
    assert {one.joint for one in done.report.exchanged} == {
        s + part for s in ("Left", "Right") for part in LEG
    }
    assert all(one.frames == ("80:104",) for one in done.report.exchanged)
    assert "80:104" in str(done.report)
    assert (done.provenance[80:104, clip.skeleton.index("LeftLeg")] > 0).all()


def test_denoise_puts_them_back_and_says_so(cmu_walk):
    clip = cmu_walk.slice(1, 209)
    odd = swapped(clip, LEG, (80, 104))
    done = tasks.denoise(odd, frames=(50, 150))
    off = np.linalg.norm(done.clip.positions() - clip.positions(), axis=-1)
    assert off.max() < 0.03
    assert {at for one in done.report.exchanged for at in one.frames} == {"80:104"}
    assert "put back" in str(done.report)
    # What it says that joints moved is from what came to what comes back.
    moved = 100 * np.linalg.norm(done.clip.positions() - odd.positions(), axis=-1)[50:150]
    assert done.report.noise.moved_most == pytest.approx(moved.max(), rel=1e-6)
    assert done.report.noise.moved == pytest.approx(moved.mean(), rel=1e-6)
    assert tasks.denoise(odd, 0).clip.rotation.tobytes() == odd.rotation.tobytes()


def spells(clip, way, start, stop):
    """Where two thighs are found on the wrong side that are turned by `way` (F,) radians ahead and back, and
    are so in the frames start to stop - 1."""
    sides = tuple((clip.skeleton.index(side + "UpLeg"),) for side in ("Left", "Right"))
    rotation = np.repeat(clip.rotation[:1], len(way), axis=0)
    signs = np.ones(len(way))
    signs[start:stop] = -1
    for (joint,), sign in zip(sides, (1, -1)):
        rotation[:, joint] = rotations.about("X", sign * signs * way)
    held = clip.with_motion(rotation, np.repeat(clip.translation[:1], len(way), axis=0))
    return [(one.start, one.stop) for one in exchange._cuts(held, Exchange(0, 0, *sides))[0]]


@pytest.mark.parametrize(("turn", "found"), [(0.5, False), (0.7, True)])
def test_an_exchange_turns_joints_by_more_than_they_move(cmu_walk, turn, found):
    """By both together, in radians, at one end or both."""
    assert spells(cmu_walk, np.full(60, turn / 4), 20, 40) == [(20, 40)] * found


@pytest.mark.parametrize(("turn", "found"), [(0.07, False), (0.15, True)])
def test_the_other_end_of_an_exchange_may_turn_them_less(cmu_walk, turn, found):
    way = np.interp(np.arange(60), [22, 38], [0.25, turn / 4])
    assert spells(cmu_walk, way, 20, 40) == [(20, 40)] * found


@pytest.mark.parametrize(
    ("end", "share", "found"), [(20, 0.4, True), (20, 0.6, False), (40, 0.75, True), (40, 0.85, False)]
)
def test_an_exchange_that_is_undone_leaves_a_smaller_turn(cmu_walk, end, share, found):
    """At one end half of it at most, at the other four fifths: what is left is the legs' own motion."""
    beside = 0.3 * (1 - share) / (1 + share)
    way = np.where(np.arange(60) < end, 0.3, beside)
    # What begins with the smaller share ends with a turn that is none of the sure ones.
    if end == 20:
        way = np.interp(np.arange(60), [19, 20, 38], [0.3, beside, 0.05])
    assert spells(cmu_walk, way, 20, 40) == [(20, 40)] * found


@pytest.mark.parametrize(("seconds", "found"), [(2.9, True), (3.2, False)])
def test_of_long_exchanges_nobody_knows_which_side_is_wrong(cmu_walk, seconds, found):
    stop = 20 + round(seconds * cmu_walk.fps)
    assert spells(cmu_walk, np.full(150, 0.3), 20, stop) == [(20, stop)] * found


@pytest.mark.parametrize("name", ["cmu_walk.bvh", "cmu_run.bvh", "cmu_jump.bvh"])
def test_nothing_is_exchanged_in_real_clips(data, name):
    assert exchanges(formats.load(data / name)) == []


def test_what_changes_sides_for_good_is_left(cmu_walk):
    """Of one change alone nobody knows which side of it is the wrong one."""
    clip = cmu_walk.slice(1, 209)
    for start in range(10, 200, 10):
        assert exchanges(swapped(clip, LEG, (start, len(clip)))) == []


@pytest.mark.parametrize("limb", [LEG, ARM])
def test_what_changes_sides_for_good_is_put_back_where_somebody_says_that_it_is_wrong(data, limb):
    """From a frame on to the end, up to one from the beginning, or for longer than anybody could tell."""
    walk = formats.load(data / "cmu_walk.bvh").slice(1, 209)
    clip = walk.take([*range(208), *range(206, -1, -1)])
    for start, stop in ((150, 415), (0, 150), (100, 310)):
        odd = swapped(clip, limb, (start, stop))
        (told,) = [one for one in scan(odd) if one.kind == "exchanged"]
        assert {told.start, told.stop} - {415} == {start, stop} - {0, 415}
        assert OR in told.note
        assert not [one for one in scan(odd) if one.kind == "jump"]
        done = interpose.recover(odd, frames=(start, stop))
        assert np.array_equal(done.clip.rotation, clip.rotation)
        assert done.report.exchanged


@pytest.mark.parametrize(
    "limb", [("RightUpLeg", "RightLeg", "RightFoot"), ("LeftArm", "LeftForeArm", "LeftHand")]
)
@pytest.mark.parametrize("part", [(60, 64), (90, 150)])
def test_a_knee_that_bends_the_other_way_is_found_and_turned_back(cmu_walk, limb, part):
    """Ankle and foot are where they were: what interpolates the thigh alone throws them about."""
    clip = cmu_walk.slice(1, 209)
    joints = tuple(clip.skeleton.index(name) for name in limb)
    odd = put_back(clip, [Flip(*part, joints)])
    off = np.abs(odd.positions() - clip.positions())
    assert off[:, joints[2]].max() < 1e-9
    assert off[part[0] : part[1], joints[1]].max() > 0.02
    (found,) = exchanges(odd)
    assert (found.start, found.stop, found.kind) == (*part, "flipped")
    done = tasks.recover(odd)
    assert np.abs(done.clip.positions() - clip.positions())[:, joints].max() < 1e-9
    (said,) = [one for one in scan(odd) if one.kind == "flipped"]
    assert said.joints == (limb[0], limb[2])


@pytest.mark.parametrize("part", [(60, 80), (30, 150), (0, 208)])
@pytest.mark.parametrize("name", ["LeftLeg", "RightLeg"])
def test_a_knee_that_bends_the_wrong_way_by_itself_is_found_and_bent_back(cmu_walk, part, name):
    """For however long, as where a program loses signs; the bend that was put in is the one taken out."""
    clip = cmu_walk.slice(1, 209)
    knee, body = clip.skeleton.index(name), find_humanoid(clip)
    odd = put_back(clip, [Bend(*part, knee, body)])
    assert np.abs(odd.positions() - clip.positions()).max() > 0.3
    said = [one for one in scan(odd) if one.kind == "flipped"]
    assert {(one.joints, one.note) for one in said} == {((name,), "bends the wrong way")}
    done = interpose.recover(odd)
    off = np.linalg.norm(done.clip.positions() - clip.positions(), axis=-1)[:, knee:]
    assert off.max() < 0.25 * np.linalg.norm(odd.positions() - clip.positions(), axis=-1).max()
    assert off.mean() < 0.005
    assert [one.joint for one in done.report.exchanged] == [name]


def test_a_knee_that_bends_further_than_any_is_bent_back_where_it_jumps(cmu_walk):
    """A squat of 140 degrees; whoever squats past half a turn comes and goes without a jump."""
    clip = cmu_walk.slice(1, 209)
    knee, rotation = clip.skeleton.index("LeftLeg"), clip.rotation.copy()
    deeper = 2.0 * np.sin(np.pi * np.arange(208) / 207) ** 2
    rotation[:, knee] = rotations.multiply(rotation[:, knee], rotations.about("X", deeper))
    deep = clip.with_motion(rotation, clip.translation)
    odd = put_back(deep, [Bend(80, 120, knee, find_humanoid(deep))])
    (found,) = [one for one in exchanges(odd) if isinstance(one, Bend)]
    assert (found.start, found.stop, found.shin) == (80, 120, knee)
    assert not [one for one in exchanges(deep) if isinstance(one, Bend)]


def test_where_both_knees_bend_the_wrong_way_all_along_nothing_is_bent(cmu_walk):
    """It is rather the body that is taken to face backwards."""
    clip = cmu_walk.slice(1, 209)
    body, knees = find_humanoid(clip), [clip.skeleton.index(name) for name in ("LeftLeg", "RightLeg")]
    for start, stop in ((0, 208), (20, 190)):
        assert exchanges(put_back(clip, [Bend(start, stop, knee, body) for knee in knees])) == []


def test_where_the_motion_tells_how_knees_bend_nothing_is_bent(cmu_walk):
    """What is wrong for the most part would be right, and all else bent."""
    clip, _ = build("unreal", cmu_walk.slice(1, 209))
    body = find_humanoid(clip)
    assert body.rest.how == "motion"
    odd = put_back(clip, [Bend(40, 150, body.mapping["LeftLeg"], body)])
    assert exchanges(odd) == []


def test_a_bend_is_found_beside_arms_that_change_sides_and_put_back_in_part(cmu_walk):
    clip = cmu_walk.slice(1, 209)
    knee, body = clip.skeleton.index("LeftLeg"), find_humanoid(clip)
    odd = swapped(put_back(clip, [Bend(0, 208, knee, body)]), ARM, (60, 80))
    assert {(one.kind, one.start, one.stop) for one in exchanges(odd)} == {
        ("exchanged", 60, 80),
        ("flipped", 0, 208),
    }
    done = interpose.recover(put_back(clip, [Bend(0, 208, knee, body)]), frames=(20, 100)).clip
    off = np.linalg.norm(done.positions() - clip.positions(), axis=-1).max(axis=1)
    assert off[20:100].max() < 0.1
    assert off[100:].max() > 0.3


@pytest.fixture(scope="module")
def trial(data):
    """Of a skeleton whose left and right bones have axes of their own."""
    return formats.load(data / "cmu_02_03.amc", skeleton=data / "cmu_02.asf")


def crossed(clip, rows, start, stop):
    """The clip with canonical joints that point where those of the other side do, in some frames."""
    body = find_humanoid(clip)
    local = kinematics.local_rotations(body.rotations(clip), PARENTS)
    local[start:stop, rows] = local[start:stop, [SIDES[row] for row in rows]]
    return body.to_clip(kinematics.global_rotations(local, PARENTS), body.root(clip), clip)


def test_legs_with_axes_of_their_own_are_put_back(trial):
    parts = ("UpLeg", "Leg", "Foot", "Toe")
    rows = [row for row, name in enumerate(JOINTS) if name.endswith(parts) and name[0] in "LR"]
    start, stop = 12, 26
    odd = crossed(trial, rows, start, stop)
    off = np.linalg.norm(odd.positions() - trial.positions(), axis=-1)
    assert off.max() > 0.1
    found = exchanges(odd)
    assert [(type(one), one.start, one.stop) for one in found] == [(Crossing, start, stop)]
    back = put_back(odd, found)
    np.testing.assert_allclose(back.positions(), trial.positions(), atol=1e-9)
    outside = np.r_[:start, stop : len(trial)]
    assert (back.rotation[outside] == odd.rotation[outside]).all()
    assert exchanges(trial) == []


def test_arms_with_axes_of_their_own_that_stay_exchanged_are_put_back_but_for_their_fingers(cmu_walk):
    """As on rigs of games; nothing tells where fingers pointed."""
    skeleton, rest = cmu_walk.skeleton, cmu_walk.skeleton.rest_rotation.copy()
    rotation, bones = cmu_walk.rotation.copy(), skeleton.rest_translation.copy()
    half = rotations.about("X", np.array(np.pi))
    top = skeleton.index("RightShoulder")
    for joint in np.flatnonzero(skeleton.below[:, top]).tolist():
        inner = joint != top
        for values in (rest[joint : joint + 1], rotation[:, joint]):
            values[:] = rotations.multiply(values, half)
            if inner:
                values[:] = rotations.multiply(rotations.conjugate(half), values)
        if inner:
            rest[joint] = [1.0, 0, 0, 0]
            bones[joint] = rotations.rotate(rotations.conjugate(half), bones[joint])
    rig = Clip(
        replace(skeleton, rest_translation=bones, rest_rotation=rest), rotation, cmu_walk.translation, 30
    )
    assert np.allclose(rig.positions(), cmu_walk.positions())
    rows = [row for row, name in enumerate(JOINTS) if name.endswith(("Shoulder", "Arm", "ForeArm", "Hand"))]
    odd = crossed(rig, rows, 100, len(rig))
    done = tasks.recover(odd, frames=(100, len(rig)))
    arms = [skeleton.index(JOINTS[row]) for row in rows]
    assert np.allclose(done.clip.positions()[:, arms], rig.positions()[:, arms], atol=1e-6)
    fingers = skeleton.index("LThumb")
    assert (done.clip.rotation[:, fingers] == odd.rotation[:, fingers]).all()


def test_exchanged_values_are_not_taken_for_exchanged_limbs(trial):
    """Where axes differ that is something else: put back as limbs they would be half a metre off."""
    names = ["femur", "tibia", "foot", "toes"]
    left, right = ([trial.skeleton.index(side + name) for name in names] for side in "lr")
    rotation = trial.rotation.copy()
    rotation[12:26, left + right] = trial.rotation[12:26, right + left]
    odd = trial.with_motion(rotation, trial.translation)
    found = exchanges(odd)
    worst = np.linalg.norm(odd.positions() - trial.positions(), axis=-1).max()
    assert np.linalg.norm(put_back(odd, found).positions() - trial.positions(), axis=-1).max() <= worst + 1e-9


@pytest.mark.parametrize("lost", [("LHipJoint", "RHipJoint"), ("RightLeg",), ("LowerBack",)])
def test_of_half_a_body_nothing_is_asked_that_takes_a_whole_one(cmu_walk, lost):
    skeleton = cmu_walk.skeleton
    gone = {skeleton.index(name) for name in lost}
    kept = [j for j in range(len(skeleton)) if not gone & {j, *skeleton.ancestors(j)}]
    part = Skeleton(
        tuple(skeleton.names[j] for j in kept),
        tuple(kept.index(skeleton.parents[j]) if j else -1 for j in kept),
        skeleton.rest_translation[kept],
    )
    half = Clip(part, cmu_walk.rotation[:, kept], cmu_walk.translation[:, :1], cmu_walk.fps)
    assert exchanges(half) == []
    tasks.denoise(half)


@pytest.mark.parametrize("what", ["place", "turn"])
def test_a_cut_of_half_a_stride_is_a_cut(cmu_walk, what):
    """Legs are where the other ones were, and all else is elsewhere, too."""
    cut = swapped(cmu_walk, LEG, (60, 209))
    assert exchange.crossovers(cut)
    if what == "place":
        aside = np.where(np.arange(209) < 60, 0.0, 0.9)[:, None, None] * [1.0, 0.0, 0.0]
        cut = cut.with_motion(cut.rotation, cut.translation + aside)
        assert [one.kind for one in scan(cut)].count("jump") == 1
    else:
        spine = cut.skeleton.index("Spine")
        cut.rotation[60:, spine] = rotations.multiply(
            cut.rotation[60:, spine], rotations.exp(np.array([0, 0.5, 0]))
        )
    assert exchange.crossovers(cut) == []


def test_what_else_is_wrong_is_found_beside_limbs_that_change_sides(cmu_walk):
    odd = swapped(cmu_walk, LEG, (60, 209))
    joint = odd.skeleton.index("RightLeg")
    odd.rotation[150:170, joint] = odd.rotation[150, joint]
    found = [(one.kind, one.joints) for one in scan(odd)]
    assert [kind for kind, _ in found].count("exchanged") == 1
    assert {joints for kind, joints in found if kind == "frozen"} == {("RightLeg",)}
    assert not [kind for kind, _ in found if kind == "jump"]


def test_what_changes_sides_three_times_is_put_back_part_by_part(cmu_walk):
    walk = cmu_walk.slice(1, 209)
    clip = walk.take([*range(208), *range(206, -1, -1), *range(1, 208)])
    odd = swapped(clip, LEG, (100, 251), (402, 622))
    told = [(one.start, one.stop) for one in scan(odd) if one.kind == "exchanged"]
    assert told == [(100, 251), (402, 622)]
    for parts in (told, [(0, 100), (251, 402)]):
        done = odd
        for part in parts:  # a frame or two are as good
            done = interpose.recover(done, frames=(max(part[0] - 1, 0), part[1])).clip
        wanted = clip if parts == told else swapped(clip, LEG, (0, 622))
        assert np.array_equal(done.rotation, wanted.rotation)
