"""Trained weights on disk: an ONNX graph and a JSON card each."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, fields
from functools import cache, lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from interpose.errors import FileError, RequestError, unknown

# In a checkout all weights lie at its top. Installed, those for any use are inside of the package, and those
# for research in a distribution of their own (weights/pyproject.toml).
RESEARCH = "interpose_research_weights"
FOLDERS = (Path(__file__).parents[3] / "weights", Path(__file__).parents[1] / "weights")
# What weights may be asked to be licensed for: "open" are those that may be used for anything.
LICENCES = ("any", "open")
OPEN = "any use"  # what the licence of open weights begins with
MOST_THREADS = 4  # more hardly help with matrices of this size
_asked: list[str] = []  # the licences asked for, by everybody who did: the narrowest holds


@dataclass(frozen=True)
class Card:
    """What there is to know about trained weights.

    Attributes:
        name: of the weights; the folder in which they are.
        method: the method that runs them.
        description: one sentence.
        licence: what the weights may be used for.
        data: training data, a dictionary with name, licence and clips or frames each.
        tasks: the verbs that they support.
        joints: what they know, by name.
        fps: frames a second at which they think.
        max_gap: frames at that rate that it fills at once; `base` and its like fill longer ones in steps.
        training: recipe, seed, budget, commit, hours spent.
        metrics: measured figures with the command that printed them.
        auto: what the method `auto` goes by: from `from_gap` frames on the network is better than the spline.
        labels: action labels that it understands, in its own order; the first is "", for none.
        paces: for a label how fast the hips get ahead in its training motion, over a second: the 2nd and the
            98th percentile in metres a second, on a body with the canonical leg.
    """

    name: str
    method: str
    description: str
    licence: str
    data: list[dict[str, Any]]
    tasks: list[str]
    joints: list[str]
    fps: float
    max_gap: int
    training: dict[str, Any] = field(default_factory=dict)
    metrics: dict[str, Any] = field(default_factory=dict)
    auto: dict[str, Any] = field(default_factory=dict)
    labels: list[str] = field(default_factory=list)
    paces: dict[str, list[float]] = field(default_factory=dict)
    path: Path = field(default=Path(), compare=False)

    @property
    def open(self) -> bool:
        """Whether the weights may be used for anything."""
        return for_any_use(self.licence)

    @property
    def onnx(self) -> Path:
        return self.path.with_suffix(".onnx")

    def frames(self, count: int, fps: float) -> float:
        """How many frames at its rate as many at another one are, to a hundredth: the last digits of a file's
        frame time tell nothing."""
        return round(count * self.fps / fps, 2)

    def brief(self) -> dict[str, Any]:
        """What reports say of the weights that had a part in them."""
        return {"name": self.name, "licence": self.licence, "commit": self.training.get("commit")}

    def to_dict(self) -> dict[str, Any]:
        """Plain types, as in the file."""
        return {name: value for name, value in asdict(self).items() if name != "path"}

    def save(self, path: Path) -> None:
        """Write the card, whole or not at all."""
        new = path.with_suffix(".new")
        new.write_text(json.dumps(self.to_dict(), indent=2) + "\n")
        os.replace(new, path)

    @classmethod
    def load(cls, path: Path) -> Card:
        """Read a card; FileError when it is damaged."""
        again = "Export the weights again; of interpose's own: install it again."
        try:
            held = json.loads(path.read_text())
            if new := sorted(held.keys() - {one.name for one in fields(cls)}):
                why = f"it says {', '.join(new)}, of which this version knows nothing"
                raise FileError(f"cannot read the card {path}", why, "Install a newer interpose.")
            card = cls(**held, path=path)
            card._check()
        except FileError:
            raise
        except FileNotFoundError:
            why = "a graph NAME.onnx needs its card NAME.json beside it"
            raise FileError(f"there is no {path}", why, again) from None
        except (OSError, ValueError, TypeError, AttributeError) as reason:
            raise FileError(f"cannot read the card {path}", str(reason), again) from None
        return card

    def _check(self) -> None:
        """Raises ValueError where a value is none that it can have."""
        kinds = {
            str: ("name", "method", "description", "licence"),
            list: ("data", "tasks", "joints", "labels"),
        }
        kinds |= {dict: ("training", "metrics", "auto", "paces")}
        for kind, names in kinds.items():
            for name in names:
                if not isinstance(getattr(self, name), kind):
                    raise ValueError(f"its {name} is {getattr(self, name)!r}")
        for name, least in (("fps", 0.1), ("max_gap", 0)):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int | float) or not least <= value < 1e6:
                raise ValueError(f"its {name} is {value!r}")
        if not self.joints:
            raise ValueError("it knows no joints")


def for_any_use(licence: str) -> bool:
    """Whether a licence is for any use."""
    return licence.startswith(OPEN)


def session(path: Path, threads: int = 1) -> Any:
    """The ONNX Runtime session of a graph, on one thread: convolutions sum up in another order on several,
    and results are to be the same on every machine.

    Raises FileError when the file is damaged.
    """
    return _session(path.resolve(), path.stat().st_mtime_ns, threads)


def cores() -> int:
    """On how many threads networks run whose results do not depend on that: as OMP_NUM_THREADS says, or as
    many as there are cores, four at most."""
    said = os.environ.get("OMP_NUM_THREADS", "").partition(",")[0]
    if said.isdecimal() and int(said) > 0:
        return int(said)
    here = getattr(os, "sched_getaffinity", lambda _: range(os.cpu_count() or 1))(0)
    return min(len(here), MOST_THREADS)


@lru_cache(maxsize=16)
def _session(path: Path, changed: int, threads: int) -> Any:
    """The session of a graph as it was when it was `changed` last."""
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    options.inter_op_num_threads = 1
    # Threads that wait do so without taking cores that others use.
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    options.log_severity_level = 3  # errors: what it could not fold into constants is nothing to users
    try:
        return onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
    except Exception as reason:  # of kinds that ONNX Runtime does not export
        why = str(reason).partition("\n")[0]
        fix = "Export the weights again; of interpose's own: install it again."
        raise FileError(f"cannot read the network {path}", why, fix) from None


def folders() -> list[Path]:
    """Where weights lie: in a checkout, or in what is installed."""
    if FOLDERS[0].is_dir():
        return [FOLDERS[0]]
    research = find_spec(RESEARCH)
    places = [Path(place) for place in (research.submodule_search_locations or ())] if research else []
    return [folder for folder in (*FOLDERS[1:], *places) if folder.is_dir()]


def all_installed() -> bool:
    """Whether weights for research are there, too."""
    return FOLDERS[0].is_dir() or find_spec(RESEARCH) is not None


@cache
def cards() -> list[Card]:
    """The cards of all installed weights, by name."""
    every = [path for folder in folders() for path in folder.glob("*/*.json")]
    # What else lies there is none of them, and stops nobody.
    found = [Card.load(path) for path in every if path.with_suffix(".onnx").exists()]
    return sorted(found, key=lambda card: card.name)


def allow(licence: str) -> None:
    """From now on use weights of that licence alone: one of LICENCES.

    Raises RequestError for another one.
    """
    if licence not in LICENCES:
        raise unknown("licence", licence, LICENCES)
    _asked.append(licence)


@contextmanager
def asked_anew() -> Iterator[None]:
    """Within it licences may be asked for that are forgotten afterwards."""
    before = list(_asked)
    try:
        yield
    finally:
        _asked[:] = before


@contextmanager
def licensed(licence: str) -> Iterator[None]:
    """Within it methods use weights of that licence alone: "open" for those that may be used for anything.

    What chooses a method by itself chooses among these; a method whose weights are not among them is refused.
    It holds for all threads, until whoever asked for it last is through.

        with interpose.license("open"):
            done = interpose.fill("take.bvh", "120:160")

    Args:
        licence: "open", or "any", as it is without.

    Raises:
        RequestError: another licence.
    """
    allow(licence)
    try:
        yield
    finally:
        _asked.remove(licence)


def allowed(card: Card) -> Card:
    """The card, if its weights may be used. RequestError otherwise."""
    if "open" in _asked and not card.open:
        others = [one.method for one in cards() if one.open]
        raise RequestError(
            f"the weights of {card.name} are not open",
            f"their licence: {card.licence}",
            f"Use the method {' or '.join([*others, 'spline'])}, or allow any licence: --license any, "
            'or in Python none of license("open").',
        )
    return card


def find(method: str) -> Card:
    """The weights that a method runs: those of its name, or else any. Raises RequestError when there are
    none, or none that may be used."""
    there = cards()
    named = [card for card in there if card.name == method]
    for card in named or [card for card in there if card.method == method]:
        return allowed(card)
    raise RequestError(
        f"there are no weights for the method {method}",
        f"none lie in {' or '.join(map(str, folders())) or 'any of the places for them'}",
        "Install those for research, too (pip install ./weights), or use the method spline.",
    )


def of(method: str, trained: Card | None) -> Card:
    """The weights that somebody trained for a method, or else the installed ones; raises as `find` does."""
    return allowed(trained) if trained else find(method)


def told(*cards: Card) -> dict[str, Any]:
    """Notes of a method that has asked weights, its own first."""
    return {"model": cards[0].name, "weights": tuple(card.brief() for card in cards)}


def load(folder: Path, method: str) -> Card:
    """The card of weights that `interpose export` wrote into a folder. Raises FileError without any."""
    for path in sorted(folder.glob("*.onnx")):
        found = Card.load(path.with_suffix(".json"))
        if found.method == method:
            return found
    raise FileError(
        f"no weights of {method} in {folder}",
        "it has no .onnx file with a card of that method",
        f"Write them: interpose export {method} --run RUN --out {folder}",
    )


def card(name: str) -> Card:
    """The card of some weights by name, or of the only ones in a folder; the error lists all names."""
    for known in cards():
        if known.name == name:
            return known
    if not (name and Path(name).is_dir()):
        error = unknown("model", name, [known.name for known in cards()])
        more = "" if all_installed() else " Those for research are installed by: pip install ./weights."
        raise RequestError(error.what, error.why, error.fix + more)
    return within(name)


def within(folder: str) -> Card:
    """The card of the only weights in a folder. RequestError where it has none, or several."""
    found = [*Path(folder).glob("*.onnx")]
    if len(found) != 1:
        there = " and ".join(sorted(path.name for path in found)) or "none"
        raise RequestError(
            f"the folder {folder} is no model",
            f"it would have one .onnx file with its card beside it, and has {there}",
            "Name the folder that interpose export, or interpose train, wrote.",
        )
    return Card.load(found[0].with_suffix(".json"))
