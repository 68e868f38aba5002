"""Feet that shuffle take a step: one that gets from stance to stance along the floor, slowly, goes at once.

What networks say of a foot is a mean over all the moments at which it may step: where these lie apart it
glides there, and never leaves the floor. In 100 gaps of two and three seconds of LAFAN1's validation
performer feet drifted by more than 8 cm in a stance in 16 fills of `small`, so in 11; joints are off by as
much, and bodies glide as seldom. Who crouches or crawls sets feet down anew, too: in 50 gaps of three
seconds feet drifted so in 6 fills of `base`, now in one (`bench artefacts --most 25`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from interpose.clip import Clip
from interpose.finish import feet
from interpose.finish.stepping import LIFT, SINK, let_down
from interpose.finish.windows import ramp
from interpose.geometry import measures
from interpose.geometry.time import runs
from interpose.observation import Observation

# What shuffles is nowhere faster (metres a second) nor higher above the floor (metres), and gets ahead by so
# many metres.
SLOW, LOW, GETS = 1.0, 0.05, 0.08
# Metres that one step goes, at most; and that one goes which is as high as any.
STRIDE, FULL = 0.7, 0.3
# Seconds that a step takes: as short as legs can.
TAKES = (0.4, 0.6, 0.8)


@dataclass(frozen=True)
class Step:
    """What a foot does in the place of a shuffle, or of a part of one.

    Attributes:
        leg: its number.
        start, stop: the frames of the shuffle, start to stop - 1.
        part: from which share of its way to which it goes.
        middle, takes: the frame in the middle of it, and frames that it takes.
        order: what steps are sorted by, the first ones first.
    """

    leg: int
    start: int
    stop: int
    part: tuple[float, float]
    middle: float
    takes: float
    order: tuple[float, float]

    @property
    def room(self) -> tuple[float, float]:
        """The first and the last frame in which its middle may be."""
        return self.start + self.takes / 2, self.stop - 1 - self.takes / 2


def stepping(clip: Clip, known: Observation, span: tuple[int, int], takes: float) -> Clip | None:
    """The clip with steps in the place of shuffles, in frames `span` (start to before stop) of which nothing
    is known; hips are let down a little where legs are too short for them. None where nothing shuffles, or it
    cannot be helped.

    Args:
        clip, known: the motion with some of it around the frames, and what of it is observed.
        takes: seconds that a step takes.
    """
    start, stop = span
    if not feet.legs(clip.skeleton) or not feet.untold(clip, known, start, stop):
        return None
    found = _one_by_one(steps(clip, known, span, takes))
    if not found:
        return None
    pairs = feet.pairs(clip.skeleton)
    goal = clip.positions()[start:stop, pairs]
    for leg in range(len(pairs)):
        for first, last in {(one.start, one.stop) for one in found if one.leg == leg}:
            inside = slice(first - start, last - start)
            own = [one for one in found if (one.leg, one.start) == (leg, first)]
            goal[inside, leg] = _way(clip, goal[inside, leg], own)
    done, sunk = let_down(clip, known, np.zeros(stop - start), goal, span)
    return done if sunk <= SINK * feet.size(clip.skeleton) else None


def steps(clip: Clip, known: Observation, span: tuple[int, int], takes: float) -> list[Step]:
    """The steps that feet could take within a span instead of shuffling: each in the middle of what it
    replaces, where there is the time for it."""
    start, stop = span
    grown, fps, pairs = feet.size(clip.skeleton), clip.fps, feet.pairs(clip.skeleton)
    both = clip.positions()[:, pairs] / grown
    above = both[..., 1] - feet.local_floor(both, known.positions(clip.skeleton)[:, pairs], fps)
    speeds = measures.speed(both, fps)
    stills = speeds < feet.STILL
    creeps = (speeds < SLOW) & (above < LOW)
    creeps[:start] = creeps[stop:] = False
    found = []
    for leg in range(len(pairs)):
        for first, last in runs(creeps[:, leg, 1]):
            # From stance to stance: what leaves the floor, or comes down, is about to step, or has.
            stands = first + np.flatnonzero(stills[first:last, leg, 1])
            if not stands.size:
                continue
            first, last = int(stands[0]), int(stands[-1]) + 1
            way = _got(both[first:last, leg, 1])
            if np.linalg.norm((both[last - 1] - both[first])[leg, 1, [0, 2]]) < GETS:
                continue
            count = int(np.ceil(way[-1] / STRIDE))
            most = np.ptp(np.interp(np.array([0.1, 0.9]) * way[-1], way, np.arange(last - first)))
            if most < count * min(TAKES) * fps or count * takes * fps > last - 1 - first:
                continue  # a step as it is, or no time for one
            for number in range(count):
                half_way = float(np.interp((number + 0.5) / count * way[-1], way, np.arange(first, last)))
                middle = np.clip(half_way, first + takes * fps / 2, last - 1 - takes * fps / 2)
                part = (number / count, (number + 1) / count)
                # Of two at once the longer one: whose mirror image comes first, too.
                order = (half_way, -float(way[-1]))
                found.append(Step(leg, first, last, part, float(middle), takes * fps, order))
    return found


def _got(foot: np.ndarray) -> np.ndarray:
    """(F,) metres that a joint (F, 3) has got along the floor."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(foot[:, [0, 2]], axis=0), axis=1))])


