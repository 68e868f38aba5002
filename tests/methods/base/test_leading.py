"""How fast bodies go, and where, in long holes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import interpose
from interpose.geometry import rotations
from interpose.methods.base.graph import Answer
from interpose.methods.base.leading import at_pace, steady_pace
from interpose.skeletons import JOINTS


def test_who_goes_on_does_so_at_the_pace_at_which_he_came():
    """Of what is said too fast fewer frames are shown, each for longer."""
    n = 60
    there = np.zeros((n, 3))
    there[:, 2] = 0.02 * np.arange(n)
    assert steady_pace(there) == pytest.approx(0.02)
    assert steady_pace(there[:40]) is None  # two seconds tell
    assert steady_pace(np.tile(there[:1], (n, 1))) is None  # who stands may set off
    starts = there.copy()
    starts[:40, 2] = starts[39, 2]
    assert steady_pace(starts) is None
    local = np.broadcast_to(rotations.identity(), (40, len(JOINTS), 4)).copy()
    said = Answer(local, np.zeros((40, 3)), np.ones((40, 4)), np.full(40, 0.05))
    said.root[:, 2] = there[-1, 2] + 0.04 * np.arange(-9, 31)
    own = slice(10, 20)
    slow = at_pace(said, own, there[-15:], 0.02, False)
    assert np.diff(slow.root[9:20, 2]).max() < 0.031
    assert np.diff(slow.root[9:20, 2]).min() > 0.02
    assert at_pace(said, own, there[-15:], 0.05, False) is said
    back = at_pace(said.backwards(), slice(20, 30), there[-15:], 0.02, True)
    assert np.allclose(back.root[20:30], slow.root[10:20][::-1])


def test_forecasts_of_who_shuffles_do_not_run(cmu_walk):
    """At 40 % of its pace a stride takes longer than any that is carried on."""
    clip = cmu_walk.slice(1, 209)
    slow = interpose.resample(clip, 75.0, smooth=True)
    slow = replace(slow, fps=30.0, source=None)
    done = interpose.forecast(slow.slice(0, 190), frames=120, method="small").clip
    pace = np.linalg.norm(np.diff(done.root[:, [0, 2]], axis=0), axis=1)
    own = max(pace[at : at + 15].mean() for at in range(130, 175))
    assert max(pace[at : at + 15].mean() for at in range(190, 295)) < 1.3 * own


@pytest.fixture(scope="module")
def errand(cmu_walk):  # type: ignore[no-untyped-def]
    """Somebody stands for a second, and six seconds later six metres further on."""
    way = cmu_walk.root[150] - cmu_walk.root[90]
    clip = cmu_walk.take(np.repeat(90, 240))
    translation = clip.translation.copy()
    translation[210:, 0] += 6.0 * way / np.linalg.norm(way) * [1.0, 0.0, 1.0]
    return clip.with_motion(clip.rotation, translation)


@pytest.mark.parametrize("lone", [False, True])
def test_who_stands_sets_off_at_once_for_where_he_is_to_be(errand, lone):
    """And does not wait there until he has to run."""
    clip, gap = (errand.slice(29, 211), (1, 181)) if lone else (errand, (30, 210))
    done = interpose.fill(clip, gap, method="small")
    way = np.linalg.norm((done.clip.root[15:] - done.clip.root[:-15])[gap[0] : gap[1] - 15, ::2], axis=1)
    assert way.max() < 1.6 * way.mean(), way


@pytest.mark.parametrize("led", [False, True])
def test_who_is_led_does_not_change_his_pace_with_every_window(errand, led):
    gap, way = (30, 210), errand.root[[29, 210]][:, ::2]
    path = {frame: way[0] + (frame - 29) / 181 * (way[1] - way[0]) for frame in range(50, 200, 15)}
    done = interpose.fill(errand, gap, method="small", path=path if led else {}).clip
    changes = 900 * np.linalg.norm(np.diff(done.root[gap[0] : gap[1], ::2], 2, axis=0), axis=1)
    assert changes.max() < 8.0, changes.round(1)
