"""Clips on one timeline: placed as a whole, heading on, at the first one's rate, on its skeleton."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.skeletons.rigs import six_channels

import interpose
from interpose.clip import Clip, Skeleton
from interpose.errors import RequestError
from interpose.finish import on_rig_of
from interpose.formats import load
from interpose.geometry.ground import turn
from interpose.observation import timeline
from interpose.observation.timeline import Placement, lay
from interpose.resampling import resample
from interpose.skeletons import find_mapping
from interpose.skeletons.fitting import fit
from interpose.skeletons.humanoid import reflect


@pytest.fixture(scope="module")
def run(data):
    return load(data / "cmu_run.bvh")


@pytest.fixture(scope="module")
def jump(data):
    return load(data / "cmu_jump.bvh")


def _piece(line, number: int) -> Clip:
    laid = line.laid[number]
    return line.clip.slice(laid.start, laid.stop)


def test_placing_turns_and_shifts_every_point(cmu_walk):
    placement = Placement(0.7, (1.0, 0.0, -2.0))
    placed = placement.of(cmu_walk).positions()
    wanted = turn(cmu_walk.positions(), np.array(0.7)) + np.array([1.0, 0.0, -2.0])
    assert np.allclose(placed, wanted, atol=1e-9)
    assert Placement().of(cmu_walk) is cmu_walk


def test_every_frame_is_kept(cmu_walk, run, jump):
    """The first clip bit for bit, the others up to their placement and the size of their body."""
    line = lay([cmu_walk, run, jump], [20, 30])
    assert [(laid.start, laid.stop) for laid in line.laid] == [(0, 209), (229, 271), (301, 422)]
    assert [(gap.start, gap.stop) for gap in line.gaps] == [(209, 229), (271, 301)]
    assert len(line.clip) == 422
    assert _piece(line, 0).rotation.tobytes() == cmu_walk.rotation.tobytes()
    assert _piece(line, 0).translation.tobytes() == cmu_walk.translation.tobytes()
    for number, clip in ((1, run), (2, jump)):
        fitted, scale = fit(clip, cmu_walk)
        wanted = line.laid[number].placement.of(fitted)
        assert line.laid[number].scale == scale
        assert np.array_equal(_piece(line, number).rotation, wanted.rotation)
        assert np.array_equal(_piece(line, number).translation, wanted.translation)
        # Joints turn as they did; heights go by the size of the body alone.
        assert np.allclose(fitted.rotation, clip.rotation)
        assert np.allclose(_piece(line, number).root[:, 1], scale * clip.root[:, 1], atol=1e-6)


def test_a_body_of_another_size_is_said_to_be_scaled_also_on_another_rig(cmu_walk):
    examples = Path(interpose.__file__).parent / "examples"
    other = load(examples / "fingers.bvh").slice(0, 60)
    smaller = replace(cmu_walk.skeleton, rest_translation=0.7 * cmu_walk.skeleton.rest_translation)
    small = replace(cmu_walk, skeleton=smaller, translation=0.7 * cmu_walk.translation, source=None)
    for clip, scale in ((small, 1 / 0.7), (other, None)):
        if scale is None:
            assert on_rig_of(clip, cmu_walk) is not clip
            scale = find_mapping(clip.skeleton).scale / find_mapping(cmu_walk.skeleton).scale
            assert abs(scale - 1) > 0.01
        done = interpose.stitch([cmu_walk, clip], 10, method="linear")
        assert done.clips[1].scale == pytest.approx(scale)


def test_the_same_rig_under_another_namespace_is_the_same_rig(cmu_walk):
    def under(space: str, clip):  # type: ignore[no-untyped-def]
        names = tuple(space + name for name in clip.skeleton.names)
        return replace(clip, skeleton=replace(clip.skeleton, names=names), source=None)

    first, second = under("mixamorig:", cmu_walk.slice(0, 60)), under("mixamorig1:", cmu_walk.slice(90, 150))
    one, other = lay([first, second], 20), lay([cmu_walk.slice(0, 60), cmu_walk.slice(90, 150)], 20)
    assert one.clip.skeleton.names == first.skeleton.names
    assert np.array_equal(one.clip.rotation, other.clip.rotation)


def test_a_walk_goes_on_in_its_direction_at_its_pace(cmu_walk):
    first, second = cmu_walk.slice(10, 65), Placement(2.0, (5.0, 0.0, 1.0)).of(cmu_walk.slice(140, 200))
    line = lay([first, second], 29)
    (a, b) = (_piece(line, number).root[:, [0, 2]] for number in (0, 1))
    way, step = b[0] - a[-1], (a[-1] - a[-16]) / 15
    heading = step / np.linalg.norm(step)
    speeds = [np.linalg.norm(p[15] - p[0]) / 15 for p in (a[-16:], b)]
    assert np.linalg.norm(way) == pytest.approx(30 * np.mean(speeds), rel=0.06)
    assert way @ heading > 0.99 * np.linalg.norm(way)
    on = (b[15] - b[0]) / np.linalg.norm(b[15] - b[0])
    assert on @ heading > 0.99


def test_where_an_aligned_clip_lay_does_not_matter(cmu_walk, run):
    one, other = (lay([cmu_walk, Placement(*moved).of(run)]) for moved in ((), (2.5, (30.0, 0.0, -7.0))))
    assert [gap.stop for gap in one.gaps] == [gap.stop for gap in other.gaps]
    assert np.allclose(one.clip.positions(), other.clip.positions(), atol=1e-6)


@pytest.mark.parametrize("at", [40, 90, 100, 140, 180])
@pytest.mark.parametrize(
    ("yaw", "shift", "off"),
    [(0.0, (0.0, 0.0, 0.0), 0.01), (0.0, (0.3, -0.2, 0.0), 0.01), (2.0, (5.0, 0.0, 1.0), 0.02)],
)
def test_parts_of_a_take_go_on_where_it_did(cmu_walk, at, yaw, shift, off):
    """Walking on and amid a turn (by 190 degrees, frames 75 to 115): what was moved comes back, and what
    faces as it should is not turned."""
    line = lay([cmu_walk.slice(0, at), Placement(yaw, shift).of(cmu_walk.slice(at + 2, 209))], 2)
    assert (line.laid[1].placement.yaw == 0) == (yaw == 0)
    apart = np.linalg.norm(line.clip.positions()[at + 2 :] - cmu_walk.positions()[at + 2 :], axis=-1)
    assert len(line.clip) == len(cmu_walk)
    assert apart.mean() < off


def test_what_does_not_go_on_keeps_its_height_and_heads_on(cmu_walk, run):
    """Another pose, another clip, or a longer gap: however they lie, strides or courses tell how to go on."""
    lifted = Placement(0.0, (0.0, 0.2, 0.0))
    for clip, frames in ((cmu_walk.slice(150, 209), 2), (run, 2), (cmu_walk.slice(121, 209), 21)):
        line = lay([cmu_walk.slice(0, 100), lifted.of(clip)], frames)
        assert line.laid[1].placement.shift[1] == 0
        assert abs(line.laid[1].placement.yaw) > np.radians(3)


def test_what_comes_round_keeps_its_height(jump):
    """Who stands still in a lift: a loop's beginning is no later part of a take, though the pose goes on."""
    lifted = jump.translation[:1] + np.linspace(0.0, 0.2, 20)[:, None, None] * [0.0, 1.0, 0.0]
    stands = jump.with_motion(np.repeat(jump.rotation[:1], 20, axis=0), lifted)
    line = lay([stands], 2, loop=True)
    assert line.again is not None
    assert line.again.placement.shift[1] == 0
    assert lay([stands, stands], 2).laid[1].placement.shift[1] == pytest.approx(0.2, abs=0.04)


