"""A quick way through strided deconvolutions in bfloat16 on a CPU.

torch's forward pass takes a slow path for them (five to ten times the time of everything around it; seen
with torch 2.13). A deconvolution is the gradient of a convolution with regard to its input, and that
gradient has a fast path, so it is asked for directly. Parameters and results stay those of
`nn.ConvTranspose2d`.
"""

from __future__ import annotations

from types import MethodType
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional

# Strided convolutions in bfloat16 of images narrower than this give what happens to lie in memory: with two
# columns they do, with four they are right (torch 2.13). Networks that see 4 s never get there.
NARROW = 4


def _gradients(
    output: Tensor, into: Tensor, weight: Tensor, stride: tuple[int, ...], mask: list[bool]
) -> Any:
    return torch.ops.aten.convolution_backward(
        output, into, weight, None, stride, [1, 1], [1, 1], False, [0, 0], 1, mask
    )


class _Deconvolution(torch.autograd.Function):
    """A 3x3 deconvolution with padding 1, without bias."""

    @staticmethod
    @torch.amp.custom_fwd(device_type="cpu", cast_inputs=torch.bfloat16)
    def forward(ctx: Any, x: Tensor, weight: Tensor, stride: tuple[int, ...], size: list[int]) -> Tensor:
        ctx.save_for_backward(x, weight)
        ctx.stride = stride
        like = torch.empty((len(x), weight.shape[1], *size), dtype=x.dtype)
        like = like.to(memory_format=torch.channels_last)
        return _gradients(x, like, weight, stride, [True, False, False])[0]

    @staticmethod
    @torch.amp.custom_bwd(device_type="cpu")
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor, Tensor, None, None]:
        x, weight = ctx.saved_tensors
        (gradient,) = gradients
        if gradient.shape[-1] < NARROW:
            into = functional.conv2d(gradient.float(), weight.float(), None, ctx.stride, 1).to(x.dtype)
        else:
            into = functional.conv2d(gradient, weight, None, ctx.stride, 1)
        return into, _gradients(x, gradient, weight, ctx.stride, [False, True, False])[1], None, None


def _forward(module: nn.ConvTranspose2d, x: Tensor) -> Tensor:
    assert module.bias is not None
    size = [n * step for n, step in zip(x.shape[-2:], module.stride)]
    y = _Deconvolution.apply(x, module.weight, module.stride, size)
    return y + module.bias.to(y.dtype)[:, None, None]


def quicken(model: nn.Module) -> None:
    """Send the strided deconvolutions of a model through the fast path; for training on a CPU."""
    for module in model.modules():
        if isinstance(module, nn.ConvTranspose2d) and module.stride != (1, 1):
            # A method, and no function that knows the module: in a copy of the model it is the copy's.
            module.forward = MethodType(_forward, module)
