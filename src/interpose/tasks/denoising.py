"""Noise is smoothed, what is lost for moments is filled, and what is frozen is left to `fill`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from interpose.clip import Clip
from interpose.errors import RequestError, few, is_number
from interpose.finish import Completion, Provenance
from interpose.finish.completing import assembled
from interpose.finish.denoise import denoised, measured
from interpose.finish.report import NoiseReport
from interpose.methods import registry
from interpose.methods.classical import Spline
from interpose.methods.protocol import Method
from interpose.observation import Gap, Observation
from interpose.observation.exchange import put_back
from interpose.observation.finding import STUCK, Finding
from interpose.observation.frozen import held_values
from interpose.observation.scan import intact, scan
from interpose.skeletons.performers import Joints, clip_of, meant
from interpose.tasks.filling import fill
from interpose.tasks.planning import seed_of
from interpose.tasks.recovering import swaps, with_sides

ALL = "all"
STRONGEST = 100.0  # how many times the estimated noise may be assumed


def denoise(
    clip: Clip,
    strength: float = 1.0,
    joints: Sequence[str] | None = None,
    frames: tuple[int, int] | None = None,
    method: str | Path | Method = "auto",
    seed: int | None = None,
) -> Completion:
    """Smooth noise, and fill values that were lost, over the whole clip or over frames start to stop - 1; of
    several bodies each as if it were alone, or the one that somebody said is meant (`roles["root"]`).

    Args:
        clip: what is observed but not fully trusted.
        strength: what the estimated noise is multiplied with: 0 changes nothing, 2 is smoother.
        joints: the joints that may turn, roots among them that move, too; None for all.
        frames: the range in which anything may change, from which the noise is estimated, too.
        method: what fills values that were lost; "auto" interpolates, which is best for moments.
        seed: for methods that sample.

    Raises:
        RequestError: too few frames, a strength that is none from 0 to 100, a joint or range that does not
            exist.
    """
    seed = seed_of(seed)
    if not is_number(strength, 0, STRONGEST):
        raise RequestError(
            f"cannot denoise with strength {str(strength)[:40]}",
            "the estimated noise is multiplied with it",
            f"Choose 0 to {STRONGEST:g}: 1 trusts the estimate, 2 smooths more.",
        )
    start, stop = frames or (0, len(clip))
    if frames is not None:
        Gap(start, stop).check(len(clip))
    chosen = None if joints is None else [clip.skeleton.index(name) for name in joints]
    if several := meant(clip.skeleton):
        bodies: dict[Joints, Completion] = {}
        held = {clip.skeleton.names[joint] for body in several for joint in body}
        if strange := [name for name in joints or () if name not in held]:
            root = clip.skeleton.roles["root"]
            raise RequestError(
                f"cannot denoise {few(strange)}",
                f"the body of {root} is meant, and that is of another one",
                "Leave it out, or leave out what is said of the root.",
            )
        for body in several:
            own = clip_of(clip, body)
            some = None if joints is None else [name for name in joints if name in own.skeleton.names]
            bodies[body] = denoise(own, strength, some, frames, method, seed)
        return _of_bodies(clip, bodies)
    swapped = swaps(clip, start, stop) if chosen is None and strength else []
    sides = put_back(clip, swapped)
    frozen = _frozen(sides, start, stop) if strength else []
    led = _led_over(sides, frozen)
    if method == "auto":
        done = denoised(led, strength, chosen, start, stop)
    else:
        registry.get(method)
        done = denoised(
            led, strength, chosen, start, stop, lambda cut, seen: fill(cut, seen, method, seed=seed).clip
        )
    done = with_sides(_with_frozen(done, sides, frozen), swapped)
    assert done.report.noise is not None
    return replace(done, report=replace(done.report, noise=measured(done.report.noise, clip, done.clip)))


def _of_bodies(clip: Clip, bodies: dict[Joints, Completion]) -> Completion:
    """A clip with bodies that were denoised one by one, and what is to be said of all of them."""
    done, told = assembled(clip, bodies), []
    for one in bodies.values():
        assert one.report.noise is not None
        # All joints are those of this body.
        frozen = tuple(
            said.replace(f"({ALL})", f"({few(list(one.clip.skeleton.names))})")
            for said in one.report.noise.frozen
        )
        told.append(replace(one.report.noise, frozen=frozen))
    return replace(done, report=replace(done.report, noise=NoiseReport.of_bodies(told)))


def _frozen(clip: Clip, start: int, stop: int) -> list[Finding]:
    """What is missing of a clip in frames start to stop - 1, as nothing moves there, and is no noise."""
    if not (found := scan(clip, held=True)):
        return []
    gone = ~intact(clip).rotation
    # What snaps to its rest pose, and stays there, is among what is broken, which is filled.
    return [
        one
        for one in found
        if one.start < stop
        and start < one.stop
        and not gone[one.start : one.stop, held_values(clip, one)[0]].any()
    ]


def _led_over(clip: Clip, frozen: Sequence[Finding]) -> Clip:
    """A clip whose frozen values a spline leads over: smoothed, their ends would be rounded off, and nobody
    would find them any more."""
    if not frozen:
        return clip
    seen = Observation.full(clip)
    for one in frozen:
        turns, places = held_values(clip, one)
        seen.rotation[one.start : one.stop, turns] = False
        seen.translation[one.start : one.stop, places] = False
    return Spline().complete(clip, seen).clip


def _told(one: Finding) -> str:
    joints = few(list(one.joints)) if one.joints else ALL
    by = "recover restores" if one.kind in STUCK else "fill fills"
    return f"{one.start}:{one.stop} ({joints}), which interpose {by}"


def _with_frozen(done: Completion, clip: Clip, frozen: Sequence[Finding]) -> Completion:
    """A completion with frozen values as they were, also those in which they are held, and what is said of
    them."""
    if not frozen:
        return done
    turned, moved = (np.zeros(done.provenance.shape, bool) for _ in range(2))
    columns = list(clip.translated)
    for one in frozen:
        turns, places = held_values(clip, one)
        kept = [*range(one.start, one.stop)]
        for frame in {one.start - 1, one.stop} & {*range(len(clip))}:
            held = (clip.rotation[frame, turns] == clip.rotation[one.start, turns]).all()
            where = [columns.index(joint) for joint in places if joint in columns]
            if held and (clip.translation[frame, where] == clip.translation[one.start, where]).all():
                kept.append(frame)
        turned[np.ix_(kept, turns)] = moved[np.ix_(kept, places)] = True
    own = done.provenance != Provenance.METHOD  # what was broken in the frame that is held was filled
    turned, moved = turned & own, moved & own
    rotation = np.where(turned[..., None], clip.rotation, done.clip.rotation)
    translation = np.where(moved[:, columns, None], clip.translation, done.clip.translation)
    same = (rotation == clip.rotation).all(axis=-1)
    same[:, columns] &= (translation == clip.translation).all(axis=-1)
    provenance = np.where((turned | moved) & same, Provenance.OBSERVED, done.provenance).astype(np.int8)
    assert done.report.noise is not None
    told = tuple(_told(one) for one in frozen)
    report = replace(done.report, noise=replace(done.report.noise, frozen=told))
    return replace(done, clip=clip.with_motion(rotation, translation), provenance=provenance, report=report)
