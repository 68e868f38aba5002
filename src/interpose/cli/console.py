"""What verbs print with: tables, progress, and errors in three lines."""

from __future__ import annotations

import json
import os
import sys
import textwrap
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from interpose.errors import InterposeError, few

if TYPE_CHECKING:
    from rich.console import Console

# Work on fewer frames than this is over before anyone wonders.
LONG = 3000
# Networks take as long for a frame as other work for so many.
NETWORK, RATE = 20, 30.0
# What a file's own names may hold, and would tell a terminal what to do.
CONTROLS = {code: "\ufffd" for code in (*range(32), *range(127, 160)) if chr(code) not in "\n\t"}
# Lines of a pipe or a file are as long as they need to be.
WIDE = 250


def screen(**options: Any) -> Console:
    """A console of rich that leaves it to `main` what happens when the reader of a pipe has had enough."""
    from rich.console import Console

    class Screen(Console):
        def on_broken_pipe(self) -> None:
            raise BrokenPipeError

    # Frames such as 70:100: are no names of little pictures.
    return Screen(emoji=False, **options)


def console(stderr: bool = False) -> Console:
    """Made anew for every use, so that it goes where the stream goes now."""
    stream = sys.stderr if stderr else sys.stdout
    width = None if stream.isatty() or "COLUMNS" in os.environ else WIDE
    return screen(stderr=stderr, highlight=False, markup=False, soft_wrap=True, width=width)


def say(text: str = "", style: str | None = None) -> None:
    """One line of output, or several."""
    console().print(text.translate(CONTROLS), style=style)


def say_json(content: Any) -> None:
    sys.stdout.write(json.dumps(content, indent=2, allow_nan=False) + "\n")


def say_table(columns: Sequence[str], rows: Iterable[Sequence[str]], right: Iterable[str] = ()) -> None:
    """A table without lines; columns that are empty in every row are left out.

    Args:
        columns: their headings.
        rows: a text for each column.
        right: headings of the columns that are flush right.
    """
    from rich.table import Table

    rows = [list(row) for row in rows]
    used = [i for i in range(len(columns)) if any(row[i] for row in rows)]
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), header_style="bold")
    flush = set(right)
    for i in used:
        is_number = columns[i] in flush
        table.add_column(columns[i], justify="right" if is_number else "left", no_wrap=is_number)
    for row in rows:
        table.add_row(*(row[i].translate(CONTROLS) for i in used))
    out = console()
    out.soft_wrap = False  # cells wrap inside their column
    out.print(table)


def seconds(frames: int, fps: float) -> str:
    return f"{frames / fps:.2f} s"


def names(joints: Sequence[str] | None, most: int = 4) -> str:
    """Joint names, the first few of many; the whole pose for None."""
    return "all" if joints is None else few(joints, most)


def figure(value: float | None, digits: int = 2) -> str:
    """A number in a table; nothing where there is none."""
    return "" if value is None else f"{value:.{digits}f}"


def effort(missing: int, fps: float) -> int:
    """Frames of other work that take as long as to complete some: networks do so at 30 frames a second."""
    return round(NETWORK * missing * max(RATE / fps, 1.0))


@contextmanager
def progress(what: str, frames: int) -> Iterator[Callable[[float], None] | None]:
    """Shows how far long work has got: a bar in a terminal, one plain line elsewhere; None for short work.

    The caller calls what it gets with the share done, 0 to 1.
    """
    if frames < LONG:
        yield None
        return
    errors = console(stderr=True)
    if not errors.is_terminal:
        errors.print(f"{what} ...")
        yield None
        return
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

    parts = TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn()
    with Progress(*parts, console=errors, transient=True) as bar:
        task = bar.add_task(what, total=1.0)
        yield lambda share: bar.update(task, completed=share)


def complain(error: InterposeError) -> None:
    """An error on stderr: what, why and what to do, one line each."""
    lines = (line.translate(CONTROLS) for line in (error.what, error.why, error.fix) if line)
    first, *rest = (" ".join(line.split()) for line in lines)
    errors = console(stderr=True)
    errors.print(f"error: {first}", style="bold red")
    for line in rest:
        # In a terminal long lists break between words; lines for other programs stay whole.
        width = errors.width if errors.is_terminal else len(line) + 2
        errors.print(textwrap.fill(line, max(width, 20), initial_indent="  ", subsequent_indent="  "))
