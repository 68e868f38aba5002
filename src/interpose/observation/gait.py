"""Where in its stride a body is: so that what follows a walk or a run goes on in step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from interpose.clip import Clip
from interpose.geometry.ground import FLOOR, turn
from interpose.skeletons import JOINTS
from interpose.skeletons.body import facing
from interpose.skeletons.humanoid import Humanoid

LEGS = [JOINTS.index(side + part) for side in ("Left", "Right") for part in ("Leg", "Foot", "Toe")]
# Seconds of velocity that count as much as a place: legs that pass one way and the other look alike.
AHEAD = 0.1
# Seconds that a stride, two steps, takes: from runs to slow walks.
SHORTEST, LONGEST = 0.5, 1.8
MOMENT = 3.0  # seconds at the end of a clip, or its beginning, that tell its stride
# A stride comes back to where it was within this share of what poses of it are apart in the mean.
ALIKE = 0.5
# Seconds that a motion which goes round takes at most; and the share of what its poses are from their mean
# within which it comes back.
ROUND, CLOSES = 8.0, 0.5
# Metres within which who hardly moves comes back, of whom any pose is like any other: the longer the better.
NEARLY = 0.01
MOST = 5  # ways to go round that are told
LIVELY = 0.7  # of the pace of a whole clip: what moves less than that stands in it
STANDS = 2.0  # seconds for which at least who does something else, too, stands to go round so
TURNED = 0.05  # metres that joints may be apart instead of the body going round by a radian


@dataclass(frozen=True)
class InStep:
    """How a walk or a run goes on with another one.

    Attributes:
        stride: how many frames a stride takes, in the mean of both.
        phase: the share of a stride by which the end of the one is further than the beginning of the other.
        yaw: radians by which the other one would be turned if it began at the end of the one.
        rate: radians by which both turn in a frame, in the mean.
        velocities: (3,) metres a second over the floor, of the one at its end and of the other at its
            beginning: over a whole stride, as each step sways.
    """

    stride: float
    phase: float
    yaw: float
    rate: float
    velocities: tuple[np.ndarray, np.ndarray]

    def frames(self, least: int) -> int:
        """How many frames, at least so many, go by until the beginning of the other one is next in step."""
        strides = np.ceil(self.phase + least / self.stride)
        return max(least, round((strides - self.phase) * self.stride))


def legs(placed: np.ndarray, fps: float) -> np.ndarray:
    """Of canonical positions (F, 22, 3) where knees, ankles and toes are around the hips, from in front,
    and how far they get in a moment: (F, n) metres."""
    around = turn(placed[:, LEGS] - placed[:, :1], -facing(placed)[:, None]).reshape(len(placed), -1)
    steps = np.gradient(around, axis=0) if len(placed) > 1 else np.zeros_like(around)
    return np.concatenate([around, AHEAD * fps * steps], axis=1)


def stride(seen: np.ndarray, fps: float) -> int | None:
    """How many frames a stride takes in (F, n) `legs`; None where nothing comes back."""
    longest = min(round(LONGEST * fps), len(seen) - round(SHORTEST * fps / 2))
    lags = np.arange(1, longest + 1)
    if len(lags) < 3:
        return None
    apart = np.array([np.linalg.norm(seen[lag:] - seen[:-lag], axis=1).mean() for lag in lags])
    usual = scipy.spatial.distance.cdist(seen, seen).mean()
    for i in range(round(SHORTEST * fps) - 1, len(lags) - 1):
        if apart[i] < ALIKE * usual and apart[i] <= apart[i - 1] and apart[i] <= apart[i + 1]:
            return int(lags[i])
    return None


def in_step(body: Humanoid, before: Clip, after: Clip) -> InStep | None:
    """How one clip goes on with another; None where they have no strides, or none that are alike.

    The pose with which the other one begins was there, about, in the last stride of the one. There both had
    come equally far in their sway from side to side, so that they head where they face in the same way.
    """
    moment = round(MOMENT * before.fps)
    parts = before.slice(max(0, len(before) - moment), len(before)), after.slice(0, moment)
    placed = [body.positions(part) for part in parts]
    faces = [np.unwrap(facing(positions)) for positions in placed]
    seen = [legs(positions, before.fps) for positions in placed]
    first, second = (stride(some, before.fps) for some in seen)
    if first is None or second is None:
        return None
    apart = np.linalg.norm(seen[0][-first:] - seen[1][0], axis=1)
    if apart.min() > ALIKE * scipy.spatial.distance.cdist(seen[0], seen[0]).mean():
        return None
    since = first - 1 - int(apart.argmin())  # frames from that pose to the end
    rates = (faces[0][-1] - faces[0][-1 - first]) / first, (faces[1][second] - faces[1][0]) / second
    ways = [
        (hips[end] - hips[begin]) * FLOOR.values * before.fps / length
        for hips, begin, end, length in (
            (placed[0][:, 0], -1 - first, -1, first),
            (placed[1][:, 0], 0, second, second),
        )
    ]
    # Who goes round in a circle has turned by half of what a stride turns since the mean of its way.
    ways = [turn(way, np.array(by / 2)) for way, by in zip(ways, (rates[0] * first, -rates[1] * second))]
    return InStep(
        stride=(first + second) / 2,
        phase=since / first,
        yaw=float(faces[0][-1 - since] + rates[0] * since - faces[1][0]) * body.hand[0],
        rate=float(sum(rates) / 2) * body.hand[0],
        velocities=(ways[0] * body.hand, ways[1] * body.hand),
    )


def cycles(body: Humanoid, clip: Clip) -> list[tuple[int, int, float]]:
    """The frames of a motion between which it may go round: at the second one it is as it was at the first,
    in pose and pace, and heads about where it did; and by how many metres joints are apart there.

    Those that are most alike first, from SHORTEST to ROUND seconds apart, of those between which it moves as
    the whole of it does: who stands is most alike; a few at most, each half of SHORTEST apart from others.
    Of who does nothing but stand, or stands and does nothing else twice, the longest first. None where
    nothing comes back.
    """
    least, most = max(1, round(SHORTEST * clip.fps)), min(round(ROUND * clip.fps), len(clip) - 1)
    if least > most:
        return []
    placed = body.positions(clip)
    hips = placed[:, :1] * FLOOR.values
    faces = np.unwrap(facing(placed))
    around = turn(placed - hips, -faces[:, None])
    ways = turn(np.gradient(hips[:, 0], axis=0), -faces)
    paces = AHEAD * clip.fps * (np.gradient(around, axis=0) + ways[:, None])
    seen = np.concatenate([around, paces], axis=1)
    gone = np.cumsum(np.linalg.norm(paces, axis=2).mean(axis=1))
    # What hardly moves is like itself from frame to frame, and what never comes back is nowhere.
    usual = float(np.linalg.norm(seen - seen.mean(axis=0), axis=2).mean())
    idles = CLOSES * usual < NEARLY

    def alike(within: float, lively: float, least: int) -> list[tuple[float, int, int]]:
        found = []
        for lag in range(least, most + 1):
            apart = np.linalg.norm(seen[lag:] - seen[:-lag], axis=2).mean(axis=1)
            apart[gone[lag:] - gone[:-lag] < lively * lag * gone[-1] / len(clip)] = np.inf
            apart += TURNED * np.abs(faces[lag:] - faces[:-lag])
            beside = np.pad(apart, 1, constant_values=np.inf)
            at = np.flatnonzero((apart < beside[:-2]) & (apart <= beside[2:]) & (apart <= within))
            found += [(float(apart[i]), int(i), int(i) + lag) for i in at[np.argsort(apart[at])[:MOST]]]
        return found

    found = alike(NEARLY if idles else CLOSES * usual, LIVELY, least)
    if not found:
        idles, found = True, alike(NEARLY, 0.0, round(STANDS * clip.fps))
    chosen: list[tuple[int, int, float]] = []
    for apart_by, start, stop in sorted(found, key=lambda one: (one[1] - one[2], one) if idles else one):
        if len(chosen) == MOST:
            break
        if all(abs(start - a) + abs(stop - b) >= least for a, b, _ in chosen):
            chosen.append((start, stop, apart_by))
    return chosen
