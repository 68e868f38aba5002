"""Limbs that are held with a tremble, and joints that are led straight."""

from __future__ import annotations

import numpy as np
import pytest

from interpose.clip import Clip
from interpose.geometry import rotations
from interpose.observation.finding import to_gaps
from interpose.observation.frozen import stuck
from interpose.observation.scan import scan

START, STOP = 80, 110


def below(clip: Clip, name: str) -> list[int]:
    top = clip.skeleton.index(name)
    return [j for j in range(len(clip.skeleton)) if j == top or top in clip.skeleton.ancestors(j)]


def held(clip: Clip, name: str, degrees: float) -> Clip:
    """A limb stays where it was, as far as noise lets it."""
    rng, rotation = np.random.default_rng(0), clip.rotation.copy()
    for joint in below(clip, name):
        noise = rotations.exp(np.radians(degrees) * rng.standard_normal((STOP - START, 3)))
        rotation[START:STOP, joint] = rotations.multiply(noise, clip.rotation[START - 1, joint])
    return clip.with_motion(rotation, clip.translation)


def led(clip: Clip, joints: list[int]) -> Clip:
    """Joints are led straight from the frame before to the one after."""
    rotation, share = clip.rotation.copy(), np.arange(1, STOP - START + 1) / (STOP - START + 1)
    for joint in joints:
        ends = rotations.continuous(clip.rotation[[START - 1, STOP], joint])
        rotation[START:STOP, joint] = rotations.slerp(ends[:1], ends[1:], share)
    return clip.with_motion(rotation, clip.translation)


@pytest.mark.parametrize("degrees", [0.1, 0.3])
@pytest.mark.parametrize("limb", ["LeftArm", "RightUpLeg"])
def test_a_limb_that_is_held_and_trembles_is_frozen(cmu_walk, limb, degrees):
    (found,) = [one for one in scan(held(cmu_walk, limb, degrees)) if one.kind == "frozen"]
    assert found.joints is not None
    assert {*found.joints} <= {cmu_walk.skeleton.names[joint] for joint in below(cmu_walk, limb)}
    assert abs(found.start - START) <= 8
    assert found.stop == STOP
    assert to_gaps([found])


@pytest.mark.parametrize("whole", [False, True])
def test_what_is_held_for_long_is_found_from_its_first_frame(long_walk, whole):
    """Seven seconds, more than a third of the clip."""
    clip, rng, (start, stop) = long_walk.slice(0, 600), np.random.default_rng(0), (200, 410)
    joints = [*range(len(clip.skeleton))] if whole else below(clip, "LeftArm")
    alive = [j for j in joints if np.ptp(clip.rotation[:, j], axis=0).max() > 1e-3]
    rotation, translation = clip.rotation.copy(), clip.translation.copy()
    noise = rotations.exp(np.radians(0.1) * rng.standard_normal((stop - start, len(alive), 3)))
    rotation[start:stop, alive] = rotations.multiply(noise, rotation[start - 1, alive])
    if whole:
        translation[start:stop] = translation[start - 1] + 5e-4 * rng.standard_normal((stop - start, 1, 3))
    held = clip.with_motion(rotation, translation)
    (found,) = [one for one in scan(held) if "frozen" in one.kind]
    assert (found.kind, found.joints is None, found.stop) == ("frozen", whole, stop)
    assert abs(found.start - start) <= 8
    if whole:
        assert not stuck(held), "its place is held as all else is, and not for `recover`"


@pytest.mark.parametrize("limb", ["LeftArm", "RightUpLeg"])
def test_a_limb_that_is_led_straight_is_found_exactly(cmu_walk, limb):
    (found,) = [one for one in scan(led(cmu_walk, below(cmu_walk, limb))) if one.kind == "straight"]
    assert (found.start, found.stop) == (START, STOP)
    assert found.joints is not None
    assert limb in found.joints


def test_a_pose_that_is_led_straight_is_a_gap_of_the_whole_pose(cmu_walk):
    found = [one for one in scan(led(cmu_walk, [*range(len(cmu_walk.skeleton))])) if one.kind == "straight"]
    assert [(one.joints, one.start, one.stop) for one in found] == [(None, START, STOP)]


def test_what_was_animated_so_is_as_it_should_be(cmu_walk):
    """Keys every ten frames and straight lines between them: nothing is missing there."""
    keys = np.arange(len(cmu_walk)) / 10
    rotation = np.stack(
        [
            rotations.slerp(
                *(rotations.continuous(cmu_walk.rotation[[int(k) * 10, min(int(k) * 10 + 10, 208)]]))[
                    :, None
                ],
                np.full(1, k % 1),
            )[0]
            for k in keys
        ]
    )
    assert not [
        one for one in scan(cmu_walk.with_motion(rotation, cmu_walk.translation)) if one.kind == "straight"
    ]


