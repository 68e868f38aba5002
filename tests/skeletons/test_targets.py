"""Targets of feet and hands, as rigs of game engines have them beside the hips."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.skeletons.rigs import TARGET, under_root

import interpose
from interpose.finish import Provenance
from interpose.geometry import rotations
from interpose.observation import Gap
from interpose.skeletons.carrier import moved
from interpose.skeletons.targets import seated


@pytest.fixture(scope="module", params=[False, True], ids=["stays", "goes"])
def rigged(request, cmu_walk):  # type: ignore[no-untyped-def]
    return under_root(cmu_walk, request.param)


def off(clip):  # type: ignore[no-untyped-def]
    """(F,) metres, and radians, by which the target is off the left foot."""
    turned, placed = clip.kinematics()
    foot = clip.skeleton.index("LeftFoot")
    away = np.linalg.norm(placed[:, TARGET] - placed[:, foot], axis=-1)
    return np.maximum(away, rotations.angle(turned[:, TARGET], turned[:, foot]))


@pytest.mark.parametrize("gap", [(60, 110), (150, 209)])
def test_a_target_stays_on_its_foot_in_a_gap(rigged, cmu_walk, gap):
    """It was interpolated, up to a radian and a half from it."""
    done, same = (interpose.fill(clip, gap, method="small").clip for clip in (rigged, cmu_walk))
    assert off(done).max() < 1e-6
    seen = np.setdiff1d(np.arange(len(rigged)), np.arange(*gap))
    assert done.rotation[seen].tobytes() == rigged.rotation[seen].tobytes()
    assert done.translation[seen].tobytes() == rigged.translation[seen].tobytes()
    foot = rigged.skeleton.index("LeftFoot")
    assert np.linalg.norm(done.positions()[:, foot] - same.positions()[:, foot - 2], axis=-1).max() < 0.05


def test_a_target_goes_along_with_a_leg_that_is_lost(rigged):
    """It is known itself, and was left where the foot had been. In a gap that stays open nothing moves."""
    leg = Gap(60, 110, ("LeftUpLeg", "LeftLeg", "LeftFoot"))
    done = interpose.recover(rigged, leg.joints, frames=(60, 110), method="small")
    assert off(done.clip).max() < 1e-6
    assert np.abs(done.clip.positions()[60:110, TARGET] - rigged.positions()[60:110, TARGET]).max() > 0.02
    assert "ik_foot_l goes along with what it sits on" in done.report.gaps[0].notes
    assert (done.provenance[60:110, TARGET] == Provenance.CORRECTED).all()
    seen = np.setdiff1d(np.arange(len(rigged)), np.arange(60, 110))
    assert done.clip.translation[seen].tobytes() == rigged.translation[seen].tobytes()
    (left,) = interpose.fill(rigged, [leg], max_gap=20).report.open
    assert len(left) == 50
    kept = interpose.fill(rigged, [leg], max_gap=20).clip
    assert kept.translation.tobytes() == rigged.translation.tobytes()
    arm = interpose.recover(rigged, ["RightArm", "RightForeArm"], frames=(60, 110), method="small").clip
    assert arm.translation.tobytes() == rigged.translation.tobytes()


def test_a_target_stays_on_its_foot_on_the_way_to_another_clip(rigged):
    done = interpose.stitch([rigged.slice(0, 80), rigged.slice(120, 200)], method="small")
    assert off(done.clip).max() < 1e-6


def test_who_is_brought_onto_a_rig_has_its_targets_on_the_feet(rigged, cmu_walk):
    """They stayed where they were in the mean."""
    assert off(interpose.retarget(cmu_walk, rigged.slice(0, 90))).max() < 1e-6


def test_a_target_stays_on_its_foot_where_noise_is_smoothed(rigged):
    """It was smoothed by itself, centimetres away from it."""
    done = interpose.denoise(rigged, strength=2.0)
    assert (done.clip.rotation != rigged.rotation).any()
    assert off(done.clip).max() < 1e-6
    few = interpose.denoise(rigged, frames=(60, 120), strength=2.0).clip
    assert off(few).max() < 1e-6
    assert few.translation[:50].tobytes() == rigged.translation[:50].tobytes()


def test_a_target_that_is_turned_and_aside_stays_so(rigged):
    foot = rigged.skeleton.index("LeftFoot")
    tilt, way = rotations.about("X", np.array(0.7)), np.array([0.02, 0.1, -0.05])

    def there(clip):  # type: ignore[no-untyped-def]
        turned, placed = clip.kinematics()
        place = placed[:, foot] + rotations.rotate(turned[:, foot], way)
        return rotations.multiply(turned[:, foot], tilt), place

    aside = moved(rigged, {TARGET: there(rigged)})
    done = interpose.fill(aside, (60, 110), method="small").clip
    turn, place = there(done)
    assert np.abs(done.positions()[:, TARGET] - place).max() < 1e-6
    assert rotations.angle(done.kinematics()[0][:, TARGET], turn).max() < 1e-6


def test_a_target_stays_on_its_foot_at_another_frame_rate(cmu_walk):
    """Below a root that turns it is some millimetres off between the frames that were."""
    rigged = under_root(cmu_walk, True)
    turned, placed = rigged.kinematics()
    yaw = rotations.about("Y", 1.5 * np.sin(np.arange(len(rigged)) / 5))
    led = moved(rigged, {0: (rotations.multiply(yaw, turned[:, 0]), placed[:, 0])})
    led = moved(led, {joint: (turned[:, joint], placed[:, joint]) for joint in (1, TARGET)})
    faster = interpose.resample(led, 120, smooth=True)
    assert 0.002 < off(faster).max() < 0.02
    assert off(interpose.fill(faster, (240, 440), method="small").clip).max() < off(faster).max() + 1e-6


def test_a_target_below_another_one_stays_on_its_own_joint(rigged):
    """As the left hand's hangs from the right hand's in Unreal's rigs."""
    old, hand = rigged.skeleton, rigged.skeleton.index("LeftHand")
    skeleton = replace(
        old,
        names=(*old.names, "ik_hand_l"),
        parents=(*old.parents, TARGET),
        rest_translation=np.insert(old.rest_translation, len(old), 0.0, axis=0),
        rest_rotation=None,
        rest_scale=None,
    )
    both = replace(
        rigged,
        skeleton=skeleton,
        rotation=np.insert(rigged.rotation, len(old), rotations.identity(), axis=1),
        translation=np.insert(rigged.translation, 3, 0.0, axis=1),
        translated=(*rigged.translated, len(old)),
    )
    turned, placed = both.kinematics()
    both = moved(both, {len(old): (turned[:, hand], placed[:, hand])})
    done = interpose.fill(both, (60, 110), method="small").clip
    assert off(done).max() < 1e-6
    assert np.abs(done.positions()[:, -1] - done.positions()[:, hand]).max() < 1e-6
    # Where the foot's goes along with a leg that is lost, what hangs from it stays on its hand.
    leg = ("LeftUpLeg", "LeftLeg", "LeftFoot")
    done = interpose.recover(both, leg, frames=(60, 110), method="small").clip
    assert np.abs(done.positions()[60:110, TARGET] - both.positions()[60:110, TARGET]).max() > 0.02
    assert np.abs(done.positions()[:, -1] - both.positions()[:, hand]).max() < 1e-6


