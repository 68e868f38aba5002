"""What all benches are asked, and how they show what they measured."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, Protocol

from cyclopts import App, Parameter

from interpose.cli.console import console, say, say_json
from interpose.cli.research import shown
from interpose.cli.whole import Count

if TYPE_CHECKING:
    from interpose.evaluation.conditions import Table
    from interpose.methods.weights import Card


# How many windows are measured.
Most = Count | None


@Parameter(name="*")
@dataclass(frozen=True)
class Asked:
    """What all benches on published data are asked."""

    data: Annotated[
        Path, Parameter(help="the folder with the unpacked data sets; docs/data.md says where to get them.")
    ] = Path("data")
    split: Annotated[
        Literal["validation", "test"],
        Parameter(help="validation performers for development, test performers for final figures."),
    ] = "validation"
    json: Annotated[bool, Parameter(negative="", help="print JSON for other programs.")] = False


@Parameter(name="*")
@dataclass(frozen=True)
class Tabled(Asked):
    """The same of those whose main result is one table."""

    markdown: Annotated[
        bool, Parameter(negative="", help="print only the table of all windows, in Markdown.")
    ] = False


class Result(Protocol):
    """What a bench measured; the text of it tells everything."""

    def to_dict(self) -> dict[str, Any]: ...


bench = App(
    name="bench",
    help="Measure how good the methods are, by published protocols.",
    default_parameter=Parameter(show_default=shown),
)


def show(result: Result, asked: Asked) -> None:
    """Print a result as it was asked for."""
    if asked.json:
        say_json(result.to_dict())
    elif isinstance(asked, Tabled) and asked.markdown:
        say(result.table())  # type: ignore[attr-defined]
    else:
        say(str(result))


def cards_of(folders: list[Path], method: str = "cmib") -> list[Card]:
    """The weights of a method in some folders, or the installed ones."""
    from interpose.methods.weights import find, load

    return [load(folder, method) for folder in folders] or [find(method)]


def print_tables(tables: list[Table], json: bool) -> None:
    """Tables as text or as JSON."""
    if json:
        say_json([table.to_dict() for table in tables])
    else:
        say("\n\n".join(map(str, tables)))


@contextmanager
def bar() -> Iterator[Callable[[float, str], None]]:
    """Progress of minutes: a bar in a terminal, a line every tenth elsewhere."""
    screen = console(stderr=True)
    if not screen.is_terminal:
        told = -1

        def tell(share: float, line: str) -> None:
            nonlocal told
            if share == 0 or int(10 * share) > told:
                told = int(10 * share)
                screen.print(line)

        yield tell
        return
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    with Progress(
        TextColumn("{task.description}"), BarColumn(), TimeRemainingColumn(), console=screen, transient=True
    ) as bar:
        task = bar.add_task("reading", total=1.0)
        yield lambda share, line: bar.update(task, completed=share, description=line)
