"""The motion of one skeleton on another: what lets clips of different rigs be laid one after another.

Bodies hold themselves alike: every joint is turned from its T-pose as the same joint of the other body is.
Ways and heights go by the lengths of the legs, and the legs are bent until the feet are where that puts them,
so that feet that stand still stand still, and on the floor.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from interpose.clip import Clip
from interpose.finish.feet import legs, reach
from interpose.geometry import rotations
from interpose.observation.timeline import Placement, joined, other_rig
from interpose.skeletons import JOINTS, Humanoid, find_humanoid, find_mapping
from interpose.skeletons.carrier import carriers, rooted

LOW = 10  # percent of the frames in which a body's lowest joint is below what counts as the floor


def on_rig_of(clip: Clip, like: Clip) -> Clip:
    """The clip itself where its rig is that of `like`, people's sizes apart; else its motion on that rig.

    Raises:
        RequestError: the rigs differ, and one of them is no humanoid.
    """
    error = other_rig(clip, like)
    if error is None:
        return clip
    if not all(find_mapping(some.skeleton).usable for some in (clip, like)):
        raise error
    return retarget(clip, like)


def retarget(clip: Clip, like: Clip) -> Clip:
    """The motion of a clip on the skeleton of another one.

    Joints that are not among the 22 canonical ones (fingers, twists, targets) are as in `like` in the mean.
    The floor is where `like` has its own, a root above the hips goes along if it does so there.

    Args:
        clip: F frames of a humanoid.
        like: a clip of another humanoid: its skeleton, the layout of its file, and where its floor is.

    Returns:
        F frames at the rate of `clip`.

    Raises:
        RequestError: one of the skeletons is no humanoid, or its T-pose cannot be found.
    """
    theirs, mine = find_humanoid(clip), find_humanoid(like)
    turned = theirs.rotations(clip)
    placed = theirs.positions(clip) * theirs.scale / mine.scale
    held = rotations.normalize(rotations.continuous(like.rotation).mean(axis=0))
    base = like.with_motion(
        np.tile(held, (len(clip), 1, 1)), np.tile(like.translation.mean(axis=0), (len(clip), 1, 1))
    )
    made = mine.to_clip(turned, mine.root_over(placed, turned[:, 0]), base)
    made = _with_legs(made, placed * mine.hand, mine)
    joints = list(mine.mapping.mapped[1])
    rise = np.array([0.0, _floor(like, joints) - _floor(made, joints), 0.0])
    whole = joined(like, [like, Placement(shift=tuple(rise)).of(made, carriers(made))])
    known = np.arange(len(whole)) < len(like)
    done = rooted(whole, np.tile(known[:, None], len(like.skeleton))).slice(len(like), len(whole))
    return replace(done, fps=clip.fps, name=clip.name)


def _with_legs(clip: Clip, points: np.ndarray, body: Humanoid) -> Clip:
    """The clip with legs that reach the ankles of canonical points (F, 22, 3), feet turned as they are."""
    for leg in legs(clip.skeleton):
        turned, placed = clip.kinematics()
        feet = placed[:, leg.foot]
        goal = points[:, JOINTS.index(("LeftFoot", "RightFoot")[leg.side]), None] + feet - feet[:, :1]
        rotation = reach(clip.skeleton, leg, clip.rotation, turned, placed, goal)
        clip = clip.with_motion(rotation, clip.translation)
    return clip


def _floor(clip: Clip, joints: list[int]) -> float:
    """Metres: how high the lowest of some joints is where they are lowest."""
    return float(np.percentile(clip.positions()[:, joints, 1].min(axis=1), LOW))
