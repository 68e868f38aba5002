"""What all tests share. One thread everywhere: results do not depend on the machine's cores."""

from __future__ import annotations

import os

# Read by NumPy's BLAS and by torch when they are loaded, so it stands before any import of them.
os.environ["OMP_NUM_THREADS"] = "1"

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import settings

if TYPE_CHECKING:
    from interpose.clip import Clip

# Same examples on every run; a failure on a busy machine is no failure.
settings.register_profile("interpose", derandomize=True, deadline=None, print_blob=True)
settings.load_profile("interpose")


@pytest.fixture(scope="session")
def data() -> Path:
    """The folder of test clips."""
    return Path(__file__).parent / "data"


@pytest.fixture(scope="session")
def cmu_walk(data: Path) -> Clip:
    """A walk from the CMU Graphics Lab Motion Capture Database (mocap.cs.cmu.edu). Clips are never changed
    in place, so that one serves all tests."""
    from interpose import formats

    return formats.load(data / "cmu_walk.bvh")


@pytest.fixture(scope="session")
def long_walk(cmu_walk: Clip) -> Clip:
    """The walk six times over, there and back again, so that it is continuous: 1,250 frames."""
    there = np.arange(len(cmu_walk))
    frames = np.concatenate([there, there[::-1]] * 3)
    return replace(
        cmu_walk, rotation=cmu_walk.rotation[frames], translation=cmu_walk.translation[frames], source=None
    )
