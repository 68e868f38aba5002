"""Table 1 of Hernandez Ruiz et al. 2019: whether forecasts go on moving as people do, second by second.

Windows of 6 s of held-out performers: 2 s are seen, 4 s are forecast. Spectra are taken of joint angles, that
is of poses alone, at 5 frames a second, as in the paper, whose seconds have five frames; forecasts that come
at 30 are sampled down. What else section 7.1 says follows: distances to the truth, which a pose that hardly
moves does well by, and how far forecasts lie apart that other noise makes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from interpose.evaluation import forecasters, spectrum
from interpose.evaluation.forecasters import AHEAD, FPS, SEEN, Forecaster, Motions, thin, upright
from interpose.evaluation.table import markdown
from interpose.geometry import kinematics
from interpose.geometry.time import sample_smooth
from interpose.methods import weights
from interpose.methods.weights import Card
from interpose.skeletons import PARENTS
from interpose.skeletons.humanoid import pose_of

SPANS = ((0, 1), (1, 2), (2, 3), (3, 4), (0, 4))  # seconds of the forecast
HORIZONS = (0.5, 1.0, 2.0, 4.0)  # seconds
RATES = (5, 30)  # frames a second at which forecasts may be measured
VARIANTS = ("paper", "code")  # of spectra: by the paper's formulas, or as its public code computes them

# What the discriminator looks at: the row of table 1.
KINDS = {
    (): "NoGAN",
    ("base",): "Base disc",
    ("base", "edm"): "+EDM disc",
    ("base", "motion"): "+Motion disc",
    ("base", "edm", "motion"): "STMI-GAN",
}
SETTLED = ", settled"
# Table 1 itself, on Human3.6M: PSEnt and the columns that are headed PSKL(GT, Gen) and PSKL(Gen, GT), over
# each of SPANS. The public code, which printed them, prints PSKL(Gen, GT) first: see `published`.
PUBLISHED = {
    "data": (
        (0.67990, 0.00590, 0.00572),
        (0.67749, 0.00628, 0.00611),
        (0.67391, 0.00640, 0.00620),
        (0.67891, 0.00590, 0.00566),
        (1.65373, 0.01225, 0.01227),
    ),
    "seq2seq": (
        (0.37492, 0.03293, 0.04524),
        (0.20975, 0.10188, 0.17004),
        (0.12752, 0.17402, 0.33566),
        (0.09333, 0.18692, 0.37605),
        (0.85732, 0.13320, 0.15644),
    ),
    "NoGAN": (
        (0.44363, 0.03729, 0.05040),
        (0.27969, 0.07989, 0.13743),
        (0.34717, 0.06099, 0.09562),
        (0.26750, 0.08672, 0.15567),
        (1.07468, 0.10245, 0.12508),
    ),
    "Base disc": (
        (0.73626, 0.01198, 0.01149),
        (0.60450, 0.01559, 0.01766),
        (0.60804, 0.01396, 0.01611),
        (0.50224, 0.02646, 0.03460),
        (1.58270, 0.02197, 0.02274),
    ),
    "+EDM disc": (
        (0.57045, 0.01801, 0.02131),
        (0.49198, 0.02546, 0.03315),
        (0.45627, 0.03368, 0.04596),
        (0.41653, 0.04516, 0.06541),
        (1.22901, 0.08416, 0.09894),
    ),
    "+Motion disc": (
        (0.72617, 0.01220, 0.01141),
        (0.72963, 0.01223, 0.01129),
        (0.72368, 0.01312, 0.01201),
        (0.76111, 0.01436, 0.01275),
        (1.77806, 0.02434, 0.02270),
    ),
    "STMI-GAN": (
        (0.68099, 0.01090, 0.01125),
        (0.68328, 0.01041, 0.01010),
        (0.71778, 0.01306, 0.01213),
        (0.70985, 0.01108, 0.01024),
        (1.69147, 0.01888, 0.01801),
    ),
}
PUBLISHED_SPREAD = (0.81, 3.02)  # mm: expected, and the most over 4 s


def published(kind: str) -> list[tuple[float, float, float]]:
    """PSEnt, PSKL(GT, Gen), PSKL(Gen, GT) of a row of table 1 over each of SPANS; [] for what is none.

    Under the headings that they belong to: networks that come to rest are further from people's motion that
    way, PSKL(GT, Gen), than people are from theirs; seq2seq is in every second here.
    """
    return [(entropy, there, back) for entropy, back, there in PUBLISHED.get(kind, ())]


Progress = Callable[[float, str], None]


@dataclass
class Row:
    """A row of the tables.

    Attributes:
        forecast: how it goes on; None for the training performers' own motions.
        kind: the row of PUBLISHED, if it is one.
        fps: at which forecasts come.
        card: of its weights.
        spectra: PSEnt, PSKL(GT, Gen), PSKL(Gen, GT) over each of SPANS, by variant.
        off, turned: distance to the truth up to each of HORIZONS, in mm and over Euler angles.
        spread: mm between forecasts by other noise up to each of HORIZONS, and the most of any frame; empty
            for what knows no noise.
        frechet: distance to the truth; None where it could not be measured.
        shown: of each of the windows that are shown, the distance over Euler angles up to 2 s, and how much
            moves in them as a share of the truth.
    """

    forecast: Forecaster | None
    kind: str = ""
    fps: float = FPS
    card: Card | None = None
    spectra: dict[str, list[tuple[float, float, float]]] = field(default_factory=dict)
    off: list[float] = field(default_factory=list)
    turned: list[float] = field(default_factory=list)
    spread: list[float] = field(default_factory=list)
    frechet: float | None = None
    shown: list[tuple[float, float]] = field(default_factory=list)

    def to_dict(self) -> dict[str, Any]:
        names = ("psent", "pskl_gt_gen", "pskl_gen_gt")
        return {
            "weights": str(self.card.path.parent) if self.card else None,
            "spectra": {
                variant: {_words(span): dict(zip(names, figures)) for span, figures in zip(SPANS, held)}
                for variant, held in self.spectra.items()
            },
            "published": {
                _words(span): dict(zip(names, figures)) for span, figures in zip(SPANS, published(self.kind))
            },
            "l2": dict(zip(map(str, HORIZONS), self.off)),
            "euler_l2": dict(zip(map(str, HORIZONS), self.turned)),
            "diversity": dict(zip((*map(str, HORIZONS), "most"), self.spread)),
            "frechet": self.frechet,
            "shown": [{"euler_l2": off, "moves": moves} for off, moves in self.shown],
        }


@dataclass
class Forecasting:
    """The figures of all rows.

    Attributes:
        split: whose windows.
        rate: frames a second that were measured.
        variant: of the spectra that are printed.
        counts: windows by data set, and how many of the training performers.
        rows: by name.
        shown: numbers and names of the windows that are shown one by one.
        encoder: the first figures of the hash of the network whose features Frechet distances are of.
    """

    split: str
    rate: int
    variant: str
    counts: dict[str, int]
    rows: dict[str, Row]
    shown: dict[int, str] = field(default_factory=dict)
    encoder: str = ""

    def to_dict(self) -> dict[str, Any]:
        return {
            "protocol": "Hernandez Ruiz et al. 2019, table 1",
            "split": self.split,
            "rate": self.rate,
            "windows": self.counts,
            "units": {"psent": "nats", "l2": "mm", "euler_l2": "radians", "diversity": "mm"},
            "frechet_encoder": self.encoder,
            "shown": list(self.shown.values()),
            "rows": {name: row.to_dict() for name, row in self.rows.items()},
            "targets": [
                {"target": words, "value": value, "limit": limit, "met": good}
                for words, value, limit, good in self.targets()
            ],
        }

    def table(self) -> str:
        """Markdown: spectra by second, with the paper's own figures beside them."""
        figures = ("PSEnt", "PSKL(GT, Gen)", "PSKL(Gen, GT)")
        lines = []
        for at, span in enumerate(SPANS):
            lines.append([f"**{_words(span)}**", *[""] * 6])
            for name, row in self.rows.items():
                paper = published(row.kind)[at] if row.kind in PUBLISHED else ()
                cells = [f"{value:.5f}" for value in (*row.spectra[self.variant][at], *paper)]
                lines.append([name, *cells, *["-"] * (6 - len(cells))])
        return markdown(["", *figures, *(f"paper: {name}" for name in figures)], lines)

    def distance_table(self) -> str:
        """Markdown: distances to the truth by horizon, in mm and over Euler angles, and Frechet's."""
        head = [*(f"mm, {h:g} s" for h in HORIZONS), *(f"Euler, {h:g} s" for h in HORIZONS), "Frechet"]
        lines = []
        for name, row in self.rows.items():
            cells = [*(f"{v:.1f}" for v in row.off), *(f"{v:.2f}" for v in row.turned)]
            frechet = "-" if row.frechet is None else f"{row.frechet:.3f}"
            lines.append([name, *(cells or ["-"] * 8), frechet])
        return markdown(["", *head], lines)

    def spread_table(self) -> str:
        """Markdown: how far forecasts lie apart that other noise makes, in mm; "" where there are none."""
        lines = [[name, *(f"{v:.2f}" for v in row.spread)] for name, row in self.rows.items() if row.spread]
        mean, most = PUBLISHED_SPREAD
        lines.append(["paper", *["-"] * (len(HORIZONS) - 1), f"{mean:.2f}", f"{most:.2f}"])
        head = [*(f"mm, {h:g} s" for h in HORIZONS), "most"]
        return markdown(["", *head], lines) if len(lines) > 1 else ""

    def shown_table(self) -> str:
        """Markdown: distances over Euler angles of single windows, and in brackets how much moves there."""
        lines = [
            [name, *(f"{off:.2f} ({moves:.2f})" for off, moves in row.shown)]
            for name, row in self.rows.items()
            if row.shown
        ]
        return markdown(["Euler, 2 s (motion)", *(f"{i}: {name}" for i, name in self.shown.items())], lines)

    def targets(self) -> list[tuple[str, float, str, bool]]:
        """What STMI-GAN is meant to reach: in words, the figure, its limit, whether it is met."""
        found = []
        truth = np.array(self.rows[_data(self.split)].spectra[self.variant])[:-1]
        for name, row in self.rows.items():
            if row.kind != "STMI-GAN":
                continue
            entropy, there, _ = ours = np.array(row.spectra[self.variant])[:-1].T
            rivals = {
                rival: np.array(other.spectra[self.variant])[:-1, 1]
                for rival, other in self.rows.items()
                if other.kind == "seq2seq" or (other.kind == "NoGAN" and _config(other) == _config(row))
            }
            figures = [
                ("PSEnt off the data's, at worst", np.abs(entropy / truth[:, 0] - 1).max(), 0.1, True),
                ("PSEnt of the last second to the first's", entropy[-1] / entropy[0], 0.9, False),
                ("PSKL one way to the other, at worst", (ours[1:].max(0) / ours[1:].min(0)).max(), 1.5, True),
                *(
                    (f"PSKL(GT, Gen) of {rival} to this, at worst", (theirs / there).min(), 3.0, False)
                    for rival, theirs in rivals.items()
                ),
            ]
            for words, value, limit, below in figures:
                good = bool(value <= limit if below else value >= limit)
                sign = "at most" if below else "at least"
                found.append((f"{name}: {words}", float(value), f"{sign} {limit:g}", good))
        return found

    def __str__(self) -> str:
        counts = ", ".join(f"{count} of {name}" for name, count in self.counts.items())
        how = {
            "paper": "by the paper's formulas, a spectrum a sequence",
            "code": "as the paper's public code computes them, from which its table is: spectra pooled over "
            "all sequences, of angles that were converted twice",
        }[self.variant]
        checks = [
            f"{'met   ' if good else 'missed'}  {words}: {value:.2f}, {limit}"
            for words, value, limit, good in self.targets()
        ]
        notes = [
            f"{name}: {row.card.training['parameters']:,} parameters, "
            f"{row.card.training['device_hours']:.2f} h of training, {row.card.path.parent}."
            for name, row in self.rows.items()
            if row.card
        ]
        frechet = (
            f"Frechet distances are of the bottleneck of cae ({self.encoder})."
            if self.encoder
            else "Frechet distances need the package onnx: pip install 'interpose[train]'."
        )
        spread = self.spread_table()
        return "\n\n".join(
            part
            for part in [
                f"Forecasts of 4 s from 2 s, {self.split} performers (windows: {counts}), at {self.rate} "
                f"fps. Spectra of joint angles, in nats, {how}. The paper's own figures are on Human3.6M.",
                self.table(),
                "Distance to the truth, in the mean over the frames up to each horizon: in mm and the mean "
                "over joints, place and heading included, which seq2seq leaves as they were; and over Euler "
                f"angles (radians, all joints together), which are of poses alone. {frechet}",
                self.distance_table(),
                spread
                and "How far forecasts lie apart that other noise makes: mm, in the mean over joints "
                "and over the frames up to each horizon; and the most of any window and frame.",
                spread,
                "What the distance to the truth prefers, on four windows: over Euler angles up to 2 s, and "
                "in brackets how much the pose moves, as a share of the truth.",
                self.shown_table(),
                "\n".join(notes),
                "\n".join(checks),
            ]
            if part
        )


