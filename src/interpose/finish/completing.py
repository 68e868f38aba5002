"""The one place where a clip is completed: any method, then the guarantees.

What is pinned, led along a path or laid on a body is completed without that first, brought there, and given
the guarantees once more: as a method of its own that says what it was brought to.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from operator import attrgetter, itemgetter

import numpy as np

from interpose.clip import Clip
from interpose.finish import feet, pins
from interpose.finish.aiming import aimed, severed
from interpose.finish.gap_report import same
from interpose.finish.guarantees import STEPPED, STEPS, Ask, guaranteed
from interpose.finish.habits import Habits
from interpose.finish.loose import MOST, Layer, loose, without
from interpose.finish.notes import TURNS
from interpose.finish.opinion import certain, wipe
from interpose.finish.path import ahead, follow, over_floor, spans
from interpose.finish.report import Completion, GapReport, Provenance
from interpose.methods.classical import Linear, Spline, ZeroVelocity
from interpose.methods.protocol import Method, Raw
from interpose.observation import ROUGH, Gap, Observation, Pin
from interpose.skeletons.carrier import hips_of
from interpose.skeletons.performers import Joints, clip_of, performers, with_clips

# Metres from where it would be at which a pinned joint is asked about, and how many times as far at an end
# of the clip.
FAR, STREET = 1.5, 20
# Degrees by which a joint may be turned otherwise than its pin says.
OTHERWISE = 1.0
# Metres from which on a foot that hovers, as a hand is pinned, is let down; and centimetres a second by which
# feet may slide more for it.
HOVERS, SLIDES = 0.002, 1.0
# Metres by which nobody is led elsewhere.
UNMOVED = 0.01
# A path on which the hips go this much further than without it is said to be too long.
FURTHER = 1.5
# How notes on a path begin, and what is said of one that is too long.
MET, LONG = "the path is met within", "times as long as without the path"


def complete(
    clip: Clip,
    observation: Observation,
    method: Method,
    seed: int | None = None,
    fallback: Method | None = None,
    habits: Habits | None = None,
    path: Mapping[int, np.ndarray] | None = None,
    first: int = 0,
) -> Completion:
    """Complete a clip by a method, and make the result usable; of several bodies each as if it were alone.

    Observed values come back bit for bit, bones keep their lengths, there is no pop at seams, planted feet
    stay planted, and what is unobserved in `clip` has no influence on anything. Gaps that the method refuses,
    or at whose seams it fails, are filled by `fallback` (default: the spline), which the report names.

    Args:
        clip: F frames; its unobserved values may be anything.
        observation: what is known, (F, J).
        method: what completes it.
        seed: for methods that sample.
        fallback: the simpler method.
        habits: how its bodies move, when it is a window of a longer one. Default: as the clip tells.
        path: x and z in metres that the hips are to be over, by frame; inside of gaps of the whole pose.
        first: the number by which notes call the first frame, when `clip` is a window of a longer one.

    Raises:
        RequestError: the observation or one of its pins does not fit the clip, nothing fills a gap, or a
            point of the path lies in no gap of the whole pose with known frames on both sides.
    """
    observation.check(clip)
    ask = Ask(method, seed, fallback or Spline(), habits, first)
    if several := performers(clip.skeleton):
        return _each(several, clip, observation, ask, path)
    return _complete(clip, observation, ask, path)


def _each(
    several: tuple[Joints, ...],
    clip: Clip,
    observation: Observation,
    ask: Ask,
    path: Mapping[int, np.ndarray] | None,
) -> Completion:
    """Complete the bodies of a clip one by one, as if each were alone; a path is the first one's."""
    done: dict[Joints, Completion] = {}
    for joints in several:
        part, own = clip_of(clip, joints), list(joints)
        pins = tuple(pin for pin in observation.pins if pin.joint in part.skeleton.names)
        seen = Observation(observation.rotation[:, own], observation.translation[:, own], pins)
        if seen.complete and not pins:
            continue
        habits = None if ask.habits is None else ask.habits.some(joints)
        done[joints] = _complete(part, seen, replace(ask, habits=habits), path)
        path = None
    return assembled(clip, done) if done else _complete(clip, observation, ask, path)


