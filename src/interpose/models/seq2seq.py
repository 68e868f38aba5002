"""Residual sequence-to-sequence forecasting (Martinez et al. 2017): poses and an action label in, poses out.

The table of Hernandez Ruiz et al. 2019 compares with it ("Res.sup."). It knows poses alone: where the body
is and where it faces has no part in what it sees, and stays as in the last pose seen.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn import functional

from interpose.geometry import kinematics, rotations
from interpose.skeletons import JOINTS, PARENTS

# Of a pose: rotation vectors of all joints; without its heading that of the hips has no vertical part.
VALUES = 3 * len(JOINTS) - 1


@dataclass(frozen=True)
class Seq2SeqConfig:
    """What the network is.

    Attributes:
        labels: action labels; the first is "", for motions without one.
        units: of the recurrent layer.
    """

    labels: tuple[str, ...] = ("",)
    units: int = 1024


def _heading(rotation: Tensor) -> Tensor:
    """The turn about the vertical (..., 1, 4) of the hips of canonical rotations (..., 22, 4)."""
    return rotations.twist_about(rotation[..., :1, :], rotation.new_tensor([0.0, 1.0, 0.0]))


def to_values(rotation: Tensor) -> Tensor:
    """Canonical rotations (..., 22, 4) as the network sees a pose: local rotation vectors (..., 65).

    That of the hips is without their heading.
    """
    upright = rotations.relative(_heading(rotation), rotation)
    values = rotations.log(kinematics.local_rotations(upright, PARENTS)).flatten(-2)
    return torch.cat([values[..., :1], values[..., 2:]], dim=-1)


def from_values(values: Tensor, last: Tensor) -> Tensor:
    """The inverse (..., 22, 4), facing as in the rotations `last`, of a shape that broadcasts."""
    values = torch.cat([values[..., :1], torch.zeros_like(values[..., :1]), values[..., 1:]], dim=-1)
    local = rotations.exp(values.unflatten(-1, (len(JOINTS), 3)))
    return rotations.multiply(_heading(last), kinematics.global_rotations(local, PARENTS))


class Seq2Seq(nn.Module):
    """A GRU that reads a motion and goes on with it: one layer for both, as in the paper's tied architecture.

    What it says in each frame is how the pose moves on to the next one (its residual connection).
    """

    mean: Tensor
    std: Tensor

    def __init__(self, config: Seq2SeqConfig | None = None) -> None:
        super().__init__()
        self.config = config or Seq2SeqConfig()
        self.cell = nn.GRUCell(VALUES + len(self.config.labels) - 1, self.config.units)
        self.step = nn.Linear(self.config.units, VALUES)
        # At first the pose stays, which is hard to beat over long times.
        nn.init.zeros_(self.step.weight)
        nn.init.zeros_(self.step.bias)
        self.register_buffer("mean", torch.zeros(VALUES))
        self.register_buffer("std", torch.ones(VALUES))

    @torch.no_grad()
    def standardise(self, values: Tensor) -> None:
        """Take mean and deviation of the values of a pose from some (n, 65)."""
        self.mean.copy_(values.mean(dim=0))
        # What never moves must not become all there is to see.
        self.std.copy_(values.std(dim=0).clamp(min=0.02))

    def normalised(self, rotation: Tensor) -> Tensor:
        """Canonical rotations (..., 22, 4) as standardised values (..., 65)."""
        return (to_values(rotation) - self.mean) / self.std

    def advance(self, pose: Tensor, action: Tensor, state: Tensor) -> tuple[Tensor, Tensor]:
        """Standardised values (B, 65), actions (B, n) and state (B, units) of a frame: those of the next."""
        state = self.cell(torch.cat([pose, action], dim=1), state)
        return pose + self.step(state), state

    def action(self, label: Tensor) -> Tensor:
        """Labels (B,) as the network sees them (B, labels - 1): "" is no action at all."""
        return functional.one_hot(label, len(self.config.labels))[:, 1:].to(self.mean.dtype)

    def go_on(self, seen: Tensor, label: Tensor, frames: int) -> Tensor:
        """Standardised values (B, T, 65) and labels (B,) to the next ones (B, `frames`, 65).

        Each is made from the network's own one before: in training, too, so that it learns to go on from
        what it makes (the paper's sampling-based loss).
        """
        action, state = self.action(label), seen.new_zeros(len(seen), self.config.units)
        for pose in seen[:, :-1].unbind(dim=1):
            _, state = self.advance(pose, action, state)
        pose, made = seen[:, -1], []
        for _ in range(frames):
            pose, state = self.advance(pose, action, state)
            made.append(pose)
        return torch.stack(made, dim=1)

    def forward(self, rotation: Tensor, label: Tensor, state: Tensor) -> tuple[Tensor, Tensor]:
        """One frame onwards: what ONNX holds, as the same step reads a motion and goes on with it.

        Args:
            rotation: (B, 22, 4) canonical rotations of a frame.
            label: (B,) index into the configuration's labels.
            state: (B, units) what is remembered; zeros at first.

        Returns:
            (B, 22, 4) canonical rotations of the next frame, with the same heading; and the next state.
        """
        pose, state = self.advance(self.normalised(rotation), self.action(label), state)
        return from_values(pose * self.std + self.mean, rotation), state
