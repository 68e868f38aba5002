"""The figures of the field for your own predictions, whatever made them: in-betweening on LAFAN1 by the
official protocol (Harvey et al. 2020), and how rich and how near to real motion their spectra are.

    python examples/metrics.py --data data --gap 15

`mine` here draws straight lines and great arcs, so that what is printed is the row "linear" of
`interpose bench lafan1`. Put yours in its place; --split test is for final figures.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from interpose.evaluation import lafan1, spectrum
from interpose.geometry import rotations


def mine(
    rotation: np.ndarray, root: np.ndarray, target: tuple[np.ndarray, np.ndarray], count: int
) -> tuple[np.ndarray, np.ndarray]:
    """What lies between the known frames and the target.

    Args:
        rotation, root: (W, 10, 22, 4) local rotations, w x y z, and (W, 10, 3) metres, the hips: the frames
            before the gap.
        target: the same of the one frame after it, (W, 22, 4) and (W, 3).
        count: frames of the gap.

    Returns:
        (W, count, 22, 4) and (W, count, 3).
    """
    share = np.arange(1, count + 1) / (count + 1)
    turned = rotations.slerp(rotation[:, -1:], target[0][:, None], share[:, None])
    return turned, root[:, -1:] + share[:, None] * (target[1] - root[:, -1])[:, None]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--data", type=Path, default=Path("data"))
    parser.add_argument("--gap", type=int, default=15)
    parser.add_argument("--split", choices=("validation", "test"), default="validation")
    asked = parser.parse_args()

    rules, held = lafan1.PROTOCOLS["official"], lafan1.load(asked.data, asked.split)
    windows = lafan1.cut(held.sequences, rules.window(asked.gap), lafan1.STEP, held.bones)
    first, last = rules.hidden(asked.gap)
    known = windows.rotation[:, :first], windows.root[:, :first]
    said = mine(*known, (windows.rotation[:, last], windows.root[:, last]), asked.gap)

    # The metrics compare quaternions, whose sign is free: it follows the frames before.
    turned, placed = lafan1.forward(lafan1.resign(said[0], known[0][:, -1]), said[1], windows.bones)
    gap = slice(first, last)
    true_turned, true = lafan1.forward(windows.rotation[:, gap], windows.root[:, gap], windows.bones)
    print(f"{len(windows)} windows of the {asked.split} performer, gaps of {asked.gap} frames")
    print(f"L2P {lafan1.l2p(placed, true, held.statistics).mean():.4f}")
    print(f"L2Q {lafan1.l2q(turned, true_turned).mean():.4f}")
    print(f"NPSS {lafan1.npss(turned, true_turned):.5f}")
    angles, true_angles = (spectrum.joint_angles(positions) for positions in (placed, true))
    print(f"PSEnt {spectrum.psent(angles):.3f}, of the truth {spectrum.psent(true_angles):.3f}")
    both = spectrum.pskl(true_angles, angles), spectrum.pskl(angles, true_angles)
    print("PSKL(truth, mine) {:.3f}, PSKL(mine, truth) {:.3f}".format(*both))


if __name__ == "__main__":
    main()
