"""How help looks: text flows to the width of the terminal, wherever its lines end in the code."""

from __future__ import annotations

from typing import Any

from cyclopts.help import DefaultFormatter, HelpPanel, InlineText
from rich.console import Console, ConsoleOptions
from rich.text import Text


class Flowing(DefaultFormatter):
    """The usual help, with the lines of each paragraph joined; what is indented stays as it is."""

    def __call__(self, console: Console, options: ConsoleOptions, panel: HelpPanel) -> None:
        for entry in panel.entries:
            flow(entry.description)
        super().__call__(console, options, panel)

    def render_description(self, console: Console, options: ConsoleOptions, description: Any) -> None:
        flow(description)
        super().render_description(console, options, description)


def flow(text: object) -> None:
    """Join the lines of each paragraph in place."""
    if isinstance(text, InlineText) and isinstance(text.primary_renderable, Text):
        lines: list[str] = []
        for line in text.primary_renderable.plain.splitlines():
            goes_on = bool(lines and lines[-1] and line) and not lines[-1].endswith(":")
            if goes_on and not line.startswith(" ") and not lines[-1].startswith(" "):
                lines[-1] += f" {line}"
            else:
                lines.append(line)
        text.primary_renderable = Text("\n".join(lines))
