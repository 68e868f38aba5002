"""Which of a skeleton's joints are the 22 canonical ones: by what was said, by names, by topology."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from interpose.clip import Skeleton
from interpose.errors import RequestError, unknown
from interpose.skeletons import names
from interpose.skeletons.canonical import BONES, JOINTS, LEG_LENGTH, PARENTS
from interpose.skeletons.topology import guess

# How a joint is found, the surest way first: somebody said so, its own name says so, its place among named
# joints does, or the shape of the skeleton where no name helps.
HOW = ("given", "name", "chain", "shape")
HANDS = ("left", "right")
TRUNK = ("Hips", "Spine", "Spine1", "Spine2", "Neck", "Head")
# Where the joints of the trunk lie along it, in metres of the canonical body.
ALONG = np.cumsum([np.linalg.norm(BONES[JOINTS.index(name)]) for name in TRUNK])
# Without these a skeleton is no humanoid; everything else can be derived.
ESSENTIAL = (
    "Hips",
    *(side + part for side in ("Left", "Right") for part in ("UpLeg", "Leg", "Foot", "Arm", "ForeArm")),
)
# Of a thigh's length, how far a pelvis is at most from a spine that the legs hang from.
PELVIS = 0.5
Levers = dict[int, tuple[int, np.ndarray]]


@dataclass(frozen=True, eq=False)
class Mapping:
    """Where the canonical joints are in a skeleton.

    Attributes:
        skeleton: the skeleton.
        joints: for each of the 22 canonical joints the index in the skeleton, or None.
        how: for each of them how it was found, one of HOW; "" where it is missing.
    """

    skeleton: Skeleton
    joints: tuple[int | None, ...]
    how: tuple[str, ...]

    def __getitem__(self, name: str) -> int | None:
        """The skeleton's joint for a canonical one by name."""
        return self.joints[JOINTS.index(name)]

    @property
    def missing(self) -> tuple[str, ...]:
        """Canonical joints that the skeleton does not have."""
        return tuple(name for name, joint in zip(JOINTS, self.joints) if joint is None)

    @property
    def lacking(self) -> tuple[str, ...]:
        """Those of them without which it is no humanoid: nothing can stand in for them."""
        head = () if self["Head"] is not None or self["Neck"] is not None else ("Head",)
        gone = (*(name for name in self.missing if name in ESSENTIAL), *head)
        return gone or (() if self.leg_length > 1e-6 else ("legs that have a length",))

    @property
    def usable(self) -> bool:
        """Whether all that is missing can be derived."""
        return not self.lacking

    @property
    def surely(self) -> str:
        """How the least sure of the essential joints was found, one of HOW."""
        return max((how for name, how in zip(JOINTS, self.how) if name in ESSENTIAL and how), key=HOW.index)

    @cached_property
    def mapped(self) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """The canonical joints that the skeleton has, and which of its own they are."""
        rows = tuple(row for row, joint in enumerate(self.joints) if joint is not None)
        return rows, tuple(joint for joint in self.joints if joint is not None)

    @cached_property
    def weights(self) -> np.ndarray:
        """(22, J): canonical positions are these sums of the skeleton's, but for `levers`.

        A missing joint of the trunk lies on the line between its neighbours there, a missing shoulder on that
        between the arms.
        """
        weights = np.zeros((len(JOINTS), len(self.skeleton)))
        rows, joints = self.mapped
        weights[rows, joints] = 1.0
        if not self.usable:
            return weights
        known = [i for i, name in enumerate(TRUNK) if self[name] is not None]
        for i, name in enumerate(TRUNK):
            above, below = (
                next((k for k in some if step * k > step * i), None)
                for some, step in ((known, 1), (known[::-1], -1))
            )
            if i not in known and above is not None and below is not None:
                share = (ALONG[i] - ALONG[below]) / (ALONG[above] - ALONG[below])
                ends = [JOINTS.index(TRUNK[below]), JOINTS.index(TRUNK[above])]
                weights[JOINTS.index(name)] = (1 - share) * weights[ends[0]] + share * weights[ends[1]]
        out = BONES[JOINTS.index("LeftShoulder"), 0]
        share = 0.5 + 0.5 * out / (out + BONES[JOINTS.index("LeftArm"), 0])
        for side, other in (("Left", "Right"), ("Right", "Left")):
            if self[side + "Shoulder"] is None:
                arms = [weights[JOINTS.index(name + "Arm")] for name in (side, other)]
                weights[JOINTS.index(side + "Shoulder")] = share * arms[0] + (1 - share) * arms[1]
        return weights

    @cached_property
    def levers(self) -> Levers:
        """Missing ends of limbs: canonical joint to the skeleton's joint that carries it, and the bone to it.

        Metres of the skeleton, in the axes of the T-pose.
        """
        ends = {"Head": "Neck"} | {
            side + end: side + at
            for side in ("Left", "Right")
            for end, at in (("Toe", "Foot"), ("Hand", "ForeArm"))
        }
        found: Levers = {}
        for name, at in ends.items():
            joint = self[at]
            if self.usable and self[name] is None and joint is not None:
                row = JOINTS.index(name)
                found[row] = joint, BONES[row] / self.scale
        return found

    @cached_property
    def leg_length(self) -> float:
        """Thigh plus shin, mean of both sides, in the skeleton's own metres."""
        lengths = np.linalg.norm(self.skeleton.rest_translation, axis=1) * self.skeleton.scale_above
        total = 0.0
        for side in ("Left", "Right"):
            top, joint = self[side + "UpLeg"], self[side + "Foot"]
            if top is None or joint is None:
                return float("nan")
            while joint not in (top, -1):
                total += 0.5 * lengths[joint]
                joint = self.skeleton.parents[joint]
            if joint < 0:
                return float("nan")
        return float(total)

    @property
    def scale(self) -> float:
        """What positions are multiplied with to give them the canonical leg."""
        return LEG_LENGTH / self.leg_length

    @property
    def size(self) -> float:
        """How large the body is, by its legs: 1 for one for which lengths and speeds in metres are chosen,
        and where it has none."""
        length = self.leg_length
        return length / LEG_LENGTH if np.isfinite(length) and length > 0 else 1.0


