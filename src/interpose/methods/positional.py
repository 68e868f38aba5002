"""What methods share whose network speaks positions: a clip to its body and frame rate, and back."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy
from scipy import ndimage

from interpose.clip import Clip
from interpose.geometry import rotations
from interpose.geometry.time import ease, grid, sample, sample_smooth
from interpose.methods import weights
from interpose.methods.bodies import no_humanoid, observed_body
from interpose.methods.classical import Spline
from interpose.methods.protocol import Raw
from interpose.observation import Gap, Observation
from interpose.skeletons import Humanoid, Mapping, find_mapping
from interpose.skeletons.body import facing

# Seconds (standard deviation) over which positions are smoothed inside of gaps: from frame to frame, of 30 in
# a second, the autoencoder trembles by half as much again as real motion. Measured on validation performers:
# peaks of acceleration are halved, and the error falls by 1 to 2 %.
SMOOTH = 1 / 30

# Frames a second of a network from which on a clip goes evenly from one to the next. What is known between
# the frames of a coarser one is kept, so that it is left and met as it was going.
COARSE = 15.0
APART = 1.5  # of its steps lie between the last known frame and the first that it says

# A network: canonical positions (T, 22, 3) at its frame rate and which are known (T, 22), to positions three
# times: its own poses in the body's frame, the same on its own trajectory, and settled into what is known.
Network = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray]]


def refuses(clip: Clip, gap: Gap, card: weights.Card) -> str | None:
    """Why not: a skeleton that is no humanoid, joints that positions do not tell, a gap too long."""
    mapping = find_mapping(clip.skeleton)
    if reason := no_humanoid(mapping):
        return reason
    if gap.joints is not None and not _moves(mapping, gap.joints):
        return "no joint that the network knows hangs below these, so positions do not tell their rotation"
    if gap.joints is not None and len(gap) == len(clip) and _floats(mapping, gap.joints):
        return "both feet are lost all the time, so nothing tells it where the floor is"
    length = card.frames(len(gap), clip.fps)
    if gap.joints is None and length > card.max_gap:
        at = f"{length:.0f} frames at {card.fps:g} fps"
        return f"{at} are more than the {card.max_gap} it can fill: give keys inside of them"
    return None


def _moves(mapping: Mapping, names: tuple[str, ...]) -> bool:
    """Whether any mapped joint lies below one of these joints, or a root is among them."""
    skeleton = mapping.skeleton
    lost = {skeleton.index(name) for name in names}
    below = {parent for joint in mapping.joints if joint is not None for parent in skeleton.ancestors(joint)}
    return bool(lost & below)


def _floats(mapping: Mapping, names: tuple[str, ...]) -> bool:
    """Whether all joints of the feet lie below one of these joints."""
    skeleton = mapping.skeleton
    lost = {skeleton.index(name) for name in names}
    feet = [mapping[side + part] for side in ("Left", "Right") for part in ("Foot", "Toe")]
    return all(lost & set(skeleton.ancestors(joint)) for joint in feet if joint is not None)


def handover(seen: np.ndarray, frames: int) -> np.ndarray:
    """(T, 22) the network's share in what is said: 0 at observed values, 1 from `frames` on."""
    if frames == 0:
        return 1.0 - seen
    frame = np.arange(len(seen))[:, None]
    last = np.maximum.accumulate(np.where(seen, frame, -frames), axis=0)
    first = np.minimum.accumulate(np.where(seen, frame, len(seen) + frames)[::-1], axis=0)[::-1]
    x = np.clip(np.minimum(frame - last, first - frame) / frames, 0.0, 1.0)
    return ease(x)


def speak(clip: Clip, observation: Observation, card: weights.Card, network: Network, over: int) -> Raw:
    """Positions of the mapped joints at every frame, beside a spline for what positions cannot tell.

    Args:
        clip: whose unobserved values carry no information.
        card: of the network's weights, with its frame rate.
        over: frames at that rate from what is observed on in which the spline hands over to the network.
    """
    body = observed_body(clip, observation)
    base = Spline().complete(clip, observation).clip
    known = body.observed(observation.positions(clip.skeleton), observation.rotation)
    positions = body.as_canonical(clip)
    coarse, step = card.fps < COARSE, clip.fps / card.fps
    # A coarse one says one frame more where the clip ends between two of its own.
    even = np.round(np.arange(0, len(clip) - 1 + step, step), 9)
    times = even if coarse else grid(known, step)
    before, after = (np.minimum(of(times).astype(int), len(clip) - 1) for of in (np.floor, np.ceil))
    seen = known[before] & known[after] & (times < len(clip))[:, None]
    poses, raw, completed = network(sample(positions, times), seen)
    calm = ndimage.gaussian_filter1d(completed, SMOOTH * card.fps, axis=0, mode="nearest")
    completed = np.where(seen[..., None], completed, calm)
    drift = _drift(observation, raw, completed, times, body)
    # Past the last frame of the network's nothing is known of it: that frame is held.
    back = np.interp(np.arange(len(clip)), times, np.arange(len(times)))
    like = body.rotations(base)
    ahead = rotations.about("Y", -facing(body.as_canonical(base)))[:, None]
    if coarse:
        placed, share = weave(completed, times, positions, known), 1.0 - known[..., None]
    else:
        placed, share = sample_smooth(completed, back), sample(handover(seen, over)[..., None], back)
    spoken = body.from_canonical(placed, like)
    spoken = share * spoken + (1 - share) * body.positions(base) * body.hand
    own = body.from_canonical(sample_smooth(poses, back), rotations.multiply(ahead, like))
    rows, joints = body.mapping.mapped
    notes = {**weights.told(card), "drift": drift}
    return Raw(base, spoken[:, rows], joints, notes, own[:, rows])


def weave(said: np.ndarray, times: np.ndarray, positions: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Positions (F, 22, 3) that go smoothly through what is `known` (F, 22) of `positions`, and through what
    is `said` (T, 22, 3) at `times` (T) in frames, where that is far enough from known frames.
    """
    frames, step, done = np.arange(len(known)), np.diff(times[:2]).sum(), positions.copy()
    nearest = np.minimum(np.round(times).astype(int), len(known) - 1)
    patterns, which = np.unique(known, axis=1, return_inverse=True)
    for number, held in enumerate(patterns.T):
        if held.all():
            continue
        joints, lost = np.flatnonzero(which.ravel() == number), np.logical_not(held)
        away = ndimage.distance_transform_edt(lost) if held.any() else np.full(len(held), np.inf)
        free = away[nearest] >= APART * step
        at = np.concatenate([frames[held], times[free]])
        order = np.argsort(at)
        values = np.concatenate([positions[held][:, joints], said[free][:, joints]])[order]
        if len(at) == 1:
            done[:, joints] = values
            continue
        curve = scipy.interpolate.CubicSpline(at[order], values)
        done[:, joints] = curve(np.clip(frames, at.min(), at.max()))
    return done


def _drift(
    observation: Observation, raw: np.ndarray, completed: np.ndarray, times: np.ndarray, body: Humanoid
) -> dict[str, float]:
    """Metres by which the root had drifted at most in each gap, before it was corrected."""
    off = np.linalg.norm((raw - completed)[:, 0], axis=-1) / body.scale
    drift = {}
    for gap in observation.gaps(body.mapping.skeleton):
        inside = (times >= gap.start) & (times < gap.stop)
        if gap.joints is None and inside.any():
            drift[f"{gap.start}:{gap.stop}"] = float(off[inside].max())
    return drift
