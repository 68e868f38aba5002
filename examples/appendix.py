"""Figure 12 of Kaufmann et al. 2020: transitions that short seeds of different kinds of motion force.

    python examples/appendix.py --data data --out docs/pictures

The seeds are of performers that are never trained or selected on, at 30 fps: LAFAN1's subject 5, CMU's
subject 49 (mocap.cs.cmu.edu) and HDM05's tr (Müller et al. 2007). They stand in a table below, by name and
range, and were chosen by what they show, not by what comes of them. Where the paper has a motion that no test
performer does, the nearest one stands for it. Two seconds lie between two seeds. Writes appendix12.svg, and
to --clip a motion for each picture, with a page that plays it.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from figure1 import GAP, told, write

import interpose
from interpose.datasets import clips
from interpose.datasets.catalogue import FPS
from interpose.resampling import resample
from interpose.show import Take, sheet, strip


@dataclass(frozen=True)
class Seed:
    """Frames start to stop - 1 of a clip of a test performer, and what they show."""

    dataset: str
    name: str
    start: int
    stop: int
    shows: str


@dataclass(frozen=True)
class Constraint:
    """The joints of a seed, and the number of the gap in whose middle they are laid, from 1."""

    seed: Seed
    gap: int
    joints: tuple[str, ...]


def lafan1(name: str, start: int, stop: int, shows: str) -> Seed:
    return Seed("lafan1", f"{name}_subject5", start, stop, shows)


def cmu(name: str, start: int, stop: int, shows: str) -> Seed:
    return Seed("cmu", name, start, stop, shows)


def hdm05(name: str, start: int, stop: int, shows: str) -> Seed:
    return Seed("hdm05", f"HDM_tr_{name}_120", start, stop, shows)


ARM = ("rclavicle", "rhumerus", "rradius", "rwrist", "rhand")
PICTURES: dict[str, tuple[Seed, ...]] = {
    "a": (
        hdm05("hopBothLegs1hops_034", 0, 28, "a hop"),
        hdm05("depositFloorR_027", 18, 53, "bending to the floor"),
    ),
    "b": (
        lafan1("fallAndGetUp1", 1482, 1515, "sitting on the floor"),
        lafan1("run1", 300, 345, "a run"),
    ),
    "c": (
        cmu("49_10", 20, 80, "dancing"),
        cmu("49_02", 207, 240, "a squat"),
    ),
    "d": (
        lafan1("ground1", 4110, 4170, "lying on the floor"),
        lafan1("fallAndGetUp1", 120, 165, "a walk"),
    ),
    # The paper: jumping jacks.
    "e": (
        hdm05("elbowToKnee1RepsLelbowStart_024", 0, 44, "elbow to knee"),
        hdm05("sneak2StepsLStart_014", 0, 47, "large steps"),
    ),
    "f": (
        hdm05("jogLeftCircle4StepsRstart_014", 20, 62, "a jog"),
        hdm05("kickLFront1Reps_025", 0, 46, "a kick"),
        hdm05("sneak2StepsLStart_015", 0, 48, "sneaking"),
    ),
}
# The paper: a grab and a punch.
CONSTRAINTS = {
    "f": (
        Constraint(hdm05("grabHighR_024", 20, 36, "the arm of a grab"), 1, ARM),
        Constraint(hdm05("throwBasketball_012", 95, 110, "of a throw"), 2, ARM),
    )
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, required=True, help="the folder that holds the data sets")
    parser.add_argument("--out", type=Path, default=Path("docs/pictures"))
    parser.add_argument("--clip", type=Path, help="a folder for the motions, too: 12a.bvh, ...")
    parser.add_argument("--method", default="auto")
    given = parser.parse_args()
    strips = []
    for letter, seeds in PICTURES.items():
        done = interpose.stitch([load(given.data, seed) for seed in seeds], GAP, method=given.method)
        filled = [(gap.start, gap.stop) for gap in done.report.gaps]
        takes = [Take("filled", done.clip.positions(), "#2463c8")]
        title = f"({letter}) " + ", ".join(seed.shows for seed in seeds)
        print(f"{title}\n{told(done)}")
        if laid := CONSTRAINTS.get(letter, ()):
            parts = [part(given.data, one, filled[one.gap - 1]) for one in laid]
            done = interpose.fill(done.clip, filled, method=given.method, parts=parts)
            words = " and ".join(one.seed.shows for one in laid)
            takes.append(Take(f"with {words}", done.clip.positions(), "#8a4fbf"))
            print(f"with {words}\n{told(done)}")
        names, parents = done.clip.skeleton.names, done.clip.skeleton.parents
        whole, count = (0, len(done.clip)), 7 + 7 * len(filled)
        strips.append(strip(takes, parents, FPS, filled, title=title, names=names, count=count, span=whole))
        if given.clip:
            given.clip.mkdir(parents=True, exist_ok=True)
            write(done, given.clip / f"12{letter}.bvh")
    path = given.out / "appendix12.svg"
    sheet(strips, path)
    print(f"wrote {path}")


def load(data: Path, seed: Seed) -> interpose.Clip:
    """The frames of a seed."""
    return whole(data, seed.dataset, seed.name).slice(seed.start, seed.stop)


@cache
def whole(data: Path, dataset: str, name: str) -> interpose.Clip:
    """A clip of a test performer, at 30 fps."""
    entry = next(one for one in clips(dataset, data, "test") if one.path.stem == name)
    return resample(entry.load(), FPS)


def part(data: Path, one: Constraint, gap: tuple[int, int]) -> interpose.Part:
    """A constraint, laid in the middle of its gap."""
    length = one.seed.stop - one.seed.start
    at = (gap[0] + gap[1] - length) // 2
    return interpose.Part(load(data, one.seed), 0, length, at, one.joints)


if __name__ == "__main__":
    main()
