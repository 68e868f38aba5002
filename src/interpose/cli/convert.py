"""interpose convert: another format, another rate, another skeleton."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from interpose.cli.batch import MOTION, each
from interpose.cli.console import names, say, say_json
from interpose.cli.reading import Reading, describe, details
from interpose.errors import NothingError, RequestError

if TYPE_CHECKING:
    from interpose.clip import Clip

FASTEST = 1000.0  # frames a second
STIRS = 1e-4  # radians, or metres, from which on a joint moves


def convert(
    file: Annotated[Path, Parameter(name="IN")],
    /,
    output: Annotated[Path, Parameter(name=("--output", "-o"))],
    *,
    to: Literal["bvh", "npz", "amc"] | None = None,
    fps: float | None = None,
    onto: Path | None = None,
    drop_repeated: bool = False,
    json: bool = False,
    force: bool = False,
    skip_existing: bool = False,
    reading: Reading = Reading(),
) -> int:
    """Write a clip, or all of a folder, in another format, at another frame rate, or on another skeleton.

    A file written in its own format keeps its layout and units, and at the same frame rate also the
    text of every number. Other BVH is written in centimetres, Y up. The suffix gives the
    format: .bvh, .npz, .amc (only for clips read from .amc).

    Try:
      interpose convert take.bvh take.npz
      interpose convert take.amc take.bvh --skeleton subject.asf
      interpose convert take.bvh take30.bvh --fps 30
      interpose convert take.bvh mine.bvh --onto rig.bvh
      interpose convert take.bvh take.even.bvh --drop-repeated
      interpose convert takes/ mine/ --onto rig.bvh   (a whole folder)

    Args:
        file: the clip to read, or a folder of clips.
        output: the file to write; for a folder, a folder, which gets the same structure.
        to: for folders, the format to write; default: that of --onto, or else each clip's own.
        fps: the frame rate to write.
        onto: a clip on another rig; the motion is retargeted to its skeleton. Planted feet stay planted, and
            travel scales with leg length. Fingers and other joints that not every humanoid has follow if
            they have the same name and a similar rest pose; otherwise they keep their mean pose.
        drop_repeated: remove frames that repeat the one before, as `interpose scan` finds them, and spread
            the others evenly over the time, as of 24 fps motion in a 30 fps file.
        json: print JSON for other programs.
        force: replace an existing file.
        skip_existing: of folders: leave out clips whose result is there already: a batch goes on where it
            stopped.
    """
    alone = not (file.is_dir() or output.is_dir())
    if to is not None and alone:
        raise RequestError(
            "--to does not apply to one file", "the suffix of the output says the format", "Leave it out."
        )
    # What is of no known format says so itself, as it is read.
    ending = onto.suffix[1:].lower() if onto is not None and onto.suffix.lower() in MOTION else None
    ending = to if to is not None or alone else ending
    each_of = each(_convert, earlier=_earlier)
    return each_of(
        file,
        output=output,
        to=ending,
        fps=fps,
        onto=onto,
        drop_repeated=drop_repeated,
        alone=alone,
        json=json,
        force=force,
        skip_existing=skip_existing,
        reading=reading,
    )


def _written(output: Path, to: str | None) -> Path:
    return output if to is None else output.with_suffix(f".{to}")


def _earlier(path: Path, options: dict[str, Any]) -> tuple[Path, dict[str, Any]] | None:
    """What was converted before: there is no report of it."""
    made = _written(options["output"], options["to"])
    return (made, {"input": str(path)}) if made.exists() else None


def _convert(
    file: Path,
    /,
    *,
    output: Path,
    to: str | None,
    fps: float | None,
    onto: Path | None,
    drop_repeated: bool,
    alone: bool,
    json: bool,
    force: bool,
    reading: Reading,
) -> None:
    """One file; what makes no sense for one `alone` may be of some of a folder."""
    from interpose.finish import retarget
    from interpose.formats import save
    from interpose.observation.repeated import repeats
    from interpose.resampling import resample, spread
    from interpose.skeletons.fitting import other_rig

    output = _written(output, to)
    clip, rig = reading.load_all([file, onto or file])
    if output.exists() and (output.samefile(file) or output.samefile(onto or file)):
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
    made, said, repeated = clip, "", 0
    if drop_repeated:
        again = repeats(clip)
        if alone and not again.any():
            raise NothingError(
                f"no frames of {file} are repeated",
                "none, or too few to be more than chance, are the one before",
                "Leave --drop-repeated out.",
            )
        if again.any():
            made = spread(clip, again)
            repeated = int(again.sum())
            said = f"; {repeated} were repeated, and what moved in steps moves evenly"
    kept = []
    if onto is not None:
        made = retarget(made, rig)
        kept = [*_left(clip), *_kept(clip, rig, made)] if other_rig(clip, rig) else []
    made = resample(made, fps, smooth=True) if fps is not None else made
    notes = [*kept, *save(replace(made, name=output.stem), output, force=force)]
    if json:
        written = {"file": str(output), "frames": len(made), "fps": made.fps, "joints": len(made.skeleton)}
        more = {"dropped": repeated} if drop_repeated else {}
        say_json({"input": str(file), **details(clip), "wrote": written, **more, "notes": notes})
        return
    say("\n".join([*describe(file, clip), *(describe(onto, rig) if onto is not None else [])]))
    for note in notes:
        say(f"note: {note}")
    say(f"wrote {output}: {len(made)} frames at {made.fps:.4g} fps{said}")


def _left(clip: Clip) -> list[str]:
    """Whose motion, of several bodies, is not brought onto another rig."""
    from interpose.skeletons.performers import performers

    first, *others = [clip.skeleton.names[joints[0]] for joints in performers(clip.skeleton)] or [""]
    left = f"the motion of {first} alone is brought onto it: --root takes {' or '.join(others)} instead"
    return [left] if others else []


def _kept(clip: Clip, rig: Clip, made: Clip) -> list[str]:
    """What the motion of another rig tells nothing of, and what goes along with nothing in what was made."""
    import numpy as np

    from interpose.finish.retargeting import common
    from interpose.geometry import rotations

    told = common(clip, rig)
    goes = np.zeros(len(made.skeleton), bool)
    if len(made):
        goes = rotations.angle(made.rotation, made.rotation[:1]).max(axis=0) > STIRS
        goes[list(made.translated)] |= np.ptp(made.translation, axis=0).max(axis=-1) > STIRS
    others = [name for name, goes in zip(rig.skeleton.names, goes) if name not in told and not goes]
    what = f"{len(others)} joint{'s keep their' if len(others) > 1 else ' keeps its'} mean pose in {rig.name}"
    return [f"{what}: {names(others)}"] if others else []
