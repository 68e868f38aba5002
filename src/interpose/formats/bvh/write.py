"""Writing BVH: text that did not change is copied, changed numbers are written in its style."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import BinaryIO

import numpy as np

from interpose.clip import Clip
from interpose.formats.bvh.header import Header
from interpose.formats.bvh.layout import Layout
from interpose.formats.bvh.motion_text import MotionText
from interpose.formats.bvh.read import BvhSource
from interpose.geometry import rotations

_WORD = re.compile(rb"(\S+)")
DECIMALS = 6  # of files without a source
LEAST_DECIMALS, MOST_DECIMALS = 4, 12  # of changed numbers, whatever the file's own have
CENTIMETRE = 0.01


def write(clip: Clip, stream: BinaryIO) -> tuple[str, ...]:
    """Write the clip as BVH; returns notes on what the file cannot hold, usually none.

    A clip that was read from BVH and still has that skeleton keeps header and layout, and every number that
    did not change keeps its text: the clip's values are compared with those read, bit for bit. Any other clip
    gets a new header: centimetres, Y up, rotation order ZXY, six channels for roots and translated joints.
    """
    source = clip.source
    if isinstance(source, BvhSource) and _same_skeleton(clip, source):
        return _write_changes(clip, source, stream)
    _write_new(clip, stream)
    return ()


def _same_skeleton(clip: Clip, source: BvhSource) -> bool:
    mine, other = clip.skeleton, source.skeleton
    return mine is other or (
        mine.names == other.names
        and mine.parents == other.parents
        and np.array_equal(mine.rest_translation, other.rest_translation)
        and np.array_equal(mine.rest_scale, other.rest_scale)
    )


# Changes to the text of a file --------------------------------------------------------------------------


def _write_changes(clip: Clip, source: BvhSource, stream: BinaryIO) -> tuple[str, ...]:
    motion = source.motion
    stream.write(_header(clip, source.header))
    stream.write(motion.text[len(source.header.text) : motion.starts[0]].tobytes())
    style = _style(motion)
    line_end = b"\r\n" if b"\r\n" in source.header.text else b"\n"
    pattern = motion.raw(len(motion) - 1, len(motion)).rstrip() + line_end
    lost = _Lost(np.zeros(len(clip.skeleton)), np.zeros(len(clip.skeleton)))
    previous = np.zeros(motion.channels)

    def kept(start: int, stop: int) -> bytes:
        """The original text of some frames. The last one may lack a line end that it needs now."""
        text = motion.raw(start, stop) if start < stop else b""
        return text.rstrip() + line_end if text and stop == len(motion) < len(clip) else text

    for start in range(0, len(clip), motion.chunk):
        stop = min(start + motion.chunk, len(clip))
        known = max(0, min(stop, len(motion)) - start)
        values = np.zeros((stop - start, motion.channels))
        if known:
            values[:known] = motion.values(start, start + known)
        old = values[:known].copy()
        fresh = _put_motion(values, known, clip, source, start, previous, lost)
        previous = values[-1].copy()
        values = np.round(values, style.decimals) + 0.0  # no negative zeros
        # What comes out the same to the last written decimal did not change.
        fresh[:known] &= np.abs(values[:known] - old) > 0.5001 * 10.0**-style.decimals
        done = 0
        for row in np.flatnonzero(fresh.any(axis=1)).tolist():
            stream.write(kept(start + done, start + min(row, known)))
            text = kept(start + row, start + row + 1) if row < known else pattern
            stream.write(_exchange(text, values[row], fresh[row], style))
            done = row + 1
        stream.write(kept(start + done, start + known))
    return lost.notes(clip.skeleton.names)


def _header(clip: Clip, header: Header) -> bytes:
    """The header's own text; only a new number of frames or another frame time is exchanged."""
    text, (a, b), (c, d) = header.text, header.frames_at, header.time_at
    frames = text[a:b] if len(clip) == header.frames else str(len(clip)).encode()
    seconds = text[c:d] if clip.fps == header.fps else f"{1 / clip.fps:.8g}".encode()
    return text[:a] + frames + text[b:c] + seconds + text[d:]


