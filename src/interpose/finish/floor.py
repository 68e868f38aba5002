"""Nobody goes through the floor: what is lower than all that is known nearby is lifted, the body with it.

How feet stand is a matter of `finish/feet.py`; here it is about who lies, crawls or falls, and what is left.
The floor is the lowest joint that is observed nearby; where no foot is, it is taken for height 0.
"""

from __future__ import annotations

import numpy as np

from interpose.clip import Clip
from interpose.finish import feet
from interpose.finish.solve import refine
from interpose.finish.windows import envelope, rounded, spread
from interpose.methods.bodies import no_humanoid
from interpose.observation import Observation
from interpose.skeletons import Mapping, find_mapping
from interpose.skeletons.carrier import hips_of

# Metres that a joint may be lower than the lowest one that is known (rounded off over half of it):
# in 5 % of 215 gaps of 1 to 4 s of LAFAN1's validation performer the truth is lower, who falls by up to .12.
SINK = 0.02
# Seconds over which a joint is lifted and let down again.
BLEND = 0.15
# How much the place of every other joint counts beside those that are lifted, round by round; and how many
# times more those of feet do.
SHARES, FEET = (1e-1, 1e-2), 10.0
# Poses that are to be known, so many seconds apart, for feet to tell the floor: a jump holds fewer. Else they
# are lifted under hips that are lower than this (metres) above it, as those of a body that does not stand.
# What is as far above the lowest is none.
POSES, APART, LOW, ABOUT = 3, 0.4, 0.5, 0.2
# How high hips are, in legs, of a body that stands or crouches on the floor.
UPRIGHT = (0.75, 1.2)
# Metres from a hand or the head within which what hangs from it is part of the body, as fingers are.
HAND = 0.25
# Where little is free, as thighs whose shins are known, all else holds a body against the lift: it is lifted
# again where it was deeper than this (metres), to so much of that or less, in at most so many rounds, and may
# go aside then. Of 28 excerpts of LAFAN1 whose thighs are lost ten were more than 5 cm under the floor, and
# three are so.
DEEP, NEARER, ROUNDS = 0.05, 0.95, 12
# Metres that are no lift.
NOTHING = 1e-4


def depth(clip: Clip, known: Observation) -> tuple[np.ndarray, list[int]]:
    """(F, n) metres by which joints that are not observed are under the floor, and which n.

    That is the lowest observed joint of poses of which a foot is; for ankles, and for toes, the lowest one of
    these, where that is about as low: knees on which a body kneels may lie deeper than feet ever do. The
    joints are those of the humanoid, and what its hands and head end in; what is observed is 0 deep, and so
    are feet under hips that stand, where fewer than three poses are known: one may have them in the air.
    Where no foot is observed the floor is at height 0, as in most files, if hips are where those of a body
    are that stands on it; else nothing is deep.
    """
    mapping, size = find_mapping(clip.skeleton), feet.size(clip.skeleton)
    joints, ends = [*mapping.mapped[1], *_beyond(mapping)], feet.ends(clip.skeleton)
    heights, observed = clip.positions()[..., 1], known.positions(clip.skeleton)
    tells = observed[:, ends].any(axis=1)
    if no_humanoid(mapping) or not (tells.any() or _upright(clip, observed, mapping.leg_length)):
        return np.zeros((len(clip), len(joints))), joints
    if not tells.any():
        return np.where(observed, 0.0, -heights)[:, joints], joints
    heard = np.where(observed, heights, np.inf)[tells]
    low = float(heard.min())
    bound = np.full(len(clip.skeleton), low)
    for kind in feet.pairs(clip.skeleton).T:
        own = float(heard[:, kind].min())
        bound[kind] = own if own - low < ABOUT * size else low
    below = np.where(observed, 0.0, bound - heights)
    if _poses(np.flatnonzero(tells), APART * clip.fps) < POSES:
        stands = heights[:, hips_of(clip.skeleton)] > low + LOW * size
        below[:, ends] *= ~stands[:, None]
    return below[:, joints], joints


