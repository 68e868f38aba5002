"""What a command line asks to be filled: gaps from options, a file, an earlier report, or a scan."""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from pathlib import Path
from shlex import quote
from typing import Any

import numpy as np

from interpose.cli.console import names
from interpose.cli.reading import Reading, full_names, joints_of, split_names
from interpose.clip import Clip
from interpose.errors import NothingError, RequestError, unknown
from interpose.formats.place import vectors_inside
from interpose.formats.text import VALUE_LIMIT
from interpose.observation import Gap, Observation, Part, Pin
from interpose.observation.finding import NO_GAPS, STUCK, to_gaps
from interpose.observation.gapfile import is_report, read_gaps, read_json
from interpose.observation.observation import frame_at
from interpose.observation.scan import scan

EASED = 0.4  # seconds over which joints of another clip are eased in and out
# What a scan finds that is no gap, in words.
LEFT = {
    "jump": "jumps",
    "noisy": "noise",
    "repeated": "repeated frames",
    "splined": "what was splined",
    "still": "what stands still",
}
# Notes that tell why another method filled a gap.
STOOD_IN = re.compile(r"not filled by |filled by .* instead")
At = tuple[str, tuple[str, ...] | None]  # where a gap is: its frames, and its joints
OTHERS = ("denoise", "forecast", "stitch")  # verbs whose reports `fill` cannot repeat


@dataclass(frozen=True)
class Lent:
    """Poses of single joints that another clip gives.

    Attributes:
        file, frames: whose they are, and which.
        part: the same on the skeleton of the clip that they are given to, and at its rate.
        retargeted: whether the file is of another rig.
    """

    file: Path
    frames: str
    part: Part
    retargeted: bool


@dataclass(frozen=True)
class Request:
    """What is to be filled, and how.

    Attributes:
        gaps: what is missing.
        method, methods: the method, and those of single gaps by number.
        only: the numbers of the gaps to fill, None for all.
        seed: for methods that sample.
        why: why a gap stays open, by number, where an earlier report says it.
        said: lines for the user: where the gaps come from.
        action: what the motion is, for methods that know actions.
        parts: poses of single joints from other clips.
        path: points of the floor, as they were written.
        pins: places of joints, as they were written.
        left: what is missing, too, and is another verb's.
        dropped: the same of joints that drop out for moments, which most takes have: no reason to look again.
        layer: whether the parts are laid over motion that stays.
        told: of gaps, by frames and joints, why another method filled them than the one that was asked for.
    """

    gaps: list[Gap]
    method: str = "auto"
    methods: dict[int, str] = field(default_factory=dict)
    only: list[int] | None = None
    seed: int | None = None
    why: dict[int, str] = field(default_factory=dict)
    said: str = ""
    action: str = ""
    parts: list[Lent] = field(default_factory=list)
    path: list[str] = field(default_factory=list)
    pins: list[str] = field(default_factory=list)
    left: str = ""
    dropped: str = ""
    layer: bool = False
    told: dict[At, list[str]] = field(default_factory=dict)


