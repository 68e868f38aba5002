"""interpose scan: what it says to do next."""

from __future__ import annotations

import numpy as np
import pytest

from interpose.formats import load, save


@pytest.mark.parametrize(
    ("part", "said"),
    [
        (slice(0, 6), "--gap 0:6 fills anew what is before the first jump"),
        (slice(150, None), "--gap 150:163 fills anew what follows the first jump"),
        (slice(100, None), "--gap 91:109 leads over the first jump"),
    ],
)
def test_what_jumps_near_an_end_is_lost_there(run, take, part, said):
    """The frame at the very end would be known to be wrong."""
    clip = load(take)
    translation = clip.translation.copy()
    translation[part] += np.array([1.0, 0, 0.5])
    save(clip.with_motion(clip.rotation, translation), take.with_name("jumps.bvh"))
    assert said in run("scan", "jumps.bvh").out
