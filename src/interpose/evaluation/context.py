"""The studies of section 4.2 of Kaufmann et al. 2020: how long a gap may be, and how much to leave around it.

On windows of held-out performers at 30 fps. *Gap size*: gaps of .07, .33, 1.33 and 4 s (the paper's 5, 20, 80
and 250 frames at 60 fps) with .83 s known on either side. *Context*: .03, .1, .17, .43 and .83 s (its 1, 5,
10, 25 and 50 frames), and .27 s, known on either side of gaps of 1.33 s, and of shorter and longer ones; from
the errors in each kind of motion, how much is needed in proportion to the gap. Methods see only these frames.
Errors are those of finished fills in the clip's own coordinates: means over joints without hips, and frames.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from interpose.datasets.catalogue import FPS
from interpose.evaluation.table import markdown
from interpose.evaluation.windows import DATASETS, Window, windows
from interpose.finish import complete
from interpose.finish.notes import DULL
from interpose.geometry import measures
from interpose.methods import auto, registry
from interpose.methods.protocol import Method
from interpose.observation import Gap
from interpose.show.plot import COLORS, line_plot

GAPS = (2, 10, 40, 120)  # frames
METHODS = ("linear", "spline", "cae", "auto")
CONTEXTS = (1, 3, 5, 8, 13, 25)  # frames on either side
ROWS = (("spline", 40), ("cae", 40), ("auto", 20), ("auto", 40), ("auto", 60))  # methods and lengths of gap
GAP, CONTEXT = 40, CONTEXTS[-1]  # what stays while the other one changes
# Times the error with the most context: with what comes below it, there is enough of it.
ENOUGH = 1.1

Progress = Callable[[float, str], None]


@dataclass
class Context:
    """The figures of both studies.

    Attributes:
        split: whose windows.
        errors: mean joint error in cm of every window, by length of gap and frames known on either side, and
            by method; those of one kind of motion under its label, of all kinds together under "".
        lively: liveliness (`measures.liveliness`) where it is measured, by length of gap and by method, with
            "truth" among them.
        fell_back: how many fills of the network were left to the spline, by length of gap and context.
    """

    split: str
    errors: dict[str, dict[tuple[int, int], dict[str, list[float]]]] = field(
        default_factory=lambda: defaultdict(lambda: defaultdict(lambda: defaultdict(list)))
    )
    lively: dict[int, dict[str, list[float]]] = field(
        default_factory=lambda: defaultdict(lambda: defaultdict(list))
    )
    fell_back: dict[tuple[int, int], int] = field(default_factory=lambda: defaultdict(int))

    @property
    def labels(self) -> list[str]:
        """The kinds of motion, from small to large errors."""
        return sorted((label for label in self.errors if label), key=lambda label: self.curve(label)[-1])

    def mean(self, method: str, gap: int, context: int = CONTEXT, label: str = "") -> float:
        return float(np.mean(self.errors[label][gap, context][method]))

    def curve(self, label: str = "", method: str = "auto", gap: int = GAP) -> list[float]:
        """Error in cm for each of CONTEXTS."""
        return [self.mean(method, gap, context, label) for context in CONTEXTS]

    def windows(self, label: str = "") -> int:
        return len(self.errors[label][GAP, CONTEXT]["auto"])

    def alive(self, method: str, gap: int) -> tuple[float, float]:
        """Liveliness as a share of the truth's, and the share of windows that a report calls a mean pose."""
        said, truth = (np.array(self.lively[gap][name]) for name in (method, "truth"))
        return float(said.mean() / truth.mean()), float((said < DULL).mean())

    def to_dict(self) -> dict[str, Any]:
        def curve(label: str, method: str, gap: int) -> dict[str, Any]:
            errors = self.curve(label, method, gap)
            enough = needed(errors)
            return {"method": method, "gap": gap, "errors": errors, "needed": enough, "ratio": enough / gap}

        return {
            "protocol": "Kaufmann et al. 2020, section 4.2, at 30 fps",
            "split": self.split,
            "units": {"errors": "cm", "gap": "frames", "context": "frames", "needed": "frames"},
            "windows": self.windows(),
            "gaps": {
                str(gap): {
                    "errors": {method: self.mean(method, gap) for method in METHODS},
                    "fell_back": self.fell_back[gap, CONTEXT],
                    "liveliness": {
                        method: dict(zip(("share_of_truth", "mean_pose"), self.alive(method, gap)))
                        for method in self.lively[gap]
                    },
                }
                for gap in GAPS
            },
            "context": list(CONTEXTS),
            "curves": [curve("", method, gap) for method, gap in ROWS],
            "labels": {
                label: {"windows": self.windows(label), **curve(label, "auto", GAP)} for label in self.labels
            },
        }

    def plot(self, path: Path | None = None) -> str:
        """Error over context as SVG: a line a kind of motion, those between if there are more than colors."""
        labels = self.labels
        chosen = np.linspace(0, len(labels) - 1, min(len(labels), len(COLORS))).astype(int)
        seconds = [context / FPS for context in CONTEXTS]
        return line_plot(
            {labels[i]: (seconds, self.curve(labels[i])) for i in chosen},
            "known on either side of the gap, seconds",
            "joint error, cm",
            f"Gaps of {GAP / FPS:.2g} s, {self.split} performers",
            path=path,
        )

    def gap_table(self) -> str:
        """Markdown: error by length of gap, in brackets the ratio to linear."""
        lines = [
            [name, *(f"{self.mean(name, gap):.2f} ({self._ratio(name, gap):.2f})" for gap in GAPS)]
            for name in METHODS
        ]
        return markdown(["joint error", *_seconds(GAPS)], lines)

    def lively_table(self) -> str:
        """Markdown: liveliness as a share of the truth's, in brackets how often a report says mean pose."""
        gaps = [gap for gap in GAPS if self.lively[gap]]
        lines = []
        for name in (*METHODS, "truth"):
            cells = [self.alive(name, gap) for gap in gaps]
            lines.append([name, *(f"{share:.2f} ({100 * dull:.0f} %)" for share, dull in cells)])
        return markdown(["liveliness", *_seconds(gaps)], lines)

    def context_table(self) -> str:
        """Markdown: error by context, and how much of it is enough."""
        lines = [
            [method, f"{gap / FPS:.2f} s", *_cells(self.curve("", method, gap), gap)] for method, gap in ROWS
        ]
        return markdown(["all motions", "gap", *_seconds(CONTEXTS), "enough", "of the gap"], lines)

    def label_table(self) -> str:
        """Markdown: error by context in each kind of motion, and how much of it is enough."""
        lines = [[label, str(self.windows(label)), *_cells(self.curve(label), GAP)] for label in self.labels]
        return markdown(
            [f"auto, {GAP / FPS:.2f} s", "windows", *_seconds(CONTEXTS), "enough", "of the gap"], lines
        )

    def _ratio(self, method: str, gap: int) -> float:
        return self.mean(method, gap) / self.mean("linear", gap)

    def __str__(self) -> str:
        fallen = [f"{self.fell_back[GAP, c]} at {c / FPS:.2f} s" for c in CONTEXTS]
        return "\n\n".join(
            [
                f"Finished fills, {self.split} performers: mean joint error in cm (ratio to linear) by "
                f"length of gap, {CONTEXT / FPS:.2f} s known on either side, {self.windows()} windows. The "
                "network `cae` learned gaps of up to 2 s.",
                self.gap_table(),
                "How much the middle of the gap moves, as a share of the truth (in how many windows so "
                "little that a report speaks of a mean pose).",
                self.lively_table(),
                "Error by what is known on either side, in the same windows; enough is from where on it "
                f"stays within {100 * (ENOUGH - 1):.0f} % of the last one. Single frames are keys to `auto`, "
                "which leaves them to the network for keys.",
                self.context_table(),
                f"Of gaps of {GAP / FPS:.2f} s the spline took over from the network: {', '.join(fallen)}.",
                "The same by kind of motion, in windows of each.",
                self.label_table(),
            ]
        )


