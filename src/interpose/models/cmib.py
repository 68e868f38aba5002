"""Conditional motion in-betweening (CMIB), Kim et al. 2022: key poses and an action label to a whole motion.

`Encoder` is the paper's network; `Cmib` puts around it what belongs to the method: the frame of the first
key, interpolation between keys as its input, and constant bones at its output. It is what ONNX holds.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn.attention import SDPBackend, sdpa_kernel

from interpose.geometry import kinematics, rotations
from interpose.geometry.constant import Constant
from interpose.geometry.ground import FLOOR, turn
from interpose.models.keys import neighbours, pick
from interpose.skeletons import JOINTS, PARENTS
from interpose.skeletons.body import facing

POSITIONS = 3 * len(JOINTS)

ABOVE = Constant([max(parent, 0) for parent in PARENTS])
NO_TURN = Constant([1.0, 0.0, 0.0, 0.0])
PLACE = 0.3  # deviation of learned positions at first: of about the size of the numbers of a frame


@dataclass(frozen=True)
class CmibConfig:
    """Section 4.5 of the paper, but for `longest`: one table of positions for all lengths.

    Attributes:
        labels: action labels; the first is "", for motions without one.
        longest: frames, keys included.
        residual: what later work found to train faster, and False for the paper's own network. The network
            says what to add to the interpolated frames, beginning with nothing (Oreshkin et al. 2022);
            learned positions count frames from the key before and to the key after, not from the start, and
            how much two frames attend to each other has a learned part for how far apart they are (Qin et
            al. 2022, both); layers are normalised before, not after, and the network sees standardised
            numbers.
        representation: how a frame holds rotations: "quaternion", "axis-angle" or "euler", which the paper
            compares in table 1. A head has 22 numbers with each.
    """

    labels: tuple[str, ...] = ("",)
    heads: int = 7
    layers: int = 8
    inner: int = 2048
    dropout: float = 0.05
    longest: int = 160
    residual: bool = True
    representation: str = "quaternion"

    @property
    def width(self) -> int:
        """Numbers of a frame: positions and rotations of the 22 joints, 154 with quaternions."""
        return POSITIONS + len(JOINTS) * (4 if self.representation == "quaternion" else 3)


def encode(turned: Tensor, representation: str) -> Tensor:
    """Quaternions (..., 4) as a frame holds them, (..., 4) or radians (..., 3)."""
    if representation == "axis-angle":
        return rotations.log(turned)
    return rotations.to_euler(turned, "ZXY") if representation == "euler" else turned


def decode(held: Tensor, representation: str) -> Tensor:
    """The unit quaternions (..., 4) of what frames hold."""
    if representation == "axis-angle":
        return rotations.exp(held)
    return rotations.from_euler(held, "ZXY") if representation == "euler" else rotations.normalize(held)


class Encoder(nn.Module):
    """A transformer encoder over frames, the label's token in front (section 4.2, equations 4 to 10, 14)."""

    def __init__(self, config: CmibConfig) -> None:
        super().__init__()
        width = config.width
        self.label = nn.Embedding(len(config.labels), width)
        self.residual = config.residual
        self.place = nn.ParameterList(
            PLACE * torch.randn(config.longest, width) for _ in range(2 if self.residual else 1)
        )
        layer = nn.TransformerEncoderLayer(
            width,
            config.heads,
            config.inner,
            config.dropout,
            activation="gelu",
            batch_first=True,
            norm_first=self.residual,
        )
        norm = nn.LayerNorm(width) if self.residual else None
        self.layers = nn.TransformerEncoder(layer, config.layers, norm, enable_nested_tensor=False)
        self.last = nn.Linear(width, width)
        if self.residual:
            self.register_buffer("mean", torch.zeros(width))
            self.register_buffer("std", torch.ones(width))
            self.first = nn.Linear(width, width)
            self.apart = nn.Parameter(torch.zeros(config.heads, 2 * config.longest - 1))
            nn.init.zeros_(self.last.weight)
            nn.init.zeros_(self.last.bias)

    def forward(self, frames: Tensor, keys: Tensor, label: Tensor) -> tuple[Tensor, Tensor]:
        """Frames (B, T, n), keys (B, T) and labels (B,) to the token (B, n) and frames (B, T, n)."""
        token = self.label(label)[:, None]
        seen = self.first((frames - self.mean) / self.std) if self.residual else frames
        deep = torch.cat([token, seen + self._places(keys)], dim=1)
        # PyTorch's fused attention takes several times as long backwards on a CPU.
        with sdpa_kernel(SDPBackend.MATH):
            deep = self.layers(deep, mask=self._bias(keys), is_causal=False)
        said = self.last(deep[:, 1:])
        return deep[:, 0], frames + self.std * said if self.residual else said

    @torch.no_grad()
    def standardise(self, frames: Tensor) -> None:
        """Take mean and deviation of what the network sees from frames (m, n)."""
        self.mean.copy_(frames.mean(dim=0))
        # What hardly moves (a twist that no joint has) must not become all there is to see.
        self.std.copy_(frames.std(dim=0).clamp(min=0.02))

    def _places(self, keys: Tensor) -> Tensor:
        """Learned positions, (B, T, n) or (T, n)."""
        if not self.residual:
            return self.place[0][: keys.shape[1]]
        last, first = neighbours(keys)
        frame = torch.arange(keys.shape[1], device=keys.device)
        return self.place[0][(frame - last).clamp(min=0)] + self.place[1][(first - frame).clamp(min=0)]

    def _bias(self, keys: Tensor) -> Tensor | None:
        """What is added to the attention between frames, (B * heads, 1 + T, 1 + T); nothing for the token."""
        if not self.residual:
            return None
        batch, count = keys.shape
        frame = torch.arange(count, device=keys.device)
        bias = self.apart[:, frame[:, None] - frame + self.apart.shape[1] // 2]
        return nn.functional.pad(bias, (1, 0, 1, 0)).repeat(batch, 1, 1)


def between_keys(values: Tensor, keys: Tensor) -> Tensor:
    """Values (B, T, J, n) of key frames (B, T), in between by LERP (n = 3) or SLERP (n = 4): equations 2, 3.

    Before the first key and after the last one stands that key.
    """
    last, first = neighbours(keys)
    flat = values.flatten(2)
    a, b = (pick(flat, index).unflatten(2, values.shape[2:]) for index in (last, first))
    frame = torch.arange(values.shape[1], device=values.device)
    length = (first - last).clamp(min=1)
    share = ((frame - last).clamp(min=0) / length).clamp(max=1.0)[..., None]
    if values.shape[-1] == 4:
        return rotations.slerp(a, b, share)
    return a + share[..., None] * (b - a)


def settle(said: Tensor, frames: Tensor, keys: Tensor) -> Tensor:
    """What is said of frames (B, T, n), moved so that keys (B, T) are met: what is wrong at them is taken to
    be wrong, linearly, in between."""
    return said + between_keys((frames - said)[:, :, None], keys)[:, :, 0]


def restore_bones(positions: Tensor, bones: Tensor) -> Tensor:
    """Positions (B, T, 22, 3) with bones brought to their lengths (B, 22), hips first (section 4.2)."""
    # All bones at once, and positions as sums of them: in graphs joint after joint is slow.
    way = positions - positions.index_select(-2, ABOVE.beside(positions))
    way = way * (bones[:, None, :, None] / way.norm(dim=-1, keepdim=True).clamp(min=1e-6))
    way = torch.cat([positions[..., :1, :], way[..., 1:, :]], dim=-2)
    return kinematics.ancestors(PARENTS).beside(way) @ way


class Cmib(nn.Module):
    """Key poses in, a complete motion out.

    Positions are metres of a body scaled to the canonical leg, rotations are canonical (global, relative to
    the T-pose). Frames that are no keys may hold anything finite; they have no influence.
    """

    def __init__(self, config: CmibConfig | None = None) -> None:
        super().__init__()
        self.config = config or CmibConfig()
        self.encoder = Encoder(self.config)

    def prepare(self, positions: Tensor, rotation: Tensor, keys: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Interpolated frames (B, T, n) seen from the keys, and the frame: its origin (B, 3) and yaw (B,).

        The first key faces X, as in LAFAN1's protocol; the origin is halfway between first and last key.
        """
        positions = torch.where(keys[..., None, None], positions, 0.0)
        rotation = torch.where(keys[..., None, None], rotation, NO_TURN.beside(rotation))
        frame = torch.arange(keys.shape[1], device=keys.device).expand_as(keys)
        start = torch.where(keys, frame, keys.shape[1]).amin(dim=1, keepdim=True)
        target = torch.where(keys, frame, -1).amax(dim=1, keepdim=True)
        start, target = start.clamp(max=keys.shape[1] - 1), target.clamp(min=0)
        hips = positions[:, :, 0]
        origin = 0.5 * (pick(hips, start) + pick(hips, target))[:, 0] * FLOOR.beside(positions)
        first = pick(positions.flatten(2), start).unflatten(2, (len(JOINTS), 3))[:, 0]
        yaw = facing(first) - torch.pi / 2
        positions = turn(positions - origin[:, None, None], -yaw[:, None, None])
        rotation = rotations.multiply(rotations.about("Y", -yaw)[:, None, None], rotation)
        # Of the two quaternions of the first key the one with a positive real part; the others follow it.
        begin = pick(rotation.flatten(2), start).unflatten(2, (len(JOINTS), 4))
        begin = torch.where(begin[..., :1] < 0, -begin, begin)
        rotation = rotations.alike(rotation, begin)
        held = encode(between_keys(rotation, keys), self.config.representation)
        return torch.cat([between_keys(positions, keys).flatten(2), held.flatten(2)], dim=2), origin, yaw

    def split(self, frames: Tensor) -> tuple[Tensor, Tensor]:
        """Frames (B, T, n) to positions (B, T, 22, 3) and what they hold of rotations (B, T, 22, 3 or 4)."""
        joints = (len(JOINTS), -1)
        return frames[..., :POSITIONS].unflatten(2, joints), frames[..., POSITIONS:].unflatten(2, joints)

    def forward(
        self, positions: Tensor, rotation: Tensor, keys: Tensor, label: Tensor, bones: Tensor
    ) -> tuple[Tensor, Tensor, Tensor]:
        """Complete a motion.

        Args:
            positions: (B, T, 22, 3).
            rotation: (B, T, 22, 4).
            keys: (B, T) booleans, the frames whose poses are known: at least the first and the last.
            label: (B,) index into the configuration's labels.
            bones: (B, 22) lengths of bones in metres.

        Returns:
            Positions (B, T, 22, 3) with bones restored, rotations (B, T, 22, 4), and by how much the network
            itself was wrong about the hips (B, T), in metres at keys, before its motion was moved onto them.
        """
        frames, origin, yaw = self.prepare(positions, rotation, keys)
        said = self.encoder(frames, keys, label)[1]
        missed = torch.where(keys, (said - frames)[..., :3].norm(dim=-1), 0.0)
        placed, held = self.split(settle(said, frames, keys))
        placed, turned = restore_bones(placed, bones), decode(held, self.config.representation)
        placed = turn(placed, yaw[:, None, None]) + origin[:, None, None]
        turned = rotations.multiply(rotations.about("Y", yaw)[:, None, None], turned)
        return placed, turned, missed
