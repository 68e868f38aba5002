"""interpose denoise: noise, and values that were lost."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from interpose.cli.batch import each
from interpose.cli.console import progress, say, say_json
from interpose.cli.outputs import Outputs, to_json, write
from interpose.cli.reading import Reading, describe, joints_of
from interpose.cli.whole import Whole

UNITS = {"noise": "cm", "moved": "cm", "moved_most": "cm", "turned": "degrees", "turned_most": "degrees"}


@each
def denoise(
    file: Path,
    /,
    *,
    strength: float = 1.0,
    joints: list[str] = [],  # noqa: B006
    frames: str | None = None,
    method: str = "auto",
    license: str = "any",
    seed: Whole | None = None,
    output: Annotated[Path | None, Parameter(name=("--output", "-o"))] = None,
    player: bool = False,
    dry_run: bool = False,
    json: bool = False,
    force: bool = False,
    reading: Reading = Reading(),
) -> int:
    """Smooth a noisy clip, and fill joints that snap to their rest pose or spike for some frames.

    The noise is estimated from the clip, joint by joint: a clean one hardly changes.
    Bones keep their lengths. Writes take.denoised.bvh and take.denoised.json.

    Try:
      interpose denoise take.bvh
      interpose denoise take.bvh --strength 2 --joints LeftHand,RightHand
      interpose denoise take.bvh --frames 120:240 --player

    Args:
        file: the clip (.bvh, .npz, .amc), or a folder of clips.
        more: more clips or folders; each clip is processed by itself.
        strength: factor on the estimated noise: 0 changes nothing, 1 (the default) uses it, 2 is smoother.
        joints: change only these joints, separated by commas: rotations, and a root's position. Default: all.
        frames: START:STOP, change only the frames START to STOP - 1, counted from 0; or seconds, 4s:5.3s.
            Default: all.
        method: what fills lost values: auto (interpolates), cae, ...; `interpose models` lists them.
        license: open to use only weights that may be used for anything; any (the default).
        seed: random seed, for methods that sample.
        output: where to write the clip; the report goes beside it. With several clips: a folder.
        player: write a page (take.denoised.html) that plays the result; it opens in any browser.
        dry_run: say what is found and done, and write nothing.
        json: print the report as JSON.
        force: overwrite existing files (.json files only if they are reports).
    """
    from interpose import tasks
    from interpose.cli.request import check_method, range_of

    check_method(method, license)
    clip = reading.load(file)
    chosen = joints_of(joints, clip)
    part = range_of(frames, clip) if frames is not None else None
    outputs = Outputs.choose(file, output, "denoise", player)
    if not dry_run:
        outputs.check(file, force)
    span = None if part is None else (part.start, part.stop)
    with progress(f"denoising {file.name}", len(clip)):
        done = tasks.denoise(clip, strength, chosen, span, method, seed)
    more = {"dry_run": True} if dry_run else {}
    more["denoised"] = done.report.to_dict()["denoised"]
    report = to_json("denoise", file, outputs.clip, clip, done, seed, {}, more)
    report["units"] = UNITS
    notes = [] if dry_run else write(outputs, force, clip, done, report)
    if json:
        say_json(report)
    else:
        say("\n".join([*describe(file, clip), "", str(done.report), ""]))
        say("\n".join([*(f"note: {note}" for note in notes), outputs.told(dry_run)]))
    return 0
