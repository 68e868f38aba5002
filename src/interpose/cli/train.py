"""interpose train: one command a recipe."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cyclopts import App

from interpose.cli.console import say
from interpose.cli.reading import split_names
from interpose.cli.research import needs_torch
from interpose.errors import FileError, RequestError

if TYPE_CHECKING:
    from interpose.datasets import Pack

train = App(name="train", help="Train a network (needs PyTorch: pip install 'interpose[train]').")
SPLITS = ("train", "validation")


def load_packs(folder: Path) -> list[Pack]:
    """The packs in a folder, by name, but for data that trains no weights that are given away.

    Raises FileError when there are none.
    """
    from interpose.datasets import Pack, trains_shipped_weights

    paths = sorted(folder.glob("*.npz"))
    if not paths:
        raise FileError(
            f"no packs in {folder}", "it has no .npz file", f"Make them: interpose data pack --out {folder}"
        )
    packs = [Pack.load(path) for path in paths]
    for pack in packs:
        if not trains_shipped_weights(str(pack.dataset)):
            say(f"{pack.dataset} is left out: it tests, and trains no weights that are given away")
    return [pack for pack in packs if trains_shipped_weights(str(pack.dataset))]


def check_splits(texts: list[str]) -> tuple[str, ...]:
    """The splits to train on; never the test performers."""
    splits = split_names(texts) or ("train",)
    if bad := [split for split in splits if split not in SPLITS]:
        why = "networks train on train, in a final run also on validation, and never on test"
        raise RequestError(
            f"cannot train on {', '.join(bad)}", why, "Write --splits train or --splits train,validation."
        )
    return splits


def _train(
    recipe: Callable[..., Any],
    name: str,
    packs: Path,
    out: Path,
    budget: str,
    splits: list[str],
    start: str | None,
) -> None:
    """Run a recipe as its verb was told."""
    from interpose.methods import weights
    from interpose.training.budget import Budget

    chosen = check_splits(splits)
    begin = weights.card(start) if start else None
    recipe(load_packs(packs), out, Budget.parse(budget), splits=chosen, start=begin, say=say)
    say(f"done: {out}")
    say(f"Next: interpose export {name} --run {out} --packs {packs} --out weights/{name}")


@train.command
def cae(
    *,
    packs: Path = Path("packs"),
    out: Path,
    budget: str = "25m",
    splits: list[str] = [],  # noqa: B006
    start: str | None = None,
) -> None:
    """Train the convolutional autoencoder of Kaufmann et al. An interrupted run goes on where it stopped.

    Try:
      interpose train cae --packs packs --out runs/cae --budget 25m

    Args:
        packs: the folder with the packs to train on: `interpose data pack` makes them.
        out: the folder of the run: checkpoints and the log.
        budget: device time or steps: 25m, 3h, 6000steps.
        splits: train (the default); train,validation for a final run of fixed budget.
        start: go on from these installed weights, by name, instead of from nothing.
    """
    with needs_torch("train a network"):
        from interpose.training.cae import train_cae
    _train(train_cae, "cae", packs, out, budget, splits, start)


@train.command
def cmib(
    *,
    packs: Path = Path("packs"),
    out: Path,
    budget: str = "25m",
    splits: list[str] = [],  # noqa: B006
    start: str | None = None,
) -> None:
    """Train CMIB, conditional motion in-betweening of Kim et al. An interrupted run goes on where it stopped.

    Try:
      interpose train cmib --packs packs --out runs/cmib --budget 25m

    Args:
        packs: the folder with the packs to train on: `interpose data pack` makes them.
        out: the folder of the run: checkpoints and the log.
        budget: device time or steps: 25m, 3h, 6000steps.
        splits: train (the default); train,validation for a final run of fixed budget.
        start: go on from these installed weights, by name, instead of from nothing.
    """
    with needs_torch("train a network"):
        from interpose.training.cmib import train_cmib
    _train(train_cmib, "cmib", packs, out, budget, splits, start)
