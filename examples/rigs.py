"""One motion on the skeletons of four rigs.

    python examples/rigs.py --data data --out docs/pictures

A jump of a CMU test performer (mocap.cs.cmu.edu), and the same on a rig with fingers, on LAFAN1's and on
Bandai-Namco's (`interpose convert jump.bvh mine.bvh --onto rig.bvh`). What is printed says how far toes go
in a second that stand (slower than 5 cm a second), and how far the motion is off once it is put back.
"""

from __future__ import annotations

import argparse
from importlib import resources
from pathlib import Path

import numpy as np
from denoising import whole

import interpose
from interpose.resampling import resample
from interpose.show import Take, strip
from interpose.show.sheet import sheet
from interpose.skeletons import JOINTS, find_humanoid, find_mapping

BANDAI = "bandai/Bandai-Namco-Research-Motiondataset-1/data/dataset-1_walk_normal_001.bvh"
TRIAL, SHOWN = "49/49_02.bvh", (30, 120)
RIGS = {
    "a rig with fingers": resources.files("interpose") / "examples" / "fingers.bvh",
    "the rig of LAFAN1": "lafan1/bvh/walk3_subject5.bvh",
    "the rig of Bandai-Namco": BANDAI,
}
TOES = [JOINTS.index("LeftToe"), JOINTS.index("RightToe")]
STANDS = 0.05  # metres a second
OWN, OTHER = "#64748b", "#d1495b"


def speeds(clip: interpose.Clip) -> np.ndarray:
    """(F - 1, 2) metres a second of the toes, of a body with the canonical leg."""
    body = find_humanoid(clip)
    places = body.positions(clip)[:, TOES] * body.scale
    return np.asarray(np.linalg.norm(np.diff(places, axis=0), axis=-1) * clip.fps)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--data", type=Path, required=True, help="the folder that holds cmu/, lafan1/, bandai/"
    )
    parser.add_argument("--out", type=Path, default=Path("docs/pictures"))
    given = parser.parse_args()
    clip = interpose.load(given.data / "cmu" / "bvh" / TRIAL)
    clip = resample(clip.slice(1, len(clip)), 30)
    stands = speeds(clip) < STANDS
    mapped = list(find_mapping(clip.skeleton).mapped[1])
    made = {"its own rig": clip}
    print(f"its own rig: {100 * speeds(clip)[stands].mean():.1f} cm/s")
    for name, file in RIGS.items():
        made[name] = interpose.retarget(clip, interpose.load(Path(str(given.data / str(file)))))
        back = interpose.retarget(made[name], clip).positions() - clip.positions()
        off = 100 * np.linalg.norm(back, axis=-1)[:, mapped].mean()
        print(f"{name}: {100 * speeds(made[name])[stands].mean():.1f} cm/s, {off:.1f} cm off once it is back")
    given.out.mkdir(parents=True, exist_ok=True)
    sheet(
        [drawn(name, one, OWN if one is clip else OTHER) for name, one in made.items()],
        given.out / "rigs.svg",
    )
    print(f"wrote {given.out / 'rigs.svg'}")


def drawn(name: str, clip: interpose.Clip, color: str) -> str:
    """The mapped joints of a clip as a strip."""
    rows, mapped = find_mapping(clip.skeleton).mapped
    take = Take(name, clip.positions()[:, list(mapped)], color)
    title, names = f"CMU 49_02 on {name}", [JOINTS[row] for row in rows]
    every = [(0, len(clip))]
    return whole(
        strip([take], parents(clip), clip.fps, every, title=title, names=names, count=10, span=SHOWN)
    )


def parents(clip: interpose.Clip) -> list[int]:
    """Of the mapped joints, the next mapped one above each."""
    mapped = list(find_mapping(clip.skeleton).mapped[1])
    above = [[joint for joint in clip.skeleton.ancestors(one) if joint in mapped] for one in mapped]
    return [mapped.index(line[0]) if line else -1 for line in above]


if __name__ == "__main__":
    main()
