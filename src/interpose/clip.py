"""What a clip is: a skeleton and its motion. No file format and no network in here.

Units and axes: metres, Y up, right-handed; unit quaternions (w, x, y, z); frames are 0-based.
"""

from __future__ import annotations

import operator
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Protocol, SupportsIndex

import numpy as np

from interpose.errors import MotionError, RequestError, unfit, unknown
from interpose.geometry import kinematics
from interpose.geometry.time import check_rate

Frames = slice | Sequence[int] | np.ndarray  # what picks some frames: numbers, or whether each is meant


class Source(Protocol):
    """What a file has and a clip does not: its layout, and the text of its numbers. It goes along with a clip
    that is cut, or joined with others, for writing."""

    def take(self, frames: np.ndarray) -> Source:
        """Of some of the clip's frames, in that order; -1 is none of them."""

    def along(self, parts: Sequence[tuple[Source | None, int]]) -> Source:
        """Of parts one after another, each so many frames long: the numbers of this file's own are kept."""


@dataclass(frozen=True, eq=False)
class Skeleton:
    """A tree of joints with its rest transforms; parents come before their children.

    Attributes:
        names: unique joint names.
        parents: index of each joint's parent, -1 for roots (there may be several).
        rest_translation: (J, 3) metres, from the parent, in the parent's axes: the bone vectors.
        rest_rotation: (J, 4) local rotation of the rest pose; identity where a format has none.
        rest_scale: (J,) uniform scale of a joint, applied to everything below it.
        roles: what somebody said about the joints: canonical joint to own joint ("" for none), and "root" to
            the top joint of the character that is meant. Empty where nobody needs to say anything.
    """

    names: tuple[str, ...]
    parents: tuple[int, ...]
    rest_translation: np.ndarray
    rest_rotation: np.ndarray = None  # type: ignore[assignment]
    rest_scale: np.ndarray = None  # type: ignore[assignment]
    roles: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        fill = object.__setattr__
        names = tuple(self.names) if isinstance(self.names, Iterable) else None
        if isinstance(self.names, str) or names is None or not all(map(_is_name, names)):
            raise unfit("names", self.names, 'the names of all joints, such as ["Hips", "Spine"]')
        fill(self, "names", names)
        fill(
            self, "parents", joint_numbers(self.parents, "parents", "the index of each joint's parent, or -1")
        )
        if not isinstance(self.roles, Mapping):
            raise unfit("roles", self.roles, 'what joints are, such as {"Hips": "pelvis"}')
        count = len(names)
        if not count:
            raise RequestError("the skeleton has no joints", "there is nothing to move", "Name one or more.")
        fill(self, "rest_translation", numbers(self.rest_translation, "rest_translation"))
        rests = {"rest_translation": self.rest_translation, "rest_rotation": self.rest_rotation}
        for name, value in {**rests, "rest_scale": self.rest_scale}.items():
            if value is not None and not np.isfinite(numbers(value, name)).all():
                why = f"{name} has values that are no numbers, or without end"
                raise RequestError("the skeleton cannot be used", why, "Give finite numbers.")
        if self.rest_translation.shape != (count, 3):
            raise RequestError(
                "bones do not fit",
                f"expected ({count}, 3) numbers, got {self.rest_translation.shape}",
                "rest_translation has a row in metres for each joint.",
            )
        if self.rest_rotation is None:
            fill(self, "rest_rotation", np.tile([1.0, 0, 0, 0], (count, 1)))
        if self.rest_scale is None:
            fill(self, "rest_scale", np.ones(count))
        for name, shape in (("rest_rotation", (count, 4)), ("rest_scale", (count,))):
            fill(self, name, value := numbers(getattr(self, name), name))
            if value.shape != shape:
                raise RequestError(
                    f"{name} does not fit",
                    f"expected {shape} numbers, got {value.shape}",
                    "It has a row for each joint; leave it out where there is none.",
                )
        if (odd := misfit(self.rest_rotation)) is not None:
            raise RequestError(
                "rest_rotation holds no unit quaternions",
                f"that of {self.names[odd[0]]} is {np.linalg.norm(self.rest_rotation[odd]):.3g} long",
                "Divide them by their lengths; they are w, x, y, z.",
            )
        fill(self, "rest_rotation", of_length_one(self.rest_rotation))
        if not (self.rest_scale > 0).all():
            name = self.names[int(self.rest_scale.argmin())]
            raise RequestError(
                f"the scale of {name} is {self.rest_scale.min():g}",
                "a joint can be larger or smaller, and not inside out",
                "Use scales above 0.",
            )
        if len(set(self.names)) != count:
            twice = sorted({name for name in self.names if self.names.count(name) > 1})
            raise RequestError(
                "the skeleton is ambiguous",
                f"joint names occur twice: {', '.join(twice)}",
                "Give each joint a name of its own.",
            )
        if len(self.parents) != count or any(not -1 <= p < j for j, p in enumerate(self.parents)):
            raise RequestError(
                "the skeleton is no tree",
                "every parent must come before its children",
                "Sort the joints so; parents are indices, and -1 of a root.",
            )

    def __len__(self) -> int:
        return len(self.names)

    def __repr__(self) -> str:
        tops = ", ".join(self.names[root] for root in self.roots)
        return f"<Skeleton: {len(self)} joints below {tops}>"

    def index(self, name: str) -> int:
        """The index of a joint; raises RequestError listing all joints when there is none."""
        try:
            return self.names.index(name)
        except ValueError:
            raise unknown("joint", name, self.names) from None

    @cached_property
    def roots(self) -> tuple[int, ...]:
        return tuple(j for j, parent in enumerate(self.parents) if parent < 0)

    @cached_property
    def children(self) -> tuple[tuple[int, ...], ...]:
        below: list[list[int]] = [[] for _ in self.names]
        for joint, parent in enumerate(self.parents):
            if parent >= 0:
                below[parent].append(joint)
        return tuple(map(tuple, below))

    def ancestors(self, joint: int) -> tuple[int, ...]:
        """The joints from the parent of `joint` up to its root."""
        path = []
        while (joint := self.parents[joint]) >= 0:
            path.append(joint)
        return tuple(path)

    @cached_property
    def below(self) -> np.ndarray:
        """(J, J) True where the row's joint is the column's, or hangs below it."""
        return np.asarray(kinematics.ancestors(self.parents).values, bool)

    @cached_property
    def scale_above(self) -> np.ndarray:
        """(J,) product of the scales of all ancestors: what a bone vector is multiplied with."""
        above = np.ones(len(self))
        for joint, parent in enumerate(self.parents):
            if parent >= 0:
                above[joint] = above[parent] * self.rest_scale[parent]
        return above

    def otherwise(self, other: Skeleton, moved: Iterable[int]) -> str | None:
        """The first joint that, on a skeleton of the same joints, hangs from another one or rests pointing
        elsewhere, so that rotations mean something else; bones may be of other lengths, and of joints that
        are `moved` against their parents anything."""
        one, two = self.rest_translation, other.rest_translation
        longer = np.linalg.norm(one, axis=1) * np.linalg.norm(two, axis=1)
        aside = np.einsum("jc,jc->j", one, two) < AWRY * longer
        aside &= longer > SHORT**2
        aside[list(moved)] = False
        aside |= np.array(self.parents) != other.parents
        aside |= np.abs(np.einsum("jc,jc->j", self.rest_rotation, other.rest_rotation)) < np.sqrt(
            (1 + AWRY) / 2
        )
        return self.names[int(aside.argmax())] if aside.any() else None


