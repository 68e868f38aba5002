"""The recipe of CMIB (Kim et al. 2022, sections 4.3 to 4.5), for one model of all lengths at 30 fps."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np
import torch
from torch import Tensor, nn

from interpose.datasets import Pack
from interpose.errors import unknown
from interpose.geometry import rotations
from interpose.methods.weights import Card
from interpose.models.cmib import Cmib, CmibConfig, decode
from interpose.training.budget import Budget
from interpose.training.device import mixed, pick_device, processes, send
from interpose.training.loop import SHARE, SOME, SWITCH, Settings, Trainer, recorded, restore, taught
from interpose.training.optimizers import Muon
from interpose.training.poses import Batch, Poses, labels_of, new_path

REPRESENTATIONS = ("quaternion", "axis-angle", "euler")


@dataclass
class CmibSettings(Settings):
    """The paper's recipe where it says one; a small budget wants a higher learning rate than its .0001."""

    LIMITS: ClassVar = {
        **Settings.LIMITS,
        "shortest": (3, CmibConfig().longest),  # two keys, and something between them
        "longest": (3, CmibConfig().longest),
        "anchors": SOME,
        "dropout": (0, 0.9),
        **dict.fromkeys(("anchored", "augmented", "labelled"), SHARE),
        **dict.fromkeys(("residual", "muon"), SWITCH),
    }

    learning_rate: float = 1e-3
    warm_up: float = 0.03
    batch: int = 64  # of all processes together; the paper: 32
    shortest: int = 7  # frames, keys included
    longest: int = 131
    anchors: int = 3  # at most, besides start and target; the paper uses one and allows several
    anchored: float = 0.5  # share of the batches that have any
    augmented: float = 0.3  # share of walks and runs that take another way
    labelled: float = 0.8  # share of the samples that see their label; the paper: all
    semantic: float = 1.5
    position: float = 0.05
    rotation: float = 2.0
    placed: float = 0.05
    dropout: float = 0.0  # the paper: .05; drawing it takes a third of the time, and the run is short
    representation: str = "quaternion"  # table 1; one of REPRESENTATIONS
    residual: int = 1  # 0 for the paper's own network
    decay: float = 0.01
    betas: tuple[float, float] = (0.9, 0.99)
    muon: int = 0  # whether Muon moves the matrices of the layers; else AdamW moves all, as in the paper

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.representation not in REPRESENTATIONS:
            raise unknown("representation", self.representation, REPRESENTATIONS)


def draw_length(rng: np.random.Generator, settings: CmibSettings) -> int:
    """Frames of a batch: short ones as often as their length is short, which a uniform choice neglects."""
    ends = np.log([settings.shortest, settings.longest + 1])
    return int(np.exp(rng.uniform(*ends)))


def draw_keys(rng: np.random.Generator, settings: CmibSettings, batch: int, length: int) -> np.ndarray:
    """Key frames (B, T): the ends, and in some batches the same few anchors for all (randomised shuffled)."""
    keys = np.zeros((batch, length), bool)
    keys[:, [0, -1]] = True
    if length > 2 and rng.random() < settings.anchored:
        count = min(int(rng.integers(1, settings.anchors + 1)), length - 2)
        keys[:, 1 + rng.choice(length - 2, count, replace=False)] = True
    return keys


@torch.no_grad()
def sample_frames(model: Cmib, poses: Poses, settings: CmibSettings) -> Tensor:
    """(n, 154) interpolated frames as the network will see them: the same for all processes."""
    rng, seen = np.random.default_rng(settings.seed), []
    for _ in range(20):
        drawn = poses.draw(rng, 32, draw_length(rng, settings))
        keys = send(draw_keys(rng, settings, *drawn.rotation.shape[:2]), poses.device)
        seen.append(model.prepare(drawn.positions(), drawn.rotation, keys)[0].flatten(0, 1))
    return torch.cat(seen)


