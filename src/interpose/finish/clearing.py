"""Arms of motion that was brought onto another body, kept out of that body."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from interpose.clip import Clip
from interpose.finish.penetration import Part, depths, parts, points_between
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

    Of 11 clips on Bandai-Namco's rig forearms were more than 2 cm deeper in 3.8 % of the frames, and so in
    .02 %; of 12 on Mixamo's in 7.6 % (24 to 39 % of three), and so in 8 % of one.
    """
    pairs, own = depths(given.skeleton, given.positions())
    usual = {pair: own[:, column] * theirs.scale / mine.scale for column, pair in enumerate(pairs)}
    for _ in range(ROUNDS):
        turned, placed = clip.kinematics()
        rotation = clip.rotation.copy()
        pairs, deep = depths(clip.skeleton, placed)
        found, ends = dict(zip(pairs, deep.T)), parts(clip.skeleton, placed)
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
            turn = np.zeros((len(clip), 3))
            for (forearm, part), much in deeper.items():
                way = spread(rounded(much, ROUND / mine.scale), 2 * OVER * clip.fps)
                turn += _out(ends[forearm], ends[part], placed[:, arm], out, mine.scale) * way[:, None]
            turn = ndimage.gaussian_filter1d(turn, OVER * clip.fps, axis=0, mode="nearest")
            done = rotations.multiply(rotations.exp(turn), turned[:, arm])
            above = clip.skeleton.parents[arm]
            rotation[:, arm] = done if above < 0 else rotations.relative(turned[:, above], done)
        if np.array_equal(rotation, clip.rotation):
            return clip
        clip = clip.with_motion(rotations.normalize(rotation), clip.translation)
    return clip


def _out(forearm: Part, part: Part, shoulder: np.ndarray, out: np.ndarray, scale: float) -> np.ndarray:
    """(F, 3) rotation vectors about a shoulder (F, 3), a metre, by which a forearm comes out of a part of the
    body; where the two axes all but meet, towards `out` (F, 3)."""
    near, there = points_between(*forearm[:2], *part[:2])
    away, lever = near - there, near - shoulder
    far = np.linalg.norm(away, axis=-1, keepdims=True)
    away = away + np.maximum(CLOSE / scale - far, 0.0) * out
    axis = rotations.normalize(np.cross(lever, away))
    return np.asarray(axis / np.maximum(np.linalg.norm(lever, axis=-1, keepdims=True), CLOSE / scale))
