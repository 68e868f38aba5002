"""What the finishing did: where each value comes from, and a report per gap."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, replace
from enum import IntEnum
from functools import cached_property, partial
from typing import Any

import numpy as np

from interpose.clip import Clip
from interpose.errors import few
from interpose.geometry.time import runs
from interpose.methods.protocol import Raw
from interpose.observation import Gap


class Provenance(IntEnum):
    """Where a joint's values in a frame come from."""

    OBSERVED = 0  # of this clip, or of another one that parts come from
    METHOD = 1  # what the method said (solved, where it speaks positions)
    CORRECTED = 2  # the method's, changed by seams or feet; or observed, and put on its side
    FALLBACK = 3  # the simpler method's
    SMOOTHED = 4  # observed, and changed by `denoise`
    OPEN = 5  # nowhere: the gap was left open


@dataclass(frozen=True)
class GapReport:
    """One gap. Lengths are in the units named; None where there is nothing to measure.

    Attributes:
        start, stop: frames start to stop - 1.
        joints: the joints whose values are missing; None when it is the whole pose.
        method: the method that filled it, by name: the fallback's when it fell back.
        model: the trained model, if the method has one.
        weights: of all trained models that were asked, with name, licence and commit.
        solve_error: cm, mean distance of the solved pose from the positions that the method gave.
        seam_before, seam_after: cm a frame squared, the velocity jump at the seams of the joint that comes
            nearest to its limit, or goes furthest beyond, of what the method said and of what is returned.
        seam_limit: cm a frame squared, the limit of the latter: the 95th percentile of the joint's own
            velocity jumps in the clip, and at least that of all joints.
        peak: cm a frame squared, the jump of the velocity inside the gap, of the joint nearest to its limit.
        peak_limit: cm a frame squared, what it may be: twice the largest one of the observed motion around
            the gap, or four times the largest limit at seams, or what a person does who sets off; of the
            body's joints, and more for one beside them, as a sword, that goes further.
        bone_deviation: cm, largest change of a bone's length.
        foot_slide, foot_slide_before: cm a second, of the result and before the feet were held.
        foot_travel: m, length of the way of the feet.
        penetration: cm, how deep the body goes into itself; a note says where if that is out of the ordinary.
        liveliness: how much the body moves in the middle of the gap, as a share of how much around it; a note
            says so where it hardly moves.
        gliding: the share of its frames in which the body travels and no foot stands; a note says so where
            that is far more often than around it.
        path: cm, by how much the hips miss points of the path that was asked for.
        pins: cm, by how much pinned joints miss their places.
        drift: cm, of the root trajectory before it was spread over the gap.
        expected, expected_most: cm that joints which are not known are expected to be off by, in the mean of
            them and of the frames, and in that of the worst frame; of networks that say so.
        notes: one sentence each: what fell back and why, what stays above a limit.
        number: of the gap in its clip, counted from 1 in order of time; 0 where nobody counted.
    """

    start: int
    stop: int
    joints: tuple[str, ...] | None
    method: str
    model: str | None = None
    weights: tuple[dict[str, Any], ...] = ()
    solve_error: float | None = None
    seam_before: float | None = None
    seam_after: float | None = None
    seam_limit: float | None = None
    peak: float | None = None
    peak_limit: float | None = None
    bone_deviation: float = 0.0
    foot_slide: float | None = None
    foot_slide_before: float | None = None
    foot_travel: float | None = None
    penetration: float | None = None
    liveliness: float | None = None
    gliding: float | None = None
    path: float | None = None
    pins: float | None = None
    drift: float | None = None
    expected: float | None = None
    expected_most: float | None = None
    notes: tuple[str, ...] = ()
    number: int = 0

    def __str__(self) -> str:
        where = f"{self.start}:{self.stop}"
        if self.joints is not None:
            where += f" {few(self.joints)}"
        named = self.model and self.model != self.method
        parts = [f"by {self.method}" + (f" ({self.model})" if named else "")]
        if self.solve_error is not None:
            parts.append(f"solved within {self.solve_error:.2f} cm")
        if self.seam_after is not None:
            above = f" (limit {self.seam_limit:.2f})" if self.seam_limit is not None else ""
            before = "" if self.seam_before is None else f"{self.seam_before:.2f} -> "
            parts.append(f"seam {before}{self.seam_after:.2f}{above} cm/frame^2")
        if self.peak is not None:
            above = f" (limit {self.peak_limit:.2f})" if self.peak_limit is not None else ""
            parts.append(f"inside at most {self.peak:.2f}{above}")
        parts.append(f"bones within {self.bone_deviation:.2f} cm")
        if self.foot_slide is not None:
            parts.append(f"feet slide {self.foot_slide:.1f} cm/s, travel {self.foot_travel:.2f} m")
        if self.drift is not None:
            parts.append(f"drift {self.drift:.1f} cm")
        if self.expected is not None:
            parts.append(f"expected to be off by {self.expected:.1f} cm")
        return "\n    ".join([f"gap {where}: " + "; ".join(parts), *self.notes])


