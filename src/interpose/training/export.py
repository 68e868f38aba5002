"""From a run's averaged weights to what ships: a graph, its card, the training log and its curves."""

from __future__ import annotations

import datetime
import json
import pickle
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import torch
from safetensors.torch import save

from interpose.datasets import DATASETS, Pack
from interpose.datasets.own import NAME as OWN
from interpose.errors import FileError, RequestError
from interpose.methods.registry import METHODS
from interpose.methods.weights import OPEN, Card
from interpose.models.base import Base, BaseConfig
from interpose.models.cmib import Cmib, CmibConfig
from interpose.models.seq2seq import Seq2Seq, Seq2SeqConfig
from interpose.models.stmi_gan import Generator, StmiGanConfig
from interpose.show.plot import line_plot
from interpose.skeletons import JOINTS
from interpose.training.base import JUDGED, KIN, SHORTEST, chosen, title, validate
from interpose.training.cae import NETWORKS
from interpose.training.graphs import (
    export_base_onnx,
    export_cae_onnx,
    export_cmib_onnx,
    export_seq2seq_onnx,
    export_stmi_gan_onnx,
)
from interpose.training.loop import restore, sizes
from interpose.training.poses import Poses
from interpose.training.stmi_gan import DATASETS as STMI_GAN_DATASETS
from interpose.training.stmi_gan import JUDGE

LICENCES = {
    "lafan1": "CC BY-NC-ND 4.0",
    "bandai": "CC BY-NC 4.0",
    "pfnn": "free for academic and non-commercial use",
    "cmu": "free for all uses, the data itself may not be resold; mocap.cs.cmu.edu",
    OWN: "your own",
}
RESEARCH = "research and non-commercial use: the training data is licensed so"
FREE = f"{OPEN}: trained on CMU data alone"
# What the recipe of the autoencoder trains, for the card; the others are there to be compared with.
DESCRIPTIONS = {
    "cae": "Convolutional autoencoder for infilling (Kaufmann et al. 2020)",
    "vanilla": "Plain convolutional autoencoder, a baseline of Kaufmann et al. 2020",
    "holden": "Motion manifold of Holden et al. 2016, a baseline of Kaufmann et al. 2020",
}


