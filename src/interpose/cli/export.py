"""interpose export: a trained network becomes weights that users can run."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Annotated, Any

from cyclopts import App, Parameter

from interpose.cli.console import say
from interpose.cli.research import needs_torch, shown
from interpose.cli.train import check_splits, load_packs
from interpose.errors import FileError

export = App(
    name="export",
    help="Turn a training run into weights with a card (needs PyTorch).",
    default_parameter=Parameter(show_default=shown),
)


@Parameter(name="*")
@dataclass(frozen=True)
class Of:
    """What becomes weights."""

    run: Annotated[Path, Parameter(help="the folder of the training run.")]
    packs: Annotated[Path, Parameter(help="the folder with the packs that it was trained on.")] = Path(
        "packs"
    )
    splits: Annotated[
        list[str],
        Parameter(help="for runs without them on record: train (the default), or train,validation."),
    ] = field(default_factory=list)
    force: Annotated[bool, Parameter(help="replace weights that are there.")] = False


@export.command
def cae(
    *,
    of: Of,
    out: Path = Path("weights/cae"),
) -> None:
    """Write cae.onnx, its card cae.json, and the training log with its curves.

    A run of another network (--set network=vanilla) is called after it, and is for
    interpose bench infilling --weights to compare with.

    Try:
      interpose export cae --run runs/cae --packs packs --out weights/cae
      interpose export cae --run runs/vanilla --out runs/vanilla/weights

    Args:
        out: the folder for the weights.
    """
    from interpose.methods.weights import FOLDERS

    with needs_torch("export a network"):
        from interpose.training.export import export_cae
    _export(export_cae, of, out)
    if out.resolve().parent in FOLDERS:
        say("Next, so that auto knows from which length on it is better: interpose bench threshold --save")
    else:
        say(f"Next, to compare it with the installed weights: interpose bench infilling --weights {out}")


@export.command
def base(
    *,
    of: Of,
    out: Path,
    mean: str | None = None,
) -> None:
    """Write base.onnx or small.onnx, its card, and the training log with its curves.

    Try:
      interpose export base --run runs/small --packs packs --out weights/small

    Args:
        out: the folder for the weights.
        mean: the weights that the run started from, a name or a folder: their mean with the run's is written.
    """
    from interpose.methods import weights

    with needs_torch("export a network"):
        from interpose.training.export import export_base
    _export(partial(export_base, mean=weights.card(mean) if mean else None), of, out)


@export.command
def graph(trained: str, /) -> None:
    """Write the graph of base, small or weights like them anew, where they lie, from the same weights.

    For those who changed how such networks compute: it says the same but for rounding,
    and nothing is trained. The card and the weights beside it stay as they are.

    Try:
      interpose export graph small
      interpose export graph studies/base-lafan1

    Args:
        trained: the name of installed weights, or the folder of others.
    """
    from interpose.methods import weights

    with needs_torch("export a network"):
        from interpose.training.export import rewrite
    card = weights.card(trained)
    rewrite(card)
    say(f"wrote {card.onnx}")


@export.command
def cmib(
    *,
    of: Of,
    out: Path = Path("weights/cmib"),
) -> None:
    """Write cmib.onnx, its card cmib.json, and the training log with its curves.

    Try:
      interpose export cmib --run runs/cmib --packs packs --out weights/cmib

    Args:
        out: the folder for the weights.
    """
    with needs_torch("export a network"):
        from interpose.training.export import export_cmib
    _export(export_cmib, of, out)


@export.command
def stmi_gan(
    *,
    of: Of,
    out: Path = Path("weights/stmi-gan"),
) -> None:
    """Write stmi-gan.onnx, its card stmi-gan.json, and the training log with its curves.

    What was trained with config=dense is called stmi-gan-dense. The discriminator
    lies beside: a run that starts from these weights goes on against it.

    Try:
      interpose export stmi-gan --run runs/stmi --packs packs --out weights/stmi-gan

    Args:
        out: the folder for the weights.
    """
    with needs_torch("export a network"):
        from interpose.training.export import export_stmi_gan
    _export(export_stmi_gan, of, out)


@export.command
def seq2seq(
    *,
    of: Of,
    out: Path,
) -> None:
    """Write seq2seq.onnx, its card seq2seq.json, and the training log: a row of bench forecasting.

    Try:
      interpose export seq2seq --run runs/seq2seq --out runs/seq2seq/weights
      interpose bench forecasting --weights runs/seq2seq/weights

    Args:
        out: the folder for the weights.
    """
    with needs_torch("export a network"):
        from interpose.training.export import export_seq2seq
    _export(export_seq2seq, of, out)


def _export(write: Callable[..., Any], of: Of, out: Path) -> None:
    """Export a run as its verb was told."""
    chosen = check_splits(of.splits) if of.splits else ()
    for name in ("averaged.pt", "log.jsonl", "settings.json"):
        if not (of.run / name).is_file():
            raise FileError(f"cannot export {of.run}", f"it has no {name}", "Train first: interpose train.")
    if not of.force and (there := sorted(out.glob("*.onnx"))):
        why = f"{there[0].name} is in there"
        raise FileError(f"cannot write into {out}", why, "Choose another --out, or add --force.")
    packs = load_packs(of.packs)
    try:
        card = write(of.run, packs, out, chosen)
    except (KeyError, TypeError, json.JSONDecodeError) as error:
        why = f"its settings are of another recipe, or damaged: {type(error).__name__}, {error}"
        raise FileError(f"cannot export {of.run}", why, "Export it as what it was trained.") from None
    say(f"wrote {out / card.name}.onnx, {out / card.name}.json and the training log ({card.licence})")
