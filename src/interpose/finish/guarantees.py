"""The one place where a clip is completed: any method, then the guarantees.

Precedence when they collide: observed values, then bones, then pins, then seams, then feet.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from interpose.clip import Clip
from interpose.errors import InterposeError, RequestError
from interpose.finish import anatomy, feet, floor, jumps, measures, notes, penetration, pins, seams
from interpose.finish.loose import Layer, loose, without
from interpose.finish.path import follow, over_floor, spans
from interpose.finish.report import Completion, GapReport, Provenance, Report
from interpose.finish.solve import solve, solve_error
from interpose.finish.span import Span, write
from interpose.finish.standing import alone, stood
from interpose.finish.windows import grow
from interpose.formats import held
from interpose.geometry import rotations
from interpose.geometry.time import runs
from interpose.methods.classical import Linear, Spline
from interpose.methods.protocol import Method, Raw
from interpose.observation import Gap, Observation, Pin
from interpose.skeletons.carrier import rooted

STOOD = "what the body stands on tells where it is"
# Positions further out than this (metres) are as good as no numbers.
NOWHERE = 1e4
# A share of all joints: so many laid on a body are most of it.
MOST = 0.5
# Metres from where it would be at which a pinned joint is asked about.
FAR = 1.5
# Metres by which nobody is led elsewhere.
UNMOVED = 0.01
# A path on which the hips go this much further than without it is said to be too long.
FURTHER = 1.5
# Frames solved at once.
CHUNK = 4096
# Rounds in which velocity jumps above the limit are softened.
ROUNDS = 12
# A simpler method takes over where it pops by less than this share of what the method does: the hand of a
# body that falls jumps with either.
LESS = 0.9


def complete(
    clip: Clip,
    observation: Observation,
    method: Method,
    seed: int | None = None,
    fallback: Method | None = None,
    limit: float | None = None,
    path: Mapping[int, np.ndarray] | None = None,
    first: int = 0,
) -> Completion:
    """Complete a clip by a method, and make the result usable.

    Observed values come back bit for bit, bones keep their lengths, there is no pop at seams, planted feet
    stay planted, and what is unobserved in `clip` has no influence on anything. Gaps that the method refuses,
    or at whose seams it fails, are filled by `fallback` (default: the spline), which the report names.

    Args:
        clip: F frames; its unobserved values may be anything.
        observation: what is known, (F, J).
        method: what completes it.
        seed: for methods that sample.
        fallback: the simpler method.
        limit: metres per frame squared, the largest velocity jump allowed at a seam, when `clip` is a window
            of a longer one. Default: the 95th percentile of the clip's own.
        path: x and z in metres that the hips are to be over, by frame; inside of gaps of the whole pose.
        first: the number by which notes call the first frame, when `clip` is a window of a longer one.

    Raises:
        RequestError: the observation or one of its pins does not fit the clip, nothing fills a gap, or a
            point of the path lies in no gap of the whole pose with known frames on both sides.
    """
    observation.check(clip)
    fallback = fallback or Spline()
    if observation.pins:
        return _pinned(clip, observation, method, seed, fallback, limit, path, first)
    hidden = wipe(clip, observation)
    known = _certain(hidden, observation)
    if path:
        return _along(path, clip, observation, known, method, seed, fallback, limit, first)
    hanging = loose(hidden, known)
    if hanging.any() and not isinstance(method, Layer):
        body = complete(clip, without(observation, hanging), method, seed, fallback, limit, first=first)
        layer = Layer(method.name, body.clip, body.raw, hanging)
        # Where some joints that are laid on a body jump, another body would not help: it is said, and this
        # one kept. Where most of them are, it is rather the body that does not fit.
        simpler: Method = layer if hanging.any(axis=0).mean() < MOST else fallback
        return _told_of(body, complete(clip, observation, layer, seed, simpler, limit, first=first))
    gaps = known.gaps(clip.skeleton)
    if not gaps:
        return Completion(
            clip, lambda: Raw(clip), np.zeros(known.rotation.shape, np.int8), Report(method.name)
        )

    spans = [Span(start, stop, method.name) for start, stop in runs(~known.frames)]
    for gap in gaps:
        if reason := method.refuses(hidden, gap):
            there = replace(gap, start=gap.start + first, stop=gap.stop + first)
            _of(spans, gap).problem = f"{method.name} refuses {there}: {reason}"
    if all(span.problem for span in spans):
        raw = _second(fallback, hidden, observation, gaps, seed)
    else:
        raw = _said(method, hidden, observation, seed)

    opinion, error = _opinion(raw, known, spans)
    firm = known  # and joints that never turn
    if not isinstance(method, Layer):
        opinion = _carried(opinion, hidden, known)
        lost = alone(known, hidden)
        for span in spans:
            if lost[span.start : span.stop].any():
                span.notes.append((span.start, span.stop - 1, STOOD))
        if raw.positions is None:
            opinion = anatomy.straightened(opinion, known)
            firm = anatomy.locked(hidden, known)
            opinion = _merge(opinion, hidden, firm)
    opinion = held(opinion, clip.source)
    current = _merge(opinion, hidden, known)
    limit = seams.limit(hidden, known) if limit is None else limit
    bounds = None if limit is None else jumps.Bounds(limit, jumps.peak_limit(hidden, known, limit))
    before = {gap: jumps.largest(current, known, jumps.beside(gap), seams.seam_jumps) for gap in gaps}
    unheld: dict[Gap, tuple[float, float]] = {}
    mended: dict[int, list[tuple[int, int]]] = {}

    def settle(chosen: list[Span], source: Clip) -> None:
        # All spans take each step together: two that share a lone key are neighbours at every step.
        for span in chosen:
            _fade(current, source, hidden, firm, span)
            if not (isinstance(method, Layer) and method.pins):
                anatomy.calm(current, firm, span)
            places = jumps.mend(current, firm, span, bounds)
            if source is opinion:
                mended[span.start] = places
        for span in chosen:
            unheld.update(_slides(current, known, span, gaps))
            if source is not opinion or not (isinstance(method, Layer) and method.stands):
                _plant(current, firm, span, bounds, raw.stands if source is opinion else None)
                _lift(current, firm, span)
        for _ in range(ROUNDS):
            for span in chosen:
                jumps.soften(current, firm, span, limit)

    if not isinstance(method, Layer):
        anatomy.inside_out(opinion, known, spans, instead=not isinstance(fallback, Spline))
    for span in spans:
        span.problem = span.problem or _lost(opinion, hidden, known, span)
        span.hopeless = span.problem is not None
    settle([span for span in spans if not span.problem], opinion)
    for span in spans:
        excess, above, _ = jumps.excess(current, known, span, bounds, first)
        span.problem = span.problem or (above if excess > 1 else None)
    failed = [s for s in spans if s.problem and (s.hopeless or fallback.name != method.name)]
    if failed:
        second = _second(
            fallback, hidden, observation, [g for g in gaps if _of(spans, g) in failed], seed
        ).clip
        second = held(_carried(second, hidden, known), clip.source)
        merged, own = _merge(second, hidden, known), _merge(current, hidden, known)
        for span in failed:
            write(current, merged, span.start, (span.start, span.stop))
        settle(failed, second)
        for span in failed:
            # Where the simpler method pops hardly less, there is no reason to lose the motion; nor where it
            # has only the rest pose to say.
            excess, other = (jumps.excess(clip, known, span, bounds, first)[0] for clip in (own, current))
            blank = isinstance(fallback, Spline) and any(
                notes.never(known, gap, clip.skeleton.names) for gap in gaps if _of(spans, gap) is span
            )
            if not span.hopeless and (blank or other > max(1.0, LESS * excess)):
                write(current, own, span.start, (span.start, span.stop))
                continue
            span.method = fallback.name
            span.notes.append(
                (span.start, span.stop - 1, f"filled by {fallback.name} instead: {span.problem}")
            )
    if isinstance(method, Layer) and method.pins:
        current = pins.meet(current, known, method.pins)
    current = rooted(current, known.translation)
    current = _merge(held(current, clip.source), hidden, known)
    for span in spans:
        for start, stop in mended.get(span.start, ()) if span.method == method.name else ():
            which = f"frames {first + start} to {first + stop - 1}"
            span.notes.append((start, stop - 1, f"a spline leads over {which}, where velocities jumped"))
        excess, above, where = jumps.excess(current, known, span, bounds, first)
        if excess > 1:
            span.notes.append((where, where, f"flagged: {above}"))

    columns = list(clip.translated)
    finished = clip.with_motion(
        np.where(known.rotation[..., None], clip.rotation, current.rotation),
        np.where(known.translation[:, columns, None], clip.translation, current.translation),
    )
    _verify(finished, clip, known)
    slides: dict[Gap, tuple[float, float]] = {}
    for span in spans:
        slides.update(_slides(finished, known, span, gaps))
    reports = [
        _report(
            finished,
            known,
            gap,
            _of(spans, gap),
            raw,
            error,
            before[gap],
            bounds,
            unheld.get(gap),
            slides.get(gap),
            method.name,
            first,
        )
        for gap in gaps
    ]
    provenance = _provenance(known, spans, method.name, opinion, finished)
    return Completion(finished, lambda: raw, provenance, Report(method.name, reports))


def _along(
    path: Mapping[int, np.ndarray],
    clip: Clip,
    observation: Observation,
    known: Observation,
    method: Method,
    seed: int | None,
    fallback: Method,
    limit: float | None,
    first: int,
) -> Completion:
    """Complete a clip, lead the hips along the path, and make the result usable once more."""
    gaps = spans(clip, known, path)
    body = complete(clip, observation, method, seed, fallback, limit, first=first)
    led = body.clip
    for start, stop in gaps:
        if points := {frame: point for frame, point in path.items() if start <= frame < stop}:
            led = follow(led, start, stop, points)
    nothing = np.zeros_like(known.rotation)
    # Who goes there anyway stands as firmly as before.
    same = bool(np.abs(led.positions() - body.clip.positions()).max() < UNMOVED)
    layer = Layer(method.name, led, body.raw, nothing, stands=same)
    done = _told_of(body, complete(clip, observation, layer, seed, layer, limit, first=first))
    ways = over_floor(body.clip), over_floor(done.clip)

    def judged(gap: GapReport) -> GapReport:
        off = [ways[1][f] - p for f, p in path.items() if gap.start <= f < gap.stop]
        if not off:
            return gap
        missed = 100 * float(np.linalg.norm(off, axis=1).max())
        notes = [f"the path is met within {missed:.1f} cm"]
        own, new = (
            np.linalg.norm(np.diff(way[gap.start - 1 : gap.stop + 1], axis=0), axis=1).sum() for way in ways
        )
        if new > FURTHER * own:
            notes.append(
                f"flagged: its way of {new:.1f} m is {new / own:.1f} times as long as without the path, and "
                "steps are too short for it. A longer gap or a nearer point helps"
            )
        return replace(gap, path=missed, notes=(*gap.notes, *notes))

    reports = [judged(gap) for gap in done.report.gaps]
    return replace(done, report=replace(done.report, gaps=reports))


@dataclass
class _Told:
    """A method that is told pins, which those who know nothing of pins leave alone."""

    name: str
    method: Method
    pins: tuple[Pin, ...]

    def refuses(self, clip: Clip, gap: Gap) -> str | None:
        return self.method.refuses(clip, gap)

    def complete(self, clip: Clip, observation: Observation, seed: int | None = None) -> Raw:
        return self.method.complete(clip, replace(observation, pins=self.pins), seed)


def _pinned(
    clip: Clip,
    observation: Observation,
    method: Method,
    seed: int | None,
    fallback: Method,
    limit: float | None,
    path: Mapping[int, np.ndarray] | None,
    first: int,
) -> Completion:
    """Complete a clip, bring what is pinned to its place, and make the result usable once more."""
    pins.check(clip, observation)
    asked, free = pins.merged(observation.pins), replace(observation, pins=())
    known = _certain(clip, free)
    unled = complete(clip, free, method, seed, fallback, limit, path, first)
    # A network that is told of one frame changes that frame: it is told the whole way there and back.
    ways = pins.ways(unled.clip, known, asked)
    told = _Told(method.name, method, ways)
    body = complete(clip, free, told, seed, fallback, limit, path, first) if ways else unled
    met = pins.meet(body.clip, known, asked)
    layer = Layer(method.name, met, body.raw, np.zeros_like(known.rotation), pins=asked)
    done = _told_of(body, complete(clip, free, layer, seed, layer, limit, first=first))
    off = [(pin, frame, 100 * distance) for pin, frame, distance in pins.missed(done.clip, asked)]
    away = {(pin.joint, frame): distance for pin, frame, distance in pins.missed(unled.clip, asked)}
    way = over_floor(done.clip)

    def judged(gap: GapReport) -> GapReport:
        points = [np.linalg.norm(way[f] - p) for f, p in (path or {}).items() if gap.start <= f < gap.stop]
        if points:
            missed = 100 * float(max(points))
            gap = replace(gap, path=missed, notes=(*gap.notes, f"the path is met within {missed:.1f} cm"))
        inside = [one for one in off if gap.start <= one[1] < gap.stop]
        if not inside:
            return gap
        worst = max(inside, key=lambda one: one[2] / (100 * one[0].tolerance))
        notes = [f"the pins are met within {max(distance for *_, distance in inside):.2f} cm"]
        if worst[2] > 100 * worst[0].tolerance:
            notes.append(
                f"flagged: {worst[0].joint} misses its pin at frame {first + worst[1]} by {worst[2]:.1f} cm: "
                "it is out of reach, or pins contradict each other"
            )
        far, where = max((away[pin.joint, frame], (pin.joint, first + frame)) for pin, frame, _ in inside)
        if far > FAR:
            notes.append(
                f"flagged: {where[0]} is pinned {far:.1f} m from where it would be at frame {where[1]}: "
                "is the unit right?"
            )
        return replace(gap, pins=max(distance for *_, distance in inside), notes=(*gap.notes, *notes))

    reports = [judged(gap) for gap in done.report.gaps]
    return replace(done, report=replace(done.report, gaps=reports))


def _told_of(body: Completion, done: Completion) -> Completion:
    """What was laid on a body, or led, with what its report says of gaps that a simpler method filled."""
    before = {
        frame: gap
        for gap in body.report.gaps
        if gap.method != done.report.method
        for frame in range(gap.start, gap.stop)
    }
    reports = [
        replace(
            gap,
            method=one.method,
            model=None,
            notes=(*(n for n in one.notes if n not in gap.notes), *gap.notes),
        )
        if (one := before.get(gap.start)) and gap.method == done.report.method
        else gap
        for gap in done.report.gaps
    ]
    fell = (body.provenance == Provenance.FALLBACK) & (done.provenance != Provenance.OBSERVED)
    provenance = np.where(fell, Provenance.FALLBACK, done.provenance).astype(done.provenance.dtype)
    return replace(done, provenance=provenance, report=replace(done.report, gaps=reports))


def wipe(clip: Clip, observation: Observation) -> Clip:
    """The clip with unobserved values replaced by the linear completion of the observed ones.

    Unobserved values are not even looked at: they may be no numbers. What a file format left in the clip is
    dropped, because it may hold them, too.
    """
    columns = list(clip.translated)
    rotation = np.where(observation.rotation[..., None], clip.rotation, [1.0, 0, 0, 0])
    translation = np.where(observation.translation[:, columns, None], clip.translation, 0.0)
    bare = replace(clip, rotation=rotation, translation=translation, source=None)
    return Linear().complete(bare, observation).clip


def _certain(clip: Clip, observation: Observation) -> Observation:
    """What must come back unchanged: what is observed, and translations that are not animated."""
    translation = observation.translation.copy()
    translation[:, [j for j in range(len(clip.skeleton)) if j not in clip.translated]] = True
    return Observation(observation.rotation, translation)


def _said(method: Method, clip: Clip, observation: Observation, seed: int | None) -> Raw:
    """What a method says. It gets arrays of its own, whatever it does to them."""
    own = clip.with_motion(clip.rotation.copy(), clip.translation.copy())
    seen = replace(
        observation, rotation=observation.rotation.copy(), translation=observation.translation.copy()
    )
    try:
        raw = method.complete(own, seen, seed)
    except InterposeError:
        raise
    except Exception as error:
        why = f"it failed with {type(error).__name__}: {error}"
        raise RequestError(
            f"the method {method.name} does not work", why, "Tell those who made it."
        ) from error
    _sound(raw, clip, method.name)
    return raw


def _of(spans: list[Span], gap: Gap) -> Span:
    return next(span for span in spans if span.start <= gap.start and gap.stop <= span.stop)


def _second(
    fallback: Method, hidden: Clip, observation: Observation, gaps: list[Gap], seed: int | None
) -> Raw:
    """The fallback's completion; raises RequestError when it refuses, too."""
    for gap in gaps:
        if reason := fallback.refuses(hidden, gap):
            raise RequestError(f"cannot fill {gap}", f"{fallback.name}: {reason}", "Choose another method.")
    return fallback.complete(hidden, observation, seed)


