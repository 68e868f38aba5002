"""interpose train: one command a recipe."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import App, Parameter

from interpose.cli.console import names, say, say_table
from interpose.cli.reading import split_names
from interpose.cli.research import needs_torch, shown
from interpose.errors import FileError, RequestError, unknown

if TYPE_CHECKING:
    from interpose.datasets import Pack

train = App(
    name="train",
    help="Train a network (needs PyTorch: pip install 'interpose[train]').",
    default_parameter=Parameter(show_default=shown),
)
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


@Parameter(name="*")
@dataclass(frozen=True)
class Run:
    """What all recipes are told."""

    out: Annotated[Path, Parameter(help="the folder of the run: checkpoints and the log.")]
    packs: Annotated[
        Path, Parameter(help="the folder with the packs to train on: `interpose data pack` makes them.")
    ] = Path("packs")
    budget: Annotated[str, Parameter(help="device time or steps: 25m, 3h, 6000steps.")] = "25m"
    splits: Annotated[
        list[str],
        Parameter(help="train (the default); train,validation for a final run of fixed budget."),
    ] = field(default_factory=list)
    start: Annotated[
        str | None,
        Parameter(help="go on from these weights, by name or by folder, instead of from nothing."),
    ] = None
    set: Annotated[
        list[str],
        Parameter(help="change a setting of the recipe, for studies: name=value. May be repeated."),
    ] = field(default_factory=list)


def _train(recipe: Callable[..., Any], settings: Any, name: str, run: Run, shipped: bool = True) -> None:
    """Run a recipe as its verb was told. What is not shipped stays apart from the weights that users get."""
    from interpose.methods import weights
    from interpose.training.budget import Budget

    changed, chosen = change(settings, run.set), check_splits(run.splits)
    begin, budget = weights.card(run.start) if run.start else None, Budget.parse(run.budget)
    recipe(load_packs(run.packs), run.out, budget, changed, splits=chosen, start=begin, say=say)
    say(f"done: {run.out}")
    # So does a study.
    own = changed.config if name == "base" else name
    there = Path("weights") / own
    if not shipped or run.set or there.exists():
        there = run.out / "weights"
    # Runs from before splits were on record are told them once more.
    on_record = "splits" in json.loads((run.out / "settings.json").read_text())
    splits = "" if on_record else f" --splits {','.join(chosen)}"
    say(f"Next: interpose export {name} --run {run.out} --packs {run.packs} --out {there}{splits}")


@train.default
def own(
    *,
    data: Path,
    from_: Annotated[str, Parameter(name="--from")] = "small",
    out: Path = Path("own"),
    budget: str = "10m",
    set: list[str] = [],  # noqa: B006
) -> None:
    """Fine-tune interpose's own network on your own clips, and see what that brings on a part held out.

    Reads all clips below a folder (.bvh, .amc, .npz) and holds out each fifth of them, or the last fifth of
    each if they are few. Then `--method own` uses the new weights.

    Try:
      interpose train --from small --data my_takes/
      interpose train --data my_takes/ --out weights_of_mine --budget 1h
      interpose fill take.bvh --gap 120:160 --method weights_of_mine

    Args:
        data: the folder with your clips.
        from_: the weights to begin with: small, base, small-open, or a folder.
        out: the folder for the new weights. The run goes into a folder within it: one that was interrupted
            goes on, one that is finished is not replaced.
        budget: device time or steps: 10m, 1h, 2000steps.
        set: change a setting of the recipe: name=value. May be repeated.
    """
    with needs_torch("train a network"):
        from interpose.training.base import JUDGED, KIN, WIRING, BaseSettings, judge, train_base
        from interpose.training.export import export_base
    from interpose.datasets.own import own_pack
    from interpose.methods import registry, weights
    from interpose.observation.gapfile import read_json
    from interpose.training.budget import Budget
    from interpose.training.device import rank

    begin = weights.card(from_)
    if begin.method not in KIN:
        raise RequestError(
            f"{from_} cannot be fine-tuned",
            f"it belongs to {begin.method}; so far only interpose's own networks can",
            "Write --from small.",
        )
    if any(out.glob("*.onnx")):
        raise RequestError(f"{out} has weights already", "they would be replaced", "Name another --out.")
    if str(out) in (taken := {"auto", *registry.names()}):
        why = f"--method {out} would go on to take the installed one"
        raise RequestError(
            f"{out} is the name of a method", why, f"Choose another --out than {names(sorted(taken))}."
        )
    asked = Budget.parse(budget)
    # Gently: what it knows of all motion is to stay.
    wired: dict[str, Any] = {
        name: int(on) for name, on in begin.training["network"].items() if name in WIRING
    }
    gentle = BaseSettings(config=begin.training["config"], learning_rate=1e-3, every_seconds=60.0, **wired)
    settings = change(gentle, set)
    pack = own_pack(data, JUDGED, say)
    held = pack.splits == "validation"
    minutes = [float(pack.seconds[part].sum()) / 60 for part in (~held, held)]
    say(f"{len({*pack.names})} clips: {minutes[0]:.1f} min to learn from, {minutes[1]:.1f} min held out")
    run = out / "run"
    takes = {
        "start": begin.training.get("steps"),
        "clips": pack.names.tolist(),
        "seconds": pack.seconds.tolist(),
        "splits": pack.splits.tolist(),
    }
    if (run / "checkpoint.pt").exists() and read_json(run / "takes.json") != takes:
        why = "its clips or the weights that it began with are others now"
        raise RequestError(f"the run in {run} cannot go on", why, "Name another --out.")
    run.mkdir(parents=True, exist_ok=True)
    (run / "takes.json").write_text(json.dumps(takes) + "\n")
    train_base([pack], run, asked, settings, start=begin, say=say)
    if rank() > 0:
        return  # one process is enough for the rest
    export_base(run, [pack], out)
    before, after = (judge(card, pack) for card in (begin, weights.card(str(out))))
    say()
    rows = [
        (f"{gap} frames", *(f"{found[f'gap{gap}']:.2f}" for found in (before, after)))
        for gap in (5, 15, 30, 45)
    ]
    say_table(("gap", "before", "after"), rows, right=("before", "after"))
    say("mean error of joints in the part held out, cm on a body with a leg of 0.86 m")
    if after["gap30"] >= before["gap30"]:
        gentler = f"--set learning_rate={settings.learning_rate / 5:g}"
        say(f"It is no better: more takes, or {gentler} into another --out, may help.")
    say()
    say(f"wrote {out}: interpose fill TAKE.bvh --method {out}")


@train.command
def base(*, run: Run) -> None:
    """Train interpose's own network, for every task. An interrupted run goes on where it stopped.

    Try:
      interpose train base --packs packs --out runs/small --budget 2h
      interpose train base --out runs/base --set config=base
      interpose train base --out runs/base --start small --set config=base   (begins with what it says)
      interpose train base --out runs/lafan1 --set datasets=lafan1 --set tasks=gap
      interpose train base --out runs/open --set datasets=cmu   (for any use)
      interpose train base --out runs/lines --set velocities=0   (a trial)
    """
    with needs_torch("train a network"):
        from interpose.training.base import BaseSettings, train_base
    _train(train_base, BaseSettings(), "base", run)


@train.command
def cae(*, run: Run) -> None:
    """Train the convolutional autoencoder of Kaufmann et al. An interrupted run goes on where it stopped.

    The networks and losses that the paper compares with are settings of the same recipe.

    Try:
      interpose train cae --packs packs --out runs/cae --budget 25m
      interpose train cae --out runs/ours60 --set gap=30
      interpose train cae --out runs/vanilla --set network=vanilla --set gap=30
      interpose train cae --out runs/l2 --set loss=l2
    """
    with needs_torch("train a network"):
        from interpose.training.cae import CaeSettings, train_cae
    _train(train_cae, CaeSettings(), "cae", run)


@train.command
def cmib(*, run: Run) -> None:
    """Train CMIB, conditional motion in-betweening of Kim et al. An interrupted run goes on where it stopped.

    Try:
      interpose train cmib --packs packs --out runs/cmib --budget 25m
    """
    with needs_torch("train a network"):
        from interpose.training.cmib import CmibSettings, train_cmib
    _train(train_cmib, CmibSettings(), "cmib", run)


@train.command
def stmi_gan(*, run: Run) -> None:
    """Train STMI-GAN of Hernandez Ruiz et al. An interrupted run goes on where it stopped.

    On LAFAN1 and Bandai-Namco. The rows of the paper's tables are settings of the recipe.

    Try:
      interpose train stmi-gan --packs packs --out runs/stmi --budget 25m
      interpose train stmi-gan --out runs/paper --set config=paper
      interpose train stmi-gan --out runs/nogan --set branches=none
    """
    with needs_torch("train a network"):
        from interpose.training.stmi_gan import StmiGanSettings, train_stmi_gan
    _train(train_stmi_gan, StmiGanSettings(), "stmi-gan", run)


@train.command
def seq2seq(*, run: Run) -> None:
    """Train the residual sequence-to-sequence network of Martinez et al., a row of bench forecasting.

    On LAFAN1 and Bandai-Namco, with their labels. An interrupted run goes on where it stopped.

    Try:
      interpose train seq2seq --packs packs --out runs/seq2seq --budget 25m
    """
    with needs_torch("train a network"):
        from interpose.training.seq2seq import Seq2SeqSettings, train_seq2seq
    _train(train_seq2seq, Seq2SeqSettings(), "seq2seq", run, shipped=False)
