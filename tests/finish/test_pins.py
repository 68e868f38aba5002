"""Pins on a real walk: met where bones allow it, smoothly, and nothing observed changes."""

from __future__ import annotations

import shutil
from dataclasses import replace

import numpy as np
import pytest

from interpose import tasks
from interpose.errors import RequestError
from interpose.finish import Provenance, anatomy, feet, pins, seams
from interpose.formats import load, save
from interpose.geometry import kinematics, rotations
from interpose.methods.base.observed import pinned
from interpose.methods.classical import Spline
from interpose.methods.protocol import Raw
from interpose.observation import Gap, Observation, Pin
from interpose.skeletons import JOINTS, PARENTS, find_humanoid, find_mapping
from interpose.skeletons.humanoid import reflect

GAP = Gap(70, 100)
ARM = ("LeftArm", "LeftForeArm", "LeftHand")


def lifted(clip, frame=85, up=(0.0, 0.4, 0.1), joint="LeftHand"):
    """A pin some way from where the joint is."""
    return Pin(joint, np.array([frame]), clip.positions()[[frame], clip.skeleton.index(joint)] + up)


@pytest.mark.parametrize("joint", ["rhand", "lwrist", "lfingers"])
def test_pins_are_met_by_joints_of_few_axes(data, tmp_path, joint):
    """Wrists and elbows of AMC files turn about one or two: what is written is where it is pinned."""
    clip = load(data / "cmu_02_03.amc")
    pin = lifted(clip, 20, (0.1, 0.1, 0.1), joint)
    done = tasks.fill(clip, [Gap(10, 30)], "spline", pins=[pin])
    shutil.copy(data / "cmu_02.asf", tmp_path)
    save(done.clip, tmp_path / "filled.amc")
    back = load(tmp_path / "filled.amc").positions()[20, clip.skeleton.index(joint)]
    assert np.linalg.norm(back - pin.position[0]) < 1.1e-3
    assert not [note for note in done.report.gaps[0].notes if "misses" in note]


def test_turns_that_joints_of_few_axes_cannot_make_are_flagged(data, cmu_walk):
    """A hand that is held as it was comes to its place, and cannot be turned as it was."""
    for clip, joint, far in ((load(data / "cmu_02_03.amc"), "rhand", True), (cmu_walk, "RightHand", False)):
        turned, placed = (some[9, clip.skeleton.index(joint)] for some in clip.kinematics())
        frames = np.arange(15, 25)
        held = Pin(
            joint, frames, np.tile(placed + np.array([0.0, 0.1, 0.0]), (10, 1)), np.tile(turned, (10, 1))
        )
        notes = tasks.fill(clip, [Gap(10, 30)], "spline", pins=[held]).report.gaps[0].notes
        assert any("otherwise than its pin says" in note for note in notes) is far


def test_of_pins_out_of_reach_the_nearest_round_counts(data):
    clip = load(data / "cmu_02_03.amc")
    pin = lifted(clip, 20, (0.0, 2.0, 0.0), "rhand")
    done = tasks.fill(clip, [Gap(10, 30)], "spline", pins=[pin])
    hand = clip.skeleton.index("rhand")
    free = replace(clip, source=None)
    other = tasks.fill(free, [Gap(10, 30)], "spline", pins=[pin])
    off = [np.linalg.norm(one.clip.positions()[20, hand] - pin.position[0]) for one in (done, other)]
    assert off[0] < off[1] + 0.05


@pytest.mark.parametrize("method", ["spline", "small", "cae"])
def test_a_hand_is_where_it_is_pinned_and_all_observed_values_are_the_same(cmu_walk, method):
    pin = lifted(cmu_walk)
    done = tasks.fill(cmu_walk, [GAP], method, pins=[pin])
    hand = cmu_walk.skeleton.index("LeftHand")
    np.testing.assert_allclose(done.clip.positions()[85, hand], pin.position[0], atol=1e-3)
    for at in (slice(0, 70), slice(100, None)):
        assert done.clip.rotation[at].tobytes() == cmu_walk.rotation[at].tobytes()
        assert done.clip.translation[at].tobytes() == cmu_walk.translation[at].tobytes()
    gap = done.report.gaps[0]
    assert gap.pins is not None
    assert gap.pins < 0.1
    assert gap.method == method, gap.notes


