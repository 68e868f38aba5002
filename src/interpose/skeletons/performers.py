"""Several bodies in one file."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np

from interpose.clip import Clip, Skeleton
from interpose.skeletons.mapping import HOW, find_mapping

BODY = 10  # joints: what hangs together and has fewer is a prop
Joints = tuple[int, ...]


@lru_cache(maxsize=64)
def performers(skeleton: Skeleton) -> tuple[Joints, ...]:
    """The joints of each humanoid of a skeleton with several roots, the one that is looked at first; props go
    with that one. Nothing where there is one humanoid, or none."""
    mapping = find_mapping(skeleton)
    if len(skeleton.roots) < 2 or not mapping.usable:
        return ()
    mine = {(joint, *skeleton.ancestors(joint))[-1] for joint in mapping.mapped[1]}
    others = []
    for root in skeleton.roots:
        joints = tuple(np.flatnonzero(skeleton.below[:, root]).tolist())
        if root not in mine and len(joints) >= BODY:
            other = find_mapping(by_itself(skeleton, joints))
            # What has only the shape of one, beside somebody with names, may be his horse.
            if other.usable and HOW.index(other.surely) <= HOW.index(mapping.surely):
                others.append(joints)
    taken = {joint for joints in others for joint in joints}
    first = tuple(joint for joint in range(len(skeleton)) if joint not in taken)
    return (first, *others) if others else ()


@lru_cache(maxsize=64)
def by_itself(skeleton: Skeleton, joints: Joints) -> Skeleton:
    """A skeleton of some joints, with all that they hang from among them."""
    rows, names = list(joints), {skeleton.names[joint] for joint in joints}
    return Skeleton(
        tuple(skeleton.names[joint] for joint in rows),
        tuple(-1 if (above := skeleton.parents[joint]) < 0 else rows.index(above) for joint in rows),
        skeleton.rest_translation[rows],
        skeleton.rest_rotation[rows],
        skeleton.rest_scale[rows],
        {role: name for role, name in skeleton.roles.items() if not name or role == "hand" or name in names},
    )


def columns(clip: Clip, joints: Joints) -> list[int]:
    """Which translations of a clip are those of some joints."""
    return [column for column, joint in enumerate(clip.translated) if joint in joints]


def clip_of(clip: Clip, joints: Joints) -> Clip:
    """The motion of some joints by itself."""
    own = columns(clip, joints)
    return replace(
        clip,
        skeleton=by_itself(clip.skeleton, joints),
        rotation=clip.rotation[:, list(joints)],
        translation=clip.translation[:, own],
        translated=tuple(joints.index(clip.translated[column]) for column in own),
        source=None,
    )


def with_clips(clip: Clip, parts: dict[Joints, Clip]) -> Clip:
    """A clip with the motion of some joints, by these, as in clips of them by themselves."""
    rotation, translation = clip.rotation.copy(), clip.translation.copy()
    for joints, part in parts.items():
        rotation[:, list(joints)] = part.rotation
        translation[:, columns(clip, joints)] = part.translation
    return clip.with_motion(rotation, translation)


def meant(skeleton: Skeleton) -> tuple[Joints, ...]:
    """The joints of each body of several, or of the one that somebody has said is meant (`roles["root"]`);
    nothing where there is one."""
    several = performers(skeleton)
    return several[:1] if "root" in skeleton.roles else several
