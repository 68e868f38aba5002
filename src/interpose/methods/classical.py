"""Interpolation without training: zero velocity, linear and spline.

Each joint's local rotation, and each animated translation, is completed on its own from whatever is observed
*of it*: whole gaps, single joints, gaps at the ends of a clip and lone keys need no special cases. A rotation
that is never observed takes the rest pose, a root that is never observed stays at the origin.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from interpose.clip import Clip, Skeleton
from interpose.geometry import rotations, time
from interpose.geometry.values import moved, offset
from interpose.methods.protocol import Raw
from interpose.observation import Gap, Observation
from interpose.skeletons.carrier import placed

# Frames completed at once: bounds the memory that a long clip with everything missing takes.
BLOCK = 4096


@dataclass(frozen=True)
class Span:
    """The unobserved frames of values that share them, and the observed ones around each.

    Attributes:
        frames: (n,) frame numbers to complete, increasing.
        known: (m,) observed frame numbers, at least one, increasing.
        gap: (n,) for each frame the number of observed frames before it: 0 is an open start, m an open end.
        fps: frames a second.
    """

    frames: np.ndarray
    known: np.ndarray
    gap: np.ndarray
    fps: float

    @property
    def before(self) -> np.ndarray:
        """(n,) the observed frame before each, at an open start the first one after it."""
        return self.known[np.maximum(self.gap - 1, 0)]

    @property
    def after(self) -> np.ndarray:
        """(n,) the observed frame after each, at an open end the last one before it."""
        return self.known[np.minimum(self.gap, len(self.known) - 1)]


def _columns(known: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Columns of (F, n) booleans with the same missing frames: their numbers, and the (F,) they share."""
    groups: dict[bytes, list[int]] = {}
    for column, bits in enumerate(np.packbits(known, axis=0).T):
        groups.setdefault(bits.tobytes(), []).append(column)
    for columns in groups.values():
        yield np.array(columns), known[:, columns[0]]


def _spans(known: np.ndarray, fps: float) -> Iterator[Span]:
    """The spans of one column (F,), in blocks of frames."""
    missing, seen = np.flatnonzero(~known), np.flatnonzero(known)
    gap = np.searchsorted(seen, missing)
    for start in range(0, len(missing), BLOCK):
        block = slice(start, start + BLOCK)
        yield Span(missing[block], seen, gap[block], fps)


def _above(skeleton: Skeleton, rotation: np.ndarray, joint: int) -> np.ndarray:
    """(4,) how all that a joint hangs from is turned, by local rotations (J, 4)."""
    turned = rotations.identity()
    for above in skeleton.ancestors(joint):
        turned = rotations.multiply(rotation[above], turned)
    return turned


Fill = Callable[[np.ndarray, Span], np.ndarray]


def _complete(values: np.ndarray, known: np.ndarray, rest: np.ndarray, fps: float, fill: Fill) -> np.ndarray:
    """Values (F, n, d) with those not `known` (F, n) replaced: by `fill`, or by `rest` (n, d) if none is."""
    done = np.where(known[..., None], values, 0.0)
    for columns, seen in _columns(known):
        if not seen.any():
            done[:, columns] = rest[columns]
            continue
        # Unobserved values are zero here, and observed frames are all that `fill` reads of them.
        shared = done[:, columns]
        for span in _spans(seen, fps):
            done[np.ix_(span.frames, columns)] = fill(shared, span)
    return done


