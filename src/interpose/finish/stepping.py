"""Turning on the spot: feet that stand at two lone keys go from there to there in steps.

Between a pose and the same pose turned, or moved aside a little, methods let a body glide, or swivel on both
feet: what people do between two such keys differs too much for a mean of it to be any of it. Who turns where
he stands sets one foot after the other.

Between 24 standing poses of validation performers and the same turned by 45 to 175 degrees feet slide at 2
to 6 cm/s so and drift by 1 to 2 cm in a stance, by `base` alone at 10 to 18 and by 5 to 14 cm. Of 150 real
moves on the spot between lone keys (no test performers) 80 are led so: feet slid at 10 cm/s, so at 2, in
truth at 8, and drifted by 13, 1 and 3 cm; joints are off by 9.4 cm instead of 8.5, as steps that nobody
can know are no mean. Amid known motion networks know better: there .1 cm in the mean of 60 gaps of a
second were lost by steps.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from interpose.clip import Clip
from interpose.finish import feet, jumps, seams
from interpose.finish.windows import envelope, ramp, spread
from interpose.geometry import measures, rotations
from interpose.geometry.ground import FLOOR
from interpose.geometry.time import ease
from interpose.observation import Observation
from interpose.skeletons import find_humanoid, find_mapping
from interpose.skeletons.carrier import hips_of, moved, place_of

# Metres that the middle of the feet goes at most, of who stays where he is, and that a foot has to go, or the
# degrees that the body has to turn, for there to be a reason for steps.
SPOT, NEAR, TURNS = 0.6, 0.12, np.radians(30.0)
# Metres by which each foot may stand higher or lower than it does at the other end, and than the other one;
# how high hips are above the ankles at least, in legs, of who stands.
LEVEL, UPRIGHT = 0.08, 0.7
# Radians that one step turns a foot by, at most, and metres that it goes, as long as there is time; seconds
# that it takes, at least and at most.
TURN, STRIDE, QUICK, SLOW = np.radians(100.0), 0.7, 0.2, 0.5
# Metres by which ankle and toe are lifted in the middle of a step, and seconds in which a heel that is up at
# a key comes down after it, or rises before it: nobody waits on tiptoe.
LIFT, HEELS = np.array([0.08, 0.05]), 0.3
# Seconds over which hips sink, and metres that they may before they stay over the feet; and how far they get
# then from where they are over them in the keys. Three of 30 turns squatted by 15 to 22 cm, now by 2 at most.
SINKS, SINK, SWAY = 0.25, 0.05, 0.15
REACHED = 1e-4  # metres by which an ankle misses where it is to be that is there
# The share of frames in which it glides, and the metres by which a foot drifts while it stands, from which a
# method's own motion is no way to turn.
GLIDES, DRIFTS = 0.25, 0.08
# A turn that is as near to half of one (radians) may go either way: it goes the method's.
EITHER = np.radians(15.0)


@dataclass(frozen=True)
class Turn:
    """What a body is to do on the spot.

    Attributes:
        feet: (2, L, 2, 3) metres, where ankles and toes stand before and after.
        angle: radians that it turns by about the vertical.
    """

    feet: np.ndarray
    angle: float

    def stance(self, leg: int, share: np.ndarray) -> np.ndarray:
        """(n, 2, 3) where a leg's ankle and toe stand once a share (n,) of the turn is done."""
        middles = self.feet.mean(axis=(1, 2))
        middle = middles[0] + share[:, None] * (middles[1] - middles[0])
        first, last = (
            rotations.rotate(
                rotations.about("Y", angle)[:, None], np.broadcast_to(feet - middle, (len(share), 2, 3))
            )
            for feet, middle, angle in zip(
                self.feet[:, leg], middles, (self.angle * share, self.angle * (share - 1))
            )
        )
        return middle[:, None] + (1 - share)[:, None, None] * first + share[:, None, None] * last


