"""A humanoid by its shape alone: two legs, a trunk, two arms and a head, whatever the joints are called.

Looks at the zero pose, so it finds nothing in skeletons whose zero pose is a heap of bones (LAFAN1's, whose
names are enough). What does not stand upright in it, such as a horse, is no humanoid.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from interpose.clip import Skeleton
from interpose.geometry import kinematics

# How much bones of the two sides may differ, as a share of them: real people's do. How long a limb is at
# least, as a share of the longest reach.
LIKE, LIMB = 0.20, 0.25
BRANCHES = 16  # that two limbs are looked for among, the furthest-reaching ones
FOOT = 0.08  # of the leg: a shorter segment after the ankle is no foot


@dataclass(frozen=True)
class _Limb:
    """A chain of joints, and where in it the two longest neighbouring bones begin."""

    chain: list[int]
    at: int

    @property
    def middle(self) -> int:
        """The knee or elbow."""
        return self.chain[self.at + 1]

    @property
    def end(self) -> int:
        """The ankle or wrist."""
        return self.chain[self.at + 2]


class _Shape:
    """A skeleton in its zero pose."""

    def __init__(self, skeleton: Skeleton, inside: list[int]) -> None:
        bones = skeleton.rest_translation * skeleton.scale_above[:, None]
        self.placed = kinematics.forward(skeleton.rest_rotation, bones, skeleton.parents)[1]
        within = set(inside)
        self.children = {j: [c for c in skeleton.children[j] if c in within] for j in inside}
        self.length = np.linalg.norm(bones, axis=1)
        self.reach = np.zeros(len(skeleton))  # the way from a joint to the furthest end below it
        for joint in reversed(inside):
            self.reach[joint] = max(map(self.whole, self.children[joint]), default=0.0)

    def whole(self, joint: int) -> float:
        """The way to the furthest end, with the joint's own bone."""
        return float(self.length[joint] + self.reach[joint])

    def chain(self, start: int) -> list[int]:
        """From a joint down its longest branch."""
        chain = [start]
        while self.children[chain[-1]]:
            chain.append(max(self.children[chain[-1]], key=self.whole))
        return chain

    def pair(self, joint: int) -> list[_Limb]:
        """The two limbs of like length that branch off at a joint; empty when there are none."""
        least = LIMB * self.reach.max()
        some = [c for c in self.children[joint] if self.whole(c) > least]
        chains = [self.chain(c) for c in sorted(some, key=self.whole, reverse=True)[:BRANCHES]]
        pairs = [(a, b) for i, a in enumerate(chains) for b in chains[i + 1 :]]
        best = max(pairs, key=lambda pair: self._alike(*pair), default=None)
        if best is None or (same := int(self._alike(*best)[0])) < 2:
            return []
        # As far as they are alike: what a hand holds does not count.
        one, other = (chain[: same + 1] for chain in best)
        # The last that are nearly the longest: some collar bones are as long as forearms.
        sums = sum(self.length[chain[1:-1]] + self.length[chain[2:]] for chain in (one, other))
        at = int(np.flatnonzero(sums >= 0.9 * np.max(sums))[-1])
        return [_Limb(one, at), _Limb(other, at)]

    def _alike(self, a: list[int], b: list[int]) -> tuple[float, float]:
        """How many bones two chains have in common from their start on, and how alike these are."""
        off = [abs(x - y) / max(x, y, 1e-9) for x, y in zip(self.length[a[1:]], self.length[b[1:]])]
        same = next((i for i, one in enumerate(off) if one > LIKE), len(off))
        return same, -float(np.sum(off[:same]))


def guess(skeleton: Skeleton, inside: list[int], sides: dict[int, int]) -> dict[str, int]:
    """Canonical joints to the skeleton's own, of those `inside`; nothing when the shape is no humanoid's.

    sides: what their names say, -1 left, 1 right and 0 neither.
    """
    shape = _Shape(skeleton, inside)
    for hips in inside:
        legs = shape.pair(hips)
        below = [hips, *(leg.chain[0] for leg in legs)]
        # Some pelvises stand beside the spine, below a joint that carries both.
        for carrier in (hips, skeleton.parents[hips]) if legs else ():
            above = [j for c in shape.children.get(carrier, ()) if c not in below for j in shape.chain(c)]
            chest = next((joint for joint in above if shape.pair(joint)), None)
            if chest is None:
                continue
            up = shape.placed[chest] - shape.placed[carrier]
            down = np.mean([shape.placed[leg.end] for leg in legs], axis=0) - shape.placed[carrier]
            if np.linalg.norm(up) > 1e-6 and up @ down < -0.5 * np.linalg.norm(up) * np.linalg.norm(down):
                return {
                    "Hips": carrier,
                    **_limbs(shape, legs, shape.pair(chest), up, sides),
                    **_head(shape, chest, up, legs),
                }
    return {}


def _limbs(
    shape: _Shape, legs: list[_Limb], arms: list[_Limb], up: np.ndarray, sides: dict[int, int]
) -> dict[str, int]:
    """Legs and arms by name; feet point ahead, and so tell left from right where names do not."""
    feet = [
        shape.placed[leg.chain[leg.at + 3]] - shape.placed[leg.end]
        for leg in legs
        if leg.end != leg.chain[-1]
    ]
    ahead = np.sum(feet, axis=0) if feet else np.array([0.0, 0.0, 1.0])
    left = np.cross(up, ahead)
    found: dict[str, int] = {}

    def first_is_left(limbs: list[_Limb]) -> tuple[bool, bool | None]:
        """By the shape, and by names if they tell."""
        apart = shape.placed[limbs[0].middle] - shape.placed[limbs[1].middle]
        said = [sum(sides.get(joint, 0) for joint in limb.chain) for limb in limbs]
        return bool(apart @ left > 0), said[0] < 0 if said[0] * said[1] < 0 else None

    told = [shaped == said for shaped, said in map(first_is_left, (legs, arms)) if said is not None]
    if told and not any(told):
        left = -left  # it is turned round: also where the names of the other limbs say nothing
    for limbs, parts in ((legs, ("UpLeg", "Leg", "Foot", "Toe")), (arms, ("Arm", "ForeArm", "Hand"))):
        shaped, said = first_is_left(limbs)
        first = shaped if said is None else said
        for side, limb in zip(("Left", "Right") if first else ("Right", "Left"), limbs):
            own = dict(zip(parts, limb.chain[limb.at :]))
            if "Toe" in own and shape.length[own["Toe"]] < FOOT * shape.length[[limb.middle, limb.end]].sum():
                del own["Toe"]
            if "Arm" in own and limb.at > 0:
                own["Shoulder"] = limb.chain[limb.at - 1]
            found |= {side + part: joint for part, joint in own.items()}
    return found


def _head(shape: _Shape, chest: int, up: np.ndarray, legs: list[_Limb]) -> dict[str, int]:
    """Neck and head: the branch at the chest that is no arm and goes up furthest.

    The head carries a face, or is the last joint; in rigs whose toes end in a joint of their own, the last
    but one.
    """
    arms = [arm.chain[0] for arm in shape.pair(chest)]
    others = [shape.chain(joint) for joint in shape.children[chest] if joint not in arms]
    if not others:
        return {}
    chain = max(others, key=lambda chain: float(shape.placed[chain[-1]] @ up))
    face = next((i for i, joint in enumerate(chain) if len(shape.children[joint]) > 1), None)
    tips = all(len(leg.chain) > leg.at + 4 for leg in legs) and len(chain) > 2
    last = face if face is not None else len(chain) - (2 if tips else 1)
    return {"Head": chain[last]}
