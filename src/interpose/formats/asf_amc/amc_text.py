"""The motion file (.amc): a few keywords, then frames of lines, each a bone's name and its numbers."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from interpose.errors import FileError, is_number
from interpose.formats.asf_amc.asf import Asf
from interpose.formats.text import NUMBER, VALUE_LIMIT, FrameText, line_of, nth_words, number
from interpose.geometry.time import FASTEST, SLOWEST

FILE_LIMIT = 512 << 20  # bytes: more than an hour at 120 frames a second
_COMMENT = re.compile(rb"(?<![^\s,()])#[^\r\n]*")
_LINE = re.compile(rb"[^\r\n]+")
_BLANKS = bytes.maketrans(b",()", b"   ")
_AGAIN = "Correct that line, or export the clip again."
_NAME = "Name the skeleton file (--skeleton FILE.asf; skeleton= in Python)"


@dataclass(frozen=True, eq=False)
class AmcText(FrameText):
    """The frames of a motion file as it has them.

    Attributes:
        names: the words of a frame that are bone names, by their place in it; word 0 is the frame's number.
        first, step: the number of the first frame, and by how much it grows from frame to frame.
    """

    names: dict[int, bytes]
    first: int
    step: int

    @property
    def words(self) -> int:
        """How many words a frame has."""
        return 1 + len(self.names) + len(self.columns)

    def values(self, start: int, stop: int) -> np.ndarray:
        """(stop - start, C) numbers of the frames.

        Raises FileError when a frame is not made like the first one or has something else than numbers.
        """
        raw = _blanked(self.raw(start, stop))
        words, every, count = raw.split(), self.words, stop - start
        sound = len(words) == count * every
        sound = sound and all(set(words[place::every]) == {name} for place, name in self.names.items())
        expected = [self.first + self.step * frame for frame in range(start, stop)]
        if sound and list(map(_frame_number, words[::every])) == expected:
            table = np.array(words, object).reshape(count, every)[:, self.columns]
            flat = table.ravel().tolist()
            if all(NUMBER.match(word.decode("latin-1")) for word in flat):
                numbers = np.array([float(word) for word in flat])
                if np.abs(numbers).max() <= VALUE_LIMIT:
                    return numbers.reshape(count, -1)
        raise self._bad(start)

    def _bad(self, start: int) -> FileError:
        """What is wrong in the first frame from `start` on that is not like the first one."""
        return _bad_frame(self.text.tobytes(), int(self.starts[start]), self, start)

    def lines(self, start: int, stop: int, frame: int, line_end: bytes | None) -> bytes:
        """As of every text; frames are numbered anew where they are others."""
        if start == frame:
            return super().lines(start, stop, frame, line_end)
        texts = [super(AmcText, self).lines(one, one + 1, one, line_end) for one in range(start, stop)]
        numbers = [b"%d" % (self.first + self.step * (frame + i)) for i in range(len(texts))]
        return b"".join(re.sub(rb"^\d+", number, text) for number, text in zip(numbers, texts))


@dataclass(frozen=True)
class AmcHeader:
    """What stands before the first frame.

    Attributes:
        degrees: whether angles are in degrees; None when the file does not say.
        fps: frames a second, None when the file does not say (they rarely do).
        fps_at: where that number stands in the text.
    """

    degrees: bool | None
    fps: float | None
    fps_at: tuple[int, int]


def _frame_number(word: bytes) -> int:
    """The number of a frame, -1 for what is none."""
    return int(word) if word.isdigit() and len(word) < 12 else -1


def _blanked(text: bytes) -> bytes:
    """The text with blanks for comments, commas and parentheses; as long as before."""
    if b"#" in text:
        text = _COMMENT.sub(lambda match: b" " * len(match[0]), text)
    return text.translate(_BLANKS)


def read_amc(path: Path, asf: Asf) -> tuple[AmcHeader, AmcText, dict[tuple[int, str], int]]:
    """Header and frames of a motion file, checked for size and for the words of a frame.

    Also returns the column of each degree of freedom, by joint and token. Bones without numbers in the first
    frame have none in any. Raises FileError for everything that is wrong with the file but what
    `AmcText.values` finds later.
    """
    what = f"cannot read {path.name} as AMC"
    if path.stat().st_size > FILE_LIMIT:
        fix = "Split it into shorter clips."
        raise FileError(what, f"it is larger than {FILE_LIMIT >> 20} MiB", fix)
    text = path.read_bytes()
    if not text.strip():
        raise FileError(what, "the file is empty", "Export the clip again.")
    if b"\0" in text:
        raise FileError(what, "it is a binary file", "Export the clip as AMC, which is a text format.")
    blanked = _blanked(text)
    if blanked.startswith(b"\xef\xbb\xbf"):
        blanked = b"   " + blanked[3:]
    header, begin = _read_header(blanked, what)
    names, columns = _first_frame(blanked, begin, asf, what)

    words = 1 + len(names) + len(columns)
    starts, seen = nth_words(np.frombuffer(b" " + blanked, np.uint8), begin + 1, words)
    starts -= 1
    first = int(blanked[begin:].split(None, 1)[0])
    step = 1
    if len(starts) > 1:
        word = blanked[int(starts[1]) :].split(None, 1)[0]
        step = max(1, _frame_number(word) - first)
    numbers = np.array(sorted(set(range(1, words)) - set(names)))
    motion = AmcText(
        np.frombuffer(text, np.uint8), np.append(starts, len(text)), numbers, path.name, names, first, step
    )
    if seen % words:
        raise _bad_frame(text, begin, motion, 0)
    return header, motion, columns


def _read_header(text: bytes, what: str) -> tuple[AmcHeader, int]:
    """What the keywords say, and where the first frame begins."""
    degrees, fps, fps_at = None, None, (0, 0)
    for match in _LINE.finditer(text):
        words = match[0].split()
        if not words:
            continue
        key = words[0].decode("latin-1").lower()
        line = f"line {line_of(text, match.start())}: "
        if len(words) == 1 and _frame_number(words[0]) >= 0:
            return AmcHeader(degrees, fps, fps_at), text.index(words[0], match.start())
        if not key.startswith(":"):
            why = f"{line}{key[:40]!r} stands where keywords or the first frame's number should"
            raise FileError(what, why, "Check that it is an AMC file.")
        if key in (":degrees", ":radians"):
            degrees = key == ":degrees"
        elif key == ":samples-per-second":
            word = words[1].decode("latin-1") if len(words) > 1 else ""
            fps = number(word)
            if not is_number(fps, SLOWEST, FASTEST):
                why = f"{line}the frame rate is {word[:40]!r}"
                raise FileError(what, why, "Write for example :SAMPLES-PER-SECOND 120")
            begin = text.index(words[1], match.start() + len(words[0]))
            fps_at = begin, begin + len(words[1])
    raise FileError(what, "it has no frames", "Export the clip with its motion.")


def _first_frame(
    text: bytes, begin: int, asf: Asf, what: str
) -> tuple[dict[int, bytes], dict[tuple[int, str], int]]:
    """The places of the names in a frame, and the column of each degree of freedom."""
    joints = {bone.name.lower(): joint for joint, bone in enumerate(asf.bones)}
    names: dict[int, bytes] = {}
    columns: dict[tuple[int, str], int] = {}
    seen: set[int] = set()
    place = 1
    for index, match in enumerate(_LINE.finditer(text, begin)):
        words = match[0].split()
        if not words:
            continue
        if index and len(words) == 1 and words[0].isdigit():
            break
        if not index:
            continue  # the frame's number
        name = words[0].decode("latin-1")
        line = f"line {line_of(text, match.start())}: "
        joint = joints.get(_name(words[0]).lower())
        if joint is None:
            why = f"{line}{asf.path.name} has no bone {name[:40]!r}"
            raise FileError(what, why, f"{_NAME} that belongs to it.")
        if joint in seen:
            raise FileError(what, f"{line}{name} stands twice in one frame", _AGAIN)
        seen.add(joint)
        dof = asf.bones[joint].dof
        if len(words) - 1 != len(dof):
            said = f"{asf.path.name} gives it {len(dof)} ({' '.join(dof)})" if dof else "its skeleton none"
            fix = f"Correct that line. Or: {_NAME} that belongs to it."
            raise FileError(what, f"{line}{name} has {len(words) - 1} numbers, {said}", fix)
        names[place] = words[0]
        place += len(words)
        columns |= {(joint, token): len(columns) + i for i, token in enumerate(dof)}
    if not any(joint == 0 for joint, _ in columns):
        raise FileError(what, "its first frame has no root", "Export the clip again.")
    return names, columns


def _name(word: bytes) -> str:
    try:
        return word.decode("utf-8")
    except UnicodeDecodeError:
        return word.decode("latin-1")


def _bad_frame(text: bytes, begin: int, motion: AmcText, frame: int) -> FileError:
    """What is wrong with the first frame from `frame` on, at the byte `begin`, that is not sound."""
    what = f"cannot read {motion.name} as AMC"
    places = sorted(motion.names)
    lines = [
        (motion.names[place], end - place - 1) for place, end in zip(places, [*places[1:], motion.words])
    ]
    at = 0  # the line of the frame that comes next; 0 is its number
    blanked = _blanked(text)
    for match in _LINE.finditer(blanked, begin):
        words = match[0].split()
        if not words:
            continue
        line = f"line {line_of(text, match.start())}: "
        shown = words[0][:40].decode("latin-1")
        expected = motion.first + motion.step * frame
        if len(words) == 1 and words[0].isdigit():
            if at:
                missing = lines[at - 1][0].decode("latin-1")
                why = f"{line}frame {expected} ends before {missing}, which the first frame has there"
                return FileError(what, why, "Every frame must list the same bones in the same order.")
            if _frame_number(words[0]) != expected:
                why = f"{line}frame {shown[:20]} stands where frame {expected} should"
                return FileError(what, why, "Number the frames one by one; fill what is missing as a gap.")
            at = 1
            continue
        if not at:
            why = f"{line}{shown!r} stands where the number of frame {expected} should"
            return FileError(what, why, _AGAIN)
        name, count = lines[at - 1]
        if words[0] != name:
            why = f"{line}{shown!r} stands where the first frame has {name.decode('latin-1')}"
            return FileError(what, why, "Every frame must list the same bones in the same order.")
        for word in words[1:]:
            shown = word[:40].decode("latin-1")
            if not NUMBER.match(word.decode("latin-1")):
                fix = "Put any number there and name the frame as a gap, or export the clip again."
                return FileError(what, f"{line}{shown!r} is no number", fix)
            if not abs(float(word)) <= VALUE_LIMIT:
                return FileError(what, f"{line}{shown} is out of every range", "Export the clip again.")
        if len(words) - 1 != count:
            name_shown = name.decode("latin-1")
            why = f"{line}{name_shown} has {len(words) - 1} numbers, in the first frame {count}"
            return FileError(what, why, _AGAIN)
        at = (at + 1) % (len(lines) + 1)
        frame += at == 0
    if at:
        why = f"frame {motion.first + motion.step * frame} lacks its last bones: it is truncated"
        return FileError(what, why, "Delete what is left of that frame, or export the clip again.")
    return FileError(what, "its lines are not one bone each", "Export the clip again.")
