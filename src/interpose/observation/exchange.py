"""What some values were taken for, for a while: left for right, or a knee that bends one way for one that
bends the other way. All are undone by doing them once more."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar, TypeVar

import numpy as np
from scipy import ndimage

from interpose.clip import Clip
from interpose.geometry import kinematics, rotations
from interpose.geometry.time import runs
from interpose.observation.corruption import LIMBS
from interpose.skeletons import JOINTS, PARENTS, SIDES, Humanoid, find_humanoid, find_mapping
from interpose.skeletons.carrier import STILL
from interpose.skeletons.mirror import counterparts

# Seconds that it lasts at most: of longer ones nobody knows which part is the wrong one.
LONGEST = 3.0
# The joints concerned turn by more than this from one frame to the next (radians, all together) where it
# surely begins or ends, and by less than the share `sure` of it if it is undone.
TURN = 0.6
# The other end only spares something: they turn by more than this, and by less than the share `likely`.
LEAST = 0.1
# Where they change sides once, the rest of the body turns no further than so many times what it does within
# three frames, and its place goes no further: else the motion was cut there, in the middle of a stride, say.
CUT = 2.5
# A joint that turns less than this in the whole clip (radians) has no data, and none on the wrong side.
LIFELESS = 1e-3
# Radians by which axes of the left and the right differ that are alike.
ALIKE = 0.2
# Radians by which knees bend that bend the wrong way, and further than which none does: who squats deep has
# passed half a turn in some files. Of 245 clips of all data sets knees bend by up to 25 degrees that way in
# one, by 6 in one, and in all others by none.
BACKWARDS, FURTHEST = np.radians(30), np.radians(110)
# Seconds for which one does so, at least; and in how many frames knees bend the right way, at least, for each
# in which one bends the wrong way.
LASTING, SOME = 0.05, 0.25


@dataclass(frozen=True)
class Exchange:
    """The joints `left` and `right`, one for one, have each other's turns in the frames start to stop - 1.

    `alone` hang from them and turn, too, but have no like on the other side: they stay as they are.
    """

    start: int
    stop: int
    left: tuple[int, ...]
    right: tuple[int, ...]
    alone: tuple[int, ...] = ()

    # In 235 clips of all data sets, 366,000 frames, no share is below .83, of arms or legs. Where legs pass
    # each other at a radian a frame, exchanges end with shares of up to .8: .35 at both ends finds 35 of 48
    # exchanges of legs in a run and a dance, these find all 48.
    sure: ClassVar[float] = 0.5
    likely: ClassVar[float] = 0.8
    kind = "exchanged"
    note = "left and right are taken for each other"

    @property
    def joints(self) -> tuple[int, ...]:
        """All of them, in the skeleton's order."""
        return tuple(sorted(self.left + self.right))

    def undone(self, clip: Clip) -> np.ndarray:
        """The rotations of a clip (F, J, 4) with both on the other side."""
        rotation = clip.rotation.copy()
        rotation[:, self.left + self.right] = clip.rotation[:, self.right + self.left]
        return rotation


@dataclass(frozen=True)
class Crossing(Exchange):
    """The same of joints whose axes are not alike on both sides, as in .asf files and on many rigs of games:
    each points where the other one did."""

    body: Humanoid = field(compare=False, repr=False, kw_only=True)  # of the whole clip

    # Of 150 clips, 54,000 frames, none has one. Lines of an .amc file that were exchanged, which is another
    # thing, have shares of .5 at both ends, and what is one .03.
    sure: ClassVar[float] = 0.35
    likely: ClassVar[float] = 0.45

    def undone(self, clip: Clip) -> np.ndarray:
        """The rotations of a clip (F, J, 4) with both on the other side."""
        body = self.body
        rows = {joint: row for row, joint in zip(*body.mapping.mapped)}
        here, there = (
            [rows[joint] for joint in some] for some in (self.left + self.right, self.right + self.left)
        )
        local = kinematics.local_rotations(body.rotations(clip), PARENTS)
        local[:, here] = local[:, there]
        done = body.to_clip(kinematics.global_rotations(local, PARENTS), body.root(clip), clip)
        rotation, joints = clip.rotation.copy(), list(self.left + self.right)
        rotation[:, joints] = done.rotation[:, joints]
        return rotation


