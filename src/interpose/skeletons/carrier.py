"""What carries a body over the floor: the hips, or a joint above them that goes along.

Game engines hang the hips from a root at the origin. In some files it goes where the character goes; in
others it stays where it is, and is no part of the body's way.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import scipy

from interpose.clip import Clip, Skeleton
from interpose.geometry import rotations
from interpose.geometry.ground import UP
from interpose.geometry.time import hermite
from interpose.skeletons.mapping import find_mapping

NEAR = 0.3  # metres over the floor within which a root stays that goes along with the hips
STILL = 1e-3  # metres, and radians: what moves less against its parent does not move
# What of a root's height (metres) changes, and what points up at it leans (radians), at most, is none.
LEVEL, LEANS = 2e-3, 2e-3
# A root turns along with the hips that faces as they do to so many radians, over so many seconds (standard
# deviations), and turns that much less against them than by itself (a share). In a gap how it is turned
# against them fades into what is usual over so many seconds.
ASIDE, WIDTHS, LESS, EASE = np.radians(45), (0.0, 0.05, 0.1, 0.2, 0.4), 0.5, 0.5


def hips_of(skeleton: Skeleton) -> int:
    """The joint that is the hips; of what is no humanoid, its first root."""
    hips = find_mapping(skeleton)["Hips"]
    return skeleton.roots[0] if hips is None else hips


def placed(clip: Clip) -> list[int]:
    """The joints whose translations say where the body is: roots, hips and what is between, in order."""
    hips = hips_of(clip.skeleton)
    return sorted({*clip.skeleton.roots, hips, *clip.skeleton.ancestors(hips)} & set(clip.translated))


def line_of(clip: Clip) -> list[int]:
    """Those of the joints `placed` that the hips hang from, or are, the topmost first: who is there beside
    them, or what, says nothing of the body."""
    hips = hips_of(clip.skeleton)
    return [joint for joint in placed(clip) if joint in (hips, *clip.skeleton.ancestors(hips))]


def place_of(clip: Clip) -> int:
    """The lowest of these, which moves the body and leaves a root above it where it is."""
    return line_of(clip)[-1]


def carriers(clip: Clip) -> list[int]:
    """The joints that all of a motion hangs from: to move them is to move the motion.

    The first is the topmost joint from the hips upwards that moves; then other roots, and what moves beside
    the hips below a root that stays where it is (targets of feet and hands, in rigs of game engines).
    """
    skeleton = clip.skeleton
    hips = hips_of(skeleton)
    line = [joint for joint in (*skeleton.ancestors(hips)[::-1], hips) if joint in clip.translated]
    top = next((joint for joint in line if not _still(clip, joint)), line[-1])
    above = skeleton.ancestors(top)
    others = [root for root in skeleton.roots if root != top and root not in above]
    aside = [
        joint
        for joint in clip.translated
        if skeleton.parents[joint] in above and joint not in (top, *above) and not _still(clip, joint)
    ]
    return [top, *others, *aside]


def moved(clip: Clip, places: Mapping[int, tuple[np.ndarray, np.ndarray]]) -> Clip:
    """The clip with joints at other places.

    Args:
        clip: F frames.
        places: by joint, the global rotations (F, 4) and positions (F, 3) that it is to have. None of the
            joints hangs from another one of them, and each has translations of its own.
    """
    skeleton = clip.skeleton
    turned, placed = clip.kinematics()
    rotation, translation = clip.rotation.copy(), clip.translation.copy()
    for joint, (turn, place) in places.items():
        parent = skeleton.parents[joint]
        if parent >= 0:
            back = rotations.conjugate(turned[:, parent])
            turn = rotations.multiply(back, turn)
            place = rotations.rotate(back, place - placed[:, parent]) / skeleton.scale_above[joint]
        rotation[:, joint] = turn
        translation[:, clip.translated.index(joint)] = place
    return clip.with_motion(rotation, translation)


def rooted(clip: Clip, known: np.ndarray, turns: np.ndarray, cut: int = 0) -> Clip:
    """The clip with a root above the hips where it belongs in frames where the place of neither is known.

    As far aside of them as before and after, if it goes along with them in all known frames (what game
    engines call root motion); or where it was, if it stands still in these. If it turns along with them, it
    does so, too, as smoothly; and if they never turn against it, as in 3ds Max's Biped, all turns are its
    own. What is upright in all known frames, or at one height, stays so. The body stays where it is.

    Args:
        clip: F frames.
        known, turns: (F, J) which local translations, and which local rotations, are known.
        cut: the frame with which another motion begins.
    """
    hips = hips_of(clip.skeleton)
    above = [joint for joint in clip.skeleton.ancestors(hips) if joint in clip.translated]
    if not above:
        return clip
    if hips not in clip.translated:
        return _turning(clip, known, turns)
    root, (turned, placed) = above[-1], clip.kinematics()
    aside = (placed[:, root] - placed[:, hips]) * [1.0, 0.0, 1.0]
    both = np.asarray(known[:, [hips, root]].all(axis=1))
    free = np.logical_not(known[:, [hips, *above]].any(axis=1))
    if both.sum() < 2 or not free.any():
        return clip
    if np.ptp(placed[both, root], axis=0).max() < STILL:
        there = np.where(free[:, None], placed[both, root].mean(axis=0), placed[:, root])
    elif np.ptp(aside[both], axis=0).max() < NEAR:
        at = np.flatnonzero(both)
        usual = np.stack([np.interp(np.arange(len(clip)), at, axis[at]) for axis in aside.T], axis=1)
        there = placed[:, root] + (usual - aside) * free[:, None]
    else:
        there = placed[:, root].copy()
    if np.ptp(placed[both, root, 1]) < LEVEL:
        there[free, 1] = placed[both, root, 1].mean()
    turn = _upright(turned[:, root], both, free)
    both = both & turns[:, [hips, root]].all(axis=1)
    free = free & np.logical_not(turns[:, [hips, root]].any(axis=1))
    if clip.skeleton.below[list(find_mapping(clip.skeleton).mapped[1]), hips].all():
        turn = _facing(turn, turned[:, hips], both, free, clip.fps, cut)
    led = moved(clip, {root: (turn, there)})
    return moved(led, {hips: (turned[:, hips], placed[:, hips])})


def _turning(clip: Clip, known: np.ndarray, turns: np.ndarray) -> Clip:
    """The clip with a root that turns as hips do which hang from it and turn against it in no known frame;
    arguments as in `rooted`."""
    hips = hips_of(clip.skeleton)
    root, body = clip.skeleton.parents[hips], find_mapping(clip.skeleton).mapped[1]
    if root not in clip.translated or not clip.skeleton.below[list(body), hips].all():
        return clip
    both = turns[:, [hips, root]].all(axis=1)
    free = np.logical_not(turns[:, [hips, root]].any(axis=1) | known[:, root])
    if both.sum() < 2 or not free.any():
        return clip
    against, own = clip.rotation[both, hips], clip.rotation[both, root]
    if rotations.angle(against, against[:1]).max() > STILL or rotations.angle(own, own[:1]).max() < STILL:
        return clip
    turned, placed = clip.kinematics()
    turn = rotations.multiply(turned[:, hips], rotations.conjugate(against[0]))
    reach = rotations.rotate(rotations.conjugate(turned[:, root]), placed[:, hips] - placed[:, root])
    turn = np.where(free[:, None], turn, turned[:, root])
    place = np.where(free[:, None], placed[:, hips] - rotations.rotate(turn, reach), placed[:, root])
    led = moved(clip, {root: (turn, place)})
    rotation = led.rotation.copy()
    rotation[free, hips] = against[0]
    return led.with_motion(rotation, led.translation)


def _facing(
    root: np.ndarray, hips: np.ndarray, known: np.ndarray, free: np.ndarray, fps: float, cut: int
) -> np.ndarray:
    """Rotations of a root (F, 4), those that are `free` (F,) turned about the vertical to face as the hips
    (F, 4) do, if all that are `known` (F,) turn along with these."""
    if known.sum() < 2 or not free.any():
        return root
    own, theirs = _unit(_yaw(root, known)), _yaw(hips, known)
    parts = [part for part in np.split(theirs, [cut]) if len(part)]
    against = [
        own * _unit(np.concatenate([_smooth(part, width * fps) for part in parts])).conj() for width in WIDTHS
    ]
    best = min(against, key=lambda some: float(np.std(some[known])))
    mean = best[known].mean()
    off, turns = np.angle(best * mean.conj()), np.std(own[known])
    if turns < STILL or np.std(best[known]) > LESS * turns or np.abs(off[known]).max() > ASIDE:
        return root
    change = _over(off, known, EASE * fps) - off
    there = rotations.multiply(rotations.about("Y", change), root)
    return np.where(free[:, None], rotations.normalize(there), root)


def _yaw(turned: np.ndarray, known: np.ndarray) -> np.ndarray:
    """(F,) how rotations (F, 4) are turned about the vertical since the first one that is known, as complex
    numbers: shorter, the more they are tilted, until there is no telling."""
    since = rotations.multiply(turned, rotations.conjugate(turned[known][0]))
    return np.asarray((since[:, 0] + 1j * since[:, 2]) ** 2)


def _over(off: np.ndarray, known: np.ndarray, reach: float) -> np.ndarray:
    """(F,) angles led from those that are known to the next, at their pace over `reach` frames beside them;
    at both ends they come to rest."""
    at = np.flatnonzero(known)
    led = np.interp(np.arange(len(off)), at, off[at])
    pace = np.diff(led, prepend=led[:1], append=led[-1:])
    knots = np.unique([0, *at, len(off) - 1])
    for a, b in zip(knots[:-1], knots[1:]):
        if b - a > 1:
            y, other, v, w = (np.array([some]) for some in (led[a], led[b], pace[a], pace[b + 1]))
            t, length = np.arange(b - a + 1.0), np.array(float(b - a))
            led[a : b + 1] = hermite(y, other, v, w, t, length, reach)[:, 0]
    return led


def _unit(numbers: np.ndarray) -> np.ndarray:
    return np.asarray(numbers / np.maximum(np.abs(numbers), 1e-12))


def _smooth(values: np.ndarray, width: float) -> np.ndarray:
    return np.asarray(scipy.ndimage.gaussian_filter1d(values, width, mode="nearest")) if width else values


def _upright(turned: np.ndarray, known: np.ndarray, free: np.ndarray) -> np.ndarray:
    """Rotations (F, 4), those that are `free` (F,) brought upright if all that are `known` are."""
    # What points up in the first known frame points up in all of them, if it turns about the vertical alone.
    up = rotations.rotate(rotations.conjugate(turned[known][0]), UP.values)
    ways = rotations.rotate(turned, np.broadcast_to(up, (len(turned), 3)))
    if (np.linalg.norm(ways[known] - UP.values, axis=-1) > LEANS).any():
        return turned
    back = rotations.between(ways, np.broadcast_to(UP.values, ways.shape))
    return np.where(free[:, None], rotations.normalize(rotations.multiply(back, turned)), turned)


def _still(clip: Clip, joint: int) -> bool:
    """Whether a joint keeps its place and how it is turned, against its parent."""
    if not len(clip):
        return True
    place = clip.translation[:, clip.translated.index(joint)]
    turns = rotations.angle(clip.rotation[0, joint], clip.rotation[:, joint])
    return bool(np.ptp(place, axis=0).max() < STILL and turns.max() < STILL)
