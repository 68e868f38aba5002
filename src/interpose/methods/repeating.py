"""Motion that repeats itself beside a gap repeats itself in it: who walks or waves goes on in his own way.

The networks see a third of a second on either side of a gap, and say what people do in the mean; a stride, or
a wave, that is known several times over says more. Where what is known around a gap comes back to the same
poses again and again, on both sides alike, it is carried on from both; and so at an end of a clip from one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from interpose.geometry import kinematics, rotations
from interpose.geometry.ground import UP, wrap
from interpose.geometry.time import ease, runs, sample, sample_rotations
from interpose.geometry.values import moved, offset
from interpose.skeletons import JOINTS, PARENTS

# Frames at 30 fps: of known motion on each side that are looked at, fewer where nothing repeats itself in
# more (who waves has raised his arm before); and what a repetition takes, at least and at most. So many times
# as much is to be known of it.
LOOKS, SHORTEST, LONGEST, TIMES = (120, 75, 50), 8, 50, 1.4
# Where nothing follows, or goes before, for longer than ALONE, slow strides count, too: of 30 walks, many of
# them of people who are old, sad or proud, 23 are carried on so instead of 19, and three seconds of them are
# off by 17.5 cm and not by 18.6.
LONGEST_ALONE, TIMES_ALONE = 70, 1.2
# By what share periods may differ from side to side, and from the one in the hole that fits both.
UNEVEN, STRETCHED = 0.2, 0.15
# Metres that joints are from where they are in the mean, of what stirs at all; and how much less alike a
# shorter period may be than the best one to count instead: twice a period is a period, too.
STIRS, NEAR = 0.025, 0.05
# Frames into what follows nothing, or is followed by nothing, from which on the repetition counts alone.
ALONE = 45
# Frames into what nothing follows over which an arm that was held all along comes to stay so: on the back, in
# a pocket. In three seconds of 30 walks poses are off by 5.4 cm so, and 5.7 where networks let it hang.
RESTING = 15
# Frames of a hole from which on repetitions count as much as they do anywhere: in shorter ones what is beside
# it tells more.
WHOLE = 15


@dataclass(frozen=True)
class Part:
    """Joints that may repeat themselves on their own.

    Attributes:
        rows: of the canonical joints.
        alike: the correlation between repetitions from which on they do.
        share: of the repetition in what comes out; the rest is the network's.
    """

    rows: tuple[int, ...]
    alike: float
    share: float


ARMS = tuple(
    Part(tuple(JOINTS.index(side + name) for name in ("Shoulder", "Arm", "ForeArm", "Hand")), 0.90, 0.8)
    for side in ("Left", "Right")
)
BODY = Part(tuple(sorted({*range(len(JOINTS))} - {row for arm in ARMS for row in arm.rows})), 0.95, 0.5)


@dataclass(frozen=True)
class Rhythm:
    """How motion repeats itself around a hole.

    Attributes:
        before, after: frames that a repetition takes on either side; no `after` where nothing follows.
        inside: frames that it takes in the hole, for both sides to fit.
    """

    before: float
    after: float | None
    inside: float

    def sources(self, begin: int, end: int) -> tuple[list[Source], np.ndarray]:
        """What the frames of a hole, begin to end - 1, repeat: of what is before it, and of what is after, if
        something is; and to which share (n,) they do that."""
        time = np.arange(begin, end, dtype=float)
        on = np.mod((time - begin + 1) * self.before / self.inside, self.before)
        far = begin - 1 - self.before
        first = Source(far + on, begin - 1, far)
        if self.after is None:
            return [first], np.zeros(len(time))
        back = np.mod((end - time) * self.after / self.inside, self.after)
        last = Source(end + self.after - back, end, end + self.after)
        return [first, last], (time - begin + 1) / (end - begin + 1)


@dataclass(frozen=True)
class Source:
    """One side of a hole of n frames.

    Attributes:
        at: (n,) the frames that those of the hole repeat.
        edge, far: the frame beside the hole, and the one that is a repetition away from it.
    """

    at: np.ndarray
    edge: float
    far: float

    def rotations(self, local: np.ndarray) -> np.ndarray:
        """(n, m, 4) of the rotations (T, m, 4): one repetition leads to the next as it began."""
        beside, away = sample_rotations(local, np.array([self.edge, self.far], float))
        left = 1 - ease((self.at - self.far) / (self.edge - self.far))
        return moved(sample_rotations(local, self.at), left[:, None, None] * offset(away, beside))


@dataclass(frozen=True)
class Motion:
    """A motion at 30 fps: (T, 22, 4) canonical rotations relative to the parent's, (T, 3) metres the hips."""

    local: np.ndarray
    root: np.ndarray

    def part(self, frames: slice) -> Motion:
        return Motion(self.local[frames], self.root[frames])


