"""What the verbs mean: plans, windows, what stays open, long and odd clips."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import textwrap
from dataclasses import replace
from importlib import resources
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from tests.skeletons.rigs import twice, under_root

from interpose import tasks
from interpose.clip import Clip, Skeleton
from interpose.errors import RequestError
from interpose.evaluation.denoising import tremble
from interpose.finish import Provenance, complete, feet, retarget
from interpose.finish.report import GapReport
from interpose.formats import load
from interpose.geometry import measures, rotations
from interpose.geometry.ground import turn
from interpose.methods import registry, weights
from interpose.methods.base import holes
from interpose.observation import Gap, Observation, Pin, timeline
from interpose.observation.scan import intact, scan
from interpose.resampling import resample
from interpose.skeletons import find_humanoid
from interpose.skeletons.body import facing
from interpose.skeletons.performers import clip_of
from interpose.tasks import filling, stitching, windows
from interpose.tasks.blocking import blocked

METHODS = (*registry.names(), "auto")


def _same(one: Clip, other: Clip, frames: slice) -> bool:
    return bool(
        np.array_equal(one.rotation[frames], other.rotation[frames])
        and np.array_equal(one.translation[frames], other.translation[frames])
    )


@pytest.mark.parametrize("method", METHODS)
def test_what_is_observed_comes_back_and_gaps_are_filled(cmu_walk, method):
    done = tasks.fill(cmu_walk, [Gap(60, 90), Gap(120, 130, ("LeftArm", "LeftForeArm"))], method)
    assert _same(done.clip, cmu_walk, slice(0, 60))
    assert _same(done.clip, cmu_walk, slice(90, 120))
    arm = [cmu_walk.skeleton.index(name) for name in ("LeftArm", "LeftForeArm")]
    others = [j for j in range(len(cmu_walk.skeleton)) if j not in arm]
    assert np.array_equal(done.clip.rotation[120:130, others], cmu_walk.rotation[120:130, others])
    assert not np.array_equal(done.clip.rotation[60:90], cmu_walk.rotation[60:90])
    assert [gap.number for gap in done.report.gaps] == [1, 2]
    assert (done.provenance[60:90] > 0).all()
    assert not done.provenance[:60].any()


@pytest.mark.parametrize("method", METHODS)
def test_nothing_leaks(cmu_walk, method):
    gaps = [Gap(60, 90), Gap(120, 130, ("LeftArm", "Spine"))]
    seen = Observation.from_gaps(cmu_walk, gaps)
    rotation, translation = cmu_walk.rotation.copy(), cmu_walk.translation.copy()
    rotation[~seen.rotation] = [0.3, -0.5, 0.1, 0.8]
    translation[60:90] = 1e5
    poisoned = cmu_walk.with_motion(rotation, translation)
    one, other = (tasks.fill(clip, gaps, method).clip for clip in (cmu_walk, poisoned))
    assert one.rotation.tobytes() == other.rotation.tobytes()
    assert one.translation.tobytes() == other.translation.tobytes()


@pytest.mark.parametrize("seed", range(3))
def test_nothing_leaks_where_values_are_lost_here_and_there(cmu_walk, seed):
    rng, clip = np.random.default_rng(seed), cmu_walk.slice(20, 80)
    known = rng.random(clip.rotation.shape[:2]) > 0.3
    seen = Observation(known, np.ones_like(known))
    rotation = clip.rotation.copy()
    rotation[~known] = rotations.normalize(rng.standard_normal((int((~known).sum()), 4)))
    poisoned = clip.with_motion(rotation, clip.translation)
    one, other = (tasks.fill(given, seen).clip for given in (clip, poisoned))
    assert one.rotation.tobytes() == other.rotation.tobytes()


def test_a_gap_of_a_long_clip_is_the_gap_of_its_window(long_walk):
    """The window holds all that counts, but for the clip's own acceleration, which limits the seams."""
    gap = Gap(600, 630)
    margin = round(windows.CONTEXT * long_walk.fps)
    lo, hi = gap.start - margin, gap.stop + margin
    whole = tasks.fill(long_walk, [gap], "cae").clip
    alone = tasks.fill(long_walk.slice(lo, hi), [Gap(margin, margin + 30)], "cae").clip
    assert np.abs(whole.rotation[600:630] - alone.rotation[margin : margin + 30]).max() < 0.02


def test_gaps_do_not_depend_on_each_other_s_filling(long_walk):
    near = [Gap(300, 330), Gap(340, 370)]
    together = tasks.fill(long_walk, near, "spline").clip
    first = tasks.fill(long_walk, near, "spline", only=[1]).clip
    assert _same(together, first, slice(300, 330))


def test_near_gaps_are_completed_at_once(cmu_walk, monkeypatch):
    """Else each would complete all of its neighbours once more: keys on fives take 10 times as long."""
    asked, real = [], complete

    def counted(*args, **options):  # type: ignore[no-untyped-def]
        asked.append(real(*args, **options))
        return asked[-1]

    monkeypatch.setattr(filling, "complete", counted)
    gaps = [Gap(frame + 1, frame + 5) for frame in range(0, 100, 5)]
    done = tasks.fill(cmu_walk, gaps, "linear", methods={7: "spline"})
    assert sum(len(one.report.gaps) for one in asked) < 3 * len(gaps)
    assert [(gap.number, gap.start, gap.stop) for gap in done.report.gaps] == [
        (number, gap.start, gap.stop) for number, gap in enumerate(gaps, 1)
    ]
    assert done.report.gaps[6].method == "spline"
    alone = tasks.fill(cmu_walk, gaps, "linear", only=[20])
    assert _same(alone.clip, done.clip, slice(gaps[19].start, gaps[19].stop))


def test_what_has_no_beginning_goes_on_backwards(cmu_walk):
    """The network has learned what comes next: of a gap at the start it says what it says at the end of the
    clip that runs backwards, and there it is as good as the spline or better."""
    turned = cmu_walk.with_motion(cmu_walk.rotation[::-1].copy(), cmu_walk.translation[::-1].copy())
    method, frames = registry.get("small"), len(cmu_walk)
    for gap in (Gap(0, 30), Gap(0, 30, ("LeftUpLeg", "LeftLeg", "LeftFoot"))):
        there = Gap(frames - gap.stop, frames, gap.joints)
        one = method.complete(cmu_walk, Observation.from_gaps(cmu_walk, [gap])).clip
        other = method.complete(turned, Observation.from_gaps(turned, [there])).clip
        assert np.abs(one.positions() - other.positions()[::-1]).max() < 1e-4
        off = {
            name: np.abs(tasks.fill(cmu_walk, [gap], name).clip.positions() - cmu_walk.positions()).mean()
            for name in ("small", "spline")
        }
        assert off["small"] < off["spline"]


@pytest.mark.parametrize("method", ["auto", "small", "cmib", "cae", "spline", "kalman"])
def test_either_sign_of_a_quaternion_is_the_same_rotation(method):
    """In every joint and frame; also for what has never turned, which is told from what is seen of it."""
    walk = load(resources.files("interpose") / "examples" / "walk.bvh")
    signs = np.random.default_rng(0).choice([-1.0, 1.0], walk.rotation.shape[:2])[..., None]
    same = walk.with_motion(walk.rotation * signs, walk.translation)
    one, other = (tasks.fill(clip, [Gap(60, 90)], method).clip.positions() for clip in (walk, same))
    assert np.abs(one - other).max() < 1e-9


def test_keys_are_met_between_the_frames_of_a_network():
    """At 120 frames a second four go by in one of its own."""
    walk = resample(load(resources.files("interpose") / "examples" / "walk.bvh"), 120)
    (gap,) = tasks.fill(walk, [Gap(240, 360)], "cmib").report.gaps
    assert gap.method == "cmib"


