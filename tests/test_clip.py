"""What a clip and a skeleton promise, and how they refuse."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from interpose.clip import Clip, Skeleton
from interpose.errors import RequestError
from interpose.finish import complete
from interpose.methods.classical import Linear
from interpose.observation import Gap, Observation

BONES = np.array([[0, 1, 0], [0, 0.5, 0], [0.3, 0, 0], [2, 0, 0]])


def skeleton(**more: np.ndarray) -> Skeleton:
    return Skeleton(("hips", "spine", "arm", "prop"), (-1, 0, 1, -1), BONES, **more)


def clip(frames: int = 3, **more) -> Clip:
    rotation = np.tile([1.0, 0, 0, 0], (frames, 4, 1))
    return Clip(skeleton(), rotation, np.zeros((frames, 2, 3)), 30, **more)


def test_a_skeleton_knows_its_tree():
    body = skeleton()
    assert len(body) == 4
    assert body.roots == (0, 3)
    assert body.children == ((1,), (2,), (), ())
    assert body.ancestors(2) == (1, 0)
    assert (body.rest_rotation == [1, 0, 0, 0]).all()
    assert body.index("arm") == 2


def test_unknown_joints_are_answered_with_the_nearest():
    with pytest.raises(RequestError, match="unknown joint: amr") as error:
        skeleton().index("amr")
    assert "arm" in error.value.fix
    assert "hips, spine, arm, prop" in error.value.why


@pytest.mark.parametrize(
    "parents", [(-1, 2, 1, -1), (-1, 0, 3, -1), (-1, 0, 1), (-2, 0, 1, -1), (-1, 1, 1, -1)]
)
def test_what_is_no_tree_is_refused(parents):
    with pytest.raises(RequestError, match="no tree"):
        Skeleton(("hips", "spine", "arm", "prop"), parents, BONES)


def test_names_must_be_unique():
    with pytest.raises(RequestError, match="ambiguous") as error:
        Skeleton(("hips", "arm", "arm", "prop"), (-1, 0, 1, -1), BONES)
    assert "arm" in error.value.why


def test_roots_are_translated_unless_more_is_said():
    assert clip().translated == (0, 3)
    np.testing.assert_allclose(clip().positions()[0], [[0, 0, 0], [0, 0.5, 0], [0.3, 0.5, 0], [0, 0, 0]])


def test_scales_act_on_what_is_below():
    body = skeleton(rest_scale=np.array([2.0, 3.0, 5.0, 1.0]))
    assert (body.scale_above == [1, 2, 6, 1]).all()
    rotation = np.tile([1.0, 0, 0, 0], (1, 4, 1))
    positions = Clip(body, rotation, np.zeros((1, 2, 3)), 30).positions()
    np.testing.assert_allclose(positions[0, 2], [0.3 * 6, 0.5 * 2, 0])


def test_other_animated_translations_replace_the_bone():
    rotation = np.tile([1.0, 0, 0, 0], (1, 4, 1))
    moved = Clip(skeleton(), rotation, np.array([[[0, 0, 0], [9, 0, 0], [0, 0.7, 0]]]), 30, (0, 3, 1))
    np.testing.assert_allclose(moved.positions()[0], [[0, 0, 0], [0, 0.7, 0], [0.3, 0.7, 0], [9, 0, 0]])
    np.testing.assert_allclose(moved.root, [[0, 0, 0]])


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_clip_is_finite(bad):
    rotation = np.tile([1.0, 0, 0, 0], (3, 4, 1))
    rotation[1, 2, 0] = bad
    with pytest.raises(RequestError, match="no numbers") as error:
        Clip(skeleton(), rotation, np.zeros((3, 2, 3)), 30)
    assert "from_nan" in error.value.fix
    with pytest.raises(RequestError, match="no numbers"):
        Clip(skeleton(), np.tile([1.0, 0, 0, 0], (3, 4, 1)), np.full((3, 2, 3), bad), 30)


def test_shapes_and_rate_are_checked():
    rotation = np.tile([1.0, 0, 0, 0], (3, 4, 1))
    with pytest.raises(RequestError, match="rotations do not fit"):
        Clip(skeleton(), rotation[:, :3], np.zeros((3, 2, 3)), 30)
    with pytest.raises(RequestError, match="translations do not fit"):
        Clip(skeleton(), rotation, np.zeros((2, 2, 3)), 30)
    for fps in (0, -1, np.nan, 1 / 30, "30", None):
        with pytest.raises(RequestError, match="frame rate"):
            Clip(skeleton(), rotation, np.zeros((3, 2, 3)), fps)


@pytest.mark.parametrize("factor", [3.0, 1.01, 0.0])
def test_quaternions_are_unit_quaternions(factor):
    rotation = np.tile([1.0, 0, 0, 0], (3, 4, 1))
    rotation[1, 2] *= factor
    with pytest.raises(RequestError, match="at frame 1") as failed:
        Clip(skeleton(), rotation, np.zeros((3, 2, 3)), 30)
    assert "w, x, y, z" in str(failed.value)


def test_rounded_quaternions_are_made_unit_ones_and_others_stay():
    exact = np.tile([0.6, 0.8, 0, 0], (3, 4, 1))
    for rotation, same in ((exact, True), ((1.0004 * exact).astype(np.float16), False)):
        made = Clip(skeleton(), rotation, np.zeros((3, 2, 3)), 30).rotation
        assert np.abs(np.linalg.norm(made, axis=-1) - 1).max() < 1e-6
        assert np.array_equal(made, rotation) is same
    one = exact + 1e-9
    mixed = np.where(np.arange(4)[:, None] == 2, 1.0004 * exact, one)
    others = [0, 1, 3]
    assert np.array_equal(
        Clip(skeleton(), mixed, np.zeros((3, 2, 3)), 30).rotation[:, others], one[:, others]
    )


def test_a_skeleton_from_arrays_is_one_and_bones_are_checked():
    made = Skeleton(["a", "b"], np.array([-1, 0]), np.zeros((2, 3)))
    assert Clip(made, np.tile([1.0, 0, 0, 0], (2, 2, 1)), np.zeros((2, 1, 3)), 30).positions().shape == (
        2,
        2,
        3,
    )
    for bones, said in ((np.zeros((3, 3)), "bones do not fit"), (np.full((2, 3), np.nan), "no numbers")):
        with pytest.raises(RequestError, match=said):
            Skeleton(("a", "b"), (-1, 0), bones)


def test_slices_and_new_motion():
    class Layout:
        def take(self, frames):
            return frames

    whole = clip(5, source=Layout(), name="take")
    part = whole.slice(1, 3)
    assert (len(part), part.source.tolist(), part.name) == (2, [1, 2], "take")
    other = whole.with_motion(whole.rotation, whole.translation + 1)
    assert other.source is whole.source
    assert [4, 0] == whole.take([4, 0]).source.tolist() == whole.take(np.array([4, 0])).source.tolist()
    assert [2] == whole.take(np.arange(5) == 2).source.tolist() == whole.take([-3]).source.tolist()
    assert len(whole.take([])) == len(whole.take((0, 4))) - 2 == 0
    for wrong in ([5], 2, [0.5], [[1]]):
        with pytest.raises(RequestError, match="there are no frames"):
            whole.take(wrong)
    assert (whole.translation == 0).all()
    assert whole.seconds == pytest.approx(5 / 30)


def test_roots_cannot_be_left_out_of_what_is_translated():
    whole = clip()
    with pytest.raises(RequestError, match="is not translated"):
        replace(whole, translation=whole.translation[:, :1], translated=(0,))


def test_what_a_prompt_shows_of_a_clip_is_a_line():
    """And not its numbers: there may be millions of them."""
    take = clip(60, name="take")
    seen = Observation.from_gaps(take, [Gap(10, 20)])
    assert repr(take) == "<Clip 'take': 60 frames at 30 fps (2.0 s), 4 joints>"
    assert repr(take.skeleton) == "<Skeleton: 4 joints below hips, prop>"
    assert repr(seen) == "<Observation: 4 joints, all known in 50 of 60 frames>"
    done = complete(take, seen, Linear())
    assert repr(done) == f"<Completion of {take!r}>\n{done.report}"
    assert repr(done.report) == f"<Report of linear>\n{done.report}"


@pytest.mark.parametrize("factor", [1.2, 0.0])
def test_rest_rotations_are_unit_quaternions(factor):
    """And those that are rounded are made so: else every rotation below them would grow."""
    rest = np.tile([0.6, 0.8, 0, 0], (4, 1))
    made = replace(skeleton(), rest_rotation=1.0001 * rest).rest_rotation
    np.testing.assert_allclose(np.linalg.norm(made, axis=1), 1.0, atol=1e-12)
    rest[2] *= factor
    with pytest.raises(RequestError, match="rest_rotation holds no unit quaternions"):
        replace(skeleton(), rest_rotation=rest)


def test_what_is_masked_is_missing(cmu_walk):
    rotation = np.ma.masked_array(cmu_walk.rotation.copy(), mask=False)
    rotation[50:60] = np.ma.masked
    with pytest.raises(RequestError, match="no numbers"):
        cmu_walk.with_motion(rotation, cmu_walk.translation)
    seen = Observation.from_nan(cmu_walk.skeleton, rotation, cmu_walk.translation, 30)[1]
    assert not seen.rotation[50:60].any()
    assert seen.rotation[:50].all()


def test_clips_whose_rotations_mean_something_else_are_not_joined(cmu_walk):
    own = cmu_walk.skeleton
    parents = [0 if name == "LeftArm" else parent for name, parent in zip(own.names, own.parents)]
    rests = [*own.rest_rotation]
    rests[own.index("LeftArm")] = np.array([0.6, 0.8, 0.0, 0.0])
    for other in (
        replace(own, parents=parents),
        replace(own, rest_translation=own.rest_translation[:, [1, 2, 0]]),
        replace(own, rest_rotation=np.array(rests)),
    ):
        with pytest.raises(RequestError, match="hangs otherwise"):
            cmu_walk.joined([cmu_walk, replace(cmu_walk, skeleton=other)])
    taller = replace(cmu_walk, skeleton=replace(own, rest_translation=1.1 * own.rest_translation))
    assert len(cmu_walk.joined(iter([cmu_walk, taller]))) == 2 * len(cmu_walk)


def test_no_joint_is_translated_twice():
    with pytest.raises(RequestError, match="translated twice"):
        Clip(skeleton(), np.tile([1.0, 0, 0, 0], (3, 4, 1)), np.zeros((3, 3, 3)), 30, (0, 1, 0))