def test_feet_stay_and_velocities_do_not_jump(cmu_walk):
    seen = Observation.from_gaps(cmu_walk, [GAP])
    free, done = (tasks.fill(cmu_walk, [GAP], "spline", pins=some).clip for some in ((), [lifted(cmu_walk)]))
    ends = feet.ends(cmu_walk.skeleton)
    moved = np.linalg.norm(done.positions() - free.positions(), axis=-1)
    assert moved[GAP.start : GAP.stop, ends].max() < 0.01
    hand = cmu_walk.skeleton.index("LeftHand")
    assert moved[85, hand] > 0.3
    jumps = np.linalg.norm(np.diff(done.positions(), n=2, axis=0), axis=-1)[GAP.start - 1 : GAP.stop]
    assert jumps.max() < 2 * seams.PEAKS * seams.limits(cmu_walk, seen).max()


def test_a_network_goes_to_a_pin_and_back_and_does_not_jump_there_for_a_frame(cmu_walk):
    """The hand comes and goes by .4 m within half a second each: 13 m/s^2; in a single frame 39."""
    hand = cmu_walk.skeleton.index("LeftHand")
    free = tasks.fill(cmu_walk, [GAP], "small").clip.positions()
    pin = Pin("LeftHand", np.array([85]), free[[85], hand] + [0.0, 0.4, 0.1])
    done = tasks.fill(cmu_walk, [GAP], "small", pins=[pin]).clip.positions()
    ways = [np.linalg.norm(np.diff(some[83:88, hand], n=2, axis=0), axis=-1).max() for some in (free, done)]
    assert (ways[1] - ways[0]) * cmu_walk.fps**2 < 13


def test_a_hand_slows_down_to_the_place_that_it_holds_while_the_body_goes_on(cmu_walk):
    """Gone to at rest against the body, it would stop within a frame: 15 m/s^2."""
    gap, hand, frames = Gap(60, 120), cmu_walk.skeleton.index("LeftHand"), np.arange(85, 95)
    free = tasks.fill(cmu_walk, [gap], "small").clip.positions()
    pin = Pin("LeftHand", frames, np.tile(free[90, hand] + [0.0, 0.1, 0.0], (10, 1)))
    done = tasks.fill(cmu_walk, [gap], "small", pins=[pin]).clip.positions()
    jumps = np.linalg.norm(np.diff(done[:, hand], n=2, axis=0), axis=-1)[80:90]
    assert jumps.max() * cmu_walk.fps**2 < 8


def test_a_hand_leaves_its_own_way_a_third_of_a_second_before_it_holds_a_place(cmu_walk):
    """Sooner it would be led by nothing for long, later it would be jerked: 10 m/s^2."""
    gap, hand, frames = Gap(60, 120), cmu_walk.skeleton.index("LeftHand"), np.arange(90, 100)
    free = tasks.fill(cmu_walk, [gap], "spline").clip.positions()
    pin = Pin("LeftHand", frames, np.tile(free[95, hand] + [0.0, 0.1, 0.0], (10, 1)))
    done = tasks.fill(cmu_walk, [gap], "spline", pins=[pin]).clip.positions()
    jumps = np.linalg.norm(np.diff(done[:, hand], n=2, axis=0), axis=-1) * cmu_walk.fps**2
    assert jumps[84:106].max() < 8.5
    assert jumps[68:79].max() < 2


def test_the_rest_of_the_body_makes_room_evenly(cmu_walk):
    """A hand at the ear, where frames that are solved each for itself throw the elbow about: 42 m/s^2."""
    gap, hand, head = Gap(60, 120), *(cmu_walk.skeleton.index(name) for name in ("LeftHand", "Head"))
    free = tasks.fill(cmu_walk, [gap], "small").clip.positions()
    sides = [free[85, cmu_walk.skeleton.index(side + "Arm")] for side in ("Left", "Right")]
    side = (sides[0] - sides[1]) / np.linalg.norm(sides[0] - sides[1])
    pin = Pin("LeftHand", np.array([85]), [free[85, head] + 0.05 * side])
    done = tasks.fill(cmu_walk, [gap], "small", pins=[pin]).clip.positions()
    np.testing.assert_allclose(done[85, hand], pin.position[0], atol=1e-3)
    elbow = done[gap.start - 2 : gap.stop + 1, cmu_walk.skeleton.index("LeftForeArm")]
    assert np.linalg.norm(np.diff(elbow, n=2, axis=0), axis=-1).max() * cmu_walk.fps**2 < 25


def test_a_place_is_held_for_as_long_as_it_is_pinned(cmu_walk):
    frames = np.arange(80, 90)
    where = np.tile(lifted(cmu_walk).position, (10, 1))
    done = tasks.fill(cmu_walk, [GAP], "spline", pins=[Pin("LeftHand", frames, where)])
    hand = done.clip.positions()[frames, cmu_walk.skeleton.index("LeftHand")]
    np.testing.assert_allclose(hand, where, atol=1e-3)


