"""Which of a skeleton's joints are the 22 canonical ones, found by a table of names."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from interpose.clip import Skeleton
from interpose.skeletons.canonical import JOINTS, LEG_LENGTH

# Left-hand names; the right-hand ones follow. Spelling is compared in lower case, without prefix and
# punctuation. The first name of a line that a skeleton has is taken.
NAMES: dict[str, tuple[str, ...]] = {
    "Hips": ("hips", "hip", "pelvis", "root"),
    "LeftUpLeg": ("leftupleg", "leftupperleg", "leftthigh", "upperlegl", "thighl", "lfemur", "lefthip"),
    "LeftLeg": ("leftleg", "leftlowerleg", "leftshin", "lowerlegl", "calfl", "ltibia", "leftknee"),
    "LeftFoot": ("leftfoot", "footl", "lfoot", "leftankle"),
    "LeftToe": ("lefttoe", "lefttoebase", "toesl", "balll", "ltoes", "lefttoes"),
    "Neck": ("neck1", "neck", "neck01", "lowerneck"),
    "Head": ("head",),
    "LeftShoulder": ("leftshoulder", "leftcollar", "shoulderl", "claviclel", "lclavicle"),
    "LeftArm": ("leftarm", "leftupperarm", "upperarml", "lhumerus"),
    "LeftForeArm": ("leftforearm", "leftlowerarm", "lowerarml", "leftelbow", "lradius"),
    "LeftHand": ("lefthand", "handl", "lhand", "leftwrist", "lwrist"),
}


def _right(name: str) -> str:
    if name.startswith("left"):
        return "right" + name[4:]
    return "r" + name[1:] if name.startswith("l") and not name.startswith("lower") else name[:-1] + "r"


def _table() -> dict[str, tuple[str, ...]]:
    table = dict(NAMES)
    for joint, names in NAMES.items():
        if joint.startswith("Left"):
            table["Right" + joint[4:]] = tuple(_right(name) for name in names)
    return table


def _plain(name: str) -> str:
    return re.sub(r"[^a-z0-9]", "", name.rpartition(":")[2].lower())


@dataclass(frozen=True)
class Mapping:
    """Where the canonical joints are in a skeleton.

    Attributes:
        skeleton: the skeleton.
        joints: for each of the 22 canonical joints the index in the skeleton, or None.
    """

    skeleton: Skeleton
    joints: tuple[int | None, ...]

    @property
    def missing(self) -> tuple[str, ...]:
        """Canonical joints that the skeleton does not have."""
        return tuple(name for name, joint in zip(JOINTS, self.joints) if joint is None)

    @property
    def usable(self) -> bool:
        """Whether every joint but those that can be derived (one of the spine) is there."""
        return set(self.missing) <= {"Spine1"}

    @cached_property
    def weights(self) -> np.ndarray:
        """(22, J) canonical positions = weights @ positions; a missing Spine1 lies halfway up the spine."""
        weights = np.zeros((len(JOINTS), len(self.skeleton)))
        for row, joint in enumerate(self.joints):
            if joint is not None:
                weights[row, joint] = 1.0
        if self.joints[JOINTS.index("Spine1")] is None and self.usable:
            ends = [JOINTS.index("Spine"), JOINTS.index("Spine2")]
            weights[JOINTS.index("Spine1")] = 0.5 * weights[ends].sum(axis=0)
        return weights

    @cached_property
    def leg_length(self) -> float:
        """Thigh plus shin, mean of both sides, in the skeleton's own metres."""
        lengths = np.linalg.norm(self.skeleton.rest_translation, axis=1) * self.skeleton.scale_above
        total = 0.0
        for side in ("Left", "Right"):
            top, joint = (self.joints[JOINTS.index(side + part)] for part in ("UpLeg", "Foot"))
            if top is None or joint is None:
                return float("nan")
            while joint not in (top, -1):
                total += 0.5 * lengths[joint]
                joint = self.skeleton.parents[joint]
        return total

    @property
    def scale(self) -> float:
        """What positions are multiplied with to give them the canonical leg."""
        return LEG_LENGTH / self.leg_length

    def positions(self, positions: np.ndarray) -> np.ndarray:
        """(F, J, 3) positions of the skeleton's joints to (F, 22, 3) canonical ones, in metres, unscaled."""
        return np.einsum("cj,fjx->fcx", self.weights, positions)

    def observed(self, known: np.ndarray) -> np.ndarray:
        """(F, J) known positions to (F, 22): known when every joint it comes from is known."""
        return (~known).astype(float) @ (self.weights.T > 0) == 0


def _spine(skeleton: Skeleton, found: dict[str, int | None]) -> None:
    """The spine by topology: from above the hips up to the joint where both arms meet."""
    hips, left, right = (found[name] for name in ("Hips", "LeftArm", "RightArm"))
    if hips is None or left is None or right is None:
        return
    meet = next((j for j in skeleton.ancestors(left) if j in skeleton.ancestors(right)), hips)
    chain = [j for j in (meet, *skeleton.ancestors(meet)) if hips in skeleton.ancestors(j)][::-1]
    if chain:
        found["Spine"], found["Spine2"] = chain[0], chain[-1]
        found["Spine1"] = chain[len(chain) // 2] if len(chain) > 2 else None


def find_mapping(skeleton: Skeleton) -> Mapping:
    """The mapping of a skeleton by its joint names; look at `missing` and `usable` for how far it went."""
    plain = [_plain(name) for name in skeleton.names]
    found: dict[str, int | None] = {}
    table = _table()
    for joint in JOINTS:
        taken = set(found.values())
        hits = [plain.index(name) for name in table.get(joint, ()) if name in plain]
        found[joint] = next((hit for hit in hits if hit not in taken), None)
    _spine(skeleton, found)
    return Mapping(skeleton, tuple(found[joint] for joint in JOINTS))
