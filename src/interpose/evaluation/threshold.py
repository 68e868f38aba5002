"""From which length of gap on a network beats the spline: what the method `auto` goes by."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from interpose.evaluation.table import markdown
from interpose.evaluation.windows import DATASETS, windows
from interpose.finish import complete
from interpose.methods import registry
from interpose.show.plot import line_plot

GAPS = (2, 4, 6, 8, 10, 12, 15, 20, 25, 30, 40, 50, 60)
PLAIN = ("linear", "spline")


@dataclass
class Threshold:
    """Mean global joint error in cm of finished fills on validation performers, by gap length.

    Attributes:
        errors: method to one error per length in GAPS; the network last.
        from_gap: the shortest length from which on the network is better at every longer one; one more than
            the longest when it never is.
        count: windows.
    """

    errors: dict[str, list[float]]
    from_gap: int
    count: int

    def to_dict(self) -> dict[str, Any]:
        return {"gaps": list(GAPS), "errors": self.errors, "from_gap": self.from_gap, "windows": self.count}

    def plot(self, path: Path | None = None) -> str:
        """Error over gap length as SVG, the threshold marked."""
        series = {name: (GAPS, held) for name, held in self.errors.items()}
        return line_plot(
            series,
            "gap, frames at 30 fps",
            "joint error, cm",
            "Finished fills, validation performers",
            path=path,
            marks={"auto: network from here": float(self.from_gap)},
        )

    def __str__(self) -> str:
        rows = [
            [str(gap), *(f"{held[i]:.2f}" for held in self.errors.values())] for i, gap in enumerate(GAPS)
        ]
        return (
            f"{markdown(['gap', *self.errors], rows)}\n\n"
            f"Mean joint error in cm of finished fills, {self.count} windows of validation performers.\n"
            f"{list(self.errors)[-1]} is better than the spline from {self.from_gap} frames on."
        )


def crossing(spline: list[float], network: list[float]) -> int:
    """The shortest length of GAPS from which on the network's error is below the spline's at every length."""
    from_gap = GAPS[-1] + 1
    for gap, theirs, ours in reversed(list(zip(GAPS, spline, network))):
        if not ours < theirs:
            break
        from_gap = gap
    return from_gap


def measure(
    data: Path,
    network: str = "cae",
    most: int | None = 60,
    progress: Callable[[float, str], None] = lambda share, line: None,
) -> Threshold:
    """Fill gaps of every length in windows of validation performers by the network and by interpolation."""
    methods = (*PLAIN, network)
    chosen = list(windows(data, DATASETS, "validation", most=most, progress=lambda line: progress(0.0, line)))
    errors: dict[str, list[list[float]]] = {name: [[] for _ in GAPS] for name in methods}
    for done, window in enumerate(chosen):
        for i, frames in enumerate(GAPS):
            gap = window.centred(frames)
            hidden = window.hide(gap)
            part = slice(gap.start, gap.stop)
            for name in methods:
                filled = window.canonical(complete(window.clip, hidden, registry.get(name)).clip)
                wrong = np.linalg.norm((filled - window.positions)[part, 1:], axis=-1)
                errors[name][i].append(100 * float(wrong.mean()))
        progress((done + 1) / len(chosen), f"{done + 1} of {len(chosen)} windows")
    means = {name: [float(np.mean(held)) for held in lengths] for name, lengths in errors.items()}
    return Threshold(means, crossing(means["spline"], means[network]), len(chosen))
