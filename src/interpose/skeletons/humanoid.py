"""A clip's skeleton seen as the canonical humanoid, and back: numbers that mean the same everywhere."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from interpose.clip import Clip
from interpose.errors import RequestError
from interpose.geometry import kinematics, rotations
from interpose.skeletons.canonical import BONES, JOINTS, PARENTS
from interpose.skeletons.mapping import Mapping, find_mapping
from interpose.skeletons.rest import Rest, find_rest

LENGTHS = np.linalg.norm(BONES, axis=-1)  # of the canonical body
THIGHS = [JOINTS.index("LeftUpLeg"), JOINTS.index("RightUpLeg")]
SHORT = 0.01  # metres: what a shorter bone points at means nothing
SIDED = ("Left", "Right")
CLEAR = 0.04  # the sine of a bend of both knees together, in the mean: less tells nothing
AHEAD = 0.5  # how far toes point ahead, of two, in the mean: less tells nothing


@dataclass(frozen=True, eq=False)
class Humanoid:
    """The skeleton of a clip, mapped, with its T-pose.

    A canonical rotation is how a joint is turned from the T-pose, about the axes of the world. It is the
    joint's own global rotation times a constant, so the way there and back is exact.

    Some programs write left-handed axes: read as right-handed ones, the body is its own mirror image, whose
    knees bend forward, or whose toes point backwards. Such a clip is reflected on the way to canonical
    numbers, and back.

    Attributes:
        clip: the clip; its motion is looked at for what the skeleton itself does not tell.
        mapping: usable.
        given: the T-pose, where it is known already; else it is found when it is needed.
        frame: a frame of the clip that is a rest pose, where somebody says so.
    """

    clip: Clip
    mapping: Mapping
    given: Rest | None = None
    frame: int | None = None

    @cached_property
    def rest(self) -> Rest:
        """The T-pose, of the reflected skeleton if the clip is left-handed."""
        if self.given:
            return self.given
        clip = self._right(self.clip)
        return find_rest(replace(self.mapping, skeleton=clip.skeleton), clip, self.frame)

    @cached_property
    def left_handed(self) -> bool:
        """Whether the clip is its own mirror image: somebody says so, or its body shows it."""
        said = self.mapping.skeleton.roles.get("hand")
        return said == "left" if said else bool(inside_out(self.mapping, self.clip))

    @property
    def hand(self) -> np.ndarray:
        """(3,) what positions of the clip are multiplied with to give right-handed ones, and back."""
        return np.array([-1.0 if self.left_handed else 1.0, 1.0, 1.0])

    def _check(self) -> None:
        if not self.mapping.usable:
            raise RequestError(
                "the skeleton is no humanoid",
                f"nothing was found for {', '.join(self.mapping.lacking)}",
                "Say which joints they are: load(..., roles=...), or --map.",
            )

    def _right(self, clip: Clip) -> Clip:
        """A clip of this skeleton as a right-handed one."""
        return reflect(clip) if self.left_handed else clip

    @property
    def scale(self) -> float:
        """What positions are multiplied with to give them the canonical leg."""
        return self.mapping.scale

    def positions(self, clip: Clip) -> np.ndarray:
        """(F, 22, 3) canonical joints of a clip of this skeleton, in metres, unscaled, right-handed."""
        self._check()
        turned, placed = self._right(clip).kinematics()
        positions = np.einsum("cj,fjx->fcx", self.mapping.weights, placed)
        for row, (joint, bone) in self.mapping.levers.items():
            at = self._row(joint)
            inside = rotations.rotate(rotations.conjugate(self.rest.rotation[at]), bone)
            positions[:, row] = placed[:, joint] + rotations.rotate(turned[:, joint], inside)
        return positions

    def observed(self, positions: np.ndarray, rotation: np.ndarray) -> np.ndarray:
        """(F, 22): which canonical positions follow from known positions and local rotations (F, J)."""
        known = (~positions).astype(float) @ (self.mapping.weights.T > 0) == 0
        for row, (joint, _) in self.mapping.levers.items():
            known[:, row] = positions[:, joint] & rotation[:, joint]
        return known

    def rotations(self, clip: Clip) -> np.ndarray:
        """(F, 22, 4) canonical rotations of a clip; missing joints turn with their parents."""
        self._check()
        turned = self._right(clip).kinematics()[0]
        rows, joints = self.mapping.mapped
        canonical = np.zeros((len(clip), len(JOINTS), 4))
        canonical[:, rows] = rotations.multiply(
            turned[:, joints], rotations.conjugate(self.rest.rotation[list(rows)])
        )
        for row, joint in enumerate(self.mapping.joints):
            if joint is None:
                canonical[:, row] = canonical[:, PARENTS[row]]
        return canonical

    def root(self, clip: Clip) -> np.ndarray:
        """(F, 3) where the hips are, in metres, unscaled."""
        self._check()
        joint = self.mapping["Hips"]
        assert joint is not None
        return clip.positions()[:, joint] * self.hand

    @cached_property
    def bones(self) -> np.ndarray:
        """(22, 3) metres, unscaled: where each canonical joint lies from its parent in the T-pose.

        The skeleton's own proportions; where joints between two canonical ones move, as they lie on average.
        """
        clip = self.clip if len(self.clip) else None
        if clip is None:
            return BONES / self.scale
        step = max(1, len(clip) // 200)
        some = clip.take(slice(None, None, step))
        points, turned = self.positions(some), self.rotations(some)
        bones = np.zeros((len(JOINTS), 3))
        for row, parent in enumerate(PARENTS):
            if parent >= 0:
                away = points[:, row] - points[:, parent]
                bones[row] = rotations.rotate(rotations.conjugate(turned[:, parent]), away).mean(axis=0)
        return bones

    @cached_property
    def body(self) -> np.ndarray:
        """(22, 3) metres: bones, in the T-pose, of the body on which networks see this skeleton's motion.

        All bones are as long for everyone. Where the T-pose is a real pose they also point as everyone's do:
        what differs there is how skeletons are modelled. Where it was worked out from motion they point as
        the skeleton's own do, so that what was worked out does not matter.
        """
        if self.rest.how not in ("motion", "rig"):
            return BONES
        length = np.linalg.norm(self.bones, axis=-1, keepdims=True)
        return np.where(length > SHORT, self.bones * (LENGTHS[:, None] / np.maximum(length, SHORT)), BONES)

    def as_canonical(self, clip: Clip) -> np.ndarray:
        """(F, 22, 3) metres: the motion on the canonical body; it stands where the clip's legs do."""
        turned = self.rotations(clip)
        placed = self.positions(clip) * self.scale
        return canonical_positions(turned, _hips_above(placed, turned[:, 0], self.body), self.body)

    def from_canonical(self, points: np.ndarray, like: np.ndarray) -> np.ndarray:
        """The inverse of `as_canonical`: points (F, 22, 3) of the canonical body as those of this one.

        Points do not tell how bones are twisted, nor exactly how a body of other proportions holds itself:
        what they leave open is as in `like`, canonical rotations (F, 22, 4) of about the same motion.

        Returns:
            (F, 22, 3) metres, in the clip's own axes.
        """
        turned = pose_of(points, like, self.body)
        root = _hips_above(points / self.scale, turned[:, 0], self.bones)
        return canonical_positions(turned, root, self.bones) * self.hand

    def root_over(self, points: np.ndarray, turned: np.ndarray) -> np.ndarray:
        """(F, 3) metres: where hips turned by (F, 4) must be for thighs to hang where they do in canonical
        points (F, 22, 3), right-handed."""
        return _hips_above(points, turned, self.bones)

    def to_clip(self, canonical: np.ndarray, root: np.ndarray, like: Clip) -> Clip:
        """A clip of this skeleton from canonical rotations (F, 22, 4) and the place of the hips (F, 3).

        The inverse of `rotations` and `root`. Joints that are not canonical keep the local rotations and
        translations of `like`, a clip of this skeleton and as long.
        """
        if self.left_handed:
            right = self._right(like)
            # It is said: motion that makes no sense may look like the mirror image of some either way.
            skeleton = replace(right.skeleton, roles={**right.skeleton.roles, "hand": "right"})
            own = Humanoid(right, replace(self.mapping, skeleton=skeleton), self.rest)
            done = reflect(own.to_clip(canonical, root, right))
            return like.with_motion(done.rotation, done.translation)
        skeleton = self.mapping.skeleton
        rows, joints = self.mapping.mapped
        row_of = dict(zip(joints, rows))
        rotation, turned = like.rotation.copy(), np.empty_like(like.rotation)
        for joint, parent in enumerate(skeleton.parents):
            if joint in row_of:
                own = rotations.multiply(canonical[:, row_of[joint]], self.rest.rotation[row_of[joint]])
                turned[:, joint] = own
                above = rotations.conjugate(turned[:, parent]) if parent >= 0 else None
                rotation[:, joint] = own if above is None else rotations.multiply(above, own)
            elif parent >= 0:
                turned[:, joint] = rotations.multiply(turned[:, parent], rotation[:, joint])
            else:
                turned[:, joint] = rotation[:, joint]
        moved = like.with_motion(rotation, like.translation.copy())
        hips = self.mapping["Hips"]
        assert hips is not None
        carrier = next(j for j in (hips, *skeleton.ancestors(hips)) if j in like.translated)
        shift = root - moved.positions()[:, hips]
        above = skeleton.parents[carrier]
        if above >= 0:
            shift = rotations.rotate(rotations.conjugate(turned[:, above]), shift)
        moved.translation[:, like.translated.index(carrier)] += shift / skeleton.scale_above[carrier]
        return moved

    def _row(self, joint: int) -> int:
        rows, joints = self.mapping.mapped
        return rows[joints.index(joint)]


