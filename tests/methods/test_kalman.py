"""Low-rank Kalman smoothing: what it recovers, what it must not depend on, and what it refuses."""

from __future__ import annotations

import numpy as np
import pytest

from interpose import tasks
from interpose.geometry import rotations
from interpose.methods import registry
from interpose.methods.kalman import FEWEST, Kalman, headings, smooth
from interpose.observation import Gap, Observation

LEG = ("LeftUpLeg", "LeftLeg")


def said(clip, name: str, *gaps: Gap):  # type: ignore[no-untyped-def]
    """(F, J, 3) what a method says of all joints, and which positions (F, J) are known."""
    seen = Observation.from_gaps(clip, gaps)
    raw = registry.get(name).complete(clip, seen)
    positions = raw.clip.positions() if raw.positions is None else raw.positions
    return positions, seen.positions(clip.skeleton)


def swinging(frames: int = 60, points: int = 8) -> np.ndarray:
    """(F, 3 J) points that hang from three common movements, while all of them go along."""
    t = np.arange(frames)[:, None] / 30
    rng = np.random.default_rng(0)
    moves = np.concatenate([np.sin(3 * t), np.cos(5 * t), np.sin(7 * t)], axis=1)
    way = np.tile(np.concatenate([t, 0 * t, 2 * t], axis=1), points)
    return moves @ rng.standard_normal((3, 3 * points)) / 5 + rng.standard_normal(3 * points) + way


def test_points_that_move_together_are_recovered_and_none_leaks():
    values = swinging()
    known = np.ones(values.shape, bool)
    known[20:40, :9] = False
    done = smooth(np.where(known, values, np.nan), known)
    frames = np.arange(len(values))
    line = np.stack([np.interp(frames, frames[k], v[k]) for v, k in zip(values.T, known.T)], axis=1)
    assert np.abs(done - values)[~known].mean() < 0.1 * np.abs(line - values)[~known].mean()
    assert (done[known] == values[known]).all()
    assert smooth(np.where(known, values, 1e30), known).tobytes() == done.tobytes()


def test_single_coordinates_may_be_missing():
    values = swinging()
    known = np.random.default_rng(1).random(values.shape) > 0.05
    known[[0, 10, 20, 30, 40, 50, 59]] = True
    done = smooth(np.where(known, values, np.nan), known)
    assert np.abs(done - values)[~known].mean() < 0.02


def test_whole_frames_between_known_ones_lie_on_a_line():
    values = swinging()
    known = np.ones(values.shape, bool)
    known[20:30] = False
    line = np.linspace(values[19], values[30], 12)[1:-1]
    assert np.abs(smooth(values, known)[20:30] - line).max() < 0.05


@pytest.mark.parametrize("frames", [1, 2])
def test_one_or_two_whole_frames_give_numbers(frames):
    """From one it learns a pose, which is carried along with what is seen; from two, one direction."""
    values = swinging()
    known = np.ones(values.shape, bool)
    known[frames:, :9] = False
    done = smooth(np.where(known, values, np.nan), known)
    assert np.isfinite(done).all()
    if frames == 1:
        gone = (values[:, 9:] - values[0, 9:]).reshape(len(values), -1, 3).mean(axis=1)
        carried = (done[:, :9] - values[0, :9]).reshape(len(values), -1, 3)
        assert np.abs(carried - gone[:, None]).max() < 0.15, "of 4 m; the last frames lag"


def test_a_lost_leg_of_a_real_walk(cmu_walk):
    """Gaps of a second, far better than holding the leg, and better than turning it straight to its end."""
    truth = cmu_walk.positions()
    errors = {}
    for name in ("zero-velocity", "linear", "kalman"):
        wrong = []
        for start in range(40, 150, 20):
            positions, known = said(cmu_walk, name, Gap(start, start + 30, LEG))
            wrong.append(np.linalg.norm(positions - truth, axis=-1)[~known].mean())
        errors[name] = np.mean(wrong)
    assert errors["kalman"] < 0.5 * errors["zero-velocity"]
    assert errors["kalman"] < 0.8 * errors["linear"]


def test_it_follows_the_clip(cmu_walk):
    turn = rotations.about("Y", np.array(2.0))
    rotation = cmu_walk.rotation.copy()
    rotation[:, 0] = rotations.multiply(turn, rotation[:, 0])
    shift = np.array([4.0, 0.5, -3.0])
    moved = cmu_walk.with_motion(rotation, rotations.rotate(turn, cmu_walk.translation) + shift)
    for gap in (Gap(60, 90, LEG), Gap(60, 70)):
        here, _ = said(cmu_walk, "kalman", gap)
        there, _ = said(moved, "kalman", gap)
        assert np.abs(rotations.rotate(turn, here) + shift - there).max() < 1e-6


def test_headings_are_turns_from_the_first_frame():
    rng = np.random.default_rng(0)
    angles = np.array([0.0, 1.0, -2.0, 3.0])
    points = rng.standard_normal((5, 3))
    turned = rotations.rotate(rotations.about("Y", angles)[:, None], points)
    assert np.allclose(headings(turned), angles)
    assert np.abs(headings(turned + 0.01 * rng.standard_normal(turned.shape)) - angles).max() < 0.05


def test_it_refuses_what_it_cannot_learn_or_tell(cmu_walk):
    method, frames = Kalman(), len(cmu_walk)
    assert method.refuses(cmu_walk, Gap(60, 90, LEG)) is None
    assert method.refuses(cmu_walk, Gap(60, 90)) is None
    assert "no joint hangs below" in method.refuses(cmu_walk, Gap(60, 90, ("LeftToeBase",)))
    why = method.refuses(cmu_walk, Gap(FEWEST - 1, frames, LEG))
    assert f"there are {FEWEST - 1}, and it needs {FEWEST}" in why
    report = tasks.recover(cmu_walk, LEG, method="kalman").report.gaps[0]
    assert report.method == "spline"
    assert "wholly known" in " ".join(report.notes)


def test_gaps_that_leave_too_few_frames_together_are_filled_by_the_spline(cmu_walk):
    half = len(cmu_walk) // 2
    gaps = Gap(4, half, LEG), Gap(half + 4, len(cmu_walk), ("RightUpLeg",))
    assert all(Kalman().refuses(cmu_walk, gap) is None for gap in gaps)
    seen = Observation.from_gaps(cmu_walk, gaps)
    raw = Kalman().complete(cmu_walk, seen)
    assert raw.positions is None
    spline = registry.get("spline").complete(cmu_walk, seen).clip
    assert raw.clip.rotation.tobytes() == spline.rotation.tobytes()
    remarks = raw.notes["remarks"]
    assert set(remarks) == {f"{gap.start}:{gap.stop}" for gap in gaps}
    assert "filled by spline" in remarks[f"4:{half}"][0]
