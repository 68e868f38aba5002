"""Joints that are lost, named or found."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from interpose.clip import Clip
from interpose.errors import RequestError
from interpose.finish import Completion, Provenance
from interpose.finish.feet import legs
from interpose.finish.report import JointMoments
from interpose.methods.protocol import Method
from interpose.observation import Gap, Observation
from interpose.observation.exchange import Exchange, Flip, crossovers, exchanges, put_back
from interpose.observation.scan import intact, strays, stuck
from interpose.skeletons.carrier import place_of
from interpose.tasks.filling import fill


def recover(
    clip: Clip,
    joints: Sequence[str] | None = None,
    frames: tuple[int, int] | None = None,
    method: str | Method = "auto",
    seed: int | None = None,
    progress: Callable[[float], None] | None = None,
    place: bool = False,
) -> Completion:
    """Recover joints whose local rotations are unknown, over the whole clip or over frames start to stop - 1.

    Without `joints` what was lost is found (`scan.intact`): joints that snap to their rest pose or
    jump away and back, and spikes, at any frames but a first or last one that is no part of the motion as a
    whole: that `scan` finds, and `fill` mends; and hips whose place stands still while they turn, or that are
    held in place and turn while something else goes on.
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
        seen.translation[start:stop, place_of(clip)] = False
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


def swaps(clip: Clip, start: int, stop: int) -> list[Exchange | Flip]:
    """What was taken for something else within the frames start to stop - 1; or in all of them, as somebody
    says of a part of the clip at whose end, or beginning, limbs change sides."""
    within = [one for one in exchanges(clip) if start <= one.start and one.stop <= stop]
    if (start, stop) == (0, len(clip)):
        return within
    told = []
    for one in crossovers(put_back(clip, within)):
        for first, last in ((one.start, one.stop), (0, one.start), (one.stop, len(clip))):
            if (start, stop) == (first, last):
                told.append(replace(one, start=first, stop=last))
    return sorted([*within, *told], key=lambda one: (one.start, one.joints))


def with_sides(done: Completion, swapped: Sequence[Exchange | Flip]) -> Completion:
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


def _by_itself(clip: Clip, start: int, stop: int) -> Observation:
    """What is left of a clip without what was lost in frames start to stop - 1: what `recover` finds."""
    seen, odd = intact(clip), strays(clip)
    seen.rotation[odd], seen.translation[odd] = True, True
    for one in stuck(clip):
        held = [clip.skeleton.index(name) for name in one.joints or ()]
        if one.kind == "frozen body":
            seen.rotation[one.start : one.stop, held] = False
            held = [place_of(clip)]
        # A rest pose beside the frames in which a body is stuck does not tell where it is either.
        beside = [frame for frame in odd if one.start - 1 <= frame <= one.stop]
        seen.translation[np.ix_([*range(one.start, one.stop), *beside], held)] = False
    seen.rotation[:start], seen.translation[:start] = True, True
    seen.rotation[stop:], seen.translation[stop:] = True, True
    return seen
