"""The benchmark of LAFAN1 (Harvey et al. 2020): in-betweening judged by L2P, L2Q and NPSS.

Ten frames and the one after the gap are known. Everything follows the data set authors' own evaluation, down
to which windows are cut, so that figures can be laid beside published ones where the test set is the same;
where sequences are missing from it only the ratio to interpolation can.
"""

from __future__ import annotations

import math
import re
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from interpose.clip import Clip, Skeleton
from interpose.datasets import clips
from interpose.errors import RequestError, unknown
from interpose.evaluation.table import markdown
from interpose.finish import complete, feet, seams
from interpose.finish.opinion import wipe
from interpose.geometry import kinematics, measures, rotations
from interpose.methods import registry
from interpose.methods.protocol import Actor, Method
from interpose.observation import Gap, Observation
from interpose.show.plot import line_plot
from interpose.skeletons.canonical import PARENTS

PAST = 10  # frames before the gap; the last of them faces X
STEP = 40  # frames from one test window to the next
STATISTICS_WINDOW, STATISTICS_STEP = 50, 20
WHOLE = 13  # sequences of subject 5 in the complete data set
BATCH = 256  # windows whose kinematics are computed at once
GLOBAL = "linear, global"  # straight lines of global positions
SPOILT = 0.05  # a share of fills that are the spline's from which tables of a method say so
TRUTH = "truth"  # the row of the motion as it was
LEAVES = [joint for joint in range(len(PARENTS)) if joint not in PARENTS]


@dataclass(frozen=True)
class Protocol:
    """Which frames of a window are shown, hidden and judged.

    Attributes:
        name: "official" is Harvey et al. 2020; "cmib" is how Kim et al. 2022 count.
        gaps: the usual lengths.
        keys_count: whether a length counts the two key frames, which are judged, too.
        context: frames that are known before the gap.
        leaves: whether the rotations of leaf joints are judged; else they are taken for none.
        told: whether methods that know actions are told the sequence's theme.
        base: the row that all ratios are to.
    """

    name: str
    gaps: tuple[int, ...]
    keys_count: bool
    context: int
    leaves: bool
    told: bool
    base: str

    def window(self, gap: int) -> int:
        """The length of test windows."""
        if self.keys_count:
            return 65 if gap <= 55 else gap + 10
        return 65 if gap <= 50 else 140

    def hidden(self, gap: int) -> tuple[int, int]:
        """The frames of a window that are missing."""
        return PAST, PAST + gap - (2 if self.keys_count else 0)

    def judged(self, gap: int) -> slice:
        """The frames of a window over which figures are taken."""
        start, stop = self.hidden(gap)
        return slice(start - 1, stop + 1) if self.keys_count else slice(start, stop)

    def shown(self, gap: int) -> slice:
        """The frames of a window that a method gets to see, of which `hidden` are wiped."""
        start, stop = self.hidden(gap)
        return slice(start - self.context, stop + 1)


PROTOCOLS = {
    "official": Protocol("official", (5, 15, 30, 45), False, PAST, True, False, "linear"),
    "cmib": Protocol("cmib", (30, 40, 60, 80, 120), True, 1, False, True, GLOBAL),
}


@dataclass(frozen=True)
class Windows:
    """Windows of equal length as arrays.

    Attributes:
        rotation: (W, F, 22, 4) local rotations, continuous in time.
        root: (W, F, 3) metres, the hips.
        bones: (22, 3) metres, the same for all.
        names: (W,) of the sequences.
    """

    rotation: np.ndarray
    root: np.ndarray
    bones: np.ndarray
    names: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.rotation)

    def spread(self, most: int | None) -> Windows:
        """As many of them, spread evenly; all when None."""
        if most is None or most >= len(self):
            return self
        some = np.linspace(0, len(self) - 1, most).astype(int)
        names = tuple(self.names[i] for i in some)
        return Windows(self.rotation[some], self.root[some], self.bones, names)


