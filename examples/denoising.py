"""A noisy walk, denoised: the picture of docs/results.md, and a page that plays it.

    python examples/denoising.py --out docs/pictures

The walk is the example clip (mocap.cs.cmu.edu). Noise of 6.25 cm along every axis on every joint's position,
a sigma of 1 in Kaufmann et al. 2020, is solved back into rotations of its skeleton, as a tracker would do.
"""

from __future__ import annotations

import argparse
import re
from pathlib import Path

import numpy as np

import interpose
from interpose.evaluation.denoising import UNIT, shake
from interpose.show import Take, player, strip
from interpose.skeletons import find_mapping

WALK = Path(interpose.__file__).parent / "examples" / "walk.bvh"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("docs/pictures"))
    parser.add_argument("--sigma", type=float, default=1.0, help="1 is 6.25 cm")
    given = parser.parse_args()
    clip = interpose.load(WALK)
    joints = find_mapping(clip.skeleton).mapped[1]
    noisy = shake(clip, joints, UNIT * given.sigma, np.random.default_rng(1))
    done = interpose.denoise(noisy)
    print(done.report)
    for name, one in (("noisy", noisy), ("denoised", done.clip)):
        apart = 100 * np.linalg.norm(one.positions() - clip.positions(), axis=-1).mean()
        print(f"{name}: {apart:.2f} cm from the recorded motion")
    takes = [
        Take("recorded", clip.positions(), "#64748b"),
        Take(f"noisy: {100 * UNIT * given.sigma:.4g} cm", noisy.positions(), "#dd5f28"),
        Take("denoised", done.clip.positions(), "#2463c8"),
    ]
    names, parents, everything = clip.skeleton.names, clip.skeleton.parents, [(0, len(clip))]
    title = "A walk under noise"
    drawn = strip(takes, parents, clip.fps, everything, title=title, names=names, span=(30, 110))
    given.out.mkdir(parents=True, exist_ok=True)
    path = given.out / "denoising.svg"
    path.write_text(whole(drawn), encoding="utf-8")
    takes[0] = Take("recorded", clip.positions(), "#64748b", ghost=True)
    player(takes, parents, clip.fps, [], path.with_suffix(".html"), title, names=names)
    print(f"wrote {path}, {path.with_suffix('.html')}")


def whole(drawn: str) -> str:
    """A strip all of whose frames are drawn in the color of a gap, without the gap: nothing is missing."""
    drawn = re.sub(r'<rect class="gap".*?</text>\n', "", drawn, flags=re.DOTALL)
    return drawn.replace("gray: observed, ", "")


if __name__ == "__main__":
    main()
