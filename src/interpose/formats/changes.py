"""Writing a text file again: what did not change is copied, changed numbers are written in its style."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import BinaryIO, Self

import numpy as np

from interpose.clip import Clip, Skeleton, Source
from interpose.errors import RequestError
from interpose.formats.text import VALUE_LIMIT, FrameText

NAMED = 5  # joints in a note
# Puts the clip's frames from `start` into values (n, C), which where `known` (n,) are the file's own, and
# returns (n, C) True where a number may have changed: put(values, known, start, previous), where `previous`
# (C,) are the numbers of the frame before.
Put = Callable[[np.ndarray, np.ndarray, int, np.ndarray], np.ndarray]


@dataclass(frozen=True, eq=False, kw_only=True)
class TextSource:
    """What a text file has and a clip does not: kept beside the clip so that writing gives the same file.

    Attributes:
        motion: the frames' original text.
        skeleton: the skeleton as read.
        at: (n,) the file's frame that each of the clip's was, -1 for none; of a longer clip, the first ones.
    """

    motion: FrameText
    skeleton: Skeleton
    at: np.ndarray

    def take(self, frames: np.ndarray) -> Self:
        """As `Source.take`."""
        return replace(self, at=np.append(self.at, -1)[np.minimum(frames, len(self.at))])

    def along(self, parts: Sequence[tuple[Source | None, int]]) -> Self:
        """As `Source.along`."""
        own = [
            source.take(np.arange(count)).at
            if isinstance(source, TextSource) and source.motion is self.motion
            else np.full(count, -1)
            for source, count in parts
        ]
        return replace(self, at=np.concatenate(own))


def same_skeleton(mine: Skeleton, other: Skeleton) -> bool:
    """Whether two skeletons have the same joints, parents and bones."""
    return mine is other or (
        mine.names == other.names
        and mine.parents == other.parents
        and np.array_equal(mine.rest_translation, other.rest_translation)
        and np.array_equal(mine.rest_scale, other.rest_scale)
    )


def check_values(values: np.ndarray) -> None:
    """RequestError for numbers that no file of text is read with again."""
    if not np.abs(values).max(initial=0.0) <= VALUE_LIMIT:
        why = f"some of its numbers would be beyond {VALUE_LIMIT:g}, or are none"
        raise RequestError("cannot write this motion", why, "Bring it nearer to the origin.")


def write_frames(source: TextSource, frames: int, put: Put, stream: BinaryIO, line_end: bytes) -> None:
    """Write `frames` frames: the text of those that the file has, with the numbers that `put` changes
    exchanged."""
    motion = source.motion
    style = motion.style()
    previous = np.zeros(motion.channels)
    own = source.take(np.arange(frames)).at
    for start in range(0, frames, motion.chunk):
        at = own[start : start + motion.chunk]
        known, values = at >= 0, np.zeros((len(at), motion.channels))
        for first, last in _runs(at):
            if known[first]:
                values[first:last] = motion.values(int(at[first]), int(at[last - 1]) + 1)
        old = values.copy()
        fresh = put(values, known, start, previous)
        previous = values[-1].copy()
        values = np.round(values, style.decimals) + 0.0  # no negative zeros
        check_values(values)
        # What comes out the same to the last written decimal did not change.
        fresh[known] &= np.abs(values - old)[known] > 0.5001 * 10.0**-style.decimals
        for first, last in _runs(np.where(known & ~fresh.any(axis=1), at, -1)):
            # Of a frame that the file does not have the last one's text, all of whose numbers change.
            frame = int(at[first]) if known[first] else len(motion) - 1
            ends = start + last == frames and known[first]
            text = motion.lines(frame, frame + last - first, start + first, None if ends else line_end)
            changed = fresh[first].any()
            stream.write(motion.exchange(text, values[first], fresh[first], style) if changed else text)


def _runs(at: np.ndarray) -> Iterator[tuple[int, int]]:
    """Each stretch (start, stop) in which frames follow each other in the file; -1 are alone."""
    breaks = np.flatnonzero((np.diff(at) != 1) | (at[1:] == 0)) + 1
    edges = [0, *breaks.tolist(), len(at)]
    return zip(edges, edges[1:])


@dataclass
class Lost:
    """The most that a joint loses because the file has no channel for it: degrees (J,) and metres (J,)."""

    degrees: np.ndarray
    metres: np.ndarray

    @classmethod
    def nothing(cls, joints: int) -> Lost:
        return cls(np.zeros(joints), np.zeros(joints))

    def turned(self, degrees: np.ndarray) -> None:
        self.degrees = np.maximum(self.degrees, degrees)

    def moved(self, joint: int, metres: float) -> None:
        self.metres[joint] = max(self.metres[joint], metres)

    def notes(self, names: tuple[str, ...]) -> tuple[str, ...]:
        """One line for degrees and one for metres, the joints that lose most first; none for nothing."""
        kinds = (self.degrees, 0.1, "{:.1f} degrees"), (self.metres, 1e-4, "{:.3f} m")
        lines = []
        for amounts, least, pattern in kinds:
            most = sorted(np.flatnonzero(amounts > least).tolist(), key=lambda joint: -amounts[joint])
            shown = [f"{names[joint]}: {pattern.format(amounts[joint])}" for joint in most[:NAMED]]
            more = f", and {len(most) - NAMED} joints by less" if len(most) > NAMED else ""
            if most:
                lines.append(f"no channel holds all of the motion; at most lost: {', '.join(shown)}{more}")
        return tuple(lines)


def translation_of(clip: Clip, translated: tuple[int, ...], start: int, stop: int, lost: Lost) -> np.ndarray:
    """(n, K, 3) translations of the joints that the file can move; what others do is lost."""
    if clip.translated == translated:
        return clip.translation[start:stop]
    rest = clip.skeleton.rest_translation
    moved = np.tile(rest[list(translated)], (stop - start, 1, 1))
    for k, joint in enumerate(clip.translated):
        if joint in translated:
            moved[:, translated.index(joint)] = clip.translation[start:stop, k]
        else:
            lost.moved(joint, float(np.abs(clip.translation[start:stop, k] - rest[joint]).max()))
    return moved
