"""A thigh that is lost points at the foot of the leg that would be there."""

from __future__ import annotations

import numpy as np
import pytest

import interpose
from interpose.clip import Clip
from interpose.finish import feet
from interpose.finish.aiming import aimed, severed
from interpose.observation import Gap, Observation


def lost(clip: Clip, joints: list[int], start: int, stop: int) -> Observation:
    names = tuple(clip.skeleton.names[joint] for joint in joints)
    return Observation.from_gaps(clip, [Gap(start, stop, names)])


def test_known_knees_of_lost_thighs_are_severed(cmu_walk: Clip) -> None:
    left, right = feet.legs(cmu_walk.skeleton)
    known = lost(cmu_walk, [left.thigh, right.thigh, right.knee], 40, 60)
    found = severed(cmu_walk, known)
    expected = np.zeros_like(found)
    expected[40:60, [left.knee, left.ankle]] = True
    np.testing.assert_array_equal(found, expected)


def test_ankles_lie_where_those_of_the_body_point_to(cmu_walk: Clip) -> None:
    """With the knees that are known, as far as these let them; in other frames nothing changes."""
    body = cmu_walk.with_motion(
        np.roll(cmu_walk.rotation, 30, axis=0), np.roll(cmu_walk.translation, 30, axis=0)
    )
    left, _ = feet.legs(cmu_walk.skeleton)
    parts = severed(cmu_walk, lost(cmu_walk, [left.thigh], 40, 60))
    done = aimed(body, cmu_walk, parts)
    np.testing.assert_array_equal(done.rotation[parts], cmu_walk.rotation[parts])
    others = [
        joint for joint in range(len(body.skeleton)) if joint not in (left.thigh, left.knee, left.ankle)
    ]
    np.testing.assert_array_equal(done.rotation[:, others], body.rotation[:, others])
    np.testing.assert_array_equal(
        np.delete(done.rotation, np.s_[40:60], 0), np.delete(body.rotation, np.s_[40:60], 0)
    )
    ways = [
        clip.positions()[40:60, left.ankle] - clip.positions()[40:60, left.thigh] for clip in (done, body)
    ]
    straight = [way / np.linalg.norm(way, axis=1, keepdims=True) for way in ways]
    np.testing.assert_allclose(*straight, atol=1e-6)
    assert np.abs(np.linalg.norm(ways[0], axis=1) - np.linalg.norm(ways[1], axis=1)).max() > 0.01


def test_a_spline_aims_at_nothing(cmu_walk: Clip) -> None:
    """It interpolates angles, and of a thigh that is never known it has the rest pose, which it says."""
    left, _ = feet.legs(cmu_walk.skeleton)
    done = interpose.recover(cmu_walk, cmu_walk.skeleton.names[left.thigh], method="spline")
    assert any("only the rest pose" in note for note in done.report.gaps[0].notes)
    rest = cmu_walk.skeleton.rest_rotation[left.thigh]
    np.testing.assert_allclose(
        done.clip.rotation[:, left.thigh], np.tile(rest, (len(cmu_walk), 1)), atol=1e-9
    )


@pytest.mark.parametrize(("side", "most"), [(0, 0.09), (1, 0.06)])
def test_of_a_lost_thigh_the_foot_is_where_it_steps(cmu_walk: Clip, side: int, most: float) -> None:
    """Off by less than where a network that knows the knee says the thigh alone: by .107 and .070 m."""
    leg = feet.legs(cmu_walk.skeleton)[side]
    done = interpose.fill(cmu_walk, lost(cmu_walk, [leg.thigh], 60, 130), method="small")
    off = np.linalg.norm((done.clip.positions() - cmu_walk.positions())[60:130, leg.ankle], axis=1).mean()
    np.testing.assert_array_equal(done.clip.rotation[:, leg.knee], cmu_walk.rotation[:, leg.knee])
    assert off < most
