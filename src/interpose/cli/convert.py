"""interpose convert: another format, another rate."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from interpose.cli.console import say
from interpose.cli.reading import Reading, describe
from interpose.errors import RequestError

FASTEST = 1000.0  # frames a second


def convert(
    file: Annotated[Path, Parameter(name="IN")],
    output: Annotated[Path, Parameter(name="OUT")],
    /,
    *,
    fps: float | None = None,
    force: bool = False,
    reading: Reading = Reading(),  # noqa: B008
) -> None:
    """Write a clip in another format, or at another frame rate.

    A file that becomes one of its format again keeps its layout and units, and at the same rate every
    number's text. Other BVH is written in centimetres, Y up. The suffix says the
    format: .bvh, .npz, .amc (for clips read from .amc).

    Try:
      interpose convert take.bvh take.npz
      interpose convert take.amc take.bvh --skeleton subject.asf
      interpose convert take.bvh take30.bvh --fps 30

    Args:
        file: the clip to read.
        output: the file to write.
        fps: frames a second of what is written.
        force: replace an existing file.
    """
    from interpose.formats import save
    from interpose.geometry.time import resample

    clip = reading.load(file)
    if output.exists() and output.samefile(file):
        raise RequestError(
            f"cannot write {output}", "it is the input, which stays as it is", "Choose another name."
        )
    # The layout of the file does not depend on the rate: units, axes and End Sites stay as they were.
    if fps is not None and not 0 < fps <= FASTEST:
        raise RequestError(
            f"cannot write {fps:g} frames a second",
            "nobody records or plays that",
            f"Choose up to {FASTEST:g}.",
        )
    made = replace(resample(clip, fps, smooth=True), source=clip.source) if fps is not None else clip
    notes = save(replace(made, name=output.stem), output, force=force)
    say("\n".join(describe(file, clip)))
    for note in notes:
        say(f"note: {note}")
    say(f"wrote {output}: {len(made)} frames at {made.fps:.4g} fps")
