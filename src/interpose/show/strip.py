"""A strip of stick figures over time, as SVG: one row a take, time from left to right."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from interpose.show import figure
from interpose.show.figure import Body, Span, Take

WIDTH, LEFT, RIGHT, TOP, BOTTOM = 1280, 26, 26, 74, 66
OBSERVED = "#8b929c"
INK, FAINT, PAPER, LINE, SHADE = "#1f2328", "#656d76", "#ffffff", "#d5dae1", "#fff3dc"
PITCH = np.radians(7.0)

# Pixels a metre, at most and at least; pixels a slot needs for its label; metres of drift that it holds.
LARGE, SMALL, NARROW, DRIFT = 108.0, 60.0, 58.0, 0.5


def choose_frames(gaps: Sequence[Span], start: int, stop: int, count: int) -> list[int]:
    """`count` frames (fewer in short clips) out of start to stop - 1, about three times denser in gaps.

    The last frame before a gap and the first one after it are among them.
    """
    pieces: list[tuple[int, int, bool]] = []
    at = start
    for gap_start, gap_stop in figure.merged(gaps):
        gap_start, gap_stop = max(gap_start, start), min(gap_stop, stop)
        if gap_start >= gap_stop:
            continue
        pieces += [(at, gap_start, False), (gap_start, gap_stop, True)]
        at = gap_stop
    pieces = [piece for piece in [*pieces, (at, stop, False)] if piece[0] < piece[1]]
    lengths = [b - a for a, b, _ in pieces]
    weight = np.array([length * (3.0 if gap else 1.0) for length, (_, _, gap) in zip(lengths, pieces)])
    shares = [1] * len(pieces)
    for _ in range(count - len(pieces)):
        lack = [w / (s + 0.5) if s < n else -1.0 for w, s, n in zip(weight, shares, lengths)]
        shares[int(np.argmax(lack))] += max(lack) > 0
    frames: list[int] = []
    for i, ((a, b, gap), n) in enumerate(zip(pieces, shares)):
        if gap:
            chosen = np.linspace(a - 1, b, n + 2)[1:-1]
        elif n == 1:
            chosen = np.array([b - 1 if i == 0 and len(pieces) > 1 else a])
        else:
            chosen = np.linspace(a, b - 1, n)
        frames += [int(f) for f in np.clip(np.rint(chosen), a, b - 1)]
    return sorted(set(frames))


def excerpt(gaps: Sequence[Span], frames: int, fps: float) -> tuple[int, int]:
    """The frames a strip shows: all gaps with two thirds of a second around them, or the longest one.

    With more than four gaps, or more than twelve seconds from the first to the last, only the longest.
    """
    ranges = figure.merged(gaps)
    if not ranges:
        return 0, frames
    start, stop = ranges[0][0], ranges[-1][1]
    if len(ranges) > 4 or stop - start > 12 * fps:
        start, stop = max(ranges, key=lambda gap: gap[1] - gap[0])
    around = max(round(fps * 2 / 3), 1)
    return max(start - around, 0), min(stop + around, frames)


def view(towards: np.ndarray, travels: bool) -> np.ndarray:
    """(3, 3) rows: right, up and towards the viewer, for a motion along the unit vector `towards`.

    Travel goes to the right, seen from the side and a little from the front; motions in place are seen
    from the front and a little from the side.
    """
    turn = np.radians(28.0 if travels else 52.0)
    side = np.cross(towards, figure.UP)
    viewer = np.cos(turn) * side + np.sin(turn) * towards
    right = np.cross(figure.UP, viewer)
    viewer = np.cos(PITCH) * viewer + np.sin(PITCH) * figure.UP
    return np.stack([right, np.cross(viewer, right), viewer])


def slots(widths: np.ndarray, largest: float, room: float) -> tuple[float, np.ndarray]:
    """Scale (pixels a metre) and edges (n + 1,) in pixels of side-by-side slots for figures.

    widths: (n,) metres. The scale is the largest one up to `largest` at which all fit into `room`
    pixels; wide motions stop at SMALL and then overlap a little.
    """
    scale = largest
    while scale > min(SMALL, largest) and np.maximum(widths * scale + 8, NARROW).sum() > room:
        scale *= 0.98
    each = np.maximum(widths * scale + 8, NARROW)
    each *= min(1.0, room / each.sum())
    # What is left over widens the narrowest slots, so that most are equal: the level at which they fit.
    order = np.sort(each)
    levels = [(room - order[i:].sum()) / i for i in range(1, len(each) + 1)]
    level = next(v for v, above in zip(levels, [*order[1:], np.inf]) if v <= above)
    each = np.maximum(each, level)
    return scale, np.concatenate([[0.0], np.cumsum(each)])


def _seconds(value: float) -> str:
    return f"{value:.2f} s"


def strip(
    takes: Sequence[Take],
    parents: Sequence[int],
    fps: float,
    gaps: Iterable[Any],
    path: str | Path | None = None,
    title: str = "",
    *,
    names: Sequence[str] | None = None,
    count: int = 14,
    span: tuple[int, int] | None = None,
) -> str:
    """Stick figures over time as an SVG picture: one row a take, the gap shaded and denser in time.

    Every figure stands in a slot of its own, placed by the root of the *first* take, so that another
    take's figure beside its slot is one beside the truth. Observed frames are gray, gap frames have the
    take's color; left limbs are darker than right ones (when `names` tell them apart).

    Args:
        takes: Take(name, positions (F, J, 3) in metres and Y up, color), all of the same shape.
        parents: index of each joint's parent, -1 for roots.
        fps: frames a second.
        gaps: `Gap` objects or pairs (start, stop) of frames, half-open.
        path: where to write the picture, too (UTF-8).
        title: the line above it.
        names: joint names, for the sides and the head.
        count: how many figures in a row.
        span: the frames to show, half-open; without it those around the gaps.

    Returns:
        The SVG text.

    Raises:
        RequestError: takes that do not fit each other or the skeleton, a span outside the clip.
    """
    figure.check(takes, parents, fps, names)
    frames = len(takes[0].positions)
    positions, parents, names, missing = figure.below_origin(
        [np.asarray(take.positions, float) for take in takes],
        parents,
        names,
        figure.spans(gaps, frames, names),
    )
    start, stop = figure.window(span or excerpt(missing, frames, fps), frames)
    shown = choose_frames(missing, start, stop, count)
    inside = [gap for gap in missing if gap.start < stop and gap.stop > start]
    layout = _layout(positions, parents, names, shown, inside)
    svg = [
        *_frame(title, layout),
        *(line for gap in figure.merged(inside) for line in _gap(*gap, layout, fps)),
        *(line for row, take in enumerate(takes) for line in _row(row, take, layout, missing)),
        *_times(layout, fps),
        "</svg>\n",
    ]
    result = "\n".join(svg)
    if path is not None:
        Path(path).write_text(result, encoding="utf-8")
    return result


@dataclass(frozen=True)
class _Layout:
    """Where everything is.

    Attributes:
        shown: the frames whose figures are drawn, n of them.
        drawn: what is drawn of the body.
        poses: (takes, n, J, 3) metres right, up and towards the viewer, beside the middle of a figure's slot.
        heads: (takes, n, 3), likewise; None without heads.
        scale: pixels a metre.
        edges: (n + 1,) pixels, of the slots.
        stands: (n,) pixels, where the middle of a figure is.
        row, below, height: pixels, of a take's row, of what is under its floor, and of the picture.
    """

    shown: list[int]
    drawn: Body
    poses: np.ndarray
    heads: np.ndarray | None
    scale: float
    edges: np.ndarray
    stands: np.ndarray
    row: float
    below: float
    height: float

    @property
    def bottom(self) -> float:
        """Where the rows end."""
        return self.height - BOTTOM


def _layout(
    positions: list[np.ndarray],
    parents: Sequence[int],
    names: Sequence[str] | None,
    shown: list[int],
    inside: list[Span],
) -> _Layout:
    """The figures of all takes in equal slots, by what the first of them does in the gaps `inside`."""
    reference = positions[0]
    drawn = figure.body(reference, parents, names)
    floor = figure.floor_height(reference[shown], drawn.feet)
    camera = view(*figure.heading(reference, drawn, inside))
    middle = reference[shown, :1] * (1 - figure.UP) + floor * figure.UP
    poses = np.stack([values[shown] - middle for values in positions]) @ camera.T
    heads = None
    if drawn.head >= 0:
        centers = [drawn.head_center(values[shown]) for values in positions]
        heads = (np.stack(centers) - middle[:, 0]) @ camera.T

    top = poses[..., 1].max() if heads is None else max(poses[..., 1].max(), heads[..., 1].max())
    tall = float(top + 0.12)
    # How far each figure reaches to either side; a take that drifts far away may leave its slot.
    low, high = poses[..., 0].min(axis=2) - 0.06, poses[..., 0].max(axis=2) + 0.06
    low = np.maximum(low.min(axis=0), low[0] - DRIFT)
    high = np.minimum(high.max(axis=0), high[0] + DRIFT)
    scale, edges = slots(high - low, min(LARGE, 170 / max(tall, 1e-6)), WIDTH - LEFT - RIGHT)
    edges += LEFT
    below = max(0.0, float(-np.percentile(poses[..., 1], 0.5))) * scale
    row = tall * scale + below + 34
    center = (edges[:-1] + edges[1:]) / 2
    # Nothing leaves the picture: drifting takes push their figure inwards, in all rows alike.
    first, last = poses[..., 0].min(axis=(0, 2)) * scale, poses[..., 0].max(axis=(0, 2)) * scale
    stands = np.maximum(np.minimum(center - (low + high) / 2 * scale, WIDTH - 10 - last), 10 - first)
    height = TOP + row * len(positions) + BOTTOM
    return _Layout(shown, drawn, poses, heads, scale, edges, stands, row, below, height)


def _frame(title: str, layout: _Layout) -> Iterator[str]:
    """The paper, and what stands above the rows."""
    height = f"{layout.height:.0f}"
    yield (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" width="{WIDTH}" '
        f'height="{height}" role="img" font-family="{figure.text(figure.FONT)}" font-size="13">'
    )
    yield f"<title>{figure.text(title or 'Stick figures over time')}</title>"
    yield (
        f'<rect x=".5" y=".5" width="{WIDTH - 1}" height="{layout.height - 1:.0f}" rx="10" fill="{PAPER}" '
        f'stroke="{LINE}"/>'
    )
    if title:
        yield (
            f'<text x="{LEFT}" y="34" font-size="18" font-weight="600" fill="{INK}">'
            f"{figure.text(title)}</text>"
        )
    sided = ", left limbs dark, right limbs light" if any(layout.drawn.sides) else ""
    yield (
        f'<text x="{WIDTH - RIGHT}" y="33" text-anchor="end" font-size="12" fill="{FAINT}">'
        f"gray: observed{sided}</text>"
    )


def _gap(start: int, stop: int, layout: _Layout, fps: float) -> Iterator[str]:
    """The shade behind the figures of a gap, and what it says."""
    within = [i for i, frame in enumerate(layout.shown) if start <= frame < stop]
    if not within:
        return
    x, wide = layout.edges[within[0]], layout.edges[within[-1] + 1] - layout.edges[within[0]]
    yield (
        f'<rect class="gap" x="{x:.1f}" y="{TOP - 22}" width="{wide:.1f}" '
        f'height="{layout.bottom - TOP + 22:.1f}" rx="6" fill="{SHADE}"/>'
    )
    length = stop - start
    label = f"gap {start}:{stop}, {length} frame{'s' * (length != 1)}, {_seconds(length / fps)}"
    label = label if wide > 190 else f"gap {start}:{stop}" if wide > 90 else "gap"
    yield (
        f'<text x="{x + wide / 2:.1f}" y="{TOP - 6}" text-anchor="middle" font-size="12" '
        f'fill="#8a5a00">{label}</text>'
    )


def _row(row: int, take: Take, layout: _Layout, missing: list[Span]) -> Iterator[str]:
    """A take: its floor, its figures with their shadows, and its name over them."""
    scale, drawn = layout.scale, layout.drawn
    ground = TOP + layout.row * (row + 1) - layout.below - 8
    label_y = TOP + layout.row * row + 20
    yield f'<g class="take"><title>{figure.text(take.name)}</title>'
    yield (
        f'<line x1="{LEFT}" y1="{ground:.1f}" x2="{WIDTH - RIGHT}" y2="{ground:.1f}" stroke="{LINE}" '
        'stroke-width="1.5"/>'
    )
    for x in layout.stands + layout.poses[row, :, 0, 0] * scale:
        yield (
            f'<ellipse cx="{x:.1f}" cy="{ground:.1f}" rx="{0.24 * scale:.1f}" ry="{0.045 * scale:.1f}" '
            'fill="#000000" fill-opacity=".09"/>'
        )
    in_gap, gray = _shades(take.color, drawn), _shades(OBSERVED, drawn)
    place = np.array([scale, -scale, scale])
    for i, frame in enumerate(layout.shown):
        tint = figure.tinted(missing, drawn.parents, frame)
        colors = [a if t else b for a, b, t in zip(in_gap, gray, tint)]
        offset = np.array([layout.stands[i], ground, 0.0])
        points = layout.poses[row, i] * place + offset
        head = None if layout.heads is None else layout.heads[row, i] * place + offset
        kind = "filled" if tint.any() else "observed"
        yield (
            f'<g class="figure {kind}" data-frame="{frame}" fill="none" stroke-linecap="round" '
            f'stroke-linejoin="round">{_figure(points, head, drawn, colors, scale)}</g>'
        )
    yield (
        f'<circle cx="{LEFT + 6}" cy="{label_y - 4.5:.1f}" r="5" fill="{take.color}"/>'
        f'<text x="{LEFT + 18}" y="{label_y:.1f}" font-weight="600" fill="{INK}" stroke="{PAPER}" '
        f'stroke-width="3" paint-order="stroke">{figure.text(take.name)}</text></g>'
    )


def _times(layout: _Layout, fps: float) -> Iterator[str]:
    """The frames and seconds under the rows."""
    bottom = layout.bottom
    for frame, x in zip(layout.shown, (layout.edges[:-1] + layout.edges[1:]) / 2):
        yield (
            f'<line x1="{x:.1f}" y1="{bottom + 2:.1f}" x2="{x:.1f}" y2="{bottom + 8:.1f}" '
            f'stroke="{FAINT}"/>'
            f'<text x="{x:.1f}" y="{bottom + 24:.1f}" text-anchor="middle" fill="{INK}">{frame}</text>'
            f'<text x="{x:.1f}" y="{bottom + 40:.1f}" text-anchor="middle" font-size="11" '
            f'fill="{FAINT}">{_seconds(frame / fps)}</text>'
        )


def _figure(points: np.ndarray, head: np.ndarray | None, drawn: Body, colors: list[str], scale: float) -> str:
    """SVG of one pose: points (J, 3) in pixels and depth (towards the viewer), far bones first."""
    parts: list[tuple[float, str, str]] = []
    for joint, parent in enumerate(drawn.parents):
        if parent < 0:
            if joint not in drawn.parents:
                x, y, depth = points[joint]
                dot = f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3" fill="{colors[joint]}"/>'
                parts.append((depth, "", dot))
            continue
        (x1, y1, d1), (x2, y2, d2) = points[parent], points[joint]
        style = f'stroke="{colors[joint]}" stroke-width="{max(drawn.thickness[joint] * scale, 1.2):.1f}"'
        parts.append(((d1 + d2) / 2, style, f"M{x1:.1f} {y1:.1f}L{x2:.1f} {y2:.1f}"))
    if head is not None:
        x, y, depth = head
        radius = drawn.head_radius * scale
        circle = f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius:.1f}" fill="{colors[drawn.head]}"/>'
        parts.append((depth, "", circle))
    parts.sort(key=lambda part: part[0])
    out, run, open_style = [], "", ""
    for _, style, shape in [*parts, (0.0, "", "")]:
        if style != open_style and run:
            out.append(f'<path {open_style} d="{run}"/>')
            run = ""
        if style:
            run += shape
        else:
            out.append(shape)
        open_style = style
    return "".join(out)


def _shades(color: str, drawn: Body) -> list[str]:
    """A color a bone: left limbs darker, right ones lighter."""
    tones = {-1: figure.mix(color, "#000000", 0.28), 0: color, 1: figure.mix(color, "#ffffff", 0.38)}
    return [tones[side] for side in drawn.sides]
