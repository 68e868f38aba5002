"""What an animator would send back, and a mean error does not show: snaps, scuffing, squats, frozen feet.

Windows of held-out performers with a gap in their middle, or between lone keys, or at their end; each kind of
fault is counted in what a user gets, beside what people themselves do in the same frames.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from interpose.evaluation.table import markdown
from interpose.evaluation.windows import DATASETS, windows
from interpose.finish import complete, feet
from interpose.geometry import measures
from interpose.geometry.time import runs
from interpose.methods import registry
from interpose.observation import Gap, Observation
from interpose.skeletons import JOINTS

FRAMES = 150
METHODS = ("spline", "small", "base")
TRUTH = "people"
ANKLES = [JOINTS.index(side + "Foot") for side in ("Left", "Right")]
TOES = [JOINTS.index(side + "Toe") for side in ("Left", "Right")]
FEET = [*ANKLES, *TOES]

# A joint's velocity jumps so many times as far as anywhere in the truth, and as so many m/s^2 at least.
SNAPS, JERKS = 2.0, 15.0
# A step is as fast (m/s) and goes as far (m); its toe clears the floor by less than so many metres in
# one that scuffs. What is begun higher above the lowest toe is no step.
STEPS, STEP, CLEARS, HIGH = 0.35, 0.25, 0.025, 0.12
# Metres by which hips get lower than anywhere in the truth, and feet; metres that feet drift in a stance.
SQUATS, SINKS, DRIFTS = 0.10, 0.05, 0.08
# The share of how much a body stirs around a gap below which it has frozen in it.
FROZEN = 0.5


@dataclass(frozen=True)
class Seen:
    """A motion and the truth, (T, 22, 3) metres of a body of the usual size, and the gap that is judged."""

    motion: np.ndarray
    truth: np.ndarray
    fps: float
    gap: Gap

    @property
    def inner(self) -> slice:
        return slice(self.gap.start, self.gap.stop)


def snaps(seen: Seen) -> tuple[int, int]:
    """Fills in which a joint's velocity jumps as it does nowhere in the truth."""
    own, true = (
        np.pad(measures.acceleration(p) * seen.fps**2, ((1, 1), (0, 0))) for p in (seen.motion, seen.truth)
    )
    beside = slice(max(seen.gap.start - 1, 0), seen.gap.stop + 1)
    return int((own[beside] > SNAPS * np.maximum(true.max(axis=0), JERKS)).any()), 1


def scuffs(seen: Seen) -> tuple[int, int]:
    """Steps whose toe does not leave the floor."""
    scuffed = steps = 0
    lowest = seen.truth[:, TOES, 1].min()
    for toe in TOES:
        way = seen.motion[:, toe]
        fast = np.zeros(len(way), bool)
        fast[1:] = np.linalg.norm(np.diff(way[:, [0, 2]], axis=0), axis=-1) * seen.fps > STEPS
        for start, stop in runs(fast):
            if start < max(seen.gap.start, 1) or stop > min(seen.gap.stop, len(way) - 1):
                continue
            ends = way[[start - 1, stop]]
            if np.linalg.norm(np.diff(ends[:, [0, 2]], axis=0)) < STEP or ends[:, 1].min() > lowest + HIGH:
                continue
            steps += 1
            scuffed += int(way[start:stop, 1].max() - ends[:, 1].min() < CLEARS)
    return scuffed, steps


def squats(seen: Seen) -> tuple[int, int]:
    """Fills in which the hips sink below where they are anywhere in the truth."""
    return int(seen.motion[seen.inner, 0, 1].min() < seen.truth[:, 0, 1].min() - SQUATS), 1


def sinks(seen: Seen) -> tuple[int, int]:
    """Fills in which a foot is under the floor."""
    return int((seen.motion[seen.inner][:, FEET, 1] < seen.truth[:, FEET, 1].min() - SINKS).any()), 1


def drifts(seen: Seen) -> tuple[int, int]:
    """Fills in which a foot that stands drifts."""
    floor = seen.truth[:, FEET, 1].min(axis=0)
    motion = seen.motion[seen.inner][:, FEET]
    furthest = measures.stance_drift(motion, seen.fps, np.broadcast_to(floor, motion.shape[:2]))[0]
    return int(furthest > DRIFTS), 1


def glides(seen: Seen) -> tuple[int, int]:
    """Frames in which the body travels on no foot."""
    both = np.stack([seen.motion[:, ANKLES], seen.motion[:, TOES]], axis=2)
    return int(measures.glides(both, seen.motion[:, 0], seen.fps)[seen.inner].sum()), len(seen.gap)


