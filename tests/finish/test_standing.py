"""Where a body is, told by what it stands on."""

from __future__ import annotations

import numpy as np
import pytest
from tests.skeletons.rigs import TARGET, under_root

import interpose
from interpose.clip import Clip, Skeleton
from interpose.finish import standing
from interpose.formats import load
from interpose.geometry import rotations
from interpose.observation import Observation
from interpose.observation.timeline import Placement
from interpose.skeletons.carrier import hips_of, moved


def _off(one: Clip, other: Clip) -> np.ndarray:
    """(F,) metres between the hips."""
    hips = hips_of(one.skeleton)
    return np.linalg.norm(one.positions()[:, hips] - other.positions()[:, hips], axis=-1)


def _stuck(clip: Clip, start: int, stop: int) -> Clip:
    """The hips stay where they are from frame start on, until they are found again at frame stop."""
    hips = clip.translated.index(hips_of(clip.skeleton))
    translation = clip.translation.copy()
    translation[start:stop, hips] = translation[start - 1 if start else 0, hips]
    return clip.with_motion(clip.rotation, translation)


@pytest.mark.parametrize(("start", "stop"), [(40, 80), (60, 150), (100, 190)])
def test_the_place_of_the_body_is_recovered_from_its_feet(cmu_walk, start, stop):
    clip = cmu_walk
    done = interpose.recover(_stuck(clip, start, stop), frames=(start, stop), place=True)
    error, line = _off(done.clip, clip), _off(interpose.fill(clip, (start, stop), method="linear").clip, clip)
    assert error[start:stop].mean() < max(0.005, 0.2 * line[start:stop].mean())
    assert done.clip.rotation.tobytes() == clip.rotation.tobytes()
    assert error[:start].max() == error[stop:].max() == 0
    (gap,) = done.report.gaps
    assert "what the body stands on tells where it is" in gap.notes
    assert gap.seam_after <= gap.seam_limit


@pytest.mark.parametrize(
    "rig", [lambda clip: clip, lambda clip: under_root(clip, False)], ids=["root", "hips"]
)
def test_a_suit_that_knows_no_places(cmu_walk, rig):
    """Four metres of way, from the first frame on."""
    clip = rig(cmu_walk)
    done = interpose.recover(_stuck(clip, 0, len(clip)), place=True)
    assert _off(done.clip, clip).max() < 0.2
    assert np.abs((done.clip.positions() - clip.positions())[..., 1]).max() < 0.03


@pytest.mark.parametrize("told", [{}, {"place": True, "frames": (80, 120)}], ids=["found", "told"])
@pytest.mark.parametrize("turns", [False, True])
def test_a_root_that_is_held_goes_with_the_body_again(cmu_walk, told, turns):
    """As in game engines; all else hangs from it."""
    clip = under_root(cmu_walk, goes=True)
    rotation, translation = clip.rotation.copy(), clip.translation.copy()
    if turns:
        # The root faces as the body goes, and all else is turned back against it.
        yaw = rotations.about("Y", np.linspace(0.0, 1.0, len(clip)))
        turned, placed = clip.kinematics()
        clip = moved(clip, {0: (rotations.multiply(yaw, turned[:, 0]), placed[:, 0])})
        clip = moved(clip, {joint: (turned[:, joint], placed[:, joint]) for joint in (1, TARGET)})
        rotation, translation = clip.rotation.copy(), clip.translation.copy()
    translation[80:120, 0] = translation[79, 0]
    done = interpose.recover(clip.with_motion(rotation, translation), **told).clip
    assert _off(done, clip)[80:120].mean() < 0.03
    aside = (done.positions()[:, 0] - done.positions()[:, 1])[:, [0, 2]]
    assert np.linalg.norm(aside, axis=-1).max() < 0.01


def test_hips_that_stand_still_are_found(cmu_walk):
    done = interpose.recover(_stuck(cmu_walk, 80, 120))
    assert _off(done.clip, cmu_walk)[80:120].mean() < 0.03


@pytest.mark.parametrize("others", [False, True])
def test_hips_that_are_held_in_turn_and_place_are_recovered_in_both(cmu_walk, others):
    """Their turn is no more to be trusted than their place; nor are those of what is held with them."""
    stuck, names = _stuck(cmu_walk, 80, 120), cmu_walk.skeleton.names
    held = [j for j, name in enumerate(names) if name == "Hips" or (others and "Arm" not in name)]
    rotation = stuck.rotation.copy()
    rotation[80:120, held] = rotation[79, held]
    lost = stuck.with_motion(rotation, stuck.translation)
    done = interpose.recover(lost)
    off = np.linalg.norm(done.clip.positions() - cmu_walk.positions(), axis=-1)[80:120].mean()
    assert off < 0.06
    assert off < 0.25 * np.linalg.norm(lost.positions() - cmu_walk.positions(), axis=-1)[80:120].mean()
    free = [j for j in range(len(names)) if j not in held]
    assert np.array_equal(done.clip.rotation[:, free], cmu_walk.rotation[:, free])


