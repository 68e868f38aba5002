"""The guarantees of every method that is here, the trained network included, on a walk, a run and a jump."""

from __future__ import annotations

import re
import shutil

import numpy as np
import pytest

from interpose import formats, tasks
from interpose.finish import feet, seams
from interpose.geometry import measures, rotations
from interpose.methods import registry
from interpose.observation import Gap, Observation
from interpose.skeletons import find_mapping

METHODS = (*registry.names(), "auto")
GAPS = {"cmu_walk": Gap(60, 90), "cmu_run": Gap(14, 28), "cmu_jump": Gap(45, 75)}


@pytest.fixture(scope="module", params=GAPS)
def case(request, data):  # type: ignore[no-untyped-def]
    """A clip, its gap, what is observed, and its completion by each method (made when asked for)."""
    clip, gap, done = formats.load(data / f"{request.param}.bvh"), GAPS[request.param], {}

    def by(method):  # type: ignore[no-untyped-def]
        if method not in done:
            done[method] = tasks.fill(clip, [gap], method)
        return done[method]

    return clip, gap, Observation.from_gaps(clip, [gap]), by


@pytest.mark.parametrize("method", METHODS)
def test_observed_values_and_bones(case, method):
    clip, gap, _, by = case
    done = by(method).clip
    for part in (slice(0, gap.start), slice(gap.stop, None)):
        assert done.rotation[part].tobytes() == clip.rotation[part].tobytes()
        assert done.translation[part].tobytes() == clip.translation[part].tobytes()
    lengths = np.linalg.norm(clip.skeleton.rest_translation, axis=1)
    assert measures.bone_deviation(done.positions(), clip.skeleton.parents, lengths) < 1e-9


@pytest.mark.parametrize("method", METHODS)
def test_no_pop_at_seams_nor_inside(case, method):
    clip, gap, known, by = case
    done = by(method)
    (report,) = done.report.gaps
    limits = seams.limits(clip, known)
    each = measures.acceleration(done.clip.positions())  # row i belongs to frame i + 1
    jumps = each.max(axis=1)
    own = np.delete(measures.acceleration(clip.positions()), slice(gap.start - 2, gap.stop), axis=0).max()
    assert (each[[gap.start - 2, gap.stop - 1]] <= limits).all()
    assert jumps[gap.start - 1 : gap.stop - 1].max() <= max(4 * limits.max(), 2 * own)
    most = 100 * each[gap.start - 1 : gap.stop - 1].max(axis=0)  # of each joint
    assert np.isclose(most, report.peak).any()
    assert most[list(find_mapping(clip.skeleton).mapped[1])].max() <= report.peak_limit
    assert not any("flagged: the velocity" in note for note in report.notes)


@pytest.mark.parametrize("method", METHODS)
def test_feet_slide_no_more_than_real_ones_and_travel(case, method):
    clip, gap, known, by = case
    (report,) = by(method).report.gaps
    slide, travel = feet.measure(clip, known, gap.start, gap.stop)
    assert report.foot_slide <= max(1.35 * slide, 6.0, 0.25 * report.foot_slide_before)
    if method != "zero-velocity":
        assert report.foot_travel >= 0.6 * travel


def turning(speaking, case, share):
    """A network whose pose turns by up to a quarter, frame by frame by `share` (F,) of it."""
    clip, _, _, _ = case
    method = speaking(clip, sigma=0.0)
    hips = method.positions[:, :1]
    turned = (method.positions - hips)[..., [2, 1, 0]] * [1.0, 1.0, -1.0] + hips
    method.positions = method.positions + share[:, None, None] * (turned - method.positions)
    return method


def test_a_jump_inside_a_gap_is_mended_and_the_place_named(case, speaking):
    """It turns by a quarter within one frame, in the middle of the gap."""
    from interpose.finish import complete

    clip, gap, known, _ = case
    middle, time = (gap.start + gap.stop) // 2, np.arange(len(clip))
    share = np.where(time < middle, 0.0, np.clip((gap.stop - time) / (gap.stop - middle), 0, 1))
    (report,) = complete(clip, known, turning(speaking, case, share)).report.gaps
    assert report.method == "speaking"
    (note,) = [note for note in report.notes if "a spline leads over frames" in note]
    first, last = map(int, re.findall(r"\d+", note))
    assert gap.start <= first <= middle <= last < gap.stop
    assert report.peak <= report.peak_limit


