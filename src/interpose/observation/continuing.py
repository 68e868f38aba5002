"""Whether one clip goes on in another, as two parts of a take do that lie a few frames apart."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from interpose.clip import Clip
from interpose.geometry.ground import FLOOR, turn
from interpose.skeletons.carrier import hips_of

# Seconds over which a motion is foretold from how it moves on either side, and steps that are never too many.
# In LAFAN1, 30 frames a second, the hips are off over the floor by .1, .7 and 1.3 cm (in 50, 95 and 99 % of
# all frames) over two steps, by .3, 1.3 and 2.5 over three, by .4, 2.1 and 3.9 over four.
BRIEF, FEWEST = 0.1, 3
# The share of how far joints are from the hips, half a metre, by which they may be off in the mean: they are
# by 2.7 cm over two steps, and by 5.3 over three, in 99 % of all frames.
ALIKE = 0.1
# Radians and metres that are no turn and no rise, beside as much as the body itself turns or rises in these
# steps: in 99.9 % of all frames what goes on is off by less. It is best left as it is, as a degree leads what
# follows astray by 2 cm in a metre.
TURNS, RISES = np.radians(1.0), 0.02
FLAT = 0.1  # the share of how far joints are from the hips that lies aside of them: less tells no turn


@dataclass(frozen=True)
class GoesOn:
    """How a clip goes on in another.

    Attributes:
        yaw: radians by which the other one is turned for that; 0 where it faces so already.
        rise: metres by which it is lifted; 0 where its height goes on already, and where it is turned: that
            may well be another take, on another floor.
        velocities: (3,) metres a second over the floor, of the one at its end and of the other at its
            beginning, in its own place.
    """

    yaw: float
    rise: float
    velocities: tuple[np.ndarray, np.ndarray]


@dataclass(frozen=True)
class _Side:
    """Half-way between two clips, as one of them leads there.

    Attributes:
        height: metres, of the hips.
        pose: (J, 3) metres, of all joints from the hips.
        step: (3,) metres that the hips get on in a frame.
        turn: radians by which the body turns in a frame.
    """

    height: float
    pose: np.ndarray
    step: np.ndarray
    turn: float


def goes_on(before: Clip, after: Clip, steps: int) -> GoesOn | None:
    """How one clip goes on in another that begins `steps` frames after its last; None where it does not, or
    where nothing tells that: after more than a moment, or of single frames.

    It does where both lead to one pose half-way. Where the clips lie, and where they face, does not matter.
    """
    if min(len(before), len(after)) < 2 or steps > max(FEWEST, BRIEF * before.fps):
        return None
    hips = hips_of(before.skeleton)
    last = _side(before.slice(len(before) - 2, len(before)), 1, steps / 2, hips)
    then = _side(after.slice(0, 2), 0, -steps / 2, hips)
    size, aside = (np.linalg.norm(last.pose * part, axis=-1).mean() for part in (1.0, FLOOR.values))
    yaw = _yaw(then.pose, last.pose)
    apart = np.linalg.norm(last.pose - turn(then.pose, np.array(yaw)), axis=-1).mean()
    if aside < FLAT * size or apart >= ALIKE * size:
        return None
    turns = abs(yaw) > TURNS + steps * max(abs(last.turn), abs(then.turn))
    rise = last.height - then.height
    rises = abs(rise) > RISES + steps * max(abs(last.step[1]), abs(then.step[1]))
    return GoesOn(
        yaw=yaw if turns else 0.0,
        rise=rise if rises and not turns else 0.0,
        velocities=(last.step * FLOOR.values * before.fps, then.step * FLOOR.values * before.fps),
    )


def _side(pair: Clip, frame: int, steps: float, hips: int) -> _Side:
    """Of two frames: where they lead in some steps from one of them, at the pace between them."""
    places = pair.positions()
    there = places[frame] + steps * (places[1] - places[0])
    first, second = places - places[:, [hips]]
    return _Side(
        height=float(there[hips, 1]),
        pose=there - there[hips],
        step=places[1, hips] - places[0, hips],
        turn=_yaw(first, second),
    )


def _yaw(pose: np.ndarray, other: np.ndarray) -> float:
    """The turn about the vertical, in radians, that brings a pose (J, 3) closest to another, in squares."""
    (x, z), (to_x, to_z) = pose[:, [0, 2]].T, other[:, [0, 2]].T
    return float(np.arctan2((z * to_x - x * to_z).sum(), (x * to_x + z * to_z).sum()))
