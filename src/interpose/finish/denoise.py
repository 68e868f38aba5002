"""Everything is observed, but not fully trusted: how noisy a clip is, and the motion below the noise.

The noise of a value is told by its fourth differences, in which captured motion all but vanishes. Each
signal is then smoothed as far as Stein's unbiased estimate of the risk says that it gains: a clean one not at
all. Turns are smoothed first, then the positions of the joints, which errors of single turns add up to, and
the skeleton's own bones are solved back into those: into positions as they came where it is them that are
noisy, and else into those of the turns that were smoothed. On 16 clips of validation performers with 1 and 3
degrees on every turn joints are off by .75 and 1.93 cm so, and turned by 1.5 and 3.5 degrees; by 1.0 and 2.6
cm, and 1.9 and 5.0 degrees, where positions as they came counted always.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy import ndimage
from scipy.linalg import solveh_banded

from interpose.clip import Clip
from interpose.errors import RequestError, few
from interpose.finish import feet
from interpose.finish.report import Completion, JointNoise, NoiseReport, Provenance, Report
from interpose.finish.solve import solve
from interpose.finish.standing import steadied
from interpose.finish.windows import ramp
from interpose.geometry import rotations
from interpose.geometry.time import bending, runs
from interpose.methods.classical import Spline
from interpose.methods.protocol import Raw
from interpose.observation import Observation
from interpose.observation.broken import medians
from interpose.observation.scan import intact
from interpose.observation.tremor import FEWEST, SLOWEST, body_of, bursts, deviation, restless
from interpose.skeletons import find_mapping
from interpose.skeletons.carrier import hips_of, line_of, placed
from interpose.skeletons.targets import seated

# Metres are those of a body of usual size (`feet.size`).

# How stiff smoothers may be: from one that takes out hardly anything to one that leaves parts of a minute.
STIFF = 10.0 ** np.arange(-1.5, 7.01, 0.5)
# Seconds (standard deviation) over which smoothers are compared: someone stands, and then runs.
MOMENT = 0.5
# Smoothers that differ by less than this in risk, in units of noise, share the result.
TEMPERATURE = 8.0
# A joint that trembles less than this (radians) is not touched: files have about seven digits.
QUIET = 1e-5
# Nor is a signal whose noise, times the strength, is less than this (metres, or of quaternions).
NOTHING = 1e-9
# Noise adds up along the limbs where joints, squared, tremble so many times as much as bones do: on 19 clips
# with 1 and 3 degrees of noise on turns it is 2.3 times and more, with 1 to 9 cm on positions .7 to 1.5. What
# trembles by less than this in the mean (metres) is clean, and positions are as good as they came.
ADDS_UP, TINY = 1.9, 0.001
# A joint whose position trembles by more than this (metres) is shaky: where it is further from the median of
# so many frames on either side than so many deviations, it is brought as near. Measured on validation
# performers with noise of 6.25 cm: that halves the largest jumps of velocities, and the error falls by 3 %.
SHAKY, AROUND, FAR = 0.005, 3, 2.5
# A quick foot or hand is far from that median by itself, by the square of the time that it spans: a joint is
# shaky only above this (metres a second squared) times it, 2 cm at 30 frames a second. Shaky from 5 mm on, a
# kick of a dance is flattened by 12 cm. At 120 frames, where SHAKY decides, quick motion is near its median.
QUICK = 2.0
# Feet that tremble by more than this (metres) are held where they stand: with 2 cm of noise they then slide a
# third as fast, at 30 frames a second. With 1 cm smoothing alone is better: held, joints of that dance are
# off by 8.6 mm instead of 7.7, and a foot by up to 5.6 cm more than it came instead of 2.1. Nor are they
# where it is turns that are noisy: a leg that is all but straight turns its knee far for a foot that is moved
# a little. With 1 degree on every turn of six takes of LAFAN1 knees are off by .7 degrees so, by 1.2 with
# feet held, and with 2 by 1.2 and 1.9; feet that stand move at 20 and 28 cm/s instead of 12 and 15.
UNSTEADY = 0.015
# Real feet stand, other than networks': what moves further than this (metres), or than so many deviations of
# its noise, is a step. Held up to .1 m, or three deviations, joints of six clips of LAFAN1 with 1 and 2
# degrees of noise are off by up to 7.0 and 10.2 cm more than they came, so by 3.4 and 5.7; feet slide as
# people's do.
STANCE, STRAYS = 0.05, 2.5
# The place of the body alone is noisy where it trembles by more than this (metres), and so many times as much
# as any joint against it.
TREMBLES, ALIKE = 5e-4, 3.0
# Seconds over which the result goes over into the frames before and after a range.
BLEND = 0.2


def _seated(clip: Clip, done: Clip, sound: Observation, free: Observation) -> Clip:
    """The denoised clip with targets on feet and hands where those have them in the clip.

    sound, free: what is not broken, and what may change.
    """
    same = (done.rotation == clip.rotation).all(axis=(1, 2))
    same &= (done.translation == clip.translation).all(axis=(1, 2))
    both = clip.joined([clip, done])
    kept = same[:, None] | ~free.rotation
    known = np.concatenate([sound.rotation & sound.translation, kept])
    return seated(both, known, known).slice(len(clip), len(both))


def _interpolated(clip: Clip, seen: Observation) -> Clip:
    return Spline().complete(clip, seen).clip


def denoised(
    clip: Clip,
    strength: float,
    joints: Sequence[int] | None = None,
    start: int = 0,
    stop: int | None = None,
    fill: Callable[[Clip, Observation], Clip] = _interpolated,
) -> Completion:
    """Fill what is broken and smooth what is noisy. Bones keep their lengths.

    Args:
        clip: F frames.
        strength: what the estimated noise is multiplied with; 0 changes nothing, not even what is broken.
        joints: those whose rotations, and positions as far as they carry the body, may change; None for all.
        start, stop: frames start to stop - 1 may change; the noise is estimated from them.
        fill: completes a clip of which broken values are not observed.

    Raises:
        RequestError: the range is too short, or the clip has too few frames a second.
    """
    stop = len(clip) if stop is None else stop
    if clip.fps < SLOWEST:
        raise RequestError(
            f"a clip of {clip.fps:.4g} frames a second cannot be denoised",
            "quick motion jumps from one frame to the next as noise does",
            f"Take it as it was recorded, at {SLOWEST:g} frames a second or more.",
        )
    if stop - start < FEWEST:
        raise RequestError(
            f"{stop - start} frame{'s' * (stop - start != 1)} cannot be denoised",
            "in so short a motion noise cannot be told from what is meant",
            f"Take {FEWEST} frames or more.",
        )
    cut, part = clip.slice(start, stop), slice(start, stop)
    free = _free(cut, joints)
    whole = intact(cut)
    seen = Observation(whole.rotation | ~free.rotation, whole.translation | ~free.translation)
    filled = cut if seen.complete else fill(cut, seen)
    noise = deviation(filled.positions())
    if strength > 0 and (shaken := _shaken(filled, free)):
        filled = steadied(filled, strength * shaken)
    done, parts = filled if strength > 0 else cut, _parts(filled, free)
    for one in parts:
        first, last = one.start, one.stop
        source = done if one.joints else filled
        piece, own = source.slice(first, last), one.free.slice(first, last)
        tremble = deviation(piece.positions())
        noise = np.maximum(noise, tremble) if one.noisy else noise
        if strength > 0:
            still = _smooth(piece, own, strength, tremble)
            still = _ease(done.slice(first, last), still, start + first > 0, start + last < len(clip))
            rotation, translation = done.rotation.copy(), done.translation.copy()
            rotation[first:last], translation[first:last] = still.rotation, still.translation
            done = done.with_motion(rotation, translation)
    done = _seated(cut, done, whole, free)
    rotation, translation = clip.rotation.copy(), clip.translation.copy()
    rotation[part], translation[part] = done.rotation, done.translation
    result = clip.with_motion(rotation, translation)
    provenance = np.zeros(rotation.shape[:2], np.int8)
    changed = (done.rotation != cut.rotation).any(axis=-1)
    changed[:, list(clip.translated)] |= (done.translation != cut.translation).any(axis=-1)
    lost = ~(seen.rotation & seen.translation)
    provenance[part] = np.where(lost, Provenance.METHOD, Provenance.SMOOTHED) * changed
    told = replace(
        _report(cut, done, lost, noise, start, strength),
        noisy=tuple(one.told(start, clip) for one in parts if one.noisy),
    )
    report = Report("denoise", noise=told)
    return Completion(result, lambda: Raw(result), provenance, report)


@dataclass(frozen=True)
class _Part:
    """Frames start to stop - 1, smoothed by their own noise in what is `free`.

    `noisy` where the rest is not; it is then these `joints` that tremble, or all of them (none are named).
    """

    start: int
    stop: int
    free: Observation
    noisy: bool = True
    joints: tuple[int, ...] = ()

    def told(self, start: int, clip: Clip) -> str:
        """Its frames, from frame `start` of the clip on."""
        joints = few([clip.skeleton.names[joint] for joint in self.joints])
        return f"{start + self.start}:{start + self.stop}" + f" ({joints})" * bool(joints)


def _parts(clip: Clip, free: Observation) -> list[_Part]:
    """What is smoothed, in turn: those that are noisy after the rest, as they are eased into what is beside
    them, and what single joints do at the very end. Of these the frames around go along, to ease in there."""
    noisy, around = bursts(clip), round(BLEND * clip.fps)
    ends = [0, *(end for some in noisy for end in some), len(clip)]
    parts = [_Part(a, b, free, noisy=False) for a, b in zip(ends[::2], ends[1::2]) if b - a >= FEWEST]
    parts += [_Part(a, b, free) for a, b in noisy]
    for start, stop, joints in restless(clip):
        alone = _free(clip, joints)
        own = Observation(free.rotation & alone.rotation, free.translation & alone.translation)
        # What trembles all along was smoothed by its own noise like all else.
        if own.rotation.any() and stop - start < len(clip):
            parts.append(_Part(max(start - around, 0), min(stop + around, len(clip)), own, joints=joints))
    return parts


def _free(clip: Clip, joints: Sequence[int] | None) -> Observation:
    """(F, J) what may be changed: rotations, and translations that carry the body: other bones stay."""
    chosen = np.zeros(clip.rotation.shape[:2], bool)
    chosen[:, slice(None) if joints is None else list(joints)] = True
    moved = np.zeros_like(chosen)
    moved[:, placed(clip)] = True
    return Observation(chosen, chosen & moved)


def _shaken(clip: Clip, free: Observation) -> float:
    """Metres of noise along an axis, if the place of the body alone has any; else 0.

    Then all joints tremble alike, and against the hips hardly: smoothed each for itself they would bend limbs
    of which all is known.
    """
    hips = hips_of(clip.skeleton)
    if not find_mapping(clip.skeleton).usable or not free.translation[:, line_of(clip)[-1:]].all():
        return 0.0
    places = clip.positions()
    shaken = float(deviation(places[:, [hips]])[0])
    # What does not hang from the hips, as a root that stays, trembles against them as they do themselves.
    below = [joint for joint in range(len(clip.skeleton)) if hips in clip.skeleton.ancestors(joint)]
    own = deviation(places[:, below] - places[:, [hips]])
    least = TREMBLES * feet.size(clip.skeleton)
    return shaken if shaken > max(least, ALIKE * own.max()) else 0.0


def _ease(filled: Clip, done: Clip, before: bool, after: bool) -> Clip:
    """The result, at the ends that lead on to other frames blended with the input without what was broken."""
    count = len(done)
    over, time = min(BLEND * done.fps, count / 2), np.arange(count)
    share = np.ones(count)
    if before:
        share *= ramp((time + 1) / (over + 1))
    if after:
        share *= ramp((count - time) / (over + 1))
    eased = rotations.slerp(filled.rotation, done.rotation, share[:, None])
    same = (share == 1)[:, None] | (filled.rotation == done.rotation).all(axis=-1)
    return done.with_motion(
        np.where(same[..., None], done.rotation, eased),
        filled.translation + share[:, None, None] * (done.translation - filled.translation),
    )


def measured(told: NoiseReport, clip: Clip, done: Clip) -> NoiseReport:
    """The report with how far all of a clip was moved and turned to become another one."""
    whole, each = _movement(*(some.slice(told.start, told.stop) for some in (clip, done)))
    joints = tuple(replace(one, **own) for one, own in zip(told.joints, each))
    return replace(told, joints=joints, **whole)


def _movement(clip: Clip, done: Clip) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """How far joints move, in cm, and turn, in degrees, from one clip to another, in the mean and at most:
    all of them, and each."""
    moved = 100 * np.linalg.norm(done.positions() - clip.positions(), axis=-1)
    turned = np.degrees(rotations.angle(done.rotation, clip.rotation))

    def told(far: np.ndarray, about: np.ndarray) -> dict[str, Any]:
        figures = {"moved": far.mean(), "moved_most": far.max()}
        figures |= {"turned": about.mean(), "turned_most": about.max()}
        return {name: float(figure) for name, figure in figures.items()}

    return told(moved, turned), [told(far, about) for far, about in zip(moved.T, turned.T)]


def _report(
    clip: Clip, done: Clip, lost: np.ndarray, noise: np.ndarray, start: int, strength: float
) -> NoiseReport:
    whole, each = _movement(clip, done)
    joints = tuple(
        JointNoise(
            joint=name,
            noise=100 * float(noise[j]),
            broken=tuple(f"{start + a}:{start + b}" for a, b in runs(lost[:, j])),
            **each[j],
        )
        for j, name in enumerate(clip.skeleton.names)
    )
    return NoiseReport(
        start=start,
        stop=start + len(clip),
        strength=strength,
        noise=100 * float(noise[body_of(clip)].mean()),
        broken=int(lost.sum()),
        values=lost.size,
        joints=joints,
        **whole,
    )


def _smooth(clip: Clip, free: Observation, strength: float, noise: np.ndarray) -> Clip:
    """The clip with turns and positions of what is `free` smoothed; `noise` (J,) is that of its positions."""
    skeleton = clip.skeleton
    moves = free.rotation.all(axis=0) & (deviation(rotations.continuous(clip.rotation)) > QUIET)
    known = Observation(np.broadcast_to(~moves, free.rotation.shape), ~free.translation)
    still = _calm_turns(clip, moves, strength)
    mapping = find_mapping(skeleton)
    joints = mapping.mapped[1] if mapping.usable else tuple(range(len(skeleton)))
    noise, grown = strength * noise, feet.size(skeleton)
    shaky = grown * max(SHAKY, QUICK * (AROUND / clip.fps) ** 2)
    near = np.where(noise > shaky, FAR * noise, np.inf)
    turns = _adds_up(clip, joints)
    source = still if turns else clip
    places = smoothed(_bounded(source.positions(), near)[:, joints], clip.fps, strength)
    done = solve(still, known, joints, places)
    unsteady = noise[feet.ends(skeleton)].max(initial=0.0)
    if turns or unsteady <= UNSTEADY * grown:
        return done
    # The heights of real feet are known as well as the rest: lifted clear of a floor, with 2 cm of noise they
    # are off by up to 12 cm in punches of CMU's, else by 6.
    return feet.plant(done, known, (0, len(done)), step=max(STANCE, STRAYS * unsteady / grown), lift=False)


def _adds_up(clip: Clip, joints: Sequence[int]) -> bool:
    """Whether noise adds up from joint to joint, as that of turns does: then positions are best told by turns
    that are smoothed. Noise of positions is each joint's own: a bone trembles by what both of its ends do."""
    above = [next((j for j in clip.skeleton.ancestors(joint) if j in joints), -1) for joint in joints]
    pairs = np.array([both for both in zip(joints, above) if both[1] >= 0], int)
    child, parent = pairs.reshape(-1, 2).T
    places = clip.positions()
    ends, bones = deviation(places[:, child]), deviation(places[:, child] - places[:, parent])
    return bool(
        ends.sum() > TINY * feet.size(clip.skeleton) * len(ends)
        and (ends**2).sum() > ADDS_UP * (bones**2).sum()
    )