def _sound(raw: Any, clip: Clip, name: str) -> None:
    """RequestError naming a method that gives something else than a completion of the clip."""
    if not isinstance(raw, Raw) or not isinstance(raw.clip, Clip):
        problem = f"it gave a {type(raw).__name__}, no interpose.methods.protocol.Raw"
    elif raw.clip.rotation.shape != clip.rotation.shape:
        problem = f"it gave {raw.clip.rotation.shape[:2]} frames and joints of {clip.rotation.shape[:2]}"
    elif raw.positions is not None and np.shape(raw.positions) != (len(clip), len(raw.joints), 3):
        problem = f"it gave positions {np.shape(raw.positions)} of {len(raw.joints)} joints"
    elif raw.clip.translated != clip.translated:
        problem = "it gave a clip in which other joints are translated"
    elif raw.stands is not None and np.shape(raw.stands) != (len(clip), 4):
        problem = f"it says of {np.shape(raw.stands)} feet that they stand, of ({len(clip)}, 4)"
    elif raw.expected is not None and np.shape(raw.expected) != (len(clip),):
        problem = f"it expects errors {np.shape(raw.expected)} of {len(clip)} frames"
    else:
        return
    raise RequestError(f"the method {name} does not work", problem, "Tell those who made it.")


def _opinion(raw: Raw, known: Observation, spans: list[Span]) -> tuple[Clip, np.ndarray | None]:
    """What the method says as rotations, also of the observed frames beside gaps, and how far (F,) metres the
    solve is from its positions, where it speaks positions."""
    if raw.positions is None:
        return raw.clip, None
    clip, beside = raw.clip, seams.reach(raw.clip.fps)
    positions = np.asarray(raw.positions, float)
    lost = ~(np.abs(positions) < NOWHERE).all(axis=(1, 2))
    for span in spans:
        if lost[max(span.start - beside, 0) : span.stop + beside].any():
            span.problem = (
                span.problem or f"it gave positions that are no numbers, or {NOWHERE / 1e3:g} km away"
            )
    free = Observation(~grow(~known.rotation, beside), ~grow(~known.translation, beside))
    rotation, translation = clip.rotation.copy(), clip.translation.copy()
    error = np.full(len(clip), np.nan)
    for first, last in runs(~free.frames & ~lost):
        for start in range(first, last, CHUNK):
            part = slice(start, min(start + CHUNK, last))
            one = clip.slice(part.start, part.stop)
            solved = solve(one, free.slice(part.start, part.stop), raw.joints, positions[part])
            rotation[part], translation[part] = solved.rotation, solved.translation
            error[part] = solve_error(solved, raw.joints, positions[part])
    return clip.with_motion(rotation, translation), error


