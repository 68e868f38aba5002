"""Pictures of motion and of measurements: SVG strips, images and sheets, an HTML player, line plots."""

from interpose.show.figure import Take
from interpose.show.image import image
from interpose.show.player import player
from interpose.show.plot import line_plot
from interpose.show.sheet import sheet
from interpose.show.strip import strip

__all__ = ["Take", "image", "line_plot", "player", "sheet", "strip"]
