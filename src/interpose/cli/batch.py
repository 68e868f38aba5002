"""Verbs that take several clips, or a folder of them: each is done by itself, one after the other."""

from __future__ import annotations

import inspect
import json
from collections.abc import Callable, Iterable
from contextlib import nullcontext, redirect_stdout
from functools import wraps
from io import StringIO
from pathlib import Path
from typing import Any

from interpose.cli.console import complain, console, say, say_json
from interpose.errors import FileError, InterposeError, NothingError, RequestError

MOTION = (".bvh", ".npz", ".amc")


def each(verb: Callable[..., int | None]) -> Callable[..., int]:
    """The verb of one file, for several and for folders: what cannot be done is said, and the next one is.

    Its exit code is the largest of all. With --json it prints one list, an entry for each file.
    """

    @wraps(verb)
    def many(file: Path, /, *more: Path, **options: Any) -> int:
        if not more and not file.is_dir():
            return verb(file, **options) or 0
        files = [*{path.resolve(): path for path in clips((file, *more))}.values()]
        if files == [file] and file.is_dir():
            raise _empty(file)
        folder: Path | None = options.get("output")
        if folder is not None and not folder.exists() and folder.suffix.lower() not in MOTION:
            if not options.get("dry_run"):
                folder.mkdir(parents=True)
        elif folder is not None and not folder.is_dir():
            raise RequestError(
                "--output names one file",
                f"{len(files)} files are to be written",
                "Name a folder; or leave it out: each lies beside what it was made of.",
            )
        codes, reports = [], []
        for path in files:
            said = StringIO()
            if folder is not None:
                options["output"] = folder / path.name
            try:
                if path.is_dir():
                    raise _empty(path)
                with redirect_stdout(said) if options.get("json") else nullcontext():
                    codes.append(verb(path, **options) or 0)
                reports.append(json.loads(said.getvalue() or "null"))
            except NothingError as error:
                reports.append({"input": str(path), "nothing": error.what, "left": error.left})
                codes.append(error.code)
                if not options.get("json"):
                    say(f"{error.what}, but {error.left}" if error.left else error.what)
            except InterposeError as error:
                reports.append({"input": str(path), "error": error.what})
                complain(error)
                codes.append(error.exit_code)
            if not options.get("json"):
                say()
        if options.get("json"):
            say_json(reports)
        done = sum(code == 0 for code in codes)
        console(stderr=True).print(f"{done} of {len(files)} files done")
        return max(codes)

    said = inspect.signature(verb)
    first, *rest = said.parameters.values()
    others = inspect.Parameter("more", inspect.Parameter.VAR_POSITIONAL, annotation="Path")
    many.__signature__ = said.replace(parameters=[first, others, *rest])  # type: ignore[attr-defined]
    many.__annotations__ = {**verb.__annotations__, "more": "Path"}
    return many


def _empty(folder: Path) -> FileError:
    """That there is no clip in a folder."""
    why = f"there is no motion file in it ({', '.join(MOTION)})"
    return FileError(f"cannot read {folder}", why, "Name a folder with clips, or a clip.")


def clips(paths: Iterable[Path]) -> Iterable[Path]:
    """Files, and in place of folders the motion files in them, and in folders in these, without what verbs
    have made of them. A folder without any stands for itself, to be complained of."""
    for path in paths:
        if not path.is_dir():
            yield path
            continue
        held = sorted(one for one in path.rglob("*") if one.suffix.lower() in MOTION and one.is_file())
        # take.filled.bvh lies beside the take.bvh that it was made of.
        names = {*held}
        found = [one for one in held if one.with_name(one.stem.rpartition(".")[0] + one.suffix) not in names]
        yield from found or [path]