def _hips_above(placed: np.ndarray, turned: np.ndarray, bones: np.ndarray) -> np.ndarray:
    """(F, 3) where hips turned by (F, 4) must be for thighs to hang where they do in points (F, 22, 3).

    Hips are a hand above the thighs in some skeletons and level with them in others: bones (22, 3) say it.
    """
    return placed[:, THIGHS].mean(axis=1) - rotations.rotate(turned, bones[THIGHS].mean(axis=0))


def pose_of(points: np.ndarray, like: np.ndarray, bones: np.ndarray) -> np.ndarray:
    """(F, 22, 4) canonical rotations near `like`: those of a body with bones (22, 3) at points (F, 22, 3)."""
    turned = like.copy()
    for joint in range(len(JOINTS)):
        below = [child for child, parent in enumerate(PARENTS) if parent == joint]
        if not below:
            # What ends here goes on like what it hangs from.
            parent = PARENTS[joint]
            turn = rotations.multiply(turned[:, parent], rotations.conjugate(like[:, parent]))
        else:
            own = rotations.rotate(like[:, joint, None], bones[below])
            way = points[:, below] - points[:, joint, None]
            turn = rotations.between(own[:, 0], way[:, 0]) if len(below) == 1 else rotations.fit(own, way)
        turned[:, joint] = rotations.multiply(turn, like[:, joint])
    return turned


