"""Measures of a motion, as functions of positions in metres; each docstring says what comes out."""

from __future__ import annotations

import numpy as np

from interpose.geometry.time import runs

# Height above the floor, in metres, at which a moving foot no longer counts as sliding (Zhang et al. 2018).
SLIDE_HEIGHT = 0.025
# Metres a second that joints move on average against the root of a body that is not still.
STIRS = 0.15
# Metres a second, and a share of what the hips do, above which a foot goes along with a body that glides.
GLIDE, ALONG = 0.3, 0.5
# A stance: metres a second, metres above where a foot rests, and seconds.
SLOWLY, LOW, DRIFTS = 0.5, 0.02, 0.13


def joint_error(positions: np.ndarray, truth: np.ndarray) -> float:
    """Mean distance in metres between two motions (..., 3); NaN when they are empty."""
    if positions.size == 0:
        return float("nan")
    return float(np.linalg.norm(positions - truth, axis=-1).mean())


def acceleration(positions: np.ndarray, step: int = 1) -> np.ndarray:
    """Velocity jumps (F - 2 step, ...) of positions (F, ..., 3): the length of their second difference.

    In metres per `step` frames squared; row i belongs to frame i + step.
    """
    before, here, after = positions[: -2 * step], positions[step:-step], positions[2 * step :]
    return np.linalg.norm(before - 2 * here + after, axis=-1)


def bone_deviation(positions: np.ndarray, parents: tuple[int, ...], lengths: np.ndarray) -> float:
    """Largest difference in metres between a bone's length in any frame and what it should be.

    positions: (F, J, 3); parents: -1 for joints without a bone; lengths: (J,), NaN for bones without a fixed
    length (animated translations).
    """
    fixed = [j for j, parent in enumerate(parents) if parent >= 0 and np.isfinite(lengths[j])]
    if not fixed or len(positions) == 0:
        return 0.0
    bones = positions[:, fixed] - positions[:, [parents[j] for j in fixed]]
    return float(np.abs(np.linalg.norm(bones, axis=-1) - lengths[fixed]).max())


def speed(positions: np.ndarray, fps: float) -> np.ndarray:
    """Horizontal speed (F, ...) in metres a second of positions (F, ..., 3), by central differences."""
    if len(positions) < 2:
        return np.zeros(positions.shape[:-1])
    velocity = np.gradient(positions, axis=0) * fps
    return np.linalg.norm(velocity[..., [0, 2]], axis=-1)


def liveliness(positions: np.ndarray, start: int, stop: int, fps: float) -> float | None:
    """How much a body moves in the middle half of a gap, as a share of how much it moves around it.

    The mean speed of joints relative to the first one, over the second before frame `start` and the second
    from `stop` on. Long gaps of methods that say one answer tend to the mean of all possible ones, which
    hardly moves (Kaufmann et al. 2020, section 4.2). Of a gap at an end of the motion it is all but the
    quarter beside what is known, whose second alone it is compared with.

    Args:
        positions: (F, J, 3) metres, the root first.
        start, stop: the gap is frames start to stop - 1.

    Returns:
        None for gaps under a second, with less than half a second of motion on a side, or amid stillness.
    """
    second, quarter = round(fps), (stop - start) // 4
    lo, hi = max(0, start - second), min(len(positions), stop + second)
    sides = [side for side in ((lo, start), (stop, hi)) if side[0] < side[1]]
    if stop - start < second or not sides or min(b - a for a, b in sides) < max(second / 2, 2):
        return None
    around = float(np.mean([_stir(positions[a:b]) for a, b in sides]))
    if around * fps < STIRS:
        return None
    middle = positions[start + quarter * (start > 0) : stop - quarter * (stop < len(positions))]
    return float(_stir(middle) / around) if len(middle) > 1 else None


def _stir(positions: np.ndarray) -> float:
    """Mean step in metres a frame of joints relative to the first one."""
    return float(np.linalg.norm(np.diff(positions - positions[:, :1], axis=0), axis=-1).mean())


