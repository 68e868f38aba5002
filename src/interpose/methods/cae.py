"""The convolutional autoencoder (Kaufmann et al. 2020) as a method: from a clip to the graph and back."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy import ndimage

from interpose.clip import Clip
from interpose.geometry import rotations
from interpose.geometry.time import sample, sample_smooth
from interpose.methods import weights
from interpose.methods.bodies import no_humanoid, observed_body
from interpose.methods.classical import Spline
from interpose.methods.protocol import Raw
from interpose.observation import Gap, Observation
from interpose.skeletons import Humanoid, Mapping, find_mapping
from interpose.skeletons.body import facing

# Frames that the network was trained on. It learns where in its window it is, so it gets no other length:
# with 128 frames it does a quarter worse.
LENGTH = 120
STEP = 60  # frames between the windows that cover what is missing for longer
# Frames (standard deviation) over which positions are smoothed inside of gaps: frame by frame the network
# trembles by half as much again as real motion. Measured on validation performers: peaks of acceleration are
# halved, and the error falls by 1 to 2 %.
SMOOTH = 1.0
# Frames from what is observed over which the spline hands over to the network: next to observed frames it is
# the better of the two. Measured on validation performers, finished, for gaps of 15, 30 and 60 frames, in cm:
# LAFAN1 3.67, 7.69, 13.54 become 3.35, 7.37, 13.34, HDM05 2.40, 7.39, 12.01 become 1.67, 7.03, 11.77.
HANDOVER = 12
LONGEST = 90  # frames, the longest run that one window holds with enough of the motion around it


def run(path: Path, positions: np.ndarray, observed: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Run the graph on (B, T, 22, 3) metres of a canonical leg at 30 fps and (B, T, 22) booleans, any T.

    Returns:
        Positions (B, T, 22, 3) float64: the network's own poses in the body's frame, the same on its own
        trajectory, and settled into what is observed.
    """
    # Far from the origin float32 would lose millimetres: the graph sees the body near it.
    origin = np.zeros((len(positions), 1, 1, 3))
    for i, known in enumerate(observed[..., 0]):
        origin[i, 0, 0, [0, 2]] = positions[i, np.argmax(known), 0, [0, 2]]
    feed = {
        "positions": (positions - origin).astype(np.float32),
        "observed": np.ascontiguousarray(observed),
    }
    body, raw, completed = (out.astype(float) for out in weights.session(path).run(None, feed))
    return body, raw + origin, completed + origin


