"""Arms of motion that was brought onto another body, kept out of that body."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from interpose.clip import Clip
from interpose.finish.penetration import Pair, depths, parts, points_between
from interpose.finish.windows import rounded, spread
from interpose.geometry import rotations
from interpose.skeletons import Humanoid

# Metres, of a body with the canonical leg, by which forearms may go deeper into the body than they did, and
# within which axes tell no way out; what is turned is rounded off by the last. Rounds, and the seconds over
# which an arm makes room: at once hands are jerked, by up to 14 times what they were.
LEAST, CLOSE, ROUND = 0.005, 0.06, 0.005
ROUNDS, OVER = 4, 0.15


def cleared(clip: Clip, given: Clip, mine: Humanoid, theirs: Humanoid) -> Clip:
    """The clip with upper arms turned by as little as lets forearms go no deeper into legs, trunk and head
    than they do in the motion that was `given`: shoulders may be narrower here, and arms longer.

    Of 18 to 23 clips a rig those in which forearms are more than 2 cm deeper in more than 3 % of the frames
    were 8 on Bandai-Namco's rig, 4 on Mixamo's, 3 on CMU's; so none.
    """
    pairs, own = depths(given.skeleton, given.positions())
    usual = {pair: own[:, column] * theirs.scale / mine.scale for column, pair in enumerate(pairs)}
    for _ in range(ROUNDS):
        turned, placed = clip.kinematics()
        rotation = clip.rotation.copy()
        pairs, deep = depths(clip.skeleton, placed)
        found = dict(zip(pairs, deep.T))
        for side, other in (("Left", "Right"), ("Right", "Left")):
            arm, opposite = mine.mapping[f"{side}Arm"], mine.mapping[f"{other}Arm"]
            deeper = {
                pair: deep - usual.get(pair, 0.0)
                for pair, deep in found.items()
                if pair[0] == f"{side.lower()} forearm" and "forearm" not in pair[1]
            }
            worst = max((float(much.max(initial=0.0)) for much in deeper.values()), default=0.0)
            if arm is None or opposite is None or worst < LEAST / mine.scale:
                continue
            out = rotations.normalize(placed[:, arm] - placed[:, opposite])
            turn = sum(
                _out(clip, placed, placed[:, arm], out, pair, much, mine.scale)
                for pair, much in deeper.items()
            )
            turn = ndimage.gaussian_filter1d(turn, OVER * clip.fps, axis=0, mode="nearest")
            done = rotations.multiply(rotations.exp(turn), turned[:, arm])
            above = clip.skeleton.parents[arm]
            rotation[:, arm] = done if above < 0 else rotations.relative(turned[:, above], done)
        if np.array_equal(rotation, clip.rotation):
            return clip
        clip = clip.with_motion(rotations.normalize(rotation), clip.translation)
    return clip


def _out(
    clip: Clip,
    placed: np.ndarray,
    shoulder: np.ndarray,
    out: np.ndarray,
    pair: Pair,
    much: np.ndarray,
    scale: float,
) -> np.ndarray:
    """(F, 3) rotation vectors about a shoulder (F, 3) that take a forearm out of a part of the body that it
    is in by so `much` (F,) too deep; `out` (F, 3) where the axes all but meet."""
    ends = parts(clip.skeleton, placed)
    near, there = points_between(*ends[pair[0]][:2], *ends[pair[1]][:2])
    away, lever = near - there, near - shoulder
    far = np.linalg.norm(away, axis=-1, keepdims=True)
    away = away + np.maximum(CLOSE / scale - far, 0.0) * out
    way = spread(rounded(much, ROUND / scale), 2 * OVER * clip.fps)
    axis = rotations.normalize(np.cross(lever, away))
    return np.asarray(axis * (way / np.maximum(np.linalg.norm(lever, axis=-1), CLOSE / scale))[:, None])