def _poses(frames: np.ndarray, apart: float) -> int:
    """How many of the frames, in order, are that far apart."""
    count, last = 0, -np.inf
    for frame in frames.tolist():
        if frame - last >= apart:
            count, last = count + 1, frame
    return count


def _beyond(mapping: Mapping) -> list[int]:
    """The joints that hang from hands and head, none further from there than a hand is long: fingers, say."""
    skeleton, found = mapping.skeleton, []
    bones = np.linalg.norm(skeleton.rest_translation, axis=1) * skeleton.scale_above
    for end in filter(None, (mapping["LeftHand"], mapping["RightHand"], mapping["Head"])):
        away = {end: 0.0}
        for joint in np.flatnonzero(skeleton.below[:, end]).tolist():
            if (parent := skeleton.parents[joint]) in away and joint not in mapping.mapped[1]:
                away[joint] = away[parent] + float(bones[joint])
        found += [joint for joint in away if joint != end and away[joint] < HAND * feet.size(skeleton)]
    return found


def _upright(clip: Clip, observed: np.ndarray, leg: float) -> bool:
    """Whether observed hips, at their highest, are as far above height 0 as those of a body on it."""
    hips = hips_of(clip.skeleton)
    high = clip.positions()[observed[:, hips], hips, 1].max(initial=-np.inf)
    return bool(UPRIGHT[0] * leg < high < UPRIGHT[1] * leg)


def lifted(clip: Clip, known: Observation, span: tuple[int, int]) -> Clip:
    """The clip with what is under the floor in frames `span` (start to before stop) on it.

    What is free of the body gives way as little as that takes: arms bend, hips rise, and feet stay.

    Args:
        clip, known: the motion around the frames, and what of it is observed.
    """
    size, over = feet.size(clip.skeleton), max(2.0, BLEND * clip.fps)
    inside = np.zeros(len(clip), bool)
    inside[slice(*span)] = True
    fade = np.prod(envelope(inside & ~known.frames, over), axis=0)
    canonical = {*find_mapping(clip.skeleton).mapped[1]}
    deepest = np.inf
    for again in range(ROUNDS):
        deep, joints = depth(clip, known)
        lift = np.array([spread(rounded(column - SINK, SINK / 2), over) for column in deep.T / size]).T
        lift = size * lift * fade[:, None]
        if lift.max(initial=0.0) > NEARER * deepest:
            break
        deepest = float(lift.max(initial=0.0))
        # What hangs from hands need not hold still.
        asked = [i for i, joint in enumerate(joints) if joint in canonical or lift[:, i].max() > NOTHING]
        clip = higher(clip, known, [joints[i] for i in asked], lift[:, asked], aside=again > 0)
        if deepest < size * DEEP:
            break
    return clip


def higher(clip: Clip, known: Observation, joints: list[int], lift: np.ndarray, aside: bool = False) -> Clip:
    """The clip with joints lifted by so many metres (F, n); what is free of the body gives way as little as
    that takes, feet least of all. What is lifted goes straight up, or may go `aside` as well."""
    size = feet.size(clip.skeleton)
    moved = np.flatnonzero(lift.max(axis=1, initial=0.0) > NOTHING)
    if not moved.size:
        return clip
    part = clip.take(moved)
    seen = Observation(known.rotation[moved], known.translation[moved])
    goal, share = part.positions()[:, joints], np.minimum(lift[moved] / (size * SINK), 1.0)
    goal[..., 1] += lift[moved]
    heavy = np.isin(joints, feet.ends(clip.skeleton))
    for least in SHARES:
        held = np.broadcast_to(np.where(heavy, FEET, 1.0) * least, share.shape)
        up = np.maximum(share, held)
        level = held if aside else up
        part = refine(part, seen, tuple(joints), goal, np.stack([level, up, level], axis=-1))
    rotation, translation = clip.rotation.copy(), clip.translation.copy()
    rotation[moved], translation[moved] = part.rotation, part.translation
    return clip.with_motion(rotation, translation)
