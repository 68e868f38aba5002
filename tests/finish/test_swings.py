"""Feet that step leave the floor."""

from __future__ import annotations

import numpy as np
import pytest

from interpose.finish.swings import MOST, lifts

# Stands ten frames, steps for ten, and so on: five steps of half a metre.
FRAMES, STEPS = 110, [(start, start + 10) for start in range(10, 110, 20)]
GAP = slice(45, 85)


def walking(*heights: float) -> tuple[np.ndarray, np.ndarray]:
    """A foot (F, 2, 3) whose toe gets so high in its steps, and where it stands (F, 2)."""
    feet, planted = np.zeros((FRAMES, 2, 3)), np.ones((FRAMES, 2), bool)
    feet[:, 0, 1] = 0.1
    for (start, stop), height in zip(STEPS, heights):
        share = np.arange(1, 11) / 11
        feet[start:stop, :, 1] += height * np.sin(np.pi * share)[:, None]
        feet[start:, :, 2] += 0.5 * np.minimum(np.arange(1, FRAMES - start + 1) / 11, 1.0)[:, None]
        planted[start:stop] = False
    return feet, planted


def lifted(*heights: float, known: bool = True, gap: slice = GAP) -> np.ndarray:
    feet, planted = walking(*heights)
    movable = np.zeros(FRAMES, bool)
    movable[gap] = True
    floor = np.broadcast_to([0.1, 0.0], (FRAMES, 2))
    return lifts(feet, floor, planted, ~movable & known, movable)


def test_a_step_that_scuffs_is_as_high_as_those_around():
    raised = lifted(0.04, 0.05, 0.01, 0.06, 0.05)
    inside = slice(*STEPS[2])
    assert raised[inside].max() == pytest.approx(0.04, abs=0.01)
    assert (np.diff(raised[inside])[:4] > 0).all()
    raised[inside] = 0.0
    assert not raised.any(), "while it stands it stays on the floor, and what is seen stays"


def test_who_lifts_his_feet_high_does_so_no_higher_than_others():
    assert lifted(0.3, 0.3, 0.01, 0.3, 0.3).max() == pytest.approx(MOST - 0.01, abs=0.005)


@pytest.mark.parametrize(
    ("heights", "options"),
    [
        ((0.04, 0.05, 0.05, 0.06, 0.05), {}),  # is high enough
        ((0.01, 0.01, 0.01, 0.01, 0.01), {}),  # shuffles all the while
        ((0.05, 0.05, 0.01, 0.05, 0.05), {"known": False}),
        ((0.05, 0.05, 0.01, 0.05, 0.05), {"gap": slice(55, 85)}),  # began where it is seen
    ],
)
def test_nothing_else_is_lifted(heights, options):
    assert lifted(*heights, **options).max() < 2e-3
