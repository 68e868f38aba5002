"""Values of a motion, whichever they are: rotations (..., 4), or places and other vectors (..., 3)."""

from __future__ import annotations

from typing import Any

from array_api_compat import array_namespace

from interpose.geometry import rotations

Array = Any


def offset(a: Array, b: Array) -> Array:
    """What leads from `a` to `b`: their difference, or rotation vectors in the axes of `a` (..., 3)."""
    return b - a if a.shape[-1] == 3 else rotations.log(rotations.relative(a, b))


def moved(a: Array, way: Array) -> Array:
    """Where `way` (..., 3) leads from `a`: the inverse of `offset`."""
    return a + way if a.shape[-1] == 3 else rotations.multiply(a, rotations.exp(way))


def wide(numbers: Array, size: int) -> Array:
    """Each of some numbers (...) as a vector (..., size) of it: to stand beside vectors. In graphs that, as a
    product, and vectors beside vectors take half of the time of vectors beside a number each."""
    xp = array_namespace(numbers)
    return xp.matmul(numbers[..., None], xp.ones((1, size), dtype=numbers.dtype, device=numbers.device))
