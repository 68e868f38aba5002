"""What interpose's own network says, put together from several answers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import interpose
from interpose.geometry import rotations
from interpose.methods import base
from interpose.methods.weights import find
from interpose.skeletons import JOINTS

FRAMES, OWN = 40, slice(10, 30)


def answer(joint: str, degrees: np.ndarray, expected: float = 0.05) -> base.Answer:
    """A body that stands and turns one joint about the vertical."""
    local = np.broadcast_to(rotations.identity(), (FRAMES, len(JOINTS), 4)).copy()
    local[:, JOINTS.index(joint)] = rotations.about("Y", np.radians(degrees))
    return base.Answer(local, np.zeros((FRAMES, 3)), np.ones((FRAMES, 4)), np.full(FRAMES, expected))


def degrees_of(said: base.Answer, joint: str) -> np.ndarray:
    return np.degrees(rotations.angle(said.local[:, JOINTS.index(joint)], rotations.identity()))


def test_of_two_answers_the_mean_counts():
    slow = np.linspace(0, 40, FRAMES)
    said = base.mean(answer("Head", slow), answer("Head", 0 * slow), OWN, 0.25)
    np.testing.assert_allclose(degrees_of(said, "Head"), 0.75 * slow, atol=0.5)


@pytest.mark.parametrize("joint", ["Head", "Spine1", "LeftUpLeg"])
@pytest.mark.parametrize("first", [True, False])
def test_of_two_answers_the_one_counts_that_does_not_snap(joint, first):
    """Sixty degrees within two frames, also if that one expects to err less."""
    calm = np.linspace(0, 30, FRAMES)
    torn = calm + 60 * np.clip(np.arange(FRAMES) - 19, 0, 2) / 2
    both = [answer(joint, calm), answer(joint, torn, expected=0.01)]
    said = base.mean(*(both if first else both[::-1]), OWN)
    np.testing.assert_allclose(degrees_of(said, joint), calm, atol=1e-6)


def test_what_snaps_where_nothing_is_asked_for_counts_as_well():
    torn = np.where(np.arange(FRAMES) < 5, 0.0, 60.0)
    said = base.mean(answer("Head", torn), answer("Head", 0 * torn), OWN)
    np.testing.assert_allclose(degrees_of(said, "Head")[OWN], 30.0, atol=1e-6)


def seen(frames: int, hole: slice, lacks: str = "") -> base.Seen:
    """A body that stands still, in a hole of which nothing of what its skeleton has is known."""
    has = np.ones(base.COLUMNS, bool)
    if lacks:
        has[JOINTS.index(lacks)] = False
    known = np.ones((frames, base.COLUMNS), bool)
    known[hole] = ~has
    local = np.broadcast_to(rotations.identity(), (frames, len(JOINTS), 4))
    zeros = np.zeros((frames, len(JOINTS), 3))
    never, nowhere, any_ = zeros[..., 0] > 0, zeros[:, 0] * np.nan, local[:, 0] * np.nan
    return base.Seen(local, zeros[:, 0], known, has, ("", ""), zeros[0], zeros, never, nowhere, any_)


@pytest.mark.parametrize("lacks", ["", "Spine1"])
@pytest.mark.parametrize(("expected", "asked"), [(0.9 * base.SURE, 1), (1.1 * base.SURE, 4)])
def test_what_it_is_sure_of_is_said_at_once_whatever_joints_there_are(monkeypatch, lacks, expected, asked):
    """Else ten frames at either end in turn, until thirty are left."""
    heads = []

    def ask(cards, motion, own):
        count = len(motion.root)
        heads.append(own)
        local = np.broadcast_to(rotations.identity(), (count, len(JOINTS), 4)).copy()
        local[:, JOINTS.index("Head")] = rotations.about("Y", np.full(count, 0.1))
        said = base.Answer(local, np.zeros((count, 3)), np.ones((count, 4)), np.full(count, expected))
        return [(said, said)]

    monkeypatch.setattr(base, "ask", ask)
    hole = slice(20, 80)
    done = base.run_long([find("small")], seen(100, hole, lacks))
    assert len(heads) == asked, heads
    turned = rotations.angle(done.local[:, JOINTS.index("Head")], rotations.identity())
    np.testing.assert_allclose(
        turned, np.where((np.arange(100) >= 20) & (np.arange(100) < 80), 0.1, 0.0), atol=1e-6
    )
    assert (done.expected[hole] >= expected).all()


def test_who_goes_on_does_so_at_the_pace_at_which_he_came():
    """Of what is said too fast fewer frames are shown, each for longer."""
    n = 60
    there = np.zeros((n, 3))
    there[:, 2] = 0.02 * np.arange(n)
    assert base.steady_pace(there) == pytest.approx(0.02)
    assert base.steady_pace(there[:40]) is None  # two seconds tell
    assert base.steady_pace(np.tile(there[:1], (n, 1))) is None  # who stands may set off
    starts = there.copy()
    starts[:40, 2] = starts[39, 2]
    assert base.steady_pace(starts) is None
    said = answer("Head", np.zeros(FRAMES))
    said.root[:, 2] = there[-1, 2] + 0.04 * np.arange(-9, FRAMES - 9)
    own = slice(10, 20)
    slow = base.at_pace(said, own, there[-15:], 0.02, False)
    assert np.diff(slow.root[9:20, 2]).max() < 0.031
    assert np.diff(slow.root[9:20, 2]).min() > 0.02
    assert base.at_pace(said, own, there[-15:], 0.05, False) is said
    back = base.at_pace(said.backwards(), slice(20, 30), there[-15:], 0.02, True)
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


@pytest.mark.parametrize("backwards", [False, True])
def test_the_further_a_forecast_goes_the_more_it_is_expected_to_be_off(backwards):
    """Later windows know what earlier ones guessed, and would be as sure as the first one."""
    told = base._Errors(np.full(100, np.nan), False, True)
    seen = np.linspace(0.1, 0.5, 40)
    told.open(seen[::-1] if backwards else seen, (10, 90), backwards)
    told.open(np.full(40, 9.0), (10, 50), backwards)  # the first one counts
    wrong = told.expected[10:90][:: -1 if backwards else 1]
    np.testing.assert_allclose(wrong[:40], seen)
    assert (np.diff(wrong) > 0).all()
    assert wrong[-1] == pytest.approx(1.0)


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


@pytest.mark.parametrize("first", [False, True])
def test_more_frames_are_not_expected_to_be_nearer(cmu_walk, first):
    expected = []
    for frames in (60, 150, 240):
        clip = cmu_walk.take(np.concatenate([np.arange(1, 90), np.full(frames, 89)]))
        clip = clip.take(np.arange(len(clip))[:: -1 if first else 1])
        gap = (0, frames) if first else (89, 89 + frames)
        expected.append(interpose.fill(clip, gap, method="small").report.gaps[0].expected)
    assert expected == sorted(expected)
