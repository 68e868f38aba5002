"""Where and in how many bits networks are trained."""

from __future__ import annotations

import pytest
import torch

from interpose.training.device import mixed


@pytest.mark.parametrize(
    ("told", "kind"),
    [
        ({"avx2": True, "avx512_bf16": False, "amx_bf16": False}, torch.float32),  # most laptops
        ({"avx512_f": True, "avx512_bf16": True}, torch.bfloat16),
        ({"neon": True, "bf16": True}, torch.bfloat16),
        ({"neon": True, "bf16": False}, torch.float32),
    ],
)
def test_cpus_train_in_bfloat16_where_they_multiply_in_it(monkeypatch, told, kind):
    monkeypatch.setattr(torch.cpu, "get_capabilities", lambda: told, raising=False)
    with mixed(torch.device("cpu")):
        assert (torch.ones(2, 2) @ torch.ones(2, 2)).dtype == kind


def test_a_torch_that_does_not_tell_trains_in_32_bits(monkeypatch):
    monkeypatch.delattr(torch.cpu, "get_capabilities", raising=False)
    with mixed(torch.device("cpu")):
        assert (torch.ones(2, 2) @ torch.ones(2, 2)).dtype == torch.float32
