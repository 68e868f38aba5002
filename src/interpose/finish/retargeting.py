"""The motion of one skeleton on another: what lets clips of different rigs be laid one after another.

Bodies hold themselves alike: every joint is turned from its T-pose as the same joint of the other body is.
Ways and heights go by the lengths of the legs, and the legs bend until the toes are where that puts them: who
stands on the ball of a foot still does, however long the foot is.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from interpose.clip import Clip
from interpose.errors import RequestError
from interpose.finish.clearing import cleared
from interpose.finish.feet import Leg, ends, legs, reach
from interpose.finish.floor import higher
from interpose.finish.windows import ramp, rounded, spread
from interpose.geometry import measures, rotations
from interpose.methods.bodies import RESTS
from interpose.observation import Observation
from interpose.skeletons import BONES, JOINTS, PARENTS, Humanoid, find_humanoid, find_mapping
from interpose.skeletons.carrier import rooted
from interpose.skeletons.fitting import fit, other_rig, shared
from interpose.skeletons.humanoid import SHORT
from interpose.skeletons.targets import seated

# Metres, of a body with the canonical leg: so far from RESTS do toes rest in one rig or another. Stances tell
# it: toes slower than this (metres a second), for so many seconds.
LEVEL, SLOW, SECONDS = 0.05, 0.15, 0.3
# The share of its length to which a leg may be stretched (or as far as it is already) before the hips sink;
# the bound is rounded off by the second (metres), and comes and goes over so many seconds.
TAUT, ROUND, OVER = 0.98, 0.005, 0.15
# The cosine of what a leg leans by: hips sink for none beyond the first, and fully from the second on.
UPRIGHT = (0.5, 0.8)
# Metres above the floor from which on it does not matter how high a joint is that belongs to no foot.
NEAR = 0.1
# Bones of the trunk up to the neck, those to the thighs, and the joints below the chest.
TRUNK = [JOINTS.index(name) for name in ("Spine", "Spine1", "Spine2", "Neck")]
THIGHS = [JOINTS.index(name) for name in ("LeftUpLeg", "RightUpLeg")]
LOWER = [JOINTS.index(name) for name in ("Hips", "Spine", "Spine1")]
NECK, HEAD = JOINTS.index("Neck"), JOINTS.index("Head")


def retarget(clip: Clip, like: Clip) -> Clip:
    """The motion of a clip on the skeleton of another one.

    Clips of one rig, people's sizes apart, keep the local rotations of all joints. Else joints that are not
    among the 22 canonical ones (fingers, twists) do so where they have the same name and rest alike, and are
    as in `like` in the mean where they do not; a root above the hips goes and turns along, and targets sit on
    feet and hands, as they do there. Floors are at height 0, and clips
    begin over the same floor point.

    Args:
        clip: F frames of a humanoid.
        like: a clip of another humanoid: its skeleton, and the layout of its file.

    Returns:
        F frames at the rate of `clip`.

    Raises:
        RequestError: the rigs differ, and one of them is no humanoid, or its T-pose cannot be found.
    """
    on_rig = on_rig_of(clip, like)
    return replace(fit(on_rig, replace(like, fps=clip.fps))[0], source=like.source)


def on_rig_of(clip: Clip, like: Clip) -> Clip:
    """The clip itself where its rig is that of `like`, people's sizes apart; else its motion on that rig.

    Raises:
        RequestError: as `retarget`.
    """
    error = other_rig(clip, like)
    if error is None:
        return clip
    for one in (clip, like):
        if lacking := find_mapping(one.skeleton).lacking:
            raise RequestError(
                error.what,
                f"{error.why}; and {one.name or 'one of them'} is no humanoid, whose motion could be brought"
                f" onto other rigs: nothing was found for {', '.join(lacking)}",
                "Name its joints, load(..., roles=...) or --map, or use clips of one rig.",
            )
        if not len(one):
            what = f"cannot bring {clip.name or 'a clip'} onto another rig"
            raise RequestError(what, f"{one.name or 'one of them'} has no frames", "Take others.")
    return _brought(clip, like)


def common(clip: Clip, like: Clip) -> set[str]:
    """The names of the joints of `like` that the motion of a clip of another rig tells of."""
    theirs, mine = find_mapping(clip.skeleton), find_mapping(like.skeleton)
    both = zip(theirs.joints, mine.joints)
    return {like.skeleton.names[own] for other, own in both if own is not None and other is not None}


def _brought(clip: Clip, like: Clip) -> Clip:
    """`retarget` between different rigs."""
    theirs, mine = find_humanoid(clip), find_humanoid(like)
    points = theirs.positions(clip) * theirs.scale
    turned = _nodded(theirs.rotations(clip), points, theirs, mine)
    turned = _leant(turned, points, theirs, mine)
    toes = all(
        body.mapping[side + "Toe"] is not None for body in (theirs, mine) for side in ("Left", "Right")
    )
    tips = [JOINTS.index(side + ("Toe" if toes else "Foot")) for side in ("Left", "Right")]
    points[..., 1] += _rests(mine, like, tips) - _rests(theirs, clip, tips)
    # Who stands higher on the same toes has the hips higher, too.
    over = (_instep(mine) - _instep(theirs)) * toes
    points /= mine.scale
    held = rotations.normalize(rotations.continuous(like.rotation).mean(axis=0))
    frames = len(clip), 1, 1
    held = np.tile(held, frames)
    if theirs.left_handed == mine.left_handed:
        for own, other in shared(clip, like):  # of which all stay that are not canonical
            held[:, own] = clip.rotation[:, other]
    base = like.with_motion(held, np.tile(like.translation.mean(axis=0), frames))
    base = replace(base, fps=clip.fps)
    root, goals = mine.root_over(points, turned[:, 0]), points[:, tips] * mine.hand
    # Ways go by the legs from where they begin, so that who starts beside something still does.
    begins = (theirs.root(clip)[0] - root[0]) * [1.0, 0.0, 1.0]
    root, goals = root + begins, goals + begins * mine.hand
    root[:, 1] += over / mine.scale
    made = mine.to_clip(turned, root, base)
    root[:, 1] -= _sunk(made, goals, toes)
    made = mine.to_clip(turned, root, base)
    for leg in legs(made.skeleton):
        rotation = reach(made.skeleton, leg, made.rotation, *made.kinematics(), _foot(made, leg, goals, toes))
        made = made.with_motion(rotation, made.translation)
    made = cleared(_laid(made, mine, points), clip, mine, theirs)
    # A root above the hips goes and turns along, and targets stay on feet and hands, if they do so in the
    # other clip.
    like = replace(like, fps=clip.fps)
    whole = like.joined([like, made])
    known = np.tile((np.arange(len(whole)) < len(like))[:, None], len(like.skeleton))
    whole = seated(rooted(whole, known, known, len(like)), known, known)
    done = whole.slice(len(like), len(whole))
    return replace(done, fps=clip.fps, name=clip.name, source=None)


def _nodded(turned: np.ndarray, points: np.ndarray, theirs: Humanoid, mine: Humanoid) -> np.ndarray:
    """Canonical rotations (F, 22, 4) with a neck that points where that of points (F, 22, 3) does, and a head
    that goes along: zero poses hold their necks by up to 35 degrees differently."""
    both = all(body.mapping[name] is not None for body in (theirs, mine) for name in ("Neck", "Head"))
    way = points[:, HEAD] - points[:, NECK]
    if not both or min(np.linalg.norm(way, axis=-1).min(), np.linalg.norm(mine.bones[HEAD])) < SHORT:
        return turned
    nod = rotations.between(rotations.rotate(turned[:, NECK], mine.bones[HEAD]), way)
    done = turned.copy()
    done[:, [NECK, HEAD]] = rotations.multiply(nod[:, None], turned[:, [NECK, HEAD]])
    return done


def _leant(turned: np.ndarray, points: np.ndarray, theirs: Humanoid, mine: Humanoid) -> np.ndarray:
    """Canonical rotations (F, 22, 4) with hips and lower spine that lean the trunk, from the thighs to the
    neck, as that of points (F, 22, 3) leans; the chest stays turned as it is.

    Rigs bend at other heights: one whose spine begins at the hips bends there, one whose hips reach up to the
    waist does not, and would pick nothing up. In frames that lean by more than 40 degrees trunks of 50 pairs
    of clip and rig are 2.6 to 5.9 degrees off so, by rig, and 6.4 to 13.1 where joints turn alike alone.
    """
    built = [body.bones[TRUNK].sum(axis=0) - body.bones[THIGHS].mean(axis=0) for body in (theirs, mine)]
    way = points[:, NECK] - points[:, THIGHS].mean(axis=1)
    if min(*(np.linalg.norm(trunk) for trunk in built), np.linalg.norm(way, axis=-1).min()) < SHORT:
        return turned
    # In the T-pose trunks may lean differently, as the bodies are built.
    own, asked = (rotations.rotate(turned[:, 0], np.broadcast_to(trunk, way.shape)) for trunk in built)
    asked = rotations.normalize(rotations.rotate(rotations.between(own, way), asked))
    *low, upper = (
        rotations.rotate(turned[:, PARENTS[joint]], np.broadcast_to(mine.bones[joint], way.shape))
        for joint in TRUNK
    )
    thighs = np.broadcast_to(mine.bones[THIGHS].mean(axis=0), way.shape)
    lower = np.sum(low, axis=0) - rotations.rotate(turned[:, 0], thighs)
    # The lower part ends where the upper one, as it is, leads on to the line that is asked for.
    along = np.einsum("fc,fc->f", asked, upper)
    over = along**2 - (upper**2).sum(axis=-1) + (lower**2).sum(axis=-1)
    far = along + np.sqrt(np.maximum(over, 0.0))
    bend = rotations.between(lower, far[:, None] * asked - upper)
    done = turned.copy()
    done[:, LOWER] = rotations.multiply(bend[:, None], turned[:, LOWER])
    return done


def _rests(body: Humanoid, clip: Clip, ends: list[int]) -> float:
    """Metres of a body with the canonical leg: how high toes, or ankles, are over the floor they stand on.

    By how high they are while they stand still about there; what stands elsewhere stands on something.
    """
    toes = JOINTS[ends[0]].endswith("Toe")
    usual = RESTS if toes else RESTS - float(BONES[JOINTS.index("LeftToe"), 1])
    points = body.positions(clip)[:, ends] * body.scale
    if len(points) < 2:
        return usual
    height = points[..., 1]
    stands = (measures.speed(points, clip.fps) < SLOW) & (np.abs(height - usual) < LEVEL)
    return float(np.median(height[stands])) if stands.sum() > SECONDS * clip.fps else usual


def _instep(body: Humanoid) -> float:
    """Metres of a body with the canonical leg: how high ankles are over toes in the T-pose."""
    toes = [JOINTS.index("LeftToe"), JOINTS.index("RightToe")]
    return float(-body.bones[toes, 1].mean() * body.scale)


def _foot(clip: Clip, leg: Leg, goals: np.ndarray, toes: bool) -> np.ndarray:
    """(F, 2, 3) where ankle and toe are to be, turned as they are, for toes, or ankles, to be at the goals of
    both legs (F, 2, 3)."""
    feet = clip.positions()[:, leg.foot]
    return np.asarray(feet + (goals[:, leg.side] - feet[:, int(toes)])[:, None])


def _laid(clip: Clip, body: Humanoid, points: np.ndarray) -> Clip:
    """The clip with joints of who lies, crawls or kneels as high above the floor as `points` (F, 22, 3) are:
    with other proportions arms and thighs would go through it."""
    rows, joints = (list(some) for some in body.mapping.mapped)
    theirs, own = points[:, rows, 1], clip.positions()[:, joints, 1]
    deep = np.where(np.isin(joints, ends(clip.skeleton)), -1.0, np.minimum(theirs, NEAR) - own)
    size, over = 1.0 / body.scale, OVER * clip.fps
    lift = np.array([spread(rounded(column, ROUND), over) for column in deep.T / size]).T
    nothing = np.zeros((len(clip), len(clip.skeleton)), bool)
    return higher(clip, Observation(nothing, nothing), joints, size * lift)


def _sunk(clip: Clip, goals: np.ndarray, toes: bool) -> np.ndarray:
    """(F,) metres by which the hips sink for legs not to be stretched; arguments as in `_foot`."""
    placed, short = clip.positions(), np.full(len(clip), -np.inf)
    for leg in legs(clip.skeleton):
        hip, knee, ankle = (placed[:, joint] for joint in (leg.thigh, leg.knee, leg.ankle))
        length = np.linalg.norm(knee - hip, axis=-1) + np.linalg.norm(ankle - knee, axis=-1)
        own = np.linalg.norm(ankle - hip, axis=-1)
        there = _foot(clip, leg, goals, toes)[:, 0] - hip
        asked = np.linalg.norm(there, axis=-1)
        # A leg that lies is no shorter for hips that sink.
        upright = ramp((-there[:, 1] / asked - UPRIGHT[0]) / (UPRIGHT[1] - UPRIGHT[0]))
        short = np.maximum(short, upright * (asked - np.maximum(own, TAUT * length)))
    return spread(rounded(short, ROUND), OVER * clip.fps) if np.isfinite(short).all() else np.zeros(len(clip))
