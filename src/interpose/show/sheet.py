"""Several SVG pictures as one, on a grid."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from interpose.errors import RequestError


def sheet(pictures: Sequence[str], path: str | Path | None = None, *, columns: int = 1) -> str:
    """Pictures beside and below each other, row by row from the left, as one SVG picture.

    Args:
        pictures: SVG texts as `strip`, `image` and `line_plot` return them, with a size in pixels.
        path: where to write the picture, too (UTF-8).
        columns: how many stand side by side; a row is as high as its highest one.

    Returns:
        The SVG text.

    Raises:
        RequestError: no picture, or one without a size.
    """
    if not pictures:
        raise RequestError("there is nothing to draw", "the sheet has no pictures", "Give one or more.")
    placed, below, widest = [], 0, 0
    for start in range(0, len(pictures), columns):
        beside, tallest = 0, 0
        for picture in pictures[start : start + columns]:
            width, height = _size(picture)
            placed.append(picture.replace("<svg ", f'<svg x="{beside}" y="{below}" ', 1))
            beside, tallest = beside + width, max(tallest, height)
        below, widest = below + tallest, max(widest, beside)
    size = f'viewBox="0 0 {widest} {below}" width="{widest}" height="{below}"'
    result = f'<svg xmlns="http://www.w3.org/2000/svg" {size}>\n{"".join(placed)}</svg>\n'
    if path is not None:
        Path(path).write_text(result, encoding="utf-8")
    return result


def _size(picture: str) -> tuple[int, int]:
    """Width and height of an SVG picture in pixels."""
    found = re.match(r'<svg [^>]*width="(\d+)" height="(\d+)"', picture)
    if not found:
        raise RequestError(
            "cannot lay a picture on the sheet",
            "it does not begin with an svg element that has a width and a height in pixels",
            "Take what strip, image and line_plot return.",
        )
    return int(found[1]), int(found[2])
