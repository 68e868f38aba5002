"""Time of CMIB on one CPU thread over the batch size, for 30 and 80 frames: Kim et al. 2022, figure 4.

    python benchmarks/cmib_speed.py

The paper times a GPU, where a larger batch costs nearly nothing at first; on one CPU thread it costs in full.
"""

from __future__ import annotations

import time

import numpy as np

from interpose.methods import weights

BATCHES = (1, 2, 4, 8, 16, 32)


def feed(batch: int, frames: int) -> dict[str, np.ndarray]:
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


def main() -> None:
    session = weights.session(weights.find("cmib").onnx)
    print("milliseconds (median of 9):")
    print("batch  " + "  ".join(f"{frames} frames" for frames in (30, 80)))
    for batch in BATCHES:
        row = []
        for frames in (30, 80):
            inputs = feed(batch, frames)
            session.run(None, inputs)
            spent = []
            for _ in range(9):
                start = time.perf_counter()
                session.run(None, inputs)
                spent.append(time.perf_counter() - start)
            row.append(f"{1000 * float(np.median(spent)):9.1f}")
        print(f"{batch:5}  " + "  ".join(row))


if __name__ == "__main__":
    main()
