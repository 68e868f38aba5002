"""STMI-GAN as users have it: forecasts of its installed weights, and what its frames are woven into."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from interpose import tasks
from interpose.errors import RequestError
from interpose.methods import positional, registry
from interpose.observation import Gap


def test_a_walk_goes_on_walking(cmu_walk):
    """As far as it was going, with no longer steps than before, and differently by the seed."""
    done = tasks.forecast(cmu_walk, 60, method="stmi-gan")
    (report,) = done.report.gaps
    assert report.method == "stmi-gan"
    steps = np.linalg.norm(np.diff(done.clip.positions()[:, 0, [0, 2]], axis=0), axis=1)
    assert 0.7 < steps[-60:].mean() / steps[-120:-60].mean() < 1.3
    feet = [done.clip.skeleton.index(name) for name in ("LeftFoot", "RightFoot")]
    speed = np.linalg.norm(np.diff(done.clip.positions()[:, feet], axis=0), axis=-1)
    assert speed[-60:].max() < 1.5 * speed[:-60].max()
    assert (speed[-60:].min(axis=1) < 0.5 * speed[-60:].mean()).mean() > 0.5, "one foot rests, mostly"
    one, same, other = (tasks.forecast(cmu_walk, 60, method="stmi-gan", seed=seed).clip for seed in (1, 1, 2))
    assert np.array_equal(one.rotation, same.rotation)
    assert not np.array_equal(one.rotation, other.rotation)


def test_what_it_was_not_trained_for(cmu_walk):
    method = registry.get("stmi-gan")
    assert "not on gaps between poses" in method.refuses(cmu_walk, Gap(60, 90))
    assert "2 seconds of motion" in method.refuses(cmu_walk.slice(0, 90), Gap(50, 90))
    assert method.refuses(cmu_walk, Gap(60, len(cmu_walk))) is None
    assert method.refuses(cmu_walk, Gap(60, 90, ("LeftForeArm",))) is None


def test_the_dense_network_forecasts_and_fills_at_every_frame(cmu_walk):
    method = registry.get("stmi-gan-dense")
    assert method.refuses(cmu_walk, Gap(60, 90)) is None
    assert method.refuses(cmu_walk.slice(0, 90), Gap(50, 90)) is None
    assert method.card.fps == 30
    done = tasks.forecast(cmu_walk, 60, method="stmi-gan-dense").clip
    steps = np.linalg.norm(np.diff(done.positions()[:, 0, [0, 2]], axis=0), axis=1)
    assert 0.5 < steps[-60:].mean() / steps[-120:-60].mean() < 2.0
    filled = tasks.fill(cmu_walk, [Gap(80, 110)], "stmi-gan-dense")
    assert filled.report.gaps[0].method == "stmi-gan-dense"
    off = np.linalg.norm(filled.clip.positions() - cmu_walk.positions(), axis=-1)
    assert off[80:110].mean() < 0.25
    assert not off[:80].any()


def test_coarse_frames_are_woven_into_what_is_known():
    """Through all that is known, through what is said away from it, and straight where both are."""
    frames, times = np.arange(60.0), np.arange(0, 62, 6.0)
    line = np.stack([frames, 2 * frames, -frames], axis=-1)[:, None].repeat(22, axis=1)
    known = np.ones((60, 22), bool)
    known[20:41] = False
    known[:, 3] = False  # never
    said = np.stack([times, 2 * times, -times], axis=-1)[:, None].repeat(22, axis=1)
    given = np.where(known[..., None], line, 1e6)
    assert np.abs(positional.weave(said, times, given, known) - line).max() < 1e-6
    said[5] += 1.0  # at frame 30
    woven = positional.weave(said, times, given, known)
    assert np.array_equal(woven[:20, :3], line[:20, :3])
    assert woven[30, 0] == pytest.approx(line[30, 0] + 1.0)
    assert np.abs(np.diff(woven - line, 2, axis=0)).max() < 0.2, "bent, nowhere broken"


@pytest.mark.parametrize("time", [0.0333330, 0.033300, 0.0333333, 0.033367])
def test_the_last_digits_of_a_frame_time_do_not_matter(cmu_walk, time):
    clip = replace(cmu_walk, fps=1 / time)
    done = tasks.forecast(clip, 30, samples=2, method="stmi-gan")
    assert [one.report.gaps[0].method for one in done.samples] == ["stmi-gan"] * 2
    assert done.spread()[-1] > 0


def test_samples_of_what_fills_in_are_refused(cmu_walk, monkeypatch):
    monkeypatch.setattr("interpose.finish.seams.ABSURD", 0.0)
    with pytest.raises(RequestError, match="cannot draw 2 samples"):
        tasks.forecast(cmu_walk, 30, samples=2, method="stmi-gan")
