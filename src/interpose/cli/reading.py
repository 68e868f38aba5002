"""The options of every verb that reads a clip, and what is said of the clip."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from shlex import join
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Group, Parameter

from interpose.errors import FileError, RequestError

if TYPE_CHECKING:
    from interpose.clip import Clip


@Parameter(
    name="*",
    group=Group("How to read the file (if not given: detected or estimated, and printed)", sort_key=8),
)
@dataclass(frozen=True)
class Reading:
    """How to read a file that leaves something open."""

    unit: Annotated[str | None, Parameter(help="m, cm, mm, inch, CMU, or metres per unit.")] = None
    up: Annotated[str | None, Parameter(help="The axis that points up: y, z, x; --up=-y and so on.")] = None
    joint_positions: Annotated[
        str | None,
        Parameter(help="Position channels of joints replace their OFFSET, or add to it: replace or add."),
    ] = None
    skeleton: Annotated[
        Path | None, Parameter(help="The .asf file that an .amc file belongs to, if it is not beside it.")
    ] = None
    file_fps: Annotated[
        float | None, Parameter(help="Frame rate of an .amc file, which does not store it; default 120.")
    ] = None
    map: Annotated[
        Path | None,
        Parameter(help="A JSON file that says which joint is which; `interpose skeleton` writes one."),
    ] = None
    handed: Annotated[
        Literal["left", "right"] | None,
        Parameter(help="Whether the file's axes are left- or right-handed."),
    ] = None
    root: Annotated[
        str | None, Parameter(help="The root joint of the character to use, if a file has several.")
    ] = None

    def named(self, path: Path, part: str = "") -> str:
        """A file, or a part of one, on a command line that reads it in the same way."""
        said = {field.name: getattr(self, field.name) for field in fields(self)}
        options = [f"--{name.replace('_', '-')}={value}" for name, value in said.items() if value is not None]
        return join([f"{path}#{part}" if part else str(path), *options])

    def load(self, path: Path, roles: Mapping[str, str] = MappingProxyType({})) -> Clip:
        """The clip in a file; `roles` of its joints stand where no --map is given."""
        from interpose.formats import load
        from interpose.skeletons import find_mapping
        from interpose.skeletons.mapfile import read_map

        if path.is_dir():  # whatever its name ends in
            raise FileError(f"cannot read {path}", "it is a directory", "Name one file in it.")
        said = read_map(self.map) if self.map else dict(roles)
        if self.root is not None:
            said["root"] = self.root
        if self.handed is not None:
            said["hand"] = self.handed
        clip = load(path, self.unit, self.up, self.joint_positions, self.skeleton, self.file_fps, said)
        find_mapping(clip.skeleton)  # says what is wrong with the roles, before anything else is done
        return clip

    def load_all(self, paths: Sequence[Path]) -> list[Clip]:
        """The clips in several files, of different rigs perhaps: --map and --root are of those in which their
        joints are, and of one at least; what only some formats need to be told is said of these."""
        found = {path: self._of(path, paths).load_fitting(path) for path in dict.fromkeys(paths)}
        wrong = [error for _, error in found.values()]
        if all(wrong) and wrong[0]:
            raise wrong[0]
        return [found[path][0] for path in paths]

    def _of(self, path: Path, paths: Sequence[Path]) -> Reading:
        """What is said of one of several files: not what its format says, if that of another does not."""
        from interpose.formats import FORMATS

        told = {one: FORMATS[one.suffix.lower()].options for one in paths if one.suffix.lower() in FORMATS}
        options = ("unit", "up", "joint_positions", "skeleton", "fps")
        fields = {"file_fps" if option == "fps" else option: option for option in options}
        others = [
            field
            for field, option in fields.items()
            if option not in told.get(path, (option,)) and any(option in one for one in told.values())
        ]
        return replace(self, **dict.fromkeys(others))

    def load_fitting(self, path: Path) -> tuple[Clip, RequestError | None]:
        """The clip in one of several files, and why --map or --root are not of it, if they are not."""
        try:
            return self.load(path), None
        except RequestError as error:
            if self.map is None and self.root is None:
                raise
            return replace(self, map=None, root=None).load(path), error


def split_names(texts: list[str]) -> tuple[str, ...]:
    """Names from options that hold one or several, separated by commas."""
    return tuple(name.strip() for text in texts for name in text.split(",") if name.strip())


def full_names(names: Iterable[str], clip: Clip) -> tuple[str, ...]:
    """Names of joints as the skeleton has them: LeftArm is mixamorig:LeftArm, if that is the only one."""
    own, bare = clip.skeleton.names, dict[str, list[str]]()
    for name in own:
        bare.setdefault(name.rpartition(":")[2], []).append(name)
    return tuple(bare[n][0] if n not in own and len(bare.get(n, ())) == 1 else n for n in names)


def joints_of(texts: list[str], clip: Clip) -> tuple[str, ...] | None:
    """The joints of --joints, by their full names; None without any. RequestError where it names none."""
    if texts and not split_names(texts):
        raise RequestError(
            "--joints names no joint", "nothing follows it", "Write --joints LeftArm,LeftHand."
        )
    return full_names(split_names(texts), clip) or None


def describe(path: Path, clip: Clip) -> list[str]:
    """What was read, and what was estimated, for a person."""
    size = f"{len(clip)} frames at {clip.fps:.4g} fps ({clip.seconds:.1f} s), {len(clip.skeleton)} joints"
    lines: tuple[str, ...] = clip.source.describe() if hasattr(clip.source, "describe") else ()
    return [f"{path}: {size}", *(f"  {line}" for line in (*lines, understood(clip)))]


# Metres that legs may be long: of a toddler, and of a giant.
PERSON = 0.15, 3.0


def understood(clip: Clip) -> str:
    """How the skeleton is understood, in a line."""
    from interpose.skeletons import find_humanoid

    body = find_humanoid(clip)
    if not body.mapping.usable:
        return f"skeleton: no humanoid, nothing was found for {', '.join(body.mapping.lacking)}"
    ways = {
        "given": "as the map says",
        "name": "by names",
        "chain": "by names",
        "shape": "by its shape: check it",
    }
    way = ways[body.mapping.surely]
    hand = ", left-handed" if body.left_handed else ""
    leg = body.mapping.leg_length
    odd = "" if PERSON[0] < leg < PERSON[1] else f"; its leg is {leg:.3g} m long: check --unit"
    return f"skeleton: a humanoid, {len(body.mapping.mapped[0])} of 22 joints found {way}{hand}{odd}"


def details(clip: Clip) -> dict[str, Any]:
    """The same for a program: how to read the file in the same way again."""
    found: dict[str, Any] = {"frames": len(clip), "fps": clip.fps, "joints": len(clip.skeleton)}
    if clip.skeleton.roles:
        found["roles"] = dict(clip.skeleton.roles)
    source = clip.source
    if hasattr(source, "unit"):
        found |= {"unit": source.unit, "unit_how": source.unit_how, "up": source.up, "up_how": source.up_how}
    if getattr(source, "positions", "none") != "none":
        found |= {"joint_positions": source.positions, "joint_positions_how": source.positions_how}
    if hasattr(source, "asf"):
        found |= {"skeleton": str(source.asf.path), "skeleton_how": source.asf_how}
        found |= {"file_fps": source.fps, "file_fps_how": source.fps_how}
    return found
