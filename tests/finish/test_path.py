"""A filled motion that is led over points of the floor."""

from __future__ import annotations

import numpy as np
import pytest

import interpose
from interpose.finish import Provenance, anatomy
from interpose.finish.path import FASTEST, _no_faster, follow
from interpose.geometry import measures, rotations
from interpose.skeletons import find_humanoid
from interpose.skeletons.body import facing
from interpose.skeletons.humanoid import reflect

GAP, MIDDLE = (140, 190), 165


@pytest.fixture(scope="module")
def aside(cmu_walk):  # type: ignore[no-untyped-def]
    """Half a metre to the side of where the walk is in the middle of the gap."""
    way = cmu_walk.root[GAP[1]] - cmu_walk.root[GAP[0] - 1]
    across = np.array([way[2], -way[0]]) / np.hypot(way[0], way[2])
    return cmu_walk.root[MIDDLE, [0, 2]] + 0.5 * across


@pytest.mark.parametrize("method", ["spline", "cae", "cmib"])
def test_the_path_is_met_and_everything_else_holds(cmu_walk, aside, method):
    done = interpose.fill(cmu_walk, GAP, method=method, path={MIDDLE: aside})
    assert np.linalg.norm(done.clip.root[MIDDLE, [0, 2]] - aside) < 0.01
    outside = np.r_[0 : GAP[0], GAP[1] : len(cmu_walk)]
    assert done.clip.rotation[outside].tobytes() == cmu_walk.rotation[outside].tobytes()
    (report,) = done.report.gaps
    assert report.path < 1
    assert report.seam_after <= report.seam_limit
    assert report.bone_deviation < 1e-6
    assert report.foot_slide < 25
    assert any("the path is met within 0." in note for note in report.notes)


def test_who_is_led_along_a_way_takes_steps_for_it(cmu_walk):
    """From standing there and back: the network is told of the way, instead of being moved over it."""
    stands = cmu_walk.take(np.repeat(90, 210))
    way = (cmu_walk.root[150] - cmu_walk.root[90])[[0, 2]]
    way /= np.linalg.norm(way)
    there = {30 + k: stands.root[0, [0, 2]] + way * 0.04 * min(k, 150 - k) for k in range(15, 150, 15)}
    done = interpose.fill(stands, (30, 180), method="small", path=there)
    (gap,) = done.report.gaps
    assert gap.path < 1
    assert gap.gliding < 0.3


@pytest.mark.parametrize(("side", "quarters"), [(1, 3), (-1, 3), (1, 4), (-1, 4)])
def test_who_is_led_round_a_circle_turns_along(cmu_walk, side, quarters):
    """And nobody asks whether a quarter the other way is meant, as without the path."""
    course = float(facing(find_humanoid(cmu_walk).positions(cmu_walk.slice(60, 61)))[0])
    stands = cmu_walk.take(np.repeat(60, 240))
    angles = side * quarters * np.pi / 2 * np.clip((np.arange(240) - 29) / 181, 0, 1)
    heading = course + angles
    start = stands.root[0, [0, 2]]
    ring = np.stack([np.cos(course) - np.cos(heading), np.sin(heading) - np.sin(course)], axis=1)
    way = start + side * 1.2 * ring
    rotation, translation = stands.rotation.copy(), stands.translation.copy()
    rotation[:, 0] = rotations.multiply(rotations.about("Y", angles), rotation[:, 0])
    translation[:, 0, [0, 2]] = way
    clip = stands.with_motion(rotation, translation)
    path = {frame: way[frame] for frame in range(45, 205, 15)}
    done = interpose.fill(clip, (30, 210), method="small", path=path)
    turned = anatomy.turning(done.clip.slice(29, 211))[-1]
    assert turned == pytest.approx(side * quarters * np.pi / 2, abs=0.1)
    (gap,) = done.report.gaps
    assert not any("it turns by" in note for note in gap.notes)
    if quarters == 4:
        across = np.array([-1.0, 1.0])
        mirrored = {frame: point * across for frame, point in path.items()}
        other = interpose.fill(reflect(clip), (30, 210), method="small", path=mirrored)
        assert np.abs(other.clip.positions() * [-1.0, 1.0, 1.0] - done.clip.positions()).max() < 1e-6


