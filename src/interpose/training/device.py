"""Where training runs, on its own or as one of several processes, and how arrays get there."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch import distributed as dist

# What CPUs call it that multiply in bfloat16, x86 and ARM.
NATIVE = ("avx512_bf16", "amx_bf16", "bf16", "sve_bf16")


def pick_device() -> torch.device:
    """The GPU of this process when there is one, else the CPU. Under torchrun, also joins the group."""
    gpu = torch.cuda.is_available()
    if int(os.environ.get("WORLD_SIZE", "1")) > 1 and not dist.is_initialized():
        dist.init_process_group("nccl" if gpu else "gloo")
    return torch.device("cuda", int(os.environ.get("LOCAL_RANK", "0"))) if gpu else torch.device("cpu")


def processes() -> int:
    return dist.get_world_size() if dist.is_initialized() else 1


def rank() -> int:
    return dist.get_rank() if dist.is_initialized() else 0


def send(array: np.ndarray, device: torch.device) -> Tensor:
    """An array as a tensor on the device. A GPU goes on with its work meanwhile: nothing waits for it."""
    tensor = torch.from_numpy(array)
    return tensor.pin_memory().to(device, non_blocking=True) if device.type == "cuda" else tensor.to(device)


def short(device: torch.device) -> torch.dtype:
    """The shorter numbers that the device multiplies quickly: bfloat16, in half of the time of 32 bits.

    A CPU that does not multiply in it, as in most laptops, would take thirty times as long: there 32 bits.
    """
    # Not there in every torch that will do.
    tell: Callable[[], Mapping[str, Any]] = getattr(torch.cpu, "get_capabilities", dict)
    fast = device.type != "cpu" or any(tell().get(name) for name in NATIVE)
    return torch.bfloat16 if fast else torch.float32


def mixed(device: torch.device) -> torch.autocast:
    """Autocast to `short` numbers."""
    return torch.autocast(device.type, torch.bfloat16, enabled=short(device) is torch.bfloat16)
