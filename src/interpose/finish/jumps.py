"""Velocity jumps at the seams of a span and inside of it: how far they may go, and what makes them less."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from interpose.clip import Clip, Skeleton
from interpose.finish import feet, seams
from interpose.finish.leading import led_over
from interpose.finish.solve import Axes
from interpose.finish.span import Span, write
from interpose.geometry import measures
from interpose.geometry.time import runs
from interpose.observation import Gap, Observation
from interpose.skeletons import find_mapping

# Metres a second squared by which velocities may jump inside of any gap: toes of who walks do by 48, and
# beside a gap he may have stood.
SETS_OFF = 60.0
# Seconds on either side of a jump inside of a gap that a spline takes over to mend it, as few as do, and the
# share of a gap beyond which that is no mending.
MENDS, PATCHED = (0.1, 0.2, 0.4), 0.5
# Metres a second squared by which velocities jump in no body's motion, over a thirtieth of a second as from
# frame to frame (of 280 pieces of HDM05, at 120 fps, 6 do, glitches among them); and by which they seldom do
# but where feet land and hands strike: mended where nothing tells how the motion itself jumps. Between 60
# pairs of keys half a turn apart, where networks may turn all at once, 23 fills jump so, and 5 once it is
# mended (joints are off by 24.6 and 24.5 cm); between 80 pairs of any 3, and 1.
TORN, WILD = 200.0, 100.0
# Metres a second squared by which velocities may jump at a lone key, however still what is known elsewhere
# is: half of 54 pieces of 5 s of LAFAN1's validation performer have a larger limit of their own. Who stands
# before keys in which he walks is no measure for these.
LONE = 15.0
# Seconds of motion that are known at least for it to tell how far velocities may jump inside of gaps.
TELLS = 1.0
# What hangs from a joint that jumps by so great a share of what it does itself jumps for that.
CARRIES = 0.5
# By how much a limit may be passed: what is softened stops at it.
SLACK = 1.02
# Seconds.
BEAT = 1 / 30
# The change of velocity (metres a second) beyond which none is softened: that is a jump in value.
KINK = 8.0


@dataclass(frozen=True)
class Bounds:
    """How far the velocity of each joint may jump, in metres per frame squared.

    Attributes:
        seam: (J,) at seams, as much as in what is known.
        peak: (J,) inside of gaps; and at lone keys, which lie inside of motion that is not known.
        key: (J,) at lone keys before that is softened.
        beat: inside of gaps over the frames of a BEAT, in metres per BEAT squared: what frames of 1/120 s
            jump by is noise for the most part, within which an arm may whip back.
    """

    seam: np.ndarray
    peak: np.ndarray
    key: np.ndarray
    beat: float

    @classmethod
    def of(cls, clip: Clip, known: Observation, limits: np.ndarray) -> Bounds:
        """Of what is known of a clip; `limits` (J,) are those of seams, see `seams.limits`."""
        beat = float(np.nanmax(seams.own_jumps(clip, known, beats(clip.fps)), initial=torn(clip.fps)))
        return cls(limits, peak_limits(clip, known, limits), np.maximum(limits, LONE / clip.fps**2), beat)

    @classmethod
    def untold(cls, skeleton: Skeleton, fps: float) -> Bounds:
        """Where nothing tells how the motion itself jumps, as between lone keys: not as no body does."""
        peak = np.full(len(skeleton), TORN / fps**2)
        return cls(np.full_like(peak, np.inf), peak, np.full_like(peak, wild(skeleton) / fps**2), torn(fps))

    def at(self, clip: Clip, known: Observation, frames: np.ndarray) -> np.ndarray:
        """(n, J) at observed frames (n,)."""
        return np.where(seams.lone(clip, known, frames), self.peak, self.seam)

    def softened(self, clip: Clip, known: Observation, frames: np.ndarray) -> np.ndarray:
        """(n, J) at observed frames (n,), before that is softened."""
        return np.where(seams.lone(clip, known, frames), self.key, self.seam)


def beats(fps: float) -> int:
    """The frames of a BEAT."""
    return max(round(BEAT * fps), 1)


def torn(fps: float) -> float:
    """Metres per BEAT squared by which velocities jump in no body's motion."""
    return TORN * (beats(fps) / fps) ** 2


def wild(skeleton: Skeleton) -> float:
    """Metres a second squared by which velocities of a body of this size seldom jump."""
    return min(WILD * feet.size(skeleton), TORN)


