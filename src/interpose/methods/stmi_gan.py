"""STMI-GAN (Hernandez Ruiz et al. 2019) as a method: forecasts, gaps, and joints that are lost."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from interpose.clip import Clip
from interpose.geometry.ground import turn
from interpose.geometry.time import runs
from interpose.methods import positional, weights
from interpose.methods.bodies import on_the_floor
from interpose.methods.protocol import Raw
from interpose.observation import Gap, Observation
from interpose.skeletons import ACROSS, SIDES
from interpose.skeletons.body import facing

# A run of missing frames up to this share of a window is seen from both its ends at once.
SHORT = 0.75


@dataclass(frozen=True)
class StmiGan:
    """Completes what is missing by what it has seen; thinks at its card's rate on 22 joints of one leg.

    Attributes:
        trained: the weights; the installed ones without any.
        temperature: how much noise is injected, as a share of what it was trained with; without a seed none.
        name: of the weights: stmi-gan, the paper's network, or stmi-gan-dense.
    """

    trained: weights.Card | None = None
    temperature: float = 1.0
    name: str = "stmi-gan"

    @property
    def card(self) -> weights.Card:
        return weights.of(self.name, self.trained)

    def at(self, temperature: float) -> StmiGan:
        """The same with more or less noise."""
        return replace(self, temperature=temperature)

    def refuses(self, clip: Clip, gap: Gap) -> str | None:
        """Why not: a skeleton that is no humanoid, or what it was not trained for: as in its paper, that is
        gaps between poses, and going on from little motion."""
        paper, half = self.card.training["config"] == "paper", self.card.training["network"]["frames"] // 2
        if gap.joints is None and gap.stop == len(clip):
            # Two seconds are as many frames, whatever the last digits of the file's frame time are.
            if paper and round(gap.start * self.card.fps / clip.fps) < half:
                return f"it goes on from {half / self.card.fps:g} seconds of motion, and here is less"
            gap = Gap(gap.start, gap.start + 1)  # a forecast goes on as long as it is asked to
        elif gap.joints is None and paper:
            return "it was trained on forecasts and on lost joints, not on gaps between poses"
        return positional.refuses(clip, gap, self.card)

    @on_the_floor
    def complete(self, clip: Clip, observation: Observation, seed: int | None = None) -> Raw:
        """Positions of the mapped joints at every frame, beside a spline for what positions cannot tell."""
        rng = None if seed is None else np.random.default_rng(seed)

        def network(positions: np.ndarray, seen: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
            return run_long(self.card, positions, seen, rng, self.temperature)

        return positional.speak(clip, observation, self.card, network, 0)


def dense() -> StmiGan:
    """The one of 30 frames a second, which fills gaps, too."""
    return StmiGan(name="stmi-gan-dense")


def run(
    card: weights.Card,
    positions: np.ndarray,
    observed: np.ndarray,
    rng: np.random.Generator | None = None,
    temperature: float = 1.0,
) -> tuple[np.ndarray, np.ndarray]:
    """Run the graph on windows (B, T, 22, 3) in metres of a canonical leg and (B, T, 22, 3) booleans.

    T is the network's own length. Without `rng` no noise is injected.

    Returns:
        (B, T, 22, 3) float64: the network's own motion, and the same settled into what is observed.
    """
    session = weights.session(card.onnx)
    shape = (len(positions), *session.get_inputs()[2].shape[1:])
    noise = np.zeros(shape) if rng is None else temperature * rng.standard_normal(shape)
    # Far from the origin float32 would lose millimetres: the graph sees the body near it.
    known = np.where(observed, positions, 0.0)
    origin = known.sum(axis=(1, 2)) / np.maximum(observed.sum(axis=(1, 2)), 1)
    origin = origin[:, None, None] * [1.0, 0.0, 1.0]
    feed = {"positions": known - origin, "observed": observed, "noise": noise}
    feed = {name: value if value.dtype == bool else value.astype(np.float32) for name, value in feed.items()}
    raw, completed = (out.astype(float) + origin for out in session.run(None, feed))
    return raw, completed


def run_both(
    card: weights.Card,
    positions: np.ndarray,
    observed: np.ndarray,
    rng: np.random.Generator | None = None,
    temperature: float = 1.0,
) -> tuple[np.ndarray, np.ndarray]:
    """As `run`, in the mean with what it says of the mirror image: left and right are one task, and it errs
    less by 4 % where joints are lost. Not for forecasts, whose mean moves less than people do."""
    sides, across = list(SIDES), ACROSS.values
    image = run(card, positions[:, :, sides] * across, observed[:, :, sides], rng, temperature)
    plain = run(card, positions, observed, rng, temperature)
    raw, completed = (0.5 * (own + other[:, :, sides] * across) for own, other in zip(plain, image))
    return raw, completed


def run_long(
    card: weights.Card,
    positions: np.ndarray,
    seen: np.ndarray,
    rng: np.random.Generator | None,
    temperature: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The network's poses in the body's frame, its own motion, and the same settled, of one motion.

    Runs of incomplete frames are completed from the front to the back. A short one stands in the middle of a
    window; of a long one each window completes as much as half of it, which is taken as known from then on.

    Args:
        positions: (T, 22, 3).
        seen: (T, 22) whether each is known.
    """
    length = card.training["network"]["frames"]
    raw, known, held = positions.copy(), seen.copy(), np.where(seen[..., None], positions, 0.0)
    for begin, end in runs(np.logical_not(seen.all(axis=1))):
        while begin < end:
            short = end - begin <= SHORT * length and end < len(held)
            start = min((begin + end - length) // 2, len(held) - length) if short else begin - length // 2
            start = max(start, 0)
            inside = start + np.arange(length)
            index = np.minimum(inside, len(held) - 1)
            observed = known[index] & (inside < len(held))[:, None]
            values = observed[None, ..., None].repeat(3, axis=-1)
            complete = run_both if seen[begin:end].any(axis=1).all() else run
            own, completed = complete(card, held[index][None], values, rng, temperature)
            stop = min(end if short else begin + length // 2, end, start + length)
            part, said = slice(begin, stop), slice(begin - start, stop - start)
            raw[part], held[part], known[part] = own[0, said], completed[0, said], True
            begin = stop
    poses = turn(raw - raw[:, :1] * [1.0, 0.0, 1.0], -facing(raw)[:, None])
    return poses, raw, held
