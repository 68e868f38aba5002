"""Writing AMC: text that did not change is copied, changed numbers are written in its style."""

from __future__ import annotations

from typing import BinaryIO

import numpy as np

from interpose.clip import Clip
from interpose.errors import RequestError
from interpose.formats import angles, place
from interpose.formats.asf_amc.read import AmcSource
from interpose.formats.changes import Lost, same_skeleton, translation_of, write_frames


def write(clip: Clip, stream: BinaryIO) -> tuple[str, ...]:
    """Write the clip as AMC, for the skeleton file that it was read with.

    Every number that did not change keeps its text: the clip's values are compared with those read, bit for
    bit. A changed joint comes as near to its orientation in the clip as its degrees of freedom allow.

    Returns:
        Notes on what they cannot, per joint the most in degrees or metres, and on the frame rate.

    Raises:
        RequestError: the clip was not read from ASF/AMC, or has another skeleton by now.
    """
    source = clip.source
    if not isinstance(source, AmcSource):
        raise RequestError(
            f"cannot write {clip.name or 'the clip'} as AMC",
            "it does not come straight from an .amc file, so that no skeleton file belongs to it",
            "Write it as .bvh instead.",
        )
    if not same_skeleton(clip.skeleton, source.skeleton):
        raise RequestError(
            f"cannot write {clip.name or 'the clip'} as AMC",
            f"its skeleton is no longer the one of {source.asf.path.name}",
            "Write it as .bvh instead.",
        )
    motion, header = source.motion, source.header
    text = motion.text[: motion.starts[0]].tobytes()
    notes: tuple[str, ...] = ()
    if header.fps is not None and clip.fps != source.fps:
        begin, end = header.fps_at
        text = text[:begin] + b"%.8g" % clip.fps + text[end:]
    elif clip.fps != source.fps:
        notes = (f"an AMC file does not say its frame rate, which is {clip.fps:.6g} fps now",)
    stream.write(text)
    lost = Lost.nothing(len(clip.skeleton))

    def put(values: np.ndarray, known: np.ndarray, start: int, previous: np.ndarray) -> np.ndarray:
        return _put_motion(values, known, clip, source, start, previous, lost)

    write_frames(source, len(clip), put, stream, b"\r\n" if b"\r\n" in motion.raw(0, 1) else b"\n")
    notes += place.misread(clip, source.up, source.up_how)
    return (*lost.notes(clip.skeleton.names), *notes)


def _put_motion(
    values: np.ndarray,
    known: np.ndarray,
    clip: Clip,
    source: AmcSource,
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
    turned, moved = np.ones(rotation.shape[:2], bool), np.ones(translation.shape[:2], bool)
    if known.any():
        was_rotation, was_translation = layout.decode(values[known])
        turned[known] = (rotation[known] != was_rotation).any(axis=-1)
        moved[known] = (translation[known] != was_translation).any(axis=-1)
    fresh = np.zeros(values.shape, bool)
    if moved.any():
        new, off = layout.moved(values, translation)
        for k, joint in enumerate(layout.translated):
            lost.moved(joint, float(np.where(moved[:, k], off[:, k], 0.0).max()))
        affects = np.abs(layout.gains).max(axis=-1) > 0  # (T, K)
        changed = (moved[:, None, :] & affects).any(axis=-1)
        values[:, layout.moving] = np.where(changed, new, values[:, layout.moving])
        fresh[:, layout.moving] = changed
    scaled = layout.scaled(values).copy()
    if turned.any():
        own, off = layout.reachable(rotation, turned, clip.skeleton.parents)
        lost.turned(off.max(axis=0))
        before = layout.scaled(previous[None])[0]
        angles.put(scaled, fresh, own, turned, before, layout.orders, layout.rotation_columns)
    values[:] = np.where(fresh, layout.unscaled(scaled), values)
    return fresh
