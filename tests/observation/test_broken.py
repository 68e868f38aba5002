"""Single values that were lost: what is found, and what is not taken for one."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
from tests.skeletons.rigs import under_root

from interpose import formats
from interpose.evaluation.denoising import drop
from interpose.geometry import rotations
from interpose.geometry.time import runs
from interpose.observation import Observation
from interpose.observation import broken as module
from interpose.observation.broken import BLOCK, _smoother, broken, medians
from interpose.observation.frozen import stuck
from interpose.skeletons.carrier import hips_of


def test_a_snap_to_the_rest_pose_is_found(cmu_walk):
    rotation = cmu_walk.rotation.copy()
    arm, knee = (cmu_walk.skeleton.index(name) for name in ("LeftArm", "RightLeg"))
    rotation[40:45, arm] = cmu_walk.skeleton.rest_rotation[arm]
    rotation[208, knee] = [1, 0, 0, 0]
    lost = ~broken(cmu_walk.with_motion(rotation, cmu_walk.translation)).rotation
    assert np.flatnonzero(lost[:, arm]).tolist() == [40, 41, 42, 43, 44]
    assert np.flatnonzero(lost[:, knee]).tolist() == [208]
    assert lost.sum() == 6


def test_a_spike_is_found(cmu_walk):
    rotation = cmu_walk.rotation.copy()
    arm = cmu_walk.skeleton.index("RightForeArm")
    rotation[100:102, arm] = rotations.multiply(
        rotation[100:102, arm], rotations.about("X", np.array([1.0, 1.2]))
    )
    lost = ~broken(cmu_walk.with_motion(rotation, cmu_walk.translation)).rotation
    assert np.argwhere(lost).tolist() == [[100, arm], [101, arm]]


@pytest.mark.parametrize("lost", [slice(0, 1), slice(0, 3), slice(-1, None), slice(-2, None)])
@pytest.mark.parametrize("name", ["LeftArm", "RightUpLeg"])
def test_a_spike_at_an_end_is_found(cmu_walk, lost, name):
    """Though it does not come back from it, or leave it; a pose in which all joints are elsewhere is none."""
    walk = cmu_walk.slice(1, 200)
    rotation, joint = walk.rotation.copy(), walk.skeleton.index(name)
    rotation[lost, joint] = rotations.multiply(rotation[lost, joint], rotations.about("X", np.array(1.0)))
    seen = broken(walk.with_motion(rotation, walk.translation))
    expected = np.ones_like(seen.rotation)
    expected[lost, joint] = False
    np.testing.assert_array_equal(seen.rotation, expected)
    rotation, translation = walk.rotation.copy(), walk.translation.copy()
    rotation[lost], translation[lost] = walk.rotation[100], walk.translation[100]
    assert broken(walk.with_motion(rotation, translation)).complete


def test_spikes_at_both_ends_leave_what_is_between(cmu_walk):
    """Of the two jumps the second one undoes the first."""
    walk = cmu_walk.slice(1, 61)
    translation = walk.translation.copy()
    translation[[0, 1, -2, -1]] += [0.8, 0.0, 0.5]
    lost = ~broken(walk.with_motion(walk.rotation, translation)).translation[:, 0]
    assert np.flatnonzero(lost).tolist() == [0, 1, 58, 59]


@pytest.mark.parametrize("frames", [1, 2, 3])
@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("name", ["Hips", "LeftArm"])
def test_half_a_turn_is_a_spike_though_quaternions_have_no_sign_behind_it(cmu_walk, name, axis, frames):
    joint, rotation = cmu_walk.skeleton.index(name), cmu_walk.rotation.copy()
    half = rotations.exp(np.pi * np.eye(3)[axis])
    rotation[80 : 80 + frames, joint] = rotations.multiply(rotation[80 : 80 + frames, joint], half)
    seen = broken(cmu_walk.with_motion(rotation, cmu_walk.translation))
    assert not seen.rotation[80 : 80 + frames, joint].any()
    seen.rotation[80 : 80 + frames, joint] = True
    assert seen.rotation.all()


@pytest.mark.parametrize("joint", ["RightForeArm", "LeftForeArm", "Head"])
def test_of_a_spike_that_rises_and_falls_the_first_and_last_frame_are_found(cmu_walk, joint):
    """Filters make such of one frame. Without their ends what is left leads from one to the other."""
    rotation, column = cmu_walk.rotation.copy(), cmu_walk.skeleton.index(joint)
    for start in (40, 100, 160):
        bell = 1.5 * np.sin(np.pi * np.arange(1, 5) / 5)
        part = slice(start, start + 4)
        rotation[part, column] = rotations.multiply(rotation[part, column], rotations.about("X", bell))
    lost = ~broken(cmu_walk.with_motion(rotation, cmu_walk.translation)).rotation
    assert np.flatnonzero(lost[:, column]).tolist() == [s + i for s in (40, 100, 160) for i in range(4)]


def test_what_rises_to_its_height_is_motion(cmu_walk):
    """Toes that push off, at 30 fps: there and back within five frames."""
    rotation, toes = cmu_walk.rotation.copy(), cmu_walk.skeleton.index("LeftToeBase")
    bend = np.zeros(len(rotation))
    for frame in range(20, 190, 25):
        bend[frame : frame + 5] = [0.15, 0.5, 0.9, 0.4, 0.1]
    rotation[:, toes] = rotations.about("X", bend)
    assert broken(cmu_walk.with_motion(rotation, cmu_walk.translation)).complete


def test_nothing_is_lost_beside_what_jumps(cmu_walk):
    """An arm that was frozen is found by `scan`; where it goes on it is not lost."""
    rotation, arm = cmu_walk.rotation.copy(), cmu_walk.skeleton.index("LeftForeArm")
    turned = rotations.multiply(rotation[120, arm], rotations.about("X", np.array(0.8)))
    rotation[80:120, arm] = turned
    assert broken(cmu_walk.with_motion(rotation, cmu_walk.translation)).rotation[:, arm].all()


def test_arms_that_are_taken_for_each_other_are_found(cmu_walk):
    """For half a second: too long for a spike. An arm that swings as fast for as long is none."""
    rotation, names = cmu_walk.rotation.copy(), cmu_walk.skeleton.names
    arms = [names.index(side + "Arm") for side in ("Left", "Right")]
    rotation[100:115, arms] = rotation[100:115, arms[::-1]]
    leg, swing = names.index("RightUpLeg"), 1.5 * np.sin(np.arange(209) / 3)[:, None]
    rotation[:, leg] = rotations.multiply(rotation[:, leg], rotations.about("X", swing[:, 0]))
    lost = ~broken(cmu_walk.with_motion(rotation, cmu_walk.translation)).rotation
    assert lost[100:115][:, arms].all()
    assert not lost[:, leg].any()
    assert not np.delete(lost, slice(100, 115), axis=0).any()


def test_of_limbs_that_are_taken_for_each_other_all_joints_are_lost(cmu_walk):
    """Also those that do not jump, as they are turned alike on either side; where one side alone is away the
    other stays."""
    rotation, names = cmu_walk.rotation.copy(), cmu_walk.skeleton.names
    arms = [
        names.index(side + part)
        for side in ("Left", "Right")
        for part in ("Shoulder", "Arm", "ForeArm", "Hand")
    ]
    rotation[100:115, arms] = rotation[100:115, arms[4:] + arms[:4]]
    lost = ~broken(cmu_walk.with_motion(rotation, cmu_walk.translation)).rotation
    assert np.argwhere(lost).tolist() == [[frame, arm] for frame in range(100, 115) for arm in sorted(arms)]
    rotation = cmu_walk.rotation.copy()
    rotation[100:115, arms[1]] = rotation[100:115, arms[5]]
    lost = ~broken(cmu_walk.with_motion(rotation, cmu_walk.translation)).rotation
    assert np.argwhere(lost).tolist() == [[frame, arms[1]] for frame in range(100, 115)]


def test_what_jumps_and_does_not_come_back_is_not_lost(cmu_walk):
    """Neither pose is the wrong one, as far as anybody can tell."""
    rotation, arm = cmu_walk.rotation.copy(), cmu_walk.skeleton.index("LeftArm")
    rotation[100:, arm] = rotations.multiply(rotation[100:, arm], rotations.about("X", np.array(1.2)))
    assert broken(cmu_walk.with_motion(rotation, cmu_walk.translation)).complete


def test_a_root_that_jumps_or_falls_to_the_origin_is_found(cmu_walk):
    translation = cmu_walk.translation.copy()
    translation[50] = 0
    translation[90] += 3
    lost = ~broken(cmu_walk.with_motion(cmu_walk.rotation, translation)).translation
    assert np.argwhere(lost).tolist() == [[50, 0], [90, 0]]


@pytest.mark.parametrize(
    ("rig", "size"),
    [
        (lambda clip: clip, 1.0),
        (lambda clip: under_root(clip, False), 1.0),
        (lambda clip: clip.scaled(0.1), 0.1),
        (lambda clip: clip.scaled(8), 8.0),
    ],
    ids=["root", "hips", "puppet", "giant"],
)
def test_hips_that_are_somewhere_else_for_frames_are_found(cmu_walk, rig, size):
    clip = rig(cmu_walk)
    translation, hips = clip.translation.copy(), hips_of(clip.skeleton)
    translation[50, hips, 0] += 0.15 * size
    translation[90:92, hips, 2] -= 0.2 * size
    translation[130:133, hips, 1] += 0.3 * size
    lost = ~broken(clip.with_motion(clip.rotation, translation)).translation
    assert np.argwhere(lost).tolist() == [[f, hips] for f in (50, 90, 91, 130, 131, 132)]


@pytest.mark.parametrize("frames", [40, 80])
def test_hips_that_face_backwards_for_a_while_are_found(cmu_walk, frames):
    """For as long as a body may be somewhere else; an arm that is away for as long may be meant."""
    rotation, hips, arm = cmu_walk.rotation.copy(), 0, cmu_walk.skeleton.index("LeftArm")
    part = slice(60, 60 + frames)
    for joint, angle in ((hips, np.pi), (arm, 1.5)):
        turned = rotations.multiply(rotations.about("Y", np.array(angle)), rotation[part, joint])
        rotation[part, joint] = turned
    lost = ~broken(cmu_walk.with_motion(rotation, cmu_walk.translation)).rotation
    assert np.flatnonzero(lost[:, hips]).tolist() == [*range(60, 60 + frames)]
    assert not lost[:, arm].any()


@pytest.mark.parametrize("frames", [12, 30, 80])
@pytest.mark.parametrize("start", [15, 60, 120])
def test_who_walks_on_while_he_is_somewhere_else_is_found(cmu_walk, start, frames):
    """He comes back to elsewhere, but by the jump that undoes the first one."""
    translation = cmu_walk.translation.copy()
    translation[start : start + frames, 0] += [0.2, 0.05, -0.2]
    lost = ~broken(cmu_walk.with_motion(cmu_walk.rotation, translation)).translation
    assert np.argwhere(lost).tolist() == [[frame, 0] for frame in range(start, start + frames)]


def test_who_runs_on_while_he_is_somewhere_else_is_found(data):
    """His steps are as long as what he is put aside."""
    clip = formats.load(data / "cmu_run.bvh")
    translation = clip.translation.copy()
    translation[14:18, 0] += [0.15, 0.0, 0.1]
    lost = ~broken(clip.with_motion(clip.rotation, translation)).translation
    assert np.argwhere(lost).tolist() == [[frame, 0] for frame in range(14, 18)]


@pytest.mark.parametrize("run", [1, 2, 3])
@pytest.mark.parametrize("way", [(0.3, 0.0, 0.0), (0.0, -0.3, 0.0), (0.2, 0.2, -0.1)])
def test_hips_that_hop_aside_in_a_run_are_found(data, run, way):
    """It rises and falls by as much as medians of a tenth of a second let pass."""
    clip = formats.load(data / "cmu_run.bvh")
    for start in (6, 14, 21, 30):
        translation = clip.translation.copy()
        translation[start : start + run, 0] += way
        lost = ~broken(clip.with_motion(clip.rotation, translation)).translation[:, 0]
        assert np.flatnonzero(lost).tolist() == [*range(start, start + run)]


@pytest.mark.parametrize("hops", [(1, 1, 1), (2, 1, 2), (3, 1, 3), (3, 2, 2)])
def test_two_hops_with_a_good_frame_or_two_between_are_found(cmu_walk, hops):
    first, between, second = hops
    gone = np.repeat([True, False, True], [first, between, second])
    frames = 80 + np.flatnonzero(gone)
    ways = np.repeat([[0.3, 0.0, 0.0], [0.0, 0.2, -0.2]], [first, second], axis=0)
    translation = cmu_walk.translation.copy()
    translation[frames, 0] += ways
    seen = broken(cmu_walk.with_motion(cmu_walk.rotation, translation))
    lost = np.flatnonzero(~seen.translation[:, 0])
    # All in all the body is away, the good frame between included.
    assert {*frames} <= {*lost} <= {*range(80, frames[-1] + 1)}
    assert seen.rotation.all()
    knee, rotation = cmu_walk.skeleton.index("LeftLeg"), cmu_walk.rotation.copy()
    rotation[frames, knee] = rotations.multiply(rotation[frames, knee], rotations.exp(4.0 * ways))
    seen = broken(cmu_walk.with_motion(rotation, cmu_walk.translation))
    assert {*frames} <= {*np.flatnonzero(~seen.rotation[:, knee])} <= {*range(79, frames[-1] + 2)}
    assert seen.rotation.sum(axis=0).tolist().count(len(cmu_walk)) == len(cmu_walk.skeleton) - 1


def test_the_place_that_is_held_while_a_body_is_lost_is_lost(cmu_walk):
    """In the rest pose where he was, by a tracker that saw nobody; not of who is animated on the spot, nor
    while the hips are known."""
    rotation, translation = cmu_walk.rotation.copy(), cmu_walk.translation.copy()
    rotation[60:80], translation[60:80] = cmu_walk.skeleton.rest_rotation, translation[59]
    seen = broken(cmu_walk.with_motion(rotation, translation))
    assert np.flatnonzero(~seen.translation[:, 0]).tolist() == [*range(60, 80)]
    on_the_spot = np.repeat(translation[:1], len(translation), axis=0)
    assert broken(cmu_walk.with_motion(rotation, on_the_spot)).translation.all()
    rotation[60:80, 0] = cmu_walk.rotation[60:80, 0]
    assert broken(cmu_walk.with_motion(rotation, translation)).translation.all()


def test_a_long_rest_pose_is_no_snap(cmu_walk):
    rotation = cmu_walk.rotation.copy()
    arm = cmu_walk.skeleton.index("LeftArm")
    rotation[40:100, arm] = cmu_walk.skeleton.rest_rotation[arm]
    assert broken(cmu_walk.with_motion(rotation, cmu_walk.translation)).rotation[:, arm].all()


def test_a_hinge_that_reaches_its_limit_is_no_snap(cmu_walk):
    rotation = cmu_walk.rotation.copy()
    knee = cmu_walk.skeleton.index("LeftLeg")
    bend = np.maximum(np.sin(np.arange(len(cmu_walk)) / 5), 0)
    rotation[:, knee] = rotations.about("X", bend)
    assert (bend == 0).any()
    assert broken(cmu_walk.with_motion(rotation, cmu_walk.translation)).rotation[:, knee].all()


@pytest.mark.parametrize("name", ["cmu_walk", "cmu_jump", "cmu_02_03"])
def test_nothing_is_broken_in_real_clips(data, name):
    assert broken(formats.load(data / f"{name}.bvh")).complete


@pytest.mark.parametrize("frames", range(6))
def test_short_clips(cmu_walk, frames):
    assert broken(cmu_walk.slice(50, 50 + frames)).complete


def test_what_would_throw_a_foot_about_is_not_lost(cmu_walk):
    """A knee that spins while the ankle spins back, as some solvers write them: the foot goes on smoothly."""
    skeleton = cmu_walk.skeleton
    knee, ankle = (skeleton.index(name) for name in ("LeftLeg", "LeftFoot"))
    shin = skeleton.rest_translation[ankle] / np.linalg.norm(skeleton.rest_translation[ankle])
    rotation = cmu_walk.rotation.copy()
    turn = rotations.exp(np.where(np.arange(len(rotation)) % 2, 2.0, -1.0)[:, None] * shin)
    rotation[:, knee] = rotations.multiply(rotation[:, knee], turn)
    rotation[:, ankle] = rotations.multiply(rotations.conjugate(turn), rotation[:, ankle])
    spun = cmu_walk.with_motion(rotation, cmu_walk.translation)
    np.testing.assert_allclose(spun.positions(), cmu_walk.positions(), atol=1e-9)
    spiked = cmu_walk.rotation.copy()
    spiked[60, ankle] = rotations.multiply(spiked[60, ankle], rotations.about("X", np.array(2.0)))
    for clip, real in ((spun, False), (cmu_walk.with_motion(spiked, cmu_walk.translation), True)):
        alone = Observation.full(clip)
        alone.rotation[60, ankle] = False
        nothing_sure = np.zeros(clip.rotation.shape[:2], bool)
        assert _smoother(clip, alone, nothing_sure).rotation[60, ankle] != real


def test_a_foot_that_flicks_is_lost_in_a_walk_and_not_in_a_kick(cmu_walk):
    skeleton, frame = cmu_walk.skeleton, 60
    thigh, ankle = (skeleton.index(name) for name in ("LeftUpLeg", "LeftFoot"))
    around = np.arange(len(cmu_walk)) - frame
    swing = rotations.about("X", -1.2 * np.exp(-0.5 * (around / 2) ** 2))
    for kicks in (False, True):
        rotation = cmu_walk.rotation.copy()
        if kicks:
            rotation[:, thigh] = rotations.multiply(rotation[:, thigh], swing)
        rotation[frame, ankle] = rotations.multiply(
            rotation[frame, ankle], rotations.about("X", np.array(0.6))
        )
        clip = cmu_walk.with_motion(rotation, cmu_walk.translation)
        suspected = Observation.full(clip)
        suspected.rotation[frame, ankle] = False
        seen = _smoother(clip, suspected, np.zeros(rotation.shape[:2], bool))
        assert seen.rotation[frame, ankle] == kicks


def test_what_snaps_again_and_again_is_lost_whatever_would_be_rougher(cmu_walk, monkeypatch):
    """With half of all joints at rest in every frame there is always one that goes more smoothly as it is."""
    walk = cmu_walk.slice(1, len(cmu_walk))
    dropped = drop(walk, 0.5, np.random.default_rng(0))
    found = broken(dropped)
    monkeypatch.setattr(module, "ROUGHER", 0.0)
    monkeypatch.setattr(module, "ROUGH", 0.0)
    alone = broken(dropped)
    assert not found.rotation[:, walk.skeleton.index("LeftForeArm")].all()
    lost = ~found.rotation & (np.abs((dropped.rotation * walk.skeleton.rest_rotation).sum(-1)) > 1 - 1e-12)
    assert (~alone.rotation & lost).sum() > 0.99 * lost.sum() > 1000


def test_medians_of_long_takes_need_little_room():
    """And are the same where blocks meet."""
    values = np.random.default_rng(0).normal(size=(5 * BLOCK, 2, 3))
    tracemalloc.start()
    whole = medians(values, 3, "edge")
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most < 10 * values.nbytes
    meet = slice(BLOCK - 20, BLOCK + 20)
    assert np.array_equal(whole[meet][3:-3], medians(values[meet], 3, "edge")[3:-3])


def test_a_root_that_stands_still_is_right_but_for_its_spikes(cmu_walk):
    clip = under_root(cmu_walk, goes=False)
    root = clip.translated.index(clip.skeleton.roots[0])
    places = clip.translation.copy()
    spikes = [(28, 30), (84, 87), (145, 147)]
    for start, stop in spikes:
        places[start:stop, root] += [0.2, -0.1, 0.3]
    spiked = clip.with_motion(clip.rotation, places)
    lost = ~broken(spiked).translation[:, clip.skeleton.roots[0]]
    assert [(start, stop) for start, stop in runs(lost)] == spikes
    assert not stuck(spiked)
