"""interpose scan: find what is missing."""

from __future__ import annotations

from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING

from interpose.cli.batch import each
from interpose.cli.console import names, say, say_json, say_table, seconds
from interpose.cli.reading import Reading, describe, details

if TYPE_CHECKING:
    from interpose.clip import Clip
    from interpose.observation import Gap
    from interpose.observation.finding import Finding

EASED = 0.3  # seconds on either side of a jump that a fill may lead over
SHOWN = 10  # dropouts, of many
CHAIN, BESIDE = 8, 3  # runs one after the other, and frames beside what they filled that are eased, too
MOMENT = 0.5  # seconds before a jump, or after it, at an end of a clip that are lost rather than a part of it


@each
def scan(file: Path, /, *, json: bool = False, reading: Reading = Reading()) -> None:
    """Find what looks missing or wrong: frozen runs, stray rest poses, joints that drop out, swapped limbs.

    Also limbs that are frozen but jitter, joints that another program interpolated linearly or
    by a spline, jumps, noise, and repeated frames. It names the command that repairs each.

    Try:
      interpose scan take.bvh

    Args:
        file: the clip (.bvh, .npz, .amc), or a folder of clips.
        more: more clips or folders; each clip is processed by itself.
        json: print JSON for other programs.
    """
    from interpose.errors import few
    from interpose.finish.feet import legs
    from interpose.finish.notes import bodies
    from interpose.observation.finding import to_gaps
    from interpose.observation.scan import OR, scan, stays
    from interpose.skeletons.carrier import line_of
    from interpose.skeletons.performers import clip_of, meant

    clip, named = reading.load(file), reading.named(file)
    made = _made(file, clip)
    # What a network says is as smooth as what a program splines: it is not to be filled once more.
    found = [
        one for one in scan(clip) if not (one.kind == "splined" and _within(one, made, clip.skeleton.names))
    ]
    if json:
        findings = [
            {
                "kind": one.kind,
                "frames": f"{one.start}:{one.stop}",
                "joints": None if one.joints is None else list(one.joints),
                "seconds": len(one) / clip.fps,
                "note": one.note,
            }
            for one in found
        ]
        say_json({"input": str(file), **details(clip), "findings": findings, "filled": _frames(made)})
        return
    say("\n".join(describe(file, clip)))
    tops = [clip.skeleton.names[joints[0]] for joints in meant(clip.skeleton)]
    if len(tops) > 1:
        what = f"{len(tops)} bodies, each by itself: {few(tops)}"
        say(f"{what}. --root {quote(tops[-1])} means one of them, here and in other verbs")
    elif tops:
        say(f"of several bodies that of {tops[0]} alone is looked at, as --root says")
    for name, count in bodies(clip.skeleton).items():
        say(f"the {count} joints of {name} are another body, which no network knows")
    if made:
        say(f"filled by interpose, as the report beside it says: {', '.join(_frames(made))}")
    where = f"It never leaves its place: interpose recover {named} --place tells where it goes."
    suit = [where] if stays(clip) and legs(clip.skeleton) else []
    if not found:
        say("\n".join(["nothing looks missing", *suit]))
        return
    say()
    dropped = [one for one in found if one.kind == "lost"]
    doubled = [one for one in found if one.kind == "doubled"]
    shown = [one for one in found if one not in dropped[SHOWN:] + doubled[SHOWN:]]
    say_table(
        ("kind", "frames", "length", "joints", "note"),
        [
            (one.kind, f"{one.start}:{one.stop}", seconds(len(one), clip.fps), names(one.joints), one.note)
            for one in shown
        ],
        right=("frames", "length"),
    )
    if len(found) > len(shown):
        say(f"and {len(found) - len(shown)} more that are lost or doubled; --json lists them all")
    say()
    if to_gaps(found):
        say(f"interpose fill {named} fills the gaps; --gap START:STOP names one yourself.")
    if led := [one for one in found if one.kind == "splined"]:
        part = "" if led[0].joints is None else f" --joints {quote(','.join(led[0].joints))}"
        gap = f"--gap {led[0].start}:{led[0].stop}{part}"
        say(f"interpose fill {named} {gap} fills anew what is splined first.")
    if dropped:
        say(f"interpose recover {named} restores what is lost for moments.")
    sides = [one for one in found if one.kind in ("exchanged", "flipped")]
    if any(OR not in one.note for one in sides):
        say(f"interpose recover {named} puts limbs back.")
    limbs: dict[object, list[int]] = {}
    for one in sides:
        if OR in one.note:
            limbs.setdefault(one.joints and one.joints[0], []).extend((one.start, one.stop))
    for cuts in limbs.values():
        # Between changes of sides: every other stretch, or all others.
        here, there = (
            ", then ".join(f"{a}:{b}" for a, b in zip(some[::2], some[1::2]) if a < b)
            for some in (cuts, [0, *cuts, len(clip)])
        )
        part = f"interpose recover {named} --frames {here}"
        say(f"{part} puts limbs back there; if they are wrong elsewhere, --frames {there}.")
    if any(one.kind == "noisy" for one in found):
        say(f"interpose denoise {named} smooths what trembles.")
    if any(one.kind == "repeated" for one in found):
        even = quote(str(file.with_name(f"{file.stem}.even{file.suffix}")))
        say(f"interpose convert {named} {even} --drop-repeated takes repeated frames out.")
    jumps = [one for one in found if one.kind == "jump"]
    if jumps:
        first, room = jumps[0].start, max(2, round(EASED * clip.fps))
        # Of a moment before the first one, or after the last, it is the rest that is right.
        around = f"{max(first - room, 1)}:{min(first + room, len(clip) - 1)}"
        gap, what = around, "leads over the first jump"
        moment, left = round(MOMENT * clip.fps), len(clip) - first
        if first <= min(moment, left):
            gap, what = f"0:{first}", "fills anew what is before the first jump"
        elif left <= moment:
            gap, what = f"{first}:{len(clip)}", "fills anew what follows the first jump"
        said = f"interpose fill {named} --gap {gap}"
        if jumps[0].joints is not None:
            said += f" --joints {quote(','.join(_with_below(clip, jumps[0].joints)))}"
        say(f"{said} {what}.")
        # Two frames are room for the seam. With one it is flagged in 5 of 20 excerpts of LAFAN1, with two in
        # none, and what follows is off by .4 cm in the mean instead of .2.
        if jumps[0].joints is None and moment < first < len(clip) - moment:
            halves = f"{quote(f'{file}#:{first - 1}')} {reading.named(file, f'{first + 1}:')}"
            says = f"puts what follows where the body was; frames {first - 1} and {first} are made anew."
            say(f"interpose stitch {halves} --frames 2 {says}")
    if any(one.kind == "frozen body" for one in found):
        say(f"interpose recover {named} restores a held body, its place and turns at once.")
    each_of = [clip_of(clip, joints) for joints in meant(clip.skeleton)] or [clip]
    body = {(one.skeleton.names[joint],) for one in each_of for joint in line_of(one)}
    stands = [one for one in found if one.kind == "frozen position"]
    if any(one.joints in body for one in stands) and legs(clip.skeleton):
        say(f"interpose recover {named} tells from the feet where the body is that stands still.")
    if [one for one in stands if one.joints not in body]:
        say(f"interpose recover {named} leads over what else stands still.")
    for line in suit:
        say(line)