def _words(span: tuple[int, int]) -> str:
    return f"{span[0]} to {span[1]} s"


def _data(split: str) -> str:
    """The row of what real motions of others are like."""
    return f"{split} vs train"


def _config(row: Row) -> str:
    """Which of its networks was trained: "paper" or "dense" of STMI-GAN."""
    return str(row.card.training.get("config", "")) if row.card else ""


def named(cards: Sequence[Card]) -> dict[str, Row]:
    """A row for each of some weights, named by how they were trained; for STMI-GAN one more, of what users
    get, settled into what was seen."""
    rows: dict[str, Row] = {}
    for card in cards:
        kind = card.method
        if "network" in card.training:
            kind = KINDS.get(tuple(card.training["network"]["branches"]), kind)
        row = Row(forecasters.TRAINED[card.method](card), kind, card.fps, card)
        name = ", ".join(part for part in (kind, _config(row)) if part)
        # Two that were trained alike, by another budget or seed: the folder tells them apart.
        name = f"{name}, {card.path.parent}" if name in rows else name
        rows[name] = row
        if card.method == "stmi-gan" and kind == "STMI-GAN":
            rows[name + SETTLED] = Row(forecasters.inpainting(card, settled=True), "", card.fps, card)
    return rows


def run(
    data: Path,
    split: str = "validation",
    trained: Sequence[Card] = (),
    rate: int = RATES[0],
    variant: str = VARIANTS[0],
    samples: int = 5,
    most: int | None = None,
    progress: Progress = lambda share, line: None,
) -> Forecasting:
    """Measure all rows on the windows of a split.

    Args:
        data: the folder that holds lafan1/ and bandai/.
        split: "validation", or "test" for final figures.
        trained: weights that forecast, a row each.
        rate: frames a second that are measured. Networks that make fewer are left out.
        variant: of the spectra that are printed; both are measured.
        samples: forecasts of each window, by other noise, of networks that know noise; the first counts.
        most: windows of each data set; None for all.
        progress: told how it goes.
    """
    told = lambda line: progress(0.0, line)  # noqa: E731
    train, motions = (forecasters.read(data, some, most, told) for some in ("train", split))
    # As many of the training performers', spread over all of theirs: distances of sets depend on their size.
    others = train.positions[np.linspace(0, len(train) - 1, min(len(train), len(motions))).astype(int)]
    rows = {
        _data(split): Row(None, "data"),
        "zero-velocity": Row(forecasters.zero_velocity),
        "mean pose": Row(forecasters.mean_pose(train)),
        **{name: row for name, row in named(trained).items() if row.fps >= rate},
    }
    counts = {name: motions.datasets.count(name) for name in dict.fromkeys(motions.datasets)}
    result = Forecasting(split, rate, variant, counts | {"train": len(others)}, rows)
    for i in (np.arange(1, 8, 2) * len(motions)) // 8:
        result.shown[int(i)] = f"{motions.datasets[i]} {motions.labels[i]}"
    judge = Judge(motions, rate, list(result.shown))
    result.encoder = judge.encoder
    for done, (name, row) in enumerate(rows.items()):
        progress(done / len(rows), name)
        if row.forecast is None:
            judge.spectra(row, thin(others[:, SEEN:], FPS, rate), others[:, SEEN - 1])
            continue
        noisy = row.card is not None and row.card.method == "stmi-gan"
        seeds = range(max(1, samples) if noisy else 1)
        made = [thin(row.forecast(motions.seen, seed), row.fps, rate) for seed in seeds]
        judge.spectra(row, made[0], motions.positions[:, SEEN - 1])
        judge.distances(row, made[0])
        if len(made) > 1:
            judge.spread(row, np.array(made))
    return result