@pytest.mark.parametrize("keys", [10, 18])
def test_half_of_a_clip_that_was_animated_so_is_as_it_should_be(cmu_walk, keys):
    rotation = cmu_walk.rotation.copy()
    for start in range(0, 100, keys):
        ends, share = rotations.continuous(cmu_walk.rotation[[start, start + keys]]), np.arange(keys) / keys
        rotation[start : start + keys] = rotations.slerp(ends[:1], ends[1:], share[:, None])
    clip = cmu_walk.with_motion(rotation, cmu_walk.translation)
    assert not [one for one in scan(clip) if one.kind == "straight"]


def test_what_moved_slowly_before_it_was_held_is_real(cmu_walk):
    """An arm that comes to rest, as far as one sees, and then is held."""
    slow, rotation = np.radians(0.12), held(cmu_walk, "LeftArm", 0.1).rotation.copy()
    for joint in below(cmu_walk, "LeftArm"):
        turn = rotations.exp(np.outer(np.arange(12, 0, -1) * slow, [1.0, 0.0, 0.0]))
        rotation[START - 12 : START, joint] = rotations.multiply(turn, cmu_walk.rotation[START - 1, joint])
    found = scan(cmu_walk.with_motion(rotation, cmu_walk.translation))
    (last,) = [one for one in found if one.kind == "frozen" and one.stop == STOP]
    assert START - 3 <= last.start <= START + 2


def test_a_pose_that_is_held_whole_is_one_gap(cmu_walk):
    """The tracker lost all of it: turns tremble, and the place is held to the last digit."""
    rng, rotation, translation = (
        np.random.default_rng(0),
        cmu_walk.rotation.copy(),
        cmu_walk.translation.copy(),
    )
    moving = np.ptp(cmu_walk.rotation, axis=0).max(axis=1) > 1e-3
    noise = rotations.exp(np.radians(0.1) * rng.standard_normal((STOP - START, int(moving.sum()), 3)))
    rotation[START:STOP] = rotation[START - 1]
    rotation[START:STOP, moving] = rotations.multiply(noise, rotation[START - 1, moving])
    translation[START:STOP] = translation[START - 1]
    (found,) = scan(cmu_walk.with_motion(rotation, translation))
    assert (found.kind, found.joints, found.stop) == ("frozen", None, STOP)
    assert abs(found.start - START) <= 3


@pytest.mark.parametrize("frames", [1, 2, 4])
def test_what_leaps_from_a_wrong_pose_is_not_held(cmu_walk, frames):
    """An arm that rests, as far as arms do, until it swings; before it the file begins with a rest pose."""
    rng, rotation, rests = np.random.default_rng(0), cmu_walk.rotation.copy(), 31
    for joint in below(cmu_walk, "LeftArm"):
        noise = rotations.exp(np.radians(0.1) * rng.standard_normal((rests, 3)))
        rotation[:rests, joint] = rotations.multiply(noise, cmu_walk.rotation[rests, joint])
    rotation[:frames] = cmu_walk.skeleton.rest_rotation
    clip = cmu_walk.with_motion(rotation, cmu_walk.translation)
    assert not [one for one in scan(clip) if "beside a jump" in one.note]


def test_where_motion_was_cut_nothing_was_held(cmu_walk):
    """All joints leap in that step, a leg that stood among them."""
    clip = cmu_walk.slice(1, 209)
    leg, rotation = below(clip, "LeftUpLeg"), clip.rotation.copy()
    rng = np.random.default_rng(0)
    noise = rotations.exp(np.radians(0.2) * rng.standard_normal((20, len(leg), 3)))
    rotation[60:80, leg] = rotations.multiply(noise, rotation[60, leg])
    stands = clip.with_motion(rotation, clip.translation)
    assert [one.kind for one in scan(stands) if one.kind == "frozen"] == ["frozen"]
    kept = np.delete(np.arange(208), np.arange(80, 100))
    cut = stands.with_motion(rotation[kept], clip.translation[kept])
    assert [one.kind for one in scan(cut)] == ["jump"]


def test_people_who_walk_run_and_jump_are_not_stiff(cmu_walk, data):
    from interpose.formats import load

    for clip in (cmu_walk, load(data / "cmu_run.bvh"), load(data / "cmu_jump.bvh")):
        assert not [one for one in scan(clip) if one.kind in ("straight", "frozen")]
