"""What the scan finds, where exactly, and that it finds nothing in good motion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.skeletons.rigs import under_root

import interpose
from interpose.clip import Clip, Skeleton
from interpose.formats import load
from interpose.geometry import rotations
from interpose.observation import Gap, Observation
from interpose.observation.finding import Finding, to_gaps
from interpose.observation.scan import intact, scan
from interpose.observation.tremor import restless

NAMES = ("hips", "spine", "arm", "hand", "finger")
SKELETON = Skeleton(NAMES, (-1, 0, 1, 2, 3), np.tile([0.0, 0.3, 0], (5, 1)))


def motion(seconds: float = 4, fps: float = 30) -> Clip:
    """Everything moves and trembles a little, but the finger, which has no data."""
    frames = round(seconds * fps)
    rng = np.random.default_rng(0)
    t = np.arange(frames)[:, None, None] / fps
    vectors = np.sin(t * np.array([1.0, 2, 3, 4, 5])[:, None] + 1) * [0.2, 0.9, 0.4]
    vectors = vectors + rng.normal(scale=1e-4, size=vectors.shape)
    vectors[:, 4] = 0
    root = np.stack([np.sin(t), 1 + 0.1 * np.sin(9 * t), t], axis=-1).reshape(frames, 1, 3)
    return Clip(SKELETON, rotations.exp(vectors), root + rng.normal(scale=1e-4, size=root.shape), fps)


def hold(clip: Clip, start: int, stop: int, joints: list[int] | None, value: int | None = None) -> Clip:
    """Frames start to stop - 1 repeat the frame before them (or frame `value`)."""
    rotation, translation = clip.rotation.copy(), clip.translation.copy()
    source = start - 1 if value is None else value
    every = list(range(5)) if joints is None else joints
    rotation[start:stop, every] = clip.rotation[source, every]
    if joints is None:
        translation[start:stop] = clip.translation[source]
    return clip.with_motion(rotation, translation)


def spans(findings: list[Finding]) -> list[tuple]:
    return [(f.kind, f.joints, f.start, f.stop) for f in findings]


@pytest.mark.parametrize("fps", [24, 30, 60, 120])
def test_good_motion_has_no_findings(fps):
    assert scan(motion(fps=fps)) == []


@pytest.mark.parametrize("fps", [24, 30, 60, 120])
def test_a_held_pose_is_one_finding_of_exactly_the_copies(fps):
    start, stop = round(1.5 * fps), round(2 * fps)
    found = scan(hold(motion(fps=fps), start, stop, None))
    assert spans(found) == [("frozen", None, start, stop)]
    assert to_gaps(found) == [Gap(start, stop)]


@pytest.mark.parametrize("fps", [30, 1 / 0.033333])
def test_frame_times_that_are_cut_off_ask_for_as_many_frames(fps):
    """Files write thirtieths of a second with six digits."""
    found = scan(replace(hold(motion(), 40, 44, [2], value=10), fps=fps))
    assert spans(found) == [("frozen", ("arm",), 40, 44)]


def test_a_held_joint_is_named_and_joints_held_together_are_one_finding():
    found = scan(hold(motion(), 40, 60, [2, 3]))
    assert spans(found) == [("frozen", ("arm", "hand"), 40, 60)]
    found = scan(hold(hold(motion(), 40, 60, [2]), 70, 90, [3]))
    assert spans(found) == [("frozen", ("arm",), 40, 60), ("frozen", ("hand",), 70, 90)]


def test_a_pose_filled_with_a_constant_is_reported_whole():
    """Both ends jump, so none of the equal frames is the one that was held."""
    found = scan(hold(motion(), 60, 80, None, value=0))
    assert spans(found) == [("frozen", None, 60, 80)]


@pytest.mark.parametrize("joints", [None, [2]])
def test_frozen_runs_at_the_ends(joints):
    names = None if joints is None else ("arm",)
    # A single joint needs a second, or a jump, and at the ends there is none.
    start = hold(motion(), 0, 45, joints, value=45)
    assert spans(scan(start)) == [("frozen", names, 0, 45)]
    assert spans(scan(hold(motion(), 80, 120, joints))) == [("frozen", names, 80, 120)]


@pytest.mark.parametrize("part", [slice(0, 5), slice(60, 80), slice(-5, None)])
def test_turns_that_all_stop_while_the_body_goes_on_are_one_finding(cmu_walk, part):
    walk = cmu_walk.slice(1, len(cmu_walk))  # the first frame of CMU's files is a rest pose
    frames = range(len(walk))[part]
    held = frames[-1] if part.start == 0 else frames[0] - 1
    rotation = walk.rotation.copy()
    rotation[part] = rotation[held]
    (found,) = (one for one in scan(walk.with_motion(rotation, walk.translation)) if one.kind == "frozen")
    assert [*range(found.start, found.stop)] == [frame for frame in frames if frame != held]
    assert len(found.joints) >= 20
    assert "Hips" in found.joints


def test_a_frozen_position_is_found_and_is_no_gap():
    clip = motion()
    translation = clip.translation.copy()
    translation[50:80] = translation[49]
    found = scan(clip.with_motion(clip.rotation, translation))
    assert spans(found) == [("frozen position", ("hips",), 50, 80)]
    assert to_gaps(found) == []


def test_a_body_that_is_held_while_something_else_goes_on_is_one_finding(cmu_walk):
    """Fingers of a glove, a prop, somebody else."""
    walk, hips = cmu_walk.slice(1, len(cmu_walk)), cmu_walk.skeleton.index("Hips")
    lost = [j for j, name in enumerate(walk.skeleton.names) if "Arm" not in name and "Hand" not in name]
    for joints in ([hips], lost):
        rotation, translation = walk.rotation.copy(), walk.translation.copy()
        rotation[80:110, joints], translation[80:110] = rotation[79, joints], translation[79]
        (found,) = scan(walk.with_motion(rotation, translation))
        assert (found.kind, found.start, found.stop) == ("frozen body", 80, 110)
        assert "Hips" in found.joints
        assert to_gaps([found]) == []
    assert len(found.joints) > 10


def test_joints_that_are_held_in_the_very_frames_of_another_are_found_with_it():
    """The arm jumps, the hand does not, which by itself would be a pause."""
    clip = motion()
    rotation = clip.rotation.copy()
    rotation[40:52, 2] = rotation[39, 2]
    rotation[52:58, 3] = rotations.slerp(rotation[39, 3], rotation[58, 3], np.linspace(0, 1, 8)[1:-1])
    rotation[40:52, 3] = rotation[39, 3]
    (found,) = scan(clip.with_motion(rotation, clip.translation))
    assert spans([found]) == [("frozen", ("arm", "hand"), 40, 52)]


@pytest.mark.parametrize("at_end", [False, True])
def test_a_rest_pose_that_is_held_to_be_measured_is_real(cmu_walk, at_end):
    """Though the take begins, or ended, with a cut beside it; so is the place where it stands."""
    walk = cmu_walk.slice(1, len(cmu_walk))
    rest = np.repeat(walk.skeleton.rest_rotation[None], 20, axis=0)
    there = np.repeat(walk.translation[[-1 if at_end else 0]], 20, axis=0)
    order = slice(None, None, -1 if at_end else 1)
    rotation, translation = (
        np.concatenate([held, moved][order])
        for held, moved in ((rest, walk.rotation), (there, walk.translation))
    )
    (found,) = scan(walk.with_motion(rotation, translation))
    assert (found.kind, found.joints, abs(len(found) - 20) <= 1) == ("still", None, True)
    assert to_gaps([found]) == []


@pytest.mark.parametrize("part", [slice(0, 12), slice(108, 120)])
def test_a_body_that_stops_dead_at_an_end_is_found(part):
    """There is no jump to tell it: it never goes on."""
    clip = motion()
    translation = clip.translation.copy()
    translation[part] = translation[part.stop if part.start == 0 else part.start - 1]
    (found,) = scan(clip.with_motion(clip.rotation, translation))
    assert spans([found]) == [("frozen position", ("hips",), part.start, part.stop)]


def test_standing_still_within_the_noise_of_capture_is_no_finding():
    clip = motion()
    rotation = rotations.multiply(
        clip.rotation[60], rotations.exp(np.random.default_rng(1).normal(scale=1e-4, size=(40, 5, 3)))
    )
    quiet = clip.rotation.copy()
    quiet[60:100] = rotation
    found = scan(clip.with_motion(quiet, clip.translation))
    assert [one.kind for one in found] == ["jump"]  # back to the motion, in frame 100


def test_a_hinge_at_its_limit_is_no_finding():
    """Knees stop at the rest pose for a while, coming and going without a jump."""
    clip = motion(6)
    angle = np.clip(np.sin(np.arange(180) / 20), 0, None)
    rotation = clip.rotation.copy()
    rotation[:, 2] = rotations.exp(angle[:, None] * [1.0, 0, 0])
    assert (angle == 0).sum() > 60
    assert scan(clip.with_motion(rotation, clip.translation)) == []


@pytest.mark.parametrize("step", [8, 40, 110])
def test_a_joint_that_is_still_but_for_one_step_is_no_finding(step):
    """A finger without data: filling it over the whole clip would swallow the gaps beside it."""
    clip = motion()
    rotation = clip.rotation.copy()
    rotation[step:, 4] = rotations.exp(np.array([0.12, 0, 0]))
    stepped = clip.with_motion(rotation, clip.translation)
    assert scan(stepped) == []
    assert spans(scan(hold(stepped, 40, 60, [2]))) == [("frozen", ("arm",), 40, 60)]


def test_a_joint_that_rest_poses_alone_turn_is_no_finding():
    """Toes of LAFAN1 never turn; frames of a rest pose amid the motion do not make them frozen."""
    clip = motion()
    rotation = clip.rotation.copy()
    rotation[:, 4] = rotations.about("x", np.array(0.3))
    rotation[[30, 31, 70, 71, 90]] = [1.0, 0, 0, 0]
    found = scan(clip.with_motion(rotation, clip.translation))
    assert not any("finger" in (one.joints or ()) for one in found if one.kind == "frozen")


def test_missing_values_are_listed_and_not_taken_for_frozen_ones():
    clip = motion()
    rotation, translation = clip.rotation.copy(), clip.translation.copy()
    rotation[40:60] = np.nan
    translation[40:60] = np.nan
    rotation[80:90, 3] = np.nan
    clip, observation = Observation.from_nan(SKELETON, rotation, translation, 30)
    found = scan(clip, observation)
    assert spans(found) == [("missing", None, 40, 60), ("missing", ("hand",), 80, 90)]
    assert to_gaps(found) == [Gap(40, 60), Gap(80, 90, ("hand",))]


def test_joints_that_drop_out_for_moments_are_found_and_are_no_gaps():
    clip = motion()
    rotation, translation = clip.rotation.copy(), clip.translation.copy()
    rotation[30:32, 2:4] = SKELETON.rest_rotation[2:4]
    translation[50] += [0, 5, 0]
    found = scan(clip.with_motion(rotation, translation))
    assert spans(found) == [("lost", ("arm", "hand"), 30, 32), ("lost", ("hips",), 50, 51)]
    assert to_gaps(found) == []


def test_a_leg_that_never_moves_is_found_by_the_other(cmu_walk):
    """And filled; where both stand still nobody knows better."""
    names = cmu_walk.skeleton.names
    leg = tuple(name for name in names if name in ("LeftUpLeg", "LeftLeg", "LeftFoot"))
    rotation = cmu_walk.rotation.copy()
    rotation[:, [names.index(name) for name in leg]] = cmu_walk.skeleton.rest_rotation[0]
    found = scan(cmu_walk.with_motion(rotation, cmu_walk.translation))
    assert ("frozen", leg, 0, len(cmu_walk)) in spans(found)
    assert Gap(0, len(cmu_walk), leg) in to_gaps(found)
    rotation[:, [names.index(name.replace("Left", "Right")) for name in leg]] = [1, 0, 0, 0]
    assert not [f for f in scan(cmu_walk.with_motion(rotation, cmu_walk.translation)) if f.kind == "frozen"]


def test_a_rest_pose_before_the_motion_is_found():
    clip = motion()
    rotation = clip.rotation.copy()
    rotation[0] = SKELETON.rest_rotation
    rotation[-1] = rotations.exp(np.array([2.0, 1, 0]))
    rotation[-1, 4] = rotation[-2, 4]
    found = scan(clip.with_motion(rotation, clip.translation))
    assert spans(found) == [("rest pose", None, 0, 1), ("outlier", None, 119, 120)]


@pytest.mark.parametrize("frames", [1, 2, 3, 4])
def test_tiny_and_still_clips(frames):
    clip = motion()
    assert scan(clip.slice(0, frames)) == []
    still = Clip(SKELETON, np.tile([1.0, 0, 0, 0], (frames, 5, 1)), np.zeros((frames, 1, 3)), 30)
    assert scan(still) == []


def test_a_real_walk_has_no_frozen_body(cmu_walk):
    found = [f for f in scan(cmu_walk) if f.kind not in ("rest pose", "outlier")]
    assert found == []


def test_a_root_that_is_held_with_its_turns_is_a_frozen_body(cmu_walk):
    """It is above the hips, whose own place and turns go on: neither is a gap."""
    clip = under_root(cmu_walk, goes=True)
    rotation, translation = clip.rotation.copy(), clip.translation.copy()
    rotation[:, 0] = rotations.multiply(
        rotations.about("Y", np.linspace(0.0, 1.0, len(clip))), rotation[:, 0]
    )
    rotation[80:110, 0], translation[80:110, 0] = rotation[79, 0], translation[79, 0]
    held = scan(clip.with_motion(rotation, translation))
    assert spans(held) == [("frozen body", ("root",), 80, 110)]
    assert to_gaps(held) == []


def test_two_dropouts_near_each_other_do_not_tremble(cmu_walk):
    """To fall to zero and come back four times in a second is all that happens."""
    rotation, translation = cmu_walk.rotation.copy(), cmu_walk.translation.copy()
    for part in (slice(80, 95), slice(99, 112)):
        rotation[part], translation[part] = [1.0, 0.0, 0.0, 0.0], 0.0
    found = scan(cmu_walk.with_motion(rotation, translation))
    assert [one for one in spans(found) if one[2] > 1] == [
        ("frozen", None, 80, 95),
        ("frozen", None, 99, 112),
    ]


@pytest.mark.parametrize("step", [0.5, 1.0])
def test_angles_that_were_rounded_are_not_frozen(cmu_walk, step):
    """To half a degree, or a whole one: joints stand still between its steps. One that is away is found."""
    walk = cmu_walk.slice(1, len(cmu_walk))
    angles = np.round(np.degrees(rotations.to_euler(walk.rotation, "ZYX")) / step) * step
    coarse = walk.with_motion(rotations.from_euler(np.radians(angles), "ZYX"), walk.translation)
    assert [one for one in scan(coarse) if one.kind != "noisy"] == []
    rotation, arm = coarse.rotation.copy(), coarse.skeleton.index("LeftForeArm")
    rotation[60:90, arm] = rotation[20, arm]
    found = scan(coarse.with_motion(rotation, coarse.translation))
    assert ("frozen", ("LeftForeArm",), 60, 90) in spans(found)


@pytest.mark.parametrize("way", [0.4, 1.5])
def test_a_body_that_is_elsewhere_from_one_frame_on_is_said_to_jump(cmu_walk, way):
    clip = cmu_walk.slice(1, 200)
    translation = clip.translation.copy()
    translation[90:, 0, 0] += way
    (found,) = [one for one in scan(clip.with_motion(clip.rotation, translation)) if one.kind != "lost"]
    assert (found.kind, found.joints, found.start) == ("jump", None, 90)
    assert "the body is" in found.note
    assert f"{way * 30:.0f}"[0] in found.note
    assert to_gaps([found]) == []


def test_frames_that_were_cut_out_and_an_arm_that_goes_on_elsewhere_are_said_to_jump(cmu_walk):
    clip = cmu_walk.slice(1, 200)
    kept = np.delete(np.arange(len(clip)), np.arange(100, 120))
    cut = clip.with_motion(clip.rotation[kept], clip.translation[kept])
    assert [one.start for one in scan(cut) if one.kind == "jump"] == [100]
    arm, rotation = clip.skeleton.index("LeftArm"), clip.rotation.copy()
    rotation[80:, arm] = rotations.multiply(rotation[80:, arm], rotations.about("X", np.array(0.9)))
    (found,) = [one for one in scan(clip.with_motion(rotation, clip.translation)) if one.kind == "jump"]
    assert found.start == 80
    assert found.joints is not None
    assert {clip.skeleton.index(name) for name in found.joints} <= {
        joint for joint in range(len(clip.skeleton)) if arm in clip.skeleton.ancestors(joint)
    }
    assert not [one for one in scan(clip) if one.kind == "jump"]


@pytest.mark.parametrize(("every", "real"), [(2, 15), (17, 28)])
def test_frames_that_are_there_twice_are_said(cmu_walk, every, real):
    clip = cmu_walk.slice(1, 209)
    held = np.arange(len(clip))
    held[every - 1 :: every] -= 1
    twice = clip.with_motion(clip.rotation[held], clip.translation[held])
    (found,) = [one for one in scan(twice) if one.kind == "repeated"]
    assert f"{real} frames a second, in a file of 30" in found.note
    assert to_gaps([found]) == []
    assert not [one for one in scan(clip) if one.kind == "repeated"]


def doubled(clip, *runs):
    """The clip with frames start to stop - 1 of each run as the one before."""
    rotation, translation = clip.rotation.copy(), clip.translation.copy()
    for start, stop in runs:
        rotation[start:stop], translation[start:stop] = rotation[start - 1], translation[start - 1]
    return clip.with_motion(rotation, translation)


def test_single_frames_that_are_there_twice_are_gaps(cmu_walk):
    """Dropped frames, in whose place the last one is shown again; where the body rests that is nothing."""
    clip = cmu_walk.slice(1, 209)
    runs = [(30, 31), (61, 63), (90, 91), (150, 152)]
    found = scan(doubled(clip, *runs))
    assert [(one.kind, one.start, one.stop) for one in found] == [("doubled", *run) for run in runs]
    assert to_gaps(found) == [Gap(*run) for run in runs]
    assert not scan(clip)
    at = np.minimum(np.arange(200), 100)  # it walks, and rests
    still = doubled(clip.with_motion(clip.rotation[at], clip.translation[at]), (150, 152))
    assert "doubled" not in {one.kind for one in scan(still)}


def test_frames_that_tremble_are_said(cmu_walk):
    clip, rng = cmu_walk.slice(1, 209), np.random.default_rng(1)
    for part in (slice(100, 150), slice(0, 208)):
        rotation = clip.rotation.copy()
        noise = np.radians(rng.normal(0, 1.5, (*rotation[part].shape[:2], 3)))
        rotation[part] = rotations.multiply(rotation[part], rotations.exp(noise))
        found = [one for one in scan(clip.with_motion(rotation, clip.translation)) if one.kind == "noisy"]
        assert len(found) == 1
        assert abs(found[0].start - part.start) < 12
        assert abs(found[0].stop - part.stop) < 12
    assert not [one for one in scan(clip) if one.kind == "noisy"]


def test_a_joint_that_trembles_by_itself_is_said(cmu_walk):
    clip, rng = cmu_walk.slice(1, 209), np.random.default_rng(1)
    rotation, joint = clip.rotation.copy(), clip.skeleton.index("LeftForeArm")
    noise = rotations.exp(np.radians(rng.normal(0, 5.0, (40, 3))))
    rotation[100:140, joint] = rotations.multiply(rotation[100:140, joint], noise)
    (found,) = [one for one in scan(clip.with_motion(rotation, clip.translation)) if one.kind == "noisy"]
    assert found.joints == ("LeftForeArm",)
    assert abs(found.start - 100) < 8
    assert abs(found.stop - 140) < 8
    said = float(found.note.split(" by ")[1].split()[0])
    assert said == pytest.approx(5.0, rel=0.3)


@pytest.mark.parametrize("size", [6.0, 15.0, 30.0])
def test_a_hand_that_trembles_all_along_is_said(cmu_walk, size):
    clip, rng = cmu_walk.slice(1, 209), np.random.default_rng(1)
    rotation, hand = clip.rotation.copy(), clip.skeleton.index("LeftHand")
    noise = rotations.exp(np.radians(rng.normal(0, size, (len(clip), 3))))
    rotation[:, hand] = rotations.multiply(rotation[:, hand], noise)
    (found,) = [one for one in scan(clip.with_motion(rotation, clip.translation)) if one.kind == "noisy"]
    assert (found.joints, found.start, found.stop) == (("LeftHand",), 0, len(clip))


def test_a_hand_that_flaps_is_not_said_to_tremble(cmu_walk):
    """By 90 degrees nearly five times a second, at 30 frames."""
    rotation, hand = cmu_walk.rotation.copy(), cmu_walk.skeleton.index("RightHand")
    flaps = 1.6 * np.sin(np.pi * np.arange(len(cmu_walk)) / 6.5) ** 4
    rotation[:, hand] = rotations.multiply(rotation[:, hand], rotations.about("X", flaps))
    assert not restless(cmu_walk.with_motion(rotation, cmu_walk.translation))


@pytest.mark.parametrize(("real", "fps"), [(24, 60), (12, 60), (10, 120), (5, 60)])
def test_motion_in_steps_is_repeated_and_neither_frozen_nor_full_of_jumps(real, fps):
    clip = motion(seconds=6, fps=real)
    at = np.arange(6 * fps) * real // fps
    steps = replace(clip, rotation=clip.rotation[at], translation=clip.translation[at], fps=fps)
    (found,) = scan(steps)
    assert found.kind == "repeated"
    assert f"{real} frames a second" in found.note


def test_what_is_lost_where_frames_repeat_is_found_as_well(cmu_walk):
    again = np.where(
        np.arange(len(cmu_walk)) % 5 == 4, np.arange(len(cmu_walk)) - 1, np.arange(len(cmu_walk))
    )
    rotation, arm = cmu_walk.rotation[again].copy(), cmu_walk.skeleton.index("LeftArm")
    rotation[61:63, arm] = rotations.multiply(rotation[61:63, arm], rotations.about("X", np.array(2.0)))
    found = scan(cmu_walk.with_motion(rotation, cmu_walk.translation[again]))
    kinds = {one.kind: one.joints for one in found}
    assert kinds["lost"] == ("LeftArm",)
    assert "repeated" in kinds


def test_who_stands_still_between_motions_is_still_and_not_lost(cmu_walk):
    """No jump, and nobody stops dead: a statue, or a rest pose at the beginning. It is said, not filled."""
    rest = cmu_walk.skeleton.rest_rotation
    share = np.repeat([0.0, 0.5, 1.0], [30, 30, 30])
    share[30:60] = (1 - np.cos(np.pi * np.arange(30) / 30)) / 2
    at = np.where(np.arange(90) < 60, 0, np.arange(90) - 60)
    ends = rotations.continuous(np.stack([np.broadcast_to(rest, (len(rest), 4)), cmu_walk.rotation[0]]))
    rotation = rotations.slerp(ends[:1], ends[1:], share[:, None])
    rotation[60:] = cmu_walk.rotation[:30]
    translation = cmu_walk.translation[at].copy()
    translation[:60, 0, 0] += 1e-5 * np.arange(60)[::-1]
    translation[:30] = translation[30]
    found = scan(cmu_walk.with_motion(rotation, translation))
    assert ("still", None) in [(one.kind, one.joints) for one in found]
    assert not to_gaps(found)


def test_a_place_that_is_held_with_a_tremble_is_frozen_until_it_jumps(cmu_walk):
    translation = cmu_walk.translation.copy()
    rng = np.random.default_rng(0)
    translation[60:90] = translation[59] + 0.0005 * rng.standard_normal((30, 1, 3))
    (found,) = scan(cmu_walk.with_motion(cmu_walk.rotation, translation))
    assert (found.kind, found.joints, found.stop) == ("frozen position", ("Hips",), 90)
    assert abs(found.start - 60) <= 1


def test_what_jumps_is_what_turns(cmu_walk):
    """The forearm is elsewhere from one frame to the next because the arm turns."""
    rotation, arm = cmu_walk.rotation.copy(), cmu_walk.skeleton.index("LeftArm")
    rotation[100:, arm] = rotations.multiply(rotation[100:, arm], rotations.about("y", np.array(0.9)))
    found = [one for one in scan(cmu_walk.with_motion(rotation, cmu_walk.translation)) if one.kind == "jump"]
    assert [(one.joints, one.start) for one in found] == [(("LeftArm",), 100)]


def test_a_clip_in_which_nothing_ever_moves_is_said(cmu_walk):
    """A stream that was dead from the beginning: nothing tells what is missing, but it is no motion."""
    dead = np.repeat(cmu_walk.rotation[50:51], len(cmu_walk), axis=0)
    for way in (cmu_walk.translation, np.repeat(cmu_walk.translation[:1], len(cmu_walk), axis=0)):
        found = [one for one in scan(cmu_walk.with_motion(dead, way)) if one.kind == "still"]
        assert [(one.joints, one.start, one.stop) for one in found] == [(None, 0, len(cmu_walk))]
        assert "no joint turns" in found[0].note
        assert not to_gaps(found)


def test_a_joint_that_never_moves_is_lost_where_the_other_side_does_for_more_than_a_spike(cmu_walk):
    left, right = (cmu_walk.skeleton.index(f"{side}ForeArm") for side in ("Left", "Right"))
    rotation = cmu_walk.rotation.copy()
    rotation[:, left] = rotation[0, left]
    found = scan(cmu_walk.with_motion(rotation, cmu_walk.translation))
    assert [(one.kind, one.joints, one.note) for one in found] == [
        ("frozen", ("LeftForeArm",), "the other side moves")
    ]
    rotation[:, right] = rotation[0, right]
    for frame in (80, 120):
        rotation[frame, right] = rotations.multiply(rotation[0, right], rotations.about("X", np.array(1.0)))
    assert not any(one.kind == "frozen" for one in scan(cmu_walk.with_motion(rotation, cmu_walk.translation)))


def test_spikes_of_a_joint_that_stands_still_are_found(cmu_walk):
    clip = cmu_walk.slice(1, 209)
    rotation, head = clip.rotation.copy(), clip.skeleton.index("Head")
    rotation[:, head] = rotation[60, head]
    assert not [one for one in scan(clip.with_motion(rotation, clip.translation)) if one.kind == "lost"]
    rotation[100:102, head] = rotations.multiply(
        rotation[100:102, head], rotations.exp(np.array([0.8, 0, 0]))
    )
    found = [one for one in scan(clip.with_motion(rotation, clip.translation)) if one.kind == "lost"]
    assert [(one.joints, one.start, one.stop) for one in found] == [(("Head",), 100, 102)]


def test_single_spikes_are_no_trembling(cmu_walk):
    clip = cmu_walk.slice(1, 209)
    rotation, thumb = clip.rotation.copy(), clip.skeleton.index("RThumb")
    for frame in (100, 106):
        rotation[frame, thumb] = rotations.multiply(
            rotation[frame, thumb], rotations.exp(np.array([2.5, 0, 0]))
        )
    kinds = [one.kind for one in scan(clip.with_motion(rotation, clip.translation)) if one.start > 60]
    assert set(kinds) == {"lost"}


def test_what_jumps_where_frames_are_repeated_is_judged_without_these(data):
    """Half of the frames twice: hands that shake are not lost in every other one of them."""
    clip = load(data / "cmu_jump.bvh")
    twice = clip.take(np.repeat(np.arange(1, len(clip), 2), 2))
    assert {one.kind for one in scan(twice)} <= {"repeated"}


def beside(clip: Clip, count: int, parent: str | None) -> Clip:
    """The same motion with so many more joints that never move: props, or fingers below `parent`."""
    old, above = clip.skeleton, -1 if parent is None else clip.skeleton.index(parent)
    names, parents = [*old.names], [*old.parents]
    for number in range(count):
        names.append(f"more{number}")
        parents.append(above)
    rest = np.concatenate([old.rest_translation, np.tile([0.03, 0.0, 0.0], (count, 1))])
    still = np.tile(rotations.identity(), (len(clip), count, 1))
    return Clip(
        Skeleton(names, parents, rest),
        np.concatenate([clip.rotation, still], axis=1),
        clip.translation if parent else np.pad(clip.translation, ((0, 0), (0, count), (0, 0))),
        clip.fps,
        clip.translated if parent else (*clip.translated, *range(len(old), len(names))),
    )


@pytest.mark.parametrize(("count", "parent"), [(40, None), (40, "LeftHand")])
def test_props_and_fingers_that_never_move_say_nothing_of_the_body(cmu_walk, count, parent):
    """Neither whether it stands in its rest pose nor how much it trembles."""
    walk, rng = cmu_walk.slice(1, 209), np.random.default_rng(1)
    rotation, translation = walk.rotation.copy(), walk.translation.copy()
    rotation[170:], translation[170:] = rotation[169], translation[169]
    held = walk.with_motion(rotation, translation)
    assert spans(scan(beside(held, count, parent))) == spans(scan(held)) == [("frozen", None, 170, 208)]
    noise = rotations.exp(np.radians(rng.normal(0, 1.5, (*walk.rotation.shape[:2], 3))))
    noisy = walk.with_motion(rotations.multiply(walk.rotation, noise), walk.translation)
    (plain,), (more,) = (
        [one for one in scan(clip) if one.kind == "noisy"] for clip in (noisy, beside(noisy, count, parent))
    )
    assert plain.note == more.note


def test_a_body_jumps_whatever_else_is_lost_meanwhile(cmu_walk):
    clip = cmu_walk.slice(1, 200)
    hand, rotation, translation = (
        clip.skeleton.index("LeftHand"),
        clip.rotation.copy(),
        clip.translation.copy(),
    )
    rotation[:, hand] = rotation[0, hand]
    translation[90:, 0, 0] += 0.6
    found = scan(clip.with_motion(rotation, translation))
    assert ("jump", None, 90, 91) in spans(found)
    assert ("frozen", ("LeftHand",), 0, 199) in spans(found)


def test_what_is_not_known_is_not_said_to_jump(cmu_walk):
    clip = cmu_walk.slice(1, 200)
    names, rotation = clip.skeleton.names, clip.rotation.copy()
    arm, leg = (names.index(name) for name in ("RightArm", "LeftUpLeg"))
    rotation[90:, leg] = rotations.multiply(rotation[90:, leg], rotations.about("X", np.array(0.9)))
    rotation[70:110, arm] = rotations.about("Z", np.where(np.arange(70, 110) < 90, 0.0, 3.0))
    known = Observation.from_gaps(clip, [Gap(70, 110, ("RightArm", "RightForeArm", "RightHand"))])
    found = [one for one in scan(clip.with_motion(rotation, clip.translation), known) if one.kind == "jump"]
    assert [one.start for one in found] == [90]
    assert found[0].note.startswith("Left")


def test_a_body_that_runs_jumps_as_far_as_one_that_stands(data):
    clip = load(data / "cmu_run.bvh")
    clip = clip.slice(1, len(clip))
    assert not [one for one in scan(clip) if one.kind == "jump"]
    translation, at = clip.translation.copy(), len(clip) // 2
    translation[at:, 0] += 0.35 * np.array([0.6, 0.0, 0.8])
    found = [one for one in scan(clip.with_motion(clip.rotation, translation)) if one.kind == "jump"]
    assert [(one.joints, one.start) for one in found] == [(None, at)]


@pytest.mark.parametrize("part", [slice(0, 20), slice(-20, None)])
def test_a_limb_that_is_held_to_an_end_is_frozen(cmu_walk, part):
    """It jumps at neither: its joints stop in the very same frames."""
    clip = cmu_walk.slice(1, 200)
    leg = [clip.skeleton.index(name) for name in ("LeftUpLeg", "LeftLeg", "LeftFoot")]
    rotation = clip.rotation.copy()
    rotation[part, leg] = rotation[part.stop if part.start == 0 else part.start - 1, leg]
    held = clip.with_motion(rotation, clip.translation)
    (found,) = [one for one in scan(held) if one.kind == "frozen"]
    assert {"LeftUpLeg", "LeftLeg"} <= {*found.joints}
    frames = range(len(clip))[part]
    assert abs(found.start - frames[0]) <= 1
    assert abs(found.stop - frames[-1] - 1) <= 1


def test_who_stands_to_be_measured_stays(cmu_walk):
    """To `recover` and `denoise`, too: a rest pose of less than a second is no snap then."""
    walk = cmu_walk.slice(1, len(cmu_walk))
    rotation = np.concatenate([np.repeat(walk.skeleton.rest_rotation[None], 24, axis=0), walk.rotation])
    translation = np.concatenate([np.repeat(walk.translation[:1], 24, axis=0), walk.translation])
    clip = walk.with_motion(rotation, translation)
    assert intact(clip).rotation[:24].all()
    for done in (interpose.recover(clip), interpose.denoise(clip)):
        off = np.linalg.norm(done.clip.positions() - clip.positions(), axis=-1)[:23]
        assert off.max() < 0.02


def test_what_carries_the_body_need_not_turn_to_jump_away_and_back(cmu_walk):
    walk = under_root(cmu_walk.slice(1, 200), goes=True)
    translation = walk.translation.copy()
    translation[90:95, 0] += [0.3, 0.0, 0.3]
    found = [one for one in scan(walk.with_motion(walk.rotation, translation)) if one.kind != "noisy"]
    assert ("lost", ("root",), 90, 95) in spans(found)
    assert "jump" not in {one.kind for one in found}


def with_chair(clip: Clip, place: np.ndarray) -> Clip:
    """A chair beside the body, at places (F, 3)."""
    skeleton = clip.skeleton
    both = Skeleton(
        (*skeleton.names, "Chair"),
        (*skeleton.parents, -1),
        np.append(skeleton.rest_translation, [[0.0] * 3], 0),
    )
    still = np.broadcast_to(rotations.identity(), (len(clip), 1, 4))
    rotation = np.concatenate([clip.rotation, still], axis=1)
    translation = np.concatenate([clip.translation, place[:, None]], axis=1)
    return Clip(both, rotation, translation, clip.fps, (*clip.translated, len(skeleton)))


def test_a_chair_stands_where_it_was_put_and_where_it_jumps_it_is_the_chair(cmu_walk):
    time = np.arange(len(cmu_walk))
    pushed = np.zeros((len(cmu_walk), 3))
    pushed[:, 0] = 1.0 + 0.3 * (1 - np.cos(np.pi * np.clip((time - 90) / 60, 0, 1)))
    assert scan(with_chair(cmu_walk, pushed)) == scan(cmu_walk)
    pushed[120:, 2] += 1.5
    (found,) = [one for one in scan(with_chair(cmu_walk, pushed)) if one.kind == "jump"]
    assert found.joints == ("Chair",)
