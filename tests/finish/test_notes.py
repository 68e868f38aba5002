"""What reports say of a motion: a mean pose, gliding, haste, what is under the floor."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from interpose import tasks
from interpose.clip import Clip, Skeleton
from interpose.finish import complete, notes
from interpose.geometry import measures, rotations
from interpose.methods import registry
from interpose.observation import Gap, Observation
from interpose.skeletons import find_humanoid
from interpose.skeletons.body import facing
from interpose.skeletons.humanoid import reflect

ARM, LEG = ("LeftArm", "LeftForeArm"), ("LeftUpLeg", "LeftLeg")


def test_the_report_says_that_a_gap_is_a_mean_pose(cmu_walk):
    seen = Observation.from_gaps(cmu_walk, [Gap(75, 135)])
    still = registry.get("zero-velocity")
    (report,) = complete(cmu_walk, seen, still, fallback=still).report.gaps
    assert report.liveliness < 0.33
    assert any("A key near frame" in note for note in report.notes)
    (report,) = complete(cmu_walk, seen, still, fallback=still, first=500).report.gaps
    assert any("A key near frame 605 says" in note for note in report.notes), "as the whole clip counts"
    (report,) = complete(cmu_walk, seen, registry.get("cae")).report.gaps
    assert report.liveliness > 0.33
    assert not any("A key near" in note for note in report.notes)


def test_what_follows_is_compared_with_what_was_before(cmu_walk):
    positions = cmu_walk.positions()
    assert 0.7 < measures.liveliness(positions[:135], 75, 135, 30.0) < 1.4
    held = np.concatenate([positions[:75], np.repeat(positions[74:75], 60, axis=0)])
    assert measures.liveliness(held, 75, 135, 30.0) < 1e-9
    assert measures.liveliness(held[::-1], 0, 60, 30.0) < 1e-9
    done = tasks.forecast(cmu_walk.slice(0, 75), 60, method="zero-velocity")
    (report,) = done.report.gaps
    assert any("as much as the motion before it" in note for note in report.notes)


@pytest.mark.parametrize(("start", "frames"), [(10, 50), (178, 13)])
def test_a_body_that_glides_is_told_from_one_that_walks(cmu_walk, start, frames):
    """Between poses in which it faces the same way a straight line floats, and slides less than people do."""
    said = {}
    for method in ("linear", "small"):
        (said[method],) = tasks.fill(cmu_walk, [Gap(start, start + frames)], method).report.gaps
    assert said["linear"].gliding > 0.4
    assert said["small"].gliding < 0.1
    glides = {m: any("it glides" in note for note in gap.notes) for m, gap in said.items()}
    assert glides == {"linear": True, "small": False}


def test_feet_that_are_known_are_not_measured(cmu_walk):
    """What they do beside an arm that is filled is the clip's own."""
    arm, leg = (tasks.fill(cmu_walk, [Gap(60, 100, names)], "linear").report.gaps[0] for names in (ARM, LEG))
    assert (arm.foot_slide, arm.foot_travel, arm.gliding) == (None, None, None)
    assert leg.foot_slide is not None
    assert leg.gliding is not None


def test_a_body_that_glides_slowly_between_lone_keys_is_told(cmu_walk):
    """Nothing around says how it moves; at its pace it does not run."""
    poses = tasks.block({0: cmu_walk.slice(10, 11), 50: cmu_walk.slice(60, 61)})
    (said,) = tasks.between(poses, [0, 50], method="linear").report.gaps
    (note,) = (note for note in said.notes if "it glides" in note)
    assert "around" not in note


def test_a_hand_under_the_floor_is_said(cmu_walk):
    """Of a body that lies: feet tell nothing of it."""
    down = rotations.about("X", np.array(np.pi / 2))
    rotation = cmu_walk.rotation.copy()
    rotation[:, 0] = rotations.multiply(down, np.broadcast_to(rotation[60, 0], rotation[:, 0].shape))
    lying = cmu_walk.with_motion(rotation, np.zeros_like(cmu_walk.translation))
    seen, gap = Observation.from_gaps(lying, [Gap(80, 110)]), Gap(80, 110)
    assert notes.sunk(lying, seen, gap, 0) == []
    arm = cmu_walk.skeleton.index("LeftArm")
    turned = lying.kinematics()[0][80:110, lying.skeleton.parents[arm]]
    hand = lying.positions()[80:110, cmu_walk.skeleton.index("LeftHand")] - lying.positions()[80:110, arm]
    under = rotations.between(hand, np.broadcast_to([0.0, -1.0, 0.0], hand.shape))
    local = rotations.multiply(rotations.conjugate(turned), rotations.multiply(under, turned))
    rotation[80:110, arm] = rotations.multiply(local, rotation[80:110, arm])
    (note,) = notes.sunk(lying.with_motion(rotation, lying.translation), seen, gap, 100)
    assert "LeftHand" in note
    assert "under the floor at frame 2" in note  # counted from 100


