"""Values of single joints that are lost for moments: interpolated one by one, whatever fills the rest."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from interpose.clip import Clip
from interpose.finish import Completion, Provenance
from interpose.finish.opinion import wipe
from interpose.finish.report import JointMoments
from interpose.geometry.time import runs
from interpose.methods.classical import Spline
from interpose.observation import Observation
from interpose.observation.broken import roughness
from interpose.skeletons import find_mapping
from interpose.skeletons.performers import by_itself, performers

MOMENT = 0.37  # seconds: values of single joints that are lost for at most so long are interpolated
# A moment is mended by the shortest way where velocities jump by less than this share of what they do else.
CALMER = 0.7


def momentary(clip: Clip, observation: Observation, max_gap: int | None) -> Observation | None:
    """Which values are lost only for moments, and for no more than `max_gap` frames, in frames of which
    something is known of their body; None if there are none.

    "True" means lost here. Shorter than what `auto` gives to a network, with known values on both sides: the
    velocities there make interpolation continuous, so nothing needs to be eased. Measured on validation
    performers with rotations dropped at random, p .3 and .5: joints are off by .08 and .19 cm so, and by .33
    and .64 when each such run is eased like a gap.
    """
    longest = min(round(MOMENT * clip.fps), len(clip) if max_gap is None else max_gap)
    some = np.empty(observation.rotation.shape, bool)
    for body in performers(clip.skeleton) or (tuple(range(len(clip.skeleton))),):
        own, mapping = list(body), find_mapping(by_itself(clip.skeleton, body))
        # What goes along with a body, as a prop in its hands, tells nothing of it.
        told = [own[joint] for joint in mapping.mapped[1]] if mapping.usable else own
        some[:, own] = observation.rotation[:, told].any(axis=1, keepdims=True)
    masks: list[np.ndarray] = []
    for known in (observation.rotation, observation.translation):
        lost = np.zeros(known.shape, bool)
        for joint in np.flatnonzero(~known.all(axis=0)):
            for start, stop in runs(np.logical_not(known[:, joint])):
                if (
                    start > 0
                    and stop < len(known)
                    and stop - start <= longest
                    and some[start:stop, joint].all()
                ):
                    lost[start:stop, joint] = True
        masks.append(lost)
    return Observation(masks[0], masks[1]) if any(mask.any() for mask in masks) else None


def mended(clip: Clip, observation: Observation, lost: Observation) -> tuple[Clip, Observation]:
    """The clip with what was lost for moments interpolated, and an observation to which that is known.

    By a spline, or where what it goes by is no velocity but another spike, by the shortest way.
    """
    hidden, columns = wipe(clip, observation), list(clip.translated)
    curved = Spline().complete(hidden, observation).clip

    def laid(said: Clip, on: Clip) -> Clip:
        return on.with_motion(
            np.where(lost.rotation[..., None], said.rotation, on.rotation),
            np.where(lost.translation[:, columns, None], said.translation, on.translation),
        )

    mended, straight = laid(curved, clip), laid(hidden, clip)
    # What else is missing is judged as it would be completed: what stands there now may be anything.
    pair = (laid(curved, hidden), hidden)
    for start, stop, _, (rough, short) in roughness(lost.rotation | lost.translation, *pair):
        if short.max() < CALMER * rough.max():
            mended.rotation[start:stop] = straight.rotation[start:stop]
            mended.translation[start:stop] = straight.translation[start:stop]
    known = replace(
        observation,
        rotation=observation.rotation | lost.rotation,
        translation=observation.translation | lost.translation,
    )
    return mended, known


def with_moments(done: Completion, clip: Clip, lost: Observation) -> Completion:
    """A completion that also tells what had been lost for moments."""
    either = lost.rotation | lost.translation
    moments = tuple(
        JointMoments(clip.skeleton.names[j], tuple(f"{a}:{b}" for a, b in runs(either[:, j])))
        for j in np.flatnonzero(either.any(axis=0))
    )
    provenance = np.where(either, np.int8(Provenance.METHOD), done.provenance)
    return replace(done, provenance=provenance, report=replace(done.report, moments=moments))
