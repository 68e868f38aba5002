"""What every picture of a motion needs: takes, gaps, sides and thickness of bones, the floor, the view.

Positions are (F, J, 3) metres, Y up; frames are 0-based; gaps are half-open ranges of frames.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape
from typing import Protocol

import numpy as np

from interpose.errors import RequestError

FONT = "-apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', Arial, 'Liberation Sans', sans-serif"
UP = np.array([0.0, 1.0, 0.0])

# A net way shorter than this (metres) counts as moving in place.
TRAVEL = 0.6


@dataclass(frozen=True, eq=False)
class Take:
    """One motion in a picture.

    Attributes:
        name: what the legend calls it.
        positions: (F, J, 3) global joint positions in metres, Y up.
        color: "#rrggbb"; its gap frames are drawn in it.
        ghost: drawn faintly behind the others where takes lie over each other (for the truth).
    """

    name: str
    positions: np.ndarray
    color: str
    ghost: bool = False


class _Range(Protocol):
    """A gap of the observation: `start`, `stop` and the joints concerned, None for all."""

    start: int
    stop: int
    joints: tuple[str, ...] | None


@dataclass(frozen=True)
class Span:
    """Frames start to stop - 1, and the indices of the joints that are missing in them (None: all)."""

    start: int
    stop: int
    joints: frozenset[int] | None = None

    def __len__(self) -> int:
        return self.stop - self.start


@dataclass(frozen=True, eq=False)
class Body:
    """How the bones of a skeleton are drawn. A bone is named by the joint at its lower end.

    Attributes:
        parents: index of each joint's parent, -1 for roots.
        sides: (J,) -1 left, 1 right, 0 neither.
        thickness: (J,) metres across.
        head: index of the joint of the head, or -1.
        head_radius: metres.
        feet: the joint of each foot that is nearest to its tip.
        across: a pair of joints (left, right) whose line lies across the body, or None.
    """

    parents: tuple[int, ...]
    sides: tuple[int, ...]
    thickness: tuple[float, ...]
    head: int
    head_radius: float
    feet: tuple[int, ...]
    across: tuple[int, int] | None

    def head_center(self, positions: np.ndarray) -> np.ndarray:
        """(..., 3) the middle of the head: a little beyond its joint, seen from the neck."""
        top, neck = positions[..., self.head, :], positions[..., self.parents[self.head], :]
        way = top - neck
        length = np.linalg.norm(way, axis=-1, keepdims=True)
        return top + 0.75 * self.head_radius * way / np.maximum(length, 1e-9)


def text(value: object) -> str:
    """`value` as text that is safe in XML and HTML, between tags and in attributes."""
    return escape(re.sub(r"[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]", "", str(value)))


def check(takes: Sequence[Take], parents: Sequence[int], fps: float, names: Sequence[str] | None) -> None:
    """Raise RequestError unless all takes have the same frames and joints, finite values and a color."""
    if not takes:
        raise RequestError("there is nothing to draw", "no take was given", "Give at least one Take.")
    shape = np.shape(takes[0].positions)
    for take in takes:
        found = np.shape(take.positions)
        if found != shape or len(found) != 3 or found[0] == 0 or found[1:] != (len(parents), 3):
            raise RequestError(
                f"cannot draw the take {take.name!r}",
                f"its positions are {found}; "
                f"all takes must be (F, {len(parents)}, 3) with the same F above zero",
            )
        if not np.isfinite(take.positions).all():
            raise RequestError(f"cannot draw the take {take.name!r}", "some positions are no finite numbers")
        if not re.fullmatch(r"#[0-9a-fA-F]{6}", take.color):
            raise RequestError(f"cannot draw in {take.color!r}", "it is no color", "Write it as #rrggbb.")
    if names is not None and len(names) != len(parents):
        raise RequestError("the joint names do not fit", f"there are {len(names)} for {len(parents)} joints")
    if not (np.isfinite(fps) and fps > 0):
        raise RequestError("the frame rate is wrong", f"it must be above zero, got {fps}")


def spans(
    gaps: Iterable[_Range | tuple[int, int]], frames: int, names: Sequence[str] | None = None
) -> list[Span]:
    """Gaps, or pairs (start, stop), as spans inside a clip of `frames` frames, in order of time."""
    found = []
    for gap in gaps:
        start, stop = (gap[0], gap[1]) if isinstance(gap, tuple) else (gap.start, gap.stop)
        wanted = None if isinstance(gap, tuple) else gap.joints
        joints = None
        if wanted is not None and names is not None:
            joints = frozenset(j for j, name in enumerate(names) if name in wanted)
        start, stop = max(int(start), 0), min(int(stop), frames)
        if start < stop:
            found.append(Span(start, stop, joints))
    return sorted(found, key=lambda span: (span.start, span.stop))


def below_origin(
    positions: Sequence[np.ndarray], parents: Sequence[int], names: Sequence[str] | None, gaps: Sequence[Span]
) -> tuple[list[np.ndarray], tuple[int, ...], Sequence[str] | None, list[Span]]:
    """The same without joints above the hips that only say where the origin is.

    Some skeletons hang the hips from a root that stays on the floor at the origin. The line from it to the
    hips is no bone, and it does not go where the character goes. Such a root has one child, and that one
    has several: the hips.
    """
    parents, takes, gaps = tuple(parents), list(positions), list(gaps)
    if parents.count(-1) == 1 and parents[:2] == (-1, 0) and parents.count(0) == 1 < parents.count(1):
        parents = (-1, *(parent - 1 for parent in parents[2:]))
        takes = [values[:, 1:] for values in takes]
        names = None if names is None else names[1:]
        # What is missing at the root moves everything below it.
        gaps = [
            Span(g.start, g.stop, None if g.joints is None else frozenset(max(j - 1, 0) for j in g.joints))
            for g in gaps
        ]
    return takes, parents, names, gaps


def window(span: tuple[int, int], frames: int) -> tuple[int, int]:
    """The part of `span` that lies inside a clip of `frames` frames; RequestError when there is none."""
    start, stop = max(span[0], 0), min(span[1], frames)
    if start >= stop:
        raise RequestError(
            f"cannot draw the frames {span[0]}:{span[1]}", f"the clip has the frames 0 to {frames - 1}"
        )
    return start, stop


def merged(gaps: Sequence[Span]) -> list[tuple[int, int]]:
    """The frames of the spans as ranges that neither touch nor overlap."""
    ranges: list[tuple[int, int]] = []
    for gap in gaps:
        if ranges and gap.start <= ranges[-1][1]:
            ranges[-1] = (ranges[-1][0], max(ranges[-1][1], gap.stop))
        else:
            ranges.append((gap.start, gap.stop))
    return ranges


def tinted(gaps: Sequence[Span], parents: Sequence[int], frame: int) -> np.ndarray:
    """(J,) True for the bones to draw in the take's color: missing ones and all below them."""
    bones = np.zeros(len(parents), bool)
    for gap in gaps:
        if gap.start <= frame < gap.stop:
            if gap.joints is None:
                return np.ones(len(parents), bool)
            for joint, parent in enumerate(parents):
                bones[joint] |= joint in gap.joints or (parent >= 0 and bones[parent])
    return bones