def from_options(
    file: Path,
    clip: Clip,
    ranges: list[str],
    joints: list[str],
    gaps: Path | None,
    reading: Reading,
) -> Request:
    """The request of `fill`. Raises RequestError when it does not fit the clip or nothing is missing."""
    chosen = joints_of(joints, clip)
    listed = [Gap.parse(text, chosen, clip) for text in ranges]
    if gaps is not None:
        if chosen and not ranges:
            why = "the file says which joints are missing"
            fix = 'Write "joints": ["LeftArm"] into its entries.'
            raise RequestError("--joints does not apply to --gaps", why, fix)
        content = read_json(gaps)
        if is_report(content) and (verb := content.get("verb")) in OTHERS:
            why = f"{gaps} is of {verb}, which makes what is no gap of the clip that it was given"
            raise RequestError("this report cannot be repeated", why, f"Run interpose {verb} again.")
        if is_report(content) and any(map(content.get, ("place", "moments", "exchanged"))):
            why = f"{gaps} is of recover, which restored what is no gap"
            raise RequestError("this report cannot be repeated", why, "Run interpose recover again.")
        if is_report(content) and content.get("poses"):
            why = f"{gaps} is of poses of several files, between which a clip of its own was made"
            raise RequestError("this report cannot be repeated", why, "Run interpose between again.")
        if is_report(content) and content.get("frames", len(clip)) != len(clip):
            why = f"it is of a clip of {content['frames']} frames, and {file} has {len(clip)}"
            fix = f"Repeat it on {content.get('input', 'its own clip')}, or name the gaps with --gap."
            raise RequestError(f"{gaps} does not fit", why, fix)
        filled = read_gaps(gaps, clip)
        if is_report(content) and listed:
            why = f"{gaps} is a report, which is repeated as it is: gaps, methods and seed"
            fix = f"Leave --gap out; or write all gaps, those of {gaps} too, as --gap or into a list of gaps."
            raise RequestError("--gap does not go with a report", why, fix)
        try:
            request = (
                _replay(gaps, filled, content, clip, reading)
                if is_report(content)
                else Request([*filled, *listed])
            )
        except (KeyError, TypeError, AttributeError) as error:
            why = f"it is no longer as it was written: {type(error).__name__}, {error}"
            raise RequestError(
                f"cannot repeat {gaps}", why, "Write its gaps into a list, or run anew."
            ) from None
    elif listed:
        request = Request(listed)
    elif chosen:
        request = Request([Gap(0, len(clip), chosen)])
    else:
        request = _scanned(file, clip)
    for gap in request.gaps:
        gap.check(len(clip))
        for name in gap.joints or ():
            clip.skeleton.index(name)
    if not request.gaps:
        raise RequestError(
            f"nothing to fill in {file}", f"{gaps} lists no gaps", "Name one with --gap 120:160."
        )
    return request


def _scanned(file: Path, clip: Clip) -> Request:
    found = scan(clip)
    gaps = to_gaps(found)
    fix = "Name what is missing: --gap 120:160, --joints LeftArm or --gaps FILE.json."
    dropped = [one for one in found if one.kind == "lost"]
    sides = [one for one in found if one.kind in ("exchanged", "flipped")]
    stuck = [one for one in found if one.kind in STUCK]
    others = {
        "joints that drop out for moments": dropped,
        "limbs on the wrong side": sides,
        "hips that stand still": stuck,
    }
    kinds = [what for what, some in others.items() if some]
    left = f"{' and '.join(kinds)}, which `interpose recover` restores" if kinds else ""
    if not gaps:
        seen = [what for kind, what in LEFT.items() if any(one.kind == kind for one in found)]
        but = left or (f"{' and '.join(seen)}: interpose scan {quote(str(file))} says more" if seen else "")
        why = "no --gap is given, and a scan finds nothing missing" + (f" but {but}" if but else "")
        raise NothingError(f"nothing to fill in {file}", why, fix, left, 4 if stuck or sides else 0)
    lines = ["no --gap is given, so what a scan finds is filled:"]
    lines += [
        f"  {one.start}:{one.stop} {one.kind} ({names(one.joints)}), {one.note}"
        for one in found
        if one.kind not in NO_GAPS
    ]
    lines += [
        f"  {one.start}:{one.stop} {one.kind} is not: see interpose recover" for one in (*stuck, *sides)
    ]
    lines += [
        f"  {one.start}:{one.stop} splined ({names(one.joints)}) is not: name it to fill it anew"
        for one in found
        if one.kind == "splined"
    ]
    if dropped:
        lines.append(f"  joints that drop out for moments are not ({len(dropped)}): see interpose recover")
    said, first = "\n".join(lines), next(iter(others))
    return Request(
        gaps,
        said=said,
        left=left if stuck or sides else "",
        dropped=f"{first}, which `interpose recover` restores" if dropped else "",
    )