@dataclass
class _Run:
    """A run that has ended.

    Attributes:
        folder: where it lies.
        packs: what it learned from.
        splits: the parts of them.
        settings: its own.
        log: after that of the weights that it started from, but for a user's own clips: figures of the one
            and the other are of other motion.
        earlier: what their card said of their training.
        auto: what `auto` goes by. It stays as measured on the weights that the run started from: a run that
            goes on may train on the performers that it was measured with. Of a first run it is not measured
            yet, so that all gaps are the spline's until `interpose bench threshold --save`.
        licence: what the weights that it started from may be used for; "" of a first run.
        data: what these had learned from.
    """

    folder: Path
    packs: list[Pack]
    splits: list[str]
    settings: dict[str, Any]
    log: list[dict[str, Any]]
    earlier: list[dict[str, Any]]
    auto: dict[str, Any]
    licence: str = ""
    data: list[dict[str, Any]] = field(default_factory=list)

    @classmethod
    def of(cls, folder: Path, packs: list[Pack], splits: Sequence[str]) -> _Run:
        """Read it. `packs` are those that there are, `splits` those of a run that has none on record."""

        def lines(name: str) -> list[dict[str, Any]]:
            found = []
            for line in (folder / name).read_text().splitlines():
                with suppress(ValueError):  # the last one, of a run that was killed as it wrote
                    found.append(json.loads(line))
            return found

        settings: dict[str, Any] = json.loads((folder / "settings.json").read_text())
        packs = chosen(packs, ",".join(settings.pop("packs", [])))
        held = settings.pop("held", {})
        kept_splits = settings.pop("splits", None)
        if kept_splits and splits and {*kept_splits} != {*splits}:
            raise RequestError(
                f"{folder} was not trained on {','.join(splits)}",
                f"it has {','.join(kept_splits)} on record",
                "Leave out --splits.",
            )
        for pack in packs:
            name, now = str(pack.dataset), sizes(pack, kept_splits or [])
            if name in held and held[name] != now:
                raise RequestError(
                    f"{folder} was not trained on this pack of {name}",
                    f"it holds {now['clips']} clips, {now['frames']} frames, and {held[name]['clips']}, "
                    f"{held[name]['frames']} are on record",
                    "Name the folder of those that it was trained on with --packs.",
                )
        known = (folder, packs, kept_splits or list(splits) or ["train"], settings)
        if not (folder / "earlier.json").exists():
            return cls(*known, lines("log.jsonl"), [], {"from_gap": 61})
        before = [] if _are_own(packs) else lines("earlier.jsonl")
        steps, hours = (before[-1]["step"], before[-1]["hours"]) if before else (0, 0.0)
        after = [
            {**entry, "step": entry["step"] + steps, "hours": round(entry["hours"] + hours, 4)}
            for entry in lines("log.jsonl")
        ]
        kept = json.loads((folder / "earlier.json").read_text())
        # Older runs did not keep the licence. Their history tells all data sets that were ever asked for: if
        # that is CMU each time, as `small-open` was trained, nothing else can be in it.
        alone = all(one.get("datasets") == "cmu" for one in kept["training"])
        licence = kept.get("licence") or (FREE if alone else RESEARCH)
        return cls(*known, before + after, kept["training"], kept["auto"], licence, kept.get("data", []))

    def begin(self, out: Path, name: str, model: torch.nn.Module) -> Path:
        """Fill a model with the averaged weights, write the log, and say where the graph `name` goes.

        One folder holds one network, as its log and its curves have no name: RequestError otherwise.
        """
        if others := [path for path in out.glob("*.onnx") if path.stem != name]:
            raise RequestError(
                f"cannot write {name}.onnx into {out}", f"{others[0].name} is in there", "Write --out FOLDER."
            )
        try:
            held = torch.load(self.folder / "averaged.pt", map_location="cpu", weights_only=True)
            model.load_state_dict(held)
        except (RuntimeError, EOFError, pickle.UnpicklingError) as reason:
            raise FileError(
                f"cannot export {self.folder}",
                f"averaged.pt is damaged, or of another network: {str(reason).splitlines()[0]}",
                "Go on with the run, or train anew.",
            ) from None
        out.mkdir(parents=True, exist_ok=True)
        (out / "log.jsonl").write_text("".join(json.dumps(entry) + "\n" for entry in self.log))
        return out / f"{name}.onnx"

    def terms(self, mean: Card | None = None) -> dict[str, Any]:
        """Licence and data for the card: of the packs, of the weights that it started from, and of `mean`."""
        others = [one for one in (self.licence, mean.licence if mean else "") if one]
        return {
            "licence": narrowest([*others, _licence(self.packs)]),
            "data": _joined([*self.data, *(mean.data if mean else []), *_data(self.packs, self.splits)]),
        }

    def training(self, recipe: str, model: torch.nn.Module) -> dict[str, Any]:
        """How the weights came to be, for the card."""
        kind = "--from WEIGHTS --data CLIPS" if _are_own(self.packs) else recipe
        return {
            "recipe": f"interpose train {kind}"
            + (", going on from what `earlier` tells of" if self.earlier else ""),
            **self.settings,
            "splits": self.splits,
            "steps": self.log[-1]["step"],
            "device_hours": self.log[-1]["hours"],  # as the steps: from where the log begins
            "earlier": self.earlier,
            "parameters": sum(p.numel() for p in model.parameters()),
            "date": datetime.date.today().isoformat(),
        }


