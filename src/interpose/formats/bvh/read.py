"""Reading BVH: estimating what the file does not say, then numbers to a clip."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from interpose.clip import Clip, Skeleton
from interpose.errors import FileError, unknown
from interpose.formats import place
from interpose.formats.bvh.header import Header, Node
from interpose.formats.bvh.layout import Layout, make_layout
from interpose.formats.bvh.motion_text import read_text
from interpose.formats.changes import TextSource
from interpose.skeletons import find_mapping

# A share of its OFFSET: what goes further along it in a twentieth of the frames does not add to it. Hips of
# who lies or crawls do, to .14 of their height at least in each of 1,545 excerpts of all data sets, of five
# seconds each.
ADDS = 0.12
# The share of where an OFFSET is largest from which on it has a height. In 12,000 excerpts of four data sets
# whose hips begin there 875 are read wrongly so, all of them additions, and 1,201 by the largest axis alone.
# Bones that go so many times as far along Z as along Y, and along Z furthest, have Z up.
HIGH, STEEPER = 0.15, 1.5


@dataclass(frozen=True, eq=False, kw_only=True)
class BvhSource(TextSource):
    """What a BVH file has and a clip does not.

    Attributes:
        header: the part above the motion, with its original text.
        layout: which column means what; its `unit` is metres per file unit, its `up` the axis.
        unit_how, up_how: "given", or how it was estimated.
        positions: "replace" or "add": what position channels of joints that are not roots do to the OFFSET;
            "none" when there are none. Roots' replace it, except where "add" was given.
        positions_how: as `unit_how`.
    """

    header: Header
    layout: Layout
    unit_how: str
    up_how: str
    positions: str
    positions_how: str

    @property
    def unit(self) -> float:
        """Metres per file unit."""
        return self.layout.unit

    @property
    def up(self) -> str:
        """The file's up axis, "y", "z", ..."""
        return self.layout.up

    @property
    def fps(self) -> float:
        return self.header.fps

    def describe(self) -> tuple[str, ...]:
        """What was found out about the file, one line each, for printing."""
        lines = [place.unit_line(self.unit, self.unit_how), f"up: {self.up.upper()}, {self.up_how}"]
        if self.positions != "none":
            verb = "replace" if self.positions == "replace" else "add to"
            lines.append(f"position channels: {verb} the OFFSET, {self.positions_how}")
        return tuple(lines)


def read(
    path: Path,
    unit: float | str | None = None,
    up: str | None = None,
    joint_positions: str | None = None,
    roles: Mapping[str, str] | None = None,
) -> Clip:
    """A BVH file as a clip in metres, Y up; `clip.source` is its BvhSource.

    Args:
        path: the file.
        unit: metres per file unit, or one of m, cm, mm, inch, CMU; estimated from the legs when None.
        up: the axis that points up, "y", "z", "x", "-y", ...; estimated from the motion when None.
        joint_positions: "replace" or "add": whether position channels replace the OFFSET or are added to it;
            None compares them with the OFFSET.
        roles: what is said about the joints, see `Skeleton`.

    Position channels of roots replace their OFFSET: in the data that people have (LAFAN1, PFNN, Autodesk and
    Blender exports) the OFFSET of a root is zero or one frame's position, and adding it would move the whole
    clip. With joint_positions="add" roots follow the letter of the format and are added to as well.

    Raises:
        FileError: the file is not a whole, sound BVH file.
        RequestError: an option is wrong.
    """
    scale, axis = place.given_unit(unit), place.given_up(up)
    if joint_positions not in (None, "replace", "add"):
        raise unknown("meaning of joint positions", joint_positions, ("replace", "add"))

    header, motion = read_text(path)
    nodes = header.nodes
    frames = place.sample_frames(len(motion))
    # Short clips are parsed once; of long ones the sample is parsed by itself, to keep memory small.
    short = motion.values(0, len(motion)) if len(motion) <= motion.chunk else None
    sample = np.concatenate([motion.values(f, f + 1) for f in frames]) if short is None else short[frames]

    raw = make_layout(nodes, added=False, unit=1.0, up="y")
    positions, positions_how = _joint_positions(nodes, raw, sample, joint_positions)
    raw = make_layout(nodes, joint_positions == "add" or positions == "add", 1.0, "y")
    raw = _keep_roots(raw, nodes, joint_positions)
    turned, moved = raw.decode(sample)
    skeleton = replace(_skeleton(nodes, raw, np.median(moved, axis=0), path), roles=roles or {})
    mapping = find_mapping(skeleton)
    clip = Clip(skeleton, turned, moved, header.fps, raw.translated)

    scale, unit_how = (scale, "given") if scale else place.estimate_unit(mapping, clip)
    axis, up_how = (axis, "given") if axis else place.estimate_up(mapping, clip)
    layout = replace(raw, unit=scale, up=axis)
    skeleton = replace(skeleton, rest_translation=layout.vectors(skeleton.rest_translation))

    rotation = np.empty((len(motion), len(nodes), 4))
    translation = np.empty((len(motion), len(layout.translated), 3))
    for start in range(0, len(motion), motion.chunk):
        part = slice(start, min(start + motion.chunk, len(motion)))
        values = motion.values(part.start, part.stop) if short is None else short
        rotation[part], translation[part] = layout.decode(values)
    source = BvhSource(
        motion=motion,
        skeleton=skeleton,
        at=np.arange(len(motion)),
        header=header,
        layout=layout,
        unit_how=unit_how,
        up_how=up_how,
        positions=positions,
        positions_how=positions_how,
    )
    return Clip(skeleton, rotation, translation, header.fps, layout.translated, path.stem, source)


