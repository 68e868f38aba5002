"""interpose forecast: how a clip goes on."""

from __future__ import annotations

from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from interpose.cli.batch import each
from interpose.cli.console import progress, say, say_json
from interpose.cli.outputs import Outputs, beside, licence, print_report, to_json
from interpose.cli.reading import Reading, describe
from interpose.cli.whole import Count, Whole
from interpose.errors import RequestError

if TYPE_CHECKING:
    from interpose.clip import Clip
    from interpose.tasks import Forecast

COLORS = ("#d1495b", "#2a78c2", "#3a9d5d", "#c98a1b", "#7a5bb5", "#2aa4a4", "#b5467f", "#7d7f1f")
MOST = 100  # samples


def _earlier(path: Path, options: dict[str, Any]) -> tuple[Path, dict[str, Any]] | None:
    """What an earlier run made of a clip, all of its samples, and the report."""
    outputs = Outputs.choose(path, options.get("output"), "forecast", bool(options.get("player")))
    clips = _clips(outputs.clip, options.get("samples", 1))
    report = Outputs(clips[0], outputs.report, outputs.page).earlier("forecast")
    return (clips[0], report) if report and all(map(Path.exists, clips)) else None


@partial(each, earlier=_earlier)
def forecast(
    file: Path,
    /,
    *,
    frames: str | None = None,
    samples: Count = 1,
    seed: Whole | None = None,
    temperature: float = 1.0,
    output: Annotated[Path | None, Parameter(name=("--output", "-o"))] = None,
    method: str = "auto",
    license: str = "any",
    player: bool = False,
    json: bool = False,
    force: bool = False,
    reading: Reading = Reading(),
) -> int:
    """Continue a clip: frames are added after its last one.

    The clip itself comes back unchanged, except a last frame that is not part of
    the motion, such as a rest pose. Writes take.forecast.bvh and
    take.forecast.json; with several samples take.forecast.1.bvh, take.forecast.2.bvh
    and so on, and one report.

    Try:
      interpose forecast take.bvh
      interpose forecast take.bvh --frames 120 --player
      interpose forecast take.bvh --method stmi-gan --samples 5 --seed 1 --player
      interpose forecast take.bvh --method stmi-gan --samples 5 --temperature 2

    Args:
        file: the clip (.bvh, .npz, .amc), or a folder of clips.
        more: more clips or folders; each clip is processed by itself.
        frames: how many to add, at the clip's own rate, or seconds: 3s. Default: 2 seconds.
        samples: number of different continuations, each in its own file; for methods that sample.
        seed: random seed. Without it a single sample is the most likely one.
        temperature: amount of randomness, 0 to 10: 1 is what the network was trained with.
        output: where to write the clip; the report goes beside it. With several clips: a folder.
        method: how it is continued: auto (the default), base, stmi-gan, ...; `interpose models` lists them.
        license: open to use only weights that may be used for anything; any (the default).
        player: write a page (take.forecast.html) that plays all samples; it opens in any browser.
        json: print the report as JSON.
        force: overwrite existing files (.json files only if they are reports).
    """
    from interpose import tasks
    from interpose.cli.request import check_method
    from interpose.formats import saving
    from interpose.observation.observation import frames_of
    from interpose.tasks.forecasting import FIRST

    check_method(method, license)
    if samples > MOST:
        raise RequestError(
            f"cannot write {samples} samples", f"at most {MOST} are drawn at once", "Ask for fewer."
        )
    outputs = Outputs.choose(file, output, "forecast", player)
    clips = _clips(outputs.clip, samples)
    clip = reading.load(file)
    for path in clips:
        Outputs(path, outputs.report, outputs.page).check(file, force)
    count = None if frames is None else frames_of(frames, clip.fps)
    with progress(f"going on with {file.name}", samples * 100) as advance:
        done = tasks.forecast(clip, count, samples, method, seed, temperature, advance)
    more = _more(done, clips, temperature)
    drawn = FIRST if seed is None and samples > 1 else seed
    report = to_json("forecast", file, clips[0], clip, done, drawn, {}, more)
    report["units"] = {**report["units"], "spread": "cm"}
    page = _page(done, outputs.clip.name) if outputs.page else ""
    notes: dict[str, None] = {}
    # All samples, or none of them, and what tells of them.
    with beside(outputs, report, page), ExitStack() as stack:
        for path, sample in zip(clips, done.samples):
            notes |= dict.fromkeys(stack.enter_context(saving(sample.clip, path, force=force)))
    if json:
        say_json(report)
        return 0
    say("\n".join([*describe(file, clip), ""]))
    print_report(done, clip.fps, {})
    if samples > 1:
        say(f"the samples lie apart: {_apart(more['spread'])}")
    written = [*clips, outputs.report, *([outputs.page] if outputs.page else [])]
    say(
        "\n".join(
            [
                "",
                *(f"note: {note}" for note in (*licence(done), *notes)),
                f"wrote {', '.join(map(str, written))}",
            ]
        )
    )
    return 0


def _clips(clip: Path, samples: int) -> list[Path]:
    """take.forecast.bvh, or take.forecast.1.bvh and so on."""
    if samples == 1:
        return [clip]
    return [clip.with_name(f"{clip.stem}.{number}{clip.suffix}") for number in range(1, samples + 1)]


def _more(done: Forecast, clips: list[Path], temperature: float) -> dict[str, Any]:
    """What only this verb says: where the samples are, and how far they lie apart from when on."""
    if len(clips) == 1:
        return {"start": done.start}
    apart, fps = done.spread(), done.clip.fps
    horizons = [s for s in (0.25, 0.5, 1.0, 2.0, 3.0, 4.0, 6.0, 8.0) if round(s * fps) <= len(apart)]
    spread = {f"{s:g}": round(float(apart[round(s * fps) - 1]), 3) for s in horizons}
    return {
        "start": done.start,
        "samples": [str(path) for path in clips],
        "temperature": temperature,
        "spread": spread or {f"{len(apart) / fps:.3g}": round(float(apart[-1]), 3)},
    }


def _apart(spread: dict[str, float]) -> str:
    return (
        ", ".join(f"{value:.1f} cm after {at} s" for at, value in spread.items()) + " (deviation of joints)"
    )


def _page(done: Forecast, title: str) -> str:
    """A page that plays all samples over each other."""
    from interpose.show import Take, player

    several = len(done.samples) > 1
    takes = [
        Take(f"sample {i + 1}" if several else "forecast", one.clip.positions(), COLORS[i % len(COLORS)])
        for i, one in enumerate(done.samples)
    ]
    clip, skeleton = done.clip, done.clip.skeleton
    span = (max(0, done.start - round(4 * clip.fps)), len(clip)) if _long(clip, len(takes)) else None
    return player(
        takes,
        skeleton.parents,
        clip.fps,
        done.report.gaps,
        title=title,
        report=str(done.report),
        names=skeleton.names,
        span=span,
    )


def _long(clip: Clip, takes: int) -> bool:
    """Whether only the end of it is worth a page: more than a minute over all."""
    return len(clip) * takes > 60 * clip.fps