class _Classical:
    """What the three have in common; they differ in how a span of positions and of rotations is filled."""

    name: str

    def refuses(self, clip: Clip, gap: Gap) -> str | None:
        """None: classical methods fill everything, if not well."""
        return None

    def complete(self, clip: Clip, observation: Observation, seed: int | None = None) -> Raw:
        """Complete the clip; `seed` is not needed. Observed values are returned bit for bit."""
        skeleton, moved = clip.skeleton, list(clip.translated)
        rotation = _complete(
            clip.rotation, observation.rotation, skeleton.rest_rotation, clip.fps, self.rotations
        )
        translation = np.empty_like(clip.translation)
        roots = np.array([skeleton.parents[joint] < 0 for joint in moved])
        rest = np.where(roots[:, None], 0.0, skeleton.rest_translation[moved])
        # Hips below a reference, or below a root on the floor, go as a root does: seen with Y up.
        carry = np.isin(moved, placed(clip))
        axes = np.tile([1.0, 0.0, 0.0, 0.0], (len(moved), 1))
        for slot in np.flatnonzero(carry & ~roots):
            axes[slot] = _above(skeleton, rotation[0], moved[slot])
        for part, fill in ((carry, self.positions), (~carry, self.offsets)):
            known = observation.translation[:, moved][:, part]
            some = rotations.rotate(axes[part], clip.translation[:, part])
            done = _complete(some, known, rotations.rotate(axes, rest)[part], clip.fps, fill)
            done = rotations.rotate(rotations.conjugate(axes[part]), done)
            translation[:, part] = np.where(known[..., None], clip.translation[:, part], done)
        return Raw(clip.with_motion(rotation, translation))

    def positions(self, values: np.ndarray, span: Span) -> np.ndarray:
        """Positions (F, n, 3), Y up, of what carries the body, at the frames of a span."""
        raise NotImplementedError

    def offsets(self, values: np.ndarray, span: Span) -> np.ndarray:
        """Animated translations of other joints (F, n, 3) at the frames of a span."""
        return self.positions(values, span)

    def rotations(self, values: np.ndarray, span: Span) -> np.ndarray:
        """Quaternions (F, n, 4) at the frames of a span."""
        raise NotImplementedError


class ZeroVelocity(_Classical):
    """Holds the last observed value; before the first one, that."""

    name = "zero-velocity"

    def positions(self, values: np.ndarray, span: Span) -> np.ndarray:
        return values[span.before]

    rotations = positions


class Linear(_Classical):
    """LERP of translations, SLERP of rotations; constant where a gap has only one end."""

    name = "linear"

    def positions(self, values: np.ndarray, span: Span) -> np.ndarray:
        share = _share(span)[..., None]
        return (1 - share) * values[span.before] + share * values[span.after]

    def rotations(self, values: np.ndarray, span: Span) -> np.ndarray:
        return rotations.slerp(values[span.before], values[span.after], _share(span))


def _share(span: Span) -> np.ndarray:
    """(n, 1) how far each frame lies between its observed neighbours, 0 at open ends."""
    length = span.after - span.before
    return np.where(length > 0, (span.frames - span.before) / np.maximum(length, 1), 0.0)[:, None]


# How many seconds the velocity at the end of a gap is felt, at most: see Spline.
REACH = 0.8
REACH_OF_TRAVEL = 2.0
# Seconds in which a motion comes to rest where a gap has only one end.
REST = 0.5
# Velocities are read over this many seconds: one frame of most clips, several of those with a high rate,
# where the difference of two neighbours is mostly noise.
MOMENT = 1 / 30


