"""ONNX graphs of the networks, with 16-bit or 8-bit weights, and the same weights as safetensors."""

from __future__ import annotations

import json
import logging
import os
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import torch
from onnx import TensorProto, helper, numpy_helper
from onnx.external_data_helper import set_external_data
from safetensors.torch import save
from torch.nn.attention import SDPBackend, sdpa_kernel

from interpose.models.base import Base
from interpose.models.cae import Infiller
from interpose.models.cmib import Cmib
from interpose.models.seq2seq import Seq2Seq
from interpose.models.stmi_gan import Generator
from interpose.skeletons import JOINTS
from interpose.training.loop import shard_paths

SHARD = 14_000_000  # bytes of weights in a file
FORWARD = ("linear1.weight", "linear2.weight")  # of PyTorch's TransformerEncoderLayer


def export_cae_onnx(model: Infiller, path: Path) -> None:
    """Write the autoencoder's whole method as one graph, for any number of clips and frames."""
    positions, observed = torch.randn(2, 97, len(JOINTS), 3), torch.rand(2, 97, len(JOINTS)) > 0.2
    sizes = _sizes(262144)
    inputs = {"positions": (positions, sizes), "observed": (observed, sizes)}
    _write_graph(model, inputs, ["body", "raw", "completed"], path)


def export_cmib_onnx(model: Cmib, path: Path) -> None:
    """Write CMIB's whole method as one graph, for any number of motions and frames up to its longest; and its
    weights beside it, as safetensors.

    The layers between attention, nine tenths of its matrices, run in 8 bits, in half of the time; what it was
    trained to lies beside it in 16 bits, to be trained further.
    """
    sizes = _sizes(model.config.longest)
    rotation = torch.nn.functional.normalize(torch.randn(2, 40, len(JOINTS), 4), dim=-1)
    keys = torch.zeros(2, 40, dtype=torch.bool)
    keys[:, [0, 20, -1]] = True
    inputs = {
        "positions": (torch.randn(2, 40, len(JOINTS), 3), sizes),
        "rotation": (rotation, sizes),
        "keys": (keys, sizes),
        "label": (torch.zeros(2, dtype=torch.long), {0: sizes[0]}),
        "bones": (torch.rand(2, len(JOINTS)) + 0.1, {0: sizes[0]}),
    }
    between = tuple(name for name, _ in model.named_parameters() if name.endswith(FORWARD))
    _write_graph(model, inputs, ["positions_out", "rotation_out", "missed"], path, between)
    save_weights(model, path)


def export_stmi_gan_onnx(model: Generator, path: Path) -> None:
    """Write STMI-GAN's generator as one graph, for any number of motions of its own length."""
    shape = (2, model.config.frames, len(JOINTS), 3)
    noise = torch.zeros(2, model.noises, model.config.rows, model.config.width)
    clips = {0: _sizes(shape[1])[0]}
    inputs = {
        "positions": (torch.randn(shape), clips),
        "observed": (torch.rand(shape) > 0.2, clips),
        "noise": (noise, clips),
    }
    _write_graph(model, inputs, ["raw", "completed"], path)


def export_base_onnx(model: Base, path: Path) -> None:
    """Write `base` or `small` as one graph, for any number of motions and frames up to its longest; and its
    weights beside it, as safetensors.

    With matrices of 8 bits it would run in three quarters of the time, without more error; but what it says
    would differ from one machine, or browser, to the next by half a degree.
    """
    sizes = _sizes(model.config.longest)
    shape, clips = (2, 40, len(JOINTS)), {0: sizes[0]}
    inputs = {
        "local": (torch.nn.functional.normalize(torch.randn(*shape, 4), dim=-1), sizes),
        "root": (torch.randn(2, 40, 3), sizes),
        "known": ((torch.rand(2, 40, len(JOINTS) + 1) > 0.2).float(), sizes),
        "pinned": (torch.zeros(*shape, 3), sizes),
        "pins": (torch.zeros(shape, dtype=torch.bool), sizes),
        "label": (torch.zeros(2, dtype=torch.long), clips),
        "bones": (torch.rand(2, len(JOINTS), 3), clips),
    }
    _write_graph(model, inputs, ["local_out", "root_out", "contact", "error"], path)
    save_weights(model, path)


def export_seq2seq_onnx(model: Seq2Seq, path: Path) -> None:
    """Write one step of the sequence-to-sequence network as a graph, for any number of motions."""
    clips = {0: _sizes(4096)[0]}
    inputs = {
        "rotation": (torch.nn.functional.normalize(torch.randn(2, len(JOINTS), 4), dim=-1), clips),
        "label": (torch.zeros(2, dtype=torch.long), clips),
        "state": (torch.zeros(2, model.config.units), clips),
    }
    _write_graph(model, inputs, ["rotation_out", "state_out"], path)


def _sizes(longest: int) -> dict[int, Any]:
    return {0: torch.export.Dim("clips", min=1, max=4096), 1: torch.export.Dim("frames", min=2, max=longest)}


