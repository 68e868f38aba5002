"""Clips of one rig on each other's skeletons: other sizes, joints in another order or with places."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.skeletons.rigs import six_channels, under_root

from interpose.clip import Clip, Skeleton
from interpose.formats import load
from interpose.geometry import rotations
from interpose.observation.timeline import Placement, lay
from interpose.skeletons.carrier import carriers, hips_of
from interpose.skeletons.fitting import fit, other_rig


@pytest.fixture(scope="module")
def run(data):
    return load(data / "cmu_run.bvh")


def test_bodies_of_other_size_stand_on_the_floor(cmu_walk, run):
    fitted, scale = fit(run, cmu_walk)
    assert 0.9 < scale < 1.1
    toes = [cmu_walk.skeleton.index(name) for name in ("LeftToeBase", "RightToeBase")]
    before, after = (clip.positions()[:, toes, 1].min() for clip in (run, fitted))
    assert abs(before - after) < 0.02


@pytest.mark.parametrize("goes", [False, True])
@pytest.mark.parametrize("frames", [1, 60])
def test_bodies_of_other_size_begin_over_the_same_floor_point(run, goes, frames):
    """Also where hips hang from a root that stays at the origin; one that goes along begins there, too."""
    run = under_root(run, goes)
    far = Placement(0.0, (30.0, 0.0, 40.0)).of(run, carriers(run)).slice(0, frames)
    skeleton = replace(run.skeleton, rest_translation=0.6 * run.skeleton.rest_translation)
    fitted, scale = fit(far, replace(run, skeleton=skeleton))
    before, after = (clip.positions() for clip in (far, fitted))
    hips = hips_of(skeleton)
    assert scale == pytest.approx(0.6)
    assert np.allclose(after[0, hips, [0, 2]], before[0, hips, [0, 2]], atol=1e-9)
    assert np.allclose(after[:, hips, 1], 0.6 * before[:, hips, 1], atol=1e-9)
    assert np.allclose(after[: 1 if goes else None, 0], before[: 1 if goes else None, 0], atol=1e-9)
    ways = [p[-1, hips, [0, 2]] - p[0, hips, [0, 2]] for p in (before, after)]
    assert np.allclose(ways[1], 0.6 * ways[0], atol=1e-9)


@pytest.mark.parametrize("frames", [1, 60])
def test_joints_with_positions_of_their_own_have_bones_too(cmu_walk, run, frames):
    """Written with six channels on every joint, a smaller body stays one, and moves as with three."""
    child = cmu_walk.scaled(0.6).slice(0, frames)
    (plain, wanted), (made, scale) = fit(run, child), fit(six_channels(run), six_channels(child))
    assert scale == wanted < 0.7
    assert np.array_equal(made.rotation, run.rotation)
    assert np.allclose(made.positions(), plain.positions(), atol=1e-9)
    line = lay([six_channels(run), six_channels(child)])
    bones = np.linalg.norm(line.clip.translation[:, 1:], axis=-1)
    assert np.ptp(bones, axis=0).max() < 1e-9


def test_joints_that_give_way_do_so_on_bones_of_another_length(cmu_walk):
    joint = cmu_walk.skeleton.index("LeftLeg")
    walk, child = six_channels(cmu_walk), six_channels(cmu_walk.scaled(0.5))
    shaken = walk.translation.copy()
    shaken[::2, joint] *= 1.04
    made = fit(walk.with_motion(walk.rotation, shaken), child)[0]
    assert np.allclose(made.translation[:, joint], 0.5 * shaken[:, joint], atol=1e-9)


def test_joints_that_are_animated_keep_their_own_places(cmu_walk):
    """What stretches far, or is nowhere at rest, and all that is of one body."""
    joint = cmu_walk.skeleton.index("LeftHand")
    walk, child = six_channels(cmu_walk), six_channels(cmu_walk.scaled(0.5))
    moved = walk.translation.copy()
    moved[:, joint] += np.linspace(0.0, 0.3, len(walk))[:, None]
    stretched = walk.with_motion(walk.rotation, moved)
    assert np.array_equal(fit(stretched, child)[0].translation[:, joint], moved[:, joint])
    assert np.array_equal(fit(stretched, walk)[0].translation, moved)
    # Nor do they say how the rig rests.
    bones = walk.skeleton.rest_translation.copy()
    bones[joint] = [0.0, -0.3, 0.1]
    other = replace(stretched, skeleton=replace(walk.skeleton, rest_translation=bones))
    assert np.array_equal(fit(other, stretched)[0].translation, moved)


def test_short_bones_with_positions_of_their_own_point_nowhere(cmu_walk):
    """Where one is a hair long, its direction is chance."""
    walk = six_channels(cmu_walk)
    rigs = []
    for way in (1e-4, -1e-4):
        bones, places = walk.skeleton.rest_translation.copy(), walk.translation.copy()
        bones[7], places[:, 7] = [way, 0.0, 0.0], [way, 0.0, 0.0]
        rigs.append(
            replace(walk, skeleton=replace(walk.skeleton, rest_translation=bones), translation=places)
        )
    assert np.array_equal(fit(*rigs)[0].translation, rigs[0].translation)


@pytest.mark.parametrize(("angle", "same"), [(8.0, True), (12.0, False)])
def test_feet_that_rest_otherwise_are_those_of_another_rig(cmu_walk, angle, same):
    """Their toes would sink; arms may differ by more, as people's do."""
    for names, alike in ((("LeftToeBase", "RightToeBase"), same), (("LeftForeArm",), True)):
        bones = cmu_walk.skeleton.rest_translation.copy()
        joints = [cmu_walk.skeleton.index(name) for name in names]
        across = rotations.normalize(np.cross(bones[joints], [0.0, 0.3, 1.0]))
        bones[joints] = rotations.rotate(rotations.exp(np.radians(angle) * across), bones[joints])
        other = replace(cmu_walk, skeleton=replace(cmu_walk.skeleton, rest_translation=bones))
        assert (other_rig(cmu_walk, other) is None) == alike


