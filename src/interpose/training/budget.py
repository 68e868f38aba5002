"""What a training run may spend, and how far it has got."""

from __future__ import annotations

import re
import time
from dataclasses import dataclass, field

from interpose.errors import RequestError


@dataclass
class Budget:
    """An amount of device time or of steps; schedules follow the fraction of it that is spent.

    Device time is wall-clock time on a GPU, and the time that this process keeps processor cores busy on a
    CPU (core time: two busy cores spend two hours in one). Interrupted runs go on counting.

    Attributes:
        seconds: device seconds, or None when steps count.
        steps: optimiser steps, or None.
        spent_seconds, spent_steps: from earlier parts of the run.
    """

    seconds: float | None
    steps: int | None
    spent_seconds: float = 0.0
    spent_steps: int = 0
    gpu: bool = False
    _start: float = field(default=0.0, repr=False)
    _before: float = field(default=0.0, repr=False)

    @classmethod
    def parse(cls, text: str) -> Budget:
        """ "25m", "3h", "90s" or "6000steps"; RequestError for anything else."""
        match = re.fullmatch(r"(\d+(?:\.\d+)?)\s*(s|m|h|steps)", text.strip())
        whole = match is None or match[2] != "steps" or float(match[1]).is_integer()
        if not match or float(match[1]) <= 0 or not whole:
            raise RequestError(
                f"cannot read the budget {text!r}",
                "a budget is an amount of device time or a number of steps",
                "Write for example --budget 25m, --budget 3h or --budget 6000steps.",
            )
        if match[2] == "steps":
            return cls(None, int(float(match[1])))
        return cls(float(match[1]) * {"s": 1, "m": 60, "h": 3600}[match[2]], None)

    def __str__(self) -> str:
        return f"{self.steps} steps" if self.steps is not None else f"{(self.seconds or 0) / 3600:g} h"

    def start(self, gpu: bool) -> None:
        self.gpu, self._before = gpu, self.spent_seconds
        self._start = time.monotonic() if gpu else time.process_time()

    def clock(self) -> float:
        """Device seconds of this process since the start."""
        return (time.monotonic() if self.gpu else time.process_time()) - self._start

    def step(self, seconds: float | None = None) -> None:
        """One more step is done; `seconds` since the start, of all processes, when there are several."""
        self.spent_steps += 1
        self.spent_seconds = self._before + (self.clock() if seconds is None else seconds)

    @property
    def fraction(self) -> float:
        """How much is spent, 0 to 1."""
        if self.steps is not None:
            return min(1.0, self.spent_steps / self.steps)
        assert self.seconds is not None
        return min(1.0, self.spent_seconds / self.seconds)
