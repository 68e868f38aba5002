"""How motions go on, as in Hernandez Ruiz et al. 2019: figures 3, 5 and 6, and what injected noise changes.

    python examples/forecasting.py --data data --out docs/pictures

Four seconds from the middle of four trials of test performers of CMU (mocap.cs.cmu.edu), of different kinds
and long enough. Two seconds are known and two follow: by the networks that are installed, and by the last
pose held. The picture is of stick figures over time. Where weights of `stmi-gan` are installed, a second one
shows what its frame encoder makes of the first motion when the second half is hidden (it needs the extra
`train`), and the table that is printed is of five samples a trial: by how much they lie apart, as a deviation
of joints, at which temperature.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

import interpose
from interpose.datasets import clips
from interpose.evaluation.table import markdown
from interpose.methods import weights
from interpose.resampling import resample
from interpose.show import Take, image, sheet, strip
from interpose.skeletons import JOINTS, PARENTS, find_humanoid

SEEN = 60  # frames, and as many follow
TRIALS = ("16_16", "49_02", "49_08", "49_20")
COLORS = {
    "truth": "#64748b",
    "stmi-gan": "#2463c8",
    "small": "#16a34a",
    "cae": "#9333ea",
    "zero-velocity": "#dd5f28",
}
TEMPERATURES, HORIZONS = (0.5, 1.0, 2.0, 4.0), (0.5, 1.0, 2.0)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, required=True, help="the folder that holds the data sets")
    parser.add_argument("--out", type=Path, default=Path("docs/pictures"))
    given = parser.parse_args()
    motions = {trial: load(given.data, trial) for trial in TRIALS}
    pictures = [draw(f"CMU {trial}", motion) for trial, motion in motions.items()]
    sheet(pictures, given.out / "forecasting.svg")
    print(f"wrote {given.out / 'forecasting.svg'}")
    if "stmi-gan" in interpose.method_names():
        embedded(next(iter(motions.values())), given.out / "embedding.svg")
        print(f"wrote {given.out / 'embedding.svg'}\n\n{table(motions)}")


def load(data: Path, trial: str) -> interpose.Clip:
    """Four seconds from the middle of a trial at 30 fps."""
    entry = next(one for one in clips("cmu", data, "test") if one.path.stem == trial)
    clip = resample(entry.load(), 30)
    start = max((len(clip) - 2 * SEEN) // 2, 0)
    return clip.slice(start, start + 2 * SEEN)


def draw(title: str, clip: interpose.Clip) -> str:
    """The truth, networks' forecasts and the last pose held, on the canonical body; prints errors."""
    body, known, count = find_humanoid(clip), clip.slice(0, SEEN), len(clip) - SEEN
    takes = {"truth": clip}
    methods = [name for name in COLORS if name in interpose.method_names()]
    takes |= {name: interpose.forecast(known, count, method=name).clip for name in methods}
    placed = {name: body.as_canonical(take) for name, take in takes.items()}
    for name in [*placed][1:]:
        off = 100 * np.linalg.norm(placed[name] - placed["truth"], axis=-1)[SEEN:].mean()
        print(f"{title}, {name}: {off:.1f} cm over the {count / 30:g} s that follow")
    drawn = [Take(name, positions, COLORS[name]) for name, positions in placed.items()]
    gap = (SEEN, len(clip))
    return strip(drawn, PARENTS, 30.0, [gap], title=title, names=JOINTS, count=16, span=(SEEN - 20, gap[1]))


def embedded(clip: interpose.Clip, path: Path) -> None:
    """What the frame encoder writes of a motion whose second half is hidden (figure 3)."""
    import torch

    from interpose.models.stmi_gan import Frame
    from interpose.training.stmi_gan import trained

    model = trained(weights.find("stmi-gan"))
    every = len(clip) // model.config.frames
    motion = torch.from_numpy(find_humanoid(clip).as_canonical(clip)[::every]).float()[None]
    observed = torch.ones_like(motion, dtype=torch.bool)
    observed[:, SEEN // every :] = False
    with torch.no_grad():
        aligned = Frame.of(motion, observed).align(motion)
        rows = model.write(aligned, observed)[0].numpy().T
    rows = (rows - rows.mean()) / rows.std()
    fps = model.config.fps / model.config.together
    image(rows, np.ones(rows.shape, bool), fps, path, "What the frame encoder writes; hidden from 2 s on")


def table(motions: dict[str, interpose.Clip]) -> str:
    """By how many cm five samples lie apart, by temperature and seconds since the last known pose."""
    lines = []
    for temperature in TEMPERATURES:
        spreads = [
            interpose.forecast(
                clip.slice(0, SEEN), SEEN, samples=5, method="stmi-gan", seed=1, temperature=temperature
            ).spread()
            for clip in motions.values()
        ]
        apart = np.mean(spreads, axis=0)
        lines.append([f"{temperature:g}", *(f"{apart[round(30 * s) - 1]:.2f}" for s in HORIZONS)])
    return markdown(["temperature", *(f"{s:g} s" for s in HORIZONS)], lines)


if __name__ == "__main__":
    main()
