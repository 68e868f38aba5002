"""What is said of each gap once it is filled, and where each value comes from."""

from __future__ import annotations

from typing import Any

import numpy as np

from interpose.clip import Clip
from interpose.finish import anatomy, feet, hanging, jumps, notes, penetration
from interpose.finish.report import GapReport, Provenance
from interpose.finish.span import Span
from interpose.geometry import measures, rotations
from interpose.methods.protocol import Raw
from interpose.observation import Gap, Observation
from interpose.skeletons import JOINTS, PARENTS, find_mapping

# What joints are off by as a share of what `base` expects, where single joints or parts are lost from these
# on down, and of others: of 832 that validation performers of LAFAN1, CMU and Bandai-Namco lost for half a
# second to 2.5 it expects 3.8 cm, and 3.0 are right. With what one half of the clips tells the other half is
# expected to be off by 2.9 instead of 3.8 (rank correlation .83 instead of .76).
PARTS = {"Hips": 0.5, "Spine": 1.8, "Spine1": 1.0, "Spine2": 1.0, "Neck": 0.35, "Shoulder": 0.9, "Arm": 1.1}
PARTS |= {"ForeArm": 0.75, "UpLeg": 0.7, "Leg": 0.75, "Foot": 0.45}
PART = 0.8
MEASURED = 3.0  # seconds: of what is lost for longer nobody has measured it


def gap_report(
    finished: Clip,
    known: Observation,
    gap: Gap,
    span: Span,
    raw: Raw,
    instead: Raw | None,
    error: np.ndarray | None,
    before: tuple[float, float | None] | None,
    bounds: jumps.Bounds | None,
    unheld: tuple[float, float] | None,
    held: tuple[float, float] | None,
    method: str,
    first: int,
) -> GapReport:
    part = finished.slice(gap.start, gap.stop)
    own = span.method == method
    skeleton = finished.skeleton
    spoke = raw if own else instead
    lengths = np.linalg.norm(skeleton.rest_translation, axis=1) * skeleton.scale_above
    lengths[list(finished.translated)] = np.nan
    after, within = (of(finished, known, gap, bounds) for of in (jumps.beside, jumps.inside))
    alive = None if gap.joints is not None else notes.liveliness(finished, gap)
    glide, ahead = notes.gliding(finished, known, gap), gap.stop == len(finished)
    networks = gap.joints is None and "model" in raw.notes
    never = [] if spoke and "model" in spoke.notes else notes.never(known, gap, skeleton.names)
    # A method that says something else of them than how they rest has something to say.
    never = [name for name in never if _rests(part, skeleton.index(name))]
    inside = penetration.deepest(finished, gap.start, gap.stop, first)
    risk = _risk(spoke, finished, known, gap) if spoke else None
    solved = None if error is None or not own else float(np.nanmean(error[gap.start : gap.stop]))
    return GapReport(
        gap.start,
        gap.stop,
        gap.joints,
        span.method,
        model=spoke.notes.get("model") if spoke else None,
        weights=spoke.notes.get("weights", ()) if spoke else (),
        solve_error=_centi(solved),
        seam_before=_centi(before[0] if before else None),
        seam_after=_centi(after[0] if after else None),
        seam_limit=_centi(after[1] if after else None),
        peak=_centi(within[0] if within else None),
        peak_limit=_centi(within[1] if within else None),
        bone_deviation=100 * measures.bone_deviation(part.positions(), skeleton.parents, lengths),
        foot_slide=held[0] if held else None,
        foot_slide_before=unheld[0] if unheld else None,
        foot_travel=held[1] if held else None,
        penetration=_centi(inside[0] if inside else None),
        liveliness=alive,
        gliding=glide[0] if glide else None,
        drift=_centi(_drift(raw.notes, gap)) if own else None,
        expected=_centi(float(np.mean(risk))) if risk is not None else None,
        expected_most=_centi(float(np.max(risk))) if risk is not None else None,
        notes=(
            *span.told(gap),
            *((inside[1],) if inside and inside[1] else ()),
            *notes.sized(skeleton),
            *(notes.others(skeleton, gap) if networks and own else ()),
            *notes.sunk(finished, known, gap, first),
            *(notes.dull(alive, gap, first, ahead, span.method) or notes.idle(finished, known, gap, first)),
            *hanging.hung(finished, known, gap, first),
            *notes.adrift(glide, finished, gap),
            *notes.skids(held[0] if held else None, finished, known, gap, first),
            *notes.hasty(finished, known, gap, first),
            *notes.whirling(finished, known, gap, first),
            *anatomy.bent_back(finished, known, gap, first),
            *([] if bounds else notes.wild(finished, known, gap, first)),
            *notes.doubtful(risk, finished, gap, first),
            *(notes.scant(known, gap, finished.fps) if networks else ()),
            *notes.rests(never, span.method, skeleton),
            *(spoke.notes.get("remarks", {}).get(f"{gap.start}:{gap.stop}", ()) if spoke else ()),
        ),
    )


