"""Joints that are lost, over a whole clip as in Kaufmann et al. 2020, figure 8, and frame by frame.

    python examples/recovering.py --data data --out docs/pictures

Both clips are the first four seconds of CMU trials of a test performer (mocap.cs.cmu.edu), at 30 fps. In the
first one the rotations of the upper arm and of the forearm are unknown, so that it is not known where elbow
and hand are: `recover` does that. There is nothing to interpolate: the spline gives the rest pose. In the
second one the positions of both knees and of a toe are unknown, as if trackers had been lost, but not those
of the feet. Rotations cannot say that: it is the network alone, and bones have the length that it gives them.

The table that is printed is of windows of validation performers in which each rotation but the root's is
unknown in each frame with probability p, completed through an `Observation`: what the method says, and the
finished motion.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from pathlib import Path

import numpy as np

import interpose
from interpose.datasets import clips
from interpose.evaluation.table import markdown
from interpose.evaluation.windows import Window, windows
from interpose.methods import weights
from interpose.methods.cae import run_long
from interpose.observation.corruption import joints_per_frame_mask
from interpose.resampling import resample
from interpose.show import Take, sheet, strip
from interpose.skeletons import JOINTS, PARENTS, find_humanoid

FRAMES = 120
WALK, ARM, HAND = "49_01", ("LeftArm", "LeftForeArm"), ("LeftForeArm", "LeftHand")  # rotations, positions
JUMPS, KNEES = "49_02", ("RightLeg", "RightToe", "LeftLeg")
COLORS = ("#64748b", "#2463c8", "#dd5f28")
METHODS, SHARES = ("auto", "cae", "spline"), (0.3, 0.5)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, required=True, help="the folder that holds the data sets")
    parser.add_argument("--out", type=Path, default=Path("docs/pictures"))
    parser.add_argument("--most", type=int, default=3, help="windows a data set in the table")
    given = parser.parse_args()
    walk, jumps = load(given.data, WALK), load(given.data, JUMPS)
    arms = {
        "truth": walk,
        "recovered": interpose.recover(walk, ARM).clip,
        "rest pose": interpose.recover(walk, ARM, method="spline").clip,
    }
    body = find_humanoid(walk)
    pictures = [
        draw("Left elbow and left hand lost", {name: body.as_canonical(c) for name, c in arms.items()}, HAND)
    ]
    truth = find_humanoid(jumps).as_canonical(jumps)
    seen = np.broadcast_to(~np.isin(JOINTS, KNEES), truth.shape[:2])
    *_, completed = run_long(weights.find("cae").onnx, truth, seen)
    words = "Right knee, right toe and left knee lost"
    pictures.append(draw(words, {"truth": truth, "recovered": completed}, KNEES))
    path = given.out / "recovering.svg"
    sheet(pictures, path)
    print(f"wrote {path}\n\n{table(given.data, given.most)}")


def load(data: Path, trial: str) -> interpose.Clip:
    entry = next(one for one in clips("cmu", data, "test") if one.path.stem == trial)
    return resample(entry.load(), 30).slice(0, FRAMES)


def draw(title: str, takes: dict[str, np.ndarray], lost: tuple[str, ...]) -> str:
    """Canonical positions (F, 22, 3) by name as a strip; prints how far lost joints are off, on that body."""
    truth, rows = takes["truth"], [JOINTS.index(name) for name in lost]
    for name, positions in takes.items():
        if positions is not truth:
            off = 100 * np.linalg.norm((positions - truth)[:, rows], axis=-1).mean(axis=0)
            joints = ", ".join(f"{joint} {cm:.1f}" for joint, cm in zip(lost, off))
            print(f"{title}, {name}: {off.mean():.1f} cm ({joints})")
    gap = interpose.Gap(0, FRAMES, lost)
    drawn = [Take(name, positions, color) for (name, positions), color in zip(takes.items(), COLORS)]
    return strip(drawn, PARENTS, 30.0, [gap], title=title, names=JOINTS, count=12)


def table(data: Path, most: int) -> str:
    """Mean joint errors by method and probability, and what fell back."""
    figures: dict[tuple[str, float], list[tuple[float, float, float]]] = defaultdict(list)
    for number, window in enumerate(windows(data, ("lafan1", "bandai"), "validation", most=most)):
        for share in SHARES:
            shape = window.clip.rotation.shape[:2]
            known = joints_per_frame_mask(np.random.default_rng(number), 1, *shape, share)[0]
            observation = interpose.Observation(known, np.ones_like(known))
            for method in METHODS:
                done = interpose.fill(window.clip, observation, method=method)
                figures[method, share].append(judged(window, done))
    means = {key: np.mean(some, axis=0) for key, some in figures.items()}
    cell = "{:.2f}, {:.2f}, {:.0f} %"
    lines = [[method, *(cell.format(*means[method, share]) for share in SHARES)] for method in METHODS]
    head = [
        "cm as the method says it, cm finished, gaps by the spline",
        *(f"p {share:g}" for share in SHARES),
    ]
    return markdown(head, lines)


def judged(window: Window, done: interpose.Completion) -> tuple[float, float, float]:
    """Mean error of the mapped joints in cm, as the method says it and finished; % of gaps by the spline."""
    joints = list(window.body.mapping.mapped[1])
    raw, truth = done.raw, window.clip.positions()[:, joints]
    said = raw.clip.positions()[:, joints] if raw.positions is None else raw.positions
    finished = done.clip.positions()[:, joints]
    said_off, finished_off = (
        100 * float(np.linalg.norm(one - truth, axis=-1).mean()) for one in (said, finished)
    )
    splines = [gap.method == "spline" for gap in done.report.gaps]
    return said_off, finished_off, 100 * float(np.mean(splines))


if __name__ == "__main__":
    main()
