"""Which method suits which gap, by measurement: short gaps to the spline, long ones to a network."""

from __future__ import annotations

from interpose.clip import Clip
from interpose.errors import RequestError
from interpose.methods import registry, weights
from interpose.methods.protocol import Method
from interpose.observation import Gap

# Frames at 30 fps from which `cmib` is better than the others, by how many sides of the gap are lone keys. On
# the validation performer its L2P between two is .85, .71 and .68 of interpolation's at 7, 40 and 60 frames,
# the spline's 1.10, 1.01 and 1.02, and that of `cae` 1.01, 1.01 and .99 (bench lafan1 --protocol cmib). With
# motion before the gap and a lone key after it .64, .69 and .72 at 5, 15 and 30; the spline's .61, .77, .83.
LONE = {1: 10, 2: 1}


def choose(clip: Clip, gap: Gap, lone: int = 0) -> tuple[Method, str | None]:
    """The method that measured best on validation performers for gaps of this length.

    The network from `from_gap` frames on (its card says so), unless it refuses; joints that are missing on
    their own go to it as well. Where `lone` sides (1 or 2) are single keys little tells how fast
    anything moves: there the network that was made for keys is better. The spline else, and where no weights
    are installed; then with the reason why the network does not fill a gap that would be its own.
    """
    spline = registry.get("spline")
    try:
        card = weights.find("cmib" if lone and gap.joints is None else "cae")
    except RequestError as error:
        return spline, f"{error.what}: {error.fix}"
    network = registry.get(card.method)
    length = len(gap) * card.fps / clip.fps
    if length < (LONE[lone] if network.name == "cmib" else card.auto["from_gap"]):
        return spline, None
    if reason := network.refuses(clip, gap):
        return spline, f"not filled by {network.name}: {reason}"
    return network, None
