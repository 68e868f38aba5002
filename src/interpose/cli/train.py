"""interpose train: one command a recipe."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cyclopts import App

from interpose.cli.console import say
from interpose.cli.reading import split_names
from interpose.cli.research import needs_torch
from interpose.errors import FileError, RequestError, unknown

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


def change(settings: Any, changes: list[str]) -> Any:
    """A recipe's settings (a dataclass), some of them changed: "name=value"."""
    kinds = {field.name: type(getattr(settings, field.name)) for field in fields(settings)}
    found = {}
    for text in changes:
        name, _, value = text.partition("=")
        if name not in kinds or kinds[name] not in (int, float, str):
            raise unknown("setting", name, [n for n, kind in kinds.items() if kind in (int, float, str)])
        try:
            found[name] = kinds[name](value)
        except ValueError:
            raise RequestError(
                f"cannot set {name} to {value!r}",
                f"it is {kinds[name].__name__}",
                f"Write --set {name}=NUMBER.",
            ) from None
    return replace(settings, **found)


def _train(
    recipe: Callable[..., Any],
    settings: Any,
    name: str,
    packs: Path,
    out: Path,
    budget: str,
    splits: list[str],
    start: str | None,
    changes: list[str],
    shipped: bool = True,
) -> None:
    """Run a recipe as its verb was told. What is not shipped stays apart from the weights that users get."""
    from interpose.methods import weights
    from interpose.training.budget import Budget

    changed, chosen = change(settings, changes), check_splits(splits)
    begin = weights.card(start) if start else None
    recipe(load_packs(packs), out, Budget.parse(budget), changed, splits=chosen, start=begin, say=say)
    say(f"done: {out}")
    # So does a study.
    there = Path("weights") / name if shipped and not changes else out / "weights"
    say(f"Next: interpose export {name} --run {out} --packs {packs} --out {there}")


@train.command
def cae(
    *,
    packs: Path = Path("packs"),
    out: Path,
    budget: str = "25m",
    splits: list[str] = [],  # noqa: B006
    start: str | None = None,
    set: list[str] = [],  # noqa: B006
) -> None:
    """Train the convolutional autoencoder of Kaufmann et al. An interrupted run goes on where it stopped.

    The networks and losses that the paper compares with are settings of the same recipe.

    Try:
      interpose train cae --packs packs --out runs/cae --budget 25m
      interpose train cae --out runs/ours60 --set gap=30
      interpose train cae --out runs/vanilla --set network=vanilla --set gap=30
      interpose train cae --out runs/l2 --set loss=l2

    Args:
        packs: the folder with the packs to train on: `interpose data pack` makes them.
        out: the folder of the run: checkpoints and the log.
        budget: device time or steps: 25m, 3h, 6000steps.
        splits: train (the default); train,validation for a final run of fixed budget.
        start: go on from these installed weights, by name, instead of from nothing.
        set: change a setting of the recipe, for studies: name=value. May be repeated.
    """
    with needs_torch("train a network"):
        from interpose.training.cae import CaeSettings, train_cae
    _train(train_cae, CaeSettings(), "cae", packs, out, budget, splits, start, set)


@train.command
def cmib(
    *,
    packs: Path = Path("packs"),
    out: Path,
    budget: str = "25m",
    splits: list[str] = [],  # noqa: B006
    start: str | None = None,
    set: list[str] = [],  # noqa: B006
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
        set: change a setting of the recipe, for studies: name=value. May be repeated.
    """
    with needs_torch("train a network"):
        from interpose.training.cmib import CmibSettings, train_cmib
    _train(train_cmib, CmibSettings(), "cmib", packs, out, budget, splits, start, set)


@train.command
def stmi_gan(
    *,
    packs: Path = Path("packs"),
    out: Path,
    budget: str = "25m",
    splits: list[str] = [],  # noqa: B006
    start: str | None = None,
    set: list[str] = [],  # noqa: B006
) -> None:
    """Train STMI-GAN of Hernandez Ruiz et al., on LAFAN1 and Bandai-Namco. An interrupted run goes on.

    The rows of the paper's tables are settings of the same recipe.

    Try:
      interpose train stmi-gan --packs packs --out runs/stmi --budget 25m
      interpose train stmi-gan --out runs/paper --set config=paper
      interpose train stmi-gan --out runs/nogan --set config=paper --set branches=none

    Args:
        packs: the folder with the packs to train on: `interpose data pack` makes them.
        out: the folder of the run: checkpoints and the log.
        budget: device time or steps: 25m, 3h, 6000steps.
        splits: train (the default); train,validation for a final run of fixed budget.
        start: go on from these installed weights, by name, instead of from nothing.
        set: change a setting of the recipe, for studies: name=value. May be repeated.
    """
    with needs_torch("train a network"):
        from interpose.training.stmi_gan import StmiGanSettings, train_stmi_gan
    _train(train_stmi_gan, StmiGanSettings(), "stmi-gan", packs, out, budget, splits, start, set)


@train.command
def seq2seq(
    *,
    packs: Path = Path("packs"),
    out: Path,
    budget: str = "25m",
    splits: list[str] = [],  # noqa: B006
    start: str | None = None,
    set: list[str] = [],  # noqa: B006
) -> None:
    """Train the residual sequence-to-sequence network of Martinez et al., a row of bench forecasting.

    On LAFAN1 and Bandai-Namco, with their labels. An interrupted run goes on where it stopped.

    Try:
      interpose train seq2seq --packs packs --out runs/seq2seq --budget 25m

    Args:
        packs: the folder with the packs to train on: `interpose data pack` makes them.
        out: the folder of the run: checkpoints and the log.
        budget: device time or steps: 25m, 3h, 6000steps.
        splits: train (the default); train,validation for a final run of fixed budget.
        start: go on from these installed weights, by name, instead of from nothing.
        set: change a setting of the recipe, for studies: name=value. May be repeated.
    """
    with needs_torch("train a network"):
        from interpose.training.seq2seq import Seq2SeqSettings, train_seq2seq
    _train(train_seq2seq, Seq2SeqSettings(), "seq2seq", packs, out, budget, splits, start, set, shipped=False)