@dataclass
class _Lost:
    """The most that a joint loses because the file has no channel for it: degrees (J,) and metres (J,)."""

    degrees: np.ndarray
    metres: np.ndarray

    def notes(self, names: tuple[str, ...]) -> tuple[str, ...]:
        turned = [f"{names[j]}: {self.degrees[j]:.1f} degrees" for j in np.flatnonzero(self.degrees > 0.1)]
        moved = [f"{names[j]}: {self.metres[j]:.3f} m" for j in np.flatnonzero(self.metres > 1e-4)]
        return tuple(f"no channel holds all of the motion of {note} are lost" for note in turned + moved)


def _put_motion(
    values: np.ndarray,
    known: int,
    clip: Clip,
    source: BvhSource,
    start: int,
    previous: np.ndarray,
    lost: _Lost,
) -> np.ndarray:
    """Put the frames of the clip from `start` into `values` (n, C), of which `known` are the file's own.

    Returns (n, C) True where a number may have changed.
    """
    layout, stop = source.layout, start + len(values)
    rotation = clip.rotation[start:stop]
    translation = _translation(clip, layout, start, stop, lost)
    turned, moved = np.ones(rotation.shape[:2], bool), np.ones(translation.shape, bool)
    if known:
        was_rotation, was_translation = layout.decode(values[:known])
        turned[:known] = (rotation[:known] != was_rotation).any(axis=-1)
        moved[:known] = translation[:known] != was_translation
    fresh = np.zeros(values.shape, bool)
    if moved.any():
        positions, moved = layout.positions(translation), layout.in_file(moved)
        for k, columns in enumerate(layout.translation_columns):
            has = columns >= 0
            fresh[:, columns[has]] = moved[:, k, has]
            kept = values[:, columns[has]]
            values[:, columns[has]] = np.where(moved[:, k, has], positions[:, k, has], kept)
            if not has.all():
                missed = np.abs(positions[:, k, ~has]).max() * layout.unit
                lost.metres[layout.translated[k]] = max(lost.metres[layout.translated[k]], missed)
    if turned.any():
        _put_angles(values, fresh, rotation, turned, previous, layout, lost)
    return fresh


def _translation(clip: Clip, layout: Layout, start: int, stop: int, lost: _Lost) -> np.ndarray:
    """(n, K, 3) translations of the joints that the file can move."""
    if clip.translated == layout.translated:
        return clip.translation[start:stop]
    rest = clip.skeleton.rest_translation
    moved = np.tile(rest[list(layout.translated)], (stop - start, 1, 1))
    for k, joint in enumerate(clip.translated):
        if joint in layout.translated:
            moved[:, layout.translated.index(joint)] = clip.translation[start:stop, k]
        else:
            missed = np.abs(clip.translation[start:stop, k] - rest[joint]).max()
            lost.metres[joint] = max(lost.metres[joint], missed)
    return moved


def _put_angles(
    values: np.ndarray,
    fresh: np.ndarray,
    rotation: np.ndarray,
    turned: np.ndarray,
    previous: np.ndarray,
    layout: Layout,
    lost: _Lost,
) -> None:
    """Put the Euler angles of the turned joints into `values`, without jumps from frame to frame.

    Of the two triples that mean the same rotation, and of their full turns, the nearest to the frame before
    is taken. `previous` (C,) are the numbers of the frame before the first.
    """
    joints = np.flatnonzero(turned.any(axis=0))
    columns = layout.rotation_columns[joints]
    here = columns >= 0
    # Angles without a channel must be as near zero as they can be: they weigh more than any jump.
    weight = np.where(here, 1.0, 1e4)
    frames = np.flatnonzero(turned.any(axis=1))
    exact = layout.angles(rotation[frames], joints)
    mirrored = exact * [1.0, -1.0, 1.0] + 180.0
    # In gimbal lock only the sum or difference of the outer angles counts: the last one stays as it was.
    locked = np.abs(np.abs(exact[..., 1]) - 90.0) < 1e-4
    cyclic = np.array([1.0 if layout.orders[j] in "XYZXY" else -1.0 for j in joints])
    locks = np.sign(exact[..., 1]) * cyclic * locked
    for row, one, two, lock in zip(frames.tolist(), exact, mirrored, locks):
        before = np.where(here, (values[row - 1] if row else previous)[columns], 0.0)
        if lock.any():
            shift = (before[:, 2] - one[:, 2]) * np.abs(lock)
            one = one + np.stack([-lock * shift, 0.0 * shift, shift], axis=1)
        one = one + 360.0 * np.round((before - one) / 360.0)
        two = two + 360.0 * np.round((before - two) / 360.0)
        nearer = (np.abs(two - before) * weight).sum(axis=1) < (np.abs(one - before) * weight).sum(axis=1)
        chosen = np.where(nearer[:, None], two, one)
        put = turned[row, joints][:, None] & here
        values[row, columns[put]] = chosen[put]
        fresh[row, columns[put]] = True
        if not here.all():
            missed = np.abs(np.where(here | ~turned[row, joints][:, None], 0.0, chosen)).max(axis=1)
            lost.degrees[joints] = np.maximum(lost.degrees[joints], missed)