def test_only_and_max_gap_leave_gaps_open(cmu_walk):
    gaps = [Gap(20, 30), Gap(60, 100), Gap(120, 130)]
    done = tasks.fill(cmu_walk, gaps, "linear", max_gap=20)
    assert [(g.start, g.stop) for g in done.report.open] == [(60, 100)]
    assert _same(done.clip, cmu_walk, slice(60, 100))
    done = tasks.fill(cmu_walk, gaps, "linear", only=[3])
    assert [g.number for g in done.report.gaps] == [3]
    assert len(done.report.open) == 2
    with pytest.raises(RequestError, match="no gap number 4"):
        tasks.fill(cmu_walk, gaps, "linear", only=[4])


def test_methods_of_single_gaps(cmu_walk):
    done = tasks.fill(cmu_walk, [Gap(20, 30), Gap(60, 90)], "linear", methods={2: "spline"})
    assert [g.method for g in done.report.gaps] == ["linear", "spline"]


def test_auto_goes_by_length_and_by_what_the_network_can(cmu_walk):
    base, small = (weights.find(name) for name in ("base", "small"))
    short = min(card.auto["from_gap"] for card in (base, small)) - 1
    lengths = (short, base.auto["from_gap"], base.max_gap + 1)
    names = [job.method.name for length in lengths for job in _plan(cmu_walk, length)]
    assert names == ["spline", "base", "base"]


def _plan(clip, length):  # type: ignore[no-untyped-def]
    seen = Observation.from_gaps(clip, [Gap(60, 60 + length)])
    return tasks.plan(clip, seen, "auto", None, None, {})


def test_a_lost_joint_does_not_keep_the_network_from_a_gap(long_walk):
    """A whole pose is missing for a second, an arm all the time: the network fills both, piece by piece."""
    gaps = [Gap(0, len(long_walk), ("LeftArm",)), Gap(595, 625)]
    done = tasks.fill(long_walk, gaps, "cae")
    assert {gap.method for gap in done.report.gaps} == {"cae"}
    assert np.isfinite(done.clip.rotation).all()
    (job,) = tasks.plan(long_walk, Observation.from_gaps(long_walk, gaps), "auto", 40, None, {})
    assert job.method is not None, "a limit of 40 frames is meant for the gap of the whole pose"


@pytest.mark.parametrize("whole", [(100, 102), (120, 130), (60, 80), (100, 120)])
def test_a_pose_that_is_lost_beside_a_lost_arm_keeps_the_network(cmu_walk, whole):
    """Neither is the gap too short for it, nor is the hand, lost on both sides, at a seam there."""
    done = tasks.fill(cmu_walk, [Gap(80, 120, ("LeftArm", "LeftForeArm", "LeftHand")), Gap(*whole)])
    assert {gap.method for gap in done.report.gaps} == {"base"}


def test_long_gaps_and_forecasts_keep_walking():
    """Said at once, what is far from known frames is a mean that hardly moves, and glides."""
    walk = load(resources.files("interpose") / "examples" / "walk.bvh")
    filled = tasks.fill(walk, [Gap(15, len(walk) - 15)]).report.gaps[0]
    assert filled.stop - filled.start > weights.find("base").max_gap
    ahead = tasks.forecast(walk, 90).samples[0].report.gaps[0]
    for gap in (filled, ahead):
        assert (gap.method, gap.model) == ("base", "base")
        assert gap.liveliness > 0.6
        assert gap.gliding < 0.1


def test_raw_is_what_the_network_said(cmu_walk):
    raw = tasks.fill(cmu_walk, [Gap(60, 90)], "cae").raw
    assert raw.positions is not None
    assert raw.own is not None
    assert np.isfinite(raw.positions[60:90]).all()
    assert np.isnan(raw.positions[:60]).all()


def test_too_long_for_the_network_is_filled_by_the_spline_and_said(cmu_walk):
    done = tasks.fill(cmu_walk, [Gap(40, 165)], "cae")
    assert done.report.gaps[0].method == "spline"
    assert "125 frames" in " ".join(done.report.gaps[0].notes)


def test_what_is_no_humanoid_is_filled_by_the_spline_with_the_reason():
    """A dog: four legs, a level back, a tail."""
    bones = {"pelvis": (-1, (0, 0.5, 0)), "chest": (0, (0, 0, 0.5)), "skull": (1, (0, 0.2, 0.2))}
    bones["tail"] = (0, (0, 0.1, -0.2))
    for name, above, side in (("a", 0, 0.1), ("b", 0, -0.1), ("c", 1, 0.1), ("d", 1, -0.1)):
        count = len(bones)
        bones[name + "1"] = (above, (side, 0, 0))
        bones |= {f"{name}{k + 2}": (count + k, (0, -0.2, 0.02)) for k in range(3)}
    skeleton = Skeleton(
        tuple(bones), tuple(p for p, _ in bones.values()), np.array([b for _, b in bones.values()])
    )
    time = np.arange(90)[:, None, None] / 30
    swing = rotations.exp(0.4 * np.sin(7 * time + np.arange(len(bones))[:, None]) * [1.0, 0, 0])
    dog = Clip(skeleton, swing, np.array([0, 0.5, 0]) + time * [0, 0, 1.0], 30.0)
    report = tasks.fill(dog, [Gap(30, 60)], "cae").report.gaps[0]
    assert report.method == "spline"
    assert "humanoids only" in " ".join(report.notes)
    assert report.foot_slide is None


@pytest.mark.parametrize("fps", [24, 25, 60, 120])
def test_frame_rates(cmu_walk, fps):
    """The network thinks at 30 fps; the clip comes back at its own rate, near what it is at 30."""
    clip = resample(cmu_walk, fps)
    start, stop = round(2 * fps), round(3 * fps)
    done = tasks.fill(clip, [Gap(start, stop)], "cae")
    assert done.report.gaps[0].method == "cae", done.report
    assert _same(done.clip, clip, slice(0, start))
    assert _same(done.clip, clip, slice(stop, None))
    here = tasks.fill(cmu_walk, [Gap(60, 90)], "cae").clip.positions()[75]
    there = done.clip.positions()[round(2.5 * fps)]
    assert np.linalg.norm(here - there, axis=-1).mean() < 0.05


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    ("frames", "gaps"),
    [
        (1, []),
        (2, [Gap(0, 1)]),
        (2, [Gap(1, 2)]),
        (60, [Gap(0, 20)]),
        (60, [Gap(40, 60)]),
        (60, [Gap(20, 30), Gap(30, 40)]),
        (60, [Gap(20, 30), Gap(31, 40)]),
    ],
)
def test_odd_clips(cmu_walk, method, frames, gaps):
    clip = cmu_walk.slice(0, frames)
    done = tasks.fill(clip, gaps, method)
    assert np.isfinite(done.clip.rotation).all()
    assert np.isfinite(done.clip.translation).all()
    assert np.allclose(np.linalg.norm(done.clip.rotation, axis=-1), 1)
    seen = Observation.from_gaps(clip, gaps)
    assert np.array_equal(done.clip.rotation[seen.rotation], clip.rotation[seen.rotation])


@pytest.mark.parametrize("frames", [1, 40])
def test_a_clip_of_which_nothing_is_known_is_refused(cmu_walk, frames):
    with pytest.raises(RequestError, match="no value of the clip is observed"):
        tasks.fill(cmu_walk.slice(0, frames), [Gap(0, frames)])


def test_joints_lost_for_long_are_recovered_in_pieces_that_agree(long_walk):
    joints = ("LeftArm", "LeftForeArm")
    done = tasks.recover(long_walk, joints, method="cae")
    assert [(g.start, g.stop, g.method) for g in done.report.gaps] == [(0, len(long_walk), "cae")]
    arm = long_walk.skeleton.index("LeftHand")
    hand = done.clip.positions()[:, arm]
    speed = np.linalg.norm(np.diff(hand, axis=0), axis=-1)
    seams = [round(windows.PIECE * 30) - k for k in range(round(windows.OVERLAP * 30) + 2)]
    assert speed[seams].max() < 3 * np.percentile(speed, 99)
    legs = [j for j, name in enumerate(long_walk.skeleton.names) if "Leg" in name]
    assert np.array_equal(done.clip.rotation[:, legs], long_walk.rotation[:, legs])


def test_progress_goes_up_to_one(long_walk):
    shares: list[float] = []
    tasks.fill(long_walk, [Gap(100, 110), Gap(300, 310), Gap(500, 510)], "linear", progress=shares.append)
    assert shares == sorted(shares)
    assert shares[-1] == 1
    assert len(shares) == 3