def _merge(opinion: Clip, hidden: Clip, known: Observation) -> Clip:
    """The opinion where something is missing, what is observed elsewhere: arrays of its own."""
    seen = known.translation[:, list(hidden.translated), None]
    return hidden.with_motion(
        np.where(known.rotation[..., None], hidden.rotation, rotations.normalize(opinion.rotation)),
        np.where(seen, hidden.translation, opinion.translation),
    )


def _carried(opinion: Clip, hidden: Clip, known: Observation) -> Clip:
    """The opinion, with the body where its feet say if its place is all that is lost."""
    if not alone(known, hidden).any():
        return opinion
    return opinion.with_motion(opinion.rotation, stood(_merge(opinion, hidden, known), known).translation)


def _lost(opinion: Clip, hidden: Clip, known: Observation, span: Span) -> str | None:
    """Why the method's motion cannot be eased into the observed one, if so."""
    lo, hi, inner = span.around(len(hidden), 2)
    _, apart = seams.difference(opinion.slice(lo, hi), hidden.slice(lo, hi), known.slice(lo, hi), inner)
    if apart > seams.ABSURD:
        return f"it is {100 * apart:.0f} cm away from what is observed beside the gap"
    return None


def _fade(current: Clip, source: Clip, hidden: Clip, known: Observation, span: Span) -> None:
    """Fade what the source says differently of the observed frames; nothing, if it repeats them."""
    lo, hi, inner = span.around(len(hidden), seams.reach(hidden.fps))
    base, seen = hidden.slice(lo, hi), known.slice(lo, hi)
    raw = source.slice(lo, hi)
    if seams.difference(raw, base, seen, inner)[0] > seams.EXACT:
        write(current, _merge(seams.fade(raw, base, seen, inner), base, seen), span.start, inner)