def stepped(clip: Clip, known: Observation, span: tuple[int, int]) -> Clip | None:
    """The clip with steps in the frames `span` (start to before stop), where its body turns on the spot and
    glides or slides; None where it does neither, or there is no time for steps.

    Args:
        clip, known: the motion with some of it around the frames, and what of it is observed.
    """
    start, stop = span
    legs = feet.legs(clip.skeleton)
    if len(legs) != 2 or start < 1 or stop >= len(clip):
        return None
    if not feet.untold(clip, known, start, stop):
        return None
    turn = _on_the_spot(clip, known, span)
    if turn is None:
        return None
    before = _unsteady(clip, known, span)
    if before <= 1.0:
        return None
    goal = _steps(turn, clip, span)
    if goal is None:
        return None
    angles = np.zeros(stop - start)
    if abs(turn.angle) > TURN:
        angles = _evenly(clip, known, turn.angle, span)
    done, sunk = let_down(clip, known, angles, goal, span)
    if sunk > SINK * feet.size(clip.skeleton):
        done, _ = let_down(_over_feet(clip, turn, goal, span), known, angles, goal, span)
    if _unsteady(done, known, span) >= before or _jolts(done, clip, known, span):
        return None
    return done


def _on_the_spot(clip: Clip, known: Observation, span: tuple[int, int]) -> Turn | None:
    """What a body does that stands on both feet at lone keys before and after a span, in about one place."""
    skeleton, grown = clip.skeleton, feet.size(clip.skeleton)
    keys = np.array([span[0] - 1, span[1]])
    if any(0 <= beside < len(clip) and known.frames[beside] for beside in (keys[0] - 1, keys[1] + 1)):
        return None
    placed, pairs = clip.positions(), feet.pairs(skeleton)
    stands = placed[keys][:, pairs]
    heights = stands[..., 1]
    if max(np.ptp(heights, axis=0).max(), np.ptp(heights, axis=1).max()) > LEVEL * grown:
        return None
    if not stands_upright(clip)[keys].all():
        return None
    middles = stands.mean(axis=(1, 2))
    angle = _angle(clip, span)
    goes = np.linalg.norm((stands[1] - stands[0])[..., [0, 2]], axis=-1).max()
    if np.linalg.norm((middles[1] - middles[0])[[0, 2]]) > SPOT * grown:
        return None
    if goes < NEAR * grown and abs(angle) < TURNS:
        return None
    return Turn(stands, angle)


def stands_upright(clip: Clip) -> np.ndarray:
    """(F,) whether hips are as high above the ankles as they are of who stands."""
    placed, ankles = clip.positions(), feet.pairs(clip.skeleton)[:, 0]
    hips = placed[:, hips_of(clip.skeleton), 1] - placed[:, ankles, 1].mean(axis=1)
    return np.asarray(hips > UPRIGHT * find_mapping(clip.skeleton).leg_length)


def _heading(placed: np.ndarray, clip: Clip) -> np.ndarray:
    """(F,) radians about the vertical by which the line between the thighs is turned."""
    left, right = (leg.thigh for leg in feet.legs(clip.skeleton))
    across = placed[:, left] - placed[:, right]
    return np.unwrap(np.arctan2(-across[:, 2], across[:, 0]))


def _angle(clip: Clip, span: tuple[int, int]) -> float:
    """By how much the body is to turn over a span: the shorter way round, or the method's own."""
    heading = _heading(clip.slice(span[0] - 1, span[1] + 1).positions(), clip)
    own = float(heading[-1] - heading[0])
    short = (own + np.pi) % (2 * np.pi) - np.pi
    other = short - 2 * np.pi * np.sign(short)
    return other if abs(short) > np.pi - EITHER and abs(own - other) < abs(own - short) else short


def _unsteady(clip: Clip, known: Observation, span: tuple[int, int]) -> float:
    """How much a body glides, or its feet slide while they stand: beyond 1 it is no way to turn."""
    placed, grown = clip.positions(), feet.size(clip.skeleton)
    pairs = feet.pairs(clip.skeleton)
    glides = measures.glides(placed[:, pairs], placed[:, hips_of(clip.skeleton)], clip.fps, grown)
    drift = feet.drifts(clip, known, [span])[0][0]
    return max(float(glides[slice(*span)].mean()) / GLIDES, drift / (DRIFTS * grown))