def inside(
    clip: Clip, known: Observation, gap: Gap, bounds: Bounds | None
) -> tuple[float, float | None] | None:
    """As `beside`, of the frames of a gap."""
    frames = _inner(clip, np.arange(gap.start, gap.stop))
    if not frames.size:
        return None
    most = None if bounds is None else np.broadcast_to(bounds.peak, (len(frames), len(bounds.peak)))
    return _nearest(seams.jumps(clip, known, frames), most)


def share(clip: Clip, known: Observation, frames: np.ndarray, most: np.ndarray) -> float:
    """Of what they may (J,), how far velocities jump at some frames: above 1 too far."""
    frames = _inner(clip, frames)
    if not frames.size:
        return 0.0
    return float((np.linalg.norm(seams.jumps(clip, known, frames), axis=-1) / most).max())


def beside(
    clip: Clip, known: Observation, gap: Gap, bounds: Bounds | None
) -> tuple[float, float | None] | None:
    """The velocity jump beside a gap of the joint that comes nearest to its limit, or goes furthest beyond,
    and that limit, in metres per frame squared; of the one that jumps furthest where there are no limits
    (None). None where the gap has no seam."""
    frames = _inner(clip, np.array([gap.start - 1, gap.stop]))
    if not frames.size:
        return None
    return _nearest(
        seams.seam_jumps(clip, known, frames), None if bounds is None else bounds.at(clip, known, frames)
    )


def _inner(clip: Clip, frames: np.ndarray, step: int = 1) -> np.ndarray:
    """Those of the frames that have both neighbours, `step` frames away."""
    return frames[(frames >= step) & (frames < len(clip) - step)]


def _nearest(jumps: np.ndarray, most: np.ndarray | None) -> tuple[float, float | None]:
    """Of jumps (n, J, 3) the one that comes nearest to what it may be (n, J), and that."""
    size = np.linalg.norm(jumps, axis=-1)
    row, joint = np.unravel_index((size if most is None else size / most).argmax(), size.shape)
    return float(size[row, joint]), None if most is None else float(most[row, joint])


def peak_limits(hidden: Clip, known: Observation, limits: np.ndarray) -> np.ndarray:
    """(J,) how far the velocity of each joint may jump inside a gap, in metres per frame squared; `limits`
    (J,) is how far at seams.

    Landings and kicks do so far beyond the limit of seams: the observed motion around it is asked, of a
    whole body, as an arm may do next what a leg did. What hangs on it, as a sword and fingers, goes its own
    ways: further than any joint of the body, which may not for that. What no body does is a glitch of the
    file, and no measure for anything. Nor is a moment of it, of a body that may have stood.
    """
    own = seams.own_jumps(hidden, known)
    largest = np.where(own < TORN / hidden.fps**2, own, 0.0).max(axis=0, initial=0.0)
    most = np.maximum(seams.PEAKS * limits, seams.OWN_PEAKS * largest)
    body = list(find_mapping(hidden.skeleton).mapped[1]) or slice(None)
    least = SETS_OFF if len(own) >= TELLS * hidden.fps else max(SETS_OFF, wild(hidden.skeleton))
    return np.maximum(most, max(most[body].max(), least / hidden.fps**2))


def excess(
    current: Clip, known: Observation, span: Span, bounds: Bounds | None, first: int
) -> tuple[float, str, int]:
    """The largest of `excesses`."""
    return max([(0.0, "", span.start), *excesses(current, known, span, bounds, first)])


def excesses(
    current: Clip, known: Observation, span: Span, bounds: Bounds | None, first: int
) -> list[tuple[float, str, int]]:
    """By how much the velocity jumps at the seams of a span, and those inside, exceed what they may (1: just
    not), in words, and at which frame; words call the first frame `first`."""
    bounds = bounds or Bounds.untold(current.skeleton, current.fps)
    found = []
    edges = seams.edges(known, current.translated, (span.start, span.stop))
    inner = _inner(current, np.arange(span.start, span.stop))
    for frames, measure, most, where in (
        (edges, seams.seam_jumps, bounds.at(current, known, edges), "at a seam"),
        (inner, seams.jumps, bounds.peak, "inside the gap"),
    ):
        if frames.size:
            size = np.linalg.norm(measure(current, known, frames), axis=-1)
            found.append(_worst(size, most, frames, current, known, where, first))
    return found


