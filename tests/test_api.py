"""The public API: quick to import, and as friendly as the command line."""

from __future__ import annotations

import pickle
import subprocess
import sys
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

import interpose
from interpose.errors import NothingError
from interpose.finish import Provenance
from interpose.geometry import rotations

SOURCE = Path(interpose.__file__).parents[1]


def test_import_costs_nothing():
    code = (
        f"import sys; sys.path.insert(0, {str(SOURCE)!r})\n"
        "import interpose\n"
        "heavy = {'torch', 'onnxruntime', 'scipy', 'numpy', 'cyclopts', 'rich'} & set(sys.modules)\n"
        "assert not heavy, heavy\n"
        "assert 'load' in dir(interpose) and 'Any' not in dir(interpose)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_every_public_name_is_there():
    for name in interpose.__all__:
        assert getattr(interpose, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'fil'"):
        interpose.fil  # noqa: B018
    assert {"linear", "spline", "zero-velocity"} <= set(interpose.method_names())


@pytest.mark.parametrize(
    "gaps",
    [
        "100:120",
        (100, 120),
        [100, 120],
        ["100:120"],
        [(100, 120)],
        interpose.Gap(100, 120),
        [interpose.Gap(100, 120)],
    ],
)
def test_gaps_in_any_form(cmu_walk, gaps):
    done = interpose.fill(cmu_walk, gaps, method="linear")
    (gap,) = done.report.gaps
    assert (gap.start, gap.stop, gap.joints) == (100, 120, None)


@pytest.mark.parametrize("joints", ["LeftArm", ["LeftArm"], ("LeftArm",)])
def test_gaps_of_joints(cmu_walk, joints):
    done = interpose.fill(cmu_walk, (100, 120, joints), method="linear")
    assert done.report.gaps[0].joints == ("LeftArm",)
    changed = (done.clip.rotation != cmu_walk.rotation).any(axis=(0, 2))
    assert changed[cmu_walk.skeleton.index("LeftArm")]
    assert changed.sum() == 1


def test_clips_by_path(data, tmp_path):
    done = interpose.fill(data / "cmu_walk.bvh", "100:120", method="spline")
    interpose.save(done.clip, tmp_path / "out.bvh")
    assert interpose.load(tmp_path / "out.bvh").name == "out"
    assert interpose.recover(str(data / "cmu_walk.bvh"), "LeftArm", "100:120", method="linear").report.gaps


def test_without_gaps_a_scan_decides(cmu_walk):
    with pytest.raises(interpose.RequestError, match="nothing missing"):
        interpose.fill(cmu_walk)
    rotation, translation = cmu_walk.rotation.copy(), cmu_walk.translation.copy()
    rotation[80:100], translation[80:100] = rotation[80], translation[80]
    frozen = cmu_walk.with_motion(rotation, translation)
    assert interpose.scan(frozen)
    (gap,) = interpose.fill(frozen, method="spline").report.gaps
    assert (gap.start, gap.stop) in ((80, 100), (81, 100))


@pytest.mark.parametrize("method", ["auto", "linear"])
def test_missing_values_marked_by_nan(cmu_walk, method):
    rotation, translation = cmu_walk.rotation.copy(), cmu_walk.translation.copy()
    rotation[100:120], translation[110:115] = np.nan, np.nan
    clip, seen = interpose.Observation.from_nan(cmu_walk.skeleton, rotation, translation, cmu_walk.fps)
    done = interpose.fill(clip, seen, method=method)
    np.testing.assert_array_equal(done.clip.translation[:110], cmu_walk.translation[:110])
    assert np.isfinite(done.clip.rotation).all()
    assert np.abs(done.clip.positions() - cmu_walk.positions()).max() < 1.0
    left = interpose.fill(clip, seen, method=method, max_gap=10)
    assert [(gap.start, gap.stop) for gap in left.report.open] == [(100, 120)]


@pytest.mark.parametrize("gap", ["120:100", "abc", (100, 500), ("a", "b"), (1,), None, {}])
def test_gaps_that_make_no_sense(cmu_walk, gap):
    with pytest.raises(interpose.RequestError):
        interpose.fill(cmu_walk, [gap], method="linear")


def test_open_gaps_are_listed(cmu_walk):
    done = interpose.fill(cmu_walk, ["20:30", "100:160"], method="linear", max_gap=30)
    assert done.report.open == [interpose.Gap(100, 160)]
    np.testing.assert_array_equal(done.clip.rotation[30:], cmu_walk.rotation[30:])


def test_clips_and_paths_are_stitched(cmu_walk, data):
    done = interpose.stitch([cmu_walk, data / "cmu_run.bvh"], 12, method="linear")
    assert len(done.clip) == 209 + 12 + 42
    assert [laid.start for laid in done.clips] == [0, 221]


def test_scan_takes_paths_and_clips(data, cmu_walk):
    assert interpose.scan(data / "cmu_walk.bvh") == interpose.scan(cmu_walk)


def roles(clip, said):
    return replace(clip, skeleton=replace(clip.skeleton, roles=said))


def twice(clip):
    return [interpose.Part(clip, first, first + 10, at, ("LeftArm",)) for first, at in ((0, 55), (20, 60))]


def test_what_does_not_fit_is_said(cmu_walk):
    seen = interpose.Observation.full(cmu_walk.slice(0, 100))
    for request, said in (
        (lambda: interpose.fill(cmu_walk, seen), "does not fit the clip"),
        (lambda: interpose.Observation(np.ones((5, 3, 4)), np.ones((5, 3, 4))), "does not fit"),
        (lambda: interpose.forecast(cmu_walk, 30.5), "whole number"),
        (lambda: interpose.forecast(cmu_walk, [30]), "whole number"),
        (lambda: interpose.forecast(cmu_walk, "soon"), "cannot generate"),
        (lambda: interpose.between(cmu_walk, [0, 30.5, 75]), "no frame 30.5"),
        (lambda: interpose.fill(cmu_walk, (20, 60), seed=-1), "seed -1"),
        (lambda: interpose.fill(cmu_walk, (20, 60), seed="a"), "seed a"),
        (lambda: interpose.forecast(cmu_walk, 10, seed="a", samples=2), "seed a"),
        (lambda: interpose.denoise(cmu_walk, seed="a"), "seed a"),
        (lambda: interpose.forecast(cmu_walk, 10, temperature="a"), "temperature a"),
        (lambda: interpose.forecast(cmu_walk, 10, temperature=np.nan), "temperature nan"),
        (lambda: interpose.denoise(cmu_walk, "a"), "strength a"),
        (lambda: interpose.denoise(cmu_walk, None), "strength None"),
        (lambda: interpose.fill(cmu_walk, [(20, 30), (60, 90)], only=3), "no gap number 3"),
        (lambda: interpose.fill(cmu_walk, [(20, 30), (60, 90)], only=["a"]), "no gap number a"),
        (lambda: interpose.fill(cmu_walk, [(20, 30), (60, 90)], only=[1.5]), "no gap number 1.5"),
        (lambda: interpose.fill(cmu_walk, (20, 60), max_gap=-1), "-1 as the length"),
        (lambda: interpose.fill(cmu_walk, (20, 60), max_gap=0), "0 as the length"),
        (lambda: interpose.fill(cmu_walk, (20, 60), max_gap="2x"), "2x as the length"),
        (lambda: interpose.fill(cmu_walk, (20, 60), max_gap=[30]), "as the length"),
        (lambda: interpose.resample(cmu_walk, "30"), "frame rate is wrong"),
        (lambda: interpose.between(cmu_walk, 20), "nothing between the keys"),
        (lambda: interpose.fill(cmu_walk, np.array([[20, 30, 40]])), "cannot read the gap"),
        (lambda: interpose.fill(cmu_walk.slice(0, 0), []), "no frames"),
        (lambda: interpose.recover(cmu_walk.slice(0, 0)), "no frames"),
        (lambda: interpose.Part(cmu_walk, 0, 10, 55, ()), "names no joints"),
        (lambda: interpose.fill(roles(cmu_walk, {"hand": "Left"}), (20, 60)), "unknown hand"),
        (lambda: interpose.fill(cmu_walk, (50, 80), parts=twice(cmu_walk)), "two poses of LeftArm"),
    ):
        with pytest.raises(interpose.RequestError, match=said):
            request()


@pytest.mark.parametrize(
    "ask",
    [
        lambda clip: interpose.fill(clip, "120-160"),
        lambda clip: interpose.forecast(clip, 0),
        lambda clip: interpose.between(clip, [0, 30], "walk", method="spline"),
        lambda clip: interpose.forecast(clip, 10, samples=2, method="spline"),
        lambda clip: interpose.stitch([clip, clip], "many"),
        lambda clip: interpose.fill(clip, method=5),
    ],
)
def test_advice_can_be_followed_in_python(cmu_walk, ask):
    """It is the same for the command line, and so names no option alone."""
    with pytest.raises(interpose.RequestError) as error:
        ask(cmu_walk)
    assert error.value.fix
    assert "--" not in error.value.fix


@pytest.mark.parametrize(
    ("ask", "said"),
    [
        (lambda clip: interpose.Skeleton(["a", "b"], [None, 0], np.zeros((2, 3))), "parents="),
        (lambda clip: interpose.Skeleton(["a", "b"], [-1, 0.9], np.zeros((2, 3))), "parents="),
        (lambda clip: interpose.Skeleton([0, 1], [-1, 0], np.zeros((2, 3))), "names="),
        (lambda clip: interpose.Skeleton(["a\0"], [-1], np.zeros((1, 3))), "names="),
        (lambda clip: interpose.Skeleton(["a"], [-1], [["x", 1, 2]]), "rest_translation="),
        (lambda clip: interpose.Skeleton(["a"], [-1], np.zeros((1, 3)), roles="x"), "roles="),
        (lambda clip: interpose.Clip(None, [], [], 30), "skeleton=None"),
        (lambda clip: interpose.Clip(clip.skeleton, [[1], [1, 2]], clip.translation, 30), "rotation="),
        (lambda clip: clip.joined(clip), "several clips"),
        (lambda clip: clip.joined([clip, "take.bvh"]), "clip='take.bvh'"),
        (lambda clip: interpose.Observation.full("take.bvh"), "clip='take.bvh'"),
        (lambda clip: interpose.Observation.without(clip, "1:2"), "gaps='1:2'"),
        (lambda clip: interpose.Observation.from_nan(None, [], [], 30), "skeleton=None"),
        (lambda clip: interpose.Observation([[1], [1, 0]], [[1]]), "an observation="),
        (lambda clip: interpose.Gap.parse("1:2", 3), "joints=3"),
        (lambda clip: interpose.Gap.parse("1:2", None, "take.bvh"), "clip='take.bvh'"),
        (lambda clip: interpose.save(clip, "take.bvh", force="no"), "force='no'"),
        (lambda clip: interpose.load(None), "path=None"),
        (lambda clip: interpose.load(b"take.bvh"), "the path of a file"),
        (lambda clip: interpose.save(clip, 5), "path=5"),
        (lambda clip: interpose.fill(None, "20:30"), "clip=None"),
        (lambda clip: interpose.fill([clip], "20:30"), "a clip, or the path of one"),
        (lambda clip: interpose.fill(clip, "20:30", parts=5), "parts=5"),
        (lambda clip: interpose.fill(clip, "20:30", pins=[1.5]), "a Pin, or several"),
        (lambda clip: interpose.fill(clip, "20:30", path=[(1, 2)]), "points of the floor by frame"),
        (lambda clip: interpose.fill(clip, "20:30", progress=True), "progress=True"),
        (lambda clip: interpose.fill(clip, "20:30", method=["spline"]), "the name of a method"),
        (lambda clip: interpose.recover(clip, 5), "names of joints"),
        (lambda clip: interpose.recover(clip, "LeftArm", place="20:30"), "True or False"),
        (lambda clip: interpose.scan(clip, "20:30"), "an Observation, or None"),
        (lambda clip: interpose.between(clip, [0, 30], ["walk"]), "a text"),
        (lambda clip: interpose.pose_to_pose(None, clip), "start=None"),
        (lambda clip: interpose.pose_to_pose(clip, clip, 20, [(10, clip)]), "by frame"),
        (lambda clip: interpose.stitch(5), "clips, or paths of some"),
        (lambda clip: interpose.stitch({"a": clip}), "clips, or paths of some"),
        (lambda clip: interpose.retarget(clip, None), "like=None"),
        (lambda clip: interpose.resample("take.bvh", 24), "interpose.load"),
        (lambda clip: interpose.Gap(1, 5, 7), "joints=7"),
        (lambda clip: interpose.Gap.parse((1, 5)), "gap=(1, 5)"),
        (lambda clip: interpose.Part("wave.bvh", 0, 5, 22, ["LeftArm"]), "clip='wave.bvh'"),
        (lambda clip: interpose.Part(clip, 0, 5, 22, None), "joints=None"),
        (lambda clip: interpose.Observation.from_gaps(clip, "20:30"), "a list of Gaps"),
        (lambda clip: interpose.Observation.from_gaps(clip, [(20, 30)]), "a Gap, such as"),
    ],
)
def test_arguments_of_another_kind_are_named(cmu_walk, ask, said):
    with pytest.raises(interpose.RequestError) as error:
        ask(cmu_walk)
    assert said in str(error.value)
    assert len(str(error.value).splitlines()) == 3


def test_what_can_be_used_is_not_refused(cmu_walk):
    """NumPy's numbers and switches, generators and arrays."""
    done = interpose.stitch((clip for clip in [cmu_walk, cmu_walk]), np.array([20]), loop=np.bool_(False))
    assert len(done.clip) == 2 * len(cmu_walk) + 20
    done = interpose.between(cmu_walk, np.array([0, 30]), method="spline", pins=(), progress=None)
    assert len(done.report.gaps) == 1
    assert interpose.fill.__doc__
    assert pickle.loads(pickle.dumps(interpose.fill)) is interpose.fill, "for pools of processes"
    with pytest.raises(TypeError, match=r"fill\(\) got an unexpected keyword argument"):
        interpose.fill(cmu_walk, gap="20:30")


@pytest.mark.parametrize("gap", [slice(10, 20), 7, [slice(10, 20)]])
def test_gaps_that_are_none_say_how_to_write_one(cmu_walk, gap):
    with pytest.raises(interpose.RequestError, match="cannot read the gap") as failed:
        interpose.fill(cmu_walk, gap)
    assert len(str(failed.value)) < 300


def test_numbers_of_any_kind_say_frames(cmu_walk):
    whole = interpose.fill(cmu_walk, (60, 80), method="spline").clip.rotation
    for gap in (np.array([60, 80]), (np.int64(60), np.int64(80)), (60.0, 80.0), "2s:80", "60:80"):
        assert np.array_equal(interpose.fill(cmu_walk, gap, method="spline").clip.rotation, whole)
    assert interpose.between(cmu_walk, [0.0, np.int64(20)], method="spline").report.gaps[0].stop == 20
    stitched = interpose.stitch([cmu_walk, cmu_walk], np.int64(10), method="spline")
    assert len(stitched.clip) == 2 * len(cmu_walk) + 10
    assert interpose.stitch(cmu_walk, 10, loop=True, method="spline").report.gaps
    forecast = interpose.forecast(cmu_walk, np.int64(10), method="linear", seed=np.int64(1))
    assert len(forecast.clip) == len(cmu_walk) + 10


def test_names_of_a_gap_may_stand_one_after_another(cmu_walk):
    joints = ("LeftArm", "LeftForeArm")
    done = interpose.fill(cmu_walk, (60, 80, *joints), method="spline")
    assert done.report.gaps[0].joints == joints


def test_numbers_of_any_kind_say_rates_and_joints(cmu_walk):
    clip = replace(cmu_walk, fps=np.float32(30), translated=np.array([0]))
    assert (clip.fps, clip.translated) == (30.0, (0,))
    assert len(interpose.resample(clip, np.float32(60))) == 2 * len(clip) - 1
    assert "29.97 fps" in repr(replace(cmu_walk, fps=Fraction(30000, 1001)))
    seen = interpose.Observation.from_gaps(cmu_walk, [interpose.Gap(60, 80)])
    hand = cmu_walk.positions()[70:71, cmu_walk.skeleton.index("LeftHand")]
    pinned = interpose.Observation(seen.rotation, seen.translation, interpose.Pin("LeftHand", [70], hand))
    assert interpose.fill(cmu_walk, pinned, method="spline").report.gaps[0].pins < 0.1


def test_a_report_of_known_joints_on_a_body_that_nothing_tells_can_be_printed(cmu_walk):
    """But for one whole pose: the body has no seams of its own, an upper body that is laid on it has."""
    low = [name for name in cmu_walk.skeleton.names if "Leg" in name or "Foot" in name or "Toe" in name]
    low += ["Hips", "LHipJoint", "RHipJoint", "LowerBack", "Spine", "Spine1"]
    last = len(cmu_walk)
    gaps = [interpose.Gap(1, 45), interpose.Gap(45, 46, tuple(low)), interpose.Gap(46, last)]
    report = interpose.fill(cmu_walk, gaps).report
    assert any(gap.seam_after is not None for gap in report.gaps)
    assert f"gap 46:{last}" in str(report)


def test_rows_of_an_array_are_gaps(cmu_walk):
    for rows in ([[20, 30], [60, 90]], [[20, 30]]):
        done = interpose.fill(cmu_walk, np.array(rows), method="linear")
        assert [[gap.start, gap.stop] for gap in done.report.gaps] == rows


@pytest.mark.parametrize("max_gap", [30, "30", "1s", np.int64(59), 59.0])
def test_the_longest_gap_is_said_in_frames_or_seconds(cmu_walk, max_gap):
    done = interpose.fill(cmu_walk, ["20:30", "100:160"], method="linear", max_gap=max_gap)
    assert done.report.open == [interpose.Gap(100, 160)]


@pytest.mark.parametrize("only", [2, [2], np.int64(2), np.array([2]), 2.0])
def test_one_or_several_of_the_gaps_are_chosen(cmu_walk, only):
    done = interpose.fill(cmu_walk, ["20:30", "100:160"], method="linear", only=only)
    assert done.report.open == [interpose.Gap(20, 30)]


@pytest.mark.parametrize(
    "ask",
    [
        lambda clip: interpose.between(clip, [0, 30.5]),
        lambda clip: interpose.between(clip, "0,30"),
        lambda clip: interpose.between(clip, [0, np.nan]),
        lambda clip: interpose.stitch([clip, clip], 10.5),
        lambda clip: interpose.stitch([clip, clip], None),
        lambda clip: interpose.fill(clip, (60, 80), path={70.5: (0, 1)}),
        lambda clip: interpose.fill(clip, (60, 80), path={70: (0, 1, 2)}),
        lambda clip: interpose.fill(clip, (60, 80), path={70: (np.nan, 0)}),
        lambda clip: interpose.fill(clip, (60, 80), path={70: "here"}),
        lambda clip: interpose.fill(clip, (60, 80, [])),
        lambda clip: interpose.recover(clip, []),
        lambda clip: interpose.pose_to_pose(clip, clip, 0),
        lambda clip: interpose.pose_to_pose(clip, clip, "soon"),
        lambda clip: interpose.pose_to_pose(clip, clip, 20, {0: clip}),
        lambda clip: interpose.pose_to_pose(clip, clip, 20, {40: clip}),
        lambda clip: interpose.pose_to_pose(clip, clip.slice(0, 0), 20),
        lambda clip: interpose.recover(clip, "LeftArm", (10, 20, ["RightArm"])),
        lambda clip: interpose.scan(clip, interpose.Observation.full(clip).slice(0, 50)),
        lambda clip: interpose.Gap(10.5, 20),
        lambda clip: interpose.Gap(20, 40, ()),
        lambda clip: interpose.fill(clip, (60, 80, ["LeftArm"], ["LeftForeArm"])),
        lambda clip: clip.slice(1.5, 5),
        lambda clip: clip.joined([clip, interpose.resample(clip, 60)]),
        lambda clip: clip.joined(
            [replace(clip, skeleton=replace(clip.skeleton, names=clip.skeleton.names[::-1]))]
        ),
        lambda clip: replace(clip, translated=np.array([0.5])),
        lambda clip: interpose.Observation(np.ones((3, 2)), np.ones((3, 2)), ("LeftHand",)),
        lambda clip: interpose.Skeleton((), (), np.zeros((0, 3))),
        lambda clip: interpose.save(interpose.fill(clip, (60, 80), method="spline"), "x.bvh"),
        lambda clip: interpose.Clip(clip.skeleton, None, clip.translation, 30.0),
        lambda clip: replace(clip, translated=(99,)),
        lambda clip: replace(clip.skeleton, rest_rotation=np.zeros((5, 4))),
        lambda clip: replace(clip.skeleton, rest_scale=np.ones(5)),
        lambda clip: replace(clip.skeleton, rest_scale=-np.ones(len(clip.skeleton))),
        lambda clip: interpose.Observation.from_nan(clip.skeleton, clip.rotation, clip.translation[:5], 30.0),
        lambda clip: interpose.Observation.from_nan(
            clip.skeleton, clip.rotation, clip.translation, 30.0, (77,)
        ),
        lambda clip: interpose.fill(clip, (60, 80), pins=interpose.Pin("LeftHand", [70])),
    ],
)
def test_what_makes_no_sense_is_refused_in_three_lines(cmu_walk, ask):
    with pytest.raises(interpose.RequestError) as error:
        ask(cmu_walk)
    assert len(str(error.value).splitlines()) == 3


def test_what_was_left_open_is_not_called_observed(cmu_walk):
    done = interpose.fill(cmu_walk, [(20, 30), (50, 90)], max_gap=20, method="spline")
    assert (done.provenance[50:90] == Provenance.OPEN).all()
    assert not (done.provenance[:50] == Provenance.OPEN).any()


def test_joints_of_a_part_that_are_misspelt_are_named(cmu_walk):
    with pytest.raises(interpose.RequestError, match="unknown joint: LefArm"):
        interpose.fill(cmu_walk, (60, 80), parts=interpose.Part(cmu_walk, 0, 5, 65, "LefArm"))


def test_centimetres_for_metres_are_asked_about(cmu_walk):
    skeleton = replace(cmu_walk.skeleton, rest_translation=100 * cmu_walk.skeleton.rest_translation)
    huge = replace(cmu_walk, skeleton=skeleton, translation=100 * cmu_walk.translation, source=None)
    assert any("is the unit right?" in note for note in interpose.fill(huge, (60, 80)).report.gaps[0].notes)


def test_a_clip_of_one_joint_is_completed():
    rng = np.random.default_rng(0)
    turns = rotations.exp(0.05 * rng.standard_normal((60, 1, 3)).cumsum(axis=0))
    clip = interpose.Clip(
        interpose.Skeleton(("one",), (-1,), np.zeros((1, 3))), turns, np.zeros((60, 1, 3)), 30.0
    )
    for method in ("zero-velocity", "kalman", "spline"):
        assert len(interpose.fill(clip, (20, 40), method=method).clip) == 60
    assert len(interpose.denoise(clip).clip) == 60


def test_names_that_bvh_cannot_hold_are_refused(cmu_walk, tmp_path):
    names = ("a{", *cmu_walk.skeleton.names[1:])
    odd = replace(cmu_walk, skeleton=replace(cmu_walk.skeleton, names=names), source=None)
    with pytest.raises(interpose.RequestError, match="as BVH"):
        interpose.save(odd, tmp_path / "odd.bvh")
    assert not list(tmp_path.iterdir())


def test_who_stands_before_and_after_may_walk_in_between(cmu_walk):
    """What is known beside a gap tells how far joints may jump, and who stands hardly moves: his steps in the
    gap are none too far."""
    pose = cmu_walk.slice(20, 21)
    still = np.repeat(pose.translation, 110, axis=0)
    still[:, 0] += 0.001 * np.sin(np.arange(110))[:, None]
    still[60:, 0, [0, 2]] += 1.5 * _ahead(cmu_walk)
    clip = pose.with_motion(np.repeat(pose.rotation, 110, axis=0), still)
    (gap,) = interpose.fill(clip, (20, 70)).report.gaps
    assert gap.method == "base"
    assert gap.foot_slide < 40


def _ahead(clip):  # type: ignore[no-untyped-def]
    way = clip.root[-1] - clip.root[0]
    return way[[0, 2]] / np.linalg.norm(way[[0, 2]])


def test_results_go_from_process_to_process(data, tmp_path):
    """A pool of processes gives back whole results, and a Forecast is one as well."""
    path = data / "cmu_walk.bvh"
    done = interpose.fill(path, "20:30", method="spline")
    got = pickle.loads(pickle.dumps(done))
    assert np.array_equal(got.raw.clip.rotation, done.raw.clip.rotation)
    assert str(got.report) == str(done.report)
    for one, name in ((done, "a.bvh"), (got, "b.bvh")):
        interpose.save(one.clip, tmp_path / name)
    assert (tmp_path / "a.bvh").read_bytes() == (tmp_path / "b.bvh").read_bytes()
    ahead = pickle.loads(pickle.dumps(interpose.forecast(path, 5, method="spline")))
    assert len(ahead.clip) - ahead.start == 5
    for error in (
        interpose.FileError("what", "why", "fix"),
        NothingError("what", "why", "fix", "left", 4),
    ):
        assert vars(pickle.loads(pickle.dumps(error))) == vars(error)


def test_how_many_frames_to_generate_may_be_said_in_seconds(cmu_walk):
    """As on the command line."""
    walk = cmu_walk.slice(1, 91)
    assert len(interpose.forecast(walk, "0.5s", method="zero-velocity").clip) == 90 + 15
    joined = interpose.stitch([walk.slice(0, 40), walk.slice(50, 90)], "0.4s", method="spline").clip
    assert len(joined) == 40 + 12 + 40
    for text in ("soon", "0s"):
        with pytest.raises(interpose.RequestError, match="cannot generate"):
            interpose.forecast(walk, text)


def test_what_a_method_said_is_shown_in_a_line(cmu_walk):
    done = interpose.fill(cmu_walk, (60, 90), method="small")
    assert len(repr(done.raw)) < 500
