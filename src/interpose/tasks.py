"""What the verbs mean: say what is observed, choose a method for each gap, window the clip, complete, report.

Every gap is completed in a window of its own, cut from observed frames on both sides, with all other gaps
hidden. So gaps do not depend on each other, and a long clip costs no more memory than its own values.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from interpose.clip import Clip
from interpose.errors import RequestError
from interpose.finish import Completion, GapReport, Report, complete, on_rig_of, seams
from interpose.finish import pins as pinning
from interpose.finish.denoise import denoised
from interpose.finish.feet import legs
from interpose.finish.guarantees import wipe
from interpose.finish.measures import acceleration
from interpose.finish.path import spans as path_spans
from interpose.finish.report import JointMoments, Provenance
from interpose.finish.windows import ramp
from interpose.geometry import rotations
from interpose.geometry.time import runs
from interpose.methods import auto, registry
from interpose.methods.classical import Spline
from interpose.methods.protocol import Method, Raw, Sampler
from interpose.observation import Gap, Observation, Part, Pin, timeline
from interpose.observation.broken import broken, roughness
from interpose.observation.exchange import Exchange, Flip, exchanges, put_back
from interpose.observation.part import lay, misfits
from interpose.observation.scan import strays, stuck
from interpose.skeletons import find_humanoid
from interpose.skeletons.carrier import placed as placing

CONTEXT = 2.0  # seconds of the clip on both sides of a gap that a method sees
PIECE = 20.0  # seconds: joints that are missing for longer are completed piece by piece ...
GROUP = 8.0  # seconds: gaps near each other are completed at once up to this length
OVERLAP = 1.0  # ... which overlap by this much and are blended there
# Seconds by which a transition may be longer than it has to be, where feet slide less so; seconds of motion
# on either side with which that is tried; metres that feet have to travel in it; and the slide (cm/s) that
# counts as much as gliding all along.
TRIED, BESIDE, TRAVELS, GLIDING = 1.0, 0.7, 0.2, 50.0
# A moment is mended by the shortest way where velocities jump by less than this share of what they do else.
CALMER = 0.7
MOMENT = 0.37  # seconds: values of single joints that are lost for at most so long are interpolated
AHEAD = 2.0  # seconds that a forecast goes on for, if nobody says how long
HOTTEST = 10.0  # times the noise of the training that may be injected
STRONGEST = 100.0  # how many times the estimated noise may be assumed


@dataclass(frozen=True)
class Job:
    """A run of frames in which something is missing, its number in order of time, and who fills it."""

    number: int
    gap: Gap
    method: Method | None  # None: it stays open
    note: str | None = None


def fill(
    clip: Clip,
    gaps: Sequence[Gap] | Observation,
    method: str = "auto",
    max_gap: int | None = None,
    only: Sequence[int] | None = None,
    seed: int | None = None,
    methods: Mapping[int, str] | None = None,
    progress: Callable[[float], None] | None = None,
    action: str = "",
    parts: Sequence[Part] = (),
    path: Mapping[int, Any] | None = None,
    pins: Sequence[Pin] = (),
    temperature: float = 1.0,
    zero: int = 0,
) -> Completion:
    """Fill gaps of a clip. What is observed comes back unchanged, bit for bit.

    Args:
        clip: F frames; its values inside the gaps have no influence.
        gaps: what is missing, or an observation that says for every value whether it is known. Gaps that
            touch or overlap count as one.
        method: a name of `methods.registry.names()`, or "auto" for what measured best at each gap's length:
            values that an observation misses for moments it interpolates one by one.
        max_gap: frames; longer gaps stay open.
        only: numbers of the gaps to fill, counted from 1 in order of time; the others stay open.
        seed: for methods that sample.
        methods: the method of single gaps by number, in place of `method`.
        progress: called with the share done, 0 to 1.
        action: what the motion in the gaps is, for methods that know actions; "auto" then is one of them.
        parts: poses of single joints that other clips give inside of the gaps; of other rigs they are brought
            onto this one's first.
        path: x and z in metres that the hips are led over, by frame; inside of gaps of the whole pose.
        pins: where joints are to be, or how turned, at frames of gaps; besides those of an observation.
        temperature: for methods that sample, how far their answers lie apart; 1 is as in training.
        zero: the frame that notes call 0.

    Returns:
        The completion; `report.open` lists the gaps left open.

    Raises:
        RequestError: a range, a joint, a gap number, a method or an action that does not exist; nothing
            observed; a part that does not fit; a path, or a pin, outside of the gaps.
    """
    observation = gaps if isinstance(gaps, Observation) else Observation.from_gaps(clip, gaps)
    observation.check(clip)
    if seed is not None and seed < 0:
        raise RequestError(f"cannot take the seed {seed}", "it is a number from 0 on", "Write --seed 1.")
    observation = replace(observation, pins=(*observation.pins, *pins))
    clip, observation = lay(clip, observation, fitted(parts, clip))
    momentary = isinstance(gaps, Observation) and not observation.pins
    brief = _momentary(clip, observation) if momentary else None
    if brief and method in ("auto", "spline"):
        mended, seen = _mended(clip, observation, brief)
        rest = fill(
            mended, seen, method, max_gap, only, seed, methods, progress, action, (), path, (), temperature
        )
        return _with_moments(rest, clip, brief)
    if not (observation.rotation.any() or observation.translation[:, list(clip.translated)].any()):
        raise RequestError(
            "there is nothing to go by",
            "no value of the clip is observed, so any motion would do",
            "Leave at least one frame out of the gaps.",
        )
    whole, clip = clip, _handed(clip, observation)
    path_spans(clip, observation, path or ())
    jobs = plan(clip, observation, method, max_gap, only, methods or {}, action, temperature)
    for frame in path or {}:
        if any(job.method is None and job.gap.start <= frame < job.gap.stop for job in jobs):
            raise RequestError(
                f"the path leads through a gap that stays open: frame {frame}",
                "the gap is longer than allowed, or not among the gaps chosen",
                "Leave the point out, or let the gap be filled.",
            )
    rotation, translation = clip.rotation.copy(), clip.translation.copy()
    provenance = np.zeros(rotation.shape[:2], np.int8)
    said: list[tuple[int, slice, Raw]] = []
    reports: list[GapReport] = []
    limit = seams.limit(clip, observation) if any(job.method for job in jobs) else None
    work = [(group, one) for group in _together(jobs, clip, observation) for one in group.methods]
    for done, (group, chosen) in enumerate(work):
        margin = round(CONTEXT * clip.fps)
        lo, hi = max(0, group.pieces[0].start - margin), min(len(clip), group.pieces[-1].stop + margin)
        pieces = [piece for piece in group.pieces if piece.job.method == chosen]
        led = {frame for piece in pieces for frame in range(piece.start, piece.stop)}
        way = {f - lo: np.array(point, float) for f, point in (path or {}).items() if f in led}
        # The file tells what its joints can do, and is not what the window is written to.
        window, seen = replace(clip.slice(lo, hi), source=clip.source), observation.slice(lo, hi)
        part = complete(window, seen, chosen, seed, limit=limit, path=way, first=lo - zero)
        for job, start, stop in pieces:
            fade = min(round(OVERLAP * clip.fps), stop - start) if start > job.gap.start else 0
            inside = slice(start - lo, stop - lo)
            _paste(rotation, part.clip.rotation, observation.rotation, start, inside, fade)
            known = observation.translation[:, list(clip.translated)]
            _paste(translation, part.clip.translation, known, start, inside, fade)
            provenance[start:stop] = part.provenance[inside]
            said.append((start, inside, part.raw))
            reports += _shifted(part.report.gaps, lo, start, stop, job)
        if progress:
            progress((done + 1) / len(work))
    reports.sort(key=lambda gap: (gap.number, gap.start))
    reports = _joined(reports)
    left = [job.gap for job in jobs if job.method is None]
    report = Report(method, reports, left, action)
    return Completion(
        whole.with_motion(rotation, translation), lambda: _put_together(whole, said), provenance, report
    )


def fitted(parts: Iterable[Part], clip: Clip) -> list[Part]:
    """Parts on the skeleton of a clip, whatever rig they are of."""
    return [replace(part, clip=on_rig_of(part.clip, clip)) if misfits(clip, part) else part for part in parts]


def _momentary(clip: Clip, observation: Observation) -> Observation | None:
    """Which values are lost only for moments in frames of which something is known; None if there are none.

    "True" means lost here. Shorter than what `auto` gives to a network, with known values on both sides: the
    velocities there make interpolation continuous, so nothing needs to be eased. Measured on validation
    performers with rotations dropped at random, p .3 and .5: joints are off by .08 and .19 cm so, and by .33
    and .64 when each such run is eased like a gap.
    """
    longest = round(MOMENT * clip.fps)
    some = np.asarray(observation.rotation.any(axis=1))
    masks: list[np.ndarray] = []
    for known in (observation.rotation, observation.translation):
        lost = np.zeros(known.shape, bool)
        for joint in np.flatnonzero(~known.all(axis=0)):
            for start, stop in runs(np.logical_not(known[:, joint])):
                if start > 0 and stop < len(known) and stop - start <= longest and some[start:stop].all():
                    lost[start:stop, joint] = True
        masks.append(lost)
    return Observation(masks[0], masks[1]) if any(mask.any() for mask in masks) else None


def _mended(clip: Clip, observation: Observation, lost: Observation) -> tuple[Clip, Observation]:
    """The clip with what was lost for moments interpolated, and an observation to which that is known.

    By a spline, or where what it goes by is no velocity but another spike, by the shortest way.
    """
    hidden, columns = wipe(clip, observation), list(clip.translated)

    def laid(said: Clip) -> Clip:
        return clip.with_motion(
            np.where(lost.rotation[..., None], said.rotation, clip.rotation),
            np.where(lost.translation[:, columns, None], said.translation, clip.translation),
        )

    mended, straight = laid(Spline().complete(hidden, observation).clip), laid(hidden)
    for start, stop, (curved, short) in roughness(lost.rotation | lost.translation, mended, straight):
        if short.max() < CALMER * curved.max():
            mended.rotation[start:stop] = straight.rotation[start:stop]
            mended.translation[start:stop] = straight.translation[start:stop]
    known = replace(
        observation,
        rotation=observation.rotation | lost.rotation,
        translation=observation.translation | lost.translation,
    )
    return mended, known


def _with_moments(done: Completion, clip: Clip, lost: Observation) -> Completion:
    """A completion that also tells what had been lost for moments."""
    either = lost.rotation | lost.translation
    moments = tuple(
        JointMoments(clip.skeleton.names[j], tuple(f"{a}:{b}" for a, b in runs(either[:, j])))
        for j in np.flatnonzero(either.any(axis=0))
    )
    provenance = np.where(either, np.int8(Provenance.METHOD), done.provenance)
    return replace(done, provenance=provenance, report=replace(done.report, moments=moments))


def _handed(clip: Clip, observation: Observation) -> Clip:
    """The clip with its handedness said, from all that is observed of it: single gaps must not decide."""
    frames = np.flatnonzero(observation.frames)
    if "hand" in clip.skeleton.roles or not frames.size:
        return clip
    frames = frames[:: max(1, frames.size // 200)]
    body = find_humanoid(clip.with_motion(clip.rotation[frames], clip.translation[frames]))
    roles = {**clip.skeleton.roles, "hand": "left" if body.left_handed else "right"}
    return replace(clip, skeleton=replace(clip.skeleton, roles=roles))


def recover(
    clip: Clip,
    joints: Sequence[str] | None = None,
    frames: tuple[int, int] | None = None,
    method: str = "auto",
    seed: int | None = None,
    progress: Callable[[float], None] | None = None,
    place: bool = False,
) -> Completion:
    """Recover joints whose local rotations are unknown, over the whole clip or over frames start to stop - 1.

    Without `joints` what was lost is found (`observation.broken`): joints that snap to their rest pose or
    jump away and back, and spikes, at any frames but a first or last one that is no part of the motion as a
    whole: that `scan` finds, and `fill` mends; and hips whose place stands still while they turn. `place`
    says that this is all that is lost: where the body is, but for the first frame of a whole clip. Feet that
    stand tell it. Other arguments, result and errors are those of `fill`.
    """
    start, stop = frames or (0, len(clip))
    if frames is not None:
        Gap(start, stop).check(len(clip))
    if place:
        if joints is not None:
            raise RequestError(
                "joints and the place of the body cannot be recovered at once",
                "feet tell the place only where all turns are known",
                "Recover the joints first, and then the place.",
            )
        if not legs(clip.skeleton):
            raise RequestError(
                "the place of the body cannot be recovered",
                "what it stands on tells it, and no legs were found",
                "Name them: --map, or load(..., roles=...).",
            )
        seen = Observation.full(clip)
        seen.translation[start:stop, placing(clip)[-1:]] = False
        if (start, stop) == (0, len(clip)):
            # The first frame counts that belongs to the motion.
            seen.translation[min({*range(stop)} - {*strays(clip)}, default=0) :][:1] = True
        return fill(clip, seen, method, seed=seed, progress=progress)
    if joints is None:
        swapped = _swapped(clip, start, stop)
        sides = put_back(clip, swapped)
        done = fill(sides, _by_itself(sides, start, stop), method, seed=seed, progress=progress)
        return _with_sides(done, swapped)
    return fill(clip, [Gap(start, stop, tuple(joints))], method, seed=seed, progress=progress)


def _swapped(clip: Clip, start: int, stop: int) -> list[Exchange | Flip]:
    """What was taken for something else within the frames start to stop - 1."""
    return [one for one in exchanges(clip) if start <= one.start and one.stop <= stop]


def _with_sides(done: Completion, swapped: Sequence[Exchange | Flip]) -> Completion:
    """A completion that also tells what was on the wrong side, and was put back."""
    if not swapped:
        return done
    provenance, frames = done.provenance.copy(), dict[int, list[str]]()
    for one in swapped:
        provenance[one.start : one.stop, one.joints] = Provenance.CORRECTED
        for joint in one.joints:
            frames.setdefault(joint, []).append(f"{one.start}:{one.stop}")
    told = tuple(JointMoments(done.clip.skeleton.names[j], tuple(at)) for j, at in sorted(frames.items()))
    return replace(done, provenance=provenance, report=replace(done.report, exchanged=told))


def _by_itself(clip: Clip, start: int, stop: int) -> Observation:
    """What is left of a clip without what was lost in frames start to stop - 1: what `recover` finds."""
    seen, odd = broken(clip), strays(clip)
    seen.rotation[odd], seen.translation[odd] = True, True
    for one in stuck(clip):
        held = [clip.skeleton.index(name) for name in one.joints or ()]
        # A rest pose beside the frames in which a body is stuck does not tell where it is either.
        beside = [frame for frame in odd if one.start - 1 <= frame <= one.stop]
        seen.translation[np.ix_([*range(one.start, one.stop), *beside], held)] = False
    seen.rotation[:start], seen.translation[:start] = True, True
    seen.rotation[stop:], seen.translation[stop:] = True, True
    return seen


def denoise(
    clip: Clip,
    strength: float = 1.0,
    joints: Sequence[str] | None = None,
    frames: tuple[int, int] | None = None,
    method: str = "auto",
    seed: int | None = None,
) -> Completion:
    """Smooth noise, and fill values that were lost, over the whole clip or over frames start to stop - 1.

    Args:
        clip: what is observed but not fully trusted.
        strength: what the estimated noise is multiplied with: 0 changes nothing, 2 is smoother.
        joints: the joints that may turn, roots among them that move, too; None for all.
        frames: the range in which anything may change, from which the noise is estimated, too.
        method: what fills values that were lost; "auto" interpolates, which is best for moments.
        seed: for methods that sample.

    Raises:
        RequestError: too few frames, a strength below 0 or above 100, a joint or range that does not exist.
    """
    if not 0 <= strength <= STRONGEST:
        raise RequestError(
            f"cannot denoise with strength {strength:g}",
            "the estimated noise is multiplied with it",
            f"Choose 0 to {STRONGEST:g}: 1 trusts the estimate, 2 smooths more.",
        )
    start, stop = frames or (0, len(clip))
    if frames is not None:
        Gap(start, stop).check(len(clip))
    chosen = None if joints is None else [clip.skeleton.index(name) for name in joints]
    swapped = _swapped(clip, start, stop) if chosen is None and strength else []
    sides = put_back(clip, swapped)
    if method == "auto":
        return _with_sides(denoised(sides, strength, chosen, start, stop), swapped)
    registry.get(method)
    done = denoised(
        sides, strength, chosen, start, stop, lambda cut, seen: fill(cut, seen, method, seed=seed).clip
    )
    return _with_sides(done, swapped)


def between(
    clip: Clip,
    keys: Sequence[int],
    action: str = "",
    method: str = "auto",
    seed: int | None = None,
    progress: Callable[[float], None] | None = None,
    cut: bool = False,
) -> Completion:
    """Generate all that lies between key frames of a clip; the keys come back unchanged.

    Args:
        clip: its poses between the keys have no influence; what lies before the first and after the last key
            stays as it is.
        keys: frame numbers, two or more, in any order.
        action: what the motion is, for methods that know actions.
        method, seed, progress: as in `fill`.
        cut: give back what lies from the first key to the last alone.

    Raises:
        RequestError: too few keys, one outside of the clip, nothing between them, an unknown action.
    """
    chosen = sorted(set(keys))
    if bad := [key for key in chosen if key != int(key) or not 0 <= key < len(clip)]:
        raise RequestError(
            f"there is no frame {bad[0]}",
            f"the clip has {len(clip)} frames, counted from 0",
            f"Choose keys from 0 to {len(clip) - 1}.",
        )
    gaps = [Gap(a + 1, b) for a, b in zip(chosen, chosen[1:]) if b > a + 1]
    if not gaps:
        raise RequestError(
            "there is nothing between the keys",
            f"the keys are {', '.join(map(str, chosen)) or 'none'}",
            "Name some that are apart: 0,30,75. Of a file of poses: --start a.bvh#0 --target a.bvh#1.",
        )
    zero, stop = (chosen[0], chosen[-1] + 1) if cut else (0, len(clip))
    done = fill(clip, gaps, method, seed=seed, progress=progress, action=action, zero=zero)
    return _part(done, zero, stop) if cut else done


def _part(done: Completion, start: int, stop: int) -> Completion:
    """The frames start to stop - 1 of a completion, all of its gaps among them."""
    reports = [replace(gap, start=gap.start - start, stop=gap.stop - start) for gap in done.report.gaps]
    clip, part = done.clip, slice(start, stop)
    return Completion(
        clip.with_motion(clip.rotation[part], clip.translation[part]),
        lambda: _raw_part(done.raw, start, stop),
        done.provenance[part],
        replace(done.report, gaps=reports),
    )


def block(poses: Mapping[int, Clip]) -> Clip:
    """A clip from poses by frame: the key frames that `between` goes by. Each pose holds until the next.

    Args:
        poses: clips of one frame on skeletons with the same joints, frame 0 among them: its skeleton, frame
            rate and file layout are the result's.

    Raises:
        RequestError: the skeletons differ.
    """
    first = poses[0]
    for frame, pose in poses.items():
        if pose.skeleton.names != first.skeleton.names or pose.translated != first.translated:
            odd = sorted({*pose.skeleton.names} ^ {*first.skeleton.names})
            raise RequestError(
                f"the pose at frame {frame} is on another skeleton than the first",
                f"joints that only one of them has: {', '.join(odd[:6])}" if odd else "joints differ in kind",
                "Use poses of one character.",
            )
    held = np.repeat(sorted(poses), np.diff([*sorted(poses), max(poses) + 1]))
    rotation, translation = (
        np.concatenate([getattr(poses[frame], name) for frame in held])
        for name in ("rotation", "translation")
    )
    return first.with_motion(rotation, translation)


@dataclass(frozen=True, eq=False)
class Forecast(Completion):
    """A clip and what follows, and other ways in which it may go on.

    Attributes:
        start: the first frame that was not there.
        samples: all of them, this one first.
    """

    start: int
    samples: list[Completion]

    def spread(self) -> np.ndarray:
        """(frames,) cm by which joints of the samples lie from their mean, in the mean, in each new frame."""
        positions = np.stack([one.clip.slice(self.start, len(one.clip)).positions() for one in self.samples])
        off = np.linalg.norm(positions - positions.mean(axis=0), axis=-1)
        return np.asarray(100 * np.sqrt(np.square(off).mean(axis=(0, 2))))


def forecast(
    clip: Clip,
    frames: int | None = None,
    samples: int = 1,
    method: str = "auto",
    seed: int | None = None,
    temperature: float = 1.0,
    progress: Callable[[float], None] | None = None,
) -> Forecast:
    """Go on with a clip, from its last pose and where that is.

    Args:
        clip: what is known; it comes back unchanged.
        frames: how many are added; 2 s without it.
        samples: in how many ways; seeds are counted up from `seed`, or from 1.
        method: a method, or "auto".
        seed: of the noise that is injected; a single sample without any is the most likely one.
        temperature: how much of it; 1 is what the method was trained with.
        progress: called with the share done, 0 to 1.

    Raises:
        RequestError: nothing to go on from, no frame or no sample asked for, a temperature that the method
            does not have, and what `fill` refuses.
    """
    frames = round(AHEAD * clip.fps) if frames is None else frames
    for what, count, fix in (("frame", frames, "--frames 60"), ("sample", samples, "--samples 5")):
        if not isinstance(count, int | np.integer) or count < 1:
            raise RequestError(
                f"cannot forecast {count} {what}s",
                "it is a whole number from 1 on",
                f"Write for example {fix}.",
            )
    timeline.bounded(frames, clip.fps)
    if not 0 <= temperature <= HOTTEST:
        raise RequestError(
            f"cannot sample at temperature {temperature:g}",
            "the noise is multiplied with it",
            f"Choose 0 to {HOTTEST:g}: 1 is what the network was trained with.",
        )
    if not len(clip):
        raise RequestError("there is nothing to go on from", "the clip has no frame", "Name another clip.")
    held = np.minimum(np.arange(len(clip) + frames), len(clip) - 1)
    longer = clip.with_motion(clip.rotation[held], clip.translation[held])
    gap = Gap(len(clip), len(longer))
    job = plan(longer, Observation.from_gaps(longer, [gap]), method, None, None, {})[0]
    chosen = job.method.name if method == "auto" and job.method else method
    if samples > 1 and job.method and (why := job.method.refuses(longer, gap)):
        raise RequestError(
            f"cannot draw {samples} samples",
            f"{chosen} refuses: {why}",
            "Ask for one, or give it more to see.",
        )
    if samples > 1 and not isinstance(registry.get(chosen), Sampler):
        raise registry.one_answer(f"cannot draw {samples} samples with {chosen}")
    seeds = [seed] if samples == 1 else [(1 if seed is None else seed) + i for i in range(samples)]

    def part(i: int) -> Callable[[float], None] | None:
        return (lambda share: progress((i + share) / samples)) if progress else None

    done = [
        fill(longer, [gap], chosen, seed=drawn, progress=part(i), temperature=temperature)
        for i, drawn in enumerate(seeds)
    ]
    first = done[0]
    made = Forecast(first.clip, first.said, first.provenance, first.report, start=gap.start, samples=[])
    made.samples.extend([made, *done[1:]])
    return made


@dataclass(frozen=True)
class Loop:
    """How a motion that goes round meets its beginning.

    Attributes:
        placement: how the whole motion is turned and shifted each time it comes round.
        why: what decided the length of the last gap, where nobody said it.
        jump, limit: cm a frame squared, the largest velocity jump of any joint at frame 0, so placed, after
            the last two frames; and the 95th percentile of the motion's own.
    """

    placement: timeline.Placement
    why: str
    jump: float | None
    limit: float | None


@dataclass(frozen=True, eq=False)
class Stitched(Completion):
    """A completion that tells where each clip lies on the timeline, and of a loop how it closes."""

    clips: list[timeline.Laid]
    loop: Loop | None = None


def stitch(
    clips: Sequence[Clip],
    frames: str | int | Sequence[int] = "auto",
    align: bool = True,
    loop: bool = False,
    action: str = "",
    method: str = "auto",
    seed: int | None = None,
    progress: Callable[[float], None] | None = None,
) -> Stitched:
    """Lay clips one after another on one timeline, and generate the motion that leads from each to the next.

    All frames of the clips are kept; following ones are placed as a whole (`timeline.lay`). Of a loop the
    beginning is laid at the end once more, as what the last gap leads to, and then taken away again.

    Args:
        clips, frames, align, loop: as in `timeline.lay`; the motion of what is on another rig than the first
            clip is brought onto that one's skeleton first (`retarget`).
        action, method, seed, progress: as in `fill`.

    Raises:
        RequestError: what `on_rig_of`, `timeline.lay` and `fill` refuse.
    """
    clips = [on_rig_of(clip, clips[0]) if len(clip) else clip for clip in clips]
    line = timeline.lay(clips, frames, align, loop)
    if frames == "auto" and align:
        lengths, whys = _tried(line, method, action, seed)
        line = timeline.lay(clips, lengths, align, loop).because(whys)
    done = fill(line.clip, line.gaps, method, seed=seed, progress=progress, action=action)
    clip, provenance, closing = done.clip, done.provenance, None
    if line.again is not None:
        start, last = line.again.start, done.report.gaps[-1]
        around = acceleration(clip.slice(start - 1, start + 2).positions())
        jump = 100 * float(around.max()) if around.size else None
        closing = Loop(line.again.placement, line.again.why, jump, last.seam_limit)
        clip = clip.with_motion(clip.rotation[:start], clip.translation[:start])
        provenance = provenance[:start]
    return Stitched(
        clip,
        lambda: _raw_part(done.raw, 0, len(clip)),
        provenance,
        done.report,
        clips=line.laid,
        loop=closing,
    )


def _tried(
    line: timeline.Timeline, method: str, action: str, seed: int | None
) -> tuple[list[int], list[str]]:
    """How long each gap should be, and why: where strides do not tell it, as long as feet slide least with
    the motion beside it, from its length on up to TRIED more."""
    lengths, whys, fps = [], [], line.clip.fps
    for way, gap in zip(line.ways, line.gaps):
        near, slides = round(BESIDE * fps) + 1, {}
        ends = (
            line.clip.slice(max(0, gap.start - near), gap.start),
            line.clip.slice(gap.stop, gap.stop + near),
        )
        for length in range(len(gap), len(gap) + round(TRIED * fps) + 1, max(1, round(fps / 10))):
            if way.in_step:
                break
            pair = timeline.lay(ends, length)
            (report,) = fill(pair.clip, pair.gaps, method, seed=seed, action=action).report.gaps
            if report.foot_slide is None or (report.foot_travel or 0.0) < TRAVELS:
                break
            slides[length] = report.foot_slide + GLIDING * (report.gliding or 0.0)
        lengths.append(min(slides, key=lambda length: slides[length], default=len(gap)))
        least = f"feet slide least, of {len(slides)} lengths tried (the shortest: {way.why})"
        whys.append(least if lengths[-1] > len(gap) else way.why)
    return lengths, whys


def _raw_part(raw: Raw, start: int, stop: int) -> Raw:
    """What a method said of the frames start to stop - 1."""
    positions, own = (None if some is None else some[start:stop] for some in (raw.positions, raw.own))
    return replace(raw, clip=raw.clip.slice(start, stop), positions=positions, own=own)


def plan(
    clip: Clip,
    observation: Observation,
    method: str,
    max_gap: int | None,
    only: Sequence[int] | None,
    methods: Mapping[int, str],
    action: str = "",
    temperature: float = 1.0,
) -> list[Job]:
    """The runs of incomplete frames, numbered in order of time, each with its method; pins are checked."""
    pinning.check(clip, observation)
    spans = [_span(observation, clip, start, stop) for start, stop in runs(~observation.frames)]
    for number in (*(only or ()), *methods):
        if not 1 <= number <= len(spans):
            raise RequestError(
                f"there is no gap number {number}",
                f"the clip has {len(spans)} gaps, counted from 1 in order of time",
                "A dry run lists them: --dry-run.",
            )
    jobs = []
    for number, gap in enumerate(spans, 1):
        lead = _lead(observation, gap)
        open_ = (max_gap is not None and len(lead) > max_gap) or (only is not None and number not in only)
        name, note = methods.get(number, method), None
        if name == "auto" and action:
            chosen = auto.choose_told(clip, lead, _turned(clip, observation, gap), action)
        elif name == "auto":
            chosen, note = _suited(clip, observation, gap, lead)
        else:
            chosen = registry.told(name, action, temperature)
        if open_ and (pins := observation.slice(gap.start, gap.stop).pins):
            raise RequestError(
                f"{pins[0].joint} is pinned in a gap that stays open: frame {gap.start + pins[0].frames[0]}",
                f"gap {number}, {gap}, is longer than allowed, or not among the gaps chosen",
                "Leave the pin out, or let the gap be filled.",
            )
        jobs.append(Job(number, gap, None if open_ else chosen, note))
    return jobs


def _turned(clip: Clip, observation: Observation, gap: Gap) -> float:
    """By how many degrees the body turns from one lone key to the other; 0 where there are not two."""
    return auto.turns(clip, gap) if _lone(observation, gap) == 2 and gap.joints is None else 0.0


def _suited(clip: Clip, observation: Observation, gap: Gap, lead: Gap) -> tuple[Method, str | None]:
    """The method that `auto` takes for a gap, and why no network, where one would be its own."""
    if observation.rotation[gap.start : gap.stop].all():
        # What the body stands on tells more of where it is than any method.
        return Spline(), None
    chosen, note = auto.choose(clip, lead, _lone(observation, gap), _turned(clip, observation, gap))
    if isinstance(chosen, Spline) and note is None and (parted := _parted(observation, clip, gap)):
        # Too short for a network alone, amid joints that are lost for longer.
        return auto.choose(clip, parted)
    return chosen, note


def _span(observation: Observation, clip: Clip, start: int, stop: int) -> Gap:
    """A run of incomplete frames as one gap: of the whole pose, if that is missing anywhere in it."""
    part = observation.rotation[start:stop]
    if (~part).all(axis=1).any():
        return Gap(start, stop)
    lost = ~(part & observation.translation[start:stop])
    return Gap(start, stop, tuple(clip.skeleton.names[j] for j in np.flatnonzero(lost.any(axis=0))))


def _lone(observation: Observation, gap: Gap) -> int:
    """How many sides of the gap are single known frames; 0 at an end of the clip."""
    known = observation.frames
    if gap.start == 0 or gap.stop == len(known):
        return 0
    return int(known[max(0, gap.start - 2) : gap.start].sum() == 1) + int(
        known[gap.stop : gap.stop + 2].sum() == 1
    )


def _lead(observation: Observation, gap: Gap) -> Gap:
    """What a method is chosen by: the longest stretch without any pose; without one, the whole gap."""
    if gap.joints is not None:
        return gap
    empty = runs(np.logical_not(observation.rotation[gap.start : gap.stop].any(axis=1)))
    start, stop = max(empty, key=lambda run: run[1] - run[0])
    return Gap(gap.start + start, gap.start + stop)


def _parted(observation: Observation, clip: Clip, gap: Gap) -> Gap | None:
    """The joints that are lost in the frames of a gap in which others are known."""
    part = observation.slice(gap.start, gap.stop)
    lost = ~(part.rotation & part.translation) & part.rotation.any(axis=1, keepdims=True)
    names = tuple(clip.skeleton.names[joint] for joint in np.flatnonzero(lost.any(axis=0)))
    return Gap(gap.start, gap.stop, names) if names else None


class _Piece(NamedTuple):
    """The frames of a job that are completed at once: all, or those of a piece of a long one."""

    job: Job
    start: int
    stop: int


@dataclass
class _Group:
    """Pieces near each other, which are seen and completed at once."""

    pieces: list[_Piece]

    @property
    def methods(self) -> list[Method]:
        """Those that fill any of it."""
        found: list[Method] = []
        for piece in self.pieces:
            if piece.job.method is not None and piece.job.method not in found:
                found.append(piece.job.method)
        return found


def _together(jobs: Sequence[Job], clip: Clip, observation: Observation) -> list[_Group]:
    """All jobs in groups. What is near belongs together, filled or left open and by whatever method: each gap
    is seen with what is around it, so alone it would have its neighbours completed once more, and what
    becomes of it does not depend on what becomes of them."""
    groups: list[_Group] = []
    for job in jobs:
        for start, stop in _pieces(clip, observation, job.gap):
            held = groups[-1].pieces if groups else []
            near = held and held[-1].job is not job and start - held[-1].stop < CONTEXT * clip.fps
            if near and stop - held[0].start <= GROUP * clip.fps:
                held.append(_Piece(job, start, stop))
            else:
                groups.append(_Group([_Piece(job, start, stop)]))
    return groups


def _pieces(clip: Clip, observation: Observation, gap: Gap) -> Iterator[tuple[int, int]]:
    """The gap itself; or, when single joints are missing for long, overlapping pieces of it.

    Where pieces overlap at least a part of every pose is known. Where all turns are, the way of the body goes
    on from its beginning, and pieces of it would be apart.
    """
    piece, overlap = round(PIECE * clip.fps), round(OVERLAP * clip.fps)
    if observation.rotation[gap.start : gap.stop].all():
        piece = len(gap)
    empty = np.logical_not(observation.rotation.any(axis=1))
    start = gap.start
    while True:
        stop = min(start + piece, gap.stop)
        while stop < gap.stop and empty[stop - overlap : stop].any():
            stop += 1
        yield start, stop
        if stop == gap.stop:
            return
        start = stop - overlap


def _paste(
    whole: np.ndarray, part: np.ndarray, known: np.ndarray, start: int, inside: slice, fade: int
) -> None:
    """Put the unobserved values of a window into the whole clip, blended over its first `fade` frames."""
    values = part[inside].copy()
    stop = start + len(values)
    if fade:
        share = ramp(np.arange(1, fade + 1) / (fade + 1))
        before = whole[start : start + fade]
        if whole.shape[-1] == 4:
            values[:fade] = rotations.slerp(before, values[:fade], share[:, None])
        else:
            values[:fade] = before + share[:, None, None] * (values[:fade] - before)
    missing = ~known[start:stop]
    whole[start:stop][missing] = values[missing]


def _shifted(reports: Iterable[GapReport], by: int, start: int, stop: int, job: Job) -> Iterator[GapReport]:
    """The reports of a window that concern its own gap, counted in frames of the whole clip."""
    for one in reports:
        if one.start + by < stop and one.stop + by > start:
            first, last = max(one.start + by, start), min(one.stop + by, stop)
            notes = ((job.note,) if job.note else ()) + one.notes
            yield replace(one, start=first, stop=last, number=job.number, notes=notes)


def _joined(reports: list[GapReport]) -> list[GapReport]:
    """One report for a gap that was completed in pieces: the worst seam and bone, means of the rest."""
    done: list[GapReport] = []
    for one in reports:
        last = done[-1] if done else None
        if last is None or (last.number, last.joints, last.method) != (one.number, one.joints, one.method):
            done.append(one)
            continue
        # Of all frames so far, those that the new piece added.
        share = (one.stop - last.stop) / (one.stop - last.start)
        worst = {
            name: _over(last, one, name, max)
            for name in (
                *("seam_before", "seam_after", "peak", "peak_limit", "bone_deviation"),
                *("penetration", "path", "pins", "drift"),
            )
        }
        means = {
            name: _over(last, one, name, lambda a, b, share=share: a + share * (b - a))
            for name in (
                *("solve_error", "foot_slide", "foot_slide_before"),
                *("liveliness", "gliding", "expected"),
            )
        }
        travel = _over(last, one, "foot_travel", lambda a, b: a + b)
        notes = tuple(dict.fromkeys(last.notes + one.notes))
        done[-1] = replace(last, stop=one.stop, foot_travel=travel, notes=notes, **worst, **means)
    return done


def _over(one: GapReport, other: GapReport, name: str, combine: Callable[..., float]) -> Any:
    """A measure of two reports combined; where only one has it, that one's."""
    a, b = getattr(one, name), getattr(other, name)
    return combine(a, b) if a is not None and b is not None else b if a is None else a