class Judge:
    """Measures forecasts (N, 4 * rate, 22, 3) of motions at `rate` frames a second."""

    def __init__(self, motions: Motions, rate: int, shown: Sequence[int]) -> None:
        self.motions, self.rate, self.shown = motions, rate, shown
        self.truth = thin(motions.positions[:, SEEN:], FPS, rate)
        self.angles = {variant: spectrum.joint_angles(self.truth, variant == "code") for variant in VARIANTS}
        self.local = self._local(self.truth)
        self.encoder, self.features = "", np.zeros((0, 0))
        try:
            self.features = self._features(self.truth, motions.positions[:, SEEN - 1])
            self.encoder = spectrum.digest(weights.find("cae").onnx)[:12]
        except ModuleNotFoundError:
            pass

    def spectra(self, row: Row, made: np.ndarray, last: np.ndarray) -> None:
        """What needs no truth of the same window; `last` (N, 22, 3) are the poses before."""
        for variant, real in self.angles.items():
            angles, pooled = spectrum.joint_angles(made, variant == "code"), variant == "code"
            row.spectra[variant] = []
            for start, stop in SPANS:
                part = slice(start * self.rate, stop * self.rate)
                gt, gen = real[:, part], angles[:, part]
                # The first row is the data's own: real motions against those of the training performers.
                entropy = spectrum.psent(gt if row.forecast is None else gen, pooled)
                there, back = spectrum.pskl(gt, gen, pooled), spectrum.pskl(gen, gt, pooled)
                row.spectra[variant].append((entropy, there, back))
        if self.encoder and min(len(made), len(self.truth)) > 1:  # one motion has no spread
            row.frechet = spectrum.frechet(self.features, self._features(made, last))

    def distances(self, row: Row, made: np.ndarray) -> None:
        """How far from the truth."""
        row.off = self._upto(spectrum.l2(self.truth, made))
        off = spectrum.euler_l2(self.local, self._local(made))
        row.turned = self._upto(off)
        part = slice(0, 2 * self.rate)
        moves = [
            np.linalg.norm(np.diff(upright(one[self.shown, part]), axis=1), axis=-1).mean(axis=(1, 2))
            for one in (made, self.truth)
        ]
        shares = moves[0] / np.maximum(moves[1], 1e-9)
        row.shown = list(zip(off[self.shown, part].mean(axis=1).tolist(), shares.tolist()))

    def spread(self, row: Row, samples: np.ndarray) -> None:
        """How far forecasts (n, N, 4 * rate, 22, 3) of the same lie apart."""
        apart = spectrum.diversity(samples)
        row.spread = [*self._upto(apart), float(apart.max())]

    def _upto(self, figures: np.ndarray) -> list[float]:
        """Means of (N, 4 * rate) over the frames up to each horizon."""
        return [float(figures[:, : int(horizon * self.rate)].mean()) for horizon in HORIZONS]

    def _local(self, positions: np.ndarray) -> np.ndarray:
        """Local rotations (N, T, 22, 4) of a motion.

        Twists, which positions leave open, are those of the last pose seen, for the truth as for forecasts.
        """
        like = np.broadcast_to(self.motions.rotation[:, [SEEN - 1]], (*positions.shape[:3], 4))
        turned = [pose_of(*one) for one in zip(positions, like, self.motions.bones)]
        return kinematics.local_rotations(np.array(turned), PARENTS)

    def _features(self, made: np.ndarray, last: np.ndarray) -> np.ndarray:
        """Of motions for Frechet's distance, smoothly brought to the 30 fps that it is measured at."""
        whole = np.moveaxis(np.concatenate([last[:, None], made], axis=1), 1, 0)
        dense = sample_smooth(whole, np.arange(1, AHEAD + 1) * self.rate / FPS)
        return spectrum.bottleneck(np.moveaxis(dense, 0, 1), weights.find("cae").onnx)
