"""Optimisers that work together on the parameters of one network."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor, nn

from interpose.training.device import short

# How much of the momentum is kept in a step; the coefficients of the quintic iteration (Jordan et al. 2024),
# and how often it is done; the mean size of steps, as that of AdamW's.
MOMENTUM, QUINTIC, ROUNDS, SIZE = 0.95, (3.4445, -4.7750, 2.0315), 5, 0.2


class Muon:
    """Muon (Jordan et al. 2024) for the matrices within a network, AdamW for all else; steps of one size.

    Muon moves a matrix in all directions alike, by the orthogonal matrix nearest to its momentum. It is
    meant for what lies between the first layer and the last: those, vectors and tables are AdamW's. Its
    steps are scaled to the mean size of AdamW's (Liu et al. 2025), so that one learning rate does for both.

    Args:
        named: the parameters of a network by name.
        inner: what the names of parameters begin with that are within it.
        learning_rate: of both.
        decay: the weight decay of both.
    """

    def __init__(
        self, named: list[tuple[str, nn.Parameter]], inner: str, learning_rate: float, decay: float
    ) -> None:
        within = [p for name, p in named if name.startswith(inner) and p.ndim == 2]
        held = {id(p) for p in within}
        rest = [p for _, p in named if id(p) not in held]
        self.parts: list[torch.optim.Optimizer] = [
            _Orthogonal(within, {"lr": learning_rate, "weight_decay": decay}),
            torch.optim.AdamW(rest, learning_rate, (0.9, 0.99), weight_decay=decay, fused=True),
        ]

    @property
    def param_groups(self) -> list[dict[str, Any]]:
        return [group for part in self.parts for group in part.param_groups]

    def zero_grad(self, set_to_none: bool = True) -> None:
        for part in self.parts:
            part.zero_grad(set_to_none)

    def step(self) -> None:
        for part in self.parts:
            part.step()

    def state_dict(self) -> dict[str, Any]:
        return {"parts": [part.state_dict() for part in self.parts]}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        for part, held in zip(self.parts, state["parts"], strict=True):
            part.load_state_dict(held)


class _Orthogonal(torch.optim.Optimizer):
    """The part of Muon that moves matrices. That of torch does it in bfloat16 whatever the device is."""

    @torch.no_grad()
    def step(self, closure: None = None) -> None:
        for group in self.param_groups:
            for matrix in group["params"]:
                if matrix.grad is None:
                    continue
                if "momentum" not in self.state[matrix]:
                    self.state[matrix]["momentum"] = torch.zeros_like(matrix.grad)
                momentum = self.state[matrix]["momentum"]
                momentum.lerp_(matrix.grad, 1 - MOMENTUM)
                ahead = matrix.grad.lerp(momentum, MOMENTUM)  # as Nesterov has it
                far = SIZE * max(matrix.shape) ** 0.5
                matrix.mul_(1 - group["lr"] * group["weight_decay"])
                matrix.add_(orthogonal(ahead), alpha=-group["lr"] * far)


def orthogonal(matrix: Tensor) -> Tensor:
    """About the orthogonal matrix nearest to one (n, m), whose singular values become .7 to 1.2 by a
    Newton-Schulz iteration (Jordan et al. 2024)."""
    a, b, c = QUINTIC
    tall = matrix.shape[0] > matrix.shape[1]
    x = (matrix.T if tall else matrix).to(short(matrix.device))
    x = x / x.norm().clamp(min=1e-7)
    for _ in range(ROUNDS):
        gram = x @ x.T
        x = torch.addmm(x, torch.addmm(gram, gram, gram, beta=b, alpha=c), x, beta=a)
    return (x.T if tall else x).to(matrix.dtype)
