"""interpose stitch: clips one after another, and what leads from each to the next."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from cyclopts import Parameter

from interpose.cli.console import names, progress, say, say_json, say_table, seconds
from interpose.cli.outputs import Outputs, licence, others_read, print_report, to_json, write
from interpose.cli.reading import Reading, describe
from interpose.cli.whole import Whole
from interpose.errors import RequestError
from interpose.formats.place import vectors_in_file
from interpose.observation import Gap
from interpose.skeletons.carrier import hips_of

if TYPE_CHECKING:
    from interpose.clip import Clip
    from interpose.observation.timeline import Placement
    from interpose.tasks import Stitched
    from interpose.tasks.stitching import Loop

TRAVELS = 0.5  # metres over the floor: a body that travels, whose root may go along
# Of what only this verb measures.
UNITS = {
    "yaw": "degrees",
    "shift": "the file's unit and axes",
    "way": "m",
    "jump": "cm/frame^2",
    "limit": "cm/frame^2",
}


@dataclass(frozen=True)
class Piece:
    """A clip as it is named on the command line.

    Attributes:
        file: where it is.
        part: START:STOP, or None for all of it.
        whole, clip: all of the file, and what is meant of it, on the first file's skeleton.
        retargeted: whether that is of another rig.
    """

    file: Path
    part: str | None
    whole: Clip
    clip: Clip
    retargeted: bool = False

    def __str__(self) -> str:
        return f"{self.file}#{self.part}" if self.part else str(self.file)


def stitch(
    *files: Annotated[str, Parameter(name="FILES")],
    frames: str = "auto",
    align: Annotated[bool, Parameter(negative="--no-align")] = True,
    loop: bool = False,
    trim: bool = False,
    action: str = "",
    output: Annotated[Path | None, Parameter(name=("--output", "-o"))] = None,
    method: str = "auto",
    license: str = "any",
    seed: Whole | None = None,
    player: bool = False,
    json: bool = False,
    force: bool = False,
    reading: Reading = Reading(),
) -> int:
    """Join clips one after another, and generate the transitions between them.

    The first clip stays where it is, and the result has its skeleton and frame rate;
    clips on other rigs are retargeted. Each following clip is turned and placed so
    that it continues in the direction of the one before; all of its frames are kept.
    Heights above the floor stay the same. Parts of one take with up to .1 s between
    them are joined as one continuous motion, even if the position jumps there.
    Writes the clip and a report beside the first file: walk.stitched.bvh and
    walk.stitched.json.

    Try:
      interpose stitch walk.bvh run.bvh jump.bvh --player
      interpose stitch walk.bvh run.bvh jump.bvh --frames 20,45
      interpose stitch walk.bvh#10:90 sit.bvh#120:300 --no-align
      interpose stitch walk.bvh --loop
      interpose stitch walk.bvh --loop --trim

    Args:
        files: FILE or FILE#START:STOP, frames START to STOP - 1 of it, or seconds (.bvh, .npz, .amc); without
            START from the first frame on, without STOP to the last one.
        frames: length of the transitions in frames, or seconds: one number, or one for each; auto (the
            default) chooses unhurried ones.
        align: turn and place each clip to continue the one before; --no-align leaves clips where they are.
        loop: also generate a transition back to the beginning, so that the result can be played as a loop.
        trim: with --loop, keep only the part of the clip that loops best, such as one stride of a walk, and
            generate just a few frames to close it.
        action: an action label for the generated motion; `interpose models base` lists them.
        output: where to write the clip; the report goes beside it.
        method: what generates it: auto (the default), base, spline, ... `interpose models` lists them.
        license: open to use only weights that may be used for anything; any (the default).
        seed: random seed, for methods that sample.
        player: write a page (walk.stitched.html) that plays the result; it opens in any browser.
        json: print the report as JSON.
        force: overwrite existing files (.json files only if they are reports).
    """
    from interpose import tasks
    from interpose.cli.request import check_method

    check_method(method, license)
    if not files:
        raise RequestError("no clips are named", "it takes two or more", "Write stitch walk.bvh run.bvh.")
    pieces = _read(files, reading)
    pieces = [_fitted(piece, pieces[0].whole) for piece in pieces]
    if trim:
        pieces, frames = _trimmed(pieces, loop, frames)
    first = pieces[0].file
    outputs = Outputs.choose(first, output, "stitch", player)
    for piece in pieces:
        outputs.check(piece.file, force)
    clips = [piece.clip for piece in pieces]
    with progress(f"stitching {len(clips)} clips", sum(map(len, clips))) as advance:
        done = tasks.stitch(clips, _lengths(frames, clips[0].fps), align, loop, action, method, seed, advance)
    others = dict.fromkeys(piece.file for piece in pieces if piece.retargeted)
    rigs = [f"{file} is on another rig: its motion was retargeted to that of {first}" for file in others]
    remarks = [*rigs, *_odd(pieces), *_roots(pieces)]
    more = others_read((piece.file for piece in pieces), first) | _more(pieces, done)
    more |= {"notes": remarks} if remarks else {}
    report = to_json("stitch", first, outputs.clip, done.clip, done, seed, {}, more)
    report["units"] = {**report["units"], **UNITS}
    notes = write(outputs, force, done.clip, done, report)
    if json:
        say_json(report)
        return 0
    lines = dict.fromkeys(line for piece in pieces for line in describe(piece.file, piece.whole))
    say("\n".join([*lines, ""]))
    _print_clips(pieces, done)
    say()
    print_report(done, done.clip.fps, {})
    said = [f"note: {note}" for note in (*remarks, *licence(done), *notes)]
    say("\n".join([*_closing(done), "", *said, outputs.told()]))
    return 0


def _trimmed(pieces: list[Piece], loop: bool, frames: str) -> tuple[list[Piece], str]:
    """The part of a clip that goes round, and how many frames lead back."""
    from interpose import tasks

    if not loop or len(pieces) > 1 or frames != "auto":
        why = "it keeps the part of one clip that goes round, and says how many frames lead back"
        raise RequestError("--trim goes with --loop alone", why, "Write stitch walk.bvh --loop --trim.")
    (piece,) = pieces
    found = tasks.cycle(piece.clip)
    offset = 0 if piece.part is None else Gap.parse(piece.part, clip=piece.whole).start
    part = f"{offset + found.start}:{offset + found.stop}"
    return [replace(piece, part=part, clip=_part(piece.file, piece.whole, part))], str(found.frames)


def _read(texts: Sequence[str], reading: Reading) -> list[Piece]:
    """Of each FILE or FILE#START:STOP."""
    named = [_named(text) for text in texts]
    wholes = reading.load_all([file for file, _ in named])
    return [
        Piece(file, part, whole, _part(file, whole, part) if part is not None else whole)
        for (file, part), whole in zip(named, wholes)
    ]


