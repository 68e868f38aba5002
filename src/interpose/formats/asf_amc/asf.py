"""The skeleton file (.asf): sections of keywords, bones with their axes and degrees of freedom, a hierarchy.

Sources: Schafer, Acclaim Skeleton File Definition V1.10, Acclaim, 1995; Vicon, Acclaim Format - ASF line
Details; Lander, Working with Motion Capture File Formats, Game Developer, January 1998.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path

from interpose.errors import FileError
from interpose.formats.text import NUMBER, number

SIZE_LIMIT = 4 << 20  # bytes
BONE_LIMIT = 2000  # kinematics keep a matrix (joints, joints)
ROOT = "root"
DEGREES_OF_FREEDOM = ("tx", "ty", "tz", "rx", "ry", "rz", "l")
_COMMENT = re.compile(r"(?<![^\s,()])#.*")
_AGAIN = "The file is damaged: export it again."

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Bone:
    """One bone as the file has it, in the file's units; the root is a bone without length.

    Attributes:
        name: as written.
        parent: index of the parent, -1 for the root.
        direction: from its start to its end, in global axes.
        length: of the bone.
        axis: three angles that turn the global axes into those of its degrees of freedom.
        order: the axes of these angles, such as "XYZ": first about the fixed X, then Y, then Z.
        dof: its degrees of freedom in the order of the numbers in the motion file: tx, ty, tz, rx, ry, rz, l.
    """

    name: str
    parent: int
    direction: Vector = (0.0, 0.0, 0.0)
    length: float = 0.0
    axis: Vector = (0.0, 0.0, 0.0)
    order: str = "XYZ"
    dof: tuple[str, ...] = ()


@dataclass(frozen=True)
class Asf:
    """A skeleton file.

    Attributes:
        path: of the file.
        bones: the root and then all bones, depth first as in the hierarchy. The root's `axis` and `order` are
            its preset orientation, its `dof` is its line `order`.
        position: the root's preset position.
        length: the number behind `length` in the units.
        degrees: whether angles are in degrees.
    """

    path: Path
    bones: tuple[Bone, ...]
    position: Vector
    length: float
    degrees: bool


def find_asf(amc: Path) -> Path:
    """The skeleton file beside a motion file.

    walk.asf for walk.amc; else the one whose name the motion's begins with (02.asf for 02_01.amc, HDM_bd.asf
    for HDM_bd_walk_001_120.amc), the longest; else the only one in the folder.

    Raises FileError when that is not enough.
    """
    here = sorted(path for path in amc.parent.iterdir() if path.suffix.lower() == ".asf" and path.is_file())
    stem = amc.stem.lower()
    begins = [path for path in here if _begins(stem, path.stem.lower())]
    if begins:
        return max(begins, key=lambda path: len(path.stem))
    if len(here) == 1:
        return here[0]
    what = f"cannot read {amc.name} without its skeleton"
    fix = "Name it with --skeleton FILE.asf (skeleton= in Python), or put it beside the motion."
    if not here:
        raise FileError(what, f"there is no .asf file in {amc.parent}", fix)
    names = ", ".join(path.name for path in here[:8]) + (", ..." if len(here) > 8 else "")
    raise FileError(what, f"its name fits none of {names}", fix)


def _begins(stem: str, start: str) -> bool:
    """Whether a name begins with another and then ends or goes on with a mark."""
    return bool(start) and stem.startswith(start) and not stem[len(start) : len(start) + 1].isalnum()


def read_asf(path: Path) -> Asf:
    """A skeleton file. Raises FileError, with the line number where there is one, when it is not sound."""
    what = f"cannot read {path.name} as ASF"
    with path.open("rb") as file:
        text = file.read(SIZE_LIMIT + 1)
    if len(text) > SIZE_LIMIT:
        raise FileError(what, f"it is larger than {SIZE_LIMIT >> 20} MiB", "Check that it is an ASF file.")
    if not text.strip():
        raise FileError(what, "the file is empty", "Export the skeleton again.")
    if b"\0" in text:
        raise FileError(what, "it is a binary file", "Export the skeleton as ASF, which is a text format.")
    try:
        decoded = text.removeprefix(b"\xef\xbb\xbf").decode("utf-8")
    except UnicodeDecodeError:
        decoded = text.decode("latin-1")
    parser = _Parser(what)
    for line in re.split(r"\r\n|\n|\r", decoded):
        parser.read_line(line)
    return parser.finish(path)


@dataclass
class _Draft:
    """A bone while it is read: its keywords, and the line it begins at."""

    line: int
    name: str = ""
    vectors: dict[str, Vector] = field(default_factory=dict)
    length: float | None = None
    order: str = "XYZ"
    dof: tuple[str, ...] | None = None


class _Parser:
    """Reads line by line; what is not needed (masses, limits, skins, documentation) is passed over.

    Limits too: "the limit information should not be used to clip data", says the specification.
    """

    def __init__(self, what: str) -> None:
        self.what = what
        self.line = 0
        self.section = ""
        self.seen: set[str] = set()
        self.length, self.degrees = 1.0, True
        self.root = _Draft(0, ROOT)
        self.bones: dict[str, _Draft] = {}  # by name in small letters
        self.open: _Draft | None = None
        self.children: dict[str, list[str]] = {}
        self.parents: dict[str, str] = {}
        self.tree = ""  # "", "begin" or "end"

    def bad(self, why: str, fix: str = _AGAIN) -> FileError:
        return FileError(self.what, f"line {self.line}: {why}", fix)

    def read_line(self, line: str) -> None:
        self.line += 1
        words = re.sub(r"[,()]", " ", _COMMENT.sub("", line)).split()
        if not words:
            return
        if words[0].startswith(":"):
            if self.open:
                raise self.bad(f"{words[0][:40]} stands inside of a bone: its end is missing")
            self.section = words[0][1:].lower()
            self.seen.add(self.section)
        elif not self.section:
            why = f"{words[0][:40]!r} stands before any keyword"
            raise self.bad(why, "Check that it is an ASF file.")
        elif self.section == "units":
            self.read_unit(words[0].lower(), words[1:])
        elif self.section == "root":
            self.read_property(self.root, words[0].lower(), words[1:])
        elif self.section == "bonedata":
            self.read_bone(words[0].lower(), words[1:])
        elif self.section == "hierarchy":
            self.read_hierarchy(words)

    def read_unit(self, key: str, words: list[str]) -> None:
        value = " ".join(words)
        if key == "length":
            length = number(value)
            if length is None or not length > 1e-6:
                raise self.bad(f"the length unit is {value[:40]!r}", "Write for example: length 1.0")
            self.length = length
        elif key == "angle":
            if value.lower() not in ("deg", "rad"):
                raise self.bad(f"the angle unit is {value[:40]!r}", "Write: angle deg, or: angle rad")
            self.degrees = value.lower() == "deg"

    def read_bone(self, key: str, words: list[str]) -> None:
        if key == "begin":
            if self.open:
                raise self.bad("a bone begins inside of another: an end is missing")
            self.open = _Draft(self.line)
        elif self.open is None:
            raise self.bad(f"{key[:40]!r} stands outside of begin and end")
        elif key == "end":
            bone, self.open = self.open, None
            self.line, end = bone.line, self.line
            if not bone.name:
                raise self.bad("the bone that begins here has no name")
            if "direction" not in bone.vectors or bone.length is None:
                missing = "length" if "direction" in bone.vectors else "direction"
                raise self.bad(f"the bone {bone.name} has no {missing}")
            if bone.name.lower() in self.bones or bone.name.lower() == ROOT:
                raise self.bad(f"there are two bones {bone.name}", "Give each a name of its own.")
            if len(self.bones) >= BONE_LIMIT:
                raise self.bad(f"more than {BONE_LIMIT} bones", "interpose reads no larger skeletons.")
            self.bones[bone.name.lower()] = bone
            self.line = end
        else:
            self.read_property(self.open, key, words)

    def read_property(self, bone: _Draft, key: str, words: list[str]) -> None:
        if key == "name":
            bone.name = " ".join(words)
            if len(words) != 1:
                raise self.bad(f"the name is {bone.name[:40]!r}", "A name is one word.")
        elif key == "length":
            bone.length = number(words[0]) if len(words) == 1 else None
            if bone.length is None or bone.length < 0:
                raise self.bad(f"the length is {' '.join(words)[:40]!r}")
        elif key in ("direction", "position", "orientation"):
            bone.vectors[key] = self.vector(key, words)
        elif key == "axis":
            if bone is not self.root:
                bone.vectors[key] = self.vector(key, words[:3])
                words = words[3:]
            order = "".join(words).upper() or "XYZ"
            if sorted(order) != ["X", "Y", "Z"]:
                raise self.bad(f"the order of the axis is {order[:40]!r}", "Write for example XYZ.")
            bone.order = order
        elif key == ("order" if bone is self.root else "dof"):
            bone.dof = tuple(word.lower() for word in words)
            if len(set(bone.dof)) < len(words) or not set(bone.dof) <= set(DEGREES_OF_FREEDOM):
                raise self.bad(
                    f"unknown or repeated degrees of freedom: {' '.join(words)[:60]}",
                    f"They are {', '.join(DEGREES_OF_FREEDOM)}.",
                )
        elif NUMBER.match(key) and bone is self.root:
            raise self.bad(f"cannot understand {key[:40]!r}")

    def vector(self, key: str, words: list[str]) -> Vector:
        values = [number(word) for word in words]
        if len(values) != 3 or None in values:
            raise self.bad(f"{key} needs three numbers, found {' '.join(words)[:60]!r}")
        return tuple(values)  # type: ignore[return-value]

    def read_hierarchy(self, words: list[str]) -> None:
        names = [word.lower() for word in words]
        if names == ["begin"] and not self.tree:
            self.tree = "begin"
        elif names == ["end"] and self.tree == "begin":
            self.tree = "end"
        elif self.tree != "begin":
            raise self.bad(f"{words[0][:40]!r} stands outside of begin and end")
        else:
            for name, word in zip(names, words):
                if name not in self.bones and name != ROOT:
                    raise self.bad(f"there is no bone {word[:40]!r}", "Correct the name, or add the bone.")
            for name, word in zip(names[1:], words[1:]):
                if name in self.parents or name == ROOT:
                    raise self.bad(f"{word} has two parents", "Name each bone once as a child.")
                self.parents[name] = names[0]
                self.children.setdefault(names[0], []).append(name)

    def finish(self, path: Path) -> Asf:
        def whole(why: str, fix: str = _AGAIN) -> FileError:
            return FileError(self.what, why, fix)

        for section in ("root", "bonedata", "hierarchy"):
            if section not in self.seen:
                raise whole(f"it has no section :{section}", "Check that it is a whole ASF file.")
        if self.open:
            raise whole(f"it ends inside of the bone {self.open.name}: it is truncated")
        if self.tree != "end":
            raise whole("its hierarchy has no end: it is truncated")
        if not self.bones:
            raise whole("it has no bones")
        if not self.root.dof:
            fix = "Write for example: order TX TY TZ RX RY RZ"
            raise whole("its root has no order of translations and rotations", fix)
        if "l" in self.root.dof:
            raise whole("its root has the degree of freedom l", "A root has tx, ty, tz, rx, ry, rz.")

        zero = (0.0, 0.0, 0.0)
        bones = [
            Bone(
                ROOT,
                -1,
                axis=self.root.vectors.get("orientation", zero),
                order=self.root.order,
                dof=self.root.dof,
            )
        ]
        waiting = [(name, 0) for name in reversed(self.children.get(ROOT, []))]
        while waiting:
            name, parent = waiting.pop()
            one = self.bones[name]
            direction, length = one.vectors["direction"], one.length or 0.0
            if length and not any(direction):
                raise whole(f"the direction of {one.name} is zero, its length is not")
            waiting += [(child, len(bones)) for child in reversed(self.children.get(name, []))]
            axis = one.vectors.get("axis", zero)
            bones.append(Bone(one.name, parent, direction, length, axis, one.order, one.dof or ()))
        if len(bones) <= len(self.bones):
            loose = [bone.name for name, bone in self.bones.items() if name not in self.parents]
            name = loose[0] if loose else next(iter(self.bones.values())).name
            raise whole(f"its hierarchy does not join {name} to the root", "Add it to its parent's line.")
        if not any(bone.length for bone in bones):
            raise whole("all its bones have length zero", "Export the skeleton again.")
        return Asf(path, tuple(bones), self.root.vectors.get("position", zero), self.length, self.degrees)
