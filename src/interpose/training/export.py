"""From averaged weights to what ships: an ONNX graph with 16-bit weights, and its card."""

from __future__ import annotations

import datetime
import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import torch
from onnx import TensorProto, helper, numpy_helper

from interpose.datasets import DATASETS, Pack
from interpose.methods.weights import Card
from interpose.models.cae import Infiller
from interpose.show.plot import line_plot
from interpose.skeletons import JOINTS

LICENCES = {
    "lafan1": "CC BY-NC-ND 4.0",
    "bandai": "CC BY-NC 4.0",
    "pfnn": "free for academic and non-commercial use",
    "cmu": "free for all uses, the data itself may not be resold; mocap.cs.cmu.edu",
}
RESEARCH = "research and non-commercial use: the training data is licensed so"
OPEN = "any use: trained on CMU data alone"


def export_onnx(model: Infiller, path: Path) -> None:
    """Write the whole method as one graph, for any number of clips and frames.

    Weights are stored in 16 bits and widened when the graph is loaded; all computing is in 32 bits.
    """
    positions, observed = torch.randn(2, 97, len(JOINTS), 3), torch.rand(2, 97, len(JOINTS)) > 0.2
    sizes = {0: torch.export.Dim("clips", min=1, max=4096), 1: torch.export.Dim("frames", min=2, max=262144)}
    program = torch.onnx.export(
        model.eval().cpu(),
        (positions, observed),
        dynamo=True,
        input_names=["positions", "observed"],
        output_names=["body", "raw", "completed"],
        dynamic_shapes=(sizes, sizes),
        verbose=False,
    )
    graph = program.model_proto
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


def export_cae(folder: Path, packs: list[Pack], out: Path, splits: list[str]) -> Card:
    """Write `cae.onnx`, `cae.json`, the training log and its curve into `out` from a run's folder."""
    model = Infiller()
    model.load_state_dict(torch.load(folder / "averaged.pt", map_location="cpu", weights_only=True))
    out.mkdir(parents=True, exist_ok=True)
    export_onnx(model, out / "cae.onnx")
    settings: dict[str, Any] = json.loads((folder / "settings.json").read_text())
    log, earlier, auto = _history(folder)
    (out / "log.jsonl").write_text("".join(json.dumps(entry) + "\n" for entry in log))
    hours = [entry["hours"] for entry in log]
    line_plot(
        {"loss": (hours, [entry["loss"] for entry in log])},
        "device hours",
        "L1, normalised",
        "Training of cae",
        path=out / "loss.svg",
    )
    line_plot(
        {f"gap of {gap} frames": (hours, [entry[f"gap{gap}"] for entry in log]) for gap in (15, 30, 60)},
        "device hours",
        "joint error, cm",
        "Validation performers",
        path=out / "validation.svg",
    )
    data = []
    for pack in packs:
        kept = np.isin(pack.splits, splits)
        frames = int(np.diff(pack.starts)[kept].sum())
        data.append(
            {
                "name": str(pack.dataset),
                "licence": LICENCES[pack.dataset],
                "clips": int(kept.sum()),
                "frames": frames,
            }
        )
    card = Card(
        name="cae",
        method="cae",
        description="Convolutional autoencoder for infilling (Kaufmann et al. 2020), gaps to 2 s",
        licence=OPEN if {pack.dataset for pack in packs} == {"cmu"} else RESEARCH,
        data=sorted(data, key=lambda one: list(DATASETS).index(one["name"])),
        tasks=["fill", "recover"],
        joints=list(JOINTS),
        fps=30.0,
        max_gap=60,
        training={
            "recipe": "interpose train cae" + (" --start cae" if earlier else ""),
            **settings,
            "splits": splits,
            "steps": log[-1]["step"],
            "device_hours": log[-1]["hours"],  # from the first start on, as the steps
            "earlier": earlier,
            "parameters": sum(p.numel() for p in model.parameters()),
            "date": datetime.date.today().isoformat(),
            "statistics": {
                "mean": [round(float(v), 6) for v in model.mean.flatten()],
                "std": [round(float(v), 6) for v in model.std.flatten()],
            },
        },
        metrics={"validation": log[-1]},
        auto=auto,
    )
    card.save(out / "cae.json")
    return card


def _history(folder: Path) -> tuple[list[dict[str, Any]], list[dict[str, Any]], dict[str, Any]]:
    """The log of a run, after that of the weights that it started from; what their card said of their
    training; and what `auto` goes by.

    The latter stays as measured on them: a run that goes on may train on the performers that it was measured
    with. Of a first run it is not measured yet, so that all gaps are the spline's until
    `interpose bench threshold --save`.
    """

    def lines(name: str) -> list[dict[str, Any]]:
        return [json.loads(line) for line in (folder / name).read_text().splitlines()]

    if not (folder / "earlier.json").exists():
        return lines("log.jsonl"), [], {"from_gap": 61}
    before = lines("earlier.jsonl")
    steps, hours = before[-1]["step"], before[-1]["hours"]
    after = [
        {**entry, "step": entry["step"] + steps, "hours": round(entry["hours"] + hours, 4)}
        for entry in lines("log.jsonl")
    ]
    kept = json.loads((folder / "earlier.json").read_text())
    return before + after, kept["training"], kept["auto"]