class Spline(_Classical):
    """Cubic interpolation with the velocity of the observed frames on both sides (C1).

    The cubic (Hermite) form swings out by up to 4/27 of velocity times length, so that on long gaps a limb
    caught in mid-swing would fly off: its velocity says nothing about where it is a second later. End
    velocities therefore fade into that of the straight line within `REACH` seconds, which is an ordinary
    cubic up to that length. The way of a root over the ground has more inertia and gets longer.

    Measured on 240 windows of LAFAN1 (subjects 2 to 4, 30 fps), mean joint error in cm on the true root, for
    gaps of 15, 30 and 60 frames: 3.1, 6.9 and 11.6 with .8 s; plain cubic 3.1, 7.4 and 14.3; linear 5.1, 8.6
    and 12.6. The root's height is best with .8 s too, its way with a plain cubic up to 2 s (11.7 cm over 60
    frames, linear 21.3). On CMU's straight walks less would do: 4.9 cm with .8 s, 6.7 with 2 s.

    Where a gap has only one end the motion carries on and comes to rest within `REST` seconds.
    """

    name = "spline"

    def positions(self, values: np.ndarray, span: Span) -> np.ndarray:
        level = self._blend(values, span, time.hermite, REACH_OF_TRAVEL)
        height = self._blend(values, span, time.hermite, REACH)
        return np.where([False, True, False], height, level)

    def offsets(self, values: np.ndarray, span: Span) -> np.ndarray:
        return self._blend(values, span, time.hermite, REACH)

    def rotations(self, values: np.ndarray, span: Span) -> np.ndarray:
        return self._blend(values, span, time.hermite_rotations, REACH)

    def _blend(
        self, values: np.ndarray, span: Span, hermite: Callable[..., np.ndarray], reach: float
    ) -> np.ndarray:
        """The frames of a span; `hermite` is the curve between two values."""
        last = len(span.known) - 1
        gaps, which = np.unique(span.gap, return_inverse=True)
        start, stop = np.maximum(gaps - 1, 0), np.minimum(gaps, last)
        va = _velocity(values, span, start, -1)
        vb = _velocity(values, span, stop, 1)
        a, b = values[span.known[start]], values[span.known[stop]]
        length = (span.known[stop] - span.known[start]).astype(float)
        since = (span.frames - span.known[start][which])[:, None].astype(float)
        # An open end is a curve from its one value to itself, so only the velocity is left of it.
        is_open = (length == 0)[which]
        filled = np.empty((len(span.frames), *values.shape[1:]))
        inner = which[~is_open]
        filled[~is_open] = hermite(
            a[inner], b[inner], va[inner], vb[inner], since[~is_open], length[inner, None], reach * span.fps
        )
        outer = which[is_open]
        rest = max(REST * span.fps, 1.0)
        left = np.maximum(1.0 - abs(since[is_open]) / rest, 0.0)
        carried = np.sign(since[is_open]) * rest / 3 * (1 - left**3)
        velocity = np.where((gaps == 0)[outer, None, None], vb[outer], va[outer])
        filled[is_open] = moved(a[outer], carried[..., None] * velocity)
        return filled


def _velocity(values: np.ndarray, span: Span, at: np.ndarray, side: int) -> np.ndarray:
    """Velocities a frame (g, n, 3) at the observed frames number `at` (g,), from those before or after.

    Args:
        side: -1 to look at the run of observed frames that ends there, 1 at the one that starts there.
    """
    known, last = span.known, len(span.known) - 1
    # How many more observed frames follow on that side without a break.
    breaks = np.flatnonzero(np.diff(known) > 1)
    if side < 0:
        edge = np.concatenate([[0], breaks + 1])
        run = at - edge[np.searchsorted(breaks, at)]
    else:
        edge = np.concatenate([breaks, [last]])
        run = edge[np.searchsorted(breaks, at)] - at
    stride = np.clip(run // 2, 1, max(1, round(MOMENT * span.fps)))

    def difference(i: np.ndarray, j: np.ndarray) -> np.ndarray:
        i, j = np.minimum(i, j), np.maximum(i, j)
        lapse = np.maximum(known[j] - known[i], 1)
        return offset(values[known[i]], values[known[j]]) / lapse[:, None, None]

    def step(count: np.ndarray) -> np.ndarray:
        return np.clip(at + side * count, 0, last)

    # The velocity at the edge itself, not half a stride inside: half as much again of the last change.
    near, far = difference(at, step(stride)), difference(step(stride), step(2 * stride))
    ahead = np.where(run >= 2, 0.5, 0.0)[:, None, None]
    moving = near + ahead * (near - far)
    # A lone key has the slope of the parabola through its neighbours, or of the line to the only one.
    before, after = np.maximum(at - 1, 0), np.minimum(at + 1, last)
    past = np.where(at > 0, known[after] - known[at] + (at == last), 0)[:, None, None]
    future = np.where(at < last, known[at] - known[before] + (at == 0), 0)[:, None, None]
    slope = past * difference(before, at) + future * difference(at, after)
    lone = slope / np.maximum(past + future, 1)
    return np.where((run >= 1)[:, None, None], moving, lone)
