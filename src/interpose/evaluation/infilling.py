"""Table 1 of Kaufmann et al. 2020 at 30 fps: joint error when a gap in the middle of 4 s is filled.

Windows of 120 frames of held-out performers; gaps of 0, 15, 30 and 60 frames (0, .5, 1 and 2 s), centred;
mean and standard deviation over joints and gap frames of the 3-D error in centimetres, without the hips.
Networks that were trained to be compared with (the paper's baselines and ablations) are rows more.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from interpose.clip import Clip
from interpose.evaluation.table import markdown
from interpose.evaluation.windows import DATASETS, Window, windows
from interpose.finish import complete, feet
from interpose.finish.opinion import wipe
from interpose.geometry import measures
from interpose.methods import registry
from interpose.methods.cae import Cae
from interpose.methods.weights import Card
from interpose.observation import Gap, Observation

GAPS = (0, 15, 30, 60)
PAPER = "linear, global positions"
ROWS = (
    "zero-velocity",
    PAPER,
    "linear, true trajectory",
    "spline, true trajectory",
    "spline, finished",
    "cae, true trajectory",
    "cae, settled",
    "cae, finished",
)


@dataclass
class Infilling:
    """The figures: `errors[dataset][row][gap]` holds every window's (sum, sum of squares, count) in cm.

    Attributes:
        split: whose windows.
        networks: those to compare with, by the name of their row.
    """

    split: str
    networks: dict[str, Cae] = field(default_factory=dict)
    counts: dict[str, int] = field(default_factory=lambda: defaultdict(int))
    errors: dict[str, dict[str, dict[int, list[np.ndarray]]]] = field(
        default_factory=lambda: defaultdict(lambda: defaultdict(lambda: defaultdict(list)))
    )
    feet: dict[str, dict[int, list[tuple[float, float, float]]]] = field(
        default_factory=lambda: defaultdict(lambda: defaultdict(list))
    )
    solves: list[float] = field(default_factory=list)
    drifts: dict[int, list[float]] = field(default_factory=lambda: defaultdict(list))
    fallen: dict[int, int] = field(default_factory=lambda: defaultdict(int))

    @property
    def rows(self) -> tuple[str, ...]:
        return (*ROWS, *self.networks)

    def add(self, window: Window, row: str, gap: Gap, frames: int, positions: np.ndarray) -> None:
        part = slice(gap.start, gap.stop) if frames else slice(None)
        wrong = 100 * np.linalg.norm((positions - window.positions)[part, 1:], axis=-1)
        figures = np.array([wrong.sum(), (wrong**2).sum(), wrong.size])
        for group in (window.dataset, "all"):
            self.errors[group][row][frames].append(figures)

    def mean(self, group: str, row: str, frames: int) -> tuple[float, float] | None:
        """Mean and standard deviation in cm, or None where a row has no meaning."""
        held = self.errors[group][row].get(frames)
        if not held:
            return None
        total, squares, count = np.sum(held, axis=0)
        mean = total / count
        return float(mean), float(np.sqrt(max(squares / count - mean**2, 0.0)))

    def ratio(self, group: str, row: str, frames: int) -> float | None:
        mine, linear = self.mean(group, row, frames), self.mean(group, PAPER, frames)
        return mine[0] / linear[0] if mine and linear else None

    def foot(self, row: str, frames: int) -> dict[str, float]:
        """Of the feet in the gap: mean slide (cm/s), travel (m), and speed in the truth's stances (cm/s)."""
        means = np.nanmean(self.feet[row][frames], axis=0)
        return {name: float(mean) for name, mean in zip(("slide", "travel", "stance_speed"), means)}

    def to_dict(self) -> dict[str, Any]:
        groups: dict[str, Any] = {}
        for group in self.errors:
            groups[group] = {
                row: {
                    str(frames): {"mean": mean[0], "std": mean[1], "ratio": self.ratio(group, row, frames)}
                    for frames in GAPS
                    if (mean := self.mean(group, row, frames))
                }
                for row in self.rows
            }
        feet = {
            row: {str(frames): self.foot(row, frames) for frames in held} for row, held in self.feet.items()
        }
        return {
            "protocol": "Kaufmann et al. 2020, table 1, at 30 fps",
            "split": self.split,
            "windows": dict(self.counts),
            "unit": "cm",
            "networks": {row: origin(network.card) for row, network in self.networks.items()},
            "errors": groups,
            "feet": feet,
            "solve_error": float(np.mean(self.solves)) if self.solves else None,
            "drift": {str(gap): float(np.mean(held)) for gap, held in self.drifts.items()},
            "fell_back": dict(self.fallen),
            "targets": [
                {"target": words, "value": value, "limit": limit, "met": good}
                for words, value, limit, good in self.targets()
            ],
        }

    def table(self, group: str = "all") -> str:
        """A Markdown table: mean error in cm, its deviation, and the ratio to the paper's linear row."""
        head = ["", *(f"{frames} frames" for frames in GAPS)]
        lines = []
        for row in self.rows:
            cells = [row]
            for frames in GAPS:
                mean, ratio = self.mean(group, row, frames), self.ratio(group, row, frames)
                cell = f"{mean[0]:.2f} ± {mean[1]:.1f}" if mean else "-"
                cells.append(cell + (f" ({ratio:.2f})" if ratio is not None else ""))
            lines.append(cells)
        return markdown(head, lines)

    def feet_table(self) -> str:
        """A Markdown table of the feet in the gap, next to the truth's."""
        frames = [gap for gap in GAPS if gap]
        lines = []
        for row in self.feet:
            figures = [self.foot(row, gap) for gap in frames]
            cells = [f"{f['slide']:.1f}, {f['travel']:.2f}, {f['stance_speed']:.1f}" for f in figures]
            lines.append([row, *cells])
        return markdown(["feet", *(f"{gap} frames" for gap in frames)], lines)

    def __str__(self) -> str:
        parts = [
            f"{group} ({self.counts[group]} windows, {self.split})\n\n{self.table(group)}"
            for group in self.errors
        ]
        drift = ", ".join(f"{np.mean(held):.1f} cm at {gap}" for gap, held in self.drifts.items())
        checks = [
            f"{'met   ' if good else 'missed'}  {words}: {value:.2f}, {limit}"
            for words, value, limit, good in self.targets()
        ]
        notes = [
            "Mean ± standard deviation of the joint error in cm (ratio to the paper's linear row).",
            "Feet: slide in cm/s, travel in m, speed in cm/s where the truth's feet stand.",
            f"Solve: {np.mean(self.solves):.2f} cm from the network's positions.",
            f"Root drift before correction: {drift}.",
            f"Fell back to the spline (by gap length): {dict(self.fallen)}.",
            *(f"{row}: {in_words(network.card)}." for row, network in self.networks.items()),
        ]
        return "\n\n".join([*parts, self.feet_table(), "\n".join(notes), "\n".join(checks)])

    def targets(self) -> list[tuple[str, float, str, bool]]:
        """What the network is meant to reach: in words, the figure, its limit, whether it is met."""
        found = []
        for frames, most in ((30, 0.75), (60, 0.65)):

            def mean(row: str, frames: int = frames) -> float:
                figures = self.mean("all", row, frames)
                return figures[0] if figures else float("nan")

            ours, finished = mean("cae, true trajectory"), mean("cae, finished")
            rivals = min(mean("linear, true trajectory"), mean("spline, true trajectory"))
            spline, settled = mean("spline, finished"), mean("cae, settled")
            feet, truth = self.foot("cae, finished", frames), self.foot("truth", frames)
            figures = (
                ("network to the paper's linear row", ours / mean(PAPER), most, True),
                ("network to the better of linear and spline, true trajectory", ours / rivals, 1.0, True),
                ("finished to spline finished", finished / spline, 1.0, True),
                ("finished to what the network settled on", finished / settled, 1.05, True),
                ("foot slide to the truth's", feet["slide"] / truth["slide"], 1.2, True),
                ("foot travel to the truth's", feet["travel"] / truth["travel"], 0.8, False),
            )
            for words, value, limit, below in figures:
                good = value <= limit if below else value >= limit
                sign = "at most" if below else "at least"
                found.append((f"{frames} frames, {words}", value, f"{sign} {limit:g}", good))
        return found


