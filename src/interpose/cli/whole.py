"""Whole numbers on a command line, of which the parser by itself takes 1.5 for 2."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Annotated, Any

from cyclopts import CoercionError, Parameter, Token, convert
from cyclopts.validators import Number


def _whole(kind: Any, tokens: Sequence[Token]) -> Any:
    for token in tokens:
        if not re.fullmatch(r"[+-]?[0-9]+", token.value):
            raise CoercionError(token=token, target_type=int)
    return convert(kind, tokens)


WHOLE = Parameter(converter=_whole)
Whole = Annotated[int, WHOLE]
# How many there are of something.
Count = Annotated[int, WHOLE, Parameter(validator=Number(gte=1))]
