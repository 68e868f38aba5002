"""BVH: Biovision hierarchy, text. Reading, writing, and what is kept so that nothing else changes."""

from interpose.formats.bvh.read import BvhSource, read
from interpose.formats.bvh.write import write

__all__ = ["BvhSource", "read", "write"]