def test_who_is_led_aside_does_not_jolt_up_and_down(cmu_walk):
    """Each window comes with a height of its own: from one to the next speed jumped by .14 m/s, in a walk."""
    hips = cmu_walk.positions()[:, 0]
    way = hips[120] - hips[60]
    aside = 0.5 * np.array([-way[2], way[0]]) / np.hypot(way[0], way[2])
    done = interpose.fill(cmu_walk, (60, 120), path={90: 0.5 * (hips[60] + hips[120])[[0, 2]] + aside})
    speed = np.diff(done.clip.positions()[:, 0, 1]) * cmu_walk.fps
    assert np.abs(np.diff(speed))[58:121].max() < 0.1


def test_the_body_turns_along_the_way_and_the_ends_stay(cmu_walk, aside):
    led = follow(cmu_walk, *GAP, {MIDDLE: aside})
    assert np.linalg.norm(led.root[MIDDLE, [0, 2]] - aside) < 1e-9
    assert np.array_equal(led.root[:, 1], cmu_walk.root[:, 1])
    assert measures.acceleration((led.root - cmu_walk.root)[[GAP[0] - 2, GAP[0] - 1, GAP[0]]]).max() < 0.003

    def heading(clip):  # type: ignore[no-untyped-def]
        step = np.gradient(clip.root, axis=0)
        return np.arctan2(step[:, 0], step[:, 2])

    turn = rotations.multiply(led.rotation[:, 0], rotations.conjugate(cmu_walk.rotation[:, 0]))
    turned = 2 * np.arctan2(turn[:, 2], turn[:, 0])
    wanted = np.angle(np.exp(1j * (heading(led) - heading(cmu_walk))))
    middle = slice(GAP[0] + 12, GAP[1] - 12)
    assert np.abs(np.angle(np.exp(1j * (turned - wanted))))[middle].max() < 0.25
    assert np.ptp(wanted[middle]) > 0.5, "there is something to turn by"


@pytest.mark.parametrize("there", [(0.8, 0.0), (0.0, 0.8), (-0.8, 0.0), (0.0, -0.8)])
def test_a_way_that_turns_back_does_not_whip_the_body_round(cmu_walk, there):
    """The direction of a way may turn by more than half a turn within moments."""
    led = follow(cmu_walk, *GAP, {MIDDLE: cmu_walk.root[MIDDLE, [0, 2]] + there})
    turn = rotations.multiply(led.rotation[:, 0], rotations.conjugate(cmu_walk.rotation[:, 0]))
    steps = rotations.angle(turn[1:], turn[:-1])
    assert np.degrees(steps.max()) * cmu_walk.fps < 205


def test_a_path_through_where_it_goes_anyway_changes_nothing(cmu_walk):
    plain = interpose.fill(cmu_walk, GAP, method="spline").clip
    led = interpose.fill(cmu_walk, GAP, method="spline", path={MIDDLE: plain.root[MIDDLE, [0, 2]]}).clip
    assert np.linalg.norm(led.positions() - plain.positions(), axis=-1).max() < 0.02


def test_the_path_turns_with_the_clip(cmu_walk, aside):
    turn = rotations.about("Y", np.array(0.8))
    rotation = cmu_walk.rotation.copy()
    rotation[:, 0] = rotations.multiply(turn, rotation[:, 0])
    turned = cmu_walk.with_motion(rotation, rotations.rotate(turn, cmu_walk.translation))
    point = rotations.rotate(turn, np.array([aside[0], 0.0, aside[1]]))[[0, 2]]
    one = interpose.fill(cmu_walk, GAP, method="spline", path={MIDDLE: aside}).clip.positions()
    other = interpose.fill(turned, GAP, method="spline", path={MIDDLE: point}).clip.positions()
    assert np.abs(rotations.rotate(turn, one) - other).max() < 1e-3


@pytest.mark.parametrize("frame", [-1, 10, 74, 135, 500])
def test_a_path_outside_of_the_gaps_is_refused(cmu_walk, frame):
    with pytest.raises(interpose.RequestError, match=f"through frame {frame}"):
        interpose.fill(cmu_walk, GAP, path={frame: (0.0, 0.0)})