def test_a_jump_between_lone_keys_is_mended_as_well(cmu_walk, speaking):
    """Where nothing tells how the motion itself jumps: an eighth of a turn within a frame, by 140 m/s^2."""
    from interpose.finish import complete

    clip, time = cmu_walk.slice(60, 102), np.arange(42)
    case = clip, Gap(1, 41), Observation.from_gaps(clip, [Gap(1, 41)]), None
    share = np.where(time < 21, 0.0, 0.5 * np.clip((41 - time) / 20, 0, 1))
    method = turning(speaking, case, share)
    (report,) = complete(clip, case[2], method).report.gaps
    assert any("a spline leads over frames" in note for note in report.notes)
    assert report.peak * clip.fps**2 / 100 < 100
    assert not any("jumps at frame" in note for note in report.notes)


def test_what_jumps_all_over_a_gap_falls_back_by_name(case, speaking):
    """It turns to and fro, from frame to frame."""
    from interpose.finish import complete

    clip, gap, known, _ = case
    time = np.arange(len(clip))
    share = np.where((time >= gap.start) & (time < gap.stop), time % 2, 0.0)
    (report,) = complete(clip, known, turning(speaking, case, share)).report.gaps
    assert report.method == "spline"
    assert any("filled by spline instead: the velocity jumps" in note for note in report.notes)
    assert not any("leads over" in note for note in report.notes)
    assert report.peak <= report.peak_limit


def test_what_is_lost_while_something_else_is_lost_has_a_seam_of_its_own(cmu_walk):
    """A leg that steps while an arm comes back is no jump of the arm's."""
    known, names = Observation.from_gaps(cmu_walk, []), cmu_walk.skeleton.names
    for frames, part in ((slice(60, 110), "LeftArm"), (slice(85, 140), "RightUpLeg")):
        whole = {names.index(part)}
        for joint, parent in enumerate(cmu_walk.skeleton.parents):
            whole |= {joint} if parent in whole else set()
        known.rotation[frames, sorted(whole)] = False
    lost = ~known.positions(cmu_walk.skeleton)
    done = {method: tasks.fill(cmu_walk, known, method) for method in ("small", "spline")}
    off = {
        method: np.linalg.norm(one.clip.positions() - cmu_walk.positions(), axis=-1)[lost].mean()
        for method, one in done.items()
    }
    assert [gap.method for gap in done["small"].report.gaps] == ["small"] * 3
    assert off["small"] < 0.9 * off["spline"]


@pytest.mark.parametrize("gap", [Gap(10, 30), Gap(10, 30, ("lradius", "lwrist", "rhand"))])
@pytest.mark.parametrize("method", ["small", "spline"])
def test_what_is_said_of_an_amc_clip_is_what_its_file_holds(data, tmp_path, gap, method):
    """Its joints turn about one or two axes: a motion that they cannot do is no result."""
    clip = formats.load(data / "cmu_02_03.amc")
    done = tasks.fill(clip, [gap], method).clip
    assert np.abs(done.rotation - clip.rotation)[gap.start : gap.stop].max() > 1e-3
    shutil.copy(data / "cmu_02.asf", tmp_path)
    assert formats.save(done, tmp_path / "filled.amc") == ()
    back = formats.load(tmp_path / "filled.amc")
    assert np.abs(back.positions() - done.positions()).max() < 1e-4


@pytest.mark.parametrize("gap", [Gap(10, 30), Gap(14, 26)])
def test_joints_of_few_axes_leave_no_jumps_to_flag(data, gap):
    """What their file does not hold of a seam that is softened, others make up for."""
    report = tasks.fill(formats.load(data / "cmu_02_03.amc"), [gap], "small").report.gaps[0]
    assert report.method == "small"
    assert not [note for note in report.notes if note.startswith("flagged")]


def test_half_a_turn_between_lone_keys_does_not_tear(cmu_walk):
    """Networks turn all at once there, and no motion is known that would tell how far velocities may jump."""
    clip = cmu_walk.slice(60, 71)
    rotation, translation = clip.rotation.copy(), clip.translation.copy()
    rotation[10, 0] = rotations.multiply(rotations.about("Y", np.array(np.pi)), rotation[10, 0])
    translation[10, 0, [0, 2]] = translation[0, 0, [0, 2]]
    done = tasks.fill(clip.with_motion(rotation, translation), [Gap(1, 10)], "small")
    (report,) = done.report.gaps
    assert report.peak < 20
    assert any("filled by spline instead: the velocity jumps" in note for note in report.notes)