def _lift(current: Clip, known: Observation, span: Span) -> None:
    """Lift what a span has under the floor."""
    lo, hi, inner = span.around(len(current), round(feet.NEARBY * current.fps))
    write(current, floor.lifted(current.slice(lo, hi), known.slice(lo, hi), inner), span.start, inner)


def _plant(
    current: Clip, known: Observation, span: Span, bounds: jumps.Bounds | None, stands: np.ndarray | None
) -> None:
    """Hold the feet of a span as firmly as they bear: with jumps that the observed motion has, too, or as
    softly as possible with those that a gap may have at most."""
    lo, hi, inner = span.around(len(current), round(feet.NEARBY * current.fps))
    loose, seen, frames = current.slice(lo, hi), known.slice(lo, hi), np.arange(*inner)
    slide, peak = feet.measure(loose, seen, *inner), jumps.largest(loose, seen, frames) or 0.0
    chosen = None
    for blend in feet.BLENDS:
        held = feet.plant(loose, seen, inner, blend, None if stands is None else stands[lo:hi])
        slides, jump = feet.measure(held, seen, *inner), jumps.largest(held, seen, frames) or 0.0
        if slide is None or slides is None or slides[0] > slide[0]:
            break  # holding feet made them slide: it was about something else than stances
        if bounds is None or jump <= max(bounds.peak, peak):
            chosen = held
        if bounds is None or jump <= max(bounds.calm, peak):
            break
    if chosen is not None:
        write(current, chosen, span.start, inner)


