"""Where training runs, on its own or as one of several processes, and how arrays get there."""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import wraps

import numpy as np
import torch
from torch import Tensor
from torch import distributed as dist


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


def fused(device: torch.device, frames: int, function: Callable[..., Tensor]) -> Callable[..., Tensor]:
    """On a GPU a function of tensors, the first `frames` of them (B, T, ...), compiled for any T.

    Geometry is hundreds of small steps; one after the other they would read and write memory most of the
    time. Where compiling fails it goes on uncompiled.
    """
    if device.type != "cuda":
        return function
    import torch._dynamo
    import torch._inductor.config as inductor

    torch._dynamo.config.suppress_errors = True
    # Products with the small constant matrices of geometry become part of what stands around them.
    inductor.post_grad_fusion_options = {**inductor.post_grad_fusion_options, "decompose_mm_pass": {}}
    compiled = torch.compile(function)
    begun = False

    @wraps(function)
    def call(*tensors: Tensor) -> Tensor:
        nonlocal begun
        if not begun:  # as it is, which brings its constants there
            begun = True
            return function(*tensors)
        for tensor in tensors[:frames]:
            torch._dynamo.mark_dynamic(tensor, 1)
        return compiled(*tensors)

    return call
