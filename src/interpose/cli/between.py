"""interpose between: the motion between key poses."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from interpose.cli.console import progress
from interpose.cli.outputs import Outputs, finish
from interpose.cli.reading import Reading, split_names
from interpose.errors import RequestError


def between(
    file: Path,
    /,
    *,
    keys: list[str],
    action: str = "",
    output: Annotated[Path | None, Parameter(name=("--output", "-o"))] = None,
    method: str = "auto",
    seed: int | None = None,
    player: bool = False,
    json: bool = False,
    force: bool = False,
    reading: Reading = Reading(),  # noqa: B008
) -> int:
    """Generate the motion between key poses; the keys themselves come back unchanged.

    What lies between the keys in the file has no influence; what lies
    before the first and after the last one stays as it is. Writes the clip
    and a report beside the input: keys.between.bvh and keys.between.json.

    Try:
      interpose between keys.bvh --keys 0,30,75
      interpose between keys.bvh --keys 0,30,75 --action jumps --player

    Args:
        file: the clip (.bvh, .npz, .amc).
        keys: the frames that are keys, separated by commas, counted from 0.
        action: what the motion is; `interpose models cmib` lists what there is. Asks for the method cmib.
        output: where to write the clip; the report goes beside it.
        method: what generates it: auto (the default), cmib, spline, ... `interpose models` lists them.
        seed: for methods that sample.
        player: write a page (keys.between.html) that plays the result; it opens in any browser.
        json: print the report as JSON.
        force: replace existing files, of .json files only reports.
    """
    from interpose import tasks
    from interpose.cli.request import check_method

    frames = [_frame(text) for text in split_names(keys)]
    check_method(method)
    clip = reading.load(file)
    outputs = Outputs.choose(file, output, "between", player)
    outputs.check(file, force)
    with progress(f"generating what lies between {len(frames)} keys of {file.name}", len(clip)) as advance:
        done = tasks.between(clip, frames, action, method, seed, advance)
    return finish("between", file, outputs, clip, done, seed, {}, json=json, force=force)


def _frame(text: str) -> int:
    if not text.isdecimal():
        raise RequestError(f"cannot read the key {text}", "it is no frame number", "Write --keys 0,30,75.")
    return int(text)
