"""How far velocities may jump inside of gaps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from interpose import Observation
from interpose.clip import Clip
from interpose.finish import jumps, seams


def with_a_sword(clip: Clip) -> Clip:
    """The clip with a blade of a metre in the right hand, across the forearm."""
    skeleton, hand = clip.skeleton, clip.skeleton.index("RightHand")
    longer = replace(
        skeleton,
        names=(*skeleton.names, "Sword"),
        parents=(*skeleton.parents, hand),
        rest_translation=np.append(skeleton.rest_translation, [[0.0, 0.0, 1.0]], axis=0),
        rest_rotation=np.append(skeleton.rest_rotation, [[1.0, 0, 0, 0]], axis=0),
        rest_scale=np.append(skeleton.rest_scale, 1.0),
    )
    still = np.broadcast_to([1.0, 0, 0, 0], (len(clip), 1, 4))
    rotation = np.append(clip.rotation, still, axis=1)
    return Clip(longer, rotation, clip.translation, clip.fps, clip.translated)


def test_what_is_held_in_a_hand_does_not_say_how_the_body_may_jump(cmu_walk):
    armed, count = with_a_sword(cmu_walk), len(cmu_walk.skeleton)
    most = []
    for clip in (cmu_walk, armed):
        known = Observation.full(clip)
        limits = seams.limits(clip, known)
        limits[:] = limits[:count].min()
        most.append(jumps.peak_limits(clip, known, limits))
    np.testing.assert_allclose(most[1][:count], most[0])
    assert most[1][-1] > 1.3 * most[0].max()
