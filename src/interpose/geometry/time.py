"""Values between samples: linear and smooth interpolation in time."""

from __future__ import annotations

import math
from bisect import bisect
from typing import Any

import numpy as np
from array_api_compat import array_namespace

from interpose.errors import RequestError, is_number
from interpose.geometry import rotations
from interpose.geometry.values import offset

Array = Any

# Frames a second: who has fewer gives a frame time for a rate, and nothing has more.
SLOWEST, FASTEST = 0.25, 1e5
# Steps in a run of known frames from which on they may be stretched.
SPREAD = 5
# Steps that two ends are apart at least.
CLOSE = 0.6


def check_rate(fps: object) -> None:
    """RequestError for what is no number of frames a second."""
    if not is_number(fps, SLOWEST, FASTEST):
        raise RequestError(
            "the frame rate is wrong",
            f"it is a number of frames a second, {SLOWEST:g} to {FASTEST:g}, and got {fps!r}",
            "Of a frame time give one over it.",
        )


def runs(flags: np.ndarray) -> list[tuple[int, int]]:
    """The ranges (start, stop) of frames in which `flags` (F,) is True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    return [(int(start), int(stop)) for start, stop in edges.reshape(-1, 2)]


def _around(xp: Any, frames: int, times: Array) -> tuple[Array, Array, Array]:
    """The samples before and after each time (n,), and how far it lies between them, 0 to 1."""
    times = xp.clip(times, 0, frames - 1)
    before = xp.clip(xp.astype(xp.floor(times), xp.int64), 0, max(frames - 2, 0))
    after = xp.clip(before + 1, 0, frames - 1)
    return before, after, times - xp.astype(before, times.dtype)


def _column(t: Array, like: Array) -> Array:
    """`t` (n,) with as many trailing axes of length one as broadcast against `like` (n, ..., d) without d."""
    return t.reshape((-1,) + (1,) * (like.ndim - 2))


def sample(values: Array, times: Array) -> Array:
    """Linear interpolation of `values` (F, ..., d) at fractional frames `times` (n,): (n, ..., d).

    Times outside 0..F-1 take the first or last value.
    """
    xp = array_namespace(values, times)
    before, after, t = _around(xp, values.shape[0], times)
    t = xp.astype(_column(t, values), values.dtype)[..., None]
    # Weights on both ends: at t = 0 the sample itself comes back, bit for bit.
    return (1 - t) * values[before] + t * values[after]


def sample_rotations(q: Array, times: Array) -> Array:
    """SLERP of quaternions (F, ..., 4) at fractional frames `times` (n,): (n, ..., 4)."""
    xp = array_namespace(q, times)
    before, after, t = _around(xp, q.shape[0], times)
    t = xp.astype(_column(t, q), q.dtype)
    return rotations.slerp(q[before], q[after], t)


def grid(known: np.ndarray, step: float) -> np.ndarray:
    """Times (n,), in frames, about `step` apart, among which are the ends of each run of frames in which all
    values are `known` (F, n), and those of each value's own.

    A network at a lower frame rate would not see a key between two of its own frames, and not where exactly a
    gap begins. So its steps are stretched or shortened until they end there; where much is known they hardly
    change. Runs of few known frames keep the step, from their first one on, as it tells velocities; what is
    nearer to such an end than a good half of a step is left out, and those of single values come last.
    """
    last, singles = len(known) - 1, np.unique(known, axis=1).T
    ends: set[float] = {0, last}
    for start, stop in runs(np.asarray(known.all(axis=1))):
        whole = math.floor((stop - 1 - start) / step)
        ends |= (
            {start, stop - 1}
            if whole >= SPREAD or step <= 1
            else {start + step * i for i in range(whole + 1)}
        )
    at = [0.0]
    for end in sorted(ends)[1:]:
        if end - at[-1] >= CLOSE * step:
            at.append(end)
    if last > at[-1]:
        at[max(1, len(at) - 1) :] = [last]  # the end of all is always one
    for end in sorted({end for value in singles for start, stop in runs(value) for end in (start, stop - 1)}):
        i = bisect(at, end)
        if end - at[i - 1] >= CLOSE * step and (i == len(at) or at[i] - end >= CLOSE * step):
            at.insert(i, end)
    pieces = [
        np.linspace(a, b, max(1, round((b - a) / step)), endpoint=False) for a, b in zip(at[:-1], at[1:])
    ]
    return np.concatenate([*pieces, [float(last)]])


def fade_out(t: Array, length: Array) -> Array:
    """How far a start velocity of one carries when it fades out within `length`: t (1 - t / length)^2.

    Zero at t = 0 with slope 1, zero with slope 0 from t = `length` on: the tangent term of the cubic Hermite
    basis. Both arguments broadcast and are in the same unit (frames).
    """
    left = 1.0 - t / length
    left = 0.5 * (left + abs(left))
    return t * left * left


def _hermite_terms(t: Array, length: Array, reach: float | None) -> tuple[Array, Array, Array]:
    """Share of the end value, and what a velocity of one at the start and at the end adds: (..., 1) each."""
    within = length if reach is None else 0.5 * (length + reach - abs(length - reach))
    terms = t / length, fade_out(t, within), -fade_out(length - t, within)
    return terms[0][..., None], terms[1][..., None], terms[2][..., None]


def hermite(
    a: Array, b: Array, va: Array, vb: Array, t: Array, length: Array, reach: float | None = None
) -> Array:
    """Cubic Hermite interpolation of positions, written as a straight line plus what the velocities add.

    Args:
        a, b: (..., d) values at time 0 and at time `length`.
        va, vb: (..., d) velocities there, in units a frame.
        t: (...) time in frames, 0 to `length`.
        length: (...) frames from `a` to `b`, above zero.
        reach: frames within which an end velocity turns into that of the straight line. None, or more than
            `length`, is the ordinary cubic; less keeps long spans from overshooting. C1 in either case.
    """
    share, start, stop = _hermite_terms(t, length, reach)
    line = (b - a) / length[..., None]
    return (1 - share) * a + share * b + start * (va - line) + stop * (vb - line)


def hermite_rotations(
    a: Array, b: Array, va: Array, vb: Array, t: Array, length: Array, reach: float | None = None
) -> Array:
    """The same for rotations: SLERP, turned by what the end velocities add to its constant velocity.

    Args:
        a, b: (..., 4) rotations at time 0 and at time `length`; the short way is taken.
        va, vb: (..., 3) angular velocities there in radians a frame, in the axes of the turning body: those
            of log(conjugate(q[f]) q[f + 1]).
        t, length, reach: as in `hermite`.

    The correction is added in the body's axes, so that turning the whole input turns the result. At both
    ends it is zero, and its slope makes up exactly for the difference to `va` and `vb`; played backwards it
    is the interpolation of the reversed input.
    """
    share, start, stop = _hermite_terms(t, length, reach)
    way = offset(a, b)
    line = way / length[..., None]
    base = rotations.multiply(a, rotations.exp(share * way))
    extra = rotations.exp(start * (va - line) + stop * (vb - line))
    return rotations.normalize(rotations.multiply(base, extra))


def ease(share: Array) -> Array:
    """Smoothly from 0 at 0 to 1 at 1, with no slope at either end."""
    return share * share * (3 - 2 * share)


def steps(q: Array) -> Array:
    """The turn from each frame to the next, (F, ..., 4) to rotation vectors (F - 1, ..., 3) in body axes."""
    return offset(q[:-1], q[1:])


def _velocities(xp: Any, differences: Array) -> Array:
    """Velocities at F samples from the F - 1 differences between them: their mean on both sides."""
    return 0.5 * (
        xp.concat([differences[:1], differences], axis=0) + xp.concat([differences, differences[-1:]], axis=0)
    )


def sample_smooth(values: Array, times: Array) -> Array:
    """C1 interpolation of `values` (F, ..., d) at fractional frames `times` (n,), through every sample.

    Cubic Hermite with central differences (Catmull and Rom 1974).
    """
    xp = array_namespace(values, times)
    if values.shape[0] < 3:
        return sample(values, times)
    v = _velocities(xp, values[1:] - values[:-1])
    before, after, t = _around(xp, values.shape[0], times)
    t = xp.astype(_column(t, values), values.dtype)
    return hermite(values[before], values[after], v[before], v[after], t, xp.ones_like(t))


def sample_rotations_smooth(q: Array, times: Array) -> Array:
    """C1 interpolation of quaternions (F, ..., 4) at fractional frames `times` (n,), through every sample."""
    xp = array_namespace(q, times)
    if q.shape[0] < 3:
        return sample_rotations(q, times)
    v = _velocities(xp, steps(q))
    before, after, t = _around(xp, q.shape[0], times)
    t = xp.astype(_column(t, q), q.dtype)
    return hermite_rotations(q[before], q[after], v[before], v[after], t, xp.ones_like(t))


def bending(frames: int) -> np.ndarray:
    """(3, frames) how second differences of a signal add up, squared: the lower bands of that matrix.

    What `scipy.linalg.solveh_banded` takes, the diagonal first (Whittaker 1923; Eilers 2003).
    """
    bands = np.zeros((3, frames))
    for first, one in enumerate((1.0, -2.0, 1.0)):
        for apart, other in enumerate((1.0, -2.0, 1.0)[first:]):
            bands[apart, first : max(frames - 2 + first, first)] += one * other
    return bands
