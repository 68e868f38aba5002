"""The unit and the up axis of files that do not say them: names, estimates, and the way inside."""

from __future__ import annotations

import numpy as np

from interpose.clip import Clip
from interpose.errors import RequestError, unknown
from interpose.geometry import kinematics
from interpose.skeletons import JOINTS, Mapping, find_mapping

INCH = 0.0254
# Metres, the likelier first. CMU is the scale of that data: 1/0.45 inch.
UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "CMU": INCH / 0.45, "inch": INCH}
LEG = 0.40, 1.25  # metres: thigh and shin of a child and of a giant
USUAL_LEG = 0.85
BODY = 0.9, 2.6  # metres: the extent of a body of which no legs are known
SAMPLE = 51  # frames looked at for estimates
# What speaks against an axis as the up axis: how far the floor under the body goes up and down, in legs (no
# more than of stairs); a head that is not above the feet; a floor that is not at 0; another axis than Y. Of
# 691 excerpts of all data sets, crawlers among them, 1 is misjudged, and 6 with Z up, by `examples/up.py`.
STEPS, OVERHEAD, LEVEL, UNUSUAL = 0.3, 0.3, 0.3, 0.1
# An axis that is ahead of the next one by less is not sure; hips that stay as near to the origin, in legs,
# tell nothing of a floor at 0.
UNSURE, IN_PLACE = 0.1, 0.1

# Where the axes X, Y, Z of a file stand in a clip, and their signs, by the axis that points up. A file with Z
# up is turned by -90 degrees about X as a whole, rest pose included: exact in floating point, because that
# only moves numbers.
_INSIDE = {
    "y": ((0, 1, 2), (1.0, 1.0, 1.0)),
    "z": ((0, 2, 1), (1.0, -1.0, 1.0)),
    "x": ((1, 0, 2), (1.0, -1.0, 1.0)),
    "-x": ((1, 0, 2), (-1.0, 1.0, 1.0)),
    "-y": ((0, 1, 2), (1.0, -1.0, -1.0)),
    "-z": ((0, 2, 1), (1.0, 1.0, -1.0)),
}


def vectors_inside(vectors: np.ndarray, unit: float, up: str) -> np.ndarray:
    """(..., 3) in file units and axes to metres, Y up."""
    place, sign = _INSIDE[up]
    inside = np.empty(np.shape(vectors))
    inside[..., place] = np.asarray(vectors) * sign
    return inside * unit


def vectors_in_file(vectors: np.ndarray, unit: float, up: str) -> np.ndarray:
    """(..., 3) in metres, Y up, to file units and axes."""
    return axes_in_file(vectors, up) * _INSIDE[up][1] / unit


def axes_in_file(values: np.ndarray, up: str) -> np.ndarray:
    """(..., 3) things about the clip's axes in the order of the file's axes."""
    return values[..., _INSIDE[up][0]]


def rotations_inside(q: np.ndarray, up: str) -> np.ndarray:
    """Rotations (..., 4) about the file's axes to rotations about the clip's."""
    if up == "y":
        return q
    place, sign = _INSIDE[up]
    inside = q.copy()
    inside[..., [1 + p for p in place]] = q[..., 1:] * sign
    return inside


def rotations_in_file(q: np.ndarray, up: str) -> np.ndarray:
    """`rotations_inside` backwards."""
    if up == "y":
        return q
    place, sign = _INSIDE[up]
    turned = q.copy()
    turned[..., 1:] = q[..., [1 + p for p in place]] * sign
    return turned


def given_unit(unit: float | str | None) -> float | None:
    """Metres per file unit from what the user gave."""
    if unit is None:
        return None
    names = {name.lower(): size for name, size in UNITS.items()} | {"in": INCH}
    try:
        size = names[unit.lower()] if isinstance(unit, str) and unit.lower() in names else float(unit)
    except (TypeError, ValueError):
        raise unknown("unit", unit, (*UNITS, "or metres per unit, such as 0.01")) from None
    if not 1e-9 < size < 1e9:
        raise RequestError(
            f"the unit {unit} is impossible", "it is metres per unit of the file", "Write for example 0.01."
        )
    return size


def given_up(up: str | None) -> str | None:
    """ "y", "z", "-y", ... from what the user gave."""
    if up is not None and not (isinstance(up, str) and up.lower() in _INSIDE):
        raise unknown("up axis", up, _INSIDE)
    return None if up is None else up.lower()


def unit_line(unit: float, how: str) -> str:
    """The unit of a file and how it was found, for printing."""
    name = next((f" ({name})" for name, size in UNITS.items() if np.isclose(size, unit)), "")
    return f"unit: {unit:.6g} m{name}, {how}"