def _joint_positions(
    nodes: tuple[Node, ...], layout: Layout, sample: np.ndarray, given: str | None
) -> tuple[str, str]:
    """Whether position channels of joints that are not roots replace the OFFSET or add to it.

    Every joint votes by its height, or where its OFFSET has none, by where it is along the axis on which that
    is largest, beside how far it goes there: it adds if it stays at zero and below. Hips below a root travel,
    and may be anywhere on the floor; they are low where people crawl, but not as low as that.
    """
    padded = np.concatenate([sample, np.zeros((len(sample), 1))], axis=1)
    bones = np.array([node.offset for joint, node in enumerate(nodes) if joint not in layout.translated])
    along = np.abs(bones.reshape(-1, 3)).sum(axis=0)
    up = 2 if along[2] > max(along[0], STEEPER * along[1]) else 1  # most files have Y up
    votes = []
    for joint, columns in zip(layout.translated, layout.translation_columns):
        if nodes[joint].parent < 0:
            continue
        offset = np.where(columns >= 0, nodes[joint].offset, 0.0)
        values, size = padded[:, columns], np.abs(offset).max()
        if size > 1e-6:
            axis = int(np.argmax(np.abs(offset) / (values.std(axis=0) + 0.1 * size)))
            axis = up if np.abs(offset[up]) > HIGH * size else axis
            votes.append(bool(np.percentile(values[:, axis] / offset[axis], 95) > ADDS))
    if all(nodes[joint].parent < 0 for joint in layout.translated):
        return "none", ""
    if given:
        return given, "given"
    if 2 * sum(votes) >= len(votes):
        return "replace", "as they are about the OFFSET"
    return "add", "as they are about zero"


def _keep_roots(layout: Layout, nodes: tuple[Node, ...], given: str | None) -> Layout:
    """Roots' channels replace their OFFSET unless "add" was asked for."""
    if given == "add":
        return layout
    base = layout.base.copy()
    for row, joint in enumerate(layout.translated):
        if nodes[joint].parent < 0:
            base[row, layout.translation_columns[row] >= 0] = 0.0
    return replace(layout, base=base)


def _skeleton(nodes: tuple[Node, ...], layout: Layout, median: np.ndarray, path: Path) -> Skeleton:
    """The skeleton in file units and axes. A bone that only the position channels give takes their median."""
    names: list[str] = []
    used = {node.name for node in nodes}
    seen: set[str] = set()
    for node in nodes:
        name, count = node.name, 1
        while name in seen or (count > 1 and name in used):
            count += 1
            name = f"{node.name}#{count}"
        seen.add(name)
        names.append(name)
    rest = np.array([node.offset for node in nodes])
    for row, joint in enumerate(layout.translated):
        if nodes[joint].parent >= 0 and not rest[joint].any():
            rest[joint] = median[row]
    if len(nodes) > len([n for n in nodes if n.parent < 0]) and not any(
        rest[j].any() for j, node in enumerate(nodes) if node.parent >= 0
    ):
        raise FileError(
            f"cannot read {path.name} as BVH",
            "all its bones have length zero",
            "Export the clip with its skeleton.",
        )
    return Skeleton(tuple(names), tuple(node.parent for node in nodes), rest)