# The cosine of how far bones may point apart to be the same ones; those shorter than so many metres point
# nowhere.
AWRY, SHORT = 0.98, 0.01
# How far the square of a quaternion's length may be from 1: what is stored with three decimals is nearer, and
# is made 1 if it is not.
UNIT, ROUNDED = 0.01, 1e-6


def joint_numbers(
    joints: Iterable[SupportsIndex],
    name: str = "translated",
    kind: str = "indices of joints, such as (0, 5)",
) -> tuple[int, ...]:
    """Indices of joints, whatever kind of numbers says them; RequestError where they are none."""
    try:
        return tuple(operator.index(joint) for joint in joints)
    except TypeError:
        raise unfit(name, joints, kind) from None


def _is_name(name: object) -> bool:
    return isinstance(name, str) and "\0" not in name


def numbers(values: object, name: str) -> np.ndarray:
    """Values as an array of float64; what is masked is NaN. RequestError where they are no numbers."""
    try:
        if isinstance(values, np.ma.MaskedArray):
            return np.asarray(np.ma.filled(values.astype(float), np.nan))
        return np.asarray(values, float)
    except (TypeError, ValueError):
        raise unfit(name, values, "an array of numbers, all rows of one length") from None


def misfit(rotation: np.ndarray) -> tuple[int, ...] | None:
    """Where in (..., 4) the quaternion is whose length is furthest from 1, if that is no rounding."""
    off = np.abs(np.einsum("...c,...c->...", rotation, rotation) - 1)
    if not off.max(initial=0.0) > UNIT:
        return None
    return tuple(int(i) for i in np.unravel_index(int(off.argmax()), off.shape))


