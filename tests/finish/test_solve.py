"""From positions to rotations."""

from __future__ import annotations

import numpy as np
import pytest

from interpose.clip import Clip, Skeleton
from interpose.finish.solve import solve, solve_error
from interpose.geometry import rotations
from interpose.methods.classical import Linear, Spline
from interpose.observation import Gap, Observation

GAP = slice(40, 80)


def gaps_of(clip: Clip, *ranges: tuple[int, int]) -> Observation:
    return Observation.from_gaps(clip, [Gap(start, stop) for start, stop in ranges])


@pytest.fixture(scope="module")
def hidden(walk):
    known = gaps_of(walk, (40, 80))
    return Spline().complete(walk, known).clip, known


def test_true_positions_come_back_within_a_millimetre(walk, hidden, network_like):
    joints, positions = network_like(walk, sigma=0.0)
    base, known = hidden
    assert solve_error(base, joints, positions)[GAP].max() > 0.05
    assert solve_error(solve(base, known, joints, positions), joints, positions)[GAP].max() < 1e-3


def test_noisy_positions_are_met_better_than_their_noise(walk, hidden, network_like):
    joints, positions = network_like(walk, sigma=0.02)
    solved = solve(*hidden, joints, positions)
    assert solve_error(solved, joints, positions)[GAP].mean() < 0.013
    true = np.linalg.norm(solved.positions()[:, joints] - walk.positions()[:, joints], axis=-1)[GAP].mean()
    raw = np.linalg.norm(positions - walk.positions()[:, joints], axis=-1)[GAP].mean()
    assert true < 1.05 * raw


def test_too_long_bones_are_shared_out(walk, hidden, network_like):
    """3 % of a body is up to 5 cm at the head; what bones allow is much nearer."""
    joints, positions = network_like(walk, sigma=0.0, scale=1.03)
    assert solve_error(solve(*hidden, joints, positions), joints, positions)[GAP].mean() < 0.015


def test_observed_values_do_not_move(walk, hidden, network_like):
    joints, positions = network_like(walk, sigma=0.05)
    base, known = hidden
    arm = [walk.skeleton.index(n) for n in ("LeftArm", "LeftForeArm")]
    seen = np.ones_like(known.rotation)
    seen[GAP, arm] = False
    partly = Observation(seen, np.ones_like(seen))
    solved = solve(base, partly, joints, positions)
    assert np.array_equal(solved.rotation[seen], base.rotation[seen])
    assert np.array_equal(solved.translation, base.translation)
    assert not np.array_equal(solved.rotation[GAP, arm], base.rotation[GAP, arm])


def test_joints_that_positions_do_not_tell_keep_their_rotation(walk, hidden, network_like):
    base, known = hidden
    solved = solve(base, known, *network_like(walk))
    for name in ("LeftHandIndex1", "LThumb", "LHipJoint", "Head", "RightToeBase", "LeftHand"):
        joint = walk.skeleton.index(name)
        assert np.array_equal(solved.rotation[:, joint], base.rotation[:, joint]), name


def test_smooth_positions_give_smooth_rotations(walk, hidden, network_like):
    """The largest change of angular velocity stays in the range of the truth's."""
    base, known = hidden
    solved = solve(base, known, *network_like(walk, sigma=0.02))

    def shock(clip: Clip) -> np.ndarray:
        turns = rotations.log(rotations.multiply(rotations.conjugate(clip.rotation[:-1]), clip.rotation[1:]))
        return np.linalg.norm(np.diff(turns[GAP], axis=0), axis=-1)

    assert shock(solved).max() < 1.5 * shock(walk).max()
    assert np.sqrt((shock(solved) ** 2).mean()) < 1.3 * np.sqrt((shock(walk) ** 2).mean())


def test_the_bend_of_a_limb_tells_its_twist():
    """A forearm bent to the other side than in the classical pose turns the upper arm, not the elbow."""
    names = ("Hips", "LeftShoulder", "LeftArm", "LeftForeArm", "LeftHand")
    bones = np.array([[0, 1, 0], [0.1, 0.4, 0], [0.1, 0, 0], [0.3, 0, 0], [0.25, 0, 0]])
    skeleton = Skeleton(names, (-1, 0, 1, 2, 3), bones)
    rotation = np.tile([1.0, 0, 0, 0], (1, 5, 1))
    rotation[:, 3] = rotations.exp(np.array([0, 0, 1.2]))
    base = Clip(skeleton, rotation, np.zeros((1, 1, 3)), 30.0)
    twist = rotations.exp(np.array([0.9, 0, 0]))
    truth = base.with_motion(rotation.copy(), base.translation)
    truth.rotation[:, 2] = twist
    nothing = Observation(np.zeros((1, 5), bool), np.zeros((1, 5), bool))
    solved = solve(base, nothing, tuple(range(5)), truth.positions())
    assert rotations.angle(solved.rotation[0, 2], twist) < 0.02
    assert rotations.angle(solved.rotation[0, 3], rotation[0, 3]) < 0.02


def test_hips_below_a_still_root_carry_the_motion():
    """Two animated translations: the one of the topmost known joint moves, and within its parent's axes."""
    skeleton = Skeleton(
        ("root", "Hips", "Spine"), (-1, 0, 1), np.array([[0, 0, 0], [0, 1, 0], [0, 0.3, 0.0]])
    )
    rotation = np.tile([1.0, 0, 0, 0], (3, 3, 1))
    rotation[:, 0] = rotations.exp(np.array([0, 0.7, 0]))
    clip = Clip(skeleton, rotation, np.zeros((3, 2, 3)), 30.0, (0, 1))
    goal = np.array([[[0.2, 1.0, 0.5], [0.2, 1.3, 0.5]]] * 3)
    nothing = Observation(np.zeros((3, 3), bool), np.zeros((3, 3), bool))
    solved = solve(clip, nothing, (1, 2), goal)
    assert np.allclose(solved.positions()[:, 1:], goal, atol=1e-6)
    assert np.array_equal(solved.translation[:, 0], clip.translation[:, 0])


def test_only_the_root_is_missing(walk, network_like):
    known = Observation.full(walk)
    known.translation[GAP, 0] = False
    base = Linear().complete(walk, known).clip
    joints, positions = network_like(walk, sigma=0.0)
    solved = solve(base, known, joints, positions)
    assert np.allclose(solved.root, walk.root, atol=1e-6)
    assert np.array_equal(solved.rotation, walk.rotation)