@dataclass(frozen=True)
class JointNoise:
    """What denoising found of one joint and did to it: its name, noise and movement as in `NoiseReport`, and
    the frames START:STOP in which its value was broken."""

    joint: str
    noise: float
    moved: float
    moved_most: float
    turned: float
    turned_most: float
    broken: tuple[str, ...]


@dataclass(frozen=True)
class NoiseReport:
    """What denoising found and did.

    Attributes:
        start, stop: frames start to stop - 1 were looked at.
        strength: what the estimated noise was multiplied with.
        noise: cm, the estimated standard deviation of the joints' positions along an axis, in the mean.
        moved, moved_most: cm, how far joints moved, in the mean and at most; what was put back on its side
            among them.
        turned, turned_most: degrees, how far they turned against their parents.
        broken: how many values of joints were judged broken, and filled.
        values: how many there are: frames times joints.
        joints: each joint.
        noisy: the frames "START:STOP" that are noisy where the rest is not; `noise` is then theirs.
        frozen: the frames and joints in which nothing moves, left as they are, and what fills them.
    """

    start: int
    stop: int
    strength: float
    noise: float
    moved: float
    moved_most: float
    turned: float
    turned_most: float
    broken: int
    values: int
    joints: tuple[JointNoise, ...] = field(repr=False)
    noisy: tuple[str, ...] = ()
    frozen: tuple[str, ...] = ()

    @classmethod
    def of_bodies(cls, told: Sequence[NoiseReport]) -> NoiseReport:
        """What is to be said of several bodies at once: means are those of all of their joints."""
        joints = tuple(joint for one in told for joint in one.joints)
        share = [len(one.joints) / len(joints) for one in told]
        means: dict[str, Any] = {
            name: float(np.dot(share, [getattr(one, name) for one in told]))
            for name in ("noise", "moved", "turned")
        }
        most: dict[str, Any] = {
            name: max(getattr(one, name) for one in told) for name in ("moved_most", "turned_most")
        }
        return replace(
            told[0],
            **means,
            **most,
            broken=sum(one.broken for one in told),
            values=sum(one.values for one in told),
            joints=joints,
            noisy=tuple(dict.fromkeys(frames for one in told for frames in one.noisy)),
            frozen=tuple(said for one in told for said in one.frozen),
        )

    def __str__(self) -> str:
        shakiest = max(self.joints, key=lambda one: one.noise)
        furthest = max(self.joints, key=lambda one: one.moved_most)
        twisted = max(self.joints, key=lambda one: one.turned_most)
        lossy = [one.joint for one in self.joints if one.broken]
        where = f", in {few(lossy)}" if lossy else ""
        return "\n".join(
            [
                f"noise: {self.noise:.2f} cm along each axis, estimated (most: {shakiest.joint}, "
                f"{shakiest.noise:.2f} cm)" + f", in frames {', '.join(self.noisy)}" * bool(self.noisy),
                f"broken: {self.broken:,} of {self.values:,} joint rotations or positions{where}"
                + "; filled" * (self.broken > 0 and self.strength > 0),
                f"moved: joints by {self.moved:.2f} cm in the mean, at most by {self.moved_most:.2f} cm "
                f"({furthest.joint})",
                f"turned: joints by {self.turned:.2f} degrees in the mean, at most by {self.turned_most:.2f} "
                f"({twisted.joint})",
                *[f"left as it is: frozen {one}" for one in self.frozen],
            ]
        )


@dataclass(frozen=True)
class JointMoments:
    """The frames START:STOP in which a joint was lost for moments, amid known ones, and was interpolated; or
    in which it had the turns of the other side, was turned by half a turn, or bent the wrong way."""

    joint: str
    frames: tuple[str, ...]