def test_an_observation_says_the_same_as_its_gaps(cmu_walk):
    gaps = [Gap(60, 90)]
    by_gaps = tasks.fill(cmu_walk, gaps, "spline").clip
    by_observation = tasks.fill(cmu_walk, Observation.from_gaps(cmu_walk, gaps), "spline").clip
    assert _same(by_gaps, by_observation, slice(None))


def test_one_window_is_what_finish_makes_of_it(cmu_walk):
    """A clip no longer than its window goes through `complete` as it is."""
    clip, gap = cmu_walk.slice(20, 120), Gap(40, 60)
    mine = tasks.fill(clip, [gap], "spline").clip
    theirs = complete(clip, Observation.from_gaps(clip, [gap]), registry.get("spline")).clip
    assert _same(mine, theirs, slice(None))


def test_half_an_hour_takes_less_than_a_gigabyte(data):
    """54,000 frames of 31 joints with gaps, filled by network and spline, in a process of its own."""
    program = f"""
        import re
        import resource
        from dataclasses import replace
        from pathlib import Path
        import numpy as np
        from interpose import tasks
        from interpose.formats import load
        from interpose.observation import Gap
        walk = load({str(data / "cmu_walk.bvh")!r})
        there = np.arange(len(walk))
        frames = np.resize(np.concatenate([there, there[::-1]]), 54_000)
        clip = replace(walk.slice(0, 1), rotation=walk.rotation[frames], translation=walk.translation[frames])
        tasks.fill(clip, [Gap(30_000, 30_040), Gap(40_000, 40_005)], "cae")
        tasks.fill(clip, [Gap(1_000, 1_030)], "spline")
        # Not ru_maxrss: that begins with what the process weighed that started this one.
        status = Path("/proc/self/status")
        high = re.search(r"VmHWM:\\s*(\\d+)", status.read_text()) if status.exists() else None
        print(high[1] if high else resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
    """
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(program)], capture_output=True, text=True, check=True
    )
    assert int(done.stdout) < 1_000_000, "kilobytes"


@pytest.mark.parametrize(
    ("slides", "glides", "travels", "flags", "longer"),
    [
        ((20.0, 11.0), (0.0, 0.15), (1.0, 1.0), (0, 0), True),
        ((20.0, 11.0), (0.0, 0.22), (1.0, 1.0), (0, 0), False),
        ((20.0, 11.0), (0.0, None), (1.0, 0.3), (0, 0), True),
        ((20.0, 11.0), (0.0, None), (1.0, 0.1), (0, 0), False),
        ((20.0, 11.0), (0.0, 0.15), (1.0, 1.0), (0, 1), False),
        ((20.0, 99.0), (0.0, 0.15), (1.0, 1.0), (1, 0), True),
        ((20.0, 99.0), (0.0, 0.15), (0.1, 0.1), (1, 0), True),
    ],
)
def test_a_transition_takes_longer_where_feet_slide_less(
    cmu_walk, data, monkeypatch, slides, glides, travels, flags, longer
):
    """Gliding all along counts as 50 cm/s; feet that do not travel tell nothing; and first of all
    it is one in which nothing is flagged."""
    line = timeline.lay([cmu_walk, load(data / "cmu_run.bvh")])
    (gap,), tried = line.gaps, []

    def judged(clip, gaps, *args, **more):  # type: ignore[no-untyped-def]
        which = min(len(tried), 1)
        tried.append(len(gaps[0]))
        said = replace(GapReport(0, 9, None, "made up"), foot_slide=slides[which])
        notes = ("flagged: made up",) * flags[which]
        said = replace(said, gliding=glides[which], foot_travel=travels[which], notes=notes)
        return SimpleNamespace(report=SimpleNamespace(gaps=[said]))

    monkeypatch.setattr(stitching, "fill", judged)
    (length,), _ = stitching._tried(line, "auto", "", None)
    assert tried[0] == len(gap)
    assert tried[-1] <= len(gap) + cmu_walk.fps
    assert (length > len(gap)) == longer


def test_a_transition_is_shorter_where_something_is_flagged_in_all_others(cmu_walk, data, monkeypatch):
    """By a tenth of a second each time, until nothing is."""
    line = timeline.lay([cmu_walk, load(data / "cmu_run.bvh")])
    (gap,) = line.gaps

    def judged(clip, gaps, *args, **more):  # type: ignore[no-untyped-def]
        flagged = ("flagged: made up",) if len(gaps[0]) > len(gap) - 6 else ()
        said = replace(GapReport(0, 9, None, "made up"), foot_slide=9.0, foot_travel=1.0, notes=flagged)
        return SimpleNamespace(report=SimpleNamespace(gaps=[said]))

    monkeypatch.setattr(stitching, "fill", judged)
    (length,), (why,) = stitching._tried(line, "auto", "", None)
    assert length == len(gap) - 6
    assert "of 13 lengths tried" in why


@pytest.mark.parametrize(("pace", "goes_on"), [(15.0, True), (25.0, False)])
def test_what_moves_too_fast_beside_a_key_is_another_pose(cmu_walk, pace, goes_on):
    """Metres a second, of a body: it tells nothing of how the motion comes to the key, or leaves it."""
    translation = cmu_walk.translation.copy()
    translation[40:, 0, 0] += pace / cmu_walk.fps
    odd = cmu_walk.with_motion(cmu_walk.rotation, translation)
    later, sooner = blocked(odd, 40, cmu_walk, 70, {}, 20), blocked(cmu_walk, 10, odd, 39, {}, 20)
    assert (later.keys[0] > 0) == goes_on
    assert (len(sooner.clip) > sooner.keys[-1] + 1) == goes_on


@pytest.fixture(scope="module")
def stitched(cmu_walk, data):  # type: ignore[no-untyped-def]
    takes = [cmu_walk, *(load(data / f"cmu_{name}.bvh") for name in ("run", "jump"))]
    return tasks.stitch(takes)


def test_nothing_pops_where_clips_are_stitched(stitched):
    """At seams, and in the gaps by what the fill allows there; the feet do not slide."""
    assert len(stitched.report.gaps) == 2
    for gap in stitched.report.gaps:
        jumps = 100 * np.linalg.norm(np.diff(stitched.clip.positions(), 2, axis=0), axis=-1).max(axis=1)
        assert max(jumps[gap.start - 2], jumps[gap.stop - 1]) <= gap.seam_limit + 1e-6
        assert jumps[gap.start - 1 : gap.stop - 1].max() <= gap.peak_limit
        assert gap.foot_slide < 25, "real feet: 8 to 30 cm/s by this measure"
    known = np.ones(len(stitched.clip), bool)
    for gap in stitched.report.gaps:
        known[gap.start : gap.stop] = False
    assert not stitched.provenance[known].any()
    assert (stitched.provenance[~known] > 0).all()


@pytest.mark.parametrize("align", [True, False])
def test_a_loop_comes_round_without_a_pop(cmu_walk, align):
    """Three times round, each time placed as it says: no jump above the limit where it begins again."""
    done = tasks.stitch([cmu_walk], align=align, loop=True)
    assert done.loop is not None
    laps, placed = [], done.clip
    for _ in range(3):
        laps.append(placed.positions())
        placed = done.loop.placement.of(placed)
    jumps = 100 * np.linalg.norm(np.diff(np.concatenate(laps), 2, axis=0), axis=-1)
    assert done.loop.jump <= done.loop.limit
    for start in (len(done.clip), 2 * len(done.clip)):
        assert np.abs(jumps[start - 1] - done.loop.jump).min() < 1e-3  # of one of the joints
        assert jumps[start - 1].max() < 2 * done.loop.jump
        assert jumps[start - 2].max() <= done.report.gaps[-1].peak_limit
    if not align:  # it comes back to where it began
        assert done.loop.placement == timeline.Placement()
    assert len(done.raw.clip) == len(done.clip) == len(done.provenance) == done.report.gaps[-1].stop


