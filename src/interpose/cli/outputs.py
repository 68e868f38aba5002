"""What verbs leave behind: clip, report (of `fill`, `between` and `recover` to be replayed), and a page."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from hashlib import sha256
from json import dumps
from pathlib import Path
from typing import TYPE_CHECKING, Any

from interpose import __version__
from interpose.cli.console import figure, names, say, say_json, say_table, seconds
from interpose.cli.reading import describe, details
from interpose.errors import RequestError

if TYPE_CHECKING:
    from interpose.clip import Clip
    from interpose.finish import Completion, GapReport
    from interpose.observation import Gap

# Units of the measures in a report, for whoever reads the JSON.
UNITS = {
    "solve_error": "cm",
    "seam_before": "cm/frame^2",
    "seam_after": "cm/frame^2",
    "seam_limit": "cm/frame^2",
    "peak": "cm/frame^2",
    "peak_limit": "cm/frame^2",
    "bone_deviation": "cm",
    "foot_slide": "cm/s",
    "foot_slide_before": "cm/s",
    "foot_travel": "m",
    "penetration": "cm",
    "liveliness": "share of the motion around",
    "gliding": "share of the frames",
    "path": "cm",
    "pins": "cm",
    "drift": "cm",
    "expected": "cm",
    "expected_most": "cm",
}


# What verbs call what they make of take.bvh: take.filled.bvh and so on.
MADE = {
    "between": "between",
    "denoise": "denoised",
    "fill": "filled",
    "forecast": "forecast",
    "recover": "recovered",
    "stitch": "stitched",
}

# Whether a folder that is not there yet will be: a dry run of many clips makes none.
FOLDERS_MADE: ContextVar[bool] = ContextVar("FOLDERS_MADE", default=False)


@dataclass(frozen=True)
class Outputs:
    """The files of one run, beside each other: clip, report and (if asked for) page."""

    clip: Path
    report: Path
    page: Path | None

    @classmethod
    def choose(cls, file: Path, output: Path | None, verb: str, player: bool) -> Outputs:
        """take.bvh to take.filled.bvh, take.filled.json, take.filled.html; `output` names another clip."""
        clip = output or file.with_name(f"{file.stem}.{MADE[verb]}{file.suffix}")
        return cls(clip, clip.with_suffix(".json"), clip.with_suffix(".html") if player else None)

    @property
    def all(self) -> list[Path]:
        return [path for path in (self.clip, self.report, self.page) if path is not None]

    def earlier(self, verb: str) -> dict[str, Any] | None:
        """The report of an earlier run of the verb that left all of these files, or None."""
        from interpose.observation.gapfile import is_report, read_json

        report = read_json(self.report)
        whole = is_report(report) and report.get("verb") == verb and all(map(Path.exists, self.all))
        return report if whole else None

    def told(self, dry_run: bool = False) -> str:
        """What was written, or would be."""
        names = ", ".join(map(str, self.all))
        return f"a dry run: nothing is written. Without --dry-run: {names}" if dry_run else f"wrote {names}"

    def check(self, file: Path, force: bool, gaps: Path | None = None) -> None:
        """Before any work: RequestError if something is in the way.

        Args:
            file, gaps: the clip and the file of gaps that are read.
            force: existing files may be replaced; of .json files only reports, as `-o NAME.bvh` does not
                say that NAME.json is written, too.
        """
        from interpose.formats import FORMATS
        from interpose.observation.gapfile import is_report, read_json

        if self.clip.suffix.lower() not in FORMATS:
            folder = f" Or make the folder {self.clip} first." if not self.clip.suffix else ""
            raise RequestError(
                f"cannot write {self.clip}",
                f"the suffix {self.clip.suffix or '(none)'} names no format",
                f"Supported are {', '.join(FORMATS)}.{folder}",
            )
        for path in self.all:
            what = f"cannot write {path}"
            if path.exists() and path.samefile(file):
                raise RequestError(
                    what, "it is the input, which stays as it is", "Choose another name with -o."
                )
            if path.is_dir():
                raise RequestError(what, "it is a directory", "Name a file in it with -o.")
            if not (path.parent.is_dir() or FOLDERS_MADE.get()):
                raise RequestError(what, f"there is no folder {path.parent}", "Make the folder first.")
            if path == self.report and path.exists() and not is_report(read_json(path)):
                read = gaps is not None and gaps.exists() and path.samefile(gaps)
                why = "it is the file of gaps, which stays as it is" if read else "it is no earlier report"
                fix = "Choose another name with -o: --force replaces clips and reports, not other files."
                raise RequestError(what, why, fix)
            if os.path.lexists(path) and not force:
                raise RequestError(
                    what, "the file exists already", "Choose another name with -o, or add --force."
                )


def write_text(path: Path, text: str) -> None:
    """Write a file whole or not at all. Raises FileError when it cannot be written."""
    from interpose.formats.whole import replacing

    with replacing(path) as part:
        part.write_text(text, encoding="utf-8")


@contextmanager
def beside(outputs: Outputs, report: dict[str, Any], page: str) -> Iterator[None]:
    """Writes report and page, and lets the caller write the clip when there is room for them: if that fails,
    all files stay as they were. A report comes last, so that it stands for a whole result."""
    from interpose.formats.whole import replacing

    texts = [(outputs.report, dumps(report, indent=2, allow_nan=False) + "\n")]
    texts += [(outputs.page, page)] if outputs.page else []
    with ExitStack() as stack:
        for path, text in texts:
            stack.enter_context(replacing(path)).write_text(text, encoding="utf-8")
        yield


def numbered(completion: Completion) -> list[tuple[int, Gap]]:
    """The gaps left open with their numbers: those that no filled gap has, in order of time."""
    left = completion.report.open
    taken = {gap.number for gap in completion.report.gaps}
    free = [number for number in range(1, len(taken) + len(left) + 1) if number not in taken]
    return list(zip(free, left))


def to_json(
    verb: str,
    file: Path,
    output: Path,
    clip: Clip,
    completion: Completion,
    seed: int | None,
    why: dict[int, str],
    more: dict[str, Any],
) -> dict[str, Any]:
    """The report as it is written beside the clip; `fill --gaps` replays it.

    Args:
        why: for the number of each open gap why it is open.
        more: what only this verb says.
    """
    report = completion.report.to_dict()
    return {
        "interpose": __version__,
        "verb": verb,
        "input": str(file),
        "input_sha256": _checksum(file),
        "output": str(output),
        **details(clip),
        **({"skeleton_sha256": _checksum(clip.source.asf.path)} if hasattr(clip.source, "asf") else {}),
        "method": report["method"],
        **({"action": report["action"]} if report["action"] else {}),
        "seed": seed,
        **more,
        "gaps": gap_entries(completion),
        "open": [
            {
                "number": number,
                "frames": f"{gap.start}:{gap.stop}",
                "joints": None if gap.joints is None else list(gap.joints),
                "why": why.get(number, ""),
            }
            for number, gap in numbered(completion)
        ],
        **{name: report[name] for name in ("moments", "exchanged", "unpaired") if name in report},
        "weights": used(completion),
        "sources": completion.sources(),
        "units": UNITS,
    }


def others_read(files: Iterable[Path], file: Path) -> dict[str, Any]:
    """What a report says of the files that were read beside its input: the checksum of each."""
    named = {one.resolve(): one for one in (file, *files)}  # each once, however it is spelled
    others = {str(one): _checksum(one) for path, one in named.items() if path != file.resolve()}
    return {"others_sha256": others} if others else {}


def _checksum(file: Path) -> str:
    return sha256(file.read_bytes()).hexdigest()


def gap_entries(completion: Completion) -> list[dict[str, Any]]:
    """What a report says of each filled gap."""
    return [
        {
            "number": gap["number"],
            "frames": f"{gap['start']}:{gap['stop']}",
            "joints": gap["joints"],
            **{name: value for name, value in gap.items() if name not in ("start", "stop", "weights")},
        }
        for gap in completion.report.to_dict()["gaps"]
    ]


def used(completion: Completion) -> list[dict[str, Any]]:
    """The trained weights that had a part in a completion, each once: name, licence and commit."""
    found: list[dict[str, Any]] = []
    for gap in completion.report.gaps:
        found += [one for one in gap.weights if one not in found]
    return found


def finish(
    verb: str,
    file: Path,
    outputs: Outputs,
    clip: Clip,
    completion: Completion,
    seed: int | None,
    why: dict[int, str],
    said: str = "",
    *,
    json: bool,
    force: bool,
    more: dict[str, Any] | None = None,
    read: list[str] | None = None,
    dry_run: bool = False,
) -> int:
    """Write everything, print the report, and return the exit code: 4 when a gap stays open.

    `read` are lines of what was read, where that is not the file as the clip is.
    """
    report = to_json(verb, file, outputs.clip, clip, completion, seed, why, more or {})
    notes = [] if dry_run else write(outputs, force, clip, completion, report)
    if json:
        say_json(report)
    else:
        read = describe(file, clip) if read is None else read
        say("\n".join([*read, *([said] if said else []), ""]))
        print_report(completion, clip.fps, why)
        notes = [*licence(completion), *notes]
        say("\n".join(["", *(f"note: {note}" for note in notes), outputs.told(dry_run)]))
    return 4 if completion.report.open else 0


def licence(completion: Completion) -> list[str]:
    """A note where weights had a part in it that are not for any use."""
    from interpose.methods.weights import for_any_use

    closed = [one["name"] for one in used(completion) if not for_any_use(one["licence"])]
    named = " and ".join(closed)
    return [f"{named}: for research and non-commercial use; --license open avoids them"] if closed else []


def write(
    outputs: Outputs, force: bool, clip: Clip, completion: Completion, report: dict[str, Any]
) -> list[str]:
    """Write all files; returns notes on what the format could not hold."""
    from interpose.formats import save

    page = compare(clip, completion, outputs.clip.name) if outputs.page else ""
    with beside(outputs, report, page):
        return list(save(completion.clip, outputs.clip, force=force))


def compare(clip: Clip, completion: Completion, title: str) -> str:
    """A page that plays the clip as it was, faintly, and as it is now; once, if that is all there is."""
    from interpose.observation import Gap
    from interpose.show import Take, player

    done = "filled" if completion.report.noise is None else "denoised"
    takes = [Take(done, completion.clip.positions(), "#d1495b")]
    if clip is not completion.clip:
        takes.append(Take("input", clip.positions(), "#6b7280", ghost=True))
    report = completion.report
    brief = [Gap.parse(at, (one.joint,)) for one in (*report.moments, *report.exchanged) for at in one.frames]
    gaps = [*report.gaps, *brief]
    text, names_ = str(completion.report), clip.skeleton.names
    return player(takes, clip.skeleton.parents, clip.fps, gaps, title=title, report=text, names=names_)


def print_report(completion: Completion, fps: float, why: dict[int, str]) -> None:
    """A line for each gap, then what is to be said about single ones, then what stayed open."""
    gaps, report = completion.report.gaps, completion.report
    if report.exchanged:
        say(report.sides)
        if not gaps and not report.moments:
            return
    if report.moments:
        say(report.momentary)
        for one in report.moments:
            more = f" +{len(one.frames) - 8}" if len(one.frames) > 8 else ""
            say(f"  {one.joint}: {', '.join(one.frames[:8])}{more}", style="dim")
        if not gaps:
            return
    say_table(
        ("gap", "frames", "length", "joints", "method", "seam", "bones", "slide", "travel", "drift"),
        [_row(gap, fps) for gap in gaps],
        right=("gap", "frames", "length", "seam", "bones", "slide", "travel", "drift"),
    )
    if gaps:
        say("\n".join(_legend(gaps)), style="dim")
    parts = Counter(gap.number for gap in gaps)
    said = (
        (gap.number, f" ({gap.start}:{gap.stop})" if parts[gap.number] > 1 else "", note)
        for gap in gaps
        for note in gap.notes
    )
    for number, part, note in dict.fromkeys(said):
        say(f"gap {number}{part}: {note}")
    for number, left in numbered(completion):
        say(f"gap {number} stays open: {left} ({seconds(len(left), fps)}), {why.get(number, 'not filled')}")


def _legend(gaps: list[GapReport]) -> Iterator[str]:
    """What the columns mean, of those that are there."""
    if any(gap.seam_after is not None for gap in gaps):
        known = any(gap.seam_limit is not None and gap.seam_limit != gap.peak_limit for gap in gaps)
        usual = " (95th percentile of its own jumps)" if known else ""
        yield f"seam: velocity jump at the ends, cm/frame^2, of the joint nearest to its limit{usual}"
    yield "bones: largest change in bone length, cm"
    if any(gap.foot_slide is not None for gap in gaps):
        yield "slide, travel: foot sliding, cm/s, and foot travel, m"
    if any(gap.drift is not None for gap in gaps):
        yield "drift: of the trajectory before it was corrected, cm"


def seam(jump: float | None, limit: float | None) -> str:
    """A velocity jump and how far it may go, "1.05 of 2.56"."""
    return figure(jump) if limit is None else f"{figure(jump)} of {figure(limit)}"


def _row(gap: GapReport, fps: float) -> list[str]:
    joints = "" if gap.joints is None else names(gap.joints, most=2)
    return [
        str(gap.number),
        f"{gap.start}:{gap.stop}",
        seconds(gap.stop - gap.start, fps),
        joints,
        gap.method if gap.model is None or gap.model == gap.method else f"{gap.method} ({gap.model})",
        seam(gap.seam_after, gap.seam_limit),
        figure(gap.bone_deviation),
        figure(gap.foot_slide, 1),
        figure(gap.foot_travel),
        figure(gap.drift, 1),
    ]