@lru_cache(maxsize=64)
def find_mapping(skeleton: Skeleton) -> Mapping:
    """The mapping of a skeleton; look at `missing`, `usable` and `how` for how far it went.

    What `skeleton.roles` says stands. Then names are read; a joint that they leave open may follow from those
    around it (the spine does), and where names say nothing the shape of the skeleton is asked. Where a file
    has several characters, the one of which most is found is taken, and `roles["root"]` chooses another.

    Raises RequestError when `roles` names joints that are not there, or one joint twice.
    """
    given = _given(skeleton)
    root = skeleton.roles.get("root")
    if root is not None and root not in skeleton.names:
        error = unknown("joint", root, skeleton.names)
        raise RequestError(f"there is no joint {root} to be the root", error.why, error.fix)
    roots = [skeleton.index(root)] if root is not None else list(skeleton.roots)
    inside = [_below(skeleton, one) for one in roots]
    for name, joint in given.items():
        if joint is not None and root is not None and joint not in inside[0]:
            raise RequestError(
                f"{name} cannot be {skeleton.names[joint]}",
                f"it does not hang below {root}, which is said to be the root",
                "Name a joint of that character, or another root.",
            )
    found = []
    for some in inside:
        # Of several chains the one that deforms is the body, where it is a whole one.
        chosen = [any(map(names.DEFORMS.match, skeleton.names)), False]
        tried = (_find(skeleton, some, given, deforming) for deforming in dict.fromkeys(chosen))
        found.append(max(tried, key=lambda mapping: (mapping.usable, len(mapping.mapped[0]))))
    return _check(max(found, key=lambda mapping: (mapping.usable, len(mapping.mapped[0]))))


def _given(skeleton: Skeleton) -> dict[str, int | None]:
    """What somebody said: canonical joint to own joint, None for one that is not there."""
    given: dict[str, int | None] = {}
    for name, own in skeleton.roles.items():
        if name == "hand" and own and own not in HANDS:
            raise unknown("hand", own, HANDS)
        if name in ("root", "hand"):
            continue
        if name not in JOINTS:
            raise unknown("canonical joint", name, JOINTS)
        if own and own not in skeleton.names:
            error = unknown("joint", own, skeleton.names)
            raise RequestError(f"{name} cannot be {own}: there is no such joint", error.why, error.fix)
        given[name] = skeleton.index(own) if own else None
    used = [joint for joint in given.values() if joint is not None]
    if twice := {skeleton.names[joint] for joint in used if used.count(joint) > 1}:
        raise RequestError(
            f"the mapping names {', '.join(sorted(twice))} twice",
            "one joint cannot be two canonical ones",
            "Name it once; leave out what the skeleton does not have.",
        )
    return given


