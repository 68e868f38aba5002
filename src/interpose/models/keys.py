"""What stands around a frame: the known frames before and after it, for networks that complete a motion."""

from __future__ import annotations

import torch
from torch import Tensor


def neighbours(placed: Tensor) -> tuple[Tensor, Tensor]:
    """For each frame the last frame at or before it, and the first at or after it, that is placed.

    (..., T) booleans to two (..., T) of indices. At an open end both name the only neighbour there is; where
    nothing is placed at all, frame 0.
    """
    length = placed.shape[-1]
    frame = torch.arange(length, device=placed.device)
    held = placed.long()
    rank = torch.cumsum(held, dim=-1)
    count = rank[..., -1:]
    # The k-th placed frame stands in slot k; slot 0, which all others share, says frame 0.
    table = torch.zeros((*placed.shape[:-1], length + 1), dtype=torch.long, device=placed.device)
    table = table.scatter(-1, held * rank, held * frame)
    last = table.gather(-1, torch.minimum(torch.clamp(rank, min=1), count))
    first = table.gather(-1, torch.minimum(rank + 1 - held, count))
    return last, first


def pick(values: Tensor, index: Tensor) -> Tensor:
    """Values (..., T) or (..., T, n) at frames (..., S): (..., S) or (..., S, n)."""
    if values.ndim == index.ndim:
        return values.gather(-1, index)
    # Whole rows of all motions one after the other: in graphs much faster than one by one.
    motions = torch.arange(index[..., 0].numel(), device=index.device).view(*index.shape[:-1], 1)
    row = index + values.shape[-2] * motions
    return values.flatten(0, -2).index_select(0, row.flatten()).unflatten(0, index.shape)
