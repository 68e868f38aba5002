"""Interpolation in time: through the samples, with the given velocities, the short way."""

from __future__ import annotations

import numpy as np
import pytest

from interpose.geometry import rotations, time


def wobble(frames: int = 40, joints: int = 2, seed: int = 0) -> np.ndarray:
    """Smooth rotations (F, J, 4)."""
    rng = np.random.default_rng(seed)
    t = np.arange(frames)[:, None, None] / 30
    vectors = sum(rng.normal(scale=0.5, size=(1, joints, 3)) * np.sin((k + 1) * t + k) for k in range(3))
    return rotations.exp(vectors)


def apart(a: np.ndarray, b: np.ndarray) -> float:
    return float(rotations.angle(a, b).max())


def test_easing_begins_and_ends_at_rest():
    share = np.linspace(0, 1, 101)
    eased = time.ease(share)
    assert (eased[0], eased[50], eased[-1]) == (0, 0.5, 1)
    assert (np.diff(eased) > 0).all()
    assert np.diff(eased)[[0, -1]].max() < 0.04 * np.diff(eased).max()


def test_sampling_at_and_between_samples(kind):
    values = np.random.default_rng(0).normal(size=(5, 2, 3))
    times = kind.array([0.0, 1.0, 1.25, 4.0, -1.0, 9.0])
    got = kind.numpy(time.sample(kind.array(values), times))
    np.testing.assert_allclose(got[[0, 1, 3, 4, 5]], values[[0, 1, 4, 0, 4]], atol=kind.tolerance)
    np.testing.assert_allclose(got[2], 0.75 * values[1] + 0.25 * values[2], atol=kind.tolerance)
    q = wobble(5)
    got = time.sample_rotations(kind.array(q), times)
    expected = rotations.slerp(q[1], q[2], np.array(0.25))
    np.testing.assert_allclose(abs((kind.numpy(got)[2] * expected).sum(-1)), 1, atol=kind.tolerance)


@pytest.mark.parametrize("reach", [None, 3.0, 100.0])
def test_hermite_meets_values_and_velocities(kind, reach):
    a, b, va, vb = np.random.default_rng(0).normal(size=(4, 3))
    length, step = 12.0, 1e-2 if kind.tolerance > 1e-9 else 1e-5
    t = kind.array([0.0, step, length - step, length])
    ends = [kind.array(x)[None] for x in (a, b, va, vb)]
    p = kind.numpy(time.hermite(*ends, t, kind.array([length]), reach))
    np.testing.assert_allclose(p[[0, 3]], [a, b], atol=4 * kind.tolerance)
    np.testing.assert_allclose((p[1] - p[0]) / step, va, atol=2 * step + 1e3 * kind.tolerance)
    np.testing.assert_allclose((p[3] - p[2]) / step, vb, atol=2 * step + 1e3 * kind.tolerance)


def test_hermite_without_reach_is_the_textbook_cubic():
    a, b, va, vb = np.random.default_rng(1).normal(size=(4, 3))
    length, s = 7.0, np.linspace(0, 1, 20)[:, None]
    cubic = (
        (2 * s**3 - 3 * s**2 + 1) * a
        + (3 * s**2 - 2 * s**3) * b
        + (s**3 - 2 * s**2 + s) * va * length
        + (s**3 - s**2) * vb * length
    )
    got = time.hermite(a, b, va, vb, s[:, 0] * length, np.full(20, length))
    np.testing.assert_allclose(got, cubic, atol=1e-12)


@pytest.mark.parametrize("reach", [None, 3.0])
def test_rotations_meet_values_and_velocities(reach):
    rng = np.random.default_rng(2)
    a, b = wobble(2, seed=3)[:, 0]
    va, vb = rng.normal(scale=0.2, size=(2, 3))
    length, step = 12.0, 1e-5
    t = np.array([0.0, step, length - step, length])
    q = time.hermite_rotations(a, b, va, vb, t, np.full(4, length), reach)
    assert apart(q[[0, 3]], np.stack([a, b])) < 1e-12
    np.testing.assert_allclose(time.steps(q)[0] / step, va, atol=1e-4)
    np.testing.assert_allclose(time.steps(q)[2] / step, vb, atol=1e-4)


