"""A motion that goes another way over the floor: through points, and the body turns along.

Kaufmann et al. 2020 name control of the trajectory as future work. As with the random paths of Kim et al.
2022 (section 4.3.2) the poses stay, and only where the body is and where it faces is changed.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d

from interpose.clip import Clip
from interpose.errors import RequestError
from interpose.finish.windows import ramp
from interpose.geometry import rotations
from interpose.geometry.time import runs
from interpose.observation import Observation
from interpose.skeletons.carrier import carriers, hips_of, moved

# Metres a second: who is slower does not turn along its way, who is twice as fast does so altogether.
SLOW = 0.25
SMOOTH = 0.15  # seconds (standard deviation) over which the way is seen
FLOOR = np.array([1.0, 0.0, 1.0])
EASE = 0.3  # seconds at both ends over which the body begins and ceases to turn


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
    cubic spline that meets the points. The body is turned by as much as the direction of the way has changed;
    a root above the hips goes along if it moves at all.

    Args:
        clip: F frames; start is at least 1 and stop at most F - 1.
        points: x and z in metres for frames from start to stop - 1.
    """
    frames = np.arange(start - 1, stop + 1)
    knots, places = [start - 1, *sorted(points), stop], over_floor(clip)
    off = [np.zeros(2), *(points[k] - places[k] for k in sorted(points)), np.zeros(2)]
    shift = CubicSpline(knots, np.array(off), bc_type="clamped")(frames)
    old = places[frames]
    headings, speeds = zip(*(_way(some, clip.fps) for some in (old, old + shift)))
    # A heading says something only while there is a way, before and after.
    share = ramp(np.minimum(*speeds) / SLOW - 1)
    share *= ramp(np.minimum(frames - frames[0], frames[-1] - frames) / (EASE * clip.fps))
    turn = rotations.about("Y", share * np.angle(np.exp(1j * (headings[1] - headings[0]))))
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
            for joint in carriers(clip)
        },
    )
    rotation, translation = clip.rotation.copy(), clip.translation.copy()
    rotation[start:stop], translation[start:stop] = led.rotation, led.translation
    return clip.with_motion(rotation, translation)


def _way(points: np.ndarray, fps: float) -> tuple[np.ndarray, np.ndarray]:
    """Direction (radians about Y, 0 along Z) and speed (metres a second) of a way (n, 2) in x and z."""
    step = gaussian_filter1d(np.gradient(points, axis=0) * fps, SMOOTH * fps, axis=0, mode="nearest")
    return np.arctan2(step[:, 0], step[:, 1]), np.linalg.norm(step, axis=1)