def run(
    data: Path,
    split: str = "validation",
    most: int | None = None,
    progress: Callable[[float, str], None] = lambda share, line: None,
    trained: Sequence[Card] = (),
) -> Infilling:
    """Measure all rows on the windows of a split.

    Args:
        data: the folder that holds lafan1/ and bandai/.
        split: "validation", or "test" for final figures.
        most: windows per data set; None for all.
        progress: told how it goes.
        trained: weights to compare with, a row each.
    """
    networks = {f"{name}, true trajectory": Cae(card) for name, card in named(trained).items()}
    result = Infilling(split, networks)
    chosen = list(windows(data, DATASETS, split, most=most, progress=lambda line: progress(0.0, line)))
    for done, window in enumerate(chosen):
        result.counts[window.dataset] += 1
        result.counts["all"] += 1
        for frames in GAPS:
            _measure(result, window, frames)
        progress((done + 1) / len(chosen), f"{done + 1} of {len(chosen)} windows")
    return result


def named(cards: Sequence[Card]) -> dict[str, Card]:
    """Some weights by a name for their row: the network and how it was trained."""
    rows: dict[str, Card] = {}
    for card in cards:
        how = card.training
        gap = f"gaps of {how['gap'] / card.fps:g} s" if how.get("gap") else "curriculum"
        loss = [how["loss"].upper()] if how.get("loss", "l1") != "l1" else []
        bones = [f"bones {how['bones']:g}"] if how.get("bones") else []
        noise = ["also on noise"] if how.get("noise") else []
        row = f"{card.name} ({', '.join([gap, *loss, *bones, *noise])})"
        # Two that were trained alike, by another budget or seed: the folder tells them apart.
        rows[f"{row}, {card.path.parent}" if row in rows else row] = card
    return rows