def _bounded(positions: np.ndarray, near: np.ndarray) -> np.ndarray:
    """Positions (F, n, 3), each brought as near as `near` (n,) metres to the median of those around it."""
    if not np.isfinite(near).any():
        return positions
    middle = medians(positions, AROUND, "reflect")
    off = positions - middle
    # At the ends what is around lies on one side: whoever moves is far from it.
    off[:AROUND] = off[len(off) - AROUND :] = 0.0
    far = np.maximum(np.linalg.norm(off, axis=-1) / near, 1.0)
    return np.where((far > 1)[..., None], middle + off / far[..., None], positions)


def _calm_turns(clip: Clip, moves: np.ndarray, strength: float) -> Clip:
    """The clip with the turns of joints that move (J,) smoothed: to their parent or in the world, whichever
    is quieter. Noise on positions makes the first tremble more, noise on rotations the second."""
    own, turned = clip.rotation, clip.kinematics()[0]
    to_parent = deviation(rotations.continuous(own)) <= deviation(rotations.continuous(turned))
    local, world = own.copy(), turned.copy()
    for joint, parent in enumerate(clip.skeleton.parents):
        above = world[:, parent] if parent >= 0 else rotations.identity(len(own))
        if moves[joint]:
            signal = rotations.continuous((own if to_parent[joint] else turned)[:, [joint]])
            still = rotations.normalize(smoothed(signal, clip.fps, strength)[:, 0])
            local[:, joint] = still if to_parent[joint] else rotations.relative(above, still)
        world[:, joint] = rotations.multiply(above, local[:, joint])
    return clip.with_motion(local, clip.translation)


