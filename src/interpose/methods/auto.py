"""Which method suits which gap, by measurement: short gaps to the spline, long ones to the network."""

from __future__ import annotations

from interpose.clip import Clip
from interpose.errors import RequestError
from interpose.methods import registry, weights
from interpose.methods.protocol import Method
from interpose.observation import Gap


def choose(clip: Clip, gap: Gap) -> tuple[Method, str | None]:
    """The method that measured best on validation performers for gaps of this length.

    The network from `from_gap` frames on (its card says so), unless it refuses; joints that are missing on
    their own go to it as well. The spline else, and where no weights are installed; then with the reason
    why the network does not fill a gap that would be its own.
    """
    spline = registry.get("spline")
    try:
        card = weights.find("cae")
    except RequestError as error:
        return spline, f"{error.what}: {error.fix}"
    network = registry.get(card.method)
    length = len(gap) * card.fps / clip.fps
    if length < card.auto["from_gap"]:
        return spline, None
    if reason := network.refuses(clip, gap):
        return spline, f"not filled by {network.name}: {reason}"
    return network, None
