"""Who is in the air comes down: at an open end of a clip a body falls until something of it is on the floor.

What a network says there is a mean of all that may follow, and may stay up. Of 75 forecasts from cuts in the
air of jumps (LAFAN1's training performers) 6 are led so: 3 never came down in two seconds, and one after 1.6;
so all land after .24 s in the mean (truth .23), and joints are off by 11.4 instead of 13.4 cm in the first
half of a second, and 52 instead of 53 in two. Of 117 cuts of all its motion above the lowest floor, as on
boxes, none is.
"""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from interpose.clip import Clip
from interpose.finish import feet
from interpose.finish.standing import GRAVITY
from interpose.finish.windows import ramp
from interpose.observation import Observation
from interpose.skeletons import find_mapping
from interpose.skeletons.carrier import moved, place_of

# Metres above the floor from which on nothing stands; and metres higher than it can be from which on a body
# is led.
ALOFT, HOVERS = 0.03, 0.05
# In the air is who falls, by this share of gravity, or who rises by so many metres a second.
FALLS, RISES = 0.5, 0.7
# Seconds after which a body that has landed is lowest, and metres that it gives way at most; seconds around a
# frame in which it is on the floor once at least.
GIVES, DEEPEST, STEPS = 0.12, 0.2, 0.4


def landed(clip: Clip, known: Observation, span: tuple[int, int]) -> Clip:
    """The clip with a body that falls, and lands, in frames `span` (start to before stop) at an end of it, if
    it is in the air where they begin and stays there.

    Args:
        clip, known: the motion with some of it before the frames, or behind them, and what of it is observed.
    """
    start, stop = span
    if start == 0 and stop < len(clip):
        # Backwards in time all falls as well.
        back = Observation(known.rotation[::-1], known.translation[::-1])
        turned = clip.take(slice(None, None, -1))
        done = landed(turned, back, (len(clip) - stop, len(clip)))
        return clip if done is turned else clip.with_motion(done.rotation[::-1], done.translation[::-1])
    if start < 2 or stop < len(clip) or not feet.untold(clip, known, start, stop):
        return clip
    if not feet.legs(clip.skeleton) or not find_mapping(clip.skeleton).usable:
        return clip
    grown, fps = feet.size(clip.skeleton), clip.fps
    placed = clip.positions() / grown
    rests = resting(placed, clip, known)
    clear = above(placed, rests, clip)
    height = placed[:, list(find_mapping(clip.skeleton).mapped[1]), 1].mean(axis=1)
    gravity = GRAVITY / grown / fps**2
    rate = _flies(height[:start], clear[:start], gravity, fps)
    if rate is None:
        return clip
    time = np.arange(1, stop - start + 1)
    fall = height[start - 1] + rate * time - gravity * time * (time + 1) / 2
    over, clear = np.maximum(height[start:] - fall, 0.0), np.maximum(clear[start:], 0.0)
    lands = int(np.argmax(over >= clear)) if (over >= clear).any() else len(time)
    if over[:lands].max(initial=0.0) < HOVERS:
        return clip
    # It lands between two frames, and gives way from then on: else it would stop for one.
    early = 0.0
    if 0 < lands < len(time):
        early = float(np.clip((over - clear)[lands] / max(over[lands] - over[lands - 1], 1e-9), 0.0, 1.0))
    down, since = np.minimum(over, clear), np.maximum(time - 1 - lands + early, 0) / fps
    if lands < len(time):
        # On the floor it stays: what the method does above it, it does on it.
        stays = ndimage.minimum_filter1d(clear, 2 * round(STEPS * fps) + 1)
        eased = stays + (clear[lands] - stays[lands]) * (1 - ramp(since / STEPS))
        down[lands:] = np.minimum(eased, clear)[lands:]
    fast = max(0.0, -(rate - gravity * lands) * fps) * (lands < len(time))
    gives = np.minimum(fast, DEEPEST * np.e / GIVES) * since * np.exp(-since / GIVES)
    return lowered(clip, grown * down, grown * gives, grown * rests[start:], start)


def resting(placed: np.ndarray, clip: Clip, known: Observation) -> np.ndarray:
    """(F, L, 2) the heights at which ankles and toes rest, of places (F, J, 3)."""
    pairs = feet.pairs(clip.skeleton)
    return feet.local_floor(placed[:, pairs], known.positions(clip.skeleton)[:, pairs], clip.fps)


def above(placed: np.ndarray, rests: np.ndarray, clip: Clip) -> np.ndarray:
    """(F,) how far the lowest joint of places (F, J, 3) is above the floor, on which ankles and toes rest at
    heights (F, L, 2)."""
    low = (placed[:, feet.pairs(clip.skeleton), 1] - rests).reshape(len(placed), -1).min(axis=1)
    return np.minimum(low, others_above(placed, rests, clip))


def others_above(placed: np.ndarray, rests: np.ndarray, clip: Clip) -> np.ndarray:
    """(F,) the same of the lowest joint of the body that is no ankle or toe."""
    pairs = feet.pairs(clip.skeleton)
    others = [j for j in find_mapping(clip.skeleton).mapped[1] if j not in pairs]
    return np.asarray(placed[:, others, 1].min(axis=1) - rests.min(axis=(1, 2)))


def _flies(height: np.ndarray, clear: np.ndarray, gravity: float, fps: float) -> float | None:
    """By how many metres a frame a body rises that is in the air at the last frame; None where it is not.

    height, clear: (n,) metres, of the body and of what is lowest of it, above the floor.
    """
    stood = np.flatnonzero(clear < ALOFT)
    aloft = len(clear) - 1 - (int(stood[-1]) if stood.size else -1)
    rises = np.diff(height)
    if not aloft:
        return None
    if aloft > 2 and (rises[-1] - rises[-aloft + 1]) / (aloft - 2) > -FALLS * gravity:
        return None
    if aloft <= 2 and rises[-1] * fps < RISES:
        return None
    return float(rises[-1])


def lowered(clip: Clip, down: np.ndarray, gives: np.ndarray, rests: np.ndarray, start: int) -> Clip:
    """The clip let down by `down` (n,) metres from frame `start` on, and by `gives` (n,) more above its feet.

    rests: (n, L, 2) metres, what ankles and toes stay above.
    """
    turned, placed = clip.kinematics()
    legs, joint = feet.legs(clip.skeleton), place_of(clip)
    goal = placed[start:, feet.pairs(clip.skeleton)]
    goal[..., 1] = np.maximum(goal[..., 1] - down[:, None, None], rests)
    place = placed[:, joint].copy()
    place[start:, 1] -= down + gives
    done = moved(clip, {joint: (turned[:, joint], place)})
    turned, placed = (some[start:] for some in done.kinematics())
    rotation = done.rotation.copy()
    gone = gives > 0
    for leg, ends in zip(legs, np.moveaxis(goal, 1, 0)):
        reached = feet.reach(clip.skeleton, leg, rotation[start:], turned, placed, ends)
        rotation[start:][gone] = reached[gone]
    return done.with_motion(rotation, done.translation)