def assembled(clip: Clip, done: Mapping[Joints, Completion]) -> Completion:
    """A clip with the completions of some of its bodies, by the joints of each."""
    main = next(iter(done.values()))
    codes = np.full(clip.rotation.shape[:2], Provenance.OBSERVED, np.int8)
    gaps: list[GapReport] = []
    for joints, one in done.items():
        codes[:, list(joints)] = one.provenance
        # Of the one that was said to be meant a whole pose is all there is.
        names = None if "root" in clip.skeleton.roles else one.clip.skeleton.names
        gaps += [gap if gap.joints else replace(gap, joints=names) for gap in one.report.gaps]
    gaps.sort(key=attrgetter("start"))
    reports = [one.report for one in done.values()]
    report = replace(
        main.report,
        gaps=gaps,
        moments=tuple(told for one in reports for told in one.moments),
        exchanged=tuple(told for one in reports for told in one.exchanged),
        unpaired=tuple(name for one in reports for name in one.unpaired),
    )

    def said() -> Raw:
        spoken = {joints: one.raw.clip for joints, one in done.items()}
        return replace(main.raw, clip=with_clips(clip, spoken), positions=None, joints=(), own=None)

    return Completion(
        with_clips(clip, {joints: one.clip for joints, one in done.items()}), said, codes, report
    )


def _complete(
    clip: Clip, observation: Observation, ask: Ask, path: Mapping[int, np.ndarray] | None
) -> Completion:
    if observation.pins:
        return _pinned(clip, observation, ask, path)
    if path:
        return _along(path, clip, observation, ask)
    hidden = wipe(clip, observation)
    if not isinstance(ask.method, Layer):
        hanging = loose(hidden, certain(hidden, observation))
        if hanging.any():
            return _laid(hanging, clip, observation, ask)
        parts = severed(hidden, certain(hidden, observation))
        if parts.any() and not isinstance(ask.method, Spline | Linear | ZeroVelocity):
            return _aimed(parts, clip, hidden, observation, ask)
    return guaranteed(clip, hidden, observation, ask)


def _laid(hanging: np.ndarray, clip: Clip, observation: Observation, ask: Ask) -> Completion:
    """Complete the body on which known joints (F, J) hang, and lay them on it."""
    body = _complete(clip, without(observation, hanging), ask, None)
    # On other legs a body stands anew.
    legs = [joint for leg in feet.legs(clip.skeleton) for joint in (leg.thigh, leg.knee, *leg.foot)]
    anew = bool(hanging[:, legs].any())
    layer = Layer(ask.method.name, body.clip, body.raw, hanging, stands=not anew)
    # Where some joints that are laid on a body jump, another body would not help: it is said, and this
    # one kept. Where most of them are, it is rather the body that does not fit.
    simpler: Method = layer if hanging.any(axis=0).mean() < MOST else ask.fallback
    done = _complete(clip, observation, replace(ask, method=layer, fallback=simpler), None)
    return _told_of(body, done, (STEPS, STEPPED) if anew else ())


def _aimed(parts: np.ndarray, clip: Clip, hidden: Clip, observation: Observation, ask: Ask) -> Completion:
    """Complete a clip without known `parts` (F, J) of legs whose thighs are lost, and aim these.

    Not by what interpolates angles, which knows nothing of feet; nor by networks that speak positions, which
    say where knees are: `cae` is off by 10.0 cm so where a joint is lost, and by 9.1 by itself (`bench every
    --most 8`).
    """
    body = _complete(clip, without(observation, parts), ask, None)
    if body.raw.positions is not None:
        return guaranteed(clip, hidden, observation, ask)
    layer = Layer(
        ask.method.name, aimed(body.clip, clip, parts), body.raw, np.zeros_like(parts), stands=False
    )
    return _told_of(body, _complete(clip, observation, replace(ask, method=layer), None))