def starts(complete: np.ndarray) -> np.ndarray:
    """First frames of the windows for a motion of which frames (T,) are complete.

    One around the middle of every incomplete run; several, evenly spread, for a long one.
    """
    last = max(len(complete) - LENGTH, 0)
    edges = np.flatnonzero(np.diff(np.concatenate([[True], complete, [True]]).astype(int)))
    chosen: set[int] = set()
    for start, stop in edges.reshape(-1, 2):
        count = 1 if stop - start <= LONGEST else 1 + -(-(stop - start - LONGEST) // STEP)
        middles = np.linspace(start, stop, 2 * count + 1)[1::2]
        chosen |= {int(np.clip(round(middle - LENGTH / 2), 0, last)) for middle in middles}
    return np.array(sorted(chosen), int)


def run_long(
    path: Path, positions: np.ndarray, observed: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """`run` on one motion (T, 22, 3) of any length, in windows of the length that the network knows.

    Where windows overlap they are blended, each fading towards its ends. A short motion repeats its last
    pose, as in training. Frames that no window holds come back as they are; a complete motion is
    reconstructed as a whole.
    """
    length = len(positions)
    complete = observed.all(axis=1)
    first = starts(np.logical_and(complete, not complete.all()))
    inside = first[:, None] + np.arange(LENGTH)
    frames = np.minimum(inside, length - 1)
    outputs = run(path, positions[frames], observed[frames])
    weight = np.minimum(np.arange(1, LENGTH + 1), np.arange(LENGTH, 0, -1)) ** 3.0
    sums = [np.zeros((length, *positions.shape[1:])) for _ in outputs]
    total = np.zeros(length)
    for i, real in enumerate(inside < length):
        total[inside[i, real]] += weight[real]
        for whole, out in zip(sums, outputs):
            whole[inside[i, real]] += weight[real, None, None] * out[i, real]
    held = total > 0
    body, raw, completed = (
        np.where(held[:, None, None], whole / np.where(held, total, 1.0)[:, None, None], positions)
        for whole in sums
    )
    return body, raw, completed


def handover(seen: np.ndarray) -> np.ndarray:
    """(T, 22) the network's share in what is said: 0 at observed values, 1 from HANDOVER frames on."""
    frames = np.arange(len(seen))[:, None]
    last = np.maximum.accumulate(np.where(seen, frames, -HANDOVER), axis=0)
    first = np.minimum.accumulate(np.where(seen, frames, len(seen) + HANDOVER)[::-1], axis=0)[::-1]
    x = np.clip(np.minimum(frames - last, first - frames) / HANDOVER, 0.0, 1.0)
    return x * x * (3 - 2 * x)


@dataclass(frozen=True)
class Cae:
    """Fills gaps of whole poses and recovers joints; thinks at 30 fps on 22 joints scaled to one leg.

    Attributes:
        trained: the weights; the installed ones without any.
    """

    trained: weights.Card | None = None
    name = "cae"

    @property
    def card(self) -> weights.Card:
        return self.trained or weights.find(self.name)

    def refuses(self, clip: Clip, gap: Gap) -> str | None:
        """Why not: a skeleton that is no humanoid, or a gap beyond what the network was trained for."""
        mapping = find_mapping(clip.skeleton)
        if reason := no_humanoid(mapping):
            return reason
        if gap.joints is not None and not self._moves(mapping, gap.joints):
            return (
                "no joint that the network knows hangs below these, so positions do not tell their rotation"
            )
        if gap.joints is not None and len(gap) == len(clip) and self._floats(mapping, gap.joints):
            return "both feet are lost all the time, so nothing tells it where the floor is"
        length = len(gap) * self.card.fps / clip.fps
        if gap.joints is None and length > self.card.max_gap:
            at = f"{length:.0f} frames at {self.card.fps:g} fps"
            return f"{at} are more than the {self.card.max_gap} it can fill"
        return None

    @staticmethod
    def _moves(mapping: Mapping, names: tuple[str, ...]) -> bool:
        """Whether any mapped joint lies below one of these joints, or a root is among them."""
        skeleton = mapping.skeleton
        lost = {skeleton.index(name) for name in names}
        below = {
            parent for joint in mapping.joints if joint is not None for parent in skeleton.ancestors(joint)
        }
        return bool(lost & below)

    @staticmethod
    def _floats(mapping: Mapping, names: tuple[str, ...]) -> bool:
        """Whether all joints of the feet lie below one of these joints."""
        skeleton = mapping.skeleton
        lost = {skeleton.index(name) for name in names}
        feet = [mapping[side + part] for side in ("Left", "Right") for part in ("Foot", "Toe")]
        return all(lost & set(skeleton.ancestors(joint)) for joint in feet if joint is not None)

    def complete(self, clip: Clip, observation: Observation, seed: int | None = None) -> Raw:
        """Positions of the mapped joints at every frame, beside a spline for what positions cannot tell."""
        card, body = self.card, observed_body(clip, observation)
        base = Spline().complete(clip, observation).clip
        known = body.observed(observation.positions(clip.skeleton), observation.rotation)
        positions = body.as_canonical(clip)
        times = np.round(np.arange(0, len(clip) - 0.5, clip.fps / card.fps), 9)
        before = np.floor(times).astype(int)
        after = np.minimum(np.ceil(times).astype(int), len(clip) - 1)
        seen = known[before] & known[after]
        poses, raw, completed = run_long(card.onnx, sample(positions, times), seen)
        calm = ndimage.gaussian_filter1d(completed, SMOOTH, axis=0, mode="nearest")
        completed = np.where(seen[..., None], completed, calm)
        drift = self._drift(observation, raw, completed, times, body)
        # Past the last thirtieth of a second nothing is known of the network: its last frame is held.
        back = np.minimum(np.arange(len(clip)) * card.fps / clip.fps, len(times) - 1)
        like = body.rotations(base)
        ahead = rotations.about("Y", -facing(body.as_canonical(base)))[:, None]
        spoken = body.from_canonical(sample_smooth(completed, back), like)
        share = sample(handover(seen)[..., None], back)
        spoken = share * spoken + (1 - share) * body.positions(base) * body.hand
        own = body.from_canonical(sample_smooth(poses, back), rotations.multiply(ahead, like))
        rows, joints = body.mapping.mapped
        notes = {"model": card.name, "drift": drift}
        return Raw(base, spoken[:, rows], joints, notes, own[:, rows])

    def _drift(
        self,
        observation: Observation,
        raw: np.ndarray,
        completed: np.ndarray,
        times: np.ndarray,
        body: Humanoid,
    ) -> dict[str, float]:
        """Metres by which the root had drifted at the end of each gap, before it was corrected."""
        off = np.linalg.norm((raw - completed)[:, 0], axis=-1) / body.scale
        drift = {}
        for gap in observation.gaps(body.mapping.skeleton):
            inside = (times >= gap.start) & (times < gap.stop)
            if gap.joints is None and inside.any():
                drift[f"{gap.start}:{gap.stop}"] = float(off[inside].max())
        return drift
