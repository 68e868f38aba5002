"""Saying what is observed, beside the clip and never inside it."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from interpose.clip import Clip, Skeleton, joint_numbers, numbers
from interpose.errors import RequestError, is_number, unfit
from interpose.skeletons.performers import meant

# Metres by which a pin may be missed from which on it says roughly where the body goes, and no more.
ROUGH = 0.1


def frame_number(value: object) -> int:
    """A frame as a whole number, whatever kind of number says it; RequestError where it is none."""
    if is_number(value, whole=True):
        return int(value)
    raise RequestError(
        f"there is no frame {str(value)[:40]}", "frames are whole numbers, counted from 0", "Write 120."
    )


@dataclass(frozen=True)
class Gap:
    """Frames start to stop - 1 in which something is missing.

    `joints` names the joints whose *local rotations* are unknown; None means the whole pose and the
    translation of the root.
    """

    start: int
    stop: int
    joints: tuple[str, ...] | None = None

    def __post_init__(self) -> None:
        for side in ("start", "stop"):
            object.__setattr__(self, side, frame_number(getattr(self, side)))
        if self.joints is not None:
            object.__setattr__(self, "joints", joint_names(self.joints))
            if not self.joints:
                raise RequestError(
                    f"nothing is missing in the gap {self.start}:{self.stop}",
                    "it names no joints",
                    "Name some, or leave them out for the whole pose.",
                )

    def __len__(self) -> int:
        return max(self.stop - self.start, 0)

    def __str__(self) -> str:
        return f"{self.start}:{self.stop}" + (f" {','.join(self.joints)}" if self.joints else "")

    @classmethod
    def parse(cls, text: str, joints: tuple[str, ...] | None = None, clip: Clip | None = None) -> Gap:
        """A gap from "120:160", frames 120 to 159. Raises RequestError for anything else.

        Of a clip also from seconds, "4s:5.3s", and without one of its ends: "120:" is open to the clip's end.
        """
        if not isinstance(text, str):
            raise unfit("gap", text, 'a text, such as "120:160"')
        first, colon, last = (part.strip() for part in text.partition(":"))

        if not isinstance(clip, Clip | None):
            raise unfit("clip", clip, "a clip: interpose.load reads one")
        try:
            if not colon or (clip is not None and not first + last):
                raise ValueError
            if clip is None:
                start, stop = int(first), int(last)
            else:
                start = frame_at(first, clip.fps) if first else 0
                stop = frame_at(last, clip.fps) if last else len(clip)
        except ValueError:
            raise RequestError(
                f"cannot read the gap {text!r}",
                "a gap is a range of frames START:STOP, and STOP is the first frame after it",
                "Write 120:160 for the frames 120 to 159, or 4s:5.3s.",
            ) from None
        return cls(start, stop, joints)

    def check(self, frames: int) -> Gap:
        """Itself, or RequestError when the range is backwards, empty or outside a clip of `frames` frames."""
        fix = f"The clip has frames 0 to {frames - 1}; write START:STOP with 0 <= START < STOP <= {frames}."
        if not frames:
            why = "the clip has no frames"
            raise RequestError(f"there is no gap {self.start}:{self.stop}", why, "Give a clip that has some.")
        if self.stop <= self.start:
            why = "it stops where it starts" if self.stop == self.start else "it stops before it starts"
            raise RequestError(f"the gap {self.start}:{self.stop} is empty", why, fix)
        if self.start < 0 or self.stop > frames:
            raise RequestError(
                f"the gap {self.start}:{self.stop} reaches outside the clip", f"it has {frames} frames", fix
            )
        return self


def joint_names(joints: Any) -> tuple[str, ...]:
    """Names of joints, of one alone, too."""
    if isinstance(joints, str):
        return (joints,)
    if not isinstance(joints, Iterable):
        raise unfit("joints", joints, 'names of joints, such as ["LeftArm"]')
    return tuple(joints)


def frame_at(text: str, fps: float) -> int:
    """The frame that is named "140", or the one nearest to "3.5s". ValueError for anything else."""
    if not text.endswith("s"):
        return int(text)
    frame = float(text[:-1]) * fps
    if not math.isfinite(frame):
        raise ValueError
    return round(frame)


def frames_of(text: str, fps: float) -> int:
    """How many frames to generate: of "60", or "2s". RequestError for what is no number, or none."""
    try:
        count = frame_at(text.strip(), fps)
    except (ValueError, OverflowError):
        count = 0
    if count < 1:
        why = "it takes a number from 1 on, or seconds"
        raise RequestError(f"cannot generate {text} frames", why, "Write 45, or 1.5s.")
    return count


def longest(max_gap: object, fps: float) -> int:
    """How many frames a gap may have: of 90, "90" or "3s". RequestError for what is none, or nothing."""
    try:
        frames = frame_at(max_gap, fps) if isinstance(max_gap, str) else max_gap
    except ValueError:
        frames = None
    if not is_number(frames, 1, whole=True):
        raise RequestError(
            f"cannot use {str(max_gap)[:40]} as the length of the longest gap",
            "it is a number of frames, or of seconds, and more than none",
            'Write --max-gap 90, or --max-gap 3s (max_gap=90 or "3s" in Python).',
        )
    return int(frames)


@dataclass(frozen=True, eq=False)
class Pin:
    """A known *global* position and/or orientation of a joint at some frames.

    Attributes:
        joint: its name.
        frames: (n,) frame numbers.
        position: (n, 3) metres, or None.
        orientation: (n, 4) global quaternions, or None.
        tolerance: metres by which the joint may miss.
    """

    joint: str
    frames: np.ndarray
    position: np.ndarray | None = None
    orientation: np.ndarray | None = None
    tolerance: float = 0.001

    def slice(self, start: int, stop: int) -> Pin:
        """What it says of the frames start to stop - 1, counted from start."""
        frames = np.asarray(self.frames)
        inside = (frames >= start) & (frames < stop)
        position, orientation = (
            None if value is None else np.asarray(value, float)[inside]
            for value in (self.position, self.orientation)
        )
        return replace(self, frames=frames[inside] - start, position=position, orientation=orientation)


def _of(gaps: Iterable[Gap], clip: Clip) -> list[Gap]:
    """Gaps of a clip; RequestError for what is none, or lies outside."""
    if not isinstance(gaps, Iterable) or isinstance(gaps, str):
        raise unfit("gaps", gaps, 'a list of Gaps, such as [Gap.parse("120:160")]')
    gaps = list(gaps)
    for gap in gaps:
        if not isinstance(gap, Gap):
            raise unfit("gap", gap, 'a Gap, such as Gap.parse("120:160")')
        gap.check(len(clip))
    return gaps


def _flags(values: object) -> np.ndarray:
    """True where something is known; RequestError for what does not say so, as a tracker's confidences."""
    try:
        flags = np.asarray(values)
    except ValueError:
        raise unfit("an observation", values, "arrays (frames, joints) of True and False") from None
    if flags.dtype != bool and not (flags.dtype.kind in "iuf" and np.isin(flags, (0, 1)).all()):
        raise RequestError(
            "an observation says of each value whether it is known",
            f"its array of {flags.dtype} holds something else than True and False",
            "Compare confidences with the least one to be trusted, as in confidence > 0.5.",
        )
    return flags.astype(bool, copy=False)


