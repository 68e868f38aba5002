"""interpose between: the motion between key poses."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from interpose.cli.console import effort, progress
from interpose.cli.outputs import Outputs, finish, others_read
from interpose.cli.reading import Reading, describe, split_names
from interpose.cli.whole import Whole
from interpose.errors import RequestError

if TYPE_CHECKING:
    from interpose.clip import Clip
    from interpose.tasks.blocking import Blocked


def between(
    file: Path | None = None,
    /,
    *,
    keys: list[str] = [],  # noqa: B006
    start: str | None = None,
    target: str | None = None,
    frames: str | None = None,
    anchor: list[str] = [],  # noqa: B006
    action: str = "",
    path: list[str] = [],  # noqa: B006
    pin: list[str] = [],  # noqa: B006
    output: Annotated[Path | None, Parameter(name=("--output", "-o"))] = None,
    method: str = "auto",
    license: str = "any",
    seed: Whole | None = None,
    player: bool = False,
    json: bool = False,
    force: bool = False,
    reading: Reading = Reading(),
) -> int:
    """Generate the motion between key poses; the keys themselves come back unchanged.

    With --keys, the keys are frames of one file. What lies between them there is
    ignored; what lies before the first and after the last one stays as it is.
    With --start and --target, the keys are poses of several files: the result is
    the --start pose, --frames new frames, and the --target pose, on the skeleton of
    --start; other rigs are retargeted to it. The frames beside these poses in their
    files set the velocities. Both poses stay where they are in their files; use
    `interpose stitch` to place clips one after another. Writes the clip and a report
    beside the input: keys.between.bvh and keys.between.json.

    Try:
      interpose between keys.bvh --keys 0,30,75
      interpose between keys.bvh --keys 0,30,75 --action jumps --player
      interpose between keys.bvh --keys 0,75 --path 40:35,-120
      interpose between --start walk.bvh --target sit.bvh --frames 45
      interpose between --start walk.bvh#80 --target sit.bvh#0 --frames 45 --anchor turn.bvh#12@20

    Args:
        file: the clip (.bvh, .npz, .amc).
        keys: the frames of the file that are keys, separated by commas, counted from 0; or seconds, 1s,2.5s.
        start: FILE or FILE#FRAME: the first pose; without a frame the last one of that file.
        target: FILE or FILE#FRAME: the last pose; without a frame the first one of that file.
        frames: how many frames, or seconds, to generate between --start and --target; auto, the default,
            chooses a length (after the last anchor).
        anchor: FILE@AT or FILE#FRAME@AT: a pose to reach at frame AT; --start is frame 0. May be repeated.
        action: an action label; `interpose models base` lists them. It has little effect: another key has
            more.
        path: FRAME:X,Z (or X,Y), where the hips are to be on the floor, in the file's unit; --start is frame
            0. May be repeated.
        pin: JOINT@FRAME:X,Y,Z, where a joint is to be, in the file's unit and axes; or JOINT@START:STOP:X,Y,Z
            to hold it there. @30 instead of X,Y,Z: where it is at frame 30, and turned as it is then. May be
            repeated.
        output: where to write the clip; the report goes beside it.
        method: what generates it: auto (the default), cmib, spline, ... `interpose models` lists them.
        license: open to use only weights that may be used for anything; any (the default).
        seed: random seed, for methods that sample.
        player: write a page (keys.between.html) that plays the result; it opens in any browser.
        json: print the report as JSON.
        force: overwrite existing files (.json files only if they are reports).
    """
    from interpose import tasks
    from interpose.cli.request import check_method, frame_of, path_of, pins_of
    from interpose.observation import Gap

    check_method(method, license)
    said, others, read, laid = "", dict[Path, bool](), None, None
    if file is not None and not (start or target or frames or anchor):
        clip = reading.load(file)
        chosen = [frame_of(text, clip) for text in split_names(keys)]
    elif file is None and not keys and start and target:
        file, laid, said, others, read = _blocked(start, target, frames or "auto", anchor, reading)
        chosen, clip = laid.keys, laid.clip
    else:
        raise RequestError(
            "it is not clear what the keys are",
            "they are frames of one file, or poses of several",
            "Write keys.bvh --keys 0,30,75, or --start a.bvh#0 --target a.bvh#2 --anchor a.bvh#1@30.",
        )
    outputs = Outputs.choose(file, output, "between", player)
    for one in (file, *others):
        outputs.check(one, force)
    zero = chosen[0] if laid else 0
    counted = clip.slice(zero, chosen[-1] + 1) if laid else clip
    open_ = [Gap(a + 1 - zero, b - zero) for a, b in pairwise(sorted({*chosen})) if b > a + 1]
    points, pins = path_of(path, counted), pins_of(pin, counted, open_)
    if laid:
        points, pins = laid.counted(points, pins)
    what = f"generating what lies between {len(chosen)} keys of {file.name}"
    missing = max(chosen, default=0) - min(chosen, default=0)
    with progress(what, effort(missing, clip.fps)) as advance:
        done = tasks.between(clip, chosen, action, method, seed, advance, laid is not None, points, pins)
    if laid:
        clip = done.clip
    retargeted = [str(path) for path, other in others.items() if other]
    more: dict[str, Any] = {"retargeted": retargeted} if retargeted else {}
    more |= {"poses": [start, target, *anchor], **others_read(others, file)} if laid else {}
    more |= {"path": path} if path else {}
    more |= {"pinned": pin} if pin else {}
    told: dict[str, Any] = {"json": json, "force": force, "more": more, "read": read}
    return finish("between", file, outputs, clip, done, seed, {}, said, **told)


def _blocked(
    start: str, target: str, frames: str, anchors: list[str], reading: Reading
) -> tuple[Path, Blocked, str, dict[Path, bool], list[str]]:
    """Poses of several files, blocked: the file it begins with, what holds them at its keys, lines for the
    user, the other files, each with whether it is of another rig, and lines that say what was read.
    """
    from interpose.finish import on_rig_of
    from interpose.observation.observation import frames_of
    from interpose.tasks.blocking import blocked, edge

    met_at = [_met(text) for text in anchors]
    for k, (what, when) in enumerate(met_at):
        if twice := next((other for other, at in met_at[:k] if at == when), None):
            raise RequestError(
                f"cannot meet {what} at frame {when}",
                f"{twice} is to be met there, too",
                "Leave one of them out.",
            )
    named = [_named(text) for text in (start, target, *(what for what, _ in met_at))]
    loaded = reading.load_all([path for path, _ in named])
    clips = [loaded[0], *(on_rig_of(clip, loaded[0]) for clip in loaded[1:])]
    others = {path: clip is not own for (path, _), clip, own in zip(named[1:], clips[1:], loaded[1:])}
    said = [f"{path} is on another rig: its motion was retargeted" for path, other in others.items() if other]
    at = []
    for k, ((path, frame), clip) in enumerate(zip(named, clips)):
        usual = len(clip) - 1 if k == 0 else 0
        number = edge(clip, last=k == 0) if frame is None else _checked(path, frame, clip)
        if frame is None and number != usual:
            said.append(
                f"frame {usual} of {path} has nothing to do with the one beside: frame {number} is taken"
            )
        at.append(number)
    met = {when: clip.slice(frame, frame + 1) for (_, when), clip, frame in zip(met_at, clips[2:], at[2:])}
    count = None if frames == "auto" else frames_of(frames, clips[0].fps)
    done = blocked(clips[0], at[0], clips[1], at[1], met, count)
    files = {path: clip for (path, _), clip in zip(named, loaded)}
    read = [line for path, clip in files.items() for line in describe(path, clip)]
    return named[0][0], done, "\n".join([*said, *done.said]), others, read


def _met(text: str) -> tuple[str, int]:
    """FILE@AT or FILE#FRAME@AT: the pose that is met, and when."""
    what, _, at = text.rpartition("@")
    if not what or not at.isdecimal() or int(at) < 1:
        why = "it is FILE@AT, with AT from 1 on"
        raise RequestError(f"cannot use the anchor {text}", why, "Write --anchor turn.bvh@20.")
    return what, int(at)


def _named(text: str) -> tuple[Path, int | None]:
    """FILE or FILE#FRAME."""
    name, _, frame = text.rpartition("#")
    return (Path(name), int(frame)) if name and frame.isdecimal() else (Path(text), None)


def _checked(path: Path, frame: int, clip: Clip) -> int:
    """The frame, if the clip has it."""
    if frame >= len(clip):
        why = f"the clip has {len(clip)} frames, counted from 0"
        raise RequestError(f"there is no frame {frame} in {path}", why, f"Choose up to {len(clip) - 1}.")
    return frame
