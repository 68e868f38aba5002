"""The recipe of the convolutional autoencoder (Kaufmann et al. 2020, section 3.3), at 30 fps.

What the paper leaves open, and where a small budget asks for something else, is said beside each value.

The other rows of table 1 and the ablations are settings of the same recipe: the same data, the same schedule.

    Ours (curr.)        nothing
    Ours (60)           gap=30
    Vanilla AE (60)     network=vanilla gap=30
    Holden et al. (60)  network=holden gap=30 loss=l2 learning_rate=1e-5
    section 3.3         loss=l2
    section 4.1         bones=1
    Table 2, on noise   noise=0.3

Such a row is trained by `interpose train cae --out runs/noise --set noise=0.3`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar

import numpy as np
import torch
from torch import Tensor, nn

from interpose.datasets import Pack
from interpose.errors import RequestError, unknown
from interpose.geometry.ground import wrap
from interpose.methods.weights import Card
from interpose.models.cae import ROWS, Image, Infiller, to_image
from interpose.models.holden import HoldenInfiller
from interpose.models.vanilla import Vanilla
from interpose.observation.corruption import gap_mask, gaussian_noise, joints_mask, joints_per_frame_mask
from interpose.skeletons import JOINTS, PARENTS
from interpose.training.budget import Budget
from interpose.training.deconvolution import quicken
from interpose.training.device import mixed, pick_device, processes, send
from interpose.training.loop import SHARE, SOME, Settings, Trainer, from_weights, restore, taught
from interpose.training.windows import SHORTEST, Windows

NETWORKS: dict[str, Callable[[], Infiller]] = {
    "cae": Infiller,
    "vanilla": lambda: Infiller(Vanilla()),
    "holden": HoldenInfiller,
}
POSITIONS = 3 * len(JOINTS)  # rows of the image; what follows is the trajectory, and contacts where there are
# The worst that table 2 does to a clip, and training on noise with it: the standard deviation of noise in
# metres, 1.5 of the paper's units, and the share of joints that a frame loses.
NOISE, LOST = 1.5 * 0.0625, 0.5
LOSSES: dict[str, Callable[[Tensor], Tensor]] = {"l1": torch.abs, "l2": torch.square}


@dataclass
class CaeSettings(Settings):
    """The paper's recipe; its frame counts are at 60 fps, these at 30."""

    LIMITS: ClassVar = {
        **Settings.LIMITS,
        "length": (SHORTEST, 10_000),
        "first_gap": SOME,
        "last_gap": SOME,
        "curriculum": (0.001, 1),
        "joints_share": SHARE,
        "noise": SHARE,
    }

    length: int = 120  # frames, 4 s
    batch: int = 32  # of all processes together; the paper: 80. A small budget learns more in small steps
    first_gap: float = 5.0  # mean gap at the start ...
    last_gap: float = 60.0  # ... and where the curriculum ends, 2 s
    sigma: float = 10.0
    curriculum: float = 0.345  # share of the budget until the last gap: epoch 69 of 200
    joints_share: float = 0.3  # of the samples lose joints over the whole clip instead of a gap
    network: str = "cae"  # one of NETWORKS
    gap: int = 0  # frames of all gaps, without lost joints; 30, a second, are the paper's (60); 0: curriculum
    loss: str = "l1"  # or "l2", of normalised rows
    bones: float = 0.0  # weight of the loss on the lengths of bones
    noise: float = 0.0  # share of the clips that are whole but noisy, or lose joints frame by frame

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.network not in NETWORKS:
            raise unknown("network", self.network, NETWORKS)
        if self.loss not in LOSSES:
            raise unknown("loss", self.loss, LOSSES)
        if self.gap > self.length - 2:
            raise RequestError(
                f"cannot train with gaps of {self.gap} frames",
                f"windows have {self.length}, and the first and the last stay known",
                f"Write --set gap={self.length - 2} or less, or --set length={self.gap + 2} or more.",
            )

    def going_on(self) -> CaeSettings:
        """For a run from trained weights: the end of the curriculum, and steps half as large."""
        return replace(self, first_gap=self.last_gap, learning_rate=0.5 * self.learning_rate)


def curriculum_mean(settings: CaeSettings, fraction: float) -> float:
    """The mean gap length at a point of the budget: held for 7 % of it, then grown in 11 equal steps."""
    hold = 14 / 69 * settings.curriculum
    if fraction < hold:
        return settings.first_gap
    steps = np.floor(11 * min(1.0, (fraction - hold) / (settings.curriculum - hold))) / 11
    return float(settings.first_gap + steps * (settings.last_gap - settings.first_gap))