def export_cae(folder: Path, packs: list[Pack], out: Path, splits: Sequence[str] = ()) -> Card:
    """Write `cae.onnx`, `cae.json`, the training log and its curve into `out` from a run's folder.

    A run of one of the networks to compare with is called after that network instead.
    """
    run = _Run.of(folder, packs, splits)
    settings, log = run.settings, run.log
    name = settings.get("network", "cae")
    model = NETWORKS[name]()
    export_cae_onnx(model, run.begin(out, name, model))
    _curves(log, name, f"{settings.get('loss', 'l1').upper()}, normalised", (15, 30, 60), out)
    drawn = min(settings.get("last_gap", 60), settings.get("length", 120) - 2)
    longest = settings.get("gap") or round(drawn)
    card = Card(
        name=name,
        method="cae",
        description=f"{DESCRIPTIONS[name]}, trained on gaps to {longest / 30:g} s",
        **run.terms(),
        tasks=["fill", "recover"],
        joints=list(JOINTS),
        fps=30.0,
        # Twice as long as what it learned it is still far ahead of the spline: with gaps of 4 s joints of
        # validation performers, whom its last runs had seen, are off by 22, not 39 cm (bench context).
        max_gap=2 * longest,
        training={
            **run.training("cae", model),
            "statistics": {
                "mean": [round(float(v), 6) for v in model.mean.flatten()],
                "std": [round(float(v), 6) for v in model.std.flatten()],
            },
        },
        metrics={"validation": log[-1]},
        auto=run.auto,
    )
    card.save(out / f"{name}.json")
    return card


def export_seq2seq(folder: Path, packs: list[Pack], out: Path, splits: Sequence[str] = ()) -> Card:
    """Write `seq2seq.onnx`, `seq2seq.json`, the log and its curves into `out` from a run's folder."""
    packs = [pack for pack in packs if str(pack.dataset) in STMI_GAN_DATASETS]
    run = _Run.of(folder, packs, splits)
    settings, log = run.settings, run.log
    config = settings.pop("config")
    model = Seq2Seq(Seq2SeqConfig(**{**config, "labels": tuple(config["labels"])}))
    export_seq2seq_onnx(model, run.begin(out, "seq2seq", model))
    hours = [entry["hours"] for entry in log]
    curve = {"loss": (hours, [entry["loss"] for entry in log])}
    line_plot(curve, "device hours", "squared, normalised", "Training of seq2seq", path=out / "loss.svg")
    errors = {
        f"first {frames / 30:g} s": (hours, [entry[f"degrees{frames}"] for entry in log])
        for frames in (15, 30, 60, 120)
    }
    title = "Validation performers"
    line_plot(errors, "device hours", "rotation error, degrees", title, path=out / "validation.svg")
    card = Card(
        name="seq2seq",
        method="seq2seq",
        description="Residual sequence-to-sequence network (Martinez et al. 2017), to compare forecasts with",
        **run.terms(),
        tasks=[],
        joints=list(JOINTS),
        fps=30.0,
        max_gap=0,
        training=run.training("seq2seq", model),
        metrics={"validation": log[-1]},
        labels=config["labels"],
    )
    card.save(out / "seq2seq.json")
    return card


def export_cmib(folder: Path, packs: list[Pack], out: Path, splits: Sequence[str] = ()) -> Card:
    """Write `cmib.onnx`, `cmib.json`, the training log and its curves into `out` from a run's folder."""
    run = _Run.of(folder, packs, splits)
    settings, log = run.settings, run.log
    config = settings.pop("config")
    model = Cmib(CmibConfig(**{**config, "labels": tuple(config["labels"])}))
    export_cmib_onnx(model, run.begin(out, "cmib", model))
    _curves(log, "cmib", "weighted loss", (30, 60, 120), out)
    labels = config.pop("labels")
    card = Card(
        name="cmib",
        method="cmib",
        description="Conditional motion in-betweening (Kim et al. 2022) between keys, with action labels",
        **run.terms(),
        tasks=["fill", "between"],
        joints=list(JOINTS),
        fps=30.0,
        max_gap=settings["longest"] - 2,  # a length counts both keys
        training={**run.training("cmib", model), "config": config},
        metrics={"validation": log[-1]},
        labels=labels,
        paces=paces(run.packs, run.splits),
    )
    card.save(out / "cmib.json")
    return card


