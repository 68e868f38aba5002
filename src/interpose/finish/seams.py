"""No pop: fade what a method says differently from what is observed, and measure what is left.

A *run* is a range of frames in which one value is missing, a *span* one in which any is. The observed frame
beside a run is a *seam*. Everything is done in local rotations (from the right) and in translations as
vectors, so that a clip that is turned or shifted gives the same, turned or shifted.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from interpose.clip import Clip
from interpose.finish.solve import Axes, Bounds, refine
from interpose.geometry import measures
from interpose.geometry.time import ease, runs
from interpose.geometry.values import moved, offset
from interpose.observation import Observation

# Seconds over which a difference in value, and one in velocity, fade into a gap. A slope fades sooner: over a
# long way it would carry the pose far off.
VALUE_FADE, SLOPE_FADE = 0.75, 0.25
# Seconds of observed motion from which the difference in velocity is taken: less is noise.
MOMENT = 0.05
# A method that differs by more than this at a seam (metres) has lost the motion: replaced, not faded.
ABSURD = 0.5
# Below this a difference in a local rotation (radians) or translation (metres) is none.
EXACT = 1e-6
# The limit of velocity jumps: a percentile of the joint's own, and at least this, in metres per second
# squared (1 mm a frame squared at 30 fps).
PERCENTILE, FLOOR = 95.0, 0.9
# Inside a gap no joint jumps further than so many times the largest limit, or than so many times the largest
# jump of the observed motion around it. On validation performers 98 of 100 gaps of true motion keep to it.
PEAKS, OWN_PEAKS = 4.0, 2.0
# A jump that is brought below the limit is brought to this share of it.
MARGIN = 0.85
CHUNK = 4096


def reach(fps: float) -> int:
    """How many observed frames beside a run are read."""
    return max(2, round(MOMENT * fps) + 1)


def edges(known: Observation, translated: tuple[int, ...], span: tuple[int, int]) -> np.ndarray:
    """The frames of a span's seams: the observed one at each end of every run, if it has both neighbours."""
    found: set[int] = set()
    for seen in (known.rotation, known.translation[:, list(translated)]):
        for start, stop in _shared(seen, span):
            found |= {start - 1, stop}
    return np.array(sorted(f for f in found if 0 < f < len(known.rotation) - 1), int)


def limits(clip: Clip, observation: Observation) -> np.ndarray | None:
    """(J,) how far the velocity of each joint may jump at seams, in metres per frame squared.

    The 95th percentile of the joint's own velocity jumps, and at least that of all joints pooled: feet that
    land, and hands, jump three times as far as the rest of a body, which tells nothing of its hips. None when
    none are observed, as between lone keys.
    """
    own = own_jumps(clip, observation)
    if not own.size:
        return None
    pooled = max(float(np.percentile(own[np.isfinite(own)], PERCENTILE)), FLOOR / clip.fps**2)
    most = np.full(own.shape[1], pooled)
    for joint in np.flatnonzero(np.isfinite(own).any(axis=0)):
        told = own[np.isfinite(own[:, joint]), joint]
        most[joint] = max(float(np.percentile(told, PERCENTILE)), pooled)
    return most


def own_jumps(clip: Clip, observation: Observation, step: int = 1) -> np.ndarray:
    """(n, J) the clip's own velocity jumps, in metres per `step` frames squared.

    Of the frames in which the position of a joint is observed together with where it is `step` frames before
    and after; NaN for joints of which it is not.
    """
    pooled, wide = [np.empty((0, len(clip.skeleton)), np.float32)], 2 * step
    for start in range(0, max(len(clip) - wide, 0), CHUNK):
        stop = min(start + CHUNK + wide, len(clip))
        known = observation.slice(start, stop).positions(clip.skeleton)
        known = known[:-wide] & known[step:-step] & known[wide:]
        if known.any():
            part = measures.acceleration(_bare(clip, observation, start, stop).positions(), step)
            pooled.append(np.where(known, part, np.nan)[known.any(axis=1)].astype(np.float32))
    return np.concatenate(pooled)


def _bare(clip: Clip, observation: Observation, start: int, stop: int) -> Clip:
    """Some frames, in which nothing unobserved is looked at."""
    seen = observation.translation[start:stop, list(clip.translated), None]
    rotation = np.where(observation.rotation[start:stop, :, None], clip.rotation[start:stop], [1.0, 0, 0, 0])
    return clip.with_motion(rotation, np.where(seen, clip.translation[start:stop], 0.0))


