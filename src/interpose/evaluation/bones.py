"""Figure 5 of Kaufmann et al. 2020: how long bones are where networks reconstruct motion that is all known.

All windows of 120 frames (4 s) of held-out performers on the canonical body, whose bones are as long for
everyone and in every frame. What is measured is the distance of joints as a network says them, before
anything is finished: the skeleton of a file that is filled keeps its bones in any case.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from interpose.evaluation.infilling import in_words, named, origin
from interpose.evaluation.table import markdown
from interpose.evaluation.windows import DATASETS, windows
from interpose.methods import cae
from interpose.methods.weights import Card
from interpose.show.plot import Box, box_plot
from interpose.skeletons import BONES, JOINTS, PARENTS

# Bones, by the joint at which they end.
SELECTED = {
    "thigh": "LeftLeg",
    "shin": "LeftFoot",
    "upper arm": "LeftForeArm",
    "forearm": "LeftHand",
    "chest": "Neck",
    "neck": "Head",
}
ENDS = [JOINTS.index(name) for name in SELECTED.values()]
TRUTH = 100 * np.linalg.norm(BONES[ENDS], axis=-1)  # cm


@dataclass
class Bones:
    """The figures.

    Attributes:
        split: whose windows.
        cards: weights, by the name of their row.
        windows: by data set.
        lengths: of each row, every window's (T, 6) in cm.
    """

    split: str
    cards: dict[str, Card]
    windows: dict[str, int] = field(default_factory=lambda: defaultdict(int))
    lengths: dict[str, list[np.ndarray]] = field(default_factory=lambda: defaultdict(list))

    def wrong(self, row: str) -> list[Box]:
        """Quartiles of each bone's length minus the true one, in cm."""
        return [Box.of(values) for values in np.concatenate(self.lengths[row]).T - TRUTH[:, None]]

    def to_dict(self) -> dict[str, Any]:
        return {
            "protocol": "Kaufmann et al. 2020, figure 5, at 30 fps",
            "split": self.split,
            "windows": dict(self.windows),
            "unit": "cm",
            "networks": {row: origin(card) for row, card in self.cards.items()},
            "truth": dict(zip(SELECTED, TRUTH.tolist())),
            "length_minus_truth": {
                row: {bone: dict(vars(box)) for bone, box in zip(SELECTED, self.wrong(row))}
                for row in self.cards
            },
        }

    def table(self) -> str:
        """A Markdown table: by how much bones are too long in cm, the median and the quartiles' distance."""
        lines = [["true length", *(f"{length:.1f}" for length in TRUTH)]]
        for row in self.cards:
            cells = [f"{box.median:+.2f} ({box.upper - box.lower:.2f})" for box in self.wrong(row)]
            lines.append([row, *cells])
        return markdown(["", *SELECTED], lines)

    def plot(self, path: Path | None = None) -> str:
        """Box plots as SVG. The true lengths stand below: on one axis with these the boxes would be lines."""
        return box_plot(
            {row: self.wrong(row) for row in self.cards},
            [f"{bone}\n{length:.1f} cm" for bone, length in zip(SELECTED, TRUTH)],
            "length minus true length, cm",
            f"Bones of reconstructed motion, {self.split} performers",
            path,
            dots=("truth", [0.0] * len(SELECTED)),
        )

    def __str__(self) -> str:
        counts = ", ".join(f"{count} of {dataset}" for dataset, count in self.windows.items())
        notes = [
            "Median of length minus true length in cm (distance of the quartiles); all frames.",
            *(f"{row}: {in_words(card)}." for row, card in self.cards.items()),
        ]
        return "\n\n".join([f"{counts}: windows, {self.split}", self.table(), "\n".join(notes)])


def run(
    data: Path,
    trained: Sequence[Card],
    split: str = "validation",
    most: int | None = None,
    progress: Callable[[float, str], None] = lambda share, line: None,
) -> Bones:
    """Measure networks on the windows of a split.

    Args:
        data: the folder that holds lafan1/ and bandai/.
        trained: weights, a row each.
        split: "validation", or "test" for final figures.
        most: windows per data set; None for all.
    """
    result = Bones(split, named(trained))
    chosen = list(windows(data, DATASETS, split, most=most, progress=lambda line: progress(0.0, line)))
    for done, window in enumerate(chosen):
        result.windows[window.dataset] += 1
        positions = window.body.as_canonical(window.clip)[None]
        for row, card in result.cards.items():
            (body,), *_ = cae.run(card.onnx, positions, np.ones(positions.shape[:-1], bool))
            ways = body[:, ENDS] - body[:, [PARENTS[end] for end in ENDS]]
            result.lengths[row].append(100 * np.linalg.norm(ways, axis=-1))
        progress((done + 1) / len(chosen), f"{done + 1} of {len(chosen)} windows")
    return result
