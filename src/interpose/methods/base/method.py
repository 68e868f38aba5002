"""Whatever of a pose is missing, by interpose's own networks, on the user's skeleton and back."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from interpose.clip import Clip
from interpose.errors import RequestError, unknown
from interpose.geometry import kinematics, rotations
from interpose.geometry.time import grid, sample, sample_rotations, sample_rotations_smooth, sample_smooth
from interpose.methods import repeating, weights
from interpose.methods.base.graph import Seen
from interpose.methods.base.holes import run_long
from interpose.methods.base.observed import COLUMNS, faces, knowledge, pinned, through, way
from interpose.methods.bodies import no_humanoid, observed_body, on_the_floor
from interpose.methods.classical import Spline
from interpose.methods.joining import joined
from interpose.methods.protocol import Raw
from interpose.observation import Gap, Observation
from interpose.skeletons import FEET, PARENTS, find_mapping
from interpose.skeletons.mirror import mirrored
from interpose.skeletons.performers import by_itself, performers


@dataclass(frozen=True)
class Base:
    """Completes poses by what it has seen; thinks at 30 fps on 22 joints scaled to one leg.

    Attributes:
        name: of the weights: base, small, small-open, or the folder they lie in.
        action: a label of its card; "" leaves it open.
        trained: the weights; the installed ones without any.
        beside: the name of installed weights that are asked, too, unless others were trained: the mean of
            what both say counts, to the share BESIDE.
    """

    name: str = "base"
    action: str = ""
    trained: weights.Card | None = None
    beside: str = ""

    @property
    def card(self) -> weights.Card:
        return weights.of(self.name, self.trained)

    @property
    def asked(self) -> list[weights.Card]:
        """All weights that are asked, its own first; alone where the others are not installed."""
        asked = [self.card]
        if self.beside and not self.trained:
            with suppress(RequestError):
                asked.append(weights.find(self.beside))
        return asked

    def for_action(self, action: str) -> Base:
        """The same method, told what the motion is. RequestError lists the actions for an unknown one."""
        labels = [label for label in self.card.labels if label]
        if not labels:
            raise RequestError(
                f"cannot make it {action} with {self.name}", f"{self.name} knows no actions", "Leave it out."
            )
        if action not in labels:
            raise unknown("action", action, labels)
        return replace(self, action=action)

    def refuses(self, clip: Clip, gap: Gap) -> str | None:
        """Why not: no humanoid, or joints that it does not know."""
        mapping = find_mapping(clip.skeleton)
        if reason := no_humanoid(mapping):
            return reason
        if gap.joints is not None:
            bodies = [
                clip.skeleton,
                *(by_itself(clip.skeleton, one) for one in performers(clip.skeleton)[1:]),
            ]
            known = {body.names[joint] for body in bodies for joint in find_mapping(body).mapped[1]}
            return None if known & {*gap.joints} else "it knows none of these joints"
        return None

    @on_the_floor
    def complete(self, clip: Clip, observation: Observation, seed: int | None = None) -> Raw:
        """Rotations of the mapped joints and the way of the hips; a spline for all else."""
        cards, body = self.asked, observed_body(clip, observation)
        card = cards[0]
        base = Spline().complete(clip, observation).clip
        turned, root, bones = body.rotations(base), body.root(base) * body.scale, body.bones * body.scale
        known = knowledge(observation, body.mapping)
        times = grid(known, clip.fps / card.fps)
        before = np.floor(times).astype(int)
        after = np.minimum(np.ceil(times).astype(int), len(clip) - 1)
        local = kinematics.local_rotations(turned, PARENTS)
        across = card.labels[mirrored(card.labels)[card.labels.index(self.action)]] if self.action else ""
        seen = Seen(
            sample_rotations(local, times),
            sample(root, times),
            known[before] & known[after],
            np.isin(np.arange(COLUMNS), [*body.mapping.mapped[0], COLUMNS - 1]),
            (self.action, across),
            bones,
            *pinned(observation, body.mapping, times, body.scale * body.hand),
            way(observation, body.mapping, times, body.scale * body.hand),
            faces(observation, body, base, times),
        )
        answer = run_long(cards, seen)
        said = repeating.Motion(answer.local, answer.root)
        held = repeating.Motion(seen.local, seen.root)
        told = seen.known[:, seen.has]
        told[seen.pins.any(axis=1), 0] = True  # where it is to be there is more to it than that
        on, periods = repeating.carried_on(held, told, said, bones)
        answer.local, answer.root = on.local, on.root
        changes = np.flatnonzero((seen.known[1:] != seen.known[:-1]).any(axis=1)) + 1
        answer.local = joined(answer.local, seen.known[:, :-1], changes, card.fps)
        answer.root = joined(answer.root[:, None], seen.known[:, -1:], changes, card.fps)[:, 0]
        said = kinematics.global_rotations(answer.local, PARENTS)
        missing = ~known.all(axis=1)
        back = np.interp(through(observation, known[:, -1], clip.fps)[missing], times, np.arange(len(times)))
        # What is known of a frame is exactly so; only what is not is the network's.
        turns = rotations.normalize(sample_rotations_smooth(rotations.continuous(said), back))
        own = kinematics.local_rotations(turns, PARENTS)
        local[missing] = np.where(known[missing, : len(PARENTS), None], local[missing], own)
        root[missing] = np.where(known[missing, -1:], root[missing], sample_smooth(answer.root, back))
        done = body.to_clip(kinematics.global_rotations(local, PARENTS), root / body.scale, base)
        stands, expected = np.full((len(clip), len(FEET)), np.nan), np.full(len(clip), np.nan)
        stands[missing] = sample(answer.stands, back)
        expected[missing] = sample(answer.expected[:, None], back)[:, 0] / body.scale
        remarks = {}
        for gap in observation.gaps(clip.skeleton):
            for (start, stop), (what, period) in periods.items():
                if times[start] <= (gap.start + gap.stop - 1) / 2 <= times[stop - 1]:
                    every = f"{period / card.fps:.1f} s"
                    remarks[f"{gap.start}:{gap.stop}"] = [f"{what} every {every} goes on in it"]
        notes = {**weights.told(*cards), "remarks": remarks}
        return Raw(done, notes=notes, stands=stands, expected=expected)


def base() -> Base:
    """The larger one, and `small` beside it: they err differently, and their mean less than either."""
    return Base("base", beside="small")


def small() -> Base:
    """The one that is small enough for everywhere."""
    return Base("small")


def small_open() -> Base:
    """The same network, of weights for any use."""
    return Base("small-open")
