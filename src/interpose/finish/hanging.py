"""Nobody hangs in the air: who is aloft within a gap flies freely, or is let down.

A network's answer is a mean of all that may be: of who jumps at some time or other it says that he hovers all
the while, and of one who is cut in the air that he comes down as on a parachute. Of what somebody stands on
in the middle of a gap alone, as on a box, nothing is known: he is let down, too.
"""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from interpose.clip import Clip
from interpose.finish import feet
from interpose.finish.falling import above, lowered, others_above, resting
from interpose.finish.standing import GRAVITY
from interpose.geometry.time import runs
from interpose.observation import Gap, Observation
from interpose.skeletons import find_mapping
from interpose.skeletons.carrier import place_of

# Metres above the floor from which on a body is aloft; the share of gravity by which one that flies falls.
ALOFT, FALLS = 0.05, 0.5
# The share of the height of a free flight that frames aloft have at least: beside known motion that is in the
# air, and in the middle of a gap; and from which on, there, a flight is made of them and else none.
BESIDE, WITHIN, SOME = 0.5, 0.8, 0.3
# Metres a second: who travels faster would be let down on feet that slide.
TRAVELS = 1.2
# Seconds for which known motion nearby, within so many seconds, may hang before it is taken to do so, as on a
# bar; and metres by which the floor may be uneven.
MOMENT, NEAR, EVEN = 0.15, 1.0, 0.08
# Metres above the floor below which a knee, a hip or a hand rests on it.
FLESH = 0.12
# Seconds over which a body is let down smoothly, and over which its height is evened out.
SOFT, SMOOTH = 0.03, 0.04
# Seconds of hanging that are asked about; and frames a second below which a fall is told too roughly.
LONG, SLOWEST = 0.25, 12.0


def grounded(clip: Clip, known: Observation, span: tuple[int, int]) -> Clip:
    """The clip with a body let down that hangs in the air in frames `span`, between known ones.

    Frames aloft that rise and fall as a free flight of their length does are left alone. In all others the
    body goes down to the floor, no lower than it can fall from where known motion has it in the air.
    """
    start, stop = span
    if start < 1 or stop >= len(clip) or not feet.untold(clip, known, start, stop):
        return clip
    if not feet.legs(clip.skeleton) or not find_mapping(clip.skeleton).usable:
        return clip
    body = _Body(clip, known)
    if np.ptp(body.rests[:, 0], axis=0).max() > EVEN or body.used_to_hang(span):
        return clip
    down, hangs = np.zeros(len(clip)), body.hangs()
    for first, last in runs(body.clear > ALOFT / 2):
        low, high = max(first, start), min(last, stop)
        if body.lasts(hangs[low:high]):
            down[low:high] = body.too_high(low, high, first < start, last > stop)
    if down.max() < ALOFT:
        return clip
    down = ndimage.gaussian_filter1d(down, SOFT * clip.fps, mode="constant")
    # Nothing at the borders of the gap, where known motion begins.
    frame = np.arange(len(clip))
    inside = np.minimum(frame - start + 1, stop - frame) / max(1.0, 2 * SOFT * clip.fps)
    down = feet.size(clip.skeleton) * (down * np.clip(inside, 0.0, 1.0))[start:]
    rests = feet.size(clip.skeleton) * body.rests[start:]
    return lowered(clip, down, np.zeros(len(down)), rests, start)


def flies(clip: Clip, known: Observation) -> np.ndarray:
    """(F,) where a body is in the air, and falls, or rises, freely."""
    if not find_mapping(clip.skeleton).usable or not feet.legs(clip.skeleton):
        return np.zeros(len(clip), bool)
    body = _Body(clip, known)
    return (body.clear > ALOFT) & ~body.hangs()


def hung(finished: Clip, known: Observation, gap: Gap, first: int) -> list[str]:
    """A note where a body hangs in the air within a gap, and the known motion nearby does not."""
    near = round(feet.NEARBY * finished.fps)
    lo, hi = max(gap.start - near, 0), min(gap.stop + near, len(finished))
    part, seen = finished.slice(lo, hi), known.slice(lo, hi)
    span = gap.start - lo, gap.stop - lo
    if gap.joints is not None or not find_mapping(part.skeleton).usable or not feet.legs(part.skeleton):
        return []
    if finished.fps < SLOWEST:
        return []
    body = _Body(part, seen)
    hangs = np.zeros(len(part), bool)
    hangs[slice(*span)] = body.hangs()[slice(*span)]
    start, stop = max(runs(hangs), key=lambda run: run[1] - run[0], default=(0, 0))
    if stop - start <= LONG * finished.fps or body.used_to_hang(span):
        return []
    frames = f"frames {first + lo + start} to {first + lo + stop - 1}"
    said = f"flagged: nothing of it touches the floor in {frames}, and it does not fall"
    return [f"{said}: unless it stands on something there, a key with a foot down helps"]


