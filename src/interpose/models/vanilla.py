"""The plain autoencoder that Kaufmann et al. 2020 compare theirs with: "Vanilla AE" of table 1.

It is a network for `interpose.models.cae.Infiller`: the same image of a motion goes in and comes out.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

from interpose.skeletons import JOINTS

POSITIONS = 3 * len(JOINTS)
# Steps over rows and frames. Rows, 25 of them, are halved while there are ten or more: 25, 13, 7.
STRIDES = ((2, 2), (2, 2), (1, 2), (1, 2), (1, 2))


class Vanilla(nn.Module):
    """Five strided 3x3 convolutions to 32 .. 512 channels and five deconvolutions back: 3,136,643 parameters.

    (B, 1, 69, T) to the same shape, for any T. Inside x, y and z of a joint are three channels of one row,
    and each of the three movements of the root is a row of its own, with nothing in its other two channels:
    (B, 3, 25, T). So the first convolution has 3 channels in and the last 3 out, all have biases and none
    share weights: 1,568,576 parameters there and 1,568,067 back. tanh everywhere but at the end.

    Source: Kaufmann et al. 2020, section 4.1; channels, tanh and strides as in the authors' public code.
    """

    def __init__(self, channels: tuple[int, ...] = (32, 64, 128, 256, 512)) -> None:
        super().__init__()
        layers = list(zip((3, *channels), channels, STRIDES))
        self.encoder = nn.ModuleList(nn.Conv2d(a, b, 3, stride, 1) for a, b, stride in layers)
        self.decoder = nn.ModuleList(
            nn.ConvTranspose2d(b, a, 3, (rows, frames), 1, (rows - 1, frames - 1))
            for a, b, (rows, frames) in reversed(layers)
        )
        for module in (*self.encoder, *self.decoder):
            nn.init.xavier_uniform_(module.weight)
            nn.init.zeros_(module.bias)

    def forward(self, image: Tensor) -> Tensor:
        rows = image[:, 0]
        joints = rows[:, :POSITIONS].unflatten(1, (len(JOINTS), 3)).transpose(1, 2)
        moves = functional.pad(rows[:, None, POSITIONS:], (0, 0, 0, 0, 0, 2))
        x = torch.cat([joints, moves], dim=2)
        sizes = []
        for layer in self.encoder:
            sizes.append(x.shape[-2:])
            x = torch.tanh(layer(x))
        for i, layer in enumerate(self.decoder):
            height, width = sizes[-1 - i]
            # Twice the size, less the last row or column where halving had rounded up.
            x = layer(x)[..., :height, :width]
            if i < len(self.decoder) - 1:
                x = torch.tanh(x)
        joints, moves = x[:, :, : len(JOINTS)], x[:, 0, len(JOINTS) :]
        return torch.cat([joints.transpose(1, 2).flatten(1, 2), moves], dim=1)[:, None]
