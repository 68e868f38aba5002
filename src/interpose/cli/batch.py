"""Verbs that take several clips, or a folder of them: each is done by itself, one after the other."""

from __future__ import annotations

import inspect
import json
import os
import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import nullcontext, redirect_stdout
from functools import wraps
from io import StringIO
from pathlib import Path
from typing import Any

from interpose.cli import Terminated, foreseen
from interpose.cli.console import complain, console, say, say_json
from interpose.cli.outputs import FOLDERS_MADE, MADE
from interpose.errors import FileError, NothingError, RequestError

MOTION = (".bvh", ".npz", ".amc")
# take.filled.bvh and take.forecast.2.bvh lie beside the take.bvh that they were made of.
PRODUCT = re.compile(rf"(.+)\.(?:{'|'.join(MADE)})(?:\.\d+)?")


def each(verb: Callable[..., int | None]) -> Callable[..., int]:
    """The verb of one file, for several and for folders: what cannot be done is said, and the next one is.

    Its exit code is the largest of those that could not be done, or else of all. With --json it prints one
    list, an entry for each file.
    """

    signature = inspect.signature(verb)

    @wraps(verb)
    def many(file: Path, /, *more: Path, **options: Any) -> int:
        folder: Path | None = options.get("output")
        if not more and not file.is_dir() and (folder is None or not folder.is_dir()):
            return verb(file, **options) or 0
        found = {path.resolve(): (path, place) for path, place in clips((file, *more), folder)}
        files = [path for path, _ in found.values()]
        if files == [file] and file.is_dir():
            raise _empty(file)
        if folder is not None and (folder.suffix.lower() in MOTION or folder.is_file()):
            raise RequestError(
                "--output names one file",
                f"{len(files)} files are to be written",
                "Name a folder; or leave it out: each lies beside what it was made of.",
            )
        if "output" in signature.parameters:
            _apart([(path, place if folder is not None else path) for path, place in found.values()])
        codes, reports = [], []
        for path, place in found.values():
            said, made = StringIO(), FOLDERS_MADE.set(bool(options.get("dry_run")))
            try:
                if path.is_dir():
                    raise _empty(path)
                if folder is not None:
                    options["output"] = folder / place
                    if not options.get("dry_run"):
                        (folder / place).parent.mkdir(parents=True, exist_ok=True)
                with redirect_stdout(said) if options.get("json") else nullcontext():
                    codes.append(verb(path, **options) or 0)
                reports.append(json.loads(said.getvalue() or "null"))
            except NothingError as error:
                reports.append({"input": str(path), "nothing": error.what, "left": error.left})
                codes.append(error.code)
                if not options.get("json"):
                    say(f"{error.what}, but {error.left}" if error.left else error.what)
            except (KeyboardInterrupt, Terminated):
                if options.get("json"):
                    say_json(reports)
                raise
            except Exception as error:
                told = foreseen(error)
                said_of = {"error": told.what, "why": told.why, "fix": told.fix, "code": told.exit_code}
                reports.append({"input": str(path), **said_of})
                complain(told)
                codes.append(told.exit_code)
            finally:
                FOLDERS_MADE.reset(made)
            if not options.get("json"):
                say()
        if options.get("json"):
            say_json(reports)
        done = sum(code == 0 for code in codes)
        console(stderr=True).print(f"{done} of {len(files)} files done")
        # What could not be done at all before what was left open in what was.
        return max(codes, key=lambda code: (code not in (0, 4), code))

    first, *rest = signature.parameters.values()
    others = inspect.Parameter("more", inspect.Parameter.VAR_POSITIONAL, annotation="Path")
    many.__signature__ = signature.replace(parameters=[first, others, *rest])  # type: ignore[attr-defined]
    many.__annotations__ = {**verb.__annotations__, "more": "Path"}
    return many


def _empty(folder: Path) -> FileError:
    """That there is no clip in a folder."""
    why = f"there is no motion file in it ({', '.join(MOTION)})"
    return FileError(f"cannot read {folder}", why, "Name a folder with clips, or a clip.")


def _apart(found: list[tuple[Path, Path]]) -> None:
    """RequestError where two results would have one name: the later would replace the earlier."""
    of: dict[Path, Path] = {}
    for path, place in found:
        # Beside a clip lies its report, which has its name but for the suffix.
        if (other := of.setdefault(place.with_suffix(""), path)) != path:
            raise RequestError(
                "two results would have one name",
                f"{other} and {path} are both called {place.stem}",
                "Do them one after the other, or name the folder that holds both folders.",
            )


def clips(paths: Iterable[Path], output: Path | None = None) -> Iterator[tuple[Path, Path]]:
    """Files, and in place of folders the motion files in them, and in folders in these; each with where it
    belongs in another folder.

    Without what verbs have made of them, and what lies in the folder that results go to. A folder without any
    stands for itself, to be complained of.
    """
    for path in paths:
        if not path.is_dir():
            yield path, Path(path.name)
            continue
        held = sorted(one for one in _within(path) if one.suffix.lower() in MOTION and one.is_file())
        names, into = {*held}, output.resolve() if output is not None else None
        found = False
        for one in held:
            made = PRODUCT.fullmatch(one.stem)
            of_other = made is not None and one.with_name(made[1] + one.suffix) in names
            if not of_other and (into in (None, path.resolve()) or into not in one.resolve().parents):
                found = True
                yield one, one.relative_to(path)
        if not found:
            yield path, Path(path.name)


def _within(folder: Path) -> Iterator[Path]:
    """The files in a folder and the folders in it, linked ones, too, each of them once."""
    been: set[str] = set()
    links = [str(folder)]
    while links:
        # What a link leads to is looked into last: it may lie in the folder as well.
        for place, folders, files in os.walk(links.pop(0)):
            if (real := os.path.realpath(place)) in been:
                folders.clear()
                continue
            been.add(real)
            links += sorted(path for name in folders if os.path.islink(path := os.path.join(place, name)))
            yield from (Path(place, name) for name in files)
