"""Files: one module or package a format, and the two verbs that choose among them by suffix."""

from __future__ import annotations

import difflib
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from interpose.clip import Clip
from interpose.errors import FileError, RequestError, unfit
from interpose.formats import asf_amc, bvh, npz
from interpose.formats.whole import replacing

__all__ = ["FORMATS", "Format", "held", "load", "save", "saving"]


class Format(NamedTuple):
    """How a format is read and written, and which options of `load` it takes.

    `read(path, **options) -> Clip`; `write(clip, binary stream) -> notes` on what the format cannot hold.
    """

    read: Callable[..., Clip]
    write: Callable[..., tuple[str, ...]]
    options: tuple[str, ...] = ()


FORMATS = {
    ".bvh": Format(bvh.read, bvh.write, ("unit", "up", "joint_positions", "roles")),
    ".npz": Format(npz.read, npz.write, ("roles",)),
    ".amc": Format(asf_amc.read, asf_amc.write, ("unit", "up", "skeleton", "fps", "roles")),
}


def load(
    path: str | Path,
    unit: float | str | None = None,
    up: str | None = None,
    joint_positions: str | None = None,
    skeleton: str | Path | None = None,
    fps: float | None = None,
    roles: Mapping[str, str] | None = None,
) -> Clip:
    """Read a clip from a file; the suffix says how (.bvh, .npz, .amc). Metres and Y up inside.

    Args:
        path: the file.
        unit: metres per unit of the file, or m, cm, mm, inch, CMU. Estimated when None.
        up: the file's up axis: y, z, x, or -y, ... Estimated when None.
        joint_positions: "replace" or "add": what position channels do to a joint's rest translation.
            Estimated when None.
        skeleton: the .asf file that an .amc file belongs to. Found beside it when None.
        fps: frames a second of an .amc file, which does not say it. 120 when None.
        roles: what is to be said about the joints: canonical joint to own joint, "root", and "hand": "left"
            for a left-handed file; see `Skeleton`.

    What was estimated stands in `clip.source` (a `bvh.BvhSource` or `asf_amc.AmcSource`; its `describe()`
    gives lines to print).

    Raises:
        FileError: the file is missing, unreadable or damaged; the message says what to do.
        RequestError: the suffix or an option is wrong.
    """
    path = _path(path)
    chosen = _format(path)
    if roles is not None and not isinstance(roles, Mapping):
        raise RequestError(
            f"cannot use roles={roles!r}", "it is no mapping", 'Give for example roles={"Hips": "pelvis"}.'
        )
    options: dict[str, Any] = {"unit": unit, "up": up, "joint_positions": joint_positions}
    options |= {"skeleton": skeleton, "fps": fps, "roles": roles or None}
    options = {name: value for name, value in options.items() if value is not None}
    for name in options:
        if name not in chosen.options:
            raise RequestError(
                f"{name} does not apply to {path.name}",
                f"{path.suffix} files say it themselves",
                "Leave the option out.",
            )
    _check_readable(path)
    if skeleton is not None:
        _check_readable(_path(skeleton, "skeleton"))
    try:
        return chosen.read(path, **options)
    except OSError as error:
        raise FileError(f"cannot read {path}", error.strerror or str(error), "Check the file.") from None


def held(clip: Clip, source: Any) -> Clip:
    """The clip with the rotations that a file of the format it came from can hold: joints of AMC turn about
    fewer axes than three. `source` is that of the clip as it was read."""
    if not isinstance(source, asf_amc.AmcSource) or source.skeleton.parents != clip.skeleton.parents:
        return clip
    return clip.with_motion(source.layout.held(clip.rotation, clip.skeleton.parents), clip.translation)


def axes(clip: Clip, source: Any) -> dict[int, np.ndarray]:
    """The axes of joints that turn about fewer than three in a file as in `held`: of each (F, 3, k) unit
    vectors in the axes of its parent, as the joints above and its own first turns have them."""
    if not isinstance(source, asf_amc.AmcSource) or source.skeleton.parents != clip.skeleton.parents:
        return {}
    return source.layout.axes(clip.rotation)


