"""Where training runs, on its own or as one of several processes, and how arrays get there."""

from __future__ import annotations

import os

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