def carried_on(
    seen: Motion, known: np.ndarray, said: Motion, bones: np.ndarray
) -> tuple[Motion, dict[tuple[int, int], tuple[str, float]]]:
    """What a network says, with what repeats itself around holes of the whole pose carried on in them.

    Args:
        seen: the motion; known: (T, n) what is known of what the skeleton has of it.
        said: all of it, by the network.
        bones: (22, 3) metres.

    Returns:
        The motion, and for each hole (start to stop - 1) in which something was, what that is, and the
        frames that it takes.
    """
    whole, done = np.asarray(known.all(axis=1)), Motion(said.local.copy(), said.root.copy())
    periods = {}
    for begin, end in runs(np.logical_not(known.any(axis=1))):
        first, last = begin - _lasting(whole[:begin][::-1]), end + _lasting(whole[end:])
        if (first == begin > 0) or (last == end < len(whole)):
            continue  # something else is missing beside it
        around, inside = seen.part(slice(first, last)), said.part(slice(begin, end))
        if begin == 0:  # what goes on so had been going on so before
            back = slice(None, None, -1)
            around, inside, hole = around.part(back), inside.part(back), (last - end, last - begin)
            carried, period = _carried(around, inside, hole, bones)
            carried = carried.part(back)
        else:
            carried, period = _carried(around, inside, (begin - first, end - first), bones)
        if period is not None:
            done.local[begin:end], done.root[begin:end] = carried.local, carried.root
            periods[begin, end] = period
    return done, periods


def _lasting(flags: np.ndarray) -> int:
    """How many flags are True before the first that is not, of as many as are looked at."""
    return int(np.logical_and.accumulate(flags[: LOOKS[0]]).sum())


def _carried(
    seen: Motion, said: Motion, hole: tuple[int, int], bones: np.ndarray
) -> tuple[Motion, tuple[str, float] | None]:
    """What is said of a hole (n frames) with what repeats itself around it, in all other frames of `seen`;
    and what that is, in words, and the frames that a repetition takes; None without any."""
    begin, end = hole
    periods: dict[Part, float] = {}
    yaw, local = heading(seen.local), seen.local.copy()
    local[:, 0] = rotations.multiply(rotations.about("Y", -yaw), local[:, 0])
    there, turned, root = heading(said.local), said.local.copy(), said.root
    turned[:, 0] = rotations.multiply(rotations.about("Y", -there), turned[:, 0])
    for part, poses in _poses(local, bones).items():
        rows = list(part.rows)
        rhythm = find(poses[:begin], poses[end:] if end < len(poses) else None, end - begin, part.alike)
        if rhythm is None:
            if part is not BODY and end == len(poses) and _rests(poses[:begin]):
                gone = np.arange(1, end - begin + 1)
                stays = np.repeat(local[begin - 1 : begin, rows], end - begin, axis=0)
                turned[:, rows] = _mixed(turned[:, rows], stays, ease(np.minimum(gone / RESTING, 1.0)))
            continue
        periods[part] = rhythm.inside
        sources, after = rhythm.sources(begin, end)
        share = np.full(end - begin, part.share * min((end - begin) / WHOLE, 1.0))
        if rhythm.after is None:
            # The further it goes the less the network knows, and the mean of two that stray is no step.
            share += (1 - part.share) * ease(np.minimum(np.arange(1, end - begin + 1) / ALONE, 1.0))
        again = [source.rotations(local[:, rows]) for source in sources]
        both = _mixed(again[0], again[-1], after)
        turned[:, rows] = _mixed(turned[:, rows], both, share)
        if part is BODY and rhythm.after is None:
            way, turns = _way(seen.part(slice(begin)), yaw[:begin], sources[0].at)
            way[:, 1] = root[:, 1]  # who climbed a little would go on for ever
            steps = [np.diff(one, axis=0, prepend=seen.root[begin - 1 : begin]) for one in (root, way)]
            root = seen.root[begin - 1] + np.cumsum(steps[0] + share[:, None] * (steps[1] - steps[0]), axis=0)
            there = there + share * np.unwrap(wrap(turns - there))
    turned[:, 0] = rotations.multiply(rotations.about("Y", there), turned[:, 0])
    if not periods:
        return Motion(turned, root), None
    body = BODY in periods
    every = periods[BODY] if body else max(periods.values())
    return Motion(turned, root), ("what repeats itself" if body else "what arms repeat", every)


def heading(local: np.ndarray) -> np.ndarray:
    """(T,) radians by which the hips are turned about the vertical."""
    twist = rotations.twist_about(local[:, 0], UP.values)
    return 2.0 * np.arctan2(twist[:, 2], twist[:, 0])


