"""Writing BVH: text that did not change is copied, changed numbers are written in its style."""

from __future__ import annotations

from typing import BinaryIO

import numpy as np

from interpose.clip import Clip
from interpose.errors import RequestError
from interpose.formats import angles, place
from interpose.formats.asf_amc.read import AmcSource
from interpose.formats.bvh.header import Header
from interpose.formats.bvh.read import BvhSource
from interpose.formats.changes import Lost, check_values, same_skeleton, translation_of, write_frames
from interpose.formats.text import DECIMALS
from interpose.geometry import rotations

CENTIMETRE = 0.01
UNWRITTEN = {*"{}"}  # in names


def write(clip: Clip, stream: BinaryIO) -> tuple[str, ...]:
    """Write the clip as BVH; returns notes on what the file cannot hold, usually none.

    A clip that was read from BVH and still has that skeleton keeps header and layout, and every number that
    did not change keeps its text: the clip's values are compared with those read, bit for bit. Any other clip
    gets a new header: centimetres, Y up, rotation order ZXY, six channels for roots and translated joints.
    Where it was read from AMC, End Sites are where its bones end.

    Raises RequestError for joint names that BVH cannot hold.
    """
    source = clip.source
    if isinstance(source, BvhSource) and same_skeleton(clip.skeleton, source.skeleton):
        return _write_changes(clip, source, stream)
    _write_new(clip, stream)
    return (*place.missized(clip, CENTIMETRE), *place.misread(clip, "y"))


# Changes to the text of a file --------------------------------------------------------------------------


def _write_changes(clip: Clip, source: BvhSource, stream: BinaryIO) -> tuple[str, ...]:
    motion = source.motion
    stream.write(_header(clip, source.header))
    stream.write(motion.text[len(source.header.text) : motion.starts[0]].tobytes())
    lost = Lost.nothing(len(clip.skeleton))

    def put(values: np.ndarray, known: np.ndarray, start: int, previous: np.ndarray) -> np.ndarray:
        return _put_motion(values, known, clip, source, start, previous, lost)

    write_frames(source, len(clip), put, stream, b"\r\n" if b"\r\n" in source.header.text else b"\n")
    return (*lost.notes(clip.skeleton.names), *place.misread(clip, source.up, source.up_how))


def _header(clip: Clip, header: Header) -> bytes:
    """The header's own text; only a new number of frames or another frame time is exchanged."""
    text, (a, b), (c, d) = header.text, header.frames_at, header.time_at
    frames = text[a:b] if len(clip) == header.frames else str(len(clip)).encode()
    seconds = text[c:d] if clip.fps == header.fps else f"{1 / clip.fps:.8g}".encode()
    return text[:a] + frames + text[b:c] + seconds + text[d:]


def _put_motion(
    values: np.ndarray,
    known: np.ndarray,
    clip: Clip,
    source: BvhSource,
    start: int,
    previous: np.ndarray,
    lost: Lost,
) -> np.ndarray:
    """Put the frames of the clip from `start` into `values` (n, C), which where `known` are the file's own.

    Returns (n, C) True where a number may have changed.
    """
    layout, stop = source.layout, start + len(values)
    rotation = clip.rotation[start:stop]
    translation = translation_of(clip, layout.translated, start, stop, lost)
    turned, moved = np.ones(rotation.shape[:2], bool), np.ones(translation.shape, bool)
    if known.any():
        was_rotation, was_translation = layout.decode(values[known])
        turned[known] = (rotation[known] != was_rotation).any(axis=-1)
        moved[known] = translation[known] != was_translation
    fresh = np.zeros(values.shape, bool)
    if moved.any():
        positions, moved = layout.positions(translation), place.axes_in_file(moved, layout.up)
        for k, columns in enumerate(layout.translation_columns):
            has = columns >= 0
            fresh[:, columns[has]] = moved[:, k, has]
            kept = values[:, columns[has]]
            values[:, columns[has]] = np.where(moved[:, k, has], positions[:, k, has], kept)
            if not has.all():
                lost.moved(layout.translated[k], np.abs(positions[:, k, ~has]).max() * layout.unit)
    lost.turned(
        angles.put(
            values,
            fresh,
            place.rotations_in_file(rotation, layout.up),
            turned,
            previous,
            layout.orders,
            layout.rotation_columns,
        )
    )
    return fresh


# A new file ---------------------------------------------------------------------------------------------


