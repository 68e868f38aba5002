"""Where a body goes of which the turns alone are known: its way from above, recorded and told by its feet.

    python examples/standing.py --data data

A run and a walk of LAFAN1's test performer (CC BY-NC-ND 4.0). Their hips are put where they are in the first
frame, for all frames, and what `interpose recover --place` does finds their way again. The picture shows the
walk.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

import interpose
from interpose.show.plot import line_plot

CLIPS, SHOWN = ("run1_subject5", "walk3_subject5"), 60.0  # seconds of the picture


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, default=Path("data"))
    parser.add_argument("--out", type=Path, default=Path("docs/pictures"))
    given = parser.parse_args()
    path = given.out / "standing.svg"
    for name in CLIPS:
        clip = interpose.load(given.data / "lafan1" / "bvh" / f"{name}.bvh")
        stuck = clip.with_motion(clip.rotation, np.repeat(clip.translation[:1], len(clip), axis=0))
        done = interpose.recover(stuck, place=True).clip
        way = np.linalg.norm(np.diff(clip.root[:, [0, 2]], axis=0), axis=1).sum()
        off = done.root - clip.root
        end, mean = np.linalg.norm(off[-1]), np.linalg.norm(off, axis=1).mean()
        print(
            f"{name}: {clip.seconds:.0f} s and {way:.0f} m; off by {end:.2f} m at the end, "
            f"{mean:.2f} in the mean, {np.abs(off[:, 1]).mean():.3f} in height"
        )
        part = slice(0, round(SHOWN * clip.fps))
        series = {
            said: (one.root[part, 0].tolist(), one.root[part, 2].tolist())
            for said, one in (("recorded", clip), ("told by its feet", done))
        }
        title = f"The way of {name} from above, {SHOWN:.0f} s"
        line_plot(series, "x, m", "z, m", title, path, alike=True)
    print(f"wrote {path}")


if __name__ == "__main__":
    main()
