"""Kaufmann et al. 2020: infilling, denoising, and what their networks do."""

from __future__ import annotations

from pathlib import Path

from interpose.cli.bench.asking import Most, Tabled, bar, bench, cards_of, show
from interpose.cli.research import needs_torch
from interpose.cli.whole import Count


@bench.command
def infilling(
    *,
    weights: list[Path] = [],  # noqa: B006
    most: Most = None,
    asked: Tabled = Tabled(),
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
        weights: a folder that `interpose export cae` wrote, to compare with; may be repeated.
        most: windows of each data set; all without it.
    """
    from interpose.evaluation.infilling import run

    with bar() as progress:
        result = run(asked.data, asked.split, most, progress, cards_of(weights, "cae") if weights else [])
    show(result, asked)


@bench.command
def denoise(
    *,
    most: Most = None,
    asked: Tabled = Tabled(),
) -> None:
    """Kaufmann et al. 2020, table 2: joint error of noisy clips of 4 s, before and after denoising.

    As users meet it, on skeletons. Networks alone, as in the paper: interpose bench noise.

    Try:
      interpose bench denoise --data data --split test

    Args:
        most: windows of each data set; all without it.
    """
    from interpose.evaluation.denoising import run

    with bar() as progress:
        result = run(asked.data, asked.split, most, progress)
    show(result, asked)


@bench.command
def noise(
    *,
    weights: list[Path] = [],  # noqa: B006
    most: Count = 400,
    asked: Tabled = Tabled(),
) -> None:
    """Kaufmann et al. 2020, table 2, as in the paper: joint error of networks on noise and lost joints.

    The installed network and others, alone, on positions of no skeleton (needs PyTorch).
    What denoising does for users is measured by interpose bench denoise.

    Try:
      interpose bench noise --data data --split test
      interpose train cae --out runs/noise --set noise=0.3
      interpose export cae --run runs/noise --out runs/noise/weights
      interpose bench noise --weights runs/noise/weights

    Args:
        weights: a folder that `interpose export cae` wrote, to compare with; may be repeated.
        most: windows, drawn at random from all of them.
    """
    from functools import partial

    from interpose.evaluation.infilling import named
    from interpose.evaluation.noise import run

    with needs_torch("run networks on noise"):
        from interpose.training.cae import reconstruct, trained
    cards = named([*cards_of([], "cae"), *(cards_of(weights, "cae") if weights else [])])
    networks = {row: partial(reconstruct, trained(card)) for row, card in cards.items()}
    with bar() as progress:
        result = run(asked.data, networks, cards, asked.split, most, progress)
    show(result, asked)


@bench.command
def bones(
    *,
    weights: list[Path] = [],  # noqa: B006
    most: Most = None,
    plot: Path | None = None,
    asked: Tabled = Tabled(),
) -> None:
    """Kaufmann et al. 2020, figure 5: how long bones are in motion that networks reconstruct.

    Try:
      interpose bench bones --data data --weights runs/holden/weights --plot bones.svg

    Args:
        weights: a folder that `interpose export cae` wrote, to compare with; may be repeated.
        most: windows of each data set; all without it.
        plot: an SVG file to draw the box plots into.
    """
    from interpose.evaluation.bones import run

    cards = [*cards_of([], "cae"), *(cards_of(weights, "cae") if weights else [])]
    with bar() as progress:
        result = run(asked.data, cards, asked.split, most, progress)
    if plot is not None:
        result.plot(plot)
    show(result, asked)