def _write_new(clip: Clip, stream: BinaryIO) -> None:
    skeleton = clip.skeleton
    if bad := [name for name in skeleton.names if not _fits(name)]:
        raise RequestError(
            f"cannot write a joint called {bad[0]!r} as BVH",
            "names in it are one line of text, with single blanks inside of them and no braces",
            "Rename it, or write .npz.",
        )
    offsets = skeleton.rest_translation * skeleton.scale_above[:, None] / CENTIMETRE
    source, ends = clip.source, np.zeros_like(offsets)
    if isinstance(source, AmcSource) and same_skeleton(skeleton, source.skeleton):
        ends = source.ends() / CENTIMETRE
    bones = np.round(offsets[[parent >= 0 for parent in skeleton.parents]], DECIMALS)
    check_values(bones)
    if bones.size and not bones.any():
        raise RequestError(
            "cannot write the skeleton as BVH", "all its bones have length zero", "Write .npz."
        )
    order: list[int] = []  # as the hierarchy is written: children directly below their parents
    lines = ["HIERARCHY"]
    open_joints: list[int] = []
    waiting = list(reversed(skeleton.roots))

    def close(depth: int) -> None:
        while len(open_joints) > depth:
            lines.append("\t" * (len(open_joints) - 1) + "}")
            open_joints.pop()

    while waiting:
        joint = waiting.pop()
        parent = skeleton.parents[joint]
        close(0 if parent < 0 else open_joints.index(parent) + 1)
        indent = "\t" * len(open_joints)
        order.append(joint)
        open_joints.append(joint)
        # A root's position is in its channels, so that it does not matter whether a reader adds the OFFSET.
        offset = np.zeros(3) if parent < 0 else offsets[joint]
        position = "Xposition Yposition Zposition " if joint in clip.translated else ""
        lines += [
            f"{indent}{'ROOT' if parent < 0 else 'JOINT'} {skeleton.names[joint]}",
            f"{indent}{{",
            f"{indent}\tOFFSET {_numbers(offset)}",
            f"{indent}\tCHANNELS {6 if position else 3} {position}Zrotation Xrotation Yrotation",
        ]
        below = skeleton.children[joint]
        waiting.extend(reversed(below))
        if not below:
            lines += [f"{indent}\tEnd Site", f"{indent}\t{{", f"{indent}\t\tOFFSET {_numbers(ends[joint])}"]
            lines += [f"{indent}\t}}"]
    close(0)
    lines += ["MOTION", f"Frames: {len(clip)}", f"Frame Time: {1 / clip.fps:.8f}", ""]
    stream.write("\n".join(lines).encode())
    _write_numbers(clip, order, stream)


def _fits(name: str) -> bool:
    """Whether BVH can hold a joint's name."""
    lone = any("\ud800" <= letter <= "\udfff" for letter in name)  # halves of letters are no text
    clean = name == " ".join(name.split()) and all(letter >= " " for letter in name)
    return bool(name) and clean and not lone and not UNWRITTEN & {*name}


def _numbers(vector: np.ndarray) -> str:
    return " ".join(f"{value:.{DECIMALS}f}" for value in np.round(vector, DECIMALS) + 0.0)


def _write_numbers(clip: Clip, order: list[int], stream: BinaryIO) -> None:
    chunk = max(1, (1 << 17) // (4 * len(order)))
    before = np.zeros((len(order), 3))
    for start in range(0, len(clip), chunk):
        part = slice(start, min(start + chunk, len(clip)))
        euler = np.degrees(rotations.to_euler(clip.rotation[part], "ZXY"))
        mirrored = euler * [1.0, -1.0, 1.0] + 180.0
        for row, two in zip(euler, mirrored):
            row += 360.0 * np.round((before - row) / 360.0)
            two += 360.0 * np.round((before - two) / 360.0)
            nearer = np.abs(two - before).sum(axis=1) < np.abs(row - before).sum(axis=1)
            row[nearer] = two[nearer]
            before = row
        columns = []
        for joint in order:
            if joint in clip.translated:
                scale = clip.skeleton.scale_above[joint] / CENTIMETRE
                columns.append(clip.translation[part, clip.translated.index(joint)] * scale)
            columns.append(euler[:, joint])
        rows = np.round(np.concatenate(columns, axis=1), DECIMALS) + 0.0
        check_values(rows)
        pattern = " ".join([f"%.{DECIMALS}f"] * rows.shape[1]) + "\n"
        stream.write("".join([pattern % tuple(row) for row in rows.tolist()]).encode())
