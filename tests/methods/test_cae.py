"""The method around the network: windows, and who speaks where."""

from __future__ import annotations

import numpy as np

from interpose.methods.cae import HANDOVER, LENGTH, starts
from interpose.methods.positional import handover


def test_the_spline_hands_over_to_the_network():
    seen = np.ones((120, 22), bool)
    seen[40:80] = False
    seen[:, 5] = False
    share = handover(seen, HANDOVER)
    assert (share[seen] == 0).all()
    assert (share[:, 5] == 1).all(), "a joint that is never seen is the network's"
    assert share[40 + HANDOVER, 0] == 1
    assert np.allclose(share[40:80, 0], share[40:80, 0][::-1]), "the same from both sides"
    assert (np.diff(share[39 : 40 + HANDOVER, 0]) > 0).all()
    assert np.abs(np.diff(share[:, 0], 2)).max() < 0.05, "without a kink"


def test_windows_lie_around_what_is_missing():
    complete = np.ones(600, bool)
    complete[300:330] = False
    (first,) = starts(complete)
    assert first < 300 - 40
    assert first + LENGTH > 330 + 40
    complete[100:400] = False
    assert len(starts(complete)) > 3