def _below(skeleton: Skeleton, root: int) -> list[int]:
    """A joint and all below it."""
    inside = {root}
    for joint, parent in enumerate(skeleton.parents):
        if parent in inside:
            inside.add(joint)
    return sorted(inside)


def _find(skeleton: Skeleton, inside: list[int], given: dict[str, int | None], deforming: bool) -> Mapping:
    """The mapping of the joints `inside`, by all names or those of `deforming` bones alone."""
    here = {name: joint for name, joint in given.items() if joint is None or joint in inside}
    said = dict(zip(inside, names.read(tuple(skeleton.names[joint] for joint in inside), deforming)))
    chains = _Chains(skeleton, said)
    found, how = chains.limbs()
    if not {"LeftUpLeg", "RightUpLeg", "LeftArm", "RightArm"} <= set(found) and (
        shaped := guess(skeleton, inside, {joint: one.side for joint, one in said.items()})
    ):
        found, how = shaped, dict.fromkeys(shaped, "shape")
    fixed = {name: joint for name, joint in here.items() if joint is not None}
    # What is given is nothing else as well.
    found = {name: joint for name, joint in found.items() if joint not in fixed.values()} | fixed
    for name, joint in chains.trunk(found).items():
        if name not in found:
            found[name] = joint
            how[name] = "name" if said[joint].part in ("hips", "spine", "neck", "head") else "chain"
    for name, own in here.items():
        how[name] = "given"
        if own is None:
            found.pop(name, None)
    joints = tuple(found.get(name) for name in JOINTS)
    how_each = tuple(how.get(name, "chain") if found.get(name) is not None else "" for name in JOINTS)
    return Mapping(skeleton, joints, how_each)


def _check(mapping: Mapping) -> Mapping:
    """The mapping, if it makes a body: RequestError where what somebody said hangs from the wrong place."""
    skeleton = mapping.skeleton
    for row, joint in enumerate(mapping.joints):
        above = PARENTS[row]
        while above >= 0 and mapping.joints[above] is None:
            above = PARENTS[above]
        if joint is None or above < 0 or mapping.joints[above] in skeleton.ancestors(joint):
            continue
        lower, upper = skeleton.names[joint], skeleton.names[mapping.joints[above]]  # type: ignore[index]
        fix = "Correct the map; interpose skeleton prints the tree."
        # Who is blamed is what was said, not what was found.
        if mapping.how[row] == "given":
            why = f"it does not hang below {upper}, which is {JOINTS[above]}"
            raise RequestError(f"{JOINTS[row]} cannot be {lower}", why, fix)
        if mapping.how[above] == "given":
            why = f"{lower}, which is {JOINTS[row]}, does not hang below it"
            raise RequestError(f"{JOINTS[above]} cannot be {upper}", why, fix)
        fewer = tuple(None if j == row else own for j, own in enumerate(mapping.joints))
        how = tuple("" if j == row else one for j, one in enumerate(mapping.how))
        return _check(Mapping(skeleton, fewer, how))
    return mapping


Found = dict[str, int]
LEG, ARM = ("UpLeg", "Leg", "Foot", "Toe"), ("Shoulder", "Arm", "ForeArm", "Hand")