def test_left_handed_clips_are_placed_as_in_a_mirror(cmu_walk):
    clips = cmu_walk.slice(0, 80), cmu_walk.slice(100, 200)
    one, other = lay(clips, 20), lay([reflect(clip) for clip in clips], 20)
    assert abs(one.laid[1].placement.yaw) > 0.1
    assert np.allclose(one.clip.positions() * [-1, 1, 1], other.clip.positions(), atol=1e-6)


def test_unaligned_clips_stay_where_they_lie(cmu_walk):
    line = lay([cmu_walk.slice(0, 50), cmu_walk.slice(80, 150)], align=False)
    assert _piece(line, 1).translation.tobytes() == cmu_walk.translation[80:150].tobytes()
    assert "m/s" in line.laid[1].why
    assert 20 <= len(line.gaps[0]) <= 40  # the walk took 30 for that way


def test_lengths_are_chosen_with_a_reason(cmu_walk, run):
    """Nothing takes less than a step; who walks on does so in step; running on takes longer."""
    walk_on, speed_up = (lay([cmu_walk.slice(10, 65), clip]) for clip in (cmu_walk.slice(140, 200), run))
    assert 14 <= len(walk_on.gaps[0]) <= 14 + 42, "a stride takes 42 frames"
    assert "in step" in walk_on.laid[1].why
    assert len(speed_up.gaps[0]) > 25
    assert "pace" in speed_up.laid[1].why


def test_who_stands_is_given_a_moment_to_another_pose(cmu_walk):
    """Not a single frame, in which velocities would jump; a walk that was cut is: it goes on as it did."""
    still = cmu_walk.take([60] * 40)
    assert timeline.plausible_length(still, 39, still, 0)[0] == round(timeline.LEAST * 30) - 1
    assert timeline.plausible_length(cmu_walk, 60, cmu_walk, 62)[0] <= 3


