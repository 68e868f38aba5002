"""The same canonical figure from every data set: walks as pictures, and how far mean rotations are apart.

    python examples/canonical.py --data data --out docs/pictures

From each set the frames of people who walk ahead, upright and at an even pace are taken. What is printed is
how far the mean canonical rotations of their joints are apart, relative to where the body faces, in degrees;
beside it how far single walks of one set are from its own mean. The picture shows the walk nearest to each
set's mean. HDM05's classes that were at hand hold no walk.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from scipy import ndimage

from interpose.clip import Clip
from interpose.datasets import clips
from interpose.geometry import rotations
from interpose.show import Take, strip
from interpose.skeletons import BONES, JOINTS, PARENTS, canonical_positions, find_humanoid
from interpose.skeletons.body import facing

SETS = {"lafan1": "#2463c8", "pfnn": "#dd5f28", "cmu": "#2a9d5c", "bandai": "#8a4fbf"}
FRAMES = 48  # of the picture
CLIPS = 40  # as many of each set, spread over it


def mean(q: np.ndarray) -> np.ndarray:
    """The mean rotations (J, 4) of (F, J, 4)."""
    _, vectors = np.linalg.eigh(np.einsum("fji,fjk->jik", q, q))
    return vectors[..., -1]


def walking(points: np.ndarray, yaw: np.ndarray) -> np.ndarray:
    """(F,) where someone walks ahead, upright, with long legs and an even pace (points of a usual body)."""
    velocity = 30 * np.gradient(points[:, 0], axis=0)
    ahead = velocity[:, 0] * np.sin(yaw) + velocity[:, 2] * np.cos(yaw)
    turning = 30 * np.abs(np.gradient(np.unwrap(yaw)))
    feet = points[:, [JOINTS.index("LeftFoot"), JOINTS.index("RightFoot")], 1].min(axis=1)
    trunk = rotations.normalize(points[:, JOINTS.index("Head")] - points[:, 0])[:, 1]
    steady = (
        (ahead > 0.7) & (ahead < 1.8) & (turning < 0.8) & (points[:, 0, 1] - feet > 0.79) & (trunk > 0.93)
    )
    return ndimage.binary_opening(steady, np.ones(20))


def at_30(clip: Clip) -> Clip:
    step = max(1, round(clip.fps / 30))
    return clip.with_motion(clip.rotation[::step], clip.translation[::step])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, required=True, help="the folder that holds the data sets")
    parser.add_argument("--out", type=Path, default=Path("docs/pictures"))
    given = parser.parse_args()
    means: dict[str, np.ndarray] = {}
    spread: dict[str, np.ndarray] = {}
    takes = []
    for name, color in SETS.items():
        walks, shown = [], []
        entries = [e for e in clips(name, given.data) if e.split != "test"]
        entries = [e for e in entries if name != "bandai" or "walk" in e.label]
        for entry in [
            entries[i] for i in np.linspace(0, len(entries) - 1, min(CLIPS, len(entries))).astype(int)
        ]:
            clip = at_30(entry.load())
            body = find_humanoid(clip)
            points = body.positions(clip) * body.scale
            yaw = facing(points)
            steady = walking(points, yaw)
            if steady.sum() < 20:
                continue
            turned = rotations.multiply(rotations.about("Y", -yaw)[:, None], body.rotations(clip))
            walks.append(mean(turned[steady]))
            first = int(np.argmax(ndimage.binary_erosion(steady, np.ones(FRAMES), origin=-(FRAMES // 2))))
            part = slice(first, first + FRAMES)
            if steady[part].sum() == FRAMES:
                way = np.stack([0 * yaw[part], points[part, 0, 1], np.arange(FRAMES) * 1.2 / 30], axis=-1)
                shown.append((walks[-1], canonical_positions(turned[part], way, BONES)))
        means[name] = mean(np.array(walks))
        spread[name] = np.degrees(rotations.angle(np.array(walks), means[name])).mean(axis=0)
        print(f"{name}: {len(walks)} walks")
        if shown:
            nearest = min(shown, key=lambda walk: float(rotations.angle(walk[0], means[name]).mean()))
            takes.append(Take(name, nearest[1], color))
    given.out.mkdir(parents=True, exist_ok=True)
    title = "One figure, walks of four data sets"
    strip(takes, PARENTS, 30, [], given.out / "canonical.svg", title, names=JOINTS)
    print("\n| joint | furthest apart | between | spread within a set |\n| --- | ---: | --- | ---: |")
    for j, joint in enumerate(JOINTS):
        apart = {
            (a, b): float(np.degrees(rotations.angle(means[a][j], means[b][j])))
            for a in means
            for b in means
            if a < b
        }
        worst = max(apart, key=lambda pair: apart[pair])
        within = np.mean([held[j] for held in spread.values()])
        print(f"| {joint} | {apart[worst]:.0f} | {worst[0]}, {worst[1]} | {within:.0f} |")


if __name__ == "__main__":
    main()
