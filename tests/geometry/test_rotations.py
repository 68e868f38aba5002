"""Rotations against SciPy, on NumPy and torch, in both precisions; gradients where they like to break."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from interpose.geometry import rotations, values

ORDERS = ["".join(order) for order in itertools.product("XYZ", repeat=3)]
ORDERS = [order for order in ORDERS if order[0] != order[1] != order[2]]


def quaternions(count: int = 200, seed: int = 0) -> np.ndarray:
    q = np.random.default_rng(seed).normal(size=(count, 4))
    return q / np.linalg.norm(q, axis=-1, keepdims=True)


def scipy(q: np.ndarray) -> Rotation:
    return Rotation.from_quat(q[..., [1, 2, 3, 0]])


def unscipy(r: Rotation) -> np.ndarray:
    return r.as_quat()[..., [3, 0, 1, 2]]


def distance(a: np.ndarray, b: np.ndarray) -> float:
    """The largest difference between rotations, whatever the sign of their quaternions."""
    return float(np.minimum(np.linalg.norm(a - b, axis=-1), np.linalg.norm(a + b, axis=-1)).max())


def test_product_rotation_and_inverse(kind):
    a, b = quaternions(seed=1), quaternions(seed=2)
    v = np.random.default_rng(3).normal(size=(200, 3))
    product = rotations.multiply(kind.array(a), kind.array(b))
    assert distance(kind.numpy(product), unscipy(scipy(a) * scipy(b))) < kind.tolerance
    turned = rotations.rotate(kind.array(a), kind.array(v))
    np.testing.assert_allclose(kind.numpy(turned), scipy(a).apply(v), atol=4 * kind.tolerance)
    back = rotations.multiply(kind.array(a), rotations.conjugate(kind.array(a)))
    assert distance(kind.numpy(back), np.array([1.0, 0, 0, 0])) < kind.tolerance
    seen = rotations.relative(kind.array(a), kind.array(b))
    assert distance(kind.numpy(seen), unscipy(scipy(a).inv() * scipy(b))) < kind.tolerance


def test_what_leads_from_one_value_to_another_leads_there(kind):
    for a, b in (
        (quaternions(seed=1), quaternions(seed=2)),
        np.random.default_rng(3).normal(size=(2, 50, 3)),
    ):
        way = values.offset(kind.array(a), kind.array(b))
        assert way.shape == (len(a), 3)
        assert distance(kind.numpy(values.moved(kind.array(a), way)), b) < 4 * kind.tolerance


def test_leading_axes_broadcast(kind):
    a, v = quaternions(5), np.random.default_rng(0).normal(size=(7, 5, 3))
    turned = kind.numpy(rotations.rotate(kind.array(a), kind.array(v)))
    assert turned.shape == (7, 5, 3)
    np.testing.assert_allclose(turned[4], scipy(a).apply(v[4]), atol=4 * kind.tolerance)


def test_matrix_and_6d(kind):
    q = quaternions()
    # Half turns about every axis are where a naive matrix-to-quaternion conversion divides by zero.
    q = np.concatenate([q, np.eye(4), [[0, 0.6, 0.8, 0], [1e-9, 0, 1, 0]]])
    # And the 80 whose components are alike or missing, of either sign: none may cancel out another.
    alike = np.stack(np.meshgrid(*[[-1.0, 0.0, 1.0]] * 4), axis=-1).reshape(-1, 4)
    q = np.concatenate([q, rotations.normalize(alike[np.any(alike, axis=1)])])
    m = rotations.to_matrix(kind.array(q))
    np.testing.assert_allclose(kind.numpy(m), scipy(q).as_matrix(), atol=kind.tolerance)
    assert distance(kind.numpy(rotations.from_matrix(m)), q) < kind.tolerance
    assert distance(kind.numpy(rotations.from_6d(rotations.to_6d(kind.array(q)))), q) < kind.tolerance


def test_6d_is_made_orthonormal(kind):
    columns = np.array([2.0, 0, 0, 5.0, 3.0, 0])
    q = rotations.from_6d(kind.array(columns))
    assert distance(kind.numpy(q), np.array([1.0, 0, 0, 0])) < kind.tolerance


@pytest.mark.parametrize("order", ORDERS)
def test_euler_angles_in_every_order(kind, order):
    q = quaternions()
    angles = kind.numpy(rotations.to_euler(kind.array(q), order))
    # Capital letters are intrinsic turns for SciPy too.
    assert distance(unscipy(Rotation.from_euler(order, angles)), q) < 2 * kind.tolerance
    assert distance(kind.numpy(rotations.from_euler(kind.array(angles), order)), q) < 2 * kind.tolerance
    assert (abs(angles[:, [0, 2]]) <= math.pi + 1e-6).all()
    low, high = (0, math.pi) if order[0] == order[2] else (-math.pi / 2, math.pi / 2)
    assert (angles[:, 1] >= low - 1e-6).all()
    assert (angles[:, 1] <= high + 1e-6).all()


@pytest.mark.parametrize("order", ORDERS)
def test_gimbal_lock_keeps_the_rotation(kind, order):
    middle = [0.0, math.pi] if order[0] == order[2] else [-math.pi / 2, math.pi / 2]
    locked = np.array([[first, m, last] for m in middle for first in (-2.0, 0.3, 3.0) for last in (0.0, 1.2)])
    q = unscipy(Rotation.from_euler(order, locked))
    angles = kind.numpy(rotations.to_euler(kind.array(q), order))
    assert np.isfinite(angles).all()
    # Angles are ill-conditioned there: half of the digits are left in the worst case.
    assert distance(unscipy(Rotation.from_euler(order, angles)), q) < math.sqrt(kind.tolerance)


def test_log_and_exp(kind):
    rng = np.random.default_rng(0)
    axis = rng.normal(size=(50, 3))
    axis /= np.linalg.norm(axis, axis=-1, keepdims=True)
    for angle in (0.0, 1e-12, 1e-7, 1e-5, 9e-5, 1.1e-4, 3e-4, 1e-2, 1.0, 3.0, math.pi - 1e-6):
        vector = axis * angle
        q = rotations.exp(kind.array(vector))
        assert distance(kind.numpy(q), unscipy(Rotation.from_rotvec(vector))) < kind.tolerance
        np.testing.assert_allclose(kind.numpy(rotations.log(q)), vector, atol=2 * kind.tolerance)
        # The other sign of the quaternion is the same rotation.
        np.testing.assert_allclose(kind.numpy(rotations.log(-q)), vector, atol=2 * kind.tolerance)


def test_log_of_a_half_turn_has_the_length_pi(kind):
    q = np.array([[0, 0, 1.0, 0], [0, 0.6, 0, 0.8]])
    length = np.linalg.norm(kind.numpy(rotations.log(kind.array(q))), axis=-1)
    np.testing.assert_allclose(length, math.pi, atol=kind.tolerance)


def test_slerp_takes_the_short_way_at_constant_speed(kind):
    a, b = quaternions(seed=1), quaternions(seed=2)
    b = np.where((a * b).sum(-1, keepdims=True) > 0, -b, b)  # always given the long way round
    t = np.linspace(0, 1, 200)
    q = kind.numpy(rotations.slerp(kind.array(a), kind.array(b), kind.array(t)))
    way = scipy(a).inv() * scipy(b)
    expected = scipy(a) * Rotation.from_rotvec(way.as_rotvec() * t[:, None])
    assert distance(q, unscipy(expected)) < 2 * kind.tolerance
    assert way.magnitude().max() <= math.pi


def test_slerp_between_equal_rotations(kind):
    q = kind.array(quaternions(3))
    t = kind.array(np.full(3, 0.4))
    assert distance(kind.numpy(rotations.slerp(q, -q, t)), kind.numpy(q)) < kind.tolerance


def test_angle(kind):
    a, b = quaternions(seed=1), quaternions(seed=2)
    angle = kind.numpy(rotations.angle(kind.array(a), kind.array(b)))
    np.testing.assert_allclose(angle, (scipy(a).inv() * scipy(b)).magnitude(), atol=4 * kind.tolerance)


def test_between_turns_one_direction_into_another(kind):
    rng = np.random.default_rng(0)
    a, b = rng.normal(size=(2, 50, 3))
    a = np.concatenate([a, [[1, 0, 0], [0, 2, 0], [0, 0, 3], [1, 1, 1]]])
    b = np.concatenate([b, [[-1, 0, 0], [0, -1, 0], [0, 0, -1], [1, 1, 1]]])
    q = kind.numpy(rotations.between(kind.array(a), kind.array(b)))
    turned = scipy(q).apply(a)
    unit = b / np.linalg.norm(b, axis=-1, keepdims=True) * np.linalg.norm(a, axis=-1, keepdims=True)
    np.testing.assert_allclose(turned, unit, atol=20 * kind.tolerance)
    nothing = rotations.between(kind.array([0.0, 0, 0]), kind.array([1.0, 0, 0]))
    assert distance(kind.numpy(nothing), np.array([1.0, 0, 0, 0])) < kind.tolerance


@pytest.mark.parametrize("off", [1e-2, 1e-3, 1e-4, 1e-6])
def test_between_nearly_opposite_directions_misses_by_rounding_alone(kind, off):
    """It turned half about some axis, off by all that was left: up to .08 degrees."""
    a = np.array([[0.6, 0.0, 0.8], [0.0, 1.0, 0.0]])
    across = np.array([[0.0, 1.0, 0.0], [0.6, 0.0, 0.8]])
    b = -np.cos(off) * a + np.sin(off) * across
    turned = scipy(kind.numpy(rotations.between(kind.array(a), kind.array(b)))).apply(a)
    np.testing.assert_allclose(turned, b, atol=2 * kind.tolerance**0.5 if kind.tolerance > 1e-9 else 1e-7)


def test_twist_leaves_a_swing_across_the_axis(kind):
    q = quaternions()
    axis = np.random.default_rng(1).normal(size=(200, 3))
    axis /= np.linalg.norm(axis, axis=-1, keepdims=True)
    twist = rotations.twist_about(kind.array(q), kind.array(axis))
    np.testing.assert_allclose(
        kind.numpy(rotations.rotate(twist, kind.array(axis))), axis, atol=4 * kind.tolerance
    )
    swing = kind.numpy(rotations.multiply(kind.array(q), rotations.conjugate(twist)))
    along = (swing[:, 1:] * axis).sum(-1)
    np.testing.assert_allclose(along, 0, atol=4 * kind.tolerance)


def test_continuous_removes_sign_flips_only(kind):
    rng = np.random.default_rng(0)
    smooth = rotations.exp(np.cumsum(rng.normal(scale=0.05, size=(100, 3, 3)), axis=0))
    flipped = smooth * rng.choice([-1.0, 1.0], size=(100, 3, 1))
    fixed = kind.numpy(rotations.continuous(kind.array(flipped)))
    assert (np.sum(fixed[1:] * fixed[:-1], axis=-1) > 0).all()
    assert distance(fixed, smooth) < kind.tolerance


def test_normalize_leaves_zero(kind):
    v = kind.numpy(rotations.normalize(kind.array([[0.0, 0, 0], [0, 3, 4]])))
    np.testing.assert_allclose(v, [[0, 0, 0], [0, 0.6, 0.8]], atol=kind.tolerance)


def test_identity_follows_its_pattern(kind):
    q = rotations.identity(2, 3, like=kind.array([0.0]))
    assert tuple(q.shape) == (2, 3, 4)
    assert (kind.numpy(q) == [1, 0, 0, 0]).all()


@pytest.mark.parametrize("precision", ["float32", "float64"])
@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-5, 1e-4, 1.0, math.pi - 1e-4, math.pi])
@pytest.mark.parametrize("name", ["log", "slerp", "angle", "6d", "matrix", "exp", "twist"])
def test_gradients_are_finite(name, angle, precision):
    torch = pytest.importorskip("torch")
    dtype = getattr(torch, precision)
    vectors = [[0.0, angle, 0.0], [0.6 * angle, 0.0, 0.8 * angle]]
    vector = torch.tensor(vectors, dtype=dtype, requires_grad=True)
    q = rotations.exp(vector)
    one = torch.tensor([1.0, 0, 0, 0], dtype=dtype).expand(2, 4)
    value = {
        "exp": lambda: q,
        "log": lambda: rotations.log(q),
        "slerp": lambda: rotations.slerp(one, q, torch.tensor([0.3, 0.7], dtype=dtype)),
        "angle": lambda: rotations.angle(one, q),
        "6d": lambda: rotations.from_6d(rotations.to_6d(q)),
        "matrix": lambda: rotations.from_matrix(rotations.to_matrix(q)),
        "twist": lambda: rotations.twist_about(q, torch.tensor([0.0, 0.6, 0.8], dtype=dtype)),
    }[name]()
    weights = torch.arange(1.0, value.numel() + 1, dtype=dtype).reshape(value.shape)
    (gradient,) = torch.autograd.grad((value * weights).sum(), vector)
    assert torch.isfinite(gradient).all()


@pytest.mark.parametrize("name", ["exp", "log", "6d"])
def test_gradients_are_right(name):
    torch = pytest.importorskip("torch")
    rng = np.random.default_rng(0)
    vector = np.concatenate([rng.normal(size=(6, 3)), np.full((1, 3), 3e-5), np.full((1, 3), 2e-4)])
    vector = torch.tensor(vector, requires_grad=True)
    function = {
        "exp": rotations.exp,
        "log": lambda v: rotations.log(rotations.exp(v)),
        "6d": lambda v: rotations.from_6d(rotations.to_6d(rotations.exp(v)) * 1.3),
    }[name]
    assert torch.autograd.gradcheck(function, vector, eps=1e-7, atol=1e-6)


def test_fit_finds_the_rotation_between_vectors(kind):
    """And never a mirror image."""
    rng = np.random.default_rng(0)
    vectors = rng.normal(size=(40, 5, 3))
    q = rotations.normalize(rng.normal(size=(40, 4)))
    wanted = rotations.rotate(q[:, None], vectors)
    found = kind.numpy(rotations.fit(kind.array(vectors), kind.array(wanted)))
    assert rotations.angle(found, q).max() < 1e3 * kind.tolerance
    flat = vectors * [1.0, 1.0, 0.0]
    mirrored = rotations.fit(kind.array(flat), kind.array(flat * [1, -1, 1]))
    assert np.allclose(np.linalg.det(kind.numpy(rotations.to_matrix(mirrored))), 1, atol=1e-4)
