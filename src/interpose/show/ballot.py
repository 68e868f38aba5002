"""A page on which a person says of one clip after the other whether it was recorded or generated."""

from __future__ import annotations

import json
from collections.abc import Sequence
from importlib import resources


def ballot(pages: Sequence[str], survey: str) -> str:
    """One self-contained HTML page that asks about clips 1, 2, ... and saves the answers as a JSON file.

    Args:
        pages: a bare `player` for each clip, in the order in which they are shown.
        survey: which survey it is; stands in the file, so that votes find their key.

    Returns:
        The HTML text. Nothing in it is sent anywhere. `window.interposeBallot` tells its state and takes
        show(number), answer("recorded" or "generated") and save().
    """
    # Inside a script element only these could end it or start a comment; JSON may write them so.
    packed = json.dumps({"survey": survey, "pages": list(pages)}, separators=(",", ":"))
    for character in "<>&":
        packed = packed.replace(character, f"\\u{ord(character):04x}")
    template = resources.files("interpose.show").joinpath("ballot.html").read_text(encoding="utf-8")
    return template.replace("{{data}}", packed)
