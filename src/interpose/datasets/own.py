"""A user's own clips as a pack, a part of them held out: what a network is fine-tuned on, and judged by."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np

from interpose.clip import Clip
from interpose.datasets.catalogue import FPS
from interpose.datasets.pack import Pack, Part, assemble, unfit
from interpose.errors import FileError, InterposeError
from interpose.formats import FORMATS, load
from interpose.observation.gapfile import is_report, read_json
from interpose.resampling import resample

NAME = "own"
# Each fifth clip is held out; of fewer clips the last fifth of each.
FIFTH = 5


def own_pack(folder: Path, shortest: int, progress: Callable[[str], None] = lambda line: None) -> Pack:
    """Read all clips below a folder, in any format that can be read, and pack them.

    Clips that cannot be read or used are told to `progress` and left out.

    Args:
        folder: where the clips are, also in folders within it.
        shortest: frames at 30 fps that a held-out clip needs to be judged by.
        progress: told what is left out.

    Raises:
        FileError: no clip can be used, or none is long enough to be held out.
    """
    found: list[tuple[str, Clip]] = []
    same: dict[bytes, str] = {}  # names by motion
    if not folder.is_dir():
        raise FileError(
            f"there is no folder {folder}", "clips are looked for in a folder", "Name it with --data."
        )
    paths = sorted(path for path in folder.rglob("*") if path.suffix.lower() in FORMATS)
    for path in paths:
        name = str(path.relative_to(folder))
        if is_report(read_json(path.with_suffix(".json"))):
            progress(f"left out: {name} (the report beside it says that interpose made it)")
            continue
        try:
            clip = resample(load(path), FPS)
        except InterposeError as error:
            progress(f"left out: {name} ({error.what}: {error.why})")
            continue
        # A copy would be learned from and held out.
        way = clip.translation - clip.translation[:1]
        # Zeros have no sign so, as rotations have none.
        motion = np.abs(clip.rotation).round(4).tobytes() + (way.round(4) + 0.0).tobytes()
        if reason := unfit(clip):
            progress(f"left out: {name} ({reason})")
        elif motion in same:
            progress(f"left out: {name} (the motion of {same[motion]} once more)")
        else:
            same[motion] = name
            found.append((name, clip))
    if not found:
        raise FileError(
            f"no clips to learn from in {folder}",
            "none of its clips could be used" if paths else f"it holds no clip ({', '.join(FORMATS)})",
            "Name a folder of whole, clean takes.",
        )
    # Each fifth clip, where there are so many, and one of those is long enough to be judged by.
    apart = any(len(clip) >= shortest for _, clip in found[FIFTH - 1 :: FIFTH])
    parts, performers = [], dict[tuple[object, ...], str]()
    for number, (name, clip) in enumerate(found):
        # Who has the same joints and bones is taken for one performer.
        bones = (clip.skeleton.names, clip.skeleton.rest_translation.round(3).tobytes())
        performer = performers.setdefault(bones, str(len(performers)))
        cut = len(clip) - len(clip) // FIFTH
        if not apart:
            pieces = [("train", clip.slice(0, cut)), ("validation", clip.slice(cut, len(clip)))]
        else:
            pieces = [("validation" if number % FIFTH == FIFTH - 1 else "train", clip)]
        parts += [Part(piece, name, performer, "", split) for split, piece in pieces if len(piece) > 1]
    held = [part for part in parts if part.split == "validation" and len(part.clip) >= shortest]
    if not held:
        raise FileError(
            f"the clips in {folder} are too short",
            f"a fifth of them is held out, and no part of it has {shortest} frames at {FPS:g} fps",
            f"Add longer takes: {math.ceil(FIFTH * shortest / FPS)} s in one clip are enough.",
        )
    return assemble(NAME, parts)