def test_what_is_out_of_reach_is_met_as_nearly_as_bones_allow_and_said(cmu_walk):
    """With the body observed a hand comes no nearer than an arm is long."""
    skeleton, placed = cmu_walk.skeleton, cmu_walk.positions()
    shoulder, elbow, hand = (skeleton.index(name) for name in ARM)
    far = placed[85, shoulder] + [2.0, 1.0, 0.0]
    pin = Pin("LeftHand", np.array([85]), far[None])
    done = tasks.fill(cmu_walk, [Gap(70, 100, ARM)], "spline", pins=[pin])
    arm = sum(np.linalg.norm(placed[85, b] - placed[85, a]) for a, b in ((shoulder, elbow), (elbow, hand)))
    nearest = np.linalg.norm(far - placed[85, shoulder]) - arm
    off = np.linalg.norm(done.clip.positions()[85, hand] - far)
    assert nearest <= off < nearest + 0.02
    gap = done.report.gaps[0]
    assert gap.pins == pytest.approx(100 * off)
    assert "out of reach" in " ".join(gap.notes)
    others = [j for j in range(len(skeleton)) if skeleton.names[j] not in ARM]
    assert (done.clip.rotation[:, others] == cmu_walk.rotation[:, others]).all()


def test_an_orientation_is_met_with_a_place(cmu_walk):
    turned = rotations.about("Y", np.array([0.8]))
    pin = replace(lifted(cmu_walk), orientation=turned)
    done = tasks.fill(cmu_walk, [GAP], "spline", pins=[pin]).clip
    globals_, placed = done.kinematics()
    hand = done.skeleton.index("LeftHand")
    assert rotations.angle(globals_[85, hand], turned[0]) < 1e-3
    np.testing.assert_allclose(placed[85, hand], pin.position[0], atol=1e-3)


@pytest.mark.parametrize("degrees", [90.0, 170.0])
def test_a_forearm_takes_its_share_of_how_a_hand_turns_about_it(cmu_walk, degrees):
    """A wrist alone would twist as no wrist does; hand and elbow stay where they are."""
    hand, forearm = (cmu_walk.skeleton.index(name) for name in ("LeftHand", "LeftForeArm"))
    free = tasks.fill(cmu_walk, [GAP], "spline").clip
    turned, placed = (values[85] for values in free.kinematics())
    bone = placed[hand] - placed[forearm]
    about = rotations.exp(np.radians(degrees) * bone / np.linalg.norm(bone))
    pin = Pin("LeftHand", [85], orientation=rotations.multiply(about, turned[hand])[None])
    done = tasks.fill(cmu_walk, [GAP], "spline", pins=[pin]).clip
    there, where = (values[85] for values in done.kinematics())
    assert rotations.angle(there[hand], pin.orientation[0]) < 1e-3
    np.testing.assert_allclose(where[[hand, forearm]], placed[[hand, forearm]], atol=1e-6)
    shares = [
        np.degrees(rotations.angle(done.rotation[85, j], free.rotation[85, j])) for j in (hand, forearm)
    ]
    assert shares == pytest.approx([degrees / 2, degrees / 2], abs=1.0)


@pytest.mark.parametrize("order", [1, -1])
def test_a_hand_and_its_forearm_are_both_turned_as_pinned(cmu_walk, order):
    free = tasks.fill(cmu_walk, [GAP], "spline").clip
    turned = free.kinematics()[0][85]
    more = rotations.about("X", np.array(1.2))
    asked = [
        Pin(name, [85], orientation=rotations.multiply(turn, turned[cmu_walk.skeleton.index(name)])[None])
        for name, turn in (("LeftHand", more), ("LeftForeArm", rotations.identity()))
    ]
    done = tasks.fill(cmu_walk, [GAP], "spline", pins=asked[::order]).clip.kinematics()[0][85]
    for pin in asked:
        assert rotations.angle(done[cmu_walk.skeleton.index(pin.joint)], pin.orientation[0]) < 1e-3


def test_places_and_turns_that_go_together_are_both_met(cmu_walk):
    """Of six joints as they were: nearer to the truth than places alone lead, and no one is torn away."""
    frames = np.arange(GAP.start, GAP.stop)
    turned, placed = cmu_walk.kinematics()
    off = []
    for both in (False, True):
        pinned = []
        for name in ("Hips", "Head", "LeftHand", "RightHand", "LeftFoot", "RightFoot"):
            joint = cmu_walk.skeleton.index(name)
            pinned.append(Pin(name, frames, placed[frames, joint], turned[frames, joint] if both else None))
        done = tasks.fill(cmu_walk, [GAP], "small", pins=pinned).clip
        assert max(far for *_, far in pins.missed(done, tuple(pinned))) < 1e-3
        off.append(np.linalg.norm(done.positions() - cmu_walk.positions(), axis=-1)[frames].mean())
    assert off[1] < 0.9 * off[0]


