"""What a graph says of one window of a motion, and of its mirror image; the mean of several."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial, reduce

import numpy as np

from interpose.geometry import kinematics, rotations
from interpose.methods import weights
from interpose.skeletons import ACROSS, ACROSS_TURN, FEET, JOINTS, PARENTS, SIDES

FEET_ACROSS = [FEET.index(SIDES[foot]) for foot in FEET]
AGREE = np.pi / 2  # how far a motion and its mirror image may be apart, in any joint
# Degrees a second by which joints turn against the one above in all but one frame of ten thousand (84,000 of
# LAFAN1's and Bandai-Namco's training and validation performers): what turns faster snaps. And the share of
# the one's haste below which the other of two answers is calmer.
HASTE = {"Hips": 500, "Spine": 150, "Spine1": 200, "Spine2": 220, "Neck": 520, "Head": 560}
HASTE |= {"Shoulder": 400, "Arm": 1250, "ForeArm": 1060, "Hand": 2000}
HASTE |= {"UpLeg": 800, "Leg": 1000, "Foot": 1200, "Toe": 900}
FASTEST = np.radians([HASTE[name.removeprefix("Left").removeprefix("Right")] for name in JOINTS]) / 30.0
CALMER = 0.8
ROUGHLY = 0.5  # how far what is said to be roughly so counts as known
# What weights count for that are asked beside others: `small` had far more steps for lost joints than `base`.
# On 16 windows of validation performers halves are 1 % worse there, and 1 % better in gaps of the whole pose;
# `small` alone is 1 to 5 % worse in these.
BESIDE = 2 / 3


@dataclass
class Seen:
    """What the network is given of a motion at 30 fps.

    Attributes:
        local: (T, 22, 4) canonical rotations relative to the parent's.
        root: (T, 3) metres, the hips.
        known: (T, 23) how far each is known: 0 not at all, 1 exactly.
        has: (23,) which of these the skeleton has; others count as known.
        actions: what it is told to be, and what the mirror image is; "" for nothing.
        bones: (22, 3) metres.
        places: (T, 22, 3) metres, where joints are to be.
        pins: (T, 22) of which joints that is said.
        way, faces: (T, 3) metres and (T, 4), where the hips go and how they are turned, roughly; NaN where
            that is not said.
    """

    local: np.ndarray
    root: np.ndarray
    known: np.ndarray
    has: np.ndarray
    actions: tuple[str, str]
    bones: np.ndarray
    places: np.ndarray
    pins: np.ndarray
    way: np.ndarray
    faces: np.ndarray

    def part(self, frames: slice) -> Seen:
        """Of some frames."""
        names = ("local", "root", "known", "places", "pins", "way", "faces")
        return replace(self, **{name: getattr(self, name)[frames] for name in names})

    def backwards(self) -> Seen:
        """From its end to its beginning."""
        return self.part(slice(None, None, -1))

    def mirrored(self) -> Seen:
        """The mirror image."""
        sides, across = list(SIDES), ACROSS.values
        return Seen(
            self.local[:, sides] * ACROSS_TURN.values,
            self.root * across,
            self.known[:, [*sides, len(sides)]],
            self.has[[*sides, len(sides)]],
            self.actions[::-1],
            self.bones[sides] * across,
            self.places[:, sides] * across,
            self.pins[:, sides],
            self.way * across,
            self.faces * ACROSS_TURN.values,
        )


@dataclass
class Answer:
    """What the network says of a motion at 30 fps.

    Attributes:
        local: (T, 22, 4) canonical rotations relative to the parent's; float64.
        root: (T, 3) metres, the hips.
        stands: (T, 4) how likely ankles and toes stand, 0 to 1, or NaN.
        expected: (T,) metres that joints are expected to be off, or NaN.
    """

    local: np.ndarray
    root: np.ndarray
    stands: np.ndarray
    expected: np.ndarray

    def backwards(self) -> Answer:
        """From its end to its beginning."""
        return Answer(self.local[::-1], self.root[::-1], self.stands[::-1], self.expected[::-1])


def run(card: weights.Card, *motions: Seen) -> list[Answer]:
    """Run the graph of some weights on motions of one length."""
    # Far from the origin float32 would lose millimetres.
    origins = [one.root[np.argmax(one.known[:, -1])] * [1.0, 0.0, 1.0] for one in motions]
    feeds = [
        {
            "local": np.where(one.known[:, :-1, None] > 0, one.local, [1.0, 0.0, 0.0, 0.0]),
            "root": np.where(one.known[:, -1:] > 0, one.root - origin, 0.0),
            "known": one.known,
            "pinned": np.where(one.pins[..., None], one.places - origin, 0.0),
            "bones": one.bones,
        }
        for one, origin in zip(motions, origins)
    ]
    feed = {name: np.stack([one[name] for one in feeds]).astype(np.float32) for name in feeds[0]}
    feed["pins"] = np.stack([one.pins for one in motions])
    told = [one.actions[0] for one in motions]
    feed["label"] = np.array([card.labels.index(action) if action in card.labels else 0 for action in told])
    session = weights.session(card.onnx, weights.cores())
    said = session.run(["local_out", "root_out", "contact", "error"], feed)
    return [
        Answer(rotations.normalize(turned), placed + origin, stands, off / 100)
        for turned, placed, stands, off, origin in zip(*(out.astype(float) for out in said), origins)
    ]


def run_both(card: weights.Card, motion: Seen) -> tuple[Answer, Answer]:
    """What the graph says of a motion, and what it says of the mirror image: in the mean of both the mirror
    image of a clip is completed as the mirror image of what the clip is, and errors are 2 to 4 % smaller."""
    said, image = run(card, motion, motion.mirrored())
    sides, across = list(SIDES), ACROSS.values
    turned = image.local[:, sides] * ACROSS_TURN.values
    return said, Answer(turned, image.root * across, image.stands[:, FEET_ACROSS], image.expected)


def ask(cards: Sequence[weights.Card], motion: Seen, own: slice) -> list[tuple[Answer, Answer]]:
    """What each graph says of a motion and of its mirror image, for the sake of its frames `own`.

    They have learned how motion goes on, not how it came about: where only what follows is known it goes
    backwards, which errs by a third less in gaps of a second.
    """
    known = np.asarray((motion.known > ROUGHLY).all(axis=1))
    if known[: own.start].any() or not known[own.stop :].any():
        return [run_both(card, motion) for card in cards]
    said = [run_both(card, motion.backwards()) for card in cards]
    return [(one.backwards(), image.backwards()) for one, image in said]


def agreed(said: Sequence[tuple[Answer, Answer]], own: slice) -> Answer:
    """The mean of all that is said of frames `own`."""
    first, *others = (mean(*both, own) for both in said)
    return reduce(partial(mean, own=own, share=BESIDE), others, first)


def mean(one: Answer, other: Answer, own: slice, share: float = 0.5) -> Answer:
    """Of two answers, to a `share` of the other. Where they disagree by more than a right angle it would be
    neither: then the one counts that expects to err less. Where one of them snaps as nobody does, and the
    other does less, the other counts."""
    wild = haste(one, own), haste(other, own)
    if max(wild) > 1.0 and min(wild) < CALMER * max(wild):
        return one if wild[0] < wild[1] else other
    apart = rotations.angle(*(kinematics.global_rotations(said.local, PARENTS) for said in (one, other)))
    if apart.max(initial=0.0) > AGREE:
        return min(one, other, key=lambda said: float(said.expected.mean()))
    return Answer(
        rotations.normalize((1 - share) * one.local + share * rotations.alike(other.local, one.local)),
        *(a + share * (b - a) for a, b in zip(*((x.root, x.stands, x.expected) for x in (one, other)))),
    )


def haste(said: Answer, own: slice) -> float:
    """How fast the joint turns that does so most, in frames `own` and to those beside, by what joints do:
    beyond 1 it snaps."""
    local = said.local[max(own.start - 1, 0) : own.stop + 1]
    return float((rotations.angle(local[1:], local[:-1]) / FASTEST).max(initial=0.0))