def _carried(current: Clip, known: Observation, joint: int, frame: int, step: int) -> str:
    """Of a jump of a joint over `step` frames, which hangs from one whose place is known, what that is to
    blame for, in words."""
    near, skeleton = slice(frame - step, frame + step + 1), current.skeleton
    told = np.atleast_1d(known.slice(near.start, near.stop).positions(skeleton).all(axis=0))
    above = next((one for one in skeleton.ancestors(joint) if told[one]), None)
    if above is None:
        return ""
    placed = current.slice(near.start, near.stop).positions()
    own, its = (float(measures.acceleration(placed[:, one], step)[0]) / step**2 for one in (joint, above))
    if its < CARRIES * own:
        return ""
    name = skeleton.names[above]
    return f"; {name}, from which it hangs, and which is measured, jumps by {100 * its:.2f} there"


def whips(
    current: Clip, known: Observation, span: Span, bounds: Bounds | None, first: int
) -> list[tuple[float, str, int]]:
    """As `excesses`, of jumps inside of a span over the frames of a BEAT, where it has more than one. What
    whips so is still nearer to the motion than a simpler method's, and no reason for that one to take over.
    """
    step = beats(current.fps)
    frames = _inner(current, np.arange(span.start, span.stop), step)
    if step == 1 or not frames.size:
        return []
    bounds = bounds or Bounds.untold(current.skeleton, current.fps)
    # Told by the frame, as all jumps are.
    size = np.linalg.norm(seams.jumps(current, known, frames, step), axis=-1) / step**2
    where = f"inside the gap, over {step} frames"
    most = np.array(bounds.beat / step**2)
    return [_worst(size, most, frames, current, known, where, first, step)]


def _worst(
    size: np.ndarray,
    most: np.ndarray,
    frames: np.ndarray,
    clip: Clip,
    known: Observation,
    where: str,
    first: int,
    step: int = 1,
) -> tuple[float, str, int]:
    """An entry of `excesses`: of jumps (n, J) over `step` frames at some the one furthest beyond what it may
    be."""
    most = np.broadcast_to(most, size.shape)
    row, joint = np.unravel_index((size / most).argmax(), size.shape)
    own, limit, frame = float(size[row, joint]), float(most[row, joint]), int(frames[row])
    words = f"the velocity jumps by {100 * own:.2f} cm/frame^2 {where}, above {100 * limit:.2f}"
    words += f" ({clip.skeleton.names[joint]}, frame {first + frame})"
    return own / limit, words + _carried(clip, known, int(joint), frame, step), frame


def mend(current: Clip, known: Observation, span: Span, bounds: Bounds | None) -> list[tuple[int, int]]:
    """Where velocities jump further inside of a span than they may, let a spline lead over the place.

    Returns the frames start to stop - 1 of each, in order: none where too much of it would have to be.
    """
    usual = np.full(len(current.skeleton), wild(current.skeleton) / current.fps**2)
    most = usual if bounds is None else bounds.peak
    lo, hi, (start, stop) = span.around(len(current), 3)
    # Not the frames beside seams: where a method does not arrive there, a spline would only hide it.
    frames, seen, led = np.arange(start + 1, stop - 1), known.slice(lo, hi), current.slice(lo, hi)
    places = np.zeros(len(led), bool)

    def off(done: Clip, first: int, last: int) -> float:
        return share(done, seen, np.arange(first - 1, last + 1), most)

    while frames.size:
        jumps = (np.linalg.norm(seams.jumps(led, seen, frames), axis=-1) / most).max(axis=1)
        if jumps.max() <= 1:
            break
        worst = int(frames[jumps.argmax()])
        better = led_over(led, seen, (start, stop), (worst, worst + 1), MENDS, off)
        if better is None:
            return []
        led, again = better.clip, places[better.start : better.stop].all()
        places[better.start : better.stop] = True
        if again or places.sum() > PATCHED * (stop - start):
            return []
    if places.any():
        write(current, led, span.start, (start, stop))
    return [(lo + first, lo + last) for first, last in runs(places)]


def soften(
    current: Clip,
    known: Observation,
    span: Span,
    bounds: Bounds | None,
    axes: Axes,
) -> float:
    """Bring the jumps at the seams of a span below what they may be, by joints that may turn about `axes`.

    Returns how many times too large the largest one was, or 0 where there was nothing to do.
    """
    edges = seams.edges(known, current.translated, (span.start, span.stop))
    if not edges.size:
        return 0.0
    bounds = bounds or Bounds.untold(current.skeleton, current.fps)
    size, most = (
        np.linalg.norm(seams.seam_jumps(current, known, edges), axis=-1),
        bounds.softened(current, known, edges),
    )
    if not (size > most).any() or size.max() >= KINK / current.fps:
        return 0.0
    lo, hi, inner = span.around(len(current), 2)
    softer = seams.soften(current.slice(lo, hi), known.slice(lo, hi), inner, bounds.softened, axes)
    write(current, softer, span.start, inner)
    return float((size / most).max())
