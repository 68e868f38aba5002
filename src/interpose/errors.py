"""Errors that a user can act on: what happened, why, and what to do about it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from numbers import Real
from typing import Any, TypeGuard, cast


class InterposeError(ValueError):
    """One line what, one line why, one line what to do.

    Args:
        what: what could not be done, with the name of the file or value concerned.
        why: the reason, with the offending value.
        fix: what the user can type or change.
    """

    exit_code = 2

    def __init__(self, what: str, why: str = "", fix: str = "") -> None:
        self.what, self.why, self.fix = what, why, fix
        super().__init__("\n".join(line for line in (what, why, fix) if line))


class RequestError(InterposeError):
    """The request itself is wrong: an unknown joint, a range outside the clip, an existing output."""


class MotionError(RequestError):
    """Numbers are none that a motion has: no numbers at all, or rotations that are none."""


class NothingError(RequestError):
    """There is nothing to do, which is no fault where one clip of many needs nothing.

    Args:
        left: what is missing there and is another verb's, if anything is.
        code: with which exit code one of several clips ends so.
    """

    def __init__(self, what: str, why: str = "", fix: str = "", left: str = "", code: int = 0) -> None:
        super().__init__(what, why, fix)
        self.left, self.code = left, code


class Fault(InterposeError):
    """The program is wrong."""

    exit_code = 1


class FileError(InterposeError):
    """The input cannot be read: missing, binary, truncated or contradicting itself."""

    exit_code = 3


def unknown(kind: str, name: object, choices: object) -> RequestError:
    """The error for a name that is not in a list; the list is in the message, nearest names first."""
    import difflib

    names = [str(choice) for choice in choices]  # type: ignore[attr-defined]
    near = difflib.get_close_matches(str(name), names, n=3, cutoff=0.5)
    hint = f"Did you mean {' or '.join(near)}? " if near else ""
    return RequestError(
        f"unknown {kind}: {name}",
        f"the choices are: {', '.join(names)}",
        f"{hint}Choose one of the names above.",
    )


def unfit(name: str, value: object, kind: str) -> RequestError:
    """The error for an argument of a wholly other kind than the one that it must be of."""
    shown = repr(value)
    shown = shown if len(shown) <= 60 else f"{shown[:57]}..."
    a = "an" if type(value).__name__[0] in "aeiouAEIO" else "a"
    why = "nothing was given" if value is None else f"it is {a} {type(value).__name__}"
    return RequestError(f"cannot use {name}={shown}", why, f"Give {kind}.")


def is_number(
    value: Any, least: float = -math.inf, most: float = math.inf, whole: bool = False
) -> TypeGuard[float]:
    """Whether something is a number of any kind, NumPy's too, from `least` to `most`: no text, no NaN, not
    without end. A `whole` one may be written 2.0."""
    if not isinstance(value, Real):
        return False
    size = cast(float, value)
    return abs(size) < math.inf and least <= size <= most and (not whole or size == int(size))


def few(names: Sequence[str], most: int = 4) -> str:
    """Names in a sentence, the first of many."""
    return ", ".join(names[:most]) + f" +{len(names) - most}" * (len(names) > most)
