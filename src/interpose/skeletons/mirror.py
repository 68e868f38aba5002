"""The mirror image of a motion: left becomes right."""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from interpose.clip import Clip, Skeleton
from interpose.errors import RequestError
from interpose.geometry import rotations
from interpose.skeletons.canonical import SIDES
from interpose.skeletons.mapping import find_mapping

# How far a bone may be from the mirror image of its counterpart: share of its length, and metres.
TOLERANCE, LEAST = 0.25, 0.02


def _counterpart(name: str) -> list[str]:
    """What the same joint of the other side may be called."""
    swaps = {"left": "right", "Left": "Right", "LEFT": "RIGHT", "L": "R", "l": "r"}
    swaps |= {right: left for left, right in swaps.items()}
    found = [
        name[: hit.start()] + swaps[hit.group()] + name[hit.end() :]
        for hit in re.finditer(r"left|Left|LEFT|right|Right|RIGHT", name)
    ]
    # One letter: at the beginning, or set off by punctuation at either end (LThumb, lfemur, thigh.l, l_hand).
    for hit in re.finditer(r"^[LlRr](?=[A-Za-z_])|(?<=[_.\-: ])[LlRr](?=$|[_.\- ])", name):
        found.append(name[: hit.start()] + swaps[hit.group()] + name[hit.end() :])
    return found


def mirrored(labels: Sequence[str]) -> list[int]:
    """For each action label that of the mirror image, by index, left for right; 0 where there is none."""

    def swap(label: str) -> str:
        return re.sub("left|right", lambda side: "right" if side[0] == "left" else "left", label)

    return [labels.index(swap(label)) if swap(label) in labels else 0 for label in labels]


def counterparts(skeleton: Skeleton) -> tuple[int, ...]:
    """For each joint the index of what seems its mirror image, itself where there is none, as in the middle.

    By the canonical joints, and for all others by left and right in their names. Nothing is checked: of two
    joints one may be the other's, and not the other way round.
    """
    place = {name: joint for joint, name in enumerate(skeleton.names)}
    swapped = list(range(len(skeleton)))
    for joint, name in enumerate(skeleton.names):
        swapped[joint] = next((place[other] for other in _counterpart(name) if other in place), joint)
    found = find_mapping(skeleton).joints
    for one, other in enumerate(SIDES):
        left, right = found[one], found[other]
        if left is not None and right is not None:
            swapped[left] = right
    return tuple(swapped)


def sides(skeleton: Skeleton) -> tuple[int, ...]:
    """For each joint the index of its mirror image, itself for those in the middle.

    They are the `counterparts`. Raises RequestError when the two sides do not have the same joints.
    """
    swapped = counterparts(skeleton)
    for joint, other in enumerate(swapped):
        parent = skeleton.parents[joint]
        expected = swapped[parent] if parent >= 0 else -1
        if swapped[other] != joint or skeleton.parents[other] != expected:
            raise RequestError(
                "the skeleton has no mirror image",
                f"{skeleton.names[joint]} and {skeleton.names[other]} do not hang from the same place",
                "Mirroring needs the same joints on the left and on the right.",
            )
    return swapped


@lru_cache(maxsize=64)
def _plan(skeleton: Skeleton) -> tuple[tuple[int, ...], int]:
    """The sides, and the local axis (0, 1, 2) whose reflection takes each bone to its counterpart's."""
    swapped = sides(skeleton)
    bones = skeleton.rest_translation
    limits = np.maximum(LEAST, TOLERANCE * np.linalg.norm(bones, axis=-1))
    below = np.array([parent >= 0 for parent in skeleton.parents])
    misses = []
    for axis in range(3):
        signs = np.where(np.arange(3) == axis, -1.0, 1.0)
        away = np.linalg.norm(bones[list(swapped)] - signs * bones, axis=-1)
        # The rest rotations (where a format has them) must be mirror images in the same way.
        image = _reflect(skeleton.rest_rotation, axis)
        turned = rotations.angle(skeleton.rest_rotation[list(swapped)], image)
        misses.append(np.where(below, np.maximum(away / limits, turned / TOLERANCE), 0.0))
    worst = [float(miss.max(initial=0.0)) for miss in misses]
    axis = int(np.argmin(worst))
    if worst[axis] > 1.0:
        joint = int(np.argmax(misses[axis]))
        raise RequestError(
            "the skeleton cannot be mirrored",
            f"its local axes are not symmetric: {skeleton.names[joint]} is not where the mirror image of "
            f"{skeleton.names[swapped[joint]]} would be",
            "Mirroring needs a rig whose left and right joints have mirrored axes.",
        )
    return swapped, axis


def _reflect(q: np.ndarray, axis: int) -> np.ndarray:
    """R q R for the reflection R along `axis`: the turn about that axis stays, the others change sign."""
    signs = -np.ones(4)
    signs[[0, 1 + axis]] = 1.0
    return q * signs


def mirror(clip: Clip) -> Clip:
    """The clip seen in a mirror standing in the plane X = 0: what the left arm did the right arm does.

    Joint positions are the mirrored, side-swapped positions, up to differences between the actor's left and
    right bones: those stay where they are. Mirroring twice gives the same motion back.

    With M the reflection of the world and R that of a local axis, the mirror image of a global rotation G is
    M G R, and of a local one R L R; so there must be one local axis whose reflection maps the bones of one
    side onto those of the other. RequestError when there is none, or when the sides have different joints.
    """
    skeleton = clip.skeleton
    swapped, axis = _plan(skeleton)
    rotation = _reflect(clip.rotation, axis)
    roots = list(skeleton.roots)
    rotation[:, roots] = _reflect(clip.rotation[:, roots], 0)
    if axis != 0:
        # M and R differ by half a turn about the third axis.
        half = np.zeros(4)
        half[1 + 3 - axis] = 1.0
        rotation[:, roots] = rotations.multiply(rotation[:, roots], half)
    if {swapped[joint] for joint in clip.translated} != set(clip.translated):
        raise RequestError(
            "the clip cannot be mirrored",
            "joints of one side have animated positions, and those of the other have none",
            "Write positions of both, or of neither.",
        )
    flipped = np.where(np.isin(clip.translated, roots)[:, None] & [True, False, False], -1.0, 1.0)
    flipped[~np.isin(clip.translated, roots), axis] = -1.0
    translation = clip.translation * flipped
    columns = [clip.translated.index(swapped[joint]) for joint in clip.translated]
    return clip.with_motion(rotation[:, list(swapped)], translation[:, columns])