def part_of(
    path: Path | None, span: str | None, at: int | None, joints: list[str], clip: Clip, reading: Reading
) -> list[Lent]:
    """What the options of `fill` name for a clip: --from, --from-range, --at and --joints."""
    from interpose import tasks

    if path is None:
        if span is not None or at is not None:
            why = "--from-range and --at say which frames of another clip go where"
            raise RequestError("no other clip is named", why, "Name it with --from FILE.")
        return []
    names = split_names(joints)
    if at is None or not names:
        why = "they say where the other clip's frames begin, and which joints are taken"
        raise RequestError(
            "--from needs --at and --joints", why, "Write --at 130 --joints RightArm,RightHand."
        )
    other = reading.load_fitting(path)[0]
    whole = Gap(0, len(other)) if span is None else _frames(span)
    part = Part(other, whole.start, whole.stop, at, full_names(names, clip))
    (fitted,) = tasks.fitted([part], clip)
    return [Lent(path, f"{whole.start}:{whole.stop}", fitted, fitted.clip.skeleton is not other.skeleton)]


def layered(parts: list[Lent], clip: Clip) -> list[str]:
    """The gap in which --layer lays the part: with what it takes to ease it in and out."""
    part, over = parts[0].part, max(2, round(EASED * clip.fps))
    end = part.at + part.stop - part.start
    if end > len(clip):
        count = part.stop - part.start
        why = f"the clip has {len(clip)} frames, and {count} from {part.at} on reach to {end}"
        raise RequestError("the other clip reaches beyond the end", why, "Take fewer with --from-range.")
    return [f"{max(part.at - over, 0)}:{min(end + over, len(clip))}"]


def _frames(text: str) -> Gap:
    try:
        return Gap.parse(text)
    except RequestError as error:
        fix = "Write --from-range 40:48 for the frames 40 to 47."
        raise RequestError(
            f"cannot read --from-range {text}", error.why.replace("a gap", "it"), fix
        ) from None


def range_of(text: str, clip: Clip, joints: tuple[str, ...] | None = None) -> Gap:
    """The gap that --frames names; RequestError when it cannot be read."""
    try:
        return Gap.parse(text, joints, clip)
    except RequestError as error:
        fix = "Write --frames 120:160 for the frames 120 to 159, or --frames 4s:5.3s."
        raise RequestError(f"cannot read --frames {text}", error.why.replace("a gap", "it"), fix) from None


FRAME = r"\d+|\d*\.?\d+s"  # a frame, or a time in seconds


def frame_of(text: str, clip: Clip, end: bool = False) -> int:
    """A frame from "140", or the one nearest to "3.5s"; or the `end` of a range, which may be the one after
    the last. RequestError for what is none, or is not there."""
    try:
        frame = frame_at(text, clip.fps) if re.fullmatch(FRAME, text) else None
    except ValueError:  # hundreds of digits
        frame = None
    if frame is None:
        why = "it is a number of a frame, counted from 0, or a time in seconds"
        raise RequestError(f"cannot read the frame {text}", why, "Write 140, or 3.5s.")
    if frame >= len(clip) + end:
        why = f"the clip has {len(clip)} frames, counted from 0"
        raise RequestError(f"there is no frame {text}", why, f"Choose one of 0 to {len(clip) - 1}.")
    return frame


def path_of(texts: list[str], clip: Clip) -> dict[int, np.ndarray]:
    """Points "FRAME:A,B" of --path, in the file's own unit and floor axes: x and z in metres by frame."""
    unit, up = getattr(clip.source, "unit", 1.0), getattr(clip.source, "up", "y")
    floor = ["xyz".index(axis) for axis in "xyz" if axis != up[-1]]
    points: dict[int, np.ndarray] = {}
    for text in texts:
        match = re.fullmatch(rf"({FRAME}):([^,]+),([^,]+)", text)
        try:
            where = np.zeros(3)
            where[floor] = [float(number) for number in match.groups()[1:]] if match else np.nan
        except ValueError:
            where[:] = np.nan
        if match is None or not np.abs(where).max() <= VALUE_LIMIT:
            names = " and ".join("xyz"[axis] for axis in floor)
            raise RequestError(
                f"cannot read --path {text}",
                f"a point is a frame and two coordinates on the floor, {names}, in the file's own unit",
                "Write for example --path 130:120.5,-40.",
            )
        frame, point = frame_of(match[1], clip), vectors_inside(where, unit, up)[[0, 2]]
        if np.any(points.setdefault(frame, point) != point):
            raise RequestError(
                f"the path is given two points at frame {frame}",
                "the hips can be over one of them",
                "Leave one of the points out.",
            )
    return points