def test_a_rest_pose_beside_it_does_not_tell_where_the_body_is(cmu_walk):
    """CMU's files begin with one, at the origin."""
    rotation, translation = cmu_walk.rotation.copy(), cmu_walk.translation.copy()
    rotation[0], translation[0] = cmu_walk.skeleton.rest_rotation, [[0.0, 1.0, 0.0]]
    led = _stuck(cmu_walk.with_motion(rotation, translation), 1, 60)
    led.translation[1:60] = cmu_walk.translation[60]
    done = interpose.recover(led).clip
    assert _off(done, cmu_walk)[1:60].max() < 0.1
    whole = interpose.recover(cmu_walk.with_motion(rotation, translation), place=True).clip
    assert _off(whole, cmu_walk)[1:].max() < 0.2


def test_a_pose_that_has_nothing_to_do_with_the_others_does_not_throw_the_body(data):
    """A rest pose between two parts of a run: how feet get there, at 9 m/s, tells nothing of the way. Taken
    for a step it would throw the body up by 90 cm."""
    run = load(data / "cmu_run.bvh").slice(1, 42)
    frames, hips = np.r_[14:27, 7:20], hips_of(run.skeleton)
    rotation = run.rotation[frames]
    rotation[13] = run.skeleton.rest_rotation
    done = interpose.recover(run.with_motion(rotation, run.translation[frames]), place=True).clip
    off = done.positions()[15:, hips] - run.positions()[9:20, hips]
    assert np.linalg.norm(off - off[0], axis=-1).max() < 0.3
    assert np.abs(off[:, 1]).max() < 0.15


@pytest.mark.parametrize(("slower", "flies"), [(1.5, False), (3.0, True)])
def test_what_would_hold_a_body_back_on_its_way_up_has_left_it(slower, flies):
    """In gravities: nobody comes to rest on a leg much faster than by falling, as the floor does not pull."""
    falls, frames = standing.GRAVITY / 30**2, np.arange(12)
    pace = np.where(frames < 6, 2.0 / 30, 2.0 / 30 - slower * falls)
    against = np.zeros((12, 1, 3))
    against[:, 0, 1] = -0.9 - np.cumsum(pace)
    known = frames == 0
    stands = standing._begun(np.zeros((12, 3)), against, known, falls, torn=1.0)[:, 0]
    assert stands[:5].all()
    assert stands[5] != flies


def test_it_turns_and_moves_with_the_clip(cmu_walk):
    placement = Placement(1.1, (3.0, 0.5, -2.0))
    one = interpose.recover(cmu_walk, frames=(60, 150), place=True).clip
    other = interpose.recover(placement.of(cmu_walk), frames=(60, 150), place=True).clip
    assert np.abs(placement.of(one).positions() - other.positions()).max() < 1e-6


def test_nothing_of_what_is_lost_is_looked_at(cmu_walk):
    translation = cmu_walk.translation.copy()
    translation[60:150] = 1e3
    seen = Observation.full(cmu_walk)
    seen.translation[60:150, 0] = False
    done = [
        interpose.fill(cmu_walk.with_motion(cmu_walk.rotation, t), seen).clip
        for t in (translation, cmu_walk.translation)
    ]
    assert done[0].translation.tobytes() == done[1].translation.tobytes()


def test_joints_and_place_at_once_are_refused(cmu_walk):
    with pytest.raises(interpose.RequestError, match="at once"):
        interpose.recover(cmu_walk, "LeftArm", place=True)


def test_what_never_stands_goes_on(cmu_walk):
    """Turns at random, in which nothing tells where the body goes: an answer all the same."""
    rng = np.random.default_rng(0)
    turned = rotations.normalize(rng.standard_normal(cmu_walk.rotation.shape))
    done = interpose.recover(cmu_walk.with_motion(turned, cmu_walk.translation), place=True)
    assert np.isfinite(done.clip.translation).all()


def test_what_has_no_legs_is_refused():
    chain = Skeleton(("a", "b", "c"), (-1, 0, 1), np.tile([0.0, 0.3, 0.0], (3, 1)))
    clip = Clip(chain, np.tile([1.0, 0, 0, 0], (20, 3, 1)), np.zeros((20, 1, 3)), 30.0)
    with pytest.raises(interpose.RequestError, match="cannot be recovered"):
        interpose.recover(clip, place=True)


@pytest.mark.parametrize(
    "rig", [lambda clip: clip, lambda clip: under_root(clip, False)], ids=["root", "hips"]
)
def test_noise_on_the_place_alone_bends_no_limb(cmu_walk, rig):
    cmu_walk = rig(cmu_walk)
    hips, rng = hips_of(cmu_walk.skeleton), np.random.default_rng(0)
    translation = cmu_walk.translation.copy()
    translation[:, hips] += rng.normal(scale=0.02, size=translation[:, hips].shape)
    noisy = cmu_walk.with_motion(cmu_walk.rotation, translation)
    done = interpose.denoise(noisy).clip
    assert _off(done, cmu_walk).mean() < 0.35 * _off(noisy, cmu_walk).mean()
    turned = np.degrees(rotations.angle(done.rotation, cmu_walk.rotation))
    assert turned.mean() < 0.2
    assert turned.max() < 5
