"""Random windows of packed clips, assembled on the device that trains."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor

from interpose.datasets import Pack
from interpose.errors import RequestError
from interpose.skeletons import ACROSS, SIDES
from interpose.training.device import send

STEP = 1 / 16384  # metres: positions relative to the hips in 16 bits reach 2 m at .06 mm
SHORTEST = 30  # frames; shorter clips do not train, longer ones than this are padded with their last pose


class Windows:
    """All clips of some splits of some packs, in memory.

    Clips are drawn in proportion to their length and windows uniformly within a clip. Clips shorter than
    the window repeat their last pose, as in Kaufmann et al. 2020.
    """

    def __init__(
        self, packs: Sequence[Pack], splits: Sequence[str], length: int, device: torch.device
    ) -> None:
        offset, hips, counts = [], [], []
        for pack in packs:
            positions = pack.positions()
            for clip in range(len(pack.names)):
                start, stop = pack.starts[clip], pack.starts[clip + 1]
                if pack.splits[clip] in splits and stop - start >= SHORTEST:
                    body = positions[start:stop]
                    offset.append(np.rint((body - body[:, :1]) / STEP).astype(np.int16))
                    hips.append(body[:, 0])
                    counts.append(stop - start)
        if not counts:
            raise RequestError(
                "there is nothing to train on",
                f"the packs hold no clip of {', '.join(splits)} with {SHORTEST} frames or more",
                "Make packs with: interpose data pack.",
            )
        self.length, self.device = length, device
        self.counts = np.array(counts)
        self.starts = np.concatenate([[0], np.cumsum(counts)])[:-1]
        self.offset = torch.from_numpy(np.concatenate(offset)).to(device)
        self.hips = torch.from_numpy(np.concatenate(hips)).to(device)
        self.sides = torch.tensor(SIDES, device=device)

    @property
    def frames(self) -> int:
        return int(self.counts.sum())

    def at(self, clip: np.ndarray, first: np.ndarray) -> Tensor:
        """Windows (B, T, 22, 3) in metres, of the given clips from the given frames on."""
        inside = np.minimum(first[:, None] + np.arange(self.length), self.counts[clip][:, None] - 1)
        index = send(self.starts[clip][:, None] + inside, self.device)
        return self.hips[index][:, :, None] + self.offset[index].to(torch.float32) * STEP

    def draw(self, rng: np.random.Generator, batch: int, mirror: bool = True) -> Tensor:
        """A random batch (B, T, 22, 3) in metres, half of it mirrored left to right."""
        clip = rng.choice(len(self.counts), batch, p=self.counts / self.counts.sum())
        first = (rng.random(batch) * (np.maximum(self.counts[clip] - self.length, 0) + 1)).astype(int)
        positions = self.at(clip, first)
        if mirror:
            flip = send(rng.random(batch) < 0.5, self.device)[:, None, None, None]
            mirrored = positions[:, :, self.sides] * ACROSS.beside(positions)
            positions = torch.where(flip, mirrored, positions)
        return positions

    def spread(self, count: int) -> Tensor:
        """A fixed set of whole windows (n, T, 22, 3) spread evenly over all clips, for validation."""
        whole = [
            (clip, first)
            for clip, frames in enumerate(self.counts)
            for first in range(0, frames - self.length + 1, self.length // 2)
        ]
        if not whole:
            raise RequestError(
                f"no clip that is held out has the {self.length} frames that are judged",
                f"the longest one has {self.counts.max()} at 30 fps",
                "Hold out longer clips.",
            )
        chosen = np.array(whole)[np.linspace(0, len(whole) - 1, min(count, len(whole))).astype(int)]
        return self.at(chosen[:, 0], chosen[:, 1])