def _named(text: str) -> tuple[Path, str | None]:
    """The file, and the part of it."""
    name, _, part = text.rpartition("#")
    return (Path(text), None) if not name or Path(text).exists() else (Path(name), part)


def _part(file: Path, whole: Clip, part: str) -> Clip:
    """Some frames of a file."""
    try:
        span = Gap.parse(part, clip=whole)
    except RequestError:
        fix = f"Write {quote(f'{file}#12:80')} for the frames 12 to 79."
        raise RequestError(f"cannot read the part {part} of {file}", "a part is START:STOP", fix) from None
    if not 0 <= span.start < span.stop <= len(whole):
        why = f"the clip has {len(whole)} frames, counted from 0"
        raise RequestError(f"there are no frames {part} in {file}", why, f"Stay within 0:{len(whole)}.")
    return whole.slice(span.start, span.stop)


def _odd(pieces: list[Piece]) -> Iterator[str]:
    """Pieces whose first or last frame is a rest pose, or another that has nothing to do with the rest."""
    from interpose.observation.scan import strays

    for piece in pieces:
        if odd := strays(piece.clip):
            first, last = int(0 in odd), len(piece.clip) - int(len(piece.clip) - 1 in odd)
            start = 0 if piece.part is None else Gap.parse(piece.part, clip=piece.whole).start
            better = quote(f"{piece.file}#{start + first}:{start + last}")
            what = "begins" if first else "ends"
            yield f"{piece} {what} with a frame that has nothing to do with the rest: {better} leaves it out"


def _roots(pieces: list[Piece]) -> Iterator[str]:
    """Where a root above the hips goes along in one piece and stays where it is in another."""
    skeleton = pieces[0].clip.skeleton
    above = skeleton.ancestors(hips := hips_of(skeleton))
    if not above or above[-1] not in pieces[0].clip.translated:
        return
    moved = {True: list[str](), False: list[str]()}
    for piece in pieces:
        root, body = (
            np.ptp(piece.clip.positions()[:, joint, ::2], axis=0).max() for joint in (above[-1], hips)
        )
        if body > TRAVELS:
            moved[bool(root > body / 2)].append(str(piece))
    if moved[True] and moved[False]:
        goes, stays = (names(list(dict.fromkeys(moved[one]))) for one in (True, False))
        ways = f"goes along in {goes} and stays where it is in {stays}"
        yield f"{skeleton.names[above[-1]]} {ways}: between them it leads from the one to the other"


