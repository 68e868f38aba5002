"""Table 3 of Hernandez Ruiz et al. 2019: joints, limbs, frames or single coordinates are missing.

Windows of 4 s of held-out performers, 20 frames as in the paper or 120, as positions of the canonical body,
which is as large as LAFAN1's actors. Between the first and the last frame, which stay, 80 % is hidden. The
error is the distance in millimetres between a hidden joint and where it is put, in the mean over all hidden
joints of all frames. A joint is hidden when one of its coordinates is; coordinates that are known of it are
left as they are.

The paper's caption says that joints and limbs are hidden frame by frame; its public code hides them for the
whole clip. Both are measured. The code also draws joints and frames with replacement, so that about 55 % of
them are hidden, and loses joints with all their coordinates in noisy transmission: `drawn="code"`.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from interpose.errors import RequestError, unknown
from interpose.evaluation.forecasters import thin
from interpose.evaluation.forecasting import SETTLED, named
from interpose.evaluation.table import markdown
from interpose.evaluation.windows import DATASETS, windows
from interpose.methods import cae, stmi_gan, weights
from interpose.methods.kalman import smooth
from interpose.methods.weights import Card
from interpose.observation import corruption
from interpose.skeletons import JOINTS

SECONDS = 4
FPS = 30  # of windows
RATES = (5, 30)  # frames a second at which they may be measured
HIDDEN = 0.8
GIVEN = ", as users get it"

# From positions (T, 22, 3) in metres, 0 where hidden, and which are known (T, 22, 3), to all positions.
Row = Callable[[np.ndarray, np.ndarray], np.ndarray]


def linear(positions: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Each coordinate goes straight from where it is known to where it is known next: that of a joint that is
    hidden for the whole clip from the first frame to the last."""
    filled, frames = positions.reshape(len(positions), -1).copy(), np.arange(len(positions))
    for column, seen in zip(filled.T, known.reshape(filled.shape).T):
        column[:] = np.interp(frames, frames[seen], column[seen])
    return filled.reshape(positions.shape)