class Losses:
    """Equations 15 to 18, in the frame of the first key, and where rotations and hips put the joints.

    With positions in centimetres the paper's weights make its three about equal at the start, as its section
    4.4 asks for. The fourth is what counts for users, whose clips hold rotations and hips only.
    """

    def __init__(self, model: Cmib, settings: CmibSettings) -> None:
        self.model, self.settings = model, settings

    def parts(self, batch: Batch, keys: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """Semantic, of positions (cm), of rotations, and of positions through FK (cm)."""
        positions = batch.positions()
        frames, _, _ = self.model.prepare(positions, batch.rotation, keys)
        # The truth in the frame of the keys: its origin is that of the ends, which are keys, too.
        truth, _, _ = self.model.prepare(positions, batch.rotation, torch.ones_like(keys))
        true, true_held = self.model.split(truth)
        with mixed(frames.device):
            token, out = self.model.encoder(frames, keys, batch.label)
        label, (said, held) = self.model.encoder.label(batch.label), self.model.split(out.float())
        if held.shape[-1] == 4:  # both quaternions of a rotation are right: the one near interpolation's
            true_held = rotations.alike(true_held, self.model.split(frames)[1])
        turned = decode(held, self.model.config.representation)
        through = Batch(turned, said[:, :, 0], batch.bones, batch.label).positions()
        return (
            (token.float() - label).abs().mean(),
            100 * (said - true).abs().mean(),
            (held - true_held).abs().mean(),
            100 * (through - true).abs().mean(),
        )

    def __call__(self, batch: Batch, keys: Tensor) -> Tensor:
        asked = self.settings
        weights = (asked.semantic, asked.position, asked.rotation, asked.placed)
        return torch.stack([weight * part for weight, part in zip(weights, self.parts(batch, keys))]).sum()


def train_cmib(
    packs: Sequence[Pack],
    folder: Path,
    budget: Budget,
    settings: CmibSettings | None = None,
    splits: Sequence[str] = ("train",),
    start: Card | None = None,
    say: Callable[[str], None] = print,
) -> Cmib:
    """Train, or go on training, in `folder`; the averaged model comes back. Arguments as in `train_cae`."""
    settings = settings or CmibSettings()
    device = pick_device()
    torch.manual_seed(settings.seed)
    # Which row of the embedding is which label, no weight could tell.
    before = recorded(folder, "config")
    labels = tuple(before["labels"]) if before else labels_of(packs, splits, start.labels if start else ("",))
    poses = Poses(packs, splits, labels, settings.longest, device)
    held_out = Poses(packs, ("validation",), labels, settings.longest, device).spread(64, 120)
    heads = 7 if settings.representation == "quaternion" else 6
    config = CmibConfig(
        labels,
        heads,
        dropout=settings.dropout,
        residual=bool(settings.residual),
        representation=settings.representation,
    )
    model = Cmib(config).to(device)
    if start and not before:
        restore(model, start.onnx)
    elif not before and model.config.residual:
        model.encoder.standardise(sample_frames(model, poses, settings))
    losses = Losses(model, settings)
    moving = torch.tensor([name in ("walk", "run", "locomotion") for name in labels], device=device)
    batch = max(1, settings.batch // processes())

    def loss(rng: np.random.Generator, fraction: float) -> Tensor:
        length = draw_length(rng, settings)
        drawn = poses.draw(rng, batch, length)
        walks = moving[drawn.label].cpu().numpy() & (rng.random(batch) < settings.augmented)
        drawn = new_path(rng, drawn, walks)
        unsaid = send(rng.random(batch) >= settings.labelled, device)
        drawn.label = torch.where(unsaid, 0, drawn.label)
        keys = send(draw_keys(rng, settings, batch, length), device)
        return losses(drawn, keys)

    def optimizer(parameters: list[nn.Parameter]) -> torch.optim.Optimizer | Muon:
        if settings.muon:
            named = list(model.named_parameters())
            return Muon(named, "encoder.layers.", settings.learning_rate, settings.decay)
        return torch.optim.AdamW(
            parameters, settings.learning_rate, settings.betas, weight_decay=settings.decay, fused=True
        )

    trainer = Trainer(
        model,
        loss,
        lambda averaged: validate(averaged, held_out),
        folder,
        budget,
        settings,
        say,
        optimizer=optimizer,
        clip=1.0,
        about={"config": asdict(model.config)},
        data=taught(packs, splits),
    )
    return trainer.go(f"{poses.told}, {len(labels) - 1} labels, on {device}", start)


@torch.no_grad()
def validate(model: nn.Module, batch: Batch) -> dict[str, float]:
    """Mean joint error (cm) and global rotation error (degrees) between two keys, through FK, and the ratio
    to interpolation; and how far the embeddings of labels are apart, which tells whether they collapse."""
    assert isinstance(model, Cmib)
    figures: dict[str, float] = {}
    positions, bones = batch.positions(), batch.bones.norm(dim=-1)
    for length in (30, 60, 120):
        part = slice(0, length)
        keys = torch.zeros(len(positions), length, dtype=torch.bool, device=positions.device)
        keys[:, [0, -1]] = True
        placed, turned, _ = model(positions[:, part], batch.rotation[:, part], keys, batch.label, bones)
        share = torch.linspace(0, 1, length, device=positions.device)[:, None, None]
        line = positions[:, :1] + share * (positions[:, length - 1 : length] - positions[:, :1])
        placed = Batch(turned, placed[:, :, 0], batch.bones, batch.label).positions()
        off, base = ((p - positions[:, part])[:, 1:-1].norm(dim=-1).mean() for p in (placed, line))
        figures[f"gap{length}"] = 100 * float(off)
        figures[f"ratio{length}"] = float(off / base)
        angle = rotations.angle(turned, batch.rotation[:, part])[:, 1:-1].mean()
        figures[f"degrees{length}"] = float(torch.rad2deg(angle))
    table = model.encoder.label.weight
    figures["labels_apart"] = float(torch.cdist(table, table).mean() / table.norm(dim=1).mean())
    return figures
