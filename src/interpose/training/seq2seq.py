"""The recipe of the residual sequence-to-sequence network (Martinez et al. 2017), at 30 fps for their 25.

On LAFAN1 and Bandai-Namco, whose themes and contents are the actions. It sees 2 s and learns to foretell the
next one from what it makes itself, as in the paper. The paper trains 100,000 steps of SGD at .005, which
falls to .95 of itself every 10,000; Adam, with the schedule of all recipes, gets as far in a short budget.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np
import torch
from torch import Tensor, nn

from interpose.datasets import Pack
from interpose.geometry import kinematics, rotations
from interpose.methods.weights import Card
from interpose.models.seq2seq import Seq2Seq, Seq2SeqConfig, from_values, to_values
from interpose.skeletons import PARENTS
from interpose.training.budget import Budget
from interpose.training.device import pick_device, processes
from interpose.training.loop import SOME, Settings, Trainer, recorded, restore, taught
from interpose.training.poses import Batch, Poses, labels_of
from interpose.training.stmi_gan import DATASETS

ROLLED = 120  # frames that are foretold when it is measured, 4 s


@dataclass
class Seq2SeqSettings(Settings):
    """The paper's recipe, the optimiser apart."""

    LIMITS: ClassVar = {**Settings.LIMITS, **dict.fromkeys(("seen", "foretold", "units"), SOME)}

    learning_rate: float = 5e-4
    batch: int = 16  # of all processes together
    seen: int = 60  # frames
    foretold: int = 30  # frames, in training
    units: int = 1024  # of the recurrent layer


def train_seq2seq(
    packs: Sequence[Pack],
    folder: Path,
    budget: Budget,
    settings: Seq2SeqSettings | None = None,
    splits: Sequence[str] = ("train",),
    start: Card | None = None,
    say: Callable[[str], None] = print,
) -> Seq2Seq:
    """Train, or go on training, in `folder`; the averaged model comes back. Arguments as in `train_cae`."""
    settings = settings or Seq2SeqSettings()
    device = pick_device()
    torch.manual_seed(settings.seed)
    packs = [pack for pack in packs if str(pack.dataset) in DATASETS]
    before = recorded(folder, "config")
    labels = tuple(before["labels"]) if before else labels_of(packs, splits, start.labels if start else ("",))
    length = settings.seen + settings.foretold
    poses = Poses(packs, splits, labels, length, device)
    whole = settings.seen + ROLLED
    held_out = Poses(packs, ("validation",), labels, whole, device).spread(96, whole)
    model = Seq2Seq(Seq2SeqConfig(labels, settings.units)).to(device)
    if start and not before:
        restore(model, start.onnx)
    elif not before:
        rng = np.random.default_rng(settings.seed)
        drawn = torch.cat([poses.draw(rng, 64, length).rotation.flatten(0, 1) for _ in range(20)])
        model.standardise(to_values(drawn))
    batch = max(1, settings.batch // processes())

    def loss(rng: np.random.Generator, fraction: float) -> Tensor:
        drawn = poses.draw(rng, batch, length)
        values = model.normalised(drawn.rotation)
        made = model.go_on(values[:, : settings.seen], drawn.label, settings.foretold)
        return (made - values[:, settings.seen :]).square().mean()

    trainer = Trainer(
        model,
        loss,
        lambda averaged: validate(averaged, held_out, settings.seen),
        folder,
        budget,
        settings,
        say,
        clip=5.0,
        about={"config": asdict(model.config)},
        data=taught(packs, splits),
    )
    return trainer.go(f"{poses.told}, {len(labels) - 1} labels, on {device}", start)


@torch.no_grad()
def validate(model: nn.Module, batch: Batch, seen: int) -> dict[str, float]:
    """Mean error of local rotations in degrees over the first .5, 1, 2 and 4 s of forecasts, and the ratio to
    the last pose held; and how fast joints turn in the last second, as a share of how fast they truly do."""
    assert isinstance(model, Seq2Seq)
    values = model.normalised(batch.rotation[:, :seen])
    made = model.go_on(values, batch.label, ROLLED) * model.std + model.mean

    last = batch.rotation[:, seen - 1 : seen]
    truth, said, held = (
        kinematics.local_rotations(from_values(some, last), PARENTS)
        for some in (to_values(batch.rotation[:, seen:]), made, to_values(last))
    )
    figures: dict[str, float] = {}
    for frames in (15, 30, 60, 120):
        part = slice(0, frames)
        off, base = (rotations.angle(one[:, part], truth[:, part]).mean() for one in (said, held))
        figures[f"degrees{frames}"] = float(torch.rad2deg(off))
        figures[f"ratio{frames}"] = float(off / base)
    speeds = [rotations.angle(one[:, -30:-1], one[:, -29:]).mean() for one in (said, truth)]
    figures["moves"] = float(speeds[0] / speeds[1])
    return figures
