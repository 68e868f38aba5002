"""The image of a motion as a network sees it, as SVG: one row a value, one column a frame, missing is white.

Kaufmann et al. 2020, figures 3, 6 and 9.
"""

from __future__ import annotations

import base64
import struct
import zlib
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from interpose.errors import RequestError
from interpose.show import figure
from interpose.show.plot import FAINT, INK, PAPER, ticks

WIDTH, LEFT, RIGHT, TOP, BOTTOM = 1280, 104, 26, 48, 62
ROW = 4  # pixels

# Values from -LIMIT to LIMIT run through these colors, from dark to light; beyond, the last one is kept.
LIMIT = 2.5
RAMP = ("#2d1160", "#3b528b", "#21918c", "#5ec962", "#f4dc3c")


def palette() -> np.ndarray:
    """(256, 3) red, green and blue, 0 to 255: white for what is missing, then the ramp."""
    anchors = np.array([[int(color[i : i + 2], 16) for i in (1, 3, 5)] for color in RAMP])
    at = np.linspace(0, len(RAMP) - 1, 255)
    ramp = np.stack([np.interp(at, np.arange(len(RAMP)), channel) for channel in anchors.T], axis=1)
    return np.concatenate([np.full((1, 3), 255), np.rint(ramp)]).astype(np.uint8)


def pixels(rows: np.ndarray, known: np.ndarray) -> np.ndarray:
    """(R, T) places in the palette: 0 where a value is not known, else 1 to 255."""
    share = (np.clip(np.where(known, rows, 0.0), -LIMIT, LIMIT) + LIMIT) / (2 * LIMIT)
    return np.where(known, 1 + np.rint(254 * share), 0).astype(np.uint8)


def png(indices: np.ndarray, colors: np.ndarray) -> bytes:
    """A PNG file of places (H, W) in a list of at most 256 colors (n, 3), both unsigned bytes.

    Source: Portable Network Graphics, W3C recommendation, sections 5 and 11.
    """
    height, width = indices.shape
    # Every line begins with the number of its filter: 0, none.
    lines = np.pad(indices, ((0, 0), (1, 0)))

    def chunk(kind: bytes, content: bytes) -> bytes:
        return (
            struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))
        )

    head = struct.pack(">IIBBBBB", width, height, 8, 3, 0, 0, 0)  # 8 bits a pixel, into the palette
    parts = [(b"IHDR", head), (b"PLTE", colors.tobytes()), (b"IDAT", zlib.compress(lines.tobytes(), 9))]
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunk(*part) for part in (*parts, (b"IEND", b"")))


def _embedded(indices: np.ndarray, place: str) -> str:
    """A picture as an SVG element that fills its place (x, y, width, height), pixel by pixel."""
    data = base64.b64encode(png(indices, palette())).decode("ascii")
    return (
        f'<image {place} preserveAspectRatio="none" style="image-rendering:pixelated" '
        f'href="data:image/png;base64,{data}"/>'
    )


def _place(x: float, y: float, width: float, height: float) -> str:
    return f'x="{x:.1f}" y="{y:.1f}" width="{width:.1f}" height="{height:.1f}"'


def image(
    rows: np.ndarray,
    known: np.ndarray,
    fps: float,
    path: str | Path | None = None,
    title: str = "",
    *,
    groups: Mapping[str, int] | None = None,
    first: int = 0,
    width: int = WIDTH,
) -> str:
    """The image of a motion as an SVG picture; known values are colored, missing ones are white.

    Args:
        rows: (R, T) normalised values: in standard deviations from their mean.
        known: (R, T) booleans. What is not known may hold anything.
        fps: frames a second.
        path: where to write the picture, too (UTF-8).
        title: the line above it.
        groups: a name for so many rows each, from the top; R in all.
        first: the number of the first frame, for the seconds below.
        width: pixels.

    Returns:
        The SVG text, with the image inside of it as PNG.

    Raises:
        RequestError: no values, arrays or groups that do not fit each other, known values that are no finite
            numbers.
    """
    rows, known = np.asarray(rows, float), np.asarray(known, bool)
    groups = groups or {}
    if rows.ndim != 2 or not rows.size or rows.shape != known.shape:
        raise RequestError(
            "cannot draw the image",
            f"rows are {rows.shape} and known is {known.shape}",
            "Both are (rows, frames), one or more of each.",
        )
    if groups and sum(groups.values()) != len(rows):
        raise RequestError(
            "the groups of rows do not fit",
            f"they name {sum(groups.values())} rows, and there are {len(rows)}",
            "Name all rows, from the top.",
        )
    if not np.isfinite(rows[known]).all():
        raise RequestError(
            "cannot draw the image", "some known values are no finite numbers", "Mark them as not known."
        )
    count, length = rows.shape
    wide, tall = width - LEFT - RIGHT, count * ROW
    height = TOP + tall + BOTTOM
    base = TOP + tall
    name = figure.text(title or "The image of a motion")
    svg = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" '
        f'height="{height}" role="img" font-family="{figure.text(figure.FONT)}" font-size="12">',
        f"<title>{name}</title>",
        f'<rect x=".5" y=".5" width="{width - 1}" height="{height - 1}" rx="10" fill="{PAPER}" '
        'stroke="#d5dae1"/>',
    ]
    if title:
        svg.append(f'<text x="{LEFT}" y="30" font-size="15" font-weight="600" fill="{INK}">{name}</text>')
    svg.append(_embedded(pixels(rows, known), _place(LEFT, TOP, wide, tall)))
    svg.append(f'<rect {_place(LEFT, TOP, wide, tall)} fill="none" stroke="#d5dae1"/>')

    top = float(TOP)
    for words, number in groups.items():
        bottom = top + number * ROW
        svg.append(
            f'<path d="M{LEFT - 4} {top + 1.5:.1f}h-4V{bottom - 1.5:.1f}h4" fill="none" stroke="{FAINT}"/>'
            f'<text x="{LEFT - 14}" y="{(top + bottom) / 2 + 4:.1f}" text-anchor="end" fill="{INK}">'
            f"{figure.text(words)}</text>"
        )
        top = bottom
    for second in ticks(first / fps, (first + length) / fps, max(wide // 90, 2)):
        x = LEFT + (second * fps - first) / length * wide
        svg.append(
            f'<line x1="{x:.1f}" y1="{base}" x2="{x:.1f}" y2="{base + 5}" stroke="{FAINT}"/>'
            f'<text x="{x:.1f}" y="{base + 18}" text-anchor="middle" fill="{FAINT}">{second:g} s</text>'
        )

    # The legend: the ramp between its ends, and a white box.
    y, x = base + 36, LEFT + 30
    svg.append(
        f'<text x="{x - 6}" y="{y + 9}" text-anchor="end" fill="{FAINT}">-{LIMIT:g}</text>'
        + _embedded(np.arange(1, 256, dtype=np.uint8)[None], _place(x, y, 100, 10))
        + f'<text x="{x + 106}" y="{y + 9}" fill="{FAINT}">{LIMIT:g} deviations from the mean</text>'
        f'<rect {_place(x + 274, y, 14, 10)} fill="{PAPER}" stroke="{FAINT}"/>'
        f'<text x="{x + 294}" y="{y + 9}" fill="{FAINT}">missing</text>'
    )
    svg.append("</svg>\n")
    result = "\n".join(svg)
    if path is not None:
        Path(path).write_text(result, encoding="utf-8")
    return result
