"""In-betweening as in Kim et al. 2022, figures 5 to 7: without a condition, with an anchor, by action.

    python examples/between.py --data data --out docs/pictures

The clip is a CMU trial of a test performer (mocap.cs.cmu.edu), at 30 fps.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import interpose
from interpose.resampling import resample
from interpose.show import Take, strip

TRIAL, START, TARGET, ANCHOR = "16/16_22.bvh", 12, 72, 42


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, required=True, help="the folder that holds cmu/")
    parser.add_argument("--out", type=Path, default=Path("docs/pictures"))
    given = parser.parse_args()
    clip = interpose.load(given.data / "cmu" / "bvh" / TRIAL)
    clip = resample(clip.slice(1, len(clip)), 30).slice(START, TARGET + 1)
    last, anchor = TARGET - START, ANCHOR - START
    rows = [
        ("interpolation", "#dd5f28", interpose.between(clip, [0, last], method="linear")),
        ("no action", "#2463c8", interpose.between(clip, [0, last], method="cmib")),
        ("with an anchor", "#2a9d5c", interpose.between(clip, [0, anchor, last], method="cmib")),
        *(
            (action, "#8a4fbf", interpose.between(clip, [0, last], action))
            for action in ("walk", "jumps", "run")
        ),
    ]
    takes = [Take("truth", clip.positions(), "#64748b", ghost=True)]
    takes += [Take(name, done.clip.positions(), color) for name, color, done in rows]
    for name, _, done in rows:
        print(f"{name}:\n{done.report}")
    path = given.out / "between.svg"
    words = "Two seconds between two keys"
    strip(takes, clip.skeleton.parents, clip.fps, [(1, last)], path, words, names=clip.skeleton.names)
    print(f"wrote {path}")


if __name__ == "__main__":
    main()