@dataclass(frozen=True)
class Flip:
    """The thigh and shin, or arm and forearm, of a limb are turned by half a turn about the line from hip to
    ankle, which stays where it is, as does the foot, in the frames start to stop - 1."""

    start: int
    stop: int
    limb: tuple[int, int, int]  # thigh, shin and foot, or their like
    alone = ()

    # In 215 clips of all data sets two knees have two ends below this, which are flipped.
    sure: ClassVar[float] = 0.35
    likely: ClassVar[float] = 0.35
    kind = "flipped"
    note = "half a turn about itself"

    @property
    def joints(self) -> tuple[int, ...]:
        """Those that turn against their parents."""
        return self.limb[0], self.limb[2]

    def undone(self, clip: Clip) -> np.ndarray:
        """The rotations of a clip (F, J, 4) with the limb turned by half a turn."""
        thigh, shin, foot = self.limb
        parent, (turned, placed) = clip.skeleton.parents[thigh], clip.kinematics()
        line = placed[:, foot] - placed[:, thigh]
        line /= np.maximum(np.linalg.norm(line, axis=1, keepdims=True), 1e-9)
        half = rotations.exp(np.pi * line)
        rotation = clip.rotation.copy()
        above = turned[:, parent] if parent >= 0 else rotations.identity(len(clip))
        flipped = [rotations.multiply(half, turned[:, joint]) for joint in (thigh, shin)]
        rotation[:, thigh] = rotations.relative(above, flipped[0])
        rotation[:, foot] = rotations.relative(flipped[1], turned[:, foot])
        return rotation


@dataclass(frozen=True)
class Bend:
    """A shin that bends against its thigh the other way than knees do, in the frames start to stop - 1."""

    start: int
    stop: int
    shin: int
    body: Humanoid = field(compare=False, repr=False)  # of the whole clip
    alone = ()

    kind = "flipped"
    note = "bends the wrong way"

    @property
    def joints(self) -> tuple[int, ...]:
        """The shin."""
        return (self.shin,)

    def undone(self, clip: Clip) -> np.ndarray:
        """The rotations of a clip (F, J, 4) with the knee bent as far the other way."""
        local = kinematics.local_rotations(self.body.rotations(clip), PARENTS)
        row = self.body.mapping.joints.index(self.shin)
        local[:, row] = rotations.conjugate(local[:, row])
        done = self.body.to_clip(kinematics.global_rotations(local, PARENTS), self.body.root(clip), clip)
        rotation = clip.rotation.copy()
        rotation[:, self.shin] = done.rotation[:, self.shin]
        return rotation


Taken = Exchange | Flip | Bend
Kind = TypeVar("Kind", Exchange, Flip)


def exchanges(clip: Clip) -> list[Taken]:
    """Where arms, or legs, change sides and back, or are flipped, or knees bend the wrong way, in order of
    time; none of what is no humanoid."""
    mapping, found = find_mapping(clip.skeleton), list[Taken]()
    for sides in _sides(clip):
        found += [_whole(clip, one) for one in _changes(clip, sides)[1]]
    for limb in LIMBS:
        own = [mapping.joints[row] for row in limb]
        # Of an arm it is the collar that comes first.
        bones = own[:3] if JOINTS[limb[0]].endswith("UpLeg") else own[1:]
        if None not in bones and _chain(clip, bones):  # type: ignore[arg-type]
            found += _cuts(clip, Flip(0, 0, tuple(bones)))[0]  # type: ignore[arg-type]
    found += [
        bend
        for bend in _bends(put_back(clip, found))
        if not any(
            one.start < bend.stop
            and bend.start < one.stop
            and {bend.shin, clip.skeleton.parents[bend.shin]} & {*one.joints}
            for one in found
        )
    ]
    return sorted(found, key=lambda one: (one.start, one.joints))