def test_a_walk_that_loops_walks_on(data):
    """Forty times two steps: as far as the pace leads, not on the spot."""
    walk = load(data / "cmu_walk.bvh").slice(10, 65)
    done = tasks.stitch([walk], loop=True)
    assert done.loop is not None
    way = np.hypot(*done.loop.placement.shift[::2])
    assert done.loop.placement.yaw == pytest.approx(0, abs=0.4)
    begun, ended = (np.linalg.norm((p[1] - p[0])[[0, 2]]) for p in (walk.root[[0, 15]], walk.root[[-16, -1]]))
    assert np.linalg.norm((done.loop.placement.of(walk).root[0] - walk.root[-1])[[0, 2]]) == pytest.approx(
        (begun + ended) / 30 * (len(done.clip) - len(walk) + 1), rel=0.05
    )
    assert way > 1


def test_a_transition_without_strides_takes_as_long_as_feet_slide_least(cmu_walk):
    """The first clip turns on the spot, and has none."""
    clips = cmu_walk.slice(85, 125), cmu_walk.slice(150, 200)
    least = len(timeline.lay(clips).gaps[0])
    chosen, hurried = tasks.stitch(clips), tasks.stitch(clips, least)
    assert least < len(chosen.clip) - 90 <= least + 30
    assert chosen.report.gaps[0].foot_slide < 0.5 * hurried.report.gaps[0].foot_slide
    assert "feet slide least, of 11 lengths" in chosen.clips[1].why


def test_other_values_of_the_clips_do_not_reach_each_other(cmu_walk):
    """Turning and moving a following clip changes nothing."""
    first, second = cmu_walk.slice(0, 80), cmu_walk.slice(120, 209)
    moved = timeline.Placement(1.9, (40.0, 0.0, -3.0)).of(second)
    one, other = (tasks.stitch([first, clip]) for clip in (second, moved))
    assert len(one.clip) == len(other.clip)
    assert np.abs(one.clip.positions() - other.clip.positions()).max() < 1e-3


def test_auto_takes_networks_at_any_length_where_keys_are_lone(cmu_walk):
    def methods(*gaps):  # type: ignore[no-untyped-def]
        seen = Observation.from_gaps(cmu_walk, [Gap(*gap) for gap in gaps])
        return [job.method.name for job in tasks.plan(cmu_walk, seen, "auto", None, None, {})]

    assert methods((10, 40), (41, 80)) == ["base", "base"], "motion on one side of each"
    assert methods((10, 40), (41, 80), (81, 120)) == ["base"] * 3
    assert methods((10, 40), (42, 80)) == ["base", "base"]
    assert methods((1, 3), (4, 5)) == ["base", "spline"], "a key at the start, and motion after the last gap"
    assert methods((1, 126), (127, 140)) == ["base", "base"], "between keys that are half a turn apart"
    assert [gap.method for gap in tasks.between(cmu_walk, [0, 40, 90]).report.gaps] == ["base", "base"]


@pytest.mark.parametrize("method", ["small", "base"])
def test_who_walks_walks_on_for_seconds(cmu_walk, method):
    """As far as in truth to a quarter; half of it where what is said of the first seconds counts as known."""
    done = tasks.fill(cmu_walk, [Gap(100, 209)], method).clip
    ways = [np.linalg.norm(np.diff(one.root[99:], axis=0), axis=1).sum() for one in (done, cmu_walk)]
    assert 0.75 < ways[0] / ways[1] < 1.25


def test_half_a_turn_between_lone_keys_takes_the_time_there_is(cmu_walk):
    """Seen from either way round it is as far; a network alone would snap."""
    pose, body = cmu_walk.slice(0, 1), find_humanoid(cmu_walk)
    for degrees in (100, 175):
        yaw = np.radians(degrees)
        there = timeline.Placement(yaw, tuple(pose.root[0] - turn(pose.root[0], np.array(yaw)))).of(pose)
        done = tasks.between(tasks.block({0: pose, 46: there}), [0, 46])
        assert done.report.gaps[0].method == "base"
        faces = np.unwrap(facing(body.positions(done.clip)))
        assert np.degrees(np.abs(np.diff(faces))).max() * cmu_walk.fps < 360


def dropped(clip, share):  # type: ignore[no-untyped-def]
    """The clip with joints in their rest pose, each in a share of the frames, and which values are lost."""
    lost = np.random.default_rng(0).random(clip.rotation.shape[:2]) < share
    lost[:, 0] = False
    lost[[0, -1]] = False
    rotation = np.where(lost[..., None], clip.skeleton.rest_rotation, clip.rotation)
    return clip.with_motion(rotation, clip.translation), lost


@pytest.mark.parametrize("gap", [(0, 2), (138, 140)])
def test_auto_takes_the_network_at_any_length_at_the_ends(cmu_walk, gap):
    """A spline has nothing on the other side."""
    cmu_walk = cmu_walk.slice(60, 200)
    errors = {
        method: np.linalg.norm(
            tasks.fill(cmu_walk, [Gap(*gap)], method).clip.positions() - cmu_walk.positions(), axis=-1
        )[slice(*gap)].mean()
        for method in ("auto", "spline")
    }
    assert errors["auto"] < 0.8 * errors["spline"]


def test_joints_lost_for_moments_are_found_and_interpolated(cmu_walk):
    """At random frames: one line tells of them, the rest comes back bit for bit, and the error is small."""
    noisy, _ = dropped(cmu_walk, 0.3)
    done = tasks.recover(noisy)
    assert done.report.gaps == []
    assert "lost for moments" in str(done.report)
    found = done.provenance != 0
    assert np.array_equal(done.clip.rotation[~found], noisy.rotation[~found])
    spoiled = rotations.angle(noisy.rotation, cmu_walk.rotation) > 0.1
    assert found[spoiled].mean() > 0.95
    off = 100 * np.linalg.norm(done.clip.positions() - cmu_walk.positions(), axis=-1)
    before = 100 * np.linalg.norm(noisy.positions() - cmu_walk.positions(), axis=-1)
    assert off.mean() < 0.3 < 10 < before.mean()


def test_a_rest_pose_that_leads_a_file_is_no_lost_joints(cmu_walk):
    """As it leads the BVH files of CMU's library: `scan` names it, and `fill` mends it."""
    rotation, skeleton = cmu_walk.rotation.copy(), cmu_walk.skeleton
    elbow = skeleton.index("LeftForeArm")
    rotation[0] = skeleton.rest_rotation
    rotation[10:70:7, elbow] = skeleton.rest_rotation[elbow]
    clip = cmu_walk.with_motion(rotation, cmu_walk.translation)
    done = tasks.recover(clip)
    assert {(one.joint, frame) for one in done.report.moments for frame in one.frames} == {
        ("LeftForeArm", f"{frame}:{frame + 1}") for frame in range(10, 70, 7)
    }
    assert np.array_equal(done.clip.rotation[0], rotation[0])


def test_of_a_pose_that_falls_to_rest_every_joint_is_recovered(cmu_walk):
    """A knee that is nearly straight beside it does not snap."""
    rest, knee = cmu_walk.skeleton.rest_rotation, cmu_walk.skeleton.index("LeftLeg")
    rotation = cmu_walk.rotation.copy()
    straight = 0.93 * np.exp(-(((np.arange(len(cmu_walk)) - 55) / 20) ** 2))
    rotation[:, knee] = rotations.exp((1 - straight)[:, None] * rotations.log(rotation[:, knee]))
    sound = cmu_walk.with_motion(rotation.copy(), cmu_walk.translation)
    rotation[50:60] = rest
    fallen = cmu_walk.with_motion(rotation, cmu_walk.translation)
    assert intact(fallen).rotation[50:60, knee].any()
    done = tasks.recover(fallen)
    assert rotations.angle(done.clip.rotation[50:60, knee], rest[knee]).min() > 0.01
    off = rotations.angle(done.clip.rotation[50:60, knee], sound.rotation[50:60, knee])
    assert off.max() < 0.1