def _write_graph(
    model: torch.nn.Module,
    inputs: dict[str, tuple[torch.Tensor, Any]],
    outputs: list[str],
    path: Path,
    eight: tuple[str, ...] = (),
) -> None:
    """Write a module as ONNX; `inputs` are examples with their dynamic sizes, by name.

    Weights are stored in 16 bits and widened when the graph is loaded; all computing is in 32 bits. Linear
    layers whose weights are named in `eight` have 8 bits and compute in 8, on what is scaled as it comes.
    """
    # Of other packages, which are not needed, it says that they are not there.
    logging.getLogger("torch.onnx").setLevel(logging.ERROR)
    # The exporter stumbles over the memory layout of fused attention with a bias.
    with sdpa_kernel(SDPBackend.MATH):
        program = torch.onnx.export(
            model.eval().cpu(),
            tuple(example for example, _ in inputs.values()),
            dynamo=True,
            input_names=list(inputs),
            output_names=outputs,
            dynamic_shapes=tuple(sizes for _, sizes in inputs.values()),
            verbose=False,
            optimize=False,  # keeps weights under their names, so that training can start from them
        )
    graph = program.model_proto
    if eight:
        graph = _in_eight_bits(graph, eight)
    _strip(graph)
    _halve(graph)
    onnx.checker.check_model(graph)
    new = path.with_suffix(".new")
    onnx.save(graph, new)
    os.replace(new, path)


def _strip(model: onnx.ModelProto) -> None:
    """Drop what the exporter notes of the code that it came from, paths of the machine among it."""
    graph = model.graph
    for part in (
        model,
        graph,
        *graph.node,
        *graph.value_info,
        *graph.input,
        *graph.output,
        *graph.initializer,
    ):
        part.ClearField("metadata_props")
        part.ClearField("doc_string")


def _in_eight_bits(model: onnx.ModelProto, eight: tuple[str, ...]) -> onnx.ModelProto:
    """The graph with linear layers in 8 bits: those whose weights are named."""
    from onnxruntime.quantization import QuantType, quantize_dynamic

    graph = model.graph
    held, chosen = {one.name: one for one in graph.initializer}, set()
    # Linear layers are transposed within the graph: only constants are stored in 8 bits.
    for node in [node for node in graph.node if node.op_type == "Transpose" and node.input[0] in eight]:
        value = numpy_helper.to_array(held[node.input[0]])
        turned = np.ascontiguousarray(value.transpose(*node.attribute[0].ints))
        graph.initializer.append(numpy_helper.from_array(turned, node.output[0]))
        graph.initializer.remove(held[node.input[0]])
        graph.node.remove(node)
        chosen.add(node.output[0])
    # Shapes that the exporter noted are in the way of the quantiser's own.
    del graph.value_info[:]
    layers = [node.name for node in graph.node if node.op_type == "MatMul" and node.input[1] in chosen]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "eight.onnx"
        logging.disable(logging.WARNING)  # it would advise to prepare the graph, as was done above
        try:
            # One bit less than there are: processors without instructions for it would overflow.
            quantize_dynamic(
                model,
                path,
                op_types_to_quantize=["MatMul"],
                per_channel=True,
                reduce_range=True,
                weight_type=QuantType.QInt8,
                nodes_to_quantize=layers,
            )
        finally:
            logging.disable(logging.NOTSET)
        return onnx.load(path)


def save_weights(model: torch.nn.Module, path: Path) -> None:
    """Write a model's weights in 16 bits beside its graph, as safetensors in files of less than 15 MB.

    Where it takes more than one file the graph lets go of its own copy and reads them, too.
    """
    shards: list[dict[str, torch.Tensor]] = [{}]
    room = SHARD
    for name, value in model.state_dict().items():
        half = value.detach().to("cpu", torch.float16).contiguous()
        if half.nbytes > room and shards[-1]:
            shards.append({})
            room = SHARD
        shards[-1][name] = half
        room -= half.nbytes
    for old in shard_paths(path):
        old.unlink()
    for i, shard in enumerate(shards, 1):
        of = f"-{i:05d}-of-{len(shards):05d}" if len(shards) > 1 else ""
        where = path.with_name(f"{path.stem}{of}.safetensors")
        where.with_suffix(".new").write_bytes(save(shard))
        os.replace(where.with_suffix(".new"), where)
    if len(shards) > 1:
        _point(path)


def _point(path: Path) -> None:
    """Make a graph read its weights from the safetensors beside it.

    Source: safetensors' format (its header's length in 8 bytes, the header, the data), ONNX external data.
    """
    graph = onnx.load(path)
    held = {one.name.removesuffix(".half"): one for one in graph.graph.initializer}
    for shard in shard_paths(path):
        data = shard.read_bytes()
        begin = 8 + int.from_bytes(data[:8], "little")
        for name, where in json.loads(data[8:begin]).items():
            start, stop = (begin + at for at in where["data_offsets"])
            if name not in held or held[name].raw_data != data[start:stop]:
                continue  # not in 16 bits in the graph: small ones
            set_external_data(held[name], shard.name, start, stop - start)
            held[name].ClearField("raw_data")
    new = path.with_suffix(".new")
    onnx.save(graph, new)
    os.replace(new, path)


def _halve(model: onnx.ModelProto) -> None:
    """Store large initialisers in 16 bits, each followed by a cast."""
    casts = []
    for i, held in enumerate(model.graph.initializer):
        if held.data_type != TensorProto.FLOAT or np.prod(held.dims) < 1024:
            continue
        half = numpy_helper.from_array(numpy_helper.to_array(held).astype(np.float16), held.name + ".half")
        casts.append(helper.make_node("Cast", [half.name], [held.name], to=TensorProto.FLOAT))
        model.graph.initializer[i].CopyFrom(half)
    for cast in reversed(casts):
        model.graph.node.insert(0, cast)