def _fitted(piece: Piece, first: Clip) -> Piece:
    """The piece on the rig of the first file; all of a file tells more of its skeleton than a part does."""
    from interpose.finish import on_rig_of

    clip = on_rig_of(piece.whole, first) if len(piece.whole) and len(first) else piece.whole
    if clip is piece.whole:
        return piece
    return replace(
        piece, clip=_part(piece.file, clip, piece.part) if piece.part is not None else clip, retargeted=True
    )


def _lengths(text: str, fps: float) -> str | list[int] | int:
    """auto, one number of frames or seconds, or several separated by commas."""
    from interpose.observation.observation import frames_of

    if text == "auto":
        return text
    said = [frames_of(one, fps) for one in text.split(",")]
    return said[0] if len(said) == 1 else said


def _placed(placement: Placement, clip: Clip) -> dict[str, Any]:
    """A placement as numbers of the file that a clip is written to: what --path and --pin speak in, too."""
    unit, up = getattr(clip.source, "unit", 1.0), getattr(clip.source, "up", "y")
    shift = [round(float(value), 4) for value in vectors_in_file(np.array(placement.shift), unit, up)]
    # About the origin, from which a clip may lie far away.
    return {"yaw": round(float(np.degrees(placement.yaw)), 7), "shift": shift}


def _more(pieces: list[Piece], done: Stitched) -> dict[str, Any]:
    """What only this verb says: where each clip lies on the timeline, and how a loop closes."""
    clips = [
        {
            "file": str(piece.file),
            "part": piece.part,
            "frames": f"{laid.start}:{laid.stop}",
            **_placed(laid.placement, done.clip),
            "scale": round(laid.scale, 4),
            **({"retargeted": True} if piece.retargeted else {}),
            "gap_before": laid.why,
        }
        for piece, laid in zip(pieces, done.clips)
    ]
    loop = done.loop
    if loop is None:
        return {"clips": clips}
    closing = {
        "way": round(_way(done, loop), 4),
        "gap_before": loop.why,
        "jump": loop.jump,
        "limit": loop.limit,
    }
    return {"clips": clips, "loop": {**_placed(loop.placement, done.clip), **closing}}


def _print_clips(pieces: list[Piece], done: Stitched) -> None:
    """A line for each clip: where it lies, how it was placed, and why the gap before it has its length."""
    say_table(
        ("clip", "frames", "length", "turned", "moved", "scaled", "the gap before it"),
        [
            [
                str(piece),
                f"{laid.start}:{laid.stop}",
                seconds(laid.stop - laid.start, done.clip.fps),
                f"{np.degrees(laid.placement.yaw):.0f} deg" if laid.placement.yaw else "",
                f"{np.hypot(*laid.placement.shift[::2]):.2f} m" if any(laid.placement.shift) else "",
                f"{laid.scale:.3f}" if laid.scale != 1 else "",
                laid.why,
            ]
            for piece, laid in zip(pieces, done.clips)
        ],
        right=("frames", "length", "turned", "moved", "scaled"),
    )


def _way(done: Stitched, loop: Loop) -> float:
    """Metres that the hips get on each time a loop goes round. Turned about the origin, what lies far from it
    is shifted a long way: it is the body's own that is meant."""
    hips = done.clip.slice(0, 1).positions()[0, hips_of(done.clip.skeleton)]
    return float(np.hypot(*(loop.placement.at(hips) - hips)[::2]))


def _closing(done: Stitched) -> list[str]:
    """How a loop closes."""
    loop = done.loop
    if loop is None:
        return []
    way = _way(done, loop)
    turned = np.degrees(loop.placement.yaw)
    lines = [f"loop: {loop.why}"] if loop.why else []
    lines += [f"loop: frame 0 follows frame {len(done.clip) - 1}, each time {way:.2f} m on"]
    lines[-1] += f" and turned by {turned:.0f} degrees" if abs(turned) >= 0.5 else ""
    if loop.jump is not None and loop.limit is not None:
        lines += [f"loop: the velocity jumps there by {loop.jump:.2f} cm/frame^2 (limit {loop.limit:.2f})"]
    return lines