def test_a_frame_in_which_most_joints_are_lost_keeps_the_others(cmu_walk):
    skeleton, rotation = cmu_walk.skeleton, cmu_walk.rotation.copy()
    sound = [skeleton.index(name) for name in ("Hips", "RightArm", "RightForeArm", "RightHand")]
    for joint in {*range(len(skeleton))} - {*sound}:
        rotation[100, joint] = skeleton.rest_rotation[joint]
    done = tasks.recover(cmu_walk.with_motion(rotation, cmu_walk.translation))
    assert done.provenance[100].any()
    assert np.array_equal(done.clip.rotation[100, sound], cmu_walk.rotation[100, sound])


def test_only_frames_asked_for_are_recovered(cmu_walk):
    noisy, _ = dropped(cmu_walk, 0.1)
    done = tasks.recover(noisy, frames=(40, 60))
    assert not done.provenance[:40].any()
    assert not done.provenance[60:].any()
    assert done.provenance[40:60].any()


def test_moments_beside_a_gap(cmu_walk):
    """A gap is filled as ever, and what is lost for moments elsewhere has no influence on its own values."""
    noisy, lost = dropped(cmu_walk, 0.1)
    lost[70:120] = False
    lost[80:110] = True
    observation = Observation(~lost, np.ones_like(lost))
    done = tasks.fill(noisy, observation)
    (gap,) = done.report.gaps
    assert (gap.start, gap.stop) == (80, 110)
    assert len(done.report.moments) > 10
    spoiled = noisy.with_motion(np.where(lost[..., None], [1.0, 0, 0, 0], noisy.rotation), noisy.translation)
    assert np.array_equal(tasks.fill(spoiled, observation).clip.rotation, done.clip.rotation)


def test_a_path_through_a_gap_that_stays_open_is_refused(cmu_walk):
    point = cmu_walk.root[50, [0, 2]]
    with pytest.raises(RequestError, match="stays open: frame 50"):
        tasks.fill(cmu_walk, [Gap(40, 60), Gap(90, 110)], "spline", only=[2], path={50: point})


def test_what_several_methods_said_is_kept_apart_by_joint(cmu_walk):
    """They speak of different joints; what a network says of feet and of its errors is not lost."""
    gaps = [Gap(40, 60), Gap(90, 110)]
    raw = tasks.fill(cmu_walk, gaps, methods={1: "kalman", 2: "cae"}).raw
    alone = [tasks.fill(cmu_walk, gaps, name, only=[n]).raw for n, name in ((1, "kalman"), (2, "cae"))]
    for one, part in zip(alone, (slice(40, 60), slice(90, 110))):
        rows = [raw.joints.index(joint) for joint in one.joints]
        np.testing.assert_allclose(raw.positions[part, rows], one.positions[part], atol=1e-6)
    done = tasks.fill(cmu_walk, gaps, "small")
    assert np.isfinite(done.raw.expected[40:60]).all()
    assert np.isfinite(done.raw.stands[90:110]).all()
    assert 100 * done.raw.expected[40:60].mean() == pytest.approx(done.report.gaps[0].expected)


def test_feet_of_a_gap_in_pieces_travel_as_far_as_they_do(long_walk):
    """Windows overlap, and each tells of its own frames alone: it was a fifth too far."""
    joints = ("LeftUpLeg", "LeftLeg", "LeftFoot")
    done = tasks.recover(long_walk, joints, method="linear")
    (gap,) = done.report.gaps
    known = Observation.from_gaps(long_walk, [Gap(0, len(long_walk), joints)])
    _, travel = feet.measure(done.clip, known, 0, len(long_walk))
    assert gap.foot_travel == pytest.approx(travel, rel=0.08)
    assert len(long_walk) > windows.PIECE * long_walk.fps


def test_reports_of_pieces_are_joined_whole():
    """The worst of what must not be, means of what is a mean, and what only the second piece has."""
    first = GapReport(0, 100, ("Head",), "small", 1, penetration=1.0, expected=2.0)
    second = replace(first, start=90, stop=140, penetration=9.0, pins=3.0, expected=6.0)
    (joined,) = windows.joined([first, second])
    assert (joined.start, joined.stop, joined.penetration, joined.pins) == (0, 140, 9.0, 3.0)
    assert 2.0 < joined.expected < 6.0


@pytest.mark.parametrize("fps", [60, 120])
def test_a_network_says_of_every_new_frame_which_feet_stand(cmu_walk, fps):
    """Beside seams, too, where frames of the clip lie between a known one of the network's and a new one."""
    clip = resample(cmu_walk, fps)
    start, stop = round(2 * fps), round(3 * fps)
    fine = tasks.fill(clip, [Gap(start, stop)], "small").raw.stands[start:stop]
    coarse = tasks.fill(cmu_walk, [Gap(60, 90)], "small").raw.stands[60:90]
    step = fps // 30
    assert np.abs(fine[::step] - coarse).max() < 0.35
    assert np.abs(fine[:step] - coarse[0]).max() < 0.35, "nothing is mixed with what was never said"


def test_a_method_that_fails_when_it_is_asked_is_named(cmu_walk):
    class Odd(type(registry.get("linear"))):  # type: ignore[misc]
        name = "odd"

        def refuses(self, clip, gap):  # type: ignore[no-untyped-def]
            return clip.nothing

    with pytest.raises(RequestError, match="the method odd does not work"):
        complete(cmu_walk, Observation.from_gaps(cmu_walk, [Gap(70, 100)]), Odd())


@pytest.mark.parametrize(
    "joints", [range(1, 32), range(-1, 30), [*range(30), 5.5], [*range(30), "Head"], None]
)
def test_a_method_that_speaks_of_joints_that_are_not_there_is_named(cmu_walk, joints):
    class Odd(type(registry.get("linear"))):  # type: ignore[misc]
        name = "odd"

        def complete(self, clip, observation, seed=None):  # type: ignore[no-untyped-def]
            raw = super().complete(clip, observation, seed)
            return replace(raw, positions=raw.clip.positions(), joints=joints)

    assert len(cmu_walk.skeleton) == 31
    with pytest.raises(RequestError, match="the method odd does not work"):
        complete(cmu_walk, Observation.from_gaps(cmu_walk, [Gap(70, 100)]), Odd())


def test_a_method_that_answers_on_other_bones_is_named(cmu_walk):
    class Odd(type(registry.get("linear"))):  # type: ignore[misc]
        name = "odd"

        def complete(self, clip, observation, seed=None):  # type: ignore[no-untyped-def]
            raw = super().complete(clip, observation, seed)
            longer = replace(clip.skeleton, rest_translation=2 * clip.skeleton.rest_translation)
            return replace(raw, clip=replace(raw.clip, skeleton=longer))

    with pytest.raises(
        RequestError, match="the method odd does not work\nit gave a clip on another skeleton"
    ):
        complete(cmu_walk, Observation.from_gaps(cmu_walk, [Gap(70, 100)]), Odd())


@pytest.mark.parametrize(
    "wrong",
    [
        {"stands": np.ones((7, 4))},
        {"expected": np.ones(7)},
        {"translated": (0, 1)},
        {"notes": ["so"]},
        {"rotation": np.nan},
        {"rotation": 1.5},
    ],
)
def test_a_method_that_gives_something_else_is_named(cmu_walk, wrong):
    class Odd(type(registry.get("linear"))):  # type: ignore[misc]
        name = "odd"

        def complete(self, clip, observation, seed=None):  # type: ignore[no-untyped-def]
            raw = super().complete(clip, observation, seed)
            if "rotation" in wrong:
                return replace(raw, clip=replace(raw.clip, rotation=wrong["rotation"] * raw.clip.rotation))
            if "translated" not in wrong:
                return replace(raw, **wrong)
            more = np.repeat(raw.clip.translation, 2, axis=1)
            return replace(raw, clip=replace(raw.clip, translation=more, **wrong))

    seen = Observation.from_gaps(cmu_walk, [Gap(70, 100)])
    with pytest.raises(RequestError, match="the method odd does not work"):
        complete(cmu_walk, seen, Odd())


def test_a_part_of_what_a_method_said_is_of_its_frames(cmu_walk):
    done = tasks.between(cmu_walk, [40, 80], cut=True)
    assert done.raw.stands is not None
    assert len(done.raw.stands) == len(done.raw.expected) == len(done.raw.clip) == len(done.clip) == 41