def theme(name: str) -> str:
    """What a sequence is of: "walk" of "walk1_subject5"."""
    return re.split(r"\d", name)[0]


def forward(rotation: np.ndarray, root: np.ndarray, bones: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Global rotations and positions of local rotations (..., 22, 4) and hips (..., 3).

    The sign of a global quaternion is the product of those above it, as the metrics need it.
    """
    moves = np.broadcast_to(bones, (*rotation.shape[:-1], 3)).copy()
    moves[..., 0, :] = root
    return kinematics.forward(rotation, moves, PARENTS)


def cut(sequences: Sequence[Clip], length: int, step: int, bones: np.ndarray) -> Windows:
    """Windows as the data set's authors cut them: while start + length < frames; centred, and turned so that
    the last frame before the gap faces X."""
    turned, moved, names = [], [], []
    for clip in sequences:
        rotation = rotations.continuous(clip.rotation)
        for start in range(0, len(clip) - length, step):
            turned.append(rotation[start : start + length])
            moved.append(clip.root[start : start + length])
            names.append(clip.name)
    if not names:
        raise RequestError(
            "there is nothing to measure with",
            f"no sequence has more than the {length} frames of a window",
            "Unpack the whole data set there: docs/data.md.",
        )
    rotation, root = np.array(turned), np.array(moved)
    root = root - root.mean(axis=1, keepdims=True) * [1.0, 0.0, 1.0]
    # The second local axis of the hips points ahead in this skeleton.
    ahead = rotations.rotate(rotation[:, PAST - 1, 0], np.array([0.0, 1.0, 0.0]))
    turn = rotations.about("Y", np.arctan2(ahead[:, 2], ahead[:, 0]))[:, None]
    rotation[:, :, 0] = rotations.multiply(turn, rotation[:, :, 0])
    return Windows(rotation, rotations.rotate(turn, root), bones, tuple(names))


@dataclass(frozen=True)
class Statistics:
    """Mean and deviation (66,) of global positions over training windows."""

    mean: np.ndarray
    std: np.ndarray

    def normalise(self, positions: np.ndarray) -> np.ndarray:
        """(..., 22, 3) metres to (..., 66) units of the deviation."""
        return (positions.reshape(*positions.shape[:-2], -1) - self.mean) / self.std


@dataclass
class Data:
    """All that is needed of the data set: statistics of subjects 1 to 4, and the sequences that test."""

    statistics: Statistics
    bones: np.ndarray
    skeleton: Skeleton
    sequences: list[Clip]
    name: str


def load(data: Path, split: str, progress: Callable[[str], None] = lambda line: None) -> Data:
    """Read the data set. `split`: "test" (subject 5) or "validation" (subject 4)."""
    entries = [entry for entry in clips("lafan1", data) if not entry.trains_only]
    training = [entry for entry in entries if entry.split != "test"]
    chosen = [entry for entry in entries if entry.split == split]
    for what, found in (("training", training), (split, chosen)):
        if not found:
            raise RequestError(
                "there is nothing to measure with",
                f"{data} holds no sequences of LAFAN1's {what} performers",
                "Unpack the whole data set there: docs/data.md.",
            )
    progress(f"lafan1: reading {len(training)} sequences for the statistics")
    known = [entry.load() for entry in training]
    # Bones of the first training frame serve everyone, the test's truth included.
    bones = known[0].skeleton.rest_translation.copy()
    bones[0] = 0.0
    total = cut(known, STATISTICS_WINDOW, STATISTICS_STEP, bones)
    sums, squares, count = np.zeros(66), np.zeros(66), 0
    for start in range(0, len(total), BATCH):
        part = slice(start, start + BATCH)
        flat = forward(total.rotation[part], total.root[part], bones)[1].reshape(-1, 66)
        sums, squares, count = sums + flat.sum(axis=0), squares + (flat**2).sum(axis=0), count + len(flat)
    mean = sums / count
    statistics = Statistics(mean, np.sqrt(squares / count - mean**2))
    progress(f"lafan1: reading {len(chosen)} sequences of the {split} performer")
    sequences = [entry.load() for entry in chosen]
    whole = split == "test" and len(chosen) == WHOLE
    name = "LAFAN1" if whole else f"LAFAN1 s{chosen[0].performer[-1]}-{len(chosen)}"
    return Data(statistics, bones, known[0].skeleton, sequences, name)


# Metrics -------------------------------------------------------------------------------------------------


def _alike(said: np.ndarray, truth: np.ndarray) -> None:
    """RequestError where there are not as many of what is said as of the truth."""
    if said.shape != truth.shape:
        why = f"what is said is {said.shape}, and the truth {truth.shape}"
        raise RequestError("cannot compare motions", why, "Give as many windows, frames and joints.")


def l2p(positions: np.ndarray, truth: np.ndarray, statistics: Statistics) -> np.ndarray:
    """(W,) mean over frames of the distance of normalised positions (W, n, 22, 3)."""
    _alike(positions, truth)
    return np.linalg.norm(statistics.normalise(positions) - statistics.normalise(truth), axis=-1).mean(axis=1)


def l2q(turned: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """(W,) mean over frames of the distance of global quaternions (W, n, 22, 4), as flat vectors."""
    _alike(turned, truth)
    return np.linalg.norm((turned - truth).reshape(*truth.shape[:2], -1), axis=-1).mean(axis=1)


def npss(turned: np.ndarray, truth: np.ndarray) -> float:
    """Normalised power spectrum similarity of global quaternions (W, n, 22, 4) over the whole test set.

    Source: Gopalakrishnan et al. 2019, with the real part of the spectrum, as in the authors' evaluation.
    """
    _alike(turned, truth)
    power, true_power = (
        np.real(np.fft.fft(q.reshape(*q.shape[:2], -1), axis=1)) ** 2 for q in (turned, truth)
    )
    total, true_total = (p.sum(axis=1, keepdims=True) for p in (power, true_power))
    cumulative, true_cumulative = (
        np.cumsum(p / np.where(t == 0, 1.0, t), axis=1) for p, t in ((power, total), (true_power, true_total))
    )
    distance = np.abs(cumulative - true_cumulative).sum(axis=1)
    return float(np.average(distance, weights=true_total[:, 0]))


def resign(rotation: np.ndarray, before: np.ndarray) -> np.ndarray:
    """Local rotations (W, n, 22, 4) with the signs that continue those of the frame before (W, 22, 4).

    What a method says of a rotation is the same with either sign, and the metrics are not: so signs follow
    the context, never the truth.
    """
    return rotations.continuous(np.concatenate([before[None], np.moveaxis(rotation, 1, 0)]))[1:].swapaxes(
        0, 1
    )


# Rows ----------------------------------------------------------------------------------------------------


@dataclass
class Seen:
    """What users see of motion in gaps; means over windows.

    Attributes:
        slide, travel: of the feet, cm/s and m.
        pop: the velocity jump at the keys, cm/frame^2, of the joint that jumps most.
        bones: by how much their lengths change, cm.
    """

    slide: float
    travel: float
    pop: float
    bones: float

    def __str__(self) -> str:
        feet = f"feet {self.slide:.1f} cm/s {self.travel:.2f} m"
        pop = (
            f"; pop {self.pop:.2f}" if math.isfinite(self.pop) else ""
        )  # a clip that ends with its keys has none
        return f"{feet}{pop}; bones {self.bones:.2f} cm"


@dataclass
class Row:
    """What one method reached at one length of gap; see `Lafan1` for units."""

    l2p: float
    l2q: float
    npss: float
    degrees: float
    milliseconds: float
    seen: Seen | None = None
    fell_back: float | None = None


@dataclass
class Lafan1:
    """The figures: `rows[method][gap]`, and of the motion as it was, `truth[gap]`.

    l2p, l2q, npss as published; degrees by which global rotations are off; milliseconds a clip; of finished
    fills also what users see, and the share of fills that are the spline's, because the method's own did not
    do.
    """

    name: str
    split: str
    protocol: Protocol
    windows: dict[int, int] = field(default_factory=dict)
    rows: dict[str, dict[int, Row]] = field(default_factory=dict)
    truth: dict[int, Seen] = field(default_factory=dict)

    def ratio(self, row: str, gap: int, figure: str) -> float:
        """To the protocol's own interpolation; NaN where that is not off at all, as NPSS of one frame is."""
        base = getattr(self.rows[self.protocol.base][gap], figure)
        return float(getattr(self.rows[row][gap], figure) / base) if base else math.nan

    def to_dict(self) -> dict[str, Any]:
        """For JSON, which has no NaN: None stands for it."""

        def held(figures: dict[str, Any]) -> dict[str, Any]:
            return {
                name: None if math.isnan(value) else value
                for name, value in figures.items()
                if isinstance(value, float)
            }

        return {
            "protocol": self.protocol.name,
            "data": self.name,
            "split": self.split,
            "windows": {str(gap): count for gap, count in self.windows.items()},
            "truth": {str(gap): held(vars(seen)) for gap, seen in self.truth.items()},
            "rows": {
                name: {
                    str(gap): {
                        **held(vars(row)),
                        **(held(vars(row.seen)) if row.seen else {}),
                        "ratios": held({key: self.ratio(name, gap, key) for key in ("l2p", "l2q", "npss")}),
                    }
                    for gap, row in rows.items()
                }
                for name, rows in self.rows.items()
            },
        }

    def table(self, figure: str, digits: int) -> str:
        """Markdown: a row a method, with the ratio to interpolation in brackets."""

        def cell(name: str, gap: int) -> str:
            row = self.rows[name][gap]
            ratio = self.ratio(name, gap, figure)
            told = "-" if math.isnan(ratio) else f"{ratio:.2f}"
            said = f"{getattr(row, figure):.{digits}f} ({told})"
            # The figures are then rather those of another method.
            fell = row.fell_back or 0.0
            return f"{said}, {100 * fell:.0f} % the spline's" if fell > SPOILT else said

        return self._markdown(figure.upper(), cell)

    def extras(self) -> str:
        """Markdown: what users see and the field does not print."""

        def cell(name: str, gap: int) -> str:
            if name == TRUTH:
                return str(self.truth[gap])
            row = self.rows[name][gap]
            figures = [f"{row.degrees:.1f} deg", f"{row.milliseconds:.1f} ms"]
            if row.seen is not None:
                figures += [str(row.seen), f"{100 * (row.fell_back or 0):.0f} % fell back"]
            return "; ".join(figures)

        return self._markdown("", cell, TRUTH)

    def _markdown(self, head: str, cell: Callable[[str, int], str], *more: str) -> str:
        gaps = list(self.windows)
        rows = [[name, *(cell(name, gap) for gap in gaps)] for name in (*self.rows, *more)]
        return markdown([head, *map(str, gaps)], rows)

    def plot(self, path: Path | None = None) -> str:
        """L2P as a ratio to interpolation over the length of the gap, as SVG."""
        gaps = list(self.windows)
        series = {name: (gaps, [self.ratio(name, gap, "l2p") for gap in gaps]) for name in self.rows}
        return line_plot(
            series, "gap, frames", "L2P to interpolation", f"{self.name}, {self.split}", path=path
        )

    def __str__(self) -> str:
        counts = ", ".join(f"{count} windows at {gap}" for gap, count in self.windows.items())
        return "\n\n".join(
            [
                f"{self.name}, {self.split} performer, {self.protocol.name} protocol: {counts} frames; "
                f"in brackets the ratio to {self.protocol.base}.",
                *(self.table(figure, digits) for figure, digits in (("l2p", 4), ("l2q", 4), ("npss", 5))),
                "Global rotations off in degrees; time a clip; of finished fills foot slide and travel, "
                "velocity jump at keys (cm/frame^2), change of bones, share that fell back to the spline; "
                "last the motion as it was:",
                self.extras(),
            ]
        )


def run(
    data: Path,
    split: str = "validation",
    protocol: str = "official",
    gaps: Sequence[int] = (),
    methods: Sequence[str] = (),
    most: int | None = None,
    progress: Callable[[float, str], None] = lambda share, line: None,
) -> Lafan1:
    """The benchmark: zero-velocity and interpolations as they are, then `methods` as users get them.

    Args:
        data: the folder that holds lafan1/.
        split: "validation" (subject 4), or "test" (subject 5) for final figures.
        protocol: a name of PROTOCOLS.
        gaps: lengths in frames; the protocol's own without any.
        methods: names of methods.
        most: windows; None for all.

    Raises:
        RequestError: an unknown protocol or method, or a gap that no window holds.
    """
    if protocol not in PROTOCOLS:
        raise unknown("protocol", protocol, PROTOCOLS)
    rules = PROTOCOLS[protocol]
    for name in methods:
        registry.get(name)
    gaps = tuple(gaps) or rules.gaps
    least = 3 if rules.keys_count else 1
    if bad := [gap for gap in gaps if not least <= gap <= 128]:
        why = f"windows of this protocol hold {least} to 128"
        raise RequestError(f"cannot measure a gap of {bad[0]} frames", why, "Choose others with --gaps.")
    held = load(data, split, lambda line: progress(0.0, line))
    result = Lafan1(held.name, split, rules)
    plain = dict.fromkeys(("zero-velocity", rules.base, "linear", "spline"))
    work = [(gap, name, False) for gap in gaps for name in plain]
    work += [(gap, name, True) for gap in gaps for name in methods]
    cuts: dict[int, Windows] = {}
    for done, (gap, name, finished) in enumerate(work):
        if gap not in cuts:
            cuts[gap] = cut(held.sequences, rules.window(gap), STEP, held.bones).spread(most)
            result.windows[gap] = len(cuts[gap])
            result.truth[gap] = as_it_was(held, rules, cuts[gap], gap)
        method = None if name == GLOBAL else registry.get(name)
        row = measure(held, rules, cuts[gap], gap, method, finished)
        result.rows.setdefault(f"{name}, finished" if finished else name, {})[gap] = row
        progress((done + 1) / len(work), f"{name} at {gap} frames")
    return result


def measure(
    held: Data, rules: Protocol, windows: Windows, gap: int, method: Method | None, finished: bool
) -> Row:
    """Complete all windows by a method and judge; a method sees nothing after the target.

    Without a method: straight lines of global positions.
    """
    part = rules.judged(gap)
    truth_turned, truth = forward(windows.rotation[:, part], windows.root[:, part], windows.bones)
    start, extra = time.perf_counter(), []
    if method is None:
        turned, placed = global_lines(truth_turned, truth)
    else:
        rotation, root = windows.rotation[:, part].copy(), windows.root[:, part].copy()
        first, last = (frame - part.start for frame in rules.hidden(gap))
        for i, clip in enumerate(shown_clips(held, rules, windows, gap)):
            one = _told(method, theme(clip.name)) if rules.told else method
            done, missing, fell_back = fill(clip, rules, gap, one, finished)
            rotation[i, first:last], root[i, first:last] = done.rotation[missing], done.root[missing]
            if finished:
                extra.append((*_seen(done, missing), fell_back))
        before = windows.rotation[:, part.start - 1] if first == 0 else rotation[:, 0]
        turned, placed = forward(resign(rotation, before), root, windows.bones)
    spent = 1000 * (time.perf_counter() - start) / len(windows)
    if rules.keys_count:
        # They are known, also where quaternions have come round to the other sign on the way.
        turned[:, [0, -1]], placed[:, [0, -1]] = truth_turned[:, [0, -1]], truth[:, [0, -1]]
    if not rules.leaves:
        above = [PARENTS[joint] for joint in LEAVES]
        for q in (turned, truth_turned):
            q[:, :, LEAVES] = q[:, :, above]
    figures = _means(extra) if extra else None
    return Row(
        float(l2p(placed, truth, held.statistics).mean()),
        float(l2q(turned, truth_turned).mean()),
        npss(turned, truth_turned),
        float(np.degrees(rotations.angle(turned, truth_turned)).mean()),
        spent,
        Seen(*figures[:-1]) if figures else None,
        figures[-1] if figures else None,
    )


def _told(method: Method, action: str) -> Method:
    """The method, told what the motion is, if it knows such a thing and nobody has told it yet."""
    if isinstance(method, Actor) and not method.action and action in method.card.labels:
        return method.for_action(action)
    return method


def global_lines(turned: np.ndarray, placed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Straight lines of global positions, and SLERP of global rotations, between the ends."""
    share = np.linspace(0, 1, turned.shape[1])[None, :, None]
    lines = placed[:, :1] + share[..., None] * (placed[:, -1:] - placed[:, :1])
    return rotations.slerp(turned[:, :1], turned[:, -1:], share), lines


def fill(clip: Clip, rules: Protocol, gap: int, method: Method, finished: bool) -> tuple[Clip, slice, bool]:
    """A clip completed by a method, `finished` with all guarantees; which frames were missing; and whether
    it fell back to a simpler method there."""
    start, stop = (frame - rules.shown(gap).start for frame in rules.hidden(gap))
    seen = Observation.from_gaps(clip, [Gap(start, stop)])
    if finished:
        done = complete(clip, seen, method)
        return done.clip, slice(start, stop), any(one.method != method.name for one in done.report.gaps)
    return method.complete(wipe(clip, seen), seen).clip, slice(start, stop), False


def shown_clips(held: Data, rules: Protocol, windows: Windows, gap: int) -> Iterator[Clip]:
    """Each window as a clip of the frames that are shown; it ends with the target."""
    skeleton, part = replace(held.skeleton, rest_translation=windows.bones), rules.shown(gap)
    for rotation, root, name in zip(windows.rotation, windows.root, windows.names):
        yield Clip(skeleton, rotation[part], root[part, None], 30.0, name=name)


def as_it_was(held: Data, rules: Protocol, windows: Windows, gap: int) -> Seen:
    """What users would see of the motion that was there."""
    missing = slice(*(frame - rules.shown(gap).start for frame in rules.hidden(gap)))
    figures = [_seen(clip, missing) for clip in shown_clips(held, rules, windows, gap)]
    return Seen(*_means(figures))


def _means(rows: Sequence[Sequence[float]]) -> list[float]:
    """Of each column; NaN, of which there may be nothing else, aside."""
    means: list[float] = np.ma.masked_invalid(rows).mean(axis=0).filled(np.nan).tolist()
    return means


def _seen(done: Clip, missing: slice) -> tuple[float, float, float, float]:
    """What `Seen` has of a clip in which some frames are, or were, missing."""
    seen = Observation.from_gaps(done, [Gap(missing.start, missing.stop)])
    slide, travel = feet.measure(done, seen, missing.start, missing.stop) or (np.nan, np.nan)
    keys = np.array([frame for frame in (missing.start - 1, missing.stop) if 0 < frame < len(done) - 1], int)
    jump = np.linalg.norm(seams.jumps(done, seen, keys), axis=-1).max() if keys.size else np.nan
    lengths = np.linalg.norm(done.skeleton.rest_translation, axis=1)
    lengths[0] = np.nan
    bones = measures.bone_deviation(done.positions(), done.skeleton.parents, lengths)
    return slide, travel, 100 * float(jump), 100 * bones
