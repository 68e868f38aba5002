"""One small file per data set, for training: canonical joint positions at 30 fps in 16 bits.

Test performers never enter a pack, so that no recipe can train on them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from interpose.datasets.catalogue import FPS, clips
from interpose.errors import FileError
from interpose.skeletons import JOINTS, find_mapping

STEP = 1 / 16384  # metres: positions relative to the hips in 16 bits reach 2 m at .06 mm.
JUMP = 0.4  # metres a frame at 30 fps; no body moves at 12 m/s here, so the recording is broken.


@dataclass(frozen=True)
class Pack:
    """The clips of a data set, laid end to end.

    Attributes:
        offset: (F, 22, 3) int16, joint positions relative to the hips in units of STEP, scaled to the
            canonical leg.
        hips: (F, 3) float32 metres, the hips, scaled likewise.
        starts: (C + 1,) first frame of each clip, and the end.
        names, performers, labels, splits: (C,) strings.
    """

    dataset: str
    offset: np.ndarray
    hips: np.ndarray
    starts: np.ndarray
    names: np.ndarray
    performers: np.ndarray
    labels: np.ndarray
    splits: np.ndarray

    def save(self, path: Path) -> None:
        np.savez_compressed(path, **self.__dict__)

    @classmethod
    def load(cls, path: Path) -> Pack:
        try:
            with np.load(path) as held:
                return cls(**{name: held[name][()] for name in cls.__dataclass_fields__})
        except (OSError, KeyError, ValueError) as reason:
            raise FileError(
                f"cannot read the pack {path}", str(reason), "Make it again with: interpose data pack."
            ) from None


def build_pack(dataset: str, data: Path, progress: Callable[[str], None] = lambda line: None) -> Pack:
    """Read all clips of a data set but the test performers', and pack them."""
    offsets, hips, entries = [], [], []
    for entry in clips(dataset, data):
        if entry.split == "test":
            continue
        clip = entry.load()
        step = max(1, round(clip.fps / FPS))
        mapping = find_mapping(clip.skeleton)
        positions = mapping.positions(clip.positions()[::step]) * mapping.scale
        if len(positions) < 2 or np.abs(np.diff(positions[:, 0], axis=0)).max() > JUMP:
            progress(f"left out: {entry.path.name} (too short, or the body jumps)")
            continue
        relative = np.rint((positions - positions[:, :1]) / STEP)
        if np.abs(relative).max() > 32767:
            progress(f"left out: {entry.path.name} (joints further than 2 m from the hips)")
            continue
        offsets.append(relative.astype(np.int16))
        hips.append(positions[:, 0].astype(np.float32))
        entries.append(entry)
    lengths = [len(h) for h in hips]
    return Pack(
        dataset,
        np.concatenate(offsets) if offsets else np.zeros((0, len(JOINTS), 3), np.int16),
        np.concatenate(hips) if hips else np.zeros((0, 3), np.float32),
        np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64),
        np.array([entry.path.stem for entry in entries]),
        np.array([entry.performer for entry in entries]),
        np.array([entry.label for entry in entries]),
        np.array([entry.split for entry in entries]),
    )
