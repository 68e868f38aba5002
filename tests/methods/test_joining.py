"""A joint does not step where other joints are lost or come back."""

from __future__ import annotations

import numpy as np
import pytest

import interpose
from interpose.geometry import rotations
from interpose.methods.joining import joined

FRAMES, CHANGE, START, STOP = 60, 30, 20, 41


def wave(step: float) -> tuple[np.ndarray, np.ndarray]:
    """Turns of two joints, which both swing, and step at a change; and which are known."""
    angle = 0.5 * np.sin(np.arange(FRAMES) / 8) + step * (np.arange(FRAMES) >= CHANGE)
    vectors = angle[:, None, None] * [[1.0, 0, 0], [0, 0.6, 0.8]]
    known = np.ones((FRAMES, 2), bool)
    known[START:STOP] = False
    return vectors, known


@pytest.mark.parametrize("turned", [False, True])
def test_a_step_fades_to_both_ends_and_what_is_known_stays(turned):
    (vectors, known), (smooth, _) = wave(0.3), wave(0.0)
    values, truth = (rotations.exp(v) if turned else v for v in (vectors, smooth))
    done = joined(values, known, np.array([CHANGE]), 30.0)
    back = rotations.log(done) if turned else done
    assert (done[known[:, 0]] == values[known[:, 0]]).all()
    steps = np.linalg.norm(np.diff(back, axis=0) - np.diff(smooth, axis=0), axis=-1)[START : STOP - 1]
    assert steps.max() < 0.06, "there was one of .3"
    # Without a step there is nothing to mend but curvature.
    same = joined(truth, known, np.array([CHANGE]), 30.0)
    assert np.abs(same - truth).max() < 1e-3


def test_changes_beside_each_other_and_beside_known_frames_are_left():
    vectors, known = wave(0.3)
    for changes in ([CHANGE, CHANGE + 1], [START + 1], [STOP - 1], [5]):
        assert (joined(vectors, known, np.array(changes), 30.0) == vectors).all()


@pytest.mark.parametrize("first", [True, False])
def test_an_arm_that_is_missing_longer_than_the_body_does_not_jump(cmu_walk, first):
    arm = tuple(
        name for name in cmu_walk.skeleton.names if name.startswith(("LeftArm", "LeftFore", "LeftHand"))
    )
    body, more = ((60, 100), (100, 130)) if first else ((80, 120), (50, 80))
    gaps = [interpose.Gap(*body), interpose.Gap(*more, arm)]
    done = interpose.fill(cmu_walk, gaps, method="small-open").clip
    border = slice(95, 103) if first else slice(75, 83)
    hand = cmu_walk.skeleton.index("LeftHand")
    jumps = np.linalg.norm(np.diff(done.positions()[border, hand], 2, axis=0), axis=-1)
    assert jumps.max() * done.fps**2 < 12, "it was 47 m/s^2; the walk's own is 3 to 5"
