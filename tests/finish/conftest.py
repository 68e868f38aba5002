"""Clips with gaps, and methods that speak positions: what a network would say, made from the truth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from interpose.clip import Clip
from interpose.geometry import rotations
from interpose.methods.classical import Linear, Spline, ZeroVelocity
from interpose.methods.protocol import Raw
from interpose.observation import Gap, Observation
from interpose.skeletons import find_mapping


def positions_of(truth: Clip, sigma: float = 0.02, bias: float = 0.0, scale: float = 1.0) -> tuple:
    """Mapped joints and their positions (F, n, 3): the truth, scaled about the root's ground point, moved
    sideways, and with slow noise of `sigma` metres."""
    joints = tuple(j for j in find_mapping(truth.skeleton).joints if j is not None)
    positions = truth.positions()[:, joints]
    time = np.arange(len(truth))[:, None, None, None] / truth.fps
    rng = np.random.default_rng(7)
    shape = (1, *positions.shape[1:], 8)
    waves = np.sin(2 * np.pi * rng.uniform(0.2, 1.5, shape) * time + rng.uniform(0, 2 * np.pi, shape))
    noise = waves.sum(-1) * sigma / np.sqrt(12.0)
    ground = truth.root[:, None] * [1.0, 0.0, 1.0]
    # The bias lies in the body's first facing, so that a turned truth gives turned positions.
    side = rotations.rotate(truth.rotation[0, 0], np.array([1.0, 0.0, 0.0])) * [1.0, 0.0, 1.0]
    turned = rotations.rotate(truth.rotation[0, 0], noise)
    return joints, (positions - ground) * scale + ground + turned + bias * side


class Speaking:
    """Says positions of the mapped joints at every frame, as a network does; a spline tells the rest."""

    def __init__(self, truth: Clip, **kwargs: float) -> None:
        self.name = "speaking"
        self.joints, self.positions = positions_of(truth, **kwargs)

    def refuses(self, clip: Clip, gap: Gap) -> str | None:
        return None

    def complete(self, clip: Clip, observation: Observation, seed: int | None = None) -> Raw:
        base = Spline().complete(clip, observation).clip
        return Raw(base, self.positions, self.joints, {"model": "made up", "drift": 0.12})


METHODS = {
    "zero-velocity": lambda truth: ZeroVelocity(),
    "linear": lambda truth: Linear(),
    "spline": lambda truth: Spline(),
    "network": lambda truth: Speaking(truth, sigma=0.03, bias=0.03, scale=1.03),
}


@pytest.fixture(params=METHODS)
def make(request):
    """Makes a method for a clip, given the truth."""
    return METHODS[request.param]


@pytest.fixture(scope="session")
def walk(cmu_walk: Clip) -> Clip:
    """Four seconds of the walk, with rotations that are not written in a file."""
    return replace(cmu_walk.slice(0, 120), name="walk")


@pytest.fixture(scope="session")
def network_like():
    """Makes positions from the truth, see `positions_of`."""
    return positions_of


@pytest.fixture(scope="session")
def speaking():
    """Makes a method that says positions, from the truth."""
    return Speaking
