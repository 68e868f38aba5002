"""What is missing: finding it (scan), saying it (Observation, Gap, Pin), making it (corruption)."""

from interpose.observation.observation import ROUGH, Gap, Observation, Pin
from interpose.observation.part import Part

__all__ = ["ROUGH", "Gap", "Observation", "Part", "Pin"]
