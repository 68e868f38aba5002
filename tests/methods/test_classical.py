"""The classical methods: what they put into gaps of every kind, and what they must never touch."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp
from tests.skeletons.rigs import under_root

from interpose.clip import Clip, Skeleton
from interpose.geometry import rotations, time
from interpose.methods import classical, registry
from interpose.observation import Gap, Observation

NAMES = ("zero-velocity", "linear", "spline")
SKELETON = Skeleton(
    ("root", "spine", "arm", "hand"),
    (-1, 0, 1, 2),
    np.array([[0, 0.9, 0], [0, 0.5, 0], [0.3, 0.1, 0], [0.3, 0, 0]]),
    rest_rotation=np.array([[1.0, 0, 0, 0], [0.8, 0.6, 0, 0], [0, 1, 0, 0], [1, 0, 0, 0]]),
)


def motion(frames: int = 90, fps: float = 30, translated: tuple[int, ...] = (0,)) -> Clip:
    """A swinging arm on a body that goes forward: smooth, and never straight."""
    t = np.arange(frames)[:, None, None] / fps
    speed = np.array([1.0, 2, 3, 4])[None, :, None]
    axis = np.array([[0.1, 0.5, 0.2], [0.3, 0.1, -0.2], [0.9, 0.2, 0.3], [0.2, 0.4, 0.8]])
    rotation = rotations.exp(axis * np.sin(speed * t + speed))
    path = np.concatenate([np.sin(t), 0.9 + 0.05 * np.cos(4 * t), t], axis=-1)
    other = SKELETON.rest_translation[list(translated[1:])] * (1 + 0.1 * np.sin(2 * t))
    return Clip(SKELETON, rotation, np.concatenate([path, other], axis=1), fps, translated)


def fill(name: str, clip: Clip, *gaps: Gap) -> Clip:
    return registry.get(name).complete(clip, Observation.from_gaps(clip, gaps)).clip


def apart(a: np.ndarray, b: np.ndarray) -> float:
    return float(rotations.angle(a, b).max())


def test_zero_velocity_holds_the_last_pose_and_before_the_first_that():
    clip = motion()
    filled = fill("zero-velocity", clip, Gap(0, 10), Gap(40, 60), Gap(80, 90))
    assert (filled.rotation[40:60] == clip.rotation[39]).all()
    assert (filled.translation[40:60] == clip.translation[39]).all()
    assert (filled.rotation[:10] == clip.rotation[10]).all()
    assert (filled.rotation[80:] == clip.rotation[79]).all()


def test_linear_is_scipys_slerp_and_straight_lines():
    clip = motion()
    filled = fill("linear", clip, Gap(40, 60), Gap(80, 90))
    for joint in range(4):
        ends = Rotation.from_quat(clip.rotation[[39, 60], joint][:, [1, 2, 3, 0]])
        expected = Slerp([39, 60], ends)(np.arange(40, 60)).as_quat()[:, [3, 0, 1, 2]]
        assert apart(filled.rotation[40:60, joint], expected) < 1e-7
    line = np.linspace(clip.root[39], clip.root[60], 22)[1:-1]
    np.testing.assert_allclose(filled.root[40:60], line, atol=1e-12)
    assert apart(filled.rotation[80:], clip.rotation[79][None]) < 1e-7


@pytest.mark.parametrize("fps", [24, 30, 60, 120])
def test_spline_keeps_the_velocity_and_beats_linear(fps):
    clip = motion(int(3 * fps), fps)
    gap = Gap(fps, 2 * fps)
    spline, linear = fill("spline", clip, gap), fill("linear", clip, gap)
    truth = clip.positions()
    # No pop: a cubic bends more than the motion it replaces, but its velocity does not jump.
    jumps = [np.linalg.norm(np.diff(c.positions(), 2, axis=0), axis=-1) for c in (clip, spline, linear)]
    seams = [gap.start - 2, gap.start - 1, gap.stop - 2, gap.stop - 1]
    assert jumps[1][seams].max() < 2 * jumps[0].max()
    assert jumps[2][seams].max() > fps / 6 * jumps[0].max()
    errors = [np.linalg.norm(c.positions() - truth, axis=-1)[gap.start : gap.stop] for c in (spline, linear)]
    assert errors[0].mean() < 0.6 * errors[1].mean()


def test_spline_on_long_gaps_does_not_swing_out():
    """A limb in full swing at the edge of a long gap comes back to the line between the ends."""
    clip = motion(400)
    turning = clip.rotation.copy()
    turning[:, 2] = rotations.exp(np.array([0.0, 0, 0.15]) * np.arange(400)[:, None])
    clip = clip.with_motion(turning, clip.translation)
    filled, linear = (fill(name, clip, Gap(50, 350)) for name in ("spline", "linear"))
    away = rotations.angle(filled.rotation[50:350, 2], linear.rotation[50:350, 2])
    reach = classical.REACH * 30
    assert away.max() < 0.2 * 4 / 27 * reach * 1.1
    assert away[50:-50].max() < 1e-6


def test_spline_comes_to_rest_at_open_ends():
    clip = motion()
    filled = fill("spline", clip, Gap(0, 30), Gap(60, 90))
    steps = rotations.angle(filled.rotation[1:], filled.rotation[:-1])
    rest = round(classical.REST * 30) + 1
    assert steps[59 + rest : 89].max() < 1e-6
    assert steps[: 29 - rest].max() < 1e-6
    # ... but not at once: there is no jump of velocity where the gap begins.
    np.testing.assert_allclose(
        time.steps(filled.rotation[58:61])[1], time.steps(clip.rotation)[59], atol=0.03
    )
    np.testing.assert_allclose(
        np.diff(filled.root, axis=0)[[29, 59]], np.diff(clip.root, axis=0)[[29, 59]], atol=0.01
    )


def test_a_lone_key_is_passed_smoothly():
    clip = motion(121)
    filled = fill("spline", clip, Gap(40, 60), Gap(61, 81))
    turns = time.steps(filled.rotation)
    assert np.linalg.norm(turns[60] - turns[59], axis=-1).max() < 0.03
    assert np.linalg.norm(np.diff(filled.root, 2, axis=0), axis=-1)[59] < 0.01
    assert (filled.rotation[60] == clip.rotation[60]).all()


@pytest.mark.parametrize("name", NAMES)
def test_methods_do_not_depend_on_the_direction_the_body_faces(name):
    clip = motion()
    world = rotations.exp(np.array([0.0, 2.0, 0.0]))
    turned = clip.rotation.copy()
    turned[:, 0] = rotations.multiply(world, turned[:, 0])
    moved = clip.with_motion(turned, rotations.rotate(world, clip.translation))
    gaps = Gap(0, 5), Gap(40, 60), Gap(61, 70), Gap(85, 90)
    here = rotations.rotate(world, fill(name, clip, *gaps).positions())
    np.testing.assert_allclose(fill(name, moved, *gaps).positions(), here, atol=1e-7)


@pytest.mark.parametrize("name", ["linear", "spline"])
def test_quaternion_signs_do_not_matter(name):
    clip = motion()
    signs = np.random.default_rng(0).choice([-1.0, 1.0], size=(90, 4, 1))
    flipped = clip.with_motion(clip.rotation * signs, clip.translation)
    gaps = Gap(10, 30), Gap(50, 51), Gap(80, 90)
    assert apart(fill(name, flipped, *gaps).rotation, fill(name, clip, *gaps).rotation) < 1e-7


# Masks (frames, joints) of what is known, by what is hard about them.
def _known(case: str, frames: int) -> np.ndarray:
    known = np.ones((frames, 4), bool)
    rng = np.random.default_rng(0)
    if case == "one gap":
        known[20:40] = False
    elif case == "start":
        known[:20] = False
    elif case == "end":
        known[-20:] = False
    elif case == "touching":
        known[20:40, :2] = False
        known[40:60, 2:] = False
    elif case == "joint never":
        known[:, 2] = False
    elif case == "nothing":
        known[:] = False
    elif case == "one frame":
        known[:] = False
        known[30] = True
    elif case == "keys":
        known[:] = False
        known[::15] = True
    elif case == "every other":
        known[::2] = False
    elif case == "scattered":
        known = rng.random((frames, 4)) > 0.5
    elif case == "ends only":
        known[1:-1] = False
    return known


CASES = ("one gap", "start", "end", "touching", "joint never", "nothing", "one frame", "keys", "every other")
CASES += ("scattered", "ends only")


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("poison", [np.nan, 1e30])
def test_observed_values_return_and_unobserved_ones_change_nothing(name, case, poison):
    clip = motion(90, translated=(0, 2))
    known = _known(case, 90)
    observation = Observation(known, known | ~np.isin(np.arange(4), (0, 2)))
    done = registry.get(name).complete(clip, observation).clip
    assert np.isfinite(done.rotation).all()
    np.testing.assert_allclose(np.linalg.norm(done.rotation, axis=-1), 1, atol=1e-12)
    assert (done.rotation[known] == clip.rotation[known]).all()
    moved = known[:, [0, 2]]
    assert (done.translation[moved] == clip.translation[moved]).all()
    # A clip refuses NaN, so it is put in behind its back.
    poisoned = clip.with_motion(clip.rotation.copy(), clip.translation.copy())
    poisoned.rotation[~known] = poison
    poisoned.translation[~moved] = poison
    again = registry.get(name).complete(poisoned, observation).clip
    assert (again.rotation == done.rotation).all()
    assert (again.translation == done.translation).all()


@pytest.mark.parametrize("name", NAMES)
def test_what_was_never_observed_takes_the_rest_pose(name):
    clip = motion(translated=(0, 2))
    nothing = Observation(np.zeros((90, 4), bool), np.zeros((90, 4), bool))
    done = registry.get(name).complete(clip, nothing).clip
    assert (done.rotation == SKELETON.rest_rotation).all()
    assert (done.translation[:, 0] == 0).all()
    assert (done.translation[:, 1] == SKELETON.rest_translation[2]).all()


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("frames", [1, 2, 3])
def test_tiny_clips(name, frames):
    clip = motion(frames)
    for start in range(frames):
        for stop in range(start + 1, frames + 1):
            done = fill(name, clip, Gap(start, stop))
            assert np.isfinite(done.positions()).all()
            assert len(done) == frames
    assert (fill(name, clip).rotation == clip.rotation).all()


@pytest.mark.parametrize("name", NAMES)
def test_joints_are_completed_on_their_own(name):
    """A gap of one joint gives the same as that joint in a gap of all, and leaves the others alone."""
    clip = motion()
    one, whole = fill(name, clip, Gap(30, 50, ("arm",))), fill(name, clip, Gap(30, 50))
    np.testing.assert_allclose(one.rotation[:, 2], whole.rotation[:, 2], atol=1e-12)
    rest = [0, 1, 3]
    assert (one.rotation[:, rest] == clip.rotation[:, rest]).all()
    assert (one.translation == clip.translation).all()


@pytest.mark.parametrize("name", NAMES)
def test_blocks_of_a_long_clip_agree_with_the_whole(name, monkeypatch):
    clip = motion(300)
    gaps = Gap(10, 120), Gap(130, 131), Gap(200, 300)
    whole = fill(name, clip, *gaps)
    monkeypatch.setattr(classical, "BLOCK", 7)
    blocks = fill(name, clip, *gaps)
    assert (whole.rotation == blocks.rotation).all()
    assert (whole.translation == blocks.translation).all()


def test_spline_on_a_real_walk(cmu_walk):
    """Gaps of a sixth of a second in a walk: less than half of linear's error."""
    clip = cmu_walk.slice(1, len(cmu_walk))
    length = round(clip.fps / 6)
    gaps = [Gap(start, start + length) for start in range(length, len(clip) - 2 * length, 3 * length)]
    inside = ~Observation.from_gaps(clip, gaps).frames
    truth = clip.positions()[inside]
    spline, linear = (
        np.linalg.norm(fill(name, clip, *gaps).positions()[inside] - truth, axis=-1).mean()
        for name in ("spline", "linear")
    )
    assert spline < 0.5 * linear


def test_hips_below_a_root_go_as_a_root_does(cmu_walk):
    """As MotionBuilder and game engines write them, Z up or not: eased on their way, not led straight on."""
    below = under_root(cmu_walk, goes=False)
    own, other = (fill("spline", clip, Gap(60, 120)).positions() for clip in (cmu_walk, below))
    joints = [below.skeleton.index(name) for name in cmu_walk.skeleton.names]
    np.testing.assert_allclose(other[:, joints], own, atol=1e-6)
