"""The public data sets: where their clips are, who performs, their splits, and packs of them."""

from interpose.datasets.catalogue import DATASETS, SPLITS, Entry, clips, split_of, trains_shipped_weights
from interpose.datasets.pack import Pack, build_pack

__all__ = ["DATASETS", "SPLITS", "Entry", "Pack", "build_pack", "clips", "split_of", "trains_shipped_weights"]
