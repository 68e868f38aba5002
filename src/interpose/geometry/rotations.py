"""Rotations as unit quaternions (w, x, y, z), written once for NumPy and torch.

Every function takes arrays of shape (..., n) and broadcasts over the leading axes; angles are radians.
Products read like matrices: ``multiply(a, b)`` first turns by ``b``, then by ``a``.
All of them are smooth where the rotation is: at identity and at half turns gradients stay finite.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from array_api_compat import array_namespace

from interpose.geometry.bilinear import bilinear, table
from interpose.geometry.constant import Constant

Array = Any
AXES = "XYZ"

PRODUCT = table("wxyz", "wxyz", "ww-xx-yy-zz", "wx+xw+yz-zy", "wy-xz+yw+zx", "wz+xy-yx+zw")
RELATIVE = table("wxyz", "wxyz", "ww+xx+yy+zz", "wx-xw-yz+zy", "wy+xz-yw-zx", "wz-xy+yx-zw")
CROSS = table("xyz", "xyz", "yz-zy", "zx-xz", "xy-yx")
_MATRIX = [
    ["ww+xx-yy-zz", "xy+xy-wz-wz", "xz+xz+wy+wy"],
    ["xy+xy+wz+wz", "ww-xx+yy-zz", "yz+yz-wx-wx"],
    ["xz+xz-wy-wy", "yz+yz+wx+wx", "ww-xx-yy+zz"],
]
MATRIX = table("wxyz", "wxyz", *_MATRIX[0], *_MATRIX[1], *_MATRIX[2])
COLUMNS = table("wxyz", "wxyz", *(_MATRIX[row][column] for column in (0, 1) for row in range(3)))
# A matrix with the rows abc, def, ghi times a vector.
APPLY = table("abcdefghi", "xyz", "ax+by+cz", "dx+ey+fz", "gx+hy+iz")

# Four times each component of its quaternion times each other, but for the one that squares have besides.
_NUMBERS, _, _SUMS = table(
    *("abcdefghi", "o"),
    *("ao+eo+io", "ho-fo", "co-go", "do-bo"),
    *("ho-fo", "ao-eo-io", "bo+do", "co+go"),
    *("co-go", "bo+do", "eo-ao-io", "fo+ho"),
    *("do-bo", "co+go", "fo+ho", "io-ao-eo"),
)
_PRODUCTS, _OWN = _NUMBERS.values @ _SUMS.values, np.arange(16) // 4 * 5
SQUARES = Constant(np.eye(4).ravel())
# Those products, and in place of each the square that is in its row: of matrices row by row, and of matrices
# whose columns stand one after the other.
OF_ROWS = Constant(_PRODUCTS), Constant(_PRODUCTS[:, _OWN])
OF_COLUMNS = tuple(Constant(one.values.reshape(3, 3, 16).swapaxes(0, 1).reshape(9, 16)) for one in OF_ROWS)
# Sums over the rows: of the second one three times, of the third nine times, of the last one 27 times.
ROWS = Constant(np.kron([[1.0], [3.0], [9.0], [27.0]], np.eye(4)))
# The sum of the numbers of a vector, and the first of them, in place of each: in graphs vectors beside
# vectors take a third of the time of vectors beside a number each.
SUM_OF_3, SUM_OF_4 = Constant(np.ones((3, 3))), Constant(np.ones((4, 4)))
FIRST_OF_4 = Constant(np.eye(4)[:, :1] + np.zeros(4))


def identity(*shape: int, like: Array = None) -> Array:
    """The identity quaternion in an array of shape (*shape, 4), of the kind and precision of `like`."""
    if like is None:
        like = np.zeros(())
    xp = array_namespace(like)
    one = xp.zeros((*shape, 4), dtype=like.dtype, device=like.device if hasattr(like, "device") else None)
    one[..., 0] = 1.0
    return one


def normalize(q: Array) -> Array:
    """The unit vector along `q` (..., n); zero vectors stay zero."""
    xp = array_namespace(q)
    length = xp.linalg.vector_norm(q, axis=-1, keepdims=True)
    return q / xp.where(length > 0, length, 1.0)


def multiply(a: Array, b: Array) -> Array:
    """Hamilton product (..., 4): the rotation `b` followed by `a`."""
    return bilinear(a, b, PRODUCT)


def relative(a: Array, b: Array) -> Array:
    """`b` as seen from `a` (..., 4): the inverse of `a`, after `b`."""
    return bilinear(a, b, RELATIVE)


def conjugate(q: Array) -> Array:
    """The inverse of a unit quaternion (..., 4)."""
    xp = array_namespace(q)
    return xp.concat([q[..., :1], -q[..., 1:]], axis=-1)


def cross(a: Array, b: Array) -> Array:
    """Cross product of (..., 3) vectors, broadcasting."""
    return bilinear(a, b, CROSS)


def rotate(q: Array, v: Array) -> Array:
    """The vectors `v` (..., 3) turned by `q` (..., 4)."""
    return bilinear(bilinear(q, q, MATRIX), v, APPLY)


def exp(rotvec: Array) -> Array:
    """Rotation vector (..., 3), axis times angle, to quaternion (..., 4)."""
    xp = array_namespace(rotvec)
    square = xp.sum(rotvec * rotvec, axis=-1, keepdims=True)
    small = square < 1e-8
    angle = xp.sqrt(xp.where(small, xp.ones_like(square), square))
    # sin(a/2)/a: its series near zero keeps the gradient finite.
    factor = xp.where(small, 0.5 - square / 48.0, xp.sin(0.5 * angle) / angle)
    real = xp.where(small, 1.0 - square / 8.0, xp.cos(0.5 * angle))
    return xp.concat([real, factor * rotvec], axis=-1)


def log(q: Array) -> Array:
    """Quaternion (..., 4) to the shortest rotation vector (..., 3), of length at most pi."""
    xp = array_namespace(q)
    q = xp.where(q[..., :1] < 0, -q, q)
    real, imaginary = q[..., :1], q[..., 1:]
    square = xp.sum(imaginary * imaginary, axis=-1, keepdims=True)
    small = square < 1e-8
    sine = xp.sqrt(xp.where(small, xp.ones_like(square), square))
    angle = 2.0 * xp.atan2(sine, xp.where(small, xp.ones_like(real), real))
    safe_real = xp.where(small, real, xp.ones_like(real))
    series = (2.0 - 2.0 * square / (3.0 * safe_real * safe_real)) / safe_real
    return xp.where(small, series, angle / sine) * imaginary


def angle(a: Array, b: Array) -> Array:
    """The angle in radians (0 to pi) between the rotations `a` and `b` (..., 4): shape (...)."""
    xp = array_namespace(a, b)
    difference = log(relative(a, b))
    square = xp.sum(difference * difference, axis=-1)
    # At zero the root has no slope; its gradient there is taken as zero.
    same = square == 0
    return xp.where(same, square, xp.sqrt(xp.where(same, xp.ones_like(square), square)))


def alike(q: Array, other: Array) -> Array:
    """The same rotations `q` (..., 4), each with the sign that brings it nearer to the other quaternion."""
    xp = array_namespace(q, other)
    return xp.where(xp.sum(q * other, axis=-1, keepdims=True) < 0, -q, q)


def slerp(a: Array, b: Array, t: Array) -> Array:
    """From `a` to `b` (..., 4) along the short way; `t` (...) is 0 at `a` and 1 at `b`.

    Source: Shoemake, Animating Rotation with Quaternion Curves, 1985.
    """
    xp = array_namespace(a, b)
    b = alike(b, a)
    t = xp.asarray(t, dtype=a.dtype) if not hasattr(t, "dtype") else t
    return normalize(multiply(a, exp(t[..., None] * log(relative(a, b)))))


def to_matrix(q: Array) -> Array:
    """Unit quaternion (..., 4) to rotation matrix (..., 3, 3), for column vectors."""
    return array_namespace(q).reshape(bilinear(q, q, MATRIX), (*q.shape[:-1], 3, 3))


def from_matrix(m: Array) -> Array:
    """Rotation matrix (..., 3, 3) to quaternion (..., 4) with w >= 0.

    Of the four ways to write the quaternion (Shepperd 1978) all that are well conditioned are taken together.
    """
    xp = array_namespace(m)
    return xp.reshape(_from_nine(xp.reshape(m, (-1, 9)), *OF_ROWS), (*m.shape[:-2], 4))


def _from_nine(numbers: Array, products: Constant, squares: Constant) -> Array:
    """As `from_matrix`, of matrices' numbers (n, 9) in any order, and their products in that order."""
    xp = array_namespace(numbers)
    # Four times each component times each other: any row is the quaternion, times one of its components.
    every = xp.matmul(numbers, products.beside(numbers)) + SQUARES.beside(numbers)
    # The four squares are 4 together, one of them 1 at least. Rows of either sign do not cancel out, as each
    # counts for three times as much as the one before.
    good = xp.astype(xp.matmul(numbers, squares.beside(numbers)) > -0.1, numbers.dtype)
    q = xp.matmul(good * every, ROWS.beside(numbers))
    length = xp.sqrt(xp.matmul(q * q, SUM_OF_4.beside(q)))
    return q / xp.where(xp.matmul(q, FIRST_OF_4.beside(q)) < 0, -length, length)


