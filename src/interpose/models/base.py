"""interpose's own network: any part of a motion in, all of it out (`base`, and `small` of the same kind).

What is observed is said per joint and frame. Where nothing is, a classical completion that goes on as the
motion was going is the starting point, and a transformer encoder says what to add to it; so what is observed
comes back exactly, and a network that knows nothing is as good as that completion.

What it shares with others: rotations as two columns (Zhou et al. 2019), a residual on interpolation seen from
the last known pose (Oreshkin et al. 2022), a learned bias for how far frames are apart and the distance to
known ones as an input (Qin et al. 2022). Its starting point uses velocities, which theirs does not.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor, nn

from interpose.errors import RequestError
from interpose.geometry import kinematics, rotations
from interpose.geometry.constant import Constant
from interpose.geometry.ground import FLOOR
from interpose.geometry.values import wide
from interpose.models.keys import neighbours, pick
from interpose.skeletons import FEET, JOINTS, PARENTS
from interpose.skeletons.body import facing

COUNT = len(JOINTS)
SECOND = 30.0  # frames
VELOCITY = 10.0  # what velocities (m or matrix entries a frame) are multiplied with, to be about 1
# Frames that velocities reach, of rotations and of the hips: near what is best for the starting point alone,
# on the validation performer of LAFAN1, where it leaves .65, .79, .83 and .82 of the error of straight lines
# and great arcs in gaps of 5, 15, 30 and 45 frames: what a network says that has learned nothing, by
# `interpose train base --out runs/begin --set datasets=lafan1 --budget 1steps`.
REACH_TURN, REACH_WAY = 20.0, 45.0
RATE = Constant(1 / np.array([REACH_TURN] * COUNT + [REACH_WAY])[:, None])
REST = Constant([1.0, 0.0, 0.0, 0.0, 1.0, 0.0])  # columns of a joint that stands as in the T-pose
# What is never known: joints stand so, and the hips are at 0.
NEVER = Constant(np.append(np.tile(REST.values, (COUNT, 1)), np.zeros((1, 6)), axis=0))
# Rows times the cosine of the first, the sine of the second and the third are turned about Y.
FLAT, UP = Constant(np.diag([1.0, 0.0, 1.0])), Constant(np.diag([0.0, 1.0, 0.0]))
QUARTER = Constant([[0.0, 0.0, -1.0], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
# Positions of a frame, joint by joint, times this: the hips, and all joints as seen from them.
AROUND_HIPS = np.eye(3 * COUNT)
AROUND_HIPS[:3] -= np.tile(np.eye(3), COUNT)
FROM_HIPS = Constant(np.concatenate([np.eye(3 * COUNT)[:, :3], AROUND_HIPS], axis=1))
# Numbers of a frame that the network sees: columns of rotations, hips, joints around them, how both move,
# what is known, pins and whether there are any, and how near known frames are.
SEEN = 6 * COUNT + 3 + 3 * COUNT + 3 + 3 * COUNT + (COUNT + 1) + 4 * COUNT + 4

# Numbers that it says of a frame: columns of rotations, hips, contacts of the feet, and the risk.
SAID = [6 * COUNT, 3, len(FEET), 1]
PARTS = [slice(stop - size, stop) for size, stop in zip(SAID, np.cumsum(SAID).tolist())]
NEAR = 4.0  # frames from known ones at which half of what is said is added
LENGTH = 5.0  # what lengths of bones (m) are multiplied with


@dataclass(frozen=True)
class BaseConfig:
    """What the network is.

    Attributes:
        labels: action labels; the first is "", for motions without one.
        width, heads, layers: of the transformer; its inner layers are four times as wide.
        dropout: in training.
        longest: frames that it can see at once.
        residual: whether it says what to add to the starting point; else it says everything itself.
        velocities: whether the starting point goes on with the observed velocities; else it is a straight
            line, and a great arc, between known values.
        near: whether the motion is seen from the last known pose; else from the first frame.
        apart: whether attention has a learned part for how far two frames are apart.
        distances: whether the network is told how far known frames are.
        room: whether what it says counts less near known frames, where the starting point is good.
    """

    labels: tuple[str, ...] = ("",)
    width: int = 192
    heads: int = 6
    layers: int = 6
    dropout: float = 0.0
    longest: int = 192
    residual: bool = True
    velocities: bool = True
    near: bool = True
    apart: bool = True
    distances: bool = True
    room: bool = True


SMALL = BaseConfig()
# Twice as wide, so that it can begin with what `small` says (`Base.grow`).
BASE = BaseConfig(width=384, heads=12, layers=10)
CONFIGS = {"small": SMALL, "base": BASE}


@dataclass
class Motion:
    """Motions of a body scaled to the canonical leg.

    Attributes:
        local: (B, T, 22, 4) canonical rotations, relative to the parent's.
        root: (B, T, 3) metres, the hips.
    """

    local: Tensor
    root: Tensor

    def forward(self, bones: Tensor) -> tuple[Tensor, Tensor]:
        """Global rotations (B, T, 22, 4) and positions (B, T, 22, 3) with bones (B, 22, 3)."""
        move = bones[:, None, 1:].expand(-1, self.root.shape[1], -1, -1)
        return kinematics.forward(self.local, torch.cat([self.root[:, :, None], move], dim=2), PARENTS)


@dataclass
class Around:
    """The known frames around each, (..., T).

    Attributes:
        last, first: their indices, as of `neighbours`.
        since, until: how many frames they are away, as floats; 0 where there is none.
        length: how many frames they are apart; 0 at open ends.
    """

    last: Tensor
    first: Tensor
    since: Tensor
    until: Tensor
    length: Tensor

    @classmethod
    def of(cls, known: Tensor, kind: torch.dtype) -> Around:
        """Of values of which the frames (..., T) are known."""
        last, first = neighbours(known)
        frame = torch.arange(known.shape[-1], device=known.device)
        since, until, length = (d.to(kind) for d in (frame - last, first - frame, first - last))
        return cls(last, first, since.clamp(min=0), until.clamp(min=0), length)

    def some(self, part: int | slice) -> Around:
        """Of some of the values (B, n, T)."""
        every = (self.last, self.first, self.since, self.until, self.length)
        return Around(*(one[:, part] for one in every))


def complete_columns(values: Tensor, known: Tensor, around: Around, rate: Tensor | None) -> Tensor:
    """Values (..., T, n) of known frames (..., T); between, a line that is left and met at their velocities.

    A cubic of Hermite in which what the velocities differ from the line by dies away at some `rate` (...,
    1) a frame, so that long gaps do not swing out. Next to a lone known frame, and without a rate, there is
    no velocity but the line's. At open ends the value is held, after its velocity has died away.
    """
    since, until, length = around.since, around.until, around.length.clamp(min=1.0)
    share = torch.where(around.length > 0, since / length, until.clamp(max=1.0))
    held = known.to(values.dtype)
    size, pad = values.shape[-1], nn.functional.pad
    both = held[..., 1:] * held[..., :-1]
    steps = torch.cat([wide(both, size) * values.diff(dim=-2), both[..., None]], dim=-1)
    # Values, the step to or from the frame beside, and whether that is known, too.
    here = pick(torch.cat([values, pad(steps, (0, 0, 1, 0))], dim=-1), around.last)
    there = pick(torch.cat([values, pad(steps, (0, 0, 0, 1))], dim=-1), around.first)
    a, b = here[..., :size], there[..., :size]
    if rate is None:
        return a + wide(share, size) * (b - a)
    # How far each velocity carries, and how much less of the line's way that leaves.
    left = 1 - share
    leave = here[..., -1] * since * left * left * torch.exp(-rate * since)
    meet = there[..., -1] * until * share * share * torch.exp(-rate * until)
    share = share + (meet - leave) / length
    before, after = here[..., size:-1], there[..., size:-1]
    return a + wide(share, size) * (b - a) + wide(leave, size) * before - wide(meet, size) * after


def room(known: Tensor, around: Around) -> Tensor:
    """How much may be added to the starting point: 0 at frames (..., T) that are known exactly, to 1 far
    away; `around` each are those that are known at all.

    The starting point is as good as its neighbours are near: so the network, whose answers are all of about
    one size, need not learn to keep still beside them. What is noisy may always change.
    """
    held = known > 0
    # Between two known frames half their harmonic mean, at open ends the distance to the only one.
    both = around.since + around.until
    between = around.since * around.until / around.length.clamp(min=1.0)
    away = torch.where(around.length > 0, between, both)
    share = torch.where(held.any(dim=-1, keepdim=True), away / (away + NEAR), 1.0)
    return torch.where(held & (known < 1), 0.5, share)


def turned_by(values: Tensor, matrix: Tensor) -> Tensor:
    """Vectors (B, ..., 3), or several of them one after the other (B, ..., 3 n), as rows times (B, 3, 3)."""
    return (values.reshape(values.shape[0], -1, 3) @ matrix).reshape(values.shape)


class Block(nn.Module):
    """Attention and two layers, normalised before each (Xiong et al. 2020)."""

    def __init__(self, width: int, heads: int, dropout: float) -> None:
        super().__init__()
        self.heads = heads
        self.norms = nn.ModuleList(nn.LayerNorm(width) for _ in range(2))
        self.ask = nn.Linear(width, 3 * width)
        self.say = nn.Linear(width, width)
        self.inner = nn.Linear(width, 4 * width)
        self.outer = nn.Linear(4 * width, width)
        self.dropout = nn.Dropout(dropout)

    def forward(self, x: Tensor, bias: Tensor | None, batch: int) -> Tensor:
        """x: (B T, width): of rows graphs add biases as they multiply; bias: (heads, T, T), added to how much
        frames attend to each other; batch: B."""
        asked, width = self.ask(self.norms[0](x)), x.shape[1]
        query, key, value = (
            asked[:, i * width : (i + 1) * width]
            .reshape(batch, -1, self.heads, width // self.heads)
            .transpose(1, 2)
            for i in range(3)
        )
        score = (query / math.sqrt(query.shape[-1])) @ key.transpose(2, 3)
        weight = torch.softmax(score if bias is None else score + bias.to(score.dtype), dim=-1)
        told = (weight @ value).transpose(1, 2).reshape(-1, x.shape[1])
        x = x + self.dropout(self.say(told))
        deep = nn.functional.gelu(self.inner(self.norms[1](x)))
        return x + self.dropout(self.outer(deep))


@dataclass
class Start:
    """The starting point, and from where it is seen.

    Attributes:
        motion: the classical completion.
        turned, placed: (B, T, 22, 4) and (B, T, 22, 3), its global rotations and positions.
        origin: (B, 3), of the pose that all is seen from.
        away, back: (B, 3, 3), what turns rows into its heading, and back.
        columns: (B, T, 22, 6) global rotations, as seen from there.
        around: (B, 23, T) the known frames around each, of all values that may be known.
        whole: (B, T), of all of them together.
    """

    motion: Motion
    turned: Tensor
    placed: Tensor
    origin: Tensor
    away: Tensor
    back: Tensor
    columns: Tensor
    around: Around
    whole: Around


@dataclass
class Answer:
    """What the network says.

    Attributes:
        motion: complete; what is known is as it was.
        contact: (B, T, 4) logits of whether the joints FEET stand.
        risk: (B, T) logarithm of by how many cm joints are expected to be off, in the mean.
    """

    motion: Motion
    contact: Tensor
    risk: Tensor


class Encoder(nn.Module):
    """The transformer: what is seen of each frame (B, T, SEEN) to what is said of it (B, T, SAID)."""

    def __init__(self, config: BaseConfig) -> None:
        super().__init__()
        width = config.width
        self.see = nn.Linear(SEEN, width)
        self.body = nn.Linear(3 * COUNT, width)
        self.label = nn.Embedding(len(config.labels), width)
        self.blocks = nn.ModuleList(Block(width, config.heads, config.dropout) for _ in range(config.layers))
        self.norm = nn.LayerNorm(width)
        self.say = nn.Linear(width, sum(SAID))
        self.apart = nn.Parameter(torch.zeros(config.heads, 2 * config.longest - 1)) if config.apart else None
        nn.init.zeros_(self.say.weight)
        nn.init.zeros_(self.say.bias)
        nn.init.zeros_(self.label.weight)

    def forward(self, seen: Tensor, label: Tensor, bones: Tensor) -> Tensor:
        batch = seen.shape[0]  # len() would be a constant in graphs
        body = self.body(LENGTH * bones.flatten(1)) + self.label(label)
        x = self.see(seen.flatten(0, 1)).unflatten(0, (batch, -1)) + body[:, None]
        bias = None
        if self.apart is not None:
            frame = torch.arange(seen.shape[1], device=x.device)
            apart = (frame[:, None] - frame + self.apart.shape[1] // 2).flatten()
            bias = self.apart.T.index_select(0, apart).T.unflatten(1, (seen.shape[1], -1))
        x = x.flatten(0, 1)
        for block in self.blocks:
            x = block(x, bias, batch)
        said: Tensor = self.say(self.norm(x)).unflatten(0, (batch, -1))
        return said


class Base(nn.Module):
    """Part of a motion in, all of it out. Values that are not known may be anything finite."""

    def __init__(self, config: BaseConfig = SMALL) -> None:
        super().__init__()
        self.config = config
        self.encoder = Encoder(config)

    def grow(self, other: Base) -> None:
        """Begin with what a network of fewer units and blocks says, exactly (Chen et al. 2016, Net2Net).

        Each of its units is here several times, and whoever listens to it listens a little differently to
        each, so that they part as they learn. Blocks that it does not have add nothing yet.
        """
        times, rest = divmod(self.config.width, other.config.width)
        blocks, held = len(self.encoder.blocks), len(other.encoder.blocks)
        if self.config.longest != other.config.longest:
            why = f"it sees {other.config.longest} frames at once, and this one {self.config.longest}"
            raise RequestError(
                "a network cannot begin with another one", why, "Choose one that sees as many."
            )
        if rest or self.config.heads != times * other.config.heads or blocks < held:
            raise RequestError(
                f"a network of width {self.config.width} cannot begin with one of width {other.config.width}",
                "each of its units, and of its heads, is taken as often, and all of its blocks",
                f"Choose a multiple, as width {2 * other.config.width} with {2 * other.config.heads} heads.",
            )
        old = {name: value.float() for name, value in other.state_dict().items()}
        places = {round(i * (blocks - 1) / max(1, held - 1)): i for i in range(held)}
        with torch.no_grad():
            for name, value in self.state_dict().items():
                part = name.split(".")
                if part[1] == "blocks" and int(part[2]) not in places:
                    if part[3] in ("say", "outer"):
                        value.zero_()
                    continue
                if part[1] == "blocks":
                    part[2] = str(places[int(part[2])])
                began = old[".".join(part)]
                if part[1] == "label":
                    value.copy_(began.repeat(1, times))
                    continue
                if len(value) > len(began):  # what asks is three in one: queries, keys and values
                    thirds = began.unflatten(0, (3 if part[-2] == "ask" else 1, -1))
                    began = torch.cat([thirds] * times, dim=1).flatten(0, 1)
                if value.shape != began.shape:
                    share = torch.randn(times, *began.shape) / (4 * times)
                    share += 1 / times - share.mean(dim=0)
                    began = torch.cat([*(share * began)], dim=1)
                value.copy_(began)

    def start(self, local: Tensor, root: Tensor, known: Tensor, bones: Tensor) -> Start:
        """The classical completion of what is known; arguments as in `complete`."""
        count = local.shape[1]
        held = known > 0
        columns = torch.cat([rotations.to_6d(local), nn.functional.pad(root, (0, 3))[:, :, None]], dim=2)
        whole = held.all(dim=2)
        placed_hips = held[..., 0] & held[..., COUNT]
        known_values = held.transpose(1, 2)
        asked = torch.cat([known_values, placed_hips[:, None], whole[:, None]], dim=1)
        every = Around.of(asked, columns.dtype)
        around = every.some(slice(COUNT + 1))
        rate = RATE.beside(columns) if self.config.velocities else None
        done = complete_columns(columns.transpose(1, 2), known_values, around, rate).transpose(1, 2)
        ever = wide(held.any(dim=1).to(done.dtype), 6)[:, None]
        done = torch.where(ever > 0, done, NEVER.beside(done))
        motion = Motion(rotations.from_6d(done[:, :, :COUNT]), done[:, :, COUNT, :3])
        globals_, placed = motion.forward(bones)
        if self.config.near:
            frame = torch.arange(count, device=held.device)
            missing = torch.where(whole, count - 1, frame).amin(dim=1, keepdim=True)
            at = every.last[:, COUNT + 1].gather(1, missing)
        else:
            at = torch.zeros_like(every.last[:, COUNT + 1, :1])
        pose = pick(placed.flatten(2), at).unflatten(2, (COUNT, 3))[:, 0]
        origin = pose[:, 0] * FLOOR.beside(pose)
        yaw = facing(pose)[:, None, None]
        back = torch.cos(yaw) * FLAT.beside(pose) + torch.sin(yaw) * QUARTER.beside(pose) + UP.beside(pose)
        away = back.transpose(1, 2)
        columns = turned_by(rotations.to_6d(globals_), away)
        return Start(motion, globals_, placed, origin, away, back, columns, around, every.some(COUNT + 2))

    def features(self, start: Start, known: Tensor, pinned: Tensor, pins: Tensor) -> Tensor:
        """(B, T, SEEN): what the network sees of the starting point, from where it is seen."""
        origin = start.origin.repeat(1, COUNT)[:, None]
        placed = turned_by(start.placed.flatten(2) - origin, start.away)
        moving = placed @ FROM_HIPS.beside(placed)
        steps = nn.functional.pad(moving.diff(dim=1), (0, 0, 1, 0))
        there = pins.to(placed.dtype)
        off = wide(there, 3) * turned_by(pinned - start.placed, start.away)
        far = torch.stack([start.whole.since, start.whole.until], dim=-1)
        near = torch.cat([far / SECOND, 1 / (1 + far)], dim=-1)
        if not self.config.distances:
            near = torch.zeros_like(near)
        parts = [start.columns.flatten(2), moving, VELOCITY * steps]
        parts += [known.to(placed.dtype), off.flatten(2), there, near]
        return torch.cat(parts, dim=2)

    def complete(
        self,
        local: Tensor,
        root: Tensor,
        known: Tensor,
        pinned: Tensor,
        pins: Tensor,
        label: Tensor,
        bones: Tensor,
    ) -> Answer:
        """Complete a motion.

        Args:
            local: (B, T, 22, 4) canonical rotations relative to the parent's.
            root: (B, T, 3) metres, the hips of a body scaled to the canonical leg.
            known: (B, T, 23) 0 to 1, how far each rotation, and last the place of the hips, is known: 0 not
                at all, 1 exactly; what is in between is taken for noisy.
            pinned: (B, T, 22, 3) metres, where joints are to be.
            pins: (B, T, 22) booleans, of which joints that is said.
            label: (B,) index into the configuration's labels; 0 for none.
            bones: (B, 22, 3) metres.
        """
        start = self.start(local, root, known, bones)
        said = self.encoder(self.features(start, known, pinned, pins), label, bones)
        return self.answer(start, said, local, known)

    def answer(self, start: Start, said: Tensor, local: Tensor, known: Tensor) -> Answer:
        """What is said (B, T, SAID) of the starting point, as a motion; other arguments as in `complete`."""
        config = self.config
        said = said.to(start.motion.root.dtype)
        columns, moved, contact, risk = (said[..., part] for part in PARTS)
        exactly = known >= 1
        open_ = 1 - exactly.to(known.dtype)
        if config.room and config.residual:
            open_ = room(known.transpose(1, 2), start.around).transpose(1, 2)
        # A joint's global rotation is known if its own and all above it are.
        above = kinematics.ancestors(PARENTS).beside(open_)
        share = (above * open_[..., None, :COUNT]).amax(dim=-1)
        begin = start.columns
        columns = columns.unflatten(2, (COUNT, 6))
        if not config.residual:
            columns = columns + REST.beside(columns) - begin
        turned = rotations.from_6d(turned_by(begin + wide(share, 6) * columns, start.back))
        turned = kinematics.local_rotations(turned, PARENTS)
        turned = torch.where(wide(exactly[..., :COUNT].to(local.dtype), 4) > 0, local, turned)
        way = turned_by(moved, start.back)
        if not config.residual:
            way = way + start.origin[:, None] - start.motion.root
        placed = start.motion.root + open_[..., COUNT:] * way
        return Answer(Motion(turned, placed), contact, risk[..., 0])

    def forward(
        self,
        local: Tensor,
        root: Tensor,
        known: Tensor,
        pinned: Tensor,
        pins: Tensor,
        label: Tensor,
        bones: Tensor,
    ) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """What ONNX holds: `complete`, as rotations (B, T, 22, 4), hips (B, T, 3), contacts (B, T, 4) 0 to 1
        and the expected error (B, T) in cm."""
        answer = self.complete(local, root, known, pinned, pins, label, bones)
        return answer.motion.local, answer.motion.root, torch.sigmoid(answer.contact), torch.exp(answer.risk)
