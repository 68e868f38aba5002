"""A filled motion that is led over a point of the floor: the way, and what it costs.

    python examples/path.py --data data --out docs/pictures

Two seconds of a walk of a CMU test performer (mocap.cs.cmu.edu, at 30 fps) are missing, and in their middle
the hips are to be half a metre, and a metre, to the side of where they were. The picture shows the ways over
the floor; what is printed says how near they come and what the feet do.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

import interpose
from interpose.resampling import resample
from interpose.show.plot import line_plot

TRIAL, GAP, MIDDLE, ASIDE = "49/49_01.bvh", (50, 110), 80, (0.5, 1.0)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, required=True, help="the folder that holds cmu/")
    parser.add_argument("--out", type=Path, default=Path("docs/pictures"))
    given = parser.parse_args()
    clip = interpose.load(given.data / "cmu" / "bvh" / TRIAL)
    clip = resample(clip.slice(1, len(clip)), 30)
    way = (clip.root[GAP[1]] - clip.root[GAP[0] - 1])[[0, 2]]
    along = way / np.linalg.norm(way)
    across = np.array([along[1], -along[0]])
    done = {"filled": interpose.fill(clip, GAP)}
    for far in ASIDE:
        point = clip.root[MIDDLE, [0, 2]] + far * across
        done[f"led {far:g} m aside"] = interpose.fill(clip, GAP, path={MIDDLE: point})
    shown = slice(GAP[0] - 20, GAP[1] + 20)
    series = {}
    for name, one in {"truth": clip, **{name: one.clip for name, one in done.items()}}.items():
        floor = one.root[shown][:, [0, 2]] - clip.root[GAP[0], [0, 2]]
        series[name] = (floor @ along, floor @ across)
    for name, one in done.items():
        print(f"{name}: {one.report}")
    path = given.out / "path.svg"
    title = "The hips from above, two seconds filled"
    line_plot(series, "along the walk, m", "across, m", title, path=path, alike=True)
    print(f"wrote {path}")


if __name__ == "__main__":
    main()
