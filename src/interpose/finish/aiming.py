"""Thighs that are lost while the knee below them is known.

The bend of a knee tells how far the foot is from the hip, and nothing else. A network that is told of it
thinks of the thigh alone, at whose end a whole leg hangs: in 36 windows of LAFAN1's validation performer
ankles are off by 10.9 cm where thighs are lost for 2.3 s, and by 9.1 where it is not told and says the whole
leg. So the whole leg is completed, and the thigh of what is known is aimed at the ankle of that: 7.6 cm.
"""

from __future__ import annotations

import numpy as np

from interpose.clip import Clip
from interpose.finish.feet import legs
from interpose.geometry import rotations
from interpose.observation import Observation


def severed(clip: Clip, known: Observation) -> np.ndarray:
    """(F, J) True for known rotations of a leg, but for its toe's, in frames in which its thigh is lost and
    its knee is known."""
    found = np.zeros_like(known.rotation)
    for leg in legs(clip.skeleton):
        alone = known.rotation[:, leg.knee] & ~known.rotation[:, leg.thigh]
        chain = [leg.knee, leg.ankle]
        found[:, chain] = known.rotation[:, chain] & alone[:, None]
    return found


def aimed(body: Clip, clip: Clip, parts: np.ndarray) -> Clip:
    """The body with what is known of its legs, `parts` (F, J) of `clip` as `severed` says, and their thighs
    turned so that ankles are where they point to in the body."""
    rotation = np.where(parts[..., None], clip.rotation, body.rotation)
    (turned, wanted), placed = body.kinematics(), body.with_motion(rotation, body.translation).positions()
    for leg in legs(body.skeleton):
        frames = np.flatnonzero(parts[:, leg.knee])
        own, goal = (places[frames, leg.ankle] - places[frames, leg.thigh] for places in (placed, wanted))
        thigh = rotations.multiply(rotations.between(own, goal), turned[frames, leg.thigh])
        above = turned[frames, body.skeleton.parents[leg.thigh]]
        rotation[frames, leg.thigh] = rotations.relative(above, thigh)
    return body.with_motion(rotation, body.translation)
