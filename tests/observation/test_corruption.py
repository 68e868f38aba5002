"""Masks for training: shapes, what always stays, and the distributions of the papers."""

from __future__ import annotations

import numpy as np
import pytest

from interpose.observation import corruption

MASKS = {
    "gap": lambda rng: corruption.gap_mask(rng, 50, 40, 22, 10, 4),
    "joints": lambda rng: corruption.joints_mask(rng, 50, 40, 22),
    "joints per frame": lambda rng: corruption.joints_per_frame_mask(rng, 50, 40, 22, 0.3),
    "occluded joints": lambda rng: corruption.occluded_joints_mask(rng, 50, 40, 22, 0.8),
    "occluded chains": lambda rng: corruption.occluded_chains_mask(rng, 50, 40, 22, 0.8, per_frame=True),
    "missing frames": lambda rng: corruption.missing_frames_mask(rng, 50, 40, 22, 0.8),
}


@pytest.mark.parametrize("name", MASKS)
def test_masks_are_seeded_and_miss_something(name):
    mask = MASKS[name](np.random.default_rng(1))
    assert mask.shape == (50, 40, 22)
    assert mask.dtype == bool
    assert (mask == MASKS[name](np.random.default_rng(1))).all()
    assert (mask != MASKS[name](np.random.default_rng(2))).any()
    assert (~mask).any(axis=(1, 2)).all()
    assert not (mask == mask[:1]).all()


@pytest.mark.parametrize("name", ["gap", "missing frames"])
def test_whole_poses_go_and_the_ends_stay(name):
    mask = MASKS[name](np.random.default_rng(1))
    assert (mask == mask[:, :, :1]).all()
    assert mask[:, [0, -1]].all()


@pytest.mark.parametrize("name", ["joints", "joints per frame"])
def test_the_root_stays(name):
    assert MASKS[name](np.random.default_rng(1))[:, :, 0].all()


def test_gaps_have_the_length_and_place_of_the_paper():
    mask = corruption.gap_mask(np.random.default_rng(0), 20000, 120, 1, 30, 10)[:, :, 0]
    edges = np.diff(mask.astype(int), axis=1)
    assert ((edges == -1).sum(axis=1) == 1).all(), "one gap each"
    length = (~mask).sum(axis=1)
    assert abs(length.mean() - 30) < 0.3
    assert abs(length.std() - 10) < 0.3
    # Uniform: the free frames before the gap are any share of all free frames.
    share = (edges.argmin(axis=1) + 1 - 1) / (120 - length - 1)
    assert abs(share.mean() - 0.5) < 0.02
    assert abs(np.quantile(share, 0.25) - 0.25) < 0.02


def test_lengths_are_cut_to_the_clip():
    mask = corruption.gap_mask(np.random.default_rng(0), 500, 10, 3, 5, 50)
    missing = (~mask[:, :, 0]).sum(axis=1)
    assert missing.min() == 1
    assert missing.max() == 8


def test_one_to_three_whole_joints_are_missing():
    mask = corruption.joints_mask(np.random.default_rng(0), 3000, 5, 22)
    assert (mask == mask[:, :1]).all()
    counts = np.bincount((~mask[:, 0]).sum(axis=1), minlength=4)
    assert counts[0] == 0
    assert (counts[1:4] > 900).all()
    assert (~mask[:, 0, 1:]).any(axis=0).all(), "any joint can go"


def test_joints_go_with_their_probability():
    joints = corruption.joints_per_frame_mask(np.random.default_rng(0), 20, 100, 22, 0.3)
    assert abs((~joints[:, :, 1:]).mean() - 0.3) < 0.01


@pytest.mark.parametrize("precision", ["float32", "float64"])
def test_noise(precision):
    positions = np.full((50, 40, 22, 3), 2.0, precision)
    noisy = corruption.gaussian_noise(np.random.default_rng(0), positions, 0.0625)
    assert noisy.dtype == positions.dtype
    assert abs((noisy - positions).std() - 0.0625) < 1e-3
    assert abs((noisy - positions).mean()) < 1e-3


@pytest.mark.parametrize("per_frame", [False, True])
def test_an_exact_share_of_the_joints_is_occluded(per_frame):
    mask = corruption.occluded_joints_mask(np.random.default_rng(0), 30, 40, 22, 0.8, per_frame)
    assert mask[:, [0, -1]].all()
    assert ((~mask[:, 1:-1]).sum(axis=2) == 18).all()
    same = (mask[:, 1:-1] == mask[:, 1:2]).all(axis=(1, 2))
    assert same.all() != per_frame
    assert (~mask[:, 1]).any(axis=0).all(), "any joint can go, the root too"


def test_draws_with_replacement_hide_as_much_as_the_public_code():
    """Of n joints or frames .8 n draws leave (1 - 1 / n) to that power."""
    rng = np.random.default_rng(0)
    joints = corruption.occluded_joints_mask(rng, 3000, 3, 22, 0.8, repeats=True)
    assert abs(joints[:, 1].mean() - (1 - 1 / 22) ** 17) < 0.01
    frames = corruption.missing_frames_mask(rng, 500, 120, 2, 0.8, repeats=True)
    assert frames[:, [0, -1]].all()
    assert abs(frames[:, 1:-1].mean() - (1 - 1 / 118) ** 94) < 0.01


def test_an_exact_share_of_the_frames_is_missing():
    mask = corruption.missing_frames_mask(np.random.default_rng(0), 50, 120, 22, 0.8)
    assert ((~mask[:, :, 0]).sum(axis=1) == 94).all()


@pytest.mark.parametrize("per_frame", [False, True])
def test_whole_chains_are_occluded_until_it_is_enough(per_frame):
    mask = corruption.occluded_chains_mask(np.random.default_rng(0), 50, 40, 22, 0.8, per_frame)
    assert mask[:, [0, -1]].all()
    missing = ~mask[:, 1:-1].reshape(-1, 22)
    assert (missing.sum(axis=1) >= 0.8 * 22).all()
    whole = np.stack([missing[:, list(chain)].all(axis=1) for chain in corruption.CHAINS], axis=1)
    for gone, chains in zip(missing, whole):
        covered = {joint for chain, there in zip(corruption.CHAINS, chains) if there for joint in chain}
        assert set(np.flatnonzero(gone)) == covered
    assert (mask[:, 1:-1] == mask[:, 1:2]).all() != per_frame
    few = corruption.occluded_chains_mask(np.random.default_rng(0), 50, 4, 22, 0.1)
    assert ((~few[:, 1]).sum(axis=1) <= 5).all(), "one chain is enough"


def test_chains_make_up_the_body():
    assert {joint for chain in corruption.CHAINS for joint in chain} == set(range(22))


def test_single_coordinates_are_lost_in_transmission():
    mask = corruption.noisy_transmission_mask(np.random.default_rng(0), 4, 40, 22, 0.8)
    assert mask.shape == (4, 40, 22, 3)
    assert mask[:, [0, -1]].all()
    assert ((~mask).sum(axis=(1, 2, 3)) == round(0.8 * 38 * 66)).all()
    assert (mask.any(axis=-1) != mask.all(axis=-1)).any(), "a joint can lose a part"
    joints = corruption.noisy_transmission_mask(np.random.default_rng(0), 4, 40, 22, 0.8, by_joint=True)
    assert joints[:, [0, -1]].all()
    assert (joints == joints[..., :1]).all()
    assert abs(joints[:, 1:-1].mean() - 0.2) < 0.02