class _Chains:
    """Finds limbs and trunk among joints whose names say something."""

    def __init__(self, skeleton: Skeleton, said: dict[int, names.Said]) -> None:
        self.skeleton, self.said = skeleton, said
        self.above = {joint: skeleton.ancestors(joint) for joint in said}
        self.inner = {joint for above in self.above.values() for joint in above}

    def limbs(self) -> tuple[Found, dict[str, str]]:
        """Legs and arms by their names; what one side's names leave open follows from the other side, or from
        its neighbours. And how each joint was found."""
        sides = {name: self._leg(side) | self._arm(side) for side, name in ((-1, "Left"), (1, "Right"))}
        how = {side + part: "name" for side, found in sides.items() for part in found}
        for parts in (LEG, ARM):
            for side, other in (("Left", "Right"), ("Right", "Left")):
                guessed = self._like(sides[side], sides[other], parts)
                guessed |= {
                    p: j for p, j in self._beside(sides[side] | guessed, parts).items() if p not in guessed
                }
                for part, joint in guessed.items():
                    if sides[side].get(part) != joint:
                        sides[side][part], how[side + part] = joint, "chain"
        return {side + part: joint for side, found in sides.items() for part, joint in found.items()}, how

    def _like(self, mine: Found, other: Found, parts: tuple[str, ...]) -> Found:
        """The joints of a limb as far above its end as on the other side, if that is more complete."""
        ends = [part for part in parts[::-1] if part in mine and part in other]
        whole = sum(part in other for part in parts), sum(part in mine for part in parts)
        named = [self.said[joint].part for part, joint in mine.items() if part in parts]
        if not ends or whole[0] < whole[1] or (whole[0] == whole[1] and not {"shoulder", "hip"} & set(named)):
            return {}
        found, end = {}, ends[0]
        for part in parts[: parts.index(end)]:
            if part in other and other[part] in self.above[other[end]]:
                steps = self.above[other[end]].index(other[part])
                if steps < len(self.above[mine[end]]) and self.above[mine[end]][steps] in self.said:
                    found[part] = self.above[mine[end]][steps]
        return found

    def _beside(self, mine: Found, parts: tuple[str, ...]) -> Found:
        """An unnamed joint between two named ones, or right below or above a named one."""
        top, middle, end = ("UpLeg", "Leg", "Foot") if parts is LEG else ("Arm", "ForeArm", "Hand")
        found: Found = {}
        if middle not in mine and top in mine and end in mine:
            chain = self.between(mine[top], mine[end])[:-1]
            way = np.cumsum(np.linalg.norm(self.skeleton.rest_translation[[*chain, mine[end]]], axis=1))
            if chain:
                found[middle] = chain[int(np.argmax(np.minimum(way[:-1], way[-1] - way[:-1])))]
        if top not in mine and middle in mine and self.above[mine[middle]][:1]:
            above = self.above[mine[middle]][0]
            if above in self.said and self.said[above].part in (None, "leg"):
                found[top] = above
        if end not in mine and middle in mine:
            below = [j for j, up in self.above.items() if up[:1] == (mine[middle],)]
            below = [j for j in below if any(j in up for up in self.above.values())] or below
            if parts is LEG and len(below) == 1:
                found[end] = below[0]
        return found

    def _first(self, parts: str, side: int, below: int | None = None) -> int | None:
        """The topmost joint that is one of these parts of a side, below a joint; one from which something
        hangs before one from which nothing does, as helpers are called like what they help."""
        found = [
            joint
            for joint, said in self.said.items()
            if said.side == side and said.part in parts.split()
            if below is None or below in self.above[joint]
        ]
        top = [joint for joint in found if not {*found} & {*self.above[joint]}]
        return max(top, key=self.inner.__contains__, default=None)

    def _leg(self, side: int) -> Found:
        # A "hip" of one side is the thigh where nothing else is called so; the last, after a "hip joint".
        thigh, leg = self._first("thigh", side), self._first("leg", side)
        hips = [joint for joint, said in self.said.items() if said.side == side and said.part == "hip"]
        thigh = hips[-1] if thigh is None and hips else thigh
        shin = self._first("shin leg", side, thigh) if thigh is not None else self._first("shin", side, leg)
        thigh = leg if thigh is None and shin is not None else thigh
        top = shin if shin is not None else thigh
        foot = self._first("ankle foot", side, top) if top is not None else None
        toe = self._first("foot toe", side, foot) if foot is not None else self._first("toe", side, top)
        return _only({"UpLeg": thigh, "Leg": shin, "Foot": foot, "Toe": toe})

    def _arm(self, side: int) -> Found:
        clavicle, shoulder = self._first("clavicle", side), self._first("shoulder", side)
        clavicle = clavicle if clavicle in self.inner else None
        arm = self._first("upperarm", side, clavicle if clavicle is not None else shoulder)
        if arm is None:
            # "Shoulder" is the collar bone where something below is called arm, and else the upper arm.
            arm = self._first("shoulder", side, clavicle)
            arm = self._first("upperarm", side) if arm is None else arm
        if clavicle is None and shoulder != arm:
            clavicle = shoulder
        top = arm if arm is not None else clavicle
        elbow = self._first("forearm", side, top) if top is not None else self._first("forearm", side)
        top = elbow if elbow is not None else top
        hand = self._first("hand", side, top) if top is not None else None
        return _only({"Shoulder": clavicle, "Arm": arm, "ForeArm": elbow, "Hand": hand})

    def trunk(self, limbs: Found) -> Found:
        """Hips, spine, neck and head, from where legs and arms branch off."""
        legs = [limbs[name] for name in ("LeftUpLeg", "RightUpLeg") if name in limbs]
        arms = [limbs.get(side + "Shoulder", limbs.get(side + "Arm")) for side in ("Left", "Right")]
        tops = [joint for joint in arms if joint is not None]
        if len(legs) < 2 or len(tops) < 2:
            # Not a whole body: what is called so.
            parts = {"Hips": "hips", "Spine": "spine", "Neck": "neck", "Head": "head"}
            return _only({name: self._first(part, 0) for name, part in parts.items()}) | limbs
        chest = self._meet(tops)
        hips = limbs.get("Hips", self._meet([*legs, *tops]))
        if hips is None or chest is None:
            return {}
        if "Hips" not in limbs:
            hips = self._pelvis(hips, limbs)
        if self.said[chest].part == "neck":
            chest = self.skeleton.parents[chest]  # Bipeds hang their collar bones off the neck
        found: dict[str, int | None] = {"Hips": hips}
        spine = self.between(hips, chest)
        if spine:
            found["Spine"] = spine[0]
            found["Spine1"] = spine[len(spine) // 2] if len(spine) > 2 else None
            found["Spine2"] = spine[-1] if len(spine) > 1 else None
        up = self._upwards(chest, tops)
        head = limbs.get("Head", next((j for j in up if self.said[j].part == "head"), up[-1] if up else None))
        found["Head"] = head
        necks = self.between(chest, head)[:-1] if head is not None and chest in self.above[head] else []
        found["Neck"] = self._neck(necks)
        return _only(found)

    def _upwards(self, chest: int, arms: list[int]) -> list[int]:
        """The joints of neck and head, in order: those that are called so, or else the middle branch that is
        longest (Rigify calls them spine, too)."""
        named = [j for j, said in self.said.items() if said.part == "head" and chest in self.above[j]]
        if named:
            return self.between(chest, named[0])
        aside = {a for arm in arms for a in (arm, *self.above[arm])}
        best: list[int] = []
        for joint, said in self.said.items():
            if said.part in ("spine", "neck") and len(self.above[joint]) > len(self.above[chest]) + len(best):
                chain = self.between(chest, joint)
                if all(self.said[j].part in ("spine", "neck") and j not in aside for j in chain):
                    best = chain
        return best

    def _pelvis(self, meeting: int, limbs: Found) -> int:
        """The joint that carries legs and spine: above where they meet, if the pelvis is said to be there.

        Old Bipeds hang their legs off the spine, at the pelvis' own place. A root on the floor, from which it
        is as far as legs are long, is no pelvis.
        """
        above = self.skeleton.parents[meeting]
        if above not in self.said or self.said[above].part != "hips" or self.said[meeting].part != "spine":
            return meeting
        shins = [limbs[name] for name in ("LeftLeg", "RightLeg") if name in limbs]
        # The bone to the knee, from the thigh.
        thigh = max((self._bone(joint) for joint in shins), default=np.inf)
        return above if self._bone(meeting) < PELVIS * thigh else meeting

    def _bone(self, joint: int) -> float:
        """How far a joint is from its parent, in the skeleton's units."""
        return float(np.linalg.norm(self.skeleton.rest_translation[joint]))

    def _neck(self, necks: list[int]) -> int | None:
        """The first joint of the neck that is not at the chest's own place (as it is in CMU's skeletons)."""
        away = np.cumsum(np.linalg.norm(self.skeleton.rest_translation[necks], axis=1))
        return next((joint for joint, way in zip(necks, away) if way > 1e-6), necks[-1] if necks else None)

    def _meet(self, joints: Iterable[int]) -> int | None:
        """The lowest joint above all of these."""
        first, *others = joints
        return next((a for a in self.above[first] if all(a in self.above[b] for b in others)), None)

    def between(self, top: int, end: int) -> list[int]:
        """The joints from below `top` down to `end`, with it; none if `end` is not below."""
        if top not in self.above[end]:
            return []
        return [end, *self.above[end][: self.above[end].index(top)]][::-1]


def _only(found: dict[str, int | None]) -> dict[str, int]:
    return {name: joint for name, joint in found.items() if joint is not None}