def test_targets_come_onto_a_body_of_another_size(rigged):
    old = rigged.skeleton
    skeleton = replace(old, rest_translation=0.6 * old.rest_translation)
    child = replace(rigged, skeleton=skeleton, translation=0.6 * rigged.translation)
    made = interpose.retarget(rigged, child)
    assert off(made).max() < 1e-6
    assert np.abs(made.positions()[0] - child.positions()[0])[:, 1].max() < 1e-6


def test_what_does_not_sit_on_a_joint_stays_as_it_is(rigged, cmu_walk):
    known = np.ones(rigged.rotation.shape[:2], bool)
    assert seated(rigged, known, known) is rigged, "nothing is unknown"
    known[60:110] = False
    assert seated(cmu_walk, known[:, 2:], known[:, 2:]) is cmu_walk, "nothing is beside the hips"
    loose = rigged.translation.copy()
    loose[:, TARGET] += 0.02 * np.sin(np.arange(len(rigged)))[:, None]
    loose = rigged.with_motion(rigged.rotation, loose)
    assert seated(loose, known, known) is loose, "it moves against the foot"
    rest = rigged.skeleton.rest_translation.copy()
    rest[TARGET] = rigged.translation[0, TARGET]
    fixed = replace(
        rigged,
        skeleton=replace(rigged.skeleton, rest_translation=rest),
        translation=rigged.translation[:, :TARGET],
        translated=(0, 1),
    )
    assert seated(fixed, known, known) is fixed, "it only turns"
    known[:, TARGET] = True
    assert seated(rigged, known, known) is rigged, "it is known"


def test_a_target_that_is_pinned_goes_where_it_is_pinned(rigged):
    place = rigged.positions()[85, TARGET] + [0.0, 0.3, 0.0]
    pin = interpose.Pin("ik_foot_l", np.array([85]), place[None])
    done = interpose.fill(rigged, (60, 110), method="small", pins=[pin]).clip
    assert np.linalg.norm(done.positions()[85, TARGET] - place) < 0.002
