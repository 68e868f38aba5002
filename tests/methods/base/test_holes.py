"""Holes of any length, window by window."""

from __future__ import annotations

import numpy as np
import pytest

import interpose
from interpose.geometry import rotations
from interpose.methods.base import holes
from interpose.methods.base.graph import Answer, Seen
from interpose.methods.base.observed import COLUMNS
from interpose.methods.weights import find
from interpose.skeletons import JOINTS


def seen(frames: int, hole: slice, lacks: str = "") -> Seen:
    """A body that stands still, in a hole of which nothing of what its skeleton has is known."""
    has = np.ones(COLUMNS, bool)
    if lacks:
        has[JOINTS.index(lacks)] = False
    known = np.ones((frames, COLUMNS), bool)
    known[hole] = ~has
    local = np.broadcast_to(rotations.identity(), (frames, len(JOINTS), 4))
    zeros = np.zeros((frames, len(JOINTS), 3))
    never, nowhere, any_ = zeros[..., 0] > 0, zeros[:, 0] * np.nan, local[:, 0] * np.nan
    return Seen(local, zeros[:, 0], known, has, ("", ""), zeros[0], zeros, never, nowhere, any_)


@pytest.mark.parametrize("lacks", ["", "Spine1"])
@pytest.mark.parametrize(("expected", "asked"), [(0.9 * holes.SURE, 1), (1.1 * holes.SURE, 4)])
def test_what_it_is_sure_of_is_said_at_once_whatever_joints_there_are(monkeypatch, lacks, expected, asked):
    """Else ten frames at either end in turn, until thirty are left."""
    heads = []

    def ask(cards, motion, own):
        count = len(motion.root)
        heads.append(own)
        local = np.broadcast_to(rotations.identity(), (count, len(JOINTS), 4)).copy()
        local[:, JOINTS.index("Head")] = rotations.about("Y", np.full(count, 0.1))
        said = Answer(local, np.zeros((count, 3)), np.ones((count, 4)), np.full(count, expected))
        return [(said, said)]

    monkeypatch.setattr(holes, "ask", ask)
    hole = slice(20, 80)
    done = holes.run_long([find("small")], seen(100, hole, lacks))
    assert len(heads) == asked, heads
    turned = rotations.angle(done.local[:, JOINTS.index("Head")], rotations.identity())
    np.testing.assert_allclose(
        turned, np.where((np.arange(100) >= 20) & (np.arange(100) < 80), 0.1, 0.0), atol=1e-6
    )
    assert (done.expected[hole] >= expected).all()


@pytest.mark.parametrize("backwards", [False, True])
def test_the_further_a_forecast_goes_the_more_it_is_expected_to_be_off(backwards):
    """Later windows know what earlier ones guessed, and would be as sure as the first one."""
    told = holes._Errors(np.full(100, np.nan), False, np.add)
    seen = np.linspace(0.1, 0.5, 40)
    told.open(seen[::-1] if backwards else seen, (10, 90), backwards)
    told.open(np.full(40, 9.0), (10, 50), backwards)  # the first one counts
    wrong = told.expected[10:90][:: -1 if backwards else 1]
    np.testing.assert_allclose(wrong[:40], seen)
    assert (np.diff(wrong) > 0).all()
    assert wrong[-1] == pytest.approx(1.0)


@pytest.mark.parametrize("first", [False, True])
def test_more_frames_are_not_expected_to_be_nearer(cmu_walk, first):
    expected = []
    for frames in (60, 150, 240):
        clip = cmu_walk.take(np.concatenate([np.arange(1, 90), np.full(frames, 89)]))
        clip = clip.take(np.arange(len(clip))[:: -1 if first else 1])
        gap = (0, frames) if first else (89, 89 + frames)
        expected.append(interpose.fill(clip, gap, method="small").report.gaps[0].expected)
    assert expected == sorted(expected)