@dataclass(frozen=True, eq=False)
class Observation:
    """Which values of a clip are known.

    Attributes:
        rotation: (F, J) True where the local rotation is known.
        translation: (F, J) True where the local translation is known (the root's is a column of it;
            joints without animated translation are always known).
        pins: known global positions.

    Raises:
        RequestError: the arrays are not (F, J), or hold something else than True and False (or 1 and 0).
    """

    rotation: np.ndarray
    translation: np.ndarray
    pins: tuple[Pin, ...] = field(default=())

    def __post_init__(self) -> None:
        fill = object.__setattr__
        fill(self, "rotation", _flags(self.rotation))
        fill(self, "translation", _flags(self.translation))
        pins = () if self.pins is None else self.pins
        if not isinstance(pins, Iterable | Pin):
            raise unfit("pins", pins, "Pins")
        fill(self, "pins", (pins,) if isinstance(pins, Pin) else tuple(pins))
        if wrong := [pin for pin in self.pins if not isinstance(pin, Pin)]:
            raise unfit("pins", wrong[0], "Pins")
        if self.rotation.shape != self.translation.shape or self.rotation.ndim != 2:
            raise RequestError(
                "the observation does not fit",
                f"its arrays are {self.rotation.shape} and {self.translation.shape}",
                "Both are (frames, joints), True where a value is known.",
            )

    def __repr__(self) -> str:
        frames, joints = self.rotation.shape
        whole = int((self.rotation & self.translation).all(axis=1).sum())
        pins = f", {len(self.pins)} pins" if self.pins else ""
        return f"<Observation: {joints} joints, all known in {whole} of {frames} frames{pins}>"

    def check(self, clip: Clip) -> None:
        """RequestError if it has other frames or joints than a clip."""
        if self.rotation.shape != clip.rotation.shape[:2]:
            raise RequestError(
                "the observation does not fit the clip",
                f"it has {self.rotation.shape} frames and joints, the clip {clip.rotation.shape[:2]}",
                "Make it from the same clip, for example with Observation.from_gaps.",
            )

    @classmethod
    def full(cls, clip: Clip) -> Observation:
        """Everything is known."""
        if not isinstance(clip, Clip):
            raise unfit("clip", clip, "a clip: interpose.load reads one")
        shape = clip.rotation.shape[:2]
        return cls(np.ones(shape, bool), np.ones(shape, bool))

    @classmethod
    def from_gaps(cls, clip: Clip, gaps: Iterable[Gap]) -> Observation:
        """Everything is known but the gaps. Raises RequestError for ranges or joints that are not there.

        Where a file has several bodies, and somebody said which one is meant (`roles["root"]`), a gap of the
        whole pose is that body's; and one that names all joints of a body is of its place, too.
        """
        seen, several = cls.full(clip), meant(clip.skeleton)
        bodies = several or [range(len(clip.skeleton))]
        for gap in _of(gaps, clip):
            frames = slice(gap.start, gap.stop)
            lost = {clip.skeleton.index(name) for name in gap.joints or ()}
            seen.rotation[frames, [*lost]] = False
            for body in bodies:
                if gap.joints is None or (several and lost.issuperset(body)):
                    seen.rotation[frames, list(body)] = False
                    seen.translation[frames, [*{*body} & {*clip.translated}]] = False
        return seen

    @classmethod
    def without(cls, clip: Clip, gaps: Iterable[Gap]) -> Observation:
        """Everything is known but frames that nobody has recorded: nothing of any, whoever is meant."""
        seen = cls.full(clip)
        for gap in _of(gaps, clip):
            frames = slice(gap.start, gap.stop)
            seen.rotation[frames] = False
            seen.translation[frames, list(clip.translated)] = False
        return seen

    @classmethod
    def from_nan(
        cls,
        skeleton: Skeleton,
        rotation: np.ndarray,
        translation: np.ndarray,
        fps: float,
        translated: tuple[int, ...] = (),
    ) -> tuple[Clip, Observation]:
        """A finite clip and its observation from arrays in which NaN marks missing values.

        rotation: (F, J, 4); translation: (F, K, 3) as in Clip. A quaternion, or a vector, with a NaN in it is
        missing as a whole: of a place of which two coordinates are known nothing is.
        """
        if not isinstance(skeleton, Skeleton):
            raise unfit("skeleton", skeleton, "a Skeleton, such as clip.skeleton")
        translated = joint_numbers(translated) or skeleton.roots
        rotation, translation = (
            numbers(rotation, "rotation").copy(),
            numbers(translation, "translation").copy(),
        )
        if not all(0 <= joint < len(skeleton) for joint in translated):
            raise RequestError(
                f"there is no joint {max(translated, key=abs)} to be translated",
                f"the skeleton has {len(skeleton)} joints, counted from 0",
                "translated lists the joints whose translation is animated, by index.",
            )
        for name, values, row in (
            ("rotations", rotation, (len(skeleton), 4)),
            ("translations", translation, (len(translated), 3)),
        ):
            if values.ndim != 3 or values.shape != (len(rotation), *row):
                raise RequestError(
                    f"{name} do not fit",
                    f"expected (F, {row[0]}, {row[1]}), got {values.shape}",
                    f"There are {row[0]} of them in each of as many frames as there are rotations.",
                )
        known = np.isfinite(rotation).all(axis=-1)
        moved = np.ones(known.shape, bool)
        moved[:, list(translated)] = np.isfinite(translation).all(axis=-1)
        rotation[~known] = [1, 0, 0, 0]
        translation[~moved[:, list(translated)]] = 0
        return Clip(skeleton, rotation, translation, fps, translated), cls(known, moved)

    @property
    def complete(self) -> bool:
        return bool(self.rotation.all() and self.translation.all())

    @property
    def frames(self) -> np.ndarray:
        """(F,) True where every value of the frame is known."""
        return np.asarray(self.rotation.all(axis=1) & self.translation.all(axis=1))

    def positions(self, skeleton: Skeleton) -> np.ndarray:
        """(F, J) True where a joint's *global position* follows from what is known.

        It needs the rotations of all joints above it and the translations from the root down to it.
        """
        known = self.translation.copy()
        for joint, parent in enumerate(skeleton.parents):
            if parent >= 0:
                known[:, joint] &= known[:, parent] & self.rotation[:, parent]
        return known

    def gaps(self, skeleton: Skeleton) -> list[Gap]:
        """Runs of frames in which the same values are missing, in order of time."""
        found: list[Gap] = []
        missing = ~(self.rotation & self.translation)
        if not missing.any():
            return found
        change = np.flatnonzero((missing[1:] != missing[:-1]).any(axis=1)) + 1
        edges = [0, *change.tolist(), len(missing)]
        for start, stop in zip(edges, edges[1:]):
            gone = missing[start]
            if not gone.any():
                continue
            everything = (~self.rotation[start]).all()
            names = None if everything else tuple(skeleton.names[j] for j in np.flatnonzero(gone))
            found.append(Gap(start, stop, names))
        return found

    def slice(self, start: int, stop: int) -> Observation:
        """The observation of frames start to stop - 1, and what pins say of them."""
        return replace(
            self,
            rotation=self.rotation[start:stop],
            translation=self.translation[start:stop],
            pins=tuple(one for pin in self.pins if len((one := pin.slice(start, stop)).frames)),
        )
