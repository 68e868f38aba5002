"""Fill what is missing: choose a method for each gap, complete each in a window of its own, report."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from interpose.clip import Clip
from interpose.errors import RequestError
from interpose.finish import Completion, GapReport, Provenance, Report, complete, on_rig_of
from interpose.finish.habits import Habits
from interpose.finish.path import spans
from interpose.finish.retargeting import common
from interpose.methods import auto, registry
from interpose.methods.protocol import Method, Raw
from interpose.observation import Gap, Observation, Part, Pin
from interpose.observation.observation import frame_number, longest
from interpose.observation.part import lay, misfits
from interpose.resampling import resample
from interpose.skeletons import find_humanoid
from interpose.skeletons.targets import following, seated
from interpose.tasks.moments import mended, momentary, with_moments
from interpose.tasks.planning import Job, plan, seed_of
from interpose.tasks.windows import OVERLAP, Piece, joined, paste, put_together, shifted, together


def fill(
    clip: Clip,
    gaps: Sequence[Gap] | Observation,
    method: str | Path | Method = "auto",
    max_gap: int | str | None = None,
    only: Iterable[int] | int | None = None,
    seed: int | None = None,
    methods: Mapping[int, str | Path | Method] | None = None,
    progress: Callable[[float], None] | None = None,
    action: str = "",
    parts: Sequence[Part] = (),
    path: Mapping[int, Any] | None = None,
    pins: Sequence[Pin] = (),
    temperature: float = 1.0,
    zero: int = 0,
) -> Completion:
    """Fill gaps of a clip. What is observed comes back unchanged, bit for bit; but for targets of
    feet and hands that sit on what is lost in gaps of joints, which go along.

    Args:
        clip: F frames; its values inside the gaps have no influence.
        gaps: what is missing, or an observation that says for every value whether it is known. Gaps that
            touch or overlap count as one.
        method: a name of `methods.registry.names()`, an object that is a method, or "auto" for what measured
            best at each gap's length: values that an observation misses for moments it interpolates one by
            one.
        max_gap: frames, or seconds as in "2s"; longer gaps stay open.
        only: numbers of the gaps to fill, counted from 1 in order of time; the others stay open.
        seed: for methods that sample.
        methods: the method of single gaps by number, in place of `method`.
        progress: called with the share done, 0 to 1.
        action: what the motion in the gaps is, for methods that know actions; "auto" then is one of them.
        parts: poses of single joints that other clips give inside of the gaps; what is of
            another rig, or at another rate, is brought to this one's first.
        path: x and z in metres that the hips are led over, by frame; inside of gaps of the whole pose.
        pins: where joints are to be, or how turned, at frames of gaps; besides those of an observation.
        temperature: for methods that sample, how far their answers lie apart; 1 is as in training.
        zero: the frame that notes call 0.

    Returns:
        The completion; `report.open` lists the gaps left open.

    Raises:
        RequestError: a range, a joint, a gap number, a method or an action that does not exist; a length or a
            seed that is none; nothing observed; a part that does not fit; a path, or a pin, outside of the
            gaps.
    """
    observation = gaps if isinstance(gaps, Observation) else Observation.from_gaps(clip, gaps)
    observation.check(clip)
    going = None if isinstance(gaps, Observation) else following(clip, *_known(observation))
    seed = seed_of(seed)
    max_gap = None if max_gap is None else longest(max_gap, clip.fps)
    observation = replace(observation, pins=(*observation.pins, *pins))
    clip, observation = lay(clip, observation, fitted(parts, clip))
    piecemeal = isinstance(gaps, Observation) and not observation.pins and method in ("auto", "spline")
    # Numbers count what was observed.
    piecemeal = piecemeal and only is None and not methods
    brief = momentary(clip, observation, max_gap) if piecemeal else None
    if brief:
        clip, observation = mended(clip, observation, brief)
    if not len(clip):
        what = f"{clip.name or 'the clip'} has no frames"
        raise RequestError(what, "there is nothing in it to complete", "Give one that has some.")
    if not (observation.rotation.any() or observation.translation[:, list(clip.translated)].any()):
        raise RequestError(
            "there is nothing to go by",
            "no value of the clip is observed, so any motion would do",
            "Leave at least one frame out of the gaps: pins and paths alone tell no pose.",
        )
    points, whole = _points(path or {}), _Whole(clip, observation)
    clip = _handed(clip, observation)
    spans(clip, observation, points)
    jobs = plan(clip, observation, method, max_gap, only, methods or {}, action, temperature, zero)
    _check_open(jobs, points)
    # Of all of the take: a window of it tells less of how it moves.
    habits = Habits.of(clip, observation) if any(job.method for job in jobs) else None
    work = [(group, one) for group in together(jobs, clip, observation) for one in group.methods]
    for done, (group, chosen) in enumerate(work):
        pieces = [piece for piece in group.pieces if piece.job.method == chosen]
        lo, hi = group.around(len(clip), clip.fps)
        # The file tells what its joints can do, and is not what the window is written to.
        window, seen = clip.slice(lo, hi), observation.slice(lo, hi)
        other = auto.instead(chosen, window, Gap(pieces[0].start - lo, pieces[-1].stop - lo))
        led = {frame for piece in pieces for frame in range(piece.start, piece.stop)}
        way = {frame - lo: point for frame, point in points.items() if frame in led}
        part = complete(window, seen, chosen, seed, other, habits, path=way, first=lo - zero)
        whole.take(part, pieces, lo)
        if progress:
            progress((done + 1) / len(work))
    left = [job.gap for job in jobs if job.method is None]
    listed = (_turns(whole.told(), observation, clip), _turns(left, observation, clip))
    filled = whole.completion(Report(registry.name_of(method), *listed, action))
    if going is not None and going.any():
        for gap in left:
            going[gap.start : gap.stop] = False
        return _with_targets(filled, observation, going)
    return with_moments(filled, clip, brief) if brief else filled


def _known(observation: Observation) -> tuple[np.ndarray, np.ndarray]:
    """Which translations, and which rotations, are known, as `skeletons.targets` takes it."""
    return observation.translation, observation.rotation


def _with_targets(done: Completion, observation: Observation, going: np.ndarray) -> Completion:
    """A completion in which targets of feet and hands, where they are `going` (F, J), sit where they did."""
    clip = seated(done.clip, *(some & ~going for some in _known(observation)))
    names = np.array(clip.skeleton.names)

    def told(gap: GapReport) -> GapReport:
        if not (some := going[gap.start : gap.stop].any(axis=0)).any():
            return gap
        said = "goes along with what it sits on" if some.sum() == 1 else "go along with what they sit on"
        return replace(gap, notes=(*gap.notes, f"{', '.join(names[some])} {said}"))

    provenance = np.where(going, Provenance.CORRECTED, done.provenance).astype(done.provenance.dtype)
    report = replace(done.report, gaps=[told(gap) for gap in done.report.gaps])
    return replace(done, clip=clip, provenance=provenance, report=report)


class _Whole:
    """A clip as it is put together from completed windows."""

    def __init__(self, clip: Clip, observation: Observation) -> None:
        self.clip = clip
        self.known = observation.rotation, observation.translation[:, list(clip.translated)]
        self.rotation, self.translation = clip.rotation.copy(), clip.translation.copy()
        missing = ~observation.rotation
        missing[:, list(clip.translated)] |= ~self.known[1]
        self.provenance = np.where(missing, Provenance.OPEN, Provenance.OBSERVED).astype(np.int8)
        self.said: list[tuple[int, slice, Raw]] = []
        self.reports: list[GapReport] = []

    def take(self, part: Completion, pieces: Sequence[Piece], lo: int) -> None:
        """Take pieces from what was completed of the frames from `lo` on."""
        for job, start, stop in pieces:
            fade = min(round(OVERLAP * self.clip.fps), stop - start) if start > job.gap.start else 0
            inside = slice(start - lo, stop - lo)
            paste(self.rotation, part.clip.rotation, self.known[0], start, inside, fade)
            paste(self.translation, part.clip.translation, self.known[1], start, inside, fade)
            self.provenance[start:stop] = part.provenance[inside]
            self.said.append((start, inside, part.raw))
            self.reports += shifted(part.report.gaps, lo, start, stop, job)

    def told(self) -> list[GapReport]:
        """A report for each gap, in order of time."""
        return joined(sorted(self.reports, key=lambda gap: (gap.number, gap.start)))

    def completion(self, report: Report) -> Completion:
        """All of it."""
        clip, said = self.clip, self.said
        done = clip.with_motion(self.rotation, self.translation)
        return Completion(done, lambda: put_together(clip, said), self.provenance, report)


def _check_open(jobs: Iterable[Job], path: Iterable[int]) -> None:
    """RequestError for frames of a path in a gap that stays open."""
    for frame in path:
        if any(job.method is None and job.gap.start <= frame < job.gap.stop for job in jobs):
            raise RequestError(
                f"the path leads through a gap that stays open: frame {frame}",
                "the gap is longer than allowed, or not among the gaps chosen",
                "Leave the point out, or let the gap be filled.",
            )


Named = TypeVar("Named", Gap, GapReport)


def _turns(gaps: Iterable[Named], observation: Observation, clip: Clip) -> list[Named]:
    """Gaps in which all turns are lost, and where the body is, is not, as gaps of all joints: told as of the
    whole pose a report of them would be repeated without its place."""

    def placed(gap: Named) -> bool:
        return gap.joints is None and bool(observation.translation[gap.start : gap.stop].all())

    return [replace(gap, joints=clip.skeleton.names) if placed(gap) else gap for gap in gaps]


def _points(path: Mapping[int, Any]) -> dict[int, np.ndarray]:
    """A path by whole frames, points as arrays (2,); RequestError where it is none."""
    points = {}
    for frame, point in path.items():
        try:
            place = np.asarray(point, float)
        except (TypeError, ValueError):
            place = np.array(np.nan)
        if place.shape != (2,) or not np.isfinite(place).all():
            raise RequestError(
                f"cannot read the point {str(point)[:40]} of the path at frame {frame}",
                "it is a place on the floor, x and z in metres",
                "Write {130: (1.2, 0.4)}.",
            )
        points[frame_number(frame)] = place
    return points


def fitted(parts: Iterable[Part], clip: Clip) -> list[Part]:
    """Parts on the skeleton of a clip and at its rate, whatever rig and rate they are of.

    Raises:
        RequestError: a joint that another rig tells nothing of; what `on_rig_of` refuses.
    """
    done = []
    for part in parts:
        whole = part.clip
        for name in part.joints:
            clip.skeleton.index(name)
        if misfits(clip, part):
            part = replace(part, clip=on_rig_of(whole, clip))
            if mute := [name for name in part.joints if name not in common(whole, clip)]:
                raise RequestError(
                    f"{whole.name or 'the other clip'} tells nothing of {mute[0]}",
                    "it is of another rig, and no joint of it is the same",
                    f"Choose some of {', '.join(sorted(common(whole, clip)))}.",
                )
        if part.clip.fps != clip.fps and 0 <= part.start < part.stop <= len(whole):
            at_rate = resample(part.clip.slice(part.start, part.stop), clip.fps, smooth=True)
            part = replace(part, clip=at_rate, start=0, stop=len(at_rate))
        done.append(part)
    return done


def _handed(clip: Clip, observation: Observation) -> Clip:
    """The clip with its handedness said, from all that is observed of it: single gaps must not decide."""
    frames = np.flatnonzero(observation.frames)
    if "hand" in clip.skeleton.roles or not frames.size:
        return clip
    frames = frames[:: max(1, frames.size // 200)]
    body = find_humanoid(clip.take(frames))
    roles = {**clip.skeleton.roles, "hand": "left" if body.left_handed else "right"}
    return replace(clip, skeleton=replace(clip.skeleton, roles=roles))
