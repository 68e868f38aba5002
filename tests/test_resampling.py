"""Clips at other frame rates, there and back; frames that were dropped or repeated."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from interpose import resampling
from interpose.clip import Clip, Skeleton
from interpose.errors import RequestError
from interpose.geometry import rotations, time
from interpose.resampling import resample, spread

RATES = [(120, 30, 40), (30, 24, 31), (24, 60, 10), (25, 29.97, 26)]


def clip(frames: int = 40, fps: float = 30) -> Clip:
    skeleton = Skeleton(("root", "bone"), (-1, 0), np.array([[0, 0, 0], [0, 1, 0]]))
    rng, t = np.random.default_rng(0), np.arange(frames) / 30
    turns = sum(
        rng.normal(scale=0.5, size=(1, 2, 3)) * np.sin((k + 1) * t + k)[:, None, None] for k in range(3)
    )
    root = np.stack([np.sin(t), 1 + 0.1 * np.cos(3 * t), t], axis=-1)[:, None]
    return Clip(skeleton, rotations.exp(turns), root, fps)


@pytest.mark.parametrize("smooth", [False, True])
def test_resampling_there_and_back(smooth):
    short = clip(40)
    up = resample(short, 120, smooth)
    assert len(up) == 39 * 4 + 1
    assert up.fps == 120
    back = resample(up, 30)
    # Shared frames are the same numbers.
    assert (back.rotation == short.rotation).all()
    assert (back.translation == short.translation).all()
    assert back.fps == 30


@pytest.mark.parametrize(("old", "new", "frames"), RATES)
def test_resampling_keeps_the_duration(old, new, frames):
    before = clip(frames, fps=old)
    after = resample(before, new)
    first, last = (frames - 1) / old, (len(after) - 1) / new
    assert first - 1 / new < last <= first + 1e-9
    assert (after.rotation[0] == before.rotation[0]).all()
    moment = 0.5 * last
    here = time.sample(before.translation, np.array([moment * old]))
    np.testing.assert_allclose(time.sample(after.translation, np.array([moment * new])), here, atol=2e-3)


def test_a_rounded_frame_time_means_the_rate_it_stands_for():
    rounded = clip(2000, fps=1 / 0.033333)
    up = resample(rounded, 60)
    assert len(up) == 2 * 1999 + 1
    assert (up.rotation[::2] == rounded.rotation).all()


@pytest.mark.parametrize("frames", [1, 2])
def test_resampling_tiny_clips(frames):
    tiny = clip(frames)
    for smooth in (False, True):
        up = resample(tiny, 90, smooth)
        assert len(up) == 3 * (frames - 1) + 1
        assert (up.rotation[-1] == tiny.rotation[-1]).all()


@pytest.mark.parametrize("fps", [0, -30, 0.1, float("nan"), "30", None, 1e6, 1e9, 1e300])
def test_rates_that_are_none_are_refused_before_anything_is_computed(fps, monkeypatch):
    given = clip()
    monkeypatch.setattr(resampling, "np", None)
    with pytest.raises(RequestError, match="the frame rate is wrong"):
        resample(given, fps)


@pytest.mark.parametrize("smooth", [False, True])
def test_long_clips_are_resampled_in_blocks_that_agree(smooth, monkeypatch):
    whole = resample(clip(100), 70, smooth)
    monkeypatch.setattr(resampling, "BLOCK", 7)
    blocks = resample(clip(100), 70, smooth)
    np.testing.assert_allclose(blocks.rotation, whole.rotation, atol=1e-12)
    np.testing.assert_allclose(blocks.translation, whole.translation, atol=1e-12)


@pytest.mark.parametrize(("real", "shown"), [(12, np.floor), (15, np.floor), (24, np.floor), (24, np.round)])
def test_film_in_video_moves_evenly_once_repeated_frames_are_out(cmu_walk, real, shown):
    film = resample(cmu_walk, real, smooth=True)
    at = shown(np.arange(len(cmu_walk)) * real / 30 + 1e-9).astype(int)
    at = at[at < len(film)]
    video = replace(film, rotation=film.rotation[at], translation=film.translation[at], fps=30.0)
    even = spread(video, np.diff(at, prepend=-1) == 0)
    assert len(even) == len(video)
    wanted = resample(film, 30.0, smooth=True).positions()
    off = np.linalg.norm(even.positions()[: len(wanted)] - wanted[: len(even)], axis=-1)
    assert off[:-3].max() < 1e-3


def test_frames_that_were_dropped_come_back_where_they_were(cmu_walk):
    again = np.random.default_rng(0).random(len(cmu_walk)) < 0.15
    again[[0, -1]] = False
    at = np.maximum.accumulate(np.where(again, 0, np.arange(len(cmu_walk))))
    held = cmu_walk.with_motion(cmu_walk.rotation[at], cmu_walk.translation[at])
    even = spread(held, again)
    assert np.allclose(even.rotation[~again], cmu_walk.rotation[~again])
    off = np.linalg.norm(even.positions() - cmu_walk.positions(), axis=-1)
    assert off.max() < 0.25 * np.linalg.norm(held.positions() - cmu_walk.positions(), axis=-1).max()
    assert spread(cmu_walk, np.zeros(len(cmu_walk), bool)) is cmu_walk
