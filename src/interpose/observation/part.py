"""Poses of single joints that another clip gives, inside of a gap."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from interpose.clip import Clip
from interpose.errors import RequestError, unfit
from interpose.geometry import rotations
from interpose.geometry.ground import UP
from interpose.observation.observation import Observation, frame_number, joint_names
from interpose.skeletons.carrier import hips_of
from interpose.skeletons.fitting import SAME
from interpose.skeletons.humanoid import find_humanoid
from interpose.skeletons.mapping import find_mapping

EASED = 0.2  # seconds that it takes to lead from one motion to another


@dataclass(frozen=True)
class Part:
    """Local rotations of some joints over some frames of another clip.

    Where they begin, or end, beside frames of the completed clip that are known, or that another part gives,
    EASED seconds of them lead from the one motion to the other.

    Attributes:
        clip: the other clip; its skeleton has the joints under the same names and with the same rest pose,
            or it is brought onto the rig that does (`tasks.fill`).
        start, stop: its frames start to stop - 1.
        at: the frame of the completed clip at which they begin.
        joints: names.
    """

    clip: Clip
    start: int
    stop: int
    at: int
    joints: tuple[str, ...]

    def __post_init__(self) -> None:
        fill = object.__setattr__
        for side in ("start", "stop", "at"):
            fill(self, side, frame_number(getattr(self, side)))
        fill(self, "joints", tuple(dict.fromkeys(joint_names(self.joints))))
        if not self.joints:
            why = "it names no joints"
            raise RequestError("nothing is laid into the clip", why, 'Name some: ("LeftArm", "LeftHand").')
        if not isinstance(self.clip, Clip):
            raise unfit("clip", self.clip, "a clip: interpose.load reads one")


def lay(clip: Clip, observation: Observation, parts: Iterable[Part]) -> tuple[Clip, Observation]:
    """The clip with the parts in it, and the observation that knows them.

    Where the body that a part hangs on is known it points where it does in the other clip, as seen from where
    the hips face: an arm that waves over the head does so on a trunk that leans, too. Shoulder blades keep
    their local rotations, as they hardly move on a trunk, and so does a part whose body is yet to be filled.

    Raises:
        RequestError: frames or joints that are not there, a part that reaches out of the gaps, another frame
            rate, or joints that rest differently.
    """
    rotation, known = clip.rotation.copy(), observation.rotation.copy()
    given = np.zeros_like(known)
    # Of two that adjoin the later one leads on from the other, in whatever order they are named.
    for part in sorted(parts, key=lambda part: part.at):
        _check(clip, observation, part)
        to = slice(part.at, part.at + part.stop - part.start)
        for name in part.joints:
            here, there = clip.skeleton.index(name), part.clip.skeleton.index(name)
            if given[to, here].any():
                why = f"two parts give it in the frames {to.start}:{to.stop}, or in some of them"
                raise RequestError(f"there are two poses of {name}", why, "Give one of them.")
            given[to, here] = True
            rotation[to, here] = part.clip.rotation[part.start : part.stop, there]
            known[_apart(part, known[:, here], clip.fps), here] = True
        _hung(rotation, clip, observation, part)
    laid = Observation(known, observation.translation, observation.pins)
    return clip.with_motion(rotation, clip.translation), laid


def _apart(part: Part, known: np.ndarray, fps: float) -> slice:
    """The frames of a part but for those that lead to where its joint is `known` (F,)."""
    start, stop = part.at, part.at + part.stop - part.start
    over = min(max(2, round(EASED * fps)), (stop - start - 1) // 2)
    begins, ends = start > 0 and known[start - 1], stop < len(known) and known[stop]
    return slice(start + over * int(begins), stop - over * int(ends))


def _hung(rotation: np.ndarray, clip: Clip, observation: Observation, part: Part) -> None:
    """Turn the topmost joints of a part, in `rotation` (F, J, 4), as `lay` says."""
    to, skeleton = slice(part.at, part.at + part.stop - part.start), clip.skeleton
    hips, mapping = hips_of(skeleton), find_mapping(skeleton)
    blades = {mapping["LeftShoulder"], mapping["RightShoulder"]}
    laid = [skeleton.index(name) for name in part.joints]
    joints = {*laid} - blades
    tops = [
        joint
        for joint in joints
        if hips in (above := skeleton.ancestors(joint))
        and not joints & {*above}
        and (observation.rotation[to, [*above]].all(axis=0) | np.isin(above, laid)).all()
    ]
    if not tops:
        return
    own = clip.with_motion(rotation, clip.translation).slice(to.start, to.stop)
    others = part.clip.slice(part.start, part.stop)
    here, there, other = own.kinematics()[0], others.kinematics()[0], others.skeleton
    between = rotations.multiply(_ahead(own), rotations.conjugate(_ahead(others)))
    for joint in tops:
        aims = rotations.multiply(between, there[:, other.index(skeleton.names[joint])])
        parent = here[:, skeleton.parents[joint]]
        rotation[to, joint] = rotations.normalize(rotations.relative(parent, aims))


def _ahead(clip: Clip) -> np.ndarray:
    """(F, 4) by how much hips are turned about the vertical.

    Of a humanoid since its T-pose: LAFAN1's hip joints rest on their side, so that to lean is to turn them
    about the vertical, too. (The line of the hips flips where a body rolls over.)
    """
    if find_mapping(clip.skeleton).usable:
        body = find_humanoid(clip)
        # The file's own turns may be those of the mirror image.
        turned = body.rotations(clip)[:, 0] * [1.0, 1.0, body.hand[0], body.hand[0]]
    else:
        turned = clip.kinematics()[0][:, hips_of(clip.skeleton)]
    return rotations.twist_about(turned, UP.values)


def _check(clip: Clip, observation: Observation, part: Part) -> None:
    if not 0 <= part.start < part.stop <= len(part.clip):
        raise RequestError(
            f"there are no frames {part.start}:{part.stop} in the other clip",
            f"it has {len(part.clip)} frames",
            f"Choose some of 0:{len(part.clip)}.",
        )
    if abs(part.clip.fps - clip.fps) > 0.01:
        raise RequestError(
            "the two clips have different frame rates",
            f"one has {clip.fps:g} and the other {part.clip.fps:g} frames a second",
            "Bring the other one to the same rate first: interpose.resample, or interpose convert --fps.",
        )
    stop = part.at + part.stop - part.start
    joints = [clip.skeleton.index(name) for name in part.joints]
    if part.at < 0 or stop > len(clip) or observation.rotation[part.at : stop, joints].any():
        raise RequestError(
            f"the frames {part.at}:{stop} do not lie in a gap",
            "joints of another clip can only be used where those of this one are missing",
            "Move them (--at, or at=), take fewer (--from-range, or stop=), or make the gap longer.",
        )
    if odd := misfits(clip, part):
        raise RequestError(
            f"{odd[0]} rests differently in the two clips",
            "its rotations mean something else there",
            "Use a clip of the same character.",
        )


def misfits(clip: Clip, part: Part) -> list[str]:
    """The joints of a part that the clip of it does not have, or that rest differently there."""
    there = part.clip.skeleton.names
    return [name for name in part.joints if name not in there or _rests(clip, name, part.clip) > SAME]


def _rests(clip: Clip, name: str, other: Clip) -> float:
    """How differently a joint rests in two clips, in radians: its own rotation, and its bones."""
    one, two = clip.skeleton, other.skeleton
    a, b = one.index(name), two.index(name)
    worst = float(rotations.angle(one.rest_rotation[a], two.rest_rotation[b]))
    for child, parent in enumerate(one.parents):
        if parent == a and one.names[child] in two.names:
            bones = [s.rest_translation[s.index(one.names[child])] for s in (one, two)]
            worst = max(worst, float(rotations.angle(rotations.identity(), rotations.between(*bones))))
    return worst
