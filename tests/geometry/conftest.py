"""Both array libraries in both precisions; torch where it is installed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest


@dataclass(frozen=True)
class Kind:
    """One array library in one precision."""

    array: Callable[[Any], Any]
    tolerance: float
    dtype: Any

    def numpy(self, values: Any) -> np.ndarray:
        assert values.dtype == self.dtype, "the precision must not change on the way"
        return np.asarray(values, dtype=float)


@pytest.fixture(params=["numpy-float32", "numpy-float64", "torch-float32", "torch-float64"])
def kind(request: pytest.FixtureRequest) -> Kind:
    library, precision = request.param.split("-")
    tolerance = 3e-6 if precision == "float32" else 1e-12
    if library == "torch":
        torch = pytest.importorskip("torch")
        dtype = getattr(torch, precision)
        return Kind(lambda values: torch.asarray(np.asarray(values), dtype=dtype), tolerance, dtype)
    return Kind(lambda values: np.asarray(values, dtype=precision), tolerance, np.dtype(precision))
