"""The canonical humanoid of 22 joints, and how a clip's own joints map onto it."""

from interpose.skeletons.canonical import ACROSS, ACROSS_TURN, BONES, FEET, JOINTS, LEG_LENGTH, PARENTS, SIDES
from interpose.skeletons.humanoid import Humanoid, canonical_positions, find_humanoid
from interpose.skeletons.mapping import Mapping, find_mapping

__all__ = [
    "ACROSS",
    "ACROSS_TURN",
    "BONES",
    "FEET",
    "JOINTS",
    "LEG_LENGTH",
    "PARENTS",
    "SIDES",
    "Humanoid",
    "Mapping",
    "canonical_positions",
    "find_humanoid",
    "find_mapping",
]
