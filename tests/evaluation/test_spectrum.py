"""Spectra, distances and the Frechet distance against facts that must hold."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import sqrtm
from scipy.ndimage import gaussian_filter1d

from interpose.evaluation import spectrum
from interpose.geometry import rotations
from interpose.methods import weights
from interpose.skeletons import JOINTS, PARENTS, find_humanoid

POOLED = pytest.mark.parametrize("pooled", [False, True])


@pytest.fixture
def noise():  # type: ignore[no-untyped-def]
    return np.random.default_rng(0).standard_normal((200, 30, 4, 3))


@pytest.fixture(scope="module")
def walk(cmu_walk):  # type: ignore[no-untyped-def]
    return find_humanoid(cmu_walk).as_canonical(cmu_walk)


@POOLED
def test_entropy_is_the_highest_for_white_noise_and_zero_for_what_stands_still(noise, pooled):
    low = gaussian_filter1d(noise, 2.0, axis=1)
    white, smooth = (spectrum.psent(one, pooled) for one in (noise, low))
    assert smooth < 0.7 * white < white <= np.log(30)
    still = np.repeat(noise[:, :1], 30, axis=1)
    assert spectrum.psent(still, pooled) < 1e-6
    if pooled:
        assert white > 0.99 * np.log(30), "noise of many sequences is even"


def test_entropy_of_known_spectra():
    """A wave with a whole number of periods has two lines, and a third where it is added to a constant."""
    t = np.arange(32)
    wave = np.cos(2 * np.pi * 3 * t / 32)
    assert spectrum.psent(wave[None, :, None]) == pytest.approx(np.log(2))
    shares = np.array([4.0, 1.0, 1.0]) / 6  # N^2 at 0, (N / 2)^2 at the lines
    assert spectrum.psent(1 + wave[None, :, None]) == pytest.approx(-(shares * np.log(shares)).sum())
    both = np.stack([wave, np.ones(32)])[..., None]
    assert spectrum.psent(both) == pytest.approx(np.log(2) / 2), "the mean over sequences"
    assert spectrum.psent(both, pooled=True) == pytest.approx(-(shares * np.log(shares)).sum(), abs=1e-6)


def test_what_is_zero_throughout_is_constant():
    assert spectrum.psent(np.zeros((2, 30, 3))) == 0
    assert spectrum.pskl(np.zeros((2, 30, 3)), np.ones((2, 30, 3))) == 0


@POOLED
def test_divergence(noise, pooled):
    low = gaussian_filter1d(noise, 1.0, axis=1)
    assert spectrum.pskl(noise, noise, pooled) == 0
    there, back = spectrum.pskl(noise, low, pooled), spectrum.pskl(low, noise, pooled)
    assert min(there, back) > 0.1
    assert there != pytest.approx(back, rel=0.1), "it has a direction"
    assert spectrum.pskl(noise[::2], noise[1::2], pooled) < 0.05 * min(there, back)
    assert spectrum.pskl(noise[::-1], low, pooled) == pytest.approx(there), "sets have no order"


def test_what_is_no_number_has_no_spectrum(noise):
    broken = noise.copy()
    broken[0, 3] = np.nan
    assert np.isnan(spectrum.psent(broken))
    assert np.isnan(spectrum.pskl(broken, noise))
    assert np.isnan(spectrum.pskl(noise, broken))


@POOLED
def test_spectra_do_not_depend_on_the_unit(noise, pooled):
    low = gaussian_filter1d(noise, 1.0, axis=1)
    assert spectrum.psent(1000 * low, pooled) == pytest.approx(spectrum.psent(low, pooled), rel=1e-6)
    one, other = (spectrum.pskl(scale * low, scale * noise, pooled) for scale in (1, 1000))
    assert one == pytest.approx(other, rel=1e-6)


def test_loud_sequences_count_more_only_when_pooled(noise):
    loud = gaussian_filter1d(noise, 2.0, axis=1)
    mixed = np.concatenate([noise[:100], 100 * loud[:100]])
    apart = (spectrum.psent(noise[:100]) + spectrum.psent(loud[:100])) / 2
    assert spectrum.psent(mixed) == pytest.approx(apart)
    quiet = spectrum.psent(loud[:100], pooled=True)
    assert spectrum.psent(mixed, pooled=True) == pytest.approx(quiet, rel=0.05)


def test_angles_know_neither_place_nor_heading_nor_size(walk):
    angles = spectrum.joint_angles(walk)
    assert angles.shape == (len(walk), 18, 3)
    turned = 1.3 * rotations.rotate(rotations.about("Y", np.array(2.0)), walk) + [3.0, 0, 1.0]
    assert np.abs(spectrum.joint_angles(turned) - angles).max() < 1e-9
    assert np.abs(np.diff(angles, axis=0)).max() < 0.5, "they do not wrap in a walk"


def test_the_code_s_angles_turn_back_along_the_bone_before(walk):
    """Of the left knee; twice converted, and with the signs of the code."""
    hip, knee, ankle = (walk[:, JOINTS.index(name)] for name in ("LeftUpLeg", "LeftLeg", "LeftFoot"))
    euler = -rotations.to_euler(rotations.between(hip - knee, ankle - knee), "XYZ")
    twice = -rotations.to_euler(rotations.exp(euler), "XYZ")
    ends = [joint for joint, parent in enumerate(PARENTS) if parent > 0]
    column = ends.index(JOINTS.index("LeftFoot"))
    assert np.allclose(spectrum.joint_angles(walk, code=True)[:, column], twice)


def test_distances_in_millimetres(walk):
    moved = walk.copy()
    moved[:, 0] += [0.003, 0, 0.004]
    assert spectrum.l2(walk, moved) == pytest.approx(np.full(len(walk), 5 / 22))
    samples = np.stack([walk, walk + np.array([0.001, 0, 0]), walk + np.array([0.004, 0, 0])])
    assert spectrum.diversity(samples) == pytest.approx(np.full(len(walk), (1 + 4 + 3) / 3))


def test_euler_angles_leave_out_the_root_and_what_does_not_move(cmu_walk):
    truth = cmu_walk.rotation[None]
    other = truth.copy()
    other[:, :, 0] = rotations.multiply(rotations.about("Y", np.array(1.0)), other[:, :, 0])
    assert spectrum.euler_l2(truth, other) == pytest.approx(np.zeros((1, len(cmu_walk))))
    angles = rotations.to_euler(truth, "XYZ")
    moving = np.argmax(angles[0, :, 1:, 2].std(axis=0)) + 1
    angles[:, :, moving, 2] += 0.3
    done = spectrum.euler_l2(truth, rotations.from_euler(angles, "XYZ"))
    assert done == pytest.approx(np.full((1, len(cmu_walk)), 0.3))
    still = np.flatnonzero(angles[0].std(axis=0).max(axis=-1) < spectrum.STILL)
    if still.size:
        angles[:, :, still] += 0.5
        assert spectrum.euler_l2(truth, rotations.from_euler(angles, "XYZ")) == pytest.approx(done)


def test_frechet_distance_of_known_gaussians():
    rng = np.random.default_rng(0)
    one = rng.standard_normal((4000, 3)) @ rng.standard_normal((3, 3))
    assert spectrum.frechet(one, one) == pytest.approx(0, abs=1e-6)
    assert spectrum.frechet(one, one + np.array([1.0, 2.0, 0])) == pytest.approx(5, rel=1e-6)
    assert spectrum.frechet(one, 3 * (one - one.mean(axis=0)) + one.mean(axis=0)) == pytest.approx(
        4 * np.trace(np.cov(one, rowvar=False)), rel=1e-6
    )
    other = rng.standard_normal((500, 3)) @ rng.standard_normal((3, 3)) + 1
    a, b = np.cov(one, rowvar=False), np.cov(other, rowvar=False)
    apart = one.mean(axis=0) - other.mean(axis=0)
    expected = apart @ apart + np.trace(a + b - 2 * sqrtm(a @ b).real)
    assert spectrum.frechet(one, other) == pytest.approx(expected)
    assert spectrum.frechet(one, other) == pytest.approx(spectrum.frechet(other, one))


def test_features_of_the_bottleneck(walk):
    """They know what the body does, not where; and a frozen pose is further away than another walk."""
    pytest.importorskip("onnx")
    path = weights.find("cae").onnx
    starts = np.arange(0, 89, 8)
    motions = np.stack([walk[start : start + 120] for start in starts])
    features = spectrum.bottleneck(motions, path)
    assert features.shape == (len(starts), 256)
    turned = rotations.rotate(rotations.about("Y", np.array(1.0)), motions) + np.array([50.0, 0, 20.0])
    assert np.abs(spectrum.bottleneck(turned, path) - features).max() < 1e-2 * np.abs(features).max()
    frozen = np.repeat(motions[:, :1], 120, axis=1)
    near, far = (
        spectrum.frechet(features[::2], other)
        for other in (features[1::2], spectrum.bottleneck(frozen, path)[::2])
    )
    assert far > 2 * near
    assert len(spectrum.digest(path)) == 64
