"""Hernandez Ruiz et al. 2019, table 2: how often people take generated motion for recorded.

A survey is a page with clips in an order that tells nothing, and a key that says what each of them is. People
say of every clip whether it was recorded or generated and save a file; `tally` counts these files.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from interpose import formats
from interpose.clip import Clip
from interpose.errors import FileError, RequestError
from interpose.evaluation.table import markdown
from interpose.geometry.ground import turn
from interpose.show import Take, player
from interpose.show.ballot import ballot
from interpose.skeletons import find_humanoid
from interpose.skeletons.body import facing

RECORDED, GENERATED = "recorded", "generated"  # what people answer; the first is also the row of real clips
COLOR = "#6b7280"


@dataclass(frozen=True)
class Survey:
    """A page for people, and what it does not tell them.

    Attributes:
        page: HTML.
        key: what each clip is, as JSON; it belongs to nobody who votes.
        notes: what else than their motion could give generated clips away.
    """

    page: str
    key: dict[str, Any]
    notes: tuple[str, ...]


def survey(real: Path, generated: Sequence[Path], relative: bool = False, seed: int = 0) -> Survey:
    """A survey of all clips in some folders, shuffled.

    Args:
        real: the folder of recorded clips, in any format.
        generated: a folder of generated clips for each model, which is called as its folder is.
        relative: show poses alone, with the hips in one place and facing one way.
        seed: of the order; the same clips and seed give the same survey.

    Raises RequestError or FileError when a folder or a clip cannot be used.
    """
    models = [folder.resolve().name for folder in generated]
    if twice := {name for name in models if name == RECORDED or models.count(name) > 1}:
        raise RequestError(
            f"two rows of the table would be called {', '.join(sorted(twice))}",
            "models are called as their folders are, and recorded clips are the row 'recorded'",
            "Rename a folder.",
        )
    files = [
        (model, path)
        for model, folder in zip((RECORDED, *models), (real, *generated))
        for path in _files(folder)
    ]
    order = np.random.default_rng(seed).permutation(len(files))
    pages, listed, told = [], [], hashlib.sha256()
    clips: list[tuple[bool, Clip]] = []
    for number, (model, path) in enumerate((files[i] for i in order), 1):
        clip = formats.load(path)
        if not len(clip):
            raise FileError(f"cannot show {path}", "it has no frames", "Take it out of the folder.")
        points = _poses(clip, path) if relative else clip.positions()
        takes, skeleton = [Take("motion", points, COLOR)], clip.skeleton
        title = f"clip {number}"
        pages.append(
            player(takes, skeleton.parents, clip.fps, [], title=title, names=skeleton.names, bare=True)
        )
        listed.append({"clip": number, "model": model, "file": str(path)})
        clips.append((model == RECORDED, clip))
        told.update(f"{model} {path.name}".encode() + points.tobytes())
    name = told.hexdigest()[:16]
    key = {"survey": name, "motion": "relative" if relative else "absolute", "seed": seed, "clips": listed}
    return Survey(ballot(pages, name), key, tuple(_notes(clips)))


def _files(folder: Path) -> list[Path]:
    """The clips in a folder, by name."""
    what = f"no clips in {folder}"
    if not folder.is_dir():
        raise FileError(what, "there is no such folder", "Name a folder with clips.")
    found = sorted(path for path in folder.iterdir() if path.suffix.lower() in formats.FORMATS)
    if not found:
        raise FileError(
            what, f"it has no file of {', '.join(formats.FORMATS)}", "Put clips into it, or name another."
        )
    return found


def _poses(clip: Clip, path: Path) -> np.ndarray:
    """(F, J, 3) metres: joints seen from the hips, turned to face along Z; hips keep their mean height."""
    body = find_humanoid(clip)
    try:
        yaw, hips = facing(body.positions(clip)), body.root(clip)
    except RequestError as error:
        raise RequestError(
            f"cannot take the way out of {path}", f"{error.what}: {error.why}", "Leave out --relative."
        ) from None
    points = turn(clip.positions() * body.hand - hips[:, None], -yaw[:, None])
    points[..., 1] += hips[:, 1].mean()
    return points


def _notes(clips: Sequence[tuple[bool, Clip]]) -> Iterable[str]:
    """What tells generated clips from recorded ones before anybody looks at them."""
    for what, value in (
        ("length", lambda clip: len(clip)),
        ("frame rate", lambda clip: round(clip.fps, 2)),
        ("skeleton", lambda clip: clip.skeleton.names),
    ):
        own, made = ({value(clip) for is_real, clip in clips if is_real == side} for side in (True, False))
        if own != made:
            yield f"recorded and generated clips differ in {what}: people can tell them apart by that"


@dataclass(frozen=True)
class Votes:
    """What one person said: the number of a clip to RECORDED or GENERATED."""

    path: Path
    person: str
    answers: dict[int, str]


def read_key(path: Path) -> dict[str, Any]:
    """The key of a survey. Raises FileError when it is damaged or missing."""
    what, fix = (
        f"cannot read the key {path}",
        "Name the folder of the survey with --survey, or make it again.",
    )
    key = _json(path, what, fix)
    try:
        numbers = [clip["clip"] for clip in key["clips"]]
        sound = (
            all(isinstance(clip["clip"], int) and isinstance(clip["model"], str) for clip in key["clips"])
            and len(set(numbers)) == len(numbers) > 0
            and isinstance(key["survey"], str)
            and isinstance(key["motion"], str)
        )
    except (KeyError, TypeError):
        sound = False
    if not sound:
        raise FileError(what, "it does not say what each clip is", fix)
    return key


def read_votes(path: Path, key: dict[str, Any]) -> Votes:
    """The votes file of a person, checked against the key. Raises FileError when it cannot be counted."""
    what, fix = f"cannot count the votes in {path}", "Ask for the file again: the page saves it at its end."
    held = _json(path, what, fix)
    if not isinstance(held, dict) or not {"survey", "person", "votes"} <= held.keys():
        raise FileError(what, "it is no votes file", fix)
    if held["survey"] != key["survey"]:
        raise FileError(
            what, "they are of another survey, or of one with other clips", "Name its folder with --survey."
        )
    votes, numbers = held["votes"], {str(clip["clip"]) for clip in key["clips"]}
    if not isinstance(votes, dict) or not votes or not isinstance(held["person"], str):
        raise FileError(what, "nobody has answered anything in it", fix)
    for number, answer in votes.items():
        if number not in numbers or answer not in (RECORDED, GENERATED):
            raise FileError(what, f"clip {number:.20} is {answer!s:.20}, which is no answer", fix)
    return Votes(path, held["person"], {int(number): answer for number, answer in votes.items()})


def _json(path: Path, what: str, fix: str) -> Any:
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise FileError(what, error.strerror or str(error), fix) from None
    except (ValueError, RecursionError):
        raise FileError(what, "it is damaged, or no JSON", fix) from None


@dataclass(frozen=True)
class Row:
    """How a model's clips fared.

    Attributes:
        model: its name, or RECORDED.
        least, mean, most: over persons, the share in percent of its clips that a person took for recorded.
        persons: how many said something about its clips.
        clips, answers: how many there are, and how often somebody said something about one.
    """

    model: str
    least: float
    mean: float
    most: float
    persons: int
    clips: int
    answers: int


@dataclass(frozen=True)
class Tally:
    """Table 2 of the paper, for "relative" or "absolute" motion."""

    motion: str
    rows: tuple[Row, ...]

    def to_dict(self) -> dict[str, Any]:
        return {
            "protocol": "Hernandez Ruiz et al. 2019, table 2",
            "motion": self.motion,
            "unit": "percent of clips taken for recorded",
            "rows": [dict(row.__dict__) for row in self.rows],
        }

    def table(self) -> str:
        """In Markdown."""
        head = ["model", "motion", "min", "avg", "max", "persons", "clips", "answers"]
        rows = [
            [
                *(row.model, self.motion),
                *(f"{share:.2f} %" for share in (row.least, row.mean, row.most)),
                *(str(count) for count in (row.persons, row.clips, row.answers)),
            ]
            for row in self.rows
        ]
        return markdown(head, rows)

    def __str__(self) -> str:
        remark = (
            "Share of a model's clips that a person took for recorded: least, mean and most over persons. "
            "The first row is that of recorded clips: a model is as good as they are where it comes near."
        )
        return f"{self.table()}\n\n{remark}"


def tally(key: dict[str, Any], votes: Sequence[Votes]) -> Tally:
    """Count votes: one row for recorded clips, then one a model.

    Raises RequestError when there are no votes, or two files of one person.
    """
    if not votes:
        raise RequestError(
            "there is nothing to count",
            "no votes file was given, and nobody but people can say what they see",
            "Name the files that they saved: --votes ana.json --votes ben.json.",
        )
    by_person = {one.person: one for one in votes}
    if len(by_person) < len(votes):
        twice = next(one for one in votes if by_person[one.person] is not one)
        raise RequestError(
            f"{twice.path} and {by_person[twice.person].path} are of the same person",
            "one person counts once",
            "Leave one of them out.",
        )
    rows = []
    for model in dict.fromkeys([RECORDED, *sorted({clip["model"] for clip in key["clips"]})]):
        numbers = [clip["clip"] for clip in key["clips"] if clip["model"] == model]
        said = [[one.answers[n] == RECORDED for n in numbers if n in one.answers] for one in votes]
        shares = [100 * float(np.mean(some)) for some in said if some]
        if shares:
            figures = min(shares), float(np.mean(shares)), max(shares)
            rows.append(Row(model, *figures, len(shares), len(numbers), sum(map(len, said))))
    return Tally(key["motion"], tuple(rows))
