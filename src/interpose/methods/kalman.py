"""Low-rank Kalman smoothing as a method: joints that move together tell where the lost ones are.

Frames in which everything is known span the few directions in which the body moves (their principal
components). In every other frame what is known is a measurement of where the body is along these directions,
tracked by a Kalman filter and smoothed backwards; that gives the positions which are not known. It learns
from the clip alone and fits any skeleton.

Source: Burke and Lasenby, Estimating missing marker positions using low dimensional Kalman smoothing, Journal
of Biomechanics 49(9), 2016. As there: as many components as make up 99.75 % of the sum of singular values, a
random walk along them, measurements with a variance of .001. Otherwise than there: steps of the walk have the
covariance that they have in the known frames; the place of the body is free, and its heading taken out where
enough joints are known all the time, so that poses are not tied to where they were seen; and what the
smoothed motion gets wrong of known values is taken out between them, too, so that it meets them.
"""

from __future__ import annotations

import numpy as np

from interpose.clip import Clip
from interpose.geometry.ground import turn
from interpose.methods.classical import Spline
from interpose.methods.protocol import Raw
from interpose.observation import Gap, Observation

LEFT_OUT = 0.0025  # of the sum of singular values
NOISE = 1e-3  # square metres, of a measured coordinate
# Square metres by which more is uncertain than the known frames show: where the body is at first, how far it
# gets in a frame, and its pose at first. Without the second it would stand where all known frames do.
ANYWHERE, ANY_STEP, ANY_POSE = 100.0, 1e-4, 1e-6
FEWEST = 10  # frames that must be wholly known
STEADY = 3  # joints that must be known all the time for the heading to be taken out


def smooth(values: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Complete coordinates of points that move together.

    Args:
        values: (F, 3 J) metres, x, y and z of one point after the other; what is not known may be anything,
            NaN included.
        known: (F, 3 J) booleans; all are True in at least one frame, and each direction that it is to learn
            takes another one.

    Returns:
        (F, 3 J) metres; known values as they are.
    """
    whole = np.flatnonzero(known.all(axis=1))
    points = values.shape[1] // 3
    place = np.tile(np.eye(3), points) / np.sqrt(points)
    poses = values[whole] - values[whole] @ place.T @ place
    mean = poses.mean(axis=0)
    _, size, components = np.linalg.svd(poses - mean, full_matrices=False)
    count = 1 + int((np.cumsum(size) < (1 - LEFT_OUT) * size.sum()).sum())
    basis = np.concatenate([place, components[:count]])

    states = (values[whole] - mean) @ basis.T
    # Of a random walk the square of a difference grows with the frames between.
    steps = np.diff(states, axis=0) / np.sqrt(np.diff(whole))[:, None]
    walk = steps.T @ steps / max(len(steps), 1)
    is_place = np.arange(len(basis)) < 3
    walk = walk + np.diag(np.where(is_place, ANY_STEP * points, 0.0))
    state = states.mean(axis=0)
    spread = np.diag(states.var(axis=0) + np.where(is_place, ANYWHERE * points, ANY_POSE))

    means, spreads, expected = [], [], []
    for value, seen in zip(values, known):
        expected.append(spread)
        measured = basis[:, seen]
        spread = np.linalg.inv(np.linalg.inv(spread) + measured @ measured.T / NOISE)
        state = state + spread @ measured @ (value[seen] - mean[seen] - state @ measured) / NOISE
        means.append(state)
        spreads.append(spread)
        spread = spread + walk
    # Rauch, Tung and Striebel 1965: what comes later corrects what was thought before.
    for frame in range(len(means) - 2, -1, -1):
        ahead = np.linalg.solve(expected[frame + 1], means[frame + 1] - means[frame])
        means[frame] = means[frame] + spreads[frame] @ ahead

    smoothed = mean + np.array(means) @ basis
    frames = np.arange(len(values))
    for column, seen in enumerate(known.T):
        wrong = values[seen, column] - smoothed[seen, column]
        smoothed[:, column] += np.interp(frames, frames[seen], wrong)
    return np.where(known, values, smoothed)


def headings(points: np.ndarray) -> np.ndarray:
    """(F,) radians about Y by which points (F, n, 3) around the origin are turned from the first frame, as
    nearly as can be."""
    first, x, z = points[0], points[..., 0], points[..., 2]
    across = (first[:, 2] * x - first[:, 0] * z).sum(axis=1)
    return np.arctan2(across, (first[:, 0] * x + first[:, 2] * z).sum(axis=1))


class Kalman:
    """Recovers lost joints from those that are seen: the rest of the clip shows how they move together."""

    name = "kalman"

    def refuses(self, clip: Clip, gap: Gap) -> str | None:
        """Why not: positions do not tell what is lost, or too few frames are left to learn from."""
        skeleton = clip.skeleton
        if gap.joints is not None and not any(skeleton.children[skeleton.index(name)] for name in gap.joints):
            return "no joint hangs below these, so positions do not tell their rotation"
        return _too_few(len(clip) - len(gap))

    def complete(self, clip: Clip, observation: Observation, seed: int | None = None) -> Raw:
        """Positions of all joints, beside a spline for what positions cannot tell; the spline alone, with a
        remark, where several gaps leave too few frames to learn from. `seed` is not needed."""
        base = Spline().complete(clip, observation).clip
        known = observation.positions(clip.skeleton)
        if reason := _too_few(int(known.all(axis=1).sum())):
            gaps = observation.gaps(clip.skeleton)
            remarks = {f"{gap.start}:{gap.stop}": [f"filled by spline: {reason}"] for gap in gaps}
            return Raw(base, notes={"remarks": remarks})
        positions, steady = base.positions(), known.all(axis=0)
        centre, yaw = np.zeros((len(clip), 1, 3)), np.zeros((len(clip), 1))
        if steady.sum() >= STEADY:
            centre = positions[:, steady].mean(axis=1, keepdims=True)
            yaw = headings(positions[:, steady] - centre)[:, None]
        ahead = turn(positions - centre, -yaw).reshape(len(clip), -1)
        done = smooth(ahead, known.repeat(3, axis=1)).reshape(positions.shape)
        return Raw(base, turn(done, yaw) + centre, tuple(range(len(clip.skeleton))))


def _too_few(frames: int) -> str | None:
    """Why so many wholly known frames do not do, or None if they do."""
    if frames >= FEWEST:
        return None
    return f"it learns from frames that are wholly known: there are {frames}, and it needs {FEWEST}"
