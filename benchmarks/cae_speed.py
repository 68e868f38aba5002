"""Time of the autoencoder on one CPU thread, for the 1,927 frames of Kaufmann et al. 2020, figure 1.

    python benchmarks/cae_speed.py

The paper: .3 ms a frame on a Quadro M6000, 1.45 ms on a GT 730. Beside it, when torch is installed, the same
network run eagerly by torch on one thread, and how the time grows with the length.
"""

from __future__ import annotations

import time
from functools import partial

import numpy as np

from interpose.methods import weights
from interpose.methods.cae import run, run_long

PAPER = 0.3  # ms a frame
FRAMES = 1927


def timed(call, times: int = 5) -> float:  # type: ignore[no-untyped-def]
    """Seconds: the median of several runs after one that warms up."""
    call()
    spent = []
    for _ in range(times):
        start = time.perf_counter()
        call()
        spent.append(time.perf_counter() - start)
    return float(np.median(spent))


def motion(frames: int) -> tuple[np.ndarray, np.ndarray]:
    """Positions (1, F, 22, 3) of any body and two thirds of the frames hidden, as in the figure."""
    rng = np.random.default_rng(0)
    observed = np.repeat((np.arange(frames) % 90 < 30)[None, :, None], 22, axis=2)
    return rng.normal(size=(1, frames, 22, 3)), observed


def main() -> None:
    path = weights.find("cae").onnx
    positions, observed = motion(FRAMES)
    used = timed(partial(run_long, path, positions[0], observed[0]))
    print(
        f"as it is used, in windows: {FRAMES} frames in {used:.3f} s, {1000 * used / FRAMES:.3f} ms a frame"
    )
    print(f"ratio to the paper's {PAPER} ms on a GPU: {1000 * used / FRAMES / PAPER:.2f}")
    ours = timed(partial(run, path, positions, observed))
    print(f"the graph over the whole: {1000 * ours / FRAMES:.3f} ms a frame")
    for frames in (100, 1_000, 10_000, 100_000):
        spent = timed(partial(run_long, path, *(a[0] for a in motion(frames))), 1 if frames > 10_000 else 3)
        print(f"{frames:>7,} frames: {spent:.3f} s, {1000 * spent / frames:.3f} ms a frame")
    try:
        import torch
    except ImportError:
        print("torch is not installed: no comparison")
        return
    from interpose.models.cae import Infiller

    torch.set_num_threads(1)
    model = Infiller().eval()
    given = torch.from_numpy(positions).float(), torch.from_numpy(observed)
    with torch.no_grad():
        eager = timed(lambda: model(*given))
    print(
        f"torch eager, 1 thread: {1000 * eager / FRAMES:.3f} ms a frame; ONNX Runtime takes "
        f"{ours / eager:.2f} of it"
    )


if __name__ == "__main__":
    main()
