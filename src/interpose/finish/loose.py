"""Joints that are known while the body they hang on is not: an arm of another take inside a gap.

Networks are told where joints are, and of such an arm nobody knows where it is. So the body is completed
first, and the joints are laid on it: what they differ by is known where they are known, nothing outside of
the gap, and a spline in between. (Kaufmann et al. 2020, figure 7, blend this way.) Where most of a pose is
known so, its hips are turned to where the completed body's joints are.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from interpose.clip import Clip
from interpose.geometry import rotations
from interpose.methods.classical import Spline
from interpose.methods.protocol import Raw
from interpose.observation import Gap, Observation, Pin
from interpose.skeletons.carrier import hips_of


def loose(clip: Clip, observation: Observation) -> np.ndarray:
    """(F, J) True for rotations that are known in frames in which that of their root is not, or that of the
    hips that they hang from."""
    skeleton = clip.skeleton
    found, tops = np.zeros_like(observation.rotation), {*skeleton.roots, hips_of(skeleton)}
    for joint in range(len(skeleton)):
        if above := [top for top in skeleton.ancestors(joint) if top in tops]:
            found[:, joint] = observation.rotation[:, joint] & ~observation.rotation[:, above].all(axis=1)
    return found


def without(observation: Observation, some: np.ndarray) -> Observation:
    """The observation with some rotations (F, J) unknown."""
    return replace(observation, rotation=observation.rotation & ~some)


# A share of all joints: so many laid on a body are most of it.
MOST = 0.5


@dataclass
class Layer:
    """A finished completion of the body as a method, with the loose joints (F, J) laid on it.

    `stands`: its feet have been held already, and it has not been moved since. `pins` are met once more when
    its seams have been eased.
    """

    name: str
    body: Clip
    raw: Raw
    joints: np.ndarray
    stands: bool = True
    pins: tuple[Pin, ...] = ()

    def refuses(self, clip: Clip, gap: Gap) -> str | None:
        """Never: the body is there already."""
        return None

    def complete(self, clip: Clip, observation: Observation, seed: int | None = None) -> Raw:
        """The body with the joints on it."""
        off = rotations.relative(self.body.rotation, clip.rotation)
        off = np.where(self.joints[..., None], off, [1.0, 0.0, 0.0, 0.0])
        # Nothing is to be added where the whole pose is known, nor to joints that are never loose.
        known = self.joints | observation.frames[:, None] | ~self.joints.any(axis=0)
        change = Spline().complete(
            clip.with_motion(off, np.zeros_like(clip.translation)), Observation(known, np.ones_like(known))
        )
        rotation = rotations.multiply(self.body.rotation, change.clip.rotation)
        own = self.body.with_motion(rotation, self.body.translation)
        if self.joints.any(axis=0).mean() > MOST:
            own = _turned(own, self.body, observation.rotation)
        return Raw(own, notes=self.raw.notes, stands=self.raw.stands, expected=self.raw.expected)


def _turned(own: Clip, body: Clip, known: np.ndarray) -> Clip:
    """The clip with its hips turned, where they are not `known` (F, J), so that joints are nearest to those
    of the body: of a pose that is known but for which way it faces the body has a pose of its own."""
    skeleton, hips, rotation = own.skeleton, hips_of(own.skeleton), own.rotation.copy()
    frames, below = np.flatnonzero(~known[:, hips]), np.flatnonzero(skeleton.below[:, hips])
    (turned, places), wanted = own.kinematics(), body.positions()
    vectors, there = (some[frames][:, below] - some[frames][:, [hips]] for some in (places, wanted))
    facing = rotations.multiply(rotations.fit(vectors, there), turned[frames, hips])
    if (parent := skeleton.parents[hips]) >= 0:
        facing = rotations.relative(turned[frames, parent], facing)
    rotation[frames, hips] = facing
    return own.with_motion(rotation, own.translation)