def pins_of(texts: list[str], clip: Clip, gaps: list[Gap]) -> list[Pin]:
    """Pins "JOINT@FRAME:X,Y,Z" or "JOINT@START:STOP:X,Y,Z" of --pin, in the file's own unit and axes; or with
    "@FRAME" for the place, which is known in spite of the gaps: there, and turned as it is then."""
    unit, up = getattr(clip.source, "unit", 1.0), getattr(clip.source, "up", "y")
    found = []
    for text in texts:
        match = re.fullmatch(
            rf"(.+)@({FRAME})(?::({FRAME}))?:(?:@({FRAME})|([^:,]+),([^:,]+),([^:,]+))", text
        )
        try:
            where = np.array(
                [float(number) for number in match.groups()[4:]] if match and not match[4] else 0
            )
        except ValueError:
            where = np.array([np.nan])
        start = frame_of(match[2], clip) if match else 0
        stop = frame_of(match[3], clip, end=True) if match and match[3] else start + 1
        if match is None or not np.abs(where).max() <= VALUE_LIMIT or stop <= start:
            raise RequestError(
                f"cannot read --pin {text}",
                "a pin is a joint, a frame or a range, and three coordinates in the file's own unit and axes",
                "Write for example --pin LeftHand@130:35,142,-20, LeftHand@130:140:35,142,-20 to hold it, or "
                "LeftHand@130:140:@129 to hold it as it is at frame 129.",
            )
        (joint,) = full_names([match[1]], clip)
        clip.skeleton.index(joint)
        frames = np.arange(start, stop)
        if match[4]:
            place, turn = _held(text, joint, frame_of(match[4], clip), clip, gaps)
        else:
            place, turn = vectors_inside(where, unit, up), None
        rows = None if turn is None else np.tile(turn, (len(frames), 1))
        found.append(Pin(joint, frames, np.tile(place, (len(frames), 1)), rows))
    return found


def _held(text: str, name: str, frame: int, clip: Clip, gaps: list[Gap]) -> tuple[np.ndarray, np.ndarray]:
    """Where a joint is at a frame, in metres, and how it is turned; RequestError where gaps hide it."""
    known, joint = Observation.from_gaps(clip, gaps), clip.skeleton.index(name)
    if not (known.positions(clip.skeleton) & known.rotation)[frame, joint]:
        raise RequestError(
            f"cannot use --pin {text}",
            f"where {name} is at frame {frame} is missing itself",
            "Name a frame outside of the gaps.",
        )
    turned, placed = clip.slice(frame, frame + 1).kinematics()
    return placed[0, joint], turned[0, joint]


def parts_to_dict(parts: list[Lent]) -> list[dict[str, Any]]:
    """For a report, so that it can be replayed."""
    return [
        {
            **{
                "file": str(one.file),
                "frames": one.frames,
                "at": one.part.at,
                "joints": list(one.part.joints),
            },
            **({"retargeted": True} if one.retargeted else {}),
        }
        for one in parts
    ]


def _beside(report: Path, name: str) -> Path:
    """The file that a report names, as it was named, or else from where the report lies."""
    file = Path(name)
    return file if file.exists() or not (near := report.parent / file).exists() else near


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise TypeError(f"{value!r} is no text")
    return value


