"""interpose compare: what several methods make of a gap, before one is chosen."""

from __future__ import annotations

from pathlib import Path
from shlex import join
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from interpose.cli.console import effort, figure, names, progress, say, say_json, say_table, seconds
from interpose.cli.outputs import UNITS, gap_entries, used, write_text
from interpose.cli.reading import Reading, describe, details, split_names
from interpose.cli.whole import Whole
from interpose.errors import RequestError

if TYPE_CHECKING:
    from interpose.clip import Clip
    from interpose.finish import Completion, GapReport
    from interpose.observation import Gap

USUAL = ("spline", "base", "small", "cae", "cmib")
COLORS = ("#2a78c2", "#d1495b", "#3a9d5d", "#c98a1b", "#7a5bb5", "#2aa4a4", "#b5467f", "#7d7f1f")


def compare(
    file: Path,
    /,
    *,
    gap: list[str] = [],  # noqa: B006
    joints: list[str] = [],  # noqa: B006
    gaps: Path | None = None,
    methods: list[str] = [],  # noqa: B006
    output: Annotated[Path | None, Parameter(name=("--output", "-o"))] = None,
    license: str = "any",
    seed: Whole | None = None,
    json: bool = False,
    force: bool = False,
    reading: Reading = Reading(),
) -> int:
    """Fill gaps by several methods, and play the results over each other or side by side.

    Writes a page beside the input, take.compared.html, that plays them in any
    browser, and prints what each did to seams and feet. The clip itself is
    written by `interpose fill --method`, once you have chosen one. Without --gap,
    --joints or --gaps it compares fills of what `interpose scan` finds.

    Try:
      interpose compare take.bvh --gap 120:160
      interpose compare take.bvh --gap 120:160 --methods linear,spline,base
      interpose compare take.bvh --gap 120:160 --methods small,my_weights/

    Args:
        file: the clip (.bvh, .npz, .amc).
        gap: START:STOP, the frames START to STOP - 1, counted from 0; or seconds, 4s:5.3s. May be repeated.
        joints: the joints missing in each --gap, or else in the whole clip.
        gaps: a JSON file of gaps.
        methods: the methods, separated by commas; without it spline, base, small, cae and cmib, or of
            them those that are installed and may be used, and small-open where no other network is.
            `interpose models` lists what there is.
        output: where to write the page.
        license: open to use only weights that may be used for anything; any (the default).
        seed: random seed, for methods that sample.
        json: print what each did as JSON.
        force: replace an existing page.
    """
    from interpose import tasks
    from interpose.cli.request import check_method, from_options, path_of, pins_of
    from interpose.observation import Observation

    chosen = list(dict.fromkeys(split_names(methods) or _usual(license)))
    if len(chosen) > len(COLORS):
        raise RequestError(
            f"cannot compare {len(chosen)} methods",
            f"at most {len(COLORS)} are played at once",
            "Name fewer.",
        )
    for name in chosen:
        check_method(name, license)
    clip = reading.load(file)
    request = from_options(file, clip, gap, joints, gaps, reading)
    asked, points, pins = request.gaps, path_of(request.path, clip), pins_of(request.pins, clip, request.gaps)
    parts = [one.part for one in request.parts]
    page = output or file.with_name(f"{file.stem}.compared.html")
    _check(page, force)
    jobs = tasks.plan(clip, Observation.from_gaps(clip, asked), "auto", None, None, {})
    done: dict[str, Completion] = {}
    work = len(chosen) * effort(sum(map(len, asked)), clip.fps)
    with progress(f"comparing {len(chosen)} methods", work) as advance:
        for i, name in enumerate(chosen):
            made = tasks.fill(clip, asked, name, seed=seed, parts=parts, path=points, pins=pins)
            # Of the usual ones those are left out that some other method stood in for.
            if methods or any(one.method == name for one in made.report.gaps):
                done[name] = made
            if advance:
                advance((i + 1) / len(chosen))
    auto = {job.number: job.method.name for job in jobs if job.method}
    write_text(page, _page(clip, done, [job.gap for job in jobs], page.name))
    if json:
        entries = [
            {"method": name, "gaps": gap_entries(made), "weights": used(made)} for name, made in done.items()
        ]
        say_json(
            {"input": str(file), **details(clip), "auto": auto, "compared": entries, "page": str(page)}
            | {"units": UNITS}
        )
        return 0
    say("\n".join([*describe(file, clip), ""]))
    rows = [(one, name) for name, made in done.items() for one in made.report.gaps]
    rows.sort(key=lambda row: (row[0].number, row[0].start))
    say_table(
        ("gap", "frames", "length", "joints", "method", "seam", "inside", "slide", "travel", "moves", "off"),
        [_row(one, name, auto.get(one.number) == name, clip.fps) for one, name in rows],
        right=("gap", "frames", "length", "seam", "inside", "slide", "travel", "moves", "off"),
    )
    say("seam: velocity jump at the ends, cm/frame^2, of the joint nearest to its limit", style="dim")
    say("inside: largest velocity jump between the ends, cm/frame^2", style="dim")
    say("slide, travel: of the feet, cm/s and m; moves: as a share of the motion around", style="dim")
    say(
        "off: cm that joints are expected to be off by, where the method says so; *: what auto takes",
        style="dim",
    )
    for one, name in rows:
        for note in one.notes:
            say(f"gap {one.number}, {name}: {note}")
    for name in [name for name in chosen if name not in done]:
        say(f"{name} is left out: it does not fill this")
    say(f"\nwrote {page}: it plays them over each other, or side by side")
    words = [word for text in gap for word in ("--gap", text)]
    words += ["--joints", ",".join(joints)] if joints else []
    words += ["--gaps", str(gaps)] if gaps else []
    words += ["--seed", str(seed)] if seed is not None else []
    which = join([*words, "--method", "NAME"])
    say(f"interpose fill {reading.named(file)} {which} writes one of them.")
    return 0


