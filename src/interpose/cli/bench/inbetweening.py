"""Harvey et al. 2020 and Kim et al. 2022: motion between poses."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from interpose.cli.bench.asking import Asked, Most, bar, bench, cards_of, print_tables, show
from interpose.errors import RequestError


@bench.command
def lafan1(
    *,
    method: list[str] = [],  # noqa: B006
    protocol: Literal["official", "cmib"] = "official",
    gaps: str | None = None,
    most: Most = None,
    plot: Path | None = None,
    asked: Asked = Asked(),
) -> None:
    """LAFAN1 in-betweening (Harvey et al. 2020): L2P, L2Q and NPSS exactly as its authors measure them.

    Zero-velocity and interpolation stand first, then each --method as users get it,
    finished, with what the field does not print: feet, pop at keys, bones, time.

    Try:
      interpose bench lafan1 --data data --split test --method cae
      interpose bench lafan1 --data data --gaps 5,15,30,45,60,80,120

    Args:
        method: a method to measure, by name, also one of another package. May be repeated.
        protocol: official; or cmib, as Kim et al. 2022 count: lengths with both keys, one frame of context.
        gaps: lengths in frames, separated by commas; those of the protocol without it.
        most: windows, spread over all of them; all without it.
        plot: an SVG file to draw the ratios to interpolation into.
    """
    from interpose.evaluation.lafan1 import run

    try:
        lengths = [int(text) for text in gaps.split(",")] if gaps else []
    except ValueError:
        raise RequestError(
            f"cannot read --gaps {gaps}", "it is a list of numbers of frames", "Write --gaps 5,15,30,45."
        ) from None
    with bar() as progress:
        result = run(asked.data, asked.split, protocol, lengths, method, most, progress)
    if plot is not None:
        result.plot(plot)
    show(result, asked)


@bench.command
def representations(
    *,
    weights: list[Path] = [],  # noqa: B006
    most: Most = None,
    asked: Asked = Asked(),
) -> None:
    """Kim et al. 2022, table 1: L2P of CMIB by how it holds rotations.

    Networks to compare are trained by the same recipe and exported into folders of their own.

    Try:
      interpose train cmib --out runs/euler --set representation=euler --budget 20m
      interpose export cmib --run runs/euler --out runs/euler/weights
      interpose bench representations --weights runs/euler/weights --weights runs/quaternion/weights

    Args:
        weights: a folder that `interpose export cmib` wrote, may be repeated; the installed weights without.
        most: windows a length, spread over all of them; all without it.
    """
    from interpose.evaluation.conditions import representations as measure

    with bar() as progress:
        result = measure(asked.data, cards_of(weights), asked.split, most, progress)
    print_tables([result], asked.json)


@bench.command
def anchors(
    *,
    weights: list[Path] = [],  # noqa: B006
    most: Most = None,
    asked: Asked = Asked(),
) -> None:
    """Kim et al. 2022, table 5: by how much CMIB itself misses an anchor that was moved aside.

    What users get meets every anchor: the motion is moved onto it. This is what the
    network would do by itself, with and without the augmentation by random paths.

    Try:
      interpose train cmib --out runs/plain --set augmented=0 --budget 20m
      interpose export cmib --run runs/plain --out runs/plain/weights
      interpose bench anchors --weights weights/cmib --weights runs/plain/weights

    Args:
        weights: a folder that `interpose export cmib` wrote, may be repeated; the installed weights without.
        most: windows of walks and of runs, spread over all of them; all without it.
    """
    from interpose.evaluation.conditions import anchors as measure

    with bar() as progress:
        result = measure(asked.data, cards_of(weights), asked.split, most, progress)
    print_tables([result], asked.json)


@bench.command
def actions(
    *,
    weights: Path | None = None,
    most: Most = 30,
    asked: Asked = Asked(),
) -> None:
    """Kim et al. 2022, table 6: L2P of CMIB when it is told the right action, and each other one.

    Try:
      interpose bench actions --data data --split test

    Args:
        weights: a folder that `interpose export cmib` wrote; the installed weights without.
        most: windows of each action and length, spread over all of them.
    """
    from interpose.evaluation.conditions import actions as measure

    with bar() as progress:
        result = measure(asked.data, cards_of([weights] if weights else [])[0], asked.split, most, progress)
    print_tables(result, asked.json)


@bench.command
def hdm05(
    *,
    weights: Path | None = None,
    most: Most = None,
    asked: Asked = Asked(),
) -> None:
    """Kim et al. 2022, table 4: L2P and L2Q of CMIB on MPI-HDM05, which its weights have not seen.

    Try:
      interpose bench hdm05 --data data --split test

    Args:
        weights: a folder that `interpose export cmib` wrote; the installed weights without.
        most: cuts a length, spread over all of them; all without it.
    """
    from interpose.evaluation.conditions import hdm05 as measure

    with bar() as progress:
        result = measure(asked.data, cards_of([weights] if weights else [])[0], asked.split, most, progress)
    print_tables(result, asked.json)