def test_rigs_without_arms_stay_of_one_rig(cmu_walk):
    """There is no other way to bring the motion of one over: feet may rest as far apart as all else."""
    skeleton = cmu_walk.skeleton
    arms = [skeleton.index(name) for name in ("LeftShoulder", "RightShoulder")]
    kept = [joint for joint in range(len(skeleton)) if not skeleton.below[joint, arms].any()]
    parents = tuple(kept.index(p) if (p := skeleton.parents[joint]) >= 0 else -1 for joint in kept)
    bones = skeleton.rest_translation[kept]
    legs = Skeleton(tuple(skeleton.names[joint] for joint in kept), parents, bones)
    walk = Clip(legs, cmu_walk.rotation[:, kept], cmu_walk.translation, cmu_walk.fps, cmu_walk.translated)
    tilted = bones.copy()
    toe = legs.index("LeftToeBase")
    across = rotations.normalize(np.cross(bones[toe], [0.0, 0.3, 1.0]))
    tilted[toe] = rotations.rotate(rotations.exp(np.radians(12.0) * across), bones[toe])
    assert other_rig(walk, replace(walk, skeleton=replace(legs, rest_translation=tilted))) is None


def test_joints_in_another_order_are_found(cmu_walk):
    skeleton = cmu_walk.skeleton
    # Legs after arms: parents still come before their children.
    order = sorted(range(len(skeleton)), key=lambda j: ("Leg" in skeleton.names[j], j))
    order = sorted(order, key=lambda j: len(skeleton.ancestors(j)))
    other = Clip(
        Skeleton(
            tuple(skeleton.names[j] for j in order),
            tuple(order.index(skeleton.parents[j]) if skeleton.parents[j] >= 0 else -1 for j in order),
            skeleton.rest_translation[order],
        ),
        cmu_walk.rotation[:, order],
        cmu_walk.translation,
        cmu_walk.fps,
    )
    fitted, scale = fit(other, cmu_walk)
    assert scale == 1
    assert np.array_equal(fitted.rotation, cmu_walk.rotation)
