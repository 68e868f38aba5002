"""Trained weights on disk: an ONNX graph and a JSON card each."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from interpose.errors import FileError, RequestError, unknown

# In a checkout the weights lie at its top; in an installed package inside it.
FOLDERS = (Path(__file__).parents[3] / "weights", Path(__file__).parents[1] / "weights")


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
        max_gap: longest gap in frames at that rate.
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
    def onnx(self) -> Path:
        return self.path.with_suffix(".onnx")

    def to_dict(self) -> dict[str, Any]:
        """Plain types, as in the file."""
        return {name: value for name, value in asdict(self).items() if name != "path"}

    def save(self, path: Path) -> None:
        path.write_text(json.dumps(self.to_dict(), indent=2) + "\n")

    @classmethod
    def load(cls, path: Path) -> Card:
        """Read a card; FileError when it is damaged."""
        try:
            return cls(**json.loads(path.read_text()), path=path)
        except (OSError, ValueError, TypeError) as reason:
            raise FileError(
                f"cannot read the card {path.name}", str(reason), "Install interpose again to restore it."
            ) from None


@cache
def session(path: Path) -> Any:
    """The ONNX Runtime session of a graph, on one thread: results do not depend on how busy a machine is."""
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    options.inter_op_num_threads = 1
    options.log_severity_level = 3  # errors: what it could not fold into constants is nothing to users
    return onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])


@cache
def cards() -> list[Card]:
    """The cards of all installed weights, by name."""
    folder = next((folder for folder in FOLDERS if folder.is_dir()), None)
    return [Card.load(path) for path in sorted(folder.glob("*/*.json"))] if folder else []


def find(method: str) -> Card:
    """The weights that a method runs. Raises RequestError when there are none."""
    for card in cards():
        if card.method == method and card.onnx.exists():
            return card
    raise RequestError(
        f"there are no weights for the method {method}",
        f"none lie in {' or '.join(str(folder) for folder in FOLDERS)}",
        "Install interpose with its weights, or use --method spline.",
    )


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
    if Path(name).is_dir() and len(found := [*Path(name).glob("*.onnx")]) == 1:
        return Card.load(found[0].with_suffix(".json"))
    raise unknown("model", name, [known.name for known in cards()])
