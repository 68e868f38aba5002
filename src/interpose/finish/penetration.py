"""How far a body goes into itself: arms, legs, trunk and head as capsules around the bones.

CMIB's authors show that networks do not mind their own volume (Kim et al. 2022, figure 8). The distance of
two segments is that of Ericson, Real-Time Collision Detection, 2005, section 5.1.9.
"""

from __future__ import annotations

import numpy as np

from interpose.clip import Clip, Skeleton
from interpose.finish.feet import size
from interpose.skeletons import find_mapping

# Each part: the joints between which it lies, how long it is of that way (a forearm goes on as a hand), and
# its radius in metres on a body of usual size. Radii are slim: of the frames of LAFAN1's validation
# performer, who often props hands on knees, 99 % are within LIMIT, and all of CMU's and Bandai-Namco's.
PARTS: dict[str, tuple[str, str, float, float]] = {
    "trunk": ("Hips", "Neck", 1.0, 0.085),
    "head": ("Neck", "Head", 1.3, 0.08),
    **{
        f"{side.lower()} {name}": (side + a, side + b, long, radius)
        for side in ("Left", "Right")
        for name, a, b, long, radius in (
            ("forearm", "ForeArm", "Hand", 1.25, 0.03),
            ("thigh", "UpLeg", "Leg", 1.0, 0.05),
            ("shin", "Leg", "Foot", 1.0, 0.04),
            ("foot", "Foot", "Toe", 1.2, 0.035),
        )
    },
}
# What is looked at: parts that are neighbours, or rub against each other in any motion, are not.
PAIRS = (
    *(
        (f"{side} forearm", other)
        for side in ("left", "right")
        for other in ("trunk", "head", "left thigh", "right thigh", "left shin", "right shin")
    ),
    ("left forearm", "right forearm"),
    ("left shin", "right shin"),
    ("left shin", "right foot"),
    ("left foot", "right shin"),
    ("left foot", "right foot"),
    ("left thigh", "right shin"),
    ("left shin", "right thigh"),
)
Pair = tuple[str, str]
Part = tuple[np.ndarray, np.ndarray, float]  # both ends of its axis (F, 3), and its radius, in metres
LIMIT = 0.05  # metres: deeper is worth a word
BESIDE = 2.0  # seconds on both sides that are looked at as well
AS_DEEP = 1e-3  # metres further are as deep


def segment_distance(p: np.ndarray, q: np.ndarray, r: np.ndarray, s: np.ndarray) -> np.ndarray:
    """The distance (...) between the segments from p to q and from r to s, all (..., 3)."""
    one, other = points_between(p, q, r, s)
    return np.asarray(np.linalg.norm(one - other, axis=-1))


def points_between(
    p: np.ndarray, q: np.ndarray, r: np.ndarray, s: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The points (..., 3) of the segments from p to q and from r to s that are nearest to each other."""
    tiny = 1e-12
    u, v, w = q - p, s - r, p - r
    a, b, c = (u * u).sum(-1), (u * v).sum(-1), (v * v).sum(-1)
    d, e = (u * w).sum(-1), (v * w).sum(-1)
    cross = a * c - b * b
    along = np.where(cross > tiny, np.clip((b * e - c * d) / np.maximum(cross, tiny), 0, 1), 0.0)
    other = np.clip((b * along + e) / np.maximum(c, tiny), 0, 1)
    along = np.clip((b * other - d) / np.maximum(a, tiny), 0, 1)
    return p + along[..., None] * u, r + other[..., None] * v


def parts(skeleton: Skeleton, positions: np.ndarray) -> dict[str, Part]:
    """Those of PARTS that the skeleton has, by name; arguments as in `depths`."""
    mapping, grown, ends = find_mapping(skeleton), size(skeleton), {}
    for name, (start, end, long, radius) in PARTS.items():
        a, b = mapping[start], mapping[end]
        if a is not None and b is not None:
            way = positions[:, b] - positions[:, a]
            ends[name] = (positions[:, a], positions[:, a] + long * way, grown * radius)
    return ends


def depths(skeleton: Skeleton, positions: np.ndarray) -> tuple[list[Pair], np.ndarray]:
    """The pairs of parts that the skeleton has, and how deep each goes into the other (F, pairs), in metres;
    0 where they do not touch.

    positions: (F, J, 3) metres.
    """
    ends = parts(skeleton, positions)
    pairs = [(a, b) for a, b in PAIRS if a in ends and b in ends]
    found = np.zeros((len(positions), len(pairs)))
    for column, (one, other) in enumerate(pairs):
        (p, q, thick), (r, s, thin) = ends[one], ends[other]
        found[:, column] = thick + thin - segment_distance(p, q, r, s)
    return pairs, np.maximum(found, 0.0)


def deepest(clip: Clip, start: int, stop: int, first: int = 0) -> tuple[float, str] | None:
    """How deep a body goes into itself from frame start to stop - 1 (metres), and a sentence on it.

    The sentence is empty within LIMIT, and where the same two parts are as deep BESIDE: some skeletons and
    performers are stouter than others. It calls the first frame of the clip `first`. None for skeletons
    without such parts.
    """
    beside = round(BESIDE * clip.fps)
    lo, hi = max(0, start - beside), min(len(clip), stop + beside)
    pairs, found = depths(clip.skeleton, clip.slice(lo, hi).positions())
    if not pairs:
        return None
    inside = found[start - lo : stop - lo]
    frame, pair = np.unravel_index(inside.argmax(), inside.shape)
    depth = float(inside[frame, pair])
    around = np.delete(found[:, pair], np.s_[start - lo : stop - lo])
    if depth <= max(LIMIT, around.max(initial=0.0) + AS_DEEP):
        return depth, ""
    one, other = pairs[pair]
    where = f"at frame {first + start + int(frame)}"
    return depth, f"flagged: the {one} goes {100 * depth:.0f} cm into the {other} {where}"
