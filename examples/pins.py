"""A filled walk whose left hand is held at a place: what a pin does to the pose, and what it costs.

    python examples/pins.py --data data --out docs/pictures

A second of a walk of a CMU test performer (mocap.cs.cmu.edu, at 30 fps) is missing, and in its middle the
left hand is to be beside the head for a fifth of a second.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

import interpose
from interpose.resampling import resample
from interpose.show import Take, strip

TRIAL, GAP, HELD = "49/49_01.bvh", (60, 90), np.arange(72, 79)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, required=True, help="the folder that holds cmu/")
    parser.add_argument("--out", type=Path, default=Path("docs/pictures"))
    given = parser.parse_args()
    clip = interpose.load(given.data / "cmu" / "bvh" / TRIAL)
    clip = resample(clip.slice(1, len(clip)), 30)
    names = clip.skeleton.names
    head, left, right = (clip.positions()[75, names.index(name)] for name in ("Head", "LeftArm", "RightArm"))
    beside = head + 0.35 * (left - right) / np.linalg.norm(left - right)
    pin = interpose.Pin("LeftHand", HELD, np.tile(beside, (len(HELD), 1)))
    takes = [Take("truth", clip.positions(), "#64748b", ghost=True)]
    for name, color, pins in (("filled", "#2463c8", ()), ("hand pinned", "#c0392b", (pin,))):
        done = interpose.fill(clip, GAP, pins=pins)
        takes.append(Take(name, done.clip.positions(), color))
        print(f"{name}: {done.report}")
    path = given.out / "pins.svg"
    words = f"The left hand beside the head, frames {HELD[0]} to {HELD[-1]}"
    strip(takes, clip.skeleton.parents, clip.fps, [GAP], path, words, names=names)
    print(f"wrote {path}")


if __name__ == "__main__":
    main()
