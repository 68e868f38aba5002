"""Forward kinematics against a plain loop over matrices, on random trees with several roots."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from interpose.geometry import kinematics, rotations


def tree(joints: int, seed: int, roots: int = 1) -> tuple[int, ...]:
    rng = np.random.default_rng(seed)
    return tuple(-1 if j < roots else int(rng.integers(0, j)) for j in range(joints))


def motion(joints: int, frames: int = 6, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    q = rng.normal(size=(frames, joints, 4))
    return q / np.linalg.norm(q, axis=-1, keepdims=True), rng.normal(size=(frames, joints, 3))


def slowly(q: np.ndarray, t: np.ndarray, parents: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
    """One joint of one frame after the other, with 4 x 4 matrices."""
    positions, turned = np.zeros(t.shape), np.zeros((*t.shape, 3))
    for frame in range(len(q)):
        done: list[np.ndarray] = []
        for joint, parent in enumerate(parents):
            m = np.eye(4)
            m[:3, :3] = Rotation.from_quat(q[frame, joint][[1, 2, 3, 0]]).as_matrix()
            m[:3, 3] = t[frame, joint]
            done.append(m if parent < 0 else done[parent] @ m)
            turned[frame, joint], positions[frame, joint] = done[-1][:3, :3], done[-1][:3, 3]
    return turned, positions


@pytest.mark.parametrize(("joints", "roots"), [(1, 1), (2, 2), (25, 1), (25, 3)])
def test_forward_kinematics(kind, joints, roots):
    parents = tree(joints, seed=joints, roots=roots)
    q, t = motion(joints)
    turned, positions = kinematics.forward(kind.array(q), kind.array(t), parents)
    expected_turned, expected = slowly(q, t, parents)
    scale = abs(expected).max()
    np.testing.assert_allclose(kind.numpy(positions), expected, atol=4 * scale * kind.tolerance)
    np.testing.assert_allclose(
        kind.numpy(rotations.to_matrix(turned)), expected_turned, atol=10 * kind.tolerance
    )


def test_one_skeleton_for_a_batch_of_clips(kind):
    parents = tree(8, seed=1)
    q, t = motion(8)
    bones = t[0]
    batch = kind.array(np.stack([q, q[::-1]]))
    _, positions = kinematics.forward(batch, kind.array(bones), parents)
    _, expected = slowly(q, np.broadcast_to(bones, t.shape), parents)
    np.testing.assert_allclose(kind.numpy(positions)[0], expected, atol=50 * kind.tolerance)
    np.testing.assert_allclose(kind.numpy(positions)[1], expected[::-1], atol=50 * kind.tolerance)


def test_global_to_local_is_the_inverse(kind):
    parents = tree(25, seed=5, roots=2)
    q, _ = motion(25)
    there = kinematics.global_rotations(kind.array(q), parents)
    back = kind.numpy(kinematics.local_rotations(there, parents))
    np.testing.assert_allclose(abs((back * q).sum(-1)), 1, atol=10 * kind.tolerance)


def test_gradient_flows_through_forward_kinematics():
    torch = pytest.importorskip("torch")
    parents = tree(7, seed=2)
    q, t = motion(7, frames=2)
    q, t = torch.tensor(q, requires_grad=True), torch.tensor(t[0], requires_grad=True)
    assert torch.autograd.gradcheck(lambda q, t: kinematics.forward(q, t, parents)[1], (q, t), atol=1e-6)


def test_autocast_keeps_joints_in_place():
    """Under bfloat16 autocast products of matrices lose digits: positions must not, by more than a little."""
    torch = pytest.importorskip("torch")
    parents = tree(22, seed=3)
    q, t = motion(22)
    q, t = torch.tensor(q, dtype=torch.float32), torch.tensor(t[0] * 0.2, dtype=torch.float32)
    _, expected = kinematics.forward(q, t, parents)
    with torch.autocast("cpu", dtype=torch.bfloat16, enabled=True):
        _, positions = kinematics.forward(q, t, parents)
    assert torch.isfinite(positions).all()
    assert (positions.float() - expected).abs().max() < 0.05
