"""What is missing: finding it (scan), saying it (Observation, Gap, Pin), making it (corruption)."""

from interpose.observation.observation import Gap, Observation, Pin

__all__ = ["Gap", "Observation", "Pin"]
