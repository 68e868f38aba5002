"""interpose recover: joints that are missing."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from interpose.cli.batch import each
from interpose.cli.console import effort, names, progress, say
from interpose.cli.outputs import Outputs, finish
from interpose.cli.reading import Reading, joints_of
from interpose.cli.whole import Whole
from interpose.errors import NothingError

SHOWN = 4  # losses, of many


@each
def recover(
    file: Path,
    /,
    *,
    joints: list[str] = [],  # noqa: B006
    place: bool = False,
    frames: str | None = None,
    output: Annotated[Path | None, Parameter(name=("--output", "-o"))] = None,
    method: str = "auto",
    license: str = "any",
    seed: Whole | None = None,
    player: bool = False,
    dry_run: bool = False,
    json: bool = False,
    force: bool = False,
    reading: Reading = Reading(),
) -> int:
    """Recover joints that are missing in the whole clip, in a range, or for moments.

    Without --joints it finds and repairs dropouts (joints that snap to their rest
    pose, spike, or jump away and back within moments), left and right limbs that were
    swapped, knees and elbows that bend the wrong way, and hips that stay in place
    while they turn. Other missing motion is listed; `interpose fill` fills it.

    Writes the clip and a report beside the input: take.recovered.bvh and
    take.recovered.json.

    Try:
      interpose recover take.bvh --joints LeftArm,LeftForeArm,LeftHand
      interpose recover take.bvh --joints RightFoot --frames 120:160
      interpose recover take.bvh
      interpose recover suit.bvh --place

    Args:
        file: the clip (.bvh, .npz, .amc), or a folder of clips.
        more: more clips or folders; each clip is processed by itself.
        joints: the joints, separated by commas; default: those that drop out.
        place: recover the root position where only rotations are known, as from inertial suits; it is found
            from planted feet. Without --frames it starts from the first frame's position.
        frames: START:STOP, the frames START to STOP - 1, counted from 0; or seconds, 4s:5.3s. All without it.
        output: where to write the clip; the report goes beside it. With several clips: a folder.
        method: what recovers them: auto (the default), base, spline, ... `interpose models` lists them.
        license: open to use only weights that may be used for anything; any (the default).
        seed: random seed, for methods that sample.
        player: write a page (take.recovered.html) that plays the result; it opens in any browser.
        dry_run: say what is found and done, and write nothing.
        json: print the report as JSON.
        force: overwrite existing files (.json files only if they are reports).
    """
    from interpose import tasks
    from interpose.cli.request import check_method, range_of
    from interpose.finish.guarantees import STOOD
    from interpose.observation import Gap
    from interpose.observation.finding import NO_GAPS, STUCK
    from interpose.observation.frozen import stuck
    from interpose.observation.scan import OR, scan, stays

    check_method(method, license)
    clip = reading.load(file)
    chosen = joints_of(joints, clip)
    gap = range_of(frames, clip, chosen) if frames is not None else Gap(0, len(clip), chosen)
    gap.check(len(clip))
    for name in chosen or ():
        clip.skeleton.index(name)
    outputs = Outputs.choose(file, output, "recover", player)
    if not dry_run:
        outputs.check(file, force)
    work = effort(len(gap), clip.fps) if chosen else len(gap)
    with progress(f"recovering {len(gap)} frames of {file.name}", work) as advance:
        done = tasks.recover(clip, chosen, (gap.start, gap.stop), method, seed, advance, place)
    looked = chosen is None and not place
    seen = scan(done.clip) if looked else []
    others = [one for one in seen if one.kind not in NO_GAPS]
    # Once joints move again that were stuck with all of a pose, the rest of it is a body that is stuck.
    held = [one for one in seen if one.kind in STUCK and one.start < gap.stop and gap.start < one.stop]
    before = [(one.kind, one.start, one.stop) for one in stuck(clip)] if held else []
    held = [one for one in held if (one.kind, one.start, one.stop) not in before]
    again = [f"{names(one.joints)} {one.start}:{one.stop}" for one in held]
    sides = ""
    if either := [one for one in seen if OR in one.note]:
        part = f"{either[0].start}:{either[0].stop}"
        sides = f"Limbs change sides at frame {either[0].start}: --frames {part} puts them back there."
    if not (done.report.gaps or done.report.moments or done.report.exchanged):
        fix = "Name joints that are lost for longer: --joints LeftArm."
        if stays(clip):
            same = f"interpose recover {reading.named(file)}"
            fix = f"It never leaves its place: {same} --place tells where it goes."
        fix = sides or fix
        raise NothingError(
            f"there is nothing to recover in {file}",
            "no joint snaps to its rest pose, spikes, changes sides, or jumps away and back within moments",
            f"interpose fill {reading.named(file)} fills what else is missing." if others else fix,
            f"{len(others)} gaps, which `interpose fill` fills" if others else "",
            4 if others else 0,
        )
    lost = [f"{names(one.joints)} {one.start}:{one.stop}" for one in others]
    more: dict[str, Any] = {"dry_run": True} if dry_run else {}
    left = [f"{', '.join(lost)}, which `interpose fill` fills"] if others else []
    left += [f"{', '.join(again)}, which `interpose recover` restores, once more"] if again else []
    more |= {"left": "; ".join(left)} if left else {}
    if stood := [f"{one.start}:{one.stop}" for one in done.report.gaps if STOOD in one.notes]:
        more["place"] = ", ".join(stood)
    code = finish(
        "recover", file, outputs, clip, done, seed, {}, json=json, force=force, more=more, dry_run=dry_run
    )
    if sides and not json:
        say(sides)
    next_ = reading.named(file if dry_run else outputs.clip)
    if again and not json:
        say(f"Stuck, now that the rest moves: {', '.join(again[:SHOWN])}")
        say(f"interpose recover {next_}, once more, restores it.")
    if others and not json:
        rest = f" and {len(others) - SHOWN} more" if len(others) > SHOWN else ""
        say(f"Missing, too, and left as it is: {', '.join(lost[:SHOWN])}{rest}")
        say(f"interpose fill {next_} fills it; interpose scan lists all.")
    return code or (4 if left else 0)
