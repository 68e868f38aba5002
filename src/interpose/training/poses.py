"""Random windows of whole poses, positions and rotations, with labels; and new paths for them.

The Gaussian random path is that of Kim et al. 2022, section 4.3.2: a way over the floor between the same two
points, sampled from a Gaussian process, along which the body is turned.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from interpose.datasets import Pack
from interpose.datasets.pack import STEP
from interpose.errors import RequestError
from interpose.geometry import kinematics, rotations
from interpose.geometry.ground import turn
from interpose.geometry.time import sample_rotations_smooth, sample_smooth
from interpose.skeletons import ACROSS, ACROSS_TURN, PARENTS, SIDES
from interpose.skeletons.mirror import mirrored
from interpose.training.device import send


@dataclass
class Batch:
    """Windows of a body scaled to the canonical leg.

    Attributes:
        rotation: (B, T, 22, 4) canonical rotations, continuous in time.
        root: (B, T, 3) metres, the hips.
        bones: (B, 22, 3) metres, in the T-pose.
        label: (B,) index into the labels of the recipe.
    """

    rotation: Tensor
    root: Tensor
    bones: Tensor
    label: Tensor

    def positions(self) -> Tensor:
        """(B, T, 22, 3) metres."""
        move = self.bones[:, None].expand(*self.rotation.shape[:-1], 3)
        above = torch.arange(len(PARENTS), device=move.device)[:, None] == 0
        move = torch.where(above, self.root[:, :, None], move)
        return kinematics.forward(kinematics.local_rotations(self.rotation, PARENTS), move, PARENTS)[1]


def labels_of(packs: Sequence[Pack], splits: Sequence[str], before: Sequence[str] = ("",)) -> tuple[str, ...]:
    """All labels of the clips of some splits, sorted, after those of `before`.

    "" is for motions without one; a run that starts from weights keeps theirs, in their order. One that goes
    on has as many as when it began: it asks its record, not this.
    """
    found = {str(x) for pack in packs for x, s in zip(pack.labels, pack.splits) if s in splits}
    return (*before, *sorted(found - {*before}))


class Poses:
    """All clips of some splits that are long enough, in memory; `told` is what to say of them."""

    def __init__(
        self,
        packs: Sequence[Pack],
        splits: Sequence[str],
        labels: Sequence[str],
        longest: int,
        device: torch.device,
    ) -> None:
        turned, root, bones, label, counts, short = [], [], [], [], [], 0
        for pack in packs:
            for clip in range(len(pack.names)):
                part = slice(pack.starts[clip], pack.starts[clip + 1])
                if pack.splits[clip] not in splits:
                    continue
                if part.stop - part.start < longest:
                    short += 1
                else:
                    turned.append(pack.rotation[part])
                    root.append(pack.root[part])
                    bones.append(pack.bones[clip])
                    label.append(labels.index(name) if (name := str(pack.labels[clip])) in labels else 0)
                    counts.append(part.stop - part.start)
        if not counts:
            raise RequestError(
                "there is nothing to validate with"
                if "validation" in splits
                else "there is nothing to train on",
                f"the packs hold no clip of {', '.join(splits)} with {longest} frames or more",
                "Make packs of sets with performers of both (lafan1, bandai, cmu): interpose data pack.",
            )
        left = f" ({short} clip{'s' * (short != 1)} of less than {longest} frames left out)" if short else ""
        self.told = f"{sum(counts):,} frames of {', '.join(splits)}{left}"
        self.device, self.counts = device, np.array(counts)
        self.starts = np.concatenate([[0], np.cumsum(counts)])[:-1]
        self.turned = torch.from_numpy(np.concatenate(turned)).to(device)
        self.root = torch.from_numpy(np.concatenate(root)).to(device)
        self.bones = torch.from_numpy(np.array(bones, np.float32)).to(device)
        self.label = torch.tensor(label, device=device)
        self.sides = torch.tensor(SIDES, device=device)
        self.mirrored = torch.tensor(mirrored(labels), device=device)

    def at(self, clip: np.ndarray, first: np.ndarray, length: int) -> Batch:
        """Windows of the given clips from the given frames on."""
        index = send((self.starts[clip] + first)[:, None] + np.arange(length), self.device)
        turned = rotations.exp(self.turned[index].to(torch.float32) * STEP)
        # Rotation vectors jump where they pass half a turn; the rotations that they mean do not.
        turned = rotations.continuous(turned.transpose(0, 1)).transpose(0, 1)
        chosen = send(clip, self.device)
        return Batch(turned, self.root[index], self.bones[chosen], self.label[chosen])

    def draw(
        self, rng: np.random.Generator, batch: int, length: int, mirror: bool = True, pace: float = 0.0
    ) -> Batch:
        """A random batch, half of it mirrored left to right unless said otherwise; all of it faster or slower
        by a share of up to `pace`.

        Raises RequestError where no clip has `length` frames.
        """
        if pace:
            # No faster than the longest clip has frames for.
            most = max(self.counts.max() - 1, length - 1) / max(length - 1, 1)
            times = np.arange(length) * min((1 + pace) ** rng.uniform(-1, 1), most)
            whole = self.draw(rng, batch, int(np.ceil(times[-1] - 1e-6)) + 1, mirror)
            at = torch.from_numpy(times).to(self.device)
            rotation = sample_rotations_smooth(whole.rotation.transpose(0, 1), at).transpose(0, 1)
            root = sample_smooth(whole.root.transpose(0, 1), at).transpose(0, 1)
            return Batch(rotation, root, whole.bones, whole.label)
        weight = np.maximum(self.counts - length + 1, 0)
        if not weight.any():
            raise RequestError(
                f"no clip is long enough to learn from {length} frames",
                f"the longest one has {self.counts.max()} at 30 fps",
                "Give longer clips.",
            )
        clip = rng.choice(len(weight), batch, p=weight / weight.sum())
        drawn = self.at(clip, (rng.random(batch) * weight[clip]).astype(int), length)
        if not mirror:
            return drawn
        flip = send(rng.random(batch) < 0.5, self.device)[:, None, None]
        mirrored = drawn.rotation[:, :, self.sides] * ACROSS_TURN.beside(drawn.rotation)
        side = ACROSS.beside(drawn.root)
        return Batch(
            torch.where(flip[..., None], mirrored, drawn.rotation),
            torch.where(flip, drawn.root * side, drawn.root),
            torch.where(flip, drawn.bones[:, self.sides] * side, drawn.bones),
            torch.where(flip[:, 0, 0], self.mirrored[drawn.label], drawn.label),
        )

    def spread(self, count: int, length: int) -> Batch:
        """A fixed set of windows spread evenly over all clips, for validation."""
        whole = [(c, f) for c, n in enumerate(self.counts) for f in range(0, n - length + 1, length)]
        if not whole:
            raise RequestError(
                f"no clip that is held out has the {length} frames that are judged",
                f"the longest one has {self.counts.max()} at 30 fps",
                "Hold out longer clips.",
            )
        chosen = np.array(whole)[np.linspace(0, len(whole) - 1, min(count, len(whole))).astype(int)]
        return self.at(chosen[:, 0], chosen[:, 1], length)


def random_path(
    rng: np.random.Generator, x: np.ndarray, y: np.ndarray, sigma: float = 0.0, jitter: float = 1e-6
) -> np.ndarray | None:
    """A new `y` (T,) over the same `x` (T,), in metres, with the same two ends; None if x is not monotonic.

    From the Gaussian process with the squared exponential kernel, conditioned on the ends (equations 11-13).

    Args:
        x: the way along the line between the ends; it must grow.
        y: the way across it.
        sigma: how loosely the ends are met.
        jitter: added to the diagonal, so that Cholesky's decomposition exists.
    """
    if not (np.diff(x) > 0).all():
        return None
    ends = np.array([0, len(x) - 1])

    def kernel(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return np.exp(-0.5 * (a[:, None] - b) ** 2)

    cross = kernel(x, x[ends])
    gain = np.linalg.solve(kernel(x[ends], x[ends]) + (sigma**2 + jitter) * np.eye(2), cross.T).T
    covariance = kernel(x, x) - gain @ cross.T
    root = np.linalg.cholesky(covariance + jitter * np.eye(len(x)))
    path = gain @ y[ends] + root @ rng.standard_normal(len(x))
    # What jitter leaves open at the ends (a millimetre) is spread along the path.
    miss = y[ends] - path[ends]
    share = (x - x[0]) / (x[-1] - x[0])
    return path + (1 - share) * miss[0] + share * miss[1]


def new_path(rng: np.random.Generator, batch: Batch, which: np.ndarray) -> Batch:
    """The windows `which` (B,) walk another way between the same two points, turned along it."""
    # All at once: on a GPU each way that is asked for would wait.
    ways = batch.root.cpu().numpy().astype(float)
    moved, turned = ways.copy(), np.zeros(ways.shape[:2])
    for i in np.flatnonzero(which):
        line = ways[i, -1] - ways[i, 0]
        yaw = np.arctan2(line[0], line[2])
        flat = turn(ways[i], np.array(-yaw))  # the line lies along Z now
        across = random_path(rng, flat[:, 2], flat[:, 0])
        if across is None:
            continue
        before, after = (np.arctan2(np.gradient(a), np.gradient(flat[:, 2])) for a in (flat[:, 0], across))
        turned[i] = after - before
        moved[i] = turn(np.stack([across, flat[:, 1], flat[:, 2]], axis=-1), np.array(yaw))
    change, root = (send(some.astype(np.float32), batch.root.device) for some in (turned, moved))
    rotation = rotations.multiply(rotations.about("Y", change)[:, :, None], batch.rotation)
    return Batch(rotation, root, batch.bones, batch.label)
