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
# Networks for gaps of the whole pose amid motion, and for joints that are missing on their own, the best one
# first. On validation performers (bench every --most 8) joints are off by 10.2, 15.1 and 14.9 cm where one
# joint, three or a limb are lost with `small`, 17.8, 32.5 and 16.5 with `cae`, although that one has seen
# these performers; gaps of 1 and 2 s by 5.8 and 10.0 with `small`, 4.7 and 6.8 with `cae`.
AMID, JOINTS = ("cae", "small"), ("small", "cae")


def choose(clip: Clip, gap: Gap, lone: int = 0) -> tuple[Method, str | None]:
    """The method that measured best on validation performers for gaps of this length.

    A network from its length on, unless it refuses: then the next best one; joints that are missing on
    their own go to networks as well. Where `lone` sides (1 or 2) are single keys little tells how fast
    anything moves: there the network that was made for keys is better. The spline else, and where no weights
    are installed; then with the reason why no network fills a gap that would be its own.
    """
    why = None
    for name in _candidates(gap, lone):
        try:
            card = weights.find(name)
        except RequestError as error:
            why = why or f"{error.what}: {error.fix}"
            continue
        network = registry.get(name)
        least = LONE[lone] if name == "cmib" else 0 if gap.joints is not None else card.auto["from_gap"]
        if len(gap) * card.fps / clip.fps < least:
            continue
        reason = network.refuses(clip, gap)
        if reason is None:
            return network, None
        why = why or f"not filled by {name}: {reason}"
    return registry.get("spline"), why


def _candidates(gap: Gap, lone: int) -> tuple[str, ...]:
    """The networks for a gap, the best one first."""
    if gap.joints is not None:
        return JOINTS
    return ("cmib",) if lone else AMID
