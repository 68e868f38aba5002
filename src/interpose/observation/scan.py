"""Finding what is missing in a clip that does not say so: frozen runs, rest poses at the ends, values that
drop out."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import ndimage

from interpose.clip import Clip
from interpose.geometry import rotations
from interpose.geometry.time import runs
from interpose.observation.broken import AROUND, broken
from interpose.observation.exchange import crossovers, exchanges, put_back
from interpose.observation.observation import Gap, Observation
from interpose.observation.splined import splined
from interpose.observation.stiff import PACE, TELEPORTS, TIMES, even, held, held_place
from interpose.observation.tremor import FEWEST, NOISY, bursts, deviation, restless
from interpose.skeletons import SIDES, find_mapping
from interpose.skeletons.carrier import STILL as UNMOVED
from interpose.skeletons.carrier import hips_of, line_of, placed

# A value that changes less than this from frame to frame stands still: radians and metres. Captured motion
# trembles by 1e-4 and more; files keep about 1e-8.
STILL = 1e-6
# A joint that turns less than this in the whole clip (radians) has no data at all, like most fingers.
LIFELESS = 1e-3
# A joint whose like on the other side turns this much in the whole clip (radians), and in this share of its
# frames, has data, too, or had: a spike alone is none.
LIVELY, OFTEN = 1.0, 0.1
# A joint that stands still in more than this share of all steps has no data either: rest poses turn it.
IDLE = 0.9
# So many joints do not stop turning at once by themselves.
MANY = 5
# Frozen runs shorter than this many seconds are as good as noise; at least 3 frames.
SHORTEST = 0.1
# A joint that stands still without a jump at either end may be at the limit of a hinge: only after a second.
SHORTEST_WITHOUT_JUMP = 1.0
# The least jump, in radians and metres.
JUMP_TURN, JUMP_WAY = 0.01, 0.02
# Where angles are rounded a quick joint stands still for a step or two again and again, and a slow one turns
# for as long: at least so many times, and in so large a share of its pauses, or of its turns. So many
# times what it turns by, in a quarter of its steps at most, is no jump: all three of its angles may take that
# step at once.
PAUSES, BRIEFLY, ROUNDED = 4, 0.5, 2.0
# The mean turn of the joints into a frame that is out of place: radians.
OUTLIER = 0.05
# What a joint usually moves in the time of a run without a jump, at least: slow joints of files with few
# decimals stand still for long.
EXPECTED_TURN, EXPECTED_WAY = 0.2, 0.2
OR = "or in all other frames"  # where limbs change sides once, nobody knows which side of it is wrong
# Runs of so many equal frames are repeated ones where that happens in such a share of all frames.
REPEATS, REPEATING = 3, 0.04
HOLDS, MOSTLY = 0.3, 0.5  # or runs of so many seconds, in such a share: motion that was animated in steps
# Metres a second, in the mean over joints, at which a body moves before and after a frame that is doubled.
MOVES = 0.2
# Kinds of findings that are no gaps.
NO_GAPS = (
    *(
        "still",
        "frozen position",
        "frozen body",
        "splined",
        "lost",
        "exchanged",
        "flipped",
        "jump",
        "repeated",
    ),
    "noisy",
)
STUCK = ("frozen position", "frozen body")
TOLD = 1 / 3  # of the frames in which a joint trembles: found otherwise, it is that
APART = 3  # frames by which what is held at once may begin and end apart
CALIBRATION = 0.5  # seconds for which a rest pose at an end is held to be measured


@dataclass(frozen=True)
class Finding:
    """Something suspicious in a clip.

    Attributes:
        kind: "missing", "frozen", "still", "frozen position", "frozen body", "straight", "splined",
            "rest pose", "outlier", "lost", "exchanged", "flipped", "jump", "doubled", "repeated" or "noisy".
        joints: the joints concerned, or None for the whole pose.
        start, stop: frames start to stop - 1 are those to replace. Of a run of equal frames that is all but
            the one that was held.
        note: one line for a person.
    """

    kind: str
    joints: tuple[str, ...] | None
    start: int
    stop: int
    note: str = ""

    def __len__(self) -> int:
        return self.stop - self.start


def scan(clip: Clip, observation: Observation | None = None) -> list[Finding]:
    """What looks missing, in order of time.

    - "missing": what `observation` says is unknown.
    - "rest pose" or "outlier": a first or last frame that has nothing to do with its neighbour, as in the
      BVH files of the CMU library.
    - "frozen": joints whose local rotation stops changing altogether while it moves elsewhere in the clip,
      for at least .1 s (and 3 frames) with a jump at one end; or for a second in which the joint would
      usually have turned 11 degrees, away from the rest pose: a hinge at its limit has no jump, and files
      write it as their rest pose; or in the very frames in which another does. When everything that moves
      stands still at once, the root's position included, it is one finding of the whole pose; of all joints
      that turn, when the position goes on.
      A limb, or its end, that hardly moves for .3 s (a joint alone for .6 s) and then is elsewhere from one
      frame to the next is frozen, too: trackers hold what they lose with the noise of what they see.
    - "still": a whole pose that stands still without a jump at either end, and that is not met or left at a
      pace of .3 m/s: a statue; or a rest pose of half a second at the beginning or the end, for measuring.
      Nothing is missing.
    - "straight": joints that turn evenly for .3 s, as other programs interpolate; more than a third of all
      that move are the whole pose. Not those that do so in much of the clip: they were animated so.
    - "splined": joints that turn for .4 s along a curve smoother than anybody's motion, as programs ease or
      spline over what they miss, and as animators mend by hand: so that is no gap.
    - "frozen position": the same for a root, or hips, whose position stands still while the pose does not; or
      that stops from one frame to the next.
    - "frozen body": the same, and the hips do not turn either, nor whichever of the listed joints, while
      something else goes on: fingers, a prop, somebody else. `recover` restores both at once.
    - "lost": joints that snap to their rest pose, or jump away and back, for up to a second (where the body
      is, or how its hips face, for up to three), or spikes of up to three frames: what `recover` restores.
    - "exchanged": arms, or legs, that have each other's turns for a while, hands and fingers with them where
      they do: `recover` puts them back.
      Where they do not change back within three seconds it may be in all other frames, and `recover` is told
      which (`frames`).
    - "flipped": a thigh and its shin, or an arm, that are turned by half a turn about the line between their
      ends for a while, so that the knee bends backwards; or a shin that bends so by itself, for however long,
      as where signs were lost: `recover` turns them back.
    - "jump": the body, or joints against its hips, that are elsewhere from one frame to the next, and stay
      there: frames that were cut out, or a tracker that goes on with another marker. Nothing is missing.
    - "doubled": whole frames that are the one before while the body moves at .2 m/s or more on both sides,
      fewer than are frozen: frames that were dropped, and the last one shown once more.
    - "repeated": the same again and again: fewer frames a second than the file says.
    - "noisy": frames in which the body, or a joint by itself, trembles by more than recorded motion does:
      what `denoise` smooths.

    Joints that never move are "frozen" where those of the other side do. Else they are not reported, nor are
    those that stand still for half of the clip at a stretch, or for nine tenths of it in all: they have no
    data to be filled from.
    """
    known = observation or Observation.full(clip)
    known.check(clip)
    gaps = known.gaps(clip.skeleton)
    findings = [Finding("missing", gap.joints, gap.start, gap.stop, "no values") for gap in gaps]
    if len(clip) > 2:
        findings = _looked_at(clip, known, findings)
    return sorted(findings, key=lambda f: (f.start, f.stop, f.joints or ()))


def _looked_at(clip: Clip, known: Observation, findings: list[Finding]) -> list[Finding]:
    """`findings`, and what the values themselves tell: each look leaves out what an earlier one explains."""
    turned, moved = _steps(clip, known)
    findings = findings + (outliers := _strays(clip, turned))
    odd = {stray.start for stray in outliers}
    first, last = int(0 in odd), len(clip) - int(len(clip) - 1 in odd)
    turned, moved = turned[first : last - 1], moved[first : last - 1]
    findings += _frozen(clip, turned, moved, first)
    findings += _dead(clip, turned)
    findings = _bodies(clip, findings + _held_place(clip, findings))
    swapped, names = exchanges(clip), clip.skeleton.names
    findings += [
        Finding(one.kind, tuple(names[j] for j in one.joints), one.start, one.stop, one.note)
        for one in swapped
    ]
    clip = put_back(clip, swapped)
    either = [
        Finding(one.kind, tuple(names[j] for j in one.joints), one.start, one.stop, f"{one.note}, {OR}")
        for one in crossovers(clip)
    ]
    # They explain what jumps at their ends, and nothing in between.
    ends = [
        replace(one, start=end - 1, stop=end + 1)
        for one in either
        for end in (one.start, one.stop)
        if end < len(clip)
    ]
    findings += ends
    stiff = _stiff(clip, findings)
    findings = _but_whole(findings, stiff) + stiff
    repeated, brief = _repeated(turned, moved, first, clip.fps), round(HOLDS * clip.fps)
    for again in repeated:
        # What stands still for a moment, again and again, is that.
        findings = [
            one
            for one in findings
            if one.kind not in ("frozen", "still")
            or len(one) > brief
            or one.stop < again.start - 1
            or one.start > again.stop + 1
        ]
    # What repeats spans all else, and says nothing of it.
    if not repeated:
        findings += _doubled(clip, turned, moved, first)
    findings += repeated + _lost(clip, findings)
    if not repeated:
        findings += _jumps(clip, known, findings)
        findings += _noisy(clip, known, findings)
    return [one for one in findings if one not in ends] + either


def strays(clip: Clip) -> list[int]:
    """The frames among the first and the last that `scan` calls a rest pose or an outlier."""
    if len(clip) <= 2:
        return []
    return [one.start for one in _strays(clip, _steps(clip, Observation.full(clip))[0])]


def stuck(clip: Clip) -> list[Finding]:
    """The findings of `scan` that say where the body is lost, "frozen position" and "frozen body"."""
    if len(clip) <= 2:
        return []
    turned, moved = _steps(clip, Observation.full(clip))
    odd = {one.start for one in _strays(clip, turned)}
    first, last = int(0 in odd), len(clip) - int(len(clip) - 1 in odd)
    found = _frozen(clip, turned[first : last - 1], moved[first : last - 1], first)
    found = _bodies(clip, found + _held_place(clip, found))
    lost = [one for one in found if one.kind in STUCK]
    return _but_whole(lost, _stiff(clip, found)) if lost else []


def repeats(clip: Clip) -> np.ndarray:
    """(F,) booleans: the frames that "repeated" of `scan` counts, which are the one before."""
    again = np.zeros(len(clip), bool)
    if len(clip) > 2:
        turned, moved = _steps(clip, Observation.full(clip))
        odd = {one.start for one in _strays(clip, turned)}
        first, last = int(0 in odd), len(clip) - int(len(clip) - 1 in odd)
        for start, stop in _holds(turned[first : last - 1], moved[first : last - 1], clip.fps):
            again[first + start + 1 : first + stop + 1] = True
    return again


def intact(clip: Clip) -> Observation:
    """What is left of a clip without values that were lost for moments, as `broken`: where frames are
    repeated, in steps that are none, by the others."""
    again = repeats(clip)
    if not again.any():
        return broken(clip)
    kept = ~again
    seen = broken(replace(clip.take(kept), fps=clip.fps * float(kept.mean())))
    at = np.cumsum(kept) - 1
    return Observation(seen.rotation[at], seen.translation[at])


def stays(clip: Clip) -> bool:
    """Whether nothing ever leaves its place, as of suits that know no places."""
    return len(clip) > 1 and float(np.ptp(clip.translation, axis=0).max()) < UNMOVED


def to_gaps(findings: Iterable[Finding]) -> list[Gap]:
    """The gaps to fill. A frozen position is none: a gap cannot be in the root's position alone. Nor are
    values that drop out: `recover` finds both by itself."""
    return [Gap(f.start, f.stop, f.joints) for f in findings if f.kind not in NO_GAPS]


def _steps(clip: Clip, known: Observation) -> tuple[np.ndarray, np.ndarray]:
    """Change from frame to frame: turns (F - 1, J), and ways (F - 1, P) of the joints `placed`; NaN where
    unknown."""
    placing = placed(clip)
    # The chord of two quaternions: as good as the angle for small ones, and quick on long clips.
    q = rotations.continuous(clip.rotation)
    turned = 2.0 * np.linalg.norm(np.diff(q, axis=0), axis=-1)
    moved = np.diff(clip.translation[:, [clip.translated.index(joint) for joint in placing]], axis=0)
    moved = np.linalg.norm(moved, axis=-1)
    turned[~(known.rotation[1:] & known.rotation[:-1])] = np.nan
    position = known.translation[:, placing]
    moved[~(position[1:] & position[:-1])] = np.nan
    return turned, moved


def _strays(clip: Clip, turned: np.ndarray) -> list[Finding]:
    """Of a first and a last frame that have nothing to do with their neighbours; `turned` as in `_steps`."""
    found = []
    for frame, step, beside in ((0, 0, "after"), (len(clip) - 1, len(turned) - 1, "before")):
        if kind := _outlier(clip, turned, frame, step):
            note = f"nothing to do with the frame {beside} it"
            found.append(Finding(kind, None, frame, frame + 1, note))
    return found


def _outlier(clip: Clip, turned: np.ndarray, frame: int, step: int) -> str | None:
    """What the first or last frame is, given the step between it and its neighbour."""
    mean = np.nan_to_num(turned).mean(axis=1)
    others = np.delete(mean, step)
    if (
        mean[step] < OUTLIER
        or mean[step] < 2 * np.percentile(others, 99)
        or mean[step] < 10 * np.median(others)
    ):
        return None
    rest = rotations.angle(clip.skeleton.rest_rotation, clip.rotation[frame]) < 0.01
    return "rest pose" if rest.mean() > 0.5 else "outlier"


@dataclass(frozen=True)
class Run:
    """Steps start to stop - 1 are zero; does the step into the run, and the one out of it, jump?"""

    start: int
    stop: int
    jumps_in: bool
    jumps_out: bool


def _runs(zero: np.ndarray, steps: np.ndarray, least: float) -> Iterator[Run]:
    """Runs of True in `zero` (n,). A jump is a step above `least` and three times those next to it."""

    def jumps(near: np.ndarray) -> bool:
        return len(near) > 1 and bool(near[0] > least and near[0] > 3 * np.nanmax(near[1:], initial=0.0))

    edges = np.flatnonzero(np.diff(np.concatenate([[False], zero, [False]])))
    for start, stop in zip(edges[::2].tolist(), edges[1::2].tolist()):
        into, out = steps[max(start - 4, 0) : start][::-1], steps[stop : stop + 4]
        yield Run(start, stop, jumps(into), jumps(out))


@dataclass(frozen=True)
class _Steps:
    """The steps between the frames `first`, first + 1, ... of a clip: turns (n, J) and ways (n, P) as in
    `_steps`, and which of them are none."""

    clip: Clip
    turned: np.ndarray
    moved: np.ndarray
    first: int
    still: np.ndarray
    stopped: np.ndarray

    @property
    def shortest(self) -> int:
        """How many steps a frozen run has, at least."""
        return _shortest(self.clip.fps)

    @cached_property
    def rounded(self) -> np.ndarray:
        """(J,) radians by which joints turn that are rounded; 0 for all others."""
        found = np.zeros(self.still.shape[1])
        for joint, still in enumerate(self.still.T):
            brief = ([stop - start < self.shortest for start, stop in runs(part)] for part in (still, ~still))
            if any(sum(few) >= max(PAUSES, BRIEFLY * len(few)) for few in brief):
                turns = self.turned[~still & np.isfinite(self.turned[:, joint]), joint]
                found[joint] = np.percentile(turns, 25) if turns.size else 0.0
        return found

    def jump(self, joints: Sequence[int] | np.ndarray) -> float:
        """Radians that the turns of joints are more than, if one jumps."""
        return max(JUMP_TURN, ROUNDED * float(np.median(self.rounded[joints]))) if len(joints) else JUMP_TURN

    def finding(self, kind: str, joints: tuple[str, ...] | None, run: Run, why: str = "") -> Finding:
        """What a run says."""
        # Steps start..stop - 1 are zero, so frames start..stop are equal. One of them is good, unless both
        # ends jump: the first, which was held, or the last where the clip begins with the run.
        begin = run.start + (0 if run.jumps_in or run.start == 0 else 1)
        end = run.stop + (0 if run.start == 0 and not run.jumps_out else 1)
        what = "the position stands" if kind == "frozen position" else "nothing moves"
        if kind == "still" and not why:
            to_end = run.stop == len(self.turned)
            why = f", {'to the end, ' * to_end}and comes to rest {'' if to_end else 'and sets off '}by itself"
        note = f"{what} for {(run.stop - run.start) / self.clip.fps:.2f} s{why}"
        return Finding(kind, joints, self.first + begin, self.first + end, note)


def _shortest(fps: float) -> int:
    return max(3, round(SHORTEST * fps))


def _frozen(clip: Clip, turned: np.ndarray, moved: np.ndarray, first: int) -> list[Finding]:
    """Frozen runs; the steps are those between the frames `first`, first + 1, ..."""
    with np.errstate(invalid="ignore"):
        steps = _Steps(clip, turned, moved, first, turned < STILL, moved < STILL)
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


def _frozen_poses(steps: _Steps, whole: np.ndarray, alive: np.ndarray) -> tuple[list[Finding], np.ndarray]:
    """Runs of steps (n,) in which the `whole` pose stands still, and the steps (n,) of those in which it does
    so to be measured."""
    clip, found, stands = steps.clip, list[Finding](), np.zeros(len(whole), bool)
    for run in _runs(whole, steps.turned[:, alive].max(axis=1), steps.jump(alive)):
        if run.stop - run.start < steps.shortest:
            continue
        begin, end = steps.first + run.start, steps.first + run.stop
        rests = rotations.angle(clip.skeleton.rest_rotation, clip.rotation[begin]) < LIFELESS
        # Who stands in the rest pose does so to be measured.
        rest = rests.mean() > 0.5
        at_end = run.start == 0 or run.stop == len(whole)
        measured = rest and end - begin >= CALIBRATION * clip.fps and at_end
        calm = rest or _pace_beside(clip, begin, end) <= PACE
        lost = run.jumps_in or run.jumps_out or not calm
        why = ", in the rest pose, as for measuring" if measured else ""
        found.append(steps.finding("frozen" if lost and not measured else "still", None, run, why))
        # Where that is, is as real.
        stands[run.start : run.stop] |= measured
    return found, stands


def _frozen_joints(steps: _Steps, whole: np.ndarray, alive: np.ndarray) -> list[Finding]:
    """Joints that stop turning where the `whole` pose does not; those that do so together are one finding."""
    clip, still, turned = steps.clip, steps.still, steps.turned
    # Joints without data but for some steps, like the fingers of many files, are left out.
    lively = [joint for joint in alive.tolist() if _lively(still[:, joint] & ~whole, still[:, joint])]
    together: dict[Run, list[int]] = {}
    pauses: dict[tuple[int, int], list[int]] = {}
    turnless = still[:, lively].all(axis=1) & ~whole & (len(lively) >= MANY)
    for run in _runs(turnless, turned[:, lively].max(axis=1, initial=0.0), steps.jump(lively)):
        if run.stop - run.start >= steps.shortest:
            together[run] = lively
        else:
            turnless[run.start : run.stop] = False
    for joint in lively:
        own = turned[:, joint]
        for run in _runs(still[:, joint] & ~whole & ~turnless, own, steps.jump([joint])):
            value = clip.rotation[steps.first + run.start, joint]
            at_limit = rotations.angle(clip.skeleton.rest_rotation[joint], value) < LIFELESS
            told = not at_limit and not steps.rounded[joint]
            if _suspicious(run, clip.fps, np.nanmean(own) / EXPECTED_TURN * told):
                together.setdefault(run, []).append(joint)
            elif run.stop - run.start >= steps.shortest:
                pauses.setdefault((run.start, run.stop), []).append(joint)
    found = []
    for run, joints in together.items():
        joints = sorted({*joints, *pauses.pop((run.start, run.stop), [])})
        found.append(steps.finding("frozen", tuple(clip.skeleton.names[joint] for joint in joints), run))
    return found


def _frozen_places(
    steps: _Steps, whole: np.ndarray, walking: np.ndarray, stands: np.ndarray
) -> list[Finding]:
    """Places that stop, or stand still for long, while the pose does not; not beside steps in which a body
    `stands` to be measured."""
    clip, found = steps.clip, []
    for column in walking.tolist():
        own = steps.moved[:, column]
        for run in _runs(steps.stopped[:, column] & ~whole, own, JUMP_WAY):
            if stands[max(run.start - 1, 0) : run.stop + 1].any():
                continue
            beside = [*own[max(run.start - 1, 0) : run.start], *own[run.stop : run.stop + 1], 0.0]
            stopped_dead = np.nanmax(beside) * clip.fps > PACE and run.stop - run.start >= steps.shortest
            if stopped_dead or _suspicious(run, clip.fps, np.nanmean(own) / EXPECTED_WAY):
                name = clip.skeleton.names[placed(clip)[column]]
                found.append(steps.finding("frozen position", (name,), run))
    return found


def _held_place(clip: Clip, findings: list[Finding]) -> list[Finding]:
    """A body whose place is held with a tremble; not what has been found already."""
    lost = _found(clip, findings)
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


def _bodies(clip: Clip, findings: list[Finding]) -> list[Finding]:
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


def _but_whole(findings: list[Finding], stiff: list[Finding]) -> list[Finding]:
    """`findings` without places that are held as all of the pose is, which is one of those `stiff`."""
    for whole in [one for one in stiff if one.joints is None]:
        within = range(whole.start - MANY, whole.stop + MANY + 1)
        findings = [
            one
            for one in findings
            if one.kind not in STUCK or one.start not in within or one.stop not in within
        ]
    return findings


def _pace_beside(clip: Clip, start: int, stop: int) -> float:
    """Metres a second, in the mean over all joints: how fast a body is right before frame `start`, or after
    `stop`, whichever is more."""
    return max((_pace(clip, a) for a in (start - 1, stop) if 0 <= a < len(clip) - 1), default=0.0)


def _pace(clip: Clip, frame: int) -> float:
    """Metres a second, in the mean over all joints, from a frame to the next."""
    step = np.diff(clip.slice(frame, frame + 2).positions(), axis=0)
    return float(np.linalg.norm(step, axis=-1).mean() * clip.fps)


def _dead(clip: Clip, turned: np.ndarray) -> list[Finding]:
    """Joints of a humanoid that never move, while the same ones of the other side do: one finding."""
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


def _stiff(clip: Clip, findings: list[Finding]) -> list[Finding]:
    """Joints that are held with a tremble, led straight, or splined; not what has been found already, and not
    beside a pose that stands still: what moves little there sets off."""
    apart = [one for one in findings if one.kind == "still" or one.kind not in NO_GAPS]
    names, lost = clip.skeleton.names, _found(clip, apart)
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


def _found(clip: Clip, findings: list[Finding]) -> np.ndarray:
    """(F, J) what findings speak of."""
    lost = np.zeros((len(clip), len(clip.skeleton)), bool)
    for one in findings:
        joints = slice(None) if one.joints is None else [clip.skeleton.index(name) for name in one.joints]
        lost[one.start : one.stop, joints] = True
    return lost


def _lost(clip: Clip, findings: list[Finding]) -> list[Finding]:
    """Values that drop out, but those that have been found already; joints that do so together are one."""
    seen = intact(clip)
    # Joints that stand still for most of the clip have no data to be restored from, but for spikes.
    turned, _ = _steps(clip, Observation.full(clip))
    gone = ~(seen.rotation & seen.translation) & ~_found(clip, findings)
    for joint in np.flatnonzero((turned > STILL).mean(axis=0) <= 0.5):
        for start, stop in runs(gone[:, joint]):
            gone[start:stop, joint] = stop - start <= AROUND
    together: dict[tuple[int, int], list[str]] = {}
    for name, column in zip(clip.skeleton.names, gone.T):
        for run in runs(column):
            together.setdefault(run, []).append(name)
    found = []
    for (start, stop), names in together.items():
        at_end = "comes from elsewhere" * (start == 0) or "jumps away" * (stop == len(clip))
        found.append(Finding("lost", tuple(names), start, stop, at_end or "jumps away and back"))
    return found


def _jumps(clip: Clip, known: Observation, findings: list[Finding]) -> list[Finding]:
    """Where the body, or joints of it, are elsewhere from one frame to the next; not beside what has been
    found already, which begins and ends so."""
    positions, hips = clip.positions(), hips_of(clip.skeleton)
    around = positions - positions[:, [hips]]
    around[:, hips] = positions[:, hips]
    seen = known.positions(clip.skeleton)
    steps = np.linalg.norm(np.diff(around, axis=0), axis=-1)
    steps[~(seen[1:] & seen[:-1])] = 0.0
    beside = ndimage.maximum_filter(steps, footprint=[[1]] * 3 + [[0]] + [[1]] * 3, mode="nearest")
    jumps = (steps > TELEPORTS) & (steps > TIMES * beside)
    for one in findings:
        jumps[max(one.start - 2, 0) : one.stop + 1] = False
    found = []
    for step in np.flatnonzero(jumps.any(axis=1)).tolist():
        joint = int(steps[step].argmax())
        way = float(steps[step, hips] if jumps[step, hips] else steps[step, joint])
        speed = f"{way:.2f} m further from one frame to the next, {way * clip.fps:.0f} m/s"
        what = "the body is" if jumps[step, hips] else f"{clip.skeleton.names[joint]} is"
        joints = None if jumps[step, hips] else _turning(clip, np.flatnonzero(jumps[step]).tolist())
        found.append(Finding("jump", joints, step + 1, step + 2, f"{what} {speed}"))
    return found


def _doubled(clip: Clip, turned: np.ndarray, moved: np.ndarray, first: int) -> list[Finding]:
    """Single frames, or a few, that are the one before though the body moves; steps as in `_frozen`."""
    found, still = [], _still(turned, moved)
    for start, stop in runs(still):
        before, after = first + start, first + stop  # the frame that is shown again, and the last that is it
        if stop - start >= _shortest(clip.fps) or start == 0 or stop == len(still):
            continue
        if min(_pace(clip, before - 1), _pace(clip, after)) >= MOVES:
            note = "the frame before once more, while the body moves"
            found.append(Finding("doubled", None, before + 1, after + 1, note))
    return found


def _repeated(turned: np.ndarray, moved: np.ndarray, first: int, fps: float) -> list[Finding]:
    """Frames that are the one before though the body moves: one finding; steps as in `_frozen`."""
    brief = _holds(turned, moved, fps)
    if not brief:
        return []
    again, start, stop = sum(stop - start for start, stop in brief), brief[0][0], brief[-1][1]
    real = fps * (1 - again / (stop - start))
    note = f"{again} frames are the one before: {real:.0f} frames a second, in a file of {fps:.4g}"
    return [Finding("repeated", None, first + start + 1, first + stop + 1, note)]


def _holds(turned: np.ndarray, moved: np.ndarray, fps: float) -> list[tuple[int, int]]:
    """Runs of steps in which nothing moves, again and again; none where that is the exception."""
    same = _still(turned, moved)
    for longest, often in ((REPEATS, REPEATING), (round(HOLDS * fps), MOSTLY)):
        brief = [run for run in runs(same) if run[1] - run[0] <= longest]
        inside = [run for run in brief if run[0] > 0 and run[1] < len(same)]
        again = sum(stop - start for start, stop in inside)
        if len(inside) >= MANY and again >= often * (inside[-1][1] - inside[0][0]):
            return brief
    return []


def _still(turned: np.ndarray, moved: np.ndarray) -> np.ndarray:
    """(F - 1,) the steps in which nothing moves; unknown values do."""
    with np.errstate(invalid="ignore"):
        return np.asarray((turned < STILL).all(axis=1) & (moved < STILL).all(axis=1))


def _noisy(clip: Clip, known: Observation, findings: list[Finding]) -> list[Finding]:
    """Frames in which the body trembles, or joints do of which nothing else is found, where all is known."""
    if not known.complete or len(clip) < FEWEST:
        return []
    clip = _led_over(clip, findings)
    places = clip.positions()
    all_along = [(0, len(clip))] if deviation(places).mean() > NOISY else []
    found = [
        Finding(
            "noisy", None, a, b, f"trembles by {100 * deviation(places[a:b]).mean():.1f} cm along each axis"
        )
        for a, b in bursts(clip) or all_along
    ]
    for a, b, joints in [] if all_along else restless(clip):
        turns = 2 * np.degrees(deviation(rotations.continuous(clip.rotation[a:b, list(joints)])))
        named = tuple(clip.skeleton.names[joint] for joint in joints)
        note = f"trembles by {turns.max():.1f} degrees about each axis"
        told = np.zeros(b - a, bool)
        for one in findings:
            if one.joints and {*one.joints} & {*named}:
                told[max(one.start - a, 0) : max(one.stop - a, 0)] = True
        # Single spikes of what trembles are part of it.
        if told.mean() < TOLD:
            found.append(Finding("noisy", named, a, b, note))
    return found


def _led_over(clip: Clip, findings: list[Finding]) -> Clip:
    """The clip with values that lead straight over what is lost: to jump there and back is no trembling."""
    rotation, translation = clip.rotation.copy(), clip.translation.copy()
    for one in findings:
        if one.kind not in ("lost", "frozen", *STUCK) or not 0 < one.start < one.stop < len(clip):
            continue
        part, ends = slice(one.start, one.stop), [one.start - 1, one.stop]
        joints = [*map(clip.skeleton.index, clip.skeleton.names if one.joints is None else one.joints)]
        columns = [clip.translated.index(joint) for joint in joints if joint in clip.translated]
        share = np.arange(1, len(one) + 1)[:, None] / (len(one) + 1)
        before, after = rotation[ends][:, joints]
        rotation[part, joints] = rotations.slerp(before[None], after[None], share)
        near, far = translation[ends][:, columns]
        translation[part, columns] = near + share[..., None] * (far - near)
    return clip.with_motion(rotation, translation)


def _turning(clip: Clip, joints: list[int]) -> tuple[str, ...]:
    """The names of the joints that jump themselves, where `joints` are elsewhere: what those hang from, of
    those that hang from none of the others."""
    skeleton = clip.skeleton
    top = [joint for joint in joints if not {*skeleton.ancestors(joint)} & {*joints}]
    turned = dict.fromkeys(max(skeleton.parents[joint], 0) for joint in top)
    return tuple(skeleton.names[joint] for joint in turned)


def _lively(paused: np.ndarray, still: np.ndarray) -> bool:
    """Whether a joint that is `still` in some steps, and alone in those `paused`, has data throughout."""
    longest = max((stop - start for start, stop in runs(paused)), default=0)
    return 2 * longest < len(paused) and bool(still.mean() <= IDLE)


def _suspicious(run: Run, fps: float, pace: float) -> bool:
    """Whether a run of one joint is more than a pause; `pace` is 1 / frames in which it usually moves far."""
    length = run.stop - run.start
    if run.jumps_in or run.jumps_out:
        return length >= _shortest(fps)
    return length >= round(SHORTEST_WITHOUT_JUMP * fps) and length * pace >= 1
