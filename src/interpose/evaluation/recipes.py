"""Training runs laid beside each other: what their recipes differ in, and what came of it.

For ablations at an equal budget. The figures are those that each run itself measured on validation
performers as it ended, of averaged weights.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from interpose.errors import FileError, unknown
from interpose.evaluation.table import markdown

# What says how long a run has lasted, and no figure of what it reached.
PROGRESS = ("step", "hours", "fraction", "loss")


@dataclass(frozen=True)
class Run:
    """A run: the folder's name, its settings by name, and the last entry of its log."""

    name: str
    settings: dict[str, Any]
    last: dict[str, float]


@dataclass(frozen=True)
class Recipes:
    """Runs, in the order in which they were named; the first one is what others are compared with.

    Attributes:
        runs: the runs.
        chosen: the names of the figures to show; all that were measured of all runs without any.
    """

    runs: tuple[Run, ...]
    chosen: tuple[str, ...] = ()

    @property
    def figures(self) -> list[str]:
        """The names of what was measured of all runs, or of it what is to be shown."""
        held = [n for n in self.runs[0].last if n not in PROGRESS and all(n in run.last for run in self.runs)]
        if bad := [name for name in self.chosen if name not in held]:
            raise unknown("figure", bad[0], held)
        return list(self.chosen) or held

    def differs(self, run: Run) -> dict[str, Any]:
        """The settings of a run that are not those of the first one."""
        first = self.runs[0].settings
        return {name: value for name, value in run.settings.items() if first.get(name, value) != value}

    def to_dict(self) -> dict[str, Any]:
        return {
            "split": "validation",
            "runs": [{"name": r.name, "differs": self.differs(r), **r.last} for r in self.runs],
        }

    def table(self) -> str:
        head = ["run", "what is different", "steps", "hours", *self.figures]
        rows = [
            [
                run.name,
                ", ".join(f"{name}={value}" for name, value in self.differs(run).items()) or "-",
                f"{run.last['step']:,}",
                f"{run.last['hours']:.2f}",
                *(f"{run.last[name]:.3g}" for name in self.figures),
            ]
            for run in self.runs
        ]
        return markdown(head, rows)

    def __str__(self) -> str:
        seen = [run.name for run in self.runs if "validation" in run.settings.get("splits", "")]
        warning = f"\n\nTrained on these performers, too, so no measure: {', '.join(seen)}." * bool(seen)
        early = [
            f"{run.name} ({100 * done:.0f} %)"
            for run in self.runs
            if (done := run.last.get("fraction", 1)) < 1
        ]
        warning += f"\n\nNot at the end of their budget yet: {', '.join(early)}." * bool(early)
        return f"Validation performers, as each run was measured last.\n\n{self.table()}{warning}"


def compare(folders: Sequence[Path], figures: Sequence[str] = ()) -> Recipes:
    """Read runs.

    Args:
        folders: of the runs.
        figures: names of those to show.

    Raises:
        FileError: a folder that holds no run, or one that has measured nothing yet.
    """
    return Recipes(tuple(_read(folder) for folder in folders), tuple(figures))


def _read(folder: Path) -> Run:
    """A run that `interpose train` wrote."""
    try:
        lines = (folder / "log.jsonl").read_text().splitlines()
        settings = json.loads((folder / "settings.json").read_text())
        last = json.loads(lines[-1])
        if not isinstance(settings, dict) or not isinstance(last, dict) or not {"step", "hours"} <= {*last}:
            raise ValueError("its files are not those of a run")
    except (OSError, ValueError, IndexError) as reason:
        why = f"it has no {Path(reason.filename).name}" if isinstance(reason, OSError) else str(reason)
        raise FileError(
            f"cannot read the run {folder}",
            why,
            "Name folders that interpose train wrote, once they are done.",
        ) from None
    lists = {name: "+".join(map(str, value)) for name, value in settings.items() if isinstance(value, list)}
    plain = {
        name: value
        for name, value in {**settings, **lists}.items()
        if isinstance(value, int | float | str) and name not in ("commit", "budget", "processes")
    }
    return Run(folder.name, plain, last)
