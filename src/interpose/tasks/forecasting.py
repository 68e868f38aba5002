"""How a clip goes on."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from interpose.clip import Clip
from interpose.errors import RequestError, few, is_number
from interpose.finish import Completion
from interpose.finish.opinion import refusal
from interpose.methods import registry
from interpose.methods.protocol import Method, Sampler
from interpose.observation import Gap, Observation, timeline
from interpose.observation.scan import strays
from interpose.skeletons.performers import clip_of, performers
from interpose.tasks.filling import fill
from interpose.tasks.planning import plan, seed_of

AHEAD = 2.0  # seconds that a forecast goes on for, if nobody says how long
HOTTEST = 10.0  # times the noise of the training that may be injected
FIRST = 1  # the seed of the first of several samples, where none is given


@dataclass(frozen=True, eq=False, repr=False)
class Forecast(Completion):
    """A clip and what follows, and other ways in which it may go on.

    Attributes:
        start: the first frame that is new, of any body: a last one that was no part of the motion and is made
            anew, too.
        samples: all of them, this one first.
    """

    start: int
    samples: list[Completion]

    def spread(self) -> np.ndarray:
        """(frames,) cm by which joints of the samples lie apart, in the root mean square, by new frame."""
        positions = np.stack([one.clip.slice(self.start, len(one.clip)).positions() for one in self.samples])
        off = np.linalg.norm(positions - positions.mean(axis=0), axis=-1)
        return np.asarray(100 * np.sqrt(np.square(off).mean(axis=(0, 2))))


def forecast(
    clip: Clip,
    frames: int | None = None,
    samples: int = 1,
    method: str | Path | Method = "auto",
    seed: int | None = None,
    temperature: float = 1.0,
    progress: Callable[[float], None] | None = None,
) -> Forecast:
    """Go on with a clip, from its last pose and where that is.

    Args:
        clip: what is known; it comes back unchanged, but for a last frame that is no part of the motion, as
            a rest pose that ends a file: it is made anew, of bodies of which it is so, and a note says so.
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
    for what, count, fix in (("frame", frames, 60), ("sample", samples, 5)):
        if not is_number(count, 1, whole=True):
            raise RequestError(
                f"cannot forecast {str(count)[:40]} {what}s",
                "it is a whole number from 1 on",
                f"Ask for {fix} {what}s, for example.",
            )
    frames, samples, seed = int(frames), int(samples), seed_of(seed)
    timeline.bounded(frames, clip.fps)
    if not is_number(temperature, 0, HOTTEST):
        raise RequestError(
            f"cannot sample at temperature {str(temperature)[:40]}",
            "the noise is multiplied with it",
            f"Choose 0 to {HOTTEST:g}: 1 is what the network was trained with.",
        )
    if not len(clip):
        raise RequestError("there is nothing to go on from", "the clip has no frame", "Name another clip.")
    longer = clip.take(np.minimum(np.arange(len(clip) + frames), len(clip) - 1))
    odd, last = _astray(clip), len(clip)
    every = odd == [None]
    gap = Gap(last - every, len(longer))
    seen = Observation.without(longer, [gap])
    own = Observation.from_gaps(longer, [Gap(last - 1, last, names) for names in odd if names])
    seen = Observation(seen.rotation & own.rotation, seen.translation & own.translation)
    job = plan(longer, seen, method, None, None, {})[0]
    chosen = job.method if method == "auto" and job.method else method
    name = registry.name_of(chosen)
    if samples > 1 and job.method and (why := refusal(job.method, longer, gap)):
        raise RequestError(
            f"cannot draw {samples} samples",
            f"{name} refuses: {why}",
            "Ask for one, or give it more to see.",
        )
    if samples > 1 and not isinstance(registry.get(chosen), Sampler):
        raise registry.one_answer(f"cannot draw {samples} samples with {name}")
    seeds = [seed] if samples == 1 else [(FIRST if seed is None else seed) + i for i in range(samples)]

    def part(i: int) -> Callable[[float], None] | None:
        return (lambda share: progress((i + share) / samples)) if progress else None

    done = []
    for i, drawn in enumerate(seeds):
        one = fill(longer, seen, chosen, seed=drawn, progress=part(i), temperature=temperature)
        told = one.report.gaps[0]
        if samples > 1 and told.method != one.report.method:
            raise RequestError(
                f"cannot draw {samples} samples",
                f"{name} fails here, and {told.method}, which fills in for it, has one answer only",
                "Ask for one: its report says why.",
            )
        done.append(one)
    # Why it is no network's, which this was to be.
    if job.note:
        done = [_noted(one, job.note) for one in done]
    for names in odd:
        whose = f" of {few(list(names))}" if names else ""
        said = f"frame {last - 1}{whose} is no part of the motion, and made anew"
        done = [_noted(one, said, names) for one in done]
    # The report tells what was asked for; its gap, what did it.
    asked = registry.name_of(method)
    first, *others = (replace(one, report=replace(one.report, method=asked)) for one in done)
    made = Forecast(
        first.clip, first.said, first.provenance, first.report, start=last - bool(odd), samples=[]
    )
    made.samples.extend([made, *others])
    return made


def _astray(clip: Clip) -> list[tuple[str, ...] | None]:
    """The joints of each of several bodies whose last frame has nothing to do with the one before; None for
    all that there are."""
    bodies = performers(clip.skeleton)
    odd = [joints for joints in bodies if len(clip) - 1 in strays(clip_of(clip, joints))]
    if odd == [*bodies]:
        return [None] if bodies or len(clip) - 1 in strays(clip) else []
    return [tuple(clip.skeleton.names[joint] for joint in joints) for joints in odd]


def _noted(done: Completion, note: str, whose: tuple[str, ...] | None = None) -> Completion:
    """With one more note of its gaps, or of those of some joints alone."""
    gaps = [
        replace(gap, notes=(note, *gap.notes))
        if whose is None or {*whose} & {*(gap.joints or whose)}
        else gap
        for gap in done.report.gaps
    ]
    return replace(done, report=replace(done.report, gaps=gaps))
