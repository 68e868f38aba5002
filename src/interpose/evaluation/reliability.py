"""Does a network know when it is wrong? What it expects to be off by, beside what it is off by.

Frames of gaps of held-out performers are sorted by the error that the network expects of them and cut into
equal parts: where it is calibrated both means agree in every part (a reliability diagram, as Niculescu-Mizil
and Caruana drew it in 2005 for probabilities).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import spearmanr

from interpose.errors import RequestError
from interpose.evaluation.table import markdown
from interpose.evaluation.windows import DATASETS, windows
from interpose.finish.opinion import wipe
from interpose.methods import registry
from interpose.show import line_plot

GAPS = (5, 15, 30, 60)
FRAMES, PARTS = 120, 10


@dataclass
class Reliability:
    """Frames by the error that was expected of them.

    Attributes:
        method, split: what was measured, and on whom.
        count: windows.
        expected, measured: (n,) cm, of every frame of every gap.
    """

    method: str
    split: str
    count: int
    expected: np.ndarray
    measured: np.ndarray

    @property
    def parts(self) -> tuple[np.ndarray, np.ndarray]:
        """The means of tenths of the frames, those of which least is expected first."""
        order = np.array_split(np.argsort(self.expected, kind="stable"), PARTS)
        expected, measured = (
            np.array([some[part].mean() for part in order]) for some in (self.expected, self.measured)
        )
        return expected, measured

    @property
    def off(self) -> float:
        """By how much expected and measured means differ, in the mean over the parts, as a share."""
        expected, measured = self.parts
        return float(np.abs(expected - measured).mean() / self.measured.mean())

    @property
    def correlation(self) -> float:
        """Of ranks (Spearman), of single frames."""
        return float(spearmanr(self.expected, self.measured).statistic)

    def to_dict(self) -> dict[str, Any]:
        expected, measured = self.parts
        return {
            "method": self.method,
            "split": self.split,
            "windows": self.count,
            "frames": len(self.expected),
            "unit": "cm",
            "expected": expected.tolist(),
            "measured": measured.tolist(),
            "off": self.off,
            "rank_correlation": self.correlation,
        }

    def table(self) -> str:
        rows = [[str(i + 1), f"{e:.2f}", f"{m:.2f}"] for i, (e, m) in enumerate(zip(*self.parts))]
        return markdown(["tenth", "expected", "measured"], rows)

    def __str__(self) -> str:
        return "\n\n".join(
            [
                self.table(),
                f"Mean error of joints in cm, as {self.method} expects it and as it is: "
                f"{len(self.expected):,} frames of gaps of {', '.join(map(str, GAPS))} in {self.count} "
                f"windows of {self.split} performers, in tenths by what is expected.",
                f"Parts are off by {100 * self.off:.0f} % of the mean error; rank correlation of frames "
                f"{self.correlation:.2f}.",
            ]
        )

    def plot(self, path: Path) -> None:
        """Draw expected against measured errors, and the line on which they agree."""
        expected, measured = self.parts
        ends = np.array([0.0, max(expected.max(), measured.max())])
        lines: dict[str, Any] = {self.method: (expected, measured), "calibrated": (ends, ends)}
        line_plot(lines, "expected error, cm", "measured error, cm", "What the network expects", path=path)


def run(
    data: Path,
    name: str,
    split: str = "validation",
    most: int | None = 40,
    progress: Callable[[float, str], None] = lambda share, line: None,
) -> Reliability:
    """Measure a method that says what it expects to be off by.

    Args:
        data: the folder that holds lafan1/ and bandai/.
        name: of the method.
        split: "validation", or "test" for final figures.
        most: windows of each data set; None for all.
        progress: told how it goes.

    Raises:
        RequestError: an unknown method or split, or a method that says nothing of its errors.
    """
    method = registry.get(name)
    held = list(
        windows(data, DATASETS, split, FRAMES, FRAMES, most, progress=lambda line: progress(0.0, line))
    )
    expected, measured = [], []
    for done, window in enumerate(held):
        for length in GAPS:
            gap = window.centred(length)
            seen = window.hide(gap)
            raw = method.complete(wipe(window.clip, seen), seen)
            if raw.expected is None:
                raise RequestError(
                    f"{name} does not say what it expects to be off by",
                    "only networks of interpose's own do",
                    "Choose small.",
                )
            inside = slice(gap.start, gap.stop)
            off = np.linalg.norm(window.canonical(raw.clip) - window.positions, axis=-1).mean(axis=1)
            expected.append(100 * raw.expected[inside])
            measured.append(100 * off[inside])
        progress((done + 1) / len(held), f"{done + 1} of {len(held)} windows")
    return Reliability(name, split, len(held), np.concatenate(expected), np.concatenate(measured))
