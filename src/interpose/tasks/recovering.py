"""Joints that are lost, named or found."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from interpose.clip import Clip
from interpose.errors import RequestError
from interpose.finish import Completion, Provenance
from interpose.finish.completing import assembled
from interpose.finish.feet import legs
from interpose.finish.report import JointMoments
from interpose.geometry import rotations
from interpose.geometry.time import runs
from interpose.methods.protocol import Method
from interpose.observation import Gap, Observation
from interpose.observation.exchange import Bend, Exchange, Taken, crossovers, exchanges, put_back
from interpose.observation.frozen import held_values, stuck
from interpose.observation.scan import intact, strays
from interpose.skeletons.carrier import STILL, line_of, place_of
from interpose.skeletons.performers import Joints, clip_of, meant
from interpose.tasks.filling import fill

# The share that is lost, of joints that turn at all, from which on what is at rest beside them is lost as
# well, and radians by which it may be off.
MOST, STANDS = 0.75, 1e-5
# Seconds by which somebody may miss the frame at which limbs change sides.
NEAR = 0.1


def recover(
    clip: Clip,
    joints: Sequence[str] | None = None,
    frames: tuple[int, int] | None = None,
    method: str | Path | Method = "auto",
    seed: int | None = None,
    progress: Callable[[float], None] | None = None,
    place: bool = False,
) -> Completion:
    """Recover joints whose local rotations are unknown, over the whole clip or over frames start to stop - 1.

    Without `joints` what was lost is found (`scan.intact`): joints that snap to their rest pose or
    jump away and back, and spikes, at any frames but a first or last one that is no part of the motion as a
    whole: that `scan` finds, and `fill` mends; and hips whose place stands still while they turn, or that are
    held in place and turn while something else goes on. Arms and legs that change sides and not back are put
    back in the frames from one such change to the next, or to an end of the clip, where `frames` names these:
    `scan` does.
    `place` says that this is all that is lost: where the body is, but for the first frame of a whole clip.
    Feet that stand tell it. Other arguments, result and errors are those of `fill`.
    """
    start, stop = frames or (0, len(clip))
    if frames is not None:
        Gap(start, stop).check(len(clip))
    if joints is not None and not joints:
        raise RequestError(
            "there is no joint to recover", "the list of them is empty", "Leave it out to find what is lost."
        )
    if joints is None and (several := meant(clip.skeleton)):
        bodies: dict[Joints, Completion] = {}
        for i, body in enumerate(several):
            along = None if progress is None else partial(_along, progress, i, len(several))
            bodies[body] = recover(clip_of(clip, body), None, (start, stop), method, seed, along, place)
        done = assembled(clip, bodies)
        gaps = [replace(gap, number=number) for number, gap in enumerate(done.report.gaps, 1)]
        return replace(done, report=replace(done.report, gaps=gaps))
    if place:
        if joints is not None:
            raise RequestError(
                "joints and the place of the body cannot be recovered at once",
                "feet tell the place only where all turns are known",
                "Recover the joints first, and then the place.",
            )
        if not legs(clip.skeleton):
            raise RequestError(
                "the place of the body cannot be recovered",
                "what it stands on tells it, and no legs were found",
                "Name them: --map, or load(..., roles=...).",
            )
        seen = Observation.full(clip)
        seen.translation[start:stop, [place_of(clip), *_going(clip, start, stop)]] = False
        if (start, stop) == (0, len(clip)):
            # The first frame counts that belongs to the motion.
            seen.translation[min({*range(stop)} - {*strays(clip)}, default=0) :][:1] = True
        return fill(clip, seen, method, seed=seed, progress=progress)
    if joints is None:
        swapped = swaps(clip, start, stop)
        sides = put_back(clip, swapped)
        done = fill(sides, _by_itself(sides, start, stop), method, seed=seed, progress=progress)
        return with_sides(done, swapped)
    return fill(clip, [Gap(start, stop, tuple(joints))], method, seed=seed, progress=progress)


def _along(progress: Callable[[float], None], done: int, of: int, share: float) -> None:
    progress((done + share) / of)


def swaps(clip: Clip, start: int, stop: int) -> list[Taken]:
    """What was taken for something else within the frames start to stop - 1; or in all of them, as somebody
    says of a part of the clip from one change of sides to the next, or to an end, which they meet to NEAR."""
    within = []
    for one in exchanges(clip):
        if isinstance(one, Bend):  # each frame of it by itself
            one = replace(one, start=max(start, one.start), stop=min(stop, one.stop))
        if start <= one.start < one.stop <= stop:
            within.append(one)
    if (start, stop) == (0, len(clip)):
        return within
    told, near = [], max(1, round(NEAR * clip.fps))
    for first, last, one in stretches(crossovers(put_back(clip, within)), len(clip)):
        if abs(first - start) <= near and abs(last - stop) <= near:
            told.append(replace(one, start=first, stop=last))
    return sorted([*within, *told], key=lambda one: (one.start, one.joints))


def stretches(found: Sequence[Exchange], frames: int) -> Iterator[tuple[int, int, Exchange]]:
    """From each change of sides to the next, or an end of the clip, of each limb that does: start, stop, and
    what is exchanged there or in the stretches beside it."""
    limbs: dict[int, list[Exchange]] = {}
    for one in found:
        limbs.setdefault(one.left[0], []).append(one)
    for some in limbs.values():
        cuts = sorted({0, frames, *(end for one in some for end in (one.start, one.stop))})
        yield from ((first, last, some[0]) for first, last in zip(cuts, cuts[1:]))


def with_sides(done: Completion, swapped: Sequence[Taken]) -> Completion:
    """A completion that also tells what was on the wrong side, and was put back."""
    if not swapped:
        return done
    provenance, frames = done.provenance.copy(), dict[int, list[str]]()
    for one in swapped:
        provenance[one.start : one.stop, one.joints] = Provenance.CORRECTED
        for joint in one.joints:
            frames.setdefault(joint, []).append(f"{one.start}:{one.stop}")
    names = done.clip.skeleton.names
    told = tuple(JointMoments(names[joint], tuple(at)) for joint, at in sorted(frames.items()))
    alone = tuple(names[joint] for joint in sorted({joint for one in swapped for joint in one.alone}))
    report = replace(done.report, exchanged=told, unpaired=alone)
    return replace(done, provenance=provenance, report=report)


def _going(clip: Clip, start: int, stop: int) -> list[int]:
    """The joints above the hips that carry them outside of frames start to stop - 1: a root that stays where
    it is in all others is right."""
    others = np.delete(clip.translation, np.s_[start:stop], axis=0)
    ways = np.ptp(others, axis=0).max(axis=-1) if len(others) else np.zeros(len(clip.translated))
    return [joint for joint in line_of(clip) if ways[clip.translated.index(joint)] > STILL]


def _fallen(clip: Clip, seen: Observation) -> Observation:
    """The same without joints that are at rest while MOST are lost: of a pose that falls to rest as a whole,
    one that was near to that anyway does not snap."""
    lost = np.logical_not(seen.rotation)
    turning = rotations.angle(clip.rotation, clip.rotation[:1]).max(axis=0, initial=0.0) > STANDS
    for start, stop in runs(lost[:, turning].sum(axis=1) > MOST * turning.sum()):
        part = clip.rotation[start:stop]
        still = rotations.angle(part, clip.skeleton.rest_rotation).max(axis=0) < STANDS
        beside = clip.rotation[[max(start - 1, 0), min(stop, len(clip) - 1)]]
        turns = rotations.angle(beside, part[:1]).max(axis=0) > STANDS
        lost[start:stop] |= still & turns
    return replace(seen, rotation=~lost)


def _by_itself(clip: Clip, start: int, stop: int) -> Observation:
    """What is left of a clip without what was lost in frames start to stop - 1: what `recover` finds."""
    seen, odd = _fallen(clip, intact(clip)), strays(clip)
    seen.rotation[odd], seen.translation[odd] = True, True
    for one in stuck(clip):
        turns, places = held_values(clip, one)
        seen.rotation[one.start : one.stop, turns] = False
        # A rest pose beside the frames in which a body is stuck does not tell where it is either.
        beside = [frame for frame in odd if one.start - 1 <= frame <= one.stop]
        seen.translation[np.ix_([*range(one.start, one.stop), *beside], places)] = False
    seen.rotation[:start], seen.translation[:start] = True, True
    seen.rotation[stop:], seen.translation[stop:] = True, True
    return seen
