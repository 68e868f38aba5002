"""The pictures of the README: gaps of a second in real clips, truth, interpolation and the filled motion.

    python examples/pictures.py --data data --out docs/pictures

The clips are CMU trials of test performers (mocap.cs.cmu.edu), at 30 fps.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import interpose
from interpose import tasks
from interpose.resampling import resample
from interpose.show import Take, player, strip

# name: (trial, gap in frames at 30 fps, title)
PICTURES = {
    "walk": ("16/16_22.bvh", (35, 65), "A walk that veers"),
    "jump": ("49/49_02.bvh", (60, 90), "A jump"),
    "change": ("49/49_02.bvh", (215, 245), "A change of motion"),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, required=True, help="the folder that holds cmu/")
    parser.add_argument("--out", type=Path, default=Path("docs/pictures"))
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    for name, (trial, (start, stop), title) in PICTURES.items():
        clip = interpose.load(given.data / "cmu" / "bvh" / trial)
        clip = resample(clip.slice(1, len(clip)), 30)
        clip = clip.slice(max(0, start - 60), min(len(clip), stop + 60))
        gap = interpose.Gap(min(start, 60), min(start, 60) + stop - start)
        linear, filled = (tasks.fill(clip, [gap], method) for method in ("linear", "auto"))
        by = filled.report.gaps[0].method
        takes = [
            Take("truth", clip.positions(), "#64748b", ghost=True),
            Take("interpolation", linear.raw.clip.positions(), "#dd5f28"),
            Take(f"filled ({by})", filled.clip.positions(), "#2463c8"),
        ]
        names, parents = clip.skeleton.names, clip.skeleton.parents
        words = f"{title}: one second missing"
        strip(takes, parents, clip.fps, [gap], given.out / f"{name}.svg", words, names=names)
        player(takes, parents, clip.fps, [gap], given.out / f"{name}.html", words, names=names)
        print(filled.report)


if __name__ == "__main__":
    main()