def freezes(seen: Seen) -> tuple[int, int]:
    """Fills in which the body hardly stirs between where it does."""
    stirs = measures.liveliness(seen.motion, seen.gap.start, seen.gap.stop, seen.fps)
    return (0, 0) if stirs is None else (int(stirs < FROZEN), 1)


# What is counted, and in words what it is a share of.
KINDS: dict[str, Callable[[Seen], tuple[int, int]]] = {
    "snaps": snaps,
    "scuffing steps": scuffs,
    "squats": squats,
    "feet under the floor": sinks,
    "stances that drift": drifts,
    "gliding frames": glides,
    "frozen": freezes,
}

# Frames missing, and known before and after.
TASKS: dict[str, tuple[int, int, int]] = {
    "gap of 1 s": (30, 60, 60),
    "gap of 2 s": (60, 45, 45),
    "gap of 3 s": (90, 30, 30),
    "1 s between two keys": (30, 1, 1),
    "2 s between two keys": (60, 1, 1),
    "forecast of 1 s": (30, 60, 0),
}


@dataclass
class Artefacts:
    """The figures: `counts[task][kind][who]`, how many were found and of how many."""

    split: str
    methods: tuple[str, ...]
    count: int = 0
    counts: dict[str, dict[str, dict[str, list[int]]]] = field(
        default_factory=lambda: defaultdict(lambda: defaultdict(lambda: defaultdict(lambda: [0, 0])))
    )

    def add(self, task: str, who: str, seen: Seen) -> None:
        for kind, judge in KINDS.items():
            for i, number in enumerate(judge(seen)):
                self.counts[task][kind][who][i] += number

    def share(self, task: str, kind: str, who: str) -> float | None:
        """None where there is nothing of which it would be one."""
        found, of = self.counts[task][kind][who]
        return found / of if of else None

    def to_dict(self) -> dict[str, Any]:
        return {
            "split": self.split,
            "windows": self.count,
            "found_of": {
                task: {kind: {who: list(pair) for who, pair in rows.items()} for kind, rows in kinds.items()}
                for task, kinds in self.counts.items()
            },
        }

    def table(self) -> str:
        rows = []
        for task in self.counts:
            for who in (TRUTH, *self.methods):
                shares = [self.share(task, kind, who) for kind in KINDS]
                rows.append([task, who, *("-" if s is None else f"{100 * s:.1f}" for s in shares)])
        return markdown(["", "by", *KINDS], rows)

    def __str__(self) -> str:
        told = (
            f"Per cent of fills, steps or frames; {self.count} windows of {self.split} performers. A snap: "
            f"a joint's velocity jumps {SNAPS:.0f} times as far as anywhere in the truth. A squat: hips get "
            f"{100 * SQUATS:.0f} cm lower than in all of it; feet under the floor: {100 * SINKS:.0f} cm. "
            f"Scuffing: the toe is not lifted by {100 * CLEARS:.1f} cm in a step. A stance drifts by over "
            f"{100 * DRIFTS:.0f} cm. Frozen: the body stirs less than {FROZEN:.1g} times as much as around."
        )
        return f"{self.table()}\n\n{told}"


def run(
    data: Path,
    methods: Sequence[str],
    split: str = "validation",
    most: int | None = 20,
    progress: Callable[[float, str], None] = lambda share, line: None,
) -> Artefacts:
    """Count what an animator would send back.

    Args:
        data: the folder that holds lafan1/ and bandai/.
        methods: by name; one that refuses something has what it falls back to counted.
        split: "validation", or "test" for final figures.
        most: windows of each data set; None for all.
        progress: told how it goes.

    Raises:
        RequestError: an unknown method or split.
    """
    chosen = {name: registry.get(name) for name in methods}
    held = list(windows(data, DATASETS, split, FRAMES, FRAMES, most, lambda line: progress(0.0, line)))
    result = Artefacts(split, tuple(methods), len(held))
    for done, window in enumerate(held):
        size = feet.size(window.clip.skeleton)
        for task, (length, before, after) in TASKS.items():
            first = (FRAMES - length) // 2 - before
            clip = window.clip.slice(first, first + before + length + after)
            truth = window.positions[first : first + len(clip)] / size
            gap = Gap(before, before + length)
            hidden = Observation.from_gaps(clip, [gap])
            motions = {name: complete(clip, hidden, method).clip for name, method in chosen.items()}
            for who, motion in {TRUTH: clip, **motions}.items():
                result.add(task, who, Seen(window.canonical(motion) / size, truth, motion.fps, gap))
        progress((done + 1) / len(held), f"{done + 1} of {len(held)} windows")
    return result
