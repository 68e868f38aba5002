"""What stands still though it should move: poses, joints and places that a tracker or a program held."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from interpose.clip import Clip
from interpose.geometry import rotations
from interpose.geometry.time import runs
from interpose.observation.broken import AROUND
from interpose.observation.corruption import LIMBS
from interpose.observation.finding import NO_GAPS, STUCK, Finding, spoken_of
from interpose.observation.repeated import pace
from interpose.observation.splined import splined
from interpose.observation.steps import STILL, Run, Steps, zero_runs
from interpose.observation.stiff import PACE, even, held, held_place
from interpose.skeletons import SIDES, find_mapping
from interpose.skeletons.carrier import hips_of, line_of, place_of, placed

# A joint that turns less than this in the whole clip (radians) has no data at all, like most fingers.
LIFELESS = 1e-3
# A joint whose like on the other side turns this much in the whole clip (radians), and in this share of its
# frames, has data, too, or had: a spike alone is none.
LIVELY, OFTEN = 1.0, 0.1
# A joint that stands still in more than this share of all steps has no data either: rest poses turn it.
IDLE = 0.9
# So many joints do not stop turning at once by themselves.
MANY = 5
# A joint that stands still without a jump at either end may be at the limit of a hinge: only after a second.
SHORTEST_WITHOUT_JUMP = 1.0
# The least jump of a place, in metres.
JUMP_WAY = 0.02
# What a joint usually moves in the time of a run without a jump, at least: slow joints of files with few
# decimals stand still for long.
EXPECTED_TURN, EXPECTED_WAY = 0.2, 0.2
APART = 3  # frames by which what is held at once may begin and end apart
CALIBRATION = 0.5  # seconds for which a rest pose at an end is held to be measured
MEASURED = ", in the rest pose, as for measuring"
# Seconds for which joints of one limb stand still in the very same frames to an end of the clip: a tracker
# that loses a limb there jumps at no end.
TO_AN_END = 0.3


def stuck(clip: Clip) -> list[Finding]:
    """The findings of `scan` that say where the body is lost, "frozen position" and "frozen body"."""
    if len(clip) <= 2:
        return []
    found = frozen(Steps.of(clip), [])
    lost = [one for one in found if one.kind in STUCK]
    return but_whole(lost, held_or_led(clip, found)) if lost else []


def held_values(clip: Clip, one: Finding) -> tuple[list[int], list[int]]:
    """The joints that do not turn in something frozen, and those whose place stands still: of a body all that
    says where it is."""
    joints = [*range(len(clip.skeleton))] if one.joints is None else [*map(clip.skeleton.index, one.joints)]
    if one.kind == "frozen body":
        return joints, line_of(clip)
    if one.kind == "frozen position":
        return [], [*joints, place_of(clip)] if {*joints} & {*line_of(clip)} else joints
    return joints, joints if one.joints is None else []


def frozen(steps: Steps, findings: list[Finding]) -> list[Finding]:
    """`findings`, and all that is frozen; joints and places that are held at once are one."""
    findings = findings + _runs_of(steps) + _dead(steps)
    return _joined(steps.clip, findings + _held_place(steps.clip, findings))


def measured(clip: Clip) -> np.ndarray:
    """(F,) the frames in which somebody stands in the rest pose to be measured."""
    there = np.zeros(len(clip), bool)
    for one in _runs_of(Steps.of(clip)) if len(clip) > 2 else ():
        if one.note.endswith(MEASURED):
            part = slice(max(one.start - 1, 0), one.stop + 1)  # with the frame that is held
            there[part] |= (clip.rotation[part] == clip.rotation[one.start]).all(axis=(1, 2))
    return there


def _runs_of(steps: Steps) -> list[Finding]:
    """Runs of steps in which poses, joints or places do not change."""
    clip, turned, moved, first = steps.clip, steps.turned, steps.moved, steps.first
    alive = np.flatnonzero(np.nansum(turned, axis=0) > LIFELESS)
    walking = np.flatnonzero((np.nansum(moved, axis=0) > LIFELESS) & ~_resting(clip))
    if not len(alive):
        if len(clip) < max(2, clip.fps):
            return []
        also = "the body neither, " if not len(walking) else ""
        note = f"no joint turns at all, {also}in the whole clip of {len(clip) / clip.fps:.2f} s"
        return [Finding("still", None, first, first + len(turned) + 1, note)]
    whole = np.asarray(steps.still[:, alive].all(axis=1) & steps.stopped[:, walking].all(axis=1))
    poses, stands = _frozen_poses(steps, whole, alive)
    return poses + _frozen_joints(steps, whole, alive) + _frozen_places(steps, whole, walking, stands)


def _resting(clip: Clip) -> np.ndarray:
    """(P,) which places that carry the body stay where they are but for spikes: of a root above the hips."""
    places = clip.translation[:, [clip.translated.index(joint) for joint in placed(clip)]]
    away = np.abs(places - np.median(places, axis=0)).max(axis=-1) > STILL
    return np.array([all(stop - start <= AROUND for start, stop in runs(column)) for column in away.T], bool)


def _frozen_poses(steps: Steps, whole: np.ndarray, alive: np.ndarray) -> tuple[list[Finding], np.ndarray]:
    """Runs of steps (n,) in which the `whole` pose stands still, and the steps (n,) of those in which it does
    so to be measured."""
    clip, found, stands = steps.clip, list[Finding](), np.zeros(len(whole), bool)
    for run in zero_runs(whole, steps.turned[:, alive].max(axis=1), steps.jump(alive)):
        if run.stop - run.start < steps.shortest:
            continue
        begin, end = steps.first + run.start, steps.first + run.stop
        rests = rotations.angle(clip.skeleton.rest_rotation, clip.rotation[begin])[alive] < LIFELESS
        # Who stands in the rest pose does so to be measured.
        rest = rests.mean() > 0.5
        at_end = run.start == 0 or run.stop == len(whole)
        there = rest and end - begin >= CALIBRATION * clip.fps and at_end
        calm = rest or _pace_beside(clip, begin, end) <= PACE
        lost = run.jumps_in or run.jumps_out or not calm
        why = MEASURED if there else ""
        found.append(steps.finding("frozen" if lost and not there else "still", None, run, why))
        # Where that is, is as real.
        stands[run.start : run.stop] |= there
    return found, stands


def _frozen_joints(steps: Steps, whole: np.ndarray, alive: np.ndarray) -> list[Finding]:
    """Joints that stop turning where the `whole` pose does not; those that do so together are one finding."""
    clip, still, turned = steps.clip, steps.still, steps.turned
    # Joints without data but for some steps, like the fingers of many files, are left out.
    lively = [joint for joint in alive.tolist() if _lively(still[:, joint] & ~whole, still[:, joint])]
    together: dict[Run, list[int]] = {}
    pauses: dict[tuple[int, int], list[int]] = {}
    to_an_end: dict[Run, list[int]] = {}
    turnless = still[:, lively].all(axis=1) & ~whole & (len(lively) >= MANY)
    for run in zero_runs(turnless, turned[:, lively].max(axis=1, initial=0.0), steps.jump(lively)):
        if run.stop - run.start >= steps.shortest:
            together[run] = lively
        else:
            turnless[run.start : run.stop] = False
    for joint in lively:
        own = turned[:, joint]
        for run in zero_runs(still[:, joint] & ~whole & ~turnless, own, steps.jump([joint])):
            value = clip.rotation[steps.first + run.start, joint]
            at_limit = rotations.angle(clip.skeleton.rest_rotation[joint], value) < LIFELESS
            told = not at_limit and not steps.rounded[joint]
            usual = np.nanmean(own) / EXPECTED_TURN * told
            if _suspicious(run, steps, usual):
                together.setdefault(run, []).append(joint)
            elif len(run) >= steps.shortest:
                pauses.setdefault((run.start, run.stop), []).append(joint)
                at_end = run.start == 0 or run.stop == len(still)
                if at_end and len(run) >= TO_AN_END * clip.fps and len(run) * usual >= 1:
                    to_an_end.setdefault(run, []).append(joint)
    mapped = find_mapping(clip.skeleton).joints
    for run, joints in to_an_end.items():
        if any(len({*joints} & {mapped[row] for row in rows}) > 1 for rows in LIMBS):
            together.setdefault(run, []).extend(joints)
    found = []
    for run, joints in together.items():
        joints = sorted({*joints, *pauses.pop((run.start, run.stop), [])})
        found.append(steps.finding("frozen", tuple(clip.skeleton.names[joint] for joint in joints), run))
    return found


def _frozen_places(steps: Steps, whole: np.ndarray, walking: np.ndarray, stands: np.ndarray) -> list[Finding]:
    """Places that stop, or stand still for long, while the pose does not; not beside steps in which a body
    `stands` to be measured."""
    clip, found = steps.clip, []
    for column in walking.tolist():
        own = steps.moved[:, column]
        for run in zero_runs(steps.stopped[:, column] & ~whole, own, JUMP_WAY):
            if stands[max(run.start - 1, 0) : run.stop + 1].any():
                continue
            beside = [*own[max(run.start - 1, 0) : run.start], *own[run.stop : run.stop + 1], 0.0]
            stopped_dead = np.nanmax(beside) * clip.fps > PACE and run.stop - run.start >= steps.shortest
            joint = placed(clip)[column]
            # What is no body, as a chair, may stand where it was put.
            pauses = joint not in line_of(clip) and not (run.jumps_in or run.jumps_out)
            if stopped_dead or (_suspicious(run, steps, np.nanmean(own) / EXPECTED_WAY) and not pauses):
                found.append(steps.finding("frozen position", (clip.skeleton.names[joint],), run))
    return found


def _lively(paused: np.ndarray, still: np.ndarray) -> bool:
    """Whether a joint that is `still` in some steps, and alone in those `paused`, has data throughout."""
    longest = max((stop - start for start, stop in runs(paused)), default=0)
    return 2 * longest < len(paused) and bool(still.mean() <= IDLE)


def _suspicious(run: Run, steps: Steps, pace: float) -> bool:
    """Whether a run of one joint is more than a pause; `pace` is 1 / frames in which it usually moves far."""
    if run.jumps_in or run.jumps_out:
        return len(run) >= steps.shortest
    return len(run) >= round(SHORTEST_WITHOUT_JUMP * steps.clip.fps) and len(run) * pace >= 1


def _dead(steps: Steps) -> list[Finding]:
    """Joints of a humanoid that never move, while the same ones of the other side do: one finding."""
    clip, turned = steps.clip, steps.turned
    total, mapping = np.nansum(turned, axis=0), find_mapping(clip.skeleton)
    often = (turned > STILL).mean(axis=0) > OFTEN
    dead = [
        joint
        for joint, side in zip(mapping.joints, SIDES)
        if joint is not None
        and (other := mapping.joints[side]) is not None
        and total[joint] <= LIFELESS
        and total[other] > LIVELY
        and often[other]
        and np.isfinite(turned[:, joint]).all()
    ]
    names = tuple(clip.skeleton.names[joint] for joint in sorted(dead))
    return [Finding("frozen", names, 0, len(clip), "the other side moves")] if dead else []


def _held_place(clip: Clip, findings: list[Finding]) -> list[Finding]:
    """A body whose place is held with a tremble; not what has been found already."""
    lost = spoken_of(clip, findings)
    return [
        Finding(
            "frozen position",
            (clip.skeleton.names[joint],),
            start,
            stop,
            f"the position hardly moves for {(stop - start) / clip.fps:.2f} s, and then jumps",
        )
        for joint, start, stop in held_place(clip)
        if not lost[start : stop + 1, joint].any()
    ]


def _joined(clip: Clip, findings: list[Finding]) -> list[Finding]:
    """Where the place of the body and the turns of its hips are held at once, one finding of both, and of
    whatever else is held just then: trackers that lose a body hold all of it."""
    skeleton = clip.skeleton
    line = {skeleton.names[joint] for joint in line_of(clip)}
    names = {*line, skeleton.names[hips_of(skeleton)]}
    for place in [one for one in findings if one.kind == "frozen position"]:
        same = [
            one
            for one in findings
            if one.kind == "frozen" and one.joints is not None
            if max(abs(one.start - place.start), abs(one.stop - place.stop)) <= APART
        ]
        turns = {name for one in same for name in one.joints or ()}
        if not {*(place.joints or ())} <= line or not turns & names:
            continue
        joints = tuple(name for name in skeleton.names if name in turns)
        note = f"neither moves nor turns for {len(place) / clip.fps:.2f} s, while something else goes on"
        findings = [one for one in findings if one is not place and one not in same]
        findings.append(replace(place, kind="frozen body", joints=joints, note=note))
    return findings


def but_whole(findings: list[Finding], stiff: list[Finding]) -> list[Finding]:
    """`findings` without places that are held as all of the pose is, which is one of those `stiff`."""
    for whole in [one for one in stiff if one.joints is None]:
        within = range(whole.start - MANY, whole.stop + MANY + 1)
        findings = [
            one
            for one in findings
            if one.kind not in STUCK or one.start not in within or one.stop not in within
        ]
    return findings


def held_or_led(clip: Clip, findings: list[Finding]) -> list[Finding]:
    """Joints that are held with a tremble, led straight, or splined; not what has been found already, and not
    beside a pose that stands still: what moves little there sets off."""
    apart = [one for one in findings if one.kind in ("still", "frozen body") or one.kind not in NO_GAPS]
    names, lost = clip.skeleton.names, spoken_of(clip, apart)
    found = []
    for joints, start, stop in held(clip, lost.copy()):
        if not lost[start:stop, list(joints)].any():
            lost[start:stop, list(joints)] = True
            note = f"hardly moves for {(stop - start) / clip.fps:.2f} s, beside a jump"
            some = None if len(joints) == len(names) else tuple(names[joint] for joint in joints)
            found.append(Finding("frozen", some, start, stop, note))
    moving = (np.ptp(rotations.continuous(clip.rotation), axis=0).max(axis=1) > LIFELESS).sum()
    for kind, turns, led in (("straight", "evenly", even), ("splined", "along a smooth curve", splined)):
        for joints, start, stop in led(clip):
            if not lost[start:stop, list(joints)].any():
                lost[start:stop, list(joints)] = True
                some = None if 3 * len(joints) > moving else tuple(names[joint] for joint in joints)
                note = f"turns {turns} for {(stop - start) / clip.fps:.2f} s, as if interpolated"
                found.append(Finding(kind, some, start, stop, note))
    return found


def _pace_beside(clip: Clip, start: int, stop: int) -> float:
    """Metres a second, in the mean over all joints: how fast a body is right before frame `start`, or after
    `stop`, whichever is more."""
    return max((pace(clip, a) for a in (start - 1, stop) if 0 <= a < len(clip) - 1), default=0.0)