def _made(file: Path, clip: Clip) -> list[Gap]:
    """What interpose has filled, by the report beside a file, and those of the files that were its input."""
    from interpose.errors import InterposeError
    from interpose.observation.gapfile import is_report, read_gaps, read_json

    made: list[Gap] = []
    seen: set[Path] = set()
    while (report := file.with_suffix(".json")).resolve() not in seen and len(seen) < CHAIN:
        seen.add(report.resolve())
        content = read_json(report) if report.is_file() else None
        told = content if isinstance(content, dict) and is_report(content) else {}
        if told.get("frames") != len(clip) or Path(str(told.get("output"))).name != file.name:
            break
        try:
            made += read_gaps(report, clip)
        except InterposeError:
            break
        name = told.get("input")
        if not isinstance(name, str) or "\0" in name or not Path(name).suffix:
            break
        before = Path(name)
        beside = file.with_name(before.name)
        file = before if before.with_suffix(".json").is_file() or beside == file else beside
    return sorted(made, key=lambda gap: (gap.start, gap.stop))


def _frames(made: list[Gap]) -> list[str]:
    return list(dict.fromkeys(f"{gap.start}:{gap.stop}" for gap in made))


def _within(one: Finding, made: list[Gap], names: tuple[str, ...]) -> bool:
    """Whether what was found lies in what was filled, but for a frame or two beside it."""
    return any(
        gap.start - BESIDE <= one.start
        and one.stop <= gap.stop + BESIDE
        and (gap.joints is None or {*(one.joints or names)} <= {*gap.joints})
        for gap in made
    )


def _with_below(clip: Clip, joints: tuple[str, ...]) -> list[str]:
    """Joints, and all that hangs from them."""
    skeleton = clip.skeleton
    top = {skeleton.index(name) for name in joints}
    return [name for j, name in enumerate(skeleton.names) if top & {j, *skeleton.ancestors(j)}]