def _jolts(done: Clip, clip: Clip, known: Observation, span: tuple[int, int]) -> bool:
    """Whether a joint's velocity jumps further at the keys beside a span than it did, and than it may: a foot
    that is on its way there stands from there on."""
    keys = np.array([key for key in (span[0] - 1, span[1]) if 0 < key < len(clip) - 1], int)
    if not keys.size:
        return False
    before, after = (np.linalg.norm(seams.jumps(one, known, keys), axis=-1).max() for one in (clip, done))
    return bool(after > max(before, jumps.SETS_OFF * feet.size(clip.skeleton) / clip.fps**2))


def _steps(turn: Turn, clip: Clip, span: tuple[int, int]) -> np.ndarray | None:
    """(n, 2, 2, 3) where ankles and toes of both legs are to be in the n frames of a span; None without time.

    Of two steps each comes when the method's foot is half way, of more they follow each other evenly.
    """
    fps, grown, frames = clip.fps, feet.size(clip.skeleton), span[1] - span[0] + 1
    goes = float(np.linalg.norm((turn.feet[1] - turn.feet[0])[..., [0, 2]], axis=-1).max())
    rounds = max(1, int(np.ceil(max(abs(turn.angle) / TURN, goes / (STRIDE * grown)))))
    while rounds > 1 and frames / (2 * rounds) < QUICK * fps:
        rounds -= 1
    slot = frames / (2 * rounds)
    if slot < QUICK * fps:
        return None
    takes = min(slot, SLOW * fps)
    first = int(turn.angle * find_humanoid(clip).hand[0] < 0)
    middles = (np.arange(2 * rounds) + 0.5) * slot
    if rounds == 1:
        own = _half_way(turn, clip, span)
        first = int(own[1] < own[0])
        middles[0] = np.clip(own.min(), takes / 2, frames - 1.5 * takes)
        middles[1] = np.clip(own.max(), middles[0] + takes, frames - takes / 2)
    time, toes = np.arange(1, frames), [leg.toe is not None for leg in feet.legs(clip.skeleton)]
    path = np.empty((frames - 1, 2, 2, 3))
    for leg in range(2):
        phases = (time[:, None] - middles[leg != first :: 2]) / takes + 0.5
        path[:, leg] = turn.stance(leg, ramp(phases).mean(axis=1))
        heights = turn.feet[:, leg, :, 1]
        low, soon = heights.min(axis=0), HEELS * fps
        near = np.stack([1 - ramp(time / soon), 1 - ramp((frames - time) / soon)])
        path[:, leg, :, 1] = low + np.einsum("kt,kj->tj", near, heights - low)
        lift = np.sin(np.pi * np.clip(phases, 0, 1)).sum(axis=1) ** 2
        path[:, leg, :, 1] += lift[:, None] * (LIFT if toes[leg] else LIFT[0]) * grown
    return path


def _half_way(turn: Turn, clip: Clip, span: tuple[int, int]) -> np.ndarray:
    """(2,) after how many frames from the key each foot of a motion is nearer to where it goes."""
    placed = clip.slice(span[0] - 1, span[1] + 1).positions()[:, feet.pairs(clip.skeleton)]
    left, to_go = (np.linalg.norm((placed - end)[..., [0, 2]], axis=-1).mean(axis=-1) for end in turn.feet)
    return np.asarray((left < to_go).sum(axis=0), float)


def _evenly(clip: Clip, known: Observation, angle: float, span: tuple[int, int]) -> np.ndarray:
    """(n,) radians by which the body is to turn in frames of a span to turn evenly, by `angle` in all.

    It comes to rest at a key, unless it turns on beyond it: then it goes through it at the harmonic mean of
    both rates, so that it never turns back (Fritsch and Butland 1984).
    """
    start, stop = span
    heading = _heading(clip.slice(start - 1, stop + 1).positions(), clip)
    frames = stop - start + 1
    share, rate = np.linspace(0, 1, frames + 1), angle / frames
    leave, meet = (
        frames * 2 * rate * on / (rate + on) if rate * on > 0 else 0.0
        for on in (_rate(clip, known, start - 1, -1), _rate(clip, known, stop, 1))
    )
    way = angle * ease(share) + share * (1 - share) * (leave * (1 - share) - meet * share)
    return (heading[0] + way - heading)[1:-1]