def test_a_way_that_the_motion_does_not_walk_is_said(cmu_walk):
    """From frame 95 to 130 it turns on the spot."""
    point = cmu_walk.root[112, [0, 2]] + [1.0, 0.0]
    (report,) = interpose.fill(cmu_walk, (95, 130), method="spline", path={112: point}).report.gaps
    assert any("times as long as" in note for note in report.notes)


@pytest.mark.parametrize(("aside", "said"), [(0.5, False), (1.2, True)])
def test_a_detour_is_said_from_half_as_long_again_on(cmu_walk, aside, said):
    point = cmu_walk.root[MIDDLE, [0, 2]] + [aside, 0.0]
    (report,) = interpose.fill(cmu_walk, GAP, method="spline", path={MIDDLE: point}).report.gaps
    assert any("times as long as" in note for note in report.notes) == said


def test_a_gap_that_a_simpler_method_filled_is_said_to_be_its(cmu_walk, data):
    """None that `stmi-gan` fills: led, or with the arm of another clip in it, it is still the spline's."""
    gap, jump = (50, 150), interpose.load(data / "cmu_jump.bvh")
    plain = interpose.fill(cmu_walk, gap, method="stmi-gan")
    (why,) = [note for note in plain.report.gaps[0].notes if "instead" in note]
    point = plain.clip.root[100, [0, 2]]
    part = interpose.Part(jump, 40, 48, 90, ("RightArm", "RightForeArm", "RightHand"))
    for done in (
        interpose.fill(cmu_walk, gap, method="stmi-gan", path={100: point}),
        interpose.fill(cmu_walk, gap, method="stmi-gan", parts=part),
        interpose.fill(cmu_walk, gap, method="stmi-gan", parts=part, path={100: point}),
    ):
        assert {one.method for one in done.report.gaps} == {"spline"}
        assert all(why.split(":")[0] in " ".join(one.notes) for one in done.report.gaps)
        assert (done.provenance[60] == Provenance.FALLBACK).any()


@pytest.mark.parametrize("frames", [(146,), (150, 180), (145, 147)])
def test_points_near_an_end_do_not_throw_the_body_beyond_them(cmu_walk, frames):
    way = cmu_walk.root[GAP[1]] - cmu_walk.root[GAP[0] - 1]
    across = 0.15 * np.array([way[2], -way[0]]) / np.hypot(way[0], way[2])
    led = follow(cmu_walk, *GAP, {frame: cmu_walk.root[frame, [0, 2]] + across for frame in frames})
    off = np.linalg.norm((led.root - cmu_walk.root)[:, [0, 2]], axis=1)
    assert off[list(frames)] == pytest.approx(0.15, abs=1e-9)
    assert off.max() < 1.21 * 0.15


def test_points_along_a_smooth_way_are_led_over_smoothly(cmu_walk):
    """By a spline, which keeps to it between them."""
    frames = np.arange(GAP[0], GAP[1])
    wave = 0.3 * np.sin(np.pi * (frames - GAP[0] + 1) / (len(frames) + 1)) ** 2
    points = cmu_walk.root[frames][:, [0, 2]] + wave[:, None]
    led = follow(cmu_walk, *GAP, {int(frames[k]): points[k] for k in range(9, len(frames) - 5, 10)})
    assert np.linalg.norm(led.root[frames][:, [0, 2]] - points, axis=1).max() < 0.01


def test_a_turn_that_is_too_fast_is_slowed_where_it_is():
    """Not all along: who winds his way turns along the rest of it as he did."""
    time = np.linspace(0, 4, 121)
    turned = 0.8 * np.sin(1.5 * np.pi * time / 2)
    steep = turned + 1.5 * (np.clip(time - 2.0, 0, 0.1) / 0.1 - np.clip(time - 3.0, 0, 0.9) / 0.9)
    step = FASTEST / 30
    calm = _no_faster(steep, step)
    assert np.abs(np.diff(steep)).max() > 2 * step
    assert np.abs(np.diff(calm)).max() < step + 1e-9
    np.testing.assert_allclose(calm[:45], steep[:45], atol=1e-9)
    np.testing.assert_allclose(_no_faster(turned, step), turned, atol=1e-9)