def kalman(positions: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Low-rank Kalman smoothing. But for missing frames, only the first and the last frame are wholly known:
    it learns a single direction."""
    flat = len(positions), -1
    return smooth(positions.reshape(flat), known.reshape(flat)).reshape(positions.shape)


def autoencoder(positions: np.ndarray, known: np.ndarray) -> np.ndarray:
    """The installed `cae`, settled into what is known: of it only joints with all coordinates."""
    observed = np.all(known, axis=-1)
    _, _, completed = cae.run(weights.find("cae").onnx, positions[None], observed[None])
    return completed[0]


def inpainting(card: Card, positions: np.ndarray, known: np.ndarray) -> np.ndarray:
    """STMI-GAN's own motion, as in the paper; without noise."""
    return stmi_gan.run(card, positions[None], known[None])[0][0]


def given(card: Card, positions: np.ndarray, known: np.ndarray) -> np.ndarray:
    """The same as users get it: settled into joints that are known, in the mean with the mirror image."""
    return stmi_gan.run_both(card, positions[None], known[None])[1][0]


def sees(card: Card, rate: int) -> bool:
    """Whether weights of STMI-GAN see a window frame by frame at that rate."""
    return bool(card.training["network"]["frames"] == SECONDS * rate)


def networks(cards: Sequence[Card], rate: int) -> dict[str, Row]:
    """Rows for each of some weights of STMI-GAN, named as in table 1: as in the paper, and as users get it.

    Raises RequestError for weights that do not see windows frame by frame.
    """
    for card in cards:
        if not sees(card, rate):
            raise RequestError(
                f"cannot measure {card.path.parent}",
                f"it sees {card.training['network']['frames']} frames, and windows have {SECONDS * rate}",
                f"Add --fps {FPS if sees(card, FPS) else RATES[0]}.",
            )
    return {
        name + end: partial(fill, row.card)
        for name, row in named(cards).items()
        if row.card and not name.endswith(SETTLED)
        for end, fill in (("", inpainting), (GIVEN, given))
    }


ROWS: dict[str, Row] = {"linear": linear, "kalman": kalman}
DENSE: dict[str, Row] = {"cae": autoencoder}  # these know motion at 30 frames a second alone

# What is hidden, by how it is drawn: from a generator and T to (1, T, 22) or (1, T, 22, 3) of what is known.
J = len(JOINTS)
JOINTS_GONE, LIMBS_GONE = "joint occlusion, whole clip", "limb occlusion, whole clip"
FRAMES_GONE, NOISY = "missing frames", "noisy transmission"
PROBLEMS: dict[str, dict[str, Callable[[np.random.Generator, int], np.ndarray]]] = {
    "exact": {
        JOINTS_GONE: lambda g, t: corruption.occluded_joints_mask(g, 1, t, J, HIDDEN),
        "joint occlusion, per frame": lambda g, t: corruption.occluded_joints_mask(g, 1, t, J, HIDDEN, True),
        LIMBS_GONE: lambda g, t: corruption.occluded_chains_mask(g, 1, t, J, HIDDEN),
        "limb occlusion, per frame": lambda g, t: corruption.occluded_chains_mask(g, 1, t, J, HIDDEN, True),
        FRAMES_GONE: lambda g, t: corruption.missing_frames_mask(g, 1, t, J, HIDDEN),
        NOISY: lambda g, t: corruption.noisy_transmission_mask(g, 1, t, J, HIDDEN),
    },
    "code": {
        JOINTS_GONE: lambda g, t: corruption.occluded_joints_mask(g, 1, t, J, HIDDEN, repeats=True),
        LIMBS_GONE: lambda g, t: corruption.occluded_chains_mask(g, 1, t, J, HIDDEN),
        FRAMES_GONE: lambda g, t: corruption.missing_frames_mask(g, 1, t, J, HIDDEN, repeats=True),
        NOISY: lambda g, t: corruption.noisy_transmission_mask(g, 1, t, J, HIDDEN, by_joint=True),
    },
}
# Table 3: linear interpolation, low-rank Kalman smoothing, NoGAN and STMI-GAN on Human3.6M, in millimetres.
PAPER = {
    JOINTS_GONE: (232.06, 329.23, 96.52, 108.99),
    LIMBS_GONE: (209.45, 312.40, 123.07, 189.09),
    FRAMES_GONE: (50.42, 123.05, 72.67, 102.03),
    NOISY: (94.54, 308.98, 98.53, 110.29),
}


@dataclass
class Occlusion:
    """The figures.

    Attributes:
        split: whose windows.
        drawn: "exact" or "code".
        rate: frames a second.
        rows: names of what fills, linear first.
        counts: windows by data set.
        hidden: for each problem the share of joints that is hidden, of all frames but two, a window each.
        errors: by data set, problem and row every window's (sum of distances in mm, count).
    """

    split: str
    drawn: str
    rate: int
    rows: tuple[str, ...]
    counts: dict[str, int] = field(default_factory=lambda: defaultdict(int))
    hidden: dict[str, list[float]] = field(default_factory=lambda: defaultdict(list))
    errors: dict[str, dict[str, dict[str, list[tuple[float, int]]]]] = field(
        default_factory=lambda: defaultdict(lambda: defaultdict(lambda: defaultdict(list)))
    )

    def mean(self, group: str, problem: str, row: str) -> float:
        """Millimetres."""
        total, count = np.sum(self.errors[group][problem][row], axis=0)
        return float(total / count)

    def ratio(self, group: str, problem: str, row: str) -> float:
        """The error over that of linear interpolation."""
        return self.mean(group, problem, row) / self.mean(group, problem, "linear")

    def to_dict(self) -> dict[str, Any]:
        def entry(group: str, problem: str) -> dict[str, Any]:
            return {
                row: {"mean": self.mean(group, problem, row), "ratio": self.ratio(group, problem, row)}
                for row in self.rows
            }

        return {
            "protocol": "Hernandez Ruiz et al. 2019, table 3",
            "rate": self.rate,
            "split": self.split,
            "drawn": self.drawn,
            "windows": dict(self.counts),
            "unit": "mm",
            "hidden": {problem: float(np.mean(shares)) for problem, shares in self.hidden.items()},
            "errors": {
                group: {problem: entry(group, problem) for problem in problems}
                for group, problems in self.errors.items()
            },
        }

    def table(self, group: str = "all") -> str:
        """A Markdown table: mean error in mm, its ratio to linear interpolation, and the paper's figures."""
        lines = []
        for problem in self.errors[group]:
            means = [self.mean(group, problem, row) for row in self.rows]
            share = f"{100 * np.mean(self.hidden[problem]):.0f} %"
            paper = ", ".join(_cells(PAPER[problem])) if problem in PAPER else "-"
            lines.append([problem, share, *_cells(means), paper])
        head = ["", "joints hidden", *self.rows, "paper: linear, LR-Kalman, NoGAN, STMI-GAN"]
        return markdown(head, lines)

    def __str__(self) -> str:
        parts = [
            f"{group} ({self.counts[group]} windows, {self.split})\n\n{self.table(group)}"
            for group in sorted(self.errors, key=lambda name: name == "all")
        ]
        drawn = {
            "exact": "80 % of joints, frames or coordinates are hidden, of chains at least so many joints",
            "code": "drawn as the public code does, joints and frames with replacement",
        }
        return "\n\n".join([*parts, f"At {self.rate} fps, mm (ratio to linear); {drawn[self.drawn]}."])


def _cells(means: Sequence[float]) -> list[str]:
    """Figures, and behind all but the first their ratio to it."""
    return [f"{means[0]:.0f}", *(f"{mean:.0f} ({mean / means[0]:.2f})" for mean in means[1:])]


def run(
    data: Path,
    split: str = "validation",
    drawn: str = "exact",
    rate: int = RATES[0],
    most: int | None = None,
    progress: Callable[[float, str], None] = lambda share, line: None,
    networks: Mapping[str, Row] | None = None,
) -> Occlusion:
    """Measure all rows on the windows of a split; the same is hidden every time.

    Args:
        data: the folder that holds lafan1/ and bandai/.
        split: "validation", or "test" for final figures.
        drawn: "exact", or "code" as the public code hides.
        rate: frames a second that are measured: 5 as in the paper, or 30.
        most: windows per data set; None for all.
        progress: told how it goes.
        networks: more rows.

    Raises:
        RequestError: another split or way to draw; no weights of `cae`.
    """
    if drawn not in PROBLEMS:
        raise unknown("way to draw", drawn, PROBLEMS)
    rows = {**ROWS, **(DENSE if rate == FPS else {}), **(networks or {})}
    result, length = Occlusion(split, drawn, rate, tuple(rows)), SECONDS * FPS
    chosen = list(
        windows(data, DATASETS, split, length, length, most, progress=lambda line: progress(0.0, line))
    )
    for done, window in enumerate(chosen):
        truth = thin(window.body.as_canonical(window.clip)[None], FPS, rate)[0]
        groups = (window.dataset, "all")
        for group in groups:
            result.counts[group] += 1
        for number, (problem, draw) in enumerate(PROBLEMS[drawn].items()):
            mask = draw(np.random.default_rng((done, number)), len(truth))[0]
            known = np.broadcast_to(mask if mask.ndim == 3 else mask[..., None], truth.shape)
            lost = np.logical_not(np.all(known, axis=-1))
            result.hidden[problem].append(float(lost[1:-1].mean()))
            for row, fill in rows.items():
                filled = fill(np.where(known, truth, 0.0), known)
                wrong = 1000 * np.linalg.norm(np.where(known, 0.0, filled - truth), axis=-1)[lost]
                for group in groups:
                    result.errors[group][problem][row].append((float(wrong.sum()), wrong.size))
        progress((done + 1) / len(chosen), f"{done + 1} of {len(chosen)} windows")
    return result