@dataclass(frozen=True)
class Fade:
    """What is added at one seam of a run, for the values that share it.

    Attributes:
        value: (n, 3) how much the observed motion differs from the raw one at the observed frame.
        slope: (n, 3) how much its velocity differs, a frame, counted into the run.
        at_first: the slope is what is to be added at the first frame of the run.
    """

    value: np.ndarray
    slope: np.ndarray
    at_first: bool = False

    def at(self, distance: np.ndarray, room: int, fps: float) -> np.ndarray:
        """(m, n, 3) what is left of it `distance` frames (m,) into a run whose other seam is `room` away."""
        wide = min(float(room), max(VALUE_FADE * fps, 2.0))
        tight = min(float(room), max(SLOPE_FADE * fps, 2.0))
        x, y = (np.clip(distance / window, 0, 1)[:, None, None] for window in (wide, tight))
        slope = self.slope / (1 - 1 / tight) ** 2 if self.at_first else self.slope
        # The two cubic Hermite functions that start with value 1 and with slope 1.
        return (1 - ease(x)) * self.value + (y**3 - 2 * y**2 + y) * tight * slope


def fade(raw: Clip, base: Clip, known: Observation, span: tuple[int, int]) -> Clip:
    """Ease the raw motion of the span into the observed one on both sides, value by value.

    Args:
        raw: (F) frames; at observed frames what the method says of them, `reach` frames on each side.
        base: (F) frames, the observed motion.
        known: what is observed.
        span: the frames in which anything may be changed.
    """

    def measure(values: Values, slots: list[int], edge: int, way: int) -> Fade:
        mine, theirs = values(raw)[:, slots], values(base)[:, slots]
        seen, back = values(known)[:, slots[0]], 0
        while back < reach(raw.fps) - 1 and _is_seen(seen, edge - way * (back + 1)):
            back += 1
        far = edge - way * back
        value = offset(mine[edge], theirs[edge])
        return Fade(value, (value - offset(mine[far], theirs[far])) / max(back, 1))

    return _add(raw, known, span, measure)


def jumps(motion: Clip, known: Observation, at: np.ndarray, step: int = 1) -> np.ndarray:
    """(n, J, 3) velocity jumps of all joints at n frames in gaps or beside them, in metres per `step` frames
    squared.

    Zero for joints that are told around them, as to where they are against what carries them: what they do is
    no seam.
    """
    before, after = at - step, at + step
    near = np.concatenate([before, at, after])
    where = motion.with_motion(motion.rotation[near], motion.translation[near]).positions()
    where = where.reshape(3, len(at), *where.shape[1:])
    above = np.ones((len(near), len(motion.skeleton)), bool)  # all turns above a joint are known
    for joint, parent in enumerate(motion.skeleton.parents):
        if parent >= 0:
            above[:, joint] = above[:, parent] & known.rotation[near, parent]
    told = above & known.translation[near]
    first, second, third = told.reshape(3, len(at), -1)
    return np.where((first & second & third)[..., None], 0.0, where[0] - 2 * where[1] + where[2])


def seam_jumps(motion: Clip, known: Observation, at: np.ndarray) -> np.ndarray:
    """As `jumps`, of the joints alone whose seam it is: those that hang from a value that is known there and
    missing beside it, and whose own place is known there.

    What another one does that is missing all the while, as a foot that lands, is no seam of theirs, nor is
    what a lost hand does where the body is lost, too. A place that is lost alone is the seam of the joint
    that has it: all others move against it as they are known to.
    """
    moved = _parting(motion, known, at, -1) | _parting(motion, known, at, 1)
    placed = Observation(known.rotation[at], known.translation[at]).positions(motion.skeleton)
    return np.where((moved & placed)[..., None], jumps(motion, known, at), 0.0)


def lone(motion: Clip, known: Observation, at: np.ndarray) -> np.ndarray:
    """(n, J) which joints have a lone key at observed frames (n,): a seam of theirs on both sides."""
    return _parting(motion, known, at, -1) & _parting(motion, known, at, 1)


def _parting(motion: Clip, known: Observation, at: np.ndarray, way: int) -> np.ndarray:
    """(n, J) which joints hang from a value that is known at frames (n,) and missing beside it, one frame
    before or after (`way` -1 or 1)."""
    columns = list(motion.translated)
    turned, shifted = (now[at] & ~now[at + way] for now in (known.rotation, known.translation))
    moved = np.zeros_like(turned)
    for joint, parent in enumerate(motion.skeleton.parents):
        if parent >= 0:
            moved[:, joint] = moved[:, parent] | turned[:, parent]
    moved[:, columns] |= shifted[:, columns]
    return moved


