"""Hernandez Ruiz et al. 2019: forecasts, occlusions, and what people say."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from interpose.cli.bench.asking import Most, Tabled, bar, bench, show
from interpose.cli.console import say, say_json
from interpose.cli.whole import Count, Whole
from interpose.errors import RequestError


@bench.command
def forecasting(
    *,
    weights: list[Path] = [],  # noqa: B006
    fps: Literal[5, 30] = 5,
    variant: Literal["paper", "code"] = "paper",
    samples: Count = 5,
    most: Most = None,
    asked: Tabled = Tabled(),
) -> None:
    """Hernandez Ruiz et al. 2019, table 1: do forecasts of 4 s move as people do?

    Entropies of power spectra, and how far these are from real motion's, second by
    second; distances to the truth, and diversity. Weights of STMI-GAN are a row
    where they are installed, and so are those of each folder named: what the network
    says itself, as in the paper, and once more settled into what was seen, as users
    get it.

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

    with bar() as progress:
        cards = installed() + load(weights)
        result = run(asked.data, asked.split, cards, fps, variant, samples, most, progress)
    show(result, asked)


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
    paper, and frame by frame, as its caption says. Of STMI-GAN one row is what the
    network says itself, as in the paper, and one what users get: settled into what
    is known, in the mean with its mirror image.

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
    with bar() as progress:
        result = run(asked.data, asked.split, drawn, fps, most, progress, networks(trained, fps))
    show(result, asked)


@bench.command
def human(
    *,
    real: Path | None = None,
    generated: list[Path] = [],  # noqa: B006
    survey: Path = Path("survey"),
    relative: bool = False,
    seed: Whole = 0,
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
