"""Denoising real clips: how far it gets, what it leaves alone, and what it refuses."""

from __future__ import annotations

import numpy as np
import pytest

import interpose
from interpose import tasks
from interpose.clip import Clip, Skeleton
from interpose.errors import RequestError
from interpose.evaluation.denoising import UNIT, drop, shake, tremble
from interpose.finish import Provenance, feet
from interpose.finish.denoise import deviation
from interpose.geometry import measures, rotations
from interpose.observation.scan import scan
from interpose.resampling import resample
from interpose.skeletons import find_mapping


def _shaken(clip: Clip, sigma: float) -> Clip:
    joints = find_mapping(clip.skeleton).mapped[1]
    return shake(clip, joints, UNIT * sigma, np.random.default_rng(3))


def _apart(one: Clip, other: Clip) -> np.ndarray:
    """(F, J) centimetres."""
    return 100 * np.linalg.norm(one.positions() - other.positions(), axis=-1)


@pytest.mark.parametrize(("sigma", "most"), [(0.5, 0.5), (1.0, 0.5), (1.5, 0.6)])
def test_noise_on_positions_falls(cmu_walk, sigma, most):
    noisy = _shaken(cmu_walk, sigma)
    done = interpose.denoise(noisy)
    before, after = (_apart(clip, cmu_walk).mean() for clip in (noisy, done.clip))
    assert after < most * before
    assert len(done.clip) == len(cmu_walk)
    # As calm as the real one, and no pop that the noise did not have.
    jumps = [measures.acceleration(clip.positions()) for clip in (cmu_walk, done.clip, noisy)]
    truth, calm, rough = (np.percentile(jump, 95) for jump in jumps)
    assert calm < 4 * truth
    assert jumps[1].max() < rough


def test_noise_on_rotations_falls(cmu_walk):
    noisy = tremble(cmu_walk, 5.0, np.random.default_rng(3))
    done = interpose.denoise(noisy)
    assert _apart(done.clip, cmu_walk).mean() < 0.5 * _apart(noisy, cmu_walk).mean()


def test_knees_of_a_walk_are_nearer_than_they_came(cmu_walk):
    """Feet that were held on noisy turns bent legs that are all but straight to and fro."""
    noisy = tremble(cmu_walk, 2.0, np.random.default_rng(3))
    knees = [cmu_walk.skeleton.index(name) for name in ("LeftLeg", "RightLeg")]
    before, after = (
        rotations.angle(one.rotation[:, knees], cmu_walk.rotation[:, knees]).mean()
        for one in (noisy, interpose.denoise(noisy).clip)
    )
    assert after < 0.55 * before


@pytest.mark.parametrize(("name", "most"), [("cmu_walk", 0.43), ("cmu_run", 0.55), ("cmu_jump", 0.47)])
def test_turns_that_are_smoothed_are_not_bent_back_to_noisy_positions(data, name, most):
    """Which noise on turns adds up to: .48, .62 and .53 of it was left so."""
    clip = interpose.load(data / f"{name}.bvh")
    noisy = tremble(clip, 2.0, np.random.default_rng(3))
    before, after = (
        rotations.angle(some.kinematics()[0], clip.kinematics()[0]).mean()
        for some in (noisy, interpose.denoise(noisy).clip)
    )
    assert after < most * before


@pytest.mark.parametrize("name", ["cmu_walk", "cmu_run", "cmu_jump"])
def test_light_noise_falls_and_quick_motion_stays(data, name):
    """Of half a centimetre: neither a quick limb nor a foot may be much worse than it came."""
    clip = interpose.load(data / f"{name}.bvh")
    noisy = tremble(clip, 0.3, np.random.default_rng(0))
    before, after = _apart(noisy, clip), _apart(interpose.denoise(noisy).clip, clip)
    assert after.mean() < 0.85 * before.mean()
    assert after.max() <= before.max()
    assert (after - before).max() < 1.6


