"""Where the hips go in a long hole, and how fast: what leads the windows that complete it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.linalg import solveh_banded

from interpose.geometry.time import bending, sample, sample_rotations
from interpose.methods.base.graph import ROUGHLY, Answer, Seen

# Where more frames than ASTRAY are left, ends that know nothing of each other would stray, and the body would
# run in between: its hips are led along a way that leaves and meets them as they go, which wears off by e in
# LEAD frames, and that is known as far as what is noisy. In 24 gaps of 8 s of LAFAN1's validation performer
# joints are off by 89 cm so (98 with half of LEAD), by 101 where nothing leads them (they run at 2.5 m/s,
# people at 2.2) and by 130 along a straight line; in gaps of 7 s by 85, and by 81 where nothing leads them.
ASTRAY, LEAD = 225, 60.0
# So they are in shorter holes, too, that begin or end slower than STANDS (metres a frame) or at a lone frame,
# but whose ends are apart by more than GOES for every frame: who stands would stand for as long as he can,
# and then run.
STANDS, GOES = 0.4 / 30, 0.3 / 30
# Where somebody says where the hips go, they come back to it by e in about so many frames.
BACK = 5.0
# How smooth their way over the floor is made (Whittaker 1923, second differences), and how much more what
# is known counts. In 12 gaps each of 3 and 6 s of LAFAN1's validation performer, led as he went, their pace
# changes by at most 3.9 and 4.4 m/s^2 so (medians; 11.4 and 13.1 as the windows say it, his own 4.1 and 8.2);
# feet slide by 4.4 and 5.0 cm/s instead of 4.4 and 5.3, and joints are off by as much. So is their height, by
# less, for they bounce: in 9 gaps that a path leads aside their speed up or down changes by .58 m/s at most
# from one frame to the next (1.3 as the windows say it; .36 where nothing leads them).
STIFF, BOUNCES, FIXED = 7.0, 2.0, 1e6
# Of what follows nothing, or is followed by nothing: frames over which a pace is measured, and those of known
# motion in which it is, over as many; who goes steadily goes in each at such a share of the fastest, and at
# so many metres a frame. No window is slowed to less than a share.
BLOCK, STEADY, EVENLY, SLOWEST, LEAST = 15, 45, 0.3, 0.003, 0.6


def led(motion: Seen, begin: int, end: int) -> Seen:
    """The motion with the hips, from frame `begin` to before `end`, roughly on a way between the frames
    beside: the one that is said, or one that leaves and arrives as they go there, level, and is straight
    where that has worn off."""
    root, known = motion.root.copy(), motion.known.copy()
    known[begin:end, -1] = ROUGHLY
    since = np.arange(1.0, end - begin + 1)[:, None]
    until = since[::-1]
    if told(motion, begin, end):
        root[begin:end] = motion.way[begin:end]
        # What is completed already is beside it by some centimetres.
        for beside, away in ((begin - 1, since), (end, until)):
            root[begin:end] += (1 + away / BACK) * np.exp(-away / BACK) * (root[beside] - motion.way[beside])
        local = motion.local.copy()
        if np.isfinite(motion.faces[begin:end]).all():
            local[begin:end, 0], known[begin:end, 0] = motion.faces[begin:end], ROUGHLY
        return replace(motion, local=local, root=root, known=known)
    whole = end - begin + 1
    step = (root[end] - root[begin - 1]) / whole
    turns = np.zeros((end - begin, 3))
    for goes, away, back, side in (
        (velocity(motion, begin - 1, -1), since, until, 1.0),
        (velocity(motion, end, 1), until, since, -1.0),
    ):
        if goes is not None:
            turns += side * away * (back / whole) ** 2 * np.exp(-away / LEAD) * (goes - step)
    root[begin:end] = root[begin - 1] + since * step + turns * [1.0, 0.0, 1.0]
    return replace(motion, root=root, known=known)


def told(motion: Seen, begin: int, end: int) -> bool:
    """Whether it is said of a hole between known frames where the hips go."""
    return bool(np.isfinite(motion.way[begin - 1 : end + 1]).all())


def eased(said: np.ndarray, own: slice, motion: Seen, inside: slice) -> np.ndarray:
    """What a window says of the hips (n, 3), in its frames `own` moved so that they go on as they do in the
    known frames beside the frames `inside` of a motion."""
    root = said.copy()
    left = np.linspace(1.0, 0.0, own.stop - own.start + 1)[:-1, None]
    fade = left * left * (3 - 2 * left)
    for beside, way, share in ((inside.start - 1, -1, fade), (inside.stop, 1, fade[::-1])):
        if 0 < beside < len(motion.root) - 1 and (motion.known[[beside, beside + way], -1] > 0).all():
            first = own.start if way < 0 else own.stop - 1
            goes_on = 2 * motion.root[beside] - motion.root[beside + way]
            root[own] -= share * (said[first] - goes_on)
    return root


def steady(root: np.ndarray, begin: int, end: int) -> None:
    """Smooth the way of hips (F, 3) in frames begin to end - 1, where each window came with a pace, and at a
    height, of its own; the frames beside stay, and so does how they are left and met where two are known."""
    first, last = max(begin - 2, 0), min(end + 2, len(root))
    weight = np.ones(last - first)
    weight[: begin - first] = weight[end - first :] = FIXED
    for stiff, axes in ((STIFF, [0, 2]), (BOUNCES, [1])):
        bands = stiff * bending(last - first)
        bands[0] += weight
        way = solveh_banded(bands, weight[:, None] * root[first:last, axes], lower=True)
        root[begin:end, axes] = way[begin - first : end - first]


def velocity(motion: Seen, frame: int, way: int) -> np.ndarray | None:
    """How hips move, metres a frame (3,), in the known half second that begins (`way` 1) or ends (-1) with a
    frame; None where that frame is alone."""
    known = motion.known[:, -1] > 0
    part = slice(frame, frame + BLOCK + 1) if way > 0 else slice(max(frame - BLOCK, 0), frame + 1)
    count = int(np.logical_and.accumulate(known[part][::way]).sum())
    if count < 2:
        return None
    ahead: np.ndarray = (motion.root[frame + way * (count - 1)] - motion.root[frame]) / (way * (count - 1))
    return ahead


def strays(motion: Seen, begin: int, end: int, near: int) -> bool:
    """Whether ends of a hole of the whole body that know nothing of each other would not meet; they do
    where no more than `near` frames are missing."""
    if end - begin > ASTRAY:
        return True
    if end - begin <= near:
        return False
    ways = [velocity(motion, begin - 1, -1), velocity(motion, end, 1)]
    stands = any(way is None or np.linalg.norm(way[::2]) < STANDS for way in ways)
    far = np.linalg.norm((motion.root[end] - motion.root[begin - 1])[::2])
    return stands and bool(far > GOES * (end - begin + 1))


def steady_pace(root: np.ndarray) -> float | None:
    """Metres a frame that hips (T, 3) went at most, in half a second, of the last two; None of who did not go
    steadily all the while."""
    ways = np.linalg.norm((root[BLOCK:] - root[:-BLOCK])[-STEADY:, ::2], axis=1) / BLOCK
    goes = len(ways) == STEADY and ways.min() > max(EVENLY * ways.max(), SLOWEST)
    return float(ways.max()) if goes else None


def at_pace(said: Answer, own: slice, root: np.ndarray, fastest: float, backwards: bool) -> Answer:
    """What is said, slowed in its frames `own` as far as hips go faster there than they did before.

    Each window goes on from what the one before said, a little faster: in three seconds who shuffles would
    run.

    root: (BLOCK, 3) where the hips were before, the last one beside `own`; that is before it, or after where
        it goes `backwards`.
    """
    length = own.stop - own.start
    ahead = np.arange(1.0, length + 1)
    edge, way = (own.stop, -1) if backwards else (own.start - 1, 1)
    far = said.root[edge + way * length] - root[length - BLOCK - 1]
    pace = float(np.linalg.norm(far[::2])) / BLOCK
    if pace <= fastest:
        return said
    at = np.arange(len(said.root), dtype=float)
    at[(edge + way * ahead).astype(int)] = edge + way * max(fastest / pace, LEAST) * ahead
    return replace(
        said,
        local=sample_rotations(said.local, at),
        root=sample(said.root, at),
        stands=sample(said.stands, at),
    )
