"""A real walk, packed for training."""

from __future__ import annotations

import numpy as np
import pytest

from interpose.datasets import Pack
from interpose.datasets.pack import STEP
from interpose.geometry import rotations
from interpose.skeletons import find_humanoid


@pytest.fixture(scope="session")
def walk_pack(cmu_walk):  # type: ignore[no-untyped-def]
    """Packs of that walk, by the name of the data set that they pretend to be: its first half trains, its
    second half validates; or all of it does both."""
    body = find_humanoid(cmu_walk)
    rotation = np.rint(rotations.log(body.rotations(cmu_walk)) / STEP).astype(np.int16)
    root, count = (body.root(cmu_walk) * body.scale).astype(np.float32), len(cmu_walk)

    def make(dataset: str, both: bool = False) -> Pack:
        times = 1 + both
        return Pack(
            dataset,
            np.tile(rotation, (times, 1, 1)),
            np.tile(root, (times, 1)),
            np.tile(body.bones * body.scale, (2, 1, 1)).astype(np.float32),
            np.tile(body.body, (2, 1, 1)).astype(np.float32),
            np.array([0, times * count // 2, times * count]),
            np.array(["a", "b"]),
            np.array(["02", "08"]),
            np.array(["walk", "walk"]),
            np.array(["train", "validation"]),
        )

    return make