@pytest.mark.parametrize("placed", [False, True])
@pytest.mark.parametrize("about", ["X", "Y"])
def test_feet_stay_where_hips_are_turned(cmu_walk, about, placed):
    free = tasks.fill(cmu_walk, [GAP], "spline").clip
    there = rotations.multiply(rotations.about(about, np.radians(25.0)), free.kinematics()[0][85, 0])
    pin = Pin("Hips", [85], free.positions()[[85], 0] if placed else None, [there])
    done = tasks.fill(cmu_walk, [GAP], "spline", pins=[pin]).clip
    assert rotations.angle(done.kinematics()[0][85, 0], there) < np.radians(0.1)
    ends = feet.ends(done.skeleton)
    assert np.linalg.norm(done.positions()[85, ends] - free.positions()[85, ends], axis=-1).max() < 0.03


@pytest.mark.parametrize("off", [(0.0, 0.15, 0.0), (0.5, 0.0, 0.0), (1.0, 0.0, 0.0)])
def test_hips_that_are_placed_and_turned_come_there_and_feet_give_way(cmu_walk, off):
    free = tasks.fill(cmu_walk, [GAP], "spline").clip
    there = rotations.multiply(rotations.about("Y", np.radians(10.0)), free.kinematics()[0][85, 0])
    pin = Pin("Hips", np.array([85]), free.positions()[[85], 0] + off, there[None])
    done = tasks.fill(cmu_walk, [GAP], "spline", pins=[pin]).clip
    assert np.linalg.norm(done.positions()[85, 0] - pin.position[0]) < 2e-3
    assert rotations.angle(done.kinematics()[0][85, 0], there) < np.radians(0.1)


def test_a_foot_is_where_it_is_pinned_as_hips_are_turned(cmu_walk):
    free = tasks.fill(cmu_walk, [GAP], "spline").clip
    there = rotations.multiply(rotations.about("Y", np.radians(15.0)), free.kinematics()[0][85, 0])
    foot = lifted(free, up=(0.1, 0.1, 0.0), joint="LeftFoot")
    turned = Pin("Hips", np.array([85]), None, there[None])
    done = tasks.fill(cmu_walk, [GAP], "spline", pins=[foot, turned]).clip
    assert max(far for *_, far in pins.missed(done, (foot,))) < 3e-3


def test_a_neck_takes_its_share_of_how_a_head_turns(cmu_walk):
    head, neck = (find_mapping(cmu_walk.skeleton)[name] for name in ("Head", "Neck"))
    free = tasks.fill(cmu_walk, [GAP], "spline").clip
    there = rotations.multiply(rotations.about("Y", np.radians(60.0)), free.kinematics()[0][85, head])
    pin = Pin(cmu_walk.skeleton.names[head], [85], None, [there])
    done = tasks.fill(cmu_walk, [GAP], "spline", pins=[pin]).clip
    assert rotations.angle(done.kinematics()[0][85, head], there) < np.radians(0.1)
    own = [np.degrees(rotations.angle(done.rotation[85, j], free.rotation[85, j])) for j in (head, neck)]
    assert max(own) < 35


def test_all_of_a_body_goes_along_whose_hips_are_pinned_far_away(cmu_walk):
    """As after an end that nothing follows: it is not torn apart."""
    free = tasks.forecast(cmu_walk.slice(0, 100), 40, method="spline").clip
    seen = Observation.from_gaps(free, [Gap(100, 140)])
    frames = np.arange(100, 140)
    aside = np.linspace(0, 1, 40)[:, None] * [1.5, 0.0, 0.0]
    done = tasks.fill(free, seen, "spline", pins=[Pin("Hips", frames, free.root[frames] + aside)]).clip
    here, there = (one.positions()[139] - one.root[139] for one in (free, done))
    assert np.linalg.norm(here - there, axis=-1).max() < 0.2


