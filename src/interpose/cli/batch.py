"""Verbs that take several clips, or a folder of them: each is done by itself, one after the other."""

from __future__ import annotations

import inspect
import json
import os
import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import nullcontext, redirect_stdout, suppress
from dataclasses import dataclass, field
from functools import wraps
from io import StringIO
from pathlib import Path
from typing import Any

from interpose.cli import Terminated, foreseen
from interpose.cli.console import complain, console, say, say_json
from interpose.cli.outputs import FOLDERS_MADE, MADE, Outputs
from interpose.errors import FileError, NothingError, RequestError, few

MOTION = (".bvh", ".npz", ".amc")
# take.filled.bvh and take.forecast.2.bvh lie beside the take.bvh that they were made of.
PRODUCT = re.compile(rf"(.+)\.(?:{'|'.join(MADE.values())})(?:\.\d+)?")


SKIP_EXISTING = """
        skip_existing: skip clips that already have a result and a report, whatever the options of that run
            were; this resumes an interrupted batch.
    """


# What an earlier run made of a clip, by the options of this one, and its report; None where it made nothing.
Earlier = Callable[[Path, dict[str, Any]], "tuple[Path, dict[str, Any]] | None"]


def each(verb: Callable[..., int | None], earlier: Earlier | None = None) -> Callable[..., int]:
    """The verb of one file, for several and for folders: what cannot be done is said, and the next one is.

    Its exit code is the largest of those that could not be done, or else of all. With --json it prints one
    list, an entry for each file. Verbs that write get --skip-existing, so that a batch can go on where it
    stopped.
    """

    signature = inspect.signature(verb)
    writes = "output" in signature.parameters
    optional = writes and signature.parameters["output"].default is not inspect.Parameter.empty
    before = earlier or _by_report(verb.__name__)

    @wraps(verb)
    def many(file: Path, /, *more: Path, skip_existing: bool = False, **options: Any) -> int:
        folder: Path | None = options.get("output")
        if skip_existing and options.get("force"):
            why = "the one leaves alone what is there, the other replaces it"
            raise RequestError("--skip-existing does not go with --force", why, "Leave one of them out.")

        def one(path: Path) -> tuple[int, bool]:
            """The exit code, and whether the result was there already."""
            if not skip_existing:
                return verb(path, **options) or 0, False
            if (found := before(path, options)) is None:
                try:
                    return verb(path, **options) or 0, False
                except RequestError:
                    # Another process may have done it meanwhile.
                    if (found := before(path, options)) is None:
                        raise
            made, report = found
            if options.get("json"):
                say_json({**report, "skipped": True})
            else:
                say(f"skipped {path}: {made} is there already")
            return 4 if report.get("open") or report.get("left") else 0, True

        if not more and not file.is_dir() and (folder is None or not folder.is_dir()):
            return one(file)[0]
        # A link to a clip has a result of its own; a clip that is named twice, by way of a linked folder or
        # not, has one.
        found = {path.parent.resolve() / path.name: (path, at) for path, at in clips((file, *more), folder)}
        if skip_existing:
            # takes/*.bvh names what a run before has made as well.
            own = f".{MADE.get(verb.__name__)}"
            found = {
                at: one
                for at, one in found.items()
                if not (at.stem.endswith(own) and at.with_name(at.stem[: -len(own)] + at.suffix) in found)
            }
        files = [path for path, _ in found.values()]
        if files == [file] and file.is_dir():
            raise _empty(file)
        if folder is not None and (folder.suffix.lower() in MOTION or folder.is_file()):
            raise RequestError(
                f"{folder} is one file",
                f"{len(files)} files are to be written",
                "Name a folder"
                + ("; or leave it out: each lies beside what it was made of." if optional else "."),
            )
        if writes:
            _apart([(path, place if folder is not None else path) for path, place in found.values()])
        batch = Batch(files, as_json=bool(options.get("json")))
        for path, place in found.values():
            said, made, fresh = StringIO(), FOLDERS_MADE.set(bool(options.get("dry_run"))), list[Path]()
            try:
                if path.is_dir():
                    raise _empty(path)
                if folder is not None:
                    options["output"] = folder / place
                    if not options.get("dry_run"):
                        fresh = _made((folder / place).parent)
                with redirect_stdout(said) if options.get("json") else nullcontext():
                    code, skipped = one(path)
                batch.add(code, json.loads(said.getvalue() or "null"), skipped=skipped)
            except NothingError as error:
                batch.add(error.code, {"input": str(path), "nothing": error.what, "left": error.left})
                if not options.get("json"):
                    say(f"{error.what}, but {error.left}" if error.left else error.what)
            except (KeyboardInterrupt, Terminated):
                batch.tell(interrupted=True)
                raise
            except BrokenPipeError:  # who reads along has had enough
                raise
            except Exception as error:
                told = foreseen(error)
                said_of = {"error": told.what, "why": told.why, "fix": told.fix}
                batch.add(told.exit_code, {"input": str(path), **said_of})
                complain(told)
            finally:
                FOLDERS_MADE.reset(made)
                with suppress(OSError):  # what has something in it stays
                    for one_of in fresh:
                        one_of.rmdir()
            if not options.get("json"):
                say()
        batch.tell()
        return batch.code

    first, *rest = signature.parameters.values()
    others = inspect.Parameter("more", inspect.Parameter.VAR_POSITIONAL, annotation="Path")
    added = [first, others, *rest]
    many.__annotations__ = {**verb.__annotations__, "more": "Path"}
    if writes:
        kind = inspect.Parameter.KEYWORD_ONLY
        added.append(inspect.Parameter("skip_existing", kind, default=False, annotation="bool"))
        many.__annotations__["skip_existing"] = "bool"
        many.__doc__ = (verb.__doc__ or "").rstrip() + SKIP_EXISTING
    many.__signature__ = signature.replace(parameters=added)  # type: ignore[attr-defined]
    return many


