"""What bench forecasting compares: motions of 2 s that are seen, and ways to go on with them for 4 s.

All at 30 fps on the canonical body, without a clip around them: forecasts as networks make them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from interpose.errors import FileError
from interpose.evaluation.windows import DATASETS, windows
from interpose.geometry.ground import turn
from interpose.methods import stmi_gan, weights
from interpose.methods.weights import Card
from interpose.skeletons.body import facing
from interpose.skeletons.humanoid import canonical_positions

FPS, SEEN, AHEAD = 30, 60, 120  # frames a second, frames seen and frames ahead
BATCH = 64  # motions at once


@dataclass(frozen=True)
class Motions:
    """Motions on the canonical body at 30 fps.

    Attributes:
        positions: (N, T, 22, 3) metres.
        rotation: (N, T, 22, 4) canonical rotations.
        bones: (N, 22, 3) metres, in the T-pose.
        labels: (N,) what the data set calls the motion.
        datasets: (N,) whose motion it is.
    """

    positions: np.ndarray
    rotation: np.ndarray
    bones: np.ndarray
    labels: tuple[str, ...]
    datasets: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.positions)

    @property
    def seen(self) -> Motions:
        """What forecasters get: the first SEEN frames."""
        begin = self.positions[:, :SEEN], self.rotation[:, :SEEN]
        return Motions(*begin, self.bones, self.labels, self.datasets)


def read(
    data: Path, split: str, most: int | None = None, progress: Callable[[str], None] = lambda line: None
) -> Motions:
    """All windows of 6 s of a split, one after the other, or `most` of each data set.

    Raises RequestError where no clip is as long.
    """
    length = SEEN + AHEAD
    chosen = list(windows(data, DATASETS, split, length, length, most, progress))
    return Motions(
        np.array([window.body.as_canonical(window.clip) for window in chosen]),
        np.array([window.body.rotations(window.clip) for window in chosen]),
        np.array([window.body.body for window in chosen]),
        tuple(window.label for window in chosen),
        tuple(window.dataset for window in chosen),
    )


def thin(positions: np.ndarray, fps: float, rate: float) -> np.ndarray:
    """Motions (N, T, ...) at `fps` with `rate` frames a second: the last one of every 1 / rate seconds."""
    step = round(fps / rate)
    return positions[:, step - 1 :: step]


# From motions of SEEN frames and a seed to the positions (N, frames, 22, 3) of the next 4 s, in metres.
Forecaster = Callable[[Motions, int], np.ndarray]


def zero_velocity(seen: Motions, seed: int) -> np.ndarray:
    """The last pose stays."""
    return np.repeat(seen.positions[:, -1:], AHEAD, axis=1)


def mean_pose(known: Motions) -> Forecaster:
    """The mean pose of known motions stays, where the last pose is and facing as it does."""
    mean = upright(known.positions).mean(axis=(0, 1))

    def forecast(seen: Motions, seed: int) -> np.ndarray:
        last = seen.positions[:, -1:]
        turned = turn(np.broadcast_to(mean, last.shape), facing(last)[..., None])
        return np.repeat(turned + last[:, :, :1], AHEAD, axis=1)

    return forecast


def upright(positions: np.ndarray) -> np.ndarray:
    """Poses (..., 22, 3) alone: hips in the origin, facing along Z."""
    return turn(positions - positions[..., :1, :], -facing(positions)[..., None])


def seq2seq(card: Card) -> Forecaster:
    """Residual sequence-to-sequence (Martinez et al. 2017), told what the motion is.

    The network knows poses alone: where the body is and where it faces stay.
    """

    def forecast(seen: Motions, seed: int) -> np.ndarray:
        session = weights.session(card.onnx)
        label = np.array([card.labels.index(name) if name in card.labels else 0 for name in seen.labels])
        state = np.zeros((len(seen), session.get_inputs()[2].shape[1]), np.float32)
        poses = list(seen.rotation.astype(np.float32).swapaxes(0, 1))
        for frame in range(SEEN + AHEAD - 1):
            feed = {"rotation": poses[frame], "label": label, "state": state}
            following, state = session.run(None, feed)
            # While it reads, what it says comes next is not needed: that is known.
            if frame >= SEEN - 1:
                poses.append(following)
        turned = np.stack(poses[SEEN:], axis=1).astype(float)
        hips = np.repeat(seen.positions[:, -1:, 0], AHEAD, axis=1)
        return np.array([canonical_positions(*motion) for motion in zip(turned, hips, seen.bones)])

    return forecast


def inpainting(card: Card, settled: bool = False) -> Forecaster:
    """STMI-GAN, at the frame rate of its network: window by window, each going on from the one before. Its
    own motion, as in the paper, or `settled` into what was seen, which is how users get it."""

    def forecast(seen: Motions, seed: int) -> np.ndarray:
        frames, rng = card.training["network"]["frames"], np.random.default_rng(seed)
        known = frames // 2
        observed = np.broadcast_to(np.arange(frames)[:, None, None] < known, (BATCH, frames, 22, 3))
        motion = thin(seen.positions, FPS, card.fps)
        length = motion.shape[1] + round(card.fps * AHEAD / FPS)
        while motion.shape[1] < length:
            window = np.pad(motion[:, -known:], ((0, 0), (0, frames - known), (0, 0), (0, 0)))
            parts = (window[at : at + BATCH] for at in range(0, len(window), BATCH))
            made = [stmi_gan.run(card, part, observed[: len(part)], rng)[int(settled)] for part in parts]
            motion = np.concatenate([motion, np.concatenate(made)[:, known:]], axis=1)
        return motion[:, round(card.fps * SEEN / FPS) : length]

    return forecast


# By the method of a card.
TRAINED: dict[str, Callable[[Card], Forecaster]] = {"seq2seq": seq2seq, "stmi-gan": inpainting}


def installed() -> list[Card]:
    """The cards of the installed weights that can forecast."""
    return [card for card in weights.cards() if card.method in TRAINED and card.onnx.exists()]


def load(folders: Sequence[Path]) -> list[Card]:
    """The cards of weights that can forecast, in some folders. Raises FileError for one without any."""
    found = []
    for folder in folders:
        cards = [Card.load(path.with_suffix(".json")) for path in sorted(folder.glob("*.onnx"))]
        if not (known := [card for card in cards if card.method in TRAINED]):
            raise FileError(
                f"no weights that forecast in {folder}",
                f"it has no .onnx file with a card of {' or '.join(TRAINED)}",
                "Write them: interpose export stmi-gan --run RUN --out FOLDER.",
            )
        found += known
    return found