SWAPS = (("left", "right"), ("Left", "Right"), ("LEFT", "RIGHT"), ("l", "r"), ("L", "R"))


def _side(name: str, names: set[str]) -> int:
    """-1 left, 1 right when the name with the sides swapped is a joint, too; else 0 (LowerBack, Root)."""
    for left, right in SWAPS:
        for side, one, other in ((-1, left, right), (1, right, left)):
            for hit in re.finditer(one, name):
                before, after = name[: hit.start()], name[hit.end() :]
                # A single letter means a side only at an end of the name or standing alone in it.
                alone = not before or not after or not (before[-1].isalnum() or after[0].isalnum())
                if (len(one) > 1 or alone) and before + other + after in names:
                    return side
    return 0


def body(positions: np.ndarray, parents: Sequence[int], names: Sequence[str] | None = None) -> Body:
    """How to draw a skeleton, from its names where there are any and one take (F, J, 3) of it."""
    parents = tuple(int(parent) for parent in parents)
    count = len(parents)
    above = [max(parent, 0) for parent in parents]
    length = np.linalg.norm(positions[0] - positions[0][above], axis=-1)
    plain = [re.sub(r"[^a-z0-9]", "", name.rpartition(":")[2].lower()) for name in names or ()]
    sides = tuple(_side(name, set(names or ())) for name in names) if names else (0,) * count

    # What hangs below a joint tells fingers and toes from limbs.
    reach = np.zeros(count)
    for joint in reversed(range(count)):
        if parents[joint] >= 0:
            reach[parents[joint]] = max(reach[parents[joint]], reach[joint] + length[joint])
    height = max(float(np.ptp(positions[0], axis=0).max()), 1e-3)
    size = height / 1.7
    trunk = 0.06 * size if any(sides) else 0.035 * size
    thickness = []
    for joint in range(count):
        if sides[joint] == 0:
            thickness.append(trunk)
        elif length[joint] < 0.06 * size and reach[joint] < 0.1 * size:
            thickness.append(0.016 * size)
        else:
            thickness.append(float(np.clip(0.13 * length[joint], 0.036 * size, 0.056 * size)))

    head = next((j for j, name in enumerate(plain) if name == "head" and parents[j] >= 0), -1)
    ends = [j for j in range(count) if j not in parents]
    feet = [j for j, name in enumerate(plain) if re.search(r"toe|ball", name) and sides[j]]
    feet = feet or [j for j, name in enumerate(plain) if re.search(r"foot|ankle", name) and sides[j]]
    # One joint a side: the first of the toes, not the tip of every one of them.
    feet = [
        next(j for j in feet if sides[j] == side) for side in (-1, 1) if any(sides[j] == side for j in feet)
    ]
    if not feet:
        low = np.median(positions[:, ends, 1], axis=0)
        feet = [ends[i] for i in np.argsort(low, kind="stable")[:2]]
    pairs = {side: next((j for j, s in enumerate(sides) if s == side), None) for side in (-1, 1)}
    left, right = pairs[-1], pairs[1]
    for part in ("upleg", "thigh", "femur", "hip"):
        hits = {sides[j]: j for j, name in reversed(list(enumerate(plain))) if part in name and sides[j]}
        if -1 in hits and 1 in hits:
            left, right = hits[-1], hits[1]
            break
    across = (left, right) if left is not None and right is not None else None
    return Body(parents, sides, tuple(thickness), head, 0.105 * size, tuple(sorted(feet)), across)


