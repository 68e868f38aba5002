"""A small line chart as SVG, for curves of error and loss."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from interpose.errors import RequestError
from interpose.show import figure

WIDTH, HEIGHT, LEFT, RIGHT, BOTTOM = 760, 460, 78, 26, 64
INK, FAINT, PAPER, GRID = "#1f2328", "#656d76", "#ffffff", "#e4e8ed"
COLORS = ("#2563c9", "#d9622b", "#2f8f4e", "#8b4fc6", "#b8860b", "#0f8b8d", "#c2345d", "#64748b")

# More points than this in a line are not seen; neighbours are averaged.
POINTS = 800


def ticks(low: float, high: float, count: int = 6) -> list[float]:
    """Round values (1, 2 or 5 times a power of ten apart) from low to high, about `count` of them."""
    rough = (high - low) / max(count, 1)
    power = 10.0 ** math.floor(math.log10(rough))
    step = power * next(m for m in (1, 2, 5, 10) if m * power >= rough * 0.999)
    return [i * step for i in range(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1)]


def log_ticks(low: float, high: float) -> list[float]:
    """Powers of ten from low to high, with 2 and 5 times of them where there are few."""
    powers = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    for factors in ((1,), (1, 2, 5), tuple(range(1, 10))):
        found = [f * 10.0**p for p in powers for f in factors if low * 0.999 <= f * 10.0**p <= high * 1.001]
        if len(found) >= 4:
            break
    return found or [low, high]


def _label(value: float, largest: float = 0.0) -> str:
    # Whole thousands as 20k on axes that reach far: steps of a training are long numbers.
    if largest >= 10000 and value and value % 1000 == 0:
        return f"{value / 1e6:g}M" if value % 1e6 == 0 else f"{value / 1000:g}k"
    return f"{value:.6g}"


def _thin(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    if len(x) <= POINTS:
        return x, y
    edges = np.linspace(0, len(x), POINTS + 1).astype(int)
    x, y = (np.array([v[a:b].mean() for a, b in zip(edges, edges[1:])]) for v in (x, y))
    return x, y


def _width(words: str) -> float:
    return 7.1 * len(words)


def line_plot(
    series: Mapping[str, tuple[Sequence[float], Sequence[float]]],
    xlabel: str,
    ylabel: str,
    title: str,
    path: str | Path | None = None,
    *,
    log: bool = False,
    marks: Mapping[str, float] | None = None,
) -> str:
    """A line chart as SVG.

    Args:
        series: name to (x, y), each of n values; values that are not finite interrupt the line.
        xlabel, ylabel, title: words at the axes and above.
        path: where to write the picture, too (UTF-8).
        log: whether the y axis is logarithmic; values that are not above zero then interrupt the line.
        marks: words to an x value at which a dashed line stands (a threshold).

    Returns:
        The SVG text.

    Raises:
        RequestError: nothing to draw, or x and y of different length.
    """
    lines: dict[str, tuple[np.ndarray, np.ndarray]] = {}
    for name, (xs, ys) in series.items():
        x, y = np.asarray(xs, float).reshape(-1), np.asarray(ys, float).reshape(-1)
        if len(x) != len(y):
            raise RequestError(f"cannot draw the line {name!r}", f"it has {len(x)} x and {len(y)} y values")
        y = np.where(np.isfinite(x) & np.isfinite(y) & ((y > 0) | (not log)), y, np.nan)
        lines[name] = _thin(x, y)
    seen = [(x[~np.isnan(y)], y[~np.isnan(y)]) for x, y in lines.values()]
    if not any(len(x) for x, _ in seen):
        raise RequestError(
            "there is nothing to draw", "no line has a finite value" + (" above zero" if log else "")
        )
    all_x = np.concatenate([x for x, _ in seen] + [np.array(list((marks or {}).values()), float)])
    all_y = np.concatenate([y for _, y in seen])
    x_low, x_high = float(all_x.min()), float(all_x.max())
    if x_low == x_high:
        x_low, x_high = x_low - 0.5, x_high + 0.5
    y_low, y_high = float(all_y.min()), float(all_y.max())
    if log:
        room = (y_high / y_low) ** 0.05 if y_high > y_low else 2.0
        y_low, y_high = y_low / room, y_high * room
        y_marks = log_ticks(y_low, y_high)
    else:
        # From zero where the values are above it and not far away: heights then compare honestly.
        room = 0.06 * (y_high - y_low) or abs(y_high) * 0.1 or 1.0
        y_low = 0.0 if 0 <= y_low < 0.6 * y_high else y_low - room
        y_high += room
        y_marks = ticks(y_low, y_high)

    # The legend wraps; the plot starts below it.
    legend: list[tuple[str, str, float, int]] = []
    at, rank = float(LEFT), 0
    for i, name in enumerate(lines):
        needs = 30 + _width(name) + 18
        if at > LEFT and at + needs > WIDTH - RIGHT + 18:
            at, rank = float(LEFT), rank + 1
        legend.append((name, COLORS[i % len(COLORS)], at, rank))
        at += needs
    top = 78 + 20 * rank
    height = HEIGHT + 20 * rank

    def px(value: float) -> float:
        return LEFT + (value - x_low) / (x_high - x_low) * (WIDTH - LEFT - RIGHT)

    def py(value: float) -> float:
        low, high, at = (math.log10(v) if log else v for v in (y_low, y_high, value))
        return height - BOTTOM - (at - low) / (high - low) * (height - BOTTOM - top)

    svg = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" width="{WIDTH}" '
        f'height="{height}" role="img" font-family="{figure.text(figure.FONT)}" font-size="13">',
        f"<title>{figure.text(title)}</title>",
        f'<rect x=".5" y=".5" width="{WIDTH - 1}" height="{height - 1}" rx="10" fill="{PAPER}" '
        'stroke="#d5dae1"/>',
        f'<text x="{LEFT}" y="32" font-size="17" font-weight="600" fill="{INK}">{figure.text(title)}</text>',
    ]
    for name, color, x0, line in legend:
        y0 = 56.0 + 20 * line
        svg.append(
            f'<line x1="{x0:.1f}" y1="{y0}" x2="{x0 + 22:.1f}" y2="{y0}" stroke="{color}" stroke-width="3" '
            f'stroke-linecap="round"/><text x="{x0 + 30:.1f}" y="{y0 + 4.5}" fill="{INK}">'
            f"{figure.text(name)}</text>"
        )
    for value in y_marks:
        y0 = py(value)
        svg.append(
            f'<line x1="{LEFT}" y1="{y0:.1f}" x2="{WIDTH - RIGHT}" y2="{y0:.1f}" stroke="{GRID}"/>'
            f'<text x="{LEFT - 10}" y="{y0 + 4.5:.1f}" text-anchor="end" fill="{FAINT}">'
            f"{_label(value)}</text>"
        )
    base = height - BOTTOM
    for value in ticks(x_low, x_high, 8):
        x0 = px(value)
        svg.append(
            f'<line x1="{x0:.1f}" y1="{base}" x2="{x0:.1f}" y2="{base + 5}" stroke="{FAINT}"/>'
            f'<text x="{x0:.1f}" y="{base + 21}" text-anchor="middle" fill="{FAINT}">'
            f"{_label(value, x_high)}</text>"
        )
    svg.append(f'<line x1="{LEFT}" y1="{base}" x2="{WIDTH - RIGHT}" y2="{base}" stroke="{FAINT}"/>')
    for words, value in (marks or {}).items():
        x0 = px(value)
        left = x0 + 8 + _width(words) > WIDTH - RIGHT
        svg.append(
            f'<line class="mark" x1="{x0:.1f}" y1="{top}" x2="{x0:.1f}" y2="{base}" stroke="{FAINT}" '
            f'stroke-dasharray="4 4"/><text x="{x0 + (-8 if left else 8):.1f}" y="{top + 12}" '
            f'text-anchor="{"end" if left else "start"}" fill="{FAINT}" stroke="{PAPER}" stroke-width="4" '
            f'paint-order="stroke">{figure.text(words)}</text>'
        )
    for (name, color, *_), (x, y) in zip(legend, lines.values()):
        shape, pen_down, dots = "", False, ""
        for a, b in zip(x, y):
            if np.isnan(b):
                pen_down = False
                continue
            shape += f"{'L' if pen_down else 'M'}{px(a):.1f} {py(b):.1f}"
            pen_down = True
            if len(x) <= 24:
                dots += f'<circle cx="{px(a):.1f}" cy="{py(b):.1f}" r="3.2"/>'
        svg.append(
            f'<g class="series" fill="{color}"><title>{figure.text(name)}</title><path fill="none" '
            f'stroke="{color}" stroke-width="2.2" stroke-linejoin="round" stroke-linecap="round" '
            f'd="{shape}"/>'
            f"{dots}</g>"
        )
    middle = (top + base) / 2
    svg.append(
        f'<text x="{(LEFT + WIDTH - RIGHT) / 2}" y="{height - 18}" text-anchor="middle" fill="{INK}">'
        f"{figure.text(xlabel)}</text>"
        f'<text transform="translate(22 {middle:.1f}) rotate(-90)" text-anchor="middle" fill="{INK}">'
        f"{figure.text(ylabel)}</text>"
    )
    svg.append("</svg>\n")
    result = "\n".join(svg)
    if path is not None:
        Path(path).write_text(result, encoding="utf-8")
    return result
