"""The recipe of interpose's own network, `base` and `small`, at 30 fps: every task in one mixture.

What published recipes for in-betweening have in common is in it: gaps as often as they are short (Duan et al.
2021), joints through forward kinematics and global rotations in the loss (Oreshkin et al. 2022). What is
settled by trial here is a setting, so that the trial can be repeated: `--set velocities=0` and so on.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import ClassVar

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from interpose.datasets import Pack
from interpose.errors import RequestError, unknown
from interpose.geometry import kinematics, rotations
from interpose.geometry.constant import Constant
from interpose.geometry.ground import FLOOR
from interpose.methods.weights import Card
from interpose.models.base import CONFIGS, COUNT, Answer, Base, BaseConfig, Motion, turned_by
from interpose.observation.corruption import LIMBS
from interpose.skeletons import FEET, JOINTS, PARENTS
from interpose.skeletons.body import facing
from interpose.training.budget import Budget
from interpose.training.device import mixed, pick_device, processes, send
from interpose.training.loop import SHARE, SOME, SWITCH, Settings, Trainer, of_kind, recorded, restore, taught
from interpose.training.optimizers import Muon
from interpose.training.poses import Batch, Poses, labels_of

LOWER = [JOINTS.index(side + part) for side in ("Left", "Right") for part in ("UpLeg", "Leg", "Foot", "Toe")]
HANDS_FEET = [JOINTS.index(side + part) for side in ("Left", "Right") for part in ("Hand", "Foot")]
ENDS = [*HANDS_FEET, JOINTS.index("Head")]
SHORTEST = 30  # frames; clips that are shorter are left out
KNOWN = 10  # frames before a gap
JUDGED = KNOWN + 45 + 1  # frames of a window that is validated: known ones, the longest gap, and one more
# Windows that tell how far joints are from their mean, and frames of each: as many as in L2P's statistics.
SCATTERED, SEEN_AT_ONCE = 2048, 50
# A foot stands that moves by less than this in a frame, in metres (.15 m a second).
STANDS = 0.005
STANDING = Constant(FEET)
TYPICAL = 0.05  # metres that the starting point is off, in gaps of a second
# How often each kind of task is drawn, by what is to be learned: all of them, all of them by who knows whole
# poses already and not yet single joints, or in-betweening alone.
TASKS: dict[str, dict[str, float]] = {
    "all": {
        "gap": 0.44,
        "gaps": 0.06,
        "keys": 0.1,
        "joints": 0.08,
        "limbs": 0.06,
        "half": 0.04,
        "moments": 0.04,
        "path": 0.03,
        "pins": 0.05,
        "forecast": 0.05,
        "noise": 0.05,
    },
    "parts": {
        "gap": 0.26,
        "gaps": 0.03,
        "keys": 0.1,
        "joints": 0.12,
        "limbs": 0.14,
        "half": 0.08,
        "moments": 0.05,
        "path": 0.03,
        "pins": 0.05,
        "forecast": 0.09,
        "noise": 0.05,
    },
    "gap": {"gap": 1.0},
}


# How a network is wired, which none can change that begins with another.
KIN = ("base", "small", "small-open")  # what runs networks of this kind
WIRING = ("residual", "velocities", "near", "apart", "distances", "room")


@dataclass
class BaseSettings(Settings):
    """The recipe."""

    LIMITS: ClassVar = {
        **Settings.LIMITS,
        "shortest": SOME,
        "longest": SOME,
        "short": (-10, 10),  # beyond that all gaps are the shortest, or the longest
        "context": (1, (BaseConfig().longest - 1) // 2),  # the network sees it on both sides of a gap
        "usual": SHARE,
        "labelled": SHARE,
        "dropout": (0, 0.9),
        "pace": SHARE,
        **dict.fromkeys(("muon", "mirror", "together", "scattered", *WIRING), SWITCH),
    }

    config: str = "small"  # one of CONFIGS
    tasks: str = "all"  # one of TASKS
    datasets: str = ""  # names separated by commas; all packs without any
    batch: int = 64  # of all processes together
    learning_rate: float = 3e-3
    warm_up: float = 0.05
    decay: float = 0.01
    muon: int = 1  # whether Muon moves the matrices of the blocks; else AdamW moves all
    shortest: int = 1  # frames of a gap
    longest: int = 120
    short: float = 1.0  # gaps are drawn as often as their length to minus this: 0 for uniformly
    context: int = 10  # frames before a gap, and after it, at most
    usual: float = 0.5  # share of gaps with as many frames before them, and, drawn apart, one after
    labelled: float = 0.5  # share of the motions that are told their label
    noise: float = 0.06  # metres, and radians, of the worst noise
    mirror: int = 1  # whether half of the motions are mirrored
    pace: float = 0.0  # share by which motions are shown faster or slower, at most
    # The network's own settings.
    dropout: float = 0.0
    residual: int = 1
    velocities: int = 1
    near: int = 1
    apart: int = 1
    distances: int = 1
    room: int = 1
    width: int = 0  # 0 for the configuration's
    heads: int = 0
    layers: int = 0
    # Weights of the losses.
    position: float = 10.0  # of metres, in the mean over what is missing
    rotation: float = 10.0  # of matrix entries
    velocity: float = 10.0  # of metres a frame
    contact: float = 0.2
    slide: float = 5.0  # of metres a frame that a standing foot moves
    risk: float = 0.02
    # How far a batch counts by what it leaves of the starting point's error: 0 by metres alone, 1 by that.
    relative: float = 0.0
    # Whether a pose is off by the root of its joints' mean square, as L2P has it; else by their mean.
    together: int = 0
    # Whether joints are off, along each axis of the body, in units of how far they are from their mean there,
    # as L2P has it; else in metres along all.
    scattered: int = 0

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.config not in CONFIGS:
            raise unknown("config", self.config, CONFIGS)
        if self.tasks not in TASKS:
            raise unknown("tasks", self.tasks, TASKS)

    def network(self, labels: tuple[str, ...]) -> BaseConfig:
        base = CONFIGS[self.config]
        heads, width = self.heads or base.heads, self.width or base.width
        if width % heads:
            raise RequestError(
                f"a network cannot be {width} wide",
                f"its {heads} heads share the width evenly",
                f"Write --set width={heads * max(1, round(width / heads))}.",
            )
        return replace(
            base,
            labels=labels,
            dropout=self.dropout,
            width=width,
            heads=heads,
            layers=self.layers or base.layers,
            residual=bool(self.residual),
            velocities=bool(self.velocities),
            near=bool(self.near),
            apart=bool(self.apart),
            distances=bool(self.distances),
            room=bool(self.room),
        )


@dataclass
class Task:
    """What is asked of a batch: arrays over (B, T, ...).

    Attributes:
        known: (B, T, 23) 0 to 1, as the network wants it.
        pins: (B, T, 22) whose positions are told.
        noisy: (B,) whose values are noisy.
    """

    known: np.ndarray
    pins: np.ndarray
    noisy: np.ndarray


def draw_task(rng: np.random.Generator, settings: BaseSettings, batch: int) -> Task:
    """Tasks of motions of one length: frames before a gap, the gap and frames after it.

    Most often something is missing in the gap alone; joints and limbs also from one end to the other.
    """
    lengths = np.arange(settings.shortest, settings.longest + 1)
    chance = lengths.astype(float) ** -settings.short
    gap = int(rng.choice(lengths, p=chance / chance.sum()))
    before = (
        int(rng.integers(1, settings.context + 1)) if rng.random() < 1 - settings.usual else settings.context
    )
    after = 1 if rng.random() < settings.usual else int(rng.integers(1, settings.context + 1))
    count = before + gap + after
    hole = slice(before, before + gap)
    known, pins = np.ones((batch, count, COUNT + 1), np.float32), np.zeros((batch, count, COUNT), bool)
    noisy = np.zeros(batch, bool)
    kinds = list(TASKS[settings.tasks])
    odds = np.array([TASKS[settings.tasks][kind] for kind in kinds])
    for i, kind in enumerate(rng.choice(kinds, batch, p=odds / odds.sum())):
        part = slice(None) if kind in ("joints", "limbs", "half") and rng.random() < 0.5 else hole
        if kind in ("gap", "path", "pins"):
            known[i, hole] = 0
            if kind == "path":
                known[i, hole, COUNT] = 1
            elif kind == "pins":
                chosen = rng.permutation(ENDS)[: rng.integers(1, len(ENDS) + 1)]
                frames = np.flatnonzero(rng.random(gap) < rng.choice([1.0, 1.0, 0.1])) + before
                pins[i, frames[:, None], chosen] = True
        elif kind == "gaps":
            known[i, before : count - 1] = (rng.random(count - 1 - before) < 0.3)[:, None]
        elif kind == "keys":
            known[i, : count - 1] = 0
            known[i, [0, count - 1]] = 1
            known[i, rng.integers(count, size=rng.integers(0, 2 + gap // 12))] = 1
        elif kind == "joints":
            # Hips' rotation is the first column: it goes with the rest of the pose alone.
            lost = 1 + rng.permutation(COUNT - 1)[: rng.integers(1, 4)]
            known[i, part, lost[:, None]] = 0
        elif kind == "limbs":
            for limb in rng.permutation(4)[: rng.integers(1, 3)]:
                known[i, part, np.array(LIMBS[limb])[:, None]] = 0
        elif kind == "half":
            lower = rng.random() < 0.5
            half = np.array([j for j in range(1, COUNT) if (j in LOWER) == lower])
            known[i, part, half[:, None]] = 0
        elif kind == "moments":
            known[i, :, 1:COUNT] = rng.random((count, COUNT - 1)) >= rng.uniform(0.1, 0.5)
        elif kind == "forecast":
            known[i, before:] = 0
        else:
            known[i] = 0.5
            noisy[i] = True
        if (known[i] == 1).all():  # by chance, in short windows
            known[i, hole] = 0
    return Task(known, pins, noisy)


def draw_batch(
    rng: np.random.Generator, poses: Poses, settings: BaseSettings, batch: int
) -> tuple[Batch, Task]:
    """Motions, and what is asked of each."""
    task = draw_task(rng, settings, batch)
    drawn = poses.draw(rng, batch, task.known.shape[1], mirror=bool(settings.mirror), pace=settings.pace)
    unsaid = send(rng.random(batch) >= settings.labelled, poses.device)
    drawn.label = torch.where(unsaid, 0, drawn.label)
    return drawn, task


def spoil(motion: Motion, noisy: Tensor, worst: float, seed: int) -> Motion:
    """Motions with noise of up to `worst` metres, and radians, in those that are `noisy` (B,)."""
    local, root = motion.local, motion.root
    generator = torch.Generator(root.device).manual_seed(seed)
    drawn = torch.rand(len(root), 1, 1, device=root.device, generator=generator)
    size = worst * drawn * noisy[:, None, None]
    moved = root + size * torch.randn(root.shape, device=root.device, generator=generator)
    turns = torch.randn((*local.shape[:-1], 3), device=root.device, generator=generator)
    return Motion(rotations.multiply(local, rotations.exp(size[..., None] * turns)), moved)


def scatter(poses: Poses) -> Tensor:
    """(22, 3) how much errors count of each joint along the axes of the body, 1 in the mean of squares: the
    further joints are from their mean there, in windows around their middle, the less.

    So L2P counts (Harvey et al. 2020), to which errors across the way are twice as wide as those along it.
    """
    drawn = poses.spread(SCATTERED, min(SEEN_AT_ONCE, int(poses.counts.max())))
    placed = drawn.positions()
    middle = placed[:, :, :1].mean(dim=1, keepdim=True) * FLOOR.beside(placed)
    turned = rotations.about("Y", -facing(placed[:, KNOWN - 1]))[:, None, None]
    deviation = rotations.rotate(turned, placed - middle).flatten(0, 1).std(dim=0)
    share = 1 / deviation.clamp(min=1e-3)
    return share / share.square().mean().sqrt()


class Losses:
    """What is wrong with an answer, as scalars by name.

    Args:
        settings: what counts how much.
        counts: (22, 3) how much errors of positions count, of each joint along the axes of the body; alike
            without them.
    """

    def __init__(self, settings: BaseSettings, counts: Tensor | None = None) -> None:
        self.settings, self.counts = settings, counts

    def parts(
        self, answer: Answer, rotation: Tensor, placed: Tensor, known: Tensor, bones: Tensor, away: Tensor
    ) -> dict[str, Tensor]:
        """`away` (B, 3, 3) turns rows into the heading of the body."""
        turned, said = answer.motion.forward(bones)
        # Frames in which something is missing; each motion counts the same, however long its gap is.
        missing = (known < 1).any(dim=2).to(said.dtype)
        share = missing / missing.sum(dim=1, keepdim=True).clamp(min=1)

        def mean(values: Tensor) -> Tensor:
            return (values * share).sum(dim=1).mean()

        off = (said - placed).norm(dim=-1)
        columns = rotations.to_6d(turned) - rotations.to_6d(rotation)
        step, true_step = said.diff(dim=1), placed.diff(dim=1)
        moved = functional.pad((step - true_step).abs().mean(dim=(2, 3)), (1, 0))
        feet = STANDING.beside(step)
        stands = (true_step[:, :, feet].norm(dim=-1) < STANDS).to(said.dtype)
        slid = functional.pad((step[:, :, feet].norm(dim=-1) * stands).mean(dim=2), (1, 0))
        contact = functional.binary_cross_entropy_with_logits(
            answer.contact[:, 1:], stands, reduction="none"
        ).mean(dim=2)
        error = off.detach().mean(dim=2)
        if self.counts is not None:
            off = (turned_by(said - placed, away) * self.counts).norm(dim=-1)
        # The root has no gradient at zero.
        pose = off.square().mean(dim=2).clamp(min=1e-10).sqrt() if self.settings.together else off.mean(dim=2)
        return {
            "position": mean(pose + 0.5 * (said - placed)[:, :, 0].norm(dim=-1)),
            "rotation": mean(columns.abs().mean(dim=(2, 3))),
            "velocity": mean(moved),
            "slide": mean(slid),
            "contact": contact.mean(),
            # The likelihood of the error under an exponential distribution of the mean exp(risk).
            "risk": mean(answer.risk + 100 * error * torch.exp(-answer.risk)),
        }

    def __call__(
        self, answer: Answer, rotation: Tensor, placed: Tensor, known: Tensor, bones: Tensor, away: Tensor
    ) -> Tensor:
        parts = self.parts(answer, rotation, placed, known, bones, away)
        return torch.stack([getattr(self.settings, name) * part for name, part in parts.items()]).sum()


def relief(begun: Tensor, placed: Tensor, known: Tensor) -> Tensor:
    """How far off the starting point of a batch is, as a multiple of TYPICAL.

    In metres long gaps are most of the loss: a gap of 5 frames has a sixth of the gradient of one of 30. Each
    batch is of one length, so that it can be counted by how hard it is.
    """
    missing = (known < 1).any(dim=2)
    off = (begun - placed).norm(dim=-1).mean(dim=2)
    return (off * missing).sum() / missing.sum().clamp(min=1) / TYPICAL + 1e-2


def title(config: str, datasets: str, free: bool = False) -> str:
    """What weights are called: the configuration, and what they were trained on, if not on all; "open" if on
    CMU and they are free for any use."""
    names = [name for name in datasets.split(",") if name]
    return "-".join([config, *(["open"] if free and names == ["cmu"] else names)])


def chosen(packs: Sequence[Pack], names: str) -> list[Pack]:
    """The packs that are asked for. RequestError for one that is not there."""
    if not names:
        return list(packs)
    held = {str(pack.dataset): pack for pack in packs}
    if bad := [name for name in names.split(",") if name not in held]:
        raise RequestError(
            f"there is no pack of {bad[0]}", f"there are {', '.join(held)}", "Make it: interpose data pack."
        )
    return [held[name] for name in names.split(",")]


def begin(settings: BaseSettings, labels: tuple[str, ...], start: Card | None) -> Base:
    """The network of a run that begins: a new one, or that of `start`, larger where that is asked for."""
    asked = settings.network(labels)
    if not start:
        return Base(asked)
    of_kind(start, *KIN)
    # What a network is wired like has no weights of its own that could tell.
    wired = {**start.training["network"], "labels": labels, "dropout": settings.dropout}
    model = Base(BaseConfig(**wired))
    # Larger than they were only where that is asked for: by name, or by its width.
    larger = settings.width or settings.config != start.training["config"]
    grows = larger and asked.width > model.config.width
    sizes = () if grows else tuple(name for name in ("width", "heads", "layers") if getattr(settings, name))
    if not grows and settings.config != (config := start.training["config"]):
        raise RequestError(
            f"cannot begin with {start.name} and config={settings.config}",
            f"it has config={config}",
            f"Write --set config={config}, or train from nothing, without --start.",
        )
    for name in (*WIRING, *sizes):
        if (now := getattr(asked, name)) != (then := getattr(model.config, name)):
            raise RequestError(
                f"cannot begin with {start.name} and {name}={int(now)}",
                f"it has {name}={int(then)}",
                f"Write --set {name}={int(then)}, or train from nothing, without --start.",
            )
    restore(model, start.onnx)
    if not grows:
        return model
    grown = Base(replace(model.config, width=asked.width, heads=asked.heads, layers=asked.layers))
    grown.grow(model)
    return grown


def train_base(
    packs: Sequence[Pack],
    folder: Path,
    budget: Budget,
    settings: BaseSettings | None = None,
    splits: Sequence[str] = ("train",),
    start: Card | None = None,
    say: Callable[[str], None] = print,
) -> Base:
    """Train, or go on training, in `folder`; the averaged model comes back. Arguments as in `train_cae`."""
    settings = settings or BaseSettings()
    device = pick_device()
    torch.manual_seed(settings.seed)
    kept = chosen(packs, settings.datasets)
    # How it is wired, and which row of the embedding is which label, no weight could tell.
    before = recorded(folder, "network")
    labels = tuple(before["labels"]) if before else labels_of(kept, splits, start.labels if start else ("",))
    poses = Poses(kept, splits, labels, SHORTEST, device)
    # Of all data sets, so that runs on some of them can be laid beside those on all.
    held_out = Poses(packs, ("validation",), labels, SHORTEST, device).spread(128, JUDGED)
    model = Base(BaseConfig(**{**before, "labels": labels})) if before else begin(settings, labels, start)
    model = model.to(device)
    losses = Losses(settings, scatter(poses) if settings.scattered else None)
    batch = max(1, settings.batch // processes())
    # No longer than the network can see with what is around them; nor, where all clips are short, as a user's
    # own may be, than fit into them.
    room = min(model.config.longest, int(poses.counts.max())) - 2 * settings.context
    fit = max(1, min(settings.longest, room))
    if settings.shortest > fit:
        raise RequestError(
            f"cannot learn from gaps of {settings.shortest} frames and more",
            f"with {settings.context} on either side, clips and network have room for {fit}",
            f"Write --set shortest={fit} or less, or a smaller --set context.",
        )
    drawing = replace(settings, longest=fit)

    def loss(rng: np.random.Generator, fraction: float) -> Tensor:
        drawn, task = draw_batch(rng, poses, drawing, batch)
        known, pins = (send(x, device) for x in (task.known, task.pins))
        given = Motion(kinematics.local_rotations(drawn.rotation, PARENTS), drawn.root)
        seed = int(rng.integers(2**31))
        if task.noisy.any():
            given = spoil(given, send(task.noisy, device), settings.noise, seed)
        placed = drawn.positions()
        start = model.start(given.local, given.root, known, drawn.bones)
        seen = model.features(start, known, placed, pins)
        with mixed(device):
            said = model.encoder(seen, drawn.label, drawn.bones)
        answer = model.answer(start, said, given.local, known)
        weight = relief(start.placed, placed, known) ** -settings.relative
        return weight * losses(answer, drawn.rotation, placed, known, drawn.bones, start.away)

    def optimizer(parameters: list[nn.Parameter]) -> torch.optim.Optimizer | Muon:
        if settings.muon:
            named = list(model.named_parameters())
            return Muon(named, "encoder.blocks.", settings.learning_rate, settings.decay)
        return torch.optim.AdamW(
            parameters, settings.learning_rate, (0.9, 0.99), weight_decay=settings.decay, fused=True
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
        about={"network": asdict(model.config)},
        data=taught(kept, splits),
    )
    return trainer.go(f"{settings.config}, {poses.told}, on {device}", start)


def judge(card: Card, pack: Pack) -> dict[str, float]:
    """What `validate` finds of trained weights on the clips of a pack that are held out."""
    network = {**card.training["network"], "labels": tuple(card.labels)}
    model = Base(BaseConfig(**network))
    restore(model, card.onnx)
    device = torch.device("cpu")
    return validate(
        model.eval(), Poses([pack], ("validation",), card.labels, SHORTEST, device).spread(128, JUDGED)
    )


@torch.no_grad()
def validate(model: nn.Module, batch: Batch) -> dict[str, float]:
    """Joints in cm and global rotations in degrees, after ten known frames and before one, and the ratios to
    straight lines and great arcs; how well feet and the expected error are told."""
    assert isinstance(model, Base)
    figures: dict[str, float] = {}
    local, placed = kinematics.local_rotations(batch.rotation, PARENTS), batch.positions()
    plain = Base(replace(model.config, velocities=False)).to(placed.device)
    for gap in (5, 15, 30, 45):
        part = slice(0, KNOWN + gap + 1)
        inside = slice(KNOWN, KNOWN + gap)
        known = placed.new_ones(len(placed), part.stop, COUNT + 1)
        known[:, inside] = 0
        pins = torch.zeros(known.shape[0], part.stop, COUNT, dtype=torch.bool, device=placed.device)
        given = (local[:, part], batch.root[:, part], known, placed[:, part], pins)
        answer = model.complete(*given, torch.zeros_like(batch.label), batch.bones)
        line = plain.start(*given[:3], batch.bones)
        turned, said = answer.motion.forward(batch.bones)
        true = placed[:, part][:, inside]
        off, base = ((p[:, inside] - true).norm(dim=-1) for p in (said, line.placed))
        angles, base_angles = (
            rotations.angle(q[:, inside], batch.rotation[:, part][:, inside]).mean()
            for q in (turned, line.turned)
        )
        figures[f"gap{gap}"] = 100 * float(off.mean())
        figures[f"ratio{gap}"] = float(off.mean() / base.mean())
        figures[f"turn_ratio{gap}"] = float(angles / base_angles)
        expected = torch.exp(answer.risk[:, inside])
        figures[f"risk{gap}"] = float(expected.mean() / (100 * off.mean()))
    return figures
