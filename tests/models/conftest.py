"""A real walk, as the networks that speak positions see it."""

from __future__ import annotations

import pytest

from interpose.skeletons import find_humanoid


@pytest.fixture(scope="module")
def walk(cmu_walk):  # type: ignore[no-untyped-def]
    """(1, T, 22, 3) canonical positions of a real walk at 30 fps."""
    torch = pytest.importorskip("torch")
    body = find_humanoid(cmu_walk)
    positions = body.positions(cmu_walk) * body.scale
    return torch.tensor(positions[None, :128], dtype=torch.float64)


@pytest.fixture(scope="module")
def gap(walk):  # type: ignore[no-untyped-def]
    torch = pytest.importorskip("torch")
    observed = torch.ones(walk.shape[:-1], dtype=torch.bool)
    observed[:, 50:80] = False
    return observed
