"""The T-poses of rigs whose zero pose is none, worked out from many clips of several people.

    python examples/tposes.py --data data

writes src/interpose/skeletons/rigs.json. One clip, let alone a few keys, tells little of how arms and hands
are twisted; a rig that many files share need not be worked out from each of them. Of each training performer
a T-pose is worked out from all clips, and their mean is taken. Test and validation performers have no part.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import replace
from pathlib import Path

import numpy as np

from interpose.clip import Clip
from interpose.datasets import clips
from interpose.geometry import rotations
from interpose.skeletons import JOINTS, find_mapping
from interpose.skeletons.rest import estimate
from interpose.skeletons.rigs import RIGS, directions

SETS = {"lafan1": "LAFAN1", "bandai": "Bandai-Namco"}
POOL = 4000  # frames of each performer


def pool(some: list[Clip]) -> Clip:
    """Frames of all clips of one performer, as one."""
    step = max(1, sum(map(len, some)) // POOL)
    rotation = np.concatenate([clip.rotation[::step] for clip in some])
    translation = np.concatenate([clip.translation[::step] for clip in some])
    return replace(some[0], rotation=rotation, translation=translation, source=None)


def mean(q: np.ndarray) -> np.ndarray:
    """The mean rotations (J, 4) of (n, J, 4)."""
    _, vectors = np.linalg.eigh(np.einsum("fji,fjk->jik", q, q))
    return vectors[..., -1]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--data", type=Path, default=Path("data"))
    data = parser.parse_args().data
    rigs = []
    for dataset, name in SETS.items():
        own: dict[str, list[Clip]] = {}
        for entry in clips(dataset, data):
            if entry.split == "train" and not entry.trains_only:
                own.setdefault(entry.performer, []).append(entry.load())
        poses = {p: estimate(find_mapping(some[0].skeleton), pool(some)) for p, some in own.items()}
        rest = mean(np.array(list(poses.values())))
        skeleton = next(iter(own.values()))[0].skeleton
        rigs.append(
            {
                "rig": name,
                "names": list(skeleton.names),
                "directions": np.round(directions(skeleton), 3).tolist(),
                "rotation": np.round(rest, 5).tolist(),
            }
        )
        for performer, pose in poses.items():
            off = np.degrees(rotations.angle(pose, rest))
            far = f"{off.max():.1f} ({JOINTS[int(off.argmax())]})"
            print(f"{name}, {performer}: off the mean by {off.mean():.1f} degrees, at most {far}")
    RIGS.write_text(json.dumps(rigs) + "\n")
    print(f"wrote {RIGS.name}")


if __name__ == "__main__":
    main()