@dataclass(frozen=True)
class _Style:
    """How a file writes numbers: so many decimals, with zeros at the end or without."""

    decimals: int
    trimmed: bool

    def text(self, value: float) -> bytes:
        text = b"%.*f" % (self.decimals, value)
        return text.rstrip(b"0").rstrip(b".") if self.trimmed else text


def _style(motion: MotionText) -> _Style:
    """The style of the first numbers of the motion."""
    words = motion.raw(0, min(len(motion), 1 + 4096 // motion.channels)).lower().split()
    plain = [word for word in words if b"e" not in word]
    # Programs that write six digits give small numbers many decimals: those above one tell what is usual.
    usual = [word for word in plain if re.match(rb"[+-]?0*[1-9]", word)] or plain
    counts = [len(word.partition(b".")[2]) for word in usual] or [DECIMALS]
    trimmed = any(count < max(counts) for count in counts)
    return _Style(min(max(*counts, LEAST_DECIMALS), MOST_DECIMALS), trimmed)


def _exchange(text: bytes, values: np.ndarray, fresh: np.ndarray, style: _Style) -> bytes:
    """The text of a frame with some of its numbers exchanged; blanks and line ends stay."""
    parts = _WORD.split(text)
    for index, value in zip(np.flatnonzero(fresh).tolist(), values[fresh].tolist()):
        parts[2 * index + 1] = style.text(value)
    return b"".join(parts)


# A new file ---------------------------------------------------------------------------------------------


def _write_new(clip: Clip, stream: BinaryIO) -> None:
    skeleton = clip.skeleton
    offsets = skeleton.rest_translation * skeleton.scale_above[:, None] / CENTIMETRE
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
            lines += [f"{indent}\tEnd Site", f"{indent}\t{{", f"{indent}\t\tOFFSET {_numbers(np.zeros(3))}"]
            lines += [f"{indent}\t}}"]
    close(0)
    lines += ["MOTION", f"Frames: {len(clip)}", f"Frame Time: {1 / clip.fps:.8f}", ""]
    stream.write("\n".join(lines).encode())
    _write_numbers(clip, order, stream)


def _numbers(vector: np.ndarray) -> str:
    return " ".join(f"{value:.{DECIMALS}f}" for value in np.round(vector, DECIMALS) + 0.0)


def _write_numbers(clip: Clip, order: list[int], stream: BinaryIO) -> None:
    chunk = max(1, (1 << 17) // (4 * len(order)))
    before = np.zeros((len(order), 3))
    for start in range(0, len(clip), chunk):
        part = slice(start, min(start + chunk, len(clip)))
        angles = np.degrees(rotations.to_euler(clip.rotation[part], "ZXY"))
        mirrored = angles * [1.0, -1.0, 1.0] + 180.0
        for row, two in zip(angles, mirrored):
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
            columns.append(angles[:, joint])
        rows = np.round(np.concatenate(columns, axis=1), DECIMALS) + 0.0
        pattern = " ".join([f"%.{DECIMALS}f"] * rows.shape[1]) + "\n"
        stream.write("".join([pattern % tuple(row) for row in rows.tolist()]).encode())
