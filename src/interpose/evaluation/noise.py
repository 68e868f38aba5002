"""Table 2 of Kaufmann et al. 2020 at 30 fps, in the paper's conditions: networks on disturbed positions.

400 windows of 120 frames (4 s) of held-out performers, drawn at random, as positions of the canonical body,
which is as large as LAFAN1's actors. Either noise N(0, sigma^2) is added to the position of every joint, with
6.25 cm at sigma 1, or each joint but the hips is unknown in each frame with probability p: 0 after
normalisation. Each network answers once to a window, is told nothing about the noise, and is not finished.
Mean and standard deviation over frames and joints, without the hips, of the 3-D error in centimetres.

Positions are disturbed in the body's frame: hips over the origin, facing ahead. The trajectory has rows of
its own and is known as it is, in the paper as here, so errors in that frame are those on the true trajectory.
Were hips and facing found from noisy positions, the input would be off by 14 instead of 10 cm at sigma 1; and
at p .5 most frames would be lost, as neither both hips nor both shoulders are known. What users meet is
measured by `denoising`.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from interpose.evaluation.denoising import PAPER, UNIT
from interpose.evaluation.infilling import in_words, origin
from interpose.evaluation.occlusion import linear
from interpose.evaluation.table import markdown
from interpose.evaluation.windows import DATASETS, windows
from interpose.geometry.ground import turn
from interpose.methods.weights import Card
from interpose.observation.corruption import gaussian_noise, joints_per_frame_mask
from interpose.skeletons import JOINTS
from interpose.skeletons.body import facing

WINDOWS = 400
SEED = 0
BATCH = 32  # windows that a network is given at once
# The paper's columns: the standard deviation of noise in metres, and the share of joints that are lost.
COLUMNS = {
    "sigma 1.0": (UNIT, 0.0),
    "sigma 1.5": (1.5 * UNIT, 0.0),
    "p .3": (0.0, 0.3),
    "p .5": (0.0, 0.5),
}
INPUT = "input, lost joints by linear interpolation"

# From undisturbed positions (B, T, 22, 3), noise (B, T, 22, 3) on them in the body's frame, and which joints
# are kept (B, T, 22), to poses (B, T, 22, 3) in the body's frame; all in metres.
Network = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]


@dataclass
class Noise:
    """The figures.

    Attributes:
        split: whose windows.
        cards: the weights behind each row of a network.
        windows: how many were drawn.
        errors: by row and column every batch's (sum, sum of squares, count) in cm.
    """

    split: str
    cards: dict[str, Card]
    windows: int = 0
    errors: dict[str, dict[str, list[np.ndarray]]] = field(
        default_factory=lambda: defaultdict(lambda: defaultdict(list))
    )

    def add(self, row: str, column: str, wrong: np.ndarray) -> None:
        """Count poses (B, T, 22, 3) minus the truth's, in metres."""
        off = 100 * np.linalg.norm(wrong[:, :, 1:], axis=-1)
        self.errors[row][column].append(np.array([off.sum(), (off**2).sum(), off.size]))

    def mean(self, row: str, column: str) -> tuple[float, float]:
        """Mean and standard deviation in cm."""
        total, squares, count = np.sum(self.errors[row][column], axis=0)
        mean = total / count
        return float(mean), float(np.sqrt(max(squares / count - mean**2, 0.0)))

    def to_dict(self) -> dict[str, Any]:
        return {
            "protocol": "Kaufmann et al. 2020, table 2, at 30 fps",
            "split": self.split,
            "windows": self.windows,
            "unit": "cm",
            "networks": {row: origin(card) for row, card in self.cards.items()},
            "errors": {
                row: {column: dict(zip(("mean", "std"), self.mean(row, column))) for column in COLUMNS}
                for row in self.errors
            },
        }

    def table(self) -> str:
        """A Markdown table: mean error in cm and its deviation, and the paper's own."""
        lines = []
        for row in self.errors:
            figures = [self.mean(row, column) for column in COLUMNS]
            lines.append([row, *(f"{mean:.2f} ± {std:.1f}" for mean, std in figures)])
        for i, row in enumerate(("paper: Holden et al.", "paper: CAE")):
            lines.append([row, *(str(PAPER[column][i]) for column in COLUMNS)])
        return markdown(["", *COLUMNS], lines)

    def __str__(self) -> str:
        notes = [
            "Mean ± standard deviation of the joint error in cm.",
            *(f"{row}: {in_words(card)}." for row, card in self.cards.items()),
        ]
        return "\n\n".join([f"{self.windows} windows, {self.split}", self.table(), "\n".join(notes)])


def run(
    data: Path,
    networks: Mapping[str, Network],
    cards: Mapping[str, Card],
    split: str = "validation",
    most: int = WINDOWS,
    progress: Callable[[float, str], None] = lambda share, line: None,
) -> Noise:
    """Measure networks on windows of a split; the same windows and the same noise every time.

    Args:
        data: the folder that holds lafan1/ and bandai/.
        networks: what to measure, by the name of its row.
        cards: of the same rows.
        split: "validation", or "test" for final figures.
        most: windows to draw; all of them if there are fewer.
    """
    result = Noise(split, dict(cards))
    cut = list(windows(data, DATASETS, split, progress=lambda line: progress(0.0, line)))
    chosen = np.random.default_rng(SEED).permutation(len(cut))[:most]
    result.windows = len(chosen)
    for start in range(0, len(chosen), BATCH):
        some = [cut[i] for i in chosen[start : start + BATCH]]
        positions = np.stack([window.body.as_canonical(window.clip) for window in some])
        truth = in_body_frame(positions)
        for number, (column, (sigma, lost)) in enumerate(COLUMNS.items()):
            rng = np.random.default_rng((SEED, start, number))
            noise = gaussian_noise(rng, np.zeros_like(truth), sigma)
            kept = joints_per_frame_mask(rng, len(truth), truth.shape[1], len(JOINTS), lost)
            known = np.broadcast_to(kept[..., None], truth.shape)
            result.add(INPUT, column, np.stack([linear(*one) for one in zip(truth + noise, known)]) - truth)
            for row, network in networks.items():
                result.add(row, column, network(positions, noise, kept) - truth)
        done = start + len(some)
        progress(done / len(chosen), f"{done} of {len(chosen)} windows")
    return result


def in_body_frame(positions: np.ndarray) -> np.ndarray:
    """Canonical positions (..., 22, 3) with the hips over the origin, facing along Z; heights as they are."""
    return turn(positions - positions[..., :1, :] * [1.0, 0.0, 1.0], -facing(positions)[..., None])