def reflect(clip: Clip) -> Clip:
    """The clip seen in a mirror at X = 0, with its local axes: left stays left, handedness changes."""
    turn, move = np.array([1.0, 1.0, -1.0, -1.0]), np.array([-1.0, 1.0, 1.0])
    skeleton = replace(
        clip.skeleton,
        rest_translation=clip.skeleton.rest_translation * move,
        rest_rotation=clip.skeleton.rest_rotation * turn,
    )
    return replace(
        clip,
        skeleton=skeleton,
        rotation=clip.rotation * turn,
        translation=clip.translation * move,
        source=None,
    )


def inside_out(mapping: Mapping, clip: Clip) -> str:
    """What shows that a clip is its own mirror image, in the mean over it: "its knees bend forward", as seen
    from left and right, or, where they are straight, "its toes point backwards"; "" where nothing does."""
    if not mapping.usable or len(clip) == 0:
        return ""
    step = max(1, len(clip) // 100)
    placed = clip.take(slice(None, None, step)).positions()
    points = np.einsum("cj,fjx->fcx", mapping.weights, placed)

    def way(start: str, end: str) -> np.ndarray:
        return rotations.normalize(points[:, JOINTS.index(end)] - points[:, JOINTS.index(start)])

    across = way("RightUpLeg", "LeftUpLeg")
    bends = [np.cross(way(s + "UpLeg", s + "Leg"), way(s + "Leg", s + "Foot")) for s in SIDED]
    bend = (sum(bends) * across).sum(-1).mean()
    if abs(bend) > CLEAR:
        return "its knees bend forward" if bend < 0 else ""
    if any(JOINTS.index(side + "Toe") in mapping.levers for side in SIDED):
        return ""
    # A T-pose: its legs, upside down, are what points up.
    ahead = np.cross(across, sum(way(side + "Foot", side + "UpLeg") for side in SIDED))
    toes = sum((way(side + "Foot", side + "Toe") * rotations.normalize(ahead)).sum(-1) for side in SIDED)
    return "its toes point backwards" if np.mean(toes) < -AHEAD else ""


def canonical_positions(rotation: np.ndarray, root: np.ndarray, bones: np.ndarray) -> np.ndarray:
    """Forward kinematics of the canonical humanoid.

    Args:
        rotation: (F, 22, 4) canonical rotations: global, relative to the T-pose.
        root: (F, 3) the hips.
        bones: (22, 3) or (F, 22, 3) bones in the T-pose.

    Returns:
        (F, 22, 3) positions, in the units of the bones.
    """
    return kinematics.forward(
        kinematics.local_rotations(rotation, PARENTS),
        np.where(np.arange(len(JOINTS))[:, None] == 0, root[:, None], bones),
        PARENTS,
    )[1]


def find_humanoid(clip: Clip, rest: Rest | None = None, frame: int | None = None) -> Humanoid:
    """The skeleton of a clip as a humanoid; look at `mapping` for how far it went.

    Args:
        clip: its motion tells what the skeleton leaves open (handedness, the T-pose where the zero pose is
            none), so all of it should be real.
        rest: the T-pose, when more is known of it than this clip tells (from other clips of the same rig).
        frame: a frame of the clip that is a rest pose.
    """
    return Humanoid(clip, find_mapping(clip.skeleton), rest, frame)
