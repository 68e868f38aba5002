"""Table 2 of Kaufmann et al. 2020 at 30 fps, as users meet it: noise in a clip on its own skeleton.

Windows of 120 frames of held-out performers. Noise of 6.25 cm times sigma is added to the joints' positions,
which are solved back into rotations of the skeleton, because a file holds those; or each joint but the root
snaps to its rest pose in each frame with probability p; or every rotation trembles. Mean and standard
deviation over all joints and frames of the 3-D error in centimetres, before and after denoising; nothing is
told about the noise. The paper's own figures are errors of positions that were never on a skeleton: `noise`
measures networks as it does.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from interpose.clip import Clip
from interpose.evaluation.table import markdown
from interpose.evaluation.windows import DATASETS, Window, windows
from interpose.finish.denoise import denoised
from interpose.finish.solve import solve
from interpose.geometry import rotations
from interpose.observation import Observation
from interpose.observation.corruption import gaussian_noise, joints_per_frame_mask

UNIT = 0.0625  # metres: sigma 1
# The paper's figures in cm: Holden et al. and its own network.
PAPER = {"sigma 1.0": (5.0, 5.8), "sigma 1.5": (6.6, 7.8), "p .3": (6.5, 3.1), "p .5": (9.5, 4.0)}


def shake(clip: Clip, joints: tuple[int, ...], sigma: float, rng: np.random.Generator) -> Clip:
    """The clip with noise N(0, sigma^2), in metres, on each coordinate of the positions of some joints."""
    nothing = Observation(*np.zeros((2, *clip.rotation.shape[:2]), bool))
    return solve(clip, nothing, joints, gaussian_noise(rng, clip.positions()[:, list(joints)], sigma))


def drop(clip: Clip, probability: float, rng: np.random.Generator) -> Clip:
    """The clip with the rest pose in place of rotations, of each joint but the first and in each frame."""
    kept = joints_per_frame_mask(rng, 1, len(clip), len(clip.skeleton), probability)[0]
    rest = np.where(kept[..., None], clip.rotation, clip.skeleton.rest_rotation)
    return clip.with_motion(rest, clip.translation)


def tremble(clip: Clip, degrees: float, rng: np.random.Generator) -> Clip:
    """The clip with every local rotation turned by N(0, degrees^2) about each axis."""
    turns = np.radians(degrees) * rng.standard_normal((*clip.rotation.shape[:2], 3))
    return clip.with_motion(rotations.multiply(clip.rotation, rotations.exp(turns)), clip.translation)


def _shaken(sigma: float) -> Callable[[Window, np.random.Generator], Clip]:
    return lambda window, rng: shake(window.clip, window.body.mapping.mapped[1], UNIT * sigma, rng)


ROWS: dict[str, Callable[[Window, np.random.Generator], Clip]] = {
    "clean": lambda window, rng: window.clip,
    "sigma .5": _shaken(0.5),
    "sigma 1.0": _shaken(1.0),
    "sigma 1.5": _shaken(1.5),
    "p .3": lambda window, rng: drop(window.clip, 0.3, rng),
    "p .5": lambda window, rng: drop(window.clip, 0.5, rng),
    "rotations 5 degrees": lambda window, rng: tremble(window.clip, 5.0, rng),
}


@dataclass
class Denoising:
    """The figures: `errors[dataset][row]` holds every window's (sum, sum of squares, count) in cm, before and
    after."""

    split: str
    counts: dict[str, int] = field(default_factory=lambda: defaultdict(int))
    errors: dict[str, dict[str, list[np.ndarray]]] = field(
        default_factory=lambda: defaultdict(lambda: defaultdict(list))
    )

    def add(self, window: Window, row: str, before: Clip, after: Clip) -> None:
        """Count a window of a row, by its clips before and after denoising."""
        wrong = [
            100 * np.linalg.norm(window.canonical(clip) - window.positions, axis=-1)
            for clip in (before, after)
        ]
        figures = np.array([(e.sum(), (e**2).sum(), e.size) for e in wrong])
        for group in (window.dataset, "all"):
            self.errors[group][row].append(figures)

    def figures(self, group: str, row: str) -> np.ndarray:
        """(2, 2) mean and standard deviation in cm, before and after."""
        total, squares, count = np.sum(self.errors[group][row], axis=0).T
        mean = total / count
        return np.stack([mean, np.sqrt(np.maximum(squares / count - mean**2, 0.0))], axis=1)

    def to_dict(self) -> dict[str, Any]:
        def entry(group: str, row: str) -> dict[str, Any]:
            before, after = self.figures(group, row).tolist()
            return {name: dict(zip(("mean", "std"), v)) for name, v in (("before", before), ("after", after))}

        return {
            "protocol": "Kaufmann et al. 2020, table 2, at 30 fps, on skeletons",
            "split": self.split,
            "windows": dict(self.counts),
            "unit": "cm",
            "errors": {group: {row: entry(group, row) for row in ROWS} for group in self.errors},
        }

    def table(self, group: str = "all") -> str:
        """A Markdown table: mean error and deviation in cm, before and after, their ratio, the paper's."""
        lines = []
        for row in ROWS:
            before, after = self.figures(group, row)
            ratio = f"{after[0] / before[0]:.3f}" if before[0] > 1e-9 else "-"
            cells = [f"{mean:.2f} ± {std:.1f}" for mean, std in (before, after)]
            paper = ", ".join(map(str, PAPER.get(row, "-")))
            lines.append([row, *cells, ratio, paper])
        head = ["", "noisy", "denoised", "ratio", "paper: Holden et al., CAE"]
        return markdown(head, lines)

    def __str__(self) -> str:
        parts = [
            f"{group} ({self.counts[group]} windows, {self.split})\n\n{self.table(group)}"
            for group in self.errors
        ]
        return "\n\n".join([*parts, "Mean ± standard deviation of the joint error in cm."])


def run(
    data: Path,
    split: str = "validation",
    most: int | None = None,
    progress: Callable[[float, str], None] = lambda share, line: None,
) -> Denoising:
    """Measure all rows on the windows of a split; the same noise every time.

    Args:
        data: the folder that holds lafan1/ and bandai/.
        split: "validation", or "test" for final figures.
        most: windows per data set; None for all.
    """
    result = Denoising(split)
    chosen = list(windows(data, DATASETS, split, most=most, progress=lambda line: progress(0.0, line)))
    for done, window in enumerate(chosen):
        result.counts[window.dataset] += 1
        result.counts["all"] += 1
        for number, (row, spoil) in enumerate(ROWS.items()):
            noisy = spoil(window, np.random.default_rng((done, number)))
            result.add(window, row, noisy, denoised(noisy, 1.0).clip)
        progress((done + 1) / len(chosen), f"{done + 1} of {len(chosen)} windows")
    return result
