"""What is completed at once, and how that becomes one clip and one report again.

Every gap is completed in a window of its own, cut from observed frames on both sides, with all other gaps
hidden. So gaps do not depend on each other, and a long clip costs no more memory than its own values.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from interpose.clip import Clip
from interpose.finish import GapReport
from interpose.finish.notes import DOUBTS
from interpose.finish.windows import ramp
from interpose.geometry import rotations
from interpose.methods.protocol import Method, Raw
from interpose.observation import Gap, Observation
from interpose.skeletons.performers import performers
from interpose.tasks.planning import Job

CONTEXT = 2.0  # seconds of the clip on both sides of a gap that a method sees
GROUP = 8.0  # seconds: gaps near each other are completed at once up to this length
# Seconds: joints that are missing for longer than the first are completed piece by piece, and pieces overlap
# by the second and are blended there.
PIECE, OVERLAP = 20.0, 1.0


class Piece(NamedTuple):
    """The frames of a job that are completed at once: all, or those of a piece of a long one."""

    job: Job
    start: int
    stop: int


@dataclass
class Group:
    """Pieces near each other, which are seen and completed at once."""

    pieces: list[Piece]

    @property
    def methods(self) -> list[Method]:
        """Those that fill any of it."""
        found: list[Method] = []
        for piece in self.pieces:
            if piece.job.method is not None and piece.job.method not in found:
                found.append(piece.job.method)
        return found

    def around(self, frames: int, fps: float) -> tuple[int, int]:
        """The frames, first to before last, of a clip of so many that are seen with it."""
        margin = round(CONTEXT * fps)
        return max(0, self.pieces[0].start - margin), min(frames, self.pieces[-1].stop + margin)


def together(jobs: Sequence[Job], clip: Clip, observation: Observation) -> list[Group]:
    """All jobs in groups. What is near belongs together, filled or left open and by whatever method: each gap
    is seen with what is around it, so alone it would have its neighbours completed once more, and what
    becomes of it does not depend on what becomes of them."""
    groups: list[Group] = []
    for job in jobs:
        for start, stop in _pieces(clip, observation, job.gap):
            held = groups[-1].pieces if groups else []
            near = held and held[-1].job is not job and start - held[-1].stop < CONTEXT * clip.fps
            if near and stop - held[0].start <= GROUP * clip.fps:
                held.append(Piece(job, start, stop))
            else:
                groups.append(Group([Piece(job, start, stop)]))
    return groups


def _pieces(clip: Clip, observation: Observation, gap: Gap) -> Iterator[tuple[int, int]]:
    """The gap itself; or, when single joints are missing for long, overlapping pieces of it.

    Where pieces overlap at least a part of every pose is known. Where all turns are, the way of the body goes
    on from its beginning, and pieces of it would be apart.
    """
    piece, overlap = round(PIECE * clip.fps), round(OVERLAP * clip.fps)
    if observation.rotation[gap.start : gap.stop].all():
        piece = len(gap)
    bodies = performers(clip.skeleton) or [range(len(clip.skeleton))]
    empty = np.any([~observation.rotation[:, list(body)].any(axis=1) for body in bodies], axis=0)
    start = gap.start
    while True:
        stop = min(start + piece, gap.stop)
        while stop < gap.stop and empty[stop - overlap : stop].any():
            stop += 1
        yield start, stop
        if stop == gap.stop:
            return
        start = stop - overlap


def paste(
    whole: np.ndarray, part: np.ndarray, known: np.ndarray, start: int, inside: slice, fade: int
) -> None:
    """Put the unobserved values of a window into the whole clip, blended over its first `fade` frames."""
    values = part[inside].copy()
    stop = start + len(values)
    if fade:
        share = ramp(np.arange(1, fade + 1) / (fade + 1))
        before = whole[start : start + fade]
        if whole.shape[-1] == 4:
            values[:fade] = rotations.slerp(before, values[:fade], share[:, None])
        else:
            values[:fade] = before + share[:, None, None] * (values[:fade] - before)
    missing = ~known[start:stop]
    whole[start:stop][missing] = values[missing]


def shifted(reports: Iterable[GapReport], by: int, start: int, stop: int, job: Job) -> Iterator[GapReport]:
    """The reports of a window that concern its own gap, counted in frames of the whole clip."""
    for one in reports:
        if one.start + by < stop and one.stop + by > start:
            first, last = max(one.start + by, start), min(one.stop + by, stop)
            # Where windows overlap each tells of its own frames alone.
            share = (last - first) / (one.stop - one.start)
            travel = None if one.foot_travel is None else share * one.foot_travel
            notes = ((job.note,) if job.note else ()) + one.notes
            yield replace(one, start=first, stop=last, number=job.number, notes=notes, foot_travel=travel)


def joined(reports: list[GapReport]) -> list[GapReport]:
    """One report for a gap that was completed in pieces: the worst seam and bone, means of the rest."""
    done: list[GapReport] = []
    for one in reports:
        last = done[-1] if done else None
        # Pieces of one gap overlap; of two bodies one may be lost twice while the other one is.
        if (
            last is None
            or one.start > last.stop
            or (last.number, last.joints, last.method) != (one.number, one.joints, one.method)
        ):
            done.append(one)
            continue
        # Of all frames so far, those that the new piece added.
        share = (one.stop - last.stop) / (one.stop - last.start)
        worst = {
            name: _over(last, one, name, max)
            for name in (
                *("seam_before", "peak", "peak_limit", "bone_deviation"),
                *("penetration", "path", "pins", "drift"),
            )
        }
        # A joint's velocity jump goes with its own limit.
        seam = max(last, one, key=lambda part: (part.seam_after or 0.0) / (part.seam_limit or 1.0))
        worst |= {"seam_after": seam.seam_after, "seam_limit": seam.seam_limit}
        means = {
            name: _over(last, one, name, lambda a, b, share=share: a + share * (b - a))
            for name in (
                *("solve_error", "foot_slide", "foot_slide_before"),
                *("liveliness", "gliding", "expected"),
            )
        }
        travel = _over(last, one, "foot_travel", lambda a, b: a + b)
        notes = _once((*last.notes, *one.notes))
        done[-1] = replace(last, stop=one.stop, foot_travel=travel, notes=notes, **worst, **means)
    return done


def _once(notes: tuple[str, ...]) -> tuple[str, ...]:
    """Notes without those that are said twice; of doubts, the largest."""
    doubts = [note for note in notes if note.startswith(DOUBTS)]
    worst = max(doubts, key=lambda note: float(note.removeprefix(DOUBTS).split()[0]), default="")
    return tuple(note for note in dict.fromkeys(notes) if note not in doubts or note == worst)


def _over(one: GapReport, other: GapReport, name: str, combine: Callable[..., float]) -> Any:
    """A measure of two reports combined; where only one has it, that one's."""
    a, b = getattr(one, name), getattr(other, name)
    return combine(a, b) if a is not None and b is not None else b if a is None else a


