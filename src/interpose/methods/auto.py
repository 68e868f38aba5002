"""Which method suits which gap, by measurement: short gaps to the spline, long ones to the network."""

from __future__ import annotations

from interpose.clip import Clip
from interpose.errors import RequestError
from interpose.methods import registry, weights
from interpose.methods.protocol import Method
from interpose.observation import Gap


def choose(clip: Clip, gap: Gap) -> Method:
    """The method that measured best on validation performers for gaps of this length.

    The network from `from_gap` frames on (its card says so), unless it refuses; joints that are missing on
    their own go to it as well. The spline else, and where no weights are installed.
    """
    spline = registry.get("spline")
    try:
        card = weights.find("cae")
    except RequestError:
        return spline
    network = registry.get(card.method)
    if network.refuses(clip, gap):
        return spline
    length = len(gap) * card.fps / clip.fps
    return network if length >= card.auto.get("from_gap", 0) else spline
