"""LAFAN1's layout on small files."""

from __future__ import annotations

import numpy as np
import pytest

from interpose import formats
from interpose.clip import Clip, Skeleton
from interpose.geometry import kinematics, rotations
from interpose.skeletons import BONES, JOINTS, PARENTS, find_humanoid

# The axes of LAFAN1's joints in the T-pose: X up, Y ahead, Z to the left.
AXES = rotations.from_matrix(np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]]))


@pytest.fixture(scope="module")
def sequence(cmu_walk):  # type: ignore[no-untyped-def]
    """A real walk on a skeleton with LAFAN1's joints and axes, there and back again."""
    turned = rotations.multiply(find_humanoid(cmu_walk).rotations(cmu_walk), AXES)
    bones = rotations.rotate(rotations.conjugate(AXES), BONES)
    order = np.concatenate([np.arange(209), np.arange(209)[::-1]])
    local = kinematics.local_rotations(turned, PARENTS)[order]
    skeleton = Skeleton(JOINTS, PARENTS, bones)
    return Clip(skeleton, local, cmu_walk.root[order, None], 30.0, name="walk1_subject4")


@pytest.fixture(scope="module")
def published(sequence, tmp_path_factory):  # type: ignore[no-untyped-def]
    """The published layout: subjects 1, 4 and 5 with a sequence each, and a cut that only trains."""
    folder = tmp_path_factory.mktemp("data")
    for name in ("bvh/walk1_subject1", "bvh/run1_subject4", "bvh/jumps1_subject5", "cuts/fight1_subject2_a"):
        path = folder / "lafan1" / f"{name}.bvh"
        path.parent.mkdir(parents=True, exist_ok=True)
        formats.save(sequence, path)
    return folder
