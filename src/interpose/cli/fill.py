"""interpose fill: fill gaps."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from interpose.cli.batch import each
from interpose.cli.console import effort, names, progress, say, say_json, say_table, seconds
from interpose.cli.outputs import Outputs, finish, numbered, others_read
from interpose.cli.reading import Reading, describe, details
from interpose.cli.whole import WHOLE, Whole
from interpose.errors import RequestError

if TYPE_CHECKING:
    from interpose.cli.request import At, Request
    from interpose.clip import Clip
    from interpose.finish import Completion, GapReport
    from interpose.observation import Gap, Pin


@each
def fill(
    file: Path,
    /,
    *,
    gap: list[str] = [],  # noqa: B006
    joints: list[str] = [],  # noqa: B006
    gaps: Path | None = None,
    from_: Annotated[Path | None, Parameter(name="--from")] = None,
    from_range: str | None = None,
    at: Whole | None = None,
    layer: bool = False,
    path: list[str] = [],  # noqa: B006
    pin: list[str] = [],  # noqa: B006
    output: Annotated[Path | None, Parameter(name=("--output", "-o"))] = None,
    method: str | None = None,
    license: str = "any",
    max_gap: str | None = None,
    only_gap: Annotated[list[int], WHOLE] = [],  # noqa: B006
    seed: Whole | None = None,
    player: bool = False,
    dry_run: bool = False,
    json: bool = False,
    force: bool = False,
    reading: Reading = Reading(),
) -> int:
    """Fill gaps in a clip; what is not missing comes back unchanged.

    Writes the clip and a report beside the input: take.filled.bvh and
    take.filled.json. Without --gap, --joints or --gaps it fills what
    `interpose scan` finds.

    Try:
      interpose fill take.bvh --gap 120:160 --gap 200:230
      interpose fill take.bvh --gap 120:160 --joints LeftArm,LeftForeArm --player
      interpose fill take.bvh --max-gap 90 --only-gap 2 --method spline
      interpose fill take.bvh --gaps take.filled.json -o again.bvh   (once more)
      interpose fill take.bvh --gap 120:160 --path 140:35,-120
      interpose fill take.bvh --gap 120:160 --pin LeftHand@140:35,142,-20
      interpose fill take.bvh --gap 120:160 --pin LeftHand@120:150:@119   (held)
      interpose fill take.bvh --gap 120:150 --from wave.bvh --from-range 40:48
        --at 130 --joints RightArm,RightHand   (with another clip's arm in it)
      interpose fill take.bvh --layer --from wave.bvh --at 130
        --joints RightArm,RightHand   (that arm over the motion that is there)

    Exit code: 0 if all gaps were filled; 4 if a gap stays open, or if hips or limbs
    are left for `interpose recover`; 2 or 3 if nothing was done.

    Args:
        file: the clip (.bvh, .npz, .amc), or a folder of clips.
        more: more clips or folders; each clip is processed by itself.
        gap: START:STOP, the frames START to STOP - 1, counted from 0; or seconds, 4s:5.3s. May be repeated.
        joints: the joints missing in each --gap, or else in the whole clip; or those that --from gives.
        gaps: a JSON file of gaps, or the report of an earlier run, which is then repeated.
        from_: another clip from which the poses of --joints (names as in this clip) are taken; if it is on
            another rig, it is retargeted.
        from_range: START:STOP, the frames of that clip to use; default: all.
        at: the frame of this clip at which they begin.
        layer: take only --joints from the other clip, eased in and out, and leave all else unchanged. They
            point where they do there, relative to the facing of the hips. Without --layer the rest of the
            pose in the --gap is filled around them.
        path: FRAME:X,Z (or X,Y), where the hips are to be on the floor, in the file's unit. May be repeated.
        pin: JOINT@FRAME:X,Y,Z, where a joint is to be, in the file's unit and axes; or JOINT@START:STOP:X,Y,Z
            to hold it there. @119 instead of X,Y,Z: where it is at frame 119, and turned as it is then. May
            be repeated.
        output: where to write the filled clip; the report goes beside it. With several clips: a folder.
        method: what fills the gaps: auto (the default), base, spline, ...; `interpose models` lists them.
        license: open to use only weights that may be used for anything; any (the default).
        max_gap: leave gaps longer than this open, and list them; frames, or seconds, 3s.
        only_gap: fill only the gap of this number, counted from 1 in order of time. May be repeated.
        seed: random seed, for methods that sample.
        player: write a page (take.filled.html) that plays the result; it opens in any browser.
        dry_run: say what would be done, and write nothing.
        json: print the report as JSON.
        force: overwrite existing files (.json files only if they are reports).
    """
    from interpose import tasks
    from interpose.cli.request import (
        check_method,
        from_options,
        layered,
        part_of,
        parts_to_dict,
        path_of,
        pins_of,
        reading_of,
        roles_of,
    )
    from interpose.observation.observation import longest

    if layer and from_ is None:
        raise RequestError(
            "no other clip is named",
            "--layer lays joints of another clip over the motion",
            "Name it with --from FILE.",
        )
    if from_ is None:
        clip = reading_of(gaps, reading).load(file, roles_of(gaps))
    else:
        clip = reading_of(gaps, reading).load_all([file, from_])[0]
    parts = part_of(from_, from_range, at, joints, clip, reading)
    if layer and not gap:
        gap = layered(parts, clip)
    if parts and not gap and gaps is None:
        raise RequestError(
            f"no gap of {file.name} is named for --from",
            "the joints of another clip are laid into a gap",
            "Write --gap 120:150; or --layer, to lay them over the motion that is there.",
        )
    request = from_options(file, clip, gap, [] if parts and not layer else joints, gaps, reading)
    request = replace(request, parts=request.parts + parts, path=request.path + path, pins=request.pins + pin)
    points, pins = path_of(request.path, clip), pins_of(request.pins, clip, request.gaps)
    check_method(method or "auto", license)
    if method is not None:
        request = replace(request, method=method, methods={})
    if only_gap:
        request = replace(request, only=only_gap, why={})
    if seed is not None:
        request = replace(request, seed=seed)
    most = None if max_gap is None else longest(max_gap, clip.fps)
    lines = [request.said] * bool(request.said)
    lines += [
        f"{one.file} is on another rig: its motion was retargeted" for one in request.parts if one.retargeted
    ]
    outputs = Outputs.choose(file, output, "fill", player)
    if dry_run:
        return _dry_run(file, clip, request, points, pins, most, outputs, json, force, gaps)
    for read in (file, *(one.file for one in request.parts)):
        outputs.check(read, force, gaps)
    missing = len({frame for gap in request.gaps for frame in range(gap.start, gap.stop)})
    work = effort(missing, clip.fps) + len(clip) // 10
    with progress(f"filling {missing} frames of {file.name}", work) as advance:
        done = tasks.fill(
            clip,
            request.gaps,
            request.method,
            max_gap=most,
            only=request.only,
            seed=request.seed,
            methods=request.methods,
            progress=advance,
            action=request.action,
            parts=[one.part for one in request.parts],
            path=points,
            pins=pins,
        )
    if request.told:
        done = _retold(done, request.told)
    why = {number: request.why.get(number) or _why(left, most) for number, left in numbered(done)}
    more: dict[str, Any] = {"parts": parts_to_dict(request.parts)} if request.parts else {}
    more |= others_read((one.file for one in request.parts), file)
    more |= {"layer": True} if layer or request.layer else {}
    more |= {"path": request.path} if request.path else {}
    more |= {"pinned": request.pins} if request.pins else {}
    more |= {"left": request.left} if request.left else {}
    more |= {"dropped": request.dropped} if request.dropped else {}
    said = "\n".join(lines)
    code = finish(
        "fill", file, outputs, clip, done, request.seed, why, said, json=json, force=force, more=more
    )
    return code or (4 if request.left else 0)


def _retold(done: Completion, told: dict[At, list[str]]) -> Completion:
    """A completion whose gaps are told of, by frames and joints, what is told; what stood in for a method
    does so once more."""
    from interpose.finish import Provenance

    codes, names = done.provenance.copy(), done.clip.skeleton.names
    for gap in done.report.gaps:
        if any(note.startswith("filled by ") for note in told.get(_at(gap), ())):
            for name in names if gap.joints is None else gap.joints:
                part = codes[gap.start : gap.stop, names.index(name)]
                part[part != Provenance.OBSERVED] = Provenance.FALLBACK

    def with_told(gap: GapReport) -> GapReport:
        more = [note for note in told.get(_at(gap), ()) if note not in gap.notes]
        return replace(gap, notes=(*more, *gap.notes))

    report = replace(done.report, gaps=list(map(with_told, done.report.gaps)))
    return replace(done, provenance=codes, report=report)


def _at(gap: GapReport) -> At:
    return f"{gap.start}:{gap.stop}", gap.joints


def _why(gap: Gap, max_gap: int | None) -> str:
    """Why a gap stays open."""
    if max_gap is not None and len(gap) > max_gap:
        return f"longer than --max-gap {max_gap}"
    return "not among the gaps chosen"


def _dry_run(
    file: Path,
    clip: Clip,
    request: Request,
    points: dict[int, Any],
    pins: list[Pin],
    max_gap: int | None,
    outputs: Outputs,
    as_json: bool,
    force: bool,
    gaps: Path | None,
) -> int:
    """Say what would be done."""
    from interpose import tasks
    from interpose.finish.path import spans
    from interpose.observation import Observation
    from interpose.observation.part import lay

    parts = [one.part for one in request.parts]
    clip, seen = lay(clip, Observation.from_gaps(clip, request.gaps), parts)
    seen = replace(seen, pins=tuple(pins))
    spans(clip, seen, points)
    jobs = tasks.plan(clip, seen, request.method, max_gap, request.only, request.methods, request.action)
    code, ends = 4 if request.left or any(job.method is None for job in jobs) else 0, ""
    try:
        for read in (file, *(one.file for one in request.parts)):
            outputs.check(read, force, gaps)
    except RequestError as error:
        code, ends = error.exit_code, f"{error.what}; {error.why}. {error.fix}"
    if as_json:
        planned = [
            {
                "number": job.number,
                "frames": f"{job.gap.start}:{job.gap.stop}",
                "joints": None if job.gap.joints is None else list(job.gap.joints),
                "method": job.method.name if job.method else None,
            }
            for job in jobs
        ]
        files = [str(path) for path in outputs.all]
        more = {"path": request.path, "pinned": request.pins, "left": request.left}
        more |= {"dropped": request.dropped, "would_end_with": ends}
        more = {name: value for name, value in more.items() if value}
        say_json({"input": str(file), **details(clip), "would_fill": planned, "would_write": files, **more})
        return code
    say("\n".join(describe(file, clip)))
    if request.said:
        say(request.said)
    say()
    say_table(
        ("gap", "frames", "length", "joints", "would be filled by"),
        [
            (
                str(job.number),
                f"{job.gap.start}:{job.gap.stop}",
                seconds(len(job.gap), clip.fps),
                "" if job.gap.joints is None else names(job.gap.joints),
                job.method.name if job.method else f"nothing: {_why(job.gap, max_gap)}",
            )
            for job in jobs
        ],
        right=("gap", "frames", "length"),
    )
    for what, told in (("led over", request.path), ("pinned", request.pins)):
        if told:
            say(f"{what}: {'  '.join(told)}")
    say()
    say(outputs.told(dry_run=True))
    if ends:
        say(f"That would end with: {ends}")
    return code
