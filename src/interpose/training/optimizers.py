"""Optimisers that work together on the parameters of one network."""

from __future__ import annotations

from typing import Any

import torch
from torch import nn


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
            torch.optim.Muon(within, learning_rate, decay, adjust_lr_fn="match_rms_adamw"),
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
