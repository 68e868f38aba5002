"""Muon and AdamW together: who moves what, and how far."""

from __future__ import annotations

import torch
from torch import nn

from interpose.training.optimizers import Muon


def network() -> nn.Module:
    torch.manual_seed(1)
    return nn.ModuleDict({"first": nn.Linear(6, 8), "blocks": nn.Linear(8, 8), "last": nn.Linear(8, 2)})


def step(model: nn.Module, optimizer: Muon) -> None:
    x = torch.randn(256, 6, generator=torch.Generator().manual_seed(2))
    model["last"](torch.tanh(model["blocks"](torch.tanh(model["first"](x))))).square().mean().backward()
    optimizer.step()
    optimizer.zero_grad()


def test_matrices_within_turn_in_all_directions_alike():
    """What is added to them has singular values of about one size; what AdamW moves has not."""
    model = network()
    before = {name: p.detach().clone() for name, p in model.named_parameters()}
    step(model, Muon(list(model.named_parameters()), "blocks.", 1e-3, 0.0))
    moved = {name: p.detach() - before[name] for name, p in model.named_parameters()}
    assert all(change.abs().max() > 0 for change in moved.values())
    inner, outer = (torch.linalg.svdvals(moved[f"{name}.weight"]) for name in ("blocks", "first"))
    assert inner.max() < 2 * inner.median()
    assert outer.max() > 2 * outer.median()
    # As far as AdamW moves, in the mean, so that one learning rate does for both.
    assert 0.1e-3 < moved["blocks.weight"].square().mean().sqrt() < 0.3e-3


def test_it_goes_on_from_its_state():
    whole, half = network(), network()
    one = Muon(list(whole.named_parameters()), "blocks.", 1e-2, 0.01)
    for _ in range(4):
        step(whole, one)
    first = Muon(list(half.named_parameters()), "blocks.", 1e-2, 0.01)
    for _ in range(2):
        step(half, first)
    second = Muon(list(half.named_parameters()), "blocks.", 1e-2, 0.01)
    second.load_state_dict(first.state_dict())
    for _ in range(2):
        step(half, second)
    for a, b in zip(whole.parameters(), half.parameters()):
        torch.testing.assert_close(a, b)
