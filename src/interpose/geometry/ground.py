"""The ground plane (Y up): headings and turns about the vertical."""

from __future__ import annotations

import math
from typing import Any

from array_api_compat import array_namespace

from interpose.geometry.rotations import parts

Array = Any


def wrap(angles: Array) -> Array:
    """Angles brought into -pi to pi."""
    xp = array_namespace(angles)
    return angles - 2.0 * math.pi * xp.round(angles / (2.0 * math.pi))


def turn(vectors: Array, yaw: Array) -> Array:
    """Vectors (..., 3) turned about Y by `yaw` (...) radians; positive from Z towards X."""
    xp = array_namespace(vectors, yaw)
    x, y, z = parts(vectors)
    cosine, sine = xp.cos(yaw), xp.sin(yaw)
    return xp.stack([cosine * x + sine * z, y, cosine * z - sine * x], axis=-1)