@pytest.mark.parametrize("height", [0.3, 0.1])
def test_who_reaches_down_bends_as_people_do(cmu_walk, height):
    """In hips and knees: a spine that folds up leaves them where they were."""
    body, hand = find_humanoid(cmu_walk), cmu_walk.skeleton.index("RightHand")
    free = tasks.fill(cmu_walk, [GAP], "small").clip
    place = free.positions()[90, hand]
    place[1] = height
    pin = Pin("RightHand", np.arange(88, 93), np.tile(place, (5, 1)))
    done = tasks.fill(cmu_walk, [GAP], "small", pins=[pin]).clip
    np.testing.assert_allclose(done.positions()[90, hand], place, atol=1e-3)
    neck = JOINTS.index("Neck")
    long, short = (
        np.linalg.norm(placed[90, neck] - placed[90, 0]) for placed in map(body.positions, (free, done))
    )
    assert short > 0.85 * long
    local = kinematics.local_rotations(body.rotations(done), PARENTS)[90]
    trunk = [JOINTS.index(name) for name in ("Spine", "Spine1", "Spine2", "Neck")]
    assert np.degrees(rotations.angle(local[trunk], rotations.identity())).max() < 45


def test_the_result_follows_when_the_room_is_turned(cmu_walk):
    turn, away = rotations.about("Y", np.array(1.1)), np.array([3.0, 0.0, -2.0])
    pin = lifted(cmu_walk)
    root = cmu_walk.translated.index(0)
    rotation, translation = cmu_walk.rotation.copy(), cmu_walk.translation.copy()
    rotation[:, 0] = rotations.multiply(turn, rotation[:, 0])
    translation[:, root] = rotations.rotate(turn, translation[:, root]) + away
    moved = cmu_walk.with_motion(rotation, translation)
    there = replace(pin, position=rotations.rotate(turn, pin.position) + away)
    a = tasks.fill(cmu_walk, [GAP], "spline", pins=[pin]).clip.positions()
    b = tasks.fill(moved, [GAP], "spline", pins=[there]).clip.positions()
    np.testing.assert_allclose(rotations.rotate(turn, a) + away, b, atol=1e-4)


def test_a_forecast_may_end_at_a_pin(cmu_walk):
    """Where the clip ends within the gap there is no frame behind the pin to come back to."""
    cut = cmu_walk.slice(0, 100)
    done = tasks.fill(cut, [GAP], "spline", pins=[lifted(cmu_walk, 95)]).clip
    hand = cut.skeleton.index("LeftHand")
    np.testing.assert_allclose(done.positions()[95, hand], lifted(cmu_walk, 95).position[0], atol=1e-3)


@pytest.mark.parametrize(
    ("pin", "why"),
    [
        (Pin("LeftHand", np.array([20]), np.zeros((1, 3))), "cannot be pinned at frame 20"),
        (Pin("LeftHand", np.array([900]), np.zeros((1, 3))), "no frame 900"),
        (Pin("LeftHand", np.array([80]), np.zeros((2, 3))), "does not fit"),
        (Pin("LeftHand", np.array([80]), np.full((1, 3), np.nan)), "does not fit"),
        (Pin("LeftHand", np.array([80])), "says nothing"),
        (Pin("LeftHand", np.array([80.5]), np.zeros((1, 3))), "whole numbers"),
        (Pin("LeftHand", np.array([], int), np.zeros((0, 3))), "one or more"),
        (Pin("LeftHand", np.array([80]), np.zeros((1, 3)), tolerance=0.0), "above zero"),
        (Pin("LeftHand", np.array([80]), None, np.zeros((1, 4))), "is zero"),
        (Pin("Nose", np.array([80]), np.zeros((1, 3))), "unknown joint"),
    ],
)
def test_pins_that_make_no_sense_are_refused(cmu_walk, pin, why):
    with pytest.raises(RequestError, match=why):
        tasks.fill(cmu_walk, [GAP], "spline", pins=[pin])


def test_several_pins_of_a_joint_count_as_one(cmu_walk):
    one, two = lifted(cmu_walk, 80), lifted(cmu_walk, 90)
    both = Pin("LeftHand", np.array([80, 90]), np.concatenate([one.position, two.position]))
    done = [
        tasks.fill(cmu_walk, [GAP], "spline", pins=some) for some in ([one, two], [both], [one, one, two])
    ]
    assert all(gap.pins < 0.1 for fill in done for gap in fill.report.gaps)
    for fill in done[1:]:
        np.testing.assert_allclose(fill.clip.positions(), done[0].clip.positions(), atol=1e-6)


def test_what_a_pin_tears_is_measured_and_said(cmu_walk):
    """Right beside a seam there is no time to come: the pin is met, and the report says that it jumps."""
    done = tasks.fill(cmu_walk, [GAP], "spline", pins=[lifted(cmu_walk, 70)])
    gap = done.report.gaps[0]
    jump = np.linalg.norm(np.diff(done.clip.positions()[68:71], n=2, axis=0), axis=-1).max()
    assert gap.pins < 0.1
    assert gap.seam_after == pytest.approx(100 * jump, rel=0.01)
    assert "flagged: the velocity jumps" in " ".join(gap.notes)


