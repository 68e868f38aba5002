"""Euler angles of files: many joints at once, joints with fewer than three, and curves without jumps."""

from __future__ import annotations

import numpy as np

from interpose.geometry import rotations


def joint_order(channels: list[str]) -> str:
    """A rotation order such as "ZXY" from some of its axes: those without a channel stand last."""
    return "".join(channels + [axis for axis in rotations.AXES if axis not in channels])


def decode(values: np.ndarray, orders: tuple[str, ...], columns: np.ndarray) -> np.ndarray:
    """(n, C) numbers, in which angles are degrees, to rotations (n, J, 4).

    All joints in one batch, whatever their order: the product of three turns about coordinate axes in
    closed form (the same as rotations.from_euler, and a test says so).

    Args:
        values: the numbers of the frames.
        orders: per joint its rotation order; "ZXY" is the product Rz Rx Ry.
        columns: (J, 3) column of each angle in that order, -1 where there is none and it is zero.
    """
    frames, joints = len(values), len(orders)
    padded = np.concatenate([values, np.zeros((frames, 1))], axis=1)
    half = np.take(padded, columns.T.ravel(), axis=1).reshape(frames, 3, joints)
    half *= np.pi / 360.0
    (c1, c2, c3), (s1, s2, s3) = np.moveaxis(np.cos(half), 1, 0), np.moveaxis(np.sin(half), 1, 0)
    axes = np.array([[rotations.AXES.index(axis) for axis in order] for order in orders]).T
    cyclic = np.array([_cyclic(order) for order in orders])
    c12, s12, s1c2, c1s2 = c1 * c2, cyclic * (s1 * s2), s1 * c2, cyclic * (c1 * s2)
    parts = s1c2 * c3 + c1s2 * s3, cyclic * (c1s2 * c3 - s1c2 * s3), s12 * c3 + c12 * s3
    quaternion = np.empty((frames, 4 * joints))
    quaternion[:, ::4] = c12 * c3 - s12 * s3
    column = 4 * np.arange(joints) + 1
    for axis, part in zip(axes, parts):
        quaternion[:, column + axis] = part
    return quaternion.reshape(frames, joints, 4)


def _cyclic(order: str) -> float:
    """1 for XYZ, YZX and ZXY, else -1."""
    return 1.0 if order in "XYZXY" else -1.0


def nearest(q: np.ndarray, order: str, count: int) -> tuple[np.ndarray, np.ndarray]:
    """The angles of a joint that has only the first `count` of the axes of `order`.

    Of all rotations that these axes can make, the one at the smallest angle from `q` (..., 4) is taken, in
    closed form: its quaternion has the largest product with q. For two axes that product is a bilinear form
    of the sines and cosines of the half angles, largest where their sum and difference separate.

    Returns:
        Degrees (..., 3), zero where there is no axis; and how far the rotation lies from q, degrees (...).
    """
    if count == 3:
        return np.degrees(rotations.to_euler(q, order)), np.zeros(q.shape[:-1])
    w, (a, b, c) = q[..., 0], (q[..., 1 + rotations.AXES.index(axis)] for axis in order)
    angles = np.zeros((*q.shape[:-1], 3))
    if count == 2:
        c = _cyclic(order) * c
        add = np.arctan2(a + b, w - c)
        subtract = np.arctan2(a - b, w + c)
        angles[..., 0], angles[..., 1] = add + subtract, add - subtract
        alike = 0.5 * (np.hypot(a + b, w - c) + np.hypot(a - b, w + c))
    elif count == 1:
        angles[..., 0] = 2.0 * np.arctan2(a, w)
        alike = np.hypot(a, w)
    else:
        alike = np.abs(w)
    return np.degrees(angles), np.degrees(2.0 * np.arccos(np.minimum(alike, 1.0)))


def put(
    values: np.ndarray,
    fresh: np.ndarray,
    rotation: np.ndarray,
    turned: np.ndarray,
    previous: np.ndarray,
    orders: tuple[str, ...],
    columns: np.ndarray,
) -> np.ndarray:
    """Put the Euler angles of the turned joints into `values`, without jumps from frame to frame.

    Of the two triples that mean the same rotation, and of their full turns, the nearest to the frame before
    is taken.

    Args:
        values, fresh: (n, C) numbers, degrees where they are angles, and whether they changed: written to.
        rotation: (n, J, 4) the rotations that the angles stand for.
        turned: (n, J) whether a joint's rotation changed.
        previous: (C,) the numbers of the frame before the first.
        orders, columns: as in `decode`.

    Returns:
        (J,) degrees: the most that is lost of a joint's rotation because it has no three angles.
    """
    lost = np.zeros(len(orders))
    joints = np.flatnonzero(turned.any(axis=0))
    frames = np.flatnonzero(turned.any(axis=1))
    if not len(joints):
        return lost
    columns = columns[joints]
    here = columns >= 0
    counts = here.sum(axis=1)
    exact = np.empty((len(frames), len(joints), 3))
    far = np.empty(exact.shape[:2])
    kinds = [(orders[joint], int(count)) for joint, count in zip(joints, counts)]
    for kind in set(kinds):
        same = [i for i, other in enumerate(kinds) if other == kind]
        exact[:, same], far[:, same] = nearest(rotation[np.ix_(frames, joints[same])], *kind)
    changed = turned[np.ix_(frames, joints)]
    lost[joints] = np.where(changed, far, 0.0).max(axis=0)

    # Angles without a channel must stay zero: they weigh more than any jump.
    weight = np.where(here, 1.0, 1e4)
    mirrored = exact * [1.0, -1.0, 1.0] + 180.0
    # In gimbal lock only the sum or difference of the outer angles counts: the last one stays as it was.
    locked = (np.abs(np.abs(exact[..., 1]) - 90.0) < 1e-4) & (counts == 3)
    cyclic = np.array([_cyclic(orders[joint]) for joint in joints])
    locks = np.sign(exact[..., 1]) * cyclic * locked
    for i, (row, one, two, lock) in enumerate(zip(frames.tolist(), exact, mirrored, locks)):
        before = np.where(here, (values[row - 1] if row else previous)[columns], 0.0)
        if lock.any():
            shift = (before[:, 2] - one[:, 2]) * np.abs(lock)
            one = one + np.stack([-lock * shift, 0.0 * shift, shift], axis=1)
        one = one + 360.0 * np.round((before - one) / 360.0)
        two = two + 360.0 * np.round((before - two) / 360.0)
        nearer = (np.abs(two - before) * weight).sum(axis=1) < (np.abs(one - before) * weight).sum(axis=1)
        chosen = np.where(nearer[:, None], two, one)
        write = changed[i][:, None] & here
        values[row, columns[write]] = chosen[write]
        fresh[row, columns[write]] = True
    return lost