def export_stmi_gan(folder: Path, packs: list[Pack], out: Path, splits: Sequence[str] = ()) -> Card:
    """Write `stmi-gan.onnx`, `stmi-gan.json`, the log and its curves into `out` from a run's folder, and the
    discriminator, against which a run that starts from these weights goes on. Those of `config=dense` are
    called stmi-gan-dense."""
    packs = [pack for pack in packs if str(pack.dataset) in STMI_GAN_DATASETS]
    run = _Run.of(folder, packs, splits)
    settings, log = run.settings, run.log
    config = StmiGanConfig.of(settings["network"])
    model, name = Generator(config), "stmi-gan-dense" if settings["config"] == "dense" else "stmi-gan"
    export_stmi_gan_onnx(model, run.begin(out, name, model))
    state = torch.load(folder / "checkpoint.pt", map_location="cpu", weights_only=False)
    if judge := state.get("opponent"):
        halves = {name: value.half().contiguous() for name, value in judge.items()}
        (out / JUDGE).write_bytes(save(halves))
    hours = [entry["hours"] for entry in log]
    curve = {"generator": (hours, [entry["loss"] for entry in log])}
    line_plot(curve, "device hours", "weighted loss", f"Training of {name}", path=out / "loss.svg")
    moves = {
        f"{q}. quarter of the forecast": (hours, [entry[f"moves{q}"] for entry in log]) for q in range(1, 5)
    }
    title = "Validation performers"
    line_plot(moves, "device hours", "share of the truth's motion", title, path=out / "validation.svg")
    card = Card(
        name=name,
        method="stmi-gan",
        description="Spatio-temporal inpainting GAN (Hernandez Ruiz et al. 2019): forecasts, lost joints",
        **run.terms(),
        # In the paper there are no gaps between poses, nor in its configuration.
        tasks=["forecast", "recover", *(["fill"] if settings["config"] == "dense" else [])],
        joints=list(JOINTS),
        fps=config.fps,
        max_gap=config.frames // 2,
        training=run.training("stmi-gan", model),
        metrics={"validation": log[-1]},
    )
    card.save(out / f"{name}.json")
    return card


def export_base(
    folder: Path,
    packs: list[Pack],
    out: Path,
    splits: Sequence[str] = (),
    mean: Card | None = None,
) -> Card:
    """Write the graph, `small.onnx` or what else it is called, its card, the log and its curves into `out`.

    mean: weights of the same network that the run started from, whose mean with the run's is written
        (Wortsman et al. 2022): what the run learned at the cost of something else, it keeps half of. They are
        measured anew, on the packs' validation performers.
    """
    run = _Run.of(folder, packs, splits)
    settings, log = run.settings, run.log
    network = settings.pop("network")
    run.packs = chosen(run.packs, settings["datasets"])  # for runs that have none on record
    terms = run.terms(mean)
    name = title(settings["config"], settings["datasets"], terms["licence"].startswith(OPEN))
    labels = network["labels"]
    model = Base(BaseConfig(**{**network, "labels": tuple(labels)}))
    path, measured = run.begin(out, name, model), log[-1]
    if mean:
        settings["mean_with"] = f"{mean.name} of commit {mean.training.get('commit')}"
        measured = halfway(model, mean, packs)
    export_base_onnx(model, path)
    _curves(log, name, "weighted loss", (5, 15, 30, 45), out)
    del network["labels"]
    training = run.training("base", model)
    # What it learned before, of longer gaps, it still knows.
    longest = max(one.get("longest", 0) for one in (settings, *training.get("earlier", ())))
    card = Card(
        name=name,
        method=name if name in METHODS else "small",  # which runs networks of that kind, of any size
        description="interpose's own network: whatever is missing of a motion",
        **terms,
        tasks=["fill", "between", "recover", "forecast"],
        joints=list(JOINTS),
        fps=30.0,
        max_gap=min(longest, model.config.longest - 2 * settings["context"]),
        training={**training, "network": network},
        metrics={"validation": measured},
        auto=run.auto,
        labels=labels,
    )
    card.save(out / f"{name}.json")
    return card