@pytest.mark.parametrize("name", ["cmu_walk", "cmu_run", "cmu_jump", "cmu_02_03"])
def test_a_clean_clip_hardly_changes(data, name):
    clip = interpose.load(data / f"{name}.bvh")
    moved = _apart(interpose.denoise(clip).clip, clip)
    assert moved.mean() < 0.1
    assert moved.mean(axis=1).max() < 0.2  # in the fastest frame, too
    assert moved.max() < 0.5


@pytest.mark.parametrize("probability", [0.3, 0.5])
def test_dropped_joints_come_back(cmu_walk, probability):
    broken = drop(cmu_walk, probability, np.random.default_rng(3))
    done = interpose.denoise(broken)
    assert _apart(broken, cmu_walk).mean() > 5
    assert _apart(done.clip, cmu_walk).mean() < 1
    assert done.report.noise.broken > 500
    assert (done.provenance == Provenance.METHOD).sum() == done.report.noise.broken


def test_a_joint_that_drops_out_all_the_time_does_not_rest(cmu_walk):
    """Nowhere is there data for longer than a spike lasts: it is not the rest pose that is right."""
    leg = cmu_walk.skeleton.index("LeftUpLeg")
    gone = np.random.default_rng(0).permutation(len(cmu_walk)) % 5 < 2
    gone[3::4] = True
    rotation = cmu_walk.rotation.copy()
    rotation[gone, leg] = cmu_walk.skeleton.rest_rotation[leg]
    done = interpose.denoise(cmu_walk.with_motion(rotation, cmu_walk.translation))
    assert _apart(done.clip, cmu_walk).mean() < 0.3


def test_strength_scales_from_nothing_to_smoother(cmu_walk):
    noisy = _shaken(cmu_walk, 0.5)
    nothing = interpose.denoise(noisy, 0)
    assert nothing.clip.rotation.tobytes() == noisy.rotation.tobytes()
    assert nothing.clip.translation.tobytes() == noisy.translation.tobytes()
    assert not nothing.provenance.any()
    rough = [
        np.median(measures.acceleration(interpose.denoise(noisy, strength).clip.positions()))
        for strength in (0.25, 1.0, 3.0)
    ]
    assert rough == sorted(rough, reverse=True)


def test_bones_keep_their_lengths_and_still_joints_their_values(cmu_walk):
    noisy = _shaken(cmu_walk, 1.0)
    done = interpose.denoise(noisy).clip
    assert done.skeleton is noisy.skeleton
    for joint, parent in enumerate(done.skeleton.parents):
        if parent >= 0:
            bone = np.linalg.norm(done.positions()[:, joint] - done.positions()[:, parent], axis=-1)
            assert np.ptp(bone) < 1e-6
    still = (np.ptp(noisy.rotation, axis=0) == 0).all(axis=-1)
    assert still.any()
    assert np.array_equal(done.rotation[:, still], noisy.rotation[:, still])


def test_feet_stand(cmu_walk):
    noisy = _shaken(cmu_walk, 1.0)
    joints = feet.ends(cmu_walk.skeleton)
    truth = cmu_walk.positions()[:, joints]
    stands = measures.speed(truth, cmu_walk.fps) < feet.STILL
    before, after = (
        measures.stance_speed(clip.positions()[:, joints], stands, cmu_walk.fps)
        for clip in (noisy, interpose.denoise(noisy).clip)
    )
    assert after < 0.2 * before


@pytest.mark.parametrize("sigma", [0.0, 1.0])
def test_a_turned_and_shifted_input_gives_a_turned_and_shifted_result(cmu_walk, sigma):
    noisy = _shaken(cmu_walk, sigma)
    turn, shift = rotations.about("Y", np.array(2.0)), np.array([3.0, 0.0, -5.0])

    def moved(clip: Clip) -> Clip:
        rotation = clip.rotation.copy()
        rotation[:, 0] = rotations.multiply(turn, rotation[:, 0])
        return clip.with_motion(rotation, rotations.rotate(turn, clip.translation) + shift)

    assert _apart(interpose.denoise(moved(noisy)).clip, moved(interpose.denoise(noisy).clip)).max() < 2
    assert _apart(interpose.denoise(moved(noisy)).clip, moved(interpose.denoise(noisy).clip)).mean() < 0.1


