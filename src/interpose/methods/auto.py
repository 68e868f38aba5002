"""Which method suits which gap, by measurement: short gaps to the spline, long ones to a network."""

from __future__ import annotations

from interpose.clip import Clip
from interpose.errors import RequestError
from interpose.methods import registry, weights
from interpose.methods.protocol import Method
from interpose.observation import Gap

# Networks for gaps of the whole pose, for joints missing on their own, and between two lone keys, the
# best one first; measured on validation performers. Amid motion joints are off by 1.8, 4.1 and 8.3 cm with
# `small` in gaps of 15, 30 and 60 frames, 2.5, 4.8 and 10.4 with `cae` before it was trained on these
# performers, 2.4, 6.4, 11.4 with the spline (bench threshold). Before a lone key 5.0 with `small`, 6.0 with
# `cmib` in a gap of a second; between two of them 6.1 and 6.3, with one more in the middle of two seconds 6.5
# and 6.1. Where one joint, three or a limb are lost 7.1, 9.3 and 13.8 with `small`, 8.8, 13.9 and 16.5 with
# `cae` (bench every).
# `small-open` stands in where only weights for any use are installed, or asked for.
AMID = JOINTS = ("small", "cae", "small-open")
KEYS = ("cmib", "small", "small-open")


def choose(clip: Clip, gap: Gap, lone: int = 0) -> tuple[Method, str | None]:
    """The method that measured best on validation performers for gaps of this length.

    A network from its length on, unless it refuses: then the next best one; joints that are missing on
    their own go to networks as well. Where both sides (`lone` is 2) are single keys nothing tells how fast
    anything moves: there the network that was made for keys is better. The spline else, and where no weights
    are installed; then with the reason why no network fills a gap that would be its own.
    """
    why, short = None, False
    for name in _candidates(gap, lone):
        try:
            card = weights.find(name)
        except RequestError as error:
            why = why or f"{error.what}: {error.fix}"
            continue
        network = registry.get(name)
        least = 0 if gap.joints is not None or lone == 2 else card.auto["from_gap"]
        if len(gap) * card.fps / clip.fps < least:
            short = True
            continue
        reason = network.refuses(clip, gap)
        if reason is None:
            return network, None
        why = why or f"not filled by {name}: {reason}"
    return registry.get("spline"), None if short else why


def _candidates(gap: Gap, lone: int) -> tuple[str, ...]:
    """The networks for a gap, the best one first."""
    if gap.joints is not None:
        return JOINTS
    return KEYS if lone == 2 else AMID