def test_what_jumps_as_hardly_any_motion_does_is_told_by_joint_and_frame(cmu_walk):
    """Between lone keys nothing tells how the motion itself jumps."""
    gap = Gap(50, 80)
    known = Observation.from_gaps(cmu_walk, [gap])
    assert notes.wild(cmu_walk, known, gap, 0) == []
    rotation, arm = cmu_walk.rotation.copy(), cmu_walk.skeleton.index("LeftForeArm")
    rotation[60:, arm] = rotations.multiply(rotations.about("X", np.array(1.5)), rotation[60:, arm])
    (told,) = notes.wild(cmu_walk.with_motion(rotation, cmu_walk.translation), known, gap, 100)
    assert told.startswith("flagged: Left")
    assert "at frame 159" in told or "at frame 160" in told


def test_who_goes_backwards_or_hurries_is_told(cmu_walk):
    """A pose that goes where it faces at 1.2 m/s; in the gap as fast, back at 2, or at 4."""
    body, gap = find_humanoid(cmu_walk), Gap(60, 120)
    course = facing(body.positions(cmu_walk.slice(40, 41))[0])
    rotation = np.repeat(cmu_walk.rotation[[40]], 180, axis=0)
    for pace, word in ((1.2, ""), (-2.0, "backwards"), (4.0, "hurries")):
        speed = np.full(180, 1.2)
        speed[60:120] = pace
        translation = np.repeat(cmu_walk.translation[[40]], 180, axis=0)
        translation[:, 0] += np.cumsum(speed)[:, None] / 30 * [np.sin(course), 0.0, np.cos(course)]
        clip = cmu_walk.with_motion(rotation, translation)
        said = notes.hasty(clip, Observation.from_gaps(clip, [gap]), gap, 0)
        assert [word in note for note in said] == [True] * bool(word)


@pytest.mark.parametrize(("pace", "hurries"), [(1.2, False), (2.2, False), (4.0, True), (10.0, True)])
@pytest.mark.parametrize("ahead", [True, False])
def test_what_hurries_on_at_an_end_is_told_without_advice(cmu_walk, pace, hurries, ahead):
    """More frames of a forecast would not slow it down; who ran at its beginning runs on."""
    gap = Gap(120, 180) if ahead else Gap(0, 60)
    speed = np.full(180, 1.2)
    speed[gap.start : gap.stop] = pace
    translation = np.repeat(cmu_walk.translation[[40]], 180, axis=0)
    course = facing(find_humanoid(cmu_walk).positions(cmu_walk.slice(40, 41))[0])
    translation[:, 0] += np.cumsum(speed)[:, None] / 30 * [np.sin(course), 0.0, np.cos(course)]
    clip = cmu_walk.with_motion(np.repeat(cmu_walk.rotation[[40]], 180, axis=0), translation)
    said = notes.hasty(clip, Observation.from_gaps(clip, [gap]), gap, 0)
    assert ["hurries" in note for note in said] == [True] * hurries
    assert not any("would not" in note for note in said)
    # As fast just before, it goes on.
    speed[105:120] = speed[60:75] = pace
    translation = np.repeat(cmu_walk.translation[[40]], 180, axis=0)
    translation[:, 0] += np.cumsum(speed)[:, None] / 30 * [np.sin(course), 0.0, np.cos(course)]
    clip = clip.with_motion(clip.rotation, translation)
    assert notes.hasty(clip, Observation.from_gaps(clip, [gap]), gap, 0) == []


def test_a_pose_that_glides_below_a_root_that_stays_is_no_life(cmu_walk):
    """The bones of a game rig hang on an armature that stays where it is."""
    body = cmu_walk.skeleton
    rig = Skeleton(
        ("Armature", *body.names),
        (-1, *(parent + 1 for parent in body.parents)),
        np.concatenate([np.zeros((1, 3)), body.rest_translation]),
    )
    still = cmu_walk.rotation.copy()
    still[75:135] = still[74]
    turned = np.concatenate([rotations.identity(len(still), 1), still], axis=1)
    placed = np.concatenate([np.zeros((len(still), 1, 3)), cmu_walk.translation[:, :1]], axis=1)
    clip = Clip(rig, turned, placed, 30.0, translated=(0, 1))
    assert notes.liveliness(clip, Gap(75, 135)) < 1e-9


