"""What the verbs mean: say what is observed, choose a method for each gap, complete, and report."""

from interpose.tasks.blocking import pose_to_pose
from interpose.tasks.denoising import denoise
from interpose.tasks.filling import fill, fitted
from interpose.tasks.forecasting import Forecast, forecast
from interpose.tasks.keys import between, block
from interpose.tasks.planning import plan
from interpose.tasks.recovering import recover
from interpose.tasks.stitching import Cycle, Stitched, cycle, stitch

__all__ = [
    "Cycle",
    "Forecast",
    "Stitched",
    "between",
    "block",
    "cycle",
    "denoise",
    "fill",
    "fitted",
    "forecast",
    "plan",
    "pose_to_pose",
    "recover",
    "stitch",
]