def test_who_stands_goes_round_on_the_spot(cmu_walk):
    """The sway of hips was carried on as travel, and planted feet were elsewhere in each round."""
    time = np.arange(60)
    translation = cmu_walk.take([60] * 60).translation.copy()
    translation[:, 0, 0] += 0.0001 * time**2
    rotation = cmu_walk.take([60] * 60).rotation.copy()
    still = cmu_walk.with_motion(rotation, translation)
    drifting = lay([still], loop=True).again.placement
    assert np.linalg.norm(drifting.shift) > 0.03, "36 cm further on it is not where it was"
    translation[:, 0, 0] = cmu_walk.translation[60, 0, 0] + 0.01 * np.sin(time / 9)
    swaying = lay([cmu_walk.with_motion(rotation, translation)], loop=True).again.placement
    assert swaying == Placement()
    assert np.linalg.norm(lay([cmu_walk.slice(20, 100)], loop=True).again.placement.shift) > 0.5


def test_backing_away_is_no_reason_to_turn_round(cmu_walk):
    """Who walks backwards and then forwards keeps facing the same way, and stays about there."""
    back = cmu_walk.slice(10, 65)
    back = back.with_motion(back.rotation[::-1], back.translation[::-1])
    line = lay([back, cmu_walk.slice(10, 65)], 30)
    assert abs(line.laid[1].placement.yaw) < np.radians(25)
    assert np.linalg.norm((_piece(line, 1).root[0] - _piece(line, 0).root[-1])[[0, 2]]) < 0.15


def test_another_frame_rate_is_resampled(cmu_walk):
    fast = resample(cmu_walk, 120, smooth=True)
    line = lay([cmu_walk, fast], 10)
    assert line.clip.fps == cmu_walk.fps
    assert len(line.clip) == 209 + 10 + 209
    assert np.allclose(_piece(line, 1).rotation[:, 1:], cmu_walk.rotation[:, 1:])


def test_a_loop_lays_its_beginning_at_the_end(cmu_walk):
    line = lay([cmu_walk], 20, loop=True)
    assert [laid.stop for laid in line.laid] == [209]
    assert line.again is not None
    assert line.again.start == 229
    again = line.clip.slice(line.again.start, line.again.stop)
    wanted = line.again.placement.of(cmu_walk.slice(0, len(again)))
    assert np.array_equal(again.rotation, wanted.rotation)


def test_what_is_no_humanoid_goes_on_as_its_root_is_turned():
    skeleton = Skeleton(("Root", "Tip"), (-1, 0), [[0, 0, 0], [0, 0.2, 0.3]])
    angles = np.linspace(0, 0.5, 20)
    rotation = np.zeros((20, 2, 4))
    rotation[:, 0, 0], rotation[:, 0, 2], rotation[:, 1, 0] = np.cos(angles / 2), np.sin(angles / 2), 1
    clip = Clip(skeleton, rotation, np.zeros((20, 1, 3)), 30)
    assert lay([clip, clip]).laid[1].placement.yaw == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("clips", "frames", "says"),
    [
        (0, "auto", "nothing to stitch"),
        (1, "auto", "--loop"),
        (2, 0, "cannot generate 0"),
        (2, "soon", "cannot generate soon"),
        (2, 10**6, "more than 10 minutes"),
        (2, [5, 6], "2 lengths do not fit 1 gaps"),
    ],
)
def test_what_makes_no_sense_is_refused(cmu_walk, clips, frames, says):
    with pytest.raises(RequestError, match=says):
        lay([cmu_walk] * clips, frames)


def test_a_way_that_nobody_goes_is_refused_where_nobody_says_how_long_it_takes(cmu_walk):
    """It was worked on for ever."""
    far = cmu_walk.with_motion(cmu_walk.rotation, cmu_walk.translation + np.array([10_000.0, 0.0, 0.0]))
    with pytest.raises(RequestError, match="cannot generate") as error:
        lay([cmu_walk, far], "auto", align=False)
    assert "--frames" in error.value.fix
    assert len(lay([cmu_walk, far], 30, align=False).gaps) == 1


def test_other_skeletons_are_refused(cmu_walk):
    skeleton = cmu_walk.skeleton
    other = replace(cmu_walk, skeleton=replace(skeleton, names=("Pelvis", *skeleton.names[1:])))
    with pytest.raises(RequestError, match="Pelvis"):
        lay([cmu_walk, other])
    bones = skeleton.rest_translation.copy()
    bones[skeleton.index("LeftForeArm")] = [0.0, -0.3, 0.0]
    with pytest.raises(RequestError, match="LeftForeArm rests 90 degrees away"):
        lay([cmu_walk, other := replace(cmu_walk, skeleton=replace(skeleton, rest_translation=bones))])
    with pytest.raises(RequestError, match="LeftForeArm rests 90 degrees away"):
        lay([six_channels(cmu_walk), six_channels(other)])
    with pytest.raises(RequestError, match="no frames"):
        lay([cmu_walk, cmu_walk.slice(0, 0)])
    moves = tuple(range(len(skeleton)))
    loose = np.repeat(skeleton.rest_translation[None], len(cmu_walk), axis=0)
    loose[:, 0], loose[50:, 3] = cmu_walk.root, 0.5
    with pytest.raises(RequestError, match="moves against its parent"):
        lay([cmu_walk, replace(cmu_walk, translation=loose, translated=moves)])