def _seconds(frames: Iterable[int]) -> list[str]:
    return [f"{count / FPS:.2f} s" for count in frames]


def _cells(curve: Sequence[float], gap: int) -> list[str]:
    """Errors, what is enough in seconds, and as a share of the gap."""
    enough = needed(curve)
    return [*(f"{error:.2f}" for error in curve), f"{enough / FPS:.2f} s", f"{enough / gap:.2f}"]


def needed(curve: Sequence[float]) -> int:
    """The least of CONTEXTS from which on the error is within ENOUGH of that with the most."""
    enough = CONTEXTS[-1]
    for context, error in reversed(list(zip(CONTEXTS, curve))):
        if error > ENOUGH * curve[-1]:
            break
        enough = context
    return enough


def run(
    data: Path,
    split: str = "validation",
    most: int | None = 6,
    progress: Progress = lambda share, line: None,
) -> Context:
    """Measure gap sizes and contexts on the windows of a split.

    Args:
        data: the folder that holds lafan1/ and bandai/.
        split: "validation", or "test" for final figures.
        most: windows a label, and half as many where labels are taken together; None for all.
        progress: told how it goes.
    """

    def cut(length: int, most: int | None) -> list[Window]:
        def told(line: str) -> None:
            progress(0.0, line)

        return list(windows(data, DATASETS, split, length, length, most, told, by_label=True))

    result = Context(split)
    together = cut(max(GAPS) + 2 * CONTEXT, None if most is None else -(-most // 2))
    alone = cut(GAP + 2 * CONTEXT, most)
    total = len(together) + len(alone)
    for done, window in enumerate(together):
        for gap in GAPS:
            _measure(result, window, gap, CONTEXT, METHODS)
        for gap, context in product(sorted({gap for _, gap in ROWS}), CONTEXTS):
            if (gap, context) != (GAP, CONTEXT):
                _measure(result, window, gap, context, [method for method, length in ROWS if length == gap])
        progress((done + 1) / total, f"{done + 1} of {total} windows")
    for done, window in enumerate(alone, len(together)):
        for context in CONTEXTS:
            _measure(result, window, GAP, context, ["auto"], f"{window.dataset} {window.label}")
        progress((done + 1) / total, f"{done + 1} of {total} windows")
    return result


def _measure(
    result: Context, window: Window, gap: int, context: int, methods: Sequence[str], label: str = ""
) -> None:
    """Fill a gap in the middle of a window by some methods, which see `context` frames on either side."""
    middle = window.centred(gap)
    part = slice(middle.start - context, middle.stop + context)
    shown = replace(window, clip=window.clip.slice(part.start, part.stop), positions=window.positions[part])
    hole = shown.centred(gap)
    fills: dict[str, np.ndarray] = {}
    for name in methods:
        method = _method(name, shown, hole)
        if method.name not in fills:  # what auto chooses is there already, as a rule
            done = complete(shown.clip, shown.hide(hole), method)
            fills[method.name] = shown.canonical(done.clip)
            if name == "cae":
                result.fell_back[gap, context] += done.report.gaps[0].method != name
        fills[name] = fills[method.name]
        wrong = np.linalg.norm((fills[name] - shown.positions)[hole.start : hole.stop, 1:], axis=-1)
        result.errors[label][gap, context][name].append(100 * float(wrong.mean()))
    if methods == METHODS:
        for name, motion in {"truth": shown.positions, **fills}.items():
            if (alive := measures.liveliness(motion, hole.start, hole.stop, FPS)) is not None:
                result.lively[gap][name].append(alive)


def _method(name: str, shown: Window, hole: Gap) -> Method:
    """The method of a row: of `auto` as users get it, to whom a single frame beside a gap is a key."""
    if name == "auto":
        return auto.choose(shown.clip, hole, 2 if hole.start == 1 else 0)[0]
    return registry.get(name)
