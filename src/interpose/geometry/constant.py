"""Arrays that never change, beside arrays of NumPy or torch."""

from __future__ import annotations

from typing import Any

import numpy as np
from array_api_compat import array_namespace

Array = Any


class Constant:
    """An array of numbers that goes with arrays of either library.

    It is brought to a GPU once: each copy would wait until the GPU has done all that it was told before.

    Args:
        values: the array, or what makes one.
    """

    def __init__(self, values: Any) -> None:
        self.values = np.asarray(values)
        self._whole = "" if self.values.dtype.kind == "f" else self.values.dtype.name
        self._there: dict[Any, Array] = {}

    def beside(self, like: Array) -> Array:
        """The array as one of the library and device of `like`; what is float, as precise."""
        if isinstance(like, np.ndarray):
            return self.values if self._whole else self.values.astype(like.dtype, copy=False)
        key = (like.dtype, like.device)
        if key in self._there:
            return self._there[key]
        xp = array_namespace(like)
        kind = getattr(xp, self._whole) if self._whole else like.dtype
        there = xp.asarray(self.values, dtype=kind, device=like.device)
        if like.device.type != "cpu":
            self._there[key] = there
        return there
