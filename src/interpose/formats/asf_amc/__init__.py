"""ASF and AMC: Acclaim skeleton and motion, text. A motion file is read together with its skeleton file."""

from interpose.formats.asf_amc.asf import find_asf
from interpose.formats.asf_amc.read import AmcSource, read
from interpose.formats.asf_amc.write import write

__all__ = ["AmcSource", "find_asf", "read", "write"]
