"""Who turns on the spot between two keys steps round, and nobody else does."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from interpose import formats
from interpose.clip import Clip
from interpose.finish import complete, feet, guarantees, stepping
from interpose.geometry import measures, rotations
from interpose.methods.classical import Linear
from interpose.methods.protocol import Raw
from interpose.observation import Gap, Observation
from interpose.skeletons.carrier import hips_of
from interpose.skeletons.humanoid import reflect


@pytest.fixture(scope="module")
def standing(data: Path) -> Clip:
    """Somebody who stands, for one frame."""
    return formats.load(data / "cmu_jump.bvh").slice(0, 1)


def keys(pose: Clip, frames: int, degrees: float, aside: float = 0.0) -> tuple[Clip, Observation]:
    """A pose, and `frames` later the same pose turned about its hips and moved aside by so many metres."""
    rotation = np.repeat(pose.rotation, frames + 1, axis=0)
    translation = np.repeat(pose.translation, frames + 1, axis=0)
    rotation[-1, 0] = rotations.multiply(rotations.about("Y", np.radians(degrees)), rotation[-1, 0])
    translation[-1, 0, 0] += aside
    clip = pose.with_motion(rotation, translation)
    return clip, Observation.from_gaps(clip, [Gap(1, frames)])


def filled(clip: Clip, known: Observation) -> tuple[Clip, bool]:
    done = complete(clip, known, Linear())
    [gap] = done.report.gaps
    return done.clip, guarantees.STEPS in gap.notes


@pytest.mark.parametrize(
    ("frames", "degrees", "aside"), [(30, 60, 0), (30, -90, 0.1), (45, 135, 0), (60, 175, 0), (30, 0, 0.4)]
)
def test_one_foot_stands_while_the_other_one_steps(standing, frames, degrees, aside):
    clip, known = keys(standing, frames, degrees, aside)
    done, steps = filled(clip, known)
    assert steps
    placed, pairs = done.positions(), feet.pairs(done.skeleton)
    slowest = measures.speed(placed[:, pairs], done.fps).max(axis=2).min(axis=1)
    assert slowest.max() < 0.15
    slide, _ = feet.measure(done, known, 1, frames)
    assert slide < 6
    assert feet.drifts(done, known, [(1, frames)])[0][0] < 0.05
    # They come off the floor, and not through it.
    heights = placed[:, pairs, 1] - placed[0, pairs, 1]
    assert heights.max(axis=(0, 2)).min() > 0.04
    assert heights.min() > -0.02
    assert (done.rotation[[0, -1]] == clip.rotation[[0, -1]]).all()


def test_a_large_turn_is_an_even_one(standing):
    """Networks whirl half round in a few frames."""
    clip, known = keys(standing, 60, 175)
    done, _ = filled(clip, known)
    legs = feet.legs(done.skeleton)
    placed = done.positions()
    across = placed[:, legs[0].thigh] - placed[:, legs[1].thigh]
    heading = np.degrees(np.unwrap(np.arctan2(-across[:, 2], across[:, 0])))
    assert heading[-1] - heading[0] == pytest.approx(175, abs=0.5)
    assert np.abs(np.diff(heading)).max() * 30 < 1.6 * 175 / 2


@pytest.mark.parametrize(("last", "goes_on"), [(360, True), (120, False)])
def test_a_body_that_turns_on_goes_through_a_key_and_one_that_turns_back_rests_there(standing, last, goes_on):
    """Keys a second apart, turned by 0, 120, 240 and as far again, or back: each gap is led by itself."""
    parts = [keys(standing, 30, degrees)[0].slice(30, 31) for degrees in (0, 120, 240, last)]
    held = np.repeat([0, 1, 2, 3], [30, 30, 30, 1])
    clip = standing.with_motion(
        *(
            np.concatenate([getattr(part, name) for part in parts])[held]
            for name in ("rotation", "translation")
        )
    )
    known = Observation.from_gaps(clip, [Gap(1, 30), Gap(31, 60), Gap(61, 90)])
    done = complete(clip, known, Linear())
    assert all(guarantees.STEPS in gap.notes for gap in done.report.gaps)
    legs, placed = feet.legs(clip.skeleton), done.clip.positions()
    across = placed[:, legs[0].thigh] - placed[:, legs[1].thigh]
    heading = np.degrees(np.unwrap(np.arctan2(-across[:, 2], across[:, 0])))
    rate = np.diff(heading) * 30
    assert rate[:60].min() > -1, "never back"
    assert min(rate[29], rate[30]) > 100, "120 degrees a second in the mean"
    assert (min(rate[59], rate[60]) > 100) == goes_on
    assert goes_on or max(abs(rate[59]), abs(rate[60])) < 20


def test_turned_and_moved_keys_give_the_same_steps(standing):
    clip, known = keys(standing, 30, 90)
    reference = filled(clip, known)[0].positions()
    turn, shift = rotations.about("Y", np.radians(70.0)), np.array([3.0, 0.0, -2.0])
    rotation, translation = clip.rotation.copy(), clip.translation.copy()
    rotation[:, 0] = rotations.multiply(turn, rotation[:, 0])
    translation = rotations.rotate(turn, translation) + shift
    done, steps = filled(clip.with_motion(rotation, translation), known)
    assert steps
    assert np.allclose(done.positions(), rotations.rotate(turn, reference) + shift, atol=1e-6)


def test_the_mirror_image_steps_with_the_same_foot(standing):
    """Left-handed axes are those of the mirror image, in which left is still left."""
    clip, known = keys(standing, 45, 120)
    (one, steps), (other, _) = filled(clip, known), filled(reflect(clip), known)
    assert steps
    assert np.abs(other.positions() * [-1.0, 1.0, 1.0] - one.positions()).max() < 1e-6


def test_hips_sink_for_straight_legs_alone(standing):
    """And by little: a step aside takes a longer leg than there is."""
    clip, known = keys(standing, 30, 0, 0.4)
    hips = filled(clip, known)[0].positions()[:, hips_of(standing.skeleton), 1]
    assert 0 <= hips[0] - hips.min() < 0.1


def test_hips_that_went_along_for_other_steps_stay_over_the_feet(standing):
    """A method that lets the body go half a metre aside and back, where the feet turn on the spot: the body
    squatted for it."""
    clip, known = keys(standing, 60, 90)

    class Wandering(Linear):
        def complete(self, clip, observation, seed=None):
            done = super().complete(clip, observation).clip
            translation = done.translation.copy()
            translation[:, 0, 0] += 0.5 * np.sin(np.linspace(0, np.pi, len(done)))
            return Raw(done.with_motion(done.rotation, translation))

    done = complete(clip, known, Wandering())
    assert guarantees.STEPS in done.report.gaps[0].notes
    hips = done.clip.positions()[:, hips_of(standing.skeleton)]
    assert hips[0, 1] - hips[:, 1].min() < 0.05
    assert np.linalg.norm((hips - hips[0])[:, [0, 2]], axis=1).max() < 0.2


def test_without_time_nobody_steps(standing):
    assert not filled(*keys(standing, 8, 90))[1]


def test_a_pose_that_comes_back_stays(standing):
    done, steps = filled(*keys(standing, 30, 5))
    assert not steps
    assert feet.measure(done, keys(standing, 30, 5)[1], 1, 30)[1] < 0.1


def test_who_walks_or_lies_does_not_turn_on_the_spot(standing, cmu_walk):
    walk = cmu_walk.slice(30, 61)
    assert not filled(walk, Observation.from_gaps(walk, [Gap(1, 30)]))[1]
    clip, known = keys(standing, 30, 90)
    lying = clip.rotation.copy()
    lying[:, 0] = rotations.multiply(rotations.about("X", np.radians(90.0)), lying[:, 0])
    assert not filled(clip.with_motion(lying, clip.translation), known)[1]


def test_amid_known_motion_the_method_knows_better(standing):
    clip, known = keys(standing, 30, 90)
    first = np.maximum(np.arange(-1, len(clip)), 0)
    held = clip.with_motion(clip.rotation[first], clip.translation[first])
    assert not filled(held, Observation(known.rotation[first], known.translation[first]))[1]


def test_what_is_known_of_a_leg_stays(standing):
    clip, known = keys(standing, 30, 90)
    shin = standing.skeleton.names.index("LeftLeg")
    rotation = known.rotation.copy()
    rotation[:, shin] = True
    done, steps = filled(clip, Observation(rotation, known.translation))
    assert not steps
    assert (done.rotation[:, shin] == clip.rotation[:, shin]).all()


def test_a_foot_that_is_on_its_way_at_a_key_does_not_stand_from_there_on(standing):
    """Steps would stop it within a frame: what a method says is kept then."""
    clip, known = keys(standing, 30, 60)
    linear = Linear().complete(clip, known).clip
    assert stepping.stepped(linear, known, (1, 30)) is not None
    after = linear.take([*range(31), *[30] * 10])
    rotation = after.rotation.copy()
    for leg in feet.legs(after.skeleton):
        swing = rotations.about("X", -0.25 * np.arange(1, 11))
        rotation[31:, leg.thigh] = rotations.multiply(rotation[31:, leg.thigh], swing)
        rotation[25:31, leg.thigh] = rotations.multiply(
            rotation[25:31, leg.thigh], rotations.about("X", 0.25 * np.arange(5, -1, -1))
        )
    moving = after.with_motion(rotation, after.translation)
    seen = Observation.from_gaps(moving, [Gap(1, 30), Gap(31, len(moving))])
    assert stepping.stepped(moving, seen, (1, 30)) is None


def test_who_turns_does_not_wait_on_tiptoe(standing):
    """A heel that is up at a key comes down after it, and rises before the next one."""
    clip, _ = keys(standing, 60, 90)
    feet_there = clip.positions()[[0, 60]][:, feet.pairs(clip.skeleton)]
    flat = feet_there[..., 0, 1].copy()
    feet_there[1, :, 0, 1] += 0.06
    path = stepping._steps(stepping.Turn(feet_there, np.pi / 2), clip, (1, 60))
    assert path is not None
    off = path[..., 0, 1] - flat[0]
    assert off[-1].min() > 0.05
    for leg in range(2):
        landed = np.flatnonzero(np.linalg.norm(np.diff(path[:, leg, 1, ::2], axis=0), axis=1) > 1e-6)[-1] + 2
        assert np.abs(off[landed : 59 - round(stepping.HEELS * clip.fps), leg]).max(initial=0.0) < 0.002
