"""The recipe of STMI-GAN (Hernandez Ruiz et al. 2019, sections 4.2 and 6), on LAFAN1 and Bandai-Namco.

The rows of its table 1 are settings of it:

    STMI-GAN       nothing; config=paper for the network of the tables, 20 frames of 4 s
    NoGAN          branches=none
    Base disc      branches=base
    +EDM disc      branches=base,edm
    +Motion disc   branches=base,motion

The network of 30 frames a second, `config=dense`, says all frames; the losses and the discriminator look at
one at random of each fifth of a second, as the paper's. It begins from nothing (`--set config=dense`), or
with what that one has learned (`--start stmi-gan --set config=dense --set lead=.15`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import ClassVar

import numpy as np
import torch
from safetensors.torch import load_file
from torch import Tensor, nn
from torch.nn import functional

from interpose.datasets import Pack
from interpose.errors import RequestError, unknown
from interpose.evaluation.spectrum import joint_angles, psent, pskl
from interpose.geometry.constant import Constant
from interpose.methods.weights import Card
from interpose.models.stmi_gan import (
    BRANCHES,
    CONFIGS,
    ENDS,
    FIRST,
    SECOND,
    Discriminator,
    Frame,
    Generator,
    StmiGanConfig,
    distances,
    drawable,
)
from interpose.observation.corruption import LIMBS, gap_mask
from interpose.skeletons import JOINTS, PARENTS
from interpose.training.budget import Budget
from interpose.training.deconvolution import quicken
from interpose.training.device import mixed, pick_device, processes, send
from interpose.training.loop import SHARE, SOME, Opponent, Settings, Trainer, of_kind, restore, taught
from interpose.training.windows import Windows

DATASETS = ("lafan1", "bandai")
JUDGE = "discriminator.safetensors"  # beside a graph: what its network was trained against
# Whose distances to all other joints tell most actions apart: hands, feet and head.
EXTREMITIES = {JOINTS.index(name) for name in ("LeftHand", "RightHand", "LeftToe", "RightToe", "Head")}
LIMB_PAIRS = Constant([i for i, pair in enumerate(ENDS) if EXTREMITIES & set(pair)])
BONE_PAIRS = Constant([ENDS.index((parent, joint)) for joint, parent in enumerate(PARENTS) if parent >= 0])


@dataclass
class StmiGanSettings(Settings):
    """The paper's recipe, its step-wise learning rate apart: here it follows the budget."""

    LIMITS: ClassVar = {
        **Settings.LIMITS,
        "forecasts": SHARE,
        "every": SOME,
        "tallest": (1, 1.9),  # the smallest are as much smaller
    }

    config: str = "dense"  # one of CONFIGS
    branches: str = ",".join(BRANCHES)  # of the discriminator; none for NoGAN, which is told the whole truth
    batch: int = 16  # of all processes together; the paper: 128. A small budget learns more in small steps
    # The paper: 1e-3 for both, with larger batches. In small ones the generator comes to rest in mean poses
    # before the discriminator has seen what motion is: it learns faster.
    learning_rate: float = 1.5e-4
    forecasts: float = 0.5  # share of the motions of which the second half is hidden
    reconstruction: float = 1.0
    limbs: float = 0.1
    bones: float = 1.0
    # The paper: 10. Distances are summed here over all joints and frames, and 10 moves no joint against them.
    adversarial: float = 50.0
    gamma: float = 0.3  # of the R1 penalty, which the paper does not say
    pace: float = 4.0  # learning rate of the discriminator, as a multiple of the generator's
    # Share of the budget in which the discriminator learns alone: before it knows anything, it drives a
    # generator that began with trained weights from what that had learned.
    lead: float = 0.0
    every: int = 8  # steps from one R1 penalty to the next; each weighs as many times as much
    tallest: float = 1.3  # bodies are made smaller or larger by up to this factor

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.config not in CONFIGS:
            raise unknown("config", self.config, CONFIGS)
        if not 0 <= self.lead < 1:
            raise RequestError(
                f"the discriminator cannot learn alone for {self.lead:g} of the budget",
                "it is a share, and the generator needs the rest",
                "Choose 0 to 0.9.",
            )
        if bad := [name for name in self.looks if name not in BRANCHES]:
            raise RequestError(
                f"unknown branch: {bad[0]}",
                f"the discriminator has {', '.join(BRANCHES)}",
                "Write --set branches=base,edm,motion, or branches=none.",
            )

    @property
    def looks(self) -> tuple[str, ...]:
        """The branches of the discriminator."""
        return () if self.branches == "none" else tuple(self.branches.split(","))

    @property
    def network(self) -> StmiGanConfig:
        return replace(CONFIGS[self.config], branches=self.looks)