def soften(
    motion: Clip,
    known: Observation,
    span: tuple[int, int],
    limits: Callable[[Clip, Observation, np.ndarray], np.ndarray],
    axes: Axes,
) -> Clip:
    """Bring velocity jumps at the seams of the span below the limits of the joints at n observed frames (n,
    J), metres per frame squared.

    The first missing pose is turned, as little as possible, so that joints that jump too far go on more like
    they did in the observed frames; within SLOPE_FADE the motion returns to its own way. Some joints
    turn about `axes` alone: others make up for what they cannot.
    """
    at = edges(known, motion.translated, span)
    jump, most = seam_jumps(motion, known, at), limits(motion, known, at)
    size = np.linalg.norm(jump, axis=-1)
    with np.errstate(invalid="ignore"):  # where there is no limit
        share = np.where(size > most, 1 - MARGIN * most / np.maximum(size, 1e-12), 0.0)
    excess = jump * share[..., None]
    # Joints far below their limit may give way for those above it.
    weights = np.where(size > 0.7 * most, 1.0, 0.05)
    # Each seam has a pose before and one after it; what is missing in both shares the work.
    edge, way = np.repeat(at, 2), np.tile([-1, 1], len(at))
    first = edge + way
    shared = ~known.frames[edge - 1] & ~known.frames[edge + 1]
    fresh = Observation(
        known.rotation[first] | ~known.rotation[edge], known.translation[first] | ~known.translation[edge]
    )
    some = np.repeat(excess.any(axis=(1, 2)), 2) & ~fresh.frames
    if not some.any():
        return motion
    fresh = Observation(fresh.rotation[some], fresh.translation[some])
    poses = motion.with_motion(motion.rotation[first[some]], motion.translation[first[some]])
    goal = (
        poses.positions()
        - np.where(shared[some], 0.5, 1.0)[:, None, None] * np.repeat(excess, 2, axis=0)[some]
    )
    everything = tuple(range(len(motion.skeleton)))
    nudged = refine(poses, fresh, everything, goal, np.repeat(weights, 2, axis=0)[some], Bounds(axes=axes))
    row = {(int(e), int(w)): i for i, (e, w) in enumerate(zip(edge[some], way[some]))}

    def measure(values: Values, slots: list[int], edge: int, way: int) -> Fade:
        none = np.zeros((len(slots), 3))
        if (edge, way) not in row:
            return Fade(none, none)
        i = row[edge, way]
        return Fade(none, offset(values(poses)[i, slots], values(nudged)[i, slots]), at_first=True)

    return _add(motion, known, span, measure)


Values = Callable[[Clip | Observation], np.ndarray]
Measure = Callable[[Values, list[int], int, int], Fade]


def _add(motion: Clip, known: Observation, span: tuple[int, int], measure: Measure) -> Clip:
    """The motion with a fade added at both ends of every run in the span."""

    def shifted(of: Clip | Observation) -> np.ndarray:
        return of.translation if isinstance(of, Clip) else of.translation[:, list(motion.translated)]

    def turned(of: Clip | Observation) -> np.ndarray:
        return of.rotation

    done = []
    for values in (turned, shifted):
        result = values(motion).copy()
        for (start, stop), slots in _shared(values(known), span).items():
            added = np.zeros((stop - start, len(slots), 3))
            for edge, way in ((start - 1, 1), (stop, -1)):
                if 0 <= edge < len(motion):
                    distance = (np.arange(start, stop) - edge) * way
                    added += measure(values, slots, edge, way).at(distance, stop - start + 1, motion.fps)
            part = result[start:stop, slots]
            result[start:stop, slots] = moved(part, added)
        done.append(result)
    return motion.with_motion(*done)


def _is_seen(seen: np.ndarray, frame: int) -> bool:
    return 0 <= frame < len(seen) and bool(seen[frame])


def _shared(known: np.ndarray, span: tuple[int, int]) -> dict[tuple[int, int], list[int]]:
    """{run: columns of `known` (F, n) that are missing in it}, for the runs inside the span."""
    found: dict[tuple[int, int], list[int]] = {}
    for column in range(known.shape[1]):
        for start, stop in runs(~known[slice(*span), column]):
            found.setdefault((start + span[0], stop + span[0]), []).append(column)
    return found


def difference(raw: Clip, base: Clip, known: Observation, span: tuple[int, int]) -> tuple[float, float]:
    """How far a method is from what is observed beside the runs of a span: by values, and by positions.

    Returns the largest difference of a value (radians or metres) and of a joint's position (metres).
    """
    columns, values = list(raw.translated), 0.0
    frames: set[int] = set()
    for mine, theirs, seen in (
        (raw.rotation, base.rotation, known.rotation),
        (raw.translation, base.translation, known.translation[:, columns]),
    ):
        for (start, stop), slots in _shared(seen, span).items():
            for edge in {start - 1, stop} & set(range(len(mine))):
                values = max(values, float(np.abs(offset(mine[edge, slots], theirs[edge, slots])).max()))
                frames.add(edge)
    if not frames:
        return 0.0, 0.0
    at = sorted(frames)
    apart = raw.with_motion(raw.rotation[at], raw.translation[at]).positions()
    apart = apart - base.with_motion(base.rotation[at], base.translation[at]).positions()
    return values, float(np.linalg.norm(apart, axis=-1)[known.positions(raw.skeleton)[at]].max(initial=0.0))
