"""What forecasts are judged by: spectra of motion, distances to the truth, spread, and a Frechet distance.

Spectra ask whether a set of motions moves as much, and in the same way, as another; they compare sets, never
a forecast with its own truth. A feature is one column of numbers over time, such as an axis of a joint.
Entropies depend on the number of frames and on the frame rate (the paper has 5 frames a second): log T is the
most that T frames can have.
"""

from __future__ import annotations

import hashlib
from itertools import combinations
from pathlib import Path

import numpy as np

from interpose.geometry import rotations
from interpose.geometry.ground import turn
from interpose.skeletons import PARENTS
from interpose.skeletons.body import facing

EPSILON = 1e-8
STILL = 1e-4  # radians (standard deviation): angles that move less do not count
BATCH = 64  # motions encoded at once


def psent(sequences: np.ndarray, pooled: bool = False) -> float:
    """Power spectrum entropy of a set of sequences, in nats: 0 for constant ones, the most for white noise.

    Hernandez Ruiz et al. 2019, equation 8, read so: the power spectrum of a feature is the squared magnitude
    of its discrete Fourier transform at all T frequencies, the constant one (DC) and negative ones among
    them, divided by its sum; a feature that is 0 throughout counts as constant. Entropies, by the natural
    logarithm, are averaged over features and sequences.

    Args:
        sequences: (S, T, ...) features over time.
        pooled: as the public code computes it, and the paper's table 1: spectra are first summed over all
            sequences, 1e-8 is added, and then each feature's sum is made 1.
    """
    shares = _shares(sequences, pooled)
    return float(-(shares * np.log(np.where(shares > 0, shares, 1.0))).sum(axis=1).mean())


def pskl(one: np.ndarray, other: np.ndarray, pooled: bool = False) -> float:
    """Kullback-Leibler divergence PSKL(one, other) between the power spectra of two sets, in nats.

    Hernandez Ruiz et al. 2019, equation 9, read so: the spectrum of a set is the mean of its sequences' own,
    each made to sum to 1 as in `psent`; 1e-8 is added to both, so that frequencies without power have a
    logarithm; the divergence is averaged over features. The other direction says more: about equal ones mean
    that both sets are as rich as each other.

    Args:
        one, other: (S, T, ...) features over time; as many frames and features, any number of sequences.
        pooled: spectra as in `psent`.
    """
    shares = (_shares(sequences, pooled).mean(axis=0) for sequences in (one, other))
    p, q = shares if pooled else (share + EPSILON for share in shares)
    return float((p * np.log(p / q)).sum(axis=0).mean())


def _shares(sequences: np.ndarray, pooled: bool) -> np.ndarray:
    """(S or 1, T, features) power by frequency, as shares of each feature's."""
    power = np.abs(np.fft.fft(sequences.reshape(*sequences.shape[:2], -1), axis=1)) ** 2
    if pooled:
        power = power.sum(axis=0, keepdims=True) + EPSILON
    total = power.sum(axis=1, keepdims=True)
    constant = (np.arange(power.shape[1]) == 0)[:, None]
    return np.where(total == 0, constant, power / np.where(total == 0, 1.0, total))


def joint_angles(positions: np.ndarray, code: bool = False) -> np.ndarray:
    """How bones are turned against the ones before them, for spectra: motion without place and heading.

    Hernandez Ruiz et al. 2019, section 7.1, leave open how angles come from coordinates. Here a bone's turn
    is the smallest one from the direction of the bone before it, in the axes of a body that faces ahead.

    Args:
        positions: (..., 22, 3) canonical positions.
        code: as in the public code, in the axes of the world and from the direction back along the bone
            before, so that a straight limb is turned by half a circle; and converted twice: Euler angles,
            with the other sign, are taken for rotation vectors and made Euler angles once more.

    Returns:
        (..., 18, 3) radians, Euler angles about X, Y and Z; of all joints whose parent is not the hips.
    """
    if not code:
        positions = turn(positions, -facing(positions)[..., None])
    ends = [joint for joint, parent in enumerate(PARENTS) if parent > 0]
    middles = [PARENTS[joint] for joint in ends]
    starts = [PARENTS[joint] for joint in middles]
    before = positions[..., middles, :] - positions[..., starts, :]
    bones = positions[..., ends, :] - positions[..., middles, :]
    angles = rotations.to_euler(rotations.between(-before if code else before, bones), "XYZ")
    return -rotations.to_euler(rotations.exp(-angles), "XYZ") if code else angles