@dataclass
class Batch:
    """What has become of the files of a batch, in their order: exit codes, and entries for --json."""

    files: list[Path]
    as_json: bool
    codes: list[int] = field(default_factory=list)
    entries: list[Any] = field(default_factory=list)
    done: int = 0
    skipped: int = 0

    def add(self, code: int, entry: Any, *, skipped: bool = False) -> None:
        """The next file."""
        self.codes.append(code)
        self.entries.append({**entry, "code": code} if isinstance(entry, dict) else entry)
        self.skipped += skipped
        self.done += code == 0 and not skipped

    @property
    def code(self) -> int:
        """What could not be done at all comes before what was left open in what was."""
        return max(self.codes, key=lambda code: (code not in (0, 4), code))

    def tell(self, interrupted: bool = False) -> None:
        """The list of --json, and the line that sums up, on stderr."""
        if self.as_json:
            say_json(self.entries)
        parts = [f"{self.done} of {len(self.files)} files done"]
        parts += [f"{self.skipped} skipped, as their results were there"] if self.skipped else []
        idle = sum(isinstance(entry, dict) and "nothing" in entry for entry in self.entries)
        parts += [f"{idle} with nothing to do"] if idle else []
        parts += [f"{left} with something left open"] if (left := self.codes.count(4)) else []
        failed = [str(file) for file, code in zip(self.files, self.codes) if code not in (0, 4)]
        parts += [f"{len(failed)} could not be done: {few(failed)}"] if failed else []
        parts += [f"interrupted before {len(self.files) - len(self.codes)}"] if interrupted else []
        console(stderr=True).print("; ".join(parts))


def _by_report(verb: str) -> Earlier:
    """Results of a verb that writes reports are known by these."""

    def earlier(path: Path, options: dict[str, Any]) -> tuple[Path, dict[str, Any]] | None:
        outputs = Outputs.choose(path, options.get("output"), verb, bool(options.get("player")))
        report = outputs.earlier(verb)
        return None if report is None else (outputs.clip, report)

    return earlier


def _made(folder: Path) -> list[Path]:
    """Make a folder; those that were not there, the innermost first."""
    fresh = [one for one in (folder, *folder.parents) if not one.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    return fresh


def _empty(folder: Path) -> FileError:
    """That there is no clip in a folder, or that nobody may look into it."""
    why, fix = f"there is no motion file in it ({', '.join(MOTION)})", "Name a folder with clips, or a clip."
    try:
        next(os.scandir(folder), None)
    except OSError as error:
        why, fix = str(error.strerror or error), "Allow it to be read, or leave it out."
    return FileError(f"cannot read {folder}", why, fix)


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
    stands for itself, to be complained of, as do folders that cannot be read and links to nothing.
    """
    for path in paths:
        if not path.is_dir():
            yield path, Path(path.name)
            continue
        held = sorted(one for one in _within(path) if one.is_dir() or _is_clip(one))
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


def _is_clip(path: Path) -> bool:
    """Whether a path in a folder is a motion file, or a link that was to one."""
    return path.suffix.lower() in MOTION and (path.is_file() or not path.exists())


def _within(folder: Path) -> Iterator[Path]:
    """The files in a folder and the folders in it, linked ones, too, each of them once; and those of the
    folders that cannot be read."""
    been, closed = set[str](), list[OSError]()
    links = [str(folder)]
    while links:
        # What a link leads to is looked into last: it may lie in the folder as well.
        for place, folders, files in os.walk(links.pop(0), onerror=closed.append):
            if (real := os.path.realpath(place)) in been:
                folders.clear()
                continue
            been.add(real)
            links += sorted(path for name in folders if os.path.islink(path := os.path.join(place, name)))
            yield from (Path(place, name) for name in files)
    yield from (Path(error.filename) for error in closed)