def corrupt(rng: np.random.Generator, settings: CaeSettings, fraction: float, batch: int) -> np.ndarray:
    """What is observed (B, T, 22): a gap in most clips, in others 1, later up to 2 and 3 joints lost.

    With a fixed gap there is one of that length in every clip.
    """
    shape = (batch, settings.length, len(JOINTS))
    if settings.gap:
        return gap_mask(rng, *shape, settings.gap, 0.0)
    gaps = gap_mask(rng, *shape, curriculum_mean(settings, fraction), settings.sigma)
    joints = joints_mask(rng, *shape, most=1 + int(min(2, fraction * 3)))
    return np.where(rng.random((batch, 1, 1)) < settings.joints_share, joints, gaps)


def disturb(
    rng: np.random.Generator, settings: CaeSettings, batch: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What some clips suffer: half of them noise, half the loss of joints in single frames.

    How much of it is drawn uniformly, up to the worst of table 2.

    Returns:
        Which clips (B,) these are, the noise (B, T, 22, 3) in metres, and which joints are kept (B, T, 22).
    """
    shape = (batch, settings.length, len(JOINTS))
    chosen = rng.random(batch) < settings.noise
    noise, kept = np.zeros((*shape, 3), np.float32), np.ones(shape, bool)
    for clip in np.flatnonzero(chosen):
        if rng.random() < 0.5:
            noise[clip] = gaussian_noise(rng, noise[clip], rng.uniform(0.0, NOISE))
        else:
            kept[clip] = joints_per_frame_mask(rng, 1, shape[1], shape[2], rng.uniform(0.0, LOST))[0]
    return chosen, noise, kept


def predict_disturbed(model: Infiller, image: Image, noise: Tensor, kept: Tensor) -> Tensor:
    """`model.predict` of an image with noise (B, T, 22, 3) in metres added to its positions, and without the
    joints that are not kept (B, T, 22).

    As in section 4.1 that concerns positions alone, in the body's frame; the trajectory is known as it is, so
    what is shown and what should come out are in the same frame, the clean one. Noise on global positions
    would turn and shift that frame: at sigma 1 the line of hips and shoulders sways by 13 degrees, and
    nothing tells from which frame to answer.
    """
    rows, known = model.normalised(image)
    added = noise.flatten(2).transpose(1, 2) / model.std[:POSITIONS]
    rows = torch.cat([rows[:, :POSITIONS] + added, rows[:, POSITIONS:]], dim=1)
    seen = known[:, :POSITIONS] & kept.repeat_interleave(3, dim=2).transpose(1, 2)
    known = torch.cat([seen, known[:, POSITIONS:]], dim=1)
    return model.network(torch.where(known, rows, 0.0)[:, None])[:, 0]


def fit_normaliser(model: Infiller, windows: Windows, rng: np.random.Generator) -> None:
    """Mean and standard deviation of every row over fully observed training windows."""
    rows = []
    for _ in range(20):
        positions = windows.draw(rng, 100)
        image = to_image(positions, torch.ones_like(positions[..., 0], dtype=torch.bool))
        rows.append(model.shown(image)[0])
    values = torch.cat(rows).transpose(0, 1).flatten(1)
    # A body on its side can flip its facing within a frame; such a jump must not set the scale.
    values[ROWS - 1] = wrap(values[ROWS - 1]).clamp(-0.5, 0.5)
    std = values.std(dim=1)
    model.mean.copy_(values.mean(dim=1)[:, None])
    model.std.copy_(torch.where(std > 1e-4, std, torch.ones_like(std))[:, None])


def bone_error(model: Infiller, answer: Tensor, truth: Tensor) -> Tensor:
    """By how much bones are too long or too short, on average, over the mean deviation of positions.

    So that it is as large as the loss on normalised rows when bones are as wrong as positions.

    Args:
        model: whose rows they are.
        answer, truth: normalised rows (B, R, T).
    """
    positions = slice(0, POSITIONS)
    mean, std = model.mean[positions], model.std[positions]
    lengths = []
    for rows in (answer, truth):
        joints = (rows[:, positions] * std + mean).unflatten(1, (len(JOINTS), 3))
        lengths.append((joints[:, 1:] - joints[:, list(PARENTS[1:])]).norm(dim=2))
    # The hips lie over the origin: their own deviation says nothing.
    return (lengths[0] - lengths[1]).abs().mean() / std[3:].mean()


def train_cae(
    packs: Sequence[Pack],
    folder: Path,
    budget: Budget,
    settings: CaeSettings | None = None,
    splits: Sequence[str] = ("train",),
    start: Card | None = None,
    say: Callable[[str], None] = print,
) -> Infiller:
    """Train, or go on training, in `folder`; the averaged model comes back.

    Args:
        packs: the data.
        folder: of the run; an interrupted one in it goes on.
        budget: what it may spend.
        settings: the recipe.
        splits: what to train on; the validation performers are measured in any case.
        start: trained weights to begin with, instead of a network that knows nothing. Their normaliser and
            their history go along.
        say: told how it goes.
    """
    settings = settings or CaeSettings()
    settings = settings.going_on() if from_weights(folder, start) else settings
    device = pick_device()
    torch.manual_seed(settings.seed)
    rng = np.random.default_rng(settings.seed)
    windows = Windows(packs, splits, settings.length, device)
    held_out = Windows(packs, ("validation",), settings.length, device).spread(96)
    model = NETWORKS[settings.network]().to(device)
    model.network.to(memory_format=torch.channels_last)
    if start:
        restore(model, start.onnx)
    else:
        fit_normaliser(model, windows, rng)
    if device.type == "cpu":
        quicken(model)

    batch = max(1, settings.batch // processes())

    def loss(rng: np.random.Generator, fraction: float) -> Tensor:
        positions = windows.draw(rng, batch)
        observed = corrupt(rng, settings, fraction, batch)
        if settings.noise:
            chosen, *disturbance = disturb(rng, settings, batch)
            observed[chosen] = True
        image = to_image(positions, send(observed, device))
        with mixed(device):
            if settings.noise:
                noise, kept = (send(one, device) for one in disturbance)
                answer = predict_disturbed(model, image, noise, kept)
            else:
                answer = model.predict(image)
        truth = model.normalised(image)[0]
        wrong = LOSSES[settings.loss](answer.float() - truth).mean()
        return wrong + settings.bones * bone_error(model, answer.float(), truth) if settings.bones else wrong

    trainer = Trainer(
        model,
        loss,
        lambda averaged: validate(averaged, held_out),
        folder,
        budget,
        settings,
        say,
        data=taught(packs, splits),
    )
    return trainer.go(
        f"{settings.network}, {windows.frames:,} frames of {', '.join(splits)}, on {device}", start
    )


@torch.no_grad()
def validate(model: nn.Module, positions: Tensor) -> dict[str, float]:
    """Joint error in cm on the true trajectory, gap centred, and its ratio to linear interpolation."""
    assert isinstance(model, Infiller)
    figures = {}
    length = positions.shape[1]
    for gap in (gap for gap in (15, 30, 60) if gap < length - 1):
        start = (length - gap) // 2
        observed = torch.ones(positions.shape[:-1], dtype=torch.bool, device=positions.device)
        observed[:, start : start + gap] = False
        image = to_image(positions, observed)
        rows = torch.cat([model.answer(_part(image, at)) for at in range(0, len(positions), 32)])
        wrong = (rows - image.rows)[:, 3:66, start : start + gap].unflatten(1, (-1, 3)).norm(dim=2)
        share = torch.arange(1, gap + 1, device=positions.device)[:, None, None] / (gap + 1)
        ends = positions[:, [start - 1]], positions[:, [start + gap]]
        linear = ends[0] + share * (ends[1] - ends[0])
        off = (linear - positions[:, start : start + gap])[:, :, 1:].norm(dim=-1)
        figures[f"gap{gap}"] = 100 * float(wrong.mean())
        figures[f"ratio{gap}"] = float(wrong.mean() / off.mean())
    return figures


def trained(card: Card) -> Infiller:
    """The network of some weights, back from the graph that they were exported into."""
    model = NETWORKS[card.training.get("network", "cae")]()
    restore(model, card.onnx)
    return model.eval()


@torch.no_grad()
def reconstruct(model: Infiller, positions: np.ndarray, noise: np.ndarray, kept: np.ndarray) -> np.ndarray:
    """What a network makes of whole motions that are disturbed as in table 2.

    Args:
        positions: (B, T, 22, 3) metres of a canonical leg at 30 fps, undisturbed.
        noise: (B, T, 22, 3) metres added to them in the body's frame.
        kept: (B, T, 22) which joints are not lost.

    Returns:
        Poses (B, T, 22, 3) in metres, in the body's frame.
    """
    given = torch.from_numpy(positions).float()
    image = to_image(given, torch.ones_like(given[..., 0], dtype=torch.bool))
    rows = predict_disturbed(model, image, torch.from_numpy(noise).float(), torch.from_numpy(kept))
    body = (rows * model.std + model.mean)[:, :POSITIONS].transpose(1, 2).unflatten(2, (len(JOINTS), 3))
    return (body + image.floor[:, None, None, None] * body.new_tensor([0.0, 1.0, 0.0])).double().numpy()


def _part(image: Image, start: int) -> Image:
    """32 clips of a batch, from `start` on."""
    return Image(**{name: value[start : start + 32] for name, value in vars(image).items()})
