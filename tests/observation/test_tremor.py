"""Joints that tremble beside what is missing of them are smoothed there for whoever fills it."""

from __future__ import annotations

import numpy as np
import pytest

from interpose import fill
from interpose.clip import Clip
from interpose.finish import guarantees
from interpose.geometry import rotations
from interpose.observation import Gap, Observation
from interpose.observation.tremor import calmed

MISSING = (100, 140)


def lost(clip: Clip, degrees: float, joint: str) -> Clip:
    """A clip in which a joint trembles for half a second on either side of a gap."""
    rng, noisy = np.random.default_rng(5), clip.rotation.copy()
    near, row = round(0.5 * clip.fps), clip.skeleton.index(joint)
    for start, stop in ((MISSING[0] - near, MISSING[0]), (MISSING[1], MISSING[1] + near)):
        noise = rotations.exp(rng.normal(0, np.radians(degrees), (stop - start, 3)))
        noisy[start:stop, row] = rotations.multiply(noisy[start:stop, row], noise)
    return clip.with_motion(noisy, clip.translation)


@pytest.mark.parametrize("joint", ["RightHand", "LeftForeArm"])
@pytest.mark.parametrize("method", ["spline", "auto"])
def test_noise_beside_a_gap_does_not_go_on_in_it_as_speed(cmu_walk, joint, method, monkeypatch):
    row, gap = cmu_walk.skeleton.index(joint), Gap(*MISSING, (joint,))
    clip = lost(cmu_walk, 8, joint)

    def off() -> np.ndarray:
        done = fill(clip, [gap], method=method).clip
        outside = np.r_[: MISSING[0], MISSING[1] : len(clip)]
        assert (done.rotation[outside] == clip.rotation[outside]).all(), "noisy or not, it is observed"
        return np.degrees(rotations.angle(done.rotation, cmu_walk.rotation))[slice(*MISSING), row]

    calm = off()
    assert calm.max() < 35
    monkeypatch.setattr(guarantees, "calmed", lambda clip, known: clip)
    assert calm.mean() < 0.7 * off().mean()


def test_calm_motion_and_motion_that_is_restless_throughout_are_as_they_were(cmu_walk):
    known = Observation.from_gaps(cmu_walk, [Gap(*MISSING)])
    assert (calmed(cmu_walk, known).rotation == cmu_walk.rotation).all()
    shaken = rotations.exp(np.random.default_rng(1).normal(0, 0.02, (*cmu_walk.rotation.shape[:2], 3)))
    restless = cmu_walk.with_motion(rotations.multiply(cmu_walk.rotation, shaken), cmu_walk.translation)
    assert (calmed(restless, known).rotation == restless.rotation).all()


def test_only_what_is_missing_is_calmed_and_only_beside_it(cmu_walk):
    clip = lost(cmu_walk, 8, "RightHand")
    row = clip.skeleton.index("RightHand")
    known = Observation.from_gaps(clip, [Gap(*MISSING, ("RightHand",))])
    changed = (calmed(clip, known).rotation != clip.rotation).any(axis=-1)
    assert changed[:, row].any()
    assert not np.delete(changed, row, axis=1).any()
    near = round(0.35 * clip.fps)
    assert not changed[: MISSING[0] - near].any()
    assert not changed[MISSING[1] + near :].any()
    others = Observation.from_gaps(clip, [Gap(*MISSING, ("LeftHand",))])
    assert (calmed(clip, others).rotation == clip.rotation).all()