def _along(path: Mapping[int, np.ndarray], clip: Clip, observation: Observation, ask: Ask) -> Completion:
    """Complete a clip, lead the hips along the path, and make the result usable once more."""
    known = certain(clip, observation)
    through = {
        gap: points
        for gap in spans(clip, known, path)
        if (points := {frame: point for frame, point in path.items() if gap[0] <= frame < gap[1]})
    }

    def follows(done: Completion) -> Clip:
        led = done.clip
        for gap, points in through.items():
            led = follow(led, *gap, points)
        return led

    body = unled = _complete(clip, observation, ask, None)
    led = follows(unled)
    if np.abs(led.positions() - unled.clip.positions()).max() >= UNMOVED:
        # A network that is told of the way takes steps for it, and turns along.
        hips = hips_of(clip.skeleton)
        way, name = led.positions()[:, hips], clip.skeleton.names[hips]
        frames = [np.arange(start - 1, stop + 1) for start, stop in through]
        roughly = tuple(Pin(name, some, way[some], tolerance=ROUGH) for some in frames)
        tries = [unled, _complete(clip, observation, _telling(ask, roughly), None)]
        # Where it would go aside nevertheless, as round a whole circle, it is told where to face, too.
        turns = [ahead(tries[1].clip, known.frames, *gap) for gap in through]
        if any(one is not None for one in turns):
            facing = tuple(replace(pin, orientation=one) for pin, one in zip(roughly, turns))
            tries.append(_complete(clip, observation, _telling(ask, facing), None))
        body = min(reversed(tries), key=lambda done: _fell(done, ask.method))
    led = follows(body)
    nothing = np.zeros_like(known.rotation)
    # Who goes there anyway stands as firmly as before.
    same = bool(np.abs(led.positions() - body.clip.positions()).max() < UNMOVED)
    layer = Layer(ask.method.name, led, body.raw, nothing, stands=same)
    done = _told_of(body, _complete(clip, observation, replace(ask, method=layer, fallback=layer), None))
    ways = over_floor(body.clip), over_floor(done.clip)

    def judged(gap: GapReport) -> GapReport:
        gap = _on_path(gap, path, ways[1])
        if gap.path is None:
            return gap
        # The path says which way round is meant.
        gap = replace(gap, notes=tuple(note for note in gap.notes if not note.startswith(TURNS)))
        own, new = (
            np.linalg.norm(np.diff(way[gap.start - 1 : gap.stop + 1], axis=0), axis=1).sum() for way in ways
        )
        if new <= FURTHER * own:
            return gap
        said = f"flagged: its way of {new:.1f} m is {new / own:.1f} {LONG}, and steps are too short for it"
        return replace(gap, notes=(*gap.notes, f"{said}. A longer gap or a nearer point helps"))

    reports = [judged(gap) for gap in done.report.gaps]
    return replace(done, report=replace(done.report, gaps=reports))


def _telling(ask: Ask, pins: tuple[Pin, ...]) -> Ask:
    return replace(ask, method=_Told(ask.method.name, ask.method, pins))


def _fell(done: Completion, method: Method) -> int:
    """How many gaps another method filled."""
    return sum(gap.method != method.name for gap in done.report.gaps)


def _on_path(gap: GapReport, path: Mapping[int, np.ndarray], way: np.ndarray) -> GapReport:
    """A report that says by how much the hips, whose way over the floor is (F, 2), miss the path."""
    off = [float(np.linalg.norm(way[f] - p)) for f, p in path.items() if gap.start <= f < gap.stop]
    if not off:
        return gap
    missed = 100 * max(off)
    others = (note for note in gap.notes if not note.startswith(MET))
    return replace(gap, path=missed, notes=(*others, f"{MET} {missed:.1f} cm"))


@dataclass
class _Told:
    """A method that is told pins, which those who know nothing of pins leave alone."""

    name: str
    method: Method
    pins: tuple[Pin, ...]

    def refuses(self, clip: Clip, gap: Gap) -> str | None:
        return self.method.refuses(clip, gap)

    def complete(self, clip: Clip, observation: Observation, seed: int | None = None) -> Raw:
        pins = (*observation.pins, *self.pins)
        return self.method.complete(clip, replace(observation, pins=pins), seed)


def _slides(done: Completion) -> float:
    """At how many centimetres a second feet slide in the gap in which they do most."""
    return max((gap.foot_slide or 0.0 for gap in done.report.gaps), default=0.0)


