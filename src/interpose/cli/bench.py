"""interpose bench: published protocols, and what auto goes by."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from cyclopts import App

from interpose.cli.console import console, say, say_json
from interpose.errors import RequestError

if TYPE_CHECKING:
    from interpose.evaluation.conditions import Table
    from interpose.methods.weights import Card

bench = App(name="bench", help="Measure how good the methods are, by published protocols.")


@bench.command
def infilling(
    *,
    data: Path = Path("data"),
    weights: list[Path] = [],  # noqa: B006
    split: Literal["validation", "test"] = "validation",
    most: int | None = None,
    json: bool = False,
    markdown: bool = False,
) -> None:
    """Kaufmann et al. 2020, table 1: joint error when gaps of 0 to 60 frames in 4 s are filled.

    Networks to compare are trained by the same recipe and exported into folders of
    their own; each is a row beside those of the installed weights.

    Try:
      interpose bench infilling --data data --split test
      interpose train cae --out runs/vanilla --set network=vanilla --set gap=30
      interpose export cae --run runs/vanilla --out runs/vanilla/weights
      interpose bench infilling --weights runs/vanilla/weights

    Args:
        data: the folder with the unpacked data sets; docs/data.md says where to get them.
        weights: a folder that `interpose export cae` wrote, to compare with; may be repeated.
        split: validation for development, test for final figures.
        most: windows of each data set; all without it.
        json: print JSON for other programs.
        markdown: print only the table of all windows, in Markdown.
    """
    from interpose.evaluation.infilling import run

    with _bar() as progress:
        result = run(data, split, most, progress, _trained(weights, "cae") if weights else [])
    if json:
        say_json(result.to_dict())
    else:
        say(result.table() if markdown else str(result))


@bench.command
def denoise(
    *,
    data: Path = Path("data"),
    split: Literal["validation", "test"] = "validation",
    most: int | None = None,
    json: bool = False,
    markdown: bool = False,
) -> None:
    """Kaufmann et al. 2020, table 2: joint error of noisy clips of 4 s, before and after denoising.

    Try:
      interpose bench denoise --data data --split test

    Args:
        data: the folder with the unpacked data sets; docs/data.md says where to get them.
        split: validation for development, test for final figures.
        most: windows of each data set; all without it.
        json: print JSON for other programs.
        markdown: print only the table of all windows, in Markdown.
    """
    from interpose.evaluation.denoising import run

    with _bar() as progress:
        result = run(data, split, most, progress)
    if json:
        say_json(result.to_dict())
    else:
        say(result.table() if markdown else str(result))


@bench.command
def skeletons(
    *,
    data: Path = Path("data"),
    split: Literal["validation", "test"] = "validation",
    most: int | None = 60,
    json: bool = False,
    markdown: bool = False,
) -> None:
    """Every data set on its own skeleton and frame rate: error of finished fills, gaps of .5, 1 and 2 s.

    Try:
      interpose bench skeletons --data data --split test

    Args:
        data: the folder with the unpacked data sets; docs/data.md says where to get them.
        split: validation for development, test for final figures.
        most: windows of each data set and length of gap, spread over all of them.
        json: print JSON for other programs.
        markdown: print only the table, in Markdown.
    """
    from interpose.evaluation.skeletons import run

    with _bar() as progress:
        result = run(data, split, most, progress)
    if json:
        say_json(result.to_dict())
    else:
        say(result.table() if markdown else str(result))


@bench.command
def lafan1(
    *,
    data: Path = Path("data"),
    method: list[str] = [],  # noqa: B006
    protocol: Literal["official", "cmib"] = "official",
    gaps: str | None = None,
    split: Literal["validation", "test"] = "validation",
    most: int | None = None,
    plot: Path | None = None,
    json: bool = False,
) -> None:
    """LAFAN1 in-betweening (Harvey et al. 2020): L2P, L2Q and NPSS exactly as its authors measure them.

    Zero-velocity and interpolation stand first, then each --method as users get it,
    finished, with what the field does not print: feet, pop at keys, bones, time.

    Try:
      interpose bench lafan1 --data data --split test --method cae
      interpose bench lafan1 --data data --gaps 5,15,30,45,60,80,120

    Args:
        data: the folder with the unpacked data sets; docs/data.md says where to get them.
        method: a method to measure, by name, also one of another package. May be repeated.
        protocol: official; or cmib, as Kim et al. 2022 count: lengths with both keys, one frame of context.
        gaps: lengths in frames, separated by commas; those of the protocol without it.
        split: validation (subject 4) for development, test (subject 5) for final figures.
        most: windows, spread over all of them; all without it.
        plot: an SVG file to draw the ratios to interpolation into.
        json: print JSON for other programs.
    """
    from interpose.evaluation.lafan1 import run

    try:
        lengths = [int(text) for text in gaps.split(",")] if gaps else []
    except ValueError:
        raise RequestError(
            f"cannot read --gaps {gaps}", "it is a list of numbers of frames", "Write --gaps 5,15,30,45."
        ) from None
    with _bar() as progress:
        result = run(data, split, protocol, lengths, method, most, progress)
    if plot is not None:
        result.plot(plot)
    if json:
        say_json(result.to_dict())
    else:
        say(str(result))


@bench.command
def threshold(
    *,
    data: Path = Path("data"),
    most: int | None = 60,
    plot: Path | None = None,
    save: bool = False,
    json: bool = False,
) -> None:
    """From which length of gap on the network beats the spline: what the method auto goes by.

    Measured on validation performers.

    Args:
        data: the folder with the unpacked data sets.
        most: windows of each data set.
        plot: an SVG file to draw the errors into.
        save: write the result into the card of the weights.
        json: print JSON for other programs.
    """
    from interpose.evaluation.threshold import measure
    from interpose.methods import weights

    card = weights.find("cae")
    with _bar() as progress:
        result = measure(data, most, progress)
    if plot is not None:
        result.plot(plot)
    if save:
        replace(card, auto=result.to_dict()).save(card.path)
    if json:
        say_json(result.to_dict())
    else:
        say(str(result))


@bench.command
def representations(
    *,
    data: Path = Path("data"),
    weights: list[Path] = [],  # noqa: B006
    split: Literal["validation", "test"] = "validation",
    most: int | None = None,
    json: bool = False,
) -> None:
    """Kim et al. 2022, table 1: L2P of CMIB by how it holds rotations.

    Networks to compare are trained by the same recipe and exported into folders of their own.

    Try:
      interpose train cmib --out runs/euler --set representation=euler --budget 20m
      interpose export cmib --run runs/euler --out runs/euler/weights
      interpose bench representations --weights runs/euler/weights --weights runs/quaternion/weights

    Args:
        data: the folder with the unpacked data sets; docs/data.md says where to get them.
        weights: a folder that `interpose export cmib` wrote, may be repeated; the installed weights without.
        split: validation (subject 4) for development, test (subject 5) for final figures.
        most: windows a length, spread over all of them; all without it.
        json: print JSON for other programs.
    """
    from interpose.evaluation.conditions import representations as measure

    with _bar() as progress:
        result = measure(data, _trained(weights), split, most, progress)
    _print([result], json)


@bench.command
def anchors(
    *,
    data: Path = Path("data"),
    weights: list[Path] = [],  # noqa: B006
    split: Literal["validation", "test"] = "validation",
    most: int | None = None,
    json: bool = False,
) -> None:
    """Kim et al. 2022, table 5: by how much CMIB itself misses an anchor that was moved aside.

    What users get meets every anchor: the motion is moved onto it. This is what the
    network would do by itself, with and without the augmentation by random paths.

    Try:
      interpose train cmib --out runs/plain --set augmented=0 --budget 20m
      interpose export cmib --run runs/plain --out runs/plain/weights
      interpose bench anchors --weights weights/cmib --weights runs/plain/weights

    Args:
        data: the folder with the unpacked data sets; docs/data.md says where to get them.
        weights: a folder that `interpose export cmib` wrote, may be repeated; the installed weights without.
        split: validation (subject 4) for development, test (subject 5) for final figures.
        most: windows of walks and of runs, spread over all of them; all without it.
        json: print JSON for other programs.
    """
    from interpose.evaluation.conditions import anchors as measure

    with _bar() as progress:
        result = measure(data, _trained(weights), split, most, progress)
    _print([result], json)


@bench.command
def actions(
    *,
    data: Path = Path("data"),
    weights: Path | None = None,
    split: Literal["validation", "test"] = "validation",
    most: int | None = 30,
    json: bool = False,
) -> None:
    """Kim et al. 2022, table 6: L2P of CMIB when it is told the right action, and each other one.

    Try:
      interpose bench actions --data data --split test

    Args:
        data: the folder with the unpacked data sets; docs/data.md says where to get them.
        weights: a folder that `interpose export cmib` wrote; the installed weights without.
        split: validation (subject 4) for development, test (subject 5) for final figures.
        most: windows of each action and length, spread over all of them.
        json: print JSON for other programs.
    """
    from interpose.evaluation.conditions import actions as measure

    with _bar() as progress:
        result = measure(data, _trained([weights] if weights else [])[0], split, most, progress)
    _print(result, json)


@bench.command
def hdm05(
    *,
    data: Path = Path("data"),
    weights: Path | None = None,
    split: Literal["validation", "test"] = "validation",
    most: int | None = None,
    json: bool = False,
) -> None:
    """Kim et al. 2022, table 4: L2P and L2Q of CMIB on MPI-HDM05, which its weights have not seen.

    Try:
      interpose bench hdm05 --data data --split test

    Args:
        data: the folder with the unpacked data sets; docs/data.md says where to get them.
        weights: a folder that `interpose export cmib` wrote; the installed weights without.
        split: validation (mm) for development, test (tr) for final figures.
        most: cuts a length, spread over all of them; all without it.
        json: print JSON for other programs.
    """
    from interpose.evaluation.conditions import hdm05 as measure

    with _bar() as progress:
        result = measure(data, _trained([weights] if weights else [])[0], split, most, progress)
    _print(result, json)


def _trained(folders: list[Path], method: str = "cmib") -> list[Card]:
    """The weights of a method in some folders, or the installed ones."""
    from interpose.methods.weights import find, load

    return [load(folder, method) for folder in folders] or [find(method)]


def _print(tables: list[Table], json: bool) -> None:
    """Tables as text or as JSON."""
    if json:
        say_json([table.to_dict() for table in tables])
    else:
        say("\n\n".join(map(str, tables)))


@contextmanager
def _bar() -> Iterator[Callable[[float, str], None]]:
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
