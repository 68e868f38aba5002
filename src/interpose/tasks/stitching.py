"""Clips one after another, and what leads from each to the next."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from interpose.clip import Clip
from interpose.errors import RequestError
from interpose.finish import Completion, feet, on_rig_of, seams
from interpose.finish.notes import skidding
from interpose.finish.report import GapReport
from interpose.geometry.measures import acceleration
from interpose.methods.protocol import Method
from interpose.observation import Observation, gait, timeline
from interpose.skeletons import find_humanoid, find_mapping
from interpose.tasks.filling import fill
from interpose.tasks.windows import raw_part

# Seconds by which a transition may be longer than it has to be, where feet slide less so, and more than which
# even the briefest one takes, where all others would be flagged; seconds of motion on either side with which
# that is tried; metres that feet have to travel in it; the slide (cm/s) that counts as much as gliding does.
TRIED, BRIEFEST, BESIDE, TRAVELS, GLIDING = 1.0, 0.3, 0.7, 0.2, 50.0
# The share of what is unhurried that one takes at least: who runs does not stop dead.
HASTIEST = 0.6
# Seconds that are generated of a motion that goes round already, and more of them where something would be
# flagged: a foot that is elsewhere can step.
BRIDGES = (0.15, 0.3, 0.5)
# Its joints jump no further there than so many times what each does at most in the clip, or than this (metres
# a second squared): poses that are alike in the mean may have a hand elsewhere, and limits of seams are those
# of a body's liveliest joints.
SNAPS, CALM = 1.3, 8.0


@dataclass(frozen=True)
class Loop:
    """How a motion that goes round meets its beginning.

    Attributes:
        placement: how the whole motion is turned and shifted each time it comes round.
        why: what decided the length of the last gap, where nobody said it.
        jump, limit: cm a frame squared, the velocity jump at frame 0, so placed, after the last frame,
            of the joint that comes nearest to its limit or goes furthest beyond; and that limit, as at seams.
    """

    placement: timeline.Placement
    why: str
    jump: float | None
    limit: float | None


@dataclass(frozen=True, eq=False, repr=False)
class Stitched(Completion):
    """A completion that tells where each clip lies on the timeline, and of a loop how it closes."""

    clips: list[timeline.Laid]
    loop: Loop | None = None


def stitch(
    clips: Sequence[Clip],
    frames: str | int | Sequence[int] = "auto",
    align: bool = True,
    loop: bool = False,
    action: str = "",
    method: str | Path | Method = "auto",
    seed: int | None = None,
    progress: Callable[[float], None] | None = None,
) -> Stitched:
    """Lay clips one after another on one timeline, and generate the motion that leads from each to the next.

    All frames of the clips are kept; following ones are placed as a whole (`timeline.lay`). Of a loop the
    beginning is laid at the end once more, as what the last gap leads to, and then taken away again.

    Args:
        clips, frames, align, loop: as in `timeline.lay`; the motion of what is on another rig than the first
            clip is brought onto that one's skeleton first (`retarget`).
        action, method, seed, progress: as in `fill`.

    Raises:
        RequestError: what `on_rig_of`, `timeline.lay` and `fill` refuse.
    """
    given = list(clips)
    clips = [on_rig_of(clip, given[0]) if len(clip) else clip for clip in given]
    line = timeline.lay(clips, frames, align, loop)
    if isinstance(frames, str) and frames == "auto" and align:
        lengths, whys = _tried(line, method, action, seed)
        line = timeline.lay(clips, lengths, align, loop).because(whys)
    seen = Observation.without(line.clip, line.gaps)
    done = fill(line.clip, seen, method, seed=seed, progress=progress, action=action)
    clip, provenance, closing = done.clip, done.provenance, None
    if line.again is not None:
        start = line.again.start
        around = acceleration(clip.slice(start - 1, start + 2).positions())
        limits = seams.limits(line.clip, seen)
        jump = limit = None
        if around.size and limits is not None:
            joint = int((around[0] / limits).argmax())
            jump, limit = 100 * float(around[0, joint]), 100 * float(limits[joint])
        closing = Loop(line.again.placement, line.again.why, jump, limit)
        clip = clip.slice(0, start)
        provenance = provenance[:start]
    return Stitched(
        clip,
        lambda: raw_part(done.raw, 0, len(clip)),
        provenance,
        done.report,
        clips=[_scaled(*one, given[0]) for one in zip(line.laid, given, clips)],
        loop=closing,
    )


def _scaled(laid: timeline.Laid, given: Clip, brought: Clip, first: Clip) -> timeline.Laid:
    """Where a clip lies, which was `brought` onto the rig of the first one, or is as it was given."""
    if brought is given:
        return laid
    theirs, mine = (find_mapping(clip.skeleton).scale for clip in (given, first))
    return replace(laid, scale=laid.scale * theirs / mine)


@dataclass(frozen=True)
class Cycle:
    """Where a motion goes round already.

    Attributes:
        start, stop: the frames start to stop - 1 that are kept.
        frames: how many more lead back to the first of them: `stitch(clip.slice(start, stop), frames,
            loop=True)` takes as long as the motion itself did.
        apart: metres, in the mean over joints and how they move, that it was off by when it came back.
    """

    start: int
    stop: int
    frames: int
    apart: float


def cycle(clip: Clip) -> Cycle:
    """The part of a motion that loops best: of a walk one stride or several, of a dance a figure.

    The one whose ends are most alike, of those that close without anything that would be flagged, nor a snap,
    the sooner the better; where none does, the one in which least is, and joints snap and feet slide least.

    Raises:
        RequestError: no humanoid, or nothing in it comes back.
    """
    body = find_humanoid(clip)
    found = gait.cycles(body, clip) if body.mapping.usable and len(clip) else []
    if not found:
        raise RequestError(
            f"no part of {clip.name or 'the clip'} goes round",
            "no pose of it is like one that was there half a second to eight seconds before",
            "Loop all of it (without --trim, or cycle): then a way back to the beginning is generated.",
        )
    judged: dict[Cycle, tuple[int, float, float]] = {}
    own = list(body.mapping.mapped[1])  # a root that stays at the origin is put elsewhere each time
    most = np.maximum(acceleration(clip.positions()).max(axis=0, initial=0.0), CALM / clip.fps**2)[own]
    for seconds in BRIDGES:
        for begin, end, apart in found:
            bridge = min(max(2, round(seconds * clip.fps)), end - begin - 2)
            one = Cycle(begin, end - bridge, bridge, apart)
            kept = clip.slice(one.start, one.stop)
            done = stitch([kept], one.frames, loop=True)
            closed = done.report.gaps[0]
            flags, slides = _judged(closed)
            snaps = float((_jumps(done, len(kept))[own] / most).max())
            # Feet are not where the last frame has them, so that also the briefest way back may skid.
            usual = feet.measure(kept, Observation.full(kept), 1, len(kept) - 1)
            skids = closed.foot_slide is not None and skidding(
                closed.foot_slide, usual and usual[0], clip.skeleton
            )
            judged[one] = flags + skids + (snaps > SNAPS), max(snaps, SNAPS), slides
            if not judged[one][0]:
                return one
    return min(judged, key=lambda one: judged[one])


def _jumps(done: Stitched, start: int) -> np.ndarray:
    """(J,) how far joints of a loop jump at most from where the way back begins until it goes round again, in
    metres per frame squared."""
    assert done.loop is not None
    back, again = done.clip.slice(start - 2, len(done.clip)), done.loop.placement.of(done.clip.slice(0, 2))
    return acceleration(np.concatenate([back.positions(), again.positions()])).max(axis=0)


def _tried(
    line: timeline.Timeline, method: str | Path | Method, action: str, seed: int | None
) -> tuple[list[int], list[str]]:
    """How long each gap should be, and why: as long as strides tell, or else as long as feet slide least with
    the motion beside it, from its length on up to TRIED more; of those in which least is flagged. Where
    something is in each, shorter ones are tried, too."""
    lengths, whys, fps = [], [], line.clip.fps
    edges = [0, *(gap.start for gap in line.gaps), len(line.clip)], [0, *(gap.stop for gap in line.gaps)]
    for k, (way, gap) in enumerate(zip(line.ways, line.gaps)):
        near, own, by = round(BESIDE * fps) + 1, len(gap), max(1, round(fps / 10))
        ends = (
            line.clip.slice(max(edges[1][k], gap.start - near), gap.start),
            line.clip.slice(gap.stop, min(edges[0][k + 2], gap.stop + near)),
        )
        judged: dict[int, tuple[int, float]] = {}
        longer, shorter = (
            range(own, own + round(TRIED * fps) + 1, by),
            range(own - by, round(max(BRIEFEST * fps, HASTIEST * own)), -by),
        )
        for length in (*longer, *shorter):
            clean = [flags == 0 for flags, _ in judged.values()]
            if (clean and way.in_step and clean[0]) or (length < own and any(clean)):
                break
            pair = timeline.lay(ends, length)
            report = fill(pair.clip, pair.gaps, method, seed=seed, action=action).report.gaps[0]
            flags, slides = _judged(report)
            goes = report.foot_slide is not None and (report.foot_travel or 0.0) >= TRAVELS
            if goes or flags or length == own or judged[own][0]:
                judged[length] = flags, slides
            if not goes and not flags:
                break
        best = min(judged, key=lambda length: judged[length])
        lengths.append(best)
        flagged = "least is flagged, and " * any(flags for flags, _ in judged.values())
        least = f"{flagged}feet slide least, of {len(judged)} lengths tried (at first: {way.why})"
        whys.append(least if best != own else way.why)
    return lengths, whys


def _judged(report: GapReport) -> tuple[int, float]:
    """How much is flagged in a gap, and how far feet slide in it, or glide."""
    flags = sum(note.startswith("flagged") for note in report.notes)
    return flags, (report.foot_slide or 0.0) + GLIDING * (report.gliding or 0.0)
