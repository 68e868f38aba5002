"""What Kim et al. 2022 say of CMIB's conditions: rotations (table 1), anchors (table 5), actions (table 6).

All on windows of LAFAN1, as the network says it, with no finishing but that keys are met.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from interpose.clip import Clip
from interpose.errors import RequestError
from interpose.evaluation import lafan1
from interpose.evaluation.table import markdown
from interpose.geometry import rotations
from interpose.methods.cmib import Cmib
from interpose.methods.weights import Card
from interpose.observation import Gap, Observation

RULES = lafan1.PROTOCOLS["cmib"]
LENGTHS = (40, 60, 80, 120)  # frames, both keys counted
ANCHORED = 80  # frames of the windows of table 5, both keys counted
ANCHORS = (20, 40, 60)  # frame of the anchor
MOVED = 0.5  # metres by which anchors are moved: the paper says that they are, and not how far
WALKS = ("walk", "run")
CLOSE = 1.02  # of the best: as good as the best

Progress = Callable[[float, str], None]


def _quiet(share: float, line: str) -> None:
    """Progress that nobody looks at."""


@dataclass
class Table:
    """Figures by row and column.

    Attributes:
        title: what is measured, on what, in which unit.
        columns: their names.
        rows: figures of each row.
        digits: behind the point.
        remarks: sentences below.
    """

    title: str
    columns: Sequence[str]
    rows: dict[str, list[float]] = field(default_factory=dict)
    digits: int = 2
    remarks: list[str] = field(default_factory=list)

    def to_dict(self) -> dict[str, Any]:
        return {
            "title": self.title,
            "rows": {name: dict(zip(self.columns, figures)) for name, figures in self.rows.items()},
            "remarks": self.remarks,
        }

    def __str__(self) -> str:
        rows = [[name, *(f"{v:.{self.digits}f}" for v in figures)] for name, figures in self.rows.items()]
        return "\n\n".join([self.title, markdown(["", *self.columns], rows), *self.remarks])


def representations(
    data: Path,
    trained: Sequence[Card],
    split: str = "validation",
    most: int | None = None,
    progress: Progress = _quiet,
) -> Table:
    """Table 1: L2P of networks that hold rotations in different ways, over the length."""
    held = lafan1.load(data, split, lambda line: progress(0.0, line))
    table = Table(
        f"L2P, {held.name}, {split} performer, cmib protocol, by how the network holds rotations "
        "(and in brackets how many core hours it was trained):",
        [f"{length} frames" for length in LENGTHS],
    )
    methods = {"interpolation": None} | {_name(card): Cmib("", card) for card in trained}
    for done, (name, method) in enumerate(methods.items()):
        progress(done / len(methods), name)
        table.rows[name] = []
        for length in LENGTHS:
            windows = lafan1.cut(held.sequences, RULES.window(length), lafan1.STEP, held.bones).spread(most)
            table.rows[name].append(lafan1.measure(held, RULES, windows, length, method, False).l2p)
    return table


def _name(card: Card) -> str:
    config = card.training.get("config", {})
    return f"{config.get('representation', 'quaternion')} ({card.training['device_hours']:.2f} h)"


def anchors(
    data: Path,
    trained: Sequence[Card],
    split: str = "validation",
    most: int | None = None,
    progress: Progress = _quiet,
) -> Table:
    """Table 5: by how much the network itself misses the hips of an anchor that has been moved.

    Windows of walks and runs. The anchor is moved over the floor in a random direction; start and target
    are turned to face along the way from start to anchor and from anchor to target, as far as that way has
    turned.
    """
    held = lafan1.load(data, split, lambda line: progress(0.0, line))
    clips = []
    for theme in WALKS:
        some = [clip for clip in held.sequences if clip.name.startswith(theme)]
        if some:
            windows = lafan1.cut(some, RULES.window(ANCHORED), lafan1.STEP, held.bones).spread(most)
            clips += [(theme, clip) for clip in lafan1.shown_clips(held, RULES, windows, ANCHORED)]
    if not clips:
        raise RequestError(
            "there is nothing to measure", f"the {split} performer neither walks nor runs", "Add sequences."
        )
    table = Table(
        f"Metres between an anchor, moved by {MOVED:g} m, and what the network itself says there, before its "
        f"motion is moved onto it; {len(clips)} windows of {' and '.join(WALKS)}, {split} performer:",
        [f"t = {frame}" for frame in ANCHORS],
    )
    for done, card in enumerate(trained):
        augmented = card.training.get("augmented", 0.0)
        name = f"{card.path.parent.name or card.name}, {'with' if augmented else 'without'} augmentation"
        table.rows[name] = []
        for frame in ANCHORS:
            progress((done + frame / ANCHORED) / len(trained), name)
            rng, missed = np.random.default_rng(frame), []
            for theme, clip in clips:
                moved = move_anchor(clip, frame, rng)
                seen = Observation.from_gaps(moved, [Gap(1, frame), Gap(frame + 1, ANCHORED - 1)])
                method = Cmib(theme if theme in card.labels else "", card)
                missed.append(method.complete(moved, seen).notes["missed"][frame])
            table.rows[name].append(float(np.mean(missed)))
    return table


def move_anchor(clip: Clip, frame: int, rng: np.random.Generator) -> Clip:
    """The clip with one frame moved over the floor, and its first and last frame turned to go there."""
    angle = rng.uniform(0, 2 * np.pi)
    translation, rotation = clip.translation.copy(), clip.rotation.copy()
    translation[frame, 0] += MOVED * np.array([np.cos(angle), 0.0, np.sin(angle)])
    for end, a, b in ((0, 0, frame), (len(clip) - 1, frame, len(clip) - 1)):
        before, after = (way[b] - way[a] for way in (clip.root, translation[:, 0]))
        turned = np.arctan2(after[0], after[2]) - np.arctan2(before[0], before[2])
        rotation[end, 0] = rotations.multiply(rotations.about("Y", np.array(turned)), rotation[end, 0])
    return clip.with_motion(rotation, translation)


def actions(
    data: Path, trained: Card, split: str = "validation", most: int | None = None, progress: Progress = _quiet
) -> list[Table]:
    """Table 6: L2P by what the motion is (rows) and what the network is told that it is (columns), a table a
    length. In how many rows the right action is as good as the best stands below each."""
    held = lafan1.load(data, split, lambda line: progress(0.0, line))
    groups: dict[str, list[Clip]] = {}
    for clip in held.sequences:
        groups.setdefault(lafan1.theme(clip.name), []).append(clip)
    themes = sorted(name for name in groups if name in trained.labels)
    tables = []
    for at, length in enumerate(LENGTHS):
        table = Table(
            f"L2P at {length} frames, {held.name}, {split} performer; columns are what is told:", themes
        )
        good = 0
        for row, theme in enumerate(themes):
            progress((at + row / len(themes)) / len(LENGTHS), f"{theme} at {length} frames")
            windows = lafan1.cut(groups[theme], RULES.window(length), lafan1.STEP, held.bones).spread(most)
            said = [
                lafan1.measure(held, RULES, windows, length, Cmib(told, trained), False) for told in themes
            ]
            table.rows[theme] = [one.l2p for one in said]
            good += table.rows[theme][row] <= CLOSE * min(table.rows[theme])
        table.remarks.append(
            f"The right action is the best, or within {100 * (CLOSE - 1):.0f} % of it, "
            f"in {good} of {len(themes)} rows."
        )
        tables.append(table)
    return tables
