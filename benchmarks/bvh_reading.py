"""How long reading a BVH file takes, beside NumPy parsing the same numbers.

    python benchmarks/bvh_reading.py [FILE.bvh ...] [--frames 3600] [--runs 7]

Without a file: the CMU excerpt of the tests, its frames repeated. NumPy's time is the better of
`np.fromstring(text, sep=" ")` and `np.array(text.split(), float)` on the motion block, already in memory.
"Parsing" is what interpose does up to the numbers: reading the file, hierarchy, finding and checking frames,
parsing. "Loading" is the whole of `interpose.formats.load`: estimates, Euler angles to quaternions, and the
clip. The runs take turns, so that a busy machine disturbs all alike; medians are printed.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from interpose import formats
from interpose.formats.bvh.motion_text import read_text

WALK = Path(__file__).parent.parent / "tests" / "data" / "cmu_walk.bvh"


def repeated(path: Path, frames: int, folder: Path) -> Path:
    """The file with its frames repeated until there are `frames`."""
    header, motion = read_text(path)
    lines = motion.raw(0, len(motion)).rstrip(b"\r\n") + b"\n"
    text = header.text[: header.frames_at[0]] + b"%d" % frames + header.text[header.frames_at[1] :] + b"\n"
    body = (lines * (frames // len(motion) + 1)).split(b"\n")[:frames]
    longer = folder / path.name
    longer.write_bytes(text + b"\n".join(body) + b"\n")
    return longer


def parse(path: Path) -> int:
    """Every number of the motion, and no more."""
    _, motion = read_text(path)
    numbers = 0
    for start in range(0, len(motion), motion.chunk):
        numbers += motion.values(start, min(start + motion.chunk, len(motion))).size
    return numbers


def seconds(task: Callable[[], object]) -> float:
    start = time.perf_counter()
    task()
    return time.perf_counter() - start


def measure(path: Path, runs: int) -> None:
    header, motion = read_text(path)
    text = motion.raw(0, len(motion))
    tasks: dict[str, Callable[[], object]] = {
        "np.fromstring": lambda: np.fromstring(text, sep=" "),
        "np.array(split)": lambda: np.array(text.split(), float),
        "interpose, parsing": lambda: parse(path),
        "interpose, loading": lambda: formats.load(path),
    }
    times: dict[str, list[float]] = {name: [] for name in tasks}
    for _ in range(runs):
        for name, task in tasks.items():
            times[name].append(seconds(task))
    median = {name: statistics.median(values) for name, values in times.items()}
    numpy = min(median["np.fromstring"], median["np.array(split)"])
    print(f"{path.name}: {len(motion)} frames, {header.channels} channels, {len(text) / 1e6:.1f} MB")
    for name, value in median.items():
        print(f"  {name:20} {1e3 * value:9.1f} ms   {value / numpy:5.2f} x NumPy")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("files", nargs="*", type=Path, metavar="FILE.bvh")
    parser.add_argument("--frames", type=int, default=3600, help="length of the built-in example")
    parser.add_argument("--runs", type=int, default=7)
    arguments = parser.parse_args()
    for path in arguments.files:
        measure(path, arguments.runs)
    if not arguments.files:
        with tempfile.TemporaryDirectory() as folder:
            measure(repeated(WALK, arguments.frames, Path(folder)), arguments.runs)


if __name__ == "__main__":
    main()
