"""interpose demo: a gap in a real clip is filled, and the result laid beside the truth."""

from __future__ import annotations

from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from interpose.cli.console import say, say_table, seconds
from interpose.errors import FileError

if TYPE_CHECKING:
    from interpose.clip import Clip
    from interpose.finish import Completion
    from interpose.observation import Gap

GAP = 66, 96  # the middle second of the bundled clip
FILLED, PLAIN, TRUTH = "#d1495b", "#2e86ab", "#6b7280"


def example(folder: Path, name: str) -> Path:
    """A bundled clip, copied into a folder."""
    path = folder / f"{name}.bvh"
    path.write_bytes((resources.files("interpose") / "examples" / path.name).read_bytes())
    return path


def demo(
    clip: Literal["walk", "fingers"] = "walk",
    /,
    *,
    out: Annotated[Path, Parameter(name=("--out", "-o"))] = Path("demo"),
) -> None:
    """See a gap filled in a real clip.

    Someone walks, and the middle second is taken away. The demo fills it, compares
    with plain interpolation and with what was taken away, and writes the filled
    clip, a strip of stick figures, and a page that plays it in any browser.

    Try:
      interpose demo
      interpose demo fingers

    Args:
        clip: walk, as it was captured; or fingers, the same walk on a game rig of 65 joints.
        out: the folder; files of an earlier demo in it are replaced.
    """
    from interpose.formats import load

    try:
        out.mkdir(parents=True, exist_ok=True)
        path = example(out, clip)
    except OSError as error:
        why = error.strerror or str(error)
        raise FileError(f"cannot write into {out}", why, "Choose another folder with --out.") from None
    _show(load(path), out, clip)


def _show(clip: Clip, out: Path, name: str) -> None:
    """Fill the gap, write all files and say what came out."""
    from interpose import tasks
    from interpose.cli.outputs import write_text
    from interpose.formats import save
    from interpose.observation import Gap
    from interpose.show import Take, player, strip

    gap = Gap(*GAP)
    filled, plain = tasks.fill(clip, [gap]), tasks.fill(clip, [gap], "linear")
    takes = [
        Take("truth", clip.positions(), TRUTH, ghost=True),
        Take("interpolation", plain.clip.positions(), PLAIN),
        Take("filled", filled.clip.positions(), FILLED),
    ]
    text = str(filled.report)
    save(filled.clip, out / f"{name}.filled.bvh", force=True)
    joints, parents = clip.skeleton.names, clip.skeleton.parents
    picture = strip(takes, parents, clip.fps, [gap], title="A second of a walk", names=joints)
    write_text(out / "strip.svg", picture)
    page = player(takes, parents, clip.fps, [gap], title="A second of a walk", report=text, names=joints)
    write_text(out / "player.html", page)

    method = filled.report.gaps[0].method
    rig = "" if name == "walk" else f", on a rig of {len(clip.skeleton)} joints"
    say(f"A walk of {clip.seconds:.1f} s from the CMU motion capture database (mocap.cs.cmu.edu){rig}.")
    where = f"Frames {gap.start} to {gap.stop - 1} ({seconds(len(gap), clip.fps)})"
    say(f"{where} were taken away and filled by {method}.")
    say()
    say_table(
        ("", "seam", "bones", "foot slide", "foot travel", "error"),
        [
            _truth(clip, gap),
            _row("linear interpolation", clip, plain, gap),
            _row(f"filled ({method})", clip, filled, gap),
        ],
        right=("seam", "bones", "foot slide", "foot travel", "error"),
    )
    say(
        "seam: velocity jump at the ends, cm/frame^2, of the joint nearest to its limit: what 95 of 100 of\n"
        "  its own in the clip are below, and real motion can be above\n"
        "bones: largest change of a length; error: mean distance of all joints from what was taken away",
        style="dim",
    )
    for note in filled.report.gaps[0].notes:
        say(f"note: {note}")
    say()
    say(
        f"Open   {out / 'player.html'} in a browser: truth, interpolation and the filled clip over each other"
    )
    say(f"       {out / 'strip.svg'}: the same as stick figures over time")
    say(f"       {out / f'{name}.filled.bvh'} in your own tool")
    say("Then   interpose scan YOUR.bvh                        what is missing in your clip")
    say("       interpose fill YOUR.bvh --gap 120:160 --player  fill frames 120 to 159 of it")


def _row(name: str, clip: Clip, done: Completion, gap: Gap) -> list[str]:
    from interpose.cli.outputs import seam
    from interpose.geometry.measures import joint_error

    inside = slice(gap.start, gap.stop)
    wrong = joint_error(done.clip.positions()[inside], clip.positions()[inside])
    one = done.report.gaps[0]
    return [
        name,
        seam(one.seam_after, one.seam_limit),
        f"{one.bone_deviation:.2f} cm",
        f"{one.foot_slide or 0:.1f} cm/s",
        f"{one.foot_travel or 0:.2f} m",
        f"{100 * wrong:.1f} cm",
    ]


def _truth(clip: Clip, gap: Gap) -> list[str]:
    """The same measures of what was taken away."""

    from interpose.cli.outputs import seam
    from interpose.finish import feet, jumps, seams
    from interpose.observation import Observation

    seen = Observation.from_gaps(clip, [gap])
    slide, travel = feet.measure(clip, seen, gap.start, gap.stop) or (0.0, 0.0)
    limits = seams.limits(clip, seen)
    bounds = None if limits is None else jumps.Bounds.of(clip, seen, limits)
    jump, limit = (100 * (one or 0.0) for one in jumps.beside(clip, seen, gap, bounds) or (0.0, 0.0))
    return ["truth", seam(jump, limit), "0.00 cm", f"{slide:.1f} cm/s", f"{travel:.2f} m", "0.0 cm"]
