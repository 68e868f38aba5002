"""The canonical humanoid of 22 joints, and how a clip's own joints map onto it."""

from interpose.skeletons.canonical import JOINTS, LEG_LENGTH, PARENTS, SIDES
from interpose.skeletons.mapping import Mapping, find_mapping

__all__ = ["JOINTS", "LEG_LENGTH", "PARENTS", "SIDES", "Mapping", "find_mapping"]