def _put_together(clip: Clip, said: list[tuple[int, slice, Raw]]) -> Raw:
    """What the methods said in their windows, as one; positions are NaN where none spoke of them."""
    rotation, translation = clip.rotation.copy(), clip.translation.copy()
    joints = tuple(sorted({joint for _, _, raw in said if raw.positions is not None for joint in raw.joints}))
    shape = (len(clip), len(joints), 3)
    positions, own = (np.full(shape, np.nan), np.full(shape, np.nan)) if joints else (None, None)
    stands = np.full((len(clip), 4), np.nan) if any(raw.stands is not None for *_, raw in said) else None
    expected = np.full(len(clip), np.nan) if any(raw.expected is not None for *_, raw in said) else None
    for start, inside, raw in said:
        part = slice(start, start + inside.stop - inside.start)
        rotation[part], translation[part] = raw.clip.rotation[inside], raw.clip.translation[inside]
        for whole, spoken in ((positions, raw.positions), (own, raw.own)):
            if whole is not None and spoken is not None:
                whole[part, [joints.index(joint) for joint in raw.joints]] = spoken[inside]
        if stands is not None and raw.stands is not None:
            stands[part] = raw.stands[inside]
        if expected is not None and raw.expected is not None:
            expected[part] = raw.expected[inside]
    whole_clip = replace(clip, rotation=rotation, translation=translation, source=None)
    return Raw(whole_clip, positions, joints, own=own, stands=stands, expected=expected)