class _Body:
    """How high a body is, as if it were of usual size.

    Attributes:
        height: (F,) metres, of its joints in the mean.
        clear: (F,) metres, of the lowest one above the floor.
        rests: (F, L, 2) metres, where ankles and toes rest: of all legs alike, as one may be in the air.
        way: (F, 2) metres, of the hips along the floor.
        known: (F,) where all is known.
        gravity: metres a frame squared.
        fps: frames a second.
    """

    def __init__(self, clip: Clip, known: Observation) -> None:
        placed = clip.positions() / feet.size(clip.skeleton)
        rests = resting(placed, clip, known)
        self.rests = np.broadcast_to(rests.min(axis=1, keepdims=True), rests.shape)
        # Joints other than feet lie within flesh, which touches the floor before they do.
        lies = others_above(placed, self.rests, clip) < FLESH
        clear = above(placed, self.rests, clip)
        self.clear = np.where(lies, np.minimum(clear, 0.0), clear)
        self.height = placed[:, list(find_mapping(clip.skeleton).mapped[1]), 1].mean(axis=1)
        self.way = placed[:, place_of(clip)][:, [0, 2]]
        self.known, self.fps = known.frames, clip.fps
        self.gravity = GRAVITY / feet.size(clip.skeleton) / clip.fps**2

    def hangs(self) -> np.ndarray:
        """(F,) where it is aloft, and does not fall."""
        if len(self.height) < 2:
            return np.zeros(len(self.height), bool)
        even = ndimage.gaussian_filter1d(self.height, SMOOTH * self.fps, mode="nearest")
        return np.asarray((self.clear > ALOFT) & (np.gradient(np.gradient(even)) > -FALLS * self.gravity))

    def used_to_hang(self, span: tuple[int, int]) -> bool:
        """Whether known motion beside some frames hangs for longer than a moment."""
        near = round(NEAR * self.fps)
        hangs = self.hangs() & self.known
        return self.lasts(hangs[max(span[0] - near, 0) : span[0]]) or self.lasts(
            hangs[span[1] : span[1] + near]
        )

    def lasts(self, hangs: np.ndarray) -> bool:
        """Whether it hangs, in frames (n,) one after the other, for longer than a moment."""
        return any(stop - start > MOMENT * self.fps for start, stop in runs(hangs))

    def too_high(self, low: int, high: int, from_air: bool, into_air: bool) -> np.ndarray:
        """(high - low,) metres by which it is too high in frames low to high - 1, all of them aloft; whether
        it is in the air in the known frames before them, and after them."""
        part, time = slice(low, high), np.arange(low, high)
        over = np.maximum(self.clear[part], 0.0)
        line = np.interp(time, [low - 1, high], self.height[[low - 1, high]])
        rise = float((self.height[part] - line).max())
        flight = self.gravity * max(high - low - 1, 0) ** 2 / 8  # of the frames that it surely lasts
        travels = np.linalg.norm(self.way[high] - self.way[low - 1]) * self.fps / (high - low + 1)
        if rise >= (BESIDE if from_air or into_air else WITHIN) * flight or travels > TRAVELS:
            return np.zeros(high - low)
        falls = []
        if from_air:
            falls.append(self._fall(low - 1, low - 2, time - (low - 1)))
        if into_air:
            falls.append(self._fall(high, high + 1, high - time))
        if not falls and rise >= SOME * flight:
            top = low + int((self.height[part] - line).argmax())
            falls.append(self.height[top] - self.gravity * (time - top) ** 2 / 2)
        for fall in falls:
            over = np.minimum(over, np.maximum(self.height[part] - fall, 0.0))
        return over

    def _fall(self, at: int, beyond: int, time: np.ndarray) -> np.ndarray:
        """How high it is that many frames (n,) after it was in the air at a frame, or before; the one beyond
        tells how fast it rose, if it is known."""
        told = 0 <= beyond < len(self.height) and self.known[beyond]
        rate = self.height[at] - self.height[beyond] if told else 0.0
        return np.asarray(self.height[at] + rate * time - self.gravity * time * (time + 1) / 2)