def test_what_is_torn_at_a_seam_and_inside_is_said_of_both(cmu_walk):
    free = tasks.fill(cmu_walk, [GAP], "spline").clip.positions()
    hand = cmu_walk.skeleton.index("LeftHand")
    pin = Pin("LeftHand", [GAP.start + 1], free[[GAP.start + 1], hand] + [0.5, 0.4, 0.0])
    (gap,) = tasks.fill(cmu_walk, [GAP], "spline", pins=[pin]).report.gaps
    assert gap.seam_after > gap.seam_limit
    assert gap.peak > gap.peak_limit
    flags = [note for note in gap.notes if "the velocity jumps" in note]
    assert ["at a seam" in note for note in flags].count(True) == 1
    assert ["inside the gap" in note for note in flags].count(True) == 1


def test_a_pin_in_the_next_street_is_asked_about(cmu_walk):
    gap = tasks.fill(cmu_walk, [GAP], "spline", pins=[lifted(cmu_walk, up=(0, 0, 30))]).report.gaps[0]
    assert "is the unit right?" in " ".join(gap.notes)
    half = cmu_walk.slice(0, 100)
    for away, asked in ((3.0, False), (300.0, True)):
        pin = lifted(half, 90, (0.0, 0.0, away), "Hips")
        (gap,) = tasks.fill(half, [Gap(70, 100)], "spline", pins=[pin]).report.gaps
        assert any("is the unit right?" in note for note in gap.notes) is asked, "an end may be anywhere"


def test_each_joint_that_misses_its_pin_is_said(cmu_walk):
    pinned = [lifted(cmu_walk, up=(0.0, 2.5, 0.0), joint=name) for name in ("LeftHand", "RightHand")]
    pinned.append(lifted(cmu_walk, up=(0.0, 0.0, 0.0), joint="Hips"))
    (gap,) = tasks.fill(cmu_walk, [GAP], "spline", pins=pinned).report.gaps
    missed = [note for note in gap.notes if "misses its pin" in note]
    assert len(missed) >= 2, gap.notes


def test_a_path_and_a_pin_are_both_reported(cmu_walk):
    path = {85: cmu_walk.root[85, [0, 2]] + [0.1, 0.0]}
    gap = tasks.fill(cmu_walk, [GAP], "spline", path=path, pins=[lifted(cmu_walk)]).report.gaps[0]
    assert gap.pins < 0.1
    assert gap.path is not None


def test_what_is_said_of_a_motion_is_said_of_it_with_a_pin(cmu_walk):
    """How the method's own was, what was done to it, and what the path does to it."""

    class Torn(Spline):
        name = "torn"

        def complete(self, clip, observation, seed=None):
            done = super().complete(clip, observation, seed).clip
            done.translation[75, 0, 1] += 0.15
            return Raw(done)

    pin = lifted(cmu_walk, 90, up=(0, 0.02, 0))
    plain, pinned = (tasks.fill(cmu_walk, [GAP], Torn(), pins=some) for some in ((), [pin]))
    one, other = plain.report.gaps[0], pinned.report.gaps[0]
    assert one.seam_before == other.seam_before
    assert one.foot_slide_before == other.foot_slide_before
    (led,) = [note for note in one.notes if note.startswith("a spline leads")]
    assert led in other.notes
    corrected = plain.provenance == Provenance.CORRECTED
    assert corrected.any()
    assert (pinned.provenance[corrected] == Provenance.CORRECTED).all()
    arm = cmu_walk.skeleton.index("LeftArm")
    assert (pinned.provenance[88:93, arm] == Provenance.CORRECTED).all()
    point = {85: cmu_walk.root[85, [0, 2]] + [1.5, 0.0]}
    for some in ((), [pin]):
        gap = tasks.fill(cmu_walk, [GAP], "spline", path=point, pins=some).report.gaps[0]
        assert sum(note.startswith("the path is met") for note in gap.notes) == 1
        assert any("times as long as without the path" in note for note in gap.notes)


def test_a_spline_does_not_lead_over_what_is_pinned(cmu_walk):
    """It would be put back, and jump."""
    pin = lifted(cmu_walk, GAP.start + 3, up=(0, 0.6, 0))
    gap = tasks.fill(cmu_walk, [GAP], "small", pins=[pin]).report.gaps[0]
    assert gap.pins < 0.1
    assert not any(note.startswith("a spline leads") for note in gap.notes)


def test_what_a_network_expects_is_kept(cmu_walk):
    gap = tasks.fill(cmu_walk, [GAP], "small", pins=[lifted(cmu_walk)]).report.gaps[0]
    assert gap.expected is not None