def _bends(clip: Clip) -> list[Bend]:
    """Where a knee bends the wrong way, from where it does at all on.

    None where both do, or hardly one ever bends the right way: then it is rather the body that is taken to
    face backwards. Nor on rigs of which the motion has to tell how knees bend.
    """
    if not find_mapping(clip.skeleton).usable or not len(clip):
        return []
    body = find_humanoid(clip)
    if body.rest.how == "motion":
        return []
    local = kinematics.local_rotations(body.rotations(clip), PARENTS)
    found, wrong, right = [], 0, 0
    for name in ("LeftLeg", "RightLeg"):
        row = JOINTS.index(name)
        shin = body.mapping.joints[row]
        if shin is None:
            continue
        bone = rotations.rotate(local[:, row], np.broadcast_to([0.0, -1.0, 0.0], (len(clip), 3)))
        # Which way it bends: backwards, from straight on.
        bends = np.arctan2(-bone[:, 2], -bone[:, 1])
        right += int((bends > BACKWARDS).sum())
        for start, stop in runs(bends < 0):
            part = bends[start:stop]
            far = int((part < -BACKWARDS).sum())
            possible = part.min() > -FURTHEST or _turns_over(local[:, row], start, stop)
            if far > max(1, LASTING * clip.fps) and possible:
                wrong += far
                found.append(Bend(start, stop, shin, body))
    return found if right > SOME * wrong and len({one.shin for one in found}) < 2 else []


def _turns_over(local: np.ndarray, start: int, stop: int) -> bool:
    """Whether a knee with rotations (F, 4) jumps at both ends of the frames start to stop - 1, and would not
    if it were bent back."""
    if start == 0 or stop == len(local):
        return False
    inside, beside = local[[start, stop - 1]], local[[start - 1, stop]]
    jumps, rest = (rotations.angle(some, beside) for some in (inside, rotations.conjugate(inside)))
    return bool((jumps > BACKWARDS).all() and (rest < Flip.sure * jumps).all())


def crossovers(clip: Clip) -> list[Exchange]:
    """Where arms, or legs, change sides and not back within LONGEST, in order of time: from there to the next
    such place, or the end. Whether they are on the wrong side there, or in all other frames, nothing tells.
    """
    found, every = [], _sides(clip)
    cut = _torn(clip, every) if every else {*()}
    for sides in every:
        kind, _, lone = _changes(clip, sides)
        cuts = [frame for frame in (*lone, len(clip)) if frame not in cut]
        found += [
            _whole(clip, replace(kind, start=start, stop=stop))
            for start, stop in zip(cuts[:-1:2], cuts[1::2])
        ]
    return sorted(found, key=lambda one: (one.start, one.joints))


def _torn(clip: Clip, every: Sequence[Exchange]) -> set[int]:
    """The frames to which all but limbs jumps, in how it turns or where it is."""
    limbs = np.flatnonzero(clip.skeleton.below[:, [j for one in every for j in one.joints]].any(axis=1))
    rest = [joint for joint in range(len(clip.skeleton)) if joint not in limbs]
    turned = rotations.angle(clip.rotation[:-1, rest], clip.rotation[1:, rest]).sum(axis=1)
    moved = np.linalg.norm(np.diff(clip.translation, axis=0), axis=-1).sum(axis=1)
    torn = np.zeros(len(turned), bool)
    for step, least in ((turned, LEAST), (moved, STILL)):
        beside = ndimage.maximum_filter(step, footprint=[1, 1, 1, 0, 1, 1, 1], mode="nearest")
        torn |= step > CUT * beside + least
    return {*(np.flatnonzero(torn) + 1).tolist()}


def _sides(clip: Clip) -> list[Exchange]:
    """The arms, and the legs, that might be taken for each other."""
    mapping, found = find_mapping(clip.skeleton), []
    for limb in LIMBS:
        pairs = [(mapping.joints[row], mapping.joints[SIDES[row]]) for row in limb]
        both = [(a, b) for a, b in pairs if a is not None and b is not None]
        if JOINTS[limb[0]].startswith("Left") and both:
            found.append(Exchange(0, 0, *zip(*both)))
    return found


def _changes(clip: Clip, sides: Exchange) -> tuple[Exchange, list[Exchange], list[int]]:
    """In which way joints change sides, as they do by their axes or by where they point; the spells in which
    they do, and the frames in which they do and not back."""
    spells, lone = _cuts(clip, sides)
    if not spells and not lone and (crossing := _crossing(clip, sides)) is not None:
        return (crossing, *_cuts(clip, crossing))
    return sides, spells, lone


def _crossing(clip: Clip, sides: Exchange) -> Crossing | None:
    """The same as where joints point; None of no humanoid, and where axes are alike, and it would be the
    same."""
    if not find_mapping(clip.skeleton).usable:
        return None
    crossing = Crossing(0, 0, sides.left, sides.right, body=find_humanoid(clip))
    few = clip.slice(0, 2)
    one, other = (kind.undone(few) for kind in (sides, crossing))
    alike = rotations.angle(one, other).max(initial=0.0) < ALIKE
    return None if alike else crossing


