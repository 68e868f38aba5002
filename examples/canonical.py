"""The same canonical figure from every data set: walks as pictures, and how far mean rotations are apart.

    python examples/canonical.py --data data --out docs/pictures

From each set the frames of people who walk ahead, upright and at an even pace are taken. What is printed is
how far the mean canonical rotations of their joints are apart, relative to where the body faces, in degrees;
beside it how far single walks of one set are from its own mean, and how far LAFAN1 and PFNN, which share a
skeleton, are apart with one T-pose for both, so that only people differ. The picture shows the walk nearest
to each set's mean. HDM05's classes that were at hand hold no walk. With --own each walk tells the T-pose of
its rig anew, as for rigs of which none is known, and no picture is drawn.
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
from interpose.skeletons.rest import Rest, estimate

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


def walks(
    name: str, data: Path, rest: Rest | None = None, own: bool = False
) -> tuple[np.ndarray, np.ndarray | None]:
    """Mean rotations (W, 22, 4) of a set's walks; positions (FRAMES, 22, 3) of the one nearest to their mean.

    rest: the T-pose, where it shall not be found for each clip; own: worked out anew where it is a known one.
    """
    entries = [e for e in clips(name, data) if e.split != "test" and (name != "bandai" or "walk" in e.label)]
    found, shown = [], []
    for i in np.linspace(0, len(entries) - 1, min(CLIPS, len(entries))).astype(int):
        clip = at_30(entries[i].load())
        body = find_humanoid(clip, rest)
        if own and body.rest.how == "rig":
            body = find_humanoid(clip, Rest(estimate(body.mapping, clip), body.rest.pose, "motion"))
        points = body.positions(clip) * body.scale
        yaw = facing(points)
        steady = walking(points, yaw)
        if steady.sum() < 20:
            continue
        turned = rotations.multiply(rotations.about("Y", -yaw)[:, None], body.rotations(clip))
        found.append(mean(turned[steady]))
        first = int(np.argmax(ndimage.binary_erosion(steady, np.ones(FRAMES), origin=-(FRAMES // 2))))
        part = slice(first, first + FRAMES)
        if steady[part].sum() == FRAMES:
            way = np.stack([0 * yaw[part], points[part, 0, 1], np.arange(FRAMES) * 1.2 / 30], axis=-1)
            shown.append((found[-1], canonical_positions(turned[part], way, BONES)))
    middle = mean(np.array(found))
    nearest = min(shown, key=lambda one: float(rotations.angle(one[0], middle).mean()), default=None)
    return np.array(found), nearest[1] if nearest else None


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, required=True, help="the folder that holds the data sets")
    parser.add_argument("--out", type=Path, default=Path("docs/pictures"))
    parser.add_argument("--own", action="store_true", help="T-poses that each walk tells by itself")
    given = parser.parse_args()
    means, spread, takes = {}, [], []
    for name, color in SETS.items():
        found, shown = walks(name, given.data, own=given.own)
        means[name] = mean(found)
        spread.append(np.degrees(rotations.angle(found, means[name])).mean(axis=0))
        print(f"{name}: {len(found)} walks")
        if shown is not None:
            takes.append(Take(name, shown, color))
    if not given.own:
        given.out.mkdir(parents=True, exist_ok=True)
        title = "One figure, walks of four data sets"
        strip(takes, PARENTS, 30, [], given.out / "canonical.svg", title, names=JOINTS)
    # PFNN's clips are on LAFAN1's skeleton: with one T-pose for both, what is left is how people walk.
    first = clips("lafan1", given.data, "train")[0]
    rest = find_humanoid(at_30(first.load())).rest
    same = [mean(walks(name, given.data, rest)[0]) for name in ("lafan1", "pfnn")]
    people = np.degrees(rotations.angle(*same))
    print("\n| joint | furthest apart | between | walks of one set | LAFAN1 and PFNN, one T-pose |")
    print("| --- | ---: | --- | ---: | ---: |")
    for j, joint in enumerate(JOINTS):
        apart = {
            (a, b): float(np.degrees(rotations.angle(means[a][j], means[b][j])))
            for a in means
            for b in means
            if a < b
        }
        worst = max(apart, key=lambda pair: apart[pair])
        within = np.mean([held[j] for held in spread])
        between = ", ".join(worst)
        print(f"| {joint} | {apart[worst]:.0f} | {between} | {within:.0f} | {people[j]:.0f} |")


if __name__ == "__main__":
    main()
