"""Forward kinematics, written once for NumPy and torch."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from array_api_compat import array_namespace

from interpose.geometry import rotations
from interpose.geometry.constant import Constant

Array = Any


@dataclass(frozen=True)
class _Plan:
    """How joints hang together.

    Attributes:
        levels: joints by depth, in one array each.
        above: for each level but the first the places of its parents in the level before.
        order: where each joint is when all levels stand one after the other.
        parents: of each joint; of roots, joint 0.
        roots, others: (J, 4) 1 for joints without, and with, a parent, else 0. Whole rows, as
            graphs multiply with them several times as fast as with one number each.
        ancestors: (J, J) 1 where the column is the row's joint or stands above it, else 0.
    """

    levels: tuple[Constant, ...]
    above: tuple[Constant, ...]
    order: Constant
    parents: Constant
    roots: Constant
    others: Constant
    ancestors: Constant


@lru_cache(maxsize=64)
def _plan(parents: tuple[int, ...]) -> _Plan:
    depth = [0] * len(parents)
    ancestors = np.eye(len(parents))
    for joint, parent in enumerate(parents):
        if parent >= 0:
            depth[joint] = depth[parent] + 1
            ancestors[joint] += ancestors[parent]
    levels = [[j for j, d in enumerate(depth) if d == level] for level in range(max(depth) + 1)]
    above = [[before.index(parents[j]) for j in level] for before, level in zip(levels, levels[1:])]
    roots = np.repeat((np.array(parents)[:, None] < 0).astype(float), 4, axis=1)
    return _Plan(
        levels=tuple(map(Constant, levels)),
        above=tuple(map(Constant, above)),
        order=Constant(np.argsort([j for level in levels for j in level])),
        parents=Constant(np.maximum(parents, 0)),
        roots=Constant(roots),
        others=Constant(1 - roots),
        ancestors=Constant(ancestors),
    )


def ancestors(parents: tuple[int, ...]) -> Constant:
    """A matrix (J, J): 1 where the column is the row's joint or stands above it, else 0."""
    return _plan(parents).ancestors


def global_rotations(local: Array, parents: tuple[int, ...]) -> Array:
    """Local quaternions (..., J, 4) to global ones; parents come before their children.

    All joints of the same depth are multiplied at once.
    """
    xp, plan = array_namespace(local), _plan(parents)
    done = [_take(local, plan.levels[0])]
    for level, above in zip(plan.levels[1:], plan.above):
        done.append(rotations.multiply(_take(done[-1], above), _take(local, level)))
    return _take(xp.concat(done, axis=-2), plan.order)


def local_rotations(globals_: Array, parents: tuple[int, ...]) -> Array:
    """Global quaternions (..., J, 4) back to local ones: the inverse of `global_rotations`."""
    plan = _plan(parents)
    turned = rotations.relative(_take(globals_, plan.parents), globals_)
    # Sums with masks: in graphs a choice is slow.
    return plan.roots.beside(globals_) * globals_ + plan.others.beside(globals_) * turned


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
    xp, plan = array_namespace(local), _plan(parents)
    turned = global_rotations(local, parents)
    translation = xp.broadcast_to(translation, (*local.shape[:-1], 3))
    bones = rotations.rotate(_take(turned, plan.parents), translation)
    roots, others = (mask.beside(local)[:, :3] for mask in (plan.roots, plan.others))
    bones = roots * translation + others * bones
    return turned, xp.matmul(plan.ancestors.beside(local), bones)


def _take(values: Array, joints: Constant) -> Array:
    """Some joints of (..., J, n)."""
    if isinstance(values, np.ndarray):
        return values.take(joints.values, axis=-2)  # asking whose array it is would take as long
    return array_namespace(values).take(values, joints.beside(values), axis=-2)
