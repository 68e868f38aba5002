"""Which method suits which gap, by measurement: the shortest gaps to the spline, others to a network."""

from __future__ import annotations

from contextlib import suppress

from interpose.clip import Clip
from interpose.errors import RequestError
from interpose.methods import registry, weights
from interpose.methods.protocol import Method
from interpose.observation import Gap

# Networks for gaps with motion on a side and for joints missing on their own, and for gaps between two lone
# keys, the best one first; measured on validation performers. Amid motion joints are off by 1.7, 3.7 and
# 6.4 cm with `base` in gaps of 15, 30 and 60 frames, 1.8, 3.7 and 6.5 with `small`, 2.6, 4.6 and 6.7 with
# `cae`, which has seen these performers, 3.3, 7.7 and 9.8 with the spline. Between two lone keys a second
# apart 5.0 with `base` and `small`, 5.4 with `cmib`, two seconds apart with one more in the middle 5.1, 5.3
# and 5.5. One joint, or three, or a limb that is lost 4.3, 6.5 and 9.2 with `base`, 8.9, 14.0 and 16.7 with
# `cae` (bench every).
# `small-open` stands in where only weights for any use are installed, or asked for.
NETWORKS, KEYS = ("base", "small", "cae", "small-open"), ("base", "small", "cmib", "small-open")
# At an end of a clip, where a spline has one side alone to go by, this one is ahead at any length: in 2 and 3
# frames joints are off by .25 and .36 cm, the spline's by .43 and .69 (at the beginning .44 and .66, .59 and
# .96); `cae` and `small-open` are not.
AT_ENDS = ("base", "small")


def choose(clip: Clip, gap: Gap, lone: int = 0) -> tuple[Method, str | None]:
    """The method that measured best on validation performers for gaps of this length.

    A network from its length on, unless it refuses: then the next best one. Joints that are missing on their
    own go to networks at any length, as do gaps between two single keys (`lone` is 2), as nothing tells how
    fast anything moves there, and to AT_ENDS those at an end of the clip. The spline else, and where no
    weights are installed; then with the reason why no network fills a gap that would be its own.
    """
    lacking, refused, short = None, None, False
    at_end = gap.start == 0 or gap.stop == len(clip)
    for name in KEYS if gap.joints is None and lone == 2 else NETWORKS:
        try:
            card = weights.find(name)
        except RequestError as error:
            lacking = lacking or f"{error.what}: {error.fix}"
            continue
        network = registry.get(name)
        any_length = gap.joints is not None or lone == 2 or (at_end and name in AT_ENDS)
        least = 0 if any_length else card.auto["from_gap"]
        if card.frames(len(gap), clip.fps) < least:
            short = True
            continue
        reason = network.refuses(clip, gap)
        if reason is None:
            return network, None
        refused = refused or f"not filled by {name}: {reason}"
    return registry.get("spline"), refused or (None if short else lacking)


def choose_told(clip: Clip, gap: Gap, action: str) -> Method:
    """The method that is told the action: `base`, `small`, or `cmib` where these refuse or do not know it.

    Measured on LAFAN1's validation performer, in gaps of 30 and 60 frames: amid motion joints are off by 3.9
    and 9.8 cm with `small` and 7.5 and 16.7 with `cmib`; between two keys by 6.4 and 15.9, and 7.5 and 16.7.
    Another action moves them by .8 and 2.3 cm with `small`, and 2.0 and 5.1 with `cmib`, but not to what it
    says: told that they jump, hips rise by half a centimetre with either. Who walks, told so, glides in 4 to
    8 % of the frames with `cmib`, and in none with `small`; who runs in 33 to 48 %, and in 19 to 28.

    Raises RequestError for an action that none of them knows, or where none is installed.
    """
    methods: list[Method] = []
    said = registry.nobody(f"cannot make it {action}", "knows actions")
    for name in registry.usable(("base", "small", "cmib")):
        try:
            methods.append(registry.told(name, action))
        except RequestError as error:
            said = error
    if not methods:
        raise said
    return next((method for method in methods if method.refuses(clip, gap) is None), methods[0])


def instead(chosen: Method, clip: Clip, gap: Gap) -> Method:
    """What takes over where a method's motion is none of a person's: the spline, and for `cmib`, whose gaps
    are long, between keys, the network that is ahead of it."""
    for name in KEYS[: KEYS.index("cmib")] if chosen.name == "cmib" else ():
        with suppress(RequestError):
            weights.find(name)
            if registry.get(name).refuses(clip, gap) is None:
                return registry.get(name)
    return registry.get("spline")