def test_means_of_a_gap_in_pieces_count_frames_and_the_worst_stays():
    pieces = [
        GapReport(0, 30, None, "small", number=1, foot_slide=4.0, seam_after=1.0),
        GapReport(30, 120, None, "small", number=1, foot_slide=8.0, seam_after=0.5),
        GapReport(120, 160, None, "small", number=1, foot_slide=1.0, seam_after=0.2),
    ]
    (whole,) = windows.joined(pieces)
    assert (whole.start, whole.stop, whole.seam_after) == (0, 160, 1.0)
    assert whole.foot_slide == pytest.approx((30 * 4 + 90 * 8 + 40 * 1) / 160)


def test_who_is_elsewhere_at_the_next_key_walks_there(cmu_walk):
    """The same pose two metres ahead two seconds later. All said at once it is a mean of the steps that lead
    there: the body glides in 89 % of its frames."""
    pose = cmu_walk.slice(100, 101)
    yaw = facing(find_humanoid(pose).positions(pose))[0]
    keys = cmu_walk.with_motion(pose.rotation[[0] * 61], pose.translation[[0] * 61])
    keys.translation[60, 0] += [2.0 * np.sin(yaw), 0.0, 2.0 * np.cos(yaw)]
    placed = tasks.between(keys, [0, 60], method="small").clip.positions()
    glides = measures.glides(placed[:, feet.pairs(keys.skeleton)], placed[:, 0], keys.fps)
    assert glides.mean() < 0.5


def test_of_a_gap_in_pieces_what_is_expected_is_said_once():
    off = [
        f"flagged: joints are expected to be off by {cm} cm: nothing tells. A key helps" for cm in (18, 31, 9)
    ]
    pieces = [
        windows.GapReport(start, start + 60, None, "small", number=1, notes=("carried on", note))
        for start, note in zip((0, 50, 100), off)
    ]
    (whole,) = windows.joined(pieces)
    assert whole.notes == ("carried on", off[1])


def test_of_a_gap_in_pieces_the_joint_nearest_to_its_limit_counts():
    pieces = [
        GapReport(10, 40, None, "small", seam_after=2.0, seam_limit=5.0, number=1),
        GapReport(40, 60, None, "small", seam_after=1.5, seam_limit=1.6, number=1),
        GapReport(60, 80, None, "small", number=1),
    ]
    (whole,) = windows.joined(pieces)
    assert (whole.start, whole.stop, whole.seam_after, whole.seam_limit) == (10, 80, 1.5, 1.6)


def test_what_hangs_from_a_body_is_not_expected_to_be_off_by_more_and_more(cmu_walk):
    """A forearm that is lost all along: its hand is never further away than twice its length."""
    back = cmu_walk.take([*range(209), *range(207, -1, -1)])
    long = back.joined([back, back])
    done = tasks.fill(long, [Gap(0, len(long), ("LeftForeArm",))], "small")
    off = np.linalg.norm(done.clip.positions() - long.positions(), axis=-1)
    true = 100 * off[:, off.max(axis=0) > 1e-6].mean()
    assert 0.5 * true < done.report.gaps[0].expected < 3 * true


def test_why_no_network_fills_a_gap_is_said_of_what_is_no_humanoid(cmu_walk):
    """Also where the gap is too short for one of the networks that might have."""
    names = tuple(f"part{j}" for j in range(len(cmu_walk.skeleton)))
    bones = np.random.default_rng(0).permutation(cmu_walk.skeleton.rest_translation)
    skeleton = replace(cmu_walk.skeleton, names=names, rest_translation=bones)
    strange = replace(cmu_walk, skeleton=skeleton, source=None)
    (gap,) = tasks.fill(strange, [Gap(60, 90)]).report.gaps
    assert gap.method == "spline"
    assert any(note.startswith("not filled by base") for note in gap.notes)


@pytest.fixture(scope="module")
def duo(cmu_walk):  # type: ignore[no-untyped-def]
    """Two bodies in one file: one who walks, and two metres beside him the same walk backwards."""
    two, count = twice(cmu_walk), len(cmu_walk.skeleton)
    rotation, translation = two.rotation.copy(), two.translation.copy()
    rotation[:, count:] = rotation[::-1, count:]
    translation[:, 1] = translation[::-1, 1] + [2.0, 0.0, 0.0]
    return two.with_motion(rotation, translation)


def test_each_of_two_bodies_is_filled_as_if_it_were_alone(duo, cmu_walk):
    """And the reports say whose gap it is."""
    count, back = len(cmu_walk.skeleton), cmu_walk.take(np.arange(len(cmu_walk))[::-1])
    done = tasks.fill(duo, [Gap(60, 90)], "small")
    one, other = done.report.gaps
    assert one.joints == duo.skeleton.names[:count]
    assert other.joints == duo.skeleton.names[count:]
    for joints, alone in ((slice(count), cmu_walk), (slice(count, None), back)):
        there = tasks.fill(alone, [Gap(60, 90)], "small").clip
        np.testing.assert_allclose(done.clip.rotation[:, joints], there.rotation, atol=1e-9)


def test_of_two_bodies_one_can_be_lost(duo, cmu_walk):
    """All joints that are its, or the one that is said to be meant: the other one stays as it is."""
    count = len(cmu_walk.skeleton)
    own = duo.skeleton.names[count:]
    meant = replace(duo, skeleton=replace(duo.skeleton, roles={"root": "B_Hips"}), source=None)
    named = tasks.fill(duo, [Gap(60, 90, own)], "small")
    said = tasks.fill(meant, [Gap(60, 90)], "small")
    np.testing.assert_array_equal(named.clip.rotation, said.clip.rotation)
    np.testing.assert_array_equal(named.clip.translation, said.clip.translation)
    assert np.array_equal(named.clip.rotation[:, :count], duo.rotation[:, :count])
    assert np.array_equal(named.clip.translation[:, 0], duo.translation[:, 0])
    assert not np.array_equal(named.clip.translation[60:90, 1], duo.translation[60:90, 1])


def test_what_two_bodies_lack_is_found_and_recovered_of_each(duo, cmu_walk):
    """A body that is held for a second, and an arm of the other one that drops to rest meanwhile."""
    count = len(cmu_walk.skeleton)
    rotation, translation = duo.rotation.copy(), duo.translation.copy()
    rotation[60:90, count:], translation[60:90, 1] = rotation[59, count:], translation[59, 1]
    arm = duo.skeleton.index("LeftArm")
    rotation[120:123, arm] = duo.skeleton.rest_rotation[arm]
    damaged = duo.with_motion(rotation, translation)
    found = scan(damaged)
    assert [(one.kind, one.start, one.stop) for one in found] == [("frozen", 60, 90), ("lost", 120, 123)]
    assert found[0].joints == duo.skeleton.names[count:]
    assert found[1].joints == ("LeftArm",)
    mended = tasks.recover(damaged, method="small")
    assert np.array_equal(mended.clip.rotation[:, count:], rotation[:, count:])
    assert rotations.angle(mended.clip.rotation[120:123, arm], duo.rotation[120:123, arm]).max() < 0.1


def test_the_place_of_each_of_two_bodies_is_recovered(duo):
    translation = duo.translation.copy()
    translation[60:90] = translation[59]
    done = tasks.recover(duo.with_motion(duo.rotation, translation), place=True, frames=(60, 90))
    off = np.linalg.norm(done.clip.translation - duo.translation, axis=-1).max(axis=0)
    assert (off < 0.3).all(), off


def test_a_path_is_the_way_of_one_body(duo):
    aside = duo.translation[75, 0, [0, 2]] + 0.3
    done = tasks.fill(duo, [Gap(60, 90)], "small", path={75: aside})
    np.testing.assert_allclose(done.clip.translation[75, 0, [0, 2]], aside, atol=1e-6)
    there = tasks.fill(duo, [Gap(60, 90)], "small").clip
    np.testing.assert_array_equal(done.clip.translation[:, 1], there.translation[:, 1])