def _rate(clip: Clip, known: Observation, key: int, ahead: int) -> float:
    """Radians a frame by which the body is to turn from a lone key to the next known frame behind it, or
    `ahead` (1, or else -1); 0 where there is none."""
    others = np.flatnonzero(known.frames[key + 1 :] if ahead > 0 else known.frames[:key][::-1])
    if not others.size or not others[0]:
        return 0.0
    far = int(others[0]) + 1
    first = min(key, key + ahead * far)
    return _angle(clip, (first + 1, first + far)) / far


def let_down(
    clip: Clip, known: Observation, angles: np.ndarray, goal: np.ndarray, span: tuple[int, int]
) -> tuple[Clip, float]:
    """The clip as `_led`, its hips let down a little where a leg, which may be straight in both keys, is too
    short for its step; and by how many metres at most."""
    start, stop = span
    dip = np.zeros(stop - start)
    done = _led(clip, angles, dip, goal, span)
    ankles = [leg.ankle for leg in feet.legs(clip.skeleton)]
    short = done.positions()[start:stop, ankles, 1] - goal[..., 0, 1]
    if short.max() < REACHED:
        return done, 0.0
    dip = spread(np.maximum(short, 0.0).max(axis=1), SINKS * clip.fps)
    dip *= np.prod(envelope(~known.frames, SINKS * clip.fps), axis=0)[start:stop]
    return _led(clip, angles, dip, goal, span), float(dip.max())


def _over_feet(clip: Clip, turn: Turn, goal: np.ndarray, span: tuple[int, int]) -> Clip:
    """The clip with hips that stay within SWAY of where they are over the feet in both keys: what the method
    let them do was meant for other steps, and legs are too short for that.

    goal: (n, 2, 2, 3) where ankles and toes are to be in the frames of a span.
    """
    start, stop = span
    placed, inside = clip.positions()[start - 1 : stop + 1], slice(start, stop)
    hips, share = placed[:, hips_of(clip.skeleton)], ease(np.linspace(0, 1, stop - start + 2))
    middles = np.concatenate([turn.feet[:1], goal, turn.feet[1:]]).mean(axis=(1, 2))
    middles = ndimage.gaussian_filter1d(middles, SINKS * clip.fps / 2, axis=0, mode="nearest")
    first, last = (
        rotations.rotate(rotations.about("Y", angle), np.broadcast_to(hips[key] - middles[key], hips.shape))
        for key, angle in ((0, turn.angle * share), (-1, turn.angle * (share - 1)))
    )
    off = (middles + (1 - share)[:, None] * first + share[:, None] * last - hips) * FLOOR.values
    far, most = np.linalg.norm(off, axis=1), SWAY * feet.size(clip.skeleton)
    off *= (1 - most * np.tanh(far / most) / np.maximum(far, 1e-9))[:, None]
    rotation, at = clip.kinematics()
    joint = place_of(clip)
    place = at[:, joint].copy()
    place[inside] += off[1:-1]
    return moved(clip, {joint: (rotation[:, joint], place)})


def _led(clip: Clip, angles: np.ndarray, dip: np.ndarray, goal: np.ndarray, span: tuple[int, int]) -> Clip:
    """The clip with its body turned about its hips by `angles` (n,) and let down by `dip` (n,) metres in the
    frames of a span, and its ankles and toes at `goal` (n, 2, 2, 3), as far as legs are long."""
    inside = slice(*span)
    turned, placed = clip.kinematics()
    turn, joint, hips = rotations.about("Y", angles), place_of(clip), placed[inside, hips_of(clip.skeleton)]
    place = turned[:, joint].copy(), placed[:, joint].copy()
    place[0][inside] = rotations.multiply(turn, turned[inside, joint])
    place[1][inside] = hips + rotations.rotate(turn, placed[inside, joint] - hips)
    place[1][inside, 1] -= dip
    led = moved(clip, {joint: place}) if angles.any() or dip.any() else clip
    turned, placed = (some[inside] for some in led.kinematics())
    rotation = led.rotation.copy()
    for leg, ends in zip(feet.legs(clip.skeleton), np.moveaxis(goal, 1, 0)):
        rotation[inside] = feet.reach(clip.skeleton, leg, rotation[inside], turned, placed, ends)
    return led.with_motion(rotation, led.translation)