def origin(card: Card) -> dict[str, Any]:
    """Where weights come from, and which splits they have seen: an error on these flatters."""
    figures = {name: card.training[name] for name in ("parameters", "device_hours", "splits")}
    return {**figures, "folder": str(card.path.parent)}


def in_words(card: Card) -> str:
    """The same for the notes below a table."""
    how = origin(card)
    size, hours, splits = f"{how['parameters']:,}", f"{how['device_hours']:.2f}", " and ".join(how["splits"])
    return f"{size} parameters, {hours} h of training on {splits}, {how['folder']}"


def _measure(result: Infilling, window: Window, frames: int) -> None:
    gap = window.centred(frames)
    hidden = window.hide(gap)
    network = registry.get("cae")
    wiped = wipe(window.clip, hidden)
    for row, compared in result.networks.items():
        own = compared.complete(wiped, hidden).own
        assert own is not None
        result.add(window, row, gap, frames, window.placed(_spoken(window, own)))
    if frames == 0:
        raw = network.complete(window.clip, hidden)
        assert raw.own is not None
        result.add(window, "cae, true trajectory", gap, 0, window.placed(_spoken(window, raw.own)))
        return
    for name in ("zero-velocity", "linear"):
        answer = registry.get(name).complete(wiped, hidden).clip
        row = name if name == "zero-velocity" else f"{name}, true trajectory"
        result.add(window, row, gap, frames, window.on_true_way(window.canonical(answer)))
    result.add(window, PAPER, gap, frames, _linear(window.positions, gap))
    for name in ("spline", "cae"):
        completion = complete(window.clip, hidden, registry.get(name))
        raw = completion.raw
        said = (
            window.on_true_way(window.canonical(raw.clip))
            if raw.own is None
            else window.placed(_spoken(window, raw.own))
        )
        result.add(window, f"{name}, true trajectory", gap, frames, said)
        result.add(window, f"{name}, finished", gap, frames, window.canonical(completion.clip))
        _feet(result, window, completion.clip, hidden, gap, f"{name}, finished")
        if raw.positions is not None:
            result.add(window, "cae, settled", gap, frames, _spoken(window, raw.positions))
            (report,) = completion.report.gaps
            result.fallen[frames] += int(report.method != name)
            result.solves += [report.solve_error] if report.solve_error is not None else []
            result.drifts[frames] += [report.drift] if report.drift is not None else []
    _feet(result, window, window.clip, hidden, gap, "truth")


def _spoken(window: Window, positions: np.ndarray) -> np.ndarray:
    """What a network says of a skeleton's own joints, as canonical positions (T, 22, 3)."""
    mapping = window.body.mapping
    own = np.zeros((len(positions), len(window.clip.skeleton), 3))
    own[:, mapping.mapped[1]] = positions
    return np.einsum("cj,fjx->fcx", mapping.weights, own)


def _linear(positions: np.ndarray, gap: Gap) -> np.ndarray:
    """Straight lines of every joint's global position over the gap: the paper's interpolation row."""
    filled = positions.copy()
    share = (np.arange(1, len(gap) + 1) / (len(gap) + 1))[:, None, None]
    filled[gap.start : gap.stop] = (1 - share) * positions[gap.start - 1] + share * positions[gap.stop]
    return filled


def _feet(result: Infilling, window: Window, clip: Clip, hidden: Observation, gap: Gap, row: str) -> None:
    """Slide looks at low feet, so lifting one lessens it; the speed in true stances does not."""
    measured = feet.measure(clip, hidden, gap.start, gap.stop)
    if measured is None:
        return
    part, joints = slice(gap.start, gap.stop), feet.pairs(clip.skeleton)
    truth = window.clip.positions()[:, joints]
    floor = feet.local_floor(truth, hidden.positions(clip.skeleton)[:, joints], clip.fps)
    stands = (measures.speed(truth, clip.fps) < feet.STILL) & (truth[..., 1] < floor + feet.HIGH)
    speed = measures.stance_speed(clip.positions()[part][:, joints], stands[part], clip.fps)
    result.feet[row][len(gap)].append((*measured, speed))