@pytest.mark.parametrize("size", [0.1, 8.0])
@pytest.mark.parametrize("sigma", [0.1, 0.4])
def test_small_and_large_bodies_are_denoised_as_others(cmu_walk, size, sigma):
    """Puppets and giants: what is shaky, and which feet stand, is seen by the size of the body."""
    noisy = _shaken(cmu_walk, sigma)
    shift = np.random.default_rng(5).normal(scale=0.02, size=noisy.translation.shape)
    for clip in (noisy, cmu_walk.with_motion(cmu_walk.rotation, cmu_walk.translation + shift)):
        done, usual = interpose.denoise(clip.scaled(size)), interpose.denoise(clip)
        assert _apart(done.clip.scaled(1 / size), usual.clip).max() < 1e-2
        assert done.report.noise.noise == pytest.approx(size * usual.report.noise.noise)


def test_only_what_is_chosen_changes(cmu_walk):
    noisy = _shaken(cmu_walk, 0.5)
    arm = noisy.skeleton.index("LeftArm")
    done = interpose.denoise(noisy, joints="LeftArm", frames="50:100")
    changed = (done.clip.rotation != noisy.rotation).any(axis=-1)
    assert changed[50:100, arm].all()
    changed[50:100, arm] = False
    assert not changed.any()
    assert np.array_equal(done.clip.translation, noisy.translation)
    assert (done.report.noise.start, done.report.noise.stop) == (50, 100)


def test_a_range_leads_on_to_what_is_around_it(cmu_walk):
    noisy = tremble(cmu_walk, 1.0, np.random.default_rng(3))
    part = interpose.denoise(noisy, frames=(50, 150)).clip
    whole = _apart(part, noisy)
    assert whole[[50, 149]].mean() < 0.3 * whole[75:125].mean()


def test_the_noise_is_estimated_well():
    rng = np.random.default_rng(0)
    time = np.linspace(0, 4 * np.pi, 240)[:, None, None]
    signals = np.sin(time) + np.array([0.01, 0.1, 0.5])[:, None] * rng.standard_normal((240, 3, 3))
    assert np.allclose(deviation(signals), [0.01, 0.1, 0.5], rtol=0.2)


@pytest.mark.parametrize("frames", range(1, 12))
def test_short_clips_work_or_are_refused(cmu_walk, frames):
    clip = cmu_walk.slice(100, 100 + frames)
    if frames < 8:
        with pytest.raises(RequestError, match="cannot be denoised"):
            interpose.denoise(clip)
    else:
        assert _apart(interpose.denoise(clip).clip, clip).mean() < 0.2


def test_a_skeleton_that_is_no_humanoid(cmu_walk):
    rng = np.random.default_rng(0)
    skeleton = Skeleton(("base", "arm", "tip"), (-1, 0, 1), [[0, 0, 0], [0, 0.5, 0], [0, 0.5, 0]])
    time = np.linspace(0, 6, 120)
    swing = rotations.about("Z", 0.5 * np.sin(time))[:, None] * np.ones((1, 3, 1))
    clip = Clip(skeleton, swing, np.zeros((120, 1, 3)), 30.0)
    noisy = tremble(clip, 5.0, rng)
    assert _apart(interpose.denoise(noisy).clip, clip).mean() < 0.6 * _apart(noisy, clip).mean()


@pytest.mark.parametrize(
    ("arguments", "what"),
    [
        ({"strength": -1.0}, "strength -1"),
        ({"strength": float("nan")}, "strength nan"),
        ({"strength": float("inf")}, "strength inf"),
        ({"joints": ["Tail"]}, "unknown joint: Tail"),
        ({"frames": (10, 900)}, "outside the clip"),
        ({"frames": (10, 12)}, "2 frames cannot be denoised"),
    ],
)
def test_what_is_refused(cmu_walk, arguments, what):
    with pytest.raises(RequestError, match=what) as error:
        tasks.denoise(cmu_walk, **arguments)
    assert len(str(error.value).splitlines()) == 3