def test_rotations_follow_a_turn_of_the_input_and_can_be_reversed():
    rng = np.random.default_rng(2)
    a, b = wobble(2, seed=3)[:, 0]
    va, vb = rng.normal(scale=0.2, size=(2, 3))
    world = rotations.exp(np.array([1.0, -2.0, 0.5]))
    t, length = np.linspace(0, 12, 30), np.full(30, 12.0)
    q = time.hermite_rotations(a, b, va, vb, t, length, 5.0)
    turn = rotations.multiply
    turned = time.hermite_rotations(turn(world, a), turn(world, b), va, vb, t, length, 5.0)
    assert apart(turned, turn(world, q)) < 1e-7
    backwards = time.hermite_rotations(b, a, -vb, -va, t, length, 5.0)
    assert apart(backwards[::-1], q) < 1e-7


def test_rotations_take_the_short_way():
    a = rotations.exp(np.array([0.0, 0.1, 0.0]))
    t, length, rest = np.arange(9.0), np.full(9, 8.0), np.zeros(3)
    q = time.hermite_rotations(a, -rotations.exp(np.array([0.0, 0.5, 0.0])), rest, rest, t, length)
    assert rotations.angle(a, q).max() < 0.4 + 1e-9


def test_a_far_reach_swings_out_and_a_near_one_does_not():
    a = b = np.zeros(1)
    fast, rest = np.ones(1), np.zeros(1)
    t, length = np.linspace(0, 60, 200), np.full(200, 60.0)
    assert abs(time.hermite(a, b, fast, rest, t, length)).max() > 8
    assert abs(time.hermite(a, b, fast, rest, t, length, 12.0)).max() < 12 * 4 / 27 + 1e-3


def test_smooth_sampling_goes_through_samples_with_continuous_velocity():
    q = wobble(10)
    times = np.arange(0, 9.0001, 0.01)
    fine = time.sample_rotations_smooth(q, times)
    assert apart(fine[::100], q) < 1e-9
    jumps = np.linalg.norm(np.diff(time.steps(fine), axis=0), axis=-1).max()
    straight = np.linalg.norm(np.diff(time.steps(time.sample_rotations(q, times)), axis=0), axis=-1).max()
    assert jumps < 0.1 * straight
    values = np.cumsum(np.random.default_rng(0).normal(size=(10, 3)), axis=0)
    np.testing.assert_allclose(time.sample_smooth(values, times)[::100], values, atol=1e-12)


@pytest.mark.parametrize("step", [0.8, 1.0, 2.0, 3.3, 4.0])
def test_a_grid_has_the_ends_of_what_is_known(step):
    known = np.ones(300, bool)
    known[111:203] = False
    known[150] = True  # a key
    known[250:299] = False
    times = time.grid(known[:, None], step)
    assert times[0] == 0
    assert times[-1] == 299
    for frame in (110, 150, 203, 249, 299):
        assert np.abs(times - frame).min() < 1e-9
    apart = np.diff(times)
    assert (np.abs(apart / step - 1) < 0.1).all()


def test_a_grid_at_the_same_rate_is_every_frame():
    known = np.random.default_rng(0).random(100) < 0.5
    assert np.array_equal(time.grid(known[:, None], 1.0), np.arange(100))
    assert np.array_equal(time.grid(np.zeros((5, 2), bool), 1.0), np.arange(5))
    assert np.array_equal(time.grid(np.ones((1, 2), bool), 4.0), [0])


def test_a_grid_has_the_ends_of_what_is_known_of_single_values():
    """Of a leg that is lost while an arm is: else nothing leads from what is known of it to what is said."""
    known = np.ones((200, 3), bool)
    known[50:130, 0] = False
    known[83:161, 1] = False
    known[131:140, 2] = False  # nearer to another end than a step: left out
    times = time.grid(known, 4.0)
    assert {49.0, 82.0, 130.0, 140.0, 161.0} <= set(times)
    assert 131.0 not in times
    assert np.diff(times).min() >= 0.6 * 4


def test_a_grid_keeps_the_step_where_little_is_known():
    """Velocities of the two or three frames around a gap are as fast as they are."""
    known = np.zeros(100, bool)
    known[:7] = known[30:36] = True
    times = time.grid(known[:, None], 4.0)
    assert {0.0, 4.0, 30.0, 34.0} <= set(times)
    assert 6.0 not in times


def test_a_grid_stays_one_where_frames_drop_out_everywhere():
    """Of known frames that are nearer to each other than its step it takes one."""
    known = np.random.default_rng(1).random(200) < 0.4
    apart = np.diff(time.grid(known[:, None], 4.0))
    assert apart.min() > 2
    assert apart.max() < 6.1
