"""A motion that goes another way over the floor: through points, and the body turns along.

Kaufmann et al. 2020 name control of the trajectory as future work. As with the random paths of Kim et al.
2022 (section 4.3.2) the poses stay, and only where the body is and where it faces is changed.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
import scipy
from scipy.ndimage import gaussian_filter1d

from interpose.clip import Clip
from interpose.errors import RequestError
from interpose.finish.windows import ramp
from interpose.geometry import rotations
from interpose.geometry.time import runs
from interpose.observation import Observation
from interpose.skeletons import find_humanoid, find_mapping
from interpose.skeletons.body import facing
from interpose.skeletons.carrier import STILL, carriers, hips_of, moved

# Metres a second: who is slower does not turn along its way, who is twice as fast does so altogether.
SLOW = 0.25
BEYOND = 1.2  # times as far aside as any point says: a spline that swings out further is none
SMOOTH = 0.15  # seconds (standard deviation) over which the way is seen
FLOOR = np.array([1.0, 0.0, 1.0])
EASE = 0.3  # seconds at both ends over which the body begins and ceases to turn
# Somebody goes aside whose hips face elsewhere by more than this, in so many of the frames in which he goes.
ASIDE, OFTEN = np.radians(60), 1 / 3
FASTEST = np.radians(200)  # a second by which the body is turned besides its own turns at most


def spans(clip: Clip, known: Observation, path: Iterable[int]) -> list[tuple[int, int]]:
    """The runs of frames, start to stop - 1, in which a path can lead the body.

    Raises RequestError for a frame of the path that lies in none.
    """
    hips = hips_of(clip.skeleton)
    unknown = np.logical_not(known.rotation[:, [hips, *clip.skeleton.ancestors(hips)]].any(axis=1))
    found = [(start, stop) for start, stop in runs(unknown) if start > 0 and stop < len(clip)]
    for frame in path:
        if not any(start <= frame < stop for start, stop in found):
            raise RequestError(
                f"the path cannot lead through frame {frame}",
                "it lies in no gap of the whole pose with known frames on both sides",
                "Name frames inside of a gap.",
            )
    return found


def over_floor(clip: Clip) -> np.ndarray:
    """(F, 2) x and z of the hips in metres: what a path leads."""
    return clip.positions()[:, hips_of(clip.skeleton)][:, [0, 2]]


def follow(clip: Clip, start: int, stop: int, points: Mapping[int, np.ndarray]) -> Clip:
    """The clip with its hips led through points over frames start to stop - 1.

    Both ends stay where they are, and come and go at the same velocity; in between the way is moved by a
    cubic spline that meets the points, or, where that swings out beyond them, as of points near an end, by a
    piecewise cubic that does not (Fritsch and Carlson 1980). The body is turned by as much as the direction
    of the way has changed; a root above the hips goes along if it moves at all.

    Args:
        clip: F frames; start is at least 1 and stop at most F - 1.
        points: x and z in metres for frames from start to stop - 1.
    """
    frames = np.arange(start - 1, stop + 1)
    knots, places = [start - 1, *sorted(points), stop], over_floor(clip)
    off = np.zeros((len(knots), 2))
    off[1:-1] = [points[k] - places[k] for k in sorted(points)]
    shift = scipy.interpolate.CubicSpline(knots, off, bc_type="clamped")(frames)
    if np.linalg.norm(shift, axis=1).max() > BEYOND * np.linalg.norm(off, axis=1).max():
        # With a second one beyond it an end is left and reached as it was.
        knots, off = [start - 2, *knots, stop + 1], np.pad(off, ((1, 1), (0, 0)))
        shift = scipy.interpolate.PchipInterpolator(knots, off)(frames)
    old = places[frames]
    near = np.minimum(frames - frames[0], frames[-1] - frames) / clip.fps
    turn = rotations.about("Y", _turns(old, old + shift, near, clip.fps))
    inside = clip.slice(start, stop)
    turned, placed = inside.kinematics()
    hips = placed[:, hips_of(clip.skeleton)]
    led = moved(
        inside,
        {
            joint: (
                rotations.multiply(turn[1:-1], turned[:, joint]),
                hips + shift[1:-1, [0, 0, 1]] * FLOOR + rotations.rotate(turn[1:-1], placed[:, joint] - hips),
            )
            for joint in _led(clip)
        },
    )
    rotation, translation = clip.rotation.copy(), clip.translation.copy()
    rotation[start:stop], translation[start:stop] = led.rotation, led.translation
    return clip.with_motion(rotation, translation)


def ahead(clip: Clip, known: np.ndarray, start: int, stop: int) -> np.ndarray | None:
    """(stop - start + 2, 4) how the hips would be turned if a body faced where it goes, from frame start - 1
    to stop; None of who does, who goes nowhere, and who does not beside it either, as boxers.

    known: (F,) which frames are known as a whole.
    """
    if not find_mapping(clip.skeleton).usable:
        return None
    near = round(clip.fps)
    lo, hi = max(start - near, 0), min(stop + near, len(clip))
    part = clip.slice(lo, hi)
    body = find_humanoid(part)
    placed = body.positions(part)
    way = _smooth(np.gradient(placed[:, 0], axis=0)[:, [0, 2]] * clip.fps, clip.fps)
    goes = np.linalg.norm(way, axis=1) > 2 * SLOW
    faces, course = facing(placed), np.arctan2(way[:, 0], way[:, 1])
    aside = goes & (np.abs(np.angle(np.exp(1j * (faces - course)))) > ASIDE)
    inside = ~known[lo:hi]
    if aside[inside].sum() < OFTEN * max(goes[inside].sum(), clip.fps):
        return None
    if aside[~inside].sum() > OFTEN * goes[~inside].sum():
        return None
    at, told = np.arange(len(part)), goes | ~inside
    wanted = np.interp(at, at[told], np.unwrap(np.where(inside, course, faces)[told]))
    span = slice(start - lo - 1, stop - lo + 1)
    off = _smooth(_smooth(wanted, clip.fps) - np.unwrap(faces), clip.fps)[span]
    turn = rotations.about("Y", body.hand[0] * off)
    return rotations.multiply(turn, part.kinematics()[0][span, hips_of(clip.skeleton)])


def _led(clip: Clip) -> list[int]:
    """What a path leads: the body, and targets of its feet and hands, but no chair that keeps its place."""
    top, *others = carriers(clip)
    goes = np.ptp(clip.translation, axis=0).max(axis=-1) > STILL
    below = clip.skeleton.below[list(clip.translated)]
    return [top, *(joint for joint in others if goes[below[:, joint]].any())]


def _turns(old: np.ndarray, new: np.ndarray, near: np.ndarray, fps: float) -> np.ndarray:
    """(n,) radians about Y by which a way (n, 2) in x and z turns when it becomes another one; `near` (n,) is
    how many seconds its ends are away, at which nothing turns."""
    # Directions as complex numbers, so that a change of 179 degrees is near one of -179.
    ways = [np.gradient(way, axis=0) @ [1j, 1.0] * fps for way in (old, new)]
    ways = [_smooth(way, fps) for way in ways]
    # A direction says something only while there is a way, before and after.
    share = ramp(np.minimum(*np.abs(ways)) / SLOW - 1)
    apart = ways[1] * ways[0].conj()
    change = 1 - share + share * apart / np.maximum(np.abs(apart), 1e-12)
    turned = np.unwrap(np.angle(_smooth(change, fps)))
    # No whole turns, and no faster than people turn.
    turned = ramp(near / EASE) * (turned - 2 * np.pi * np.round(np.median(turned) / (2 * np.pi)))
    return _no_faster(turned, FASTEST / fps)


def _no_faster(values: np.ndarray, step: float) -> np.ndarray:
    """Values (n,), 0 at both ends, that change by no more than a step from each to the next: midway between
    the lowest such ones that are nowhere below these and the highest nowhere above. What is as slow stays."""
    way = step * np.arange(len(values))

    def above(some: np.ndarray) -> np.ndarray:
        return np.maximum.accumulate(some + way) - way

    high, low = (np.maximum(above(some), above(some[::-1])[::-1]) for some in (values, -values))
    most = np.minimum(way, way[::-1])
    return np.clip((high - low) / 2, -most, most)


def _smooth(values: np.ndarray, fps: float) -> np.ndarray:
    return np.asarray(gaussian_filter1d(values, SMOOTH * fps, axis=0, mode="nearest"))