@pytest.mark.parametrize("lone", [True, False])
def test_who_waits_and_then_hurries_needs_no_more_frames(cmu_walk, lone):
    """Two thirds of the gap at a stand and then at 4.4 m/s: it takes 1.4 all the way, which is no hurry."""
    gap = Gap(1, 91) if lone else Gap(60, 150)
    count = 92 if lone else 210
    speed = np.zeros(count)
    speed[gap.start + 60 : gap.stop] = 4.4
    course = facing(find_humanoid(cmu_walk).positions(cmu_walk.slice(40, 41))[0])
    translation = np.repeat(cmu_walk.translation[[40]], count, axis=0)
    translation[:, 0] += np.cumsum(speed)[:, None] / 30 * [np.sin(course), 0.0, np.cos(course)]
    clip = cmu_walk.with_motion(np.repeat(cmu_walk.rotation[[40]], count, axis=0), translation)
    (said,) = notes.hasty(clip, Observation.from_gaps(clip, [gap]), gap, 0)
    assert "hurries" in said
    assert "would not" not in said
    assert "1.4 m/s to get there evenly" in said


@pytest.mark.parametrize("pace", [1.2, -2.0])
def test_what_is_said_of_a_mirror_image_is_the_same(cmu_walk, pace):
    course = facing(find_humanoid(cmu_walk).positions(cmu_walk.slice(40, 41))[0])
    # Nearly half a turn while it goes, so that facing matters.
    turn = rotations.about("Y", np.linspace(0.0, 4.0, 180))
    rotation = np.repeat(cmu_walk.rotation[[40]], 180, axis=0)
    rotation[:, 0] = rotations.multiply(turn, rotation[:, 0])
    translation = np.repeat(cmu_walk.translation[[40]], 180, axis=0)
    heading = course + np.linspace(0.0, 4.0, 180)
    way = np.stack([np.sin(heading), 0 * heading, np.cos(heading)], axis=1)
    speed = np.where((np.arange(180) >= 60) & (np.arange(180) < 120), pace, 1.2)
    translation[:, 0] += np.cumsum(speed[:, None] * way, axis=0) / 30
    clip, gap = cmu_walk.with_motion(rotation, translation), Gap(10, 170)
    both = []
    for one in (clip, reflect(clip)):
        known = Observation.from_gaps(one, [gap])
        both.append([*notes.hasty(one, known, gap, 0), *notes.whirling(one, known, gap, 0)])
    assert both[0] == both[1]
    assert any("to the left" in note for note in both[0])
    assert any("backwards" in note for note in both[0]) == (pace < 0)


def test_a_hand_that_waves_on_both_sides_and_rests_between_is_said(cmu_walk):
    pose, time = cmu_walk.take(np.repeat(60, 180)), np.arange(180) / 30.0
    rotation, arm = pose.rotation.copy(), pose.skeleton.index("LeftArm")
    wave = rotations.about("Z", 0.6 * np.sin(2 * np.pi * 1.3 * time))
    rotation[:, arm] = rotations.multiply(wave, rotation[:, arm])
    waves, gap = pose.with_motion(rotation, pose.translation), Gap(60, 120)
    full = Observation.full(pose)
    assert not notes.idle(waves, full, gap, 0)
    rotation[60:120] = pose.rotation[60:120]
    (said,) = notes.idle(waves.with_motion(rotation, pose.translation), full, gap, 500)
    assert said.startswith("flagged: LeftHand moves at 0.0 m/s in it, beside it at")
    assert said.endswith("A key near frame 590 says what it does")
    beside = Observation.from_gaps(pose, [gap, Gap(125, 140)])
    assert not notes.idle(waves.with_motion(rotation, pose.translation), beside, gap, 500), (
        "a guess tells nothing"
    )
    rotation[120:] = pose.rotation[120:]
    assert not notes.idle(waves.with_motion(rotation, pose.translation), full, gap, 0)


def test_of_who_walks_on_a_hand_that_rests_is_said(cmu_walk):
    """The middle of the gap moves as much as the motion around it, but for that."""
    rotation, arm = cmu_walk.rotation.copy(), cmu_walk.skeleton.index("LeftArm")
    wave = rotations.about("Z", 0.6 * np.sin(2 * np.pi * 1.3 * np.arange(len(cmu_walk)) / 30))
    rotation[:, arm] = rotations.multiply(wave, rotation[60, arm])
    waves = cmu_walk.with_motion(rotation, cmu_walk.translation)
    rotation = rotation.copy()
    rotation[60:120, [arm, arm + 1]] = rotation[60, [arm, arm + 1]]

    class Rests(type(registry.get("linear"))):  # type: ignore[misc]
        def complete(self, clip, observation, seed=None):  # type: ignore[no-untyped-def]
            raw = super().complete(clip, observation, seed)
            return replace(raw, clip=raw.clip.with_motion(rotation, cmu_walk.translation))

    seen = Observation.from_gaps(waves, [Gap(60, 120)])
    (report,) = complete(waves, seen, Rests()).report.gaps
    assert any(note.startswith("flagged: LeftHand moves at") for note in report.notes), report.notes
    assert not any("as much as" in note for note in report.notes)
