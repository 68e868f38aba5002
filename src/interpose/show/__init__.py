"""Pictures of motion and of measurements: SVG strips, a self-contained HTML player, line plots."""

from interpose.show.figure import Take
from interpose.show.player import player
from interpose.show.plot import line_plot
from interpose.show.strip import strip

__all__ = ["Take", "line_plot", "player", "strip"]