def test_a_root_that_stays_does_so_where_a_pose_of_another_body_is_met(cmu_walk):
    """What follows the pose is moved with it: by its hips, not by what stays at the origin."""
    large = replace(cmu_walk.skeleton, rest_translation=1.3 * cmu_walk.skeleton.rest_translation)
    other = under_root(replace(cmu_walk, skeleton=large, translation=1.3 * cmu_walk.translation), False)
    done = tasks.pose_to_pose(
        under_root(cmu_walk, False).slice(0, 101), other.slice(120, 208), 30, method="spline"
    ).clip
    assert np.ptp(done.positions()[:, 0], axis=0).max() < 1e-9
    made = blocked(under_root(cmu_walk, False), 100, other, 120, {}, 30).clip.positions()
    hips = find_humanoid(other).mapping["Hips"]
    assert np.linalg.norm(np.diff(made[-15:, hips], axis=0), axis=-1).max() < 0.1


def test_a_rest_pose_beside_a_pose_does_not_say_how_long_the_way_takes(cmu_walk):
    walk = cmu_walk.slice(1, 101)
    aside = walk.with_motion(walk.rotation, walk.translation + np.array([6.0, 0.0, 0.0]))
    rest = walk.with_motion(
        np.tile(walk.skeleton.rest_rotation, (100, 1, 1)), np.zeros_like(walk.translation)
    )
    led = walk.joined([rest.slice(0, 1), aside])
    one, other = (blocked(walk, 99, target, first, {}, None).said for target, first in ((aside, 0), (led, 1)))
    assert one == other
    assert int(one[0].split()[0]) > 100
    assert one[0] in tasks.pose_to_pose(walk, led, method="spline").report.gaps[-1].notes


def test_folders_name_methods_by_text(cmu_walk):
    folder = weights.find("small").onnx.parent
    report = tasks.fill(cmu_walk, [Gap(60, 80)], folder).report
    assert report.gaps[0].method == str(folder)
    assert json.dumps(report.to_dict())


def test_numbers_of_gaps_count_what_was_observed(cmu_walk):
    """A forearm that is lost for a moment is the first of two gaps, and stays open with `only` the other."""
    seen = Observation.from_gaps(cmu_walk, [Gap(60, 100)])
    arm = cmu_walk.skeleton.index("LeftForeArm")
    seen.rotation[20:23, arm] = False
    report = tasks.fill(cmu_walk, seen, "spline", only=[2]).report
    assert [(gap.start, gap.stop) for gap in report.gaps] == [(60, 100)]
    assert [(gap.start, gap.stop) for gap in report.open] == [(20, 23)]


def test_lengths_are_tried_with_the_clips_beside_a_gap_alone(cmu_walk, monkeypatch):
    """A clip of ten frames does not reach over the gap before it."""
    seen, lay = [], timeline.lay

    def watched(clips, *args, **kwargs):
        seen.append([len(clip) for clip in clips])
        return lay(clips, *args, **kwargs)

    monkeypatch.setattr(timeline, "lay", watched)
    parts = [cmu_walk.slice(0, 60), cmu_walk.slice(100, 110), cmu_walk.slice(120, 200)]
    tasks.stitch(parts, method="spline")
    assert len(seen) > 3
    assert all(10 in lengths for lengths in seen if lengths != [60, 10, 80])


def test_nothing_retargeted_is_nothing(cmu_walk):
    large = replace(cmu_walk.skeleton, rest_translation=1.3 * cmu_walk.skeleton.rest_translation)
    assert len(retarget(replace(cmu_walk, skeleton=large).slice(0, 0), cmu_walk)) == 0


def test_the_beginning_of_a_clip_is_said_as_firmly_as_its_end(cmu_walk, monkeypatch):
    """Of fewer frames than what is near to known ones: a slice that ended before it began was taken from the
    end of the clip."""
    guessed = []

    class Watched(np.ndarray):
        def __setitem__(self, key, value):
            super().__setitem__(key, value)
            if isinstance(value, float) and value == holes.GUESSED:
                guessed.append(self[key].size)

    ones = np.ones
    monkeypatch.setattr(holes.np, "ones", lambda *args, **kwargs: ones(*args, **kwargs).view(Watched))
    for gap in (Gap(0, 25), Gap(len(cmu_walk) - 25, len(cmu_walk))):
        tasks.fill(cmu_walk, [gap], "small")
    assert set(guessed) == {0}


def test_frames_of_points_between_poses_count_from_the_first_in_what_is_said(cmu_walk):
    start, target = cmu_walk.slice(0, 60), cmu_walk.slice(100, 160)
    hand = Pin("LeftHand", np.array([45]), np.zeros((1, 3)))
    inside = replace(hand, frames=np.array([7]))
    for asked in ({"path": {40: (0.0, 0.0)}}, {"path": {-3: (0.0, 0.0)}}, {"pins": [hand]}):
        frame = 45 if "pins" in asked else next(iter(asked["path"]))
        with pytest.raises(RequestError, match=f"at frame {frame}"):
            tasks.pose_to_pose(start, target, 30, method="spline", **asked)
    for pins, frame in (
        ((replace(hand, frames=np.array([0])),), 0),
        ((inside, replace(inside, position=hand.position + 9.0)), 7),
    ):
        with pytest.raises(RequestError, match=f"pinned (to two places )?at frame {frame}"):
            tasks.pose_to_pose(start, target, 30, method="spline", pins=pins)


def test_what_is_no_body_is_said_of_forecasts_and_gets_no_advice_that_does_not_help(cmu_walk):
    odd = tuple(f"bone{i}" for i in range(len(cmu_walk.skeleton)))
    flat = np.abs(cmu_walk.skeleton.rest_translation) * [1.0, 0.0, 0.0]
    strange = replace(cmu_walk, skeleton=replace(cmu_walk.skeleton, names=odd, rest_translation=flat))
    (gap,) = tasks.forecast(strange, 10).report.gaps
    assert "humanoids only" in " ".join(gap.notes)
    for clip, joint, helps in ((strange, odd[-1], False), (cmu_walk, "LeftForeArm", True)):
        known = Observation.from_gaps(clip, [Gap(0, len(clip), (joint,))])
        (gap,) = tasks.fill(clip, known, "spline").report.gaps
        (said,) = [note for note in gap.notes if "only the rest pose to say" in note]
        assert ("The method base tells it" in said) is helps


def test_a_folder_of_the_name_of_a_method_is_a_folder(cmu_walk, tmp_path, monkeypatch):
    shutil.copytree(weights.find("small-open").onnx.parent, tmp_path / "small")
    monkeypatch.chdir(tmp_path)
    assert registry.get(Path("small")).trained.name == "small-open"
    assert registry.get("small").trained is None


@pytest.mark.parametrize("verb", ["forecast", "stitch"])
def test_frames_that_nobody_has_recorded_are_made_of_all_bodies(duo, verb):
    """Whichever is meant: else the other one would stand still in them, and jump after them."""
    meant = replace(duo, skeleton=replace(duo.skeleton, roles={"root": "B_Hips"}))
    if verb == "forecast":
        done = tasks.forecast(meant, 30, method="small")
        new = slice(len(duo), len(duo) + 30)
    else:
        done = tasks.stitch([meant.slice(0, 90), meant.slice(120, 200)], 20, method="small")
        new = slice(90, 110)
    for hips in range(2):
        steps = np.linalg.norm(np.diff(done.clip.translation[new.start - 1 : new.stop, hips], axis=0), axis=1)
        assert np.median(steps) > 1e-4
        assert steps.max() < 0.4
    assert (done.provenance[new] != Provenance.OBSERVED).all()


def test_two_gaps_of_one_body_within_one_of_another_stay_two(duo, cmu_walk):
    count = len(cmu_walk.skeleton)
    first, other = duo.skeleton.names[:count], duo.skeleton.names[count:]
    gaps = [Gap(40, 140, first), Gap(60, 70, other), Gap(100, 110, other)]
    done = tasks.fill(duo, gaps, "small")
    assert [(gap.start, gap.stop) for gap in done.report.gaps if gap.joints == other] == [
        (60, 70),
        (100, 110),
    ]
    assert np.array_equal(done.clip.rotation[70:100, count:], duo.rotation[70:100, count:])


