"""The ground plane (Y up): headings and turns about the vertical."""

from __future__ import annotations

import math
from typing import Any

from array_api_compat import array_namespace

from interpose.geometry.constant import Constant

Array = Any
FLOOR = Constant([1.0, 0.0, 1.0])  # what of a place is on the floor
UP = Constant([0.0, 1.0, 0.0])


def wrap(angles: Array) -> Array:
    """Angles brought into -pi to pi."""
    xp = array_namespace(angles)
    return angles - 2.0 * math.pi * xp.round(angles / (2.0 * math.pi))


def turn(vectors: Array, yaw: Array) -> Array:
    """Vectors (..., 3) turned about Y by `yaw` (...) radians; positive from Z towards X."""
    xp = array_namespace(vectors, yaw)
    x, y, z = _parts(vectors)
    cosine, sine = xp.cos(yaw), xp.sin(yaw)
    return xp.stack([cosine * x + sine * z, y, cosine * z - sine * x], axis=-1)


def _parts(values: Array) -> tuple[Array, ...]:
    """Arrays (..., n) taken apart along the last axis, all at once.

    In torch the gradient of one that is picked alone is an array of zeros with that one in it.
    """
    if hasattr(values, "unbind"):  # torch's own takes no detour over the first axis
        return tuple(values.unbind(-1))
    return tuple(array_namespace(values).unstack(values, axis=-1))
