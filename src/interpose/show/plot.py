"""Small charts as SVG: lines, for curves of error and loss, and box plots."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from interpose.errors import RequestError
from interpose.show import figure

WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 760, 460, 78, 26, 78, 64
INK, FAINT, PAPER, GRID = "#1f2328", "#656d76", "#ffffff", "#e4e8ed"
COLORS = ("#2563c9", "#d9622b", "#2f8f4e", "#8b4fc6", "#b8860b", "#0f8b8d", "#c2345d", "#64748b")
DOT = "#6b7280"

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


def _around(low: float, high: float, length: float) -> tuple[float, float]:
    """A range of some length with the same middle."""
    return (low + high - length) / 2, (low + high + length) / 2


def _legend(colors: Mapping[str, str]) -> tuple[list[str], int]:
    """A stroke and the name of each series, and by how much they lower the plot: the legend wraps."""
    svg = []
    at, rank = float(LEFT), 0
    for name, color in colors.items():
        needs = 30 + _width(name) + 18
        if at > LEFT and at + needs > WIDTH - RIGHT + 18:
            at, rank = float(LEFT), rank + 1
        y = 56.0 + 20 * rank
        svg.append(
            f'<line x1="{at:.1f}" y1="{y}" x2="{at + 22:.1f}" y2="{y}" stroke="{color}" stroke-width="3" '
            f'stroke-linecap="round"/><text x="{at + 30:.1f}" y="{y + 4.5}" fill="{INK}">'
            f"{figure.text(name)}</text>"
        )
        at += needs
    return svg, 20 * rank


def _sheet(title: str, height: int) -> list[str]:
    """The paper and the title."""
    return [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" width="{WIDTH}" '
        f'height="{height}" role="img" font-family="{figure.text(figure.FONT)}" font-size="13">',
        f"<title>{figure.text(title)}</title>",
        f'<rect x=".5" y=".5" width="{WIDTH - 1}" height="{height - 1}" rx="10" fill="{PAPER}" '
        'stroke="#d5dae1"/>',
        f'<text x="{LEFT}" y="32" font-size="17" font-weight="600" fill="{INK}">{figure.text(title)}</text>',
    ]


def _y_grid(marks: Sequence[float], py: Callable[[float], float]) -> list[str]:
    """A line across the plot for each round value, and the value beside it."""
    return [
        f'<line x1="{LEFT}" y1="{py(value):.1f}" x2="{WIDTH - RIGHT}" y2="{py(value):.1f}" stroke="{GRID}"/>'
        f'<text x="{LEFT - 10}" y="{py(value) + 4.5:.1f}" text-anchor="end" fill="{FAINT}">'
        f"{_label(value)}</text>"
        for value in marks
    ]


def _y_words(ylabel: str, middle: float) -> str:
    return (
        f'<text transform="translate(22 {middle:.1f}) rotate(-90)" text-anchor="middle" fill="{INK}">'
        f"{figure.text(ylabel)}</text>"
    )


def _done(svg: list[str], path: str | Path | None) -> str:
    """The text of the picture, written to a file as well if there is one."""
    result = "\n".join([*svg, "</svg>\n"])
    if path is not None:
        Path(path).write_text(result, encoding="utf-8")
    return result


def line_plot(
    series: Mapping[str, tuple[Sequence[float], Sequence[float]]],
    xlabel: str,
    ylabel: str,
    title: str,
    path: str | Path | None = None,
    *,
    log: bool = False,
    alike: bool = False,
    marks: Mapping[str, float] | None = None,
) -> str:
    """A line chart as SVG.

    Args:
        series: name to (x, y), each of n values; values that are not finite interrupt the line.
        xlabel, ylabel, title: words at the axes and above.
        path: where to write the picture, too (UTF-8).
        log: whether the y axis is logarithmic; values that are not above zero then interrupt the line.
        alike: whether both axes have one scale, as on a map.
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
        y_low = 0.0 if 0 <= y_low < 0.6 * y_high and not alike else y_low - room
        y_high += room
        if alike:
            width, tall = WIDTH - LEFT - RIGHT, HEIGHT - BOTTOM - TOP
            scale = max((x_high - x_low) / width, (y_high - y_low) / tall)
            x_low, x_high = _around(x_low, x_high, scale * width)
            y_low, y_high = _around(y_low, y_high, scale * tall)
        y_marks = ticks(y_low, y_high)

    colors = {name: COLORS[i % len(COLORS)] for i, name in enumerate(lines)}
    legend, lower = _legend(colors)
    top, height = TOP + lower, HEIGHT + lower

    def px(value: float) -> float:
        return LEFT + (value - x_low) / (x_high - x_low) * (WIDTH - LEFT - RIGHT)

    def py(value: float) -> float:
        low, high, at = (math.log10(v) if log else v for v in (y_low, y_high, value))
        return height - BOTTOM - (at - low) / (high - low) * (height - BOTTOM - top)

    svg = [*_sheet(title, height), *legend, *_y_grid(y_marks, py)]
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
    for (name, color), (x, y) in zip(colors.items(), lines.values()):
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
    svg.append(
        f'<text x="{(LEFT + WIDTH - RIGHT) / 2}" y="{height - 18}" text-anchor="middle" fill="{INK}">'
        f"{figure.text(xlabel)}</text>" + _y_words(ylabel, (top + base) / 2)
    )
    return _done(svg, path)


