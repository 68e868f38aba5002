"""Clips of one rig on each other's skeletons: the same joints, resting alike, on people of any size."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from interpose.clip import Clip, Skeleton
from interpose.errors import RequestError
from interpose.geometry import rotations
from interpose.resampling import resample
from interpose.skeletons import find_mapping
from interpose.skeletons.carrier import STILL, carriers, hips_of
from interpose.skeletons.humanoid import SHORT

SAME = np.radians(20.0)  # people of one rig differ by less in the directions of their bones
# And feet by less, or they would slide and sink: of 20 pairs of CMU's and HDM05's people whose toes rest 10
# degrees and more apart they slid in stances by half as much again as they do, and brought over as those of
# another rig by a fiftieth.
FOOT = np.radians(10.0)
SWAY = 0.1  # of its length: a bone that the positions of a joint lengthen, or turn, by less is one


def fit(clip: Clip, like: Clip) -> tuple[Clip, float]:
    """A clip on the skeleton and at the frame rate of another one, and what its way was multiplied with.

    Joints keep their local rotations, so their names (namespaces apart) and rest poses must be the same;
    bones may be of other lengths, also those of joints that have positions in every frame (`_kept`). Then
    places (of the hips, above the floor at height 0 and from where they begin, wherever a root that they hang
    from stays) go by the ratio of the legs: feet that stand still stand, and on the floor.

    Raises:
        RequestError: other joints, joints that rest differently or hang from others, or a joint that is
            moved against its parent and that `like` has no channel for.
    """
    order = _matched(clip, like)
    mine = like.skeleton
    rest, kept = clip.skeleton.rest_translation[order], _kept(like) & _kept(clip)[order]
    clip = resample(clip, like.fps, smooth=True)
    translation = np.empty((len(clip), len(like.translated), 3))
    for column, joint in enumerate(like.translated):
        own = order[joint]
        moves = own in clip.translated
        translation[:, column] = (
            clip.translation[:, clip.translated.index(own)] if moves else mine.rest_translation[joint]
        )
        bone = mine.rest_translation[joint]
        if kept[joint] and not np.allclose(rest[joint], bone, atol=STILL):
            # On a bone of another length; what it gives way by goes along.
            long = float(np.linalg.norm(rest[joint]))
            ratio = float(np.linalg.norm(bone)) / long if long > STILL else 1.0
            translation[:, column] = bone + ratio * (translation[:, column] - rest[joint])
    scale, beside = 1.0, list[int]()
    placed = [joint for joint in like.translated if order[joint] in clip.translated]
    inner = [joint for joint in range(len(mine)) if joint not in placed or kept[joint]]
    if not np.allclose(rest[inner], mine.rest_translation[inner], atol=STILL):
        bodies = find_mapping(clip.skeleton), find_mapping(mine)
        if all(body.usable for body in bodies):
            scale = bodies[0].scale / bodies[1].scale
            hips = bodies[1]["Hips"]
            assert hips is not None
            for joint in {hips, *mine.ancestors(hips)} & set(like.translated):
                column = like.translated.index(joint)
                pivot = translation[:1, column] * [1.0, 0.0, 1.0] * (mine.parents[joint] < 0)
                translation[:, column] = pivot + scale * (translation[:, column] - pivot)
            # Targets of feet and hands lie beside the body, as far as it is large.
            line = mine.below[:, hips] | mine.below[hips] | kept
            beside = [joint for joint in placed if not line[joint] and mine.parents[joint] >= 0]
            for joint in beside:
                translation[:, like.translated.index(joint)] *= scale
    fitted = replace(
        like, rotation=clip.rotation[:, order], translation=translation, name=clip.name, source=clip.source
    )
    return (fitted if scale == 1 else _from(clip, fitted, beside)), scale


def _from(clip: Clip, fitted: Clip, beside: list[int]) -> Clip:
    """`fitted` with hips, and what lies `beside` them, that begin over the same floor point as in the clip,
    below a root that stays."""
    top = carriers(fitted)[0]
    above = fitted.skeleton.parents[top]
    if above < 0 or not len(clip):
        return fitted
    begins, now = (some.slice(0, 1).positions()[0, hips_of(some.skeleton)] for some in (clip, fitted))
    skeleton, turned = fitted.skeleton, fitted.kinematics()[0]
    translation = fitted.translation.copy()
    for joint in (top, *beside):
        if not {*beside} & {*skeleton.ancestors(joint)} and top not in skeleton.ancestors(joint):
            back = rotations.conjugate(turned[:, skeleton.parents[joint]])
            shift = rotations.rotate(back, (begins - now) * [1.0, 0.0, 1.0])
            translation[:, fitted.translated.index(joint)] += shift / skeleton.scale_above[joint]
    return fitted.with_motion(fitted.rotation, translation)


def _bare(skeleton: Skeleton) -> Skeleton:
    """The skeleton without the namespace of a scene before its names: mixamorig1:Hips is Hips."""
    names = tuple(name.rpartition(":")[2] for name in skeleton.names)
    return replace(skeleton, names=names) if len({*names}) == len(names) and all(names) else skeleton


def _kept(clip: Clip) -> np.ndarray:
    """(J,) which joints below the hips have positions in every frame, and are about where they rest in 90 %.

    Some programs write positions of every joint: what does not move against its parent hangs on a bone.
    """
    skeleton, columns = clip.skeleton, list(clip.translated)
    kept = np.zeros(len(skeleton), bool)
    if len(clip):
        rest = skeleton.rest_translation[columns]
        off = np.percentile(np.linalg.norm(clip.translation - rest, axis=-1), 90, axis=0)
        kept[columns] = off < np.maximum(STILL, SWAY * np.linalg.norm(rest, axis=-1))
    hips = hips_of(skeleton)
    kept &= skeleton.below[:, hips]
    kept[hips] = False
    return kept


def shared(clip: Clip, like: Clip) -> list[tuple[int, int]]:
    """Joints of `like` below its hips, each with the one of the clip that has the same name: those that rest
    alike, on parents that do, too. Their local rotations mean the same, whatever the rigs are else."""
    mine, other = (_bare(some.skeleton) for some in (like, clip))
    pairs = [(own, other.names.index(name)) for own, name in enumerate(mine.names) if name in other.names]
    apart = _apart(like, clip, *(list(some) for some in zip(*pairs))) if pairs else np.empty(0)
    alike = {pair for pair, off in zip(pairs, apart) if off <= SAME}
    above = {(own, their): (mine.parents[own], other.parents[their]) for own, their in alike}
    below = mine.below[:, hips_of(like.skeleton)]
    return sorted(pair for pair in alike if above[pair] in alike and below[pair[0]])


def other_rig(clip: Clip, like: Clip) -> RequestError | None:
    """Why `fit` cannot take a clip as it is, or None if it can."""
    try:
        _matched(clip, like)
    except RequestError as error:
        return error
    return None


def _apart(like: Clip, clip: Clip, own: list[int], theirs: list[int]) -> np.ndarray:
    """(n,) radians by which each of the joints `own` of `like` rests away from that of the clip, `theirs`."""
    rest = np.stack([like.skeleton.rest_translation[own], clip.skeleton.rest_translation[theirs]])
    bones = rotations.between(*rest)
    # What moves against its parent rests nowhere, and what a short bone points at means nothing.
    long = (np.linalg.norm(rest, axis=-1) > SHORT).all(axis=0)
    told = _kept(like)[own] & _kept(clip)[theirs] & long
    bones[np.isin(own, like.translated) & np.isin(theirs, clip.translated) & ~told] = rotations.identity()
    turned = like.skeleton.rest_rotation[own], clip.skeleton.rest_rotation[theirs]
    return np.maximum(rotations.angle(*turned), rotations.angle(rotations.identity(), bones))


def _matched(clip: Clip, like: Clip) -> list[int]:
    """For each joint of `like` the same one of `clip`; RequestError where they are not the same."""
    mine, other = (_bare(some.skeleton) for some in (like, clip))
    what = f"{clip.name or 'a clip'} is on another skeleton than {like.name or 'the first one'}"
    fix = "Use clips of one character, or of others on the same rig."
    if odd := sorted({*mine.names} ^ {*other.names}):
        raise RequestError(what, f"joints that only one of them has: {', '.join(odd[:6])}", fix)
    order = [other.names.index(name) for name in mine.names]
    above, theirs = (
        [names[parent] if parent >= 0 else "" for parent in parents]
        for names, parents in (
            (mine.names, mine.parents),
            (other.names, [other.parents[joint] for joint in order]),
        )
    )
    apart = _apart(like, clip, list(range(len(mine))), order)
    bound = np.full(len(mine), SAME)
    body = find_mapping(like.skeleton)
    if body.usable and find_mapping(clip.skeleton).usable:  # else there is no other way to bring it over
        bound[[toe for side in ("Left", "Right") if (toe := body[side + "Toe"]) is not None]] = FOOT
    worst = int((apart / bound).argmax())
    if above != theirs:
        odd = [name for name, a, b in zip(mine.names, above, theirs) if a != b]
        raise RequestError(what, f"{odd[0]} hangs from another joint there", fix)
    if apart[worst] > bound[worst]:
        why = f"{mine.names[worst]} rests {np.degrees(apart[worst]):.0f} degrees away"
        raise RequestError(what, f"{why}, so that rotations mean something else", fix)
    for column, joint in enumerate(clip.translated):
        here = order.index(joint)
        if here not in like.translated and np.ptp(clip.translation[:, column], axis=0).max() > STILL:
            why = f"{other.names[joint]} moves against its parent in only one of them"
            raise RequestError(what, why, "Put the clip that moves it first.")
    return order
