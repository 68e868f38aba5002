"""The guarantees, the same for every method.

Precedence when they collide: observed values, then bones, then pins, then seams, then feet.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from interpose.clip import Clip
from interpose.finish import (
    anatomy,
    arms,
    falling,
    feet,
    floor,
    hanging,
    jumps,
    notes,
    pins,
    seams,
    shuffling,
    stepping,
)
from interpose.finish.axes import Axes
from interpose.finish.calming import calmed
from interpose.finish.gap_report import gap_report, provenance, slides
from interpose.finish.habits import Habits
from interpose.finish.loose import Layer
from interpose.finish.opinion import as_rotations, carried, certain, merge, refusal, said, second
from interpose.finish.report import Completion, Report
from interpose.finish.span import Span, write
from interpose.finish.standing import alone
from interpose.formats import held
from interpose.geometry.time import runs
from interpose.methods.classical import Spline
from interpose.methods.protocol import Method, Raw
from interpose.observation import Gap, Observation, Pin
from interpose.skeletons.carrier import rooted
from interpose.skeletons.targets import seated

STOOD = "what the body stands on tells where it is"
STEPS = "the body turns on the spot, in steps"
STEPPED = "feet step where they would have shuffled"
# Rounds in which velocity jumps above the limit are softened.
ROUNDS = 24
# One that came no nearer to it, by this share, in so many of them than before is left as it is.
STALLED, NEARER = 3, 0.998
# What a round leaves at most of how far pins are missed once they are written, or it is the last: a third is
# usual where they are within reach.
LEFT = 0.5
# Metres a second squared by which joints of legs may jump for their feet to stand, where they do less nearby.
# Of 300 fills of validation performers three had one that did twice as far as anywhere in the truth; so one
# has (`bench artefacts --most 25`).
STEADY = 25.0
# Where they jump further than that by themselves they may so many times as far: a softer hold let a foot
# drift by 13 cm for two per cent less.
NO_MORE = 1.1
# Seconds of gaps in which they may as far as anything: in 200 gaps of five frames of LAFAN1's validation
# performer feet slid by 11.5 instead of 11.8 cm/s, and as many fills jumped twice as far as the truth.
BRIEF = 0.3
# A simpler method takes over where it keeps to the limits, or pops by less than this share of what the method
# does: the hand of a body that falls jumps with either, and a knee that is lost alone under a hip that jumps.
# Of 336 knees and ankles of CMU and HDM05 that are lost for 80 frames four gave way to a spline that jumped
# nearly as far, and that was off by 6.0 to 26 cm instead of .8 to 6.1.
LESS = 0.5


@dataclass(frozen=True)
class Ask:
    """By what, and how, a clip is to be completed: the arguments of `finish.complete`."""

    method: Method
    seed: int | None
    fallback: Method
    habits: Habits | None
    first: int


def guaranteed(clip: Clip, hidden: Clip, observation: Observation, ask: Ask) -> Completion:
    """Complete a clip by a method, and make the result usable.

    Args:
        clip: F frames; its unobserved values may be anything.
        hidden: the clip as the method sees it, see `opinion.wipe`.
        observation: what is known, (F, J), without pins.
        ask: by what.

    Raises:
        RequestError: nothing fills a gap.
    """
    work = _Work(clip, hidden, observation, ask)
    if not work.gaps:
        nothing = np.zeros(work.known.rotation.shape, np.int8)
        return Completion(clip, lambda: Raw(clip), nothing, Report(ask.method.name))
    work.listen()
    work.look()
    work.settle([span for span in work.spans if not span.problem], work.opinion, work.raw)
    work.fall_back()
    return work.completion()


class _Work:
    """A clip as it is being completed: each step takes it further.

    Attributes:
        bare: the clip without what is missing; `hidden` the same without what trembles beside that, which is
            what is completed.
        known: what must come back unchanged.
        firm: what is known, and, of a motion that is said in rotations, joints that never turn.
        spans: the runs of frames in which something is missing; `gaps` lie within them.
        raw: what the method said; `opinion` the same as rotations, `error` (F,) how far these are from it.
        current: the clip as far as it is.
        bounds: how far velocities may jump; None where nothing is known to compare with.
        before: the velocity jump beside each gap as the method left it, see `jumps.beside`.
        unheld: slide and travel of the feet in each gap before they are held.
        habits: how the body moves; `axes`, of joints that turn about fewer than three, as far as they hold.
        simpler: what the simpler method said, where it was asked.
        mended, stepped: the frames of spans over which a spline leads, and what is to be said of spans that
            were given steps, by their first frames and whether in the method's own motion.
    """

    def __init__(self, clip: Clip, hidden: Clip, observation: Observation, ask: Ask) -> None:
        self.clip, self.observation, self.ask = clip, observation, ask
        self.layer = ask.method if isinstance(ask.method, Layer) else None
        self.bare, self.hidden = hidden, hidden if self.layer else calmed(hidden, observation)
        self.known = self.firm = certain(hidden, observation)
        self.gaps = self.known.gaps(clip.skeleton)
        self.spans = [Span(start, stop, ask.method.name) for start, stop in runs(~self.known.frames)]
        self.habits = Habits.of(hidden, self.known) if ask.habits is None else ask.habits
        # Pins and paths ask for what a body does not do by itself, and their files hold it.
        self.axes = Axes(clip.source, {} if self.layer else self.habits.single)
        self.simpler: Raw | None = None
        self.unheld: dict[Gap, tuple[float, float]] = {}
        self.mended: dict[tuple[int, bool], list[tuple[int, int]]] = {}
        self.stepped: dict[tuple[int, bool], str] = {}

    def listen(self) -> None:
        """Let the method speak, and start from what it says."""
        ask, hidden, known = self.ask, self.hidden, self.known
        for gap in self.gaps:
            if reason := refusal(ask.method, hidden, gap):
                there = replace(gap, start=gap.start + ask.first, stop=gap.stop + ask.first)
                self._of(gap).problem = f"{ask.method.name} refuses {there}: {reason}"
        if all(span.problem for span in self.spans):
            self.raw = self.simpler = second(ask.fallback, hidden, self.observation, self.gaps, ask.seed)
        else:
            self.raw = said(ask.method, hidden, self.observation, ask.seed)
        self.opinion, self.error = self._hear(self.raw)
        self.current = merge(self.opinion, hidden, known)
        limits = self.habits.limits
        self.bounds = None if np.isnan(limits).any() else jumps.Bounds.of(self.bare, known, limits)
        self.before = {gap: jumps.beside(self.current, known, gap, self.bounds) for gap in self.gaps}

    def _hear(self, raw: Raw) -> tuple[Clip, np.ndarray | None]:
        """What a method says as rotations of a body, and how far (F,) these are from its positions; which
        joints stay `firm` in it."""
        hidden, known = self.hidden, self.known
        rotations_said = not self.layer and raw.positions is None
        self.firm = anatomy.locked(known, self.habits.still) if rotations_said else known
        opinion, error = as_rotations(raw, known, self.spans)
        if not self.layer:
            opinion = carried(opinion, hidden, known)
            if rotations_said:
                opinion = anatomy.unspun(anatomy.straightened(opinion, known), known)
                # Its word on frames that are known as a whole stays: from there it is eased into the gap.
                part = ~known.frames[:, None]
                stays = Observation(self.firm.rotation & part, self.firm.translation & part)
                opinion = merge(opinion, hidden, stays)
        return held(opinion, self.clip.source), error

    def look(self) -> None:
        """Say of spans what is wrong with the method's motion, and where it was not the method's to say."""
        if not self.layer:
            lost = alone(self.known, self.hidden)
            for span in self.spans:
                if lost[span.start : span.stop].any():
                    span.notes.append((span.start, span.stop - 1, STOOD))
            another = not isinstance(self.ask.fallback, Spline)
            anatomy.inside_out(self.opinion, self.known, self.spans, instead=another)
        for span in self.spans:
            span.problem = span.problem or _lost(self.opinion, self.hidden, self.known, span)
            span.hopeless = span.problem is not None

    def settle(self, chosen: list[Span], source: Clip, raw: Raw) -> None:
        """Ease spans of `source`, which is what `raw` comes to, into what is known, and hold the feet.

        The order matters. A body comes down before its feet are held, which goes by the floor that
        it comes to. Feet are held before shuffles are looked for, and once more where steps were taken. What
        turns on the spot steps as `stepping` says, and is neither held nor lifted. Seams are softened last,
        in all spans together: two that share a lone key are neighbours.
        """
        current, layer, own = self.current, self.layer, source is self.opinion
        for span in chosen:
            _fade(current, source, self.hidden, self.firm, span)
            self._holdable(current, span)
            if not (layer and layer.pins):
                # What is pinned would be put back there, and jump.
                anatomy.unwhirl(current, self.firm, span)
                _steady(current, self.known, self.firm, span)
                self.mended[span.start, own] = jumps.mend(current, self.firm, span, self.bounds)
        for span in chosen:
            self.unheld.update(slides(current, self.known, span, self.gaps))
            if not layer:
                _change(current, self.firm, span, falling.landed)
                _change(current, self.firm, span, hanging.grounded)
            if not layer and _change(current, self.firm, span, stepping.stepped):
                self.stepped[span.start, own] = STEPS
            elif not (own and layer and layer.stands):
                _plant(current, self.firm, span, self.bounds, raw.stands)
                if not layer and _unshuffle(current, self.firm, span, self.bounds):
                    self.stepped[span.start, own] = STEPPED
                    _plant(current, self.firm, span, self.bounds, raw.stands, anyway=False)
                _change(current, self.firm, span, floor.lifted)
        for span in chosen:
            self._holdable(current, span)
        waiting, told = set(range(len(chosen))), [list[float]() for _ in chosen]
        for _ in range(ROUNDS):
            # What a span does can be seen from its neighbours, and from no other.
            beside: set[int] = set()
            for i, span in enumerate(chosen):
                if i not in waiting | beside or _stalls(told[i]):
                    continue
                if excess := jumps.soften(current, self.firm, span, self.bounds, self.axes):
                    told[i].append(excess)
                    self._holdable(current, span)
                    beside |= {i - 1, i, i + 1}
            waiting = beside

    def _holdable(self, current: Clip, span: Span) -> None:
        """Let joints in a span turn about the axes that they have."""
        lo, hi, inner = span.around(len(current), 0)
        write(current, self._held(current.slice(lo, hi), self.known.slice(lo, hi)), lo, inner)

    def _held(self, motion: Clip, known: Observation) -> Clip:
        """Some motion by joints that turn about the axes that they have, but for what of it is known."""
        done = self.axes.held(motion, known)
        return motion if done is motion else merge(done, motion, known)

    def fall_back(self) -> None:
        """Let the simpler method fill the spans in which the method's motion does not do, where it does
        better."""
        ask, known, bounds = self.ask, self.known, self.bounds
        for span in self.spans:
            excess, above, _ = jumps.excess(self.current, known, span, bounds, ask.first)
            span.problem = span.problem or (above if excess > jumps.SLACK else None)
        failed = [s for s in self.spans if s.problem and (s.hopeless or ask.fallback.name != ask.method.name)]
        if not failed:
            return
        gaps = [gap for gap in self.gaps if self._of(gap) in failed]
        raw = self.simpler or second(ask.fallback, self.hidden, self.observation, gaps, ask.seed)
        self.simpler = raw  # whose weights they are is said
        other, _ = self._hear(raw)
        start, own = merge(other, self.hidden, known), merge(self.current, self.hidden, known)
        for span in failed:
            write(self.current, start, span.start, (span.start, span.stop))
        self.settle(failed, other, raw)
        for span in failed:
            # Where the simpler method pops as well, there is no reason to lose the motion; nor where it
            # has only the rest pose to say.
            excess, less = (
                jumps.excess(one, known, span, bounds, ask.first)[0] for one in (own, self.current)
            )
            blank = isinstance(ask.fallback, Spline) and any(
                notes.never(known, gap, self.clip.skeleton.names) for gap in gaps if self._of(gap) is span
            )
            if not span.hopeless and (blank or less > max(1.0, LESS * excess)):
                write(self.current, own, span.start, (span.start, span.stop))
                continue
            span.method = ask.fallback.name
            told = f"filled by {ask.fallback.name} instead: {span.problem}"
            span.notes.append((span.start, span.stop - 1, told))

    def completion(self) -> Completion:
        """What is observed, bit for bit, with what was completed; and what is to be said of it."""
        ask, clip, known = self.ask, self.clip, self.known
        current, pinned = self.current, self.layer.pins if self.layer else ()
        if pinned:
            current = self._met(current, pinned)
        current = rooted(current, known.translation, known.rotation)
        # What is pinned itself stays where that puts it.
        stays = np.isin(clip.skeleton.names, [pin.joint for pin in pinned])
        current = seated(current, known.translation, known.rotation | stays)
        current = merge(self._held(current, known), self.bare, known)
        for span in self.spans:
            chosen = span.start, span.method == ask.method.name
            for start, stop in self.mended.get(chosen, ()):
                which = f"frames {ask.first + start} to {ask.first + stop - 1}"
                span.notes.append((start, stop - 1, f"a spline leads over {which}, where velocities jumped"))
            if steps := self.stepped.get(chosen):
                span.notes.append((span.start, span.stop - 1, steps))
            asked = (current, known, span, self.bounds, ask.first)
            found = [one for one in jumps.excesses(*asked) if one[0] > jumps.SLACK]
            for excess, above, where in found or jumps.whips(*asked):
                if excess > jumps.SLACK:
                    span.notes.append((where, where, f"flagged: {above}"))
        columns = list(clip.translated)
        finished = clip.with_motion(
            np.where(known.rotation[..., None], clip.rotation, current.rotation),
            np.where(known.translation[:, columns, None], clip.translation, current.translation),
        )
        _verify(finished, clip, known)
        raw, name = self.raw, ask.method.name
        slid = {
            gap: slide
            for span in self.spans
            for gap, slide in slides(finished, known, span, self.gaps).items()
        }
        reports = [
            gap_report(
                finished,
                known,
                gap,
                self._of(gap),
                raw,
                instead=self.simpler,
                error=self.error,
                before=self.before[gap],
                bounds=self.bounds,
                unheld=self.unheld.get(gap),
                held=slid.get(gap),
                method=name,
                first=ask.first,
            )
            for gap in self.gaps
        ]
        sources = provenance(known, self.spans, name, self.opinion, finished)
        return Completion(finished, lambda: raw, sources, Report(name, reports))

    def _met(self, current: Clip, pinned: tuple[Pin, ...]) -> Clip:
        """The clip with its pins met, by what its file holds of it: joints of AMC turn about fewer axes than
        three, and what these leave over others make up for, round by round."""
        best, least = current, np.inf
        for _ in range(ROUNDS):
            met = pins.meet(current, self.known, pinned, axes=self.axes)
            current = self._held(met, self.known)
            if current is met:
                return met
            off = max((far / pin.tolerance for pin, _, far in pins.missed(current, pinned)), default=0.0)
            nearer = off <= LEFT * least
            if off < least:
                best, least = current, off
            if off <= 1.0 or not nearer:
                break
        return best

    def _of(self, gap: Gap) -> Span:
        return next(span for span in self.spans if span.start <= gap.start and gap.stop <= span.stop)


def _stalls(told: list[float]) -> bool:
    """Whether what was told in the last rounds is no nearer to what it should be than what was before."""
    recent, before = told[-STALLED:], told[:-STALLED]
    return bool(before) and min(recent) > NEARER * min(before)


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
        write(current, merge(seams.fade(raw, base, seen, inner), base, seen), span.start, inner)


def _steady(current: Clip, known: Observation, firm: Observation, span: Span) -> None:
    """Let a spline lead arms over frames of a span in which their hands jump."""
    lo, hi, inner = span.around(len(current), round(arms.NEARBY * current.fps))
    led = arms.steadied(current.slice(lo, hi), known.slice(lo, hi), firm.slice(lo, hi), inner)
    write(current, led, span.start, inner)


def _change(
    current: Clip,
    known: Observation,
    span: Span,
    to: Callable[[Clip, Observation, tuple[int, int]], Clip | None],
) -> bool:
    """Change a span to what is made of it, told the motion nearby, what of that is known, and where the span
    lies in it; False where that is nothing."""
    lo, hi, inner = span.around(len(current), round(feet.NEARBY * current.fps))
    done = to(current.slice(lo, hi), known.slice(lo, hi), inner)
    if done is not None:
        write(current, done, span.start, inner)
    return done is not None


def _unshuffle(current: Clip, known: Observation, span: Span, bounds: jumps.Bounds | None) -> bool:
    """Let feet of a span step that shuffle; False where none does, or legs would jump further than they do
    in the observed motion."""
    lo, hi, inner = span.around(len(current), round(feet.NEARBY * current.fps))
    part, seen = current.slice(lo, hi), known.slice(lo, hi)
    usual, frames = _usual(part, seen, _peak(current, bounds)), np.arange(*inner)
    before = jumps.share(part, seen, frames, usual)
    for takes in shuffling.TAKES:
        done = shuffling.stepping(part, seen, inner, takes)
        if done is not None and jumps.share(done, seen, frames, usual) <= max(1.0, before):
            write(current, done, span.start, inner)
            return True
    return False


def _plant(
    current: Clip,
    known: Observation,
    span: Span,
    bounds: jumps.Bounds | None,
    stands: np.ndarray | None,
    anyway: bool = True,
) -> None:
    """Hold the feet of a span, one after the other: as firmly as its legs jump no further than legs do in the
    observed motion, or so that they jump least; or else not at all, unless `anyway`."""
    lo, hi, inner = span.around(len(current), round(feet.NEARBY * current.fps))
    done, seen = current.slice(lo, hi), known.slice(lo, hi)
    peak = _peak(current, bounds)
    usual = peak if span.stop - span.start <= BRIEF * current.fps else _usual(done, seen, peak)
    for leg in range(len(feet.legs(current.skeleton))):
        said = None if stands is None else stands[lo:hi]
        done = _hold(done, seen, inner, leg, peak, usual, said, anyway)
    write(current, done, span.start, inner)


def _peak(clip: Clip, bounds: jumps.Bounds | None) -> np.ndarray:
    """(J,) how far velocities of joints may jump inside of gaps, also where nothing tells how far they do."""
    return np.full(len(clip.skeleton), jumps.SETS_OFF / clip.fps**2) if bounds is None else bounds.peak


def _usual(clip: Clip, known: Observation, peak: np.ndarray) -> np.ndarray:
    """(J,) how far the velocities of knees, ankles and toes jump where they are known, in metres per frame
    squared, STEADY at least and `peak` (J,) at most; no limit for other joints."""
    own = np.nan_to_num(seams.own_jumps(clip, known)).max(axis=0, initial=0.0)
    usual, legs = np.full(len(own), np.inf), feet.legs(clip.skeleton)
    for kind in zip(*([leg.knee, *leg.foot] for leg in legs)):
        usual[list(kind)] = max(own[list(kind)].max(), STEADY * feet.size(clip.skeleton) / clip.fps**2)
    return np.minimum(usual, np.where(np.isfinite(usual), peak, np.inf))


def _hold(
    loose: Clip,
    seen: Observation,
    inner: tuple[int, int],
    leg: int,
    peak: np.ndarray,
    usual: np.ndarray,
    stands: np.ndarray | None,
    anyway: bool = True,
) -> Clip:
    """A clip with one foot held in the frames `inner`, unless it would slide more, or joints jump further
    than they may inside of gaps, `peak` (J,); as firmly as legs jump no further than is `usual` (J,), or else
    so that they do least, or, unless `anyway`, not.

    Feet that step stand before and after: to hold them made legs of 8 of 160 gaps of two and three seconds
    jump by 32 m/s^2, and 27 so, one of them twice as far as anywhere in the truth; they drift by less, too.
    """
    frames, slide = np.arange(*inner), feet.measure(loose, seen, *inner)
    before, own = (jumps.share(loose, seen, frames, most) for most in (peak, usual))
    chosen, least = loose, np.inf
    for blend in feet.BLENDS:
        held = feet.plant(loose, seen, inner, blend, stands, only=leg)
        slides = feet.measure(held, seen, *inner)
        if slide is None or slides is None or slides[0] > slide[0]:
            break  # holding feet made them slide: it was about something else than stances
        jump = jumps.share(held, seen, frames, usual)
        if jump < least and jumps.share(held, seen, frames, peak) <= max(1.0, before):
            chosen, least = held, jump
        if least <= max(1.0, NO_MORE * own):
            break
    return chosen if anyway or least <= max(1.0, NO_MORE * own) else loose


def _verify(finished: Clip, clip: Clip, known: Observation) -> None:
    """Observed values are the same to the last bit, or this program is wrong."""
    seen = known.translation[:, list(clip.translated)]
    for mine, theirs, mask in (
        (finished.rotation, clip.rotation, known.rotation),
        (finished.translation, clip.translation, seen),
    ):
        if mine[mask].tobytes() != theirs[mask].tobytes():
            raise RuntimeError("internal error: observed values were changed")