def _mixed(one: np.ndarray, other: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Rotations (n, m, 4), to a share (n,) the other."""
    return rotations.slerp(one, other, np.broadcast_to(share[:, None], one.shape[:-1]))


def _poses(local: np.ndarray, bones: np.ndarray) -> dict[Part, np.ndarray]:
    """(T, d) metres, where the joints of each part are against what carries it."""
    still = np.broadcast_to(
        np.where(np.arange(len(JOINTS))[:, None] == 0, 0.0, bones), (*local.shape[:-1], 3)
    )
    turned, placed = kinematics.forward(local, still, PARENTS)
    found = {BODY: placed[:, list(BODY.rows)]}
    for arm in ARMS:
        above = PARENTS[arm.rows[0]]
        off = placed[:, list(arm.rows)] - placed[:, [above]]
        found[arm] = rotations.rotate(rotations.conjugate(turned[:, [above]]), off)
    return {part: where.reshape(len(local), -1) for part, where in found.items()}


def _way(seen: Motion, yaw: np.ndarray, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where the hips get (n, 3), and their heading (n,), if they go on from the last frame that is seen as
    they did to each of the frames `at` (n,)."""
    steps = rotations.rotate(rotations.about("Y", -yaw[:-1]), np.diff(seen.root, axis=0))
    turns = yaw[-1] + np.cumsum(sample(wrap(np.diff(yaw))[:, None], at - 1)[:, 0])
    before = np.concatenate([yaw[-1:], turns[:-1]])
    return seen.root[-1] + np.cumsum(
        rotations.rotate(rotations.about("Y", before), sample(steps, at - 1)), axis=0
    ), turns


def find(before: np.ndarray, after: np.ndarray | None, length: int, alike: float) -> Rhythm | None:
    """How poses (n, d) before and after a hole of so many frames repeat themselves, if they are as much
    alike, and what is after repeats what is before."""
    if after is not None and len(after) > len(before):
        # What is shorter is looked for in what is longer.
        found = find(after[::-1], before[::-1], length, alike)
        return found and Rhythm(found.after or 0.0, found.before, found.inside)
    if after is None:
        # The further it goes the less the network knows; before, what comes back once may do so by chance.
        times = TIMES_ALONE if length > ALONE else TIMES
        alone = _nearby(before[::-1], alike, LONGEST_ALONE, times)
        return None if alone is None else Rhythm(alone, None, alone)
    first, last = (_nearby(poses, alike, LONGEST, TIMES) for poses in (before[::-1], after))
    if first is None:
        return None
    if last is None or abs(first - last) > UNEVEN * min(first, last):
        return None
    period = (first + last) / 2
    width = min(round(period), len(before), len(after))
    lags = np.arange(length + width, min(length + width + round(period), length + len(before)) + 1)
    told = [_alike(after[:width], before[(at := len(before) + length - lag) : at + width]) for lag in lags]
    if not told or max(told) < alike:
        return None
    lag = float(lags[int(np.argmax(told))])
    inside = lag / max(round(lag / period), 1)
    return Rhythm(first, last, inside) if abs(inside - period) < STRETCHED * period else None


def _nearby(poses: np.ndarray, alike: float, longest: int, times: float) -> float | None:
    """`_period` of as many poses (n, d) as repeat themselves, the nearest first."""
    looks = [look for look in LOOKS if look == LOOKS[0] or look < len(poses)]
    found = (_period(poses[:look], alike, longest, times) for look in looks)
    return next((period for period in found if period is not None), None)


def _period(poses: np.ndarray, alike: float, longest: int, times: float) -> float | None:
    """Frames, `longest` at most, after which poses (n, d) come back that are as much alike; None if they do
    not, or are not known for so many times as long."""
    stirs = np.sqrt(3 * poses.var(axis=0).mean()) if len(poses) else 0.0
    lags = range(SHORTEST, min(longest, int(len(poses) / times)) + 1)
    if stirs < STIRS or len(lags) < 3:
        return None
    centred = poses - poses.mean(axis=0)
    products = centred @ centred.T
    own = np.diag(products)
    apart = [(own[lag:] + own[:-lag]).mean() - 2 * np.diag(products, lag).mean() for lag in lags]
    told = 1 - np.array(apart) / (2 * own.mean())
    least = max(alike, told.max() - NEAR)
    for i in range(1, len(told) - 1):
        left, here, right = told[i - 1 : i + 2]
        if here >= max(left, right, least):
            # The top of the parabola through the three.
            bend = left - 2 * here + right
            return float(lags[i] + (0.5 * (left - right) / bend if bend < 0 else 0.0))
    return None


def _rests(poses: np.ndarray) -> bool:
    """Whether an arm with poses (n, d) has been held against the trunk for as long as is looked at."""
    last = poses[-LOOKS[2] :]
    return len(last) == LOOKS[2] and bool(np.sqrt(3 * last.var(axis=0).mean()) < STIRS)


def _alike(one: np.ndarray, other: np.ndarray) -> float:
    """The correlation of poses (n, d): 1 for the same."""
    varies = (one.var(axis=0) + other.var(axis=0)).sum()
    return 1.0 - float(((one - other) ** 2).sum(axis=1).mean() / max(varies, 1e-12))