def _usual(license: str) -> list[str]:
    """What is compared where nothing is named: what may be used of what is usual."""
    from interpose.methods import registry, weights

    weights.allow(license)
    spline, *networks = USUAL
    return [spline, *(registry.usable(tuple(networks)) or registry.usable(("small-open",)))]


def _check(page: Path, force: bool) -> None:
    """Before any work: RequestError if something is in the way."""
    what = f"cannot write {page}"
    if page.suffix.lower() not in (".html", ".htm"):
        raise RequestError(what, "it is a page", "Name an .html file with -o.")
    if not page.parent.is_dir():
        raise RequestError(what, f"there is no folder {page.parent}", "Make the folder first.")
    if page.is_dir() or (page.exists() and not force):
        raise RequestError(what, "it exists already", "Choose another name with -o, or add --force.")


def _row(one: GapReport, name: str, auto: bool, fps: float) -> list[str]:
    stood_in = f" (by {one.method})" if one.method != name and one.model != name else ""
    return [
        str(one.number),
        f"{one.start}:{one.stop}",
        seconds(one.stop - one.start, fps),
        "" if one.joints is None else names(one.joints, most=2),
        name + stood_in + " *" * auto,
        figure(one.seam_after),
        figure(one.peak),
        figure(one.foot_slide, 1),
        figure(one.foot_travel),
        figure(one.liveliness),
        figure(one.expected, 1),
    ]


def _page(clip: Clip, done: dict[str, Completion], gaps: list[Gap], title: str) -> str:
    """All results, and the clip as it was, faintly."""
    from interpose.show import Take, player

    takes = [Take(name, made.clip.positions(), color) for (name, made), color in zip(done.items(), COLORS)]
    takes.append(Take("input", clip.positions(), "#6b7280", ghost=True))
    report = "\n\n".join(f"{name}\n{made.report}" for name, made in done.items())
    parents, names_ = clip.skeleton.parents, clip.skeleton.names
    return player(takes, parents, clip.fps, gaps, title=title, report=report, names=names_)
