"""How often the up axis of a file is misjudged: of clips as they are, Y up, and of the same with Z up.

    python examples/up.py --data data

Five seconds out of every twenty are looked at by themselves, of clips spread over each data set.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from interpose.clip import Clip
from interpose.datasets import clips
from interpose.formats.place import SAMPLE, estimate_up
from interpose.geometry import rotations
from interpose.skeletons import find_mapping

DATASETS = ("lafan1", "bandai", "pfnn", "cmu", "hdm05")
SECONDS, EVERY, CLIPS = 5, 20, 60
TURN = rotations.about("X", np.array(np.pi / 2))


def with_z_up(clip: Clip) -> Clip:
    """The clip in axes of which Z points up."""
    rotation, translation = clip.rotation.copy(), clip.translation.copy()
    rotation[:, 0] = rotations.multiply(TURN, rotation[:, 0])
    translation[:, 0] = rotations.rotate(TURN, translation[:, 0])
    return clip.with_motion(rotation, translation)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, default=Path("data"))
    data = parser.parse_args().data
    total = np.zeros(3, int)
    for name in DATASETS:
        entries, found = list(clips(name, data)), np.zeros(3, int)
        chosen = np.unique(np.linspace(0, len(entries) - 1, CLIPS).astype(int))
        for clip in (entries[i].load() for i in chosen):
            mapping, length = find_mapping(clip.skeleton), round(SECONDS * clip.fps)
            for start in range(0, max(1, len(clip) - length + 1), round(EVERY * clip.fps)):
                stop = min(start + length, len(clip))
                frames = np.unique(np.linspace(start, stop - 1, SAMPLE).astype(int))
                part = clip.with_motion(clip.rotation[frames], clip.translation[frames])
                right = [
                    estimate_up(mapping, part)[0] == "y",
                    estimate_up(mapping, with_z_up(part))[0] == "z",
                ]
                found += [1, *(not one for one in right)]
        print("{}: {} excerpts, {} misjudged, {} with Z up".format(name, *found))
        total += found
    print("all: {} excerpts, {} misjudged, {} with Z up".format(*total))


if __name__ == "__main__":
    main()