def foot_slide(positions: np.ndarray, fps: float, floor: np.ndarray | None = None) -> float:
    """How much planted feet slide, in centimetres a second: the mean of v * clip(2 - 2 ** (h / H), 0, 1).

    Source: Zhang et al., Mode-Adaptive Neural Networks for Quadruped Motion Control, 2018; H is 2.5 cm. v is
    the horizontal speed between neighbouring frames, h the height above `floor`.

    Args:
        positions: (F, n, 3) ankles and/or toes.
        floor: heights at which each of them rests, broadcast to (F, n): floors need not be flat, and an ankle
            rests higher than a toe. Default: the lowest height of each over the clip.
    """
    if len(positions) < 2:
        return 0.0
    floor = positions[..., 1].min(axis=0) if floor is None else floor
    height = positions[..., 1] - np.broadcast_to(floor, positions.shape[:-1])
    height = np.maximum(0.5 * (height[1:] + height[:-1]), 0.0)
    step = np.linalg.norm(np.diff(positions[..., [0, 2]], axis=0), axis=-1)
    # From one SLIDE_HEIGHT on nothing is left; 2 to the power of all of it may be too much to hold.
    low = np.clip(2.0 - 2.0 ** np.minimum(height / SLIDE_HEIGHT, 1.0), 0.0, 1.0)
    return float((100.0 * fps * step * low).mean())


def stance_drift(positions: np.ndarray, fps: float, floor: np.ndarray) -> tuple[float, int, int, int]:
    """The furthest that a foot gets in one stance, in metres; which joint, and the frames start to stop - 1.

    What `foot_slide`, which is a mean over all frames, does not see: one long slide amid firm stances. A
    stance is DRIFTS seconds or longer, slower than SLOWLY, and no higher above the floor than LOW.

    Args:
        positions: (F, n, 3) ankles and/or toes.
        floor: (F, n) heights at which each of them rests.
    """
    still = (speed(positions, fps) < SLOWLY) & (positions[..., 1] < floor + LOW)
    worst = (0.0, 0, 0, 0)
    for joint in range(positions.shape[1]):
        for start, stop in runs(still[:, joint]):
            if stop - start >= DRIFTS * fps:
                way = positions[start:stop, joint][:, [0, 2]] - positions[start, joint, [0, 2]]
                worst = max(worst, (float(np.linalg.norm(way, axis=1).max()), joint, start, stop))
    return worst


def foot_travel(positions: np.ndarray) -> float:
    """Length of the feet's paths in metres, mean over the n joints of positions (F, n, 3).

    The counterpart of `foot_slide`: feet that are frozen do not slide, but do not travel either.
    """
    if len(positions) < 2:
        return 0.0
    return float(np.linalg.norm(np.diff(positions, axis=0), axis=-1).sum(axis=0).mean())


def glides(feet: np.ndarray, root: np.ndarray, fps: float, size: float = 1.0) -> np.ndarray:
    """(F,) in which frames a body travels on no foot: each goes along with it, ankle and toe.

    What `foot_slide` does not see, as it looks at feet on the floor alone: a method whose feet float slides
    least. Who runs or jumps is in the air for moments, too, so shares are to be compared.

    Args:
        feet: (F, L, n, 3) metres, ankles and toes of L legs.
        root: (F, 3) metres, the hips.
        size: of the body, 1 for a leg of the usual length.
    """
    slowest = speed(feet, fps).min(axis=2).min(axis=1)
    return (slowest > GLIDE * size) & (slowest > ALONG * speed(root, fps))


def stance_speed(positions: np.ndarray, planted: np.ndarray, fps: float) -> float:
    """Mean horizontal speed in centimetres a second of feet (F, n, 3) while they stand in the truth (F, n).

    For known truth, to be read beside `foot_slide`: that one stops counting 2.5 cm above the floor, so
    that lifting a foot that slides lowers it, too. This one does not look at heights. NaN without stances.
    """
    return 100.0 * float(speed(positions, fps)[planted].mean()) if planted.any() else float("nan")