def _slides(clip: Clip, known: Observation, span: Span, gaps: list[Gap]) -> dict[Gap, tuple[float, float]]:
    """Slide and travel of the feet in the gaps of a span, for skeletons that have feet."""
    lo, hi, _ = span.around(len(clip), round(feet.NEARBY * clip.fps))
    inside = [gap for gap in gaps if span.start <= gap.start and gap.stop <= span.stop]
    ranges = [(gap.start - lo, gap.stop - lo) for gap in inside]
    return dict(zip(inside, feet.measure_all(clip.slice(lo, hi), known.slice(lo, hi), ranges)))


def _verify(finished: Clip, clip: Clip, known: Observation) -> None:
    """Observed values are the same to the last bit, or this program is wrong."""
    seen = known.translation[:, list(clip.translated)]
    for mine, theirs, mask in (
        (finished.rotation, clip.rotation, known.rotation),
        (finished.translation, clip.translation, seen),
    ):
        if mine[mask].tobytes() != theirs[mask].tobytes():
            raise RuntimeError("internal error: observed values were changed")


def _provenance(
    known: Observation, spans: list[Span], method: str, opinion: Clip, finished: Clip
) -> np.ndarray:
    """(F, J) codes."""
    missing = ~(known.rotation & known.translation)
    codes = np.where(missing, Provenance.METHOD, Provenance.OBSERVED).astype(np.int8)
    # A quaternion and its negative are the same rotation.
    same = np.abs((rotations.normalize(opinion.rotation) * finished.rotation).sum(-1)) > 1 - 1e-12
    columns = list(finished.translated)
    same[:, columns] &= np.abs(opinion.translation - finished.translation).max(-1) < 1e-6
    codes[missing & ~same] = Provenance.CORRECTED
    for span in spans:
        if span.method != method:
            codes[span.start : span.stop][missing[span.start : span.stop]] = Provenance.FALLBACK
    return codes