def test_each_of_two_bodies_is_denoised_as_if_it_were_alone(duo, cmu_walk):
    """Its root, too, and a limb of it that changed sides is put back."""
    count = len(cmu_walk.skeleton)
    rng = np.random.default_rng(3)
    shaken = duo.translation + rng.normal(0.0, 0.015, duo.translation.shape)
    rotation = duo.rotation.copy()
    legs = ["LeftUpLeg", "LeftLeg", "LeftFoot", "RightUpLeg", "RightLeg", "RightFoot"]
    legs = [duo.skeleton.index(f"B_{name}") for name in legs]
    rotation[100:140, legs] = rotation[100:140][:, legs[3:] + legs[:3]]
    noisy = duo.with_motion(rotation, shaken)
    done = tasks.denoise(noisy)
    alone = tasks.denoise(clip_of(noisy, tuple(range(count, 2 * count))))
    np.testing.assert_array_equal(done.clip.rotation[:, count:], alone.clip.rotation)
    np.testing.assert_array_equal(done.clip.translation[:, 1:], alone.clip.translation)
    off = np.linalg.norm(done.clip.translation - duo.translation, axis=-1).mean(axis=0)
    assert (off < 0.5 * np.linalg.norm(shaken - duo.translation, axis=-1).mean(axis=0)).all(), off
    assert {one.joint for one in done.report.exchanged} >= {duo.skeleton.names[joint] for joint in legs}
    assert [one.joint for one in done.report.noise.joints] == list(duo.skeleton.names)
    assert done.report.noise.values == 2 * alone.report.noise.values

    one = tasks.denoise(noisy, joints=["LeftArm"]).clip
    assert np.array_equal(one.rotation[:, count:], noisy.rotation[:, count:])
    assert not np.array_equal(one.rotation[:, :count], noisy.rotation[:, :count])
    assert np.array_equal(tasks.denoise(noisy, joints=[]).clip.rotation, noisy.rotation)


def test_how_one_body_moves_does_not_say_how_another_one_may(duo, cmu_walk):
    """Beside somebody who whirls, the seams of one who walks are what they are alone, and so is its gap."""
    count = len(cmu_walk.skeleton)
    rotation = duo.rotation.copy()
    turn = rotations.about("Y", np.linspace(0.0, 40.0, len(duo)))
    for name in ("B_LeftArm", "B_RightArm", "B_Hips", "B_LeftUpLeg"):
        joint = duo.skeleton.index(name)
        rotation[:, joint] = rotations.multiply(turn, rotation[:, joint])
    wild, own = duo.with_motion(rotation, duo.translation), duo.skeleton.names[:count]
    (gap,) = tasks.fill(wild, [Gap(60, 90, own)], "spline").report.gaps
    (alone,) = tasks.fill(cmu_walk, [Gap(60, 90)], "spline").report.gaps
    assert gap.seam_limit == pytest.approx(alone.seam_limit)


def test_a_body_that_is_lost_for_a_moment_beside_another_is_a_gap(duo, cmu_walk):
    """And no values of single joints, as something is known of the other one."""
    count = len(cmu_walk.skeleton)
    seen = Observation.full(duo)
    seen.rotation[60:66, :count] = seen.translation[60:66, :count] = False
    done = tasks.fill(duo, seen)
    assert [(gap.start, gap.stop) for gap in done.report.gaps] == [(60, 66)]
    assert not done.report.moments


def test_a_body_that_is_lost_for_a_moment_beside_a_prop_is_a_gap(cmu_walk):
    """As it is beside another body: what it holds tells nothing of it."""
    old, count = cmu_walk.skeleton, len(cmu_walk)
    skeleton = Skeleton(
        (*old.names, "Ball"), (*old.parents, -1), np.vstack([old.rest_translation, [[1.0, 0, 0]]])
    )
    ball = np.tile(rotations.identity(), (count, 1, 1)), np.tile([1.0, 0.0, 0.0], (count, 1, 1))
    motion = (np.concatenate(both, axis=1) for both in zip((cmu_walk.rotation, cmu_walk.translation), ball))
    clip = Clip(skeleton, *motion, cmu_walk.fps, (*cmu_walk.translated, len(old)))
    seen = Observation.full(clip)
    seen.rotation[60:68, : len(old)] = seen.translation[60:68, : len(old)] = False
    done = tasks.fill(clip, seen)
    assert [(gap.start, gap.stop) for gap in done.report.gaps] == [(60, 68)]
    assert not done.report.moments


def test_what_is_lost_for_moments_stays_open_where_it_lasts_longer_than_allowed(cmu_walk):
    arm, seen = cmu_walk.skeleton.index("LeftForeArm"), Observation.full(cmu_walk)
    seen.rotation[60:68, arm] = False
    assert [len(gap) for gap in tasks.fill(cmu_walk, seen, max_gap=3).report.open] == [8]
    assert not tasks.fill(cmu_walk, seen, max_gap=8).report.open


def test_a_forecast_does_not_start_from_a_rest_pose_that_ends_a_file(cmu_walk):
    """It is made anew, as all that follows, and that is said."""
    rotation = cmu_walk.rotation.copy()
    rotation[-1] = cmu_walk.skeleton.rest_rotation
    ended = cmu_walk.with_motion(rotation, cmu_walk.translation)
    last = len(cmu_walk) - 1
    done = tasks.forecast(ended, 30)
    whole = tasks.forecast(cmu_walk.slice(0, last), 31)
    np.testing.assert_allclose(done.clip.positions(), whole.clip.positions(), atol=1e-6)
    assert (done.start, len(done.clip)) == (last, last + 31)
    assert any(f"frame {last} is no part of the motion" in note for note in done.report.gaps[0].notes)


def test_a_forecast_makes_the_last_frame_anew_of_whom_it_does_not_belong_to(duo):
    """One of two bodies ends in its rest pose: the other one's frame stays as it is."""
    count, last = len(duo.skeleton) // 2, len(duo) - 1
    rotation = duo.rotation.copy()
    rotation[last, count:] = duo.skeleton.rest_rotation[count:]
    odd = duo.with_motion(rotation, duo.translation)
    done = tasks.forecast(odd, 30, method="small")
    assert np.array_equal(done.clip.rotation[: last + 1, :count], odd.rotation[:, :count])
    assert np.array_equal(done.clip.translation[: last + 1, 0], odd.translation[:, 0])
    off = rotations.angle(done.clip.rotation[last, count:], duo.rotation[last, count:])
    assert off.mean() < 0.2 * rotations.angle(rotation[last, count:], duo.rotation[last, count:]).mean()
    ((gap, note),) = ((gap, note) for gap in done.report.gaps for note in gap.notes if "made anew" in note)
    assert note.startswith(f"frame {last} of B_Hips")
    assert "B_Hips" in gap.joints
    assert done.start == last
    said = replace(odd, skeleton=replace(odd.skeleton, roles={"root": "B_Hips"}), source=None)
    meant = tasks.forecast(said, 30, method="small").clip
    assert np.array_equal(meant.rotation[last, :count], odd.rotation[last, :count])
    assert not np.array_equal(meant.rotation[last, count:], odd.rotation[last, count:])
    rotation[last] = duo.skeleton.rest_rotation
    both = tasks.forecast(duo.with_motion(rotation, duo.translation), 30, method="small")
    assert both.start == last


def test_of_two_bodies_the_one_that_is_meant_is_denoised(duo):
    meant = replace(duo, skeleton=replace(duo.skeleton, roles={"root": "B_Hips"}), source=None)
    count = len(duo.skeleton) // 2
    noisy = tremble(meant, 2.0, np.random.default_rng(0))
    done = tasks.denoise(noisy)
    assert np.array_equal(done.clip.rotation[:, :count], noisy.rotation[:, :count])
    assert not np.array_equal(done.clip.rotation[:, count:], noisy.rotation[:, count:])
    with pytest.raises(RequestError, match="cannot denoise LeftArm"):
        tasks.denoise(noisy, joints=["LeftArm", "B_LeftArm"])
