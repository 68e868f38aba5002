"""What stands around a frame: the known frames before and after it, for networks that complete a motion."""

from __future__ import annotations

import torch
from torch import Tensor


def neighbours(placed: Tensor) -> tuple[Tensor, Tensor]:
    """For each frame the last frame at or before it, and the first at or after it, that is placed.

    (B, T) booleans to two (B, T) of indices. At an open end both name the only neighbour there is; where
    nothing is placed at all, frame 0.
    """
    length = placed.shape[1]
    frame = torch.arange(length, device=placed.device).expand_as(placed)
    rank = torch.cumsum(placed.long(), dim=1)
    count = rank[:, -1:]
    # The k-th placed frame stands in slot k; slot 0 takes all others and is never asked for.
    table = torch.zeros(placed.shape[0], length + 1, dtype=torch.long, device=placed.device)
    table = table.scatter(1, torch.where(placed, rank, 0), frame)
    last = table.gather(1, torch.minimum(torch.clamp(rank, min=1), count))
    first = table.gather(1, torch.minimum(torch.where(placed, rank, rank + 1), count))
    nothing = count == 0
    return torch.where(nothing, 0, last), torch.where(nothing, 0, first)


def pick(values: Tensor, index: Tensor) -> Tensor:
    """Values (B, T) or (B, T, n) at frames (B, S): (B, S) or (B, S, n)."""
    if values.ndim == 2:
        return values.gather(1, index)
    # Whole rows of all motions one after the other: in graphs much faster than one by one.
    row = index + values.shape[1] * torch.arange(values.shape[0], device=index.device)[:, None]
    return values.flatten(0, 1).index_select(0, row.flatten()).unflatten(0, (values.shape[0], -1))
