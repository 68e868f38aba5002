"""Whole numbers on a command line, of which the parser by itself takes 1.5 for 2; and seconds for frames."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Annotated, Any

from cyclopts import CoercionError, Parameter, Token, convert
from cyclopts.validators import Number

from interpose.errors import RequestError


def _whole(kind: Any, tokens: Sequence[Token]) -> Any:
    for token in tokens:
        if not re.fullmatch(r"[+-]?[0-9]+", token.value):
            raise CoercionError(token=token, target_type=int)
    return convert(kind, tokens)


WHOLE = Parameter(converter=_whole)
Whole = Annotated[int, WHOLE]
# How many there are of something.
Count = Annotated[int, WHOLE, Parameter(validator=Number(gte=1))]


def frames_of(text: str, fps: float) -> int:
    """How many frames to generate: of "60", or "2s". RequestError for what is no number, or none."""
    from interpose.observation.observation import frame_at

    try:
        count = frame_at(text.strip(), fps)
    except (ValueError, OverflowError):
        count = 0
    if count < 1:
        why = "it takes a number from 1 on, or seconds"
        raise RequestError(f"cannot generate {text} frames", why, "Write 45, or 1.5s.")
    return count
