"""One small file per data set, for training: canonical rotations at 30 fps in 16 bits.

Test performers never enter a pack, so that no recipe can train on them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from interpose.clip import Clip
from interpose.datasets.catalogue import FPS, Entry, clips
from interpose.errors import FileError
from interpose.geometry import rotations
from interpose.geometry.time import resample
from interpose.skeletons import JOINTS, canonical_positions, find_humanoid
from interpose.skeletons.humanoid import THIGHS
from interpose.skeletons.rest import Rest

STEP = np.pi / 32767  # radians: rotation vectors in 16 bits, to .003 degrees
JUMP = 0.4  # metres a frame at 30 fps; no body moves at 12 m/s here, so the recording is broken.
POOL = 400  # frames of a performer's clips that together tell the T-pose of a skeleton without one
BLOCK = 8192  # frames whose positions are computed at once


@dataclass(frozen=True)
class Pack:
    """The clips of a data set, laid end to end.

    Attributes:
        dataset: its name.
        rotation: (F, 22, 3) int16, canonical rotations (see `Humanoid`) as rotation vectors in units of STEP.
        root: (F, 3) float32 metres, the hips, scaled to the canonical leg.
        bones: (C, 22, 3) float32 metres, each clip's bones in the T-pose, scaled likewise.
        body: (C, 22, 3) float32 metres, those of the canonical body on which networks see the clip.
        starts: (C + 1,) first frame of each clip, and the end.
        names, performers, labels, splits: (C,) strings.
    """

    dataset: str
    rotation: np.ndarray
    root: np.ndarray
    bones: np.ndarray
    body: np.ndarray
    starts: np.ndarray
    names: np.ndarray
    performers: np.ndarray
    labels: np.ndarray
    splits: np.ndarray

    def save(self, path: Path) -> None:
        np.savez_compressed(path, **self.__dict__)

    @classmethod
    def load(cls, path: Path) -> Pack:
        """Read a pack; FileError when it is none, or of an earlier version."""
        try:
            with np.load(path) as held:
                return cls(**{name: held[name][()] for name in cls.__dataclass_fields__})
        except (OSError, KeyError, ValueError) as reason:
            raise FileError(
                f"cannot read the pack {path}",
                str(reason),
                "Make it again with: interpose data pack --force.",
            ) from None

    @property
    def seconds(self) -> np.ndarray:
        """(C,) how long each clip is."""
        return np.diff(self.starts) / FPS

    def positions(self) -> np.ndarray:
        """(F, 22, 3) float32 metres: the motion on the canonical body, see `Humanoid.as_canonical`."""
        placed = np.empty(self.rotation.shape, np.float32)
        clip = np.repeat(np.arange(len(self.names)), np.diff(self.starts))
        for start in range(0, len(clip), BLOCK):
            part = slice(start, start + BLOCK)
            turned = rotations.exp(self.rotation[part] * np.float32(STEP))
            own, body = self.bones[clip[part]], self.body[clip[part]]
            thighs = own[:, THIGHS].mean(axis=1) - body[:, THIGHS].mean(axis=1)
            root = self.root[part] + rotations.rotate(turned[:, 0], thighs)
            placed[part] = canonical_positions(turned, root, body)
        return placed


def build_pack(dataset: str, data: Path, progress: Callable[[str], None] = lambda line: None) -> Pack:
    """Read all clips of a data set but the test performers', and pack them.

    Clips that are too short, or in which the body jumps, are told to `progress` and left out.
    """
    chosen: list[tuple[Entry, Clip]] = []
    for entry in clips(dataset, data):
        if entry.split == "test":
            continue
        clip = resample(entry.load(), FPS)
        body = find_humanoid(clip)
        if not body.mapping.usable:
            progress(f"left out: {entry.name} (no humanoid: {', '.join(body.mapping.lacking)})")
        elif len(clip) < 2 or np.abs(np.diff(body.root(clip) * body.scale, axis=0)).max() > JUMP:
            progress(f"left out: {entry.name} (too short, or the body jumps)")
        else:
            chosen.append((entry, clip))
    rests = dict(_rests(chosen))
    turned, roots = [np.zeros((0, len(JOINTS), 3), np.int16)], [np.zeros((0, 3), np.float32)]
    bones, bodies = [], []
    for entry, clip in chosen:
        body = find_humanoid(clip, rests[entry.performer])
        turned.append(np.rint(rotations.log(body.rotations(clip)) / STEP).astype(np.int16))
        roots.append((body.root(clip) * body.scale).astype(np.float32))
        bones.append(body.bones * body.scale)
        bodies.append(body.body)
    lengths = [len(clip) for _, clip in chosen]
    shape = (len(chosen), len(JOINTS), 3)
    return Pack(
        dataset,
        np.concatenate(turned),
        np.concatenate(roots),
        np.array(bones, np.float32).reshape(shape),
        np.array(bodies, np.float32).reshape(shape),
        np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64),
        np.array([entry.name for entry, _ in chosen]),
        np.array([entry.performer for entry, _ in chosen]),
        np.array([entry.label for entry, _ in chosen]),
        np.array([entry.split for entry, _ in chosen]),
    )


def _rests(chosen: list[tuple[Entry, Clip]]) -> Iterator[tuple[str, Rest]]:
    """The T-pose of each performer's skeleton, from a sample of all clips of that performer."""
    for performer in {entry.performer for entry, _ in chosen}:
        own = [clip for entry, clip in chosen if entry.performer == performer]
        first, total = own[0], sum(map(len, own))
        alike = [clip for clip in own if clip.skeleton.names == first.skeleton.names]
        step = max(1, total // POOL)
        pool = replace(
            first,
            rotation=np.concatenate([clip.rotation[::step] for clip in alike]),
            translation=np.concatenate([clip.translation[::step] for clip in alike]),
        )
        yield performer, find_humanoid(pool).rest
