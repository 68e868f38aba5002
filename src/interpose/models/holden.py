"""The motion manifold of Holden et al. 2016, which Kaufmann et al. 2020 compare theirs with in table 1.

`Holden` is the network; `HoldenInfiller` shows it four rows more, which say whether feet are on the floor.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

from interpose.geometry.ground import turn
from interpose.models.cae import ROWS, Image, Infiller
from interpose.skeletons import JOINTS

# The joints that touch the floor, and how high in metres each may be when it does.
FEET = {"LeftFoot": 0.1875, "LeftToe": 0.125, "RightFoot": 0.1875, "RightToe": 0.125}
# Metres by which such a joint moves at most, from one frame to the next at 30 fps. These limits are those of
# Holden's public preparation of the data (3, 2 and the root of .05 at 60 fps), with its unit at 6.25 cm.
STILL = 2 * 0.05**0.5 * 0.0625


class Holden(nn.Module):
    """One convolution over time, 25 frames wide, to 256 channels, and one back: 934,729 parameters.

    (B, 1, 73, T) to the same shape, for any T. Both have biases and they share no weights:
    73 x 256 x 25 + 256 parameters there and 256 x 73 x 25 + 73 back. ReLU and a maximum over pairs of frames
    lie between; undoing it, training puts the value on either frame at random, and use half of it on both.
    A quarter of what goes into either convolution is dropped in training.

    Source: Holden et al. 2016, section 4; dropout, the way back and the start (normal, .01) as in the public
    code of Kaufmann et al. 2020.
    """

    def __init__(self, rows: int = ROWS + len(FEET), channels: int = 256, dropout: float = 0.25) -> None:
        super().__init__()
        self.encoder = nn.Conv1d(rows, channels, 25, padding=12)
        self.decoder = nn.Conv1d(channels, rows, 25, padding=12)
        self.dropout = nn.Dropout(dropout)
        for module in (self.encoder, self.decoder):
            assert module.bias is not None
            nn.init.trunc_normal_(module.weight, std=0.01, a=-0.02, b=0.02)
            nn.init.zeros_(module.bias)

    def forward(self, image: Tensor) -> Tensor:
        x = functional.relu(self.encoder(self.dropout(image[:, 0])))
        # In two dimensions: exporting the one-dimensional kind would fix the number of frames.
        x = functional.max_pool2d(x[:, :, None], (1, 2), ceil_mode=True)[:, :, 0]
        x = self.unpool(x)[..., : image.shape[-1]]
        return self.decoder(self.dropout(x))[:, None]

    def unpool(self, x: Tensor) -> Tensor:
        """(B, C, T) to (B, C, 2 T): each value on one of two frames, or its expectation on both."""
        first = torch.where(torch.rand_like(x) < 0.5, x, 0.0) if self.training else x / 2
        return torch.stack([first, x - first], dim=-1).flatten(-2)


def contacts(image: Image) -> tuple[Tensor, Tensor]:
    """Whether each of FEET touches the floor (B, 4, T), as 0 or 1, and whether that is known.

    It does when it is low and has hardly moved since the frame before; nothing is known of the first frame.
    """
    joints = [JOINTS.index(name) for name in FEET]
    body = image.rows[:, : 3 * len(JOINTS)].transpose(1, 2).unflatten(2, (len(JOINTS), 3))[:, :, joints]
    placed = turn(body, image.yaw[..., None]) + image.root[:, :, None]
    step = (placed[:, 1:] - placed[:, :-1]).norm(dim=-1)
    step = torch.cat([step[:, :1], step], dim=1)
    down = (step < STILL) & (body[..., 1] < body.new_tensor(list(FEET.values())))
    seen = image.known.transpose(1, 2)[..., [3 * joint for joint in joints]]
    seen = torch.cat([torch.zeros_like(seen[:, :1]), seen[:, 1:] & seen[:, :-1]], dim=1)
    return down.to(body.dtype).transpose(1, 2), seen.transpose(1, 2)


class HoldenInfiller(Infiller):
    """The method around `Holden`: rows 69 to 72 say whether feet touch the floor."""

    def __init__(self) -> None:
        super().__init__(Holden(), ROWS + len(FEET))

    def shown(self, image: Image) -> tuple[Tensor, Tensor]:
        down, seen = contacts(image)
        return torch.cat([image.rows, down], dim=1), torch.cat([image.known, seen], dim=1)