@dataclass(frozen=True)
class Report:
    """The filled gaps of a clip in order of time, those left open, the action that was asked for, what was
    lost for moments only, what was on the wrong side and is put back, and what denoising has to say.

    `unpaired` are joints that hang from those that changed sides and have no like there: they stay.
    """

    method: str
    gaps: list[GapReport] = field(default_factory=list)
    open: list[Gap] = field(default_factory=list)
    action: str = ""
    noise: NoiseReport | None = None
    moments: tuple[JointMoments, ...] = ()
    exchanged: tuple[JointMoments, ...] = ()
    unpaired: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Plain types only, ready for JSON."""
        gaps, left = ([_plain(asdict(gap)) for gap in some] for some in (self.gaps, self.open))
        more = {} if self.noise is None else {"denoised": _plain(asdict(self.noise))}
        more |= {"moments": [_plain(asdict(one)) for one in self.moments]} if self.moments else {}
        more |= {"exchanged": [_plain(asdict(one)) for one in self.exchanged]} if self.exchanged else {}
        more |= {"unpaired": list(self.unpaired)} if self.unpaired else {}
        return {"method": self.method, "action": self.action, "gaps": gaps, "open": left, **more}

    @property
    def momentary(self) -> str:
        """What was lost for moments, in one line; "" for nothing."""
        if not self.moments:
            return ""
        count, joints = sum(len(one.frames) for one in self.moments), [one.joint for one in self.moments]
        return f"lost for moments and interpolated: {count} time{'s' * (count != 1)}, of {few(joints)}"

    @property
    def sides(self) -> str:
        """What was on the wrong side, in one line; "" for nothing."""
        if not self.exchanged:
            return ""
        joints = [one.joint for one in self.exchanged]
        frames = sorted(
            {at for one in self.exchanged for at in one.frames}, key=lambda at: int(at.split(":")[0])
        )
        what = f"{few(joints)}, in {', '.join(frames)}"
        rest = f"; left, without a like on the other side: {few(self.unpaired)}" * bool(self.unpaired)
        return (
            f"on the wrong side, half a turn about itself or bent the wrong way, and put back: {what}{rest}"
        )

    def __repr__(self) -> str:
        return f"<Report of {self.method}>\n{self}"

    def __str__(self) -> str:
        if self.noise is not None:
            return "\n".join(line for line in (self.sides, str(self.noise)) if line)
        lines = [line for line in (self.sides, self.momentary) if line]
        lines += [str(gap) for gap in self.gaps] + [f"gap {gap}: left open" for gap in self.open]
        return "\n".join(lines) or "nothing is missing"


@dataclass(frozen=True, eq=False)
class Completion:
    """A completed clip and what there is to know about it.

    Attributes:
        clip: the finished clip.
        said: gives `raw`; of a long clip it is put together only when somebody asks.
        provenance: (F, J) int8, codes of `Provenance`.
        report: a report per gap.
    """

    clip: Clip
    said: Callable[[], Raw] = field(repr=False)
    provenance: np.ndarray = field(repr=False)
    report: Report

    def __repr__(self) -> str:
        return f"<{type(self).__name__} of {self.clip!r}>\n{self.report}"

    def sources(self) -> list[dict[str, Any]]:
        """Where the values come from that are not as they were observed: entries of `frames` "START:STOP",
        `joints` (None for all), and `source`, a name of `Provenance` in small letters; in order of time."""
        found: dict[tuple[int, int, int], list[str]] = {}
        for name, codes in zip(self.clip.skeleton.names, self.provenance.T):
            for code in np.unique(codes[codes != Provenance.OBSERVED]).tolist():
                for start, stop in runs(codes == code):
                    found.setdefault((start, stop, code), []).append(name)
        every = len(self.clip.skeleton)
        return [
            {
                "frames": f"{start}:{stop}",
                "joints": names if len(names) < every else None,
                "source": Provenance(code).name.lower(),
            }
            for (start, stop, code), names in sorted(found.items())
        ]

    @cached_property
    def raw(self) -> Raw:
        """What the method itself said, before anything was corrected (what papers' tables use)."""
        return self.said()

    def __getstate__(self) -> dict[str, Any]:
        """What goes from process to process: `raw` is put together before."""
        return {**self.__dict__, "said": partial(_given, self.raw)}


def _given(raw: Raw) -> Raw:
    return raw


def _plain(value: Any) -> Any:
    """Dictionaries, lists, text and numbers; what is no number becomes None."""
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