def test_where_more_is_pinned_less_is_expected_to_be_off(cmu_walk):
    frames, placed = np.arange(GAP.start, GAP.stop), cmu_walk.positions()
    names = ("Hips", "Head", "LeftHand", "RightHand", "LeftFoot", "RightFoot")
    expected = []
    for count in (0, 1, 6):
        pinned = [Pin(name, frames, placed[frames, cmu_walk.skeleton.index(name)]) for name in names[:count]]
        expected.append(tasks.fill(cmu_walk, [GAP], "small", pins=pinned).report.gaps[0].expected)
    assert expected[0] > expected[1] > 1.5 * expected[2]


def test_what_would_not_be_met_is_refused(cmu_walk):
    turned = Pin("LeftHand", np.array([85]), None, rotations.about("Y", np.array([0.8])))
    with pytest.raises(RequestError, match="how it is turned"):
        tasks.fill(cmu_walk, [Gap(70, 100, ("LeftArm",))], "spline", pins=[turned])
    with pytest.raises(RequestError, match="stays open"):
        tasks.fill(cmu_walk, [GAP, Gap(120, 190)], "spline", max_gap=40, pins=[lifted(cmu_walk, 150)])


def test_pins_are_cut_with_their_observation(cmu_walk):
    seen = replace(Observation.from_gaps(cmu_walk, [GAP]), pins=(lifted(cmu_walk),))
    (pin,) = seen.slice(80, 120).pins
    assert pin.frames.tolist() == [5]
    assert seen.slice(0, 80).pins == ()
    assert pins.meet(cmu_walk, Observation.full(cmu_walk), seen.pins) is cmu_walk


def test_one_joint_turned_in_two_ways_is_refused(cmu_walk):
    turns = [Pin("LeftHand", [85], None, [[1.0, 0, 0, 0]]), Pin("LeftHand", [85], None, [[0.6, 0.8, 0, 0]])]
    with pytest.raises(RequestError, match="two turns at frame 85"):
        tasks.fill(cmu_walk, [GAP], "spline", pins=turns)


def test_one_joint_at_two_places_is_refused(cmu_walk):
    there, elsewhere = lifted(cmu_walk), lifted(cmu_walk, up=(0.0, 0.1, 0.1))
    with pytest.raises(RequestError, match="two places at frame 85"):
        tasks.fill(cmu_walk, [GAP], "spline", pins=[there, elsewhere])
    tasks.fill(cmu_walk, [GAP], "spline", pins=[there, replace(there)])


@pytest.mark.parametrize("method", ["small", "spline"])
def test_pins_of_a_left_handed_clip_mean_what_they_do_in_its_mirror_image(cmu_walk, method):
    right = cmu_walk.slice(40, 130)
    left = reflect(right)
    pin = lifted(right, frame=45)
    mirrored = replace(pin, position=pin.position * [-1.0, 1.0, 1.0])
    one, other = (
        tasks.fill(clip, [Gap(30, 60)], method, pins=[own]).clip.positions()
        for clip, own in ((right, pin), (left, mirrored))
    )
    np.testing.assert_allclose(other * [-1.0, 1.0, 1.0], one, atol=1e-4)


def test_what_the_network_is_told_of_pins(cmu_walk):
    """The joint's row, the nearest of its frames, and the place on the scaled body, mirrored where it is."""
    mapping = find_mapping(cmu_walk.skeleton)
    pin = Pin("LeftHand", np.array([41]), np.array([[0.5, 1.0, 2.0]]))
    observation = replace(Observation.from_gaps(cmu_walk, [GAP]), pins=(pin,))
    places, said = pinned(observation, mapping, np.arange(0.0, 200.0, 4.0), np.array([-2.0, 2.0, 2.0]))
    assert np.argwhere(said).tolist() == [[10, JOINTS.index("LeftHand")]]
    np.testing.assert_allclose(places[10, JOINTS.index("LeftHand")], [-1.0, 2.0, 4.0])


def test_turns_past_half_a_turn_go_on_the_same_way(cmu_walk):
    """Pinned at 170, 180 and 190 degrees from where it turns by itself a head goes on, a degree a frame."""
    free = tasks.fill(cmu_walk, [GAP], "spline").clip
    head, frames = cmu_walk.skeleton.index("Head"), np.array([75, 85, 95])
    turned = free.kinematics()[0][frames, head]
    off = rotations.about("Y", np.radians([170.0, 180.0, 190.0]))
    pin = Pin("Head", frames, orientation=rotations.multiply(off, turned))
    done = tasks.fill(cmu_walk, [GAP], "spline", pins=[pin]).clip.kinematics()[0][75:96, head]
    assert rotations.angle(done[[0, 10, 20]], pin.orientation).max() < 1e-3
    assert np.degrees(rotations.angle(done[1:], done[:-1]).max()) < 10


