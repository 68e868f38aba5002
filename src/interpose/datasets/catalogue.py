"""The clips of each data set in the layout in which it is published, with performer, label and split.

Splits are by performer and stand in splits.json; every recipe and benchmark obeys them.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from interpose.clip import Clip
from interpose.datasets import h36m
from interpose.errors import FileError, unknown
from interpose.formats import load

FPS = 30.0
SPLITS = ("train", "validation", "test")
_BVH_LENGTH = re.compile(rb"Frames:\s*(\d+)\s+Frame Time:\s*([\d.eE+-]+)")
_AMC_FRAME = re.compile(rb"^\d+\s*$", re.MULTILINE)


@dataclass(frozen=True)
class Entry:
    """One published clip; `part` is its name where that of the file alone does not say which it is."""

    dataset: str
    path: Path
    performer: str
    label: str
    trains_only: bool = False
    part: str = ""

    @property
    def name(self) -> str:
        return self.part or self.path.stem

    @property
    def split(self) -> str:
        return "train" if self.trains_only else split_of(self.dataset, self.performer)

    def load(self) -> Clip:
        """The clip, without the rest pose that CMU's BVH files begin with."""
        if self.dataset == "h36m":
            return h36m.load(self.path, self.part)
        clip = load(self.path)
        return clip.slice(1, len(clip)) if self._rests else clip

    @property
    def _rests(self) -> bool:
        """Whether its file begins with a rest pose."""
        return self.dataset == "cmu" and self.path.suffix == ".bvh"

    def seconds(self) -> float:
        """How long the clip is, without reading its motion."""
        if self.dataset == "h36m":
            return h36m.seconds(self.path, self.part)
        if self.path.suffix == ".amc":
            return len(_AMC_FRAME.findall(self.path.read_bytes())) / 120.0
        head = _BVH_LENGTH.search(self.path.read_bytes())
        return (int(head[1]) - int(self._rests)) * float(head[2]) if head else 0.0


@cache
def _splits() -> dict[str, dict[str, Any]]:
    return json.loads((files("interpose.datasets") / "splits.json").read_text())


def trains_shipped_weights(dataset: str) -> bool:
    """Whether weights that are given away may be trained on a data set."""
    return not _splits()[dataset].get("never_trains_shipped_weights", False)


def split_of(dataset: str, performer: str) -> str:
    """ "train", "validation" or "test"."""
    for split in ("test", "validation"):
        if performer in _splits()[dataset][split]:
            return split
    return "train"


def _lafan1(folder: Path) -> list[Entry]:
    found = []
    for part in ("bvh", "cuts", "."):
        for path in sorted((folder / part).glob("*.bvh")):
            match = re.fullmatch(r"([A-Za-z]+)\d+_(subject\d)(_.*)?", path.stem)
            if match:
                found.append(Entry("lafan1", path, match[2], match[1], trains_only=part == "cuts"))
    # What is cut out of the takes of others than training performers trains nothing.
    return [
        entry for entry in found if not entry.trains_only or split_of("lafan1", entry.performer) == "train"
    ]


def _bandai(folder: Path) -> list[Entry]:
    found = []
    for path in sorted(folder.glob("*/data/*.bvh")):
        if match := re.fullmatch(r"([^_]+)_([^_]+)_([^_]+)_\d+", path.stem):
            found.append(Entry("bandai", path, f"{match[1]}/{match[3]}", match[2]))
    return found


def _pfnn(folder: Path) -> list[Entry]:
    return [Entry("pfnn", path, "pfnn", "locomotion") for path in sorted(folder.glob("**/*.bvh"))]


def _cmu(folder: Path) -> list[Entry]:
    """A trial that is published in both forms counts once, as BVH."""
    paths = sorted(folder.glob("bvh/*/*.bvh"))
    known = {path.stem for path in paths}
    paths += [path for path in sorted(folder.glob("asf_amc/*/*.amc")) if path.stem not in known]
    return [Entry("cmu", path, path.parent.name, "") for path in paths]


def _hdm05(folder: Path) -> list[Entry]:
    found = []
    for path in sorted(folder.glob("**/HDM_*.amc")):
        if match := re.fullmatch(r"HDM_([^_]+)_([^_]+)(_.*)?", path.stem):
            found.append(Entry("hdm05", path, match[1], match[2]))
    return found


def _h36m(folder: Path) -> list[Entry]:
    return [
        Entry("h36m", path, subject, action, part=name) for path, subject, action, name in h36m.find(folder)
    ]


DATASETS: dict[str, Callable[[Path], list[Entry]]] = {
    "lafan1": _lafan1,
    "bandai": _bandai,
    "pfnn": _pfnn,
    "cmu": _cmu,
    "hdm05": _hdm05,
    "h36m": _h36m,
}


def clips(dataset: str, data: Path, split: str | None = None) -> list[Entry]:
    """The clips of a data set below `data`, all or those of one split, in a fixed order.

    Raises RequestError for an unknown data set or split, and FileError when there is nothing of it.
    """
    if dataset not in DATASETS:
        raise unknown("data set", dataset, DATASETS)
    if split not in (None, *SPLITS):
        raise unknown("split", split, SPLITS)
    found = DATASETS[dataset](Path(data) / dataset)
    if not found:
        raise FileError(
            f"no clips of {dataset}",
            f"there is no published layout of it below {Path(data) / dataset}",
            "docs/data.md says where to get each data set and how to unpack it; name the folder with --data.",
        )
    return [entry for entry in found if split in (None, entry.split)]
