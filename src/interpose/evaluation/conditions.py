"""What Kim et al. 2022 say of CMIB's conditions: rotations (table 1), anchors (table 5), actions (table 6).

All on windows of LAFAN1, as the network says it, with no finishing but that keys are met.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from interpose import datasets
from interpose.clip import Clip
from interpose.datasets import Entry
from interpose.datasets.catalogue import FPS
from interpose.errors import RequestError
from interpose.evaluation import lafan1
from interpose.evaluation.table import markdown
from interpose.geometry import rotations
from interpose.methods.cmib import Cmib
from interpose.methods.weights import Card
from interpose.observation import Gap, Observation
from interpose.resampling import resample
from interpose.skeletons import find_humanoid
from interpose.skeletons.body import facing

RULES = lafan1.PROTOCOLS["cmib"]
LENGTHS = (40, 60, 80, 120)  # frames, both keys counted
SHORT = (40, 60, 80)  # of HDM05, as in table 4
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
    methods: dict[str, Cmib | None] = {"interpolation": None}
    for card in trained:
        # Two that were trained alike: the folder tells them apart.
        name = _name(card)
        methods[f"{name}, {card.path.parent}" if name in methods else name] = Cmib("", card)
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
        digits=4,
    )
    for done, card in enumerate(trained):
        augmented = card.training.get("augmented", 0.0)
        name = f"{card.path.parent}, {'with' if augmented else 'without'} augmentation"
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


class _Cut:
    """A piece of a clip between two keys, on the canonical body: centred, its first frame facing X."""

    def __init__(self, clip: Clip) -> None:
        self.clip, self.body = clip, find_humanoid(clip)
        self.yaw, self.middle = 0.0, np.zeros(3)
        placed, _ = self.see(clip)
        self.yaw = float(np.pi / 2 - facing(placed[0]))
        self.middle = self.see(clip)[0][:, 0].mean(axis=0) * [1.0, 0.0, 1.0]

    def see(self, clip: Clip) -> tuple[np.ndarray, np.ndarray]:
        """Positions (F, 22, 3) and rotations (F, 22, 4), continuous in time, of the piece or a completion."""
        yaw = rotations.about("Y", np.array(self.yaw))
        turned = rotations.multiply(yaw, self.body.rotations(clip))
        placed = rotations.rotate(yaw, self.body.positions(clip) * self.body.scale)
        first = np.where(turned[:1, :, :1] < 0, -turned[:1], turned[:1])
        return placed - self.middle, rotations.continuous(np.concatenate([first, turned[1:]]))


def _cuts(entries: Sequence[Entry], length: int, progress: Progress) -> list[_Cut]:
    """All pieces of that many frames at 30 fps, STEP apart."""
    found = []
    for number, entry in enumerate(entries):
        progress(0.0, f"reading {number + 1} of {len(entries)} clips")
        clip = resample(entry.load(), FPS)
        found += [_Cut(clip.slice(a, a + length)) for a in range(0, len(clip) - length + 1, lafan1.STEP)]
    if not found:
        raise RequestError(
            "there is nothing to measure", f"no clip has {length} frames at 30 fps", "Add longer clips."
        )
    return found


def hdm05(
    data: Path, trained: Card, split: str = "validation", most: int | None = None, progress: Progress = _quiet
) -> list[Table]:
    """Table 4's columns of MPI-HDM05: L2P and L2Q between two keys, both counted, on the canonical body.

    The weights have seen nothing of this data set, unlike the paper's, which trained on three of its
    performers (bk, dg and mm). Mean and deviation of positions are of those of the split "train" here, bd, bk
    and dg, as mm is for validation. Cuts are short: there are few long ones.
    """
    known = [
        cut.see(cut.clip)[0] for cut in _cuts(datasets.clips("hdm05", data, "train"), SHORT[0], progress)
    ]
    flat = np.concatenate(known).reshape(-1, 66)
    statistics = lafan1.Statistics(flat.mean(axis=0), flat.std(axis=0))
    columns: list[str] = []
    rows: dict[str, dict[str, list[float]]] = {
        figure: {"interpolation": [], "cmib": []} for figure in ("L2P", "L2Q")
    }
    for at, length in enumerate(SHORT):
        cuts = _cuts(datasets.clips("hdm05", data, split), length, progress)
        cuts = [cuts[i] for i in np.linspace(0, len(cuts) - 1, min(most or len(cuts), len(cuts))).astype(int)]
        columns.append(f"{length} frames ({len(cuts)} cuts)")
        found: dict[str, list[tuple[float, float]]] = {name: [] for name in rows["L2P"]}
        for done, cut in enumerate(cuts):
            progress((at + done / len(cuts)) / len(SHORT), f"{length} frames")
            placed, turned = (one[None] for one in cut.see(cut.clip))
            seen = Observation.from_gaps(cut.clip, [Gap(1, length - 1)])
            filled = cut.see(Cmib("", trained).complete(cut.clip, seen).clip)
            for name, (q, p) in {
                "interpolation": lafan1.global_lines(turned, placed),
                "cmib": (filled[1][None], filled[0][None]),
            }.items():
                found[name].append((lafan1.l2p(p, placed, statistics)[0], lafan1.l2q(q, turned)[0]))
        for name, pairs in found.items():
            for figure, value in zip(rows, np.mean(pairs, axis=0)):
                rows[figure][name].append(float(value))
    return [Table(f"{figure}, HDM05, {split} performer:", columns, held) for figure, held in rows.items()]
