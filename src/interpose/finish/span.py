"""A range of frames in which something is missing, as it is being completed."""

from __future__ import annotations

from dataclasses import dataclass, field

from interpose.clip import Clip
from interpose.observation import Gap


@dataclass
class Span:
    """A range of frames in which something is missing, and what becomes of it.

    `problem` says why the method's own motion does not do; it is `hopeless` if it should not be used at all.
    Each of the notes speaks of some frames, first to last.
    """

    start: int
    stop: int
    method: str
    problem: str | None = None
    hopeless: bool = False
    notes: list[tuple[int, int, str]] = field(default_factory=list)

    def told(self, gap: Gap) -> list[str]:
        """What the notes say of one of its gaps, the known frames beside it included."""
        return [text for first, last, text in self.notes if first <= gap.stop and last >= gap.start - 1]

    def around(self, frames: int, margin: int) -> tuple[int, int, tuple[int, int]]:
        """The frames lo to hi - 1 around it, and its own range counted from lo."""
        lo, hi = max(0, self.start - margin), min(frames, self.stop + margin)
        return lo, hi, (self.start - lo, self.stop - lo)


def write(current: Clip, source: Clip, at: int, inner: tuple[int, int]) -> None:
    """Put the frames `inner` of `source` into `current`, from frame `at` on."""
    part = slice(at, at + inner[1] - inner[0])
    current.rotation[part] = source.rotation[slice(*inner)]
    current.translation[part] = source.translation[slice(*inner)]