def _rests(clip: Clip, joint: int) -> bool:
    """Whether a joint has the rest pose in every frame."""
    rest = clip.skeleton.rest_rotation[joint]
    return bool((rotations.angle(clip.rotation[:, joint], rest) < 1e-6).all())


def _risk(raw: Raw, finished: Clip, known: Observation, gap: Gap) -> np.ndarray | None:
    """Metres by frame of the gap that joints are expected to be off by of which it is not known where they
    are; None where there are none, as of a hand that is turned alone, or nobody says it."""
    if raw.expected is None or not np.isfinite(raw.expected[gap.start : gap.stop]).all():
        return None
    # It speaks of all joints of the humanoid: those that are known are not off at all.
    placed = known.slice(gap.start, gap.stop).positions(finished.skeleton)
    hidden = ~placed[:, list(find_mapping(finished.skeleton).mapped[1])]
    if not hidden.any():
        return None
    share = hidden.mean(axis=1)
    part = _part(finished, known.slice(gap.start, gap.stop))
    return part * raw.expected[gap.start : gap.stop] / np.where(share > 0, share, 1.0) * (share > 0)


def _part(clip: Clip, known: Observation) -> float:
    """The share of what is expected that joints are off by, where a part of a body is lost: that of the
    topmost joints of it, in the mean."""
    rows = dict(zip(*find_mapping(clip.skeleton).mapped))
    lost = {joint for joint, row in rows.items() if not known.rotation[:, row].all()}
    tops = [joint for joint in lost if _above(joint, {*rows}) not in lost]
    if not tops or lost == {*rows} or len(known.rotation) > MEASURED * clip.fps:
        return 1.0
    names = [JOINTS[joint].removeprefix("Left").removeprefix("Right") for joint in tops]
    return float(
        np.mean([PARTS.get(name, PART) if name != "Hips" or len(lost) == 1 else 1.0 for name in names])
    )


def _above(joint: int, rows: set[int]) -> int:
    """The canonical joint among those that a skeleton has that another one hangs from; -1 for none."""
    above = PARENTS[joint]
    return above if above < 0 or above in rows else _above(above, rows)


def provenance(
    known: Observation, spans: list[Span], method: str, opinion: Clip, finished: Clip
) -> np.ndarray:
    """(F, J) codes."""
    missing = ~(known.rotation & known.translation)
    codes = np.where(missing, Provenance.METHOD, Provenance.OBSERVED).astype(np.int8)
    codes[missing & ~same(opinion, finished)] = Provenance.CORRECTED
    for span in spans:
        if span.method != method:
            codes[span.start : span.stop][missing[span.start : span.stop]] = Provenance.FALLBACK
    return codes


def same(one: Clip, other: Clip) -> np.ndarray:
    """(F, J) True where a joint is turned, and placed, alike in two clips."""
    # A quaternion and its negative are the same rotation.
    alike = np.abs((rotations.normalize(one.rotation) * other.rotation).sum(-1)) > 1 - 1e-12
    alike[:, list(other.translated)] &= np.abs(one.translation - other.translation).max(-1) < 1e-6
    return alike


def slides(clip: Clip, known: Observation, span: Span, gaps: list[Gap]) -> dict[Gap, tuple[float, float]]:
    """Slide and travel of the feet in the gaps of a span, where it is not known what they do."""
    lo, hi, _ = span.around(len(clip), round(feet.NEARBY * clip.fps))
    inside = [gap for gap in gaps if span.start <= gap.start and gap.stop <= span.stop]
    inside = [gap for gap in inside if not feet.told(clip, known, gap.start, gap.stop)]
    ranges = [(gap.start - lo, gap.stop - lo) for gap in inside]
    return dict(zip(inside, feet.measure_all(clip.slice(lo, hi), known.slice(lo, hi), ranges)))


def _drift(notes: dict[str, Any], gap: Gap) -> float | None:
    """`notes["drift"]`: metres, one number or one for each gap under its "start:stop"."""
    drift = notes.get("drift")
    if isinstance(drift, dict):
        drift = drift.get(f"{gap.start}:{gap.stop}")
    return None if drift is None else float(drift)


def _centi(metres: float | None) -> float | None:
    return None if metres is None else 100.0 * metres