def to_6d(q: Array) -> Array:
    """Quaternion (..., 4) to the first two columns of its matrix, one after the other (..., 6).

    Source: Zhou et al., On the Continuity of Rotation Representations in Neural Networks, 2019.
    """
    return bilinear(q, q, COLUMNS)


def from_6d(v: Array) -> Array:
    """Two columns (..., 6), made orthonormal by Gram and Schmidt, to quaternion (..., 4)."""
    xp, sums = array_namespace(v), SUM_OF_3.beside(v)

    def unit(vectors: Array) -> Array:
        square = xp.matmul(vectors * vectors, sums)
        return vectors / xp.sqrt(xp.where(square > 0, square, xp.ones_like(square)))

    columns = xp.reshape(v, (-1, 6))
    x, second = unit(columns[:, :3]), columns[:, 3:]
    y = unit(second - xp.matmul(x * second, sums) * x)
    q = _from_nine(xp.concat([x, y, cross(x, y)], axis=-1), *OF_COLUMNS)
    return xp.reshape(q, (*v.shape[:-1], 4))


def about(axis: str, angles: Array) -> Array:
    """Turns by `angles` (...) about the coordinate axis "X", "Y" or "Z": quaternions (..., 4)."""
    xp = array_namespace(angles)
    parts = [xp.cos(0.5 * angles)] + [xp.zeros_like(angles)] * 3
    parts[1 + AXES.index(axis.upper())] = xp.sin(0.5 * angles)
    return xp.stack(parts, axis=-1)


