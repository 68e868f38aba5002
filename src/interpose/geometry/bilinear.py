"""Sums of products of the components of two vectors, written once for NumPy and torch.

Products of quaternions, their matrices and cross products are all of this kind. Three products with constant
matrices and one of elements do what written out is forty operations, in which small networks would spend half
of their time. They lose digits under autocast: networks leave it for their geometry.
"""

from __future__ import annotations

import re
from typing import Any

import numpy as np
from array_api_compat import array_namespace

from interpose.geometry.constant import Constant

Array = Any
Table = tuple[Constant, Constant, Constant]
ROWS = 4096


def table(a: str, b: str, *sums: str) -> Table:
    """Sums of products as matrices for `bilinear`.

    Each letter of `a` and of `b` names a component of the first and of the second vector: "xy-yx" is the
    first one's x times the second one's y, minus the opposite.
    """
    pairs = sorted({pair for terms in sums for pair in re.findall(r"\w\w", terms)})
    left, right = np.zeros((len(a), len(pairs))), np.zeros((len(b), len(pairs)))
    out = np.zeros((len(pairs), len(sums)))
    for row, pair in enumerate(pairs):
        left[a.index(pair[0]), row] = right[b.index(pair[1]), row] = 1.0
    for column, terms in enumerate(sums):
        for sign, pair in re.findall(r"([+-]?)(\w\w)", terms):
            out[pairs.index(pair), column] += -1.0 if sign == "-" else 1.0
    return Constant(left), Constant(right), Constant(out)


def bilinear(a: Array, b: Array, sums: Table) -> Array:
    """Sums of products (..., k) of vectors (..., n) and (..., m), which broadcast."""
    left, right, out = (matrix.beside(a) for matrix in sums)
    if not isinstance(a, np.ndarray):
        xp = array_namespace(a, b)
        return xp.matmul(xp.matmul(a, left) * xp.matmul(b, right), out)
    # Products are wider than vectors: long clips are gone through in pieces that fit the cache.
    shape = a.shape[:-1]
    if b.shape[:-1] != shape:
        shape = np.broadcast_shapes(shape, b.shape[:-1])
        a, b = (np.broadcast_to(one, (*shape, one.shape[-1])) for one in (a, b))
    a, b = a.reshape(-1, a.shape[-1]), b.reshape(-1, b.shape[-1])
    if len(a) <= ROWS:
        return (((a @ left) * (b @ right)) @ out).reshape(*shape, out.shape[1])
    done = np.empty((len(a), out.shape[1]), np.result_type(a, b))
    for start in range(0, len(a), ROWS):
        part = slice(start, start + ROWS)
        done[part] = ((a[part] @ left) * (b[part] @ right)) @ out
    return done.reshape(*shape, out.shape[1])
