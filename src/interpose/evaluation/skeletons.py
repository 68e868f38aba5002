"""Gaps of held-out performers of every data set, each on its own skeleton and at its own frame rate.

Gaps of half a second, one and two (15, 30 and 60 frames at 30 fps) in the middle of windows of four seconds,
or of whole clips where they are shorter; at least a third of a second is observed on either side. What is
judged is what users get: the mean error of the 22 joints, as finished and in the clip's own coordinates.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from interpose.clip import Clip
from interpose.datasets import clips
from interpose.evaluation.table import markdown
from interpose.finish import complete
from interpose.methods import auto, registry
from interpose.observation import Gap, Observation
from interpose.skeletons import find_humanoid

DATASETS = ("lafan1", "cmu", "bandai", "hdm05")
GAPS = (15, 30, 60)  # frames at 30 fps
METHODS = ("linear", "spline", "cae", "auto")
WINDOW, BESIDE = 4.0, 1 / 3  # seconds: of a window, and of observed motion beside a gap at least


@dataclass
class Skeletons:
    """The figures: `errors[dataset][gap][method]` holds every window's mean error in cm."""

    split: str
    errors: dict[str, dict[int, dict[str, list[float]]]] = field(
        default_factory=lambda: defaultdict(lambda: defaultdict(lambda: defaultdict(list)))
    )
    rates: dict[str, set[float]] = field(default_factory=lambda: defaultdict(set))
    fallen: dict[str, Counter[int]] = field(default_factory=lambda: defaultdict(Counter))

    def mean(self, dataset: str, gap: int, method: str) -> float:
        return float(np.mean(self.errors[dataset][gap][method]))

    def targets(self) -> Iterator[tuple[str, bool]]:
        """At 30 and 60 frames the network, or auto, is better than linear and spline on every set."""
        for dataset in self.errors:
            for gap in GAPS[1:]:
                if self.errors[dataset][gap]:
                    rivals = min(self.mean(dataset, gap, name) for name in ("linear", "spline"))
                    ours = min(self.mean(dataset, gap, name) for name in ("cae", "auto"))
                    words = f"{dataset}, {gap} frames: {ours:.2f} cm, linear and spline {rivals:.2f}"
                    yield words, ours < rivals

    def to_dict(self) -> dict[str, Any]:
        return {
            "protocol": "finished fills of held-out performers on their own skeletons and frame rates",
            "split": self.split,
            "unit": "cm",
            "errors": {
                dataset: {
                    str(gap): {
                        "windows": len(held["auto"]),
                        "fell_back": self.fallen[dataset][gap],
                        **{m: self.mean(dataset, gap, m) for m in METHODS},
                    }
                    for gap, held in gaps.items()
                }
                for dataset, gaps in self.errors.items()
            },
            "targets": [{"target": words, "met": good} for words, good in self.targets()],
        }

    def table(self) -> str:
        """Markdown: a row a data set and length of gap."""
        lines = []
        for dataset, gaps in self.errors.items():
            rates = ", ".join(f"{rate:.0f}" for rate in sorted(self.rates[dataset]))
            for gap, held in gaps.items():
                figures = [f"{self.mean(dataset, gap, method):.2f}" for method in METHODS]
                lines.append(
                    [
                        dataset,
                        rates,
                        str(gap),
                        str(len(held["auto"])),
                        *figures,
                        str(self.fallen[dataset][gap]),
                    ]
                )
        return markdown(["data set", "fps", "gap", "windows", *METHODS, "fell back"], lines)

    def __str__(self) -> str:
        checks = [f"{'met   ' if good else 'missed'}  {words}" for words, good in self.targets()]
        head = f"Mean joint error in cm of finished fills, {self.split} performers; gaps in frames at 30 fps."
        return "\n\n".join([head, self.table(), "\n".join(checks)])


def run(
    data: Path,
    split: str = "validation",
    most: int | None = 60,
    progress: Callable[[float, str], None] = lambda share, line: None,
) -> Skeletons:
    """Measure all methods on the clips of a split.

    Args:
        data: the folder that holds the data sets.
        split: "validation", or "test" for final figures.
        most: windows a data set and length of gap, spread evenly over all of them; None for all.
    """
    result = Skeletons(split)
    work = [(name, gap, *one) for name in DATASETS for gap, one in _windows(data, name, split, most)]
    for number, (dataset, frames, clip, gap) in enumerate(work):
        body = find_humanoid(clip)
        truth = body.positions(clip)[gap.start : gap.stop]
        result.rates[dataset].add(round(clip.fps))
        for method in METHODS:
            chosen = auto.choose(clip, gap)[0] if method == "auto" else registry.get(method)
            done = complete(clip, Observation.from_gaps(clip, [gap]), chosen)
            result.fallen[dataset][frames] += method == "cae" and done.report.gaps[0].method != method
            filled = body.positions(done.clip)[gap.start : gap.stop]
            wrong = 100 * np.linalg.norm(filled - truth, axis=-1).mean()
            result.errors[dataset][frames][method].append(float(wrong))
        progress((number + 1) / len(work), f"{number + 1} of {len(work)} windows")
    return result


def _windows(
    data: Path, dataset: str, split: str, most: int | None
) -> Iterator[tuple[int, tuple[Clip, Gap]]]:
    """Length of gap at 30 fps, and a piece of a clip with that gap in its middle."""
    loaded = [entry.load() for entry in clips(dataset, data, split)]
    for frames in GAPS:
        found: list[tuple[Clip, int, int]] = []
        for clip in loaded:
            window = round(WINDOW * clip.fps)
            if len(clip) >= window:
                found += [(clip, start, start + window) for start in range(0, len(clip) - window + 1, window)]
            elif len(clip) >= (frames / 30 + 2 * BESIDE) * clip.fps:
                found.append((clip, 0, len(clip)))
        if most is not None and most < len(found):
            found = [found[i] for i in np.linspace(0, len(found) - 1, most).astype(int)]
        for clip, start, stop in found:
            missing = round(frames / 30 * clip.fps)
            first = (stop - start - missing) // 2
            yield frames, (clip.slice(start, stop), Gap(first, first + missing))
