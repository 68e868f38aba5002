"""Time of interpose's own network on one CPU thread: a gap, and a clip of gaps one after another.

    python benchmarks/base_speed.py [small]

The gap has 30 frames with ten known ones on either side; a fill asks for it and its mirror image at once.
1,927 frames are those that Kaufmann et al. 2020 time, here as gaps of 60 with ten known frames between them,
run one by one and in one batch, without mirror images.
"""

from __future__ import annotations

import argparse
import time
from typing import Any

import numpy as np

from interpose.methods import weights

CONTEXT, WHOLE, LONG = 10, 1927, 60


def feed(batch: int, gap: int) -> dict[str, np.ndarray]:
    """Any motions with a gap between known frames."""
    rng = np.random.default_rng(0)
    frames = gap + 2 * CONTEXT
    local = rng.standard_normal((batch, frames, 22, 4))
    known = np.ones((batch, frames, 23), np.float32)
    known[:, CONTEXT:-CONTEXT] = 0
    return {
        "local": (local / np.linalg.norm(local, axis=-1, keepdims=True)).astype(np.float32),
        "root": rng.standard_normal((batch, frames, 3)).astype(np.float32),
        "known": known,
        "pinned": np.zeros((batch, frames, 22, 3), np.float32),
        "pins": np.zeros((batch, frames, 22), bool),
        "label": np.zeros(batch, np.int64),
        "bones": np.full((batch, 22, 3), 0.1, np.float32),
    }


def milliseconds(session: Any, inputs: dict[str, np.ndarray], times: int) -> float:
    """The median of several runs."""
    session.run(None, inputs)
    spent = []
    for _ in range(times):
        start = time.perf_counter()
        session.run(None, inputs)
        spent.append(time.perf_counter() - start)
    return 1000 * float(np.median(spent))


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("network", nargs="?", default="small")
    card = weights.find(parser.parse_args().network)
    session = weights.session(card.onnx)
    count = round(WHOLE / (LONG + CONTEXT))
    one, batch = milliseconds(session, feed(1, LONG), 25), milliseconds(session, feed(count, LONG), 9)
    print(f"{card.name}, {card.onnx.stat().st_size / 1e6:.1f} MB, milliseconds (medians):")
    once, both = (milliseconds(session, feed(motions, 30), 101) for motions in (1, 2))
    print(f"a gap of 30 frames: {once:.1f}, with its mirror image {both:.1f}")
    print(f"{WHOLE} frames: {count * one:.0f} gap by gap, {batch:.0f} in one batch")


if __name__ == "__main__":
    main()
