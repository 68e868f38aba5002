"""The spatio-temporal inpainting GAN of Hernandez Ruiz et al. 2019: positions with holes in, a motion out.

`Generator` is the whole method: it aligns a motion, completes it and puts it back; it is what ONNX holds.
`Discriminator` trains it. Which branches judge is a matter of the configuration: none is the paper's NoGAN.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import torch
from scipy import interpolate
from torch import Tensor, nn
from torch.nn import functional

from interpose.geometry.constant import Constant
from interpose.geometry.ground import turn
from interpose.models.keys import neighbours, pick
from interpose.skeletons import JOINTS
from interpose.skeletons.body import PAIRS, facing

VALUES = 3 * len(JOINTS)
BRANCHES = ("base", "edm", "motion")
ENDS = tuple(itertools.combinations(range(len(JOINTS)), 2))  # pairs of joints whose distance is looked at
FIRST, SECOND = (Constant(side) for side in zip(*ENDS))


@dataclass(frozen=True)
class StmiGanConfig:
    """What the network is; the paper's is the default, for 22 joints instead of 17.

    Attributes:
        frames: of a window.
        fps: at which it thinks; 20 frames of 4 s in the paper.
        together: frames, one after the other, that are a row of the image; one in the paper.
        width: values that a row is encoded into, four for each coordinate of a frame in the paper.
        gates: gated blocks of the frame encoder, and of the decoder.
        blocks: U-blocks one after the other.
        channels: of the levels of a U-block, each half as large as the one before.
        branches: what the discriminator looks at, of BRANCHES; () for a network without one.
    """

    frames: int = 20
    fps: float = 5.0
    together: int = 1
    width: int = 4 * VALUES
    gates: int = 3
    blocks: int = 4
    channels: tuple[int, ...] = (32, 64, 96)
    branches: tuple[str, ...] = BRANCHES

    @classmethod
    def of(cls, held: dict[str, Any]) -> StmiGanConfig:
        """The configuration that a card holds."""
        values: dict[str, Any] = {
            name: tuple(value) if isinstance(value, list) else value for name, value in held.items()
        }
        return cls(**values)

    @property
    def rows(self) -> int:
        """Rows of the image that a motion is written as."""
        return self.frames // self.together


PAPER = StmiGanConfig()
# For users: 4 s at 30 fps. The image is the paper's, a row for each fifth of a second; of rows are said poses
# on a curve. With something to say of each frame a network trembles, and passes that off as motion.
DENSE = StmiGanConfig(frames=120, fps=30.0, together=6)
CONFIGS = {"paper": PAPER, "dense": DENSE}


class Gated(nn.Module):
    """Two layers whose output takes the place of the input as far as a gate lets it (section 6, figure 4)."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.first = nn.Linear(width, width // 2)
        self.second = nn.Linear(width // 2, width)
        self.gate = nn.Linear(width, width)
        # At the start almost everything passes as it is (Srivastava 2015), else six blocks forget the input.
        nn.init.constant_(self.gate.bias, -4.0)

    def forward(self, x: Tensor) -> Tensor:
        share = torch.sigmoid(self.gate(x))
        return share * self.second(torch.relu(self.first(x))) + (1 - share) * x


class FrameNetwork(nn.Sequential):
    """Each frame, or few together, by itself: (..., into) to (..., out), in gated blocks `width` wide.

    As figure 4 draws it, but for what section 6 says ends it, a linear layer and one more gate: here the
    encoder ends in its last block, and the decoder in the linear layer alone.
    """

    def __init__(self, into: int, width: int, gates: int, out: int | None = None) -> None:
        last = [] if out is None else [nn.Linear(width, out)]
        super().__init__(nn.Linear(into, width), *(Gated(width) for _ in range(gates)), *last)


class Noise(nn.Module):
    """Adds noise (B, 1, T, H), as much to each channel as it learns; none at the start (Karras 2019)."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.scale = nn.Parameter(torch.zeros(channels, 1, 1))

    def forward(self, x: Tensor, noise: Tensor) -> Tensor:
        return torch.addcmul(x, self.scale.to(x.dtype), noise[..., : x.shape[-2], : x.shape[-1]])


class UBlock(nn.Module):
    """Refines a motion (B, 1, T, H) that is written as an image: down through the levels and up again."""

    def __init__(self, channels: tuple[int, ...]) -> None:
        super().__init__()
        into = (channels[0], *channels[:-1])
        self.lift = nn.Conv2d(1, channels[0], 1)
        self.down = nn.ModuleList(nn.Conv2d(a, b, 3, 2, 1) for a, b in zip(into, channels))
        # On the way up what the level was on the way down is seen beside what comes from below.
        above = (2 * channels[i] if i < len(channels) - 1 else channels[i] for i in range(len(channels)))
        self.up = nn.ModuleList(
            nn.ConvTranspose2d(a, b, 3, 2, 1, 1) for a, b in reversed(list(zip(above, into)))
        )
        self.noises = nn.ModuleList(Noise(n) for n in (*into, *(m.in_channels for m in self.up)))
        self.flat = nn.Conv2d(2 * channels[0], 1, 1)
        nn.init.zeros_(self.flat.weight)
        nn.init.zeros_(self.flat.bias)

    def forward(self, image: Tensor, noise: Tensor) -> Tensor:
        """image: (B, 1, T, H); noise: (B, 2 * levels, T, H)."""
        levels = len(self.down)
        x = self.lift(image)
        noise = noise.to(x.dtype)
        skips = []
        for i, layer in enumerate(self.down):
            skips.append(x)
            x = functional.leaky_relu(layer(self.noises[i](x, noise[:, [i]])), 0.2)
        for i, layer in enumerate(self.up):
            x = self.noises[levels + i](x, noise[:, [levels + i]])
            skip = skips.pop()
            # Twice the size, less the last row or column where halving had rounded up.
            x = functional.leaky_relu(layer(x)[..., : skip.shape[-2], : skip.shape[-1]], 0.2)
            x = torch.cat([x, skip], dim=1)
        return image + self.flat(x)


@dataclass
class Frame:
    """Where a motion lies: `origin` (B, 1, 1, 3) in metres and `yaw` (B, 1, 1), of its first known pose."""

    origin: Tensor
    yaw: Tensor

    @classmethod
    def of(cls, positions: Tensor, observed: Tensor) -> Frame:
        """Of the first frame whose hips and facing are observed; else of all that is, facing along Z.

        positions: (B, T, 22, 3), observed: the same, whether each coordinate is known.
        """
        whole = observed.all(dim=-1)
        pair = torch.stack([whole[..., left] & whole[..., right] for left, right in PAIRS], dim=-1).any(-1)
        placed = whole[..., 0] & pair
        first, any_placed = placed.int().argmax(dim=1, keepdim=True), placed.any(dim=1)
        rows = first[..., None].expand(-1, 1, 3)
        hips = torch.gather(positions[:, :, 0], 1, rows)[:, 0]
        known = torch.where(observed, positions, 0.0).sum(dim=(1, 2))
        mean = known / observed.sum(dim=(1, 2)).clamp(min=1)
        yaw = pick(facing(positions, whole), first)[:, 0]
        origin = torch.where(any_placed[:, None], hips, mean)
        return cls(origin[:, None, None], torch.where(any_placed, yaw, 0.0)[:, None, None])

    def align(self, positions: Tensor) -> Tensor:
        """The motion with the first pose's hips in the origin, facing along Z."""
        return turn(positions - self.origin, -self.yaw)

    def undo(self, positions: Tensor) -> Tensor:
        return turn(positions, self.yaw) + self.origin


# Frames over which what the network gets wrong of a pose is taken to fade where nothing comes after it: half
# a second at 30 frames a second, three at 5.
FADE = 15


def settle(answer: Tensor, positions: Tensor, observed: Tensor) -> Tensor:
    """The answer (B, T, 22, 3), brought into what is observed (B, T, 22) of the positions without a jump.

    What is wrong at the last and first known frame around a hole is taken to be wrong inside as well, in
    between linearly, of the hips and of the other joints relative to them. Where nothing comes after, the
    hips stay off by as much, so that the way goes on from where it was, and poses become the network's own.
    """
    clips, length, joints, _ = answer.shape

    def rows(motion: Tensor) -> Tensor:
        """(B * 22 * 3, T): the hips, and the others as they lie around them."""
        around = torch.cat([motion[:, :, :1], motion[:, :, 1:] - motion[:, :, :1]], dim=2)
        return around.flatten(2).transpose(1, 2).flatten(0, 1)

    known = (observed & observed[:, :, :1])[..., None].expand(-1, -1, -1, 3)
    known = known.flatten(2).transpose(1, 2).flatten(0, 1)
    wrong = torch.where(known, rows(positions) - rows(answer), 0.0)
    last, first = neighbours(known)
    frame = torch.arange(length, device=answer.device)
    since = torch.abs(frame - last)
    between = first > last
    share = since / torch.where(between, first - last, 1)
    hips = (torch.arange(clips * 3 * joints, device=answer.device) % (3 * joints) < 3)[:, None]
    kept = torch.where(hips, torch.ones_like(share), torch.clamp(1 - since / FADE, min=0) ** 2)
    added = torch.where(between, 1 - share, kept) * pick(wrong, last)
    added = added + torch.where(between, share, 0.0) * pick(wrong, first)
    moved = (rows(answer) + added).unflatten(0, (clips, 3 * joints)).transpose(1, 2)
    moved = moved.unflatten(2, (joints, 3))
    moved = torch.cat([moved[:, :, :1], moved[:, :, 1:] + moved[:, :, :1]], dim=2)
    return torch.where(observed[..., None], positions, moved)


@cache
def curve(rows: int, together: int) -> Constant:
    """(rows * together, rows) what poses in the middles of rows weigh in each frame: a natural spline."""
    middles = np.arange(rows) * together + (together - 1) / 2
    spline = interpolate.CubicSpline(middles, np.eye(rows), bc_type="natural")
    frames = np.arange(rows * together)
    inside = np.clip(frames, middles[0], middles[-1])
    # Before the first of them and after the last one it is straight.
    return Constant(spline(inside) + (frames - inside)[:, None] * spline(inside, 1))


@cache
def drawable(rows: int, together: int) -> Constant:
    """(frames, frames) what brings a motion to the nearest one, by squares, that a `curve` draws."""
    drawn = curve(rows, together).values
    return Constant(drawn @ np.linalg.pinv(drawn))


class Generator(nn.Module):
    """A frame encoder, U-blocks on what it writes, and a frame decoder, within the alignment (section 4.1).

    Positions are metres of a body scaled to the canonical leg, Y up. Unobserved coordinates may hold
    anything finite; they have no influence.
    """

    mean: Tensor
    std: Tensor

    def __init__(self, config: StmiGanConfig = PAPER) -> None:
        super().__init__()
        self.config = config
        self.encoder = FrameNetwork(2 * config.together * VALUES, config.width, config.gates)
        self.blocks = nn.ModuleList(UBlock(config.channels) for _ in range(config.blocks))
        self.decoder = FrameNetwork(config.width, config.width, config.gates, VALUES)
        # One for each axis, as in the public code.
        self.register_buffer("mean", torch.zeros(3))
        self.register_buffer("std", torch.ones(3))

    def begin(self, pose: Tensor) -> None:
        """Start with a network that writes frames and reads back what it wrote.

        It says of what is known what it knows, and of the rest `pose` (22, 3), normalised, in which bones are
        not without length. So it has only the rest to learn.
        """
        write, copy, read = self.encoder[0], self.decoder[0], self.decoder[-1]
        assert all(isinstance(layer, nn.Linear) for layer in (write, copy, read))
        together = self.config.together
        around = pose.flatten()
        with torch.no_grad():
            # (together, coordinates or whether they are known, ...) is how the input is laid out.
            values, known = write.weight.unflatten(1, (together, 2, VALUES)).unbind(2)
            into = nn.init.orthogonal_(torch.empty_like(read.weight.T))
            values.copy_(into[:, None] / together)
            known.copy_(-into[:, None] / together * around)
            read.weight.copy_(into.T)
            nn.init.eye_(copy.weight)
            for layer in (write, copy):
                nn.init.zeros_(layer.bias)
            read.bias.copy_(around)

    def grow(self, other: Generator) -> None:
        """Start with what a network of single frames says of the mean pose of each row, along a curve."""
        assert other.config.together == 1
        held, write, together = other.state_dict(), "encoder.0.weight", self.config.together
        held[write] = held[write].repeat(1, together) / together
        self.load_state_dict(held)

    @property
    def noises(self) -> int:
        """How many images of noise a motion takes."""
        return 2 * len(self.config.channels) * self.config.blocks

    def write(self, motion: Tensor, observed: Tensor) -> Tensor:
        """What the frame encoder writes of aligned motions: (B, rows, width)."""
        x = torch.where(observed, (motion - self.mean) / self.std, 0.0)
        given = torch.cat([x.flatten(2), observed.flatten(2).to(x.dtype)], dim=2)
        given = given.unflatten(1, (self.config.rows, self.config.together))
        # What is known of a row in some of its frames counts as much as if it were known in all of them.
        count = given[..., VALUES:].sum(dim=2, keepdim=True).clamp(min=1)
        given = given * torch.cat([self.config.together / count] * 2, dim=3)
        written: Tensor = self.encoder(given.flatten(2))
        return written

    def aligned(self, motion: Tensor, observed: Tensor, noise: Tensor) -> Tensor:
        """The same as `forward` on motions that are aligned already."""
        image = self.write(motion, observed)[:, None]
        for block, part in zip(self.blocks, noise.chunk(self.config.blocks, dim=1)):
            image = block(image, part)
        said = self.decoder(image[:, 0])
        if self.config.together > 1:
            said = curve(self.config.rows, self.config.together).beside(said) @ said
        return said.unflatten(2, (len(JOINTS), 3)) * self.std + self.mean

    def forward(self, positions: Tensor, observed: Tensor, noise: Tensor) -> tuple[Tensor, Tensor]:
        """Complete motions.

        Args:
            positions: (B, T, 22, 3).
            observed: (B, T, 22, 3) booleans. Where a joint's x is known without its z, or the other way
                round, the first pose should face along Z: the axes of the alignment are the world's then.
            noise: (B, noises, rows, width) standard normal; 0 for the most likely answer.

        Returns:
            (B, T, 22, 3) the network's own motion, also where it is observed; and the same settled into the
            joints of which everything is observed.
        """
        positions = torch.where(observed, positions, 0.0)
        frame = Frame.of(positions, observed)
        # A coordinate that is unknown must not come into another by the turn.
        positions = torch.where(observed, positions, frame.origin)
        raw = frame.undo(self.aligned(frame.align(positions), observed, noise))
        return raw, settle(raw, positions, observed.all(dim=-1))


def distances(motion: Tensor) -> Tensor:
    """(B, T, P) metres between the joints (B, T, 22, 3) of each of the pairs ENDS: a distance matrix."""
    a, b = FIRST.beside(motion), SECOND.beside(motion)
    # The root of nothing has no gradient.
    return ((motion[:, :, a] - motion[:, :, b]).square().sum(dim=-1) + 1e-8).sqrt()


class Residual(nn.Module):
    """A residual CNN that tells features of an image (B, C, T, H): (B, 3 * `features`).

    Blocks of two convolutions and a shortcut, each halving the image; what each says, averaged over time,
    is transformed and put beside the others' (section 6).
    """

    def __init__(
        self, colours: int, height: int, channels: tuple[int, ...] = (32, 64, 96), features: int = 64
    ) -> None:
        super().__init__()
        into = (colours, *channels[:-1])
        self.first = nn.ModuleList(nn.Conv2d(a, b, 3, 2, 1) for a, b in zip(into, channels))
        self.second = nn.ModuleList(nn.Conv2d(b, b, 3, 1, 1) for b in channels)
        self.short = nn.ModuleList(nn.Conv2d(a, b, 1, 2) for a, b in zip(into, channels))
        heights = [-(-height // 2 ** (i + 1)) for i in range(len(channels))]
        self.narrow = nn.ModuleList(nn.Conv2d(b, 8, 1) for b in channels)
        self.say = nn.ModuleList(nn.Linear(8 * h, features) for h in heights)

    def forward(self, image: Tensor) -> Tensor:
        x, said = image, []
        for first, second, short, narrow, say in zip(
            self.first, self.second, self.short, self.narrow, self.say
        ):
            inner = second(functional.leaky_relu(first(x), 0.2))
            x = functional.leaky_relu(inner + short(x), 0.2)
            told = functional.leaky_relu(narrow(x), 0.2).mean(dim=2)
            said.append(functional.leaky_relu(say(told.flatten(1)), 0.2))
        return torch.cat(said, dim=1)


class Discriminator(nn.Module):
    """How real motions look: one score (B,) from all branches.

    `base` looks at poses as an encoder of its own writes them, `edm` at the distances between joints,
    `motion` at the steps of both coordinates and distances from frame to frame (section 4.1).
    All look at one frame of each row.
    """

    mean: Tensor
    std: Tensor
    sizes: Tensor

    def __init__(self, config: StmiGanConfig = PAPER) -> None:
        super().__init__()
        self.config = config
        heights = {"base": config.width, "edm": len(ENDS), "motion": VALUES + len(ENDS)}
        self.encoder = FrameNetwork(VALUES, config.width, config.gates)
        self.branches = nn.ModuleDict({name: Residual(1, heights[name]) for name in config.branches})
        self.score = nn.Linear(3 * 64 * max(len(config.branches), 1), 1)
        self.register_buffer("mean", torch.zeros(3))
        self.register_buffer("std", torch.ones(3))
        # How large distances, steps of coordinates and steps of distances usually are.
        self.register_buffer("sizes", torch.ones(3))

    def seen(self, motion: Tensor) -> dict[str, Tensor]:
        """What each branch looks at of aligned motions (B, rows, 22, 3): (B, rows or rows - 1, H)."""
        apart = distances(motion)
        steps = torch.cat(
            [motion.diff(dim=1).flatten(2) / self.sizes[1], apart.diff(dim=1) / self.sizes[2]], dim=2
        )
        found = {
            "base": ((motion - self.mean) / self.std).flatten(2),
            "edm": apart / self.sizes[0],
            "motion": steps,
        }
        return {name: found[name] for name in self.config.branches}

    def image(self, frames: Tensor) -> Tensor:
        """What is seen of frames (B, rows or rows - 1, H) as an image (B, 1, rows, H)."""
        return functional.pad(frames, (0, 0, 0, self.config.rows - frames.shape[1]))[:, None]

    def forward(self, seen: dict[str, Tensor]) -> Tensor:
        said = [
            branch(self.image(self.encoder(seen[name]) if name == "base" else seen[name]))
            for name, branch in self.branches.items()
        ]
        return self.score(torch.cat(said, dim=1))[:, 0]
