"""Nobody hangs in the air within a gap; who jumps, and who hangs on something, stays."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from interpose.clip import Clip
from interpose.finish import hanging
from interpose.finish.standing import GRAVITY
from interpose.geometry import rotations
from interpose.observation import Gap, Observation

START, STOP = 30, 66  # frames, at 30 a second
FRAMES = np.arange(100)


def stands(cmu_walk: Clip) -> Clip:
    """Somebody who stands for a while, on both feet."""
    lows = cmu_walk.positions()[:, [cmu_walk.skeleton.index(f"{side}Foot") for side in ("Left", "Right")], 1]
    pose = np.full(len(FRAMES), int(lows.max(axis=1).argmin()))
    return cmu_walk.with_motion(cmu_walk.rotation[pose], cmu_walk.translation[pose])


def raised(clip: Clip, up: np.ndarray, way: np.ndarray | float = 0.0) -> Clip:
    """The clip `up` (F,) metres higher, and `way` (F,) metres aside."""
    off = np.stack(np.broadcast_arrays(way, up, 0.0), axis=-1)
    return clip.with_motion(clip.rotation, clip.translation + off[:, None])


def low(clip: Clip) -> np.ndarray:
    """(F,) metres of the lowest joint above that of the first frame."""
    heights = clip.positions()[..., 1].min(axis=1)
    return heights - heights[0]


def asked(clip: Clip) -> tuple[Clip, Observation, tuple[int, int]]:
    return clip, Observation.from_gaps(clip, [Gap(START, STOP)]), (START, STOP)


def bump(high: float) -> np.ndarray:
    """Slowly up and down within the gap: no flight."""
    inside = np.clip((FRAMES - START) / (STOP - START), 0, 1)
    return high * np.sin(np.pi * inside) ** 2


def flight(frames: int, middle: int = (START + STOP) // 2) -> np.ndarray:
    """Off the floor for so many frames, as gravity has it."""
    away = (FRAMES - middle) / 30
    return np.maximum(GRAVITY / 2 * ((frames / 60) ** 2 - away**2), 0.0)


def said(clip: Clip) -> list[str]:
    return hanging.hung(*asked(clip)[:2], Gap(START, STOP), 100)


def test_who_rises_slowly_and_sinks_again_stays_on_the_floor(cmu_walk):
    clip = raised(stands(cmu_walk), bump(0.3))
    done = hanging.grounded(*asked(clip))
    assert low(clip).max() == pytest.approx(0.3, abs=0.01)
    assert np.abs(low(done)).max() < 0.03
    assert (done.rotation[:START] == clip.rotation[:START]).all()
    assert (done.translation[STOP:] == clip.translation[STOP:]).all()
    assert "touches the floor in frames 1" in said(clip)[0], "as those of the file, from 100 on"
    assert not said(done)


def test_jumps_stay(cmu_walk):
    clip = raised(stands(cmu_walk), flight(16))
    assert low(clip).max() > 0.3
    assert hanging.grounded(*asked(clip)) is clip
    assert not said(clip)
    assert hanging.flies(*asked(clip)[:2]).sum() > 10


def test_of_a_slow_jump_a_free_one_is_made(cmu_walk):
    """Half as high as one of its time would be: off the floor for less of it, as high as it was."""
    clip = raised(stands(cmu_walk), 0.5 * flight(24))
    done = hanging.grounded(*asked(clip))
    assert low(done).max() == pytest.approx(low(clip).max(), abs=0.06)
    assert (low(done) > 0.05).sum() < 0.85 * (low(clip) > 0.05).sum()


def test_who_is_cut_in_the_air_falls(cmu_walk):
    """Known motion is on the way up; in the gap it stays there, and comes down as on a parachute."""
    top = START + 4
    rise = flight(16, top)
    inside = np.linspace(0, 1, STOP - START)
    rise[START:STOP] = rise[START - 1] * (1 - inside) + 0.25 * inside * (1 - inside)
    clip = raised(stands(cmu_walk), rise)
    done = hanging.grounded(*asked(clip))
    lands = top + 8
    assert low(clip)[lands + 3 : STOP - 9].min() > 0.05
    assert np.abs(low(done)[lands + 3 :]).max() < 0.04
    # No faster than it falls, as far as it is up at all.
    free = np.minimum(flight(16, top), low(clip))
    assert (low(done) > free - 0.03).all()


def test_who_hangs_beside_the_gap_or_travels_is_left_alone(cmu_walk):
    """On a bar, or over steps that nothing tells of; of what travels it is said."""
    body = stands(cmu_walk)
    up = 0.5 * (FRAMES < STOP + 10)
    hangs = raised(body, up - 0.5 * (FRAMES < 10))
    assert hanging.grounded(*asked(hangs)) is hangs
    assert not said(hangs)
    travels = raised(body, bump(0.3), FRAMES / 30 * 2.0)
    assert hanging.grounded(*asked(travels)) is travels
    assert said(travels)


def test_beside_a_step_nobody_knows_where_the_floor_is(cmu_walk):
    clip = raised(stands(cmu_walk), bump(0.3) + 0.3 * (FRAMES >= STOP))
    assert hanging.grounded(*asked(clip)) is clip


def test_who_lies_or_kneels_rests_on_flesh(cmu_walk):
    """Upside down, with nothing but its shoulders near the floor, ten centimetres above where toes were."""
    body = stands(cmu_walk)
    over = rotations.about("X", np.array(np.pi))
    rotation = body.rotation.copy()
    inside = slice(START, STOP)
    rotation[inside, 0] = rotations.multiply(over, rotation[inside, 0])
    turned = body.with_motion(rotation, body.translation)
    heights = turned.positions()[inside, :, 1].min(axis=1)
    up = np.zeros(len(FRAMES))
    up[inside] = 0.10 + body.positions()[0, :, 1].min() - heights
    clip = raised(turned, up)
    assert hanging.grounded(*asked(clip)) is clip
    assert not said(clip)


@pytest.mark.parametrize("fps", [5.0, 6.0, 10.0, 12.0, 60.0])
def test_jumps_stay_at_any_frame_rate(cmu_walk, fps):
    frames = np.arange(round(100 * fps / 30))
    away = frames / fps - (START + STOP) / 60
    pose = np.zeros(len(frames), int)
    body = cmu_walk.with_motion(cmu_walk.rotation[pose], cmu_walk.translation[pose])
    up = np.maximum(GRAVITY / 2 * (0.35**2 - away**2), 0.0)
    clip = replace(raised(body, up), fps=fps)
    gap = Gap(round(START * fps / 30), round(STOP * fps / 30))
    known = Observation.from_gaps(clip, [gap])
    assert hanging.grounded(clip, known, (gap.start, gap.stop)) is clip
    assert not hanging.hung(clip, known, gap, 0)


def test_at_an_end_it_is_a_matter_of_falling(cmu_walk):
    clip = raised(stands(cmu_walk), bump(0.3))
    known = Observation.from_gaps(clip, [Gap(START, len(clip))])
    assert hanging.grounded(clip, known, (START, len(clip))) is clip