def of_length_one(rotation: np.ndarray) -> np.ndarray:
    """Quaternions (..., 4) of which rounded ones are made unit ones; all others keep their last digit."""
    size = np.einsum("...c,...c->...", rotation, rotation)
    if not (rounded := np.abs(size - 1) > ROUNDED).any():
        return rotation
    return rotation / np.sqrt(np.where(rounded, size, 1.0))[..., None]


@dataclass(frozen=True, eq=False)
class Clip:
    """Motion of a skeleton over time, always finite: what is missing stands in an Observation beside it.

    Attributes:
        skeleton: the joints.
        rotation: (F, J, 4) local rotations, unit quaternions w, x, y, z.
        translation: (F, K, 3) metres: local translations of the joints in `translated`. A root's is its
            global position.
        fps: frames a second.
        translated: the K joints whose translation is animated; the roots, and others where a file has
            them. All other joints keep the skeleton's rest translation.
        name: where the clip came from, for reports.
        source: what the file format adds (layout, original text), for writing: a Source, or None.
    """

    skeleton: Skeleton
    rotation: np.ndarray
    translation: np.ndarray
    fps: float
    translated: tuple[int, ...] = ()
    name: str = ""
    source: Any = field(default=None, repr=False)

    def __post_init__(self) -> None:
        fill = object.__setattr__
        if not isinstance(self.skeleton, Skeleton):
            raise unfit("skeleton", self.skeleton, "a Skeleton, such as clip.skeleton")
        fill(self, "translated", joint_numbers(self.translated) or self.skeleton.roots)
        fill(self, "rotation", numbers(self.rotation, "rotation"))
        fill(self, "translation", numbers(self.translation, "translation"))
        joints = len(self.skeleton)
        if self.rotation.ndim != 3 or self.rotation.shape[1:] != (joints, 4):
            raise RequestError(
                "rotations do not fit",
                f"expected (F, {joints}, 4), got {self.rotation.shape}",
                "They are quaternions w, x, y, z of every joint in every frame.",
            )
        frames = len(self.rotation)
        if not all(0 <= joint < joints for joint in self.translated):
            raise RequestError(
                f"there is no joint {max(self.translated, key=abs)} to be translated",
                f"the skeleton has {joints} joints, counted from 0",
                "translated lists the joints whose translation is animated, by index.",
            )
        if twice := [joint for joint in self.translated if self.translated.count(joint) > 1]:
            raise RequestError(
                f"the joint {self.skeleton.names[twice[0]]} is translated twice",
                f"translated lists the joints {', '.join(map(str, self.translated))}",
                "Name each of them once.",
            )
        if left := [joint for joint in self.skeleton.roots if joint not in self.translated]:
            raise RequestError(
                f"the root {self.skeleton.names[left[0]]} is not translated",
                f"translated lists the joints {', '.join(map(str, self.translated))}",
                "The roots belong to it; leave it out where nothing else does.",
            )
        if self.translation.shape != (frames, len(self.translated), 3):
            raise RequestError(
                "translations do not fit",
                f"expected ({frames}, {len(self.translated)}, 3), got {self.translation.shape}",
                "There is one, in metres, for each joint in translated: the roots, if that is left out.",
            )
        check_rate(self.fps)
        fill(self, "fps", float(self.fps))
        if not (np.isfinite(self.rotation).all() and np.isfinite(self.translation).all()):
            raise MotionError(
                "the clip has values that are no numbers",
                "a clip is always finite",
                "Use interpose.Observation.from_nan to turn NaN into missing values first.",
            )
        if (odd := misfit(self.rotation)) is not None:
            long = f"{np.linalg.norm(self.rotation[odd]):.3g} long"
            raise MotionError(
                "rotations are no unit quaternions",
                f"that of {self.skeleton.names[odd[1]]} at frame {odd[0]} is {long}",
                "Divide them by their lengths; they are w, x, y, z.",
            )
        fill(self, "rotation", of_length_one(self.rotation))

    def __len__(self) -> int:
        return self.rotation.shape[0]

    def __repr__(self) -> str:
        name = f" {self.name!r}" if self.name else ""
        length = f"{len(self)} frames at {self.fps:g} fps ({self.seconds:.1f} s)"
        return f"<Clip{name}: {length}, {len(self.skeleton)} joints>"

    @property
    def seconds(self) -> float:
        return len(self) / self.fps

    @property
    def root(self) -> np.ndarray:
        """(F, 3) position of the first root."""
        return self.translation[:, self.translated.index(self.skeleton.roots[0])]

    def local_translation(self) -> np.ndarray:
        """(F, J, 3) local translations of all joints, scales of the joints above included."""
        everything = np.broadcast_to(
            self.skeleton.rest_translation, (len(self), len(self.skeleton), 3)
        ).copy()
        everything[:, list(self.translated)] = self.translation
        return everything * self.skeleton.scale_above[:, None]

    def kinematics(self) -> tuple[np.ndarray, np.ndarray]:
        """Global rotations (F, J, 4) and global positions (F, J, 3)."""
        return kinematics.forward(self.rotation, self.local_translation(), self.skeleton.parents)

    def positions(self) -> np.ndarray:
        """(F, J, 3) global joint positions in metres."""
        return self.kinematics()[1]

    def slice(self, start: int, stop: int) -> Clip:
        """Frames start to stop - 1, as a clip of its own; the file's layout stays for writing.

        Numbers count as in any slice: what is not there is left out, negative ones count from the end. Arrays
        are shared with this clip: clips are not changed in place (`with_motion`).
        """
        return self.take(slice(start, stop))

    def take(self, frames: Frames) -> Clip:
        """Some frames, in any order; the file's layout stays for writing, and the text of their numbers.

        Raises RequestError for frames that there are not.
        """
        chosen = frames if isinstance(frames, slice) else np.asarray(frames)
        if isinstance(chosen, np.ndarray) and not chosen.size:
            chosen = np.zeros(0, int)
        try:
            index = np.arange(len(self))[chosen]
        except (IndexError, TypeError):
            index = np.zeros((0, 0), int)
        if index.ndim != 1:
            why = f"the clip has {len(self)} frames, counted from 0"
            raise RequestError(f"there are no frames {frames}", why, "Choose some of them: [0, 3, 4].")
        source = self.source.take(index) if self.source is not None else None
        # Of a slice both are views.
        part = chosen if isinstance(chosen, slice) else index
        return replace(self, rotation=self.rotation[part], translation=self.translation[part], source=source)

    def with_motion(self, rotation: np.ndarray, translation: np.ndarray) -> Clip:
        """The same clip with other motion; the file's layout stays for writing."""
        return replace(self, rotation=rotation, translation=translation)

    def scaled(self, factor: float) -> Clip:
        """The motion of a body `factor` times as large, without what its file adds."""
        skeleton = replace(self.skeleton, rest_translation=factor * self.skeleton.rest_translation)
        return replace(self, skeleton=skeleton, translation=factor * self.translation, source=None)

    def joined(self, clips: Sequence[Clip]) -> Clip:
        """The motion of clips on this skeleton, one after another, with the file's layout of this one.

        Raises RequestError for clips with other joints, or at another frame rate (lone poses have none).
        """
        if not isinstance(clips, Iterable) or isinstance(clips, Clip):
            raise unfit("clips", clips, "several clips, such as [one, two]")
        clips = list(clips)
        for clip in clips:
            if not isinstance(clip, Clip):
                raise unfit("clip", clip, "a clip: interpose.load reads one")
            mine, own = self.skeleton, clip.skeleton
            if own.names == mine.names and (odd := mine.otherwise(own, self.translated)):
                why = f"{odd} hangs otherwise from what is above it in one of them"
                raise RequestError("the clips cannot be joined", why, "Retarget one: interpose.retarget.")
            if own.names != mine.names or clip.translated != self.translated:
                why = "their joints, or those that are translated, differ"
                raise RequestError("the clips cannot be joined", why, "Retarget one: interpose.retarget.")
            if len(clip) > 1 and clip.fps != self.fps:
                why = f"one has {clip.fps:g} frames a second, another {self.fps:g}"
                raise RequestError("the clips cannot be joined", why, "Use interpose.resample first.")
        if not clips:
            return self.slice(0, 0)
        rotation, translation = (
            np.concatenate([getattr(clip, name) for clip in clips]) for name in ("rotation", "translation")
        )
        source = self.source and self.source.along([(clip.source, len(clip)) for clip in clips])
        return replace(self, rotation=rotation, translation=translation, source=source)
