"""What a method says of a clip, taken at its word and no further: it sees copies from which nothing can leak,
what it gives is checked, positions are solved for rotations, and what is observed is put back."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np

from interpose.clip import Clip, Skeleton
from interpose.errors import InterposeError, MotionError, RequestError
from interpose.finish import seams
from interpose.finish.solve import solve, solve_error
from interpose.finish.span import Span
from interpose.finish.standing import alone, stood
from interpose.finish.windows import grow
from interpose.geometry import rotations
from interpose.geometry.time import runs
from interpose.methods.classical import Linear
from interpose.methods.protocol import Method, Raw
from interpose.observation import Gap, Observation

# Positions further out than this (metres) are as good as no numbers.
NOWHERE = 1e4
# Rests of joints that differ by less (metres, parts of a quaternion) are the same, rounded.
SAME = 1e-4
# Frames solved at once.
CHUNK = 4096
TELL = "Tell those who made it."


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


def certain(clip: Clip, observation: Observation) -> Observation:
    """What must come back unchanged: what is observed, and translations that are not animated."""
    translation = observation.translation.copy()
    translation[:, [j for j in range(len(clip.skeleton)) if j not in clip.translated]] = True
    return Observation(observation.rotation, translation)


def said(method: Method, clip: Clip, observation: Observation, seed: int | None) -> Raw:
    """What a method says. It gets arrays of its own, whatever it does to them."""
    own = clip.with_motion(clip.rotation.copy(), clip.translation.copy())
    seen = replace(
        observation, rotation=observation.rotation.copy(), translation=observation.translation.copy()
    )
    with _blamed(method):
        raw = method.complete(own, seen, seed)
        _sound(raw, clip, method.name)
    return raw


def refusal(method: Method, clip: Clip, gap: Gap) -> str | None:
    """Why a method cannot fill a gap, or None if it can."""
    with _blamed(method):
        reason = method.refuses(clip, gap)
    return reason


@contextmanager
def _blamed(method: Method) -> Iterator[None]:
    """What goes wrong within is the fault of a method: RequestError names it."""
    try:
        yield
    except MotionError as error:
        why = f"{error.what}: {error.why}"
        raise RequestError(f"the method {method.name} does not work", why, TELL) from error
    except (InterposeError, MemoryError, OSError):
        raise  # no fault of its own
    except Exception as error:
        why = f"it failed with {type(error).__name__}: {error}"
        raise RequestError(f"the method {method.name} does not work", why, TELL) from error


def second(
    fallback: Method, hidden: Clip, observation: Observation, gaps: list[Gap], seed: int | None
) -> Raw:
    """The fallback's completion; raises RequestError when it refuses, too."""
    for gap in gaps:
        if reason := refusal(fallback, hidden, gap):
            raise RequestError(f"cannot fill {gap}", f"{fallback.name}: {reason}", "Choose another method.")
    return said(fallback, hidden, observation, seed)


def _sound(raw: Any, clip: Clip, name: str) -> None:
    """RequestError naming a method that gives something else than a completion of the clip."""
    if not isinstance(raw, Raw) or not isinstance(raw.clip, Clip):
        problem = f"it gave a {type(raw).__name__}, no interpose.methods.protocol.Raw"
    elif raw.clip.rotation.shape != clip.rotation.shape:
        problem = f"it gave {raw.clip.rotation.shape[:2]} frames and joints of {clip.rotation.shape[:2]}"
    elif raw.positions is not None and np.shape(raw.positions) != (len(clip), len(raw.joints), 3):
        problem = f"it gave positions {np.shape(raw.positions)} of {len(raw.joints)} joints"
    elif raw.positions is not None and (odd := _strange(raw.joints, len(clip.skeleton))):
        problem = f"it gave positions of joint {odd[0]}, and joints are 0 to {len(clip.skeleton) - 1}"
    elif not _alike(raw.clip.skeleton, clip.skeleton):
        problem = "it gave a clip on another skeleton"
    elif raw.clip.translated != clip.translated:
        problem = "it gave a clip in which other joints are translated"
    elif raw.stands is not None and np.shape(raw.stands) != (len(clip), 4):
        problem = f"it says of {np.shape(raw.stands)} feet that they stand, of ({len(clip)}, 4)"
    elif raw.expected is not None and np.shape(raw.expected) != (len(clip),):
        problem = f"it expects errors {np.shape(raw.expected)} of {len(clip)} frames"
    elif not isinstance(raw.notes, Mapping):
        problem = f"its notes are a {type(raw.notes).__name__}, no mapping"
    else:
        return
    raise RequestError(f"the method {name} does not work", problem, TELL)


def _strange(joints: Iterable[object], count: int) -> list[object]:
    """Those that are no indices of `count` joints."""
    return [joint for joint in joints if not (isinstance(joint, int | np.integer) and 0 <= joint < count)]


def _alike(one: Skeleton, other: Skeleton) -> bool:
    """Whether rotations and positions mean the same on two skeletons."""
    rests = ("rest_translation", "rest_rotation", "rest_scale")
    return one is other or (
        one.parents == other.parents
        and all(np.allclose(getattr(one, rest), getattr(other, rest), atol=SAME) for rest in rests)
    )


def as_rotations(raw: Raw, known: Observation, spans: list[Span]) -> tuple[Clip, np.ndarray | None]:
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


def merge(opinion: Clip, hidden: Clip, known: Observation) -> Clip:
    """The opinion where something is missing, what is observed elsewhere: arrays of its own."""
    seen = known.translation[:, list(hidden.translated), None]
    return hidden.with_motion(
        np.where(known.rotation[..., None], hidden.rotation, rotations.normalize(opinion.rotation)),
        np.where(seen, hidden.translation, opinion.translation),
    )


def carried(opinion: Clip, hidden: Clip, known: Observation) -> Clip:
    """The opinion, with the body where its feet say if its place is all that is lost."""
    if not alone(known, hidden).any():
        return opinion
    return opinion.with_motion(opinion.rotation, stood(merge(opinion, hidden, known), known).translation)
