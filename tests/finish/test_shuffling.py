"""Feet that a method lets glide from stance to stance take a step; others are left alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from interpose import formats
from interpose.clip import Clip
from interpose.finish import complete, feet, guarantees, shuffling
from interpose.finish.windows import ramp
from interpose.geometry import measures, rotations
from interpose.methods.protocol import Raw
from interpose.observation import Gap, Observation
from interpose.resampling import resample
from interpose.skeletons.carrier import hips_of
from interpose.skeletons.mirror import mirror

BEFORE, MISSING = 40, 60
SPAN = (BEFORE, BEFORE + MISSING)


@pytest.fixture(scope="module")
def standing(data: Path) -> Clip:
    """Somebody who stands, for one frame."""
    return formats.load(data / "cmu_jump.bvh").slice(0, 1)


def shuffle(pose: Clip, *goes: float, sinks: float = 0.0) -> Clip:
    """A body that stands, and whose feet glide forwards by so many metres each, all through a gap."""
    frames = SPAN[1] + BEFORE
    clip = pose.with_motion(*(np.repeat(x, frames, axis=0) for x in (pose.rotation, pose.translation)))
    share = ramp((np.arange(frames) - SPAN[0]) / MISSING)
    clip.translation[:, 0, 1] -= 0.03 + sinks * np.sin(np.pi * share)
    legs, (turned, placed) = feet.legs(clip.skeleton), clip.kinematics()
    foot = placed[0, legs[0].foot]
    ahead = (foot[1] - foot[0]) * [1.0, 0.0, 1.0]
    ahead /= np.linalg.norm(ahead)
    rotation = clip.rotation
    for leg, way in zip(legs, goes):
        goal = placed[:, leg.foot] + way * share[:, None, None] * ahead
        goal[..., 1] = pose.positions()[0, leg.foot, 1]
        rotation = feet.reach(clip.skeleton, leg, rotation, turned, placed, goal)
    return clip.with_motion(rotation, clip.translation)


class Says:
    """A method that says what the clip was."""

    name = "says"

    def __init__(self, truth: Clip) -> None:
        self.truth = truth

    def refuses(self, clip: Clip, gap: Gap) -> str | None:
        return None

    def complete(self, clip: Clip, observation: Observation, seed: int | None = None) -> Raw:
        return Raw(self.truth)


def finished(clip: Clip) -> Clip:
    done = complete(clip, Observation.from_gaps(clip, [Gap(*SPAN)]), Says(clip))
    assert guarantees.STEPPED in done.report.gaps[0].notes
    return done.clip


def toes(clip: Clip) -> np.ndarray:
    """(F, 2, 3)"""
    return clip.positions()[:, feet.pairs(clip.skeleton)[:, 1]]


@pytest.mark.parametrize("goes", [(0.25, 0.0), (0.0, 0.4), (0.3, 0.3), (0.3, -0.2)])
def test_a_foot_that_glides_takes_a_step_while_the_other_one_stands(standing, goes):
    clip = shuffle(standing, *goes)
    done = finished(clip)
    known = Observation.from_gaps(clip, [Gap(*SPAN)])
    assert feet.drifts(clip, known, [SPAN])[0][0] > 0.15, "it is one that shuffles"
    assert feet.drifts(done, known, [SPAN])[0][0] < 0.04
    speed = measures.speed(toes(done), done.fps)[slice(*SPAN)]
    assert speed.min(axis=1).max() < 0.1, "never both at once"
    assert (speed < 0.1).mean(axis=0).min() > 0.5, "most of the time each stands"
    lifted = toes(done)[slice(*SPAN), :, 1].max(axis=0) - toes(done)[0, :, 1]
    assert all((high > 0.025) == (way != 0) for high, way in zip(lifted, goes)), lifted
    np.testing.assert_allclose(toes(done)[SPAN[1]], toes(clip)[SPAN[1]], atol=1e-6)
    hips = hips_of(clip.skeleton)
    assert np.abs(done.positions()[:, hips] - clip.positions()[:, hips]).max() < 0.05


def test_a_turned_body_takes_the_same_steps(standing):
    reference = toes(finished(shuffle(standing, 0.3, 0.2)))
    turn = rotations.about("Y", np.array(2.0))
    rotation = standing.rotation.copy()
    rotation[:, 0] = rotations.multiply(turn, rotation[:, 0])
    turned = standing.with_motion(rotation, rotations.rotate(turn, standing.translation))
    there = toes(finished(shuffle(turned, 0.3, 0.2)))
    np.testing.assert_allclose(there, rotations.rotate(turn, reference), atol=1e-3)


def test_of_two_steps_at_once_the_mirror_image_takes_the_mirror_image(standing):
    """Near an end of a gap both would be as late as there is time for."""
    clip = shuffle(standing, 0.3, 0.2)
    one, image = (
        shuffling.stepping(each, Observation.from_gaps(each, [Gap(*SPAN)]), SPAN, 0.4)
        for each in (clip, mirror(clip))
    )
    np.testing.assert_allclose(mirror(image).positions(), one.positions(), atol=2e-3)


def test_at_another_frame_rate_the_steps_are_the_same(standing):
    clip = shuffle(standing, 0.3, 0.0)
    done = shuffling.stepping(clip, Observation.from_gaps(clip, [Gap(*SPAN)]), SPAN, 0.4)
    fast, span = resample(clip, 60.0), (2 * SPAN[0], 2 * SPAN[1] - 1)
    twice = shuffling.stepping(fast, Observation.from_gaps(fast, [Gap(*span)]), span, 0.4)
    assert np.abs(toes(twice)[: 2 * SPAN[1] : 2] - toes(done)[: SPAN[1]]).max() < 0.03


def test_who_squats_takes_a_step_too(standing):
    clip = shuffle(standing, 0.3, 0.0, sinks=0.45)
    known = Observation.from_gaps(clip, [Gap(*SPAN)])
    assert feet.drifts(clip, known, [SPAN])[0][0] > 0.15, "it is one that shuffles"
    assert feet.drifts(finished(clip), known, [SPAN])[0][0] < 0.04


def test_what_hardly_moves_is_left_alone(standing):
    clip = shuffle(standing, 0.05, 0.05)
    known = Observation.from_gaps(clip, [Gap(*SPAN)])
    assert shuffling.stepping(clip, known, SPAN, 0.4) is None


def test_where_something_is_known_of_the_body_feet_are_left_alone(standing):
    clip = shuffle(standing, 0.3, 0.0)
    names = [clip.skeleton.names[leg.thigh] for leg in feet.legs(clip.skeleton)]
    known = Observation.from_gaps(clip, [Gap(*SPAN, tuple(names))])
    assert shuffling.stepping(clip, known, SPAN, 0.4) is None


def test_without_time_nobody_steps(standing):
    clip = shuffle(standing, 0.3, 0.0)
    known = Observation.from_gaps(clip, [Gap(*SPAN)])
    assert shuffling.stepping(clip, known, SPAN, 1.0) is not None
    assert shuffling.stepping(clip, known, SPAN, 2.1) is None


def test_a_heel_comes_down_when_it_did(standing):
    """Not in one frame, when the toe has got where it stands, nor does it hang there until the end."""
    time = np.arange(61.0)
    foot = np.zeros((61, 2, 3))
    foot[:, 1, 0] = 0.4 * np.clip(time / 30, 0, 1)
    foot[:, 0, 0] = foot[:, 1, 0] - 0.15
    foot[:, 0, 1] = 0.08 + 0.06 * np.clip((60 - time) / 30, 0, 1)
    step = shuffling.Step(0, 0, 61, (0.0, 1.0), 15.0, 12.0, (0.0, 0.0))
    path = shuffling._way(standing, foot, [step])
    np.testing.assert_allclose(path[30:, 0, 1], foot[30:, 0, 1], atol=1e-9)
    np.testing.assert_allclose(path[30:, 1], foot[30:, 1], atol=1e-9)
    assert np.linalg.norm(np.diff(path[:, 0] - path[:, 1], axis=0), axis=1).max() < 0.01