@pytest.mark.parametrize("start", [30, 45])
def test_a_foot_on_its_way_at_an_end_of_the_clip_stays_there(cmu_walk, start):
    """What is around an end lies on one side of it: that a foot is far from it says nothing. It is as far off
    as in its middle: 8.1 cm, with 2 degrees on every turn."""
    clip = cmu_walk.slice(start, start + 80)
    noisy = tremble(clip, 2.0, np.random.default_rng(0))
    ends = feet.ends(clip.skeleton)
    off = _apart(interpose.denoise(noisy).clip, clip)[:, ends]
    assert off[[0, -1]].max() < 1.5 * off.max(axis=1)[3:-3].max()
    assert off[[0, -1]].max() < 9


def test_frames_that_are_noisy_among_others_are_denoised_by_their_own_noise(cmu_walk):
    """The median of a clip of which a quarter is noisy tells of no noise."""
    clip = cmu_walk.slice(1, 209)
    rotation, part = clip.rotation.copy(), slice(80, 130)
    noise = np.radians(np.random.default_rng(1).normal(0, 1.5, (50, rotation.shape[1], 3)))
    rotation[part] = rotations.multiply(rotation[part], rotations.exp(noise))
    noisy = clip.with_motion(rotation, clip.translation)
    done = tasks.denoise(noisy)
    before, after = (
        np.linalg.norm(one.positions() - clip.positions(), axis=-1) for one in (noisy, done.clip)
    )
    assert after[part].mean() < 0.6 * before[part].mean()
    others = np.r_[0:70, 140:207]
    assert after[others].mean() < 0.002
    assert done.report.noise is not None
    (frames,) = done.report.noise.noisy
    assert all(abs(int(said) - true) < 10 for said, true in zip(frames.split(":"), (80, 130)))
    assert tasks.denoise(clip).report.noise.noisy == ()


@pytest.mark.parametrize("name", ["LeftForeArm", "RightLeg"])
def test_a_joint_that_trembles_for_a_while_is_smoothed_alone(cmu_walk, name):
    clip, rng = cmu_walk.slice(1, 209), np.random.default_rng(4)
    joint, part = clip.skeleton.index(name), slice(80, 130)
    rotation = clip.rotation.copy()
    noise = rotations.exp(np.radians(rng.normal(0, 5.0, (50, 3))))
    rotation[part, joint] = rotations.multiply(rotation[part, joint], noise)
    shaken = clip.with_motion(rotation, clip.translation)
    done = interpose.denoise(shaken)
    (told,) = done.report.noise.noisy
    assert told.endswith(f"({name})")
    below = clip.skeleton.below[:, joint].copy()
    below[joint] = False
    assert _apart(done.clip, clip)[part, below].mean() < 0.5 * _apart(shaken, clip)[part, below].mean()
    jumps = [measures.acceleration(one.positions())[part][:, below].mean() for one in (done.clip, shaken)]
    assert jumps[0] < 0.2 * jumps[1]
    # All else is as in the clean clip's own result.
    others = np.arange(len(clip.skeleton)) != joint
    apart = rotations.angle(done.clip.rotation, interpose.denoise(clip).clip.rotation)[:, others]
    assert np.degrees(apart.max()) < 1.0


def test_few_frames_a_second_are_refused(cmu_walk):
    """A clean jump at 15 frames a second would be moved by 20 cm."""
    with pytest.raises(RequestError, match="cannot be denoised"):
        interpose.denoise(resample(cmu_walk, 15.0))
    slow = resample(cmu_walk, 24.0)
    assert _apart(interpose.denoise(slow).clip, slow).max() < 0.5


def test_feet_that_leave_are_not_held_back(cmu_walk):
    """With one degree of noise on all rotations a foot was held until it was 10 cm away, and its knee with
    it: up to 4.5 cm further off than it came."""
    turns = np.random.default_rng(3).standard_normal((len(cmu_walk), len(cmu_walk.skeleton), 3))
    noisy = cmu_walk.with_motion(
        rotations.multiply(cmu_walk.rotation, rotations.exp(np.radians(1.0) * turns)), cmu_walk.translation
    )
    came, left = (_apart(clip, cmu_walk) for clip in (noisy, interpose.denoise(noisy).clip))
    assert left.mean() < 0.5 * came.mean()
    assert (left - came).max() < 3.5


