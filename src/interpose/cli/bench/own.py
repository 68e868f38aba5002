"""What interpose asks of itself: every task, every skeleton, and what auto goes by."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from interpose.cli.bench.asking import Asked, Most, Tabled, bar, bench, show
from interpose.cli.console import say, say_json
from interpose.errors import RequestError


@bench.command
def every(
    *,
    methods: list[str] = [],  # noqa: B006
    most: Most = 8,
    asked: Tabled = Tabled(),
) -> None:
    """Every task by every method: gaps, keys, lost joints, forecasts. Is one network good at all of them?

    Finished motion on the performers' own skeletons, mean error in cm of what was hidden.

    Try:
      interpose bench every --data data
      interpose bench every --data data --split test --methods spline,cae --most 40

    Args:
        methods: names separated by commas; all that are installed without it.
        most: windows of each data set.
    """
    from interpose.cli.reading import split_names
    from interpose.evaluation.every import run
    from interpose.methods import registry

    with bar() as progress:
        chosen = split_names(methods) or registry.names()
        result = run(asked.data, chosen, asked.split, most, progress)
    show(result, asked)


@bench.command
def skeletons(
    *,
    most: Most = 60,
    asked: Tabled = Tabled(),
) -> None:
    """Every data set on its own skeleton and frame rate: error of finished fills, gaps of .5, 1 and 2 s.

    Try:
      interpose bench skeletons --data data --split test

    Args:
        most: windows of each data set and length of gap, spread over all of them.
    """
    from interpose.evaluation.skeletons import run

    with bar() as progress:
        result = run(asked.data, asked.split, most, progress)
    show(result, asked)


@bench.command
def artefacts(
    *,
    methods: list[str] = [],  # noqa: B006
    most: Most = 20,
    asked: Tabled = Tabled(),
) -> None:
    """What an animator would send back: snaps, scuffing, squats, drifting feet, gliding or frozen bodies.

    Shares of finished fills, beside what people do in the same frames themselves.

    Try:
      interpose bench artefacts --data data
      interpose bench artefacts --data data --methods cmib,base --most 60

    Args:
        methods: names separated by commas; spline, small and base without it.
        most: windows of each data set.
    """
    from interpose.cli.reading import split_names
    from interpose.evaluation.artefacts import METHODS, run

    with bar() as progress:
        result = run(asked.data, split_names(methods) or METHODS, asked.split, most, progress)
    show(result, asked)


@bench.command
def context(
    *,
    most: Most = 6,
    plot: Path | None = None,
    asked: Asked = Asked(),
) -> None:
    """Kaufmann et al. 2020, section 4.2: error by length of gap, and by what is known beside it.

    Gaps of .07 to 4 s; and .03 to .83 s of motion on either side of a gap, for each kind of
    motion, with how much of it is enough. docs/filling.md says what follows from it.

    Try:
      interpose bench context --data data --plot context.svg

    Args:
        most: windows of each kind of motion, and half as many where all are taken together.
        plot: an SVG file to draw the errors by kind of motion into.
    """
    from interpose.evaluation.context import run

    with bar() as progress:
        result = run(asked.data, asked.split, most, progress)
    if plot is not None:
        result.plot(plot)
    show(result, asked)


@bench.command
def threshold(
    *,
    network: str = "cae",
    data: Path = Path("data"),
    most: Most = 60,
    plot: Path | None = None,
    save: bool = False,
    json: bool = False,
) -> None:
    """From which length of gap on a network beats the spline: what the method auto goes by.

    Measured on validation performers.

    Try:
      interpose bench threshold --data data --save

    Args:
        network: the method: cae, small, ...
        data: the folder with the unpacked data sets.
        most: windows of each data set.
        plot: an SVG file to draw the errors into.
        save: write the result into the card of the weights.
        json: print JSON for other programs.
    """
    from interpose.evaluation.threshold import measure
    from interpose.methods import weights

    card = weights.find(network)
    with bar() as progress:
        result = measure(data, network, most, progress)
    if plot is not None:
        result.plot(plot)
    if save:
        replace(card, auto=result.to_dict()).save(card.path)
    if json:
        say_json(result.to_dict())
    else:
        say(str(result))


@bench.command
def reliability(
    *,
    method: str = "base",
    most: Most = 40,
    plot: Path | None = None,
    asked: Tabled = Tabled(),
) -> None:
    """Does a network know when it is wrong? Expected errors beside measured ones, frame by frame.

    Try:
      interpose bench reliability --data data --plot reliability.svg

    Args:
        method: one that says what it expects to be off by.
        most: windows of each data set.
        plot: where to draw it, as SVG.
    """
    from interpose.evaluation.reliability import run

    with bar() as progress:
        result = run(asked.data, method, asked.split, most, progress)
    show(result, asked)
    if plot:
        result.plot(plot)


@bench.command
def recipes(
    *runs: Annotated[Path, Parameter(name="RUNS")],
    figures: list[str] = [],  # noqa: B006
    json: bool = False,
    markdown: bool = False,
) -> None:
    """Training runs beside each other: what their recipes differ in, and what each reached.

    For ablations at an equal budget, on validation performers, as the runs measured it themselves.

    Try:
      interpose train cae --out runs/l1 --budget 1200steps
      interpose train cae --out runs/l2 --budget 1200steps --set loss=l2
      interpose bench recipes runs/l1 runs/l2
      interpose bench recipes studies/base/full studies/base/no-* --figures ratio15,ratio30

    Args:
        runs: folders that interpose train wrote; the first is what the others are compared with.
        figures: names of those to show, separated by commas; all without any.
        json: print JSON for other programs.
        markdown: print only the table, in Markdown.
    """
    from interpose.cli.reading import split_names
    from interpose.evaluation.recipes import compare

    if not runs:
        raise RequestError(
            "no runs are named", "there is nothing to compare", "Name folders: runs/l1 runs/l2."
        )
    result = compare(runs, split_names(figures))
    if json:
        say_json(result.to_dict())
    else:
        say(result.table() if markdown else str(result))
