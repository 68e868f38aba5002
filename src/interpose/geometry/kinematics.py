"""Forward kinematics, written once for NumPy and torch."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from array_api_compat import array_namespace

from interpose.geometry import rotations

Array = Any


@lru_cache(maxsize=64)
def _plan(parents: tuple[int, ...]) -> tuple[tuple[tuple[int, ...], ...], np.ndarray]:
    """Joints by depth, and the matrix (J, J) that is 1 where the column is the row or an ancestor of it."""
    depth = [0] * len(parents)
    ancestors = np.eye(len(parents))
    for joint, parent in enumerate(parents):
        if parent >= 0:
            depth[joint] = depth[parent] + 1
            ancestors[joint] += ancestors[parent]
    levels = tuple(tuple(j for j, d in enumerate(depth) if d == level) for level in range(max(depth) + 1))
    return levels, ancestors


def _constant(xp: Any, values: Any, like: Array, dtype: Any = None) -> Array:
    """`values` as an array beside `like` (same library, same device)."""
    device = like.device if not isinstance(like, np.ndarray) else None
    return xp.asarray(values, dtype=dtype, device=device)


def global_rotations(local: Array, parents: tuple[int, ...]) -> Array:
    """Local quaternions (..., J, 4) to global ones; parents come before their children.

    All joints of the same depth are multiplied at once.
    """
    xp = array_namespace(local)
    levels, _ = _plan(parents)
    done = [local[..., list(levels[0]), :]]
    place = {joint: i for i, joint in enumerate(levels[0])}
    for before, level in zip(levels, levels[1:]):
        above = done[-1][..., [before.index(parents[j]) for j in level], :]
        done.append(rotations.multiply(above, local[..., list(level), :]))
    order = [j for level in levels for j in level]
    place = {joint: i for i, joint in enumerate(order)}
    return xp.concat(done, axis=-2)[..., [place[j] for j in range(len(parents))], :]


def local_rotations(globals_: Array, parents: tuple[int, ...]) -> Array:
    """Global quaternions (..., J, 4) back to local ones: the inverse of `global_rotations`."""
    xp = array_namespace(globals_)
    above = globals_[..., [max(p, 0) for p in parents], :]
    roots = _constant(xp, [p < 0 for p in parents], globals_)[..., None]
    return xp.where(roots, globals_, rotations.multiply(rotations.conjugate(above), globals_))


def forward(local: Array, translation: Array, parents: tuple[int, ...]) -> tuple[Array, Array]:
    """Forward kinematics.

    Args:
        local: local quaternions (..., J, 4).
        translation: local translations (..., J, 3) or (J, 3); a root's is its global position.
        parents: index of each joint's parent, -1 for roots, parents first.

    Returns:
        Global quaternions (..., J, 4) and global positions (..., J, 3). Positions are one product of
        the ancestor matrix with all bone vectors instead of a chain of small ones.
    """
    xp = array_namespace(local)
    _, ancestors = _plan(parents)
    turned = global_rotations(local, parents)
    above = turned[..., [max(p, 0) for p in parents], :]
    roots = _constant(xp, [p < 0 for p in parents], local)[..., None]
    translation = xp.broadcast_to(translation, (*local.shape[:-1], 3))
    bones = xp.where(roots, translation, rotations.rotate(above, translation))
    return turned, xp.matmul(_constant(xp, ancestors, local, local.dtype), bones)