@dataclass(frozen=True)
class Box:
    """What a box plot shows of some values: quartiles, and whiskers to the last value within 1.5 times their
    distance (Tukey 1977)."""

    low: float
    lower: float
    median: float
    upper: float
    high: float

    @classmethod
    def of(cls, values: Sequence[float] | np.ndarray) -> Box:
        """Of some values; those that are not finite are left out. RequestError if no other is there."""
        finite = np.asarray(values, float)
        finite = finite[np.isfinite(finite)]
        if not finite.size:
            raise RequestError("there is nothing to draw", "a box has no finite value")
        lower, median, upper = (float(value) for value in np.percentile(finite, [25, 50, 75]))
        reach = 1.5 * (upper - lower)
        inside = finite[(finite >= lower - reach) & (finite <= upper + reach)]
        return cls(float(inside.min()), lower, median, upper, float(inside.max()))


def box_plot(
    series: Mapping[str, Sequence[Box]],
    groups: Sequence[str],
    ylabel: str,
    title: str,
    path: str | Path | None = None,
    *,
    dots: tuple[str, Sequence[float]] | None = None,
) -> str:
    """Boxes side by side in groups, as SVG; values beyond the whiskers are not drawn.

    Args:
        series: name to its box in each group.
        groups: words below the axis; a line break starts a second line.
        ylabel, title: words at the axis and above.
        path: where to write the picture, too (UTF-8).
        dots: a name, and a value in each group that a grey dot shows (the truth).

    Returns:
        The SVG text.

    Raises:
        RequestError: nothing to draw, or not one box, or one dot, for each group.
    """
    marked = dict([dots] if dots else [])
    for name, values in {**series, **marked}.items():
        if len(values) != len(groups):
            raise RequestError(
                f"cannot draw {name!r}", f"it has {len(values)} values in {len(groups)} groups"
            )
    if not series or not groups:
        raise RequestError("there is nothing to draw", "no group has a box")
    ends = [end for boxes in series.values() for box in boxes for end in (box.low, box.high)]
    ends += [value for values in marked.values() for value in values]
    room = 0.06 * (max(ends) - min(ends)) or 1.0
    y_low, y_high = min(ends) - room, max(ends) + room

    colors = {name: COLORS[i % len(COLORS)] for i, name in enumerate(series)}
    legend, lower = _legend({**colors, **dict.fromkeys(marked, DOT)})
    top, height = TOP + lower, HEIGHT + lower
    base = height - BOTTOM
    column = (WIDTH - LEFT - RIGHT) / len(groups)
    step = min(0.8 * column / len(series), 44.0)  # from one box of a group to the next

    def py(value: float) -> float:
        return base - (value - y_low) / (y_high - y_low) * (base - top)

    svg = [*_sheet(title, height), *legend, *_y_grid(ticks(y_low, y_high), py)]
    for at, group in enumerate(groups):
        middle = LEFT + (at + 0.5) * column
        for line, words in enumerate(group.splitlines()):
            svg.append(
                f'<text x="{middle:.1f}" y="{base + 21 + 17 * line}" text-anchor="middle" '
                f'fill="{FAINT if line else INK}">{figure.text(words)}</text>'
            )
    for i, (name, color) in enumerate(colors.items()):
        shapes = ""
        for at, box in enumerate(series[name]):
            x, half = LEFT + (at + 0.5) * column + (i - (len(series) - 1) / 2) * step, 0.36 * step
            low, bottom, median, upper, high = (py(v) for v in vars(box).values())
            shapes += (
                f'<path fill="none" d="M{x:.1f} {low:.1f}V{bottom:.1f}M{x:.1f} {upper:.1f}V{high:.1f}'
                f'M{x - half / 2:.1f} {low:.1f}h{half:.1f}M{x - half / 2:.1f} {high:.1f}h{half:.1f}"/>'
                f'<rect x="{x - half:.1f}" y="{upper:.1f}" width="{2 * half:.1f}" '
                f'height="{bottom - upper:.1f}" fill-opacity=".22"/>'
                f'<path stroke-width="2.6" d="M{x - half:.1f} {median:.1f}h{2 * half:.1f}"/>'
            )
        svg.append(
            f'<g class="series" fill="{color}" stroke="{color}" stroke-width="1.6">'
            f"<title>{figure.text(name)}</title>{shapes}</g>"
        )
    for name, values in marked.items():
        circles = "".join(
            f'<circle cx="{LEFT + (at + 0.5) * column:.1f}" cy="{py(value):.1f}" r="4"/>'
            for at, value in enumerate(values)
        )
        svg.append(
            f'<g class="dots" fill="{DOT}" stroke="{PAPER}"><title>{figure.text(name)}</title>{circles}</g>'
        )
    svg.append(_y_words(ylabel, (top + base) / 2))
    return _done(svg, path)
