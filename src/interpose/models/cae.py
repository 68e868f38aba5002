"""The convolutional autoencoder of Kaufmann et al. 2020, from joint positions to joint positions.

`Autoencoder` is the paper's network. `Infiller` puts around it all that belongs to the method: the 69-row
image of a motion, the normaliser, and the way back to a global trajectory; it is what ONNX holds. The
networks that the paper compares with, `vanilla` and `holden`, take the place of the network, nothing else.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn import functional

from interpose.geometry.ground import turn, wrap
from interpose.geometry.time import ease
from interpose.models.keys import neighbours, pick
from interpose.skeletons import JOINTS
from interpose.skeletons.body import PAIRS, facing

ROWS = 3 * len(JOINTS) + 3  # positions of 22 joints, two velocities on the floor, one turning rate


class Autoencoder(nn.Module):
    """Five encoding and five decoding units of two 3x3 (de)convolutions each: 4,703,425 parameters.

    (B, 1, 69, T) to the same shape, for any T: pooling rounds up and every deconvolution is told the size
    that it has to give back. Source: Kaufmann et al. 2020, section 3.2 and figure 4.
    """

    def __init__(self, channels: tuple[int, ...] = (32, 64, 128, 256, 256)) -> None:
        super().__init__()
        into = (1, *channels[:-1])
        self.encoder = nn.ModuleList(
            nn.ModuleList([nn.Conv2d(a, b, 3, padding=1), nn.Conv2d(b, b, 3, padding=1)])
            for a, b in zip(into, channels)
        )
        self.decoder = nn.ModuleList(
            nn.ModuleList([nn.ConvTranspose2d(b, b, 3, 2, 1, 1), nn.ConvTranspose2d(b, a, 3, 1, 1)])
            for a, b in zip(reversed((1, *channels[:-1])), reversed(channels))
        )
        # Xavier as in the paper; the gain of its leaky ReLU keeps a deep stack from fading out at the start.
        gain = nn.init.calculate_gain("leaky_relu", 0.01)
        for module in self.modules():
            if isinstance(module, nn.Conv2d | nn.ConvTranspose2d):
                nn.init.xavier_uniform_(module.weight, gain)
                assert module.bias is not None
                nn.init.zeros_(module.bias)

    def forward(self, image: Tensor) -> Tensor:
        sizes = []
        x = image
        for first, second in self.encoder:
            x = functional.leaky_relu(second(functional.leaky_relu(first(x))))
            sizes.append(x.shape[-2:])
            x = functional.max_pool2d(x, 2, ceil_mode=True)
        for i, (first, second) in enumerate(self.decoder):
            height, width = sizes[-1 - i]
            # Twice the size, less the last row or column where pooling had rounded up.
            x = second(functional.leaky_relu(first(x)[..., :height, :width]))
            if i < len(self.decoder) - 1:
                x = functional.leaky_relu(x)
        return x


@dataclass
class Image:
    """A motion as an image (section 3.1), with what is needed to read it.

    Attributes:
        rows: (B, 69, T) body-frame positions in metres (66), floor velocity in metres a frame (2) and
            turning rate in radians a frame, both relative to the previous frame; not normalised.
        known: (B, 69, T) whether a row follows from observed positions alone.
        floor: (B,) height of the lowest observed joint.
        root: (B, T, 3) hips on the floor, and yaw (B, T): the trajectory.
        placed: (B, T) whether that trajectory is observed.
    """

    rows: Tensor
    known: Tensor
    floor: Tensor
    root: Tensor
    yaw: Tensor
    placed: Tensor


def to_image(positions: Tensor, observed: Tensor) -> Image:
    """Positions (B, T, 22, 3) and which of them are observed (B, T, 22) to the image of the motion."""
    height = torch.where(observed, positions[..., 1], torch.full_like(positions[..., 1], 1e4))
    lowest = height.amin(dim=(1, 2))
    floor = torch.where(lowest < 1e4, lowest, torch.zeros_like(lowest))
    root = positions[..., 0, :] * positions.new_tensor([1.0, 0.0, 1.0]) + floor[:, None, None] * (
        positions.new_tensor([0.0, 1.0, 0.0])
    )
    yaw = facing(positions, observed)
    pair = torch.stack([observed[..., left] & observed[..., right] for left, right in PAIRS], dim=-1).any(-1)
    placed = observed[..., 0] & pair
    body = turn(positions - root[..., None, :], -yaw[..., None])
    velocity = turn(root[:, 1:] - root[:, :-1], -yaw[:, :-1])
    rate = wrap(yaw[:, 1:] - yaw[:, :-1])
    moves = torch.stack([velocity[..., 0], velocity[..., 2], rate], dim=-1)
    # Nothing comes before the first frame: it repeats the second one's movement, unobserved.
    moves = torch.cat([moves[:, :1], moves], dim=1)
    moved = torch.cat([torch.zeros_like(placed[:, :1]), placed[:, 1:] & placed[:, :-1]], dim=1)
    rows = torch.cat([body.flatten(2), moves], dim=2)
    known = torch.cat(
        [(observed & placed[..., None]).repeat_interleave(3, dim=2), moved[..., None].expand(-1, -1, 3)],
        dim=2,
    )
    return Image(rows.transpose(1, 2), known.transpose(1, 2), floor, root, yaw, placed)


# Frames over which a wrong turning rate, and a wrong speed of a joint, at a gap's edge are taken to fade.
TURN_FADE, SPEED_FADE = 15, 10


def settle(rows: Tensor, image: Image) -> Tensor:
    """Rows (B, 69, T) that agree with what is observed of them, and run into it without a jump.

    What the network gets wrong of a row at its last and first known frame around a gap it is taken to get
    wrong inside as well, in between linearly; so the residual vanishes at observed values. How fast the
    residual of a position changes at the edge fades within some frames, and so does that of the turning
    rate, which sways with every step. Found on validation performers: with gaps of 30 frames joints are off
    by 5.1 instead of 6.6 cm, and the root by 2.2 instead of 3.4 cm.
    """
    clips, count, length = rows.shape
    known = image.known.flatten(0, 1)
    wrong = torch.where(known, (image.rows - rows).flatten(0, 1), 0.0)
    last, first = neighbours(known)
    frame = torch.arange(length, device=rows.device)
    since, until = torch.abs(frame - last), torch.abs(first - frame)
    between = first > last
    share = since / torch.where(between, first - last, 1)
    start, end = (torch.clamp(1 - n / TURN_FADE, min=0) ** 2 for n in (since, until))
    turning = (torch.arange(clips * count, device=rows.device) % count == count - 1)[:, None]
    # At an open end there is one neighbour only: what is wrong there fades.
    one = torch.where(between & ~turning, 1 - share, start)
    other = torch.where(between, torch.where(turning, end, share), 0.0)
    added = one * pick(wrong, last) + other * pick(wrong, first)

    earlier, later = torch.clamp(last - 1, min=0), torch.clamp(first + 1, max=length - 1)
    before = torch.where(pick(known, earlier) & (last > 0), pick(wrong, last) - pick(wrong, earlier), 0.0)
    after = torch.where(
        pick(known, later) & (first < length - 1), pick(wrong, later) - pick(wrong, first), 0.0
    )
    leave, come = (n * torch.clamp(1 - n / SPEED_FADE, min=0) ** 2 for n in (since, until))
    position = torch.arange(clips * count, device=rows.device)[:, None] % count < 3 * len(JOINTS)
    added = added + torch.where(position & (frame > last), leave * before, 0.0)
    added = added - torch.where(position & (frame < first), come * after, 0.0)
    settled = torch.where(known, image.rows.flatten(0, 1), rows.flatten(0, 1) + added)
    return settled.unflatten(0, (clips, count))


def integrate(moves: Tensor, image: Image, correct: bool) -> tuple[Tensor, Tensor]:
    """The trajectory root (B, T, 3) and yaw (B, T) of movements (B, T, 3), anchored at observed frames.

    Inside a gap velocity and turning rate are summed up from the last observed frame. That drifts; with
    `correct` the residual in x, z and yaw at the other end is spread back over the gap by a ramp with zero
    slope at both ends.
    """
    before, after = neighbours(image.placed)
    frame = torch.arange(moves.shape[1], device=moves.device)
    inside = (frame > before) & (frame < after) & correct
    share = (frame - before) / torch.where(after > before, after - before, 1)
    ramp = torch.where(inside, ease(share), 0.0)

    def anchored(sums: Tensor, known: Tensor) -> tuple[Tensor, Tensor]:
        """Sums from the known value before, and by how much they miss the known value after."""
        start = pick(known, before) - pick(sums, before)
        return start + sums, pick(known, after) - start - pick(sums, after)

    yaw, missed = anchored(torch.cumsum(moves[..., 2], dim=1), image.yaw)
    yaw = torch.where(image.placed, image.yaw, yaw + ramp * wrap(missed))
    step = torch.stack([moves[..., 0], torch.zeros_like(yaw), moves[..., 1]], dim=-1)
    # A step is taken in the direction faced before it.
    earlier = torch.cat([yaw[:, :1], yaw[:, :-1]], dim=1)
    root, missed = anchored(torch.cumsum(turn(step, earlier), dim=1), image.root)
    return torch.where(image.placed[..., None], image.root, root + ramp[..., None] * missed), yaw


class Infiller(nn.Module):
    """The whole method as one graph: observed positions in, a complete motion out.

    Positions are metres of a body scaled to the canonical leg, Y up, at 30 fps. Unobserved positions may
    hold anything finite; they have no influence.
    """

    mean: Tensor
    std: Tensor

    def __init__(self, network: nn.Module | None = None, rows: int = ROWS) -> None:
        super().__init__()
        self.network = network if network is not None else Autoencoder()
        self.register_buffer("mean", torch.zeros(rows, 1))
        self.register_buffer("std", torch.ones(rows, 1))

    def shown(self, image: Image) -> tuple[Tensor, Tensor]:
        """The rows (B, R, T) that the network learns, and which of their values are known.

        The image's 69 rows come first; a network may be shown more.
        """
        return image.rows, image.known

    def normalised(self, image: Image) -> tuple[Tensor, Tensor]:
        """The same, rows with a mean of 0 and a deviation of 1 over the training data."""
        rows, known = self.shown(image)
        return (rows - self.mean) / self.std, known

    def predict(self, image: Image) -> Tensor:
        """Normalised rows (B, R, T), the network's answer to what is known; masked values are 0."""
        rows, known = self.normalised(image)
        return self.network(torch.where(known, rows, 0.0)[:, None])[:, 0]

    def answer(self, image: Image) -> Tensor:
        """The same in metres and radians, and no more than the image's rows (B, 69, T)."""
        return (self.predict(image) * self.std + self.mean)[:, :ROWS]

    def forward(self, positions: Tensor, observed: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Complete a motion.

        Args:
            positions: (B, T, 22, 3).
            observed: (B, T, 22) booleans.

        Returns:
            Positions (B, T, 22, 3) three times. The network's own poses, also where they are observed, in
            the body's frame: hips over the origin, facing along Z, heights as they are. The same on the
            network's own trajectory, which drifts. And settled into what is observed, with the drift taken
            out.
        """
        positions = torch.where(observed[..., None], positions, 0.0)
        image = to_image(positions, observed)
        rows = self.answer(image)
        up = positions.new_tensor([0.0, 1.0, 0.0])
        body = self._body(rows) + image.floor[:, None, None, None] * up
        return body, self._place(rows, image, False), self._place(settle(rows, image), image, True)

    @staticmethod
    def _body(rows: Tensor) -> Tensor:
        return rows[:, : 3 * len(JOINTS)].transpose(1, 2).unflatten(2, (len(JOINTS), 3))

    def _place(self, rows: Tensor, image: Image, correct: bool) -> Tensor:
        """Global positions (B, T, 22, 3) of rows, on the trajectory that they describe."""
        root, yaw = integrate(rows[:, 3 * len(JOINTS) :].transpose(1, 2), image, correct)
        return turn(self._body(rows), yaw[..., None]) + root[..., None, :]
