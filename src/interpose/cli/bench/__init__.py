"""interpose bench: published protocols, and what auto goes by. One file a paper."""

from interpose.cli.bench import forecasting, inbetweening, infilling, own
from interpose.cli.bench.asking import bench

__all__ = ["bench", "forecasting", "inbetweening", "infilling", "own"]
