"""Reading ASF/AMC: the skeleton's file is found, the unit made sure of, then numbers become a clip."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from interpose import skeletons
from interpose.clip import Clip, Skeleton
from interpose.formats import place
from interpose.formats.asf_amc.amc_text import AmcHeader, read_amc
from interpose.formats.asf_amc.asf import Asf, find_asf, read_asf
from interpose.formats.asf_amc.layout import Layout, bone_ends, bone_vectors, make_layout
from interpose.formats.changes import TextSource
from interpose.geometry.time import check_rate
from interpose.skeletons import find_mapping

FPS = 120.0  # of CMU and HDM05, and of most that is published in this form


@dataclass(frozen=True, eq=False, kw_only=True)
class AmcSource(TextSource):
    """What the two files have and a clip does not.

    Attributes:
        asf: the skeleton's file.
        header: what stands above the first frame.
        layout: which number means what; its `unit` is metres per file unit, its `up` the axis.
        fps: as read.
        asf_how, unit_how, up_how, fps_how: "given", or how it was found.
    """

    asf: Asf
    header: AmcHeader
    layout: Layout
    fps: float
    asf_how: str
    unit_how: str
    up_how: str
    fps_how: str

    @property
    def unit(self) -> float:
        """Metres per file unit."""
        return self.layout.unit

    @property
    def up(self) -> str:
        """The files' up axis, "y", "z", ..."""
        return self.layout.up

    def ends(self) -> np.ndarray:
        """(J, 3) metres, Y up: from each joint to the end of its bone in the rest pose."""
        return place.vectors_inside(bone_ends(self.asf), self.unit, self.up)

    def describe(self) -> tuple[str, ...]:
        """What was found out about the files, one line each, for printing."""
        return (
            f"skeleton: {self.asf.path.name}, {self.asf_how}",
            place.unit_line(self.unit, self.unit_how),
            f"up: {self.up.upper()}, {self.up_how}",
            f"frame rate: {self.fps:.4g} fps, {self.fps_how}",
        )


def read(
    path: Path,
    unit: float | str | None = None,
    up: str | None = None,
    skeleton: str | Path | None = None,
    fps: float | None = None,
    roles: Mapping[str, str] | None = None,
) -> Clip:
    """An AMC file and its ASF file as a clip in metres, Y up; `clip.source` is its AmcSource.

    The joints are the root and one a bone, at the bone's start; a bone's rotation turns what is below it.

    Args:
        path: the motion file.
        unit: metres per file unit, or one of m, cm, mm, inch, CMU. When None it is an inch divided by the
            length unit in the skeleton's file, as Vicon writes it (CMU and HDM05: 0.45), where that gives
            plausible legs, and else estimated from them.
        up: the axis that points up, "y", "z", "x", "-y", ...; estimated from the motion when None.
        skeleton: the skeleton's file; found beside the motion when None, see `find_asf`.
        fps: frames a second; when None what the file says, which few do, else 120.
        roles: what is said about the joints, see `Skeleton`.

    Raises:
        FileError: one of the files is missing or not sound.
        RequestError: an option is wrong.
    """
    scale, axis = place.given_unit(unit), place.given_up(up)
    if fps is not None:
        check_rate(fps)
    asf = read_asf(Path(skeleton) if skeleton is not None else find_asf(path))
    header, motion, columns = read_amc(path, asf)
    raw = make_layout(asf, columns, asf.degrees if header.degrees is None else header.degrees)

    starts = range(0, len(motion), motion.chunk)
    values = [motion.values(start, min(start + motion.chunk, len(motion))) for start in starts]
    names = tuple(bone.name for bone in asf.bones)
    parents = tuple(bone.parent for bone in asf.bones)
    rest = bone_vectors(asf)
    frames = place.sample_frames(len(motion))
    turned, moved = raw.decode(np.stack([values[f // motion.chunk][f % motion.chunk] for f in frames]))
    clip = Clip(Skeleton(names, parents, rest, roles=roles or {}), turned, moved, FPS, raw.translated)
    mapping = find_mapping(clip.skeleton)
    scale, unit_how = (scale, "given") if scale else _unit(asf, mapping, clip)
    axis, up_how = (axis, "given") if axis else place.estimate_up(mapping, clip)
    layout = replace(raw, unit=scale, up=axis)

    parts = [layout.decode(some) for some in values]
    rotation, translation = (np.concatenate(part) for part in zip(*parts))
    made = Skeleton(names, parents, place.vectors_inside(rest, scale, axis), roles=roles or {})
    if fps is not None:
        rate, fps_how = float(fps), "given"
    elif header.fps is not None:
        rate, fps_how = header.fps, "as the file says"
    else:
        rate, fps_how = FPS, "assumed, as the file does not say it"
    asf_how = "given" if skeleton is not None else "found beside it"
    source = AmcSource(
        motion=motion,
        skeleton=made,
        at=np.arange(len(motion)),
        asf=asf,
        header=header,
        layout=layout,
        fps=rate,
        asf_how=asf_how,
        unit_how=unit_how,
        up_how=up_how,
        fps_how=fps_how,
    )
    return Clip(made, rotation, translation, rate, layout.translated, path.stem, source)


def _unit(asf: Asf, mapping: skeletons.Mapping, clip: Clip) -> tuple[float, str]:
    """Metres per file unit, and how it was found.

    The specification leaves open what the length unit multiplies to; Vicon's files are in inches times it.
    """
    size = place.INCH / asf.length
    how = f"an inch divided by the skeleton's length unit {asf.length:g}"
    leg = mapping.leg_length
    if not np.isfinite(leg) or place.LEG[0] <= size * leg <= place.LEG[1]:
        return size, how
    return place.estimate_unit(mapping, clip)
