"""Arms that turn back at once are led by a spline."""

from __future__ import annotations

import numpy as np
import pytest

from interpose.finish import arms
from interpose.geometry import rotations
from interpose.observation import Gap, Observation

GAP = Gap(80, 120)


@pytest.fixture(scope="module")
def jerky(cmu_walk):  # type: ignore[no-untyped-def]
    """A walk whose left arm turns round in a frame, once in the gap and at its seam."""
    left = cmu_walk.skeleton.index("LeftArm")
    rotation = cmu_walk.rotation.copy()
    time = np.arange(len(GAP))
    swing = np.zeros((len(GAP), 3))
    swing[:, 2] = 0.08 * (np.minimum(time, 20) - np.maximum(time - 20, 0))
    rotation[GAP.start : GAP.stop, left] = rotations.multiply(
        rotation[GAP.start : GAP.stop, left], rotations.exp(swing)
    )
    return cmu_walk.with_motion(rotation, cmu_walk.translation)


def jumps(clip):  # type: ignore[no-untyped-def]
    """(2,) how far each hand's velocity jumps most in the gap and beside, in metres a second squared."""
    return [
        arms._jumps(clip, arm)[GAP.start - 1 : GAP.stop + 1].max() * clip.fps**2
        for arm in arms.arms(clip.skeleton)
    ]


def test_two_arms_are_found(cmu_walk):
    names = cmu_walk.skeleton.names
    assert [names[arm.hand] for arm in arms.arms(cmu_walk.skeleton)] == ["LeftHand", "RightHand"]
    assert [names[j] for j in arms.arms(cmu_walk.skeleton)[0].chain][:2] == ["LeftArm", "LeftForeArm"]


def test_a_hand_that_turns_back_at_once_is_led_round(jerky, cmu_walk):
    known = Observation.from_gaps(jerky, [GAP])
    done = arms.steadied(jerky, known, known, (GAP.start, GAP.stop))
    usual = max(arms.LEAST, arms.OWN * 900 * arms._usual(jerky, known))
    assert jumps(jerky)[0] > 1.5 * usual
    assert jumps(done)[0] <= usual
    moved = (done.rotation != jerky.rotation).any(axis=(0, 2))
    assert {jerky.skeleton.names[j] for j in np.flatnonzero(moved)} <= {"LeftArm", "LeftForeArm"}
    seen = np.asarray(known.frames)
    assert (done.rotation[seen] == jerky.rotation[seen]).all()
    still = arms.steadied(cmu_walk, known, known, (GAP.start, GAP.stop))
    assert still is cmu_walk, "people's own arms are left alone"


def test_an_arm_of_which_something_is_known_is_left_alone(jerky):
    known = Observation.from_gaps(jerky, [GAP])
    known.rotation[100, jerky.skeleton.index("LeftForeArm")] = True
    assert arms.steadied(jerky, known, known, (GAP.start, GAP.stop)) is jerky


def test_hands_that_jump_as_far_nearby_may(jerky):
    """In the same motion as far, beside the gap, by the other hand."""
    known = Observation.from_gaps(jerky, [GAP])
    right = jerky.skeleton.index("RightArm")
    rotation = jerky.rotation.copy()
    rotation[60, right] = rotations.multiply(rotation[60, right], rotations.exp(np.array([0.0, 0.0, 0.3])))
    wild = jerky.with_motion(rotation, jerky.translation)
    assert arms.steadied(wild, known, known, (GAP.start, GAP.stop)) is wild


def test_between_lone_keys_hands_turn_back_as_they_may_anywhere(jerky):
    part = jerky.slice(GAP.start, GAP.stop)
    known = Observation.from_gaps(part, [Gap(1, len(part) - 1)])
    assert arms._usual(part, known) is None
    before = max(arms._jumps(part, arm).max() for arm in arms.arms(part.skeleton)) * part.fps**2
    done = arms.steadied(part, known, known, (1, len(part) - 1))
    after = max(arms._jumps(done, arm).max() for arm in arms.arms(part.skeleton)) * part.fps**2
    assert after <= arms.UNTOLD < before


def test_what_never_turns_is_no_reason_to_leave_an_arm_alone(jerky):
    """Rolls of forearms that were never captured are firm, but tell nothing."""
    known = Observation.from_gaps(jerky, [GAP])
    firm = Observation(known.rotation.copy(), known.translation)
    firm.rotation[:, jerky.skeleton.index("LeftForeArm")] = True
    done = arms.steadied(jerky, known, firm, (GAP.start, GAP.stop))
    assert jumps(done)[0] < 0.7 * jumps(jerky)[0]
    moved = (done.rotation != jerky.rotation).any(axis=(0, 2))
    assert [jerky.skeleton.names[j] for j in np.flatnonzero(moved)] == ["LeftArm"]


def test_an_arm_that_is_known_nowhere_does_not_go_to_rest(jerky):
    part = jerky.slice(98, 103)
    known = Observation.full(part)
    known.rotation[:, list(arms.arms(part.skeleton)[0].chain)] = False
    assert arms.steadied(part, known, known, (0, len(part))) is part
