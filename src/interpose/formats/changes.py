"""Writing a text file again: what did not change is copied, changed numbers are written in its style."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import BinaryIO

import numpy as np

from interpose.clip import Clip, Skeleton
from interpose.errors import RequestError
from interpose.formats.text import VALUE_LIMIT, FrameText

NAMED = 5  # joints in a note
# Puts the clip's frames from `start` into values (n, C), of which the first `known` are the file's own, and
# returns (n, C) True where a number may have changed: put(values, known, start, previous), where `previous`
# (C,) are the numbers of the frame before.
Put = Callable[[np.ndarray, int, int, np.ndarray], np.ndarray]


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
        raise RequestError("cannot write this motion", why, "Bring it nearer to the origin, or write .npz.")


def write_frames(motion: FrameText, frames: int, put: Put, stream: BinaryIO, line_end: bytes) -> None:
    """Write `frames` frames: the text of `motion` with the numbers that `put` changes exchanged."""
    style = motion.style()
    previous = np.zeros(motion.channels)

    def kept(start: int, stop: int) -> bytes:
        """The original text of some frames. The last one may lack a line end that it needs now."""
        text = motion.raw(start, stop) if start < stop else b""
        return text.rstrip() + line_end if text and stop == len(motion) < frames else text

    for start in range(0, frames, motion.chunk):
        stop = min(start + motion.chunk, frames)
        known = max(0, min(stop, len(motion)) - start)
        values = np.zeros((stop - start, motion.channels))
        if known:
            values[:known] = motion.values(start, start + known)
        old = values[:known].copy()
        fresh = put(values, known, start, previous)
        previous = values[-1].copy()
        values = np.round(values, style.decimals) + 0.0  # no negative zeros
        check_values(values)
        # What comes out the same to the last written decimal did not change.
        fresh[:known] &= np.abs(values[:known] - old) > 0.5001 * 10.0**-style.decimals
        done = 0
        for row in np.flatnonzero(fresh.any(axis=1)).tolist():
            stream.write(kept(start + done, start + min(row, known)))
            inside = row < known
            text = kept(start + row, start + row + 1) if inside else motion.pattern(start + row, line_end)
            stream.write(motion.exchange(text, values[row], fresh[row], style))
            done = row + 1
        stream.write(kept(start + done, start + known))


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
