"""Values of a motion, whichever they are: rotations (..., 4), or places and other vectors (..., 3)."""

from __future__ import annotations

from typing import Any

from interpose.geometry import rotations

Array = Any


def offset(a: Array, b: Array) -> Array:
    """What leads from `a` to `b`: their difference, or rotation vectors in the axes of `a` (..., 3)."""
    return b - a if a.shape[-1] == 3 else rotations.log(rotations.relative(a, b))


def moved(a: Array, way: Array) -> Array:
    """Where `way` (..., 3) leads from `a`: the inverse of `offset`."""
    return a + way if a.shape[-1] == 3 else rotations.multiply(a, rotations.exp(way))
