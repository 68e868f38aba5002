"""Mirroring against its definition: mirrored positions with the sides swapped."""

from __future__ import annotations

import numpy as np
import pytest

from interpose.clip import Clip, Skeleton
from interpose.errors import RequestError
from interpose.geometry import rotations
from interpose.skeletons import mirror as module
from interpose.skeletons.mirror import mirror, mirrored, sides

NAMES = ("Hips", "LeftUpLeg", "LeftLeg", "RightUpLeg", "RightLeg", "Spine", "thumb.l", "thumb.r")
PARENTS = (-1, 0, 1, 0, 3, 0, 5, 5)


def skeleton(axis: int, names: tuple[str, ...] = NAMES) -> Skeleton:
    """A symmetric body whose local axis `axis` points from one side to the other."""
    across, along, ahead = np.roll(np.eye(3), axis, axis=1)
    bones = [0 * along, 0.1 * across + 0.02 * ahead, 0.4 * along, -0.1 * across + 0.02 * ahead, 0.4 * along]
    bones += [0.3 * along, 0.2 * along + 0.1 * across, 0.2 * along - 0.1 * across]
    return Skeleton(names, PARENTS, np.array(bones))


def motion(skeleton: Skeleton, frames: int = 5, translated: tuple[int, ...] = ()) -> Clip:
    rng = np.random.default_rng(0)
    count = len(translated) or 1
    rotation = rotations.normalize(rng.normal(size=(frames, len(skeleton), 4)))
    return Clip(skeleton, rotation, rng.normal(size=(frames, count, 3)), 30, translated)


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("translated", [(), (0, 6, 7)])
def test_positions_are_mirrored_and_sides_swapped(axis, translated):
    clip = motion(skeleton(axis), translated=translated)
    image = mirror(clip)
    swapped = [0, 3, 4, 1, 2, 5, 7, 6]
    expected = clip.positions()[:, swapped] * [-1, 1, 1]
    np.testing.assert_allclose(image.positions(), expected, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(image.rotation, axis=-1), 1)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_twice_is_the_same_clip(axis):
    clip = motion(skeleton(axis), translated=(0, 6, 7))
    twice = mirror(mirror(clip))
    assert (twice.rotation == clip.rotation).all()
    assert (twice.translation == clip.translation).all()


def test_sides_by_all_kinds_of_names():
    pairs = [("lfemur", "rfemur"), ("LHipJoint", "RHipJoint"), ("mixamorig:LeftArm", "mixamorig:RightArm")]
    pairs += [
        ("thigh_l", "thigh_r"),
        ("L_Wrist", "R_Wrist"),
        ("bip L Calf", "bip R Calf"),
        ("toe.L.001", "toe.R.001"),
    ]
    middle = ("root", "lowerback", "upperneck", "Leg", "rig")
    names = (*middle, *(name for pair in pairs for name in pair))
    found = sides(Skeleton(names, (-1,) + (0,) * (len(names) - 1), np.zeros((len(names), 3))))
    assert found[:5] == (0, 1, 2, 3, 4)
    for left, right in pairs:
        assert names[found[names.index(left)]] == right
        assert names[found[names.index(right)]] == left


def test_different_sides_are_refused():
    crooked = Skeleton(("hips", "left_a", "right_a", "left_b", "right_b"), (-1, 0, 0, 1, 0), np.zeros((5, 3)))
    with pytest.raises(RequestError, match="no mirror image") as error:
        mirror(motion(crooked))
    assert "left_b" in error.value.why


def test_axes_that_are_no_mirror_images_are_refused():
    bones = skeleton(0).rest_translation.copy()
    bones[4] *= -1  # the right shin runs along the other way of its axis, as on rigs mirrored by rotation
    with pytest.raises(RequestError, match="cannot be mirrored") as error:
        mirror(motion(Skeleton(NAMES, PARENTS, bones)))
    assert "Leg" in error.value.why


def test_small_differences_between_the_sides_are_accepted():
    bones = skeleton(0).rest_translation.copy()
    bones[4] *= 1.05
    clip = motion(Skeleton(NAMES, PARENTS, bones))
    expected = clip.positions()[:, module.sides(clip.skeleton)] * [-1, 1, 1]
    assert np.linalg.norm(mirror(clip).positions() - expected, axis=-1).max() < 0.021


def test_a_joint_that_moves_on_one_side_only_is_refused():
    with pytest.raises(RequestError, match="animated positions"):
        mirror(motion(skeleton(0), translated=(0, 6)))


def test_a_real_walk(cmu_walk):
    mirrored = mirror(cmu_walk)
    expected = cmu_walk.positions()[:, sides(cmu_walk.skeleton)] * [-1, 1, 1]
    away = np.linalg.norm(mirrored.positions() - expected, axis=-1)
    assert away.max() < 0.05, "the actor's own asymmetry is a few centimetres"
    assert (mirror(mirrored).rotation == cmu_walk.rotation).all()


def test_mirrored_motions_have_mirrored_labels():
    labels = ("", "raise-left-hand", "raise-right-hand", "turn-left", "walk")
    assert mirrored(labels) == [0, 2, 1, 0, 4]
