"""How long it takes to understand a skeleton: the mapping of large rigs, canonical rotations of a long clip.

    python benchmarks/skeletons.py

Times are the best of five, on one thread. Reading the same motion from text stands beside it as a measure.
"""

from __future__ import annotations

import io
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path

os.environ["OMP_NUM_THREADS"] = "1"
sys.path.insert(0, str(Path(__file__).parents[1]))

import numpy as np
from tests.skeletons import rigs

from interpose import formats
from interpose.skeletons import find_humanoid, find_mapping

FRAMES = 10_000


def best(action: Callable[[], object]) -> float:
    """Seconds."""
    times = []
    for _ in range(5):
        start = time.perf_counter()
        action()
        times.append(time.perf_counter() - start)
    return min(times)


def main() -> None:
    walk = formats.load(Path(__file__).parents[1] / "tests" / "data" / "cmu_walk.bvh")
    for name in ("character_creator", "makehuman"):
        clip, _ = rigs.build(name, walk)
        seconds = best(lambda clip=clip: find_mapping.__wrapped__(clip.skeleton))
        print(f"mapping {len(clip.skeleton)} joints ({name}): {1000 * seconds:.2f} ms")
    for name in ("mixamo", "vicon"):
        clip, _ = rigs.build(name, walk)
        frames = np.resize(np.arange(len(clip)), FRAMES)
        long = clip.with_motion(clip.rotation[frames], clip.translation[frames])
        seconds = best(lambda long=long: find_humanoid(long).rotations(long))
        values = np.random.default_rng(0).normal(size=(FRAMES, 3 * len(clip.skeleton)))
        text = io.StringIO()
        np.savetxt(text, values, fmt="%.6f")
        parse = best(lambda text=text: np.array(text.getvalue().split(), float))
        print(
            f"canonical rotations of {FRAMES:,} frames of {len(clip.skeleton)} joints ({name}): "
            f"{seconds:.3f} s, {seconds / parse:.2f} of the time that parsing their numbers takes"
        )


if __name__ == "__main__":
    main()