def rewrite(card: Card) -> None:
    """Write the graph of `base`, `small` or weights of their kind anew, from the weights in 16 bits that lie
    beside it: after a change of how such networks compute, which says the same but for rounding.

    RequestError for weights of another kind.
    """
    if card.method not in KIN:
        why = f"it is a network of another kind, of {card.method}"
        raise RequestError(f"cannot write the graph of {card.name} anew", why, f"Name {' or '.join(KIN)}.")
    network = {**card.training["network"], "labels": tuple(card.labels), "dropout": 0.0}
    model = Base(BaseConfig(**network))
    restore(model, card.onnx)
    export_base_onnx(model, card.onnx)


def halfway(model: Base, other: Card, packs: list[Pack]) -> dict[str, float]:
    """Move a model's weights half of the way to others; what `validate` finds then."""
    start = Base(model.config)
    restore(start, other.onnx)
    with torch.no_grad():
        for name, value in model.state_dict().items():
            value.lerp_(start.state_dict()[name].to(value.dtype), 0.5)
    held_out = Poses(packs, ("validation",), model.config.labels, SHORTEST, torch.device("cpu"))
    return validate(model.eval(), held_out.spread(128, JUDGED))


def paces(packs: list[Pack], splits: list[str]) -> dict[str, list[float]]:
    """For each label the 2nd and 98th percentile of how fast the hips get ahead over a second (30 frames)."""
    found: dict[str, list[np.ndarray]] = {}
    for pack in packs:
        for clip in np.flatnonzero(np.isin(pack.splits, splits) & (pack.labels != "")):
            way = pack.root[pack.starts[clip] : pack.starts[clip + 1]][:, [0, 2]]
            ahead = np.linalg.norm(way[30:] - way[:-30], axis=1)
            found.setdefault(str(pack.labels[clip]), []).append(ahead)
    return {
        label: [round(float(p), 2) for p in np.percentile(np.concatenate(some), [2, 98])]
        for label, some in sorted(found.items())
        if sum(map(len, some))
    }


def narrowest(licences: list[str]) -> str:
    """What may be done with what has all of these licences: research alone if one says so, and all of what
    they add after a semicolon."""
    uses, more = zip(*(one.partition("; ")[::2] for one in licences))
    narrow = [use for use in uses if not use.startswith(OPEN)] or uses[:1]
    return "; ".join(dict.fromkeys([*narrow, *filter(None, more)]))


def _licence(packs: list[Pack]) -> str:
    """What may be done with weights that learned from the packs alone."""
    if _are_own(packs):
        return f"{OPEN}; and what your own clips allow"
    return FREE if {str(pack.dataset) for pack in packs} == {"cmu"} else RESEARCH


def _are_own(packs: list[Pack]) -> bool:
    """Whether they are a user's own clips."""
    return {str(pack.dataset) for pack in packs} == {OWN}


def _joined(data: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Data of one run after the other: of a set the most that one of them saw. A user's own clips are a set
    each time that they are others."""
    kept: dict[Any, dict[str, Any]] = {}
    for one in data:
        key = (OWN, one["clips"], one["frames"]) if one["name"] == OWN else one["name"]
        kept[key] = max(kept.get(key, one), one, key=lambda some: some["frames"])
    order = [*DATASETS, OWN]
    return sorted(kept.values(), key=lambda one: order.index(one["name"]))


def _data(packs: list[Pack], splits: list[str]) -> list[dict[str, Any]]:
    """What of the packs was trained on, for the card."""
    names = [str(pack.dataset) for pack in packs]
    return [
        {"name": name, "licence": LICENCES[name], **sizes(pack, splits)} for name, pack in zip(names, packs)
    ]


def _curves(log: list[dict[str, Any]], name: str, unit: str, gaps: tuple[int, ...], out: Path) -> None:
    """Draw the loss, and the errors on validation performers, over device hours."""
    hours = [entry["hours"] for entry in log]
    loss = {"loss": (hours, [entry["loss"] for entry in log])}
    line_plot(loss, "device hours", unit, f"Training of {name}", path=out / "loss.svg")
    errors = {
        f"gap of {gap} frames": (hours, [entry[f"gap{gap}"] for entry in log])
        for gap in gaps
        if f"gap{gap}" in log[-1]
    }
    line_plot(errors, "device hours", "joint error, cm", "Validation performers", path=out / "validation.svg")