def test_a_leg_bends_as_a_knee_does_to_where_its_foot_is_pinned(cmu_walk):
    """And the foot goes along as it is: its toe stayed behind, and shins turned round in the knee for it."""
    body, turned = find_humanoid(cmu_walk), []
    held = cmu_walk.positions()[80, cmu_walk.skeleton.index("LeftFoot")] + [0.1, 0.2, 0.0]
    pin = Pin("LeftFoot", np.arange(80, 90), np.tile(held, (10, 1)))
    for some in ((), (pin,)):
        turned.append(body.rotations(tasks.fill(cmu_walk, [GAP], "small", pins=some).clip)[70:100])
    twists = [anatomy.knees(one)[0][:, 0].max() for one in turned]
    assert twists[1] < twists[0] + 8.0
    foot = JOINTS.index("LeftFoot")
    off = np.degrees(rotations.angle(turned[1][:, foot], turned[0][:, foot]))
    assert off.max() < 16.0


def test_a_joint_is_held_over_a_key_in_which_it_is_there(cmu_walk):
    """And refused where the key has it elsewhere."""
    hand, (start, stop) = cmu_walk.skeleton.index("LeftHand"), (GAP.start, GAP.stop)
    turned, placed = cmu_walk.slice(start - 1, start).kinematics()
    frames = np.arange(start - 1, start + 6)
    rows = [np.repeat(values[:, hand], len(frames), axis=0) for values in (placed, turned)]
    done = tasks.fill(cmu_walk, [GAP], "spline", pins=[Pin("LeftHand", frames, *rows)]).clip
    where = done.positions()[frames, hand]
    assert np.linalg.norm(where - placed[0, hand], axis=1).max() < 1e-3
    assert done.rotation[start - 1].tobytes() == cmu_walk.rotation[start - 1].tobytes()
    frames = np.arange(start - 2, stop)
    elsewhere = Pin("LeftHand", frames, np.repeat(placed[:, hand], len(frames), axis=0))
    with pytest.raises(RequestError, match=f"cannot be pinned at frame {start - 2}"):
        tasks.fill(cmu_walk, [GAP], "spline", pins=[elsewhere])


@pytest.mark.parametrize("off", [(0.0, 0.4, 0.0), (0.0, 0.3, 0.2)])
def test_a_hand_that_is_held_high_does_not_lift_who_stands_off_the_floor(data, off):
    """A network that is told of it lifts the whole body."""
    still = load(data / "cmu_jump.bvh").take([0] * 90)
    frames, hand = np.arange(35, 55), still.skeleton.index("LeftHand")
    place = np.tile(still.positions()[40, hand] + off, (len(frames), 1))
    done = tasks.fill(still, [Gap(10, 80)], pins=[Pin("LeftHand", frames, place)])
    higher = (done.clip.positions() - still.positions())[:, feet.ends(still.skeleton), 1]
    assert higher.max() < 0.004
    assert higher.min() > -0.004
    assert done.report.gaps[0].pins < 0.1


def test_feet_are_let_down_neither_out_of_a_step_nor_through_the_floor(data):
    """Who lands steps at other times with a pin than without: feet slid at 5 cm/s, 3 cm under the floor."""
    jump = load(data / "cmu_jump.bvh")
    gap, hand, ends = Gap(60, 110), jump.skeleton.index("RightHand"), feet.ends(jump.skeleton)
    free = tasks.fill(jump, [gap]).clip.positions()
    place = free[85:86, hand] + [0.0, 0.5, 0.0]
    done = tasks.fill(jump, [gap], pins=[Pin("RightHand", np.array([85]), place)])
    assert done.report.gaps[0].foot_slide < 2
    assert done.clip.positions()[:, ends, 1].min() > free[:, ends, 1].min() - 0.01


def test_how_a_joint_with_lost_parents_is_turned_is_not_known(cmu_walk):
    """And cannot be pinned, as its own rotation is known: whatever stands in the lost values."""
    gap, hand = Gap(90, 130, ("RightArm", "RightForeArm")), cmu_walk.skeleton.index("RightHand")
    turned = cmu_walk.kinematics()[0][110:111, hand]
    with pytest.raises(RequestError, match="cannot be pinned at frame 110"):
        tasks.fill(cmu_walk, [gap], "spline", pins=[Pin("RightHand", np.array([110]), None, turned)])
