"""What interpose's own network says, put together from several answers."""

from __future__ import annotations

import numpy as np
import pytest

from interpose.geometry import rotations
from interpose.methods.base.graph import Answer, mean
from interpose.skeletons import JOINTS

FRAMES, OWN = 40, slice(10, 30)


def answer(joint: str, degrees: np.ndarray, expected: float = 0.05) -> Answer:
    """A body that stands and turns one joint about the vertical."""
    local = np.broadcast_to(rotations.identity(), (FRAMES, len(JOINTS), 4)).copy()
    local[:, JOINTS.index(joint)] = rotations.about("Y", np.radians(degrees))
    return Answer(local, np.zeros((FRAMES, 3)), np.ones((FRAMES, 4)), np.full(FRAMES, expected))


def degrees_of(said: Answer, joint: str) -> np.ndarray:
    return np.degrees(rotations.angle(said.local[:, JOINTS.index(joint)], rotations.identity()))


def test_of_two_answers_the_mean_counts():
    slow = np.linspace(0, 40, FRAMES)
    said = mean(answer("Head", slow), answer("Head", 0 * slow), OWN, 0.25)
    np.testing.assert_allclose(degrees_of(said, "Head"), 0.75 * slow, atol=0.5)


@pytest.mark.parametrize("joint", ["Head", "Spine1", "LeftUpLeg"])
@pytest.mark.parametrize("first", [True, False])
def test_of_two_answers_the_one_counts_that_does_not_snap(joint, first):
    """Sixty degrees within two frames, also if that one expects to err less."""
    calm = np.linspace(0, 30, FRAMES)
    torn = calm + 60 * np.clip(np.arange(FRAMES) - 19, 0, 2) / 2
    both = [answer(joint, calm), answer(joint, torn, expected=0.01)]
    said = mean(*(both if first else both[::-1]), OWN)
    np.testing.assert_allclose(degrees_of(said, joint), calm, atol=1e-6)


def test_what_snaps_where_nothing_is_asked_for_counts_as_well():
    torn = np.where(np.arange(FRAMES) < 5, 0.0, 60.0)
    said = mean(answer("Head", torn), answer("Head", 0 * torn), OWN)
    np.testing.assert_allclose(degrees_of(said, "Head")[OWN], 30.0, atol=1e-6)
