"""The guarantees: what makes a completion usable, the same for every method."""

from interpose.finish.completing import complete
from interpose.finish.report import Completion, GapReport, Provenance, Report
from interpose.finish.retargeting import on_rig_of, retarget
from interpose.finish.solve import solve

__all__ = ["Completion", "GapReport", "Provenance", "Report", "complete", "on_rig_of", "retarget", "solve"]