def floor_height(positions: np.ndarray, feet: Sequence[int]) -> float:
    """The height in metres on which the feet stand when they are low."""
    return float(np.percentile(positions[:, list(feet), 1].min(axis=1), 5))


def heading(positions: np.ndarray, drawn: Body, gaps: Sequence[Span]) -> tuple[np.ndarray, bool]:
    """The horizontal unit vector (3,) of the main way, and whether the motion travels.

    The way over the longest gap counts first, then that over all frames; motions in place have the
    direction in which the hips look, and without named sides the one in which the body is widest.
    """
    root = positions[:, 0]
    longest = max(merged(gaps), key=lambda gap: gap[1] - gap[0], default=(0, len(root)))
    for start, stop in (longest, (0, len(root))):
        way = (root[stop - 1] - root[start]) * (1 - UP)
        if np.linalg.norm(way) > TRAVEL:
            return way / np.linalg.norm(way), True
    if drawn.across:
        left, right = drawn.across
        facing = np.cross((positions[:, left] - positions[:, right]).mean(axis=0), UP)
        if np.linalg.norm(facing) > 1e-6:
            return facing / np.linalg.norm(facing), False
    flat = (positions - positions.mean(axis=1, keepdims=True))[..., [0, 2]].reshape(-1, 2)
    x, z = np.linalg.eigh(flat.T @ flat)[1][:, -1]
    return np.array([x, 0.0, z]), False


def mix(color: str, other: str, share: float) -> str:
    """The color "#rrggbb" with `share` (0 to 1) of the other one."""
    a, b = (np.array([int(c[i : i + 2], 16) for i in (1, 3, 5)]) for c in (color, other))
    return "#" + "".join(f"{round(v):02x}" for v in a + share * (b - a))
