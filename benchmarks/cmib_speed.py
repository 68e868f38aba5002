"""Time of CMIB on one CPU thread over the batch size, for 30 and 80 frames: Kim et al. 2022, figure 4.

    python benchmarks/cmib_speed.py

Beside it the autoregressive alternative: the recurrent network of `bench forecasting`, frame after frame. The
paper times a GPU, where a larger batch costs nearly nothing at first; on one CPU thread it costs in full.
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np

from interpose.methods import weights

BATCHES = (1, 2, 4, 8, 16, 32)
LENGTHS = (30, 80)
TIMES = 15
RECURRENT = Path(__file__).parents[1] / "studies" / "seq2seq"

Feed = dict[str, np.ndarray]


def feed(batch: int, frames: int) -> Feed:
    """Any motions of which the first and the last frame are keys."""
    rng = np.random.default_rng(0)
    rotation = rng.standard_normal((batch, frames, 22, 4)).astype(np.float32)
    keys = np.zeros((batch, frames), bool)
    keys[:, [0, -1]] = True
    return {
        "positions": rng.standard_normal((batch, frames, 22, 3)).astype(np.float32),
        "rotation": rotation / np.linalg.norm(rotation, axis=-1, keepdims=True),
        "keys": keys,
        "label": np.zeros(batch, np.int64),
        "bones": np.full((batch, 22), 0.2, np.float32),
    }


def at_once(session: Any, motions: Feed) -> None:
    """All frames in one pass."""
    session.run(None, motions)


def step_by_step(session: Any, motions: Feed) -> None:
    """Each frame from the one before."""
    count, frames = motions["keys"].shape
    units = next(one for one in session.get_inputs() if one.name == "state").shape[1]
    rotation, state = motions["rotation"][:, 0], np.zeros((count, units), np.float32)
    for _ in range(frames - 1):
        inputs = {"rotation": rotation, "label": motions["label"], "state": state}
        rotation, state = session.run(None, inputs)


def milliseconds(run: Any, session: Any, motions: Feed) -> float:
    """The median of several runs."""
    run(session, motions)
    spent = []
    for _ in range(TIMES):
        start = time.perf_counter()
        run(session, motions)
        spent.append(time.perf_counter() - start)
    return 1000 * float(np.median(spent))


def main() -> None:
    cmib = weights.session(weights.find("cmib").onnx)
    recurrent = weights.session(weights.load(RECURRENT, "seq2seq").onnx)
    rows = [("CMIB", at_once, cmib), ("frame after frame", step_by_step, recurrent)]
    columns = [(name, run, session, frames) for name, run, session in rows for frames in LENGTHS]
    print(f"milliseconds (median of {TIMES}):")
    print("batch  " + "  ".join(f"{name}, {frames} frames" for name, _, _, frames in columns))
    for batch in BATCHES:
        spent = [milliseconds(run, session, feed(batch, frames)) for _, run, session, frames in columns]
        widths = [len(f"{name}, {frames} frames") for name, _, _, frames in columns]
        print(f"{batch:5}  " + "  ".join(f"{ms:{width}.1f}" for ms, width in zip(spent, widths)))


if __name__ == "__main__":
    main()