def put_together(clip: Clip, said: list[tuple[int, slice, Raw]]) -> Raw:
    """What the methods said in their windows, as one; positions are NaN where none spoke of them."""
    rotation, translation = clip.rotation.copy(), clip.translation.copy()
    joints = tuple(sorted({joint for _, _, raw in said if raw.positions is not None for joint in raw.joints}))
    shape = (len(clip), len(joints), 3)
    positions, own = (np.full(shape, np.nan), np.full(shape, np.nan)) if joints else (None, None)
    stands = np.full((len(clip), 4), np.nan) if any(raw.stands is not None for *_, raw in said) else None
    expected = np.full(len(clip), np.nan) if any(raw.expected is not None for *_, raw in said) else None
    for start, inside, raw in said:
        part = slice(start, start + inside.stop - inside.start)
        rotation[part], translation[part] = raw.clip.rotation[inside], raw.clip.translation[inside]
        for whole, spoken in ((positions, raw.positions), (own, raw.own)):
            if whole is not None and spoken is not None:
                whole[part, [joints.index(joint) for joint in raw.joints]] = spoken[inside]
        if stands is not None and raw.stands is not None:
            stands[part] = raw.stands[inside]
        if expected is not None and raw.expected is not None:
            expected[part] = raw.expected[inside]
    whole_clip = replace(clip, rotation=rotation, translation=translation, source=None)
    return Raw(whole_clip, positions, joints, own=own, stands=stands, expected=expected)


def raw_part(raw: Raw, start: int, stop: int) -> Raw:
    """What a method said of the frames start to stop - 1."""
    by_frame = {name: getattr(raw, name) for name in ("positions", "own", "stands", "expected")}
    parts: dict[str, Any] = {
        name: None if some is None else some[start:stop] for name, some in by_frame.items()
    }
    return replace(raw, clip=raw.clip.slice(start, stop), **parts)
