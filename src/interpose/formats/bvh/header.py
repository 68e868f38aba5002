"""The upper part of a BVH file: hierarchy, number of frames and frame time.

Source: Meredith and Maddock, Motion Capture File Formats Explained, University of Sheffield, 2001.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field

import numpy as np

from interpose.errors import FileError
from interpose.formats.text import line_of, number
from interpose.geometry.time import FASTEST

HEADER_LIMIT = 4 << 20  # bytes: what comes before the first number of the motion
JOINT_LIMIT = 2000  # kinematics keep a matrix (joints, joints)

_CHANNEL = re.compile(r"([XYZ])(position|rotation)\Z", re.IGNORECASE)
_MOTION = re.compile(rb"(?:\A|[\r\n])[ \t]*MOTION[ \t]*(?=[\r\n]|\Z)", re.IGNORECASE)
_FRAMES = re.compile(rb"\s*Frames[ \t]*:?[ \t]*([^\s:]+)[ \t]*(?=[\r\n]|\Z)", re.IGNORECASE)
_FRAME_TIME = re.compile(rb"\s*Frame[ \t]*Time[ \t]*:?[ \t]*([^\s:]+)[ \t]*(?=[\r\n]|\Z)", re.IGNORECASE)

# Seconds that a frame may take: what takes longer is no motion, or in milliseconds (4.17 of 240 a second).
LONGEST = 4.0
# Rates that people record and deliver at: a rounded frame time such as 0.033333 means one of these.
RATES = (
    *(10, 12, 12.5, 15, 20, 24000 / 1001, 24, 25, 30000 / 1001, 30, 48, 50, 60000 / 1001, 60, 72, 75, 90),
    *(100, 120000 / 1001, 120, 125, 144, 150, 180, 200, 240, 250, 300, 360, 400, 480, 500, 600, 1000),
)


@dataclass
class Node:
    """One ROOT or JOINT as the file has it, in the file's units and axes.

    Attributes:
        name: as written; may occur twice in a file.
        parent: index of the parent, -1 for a ROOT.
        offset: the three numbers of OFFSET.
        channels: pairs of kind ("position" or "rotation") and axis ("X", "Y", "Z"), in file order.
        ends: the offsets of its End Sites.
    """

    name: str
    parent: int
    offset: tuple[float, ...] = ()
    channels: tuple[tuple[str, str], ...] | None = None
    ends: list[tuple[float, ...]] = field(default_factory=list)


@dataclass(frozen=True)
class Header:
    """Everything before the first number of the motion.

    Attributes:
        text: the original bytes.
        nodes: the joints in file order, parents first.
        frames: the number behind "Frames:".
        fps: frames a second; the usual rate that a rounded frame time stands for, else its inverse.
        frames_at, time_at: where in `text` the number of frames and the frame time stand.
    """

    text: bytes
    nodes: tuple[Node, ...]
    frames: int
    fps: float
    frames_at: tuple[int, int]
    time_at: tuple[int, int]

    @property
    def channels(self) -> int:
        """How many numbers a frame has."""
        return sum(len(node.channels or ()) for node in self.nodes)


def parse_header(start: bytes, name: str) -> Header:
    """The header from the first bytes of a file (at most HEADER_LIMIT of them are looked at).

    Raises FileError, with the line number where there is one, when it is no BVH header.
    """
    what = f"cannot read {name} as BVH"
    start = start[:HEADER_LIMIT]
    if not start.strip():
        raise FileError(what, "the file is empty", "Export the clip again.")
    if b"\0" in start:
        raise FileError(what, "it is a binary file", "Export the clip as BVH, which is a text format.")
    hierarchy = start.removeprefix(b"\xef\xbb\xbf").lstrip()
    if not hierarchy[:9].upper() == b"HIERARCHY":
        raise FileError(what, "it does not begin with HIERARCHY", "Check that it is a BVH file.")
    motion = _MOTION.search(start)
    if motion is None:
        limit = f" in its first {HEADER_LIMIT >> 20} MiB" if len(start) == HEADER_LIMIT else ""
        raise FileError(
            what, f"there is no MOTION line{limit}", "The file is truncated or damaged: export it again."
        )
    nodes = _parse_hierarchy(start[: motion.start()], what)

    frames = _FRAMES.match(start, motion.end())
    if frames is None or not frames[1].isdigit() or len(frames[1]) > 12:
        line = line_of(start, motion.end()) + 1
        raise FileError(
            what, f"line {line}: no number of frames", 'Below MOTION must stand "Frames:" and a number.'
        )
    time = _FRAME_TIME.match(start, frames.end())
    seconds = number(time[1].decode("latin-1")) if time else None
    if time is None or seconds is None or not seconds > 0 or not math.isfinite(1 / seconds):
        line = line_of(start, frames.end()) + 1
        shown = f"the frame time is {time[1][:40].decode('latin-1')}" if time else "no frame time"
        raise FileError(
            what, f"line {line}: {shown}", 'Write "Frame Time:" and the seconds, for example 0.0333333.'
        )
    if 1 / seconds > FASTEST:
        line = line_of(start, frames.end()) + 1
        raise FileError(
            what,
            f"line {line}: a frame takes {seconds:g} seconds",
            'Write "Frame Time:" and the seconds, for example 0.0333333.',
        )
    if seconds > LONGEST:
        line = line_of(start, frames.end()) + 1
        raise FileError(
            what,
            f"line {line}: a frame takes {seconds:g} seconds",
            f'Were frames a second meant? Then write "Frame Time: {1 / seconds:.7g}". Or milliseconds? Then '
            f'"Frame Time: {seconds / 1000:g}".',
        )
    if int(frames[1]) == 0:
        raise FileError(what, "its motion has no frames (Frames: 0)", "Export the clip with its motion.")
    return Header(
        start[: time.end()],
        tuple(nodes),
        int(frames[1]),
        _rate(time[1].decode("latin-1"), seconds),
        frames.span(1),
        time.span(1),
    )


def _rate(text: str, seconds: float) -> float:
    """Frames a second: the usual rate within one unit of the last written decimal, else 1 / seconds."""
    mantissa, _, exponent = text.lower().partition("e")
    unit = 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))

    def error(rate: float) -> float:
        return abs(1 / rate - seconds)

    # What rounds to the number that is written before what is cut off to it; 60 before 59.94 where both do.
    near = float(min(RATES, key=lambda rate: (error(rate) > 0.501 * unit, rate % 1 > 0, error(rate))))
    near = near if error(near) <= 0.501 * unit else float(min(RATES, key=error))
    return near if error(near) <= 1.001 * unit and error(near) < 0.02 * seconds else 1 / seconds


def _parse_hierarchy(text: bytes, what: str) -> list[Node]:
    reading = _Hierarchy(what)
    for line in text.removeprefix(b"\xef\xbb\xbf").splitlines():
        try:
            decoded = line.decode("utf-8")
        except UnicodeDecodeError:
            decoded = line.decode("latin-1")
        reading.line(decoded)
    return reading.done()


class _Hierarchy:
    """A hierarchy as it is read line by line.

    Attributes:
        nodes: the joints so far.
        blocks: open ones: the index of a joint, or None for an End Site.
        ahead: the index of a joint, or None of an End Site, that waits for its brace; `waiting` says that
            something does.
    """

    def __init__(self, what: str) -> None:
        self.what, self.at = what, 0
        self.nodes: list[Node] = []
        self.blocks: list[int | None] = []
        self.ahead: int | None = None
        self.waiting = False

    def bad(self, why: str, fix: str = "The file is damaged: export it again.") -> FileError:
        """What is wrong with the line that is being read."""
        return FileError(self.what, f"line {self.at}: {why}", fix)

    def line(self, text: str) -> None:
        """Read a line; several statements may stand in it."""
        self.at += 1
        words = text.replace("{", " { ").replace("}", " } ").split()
        statements = {"ROOT": self._joint, "JOINT": self._joint, "END": self._end}
        statements |= {"OFFSET": self._offset, "CHANNELS": self._channels}
        while words:
            key = words.pop(0)
            word = key.upper()
            if word == "{":
                self._open()
            elif self.waiting:
                raise self.bad(f'"{{" expected, found {key[:40]!r}')
            elif word == "}":
                self._close()
            elif word in statements:
                words = statements[word](word, words)
            elif word != "HIERARCHY" or self.nodes:
                raise self.bad(f"cannot understand {key[:40]!r}")

    def _open(self) -> None:
        if not self.waiting:
            raise self.bad("a brace opens where none is expected")
        self.blocks.append(self.ahead)
        self.waiting = False

    def _close(self) -> None:
        if not self.blocks:
            raise self.bad("a brace closes that was never opened")
        closed = self.blocks.pop()
        if closed is not None and not self.nodes[closed].offset:
            raise self.bad(f"{self.nodes[closed].name} has no OFFSET")

    def _joint(self, word: str, words: list[str]) -> list[str]:
        """ROOT or JOINT, and the words of its name; those that are left come back, as from all statements."""
        parent = self.blocks[-1] if self.blocks else -1
        if (word == "ROOT") != (not self.blocks) or parent is None:
            raise self.bad(f"{word} stands at the wrong place")
        brace = words.index("{") if "{" in words else len(words)
        self.ahead, self.waiting = len(self.nodes), True
        self.nodes.append(Node(" ".join(words[:brace]) or f"joint{self.ahead}", parent))
        if len(self.nodes) > JOINT_LIMIT:
            raise self.bad(f"more than {JOINT_LIMIT} joints", "interpose reads no larger skeletons.")
        return words[brace:]

    def _end(self, _: str, words: list[str]) -> list[str]:
        """End Site, whatever it is called."""
        if not self.blocks or self.blocks[-1] is None:
            raise self.bad("an End Site stands at the wrong place")
        self.ahead, self.waiting = None, True
        return words[words.index("{") :] if "{" in words else []

    def _offset(self, _: str, words: list[str]) -> list[str]:
        values = [number(w) for w in words[:3]]
        if len(values) < 3 or None in values or (len(words) > 3 and words[3] != "}"):
            raise self.bad(f"OFFSET needs three numbers, found {' '.join(words)[:60]!r}")
        offset = tuple(float(v) for v in values)  # type: ignore[arg-type]
        if not self.blocks:
            raise self.bad("OFFSET stands outside of a joint")
        joint = self.blocks[-1]
        if joint is None:
            owner = next(b for b in reversed(self.blocks) if b is not None)
            self.nodes[owner].ends.append(offset)
        elif self.nodes[joint].offset:
            raise self.bad(f"{self.nodes[joint].name} has two OFFSETs")
        else:
            self.nodes[joint].offset = offset
        return words[3:]

    def _channels(self, _: str, words: list[str]) -> list[str]:
        joint = self.blocks[-1] if self.blocks else None
        if joint is None or self.nodes[joint].channels is not None:
            raise self.bad("CHANNELS stands at the wrong place")
        count = int(words[0]) if words and re.fullmatch("[0-9]{1,3}", words[0]) else -1
        given = words[1 : words.index("}")] if "}" in words else words[1:]
        if count != len(given):
            said = words[0][:20] if words else "nothing"
            raise self.bad(f"CHANNELS says {said}, {len(given)} names follow")
        found = [_CHANNEL.match(w) for w in given]
        if not all(found) or len({w.lower() for w in given}) < len(given):
            raise self.bad(
                f"unknown or repeated channels: {' '.join(given)[:80]}",
                "Channels are Xposition, Yposition, Zposition, Xrotation, Yrotation, Zrotation.",
            )
        self.nodes[joint].channels = tuple((m[2].lower(), m[1].upper()) for m in found if m)
        return words[1 + count :]

    def done(self) -> list[Node]:
        """All joints; FileError where they are no skeleton that moves."""
        nodes = self.nodes
        if self.blocks or self.waiting:
            raise self.bad("braces do not balance: the hierarchy ends inside of a joint")
        if not nodes:
            raise self.bad("there is no ROOT")
        if not any(node.channels for node in nodes):
            raise self.bad("no joint has channels")
        bones = [node.offset for node in nodes if node.parent >= 0]
        moved = any(kind == "position" for n in nodes if n.parent >= 0 for kind, _ in n.channels or ())
        if bones and not moved and not np.any(bones):
            raise FileError(self.what, "all its bones have length zero", "Export the clip with its skeleton.")
        return nodes
