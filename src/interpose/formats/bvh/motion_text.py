"""The lower part of a BVH file: the numbers of the motion, read from and kept as text.

The text of a long clip is large, so that it is kept once, as bytes, with the place of every frame's first
number. Everything else is made in chunks of frames.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from interpose.errors import FileError
from interpose.formats.bvh.header import HEADER_LIMIT, Header, parse_header
from interpose.formats.text import NUMBER, VALUE_LIMIT, FrameText, line_of, nth_words

BLOCK = 4 << 20  # bytes read and scanned at once
LINE_LIMIT = 8 << 20  # bytes: no line of a real clip comes near
NUMBER_LIMIT = 64  # bytes of a number with the blanks behind it, on average
COUNTED = 256 << 20  # bytes of a file whose numbers are counted to say how many frames it holds
FILE_LIMIT = 2 << 30  # bytes: five hours at 120 frames a second


class MotionText(FrameText):
    """The numbers of a motion as the file has them: every word is one."""

    def values(self, start: int, stop: int) -> np.ndarray:
        """(stop - start, C) numbers of the frames; raises FileError when one is no finite number."""
        raw = self.raw(start, stop)
        try:
            numbers = np.fromstring(raw, sep=" ")
        except ValueError:
            numbers = np.empty(0)
        # Every word gives at least one number, or parsing stops (with a warning before NumPy 2.3, which other
        # threads would share if it was caught): equal counts mean one each.
        if numbers.size != (stop - start) * self.channels or not np.abs(numbers).max() <= VALUE_LIMIT:
            raise self._bad_number(raw, int(self.starts[start]))
        return numbers.reshape(stop - start, self.channels)

    def _bad_number(self, raw: bytes, begin: int) -> FileError:
        what = f"cannot read {self.name} as BVH"
        line = line_of(self.text[:begin].tobytes(), begin)
        for offset, text in enumerate(raw.splitlines()):
            for word in text.split():
                shown = word[:40].decode("latin-1")
                here = f"line {line + offset}: "
                if not NUMBER.match(word.decode("latin-1")):
                    hint = " Write decimals with a point." if b"," in word else ""
                    fix = f"Put any number there and name the frame as a gap, or export the clip again.{hint}"
                    return FileError(what, f"{here}{shown!r} is no number", fix)
                if not abs(float(word)) <= VALUE_LIMIT:
                    return FileError(what, f"{here}{shown} is out of every range", "Export the clip again.")
        return FileError(what, f"line {line}: the numbers cannot be read", "Export the clip again.")


def read_text(path: Path) -> tuple[Header, MotionText]:
    """Header and motion text of a BVH file, checked for size, line lengths and numbers per frame.

    The file is read in blocks, so that one without line ends or far too large is refused early.
    Raises FileError for everything that is wrong with it.
    """
    name = path.name
    what = f"cannot read {name} as BVH"
    with path.open("rb") as file:
        size = file.seek(0, 2)
        file.seek(0)
        first = file.read(min(size, HEADER_LIMIT))
        header = parse_header(first, name)
        count = header.frames * header.channels
        left = size - len(header.text)
        if size > FILE_LIMIT:
            fix = "Split it into shorter clips."
            raise FileError(what, f"it is larger than {FILE_LIMIT >> 30} GiB", fix)
        if left < 2 * count:
            if size > COUNTED:
                fix = 'Check the number behind "Frames:", or export the clip again.'
                raise FileError(what, f"{left >> 20} MiB cannot hold {header.frames} frames", fix)
            text = np.frombuffer(first + file.read(), np.uint8)
            raise _truncated(what, header, nth_words(text, len(header.text), header.channels)[1])
        if left > NUMBER_LIMIT * count + BLOCK:
            raise FileError(
                what,
                f"{header.frames} frames of {header.channels} numbers cannot fill {left >> 20} MiB",
                'Check the number behind "Frames:", or export the clip again.',
            )
        text = np.empty(size, np.uint8)
        text[: len(first)] = np.frombuffer(first, np.uint8)
        view, filled, last_end = memoryview(text), len(first), 0  # type: ignore[arg-type]
        last_end = max(first.rfind(b"\n"), first.rfind(b"\r"), len(header.text))
        while True:
            if filled - last_end > LINE_LIMIT:
                line = line_of(text[:last_end].tobytes(), last_end) + 1
                why = f"line {line} is longer than {LINE_LIMIT >> 20} MiB"
                raise FileError(what, why, "A frame is one line of numbers: export the clip again.")
            got = file.readinto(view[filled : filled + BLOCK])
            if not got:
                break
            block = text[filled : filled + got].tobytes()
            end = max(block.rfind(b"\n"), block.rfind(b"\r"))
            last_end = filled + end if end >= 0 else last_end
            filled += got
    text = text[:filled]
    return header, MotionText(text, _frame_starts(text, header, what), np.arange(header.channels), name)


def _truncated(what: str, header: Header, numbers: int) -> FileError:
    whole, rest = divmod(numbers, header.channels)
    piece = f" and {rest} of the {header.channels} numbers of one more" if rest else ""
    return FileError(
        what,
        f"it says {header.frames} frames but holds {whole}{piece}: it is truncated",
        f'Export it again, or write "Frames: {whole}" and delete what is left of the last frame.',
    )


def _frame_starts(text: np.ndarray, header: Header, what: str) -> np.ndarray:
    """(F + 1,) the place of each frame's first number. Frames may be wrapped over lines.

    Raises FileError when there are too few or too many numbers.
    """
    begin, channels = len(header.text), header.channels
    starts, seen = nth_words(text, begin, channels)
    if seen == header.frames * channels:
        lines = _nonblank_lines(text[begin:])
        # Frames may share lines or be wrapped, but one line a frame leaves no doubt about where they begin.
        if lines == header.frames and not _begin_lines(text, starts):
            raise _bad_line(text, header, what)
        return np.append(starts, len(text))
    raise _bad_line(text, header, what, seen)


def _nonblank_lines(text: np.ndarray) -> int:
    """How many lines have something in them, in blocks to save memory."""
    count, empty = 0, True
    for low in range(0, len(text), BLOCK):
        block = text[low : low + BLOCK]
        ends = np.flatnonzero((block == 10) | (block == 13))
        if not len(ends):
            empty = empty and not (block > 32).any()
            continue
        filled = np.add.reduceat(block > 32, np.concatenate([[0], ends]), dtype=np.int64)
        count += int((not empty) or filled[0] > 0) + int((filled[1:-1] > 0).sum())
        empty = filled[-1] == 0
    return count + int(not empty)


def _begin_lines(text: np.ndarray, starts: np.ndarray) -> bool:
    """Whether every frame begins a line."""
    before = text[starts - 1]
    for place in starts[(before != 10) & (before != 13)].tolist():
        while text[place - 1] in b" \t":
            place -= 1
        if text[place - 1] not in b"\r\n":
            return False
    return True


def _bad_line(text: np.ndarray, header: Header, what: str, seen: int = -1) -> FileError:
    """What is wrong with the number of numbers: the first line that stands out, else the total."""
    whole = text.tobytes()
    number, begin = line_of(whole, len(header.text)), len(header.text)
    lines = last = 0
    wrong: tuple[int, int] | None = None
    for offset, line in enumerate(whole[begin:].splitlines()):
        words = line.split()
        if not words:
            continue
        lines, last = lines + 1, number + offset
        for word in words if len(words) != header.channels else ():
            if not NUMBER.match(word.decode("latin-1")):
                shown = word[:40].decode("latin-1")
                why = f"line {number + offset}: {shown!r} is no number"
                return FileError(what, why, "Replace it, or export the clip again.")
        if len(words) != header.channels and wrong is None:
            wrong = number + offset, len(words)
    short = 0 <= seen < header.frames * header.channels
    # A file cut in its last line is truncated, not wrong in that line.
    if wrong is not None and (lines == header.frames or wrong[0] < last):
        return FileError(
            what,
            f"line {wrong[0]} has {wrong[1]} numbers, its channels ask for {header.channels}",
            "Correct that line, or export the clip again.",
        )
    if short:
        return _truncated(what, header, seen)
    frames, more = divmod(seen, header.channels)
    fix = f'Write "Frames: {frames}" if they belong to the clip, or export it again.'
    if more:
        fix = f"Delete what is too much (frames have {header.channels} numbers each), or export it again."
    return FileError(
        what,
        f"it says {header.frames} frames of {header.channels} numbers, but {seen} numbers follow",
        fix,
    )
