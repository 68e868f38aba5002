"""Joints that tremble beside what is missing of them are smoothed there for whoever fills it."""

from __future__ import annotations

import numpy as np
import pytest

from interpose import fill
from interpose.clip import Clip
from interpose.finish import guarantees
from interpose.finish.calming import calmed
from interpose.geometry import rotations
from interpose.observation import Gap, Observation

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


@pytest.mark.parametrize("pace", [0, 150, 300])
def test_a_joint_that_swings_keeps_its_swing(cmu_walk, pace):
    """Degrees a second at which it turns, to the gap and on from it, under eight of noise."""
    row, (start, stop) = cmu_walk.skeleton.index("RightForeArm"), MISSING
    rotation, at = cmu_walk.rotation.copy(), np.arange(len(cmu_walk))
    away = np.maximum(np.maximum(start - at, at - stop + 1), 0) / cmu_walk.fps
    rotation[:, row] = rotations.about("X", np.radians(pace * np.minimum(away, 0.6)))
    true = cmu_walk.with_motion(rotation, cmu_walk.translation)
    clip = lost(true, 8, "RightForeArm")
    found = calmed(clip, Observation.from_gaps(clip, [Gap(*MISSING, ("RightForeArm",))]))
    near = [*range(start - 10, start), *range(stop, stop + 10)]
    noisy, calm = (
        np.degrees(rotations.angle(one.rotation[near, row], true.rotation[near, row]))
        for one in (clip, found)
    )
    assert calm.mean() < 0.7 * noisy.mean()
    before, after = (found.rotation[frames][:, row] for frames in ([start - 3, stop], [start - 1, stop + 2]))
    speed = np.degrees(rotations.log(rotations.relative(before, after)))[:, 0] * clip.fps / 2
    assert speed == pytest.approx([-pace, pace], abs=100)


def test_noise_at_a_seam_is_told_and_not_smoothed_away(cmu_walk):
    """What jumps further than it may is flagged, as every known value is there to be seen."""
    clip = lost(cmu_walk, 20, "RightForeArm")
    done = fill(clip, [Gap(*MISSING, ("RightForeArm",))], method="spline")
    [told] = done.report.gaps
    assert told.seam_after > told.seam_limit
    assert any("flagged: the velocity jumps" in note for note in told.notes)


@pytest.mark.parametrize(("degrees", "same"), [(1, True), (6, False)])
def test_what_trembles_less_than_recorded_motion_is_as_it_was(cmu_walk, degrees, same):
    known = Observation.from_gaps(cmu_walk, [Gap(*MISSING)])
    assert (calmed(cmu_walk, known).rotation == cmu_walk.rotation).all()
    rng, shape = np.random.default_rng(1), (*cmu_walk.rotation.shape[:2], 3)
    shaken = rotations.exp(rng.normal(0, np.radians(degrees), shape))
    restless = cmu_walk.with_motion(rotations.multiply(cmu_walk.rotation, shaken), cmu_walk.translation)
    assert (calmed(restless, known).rotation == restless.rotation).all() == same


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