def _one_by_one(found: list[Step]) -> list[Step]:
    """Steps one after the other: those that would be at once make way for each other, as far as they may;
    none where that is not far enough."""
    found = sorted(found, key=lambda one: one.order)
    for _ in found:
        for i, (one, other) in enumerate(zip(found, found[1:])):
            over = (one.takes + other.takes) / 2 - (other.middle - one.middle)
            if over <= 0:
                continue
            back = min(over, max(over / 2, over - (other.room[1] - other.middle)), one.middle - one.room[0])
            on = min(over - back, other.room[1] - other.middle)
            found[i : i + 2] = (
                replace(one, middle=one.middle - back),
                replace(other, middle=other.middle + on),
            )
    apart = [b.middle - a.middle - (a.takes + b.takes) / 2 for a, b in zip(found, found[1:])]
    return found if min(apart, default=0.0) > -1.0 else []


def _way(clip: Clip, foot: np.ndarray, own: list[Step]) -> np.ndarray:
    """(n, 2, 3) metres, where ankle and toe are in the frames of a shuffle if they go their way (n, 2, 3) in
    steps."""
    time, grown = np.arange(len(foot)), feet.size(clip.skeleton)
    way = _got(foot[:, 1])
    share, height = np.zeros(len(foot)), np.zeros(len(foot))
    for one in own:
        goes = one.part[1] - one.part[0]
        phase = (time + one.start - one.middle) / one.takes + 0.5
        share += goes * ramp(phase)
        full = min(1.0, goes * way[-1] / (FULL * grown))
        height += full * np.sin(np.pi * np.clip(phase, 0, 1)) ** 2
    at = np.interp(share * way[-1], way, time)
    path = np.stack([np.interp(at, time, values) for values in foot.reshape(len(foot), -1).T], axis=1)
    path = path.reshape(foot.shape)
    # Toe and heel rise and come down when they did: `at` rests in one frame of a stance, and skips others.
    aside, turned = foot[:, 0] - foot[:, 1], path[:, 0] - path[:, 1]
    long = np.linalg.norm(aside[:, ::2], axis=1) / np.maximum(np.linalg.norm(turned[:, ::2], axis=1), 1e-9)
    path[:, 1, 1] = foot[:, 1, 1]
    path[:, 0] = path[:, 1] + np.stack([long * turned[:, 0], aside[:, 1], long * turned[:, 2]], axis=1)
    toeless = feet.legs(clip.skeleton)[own[0].leg].toe is None
    path[..., 1] += height[:, None] * (LIFT[0] if toeless else LIFT) * grown
    return path
