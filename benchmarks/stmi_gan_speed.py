"""Time of STMI-GAN on one CPU thread: one pass, in which the second half of a window follows from the first.

python benchmarks/stmi_gan_speed.py
"""

from __future__ import annotations

import time

import numpy as np

from interpose.methods import stmi_gan, weights


def main() -> None:
    card = weights.find("stmi-gan")
    frames = card.training["network"]["frames"]
    positions = np.random.default_rng(0).standard_normal((1, frames, 22, 3))
    observed = np.ones(positions.shape, bool)
    observed[:, frames // 2 :] = False
    stmi_gan.run(card, positions, observed)
    spent = []
    for _ in range(101):
        start = time.perf_counter()
        stmi_gan.run(card, positions, observed)
        spent.append(time.perf_counter() - start)
    half = frames / 2 / card.fps
    print(f"{half:g} s that follow from {half:g} s: {1000 * np.median(spent):.1f} ms (median)")


if __name__ == "__main__":
    main()
