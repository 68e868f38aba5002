"""What `scan` finds: frames and joints that look missing, and which of it is to be filled."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from interpose.clip import Clip
from interpose.observation.observation import Gap

STUCK = ("frozen position", "frozen body")
# Kinds of findings that are no gaps.
NO_GAPS = (*STUCK, "still", "splined", "lost", "exchanged", "flipped", "jump", "repeated", "noisy")


@dataclass(frozen=True)
class Finding:
    """Something suspicious in a clip.

    Attributes:
        kind: "missing", "frozen", "still", "frozen position", "frozen body", "straight", "splined",
            "rest pose", "outlier", "lost", "exchanged", "flipped", "jump", "doubled", "repeated" or "noisy".
        joints: the joints concerned, or None for the whole pose.
        start, stop: frames start to stop - 1 are those to replace. Of a run of equal frames that is all but
            the one that was held.
        note: one line for a person.
    """

    kind: str
    joints: tuple[str, ...] | None
    start: int
    stop: int
    note: str = ""

    def __len__(self) -> int:
        return self.stop - self.start


def to_gaps(findings: Iterable[Finding]) -> list[Gap]:
    """The gaps to fill. A frozen position is none: a gap cannot be in the root's position alone. Nor are
    values that drop out: `recover` finds both by itself."""
    return [Gap(f.start, f.stop, f.joints) for f in findings if f.kind not in NO_GAPS]


def spoken_of(clip: Clip, findings: list[Finding]) -> np.ndarray:
    """(F, J) the frames and joints that findings speak of."""
    lost = np.zeros((len(clip), len(clip.skeleton)), bool)
    for one in findings:
        joints = slice(None) if one.joints is None else [clip.skeleton.index(name) for name in one.joints]
        lost[one.start : one.stop, joints] = True
    return lost
