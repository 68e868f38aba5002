"""Gaps in a JSON file: written by hand or by another program, or the report of an earlier run."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from interpose.clip import Clip
from interpose.errors import FileError, RequestError
from interpose.observation.observation import Gap
from interpose.smallfile import text_of

EXAMPLE = '[{"frames": "120:160"}, {"frames": "4s:5.3s"}, {"frames": [200, 230], "joints": ["LeftArm"]}]'
KEYS = {"frames", "start", "stop", "joints"}


def read_gaps(path: str | Path, clip: Clip) -> list[Gap]:
    """The gaps that a JSON file says a clip has.

    The file holds a list of entries, or an object whose "gaps" is one. An entry says its range as
    "frames": "120:160", in seconds or open-ended as for Gap.parse, as "frames": [120, 160], or as "start"
    and "stop"; "joints" (names, or null) is left out for the whole pose. The report beside a filled clip is
    such a file: what else stands in it is passed over, which replays the run.

    Raises FileError naming the entry that cannot be understood. Whether ranges and joints fit a clip shows
    only with the clip: see Observation.from_gaps.
    """
    path = Path(path)
    try:
        content = json.loads(text_of(path, "utf-8-sig"))
    except OSError as error:
        why = error.strerror or str(error)
        raise FileError(f"cannot read the gaps from {path}", why, "Check the path.") from None
    except UnicodeDecodeError:
        raise FileError(
            f"cannot read the gaps from {path}", "it is no text file", f"Write {EXAMPLE}"
        ) from None
    except json.JSONDecodeError as error:
        why = f"line {error.lineno}, column {error.colno}: {error.msg}"
        raise FileError(f"the gaps in {path} are no JSON", why, f"Write {EXAMPLE}") from None
    except ValueError as error:  # numbers of thousands of digits
        raise FileError(f"the gaps in {path} are no JSON", str(error), f"Write {EXAMPLE}") from None
    except RecursionError:
        why = "there are lists in lists, hundreds deep"
        raise FileError(f"cannot read the gaps from {path}", why, f"Write {EXAMPLE}") from None
    entries = content.get("gaps") if isinstance(content, dict) else content
    if not isinstance(entries, list):
        why = 'expected a list of gaps, or an object with a list under "gaps"'
        raise FileError(f"there are no gaps in {path}", why, f"Write {EXAMPLE}")
    reported = isinstance(content, dict) and {"method", "open"} <= content.keys()
    return [
        _gap(entry, clip, f"gap number {number} in {path}", reported)
        for number, entry in enumerate(entries, 1)
    ]


def read_json(path: Path) -> Any:
    """What a JSON file holds, or None when there is nothing to be made of it."""
    try:
        return json.loads(text_of(path))
    except (OSError, ValueError, RecursionError):
        return None


def is_report(content: Any) -> bool:
    """Whether what a file holds is a report that this program wrote, whole."""
    return isinstance(content, dict) and {"interpose", "method", "seed", "gaps", "open"} <= content.keys()


def _gap(entry: Any, clip: Clip, where: str, reported: bool) -> Gap:
    """One entry of a clip, of a report or of a list; `where` names it in errors."""

    def bad(why: str) -> FileError:
        shown = json.dumps(entry)
        shown = shown if len(shown) <= 80 else shown[:77] + "..."
        return FileError(f"{where} cannot be understood: {shown}", why, f"Write {EXAMPLE}")

    if not isinstance(entry, dict):
        raise bad('a gap is an object with "frames"')
    # A report says more about each gap than there is to read; in a list of gaps it is a slip of the pen, and
    # "joint" for "joints" would wipe the whole pose.
    odd = sorted(entry.keys() - KEYS)
    if odd and not reported:
        raise bad(f"a gap has no {', '.join(odd)}")
    joints = entry.get("joints")
    if joints is not None:
        if not isinstance(joints, list) or not joints or not all(isinstance(name, str) for name in joints):
            raise bad('"joints" is a list of names')
        joints = tuple(joints)
    if "frames" in entry:
        frames = entry["frames"]
        if isinstance(frames, str):
            try:
                return _sound(Gap.parse(frames, joints, clip), bad)
            except RequestError as error:
                raise bad(error.why) from None
        pair = frames if isinstance(frames, list) else []
    else:
        pair = [entry.get("start"), entry.get("stop")]
    if len(pair) != 2 or not all(type(frame) is int for frame in pair):
        raise bad('"frames" is "START:STOP", in frames or seconds, or [START, STOP], with whole numbers')
    return _sound(Gap(pair[0], pair[1], joints), bad)


def _sound(gap: Gap, bad: Any) -> Gap:
    if not 0 <= gap.start < gap.stop:
        raise bad("it must have 0 <= START < STOP")
    return gap
