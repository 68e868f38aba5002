"""An arm of another clip inside of a gap, as in Kaufmann et al. 2020, figure 7 (tertiary blending).

    python examples/blending.py --data data --out docs/pictures

A second of a walk is missing, and for a quarter of a second in it the right arm is that of another clip,
which raises it. Both are CMU trials of a test performer (mocap.cs.cmu.edu), at 30 fps.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import interpose
from interpose.clip import Clip
from interpose.resampling import resample
from interpose.show import Take, strip

WALK, OTHER, ARM = "49_01", "49_08", ("RightArm", "RightForeArm", "RightHand")
GAP, AT, RANGE = (60, 90), 71, (34, 42)


def read(data: Path, trial: str) -> Clip:
    """A trial at 30 fps, without the rest pose in its first frame."""
    clip = interpose.load(data / "cmu" / "bvh" / trial[:2] / f"{trial}.bvh")
    return resample(clip.slice(1, len(clip)), 30)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, required=True, help="the folder that holds cmu/")
    parser.add_argument("--out", type=Path, default=Path("docs/pictures"))
    given = parser.parse_args()
    walk, other = read(given.data, WALK), read(given.data, OTHER)
    plain = interpose.fill(walk, GAP, method="cae")
    done = interpose.fill(walk, GAP, method="cae", parts=interpose.Part(other, *RANGE, AT, ARM))
    print(done.report)
    takes = [
        Take("filled", plain.clip.positions(), "#2463c8"),
        Take("with its arm", done.clip.positions(), "#8a4fbf"),
    ]
    path = given.out / "blending.svg"
    words = "A gap of one second, and in it the raised arm of another clip"
    strip(takes, walk.skeleton.parents, walk.fps, [GAP], path, words, names=walk.skeleton.names)
    print(f"wrote {path}")


if __name__ == "__main__":
    main()
