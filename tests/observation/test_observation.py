"""Gaps and observations: what they say is known, and how they refuse."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from interpose.clip import Clip, Skeleton
from interpose.errors import RequestError
from interpose.observation import Gap, Observation, Pin

SKELETON = Skeleton(("hips", "spine", "arm", "hand"), (-1, 0, 1, 2), np.zeros((4, 3)))


def motion(frames: int = 10, translated: tuple[int, ...] = (0,)) -> Clip:
    return Clip(
        SKELETON,
        np.tile([1.0, 0, 0, 0], (frames, 4, 1)),
        np.zeros((frames, len(translated), 3)),
        30,
        translated,
    )


def test_gaps_are_read():
    assert Gap.parse(" 3:7 ") == Gap(3, 7)
    assert Gap.parse("3:7", ("arm",)) == Gap(3, 7, ("arm",))
    assert len(Gap(3, 7)) == 4
    assert str(Gap(3, 7, ("arm", "hand"))) == "3:7 arm,hand"


@pytest.mark.parametrize("text", ["", "3", "3:", ":7", "a:b", "3-7", "3:7:9", "1.5:3"])
def test_what_is_no_gap_is_refused(text):
    with pytest.raises(RequestError, match="cannot read the gap") as error:
        Gap.parse(text)
    assert "120:160" in error.value.fix


@pytest.mark.parametrize("gap", [Gap(7, 3), Gap(3, 3), Gap(-1, 3), Gap(5, 11), Gap(20, 30)])
def test_ranges_outside_the_clip_are_refused_with_its_frames(gap):
    with pytest.raises(RequestError, match=f"{gap.start}:{gap.stop}") as error:
        Observation.from_gaps(motion(), [gap])
    assert "0 to 9" in error.value.fix


def test_a_whole_gap_hides_pose_and_animated_translations():
    seen = Observation.from_gaps(motion(translated=(0, 3)), [Gap(2, 4)])
    assert not seen.rotation[2:4].any()
    assert seen.rotation[[1, 4]].all()
    assert (seen.translation[2] == [False, True, True, False]).all()
    assert not seen.complete
    assert (seen.frames == [True, True, False, False, *[True] * 6]).all()


def test_joints_hide_local_rotations_only():
    seen = Observation.from_gaps(motion(), [Gap(2, 4, ("arm",))])
    assert (seen.rotation[2] == [True, True, False, True]).all()
    assert seen.translation.all()
    with pytest.raises(RequestError, match="unknown joint: Arm") as error:
        Observation.from_gaps(motion(), [Gap(2, 4, ("Arm",))])
    assert "Did you mean arm" in error.value.fix


def test_positions_are_known_below_known_rotations_only():
    seen = Observation.from_gaps(motion(), [Gap(2, 4, ("spine",)), Gap(6, 7)])
    known = seen.positions(SKELETON)
    # The spine's own place does not need its rotation; all that hangs from it does.
    assert (known[2] == [True, True, False, False]).all()
    assert not known[6].any()
    assert known[0].all()


def test_gaps_come_back():
    gaps = [Gap(0, 2), Gap(2, 4, ("arm", "hand")), Gap(6, 7, ("hand",)), Gap(8, 10)]
    assert Observation.from_gaps(motion(), gaps).gaps(SKELETON) == gaps
    assert Observation.full(motion()).gaps(SKELETON) == []


def test_nan_means_missing():
    rotation, translation = np.tile([1.0, 0, 0, 0], (10, 4, 1)), np.ones((10, 1, 3))
    rotation[3, 1, 2] = np.nan
    translation[5, 0, 0] = np.inf
    given = rotation.copy()
    clip, seen = Observation.from_nan(SKELETON, rotation, translation, 30)
    assert np.isfinite(clip.rotation).all()
    assert not seen.rotation[3, 1]
    assert seen.rotation.sum() == 39
    assert (~seen.translation).sum() == 1
    assert not seen.translation[5, 0]
    assert np.array_equal(rotation, given, equal_nan=True), "the caller's arrays stay as they are"


def test_shapes_must_agree():
    with pytest.raises(RequestError, match="does not fit"):
        Observation(np.ones((3, 4)), np.ones((3, 5)))
    with pytest.raises(RequestError, match="does not fit"):
        Observation(np.ones(3), np.ones(3))


def test_slices():
    seen = Observation.from_gaps(motion(), [Gap(2, 4)]).slice(3, 6)
    assert (seen.frames == [False, True, True]).all()


def test_one_joint_may_be_named_as_it_is(cmu_walk):
    assert Gap(20, 30, "LeftArm") == Gap(20, 30, ["LeftArm"]) == Gap(20, 30, ("LeftArm",))
    assert not Observation.from_gaps(cmu_walk, [Gap(20, 30, "LeftArm")]).complete


@pytest.mark.parametrize("text", ["1e308s:2s", "0s:1e308s", "nans:2s", "1s:infs", f"0:{'9' * 5000}"])
def test_times_beyond_all_numbers_are_refused(cmu_walk, text):
    with pytest.raises(RequestError, match="cannot read the gap"):
        Gap.parse(text, clip=cmu_walk)


def test_pins_can_be_compared():
    pin = Pin("LeftHand", np.arange(3), np.zeros((3, 3)))
    assert pin == pin
    assert pin != replace(pin, tolerance=1.0)