def save(clip: Clip, path: str | Path, force: bool = False) -> tuple[str, ...]:
    """Write a clip to a file, whole or not at all; the suffix says how (.bvh, .npz, .amc).

    A clip that was read from BVH or AMC keeps that file's layout and the text of every number that did not
    change.

    Args:
        clip: the clip.
        path: where to; its folder must exist.
        force: replace an existing file.

    Returns:
        Notes on what the format cannot hold, and what else a file needs to be read; usually none.

    Raises:
        RequestError: the suffix is unknown, the folder is missing, the file exists and `force` is False,
            the clip has no frames, or is none that the format can hold (.amc needs one read from .amc).
        FileError: the file cannot be written.
    """
    if not isinstance(clip, Clip):
        hint = "Give its .clip." if isinstance(getattr(clip, "clip", None), Clip) else "Give a clip."
        raise RequestError(f"cannot write a {type(clip).__name__}", "it is no Clip", hint)
    if not isinstance(force, bool | np.bool_ | int):
        raise unfit("force", force, "True or False")
    with saving(clip, _path(path), force) as notes:
        pass
    return notes


@contextmanager
def saving(clip: Clip, path: Path, force: bool = False) -> Iterator[tuple[str, ...]]:
    """As `save`, whose notes it gives; the file takes its place at the end, so that several do together."""
    chosen = _format(path)
    if not len(clip):
        why = "the clip has no frames, and no file without any could be read again"
        raise RequestError(f"cannot write {path}", why, "Give a clip of one frame or more.")
    _check_free(path, force)
    with replacing(path) as part:
        with part.open("wb") as stream:
            notes = chosen.write(clip, stream)
        yield (*notes, *_alone(path))
        _check_free(path, force)


def _alone(path: Path) -> tuple[str, ...]:
    """A note where a motion lies apart from the skeleton file that it cannot be read without."""
    if path.suffix.lower() != ".amc":
        return ()
    try:
        asf_amc.find_asf(path)
    except FileError:
        where = "put that beside it, or name it with --skeleton (skeleton= in Python)"
        return (f"{path.name} is read with its .asf file: {where}",)
    return ()


def _path(path: object, name: str = "path") -> Path:
    if not isinstance(path, str | os.PathLike):
        raise unfit(name, path, "the path of a file")
    return Path(path)


def _format(path: Path) -> Format:
    try:
        return FORMATS[path.suffix.lower()]
    except KeyError:
        raise RequestError(
            f"unknown file format: {path.name}",
            f"its suffix is {path.suffix}" if path.suffix else "it has no suffix",
            f"Supported are {', '.join(FORMATS)}.",
        ) from None


def _check_readable(path: Path) -> None:
    what = f"cannot read {path}"
    try:
        if path.is_file():
            return
        if path.is_dir():
            raise FileError(what, "it is a directory", "Name one file in it.")
        if path.exists():
            raise FileError(what, "it is no regular file", "Save it to disk first.")
        folder = path.parent
        if not folder.is_dir():
            raise FileError(what, f"there is no folder {folder}", "Check the spelling.")
        if path.is_symlink():
            raise FileError(what, f"it is a link to {path.readlink()}, which is not there", "Mend the link.")
        near = difflib.get_close_matches(path.name, [p.name for p in folder.iterdir()], n=3)
    except (OSError, ValueError) as error:
        if isinstance(error, FileError):
            raise
        raise FileError(what, str(error), "Check the name.") from None
    hint = f"Did you mean {' or '.join(near)}?" if near else "Check the spelling."
    raise FileError(what, "there is no such file", hint)


def _check_free(path: Path, force: bool) -> None:
    what = f"cannot write {path}"
    try:
        # A link to nothing is there, too.
        folder, there, inside = path.is_dir(), os.path.lexists(path), path.parent.is_dir()
        if "\0" in str(path):
            raise ValueError("its name has a zero byte in it")
    except (OSError, ValueError) as error:
        raise FileError(what, getattr(error, "strerror", None) or str(error), "Check the name.") from None
    if folder:
        raise RequestError(what, "it is a directory", "Name a file in it.")
    if not inside:
        raise RequestError(what, f"there is no folder {path.parent}", "Make the folder first.")
    if there and not force:
        fix = "Choose another name, or replace it: --force, in Python force=True."
        raise RequestError(what, "the file exists already", fix)