def _pinned(
    clip: Clip, observation: Observation, ask: Ask, path: Mapping[int, np.ndarray] | None
) -> Completion:
    """Complete a clip, bring what is pinned to its place, and make the result usable once more."""
    asked, free = pins.asked(clip, observation), replace(observation, pins=())
    if not asked:
        return _complete(clip, free, ask, path)
    known = certain(clip, free)
    unled = _complete(clip, free, ask, path)
    # A network that is told of one frame changes that frame: it is told the whole way there and back.
    ways = pins.ways(unled.clip, known, asked)
    body = _complete(clip, free, _telling(ask, ways), path) if ways else unled
    own = body.raw
    if own.expected is not None:
        own = replace(own, expected=own.expected * pins.left_open(clip, known, asked))

    def laid(down: np.ndarray | None = None) -> Completion:
        met = pins.meet(body.clip, known, asked, down)
        layer = Layer(ask.method.name, met, own, np.zeros_like(known.rotation), pins=asked)
        return _complete(clip, free, replace(ask, method=layer, fallback=layer), None)

    done, high = laid(), pins.hovering(body.clip, known, unled.clip)
    if high.max(initial=0.0) > HOVERS:
        lower = laid(high)
        # Feet that are let down out of a step would slide.
        done = lower if _slides(lower) <= _slides(done) + SLIDES else done
    done = _told_of(body, done)
    off = [(pin, frame, 100 * distance) for pin, frame, distance in pins.missed(done.clip, asked)]
    turned = [(np.degrees(angle), pin, frame) for pin, frame, angle in pins.misturned(done.clip, asked)]
    away = {(pin.joint, frame): distance for pin, frame, distance in pins.missed(unled.clip, asked)}
    way = over_floor(done.clip)

    def judged(gap: GapReport) -> GapReport:
        gap = _on_path(gap, path or {}, way)
        otherwise, pin, at = max(
            (one for one in turned if gap.start <= one[2] < gap.stop),
            default=(0.0, None, 0),
            key=itemgetter(0),
        )
        if pin is not None and otherwise > OTHERWISE:
            said = f"flagged: {pin.joint} is turned {otherwise:.0f} degrees otherwise than its pin says at "
            why = f"frame {ask.first + at}: it cannot be turned so there"
            gap = replace(gap, notes=(*gap.notes, said + why))
        inside = [one for one in off if gap.start <= one[1] < gap.stop]
        if not inside:
            return gap
        notes = [f"the pins are met within {max(distance for *_, distance in inside):.2f} cm"]
        for joint in dict.fromkeys(pin.joint for pin, *_ in inside):
            own = (one for one in inside if one[0].joint == joint)
            pin, frame, distance = max(own, key=lambda one: one[2] / (100 * one[0].tolerance))
            if distance > 100 * pin.tolerance:
                notes.append(
                    f"flagged: {joint} misses its pin at frame {ask.first + frame} by {distance:.1f} cm: it "
                    "is out of reach, or pins contradict each other"
                )
        far, where = max((away[pin.joint, frame], (pin.joint, ask.first + frame)) for pin, frame, _ in inside)
        # What nothing follows may be led anywhere, within a street.
        if far > FAR * (1 if gap.start > 0 and gap.stop < len(clip) else STREET):
            notes.append(
                f"flagged: {where[0]} is pinned {far:.1f} m from where it would be at frame {where[1]}: "
                "is the unit right?"
            )
        return replace(gap, pins=max(distance for *_, distance in inside), notes=(*gap.notes, *notes))

    reports = [judged(gap) for gap in done.report.gaps]
    return replace(done, report=replace(done.report, gaps=reports))


def _told_of(body: Completion, done: Completion, but: tuple[str, ...] = ()) -> Completion:
    """What was laid on a body, or led, with what is to be said of that: how far the method's own motion was
    off, by what a gap was filled instead, and what was done to it, `but` for some. What is flagged is judged
    anew."""
    before = {frame: gap for gap in body.report.gaps for frame in range(gap.start, gap.stop)}

    def told(gap: GapReport) -> GapReport:
        if (one := before.get(gap.start)) is None:
            return gap
        if one.method != done.report.method == gap.method:
            gap = replace(gap, method=one.method, model=one.model, weights=one.weights)
        kept = [note for note in one.notes if not note.startswith("flagged") or LONG in note]
        kept = [note for note in kept if note not in (*but, *gap.notes)]
        return replace(
            gap,
            seam_before=gap.seam_before if one.seam_before is None else one.seam_before,
            foot_slide_before=one.foot_slide_before,
            solve_error=one.solve_error,
            notes=(*kept, *gap.notes),
        )

    codes = done.provenance.copy()
    moved = (body.provenance == Provenance.CORRECTED) | ~same(body.clip, done.clip)
    codes[(codes == Provenance.METHOD) & moved] = Provenance.CORRECTED
    codes[(codes != Provenance.OBSERVED) & (body.provenance == Provenance.FALLBACK)] = Provenance.FALLBACK
    report = replace(done.report, gaps=[told(gap) for gap in done.report.gaps])
    return replace(done, provenance=codes, report=report)
