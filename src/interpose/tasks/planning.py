"""Which gaps there are, and what fills each of them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from interpose.clip import Clip
from interpose.errors import RequestError, is_number
from interpose.finish import pins as pinning
from interpose.geometry.time import runs
from interpose.methods import auto, registry
from interpose.methods.classical import Spline
from interpose.methods.protocol import Method
from interpose.observation import Gap, Observation


@dataclass(frozen=True)
class Job:
    """A run of frames in which something is missing, its number in order of time, and who fills it."""

    number: int
    gap: Gap
    method: Method | None  # None: it stays open
    note: str | None = None


def plan(
    clip: Clip,
    observation: Observation,
    method: str | Path | Method,
    max_gap: int | None,
    only: Iterable[int] | int | None,
    methods: Mapping[int, str | Path | Method],
    action: str = "",
    temperature: float = 1.0,
    zero: int = 0,
) -> list[Job]:
    """The runs of incomplete frames, numbered in order of time, each with its method; pins are checked."""
    pinning.asked(clip, observation, -zero)
    spans = [_span(observation, clip, start, stop) for start, stop in runs(~observation.frames)]
    wanted = (
        range(1, len(spans) + 1) if only is None else list(only) if isinstance(only, Iterable) else [only]
    )
    for number in (*wanted, *methods):
        if not is_number(number, 1, len(spans), whole=True):
            raise RequestError(
                f"there is no gap number {str(number)[:40]}",
                f"the clip has {len(spans)} gap{'s' * (len(spans) != 1)}, counted from 1 in order of time",
                "Leave the number out: a dry run (--dry-run) lists them then; in Python the report does.",
            )
    jobs = []
    for number, gap in enumerate(spans, 1):
        lead = _lead(observation, gap)
        open_ = (max_gap is not None and len(lead) > max_gap) or number not in wanted
        name, note = methods.get(number, method), None
        if name == "auto" and action:
            chosen = auto.choose_told(clip, lead, action)
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


def seed_of(seed: object) -> int | None:
    """A seed as an int, or None for none; RequestError for what cannot be one."""
    if seed is None:
        return None
    if not is_number(seed, 0, whole=True):
        raise RequestError(
            f"cannot take the seed {str(seed)[:40]}",
            "it is a whole number from 0 on",
            "Write --seed 1 (seed=1 in Python).",
        )
    return int(seed)


def _suited(clip: Clip, observation: Observation, gap: Gap, lead: Gap) -> tuple[Method, str | None]:
    """The method that `auto` takes for a gap, and why no network, where one would be its own."""
    if observation.rotation[gap.start : gap.stop].all():
        # What the body stands on tells more of where it is than any method.
        return Spline(), None
    chosen, note = auto.choose(clip, lead, _lone(observation, gap))
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