def l2(truth: np.ndarray, other: np.ndarray) -> np.ndarray:
    """(...) millimetres between joints (..., J, 3) in metres, in the mean over joints.

    Source: Hernandez Ruiz et al. 2019, equation 10, for each frame.
    """
    return 1000 * np.linalg.norm(truth - other, axis=-1).mean(axis=-1)


def euler_l2(truth: np.ndarray, other: np.ndarray) -> np.ndarray:
    """(S, T) the norm of the difference of all joints' Euler angles, in radians, for each frame.

    As Martinez et al. 2017 measure: the first joint is left out, as is the translation, and so are angles
    that do not move in the truth; differences are not wrapped. Their angles are those about X, Y and Z with
    the other sign.

    Args:
        truth, other: (S, T, J, 4) local rotations.
    """
    angles, others = (rotations.to_euler(q[:, :, 1:], "XYZ") for q in (truth, other))
    moving = angles.std(axis=1, keepdims=True) > STILL
    return np.sqrt((np.where(moving, angles - others, 0.0) ** 2).sum(axis=(-2, -1)))


def diversity(samples: np.ndarray) -> np.ndarray:
    """(...) millimetres between samples (N, ..., J, 3) of the same, in the mean over pairs and joints.

    Of samples (N, T, J, 3) of one forecast this is by how much they spread at each frame. Source: Hernandez
    Ruiz et al. 2019, section 7.1, noise injection.
    """
    return np.mean([l2(one, other) for one, other in combinations(samples, 2)], axis=0)


def frechet(one: np.ndarray, other: np.ndarray) -> float:
    """Frechet distance between Gaussians fitted to two sets of features (n, d) and (m, d).

    It falls with more samples, so sets should be about as large; with fewer than d the fit is flat in some
    directions. Source: Heusel et al. 2017.
    """
    first, second = np.cov(one, rowvar=False), np.cov(other, rowvar=False)
    # The trace of the root of their product is the sum of the roots of its eigenvalues.
    roots = np.sqrt(np.maximum(np.linalg.eigvals(first @ second).real, 0.0))
    apart = one.mean(axis=0) - other.mean(axis=0)
    return float(max(apart @ apart + np.trace(first) + np.trace(second) - 2 * roots.sum(), 0.0))


def bottleneck(positions: np.ndarray, path: Path) -> np.ndarray:
    """Features (n, 256) of canonical motions (n, T, 22, 3) for `frechet`, from the frozen encoder of `cae`.

    They are the bottleneck of the autoencoder, in the mean over time and over rows of the motion's image. It
    was trained on windows of 120 frames, and is good for these.

    Args:
        positions: metres of a body scaled to the canonical leg, Y up, at 30 fps.
        path: the graph. Distances by other weights are other numbers: say `digest(path)` with each.

    Raises ModuleNotFoundError without the package onnx, which is in the extra `train`.
    """
    import onnx
    import onnxruntime

    model = onnx.load(path)
    last = [node.output[0] for node in model.graph.node if node.op_type == "MaxPool"][-1]
    model.graph.output.append(onnx.ValueInfoProto(name=last))
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    session = onnxruntime.InferenceSession(
        model.SerializeToString(), options, providers=["CPUExecutionProvider"]
    )
    near = (positions - positions[:, :1, :1] * [1.0, 0.0, 1.0]).astype(np.float32)
    features = []
    for start in range(0, len(near), BATCH):
        part = near[start : start + BATCH]
        (seen,) = session.run([last], {"positions": part, "observed": np.ones(part.shape[:-1], bool)})
        features.append(seen.mean(axis=(2, 3)))
    return np.concatenate(features).astype(float)


def digest(path: Path) -> str:
    """The SHA-256 of a file, in hexadecimal."""
    return hashlib.sha256(path.read_bytes()).hexdigest()