def put_back(clip: Clip, found: Sequence[Taken]) -> Clip:
    """The clip with all that was found undone; what a file left in it stays."""
    for one in found:
        rotation, part = clip.rotation.copy(), slice(one.start, one.stop)
        rotation[part] = one.undone(clip.slice(one.start, one.stop))
        clip = clip.with_motion(rotation, clip.translation)
    return clip


def _chain(clip: Clip, bones: Sequence[int]) -> bool:
    """Whether each joint is the next one's parent: else what lies between would have to be turned, too."""
    return all(clip.skeleton.parents[b] == a for a, b in zip(bones, bones[1:]))


def _whole(clip: Clip, one: Exchange) -> Exchange:
    """An exchange with what hangs from its joints and has a like on the other side, as hands and fingers do.

    All of it changed sides, or none, as where only the canonical joints went through a network: whichever
    turns less at both ends. That is right in 480 of 480 exchanges of arms in 16 clips with fingers, which are
    exchanged, too, in half of them. Where axes are not alike on both sides nothing tells where those point.
    """
    like = counterparts(clip.skeleton)
    left, right = (
        set(np.flatnonzero(clip.skeleton.below[:, side].any(axis=1)).tolist()) - set(side)
        for side in (one.left, one.right)
    )
    mine = tuple(
        joint
        for joint in sorted(left)
        if like[joint] in right and like[like[joint]] == joint and not isinstance(one, Crossing)
    )
    theirs = tuple(like[joint] for joint in mine)
    turning = np.ptp(rotations.continuous(clip.rotation), axis=0).max(axis=-1) > LIFELESS
    alone = sorted(joint for joint in (left | right) - {*mine, *theirs} if turning[joint])
    ends = np.array([end for end in (one.start, one.stop) if end < len(clip)])
    before, after = clip.rotation[ends - 1][:, mine + theirs], clip.rotation[ends]
    stay, change = (rotations.angle(before, after[:, to]).sum() for to in (mine + theirs, theirs + mine))
    if stay < change:
        mine = theirs = ()
    return replace(one, left=one.left + mine, right=one.right + theirs, alone=tuple(alone))


def _cuts(clip: Clip, kind: Kind) -> tuple[list[Kind], list[int]]:
    """The frames in which something was taken for something else, between two at which it begins and ends;
    and other frames at which it surely does the one or the other."""
    joints, own = list(kind.joints), clip.rotation
    other = kind.undone(clip)

    def turn(before: np.ndarray, after: np.ndarray) -> np.ndarray:
        return np.asarray(rotations.angle(before[:-1, joints], after[1:, joints]).sum(axis=1))

    stay, change = turn(own, own), turn(own, other)
    sure: np.ndarray = (stay > TURN) & (change < kind.sure * stay)
    if not sure.any():
        return [], []
    cuts = np.flatnonzero(sure | ((stay > LEAST) & (change < kind.likely * stay)))
    ends = _pairs(cuts, (stay - change)[cuts], sure[cuts], round(LONGEST * clip.fps))
    lone = {*(np.flatnonzero(sure) + 1).tolist()} - {end + 1 for pair in ends for end in pair}
    return [replace(kind, start=start + 1, stop=stop + 1) for start, stop in ends], sorted(lone)


def _pairs(cuts: np.ndarray, spared: np.ndarray, sure: np.ndarray, longest: int) -> list[tuple[int, int]]:
    """Of cuts (n,), in order, those between which undoing spares most in all: pairs that do not overlap.

    The two of a pair are at most `longest` apart, and one of them is `sure`.
    """
    most, pair = np.zeros(len(cuts) + 1), np.full(len(cuts) + 1, -1)
    for stop in range(len(cuts)):
        # What the first `stop + 1` cuts spare at most, and the cut that is paired with the last of them.
        most[stop + 1] = most[stop]
        for start in range(int(np.searchsorted(cuts, cuts[stop] - longest)), stop):
            gain = most[start] + spared[start] + spared[stop]
            if (sure[start] or sure[stop]) and gain > most[stop + 1]:
                most[stop + 1], pair[stop + 1] = gain, start
    found, count = list[tuple[int, int]](), len(cuts)
    while count:
        start = int(pair[count])
        if start >= 0:
            found.append((int(cuts[start]), int(cuts[count - 1])))
        count = start if start >= 0 else count - 1
    return found[::-1]
