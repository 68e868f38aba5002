"""interpose bench: published protocols, and what auto goes by."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, Protocol

from cyclopts import App, Parameter
from cyclopts.validators import Number

from interpose.cli.console import console, say, say_json
from interpose.cli.research import needs_torch, shown
from interpose.errors import RequestError

if TYPE_CHECKING:
    from interpose.evaluation.conditions import Table
    from interpose.methods.weights import Card


# How many windows are measured.
Count = Annotated[int, Parameter(validator=Number(gte=1))]
Most = Count | None


@Parameter(name="*")
@dataclass(frozen=True)
class Asked:
    """What all benches on published data are asked."""

    data: Annotated[
        Path, Parameter(help="the folder with the unpacked data sets; docs/data.md says where to get them.")
    ] = Path("data")
    split: Annotated[
        Literal["validation", "test"],
        Parameter(help="validation performers for development, test performers for final figures."),
    ] = "validation"
    json: Annotated[bool, Parameter(negative="", help="print JSON for other programs.")] = False


@Parameter(name="*")
@dataclass(frozen=True)
class Tabled(Asked):
    """The same of those whose main result is one table."""

    markdown: Annotated[
        bool, Parameter(negative="", help="print only the table of all windows, in Markdown.")
    ] = False


class Result(Protocol):
    """What a bench measured; the text of it tells everything."""

    def to_dict(self) -> dict[str, Any]: ...


bench = App(
    name="bench",
    help="Measure how good the methods are, by published protocols.",
    default_parameter=Parameter(show_default=shown),
)


@bench.command
def infilling(
    *,
    weights: list[Path] = [],  # noqa: B006
    most: Most = None,
    asked: Tabled = Tabled(),
) -> None:
    """Kaufmann et al. 2020, table 1: joint error when gaps of 0 to 60 frames in 4 s are filled.

    Networks to compare are trained by the same recipe and exported into folders of
    their own; each is a row beside those of the installed weights.

    Try:
      interpose bench infilling --data data --split test
      interpose train cae --out runs/vanilla --set network=vanilla --set gap=30
      interpose export cae --run runs/vanilla --out runs/vanilla/weights
      interpose bench infilling --weights runs/vanilla/weights

    Args:
        weights: a folder that `interpose export cae` wrote, to compare with; may be repeated.
        most: windows of each data set; all without it.
    """
    from interpose.evaluation.infilling import run

    with _bar() as progress:
        result = run(asked.data, asked.split, most, progress, _trained(weights, "cae") if weights else [])
    _show(result, asked)


@bench.command
def denoise(
    *,
    most: Most = None,
    asked: Tabled = Tabled(),
) -> None:
    """Kaufmann et al. 2020, table 2: joint error of noisy clips of 4 s, before and after denoising.

    As users meet it, on skeletons. Networks alone, as in the paper: interpose bench noise.

    Try:
      interpose bench denoise --data data --split test

    Args:
        most: windows of each data set; all without it.
    """
    from interpose.evaluation.denoising import run

    with _bar() as progress:
        result = run(asked.data, asked.split, most, progress)
    _show(result, asked)


@bench.command
def noise(
    *,
    weights: list[Path] = [],  # noqa: B006
    most: Count = 400,
    asked: Tabled = Tabled(),
) -> None:
    """Kaufmann et al. 2020, table 2, as in the paper: joint error of networks on noise and lost joints.

    The installed network and others, alone, on positions of no skeleton (needs PyTorch).
    What denoising does for users is measured by interpose bench denoise.

    Try:
      interpose bench noise --data data --split test
      interpose train cae --out runs/noise --set noise=0.3
      interpose export cae --run runs/noise --out runs/noise/weights
      interpose bench noise --weights runs/noise/weights

    Args:
        weights: a folder that `interpose export cae` wrote, to compare with; may be repeated.
        most: windows, drawn at random from all of them.
    """
    from functools import partial

    from interpose.evaluation.infilling import named
    from interpose.evaluation.noise import run

    with needs_torch("run networks on noise"):
        from interpose.training.cae import reconstruct, trained
    cards = named([*_trained([], "cae"), *(_trained(weights, "cae") if weights else [])])
    networks = {row: partial(reconstruct, trained(card)) for row, card in cards.items()}
    with _bar() as progress:
        result = run(asked.data, networks, cards, asked.split, most, progress)
    _show(result, asked)


@bench.command
def bones(
    *,
    weights: list[Path] = [],  # noqa: B006
    most: Most = None,
    plot: Path | None = None,
    asked: Tabled = Tabled(),
) -> None:
    """Kaufmann et al. 2020, figure 5: how long bones are in motion that networks reconstruct.

    Try:
      interpose bench bones --data data --weights runs/holden/weights --plot bones.svg

    Args:
        weights: a folder that `interpose export cae` wrote, to compare with; may be repeated.
        most: windows of each data set; all without it.
        plot: an SVG file to draw the box plots into.
    """
    from interpose.evaluation.bones import run

    cards = [*_trained([], "cae"), *(_trained(weights, "cae") if weights else [])]
    with _bar() as progress:
        result = run(asked.data, cards, asked.split, most, progress)
    if plot is not None:
        result.plot(plot)
    _show(result, asked)


@bench.command
def skeletons(
    *,
    most: Most = 60,
    asked: Tabled = Tabled(),
) -> None:
    """Every data set on its own skeleton and frame rate: error of finished fills, gaps of .5, 1 and 2 s.

    Try:
      interpose bench skeletons --data data --split test

    Args:
        most: windows of each data set and length of gap, spread over all of them.
    """
    from interpose.evaluation.skeletons import run

    with _bar() as progress:
        result = run(asked.data, asked.split, most, progress)
    _show(result, asked)


@bench.command
def lafan1(
    *,
    method: list[str] = [],  # noqa: B006
    protocol: Literal["official", "cmib"] = "official",
    gaps: str | None = None,
    most: Most = None,
    plot: Path | None = None,
    asked: Asked = Asked(),
) -> None:
    """LAFAN1 in-betweening (Harvey et al. 2020): L2P, L2Q and NPSS exactly as its authors measure them.

    Zero-velocity and interpolation stand first, then each --method as users get it,
    finished, with what the field does not print: feet, pop at keys, bones, time.

    Try:
      interpose bench lafan1 --data data --split test --method cae
      interpose bench lafan1 --data data --gaps 5,15,30,45,60,80,120

    Args:
        method: a method to measure, by name, also one of another package. May be repeated.
        protocol: official; or cmib, as Kim et al. 2022 count: lengths with both keys, one frame of context.
        gaps: lengths in frames, separated by commas; those of the protocol without it.
        most: windows, spread over all of them; all without it.
        plot: an SVG file to draw the ratios to interpolation into.
    """
    from interpose.evaluation.lafan1 import run

    try:
        lengths = [int(text) for text in gaps.split(",")] if gaps else []
    except ValueError:
        raise RequestError(
            f"cannot read --gaps {gaps}", "it is a list of numbers of frames", "Write --gaps 5,15,30,45."
        ) from None
    with _bar() as progress:
        result = run(asked.data, asked.split, protocol, lengths, method, most, progress)
    if plot is not None:
        result.plot(plot)
    _show(result, asked)


@bench.command
def threshold(
    *,
    network: str = "cae",
    data: Path = Path("data"),
    most: Most = 60,
    plot: Path | None = None,
    save: bool = False,
    json: bool = False,
) -> None:
    """From which length of gap on a network beats the spline: what the method auto goes by.

    Measured on validation performers.

    Try:
      interpose bench threshold --data data --save

    Args:
        network: the method: cae, small, ...
        data: the folder with the unpacked data sets.
        most: windows of each data set.
        plot: an SVG file to draw the errors into.
        save: write the result into the card of the weights.
        json: print JSON for other programs.
    """
    from interpose.evaluation.threshold import measure
    from interpose.methods import weights

    card = weights.find(network)
    with _bar() as progress:
        result = measure(data, network, most, progress)
    if plot is not None:
        result.plot(plot)
    if save:
        replace(card, auto=result.to_dict()).save(card.path)
    if json:
        say_json(result.to_dict())
    else:
        say(str(result))


@bench.command
def context(
    *,
    most: Most = 6,
    plot: Path | None = None,
    asked: Asked = Asked(),
) -> None:
    """Kaufmann et al. 2020, section 4.2: error by length of gap, and by what is known beside it.

    Gaps of .07 to 4 s; and .03 to .83 s of motion on either side of a gap, for each kind of
    motion, with how much of it is enough. docs/filling.md says what follows from it.

    Try:
      interpose bench context --data data --plot context.svg

    Args:
        most: windows of each kind of motion, and half as many where all are taken together.
        plot: an SVG file to draw the errors by kind of motion into.
    """
    from interpose.evaluation.context import run

    with _bar() as progress:
        result = run(asked.data, asked.split, most, progress)
    if plot is not None:
        result.plot(plot)
    _show(result, asked)


@bench.command
def every(
    *,
    methods: list[str] = [],  # noqa: B006
    most: Most = 8,
    asked: Tabled = Tabled(),
) -> None:
    """Every task by every method: gaps, keys, lost joints, forecasts. Is one network good at all of them?

    Finished motion on the performers' own skeletons, mean error in cm of what was hidden.

    Try:
      interpose bench every --data data
      interpose bench every --data data --split test --methods spline,cae --most 40

    Args:
        methods: names separated by commas; all that are installed without it.
        most: windows of each data set.
    """
    from interpose.cli.reading import split_names
    from interpose.evaluation.every import run
    from interpose.methods import registry

    with _bar() as progress:
        chosen = split_names(methods) or registry.names()
        result = run(asked.data, chosen, asked.split, most, progress)
    _show(result, asked)


@bench.command
def reliability(
    *,
    method: str = "small",
    most: Most = 40,
    plot: Path | None = None,
    asked: Tabled = Tabled(),
) -> None:
    """Does a network know when it is wrong? Expected errors beside measured ones, frame by frame.

    Try:
      interpose bench reliability --data data --plot reliability.svg

    Args:
        method: one that says what it expects to be off by.
        most: windows of each data set.
        plot: where to draw it, as SVG.
    """
    from interpose.evaluation.reliability import run

    with _bar() as progress:
        result = run(asked.data, method, asked.split, most, progress)
    _show(result, asked)
    if plot:
        result.plot(plot)


@bench.command
def recipes(
    *runs: Annotated[Path, Parameter(name="RUNS")],
    figures: list[str] = [],  # noqa: B006
    json: bool = False,
    markdown: bool = False,
) -> None:
    """Training runs beside each other: what their recipes differ in, and what each reached.

    For ablations at an equal budget, on validation performers, as the runs measured it themselves.

    Try:
      interpose train cae --out runs/l1 --budget 1200steps
      interpose train cae --out runs/l2 --budget 1200steps --set loss=l2
      interpose bench recipes runs/l1 runs/l2
      interpose bench recipes studies/base/full studies/base/no-* --figures ratio15,ratio30

    Args:
        runs: folders that interpose train wrote; the first is what the others are compared with.
        figures: names of those to show, separated by commas; all without any.
        json: print JSON for other programs.
        markdown: print only the table, in Markdown.
    """
    from interpose.cli.reading import split_names
    from interpose.evaluation.recipes import compare

    if not runs:
        raise RequestError(
            "no runs are named", "there is nothing to compare", "Name folders: runs/l1 runs/l2."
        )
    result = compare(runs, split_names(figures))
    if json:
        say_json(result.to_dict())
    else:
        say(result.table() if markdown else str(result))


@bench.command
def representations(
    *,
    weights: list[Path] = [],  # noqa: B006
    most: Most = None,
    asked: Asked = Asked(),
) -> None:
    """Kim et al. 2022, table 1: L2P of CMIB by how it holds rotations.

    Networks to compare are trained by the same recipe and exported into folders of their own.

    Try:
      interpose train cmib --out runs/euler --set representation=euler --budget 20m
      interpose export cmib --run runs/euler --out runs/euler/weights
      interpose bench representations --weights runs/euler/weights --weights runs/quaternion/weights

    Args:
        weights: a folder that `interpose export cmib` wrote, may be repeated; the installed weights without.
        most: windows a length, spread over all of them; all without it.
    """
    from interpose.evaluation.conditions import representations as measure

    with _bar() as progress:
        result = measure(asked.data, _trained(weights), asked.split, most, progress)
    _print([result], asked.json)


@bench.command
def anchors(
    *,
    weights: list[Path] = [],  # noqa: B006
    most: Most = None,
    asked: Asked = Asked(),
) -> None:
    """Kim et al. 2022, table 5: by how much CMIB itself misses an anchor that was moved aside.

    What users get meets every anchor: the motion is moved onto it. This is what the
    network would do by itself, with and without the augmentation by random paths.

    Try:
      interpose train cmib --out runs/plain --set augmented=0 --budget 20m
      interpose export cmib --run runs/plain --out runs/plain/weights
      interpose bench anchors --weights weights/cmib --weights runs/plain/weights

    Args:
        weights: a folder that `interpose export cmib` wrote, may be repeated; the installed weights without.
        most: windows of walks and of runs, spread over all of them; all without it.
    """
    from interpose.evaluation.conditions import anchors as measure

    with _bar() as progress:
        result = measure(asked.data, _trained(weights), asked.split, most, progress)
    _print([result], asked.json)


@bench.command
def actions(
    *,
    weights: Path | None = None,
    most: Most = 30,
    asked: Asked = Asked(),
) -> None:
    """Kim et al. 2022, table 6: L2P of CMIB when it is told the right action, and each other one.

    Try:
      interpose bench actions --data data --split test

    Args:
        weights: a folder that `interpose export cmib` wrote; the installed weights without.
        most: windows of each action and length, spread over all of them.
    """
    from interpose.evaluation.conditions import actions as measure

    with _bar() as progress:
        result = measure(asked.data, _trained([weights] if weights else [])[0], asked.split, most, progress)
    _print(result, asked.json)


@bench.command
def hdm05(
    *,
    weights: Path | None = None,
    most: Most = None,
    asked: Asked = Asked(),
) -> None:
    """Kim et al. 2022, table 4: L2P and L2Q of CMIB on MPI-HDM05, which its weights have not seen.

    Try:
      interpose bench hdm05 --data data --split test

    Args:
        weights: a folder that `interpose export cmib` wrote; the installed weights without.
        most: cuts a length, spread over all of them; all without it.
    """
    from interpose.evaluation.conditions import hdm05 as measure

    with _bar() as progress:
        result = measure(asked.data, _trained([weights] if weights else [])[0], asked.split, most, progress)
    _print(result, asked.json)


@bench.command
def human(
    *,
    real: Path | None = None,
    generated: list[Path] = [],  # noqa: B006
    survey: Path = Path("survey"),
    relative: bool = False,
    seed: int = 0,
    votes: list[Path] = [],  # noqa: B006
    force: bool = False,
    json: bool = False,
    markdown: bool = False,
) -> None:
    """Hernandez Ruiz et al. 2019, table 2: how often people take generated clips for recorded ones.

    With --real and --generated it makes a page on which a person judges one clip after the
    other. Each person saves a file; with --votes these are counted.

    Try:
      interpose bench human --real clips/recorded --generated clips/stmi-gan
      interpose bench human --votes votes-ana.json --votes votes-ben.json

    Args:
        real: a folder of recorded clips.
        generated: a folder of generated clips, called as their model is; may be repeated.
        survey: the folder of the survey: index.html for people, key.json for whoever counts.
        relative: show poses alone: the hips stay in one place and face one way.
        seed: of the order of the clips.
        votes: a file that the page saved; may be repeated.
        force: replace an existing survey.
        json: print JSON for other programs.
        markdown: print only the table, in Markdown.
    """
    from interpose.evaluation.human import read_key, read_votes, tally

    if real is not None or generated:
        if votes:
            why = "a survey is made before anybody votes"
            raise RequestError("--votes does not go with --real", why, "Leave one of them out.")
        _survey(real, generated, survey, relative, seed, force, json)
        return
    key = read_key(survey / "key.json") if votes else {}
    result = tally(key, [read_votes(path, key) for path in votes])
    if json:
        say_json(result.to_dict())
    else:
        say(result.table() if markdown else str(result))


def _survey(
    real: Path | None,
    generated: list[Path],
    folder: Path,
    relative: bool,
    seed: int,
    force: bool,
    json: bool,
) -> None:
    """Write a survey: a page, and beside it the key."""
    from json import dumps

    from interpose.cli.outputs import write_text
    from interpose.evaluation.human import survey

    if real is None or not generated:
        raise RequestError(
            "there is nothing to compare",
            "a survey needs recorded and generated clips",
            "Name their folders: --real clips/recorded --generated clips/stmi-gan.",
        )
    page, key = folder / "index.html", folder / "key.json"
    for path in (page, key):
        if path.exists() and not force:
            fix = "Choose another folder with --survey, or add --force: votes on the old one are lost then."
            raise RequestError(f"cannot write {path}", "the file exists already", fix)
    made = survey(real, generated, relative, seed)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RequestError(
            f"cannot make the folder {folder}", error.strerror or str(error), "Choose another with --survey."
        ) from None
    write_text(page, made.page)
    write_text(key, dumps(made.key, indent=1) + "\n")
    if json:
        say_json(made.key | {"page": str(page), "notes": list(made.notes)})
        return
    for note in made.notes:
        say(f"note: {note}")
    say(f"wrote {page}: {len(made.key['clips'])} clips; give it to people, who open it in a browser")
    say(f"wrote {key}: which clip is which; keep it to yourself")


@bench.command
def occlusion(
    *,
    weights: list[Path] = [],  # noqa: B006
    drawn: Literal["exact", "code"] = "exact",
    fps: Literal[5, 30] = 5,
    most: Most = None,
    asked: Tabled = Tabled(),
) -> None:
    """Hernandez Ruiz et al. 2019, table 3: joint error where 80 % of joints, limbs, frames or values is lost.

    Joints and limbs are lost for a whole clip of 4 s, as in the public code of the
    paper, and frame by frame, as its caption says.

    Try:
      interpose bench occlusion --data data --split test
      interpose bench occlusion --weights studies/nogan

    Args:
        weights: a folder that `interpose export stmi-gan` wrote; may be repeated. The installed ones are a
            row where they fit. Those of the configuration dense are measured at 30 frames a second alone.
        drawn: exact; or code, as the public code draws: with replacement, so that about 55 % is lost.
        fps: frames a second that are measured: 5 as in the paper, or 30, at which cae is a row, too.
        most: windows of each data set; all without it.
    """
    from interpose.evaluation.occlusion import networks, run, sees
    from interpose.methods.weights import cards, load

    trained = [card for card in cards() if card.method == "stmi-gan" and sees(card, fps)]
    trained += [load(folder, "stmi-gan") for folder in weights]
    with _bar() as progress:
        result = run(asked.data, asked.split, drawn, fps, most, progress, networks(trained, fps))
    _show(result, asked)


@bench.command
def forecasting(
    *,
    weights: list[Path] = [],  # noqa: B006
    fps: Literal[5, 30] = 5,
    variant: Literal["paper", "code"] = "paper",
    samples: int = 5,
    most: Most = None,
    asked: Tabled = Tabled(),
) -> None:
    """Hernandez Ruiz et al. 2019, table 1: do forecasts of 4 s move as people do?

    Entropies of power spectra, and how far these are from real motion's, second by
    second; distances to the truth, and diversity. Weights of STMI-GAN are a row
    where they are installed, and so are those of each folder named.

    Try:
      interpose bench forecasting --data data --split test
      interpose train seq2seq --out runs/seq2seq
      interpose export seq2seq --run runs/seq2seq --out runs/seq2seq/weights
      interpose bench forecasting --weights runs/seq2seq/weights

    Args:
        weights: a folder that `interpose export` wrote of stmi-gan or seq2seq; may be repeated.
        fps: frames a second that are measured: 5 as in the paper, or 30, which its network does not make.
        variant: spectra by the formulas of the paper, or as its public code computes them.
        samples: forecasts of each window by other noise, to measure diversity; 1 measures none.
        most: windows of each data set; all without it.
    """
    from interpose.evaluation.forecasters import installed, load
    from interpose.evaluation.forecasting import run

    with _bar() as progress:
        cards = installed() + load(weights)
        result = run(asked.data, asked.split, cards, fps, variant, samples, most, progress)
    _show(result, asked)


def _show(result: Result, asked: Asked) -> None:
    """Print a result as it was asked for."""
    if asked.json:
        say_json(result.to_dict())
    elif isinstance(asked, Tabled) and asked.markdown:
        say(result.table())  # type: ignore[attr-defined]
    else:
        say(str(result))


def _trained(folders: list[Path], method: str = "cmib") -> list[Card]:
    """The weights of a method in some folders, or the installed ones."""
    from interpose.methods.weights import find, load

    return [load(folder, method) for folder in folders] or [find(method)]


def _print(tables: list[Table], json: bool) -> None:
    """Tables as text or as JSON."""
    if json:
        say_json([table.to_dict() for table in tables])
    else:
        say("\n\n".join(map(str, tables)))


@contextmanager
def _bar() -> Iterator[Callable[[float, str], None]]:
    """Progress of minutes: a bar in a terminal, a line every tenth elsewhere."""
    screen = console(stderr=True)
    if not screen.is_terminal:
        told = -1

        def tell(share: float, line: str) -> None:
            nonlocal told
            if share == 0 or int(10 * share) > told:
                told = int(10 * share)
                screen.print(line)

        yield tell
        return
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    with Progress(
        TextColumn("{task.description}"), BarColumn(), TimeRemainingColumn(), console=screen, transient=True
    ) as bar:
        task = bar.add_task("reading", total=1.0)
        yield lambda share, line: bar.update(task, completed=share, description=line)
