"""Holes of any length in a motion, completed window by window."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from interpose.geometry.time import runs
from interpose.methods import weights
from interpose.methods.base.graph import Answer, Seen, agreed, ask
from interpose.methods.base.leading import BLOCK, at_pace, eased, led, steady, steady_pace, strays, told
from interpose.skeletons import FEET

CONTEXT = 10  # frames on both sides of a hole that are seen, as in training
# Frames that a window completes of a hole of the whole pose, and that the last one does between known sides:
# what is further away from known frames is a mean of all that may happen, and a body that hardly moves. Of 23
# gaps of LAFAN1's validation performer the middle moves 75, 45 and 34 % as much as the motion around it when
# all is said at once (80, 120 and 180 frames), and 92, 80 and 81 % so; joints are off by 11.6, 26 and 63 cm
# instead of 12.2, 25 and 72. Forecasts move 70, 31, 25 and 21 % as much as the truth in their first seconds
# when 60 frames are said at once, and 75, 56, 55 and 51 % so, and are off by 12.5, 60, 132 and 197 cm instead
# of 12.4, 57, 117 and 167: another motion, where nobody knows which, and no mean. Between lone keys 60 frames
# apart bodies glide in 8 % of the frames when all is said at once, and in 4 % so (people in 3).
STEP, MEET = 10, 30
# What it expects to be off by, in metres and in the mean, up to which it says all that is left of a hole of
# the whole pose at once, between known sides: there is little else that may happen. Of 60 windows of
# Bandai-Namco's validation performers gaps of 2 and 3 s are off by 1.8 and 2.2 cm so, by 2.0 and 2.8 when
# said in turn throughout; LAFAN1's, in which it is seldom as sure, by as much as ever.
SURE = 0.04
# What it has said itself of the whole pose, further than so many frames from what is known, counts as known
# to this share: taken for true, what is a mean by then leads to a mean that moves even less. In the third and
# fourth second of forecasts of LAFAN1's validation performer `small` moves 39 and 35 % as much as the truth
# so, and 29 and 24 % where all counts; in the middle of gaps of six seconds 87 and 95 % instead of 70 and 80.
# Feet travel 3.6 and 5.3 m instead of 3.1 and 5.0 (truth 3.6 and 5.5), and joints are off by 104 and 53 cm
# instead of 105 and 52.
FIRM, GUESSED = 30, 0.75


def run_long(cards: Sequence[weights.Card], motion: Seen) -> Answer:
    """Run the graphs on a motion of any length, hole by hole.

    A hole is seen with what is around it, as far as the network can see. What a window completes is taken as
    known from then on: of single joints half of what it sees, of the whole pose STEP frames, between known
    frames from both sides in turn, unless it is SURE of all that is left, and more than FIRM frames from
    these to the share GUESSED. What it says of feet and errors it also says of the known frames around; far
    from any hole nothing does (NaN).
    """
    local, root, known = motion.local.copy(), motion.root.copy(), motion.known.astype(float)
    motion, frames = replace(motion, local=local, root=root, known=known), len(root)
    done = Answer(local, root, np.full((frames, len(FEET)), np.nan), np.full(frames, np.nan))
    for begin, end in runs(np.logical_not(motion.known.all(axis=1))):
        _complete_hole(cards, motion, done, begin, end)
    return done


def _complete_hole(cards: Sequence[weights.Card], motion: Seen, done: Answer, begin: int, end: int) -> None:
    """Complete the frames begin to end - 1 of a motion, window by window.

    motion: becomes known there; `done` has its rotations and places, and is told of feet and errors.
    """
    frames, sight = len(motion.root), cards[0].max_gap
    closed = begin > 0 and end < frames
    known = motion.known[begin:end, motion.has]
    whole = not known.any()
    step, last_step = steps(known, closed, sight)
    in_turn, sure = closed and whole, np.ones(frames)
    if whole:
        near, far = begin + FIRM * (begin > 0), end - FIRM * (end < frames)
        sure[near : max(near, far)] = GUESSED
    astray, backwards = in_turn and strays(motion, begin, end, sight + 2 * STEP), begin == 0 and end < frames
    leads = in_turn and told(motion, begin, end)
    if leads:
        sure[:] = 1.0  # it is said where it goes: it does not come to rest
    fastest = None
    if whole and not closed:
        fastest = steady_pace(motion.root[end:][::-1] if backwards else motion.root[:begin])
    # A body whose hips are known gets nowhere: limbs that hang from it are off by no more and more. One that
    # is led gets nowhere else, but out of step.
    held = bool(motion.known[begin:end, [0, -1]].all())
    errors = _Errors(done.expected, closed, np.maximum if held else np.hypot if leads else np.add)
    hole = begin, end
    while begin < end:
        first, last = max(begin - CONTEXT, 0), min(end + CONTEXT, frames)
        if end - begin > sight:
            first, last = (end - sight, last) if backwards else (first, begin + sight)
        # The first window that sees all that is left tells the errors of all of it.
        sees_all = end - begin <= sight
        part, ahead = slice(first, last), slice(max(begin - first, 0), end - first)
        inside = slice(begin, end)
        if end - begin > last_step:
            inside = slice(end - step, end) if backwards else slice(begin, begin + step)
        own = slice(inside.start - first, inside.stop - first)
        each = ask(cards, (led(motion, begin, end) if leads else motion).part(part), own)
        said = agreed(each, own)
        if in_turn and sees_all and said.expected[ahead].mean() <= SURE:
            inside, own = slice(begin, end), ahead
            said = agreed(each, own)
        for held_back, new in ((done.stands, said.stands), (done.expected, said.expected)):
            held_back[part] = np.where(np.isnan(held_back[part]), new, held_back[part])
        if closed or not whole:
            errors.tell(said.expected, first, slice(begin, end) if sees_all else inside, backwards, sees_all)
        if whole and not leads and not (closed and sees_all):
            errors.open(said.expected[ahead], hole, backwards)
        if astray and not leads and not sees_all:
            said = agreed(ask(cards, led(motion, begin, end).part(part), own), own)
        if fastest is not None:
            beside = motion.root[end : end + BLOCK][::-1] if backwards else motion.root[begin - BLOCK : begin]
            said = at_pace(said, own, beside, fastest, backwards)
        if leads:
            said = replace(said, root=eased(said.root, own, motion, inside))
        _take(motion, inside, said, own, sure[inside])
        done.stands[inside] = said.stands[own]
        begin, end = (begin, inside.start) if backwards else (inside.stop, end)
        backwards = backwards != in_turn
    if leads or astray:
        steady(motion.root, *hole)


def steps(known: np.ndarray, closed: bool, sight: int) -> tuple[int, int]:
    """How many frames of a hole each window completes, and how many the last one may: half of what the
    network can see where something is known in the hole, else as STEP and MEET say.

    known: (n, 23) or fewer, what is known in the hole; `closed` between known frames.
    """
    if known.any():
        return max(sight // 2, 1), sight
    return STEP, MEET if closed else STEP


def _take(motion: Seen, inside: slice, said: Answer, own: slice, sure: np.ndarray) -> None:
    """Take what is said, in its frames `own`, of the frames `inside` of a motion as known, to the shares
    `sure` (n,)."""
    held = motion.known[inside] >= 1
    motion.local[inside] = np.where(held[:, :-1, None], motion.local[inside], said.local[own])
    motion.root[inside] = np.where(held[:, -1:], motion.root[inside], said.root[own])
    motion.known[inside] = np.where(held, 1.0, sure[:, None])


@dataclass
class _Errors:
    """The errors that are expected in a hole. What the frames are off by that a window starts from goes on
    in what it completes, and wears off towards what is known, if both sides are (`closed`).

    Attributes:
        expected: (F,) metres, of the whole motion.
        together: of two errors what both make.
        carried: what the frames at both ends of what is left are expected to be off by themselves.
        told: whether all of it has been told.
        sides: what the first window from either side says that does not see the other one.
    """

    expected: np.ndarray
    closed: bool
    together: np.ufunc
    carried: list[float] = field(default_factory=lambda: [0.0, 0.0])
    told: bool = False
    sides: dict[bool, np.ndarray] = field(default_factory=dict)

    def open(self, said: np.ndarray, hole: tuple[int, int], backwards: bool) -> None:
        """Note what the first window says that sees one side of a hole, from there on as far as it sees. What
        is further away is off by as much more: later windows start from what is a guess by then. Between
        two sides the nearer one, in effect, tells."""
        if self.told or backwards in self.sides:
            return
        begin, end = hole
        seen, frames = said[::-1] if backwards else said, np.arange(end - begin)
        wrong = np.concatenate([seen, seen[-1:] * (frames[len(seen) :] + 1) / max(len(seen), 1)])
        self.sides[backwards] = wrong[::-1] if backwards else wrong
        self.told = len(self.sides) == 1 + self.closed
        if self.told:
            self.expected[begin:end] = np.min([*self.sides.values()], axis=0)

    def tell(self, said: np.ndarray, first: int, over: slice, backwards: bool, all_left: bool) -> None:
        """Note what a window from frame `first` on says of the frames `over`, which may be `all_left`; it
        goes on from the beginning of the hole, or `backwards` from its end."""
        if self.told:
            return
        self.told = all_left
        near, far = self.carried if all_left and self.closed else [self.carried[backwards]] * 2
        wearing = np.linspace(near, far, over.stop - over.start)
        own = said[over.start - first : over.stop - first]
        self.expected[over] = self.together(own, wearing)
        self.carried[backwards] = float(self.expected[over][0 if backwards else -1])
