"""Windows of performers, held-out ones as a rule, cut the same way for every row of a table."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from interpose.clip import Clip
from interpose.datasets import clips
from interpose.errors import RequestError
from interpose.geometry.ground import turn
from interpose.observation import Gap, Observation
from interpose.skeletons import Humanoid, find_humanoid
from interpose.skeletons.body import facing

# What tables are measured on where they do not say otherwise: the sets whose clips are long enough.
DATASETS = ("lafan1", "bandai")


@dataclass(frozen=True)
class Window:
    """A piece of a clip at its own skeleton, the canonical positions (T, 22, 3) of it in metres, and what the
    data set calls the motion."""

    dataset: str
    clip: Clip
    body: Humanoid
    positions: np.ndarray
    label: str = ""

    def centred(self, gap: int) -> Gap:
        """The range of `gap` frames in the middle."""
        start = (len(self.clip) - gap) // 2
        return Gap(start, start + gap)

    def hide(self, gap: Gap) -> Observation:
        return Observation.from_gaps(self.clip, [gap] if len(gap) else [])

    def canonical(self, clip: Clip) -> np.ndarray:
        return self.body.positions(clip)

    def on_true_way(self, positions: np.ndarray) -> np.ndarray:
        """Poses (T, 22, 3) laid on the true trajectory: hips over the true point, facing the true way.

        So a trajectory does not count, as in Kaufmann et al. 2020, table 1 ("poses are root aligned").
        """
        return self.placed(turn(positions - _floor(positions), -facing(positions)[:, None]))

    def placed(self, body: np.ndarray) -> np.ndarray:
        """Poses (T, 22, 3) in the body's frame, laid on the true trajectory."""
        return turn(body, facing(self.positions)[:, None]) + _floor(self.positions)


def _floor(positions: np.ndarray) -> np.ndarray:
    """The points (T, 1, 3) on the floor below the hips."""
    return positions[:, :1] * [1.0, 0.0, 1.0]


def windows(
    data: Path,
    datasets: tuple[str, ...],
    split: str,
    length: int = 120,
    step: int = 120,
    most: int | None = None,
    progress: Callable[[str], None] = lambda line: None,
    by_label: bool = False,
) -> Iterator[Window]:
    """Whole windows of the performers of a split, at 30 fps.

    Args:
        data: the folder that holds the data sets.
        split: "validation" for development, "test" for final figures; "train" for what networks have seen.
        length, step: frames.
        most: windows per data set, spread evenly over all of them; None for all.
        by_label: so many of each label instead.

    Raises:
        RequestError: an unknown split, or none of its clips is as long.
    """
    there = False
    for dataset in datasets:
        entries = clips(dataset, data, split)
        progress(f"{dataset}: reading {len(entries)} clips")
        starts: dict[str, list[tuple[str, Clip, int]]] = defaultdict(list)
        for entry in entries:
            clip = entry.load()
            every = max(1, round(clip.fps / 30.0))
            clip = Clip(
                clip.skeleton,
                clip.rotation[::every],
                clip.translation[::every],
                clip.fps / every,
                clip.translated,
                entry.path.stem,
            )
            starts[entry.label if by_label else ""] += [
                (entry.label, clip, start) for start in range(0, len(clip) - length + 1, step)
            ]
        for some in starts.values():
            count = len(some) if most is None else min(most, len(some))
            for i in np.linspace(0, len(some) - 1, count).astype(int):
                label, clip, start = some[i]
                cut = clip.slice(start, start + length)
                body = find_humanoid(cut)
                there = True
                yield Window(dataset, cut, body, body.positions(cut), label)
    if not there:
        raise RequestError(
            "there is nothing to measure with",
            f"{data} holds no clip of {length / 30:g} s of a {split} performer ({', '.join(datasets)})",
            "Unpack the whole data sets there: docs/data.md.",
        )