def from_euler(angles: Array, order: str) -> Array:
    """Euler angles (..., 3), listed in the order of `order`, to quaternion (..., 4).

    "ZXY" means the matrix product Rz Rx Ry (intrinsic), which is how BVH channels are read.
    """
    q = about(order[0], angles[..., 0])
    for i in range(1, len(order)):
        q = multiply(q, about(order[i], angles[..., i]))
    return q


def to_euler(q: Array, order: str) -> Array:
    """Quaternion (..., 4) to Euler angles (..., 3) in the order of `order`, each of the twelve.

    The first and last angle lie within pi, the middle one within pi/2 (or 0 to pi when the first axis
    returns as the last). In gimbal lock the last angle is zero.
    Source: Bernardes and Viollet, Quaternion to Euler angles conversion, 2022.
    """
    xp = array_namespace(q)
    # The published formula is for turns about fixed axes: the same angles, read backwards.
    i, j, k = (AXES.index(axis) for axis in reversed(order.upper()))
    proper = i == k
    if proper:
        k = 3 - i - j
    sign = float((i - j) * (j - k) * (k - i) // 2)
    w, vi, vj, vk = q[..., 0], q[..., 1 + i], q[..., 1 + j], q[..., 1 + k]
    if proper:
        a, b, c, d = w, vi, vj, vk * sign
    else:
        a, b, c, d = w - vj, vi + vk * sign, vj + w, vk * sign - vi
    middle = 2.0 * xp.atan2(xp.sqrt(c * c + d * d), xp.sqrt(a * a + b * b))
    half_sum, half_difference = xp.atan2(b, a), xp.atan2(d, c)
    at_zero, at_pi = xp.abs(middle) < 1e-7, xp.abs(middle - math.pi) < 1e-7
    zero = xp.zeros_like(middle)
    last = xp.where(at_zero | at_pi, zero, half_sum - half_difference)
    first = half_sum + half_difference
    first = xp.where(at_zero, 2.0 * half_sum, xp.where(at_pi, 2.0 * half_difference, first))
    if not proper:
        first = first * sign
        middle = middle - 0.5 * math.pi
    angles = xp.stack([first, middle, last], axis=-1)
    outer = angles - 2.0 * math.pi * xp.round(angles / (2.0 * math.pi))
    return outer


def between(a: Array, b: Array) -> Array:
    """The smallest rotation (..., 4) that turns the direction of `a` (..., 3) into that of `b`.

    Opposite directions turn about an axis at right angles; zero vectors give the identity.
    """
    xp = array_namespace(a, b)
    a, b = normalize(a), normalize(b)
    a, b = xp.broadcast_arrays(a, b)
    cosine = xp.sum(a * b, axis=-1, keepdims=True)
    q = xp.concat([1.0 + cosine, cross(a, b)], axis=-1)
    # Opposite: any axis across `a` will do; take the one away from its largest coordinate.
    x_small = xp.abs(a[..., :1]) < 0.9
    unit_x = xp.concat([xp.ones_like(cosine), xp.zeros_like(cosine), xp.zeros_like(cosine)], axis=-1)
    unit_y = xp.concat([xp.zeros_like(cosine), xp.ones_like(cosine), xp.zeros_like(cosine)], axis=-1)
    across = normalize(cross(a, xp.where(x_small, unit_x, unit_y)))
    flip = xp.concat([xp.zeros_like(cosine), across], axis=-1)
    present = xp.sum(a * a, axis=-1, keepdims=True) * xp.sum(b * b, axis=-1, keepdims=True) > 0.5
    one = xp.concat([xp.ones_like(cosine), xp.zeros_like(a)], axis=-1)
    # As long as the axis across both is more than rounding.
    clear = xp.sum(q * q, axis=-1, keepdims=True) > xp.finfo(q.dtype).eps
    q = xp.where(clear, q, flip)
    return normalize(xp.where(present, q, one))


def fit(vectors: Array, wanted: Array) -> Array:
    """The rotation (..., 4) that brings vectors (..., n, 3) nearest to `wanted` (..., n, 3).

    Source: Kabsch, A solution for the best rotation to relate two sets of vectors, 1976.
    """
    xp = array_namespace(vectors, wanted)
    matrix = xp.matmul(xp.moveaxis(wanted, -1, -2), vectors)
    u, _, vt = xp.linalg.svd(matrix)
    # A mirror image fits as well: the weakest direction turns round.
    sign = xp.linalg.det(xp.matmul(u, vt))[..., None]
    u = xp.concat([u[..., :2], u[..., 2:] * sign[..., None]], axis=-1)
    return from_matrix(xp.matmul(u, vt))


def twist_about(q: Array, axis: Array) -> Array:
    """The part of `q` (..., 4) that turns about the unit vectors `axis` (..., 3).

    ``q == multiply(swing, twist)``, where the swing moves `axis` the short way.
    """
    xp = array_namespace(q, axis)
    along = xp.sum(q[..., 1:] * axis, axis=-1, keepdims=True)
    twist = xp.concat([q[..., :1], along * axis], axis=-1)
    length = xp.sum(twist * twist, axis=-1, keepdims=True)
    one = xp.concat([xp.ones_like(along), xp.zeros_like(twist[..., 1:])], axis=-1)
    return normalize(xp.where(length > 1e-12, twist, one))


def continuous(q: Array) -> Array:
    """The same rotations (frames, ..., 4) with signs chosen so that neighbouring frames do not flip."""
    xp = array_namespace(q)
    dots = xp.sum(q[1:] * q[:-1], axis=-1)
    steps = xp.where(dots < 0, -xp.ones_like(dots), xp.ones_like(dots))
    signs = xp.cumulative_prod(steps, axis=0) if hasattr(xp, "cumulative_prod") else xp.cumprod(steps, 0)
    return xp.concat([q[:1], q[1:] * signs[..., None]], axis=0)
