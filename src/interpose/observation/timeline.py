"""Clips one after another on one timeline, with gaps between: where each lies, and how long the gaps are.

What is moved is moved as a whole: turned about the vertical and shifted over the floor. Heights stay as they
are, since the floors of takes are level as a rule, and where they are not nobody knows which one is meant.
But where a motion goes on in the next clip, as in a take that jumps (`goes_on`), its height goes on, too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from interpose.clip import Clip
from interpose.errors import RequestError, is_number
from interpose.geometry import rotations
from interpose.geometry.ground import UP, turn, wrap
from interpose.observation.continuing import goes_on
from interpose.observation.gait import in_step
from interpose.observation.observation import Gap
from interpose.skeletons import FEET, find_humanoid
from interpose.skeletons.body import facing
from interpose.skeletons.carrier import carriers, hips_of, moved
from interpose.skeletons.fitting import fit
from interpose.skeletons.humanoid import Humanoid

MOMENT = 0.5  # seconds at an end of a clip that tell where it is heading, and at which pace
FURTHEST = 600.0  # seconds: more are a slip of the finger
AGAIN = 2.0  # seconds of the beginning that a loop is led back to
FORWARD = np.radians(60.0)  # who goes further aside of where they face steps sideways or backwards
STANDS = 0.4  # metres a second: who is slower does not go anywhere
PACE = 1.3  # metres a second: at which adults like to walk (Bohannon 1997)
# What is unhurried: turns of a joint (degrees a second), getting up or down (metres a second), and changes of
# pace (metres a second, a second). A step takes STEP seconds, and a transition that is shorter slides.
TURN, RISE, CHANGE, STEP = 180.0, 0.5, 2.0, 0.5
# Seconds that who stands takes to another pose, however near that is: in a frame velocities would jump.
LEAST = 0.3
# Metres by which the feet of who stands in the end where they did before are elsewhere at most.
SAME_SPOT = 0.03


@dataclass(frozen=True)
class Placement:
    """A turn about the vertical through the origin, `yaw` radians from Z towards X, then a shift (metres)."""

    yaw: float = 0.0
    shift: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def of(self, clip: Clip, carried: Sequence[int] = ()) -> Clip:
        """The clip turned and shifted; bit for bit the same where there is nothing to do.

        Args:
            clip: what is placed.
            carried: the joints that are moved, with what hangs from them (`carriers`); the roots without any.
        """
        if self == Placement():
            return clip
        turned, placed = clip.kinematics()
        yaw = np.array(self.yaw)
        return moved(
            clip,
            {
                joint: (
                    rotations.multiply(rotations.about("y", yaw), turned[:, joint]),
                    self.at(placed[:, joint]),
                )
                for joint in carried or clip.skeleton.roots
            },
        )

    def at(self, points: np.ndarray) -> np.ndarray:
        """Points (..., 3) turned and shifted."""
        return np.asarray(turn(points, np.array(self.yaw)) + self.shift)


@dataclass(frozen=True)
class Laid:
    """Where a clip lies on a timeline.

    Attributes:
        name: of the clip.
        start, stop: its frames on the timeline are start to stop - 1.
        placement: how it was turned and shifted.
        scale: what its way was multiplied with because its body is larger or smaller than the first one's.
        why: what decided the length of the gap before it, where nobody said it.
        in_step: whether it goes on at the phase of a stride at which the one before it ends.
    """

    name: str
    start: int
    stop: int
    placement: Placement = Placement()
    scale: float = 1.0
    why: str = ""
    in_step: bool = False


@dataclass(frozen=True, eq=False)
class Timeline:
    """Clips with gaps between them.

    Attributes:
        clip: all of it, with the layout of the first one's file; in gaps the pose before them is held.
        gaps: what is missing.
        laid: the clips, in order.
        again: of a loop, where its beginning lies once more, after the last gap; it is part of `clip`.
    """

    clip: Clip
    gaps: list[Gap]
    laid: list[Laid] = field(repr=False)
    again: Laid | None = None

    @property
    def ways(self) -> list[Laid]:
        """What each gap leads to."""
        return [*self.laid[1:], *([self.again] if self.again else [])]

    def because(self, whys: Sequence[str]) -> Timeline:
        """The same, with a reason for the length of each gap."""
        told = [replace(way, why=why) for way, why in zip(self.ways, whys)]
        again = told.pop() if self.again else None
        return replace(self, laid=[self.laid[0], *told], again=again)


@dataclass(frozen=True)
class End:
    """How a clip begins or ends.

    Attributes:
        place: (3,) metres, of the hips.
        velocity: (3,) metres a second over the floor.
        course: radians, where the body is heading: 0 along Z, towards X.
    """

    place: np.ndarray
    velocity: np.ndarray
    course: float


def lay(
    clips: Sequence[Clip],
    frames: str | int | Sequence[int] = "auto",
    align: bool = True,
    loop: bool = False,
) -> Timeline:
    """Lay clips on one timeline: on the first one's skeleton, at its frame rate.

    Args:
        clips: in order.
        frames: the length of all gaps, or of each; "auto" chooses what is unhurried.
        align: turn each following clip so that it heads on where the one before it was heading, and place it
            as far ahead as the mean of both paces leads. One in which the motion of the one before goes on
            after a moment (`goes_on`) is placed where that leads, and is not turned if it faces so already.
            Without it clips stay where they lie.
        loop: one more gap leads back to the beginning, aligned like all others.

    Raises:
        RequestError: nothing to stitch, an empty clip, other skeletons, lengths that do not fit.
    """
    clips = list(clips)
    if not clips or (len(clips) == 1 and not loop):
        fix = "Name two clips or more, or make a loop of one with --loop (loop=True)."
        raise RequestError(
            "there is nothing to stitch", f"it needs two clips or more, and got {len(clips)}", fix
        )
    for clip in clips:
        if not len(clip):
            raise RequestError(f"cannot stitch {clip.name or 'a clip'}", "it has no frames", "Leave it out.")
    first = clips[0]
    fitted = [(first, 1.0), *(fit(clip, first) for clip in clips[1:])]
    if loop:
        fitted.append((first.slice(0, round(AGAIN * first.fps) + 1), 1.0))
    counts = _counts(frames, len(fitted) - 1)
    for count in counts:
        bounded(count or 1, first.fps)
    # Handedness and rest pose are found from all of the motion: single short clips must not decide.
    everything = first.joined([clip for clip, _ in fitted])
    body, carried = find_humanoid(everything), carriers(everything)
    done, laid, gaps = [first], [Laid(first.name, 0, len(first))], []
    for number, ((clip, scale), count) in enumerate(zip(fitted[1:], counts), start=1):
        # The beginning of a loop is no later part of a take: where it lies, and how high, tells nothing.
        before, ended, later = done[-1], laid[-1].stop, number < len(clips)
        way = _way(body, carried, before, clip, count, later) if align else _as_it_lies(before, clip, count)
        bounded(way.frames, first.fps, "Say how many (--frames, frames=), or let clips be placed (align).")
        if len(clips) == 1 and stands_still(body, first):
            way = replace(way, placement=Placement())
        start = ended + way.frames
        gaps.append(Gap(ended, start))
        laid.append(Laid(clip.name, start, start + len(clip), way.placement, scale, way.why, way.in_step))
        held = before.slice(len(before) - 1, len(before))
        done += [held] * way.frames + [way.placement.of(clip, carried)]
    again = laid.pop() if loop else None
    return Timeline(first.joined(done), gaps, laid, again)


def stands_still(body: Humanoid, clip: Clip) -> bool:
    """Whether somebody stands in the end where they stood in the beginning: sway leads nobody on."""
    if not body.mapping.usable or len(clip) < 2:
        return False
    stands = all(np.linalg.norm(end(body, clip, frame).velocity) < STANDS for frame in (0, -1))
    feet = body.positions(clip.take([0, len(clip) - 1]))[:, list(FEET)]
    return bool(stands and np.linalg.norm(feet[1] - feet[0], axis=-1).max() < SAME_SPOT)


@dataclass(frozen=True)
class Way:
    """How one clip leads to the next.

    Attributes:
        frames: how many lie between them.
        placement: how the next one is turned and shifted.
        why: what decided the length, where nobody said it.
        in_step: strides did.
    """

    frames: int
    placement: Placement = Placement()
    why: str = ""
    in_step: bool = False


def _as_it_lies(before: Clip, clip: Clip, count: int | None) -> Way:
    """To a clip that stays where it is, in so many frames, or in as many as the way takes."""
    if count is not None:
        return Way(count)
    frames, why = plausible_length(before, len(before) - 1, clip, 0)
    return Way(frames, why=why)


def _way(
    body: Humanoid, carried: Sequence[int], before: Clip, clip: Clip, count: int | None, later: bool
) -> Way:
    """To a clip that is placed to go on, in so many frames, or in as many as is unhurried; a `later` one may
    be a later part of the same take."""
    last, then, why = end(body, before, -1), end(body, clip, 0), ""
    # Strides foretell a turn by their mean: who is amid one would be led astray, by up to 40 degrees.
    on = goes_on(before, clip, count + 1) if count and later else None
    step = in_step(body, before, clip) if not on and body.mapping.usable else None
    yaw = last.course - then.course
    if told := on or step:
        last, then = (replace(one, velocity=way) for one, way in zip((last, then), told.velocities))
        yaw = told.yaw
    if count is None:
        turned = Placement(yaw).of(clip, carried)
        begins = replace(then, velocity=turn(then.velocity, np.array(yaw)))
        count, why = unhurried_length(last, begins, before, turned)
        if step:
            count = step.frames(count + 1) - 1
            why = f"in step, a stride takes {step.stride / before.fps:.2f} s (the shortest: {why})"
    if step:
        yaw += step.rate * (count + 1)
    yaw = float(wrap(np.array(yaw)))
    rise = on.rise if on else 0.0
    placed = ahead(last, then, yaw, (count + 1) / before.fps, rise)
    return Way(count, placed, why, step is not None)


def bounded(frames: int, fps: float, fix: str = "Ask for fewer.") -> None:
    """RequestError, with what to do, for more frames in a row than anybody makes up at once."""
    if frames > FURTHEST * fps:
        raise RequestError(
            f"cannot generate {frames} frames",
            f"at {fps:g} fps they are more than {FURTHEST / 60:g} minutes",
            fix,
        )


def _counts(frames: str | int | Sequence[int], gaps: int) -> list[int | None]:
    """The length of each gap, None where it is to be chosen."""
    if isinstance(frames, str) and frames == "auto":
        return [None] * gaps
    said: Any = [frames] * gaps if is_number(frames) else frames
    counts = isinstance(said, Sequence | np.ndarray) and not isinstance(said, str)
    if not counts or not all(is_number(count, 1, whole=True) for count in said):
        raise RequestError(
            f"cannot generate {frames} frames", "it takes numbers from 1 on, or auto", "Write 45, or auto."
        )
    if len(said) != gaps:
        raise RequestError(
            f"{len(said)} lengths do not fit {gaps} gaps",
            "each clip but the first has a gap before it, and a loop one more at the end",
            f"Give one length for all, or {gaps}.",
        )
    return [int(count) for count in said]


def end(body: Humanoid, clip: Clip, frame: int) -> End:
    """How a clip begins (frame 0) or ends (frame -1).

    A body that travels is heading where it travels, if that is about where it faces; one that stands, or
    steps sideways or backwards, where it faces. What is no humanoid is heading where its root is turned.
    """
    count = round(MOMENT * clip.fps) + 1
    part = clip.slice(0, count) if frame == 0 else clip.slice(max(0, len(clip) - count), len(clip))
    hips = hips_of(clip.skeleton)
    places = part.positions()[:, hips]
    way = (places[-1] - places[0]) * [1.0, 0.0, 1.0]
    velocity = way / max(len(part) - 1, 1) * clip.fps
    if not body.mapping.usable:
        root = rotations.twist_about(part.kinematics()[0][frame, hips], UP.values)
        return End(places[frame], velocity, float(2 * np.arctan2(root[2], root[0])))
    course = float(facing(body.positions(part)[frame]) * body.hand[0])
    travel = float(np.arctan2(velocity[0], velocity[2]))
    if np.linalg.norm(velocity) > STANDS and abs(wrap(np.array(travel - course))) < FORWARD:
        course = travel
    return End(places[frame], velocity, course)


def ahead(last: End, then: End, yaw: float, seconds: float, rise: float = 0.0) -> Placement:
    """Where a clip that begins as `then`, turned by `yaw`, goes on from `last` after some seconds.

    As far as a pace leads that changes evenly from the one to the other; the height stays, but for `rise`.
    """
    velocity = (last.velocity + turn(then.velocity, np.array(yaw))) / 2
    shift = last.place + seconds * velocity - turn(then.place, np.array(yaw))
    return Placement(yaw, (float(shift[0]), rise, float(shift[2])))


def unhurried_length(last: End, then: End, before: Clip, after: Clip) -> tuple[int, str]:
    """How many frames a transition takes from the end of one clip to the beginning of another, and why.

    Where the other one lies is open; it is turned already, and how it begins. As long as what takes longest:
    the joint that has furthest to turn (at TURN), the hips up or down (RISE), the change of pace (CHANGE),
    and at least a STEP.
    """
    name, turn = _furthest(before.slice(len(before) - 1, len(before)), after.slice(0, 1))
    rise = abs(float(then.place[1] - last.place[1]))
    change = float(np.linalg.norm(then.velocity - last.velocity))
    needed, why = max(
        (STEP, f"a step takes {STEP:.1f} s"),
        (turn / TURN, f"{name} turns by {turn:.0f} degrees at {TURN:.0f} a second"),
        (rise / RISE, f"the hips go {rise:.2f} m up or down at {RISE:.1f} m/s"),
        (change / CHANGE, f"the pace changes by {change:.1f} m/s at {CHANGE:.1f} a second"),
    )
    return max(1, round(float(needed) * before.fps) - 1), why


def plausible_length(start: Clip, last: int, target: Clip, first: int) -> tuple[int, str]:
    """How many frames a motion takes from frame `last` of one clip to frame `first` of another, and why.

    As long as what takes longest: the way of the hips at the pace of the two clips (of the second beside the
    pose; people who stand set off at PACE), the hips up or down (RISE), the joint that has furthest to turn
    (at TURN); of who stands LEAST at least.
    """
    fps = start.fps
    places, paces = [], []
    for clip, frame in ((start, last), (target, first)):
        lo, hi = max(0, frame - round(clip.fps)), min(len(clip), frame + round(clip.fps) + 1)
        hips = clip.slice(lo, hi).positions()[:, hips_of(clip.skeleton)]
        steps = np.linalg.norm(np.diff(hips[:, [0, 2]], axis=0), axis=1) * clip.fps
        paces.append(float(steps.mean()) if len(steps) else 0.0)
        places.append(hips[frame - lo])
    way = float(np.linalg.norm((places[1] - places[0])[[0, 2]]))
    pace = max(paces) if max(paces) > STANDS else PACE
    rise = abs(float(places[1][1] - places[0][1]))
    name, turn = _furthest(start.slice(last, last + 1), target.slice(first, first + 1))
    needed, why = max(
        (LEAST * (max(paces) <= STANDS), f"who stands takes {LEAST:.1f} s at least"),
        (way / pace, f"{way:.2f} m at {pace:.1f} m/s"),
        (rise / RISE, f"the hips go {rise:.2f} m up or down at {RISE:.1f} m/s"),
        (turn / TURN, f"{name} turns by {turn:.0f} degrees at {TURN:.0f} a second"),
    )
    return max(1, round(needed * fps) - 1), why


def _furthest(one: Clip, other: Clip) -> tuple[str, float]:
    """The joint of the body that has furthest to turn from one pose to another, and by how many degrees."""
    skeleton = one.skeleton
    hips = hips_of(skeleton)
    turns = rotations.angle(one.rotation[0], other.rotation[0])
    # Hips may hang from what is no part of the body.
    turns[hips] = rotations.angle(one.kinematics()[0][0, hips], other.kinematics()[0][0, hips])
    body = [hips, *(joint for joint in range(len(skeleton)) if hips in skeleton.ancestors(joint))]
    joint = max(body, key=lambda joint: turns[joint])
    return skeleton.names[joint], float(np.degrees(turns[joint]))
