"""Numbers in text files: where they stand, how they are written, and how single ones are exchanged."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

VALUE_LIMIT = 1e9  # degrees or file units; what is above is damage, and would overflow later
NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?\Z", re.ASCII)
# A comment, or else a word (group 1). Commas and parentheses are blanks to ASF/AMC and stand in no number.
WORD = re.compile(rb"(?<![^\s,()])#[^\r\n]*|([^\s,()]+)")
BLOCK = 4 << 20  # bytes scanned at once
CHUNK_NUMBERS = 1 << 17
DECIMALS = 6  # where a file gives no example
LEAST_DECIMALS, MOST_DECIMALS = 4, 12  # of changed numbers, whatever the file's own have


def line_of(text: bytes, position: int) -> int:
    """The 1-based number of the line in which the byte `position` stands."""
    ends = text.count(b"\n", 0, position)
    return 1 + (ends or text.count(b"\r", 0, position))


def number(word: str) -> float | None:
    """A finite number of sensible size, or None."""
    if not NUMBER.match(word) or len(word) > 64:
        return None
    value = float(word)
    return value if abs(value) <= VALUE_LIMIT else None


def nth_words(text: np.ndarray, begin: int, every: int) -> tuple[np.ndarray, int]:
    """The places of the first word of `text` (uint8) behind `begin` and of every `every`-th one after it.

    Also returns how many words there are. The byte before `begin` must be a blank or end a word.
    """
    found, seen = [], 0
    for low in range(begin, len(text), BLOCK):
        # One byte more in front: a word begins where a blank is followed by something else.
        blank = text[low - 1 : low + BLOCK] <= 32
        words = np.flatnonzero(blank[:-1] & ~blank[1:])
        found.append(low + words[-seen % every :: every])
        seen += len(words)
    return (np.concatenate(found) if found else np.empty(0, int)), seen


@dataclass(frozen=True, eq=False)
class FrameText:
    """The frames of a motion as the file has them: the same number of words in each.

    Attributes:
        text: (bytes of the file,) uint8.
        starts: (F + 1,) where each frame's first word begins; the last entry is the end of the file.
        columns: (C,) which words of a frame are its numbers.
        name: of the file, for errors.
    """

    text: np.ndarray
    starts: np.ndarray
    columns: np.ndarray
    name: str

    def __len__(self) -> int:
        return len(self.starts) - 1

    @property
    def channels(self) -> int:
        """How many numbers a frame has."""
        return len(self.columns)

    @property
    def chunk(self) -> int:
        """Frames in a chunk."""
        return max(1, CHUNK_NUMBERS // self.channels)

    def raw(self, start: int, stop: int) -> bytes:
        """The text of the frames start to stop - 1, with the blanks and line ends behind each."""
        return self.text[self.starts[start] : self.starts[stop]].tobytes()

    def values(self, start: int, stop: int) -> np.ndarray:
        """(stop - start, C) numbers of the frames; raises FileError when one is no finite number."""
        raise NotImplementedError

    def lines(self, start: int, stop: int, frame: int, line_end: bytes | None) -> bytes:
        """The text of the frames start to stop - 1 where they are the frames from `frame` on. The file's last
        one, which may lack it, is given a line end; None where it is the last one again."""
        text = self.raw(start, stop)
        return text if line_end is None or stop < len(self) else text.rstrip() + line_end

    def style(self) -> Style:
        """The style of the first numbers of the motion."""
        count = min(len(self), 1 + 4096 // self.channels)
        words = words_of(self.raw(0, count).lower())
        every = len(words) // count
        picked = [words[every * frame + column] for frame in range(count) for column in self.columns.tolist()]
        plain = [word for word in picked if b"e" not in word]
        # Programs that write six digits give small numbers many decimals: those above one tell what is usual.
        usual = [word for word in plain if re.match(rb"[+-]?0*[1-9]", word)] or plain
        counts = [len(word.partition(b".")[2]) for word in usual] or [DECIMALS]
        trimmed = any(count < max(counts) for count in counts)
        return Style(min(max(*counts, LEAST_DECIMALS), MOST_DECIMALS), trimmed)

    def exchange(self, text: bytes, values: np.ndarray, fresh: np.ndarray, style: Style) -> bytes:
        """The text of a frame with the numbers of `values` (C,) where `fresh` (C,); all else stays."""
        spans, done = _spans(text), 0
        parts: list[bytes] = []
        for column, value in zip(self.columns[fresh].tolist(), values[fresh].tolist()):
            begin, end = spans[column]
            parts += [text[done:begin], style.text(value)]
            done = end
        return b"".join([*parts, text[done:]])


@lru_cache(maxsize=2)
def _spans(text: bytes) -> list[tuple[int, int]]:
    """Where words begin and end. Frames that a file lacks are all written after the same one."""
    return [match.span(1) for match in WORD.finditer(text) if match[1]]


def words_of(text: bytes) -> list[bytes]:
    """All words but comments."""
    return [match[1] for match in WORD.finditer(text) if match[1]]


@dataclass(frozen=True)
class Style:
    """How a file writes numbers: so many decimals, with zeros at the end or without."""

    decimals: int
    trimmed: bool

    def text(self, value: float) -> bytes:
        text = b"%.*f" % (self.decimals, value)
        return text.rstrip(b"0").rstrip(b".") if self.trimmed else text