def _report(
    finished: Clip,
    known: Observation,
    gap: Gap,
    span: Span,
    raw: Raw,
    error: np.ndarray | None,
    before: float | None,
    bounds: jumps.Bounds | None,
    unheld: tuple[float, float] | None,
    held: tuple[float, float] | None,
    method: str,
    first: int,
) -> GapReport:
    part = finished.slice(gap.start, gap.stop)
    own = span.method == method
    skeleton = finished.skeleton
    lengths = np.linalg.norm(skeleton.rest_translation, axis=1) * skeleton.scale_above
    lengths[list(finished.translated)] = np.nan
    after = jumps.largest(finished, known, jumps.beside(gap), seams.seam_jumps)
    alive = None if gap.joints is not None else notes.liveliness(finished, gap)
    glide, ahead = notes.gliding(finished, known, gap), gap.stop == len(finished)
    networks = gap.joints is None and "model" in raw.notes
    never = [] if own and "model" in raw.notes else notes.never(known, gap, skeleton.names)
    inside = penetration.deepest(finished, gap.start, gap.stop, first)
    # It speaks of all joints: where most of them are known it would mislead.
    risk = raw.expected[gap.start : gap.stop] if raw.expected is not None else None
    if gap.joints is not None or not own or risk is None or not np.isfinite(risk).all():
        risk = None
    solved = None if error is None or not own else float(np.nanmean(error[gap.start : gap.stop]))
    return GapReport(
        gap.start,
        gap.stop,
        gap.joints,
        span.method,
        model=raw.notes.get("model") if own else None,
        solve_error=_centi(solved),
        seam_before=_centi(before),
        seam_after=_centi(after),
        seam_limit=_centi(bounds.seam if bounds else None),
        peak=_centi(jumps.largest(finished, known, np.arange(gap.start, gap.stop))),
        peak_limit=_centi(bounds.peak if bounds else None),
        bone_deviation=100 * measures.bone_deviation(part.positions(), skeleton.parents, lengths),
        foot_slide=held[0] if held else None,
        foot_slide_before=unheld[0] if unheld else None,
        foot_travel=held[1] if held else None,
        penetration=_centi(inside[0] if inside else None),
        liveliness=alive,
        gliding=glide[0] if glide else None,
        drift=_centi(_drift(raw.notes, gap)) if own else None,
        expected=_centi(float(np.mean(risk))) if risk is not None else None,
        notes=(
            *span.told(gap),
            *((inside[1],) if inside and inside[1] else ()),
            *notes.sized(skeleton),
            *notes.sunk(finished, known, gap, first),
            *notes.dull(alive, gap, first, ahead, span.method),
            *notes.adrift(glide, finished, gap),
            *notes.skids(held[0] if held else None, finished, known, gap),
            *notes.hasty(finished, known, gap, first),
            *notes.whirling(finished, known, gap, first),
            *([] if bounds else notes.wild(finished, known, gap, first)),
            *notes.doubtful(risk, gap, first, ahead),
            *(notes.scant(known, gap, finished.fps) if networks else ()),
            *notes.rests(never, span.method),
            *(raw.notes.get("remarks", {}).get(f"{gap.start}:{gap.stop}", ()) if own else ()),
        ),
    )


def _drift(notes: dict[str, Any], gap: Gap) -> float | None:
    """`notes["drift"]`: metres, one number or one for each gap under its "start:stop"."""
    drift = notes.get("drift")
    if isinstance(drift, dict):
        drift = drift.get(f"{gap.start}:{gap.stop}")
    return None if drift is None else float(drift)


def _centi(metres: float | None) -> float | None:
    return None if metres is None else 100.0 * metres