def sample_frames(count: int) -> list[int]:
    """The frames of a clip to look at for estimates."""
    return np.unique(np.linspace(0, count - 1, SAMPLE).astype(int)).tolist()


def estimate_unit(mapping: Mapping, clip: Clip) -> tuple[float, str]:
    """Metres per file unit, and how it was found: from the legs, else from the size of the body."""
    leg = mapping.leg_length
    if np.isfinite(leg) and leg > 0:
        for size in UNITS.values():
            if LEG[0] <= size * leg <= LEG[1]:
                return size, f"estimated from a leg of {size * leg:.2f} m"
        return USUAL_LEG / leg, f"assumed, so that the leg is {USUAL_LEG} m"
    positions = clip.positions()
    extent = float(np.median(np.linalg.norm(np.ptp(positions, axis=1), axis=-1)))
    for name in ("m", "cm", "mm", "inch", "CMU"):
        if BODY[0] <= UNITS[name] * extent <= BODY[1]:
            return UNITS[name], f"estimated from a body of {UNITS[name] * extent:.2f} m, no legs found"
    return UNITS["cm"], "assumed, no legs found"


def missized(clip: Clip, unit: float) -> tuple[str, ...]:
    """A note where a new file of the clip, with so many metres a unit, would be taken for one of another
    unit, as those of small children and of giants."""
    if not len(clip):
        return ()
    seen = clip.take(np.array(sample_frames(len(clip)))).scaled(1 / unit)
    found = estimate_unit(find_mapping(seen.skeleton), seen)[0]
    if np.isclose(found, unit):
        return ()
    said = next((name for name, size in UNITS.items() if np.isclose(size, unit)), f"{unit:.6g}")
    times = f"{found / unit:.2g} times its size"
    return (f"read again, it may be taken for {times}: --unit={said} (unit= in Python) says it",)


def misread(clip: Clip, up: str, how: str = "") -> tuple[str, ...]:
    """A note where a file of the clip, in which `up` is the axis that points up, would be taken for one with
    another axis up, as a few seconds of a body that lies may be; none where that was given for it (`how`)."""
    if how == "given" or not len(clip):
        return ()
    seen = clip.take(np.array(sample_frames(len(clip))))
    # What is usual is the Y of the file, wherever that is in the clip.
    place, sign = _INSIDE[up]
    there = place[1], sign[1]
    usual = next(name for name, (p, s) in _INSIDE.items() if (p.index(1), s[p.index(1)]) == there)
    if estimate_up(find_mapping(clip.skeleton), seen, usual)[0] == "y":
        return ()
    return (f"read again, its axes may be mistaken, as the body lies: --up={up} (up= in Python) says it",)


def estimate_up(mapping: Mapping, clip: Clip, usual: str = "y") -> tuple[str, str]:
    """The up axis: the one along which the lowest point of the body is where it always is, on the floor.

    Who crawls or lies tells little by the direction from the feet to the head, which counts as well; so does
    a floor at 0, and that one axis is the `usual` one, Y in files. `clip` is in units in which the mapping's
    lengths are.
    """
    head, left, right = (mapping.joints[JOINTS.index(j)] for j in ("Head", "LeftFoot", "RightFoot"))
    if head is None or left is None or right is None:
        return "y", "assumed, no head and feet found"
    _, places = kinematics.forward(clip.rotation, clip.local_translation(), clip.skeleton.parents)
    body = places[:, head] - 0.5 * (places[:, left] + places[:, right])
    length = np.linalg.norm(body, axis=-1, keepdims=True)
    mean = np.mean(body / np.where(length > 0, length, 1.0), axis=0)
    size = mapping.leg_length
    if not size > 0:  # NaN, too
        size = max(float(np.median(length)), 1e-9)
    # Roots and targets beside the body stay where they are, whichever way it lies.
    known = [joint for joint in mapping.joints if joint is not None]
    hips, places = places[:, known[0]], places[:, known]
    # Who never leaves the origin with the hips, as in animations in place, has no floor at 0.
    level = LEVEL * (np.abs(hips).max() > IN_PLACE * size)
    doubts = {}
    for up, (place, sign) in _INSIDE.items():
        axis, way = place.index(1), sign[place.index(1)]
        low = (way * places[..., axis]).min(axis=1) / size
        least, most = np.percentile(low, [5, 95])
        doubts[up] = (
            min(most - least, STEPS)
            + OVERHEAD * (1 - way * mean[axis])
            + level * min(abs(float(np.median(low))), 1.0)
            + UNUSUAL * (up != usual)
        )
    up, second = sorted(doubts, key=lambda name: doubts[name])[:2]
    sure = doubts[second] - doubts[up] > UNSURE
    return up, "estimated from the floor and the head" + (
        "" if sure else ", not surely: --up (up= in Python) says it"
    )
