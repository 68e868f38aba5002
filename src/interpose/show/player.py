"""A player of takes over each other as one self-contained HTML page that works from disk."""

from __future__ import annotations

import base64
import json
import re
from collections.abc import Iterable, Sequence
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from interpose.show import figure
from interpose.show.figure import Take

# Frames times joints times takes that a page carries at most: about 16 MB of HTML.
LARGEST = 2_000_000

# Positions beside the first joint are kept in steps of 0.1 mm, or more for what is larger than 6.5 m.
FINEST = 1e-4


def _base64(values: np.ndarray, kind: str) -> str:
    return base64.b64encode(np.ascontiguousarray(values, dtype=kind).tobytes()).decode("ascii")


def encode(positions: np.ndarray) -> dict[str, Any]:
    """(F, J, 3) metres as text: the first joint as float32, the others beside it in int16 steps."""
    root = np.asarray(positions[:, 0], "<f4")
    beside = positions - root.astype(float)[:, None]
    step = max(float(np.abs(beside).max()) / 32767, FINEST)
    return {"root": _base64(root, "<f4"), "beside": _base64(np.rint(beside / step), "<i2"), "step": step}


def decode(packed: dict[str, Any], joints: int) -> np.ndarray:
    """What the page makes of `encode`: (F, J, 3) metres."""
    root = np.frombuffer(base64.b64decode(packed["root"]), "<f4").reshape(-1, 1, 3).astype(float)
    beside = np.frombuffer(base64.b64decode(packed["beside"]), "<i2").reshape(-1, joints, 3)
    return root + beside * packed["step"]


def _shown(gaps: Sequence[figure.Span], frames: int, largest: int) -> tuple[int, int]:
    """The frames a page shows: all, or as many as it can carry, from a little before the first gap."""
    if frames <= largest:
        return 0, frames
    start = max((gaps[0].start if gaps else 0) - largest // 8, 0)
    start = min(start, frames - largest)
    return start, start + largest


def player(
    takes: Sequence[Take],
    parents: Sequence[int],
    fps: float,
    gaps: Iterable[Any],
    path: str | Path | None = None,
    title: str = "interpose",
    *,
    report: str = "",
    names: Sequence[str] | None = None,
    span: tuple[int, int] | None = None,
    bare: bool = False,
) -> str:
    """An HTML page that plays takes over each other; it needs no network and no other file.

    Args:
        takes: Take(name, positions (F, J, 3) in metres and Y up, color), all of the same shape. The
            first one is what the camera follows; takes with `ghost` are drawn faintly behind the others.
        parents: index of each joint's parent, -1 for roots.
        fps: frames a second.
        gaps: `Gap` objects or pairs (start, stop) of frames, half-open.
        path: where to write the page, too (UTF-8).
        title: its heading.
        report: plain text for the panel beside the stage.
        names: joint names, for the sides, the head and the feet.
        span: the frames to show, half-open. Without it all of them, or in clips too long for a page
            (more than LARGEST joint positions) as many as it can carry, from before the first gap on.
        bare: without title and panel, to stand inside another page.

    Returns:
        The HTML text. `window.interposePlayer` in it tells its state and takes seek(frame), play() and
        pause(); an address that ends in `#frame=120` opens at that frame, paused.

    Raises:
        RequestError: takes that do not fit each other or the skeleton, a span outside the clip.
    """
    figure.check(takes, parents, fps, names)
    frames = len(takes[0].positions)
    whole, parents, names, missing = figure.below_origin(
        [take.positions for take in takes], parents, names, figure.spans(gaps, frames, names)
    )
    joints = len(parents)
    largest = max(LARGEST // (joints * len(takes)), 1)
    start, stop = figure.window(span or _shown(missing, frames, largest), frames)
    positions = [np.asarray(values[start:stop], float) for values in whole]
    drawn = figure.body(positions[0], parents, names)
    inside = [
        figure.Span(max(gap.start, start) - start, min(gap.stop, stop) - start, gap.joints)
        for gap in missing
        if gap.start < stop and gap.stop > start
    ]
    towards, travels = figure.heading(positions[0], drawn, inside)
    data = {
        "title": str(title),
        "fps": float(fps),
        "first": start,
        "frames": stop - start,
        "total": frames,
        "parents": drawn.parents,
        "names": list(names) if names is not None else None,
        "sides": drawn.sides,
        "thickness": [round(value, 4) for value in drawn.thickness],
        "head": drawn.head,
        "headRadius": round(drawn.head_radius, 4),
        "feet": drawn.feet,
        "floor": round(figure.floor_height(positions[0], drawn.feet), 4),
        "heading": [round(float(towards[0]), 5), round(float(towards[2]), 5)],
        "travels": travels,
        "gaps": [
            {
                "start": gap.start + start,
                "stop": gap.stop + start,
                "joints": None if gap.joints is None else sorted(gap.joints),
            }
            for gap in inside
        ],
        "takes": [
            {"name": take.name, "color": take.color, "ghost": take.ghost, **encode(values)}
            for take, values in zip(takes, positions)
        ],
        "report": str(report),
    }
    # Inside a script element only these could end it or start a comment; JSON may write them so.
    packed = json.dumps(data, separators=(",", ":"), allow_nan=False)
    for character in "<>&":
        packed = packed.replace(character, f"\\u{ord(character):04x}")
    parts = {"title": figure.text(title), "data": packed, "kind": "bare" if bare else "whole"}
    template = resources.files("interpose.show").joinpath("player.html").read_text(encoding="utf-8")
    # One pass, so that a title that looks like a place to fill stays a title.
    page = re.sub(r"\{\{(title|data|kind)\}\}", lambda place: parts[place[1]], template)
    if path is not None:
        Path(path).write_text(page, encoding="utf-8")
    return page
