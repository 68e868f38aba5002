"""The protocol of a method, and what it returns.

A method sees a clip in which unobserved values are already wiped (replaced by the linear completion), so
that nothing can leak, and returns its raw completion. `finish.complete` then enforces the guarantees.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Protocol, runtime_checkable

import numpy as np

from interpose.clip import Clip
from interpose.methods.weights import Card
from interpose.observation import Gap, Observation


@dataclass(frozen=True)
class Raw:
    """What a method itself says, before the guarantees are enforced.

    Attributes:
        clip: the completion on the clip's own skeleton.
        positions: (F, n, 3) global joint positions for methods that speak positions, of the n joints in
            `joints`; None for methods that speak rotations.
        joints: indices of the joints that `positions` speaks of: given with them.
        notes: what a report should say (drift of the root trajectory, model, ...).
        own: (F, J, 3) a network's own poses in the body's frame (hips over the origin, facing along Z),
            before they are settled into what is observed: the papers' tables lay them on the true way.
        stands: (F, 4) how likely left ankle, left toe, right ankle and right toe stand, 0 to 1, for methods
            that say so; NaN at frames of which they do not.
        expected: (F,) metres that joints are expected to be off in the mean; NaN likewise.
    """

    clip: Clip
    positions: np.ndarray | None = field(default=None, repr=False)
    joints: tuple[int, ...] = ()
    notes: dict[str, Any] = field(default_factory=dict)
    own: np.ndarray | None = field(default=None, repr=False)
    stands: np.ndarray | None = field(default=None, repr=False)
    expected: np.ndarray | None = field(default=None, repr=False)


class Method(Protocol):
    """Something that completes a clip."""

    @property
    def name(self) -> str: ...

    def refuses(self, clip: Clip, gap: Gap) -> str | None:
        """Why this method cannot fill this gap of this clip, or None if it can."""

    def complete(self, clip: Clip, observation: Observation, seed: int | None = None) -> Raw:
        """Complete the clip: all values, at every frame. Unobserved values of `clip` carry no information."""


@runtime_checkable
class Actor(Method, Protocol):
    """A method that can be told what the motion is.

    Attributes:
        action: what it has been told; "" for nothing.
        card: of its weights, with the labels that it knows.
    """

    action: str

    @property
    def card(self) -> Card: ...

    def for_action(self, action: str) -> Method:
        """The same method, told another action. Raises RequestError for one that it does not know."""


@runtime_checkable
class Sampler(Method, Protocol):
    """A method that has many answers, and draws one of them by a seed."""

    def at(self, temperature: float) -> Method:
        """The same method, its answers more or less apart; 1 is what it was trained with."""