def corrupt(rng: np.random.Generator, settings: StmiGanSettings, batch: int) -> np.ndarray:
    """What is observed (B, T, 22, 3): of some motions the first half, of the others all but something.

    That is one of: whole frames, joints or limbs all along, single coordinates, each kept with a probability
    of .25 to .75. The first and the last frame stay. Where frames are dense, forecasts begin after a sixth to
    two thirds of the motion, for clips that are short, joints and limbs are lost for a while as often as all
    along, and gaps are one kind more.
    """
    frames, joints, dense = settings.network.frames, len(JOINTS), settings.config == "dense"
    known = np.ones((batch, frames, joints, 3), bool)
    for motion in known:
        if rng.random() < settings.forecasts:
            motion[rng.integers(frames // 6, 2 * frames // 3) if dense else frames // 2 :] = False
            continue
        keep = rng.uniform(0.25, 0.75)
        kinds = ("frames", "joints", "limbs", "values", *(("gap",) if dense else ()))
        kind = kinds[rng.integers(len(kinds))]
        if kind == "frames":
            motion[:] = (rng.random(frames) < keep)[:, None, None]
        elif kind == "joints":
            motion[:] = (rng.random(joints) < keep)[:, None]
        elif kind == "limbs":
            for limb in LIMBS:
                motion[:, list(limb)] = rng.random() < keep
        elif kind == "values":
            motion[:] = rng.random(motion.shape) < keep
        if kind == "gap" or (dense and kind in ("joints", "limbs") and rng.random() < 0.5):
            around = gap_mask(rng, 1, frames, joints, frames / 4, frames / 8)[0, ..., None]
            motion[:] = around if kind == "gap" else motion | around
        motion[[0, -1]] = True
    return known


def draw(rng: np.random.Generator, windows: Windows, settings: StmiGanSettings, batch: int) -> Tensor:
    """Motions (B, T, 22, 3) in metres of bodies small and tall, half of them mirrored."""
    positions = windows.draw(rng, batch)
    # Of 4 s the paper's network sees one frame at random of each fifth of a second.
    (positions,) = glance(rng, settings.network.frames, positions)
    # As often smaller than taller: .7 to 1.3, as in the paper.
    tall = rng.uniform(2.0 - settings.tallest, settings.tallest, batch)
    return positions * send(tall.astype(np.float32), positions.device)[:, None, None, None]


def glance(rng: np.random.Generator, rows: int, *motions: Tensor) -> list[Tensor]:
    """One frame at random of each part of motions (B, T, ...), the same of all of them: (B, rows, ...)."""
    batch, frames = motions[0].shape[:2]
    block = frames // rows
    chosen = send(np.arange(rows) * block + rng.integers(block, size=(batch, rows)), motions[0].device)
    return [motion[torch.arange(batch, device=motion.device)[:, None], chosen] for motion in motions]


@dataclass
class Motions:
    """What is trained on: aligned motions (B, rows, 22, 3), what is observed of them, the network's, and what
    these are to be taken for: the truth, as far as the network can draw it."""

    truth: Tensor
    observed: Tensor
    made: Tensor
    real: Tensor


class Game:
    """Generator and discriminator, and what each of them wants (equations 1 to 6)."""

    def __init__(
        self,
        generator: Generator,
        discriminator: Discriminator,
        windows: Windows,
        settings: StmiGanSettings,
        batch: int,
    ) -> None:
        self.generator, self.discriminator = generator, discriminator
        self.windows, self.settings, self.batch = windows, settings, batch
        self.motions: Motions | None = None
        self.turn = 0

    def play(self, rng: np.random.Generator) -> Motions:
        """Motions of the data, with holes, and what the generator makes of them."""
        positions = draw(rng, self.windows, self.settings, self.batch)
        observed = send(corrupt(rng, self.settings, self.batch), positions.device)
        truth = Frame.of(positions, observed).align(positions)
        with mixed(truth.device):
            made = self.generator.aligned(truth, observed, noise(self.generator, len(truth), truth.device))
        rows, together = self.settings.network.rows, self.settings.network.together
        # What a curve leaves out would tell the two apart at once, and the network could only answer it by
        # moving more.
        real = truth if together == 1 else drawable(rows, together).beside(truth) @ truth.flatten(2)
        return Motions(*glance(rng, rows, truth, observed, made.float(), real.view_as(truth)))

    def opponent_loss(self, rng: np.random.Generator, fraction: float) -> Tensor:
        """Of the discriminator: which motions are the data's, and the R1 penalty on those (equation 4).

        The penalty is on how fast the score changes with normalised coordinates, those that the generator
        makes. Steps from frame to frame are small, so a score of steps changes fast with them: without that
        penalty it pulls at coordinates harder than all that is known, the more so at high frame rates.
        """
        self.motions = self.play(rng)
        penalised = self.turn % self.settings.every == 0
        self.turn += 1
        judge, std = self.discriminator, self.generator.std
        truth = (self.motions.real / std).requires_grad_(penalised)
        with mixed(truth.device):
            fake = judge(judge.seen(self.motions.made.detach())).float()
            real = judge(judge.seen(truth * std)).float()
        loss = functional.softplus(fake).mean() + functional.softplus(-real).mean()
        if penalised:
            (slope,) = torch.autograd.grad(real.sum(), truth, create_graph=True)
            steep = slope.square().sum(dim=(1, 2, 3))
            loss = loss + 0.5 * self.settings.gamma * self.settings.every * steep.mean()
        return loss

    def loss(self, rng: np.random.Generator, fraction: float) -> Tensor:
        """Of the generator (equations 1, 2, 3 and 5); nothing while the discriminator learns alone."""
        asked = self.settings
        if asked.looks and fraction < asked.lead:
            return torch.zeros((), device=self.generator.std.device)
        motions = self.motions if asked.looks and self.motions else self.play(rng)
        loss = self.told(motions)
        if asked.looks:
            with mixed(motions.made.device):
                fake = self.discriminator(self.discriminator.seen(motions.made)).float()
            loss = loss + asked.adversarial * functional.softplus(-fake).mean()
        return loss

    def told(self, motions: Motions) -> Tensor:
        """What the truth tells: visible coordinates, distances of the extremities, and lengths of bones."""
        asked = self.settings
        seen = motions.observed if asked.looks else torch.ones_like(motions.observed)
        wrong = torch.where(seen, (motions.made - motions.truth) / self.generator.std, 0.0)
        size = self.generator.std.mean()
        apart, true = distances(motions.made) / size, distances(motions.truth) / size
        off = (apart - true).abs()
        whole = seen.all(dim=-1)
        pairs = whole[..., FIRST.beside(off)] & whole[..., SECOND.beside(off)]
        limbs, bones = LIMB_PAIRS.beside(off), BONE_PAIRS.beside(off)
        return (
            asked.reconstruction * (wrong.square().sum(dim=3) + 1e-12).sqrt().sum(dim=(1, 2)).mean()
            + asked.limbs * (off[..., limbs] * pairs[..., limbs]).sum(dim=(1, 2)).mean()
            + asked.bones * off[..., bones].sum(dim=(1, 2)).mean()
        )


def noise(generator: Generator, batch: int, device: torch.device) -> Tensor:
    """Noise for a batch, standard normal."""
    config = generator.config
    return torch.randn(batch, generator.noises, config.rows, config.width, device=device)


@torch.no_grad()
def fit_normaliser(
    generator: Generator, discriminator: Discriminator, windows: Windows, settings: StmiGanSettings
) -> None:
    """Mean and deviation of each axis over aligned motions, and how large distances and steps are."""
    rng = np.random.default_rng(settings.seed)
    positions = torch.cat([draw(rng, windows, settings, 100) for _ in range(10)])
    motion = Frame.of(positions, torch.ones_like(positions, dtype=torch.bool)).align(positions)
    for network in (generator, discriminator):
        network.mean.copy_(motion.mean(dim=(0, 1, 2)))
        network.std.copy_(motion.std(dim=(0, 1, 2)))
    generator.begin((motion.mean(dim=(0, 1)) - generator.mean) / generator.std)
    (motion,) = glance(rng, settings.network.rows, motion)
    apart = distances(motion)
    found = (apart, motion.diff(dim=1), apart.diff(dim=1))
    discriminator.sizes.copy_(torch.stack([value.square().mean().sqrt() for value in found]))


def train_stmi_gan(
    packs: Sequence[Pack],
    folder: Path,
    budget: Budget,
    settings: StmiGanSettings | None = None,
    splits: Sequence[str] = ("train",),
    start: Card | None = None,
    say: Callable[[str], None] = print,
) -> Generator:
    """Train, or go on training, in `folder`; the averaged generator comes back. Arguments as in `train_cae`.

    A run that starts from trained weights goes on with the discriminator that lies beside them, if one does
    and it has the same branches, and else with one that knows nothing.
    """
    settings = settings or StmiGanSettings()
    device = pick_device()
    torch.manual_seed(settings.seed)
    packs = [pack for pack in packs if str(pack.dataset) in DATASETS]
    windows = Windows(packs, splits, 120, device)
    held_out = Windows(packs, ("validation",), 120, device).spread(96)
    generator, discriminator = (make(settings.network).to(device) for make in (Generator, Discriminator))
    fit_normaliser(generator, discriminator, windows, settings)
    if start:
        of_kind(start, "stmi-gan")
    if start and settings.network.together > 1 and StmiGanConfig.of(start.training["network"]).together == 1:
        generator.grow(trained(start))
    elif start:
        restore(generator, start.onnx)
    if start and (judge := start.path.with_name(JUDGE)).exists() and settings.looks:
        held = {name: value.float() for name, value in load_file(judge).items()}
        if held.keys() == discriminator.state_dict().keys():
            discriminator.load_state_dict(held)
            say(f"goes on with the discriminator of {start.name}")
    if device.type == "cpu":
        quicken(generator)
    for network in (generator, discriminator):
        network.to(memory_format=torch.channels_last)
    game = Game(generator, discriminator, windows, settings, max(1, settings.batch // processes()))

    def optimizer(parameters: list[nn.Parameter]) -> torch.optim.Optimizer:
        return torch.optim.NAdam(parameters, settings.learning_rate)

    opponent = Opponent(
        discriminator, game.opponent_loss, optimizer(list(discriminator.parameters())), settings.pace
    )
    trainer = Trainer(
        generator,
        game.loss,
        lambda averaged: validate(averaged, held_out),
        folder,
        budget,
        settings,
        say,
        optimizer=optimizer,
        about={"network": asdict(settings.network)},
        data=taught(packs, splits),
        opponent=opponent if settings.looks else None,
    )
    return trainer.go(
        f"{settings.config}, {windows.frames:,} frames of {', '.join(splits)}, on {device}", start
    )


@torch.no_grad()
def validate(model: nn.Module, positions: Tensor) -> dict[str, float]:
    """Of forecasts of the second half of windows (n, 120, 22, 3) in metres.

    How far joints are off there in cm, and in the part that is seen; the ratio to the last pose held; how
    much joints move in each quarter of the forecast and how rich their spectra are (entropy), as shares of
    the truth's; and how far the spectra diverge from the truth's (pskl).
    """
    assert isinstance(model, Generator)
    frames = model.config.frames
    truth = positions[:, :: positions.shape[1] // frames]
    observed = torch.ones_like(truth, dtype=torch.bool)
    half = frames // 2
    observed[:, half:] = False
    still = truth.new_zeros(len(truth), model.noises, model.config.rows, model.config.width)
    parts = (slice(at, at + 16) for at in range(0, len(truth), 16))
    made = torch.cat([model(truth[part], observed[part], still[part])[0] for part in parts])
    off = 100 * (made - truth).norm(dim=-1)
    held = 100 * (truth[:, half - 1 : half] - truth[:, half:]).norm(dim=-1)
    figures = {
        "seen": float(off[:, :half].mean()),
        "forecast": float(off[:, half:].mean()),
        "ratio": float(off[:, half:].mean() / held.mean()),
    }
    angles = [joint_angles(motion.double().cpu().numpy()) for motion in (made, truth)]
    for quarter in range(4):
        part = slice(half + quarter * half // 4 - 1, half + (quarter + 1) * half // 4)
        moved = [_stir(motion[:, part]) for motion in (made, truth)]
        figures[f"moves{quarter + 1}"] = float(moved[0] / moved[1])
        entropy = [psent(some[:, part]) for some in angles]
        figures[f"entropy{quarter + 1}"] = entropy[0] / entropy[1]
        figures[f"pskl{quarter + 1}"] = pskl(angles[0][:, part], angles[1][:, part])
    return figures


def trained(card: Card) -> Generator:
    """The network of some weights, back from the graph that they were exported into."""
    model = Generator(StmiGanConfig.of(card.training["network"]))
    restore(model, card.onnx)
    return model.eval()


def _stir(motion: Tensor) -> Tensor:
    """Mean step of joints relative to the hips."""
    return (motion - motion[:, :, :1]).diff(dim=1).norm(dim=-1).mean()