def _replay(path: Path, filled: list[Gap], content: dict[str, Any], clip: Clip, reading: Reading) -> Request:
    """The gaps of a report, filled and open ones as they were, each by the method named in it."""
    left = content["open"]
    open_gaps = [
        Gap.parse(one["frames"], None if one["joints"] is None else tuple(one["joints"])) for one in left
    ]
    methods: dict[int, set[str]] = {}
    told: dict[At, list[str]] = {}
    for entry in content["gaps"]:
        methods.setdefault(entry["number"], set()).add(_text(entry["method"]))
        # What filled it is not asked why, so that what another method stood in for is said once more.
        if stood := [note for note in entry.get("notes", []) if STOOD_IN.match(_text(note))]:
            joints = entry["joints"]
            told[_text(entry["frames"]), None if joints is None else tuple(joints)] = stood
    parts = [
        part
        for one in content.get("parts", [])
        for part in part_of(
            _beside(path, one["file"]), one["frames"], one["at"], one["joints"], clip, reading
        )
    ]
    if content.get("layer"):
        filled += [Gap(p.at, p.at + p.stop - p.start, p.joints) for p in (one.part for one in parts)]
    else:
        # The report of a gap with parts lists their frames by themselves, without the joints that they gave.
        spans = [(p.at, p.at + p.stop - p.start) for p in (one.part for one in parts)]
        holed = [gap for gap in filled if any(gap.start < stop and start < gap.stop for start, stop in spans)]
        filled = [gap if gap not in holed else Gap(gap.start, gap.stop) for gap in filled]
    return Request(
        [*filled, *open_gaps],
        _text(content["method"]),
        # Long recoveries are reported in pieces, and where pieces differ the method asked for decides again.
        {number: used.pop() for number, used in methods.items() if len(used) == 1},
        sorted(methods) if left else None,
        content["seed"],
        {one["number"]: one["why"] for one in left},
        f"as in {path}",
        str(content.get("action", "")),
        parts,
        [_text(one) for one in content.get("path", [])],
        [_text(one) for one in content.get("pinned", [])],
        layer=bool(content.get("layer")),
        told=told,
    )


def reading_of(path: Path | None, reading: Reading) -> Reading:
    """How to read the clip: as told, or else as a report says that it was read."""
    content = read_json(path) if path else None  # `from_options` says what is wrong with the file
    if content is None or not is_report(content):
        return reading
    kinds: dict[str, Any] = {
        "unit": str,
        "up": str,
        "joint_positions": str,
        "skeleton": Path,
        "file_fps": float,
    }
    try:
        said = {
            name: kind(content[name])
            for name, kind in kinds.items()
            if content.get(f"{name}_how") == "given" and getattr(reading, name) is None
        }
    except (KeyError, TypeError, ValueError):
        raise RequestError(
            f"cannot repeat {path}", "it does not say how its clip was read", "Say it: --unit, --up, ..."
        ) from None
    return replace(reading, **said)


def roles_of(path: Path | None) -> dict[str, str]:
    """What a report says that was said about the joints."""
    content = read_json(path) if path else None
    roles = content.get("roles") if content is not None and is_report(content) else None
    return {str(name): str(own) for name, own in roles.items()} if isinstance(roles, dict) else {}


def check_method(name: str, license: str) -> None:
    """From now on weights of that licence alone are used.

    Raises RequestError for another licence, for a method whose weights may not be used, and listing all
    methods, auto among them, for a name that is none.
    """
    from interpose.methods import registry, weights

    weights.allow(license)

    choices = list(dict.fromkeys(["auto", *registry.names()]))
    if name not in choices and not Path(name).is_dir():
        raise unknown("method", name, choices)
    if name in choices and any(Path(name).glob("*.onnx")):
        why = "there is a method of that name, and a folder with weights here"
        raise RequestError(
            f"it is not clear what {name} is", why, f"Write ./{name} for the folder, or rename it."
        )
    if name != "auto":
        # Of those that have weights the card, which is refused where it may not be used.
        getattr(registry.get(name), "card", None)
