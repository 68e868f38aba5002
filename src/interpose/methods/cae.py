"""The convolutional autoencoder (Kaufmann et al. 2020) as a method: from a clip to the graph and back."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from interpose.clip import Clip
from interpose.geometry.time import runs
from interpose.methods import positional, weights
from interpose.methods.protocol import Raw
from interpose.observation import Gap, Observation

# Frames that the network was trained on. It learns where in its window it is, so it gets no other length:
# with 128 frames it does a quarter worse.
LENGTH = 120
WINDOWS = 16  # at a time: what a long motion needs beside its own values stays small
STEP = 60  # frames between the windows that cover what is missing for longer
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
    chosen: set[int] = set()
    for start, stop in runs(~complete):
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
    blocks = [frames[at : at + WINDOWS] for at in range(0, len(frames), WINDOWS)]
    outputs = [np.concatenate(some) for some in zip(*(run(path, positions[b], observed[b]) for b in blocks))]
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


@dataclass(frozen=True)
class Cae:
    """Fills gaps of whole poses and recovers joints; thinks at 30 fps on 22 joints scaled to one leg.

    Attributes:
        trained: the weights; the installed ones without any.
        name: of the method, or of the folder with the weights.
    """

    trained: weights.Card | None = None
    name: str = "cae"

    @property
    def card(self) -> weights.Card:
        return weights.of(self.name, self.trained)

    def refuses(self, clip: Clip, gap: Gap) -> str | None:
        """Why not: a skeleton that is no humanoid, or a gap beyond what the network was trained for."""
        return positional.refuses(clip, gap, self.card)

    def complete(self, clip: Clip, observation: Observation, seed: int | None = None) -> Raw:
        """Positions of the mapped joints at every frame, beside a spline for what positions cannot tell."""
        network = partial(run_long, self.card.onnx)
        return positional.speak(clip, observation, self.card, network, HANDOVER)
