"""What no method here can fill, as Kaufmann et al. 2020 name it (section 4.2), and what a key does about it.

    python examples/failures.py --data data --out docs/pictures

A whole turn that lies in the gap, here a cartwheel; jumps, of which the middle of a gap of two seconds is a
mean pose; and a motion that is rare in the training data. Each is filled once more with a frame of it known.
Writes a picture of each, failure-*.svg. The clips are CMU trials of a test performer (mocap.cs.cmu.edu), at
30 fps.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import interpose
from interpose.geometry.measures import joint_error
from interpose.resampling import resample
from interpose.show import Take, strip

# name: (trial, gap in frames at 30 fps, the frame of it that is a key, title)
PICTURES = {
    "turn": ("49_06", (38, 92), 65, "A whole turn is hidden, a cartwheel: nothing tells that there was one"),
    "mean": ("49_02", (90, 150), 136, "Two seconds of jumps: the middle moves {:.0f} % as much as around it"),
    "rare": ("49_08", (84, 108), 96, "Half of a cartwheel, a rare motion: the legs come late, with a jerk"),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, required=True, help="the folder that holds cmu/")
    parser.add_argument("--out", type=Path, default=Path("docs/pictures"))
    given = parser.parse_args()
    for name, (trial, gap, key, title) in PICTURES.items():
        clip = interpose.load(given.data / "cmu" / "bvh" / trial[:2] / f"{trial}.bvh")
        clip = resample(clip.slice(1, len(clip)), 30)  # its first frame is a rest pose
        filled = interpose.fill(clip, gap)
        keyed = interpose.fill(clip, [(gap[0], key), (key + 1, gap[1])])
        truth, without, with_key = (c.positions() for c in (clip, filled.clip, keyed.clip))
        wrong = [100 * joint_error(some[slice(*gap)], truth[slice(*gap)]) for some in (without, with_key)]
        (report,) = filled.report.gaps
        print(f"{trial}: {wrong[0]:.1f} cm off, {wrong[1]:.1f} cm with a key at frame {key}\n{report}")
        takes = [
            Take("truth", truth, "#64748b", ghost=True),
            Take(f"filled ({report.method})", without, "#2463c8"),
            Take(f"with a key at frame {key}", with_key, "#2f8f4e"),
        ]
        words = title.format(100 * (report.liveliness or 0))
        path = given.out / f"failure-{name}.svg"
        strip(takes, clip.skeleton.parents, clip.fps, [gap], path, words, names=clip.skeleton.names)
        print(f"wrote {path}")


if __name__ == "__main__":
    main()
