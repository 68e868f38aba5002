"""T-poses of widespread rigs whose zero pose is none, so that not every clip has to tell them anew.

`examples/tposes.py` works them out from many clips of several people and writes the file.
"""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from interpose.clip import Skeleton
from interpose.geometry import kinematics, rotations
from interpose.skeletons.mapping import Mapping

RIGS = Path(__file__).with_name("rigs.json")
AGAIN = "#"  # before the number of a name that occurs once more in a file
LEAST = 0.01  # metres: bones that are shorter have no direction
LIKE = 0.98  # the cosine by which bones of a zero pose may point elsewhere


@cache
def _rigs() -> list[dict[str, Any]]:
    return json.loads(RIGS.read_text())


def directions(skeleton: Skeleton) -> np.ndarray:
    """(J, 3) where bones point in the zero pose; 0 for those that have no length, and for the only one below
    a root, which says where the body stands."""
    bones = skeleton.rest_translation * skeleton.scale_above[:, None]
    _, placed = kinematics.forward(skeleton.rest_rotation, bones, skeleton.parents)
    above = [max(parent, 0) for parent in skeleton.parents]
    away = placed - placed[above]
    for root in skeleton.roots:
        if len(skeleton.children[root]) == 1:
            away[skeleton.children[root][0]] = 0.0
    length = np.linalg.norm(away, axis=1, keepdims=True)
    return np.where(length > LEAST, away / np.maximum(length, LEAST), 0.0)


def known_rest(mapping: Mapping) -> tuple[str, np.ndarray] | None:
    """The name and the T-pose (22, 4) of the rig that a mapped skeleton is, or None for all others.

    Names, what hangs from what, and the zero pose must be those of the rig. A namespace before the names or
    what else all begin with, the number of a second body that has the same ones, joints above the hips, and
    those beside the body (a prop, a tail) make it no other rig.
    """
    skeleton, found = mapping.skeleton, mapping.mapped[1]
    called = [skeleton.names[joint].rpartition(":")[2].partition(AGAIN)[0] for joint in found]
    begin = next((at for at, letters in enumerate(zip(*called)) if len({*letters}) > 1), 0)
    return _known(mapping, dict(zip(called, found))) or (
        _known(mapping, dict(zip([name[begin:] for name in called], found))) if begin else None
    )


def _known(mapping: Mapping, joints: dict[str, int]) -> tuple[str, np.ndarray] | None:
    skeleton = mapping.skeleton
    for rig in _rigs():
        its = {name: np.array(way) for name, way in zip(rig["names"], rig["directions"])}
        bones = [name for name, way in its.items() if way.any()]
        if not set(bones) <= joints.keys() <= its.keys():
            continue
        at = [joints[name] for name in bones]
        own = directions(skeleton)[at]
        hangs = all(skeleton.parents[joint] in joints.values() for joint in at)
        alike = (own * [its[name] for name in bones]).sum(axis=1) > LIKE
        if hangs and alike[own.any(axis=1)].all() and own.any():
            return rig["rig"], rotations.normalize(np.array(rig["rotation"]))
    return None
