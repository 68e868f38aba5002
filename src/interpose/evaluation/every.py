"""One table of accuracy over all tasks: is one network as good as those that were made for each?

Windows of 4 s of held-out performers, each on its own skeleton; every task hides the same of them from every
method, and what is measured is what a user gets: finished motion, as the mean distance in centimetres between
joints of it and of the truth, over the frames and joints that the task hides. A method that refuses is left
out; what fell back to a simpler one counts as it came.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from interpose.evaluation.table import markdown
from interpose.evaluation.windows import DATASETS, Window, windows
from interpose.finish import complete
from interpose.methods import registry
from interpose.observation import Gap, Observation
from interpose.observation.corruption import LIMBS
from interpose.skeletons import JOINTS, PARENTS
from interpose.skeletons.carrier import place_of

FRAMES = 120
LEGS = tuple(joint for limb in LIMBS for joint in limb if JOINTS[limb[0]].endswith("UpLeg"))


@dataclass(frozen=True)
class Hidden:
    """What a task hides of a window.

    Attributes:
        shown: the frames start to stop - 1 that a method gets at all.
        observation: of these.
        judged: (frames shown, 22) which joints are measured.
    """

    shown: tuple[int, int]
    observation: Observation
    judged: np.ndarray


def _gap(window: Window, length: int, before: int, after: int, keys: Sequence[int] = ()) -> Hidden:
    """A gap in the middle with so many known frames on either side, and keys inside of it."""
    start = (FRAMES - length) // 2
    first, last = max(start - before, 0), min(start + length + after, FRAMES)
    clip = window.clip.slice(first, last)
    ends = [start - first, *(start - first + key for key in keys), start - first + length]
    cuts = [(a + (i > 0), b) for i, (a, b) in enumerate(zip(ends, ends[1:]))]
    seen = Observation.from_gaps(clip, [Gap(a, b) for a, b in cuts if b > a])
    return Hidden((first, last), seen, np.repeat(~seen.frames[:, None], len(JOINTS), axis=1))


def _joints(window: Window, *losses: tuple[Sequence[int], int, int]) -> Hidden:
    """Canonical joints whose rotations are unknown from one frame to before another; what hangs from them is
    measured."""
    mapping, gaps, moved = window.body.mapping, [], np.zeros((FRAMES, len(JOINTS)), bool)
    for rows, start, stop in losses:
        # Of what the skeleton does not have nothing is hidden.
        lost = {row: joint for row in rows if (joint := mapping.joints[row]) is not None}
        names = [window.clip.skeleton.names[joint] for joint in lost.values()]
        gaps += [Gap(start, stop, tuple(names))] if names else []
        below = {*lost}
        for joint, parent in enumerate(PARENTS):
            if parent in below:
                below.add(joint)
        moved[start:stop] |= np.array([PARENTS[joint] in below for joint in range(len(JOINTS))])
    return Hidden((0, FRAMES), Observation.from_gaps(window.clip, gaps), moved)


def _place(window: Window, length: int) -> Hidden:
    """Where the body is, in so many frames in the middle; all turns are known."""
    start = (FRAMES - length) // 2
    seen, clip = Observation.full(window.clip), window.clip
    seen.translation[start : start + length, place_of(clip)] = False
    return Hidden((0, FRAMES), seen, np.repeat(~seen.frames[:, None], len(JOINTS), axis=1))


def _draw(window: Window, rng: np.random.Generator, count: int) -> list[int]:
    """So many joints that the skeleton has, other than the hips, each with something that hangs from it."""
    inner = sorted({*PARENTS} & {*window.body.mapping.mapped[0]} - {0})
    return [int(joint) for joint in rng.permutation(inner)[:count]]


ALL = FRAMES  # as much as there is
TASKS: dict[str, Callable[[Window, np.random.Generator], Hidden]] = {
    "gap of .17 s": lambda w, rng: _gap(w, 5, ALL, ALL),
    "gap of .5 s": lambda w, rng: _gap(w, 15, ALL, ALL),
    "gap of 1 s": lambda w, rng: _gap(w, 30, ALL, ALL),
    "gap of 2 s": lambda w, rng: _gap(w, 60, ALL, ALL),
    "1 s, one frame before, one after": lambda w, rng: _gap(w, 30, 1, 1),
    "1 s, five before, one after": lambda w, rng: _gap(w, 30, 5, 1),
    "1 s, ten before, one after": lambda w, rng: _gap(w, 30, 10, 1),
    "2 s between keys, one in the middle": lambda w, rng: _gap(w, 60, 1, 1, [30]),
    "one joint lost": lambda w, rng: _joints(w, (_draw(w, rng, 1), 0, FRAMES)),
    "three joints lost": lambda w, rng: _joints(w, (_draw(w, rng, 3), 0, FRAMES)),
    "an arm or a leg lost": lambda w, rng: _joints(w, (LIMBS[rng.integers(len(LIMBS))], 0, FRAMES)),
    "legs from the upper body": lambda w, rng: _joints(w, (LEGS, 0, FRAMES)),
    # Whatever the method, it is what the body stands on that tells it.
    "where the body is lost for 2 s, all turns known": lambda w, rng: _place(w, 60),
    "forecast of 1 s": lambda w, rng: _gap(w, 30, ALL, 0),
    # Each before the one ahead is back.
    "arms and legs lost in turn, 1 s each": lambda w, rng: _joints(
        w, *((limb, 15 + 20 * i, 45 + 20 * i) for i, limb in enumerate(LIMBS))
    ),
}


@dataclass
class Every:
    """The figures: `errors[task][method]`, a mean in cm for each window."""

    split: str
    methods: tuple[str, ...]
    count: int = 0
    errors: dict[str, dict[str, list[float]]] = field(
        default_factory=lambda: defaultdict(lambda: defaultdict(list))
    )
    fell: dict[str, dict[str, int]] = field(default_factory=lambda: defaultdict(lambda: defaultdict(int)))

    def mean(self, task: str, method: str) -> float | None:
        """In cm; None for a method that refused in some window."""
        held = self.errors[task][method]
        return float(np.mean(held)) if len(held) == self.count else None

    def to_dict(self) -> dict[str, Any]:
        return {
            "split": self.split,
            "windows": self.count,
            "unit": "cm",
            "errors": {task: {m: self.mean(task, m) for m in self.methods} for task in self.errors},
            "fell_back": {task: dict(held) for task, held in self.fell.items()},
        }

    def table(self) -> str:
        rows = []
        for task in self.errors:
            means = [self.mean(task, method) for method in self.methods]
            best = min((value for value in means if value is not None), default=None)
            cells = ["-" if v is None else f"**{v:.2f}**" if v == best else f"{v:.2f}" for v in means]
            rows.append([task, *cells])
        return markdown(["", *self.methods], rows)

    def __str__(self) -> str:
        fell = ", ".join(
            f"{method} {count} times ({task})"
            for task, held in self.fell.items()
            for method, count in held.items()
        )
        return "\n\n".join(
            [
                self.table(),
                f"Mean error in cm of hidden joints, of finished motion; {self.count} windows of "
                f"{self.split} performers. The best is bold; - refuses.",
                f"Fell back to a simpler method: {fell or 'never'}.",
            ]
        )


def run(
    data: Path,
    methods: Sequence[str],
    split: str = "validation",
    most: int | None = 8,
    progress: Callable[[float, str], None] = lambda share, line: None,
) -> Every:
    """Measure methods in every task.

    Args:
        data: the folder that holds lafan1/ and bandai/.
        methods: by name.
        split: "validation", or "test" for final figures.
        most: windows of each data set; None for all.
        progress: told how it goes.

    Raises:
        RequestError: an unknown method or split.
    """
    chosen = {name: registry.get(name) for name in methods}
    held = list(
        windows(data, DATASETS, split, FRAMES, FRAMES, most, progress=lambda line: progress(0.0, line))
    )
    result = Every(split, tuple(methods), len(held))
    for done, window in enumerate(held):
        for number, (task, hide) in enumerate(TASKS.items()):
            own = result.errors[task]  # a row even where all refuse
            hidden = hide(window, np.random.default_rng((done, number)))
            clip, truth = window.clip.slice(*hidden.shown), window.positions[slice(*hidden.shown)]
            gaps = hidden.observation.gaps(clip.skeleton)
            for name, method in chosen.items():
                if any(method.refuses(clip, gap) for gap in gaps):
                    continue
                filled = complete(clip, hidden.observation, method)
                off = np.linalg.norm(window.canonical(filled.clip) - truth, axis=-1)
                own[name].append(100 * float(off[hidden.judged].mean()))
                if any(gap.method != method.name for gap in filled.report.gaps):
                    result.fell[task][name] += 1
        progress((done + 1) / len(held), f"{done + 1} of {len(held)} windows")
    return result
