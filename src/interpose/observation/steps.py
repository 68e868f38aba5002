"""Steps from frame to frame, and runs of them in which nothing changes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np

from interpose.clip import Clip
from interpose.geometry import rotations
from interpose.geometry.time import runs
from interpose.observation.finding import Finding
from interpose.observation.observation import Observation
from interpose.skeletons.carrier import placed

# A value that changes less than this from frame to frame stands still: radians and metres. Captured motion
# trembles by 1e-4 and more; files keep about 1e-8.
STILL = 1e-6
# Frozen runs shorter than this many seconds are as good as noise; at least 3 frames.
SHORTEST = 0.1
# The least jump, in radians.
JUMP_TURN = 0.01
# Where angles are rounded a quick joint stands still for a step or two again and again, and a slow one turns
# for as long: at least so many times, and in so large a share of its pauses, or of its turns. So many
# times what it turns by, in a quarter of its steps at most, is no jump: all three of its angles may take that
# step at once.
PAUSES, BRIEFLY, ROUNDED = 4, 0.5, 2.0
# The mean turn of the joints into a frame that is out of place: radians.
OUTLIER = 0.05


@dataclass(frozen=True)
class Steps:
    """How a clip changes between its frames `first`, first + 1, ...

    Attributes:
        clip: (F frames, J joints).
        turned: (n, J) radians; NaN where unknown.
        moved: (n, P) metres, of the joints `placed`; NaN where unknown.
        first: 0, or 1 where the first frame is a stray.
        strays: the first and the last frame, where they have nothing to do with their neighbours: the steps
            to them are left out.
    """

    clip: Clip
    turned: np.ndarray
    moved: np.ndarray
    first: int = 0
    strays: tuple[Finding, ...] = ()

    @classmethod
    def of(cls, clip: Clip, known: Observation | None = None) -> Self:
        """Of what is `known` of a clip; of all of it, if nothing is said."""
        known, placing = known or Observation.full(clip), placed(clip)
        moved = np.diff(clip.translation[:, [clip.translated.index(joint) for joint in placing]], axis=0)
        moved = np.linalg.norm(moved, axis=-1)
        turned = turns(clip)
        turned[~(known.rotation[1:] & known.rotation[:-1])] = np.nan
        position = known.translation[:, placing]
        moved[~(position[1:] & position[:-1])] = np.nan
        every = cls(clip, turned, moved)
        strays = tuple(_strays(clip, turned)) if len(clip) > 2 else ()
        odd = {stray.start for stray in strays}
        part = slice(int(0 in odd), len(turned) - int(len(turned) in odd))
        return replace(every, turned=turned[part], moved=moved[part], first=part.start, strays=strays)

    @cached_property
    def still(self) -> np.ndarray:
        """(n, J) where joints do not turn; what is unknown does."""
        with np.errstate(invalid="ignore"):
            return np.asarray(self.turned < STILL)

    @cached_property
    def stopped(self) -> np.ndarray:
        """(n, P) where places do not move; what is unknown does."""
        with np.errstate(invalid="ignore"):
            return np.asarray(self.moved < STILL)

    @cached_property
    def resting(self) -> np.ndarray:
        """(n,) where nothing moves."""
        return np.asarray(self.still.all(axis=1) & self.stopped.all(axis=1))

    @property
    def shortest(self) -> int:
        """How many steps a frozen run has, at least."""
        return max(3, round(SHORTEST * self.clip.fps))

    @cached_property
    def rounded(self) -> np.ndarray:
        """(J,) radians by which joints turn that are rounded; 0 for all others."""
        found = np.zeros(self.still.shape[1])
        for joint, still in enumerate(self.still.T):
            brief = ([stop - start < self.shortest for start, stop in runs(part)] for part in (still, ~still))
            if any(sum(few) >= max(PAUSES, BRIEFLY * len(few)) for few in brief):
                turns = self.turned[~still & np.isfinite(self.turned[:, joint]), joint]
                found[joint] = np.percentile(turns, 25) if turns.size else 0.0
        return found

    def jump(self, joints: Sequence[int] | np.ndarray) -> float:
        """Radians that the turns of joints are more than, if one jumps."""
        return max(JUMP_TURN, ROUNDED * float(np.median(self.rounded[joints]))) if len(joints) else JUMP_TURN

    def finding(self, kind: str, joints: tuple[str, ...] | None, run: Run, why: str = "") -> Finding:
        """What a run says."""
        # Steps start..stop - 1 are zero, so frames start..stop are equal. One of them is good, unless both
        # ends jump: the first, which was held, or the last where the clip begins with the run.
        begin = run.start + (0 if run.jumps_in or run.start == 0 else 1)
        end = run.stop + (0 if run.start == 0 and not run.jumps_out else 1)
        what = "the position stands" if kind == "frozen position" else "nothing moves"
        if kind == "still" and not why:
            to_end = run.stop == len(self.turned)
            why = f", {'to the end, ' * to_end}and comes to rest {'' if to_end else 'and sets off '}by itself"
        note = f"{what} for {(run.stop - run.start) / self.clip.fps:.2f} s{why}"
        return Finding(kind, joints, self.first + begin, self.first + end, note)


def turns(clip: Clip) -> np.ndarray:
    """(F - 1, J) radians by which joints turn from frame to frame."""
    # The chord of two quaternions: as good as the angle for small ones, and quick on long clips.
    q = rotations.continuous(clip.rotation)
    return 2.0 * np.linalg.norm(np.diff(q, axis=0), axis=-1)


@dataclass(frozen=True)
class Run:
    """Steps start to stop - 1 are zero; does the step into the run, and the one out of it, jump?"""

    start: int
    stop: int
    jumps_in: bool
    jumps_out: bool

    def __len__(self) -> int:
        return self.stop - self.start


def zero_runs(zero: np.ndarray, steps: np.ndarray, least: float) -> Iterator[Run]:
    """Runs of True in `zero` (n,). A jump is a step above `least` and three times those next to it."""

    def jumps(near: np.ndarray) -> bool:
        return len(near) > 1 and bool(near[0] > least and near[0] > 3 * np.nanmax(near[1:], initial=0.0))

    edges = np.flatnonzero(np.diff(np.concatenate([[False], zero, [False]])))
    for start, stop in zip(edges[::2].tolist(), edges[1::2].tolist()):
        into, out = steps[max(start - 4, 0) : start][::-1], steps[stop : stop + 4]
        yield Run(start, stop, jumps(into), jumps(out))


def _strays(clip: Clip, turned: np.ndarray) -> list[Finding]:
    """The first and the last frame, if they have nothing to do with their neighbours; `turned` (F - 1, J)."""
    found = []
    for frame, step, beside in ((0, 0, "after"), (len(clip) - 1, len(turned) - 1, "before")):
        if kind := _outlier(clip, turned, frame, step):
            note = f"nothing to do with the frame {beside} it"
            found.append(Finding(kind, None, frame, frame + 1, note))
    return found


def _outlier(clip: Clip, turned: np.ndarray, frame: int, step: int) -> str | None:
    """What the first or last frame is, given the step between it and its neighbour."""
    mean = np.nan_to_num(turned).mean(axis=1)
    others = np.delete(mean, step)
    if (
        mean[step] < OUTLIER
        or mean[step] < 2 * np.percentile(others, 99)
        or mean[step] < 10 * np.median(others)
    ):
        return None
    rest = rotations.angle(clip.skeleton.rest_rotation, clip.rotation[frame]) < 0.01
    return "rest pose" if rest.mean() > 0.5 else "outlier"