def smoothed(signals: np.ndarray, fps: float, strength: float) -> np.ndarray:
    """Signals (F, n, d) smoothed as far as their noise, times `strength`, makes it worth while.

    Smoothers of growing stiffness (Whittaker 1923, second differences) are weighed at every frame by their
    risk around it: what they leave of the signal, plus twice the noise that they let through (Stein 1981).
    """
    still = signals.copy()
    for i, noise in enumerate(strength * deviation(signals)):
        if noise > NOTHING:
            still[:, i] = _weighed(signals[:, i], noise, MOMENT * fps)
    return still


def _weighed(signal: np.ndarray, noise: float, moment: float) -> np.ndarray:
    """One signal (F, d), weighed as in `smoothed`; its noise and `moment` (frames) are above zero."""
    count = len(signal)
    stages = np.stack([signal, *(_whittaker(signal, stiff) for stiff in STIFF)])
    # The eigenvalues of the penalty are nearly those of a free beam; 1 / (1 + ...) is what is let through.
    wave = (2.0 * np.sin(np.pi * (np.arange(2, count) - 0.5) / (2 * count))) ** 4
    through = [1.0, *((2.0 + (1.0 / (1.0 + stiff * wave)).sum()) / count for stiff in STIFF)]
    left = ((stages - signal) ** 2).sum(axis=-1) / noise**2
    risk = ndimage.gaussian_filter1d(left, moment, axis=1, mode="nearest") + 6.0 * np.array(through)[:, None]
    risk *= np.sqrt(2 * np.pi) * moment
    with np.errstate(under="ignore"):  # what is far worse has no share
        share = np.exp((risk.min(axis=0) - risk) / TEMPERATURE)
    return np.einsum("lf,lfd->fd", share / share.sum(axis=0), stages)


def _whittaker(signal: np.ndarray, stiff: float) -> np.ndarray:
    """The signal (F, d) nearest to this one whose squared second differences, times `stiff`, are small."""
    bands = stiff * bending(len(signal))
    bands[0] += 1.0
    return np.asarray(solveh_banded(bands, signal, lower=True))