@pytest.mark.parametrize("joints", [None, ("RightArm", "RightForeArm")])
def test_what_is_frozen_is_left_to_be_filled(cmu_walk, joints):
    """Smoothed, its ends would be rounded off, and a scan would no longer find it."""
    frames = slice(81, 120)
    rotation, translation = cmu_walk.rotation.copy(), cmu_walk.translation.copy()
    rows = slice(None) if joints is None else [cmu_walk.skeleton.index(name) for name in joints]
    rotation[frames, rows] = rotation[80, rows]
    if joints is None:
        translation[frames] = translation[80]
    held = _shaken_turns(cmu_walk.with_motion(rotation, translation), frames)
    done = tasks.denoise(held)
    assert (done.clip.rotation[frames, rows] == held.rotation[frames, rows]).all()
    assert not done.provenance[frames, rows].any()
    for clip in (held, done.clip):
        found = [one for one in scan(clip) if one.kind == "frozen" and (one.start, one.stop) == (81, 120)]
        assert {*(joints or (None,))} <= {name for one in found for name in one.joints or (None,)}
    assert done.report.noise.frozen[0].startswith("81:120 (")
    assert "left as it is: frozen 81:120" in str(done.report)
    # Around it noise goes, and nothing is drawn to the frozen pose.
    error = rotations.angle(done.clip.rotation, cmu_walk.rotation)
    before = rotations.angle(held.rotation, cmu_walk.rotation)
    around = np.r_[70:80, 122:132]
    assert error[around].mean() < 0.8 * before[around].mean()
    assert error[around].max() < 1.1 * before[around].max()


def test_a_clip_that_begins_frozen_stays_so(cmu_walk):
    rotation, translation = cmu_walk.rotation.copy(), cmu_walk.translation.copy()
    rotation[:41], translation[:41] = rotation[40], translation[40]
    held = _shaken_turns(cmu_walk.with_motion(rotation, translation), slice(1, 41))
    done = tasks.denoise(held)
    assert (done.clip.rotation[:41] == held.rotation[:41]).all()
    assert (done.clip.rotation[42:] != held.rotation[42:]).any()
    find = [(one.kind, one.start, one.stop) for one in scan(held) if one.kind == "frozen"]
    assert find == [(one.kind, one.start, one.stop) for one in scan(done.clip) if one.kind == "frozen"] != []


def test_only_what_did_not_change_counts_as_observed(cmu_walk):
    """Hips whose place stands still may turn, and be smoothed."""
    translation = cmu_walk.translation.copy()
    translation[81:140] = translation[80]
    held = _shaken_turns(cmu_walk.with_motion(cmu_walk.rotation, translation), slice(1, 1))
    done = tasks.denoise(held)
    assert any("recover" in told for told in done.report.noise.frozen)
    assert (done.clip.translation[81:140] == held.translation[81:140]).all()
    untouched = done.provenance == Provenance.OBSERVED
    assert (done.clip.rotation == held.rotation)[untouched].all()


def _shaken_turns(clip: Clip, but: slice) -> Clip:
    """A clip whose joints tremble by a degree, but for some frames and the one that these hold."""
    rng = np.random.default_rng(3)
    noise = rotations.exp(rng.normal(0, np.radians(1), (*clip.rotation.shape[:2], 3)))
    noise[but.start - 1 : but.stop] = [1.0, 0.0, 0.0, 0.0]
    return clip.with_motion(rotations.multiply(clip.rotation, noise), clip.translation)


def test_noise_of_the_place_alone_is_reported_as_it_is(cmu_walk):
    """Though it is taken out first, and what is left of it is little."""
    shift = np.random.default_rng(1).normal(0.0, 0.01, (len(cmu_walk), 1, 3))
    noisy = cmu_walk.with_motion(cmu_walk.rotation, cmu_walk.translation + shift)
    assert interpose.denoise(noisy).report.noise.noise == pytest.approx(1.0, rel=0.2)
