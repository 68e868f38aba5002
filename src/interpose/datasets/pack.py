"""One small file per data set, for training: canonical rotations at 30 fps in 16 bits.

Test performers never enter a pack, so that no recipe can train on them.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from interpose.clip import Clip
from interpose.datasets.catalogue import FPS, clips
from interpose.errors import FileError, InterposeError
from interpose.geometry import rotations
from interpose.resampling import resample
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
        except (OSError, KeyError, ValueError, TypeError, EOFError, BadZipFile, zlib.error) as reason:
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


@dataclass(frozen=True)
class Part:
    """A clip on its way into a pack, at 30 fps, and what the pack says of it."""

    clip: Clip
    name: str
    performer: str
    label: str
    split: str


def build_pack(dataset: str, data: Path, progress: Callable[[str], None] = lambda line: None) -> Pack:
    """Read all clips of a data set but the test performers', and pack them.

    Clips that cannot be read, are too short, or in which the body jumps, are told to `progress` and left out.
    """
    chosen: list[Part] = []
    for entry in clips(dataset, data):
        if entry.split != "test":
            try:
                clip = resample(entry.load(), FPS)
            except InterposeError as error:
                progress(f"left out: {entry.name} ({error.what}: {error.why})")
                continue
            if reason := unfit(clip):
                progress(f"left out: {entry.name} ({reason})")
            else:
                chosen.append(Part(clip, entry.name, entry.performer, entry.label, entry.split))
    return assemble(dataset, chosen)


def unfit(clip: Clip) -> str | None:
    """Why nothing can be learned from a clip at 30 fps, if so."""
    body = find_humanoid(clip)
    if not body.mapping.usable:
        return f"no humanoid: {', '.join(body.mapping.lacking)}"
    if len(clip) < 2 or np.abs(np.diff(body.root(clip) * body.scale, axis=0)).max() > JUMP:
        return "too short, or the body jumps"
    return None


def assemble(dataset: str, chosen: Sequence[Part]) -> Pack:
    """A pack of clips."""
    rests = dict(_rests(chosen))
    turned, roots = [np.zeros((0, len(JOINTS), 3), np.int16)], [np.zeros((0, 3), np.float32)]
    bones, bodies = [], []
    for part in chosen:
        body = find_humanoid(part.clip, rests[_rig(part)])
        turned.append(np.rint(rotations.log(body.rotations(part.clip)) / STEP).astype(np.int16))
        roots.append((body.root(part.clip) * body.scale).astype(np.float32))
        bones.append(body.bones * body.scale)
        bodies.append(body.body)
    shape = (len(chosen), len(JOINTS), 3)
    return Pack(
        dataset,
        np.concatenate(turned),
        np.concatenate(roots),
        np.array(bones, np.float32).reshape(shape),
        np.array(bodies, np.float32).reshape(shape),
        np.concatenate([[0], np.cumsum([len(part.clip) for part in chosen])]).astype(np.int64),
        *(np.array([getattr(p, name) for p in chosen]) for name in ("name", "performer", "label", "split")),
    )


Rig = tuple[str, tuple[str, ...], tuple[int, ...]]


def _rig(part: Part) -> Rig:
    """The performer and the joints of a clip: a performer may come on several skeletons."""
    return part.performer, part.clip.skeleton.names, part.clip.translated


def _rests(chosen: Sequence[Part]) -> Iterator[tuple[Rig, Rest]]:
    """The T-pose of each performer's skeletons, from a sample of all clips of that performer on that one."""
    for rig in {_rig(part) for part in chosen}:
        own = [part.clip for part in chosen if _rig(part) == rig]
        step = max(1, sum(map(len, own)) // POOL)
        pool = replace(
            own[0],
            rotation=np.concatenate([clip.rotation[::step] for clip in own]),
            translation=np.concatenate([clip.translation[::step] for clip in own]),
        )
        yield rig, find_humanoid(pool).rest
