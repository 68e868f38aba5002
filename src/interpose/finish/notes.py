"""What a report says of a gap beside its figures: what a person should look at, and what would help."""

from __future__ import annotations

import math

import numpy as np
from scipy import ndimage

from interpose.clip import Clip, Skeleton
from interpose.errors import few
from interpose.finish import anatomy, feet, floor, hanging, jumps, seams
from interpose.finish.windows import grow
from interpose.geometry import measures
from interpose.geometry.time import runs
from interpose.methods import registry
from interpose.methods.bodies import no_humanoid
from interpose.observation import Gap, Observation
from interpose.skeletons import find_humanoid, find_mapping
from interpose.skeletons.body import facing
from interpose.skeletons.carrier import hips_of
from interpose.skeletons.performers import BODY, performers

# A body that moves less than this in the middle of a gap, as a share of the motion around it, is dull: of 119
# pieces of 2 s of the real motion of LAFAN1's validation performer 1 % are.
DULL = 0.33
# A gap in whose frames a body glides this much more often than around it is said to: of 39 pieces of 2 s of
# validation performers' real motion none does; of fills by `linear` 15, `spline` 14, `cmib` 5, `cae` 3 do,
# and by `small` none. Who runs is in the air for a third of the time.
GLIDES, AIRBORNE = 0.25, 0.35
# Seconds of a gap that tell whether it does: of 288 pieces each of .3, .4 and .5 s of real motion 3, 1 and 1
# would be said to.
SHORTEST = 0.3
# Metres a second, with the usual leg, at which a hand stirs against its shoulder on both sides of a gap, and
# seconds of the gap, from which on one that moves half as much in it is said to rest.
STIRRING, RESTING = 0.4, 1.5
# Metres a second, with the usual leg: who is slower walks.
RUNS = 2.0
# Metres, with the usual leg, that joints are expected to be off by in the mean from which a report says so:
# far more than in most gaps of a second.
DOUBT = 0.15
# Seconds that should be known on either side of a gap for a network to fill it well. Errors of validation
# performers are then within 6 % of those with .83 s, in gaps of .67, 1.33 and 2 s (bench context).
BESIDE = 0.1
# Backwards is against the facing by so much of the way; the real motion of LAFAN1's validation
# performer goes so at more than BACK (metres a second) in 1 % of 956 pieces of 2 s, and at more than
# HURRIES times the fastest pace of the seconds around it, or of SLOW (metres a second: who stands may walk
# off), in less than that. EVEN: seconds over which paces are evened out.
BACKWARDS, BACK, HURRIES, SLOW, EVEN = 0.7, 1.6, 2.2, 1.4, 0.1
# Metres below the floor at which a foot, or another joint, is asked about.
SUNK = 0.05
# Feet that slide so many times as much as around a gap, and more than this (centimetres a second, with the
# usual leg), are asked about: of 120 pieces of validation performers' real motion 2.5 % do, and 2.5 % of
# fills, others than these.
SKIDS, SLIDES = 3.0, 15.0
# Between lone keys, and where less than a second is known, feet that slide at so much alone are: half a turn
# between two keys takes 21 cm/s in truth.
UNSEEN = 30.0
# Seconds of a gap from which on it is asked about at all: in shorter ones a foot is where its keys have it.
SLIDING = 0.2
# Metres by which a foot drifts in one stance, and twice as far as around the gap: no real one in 64 pieces of
# LAFAN1's validation performer does, but in 9 % of fills.
DRIFTS = 0.08
# Degrees by which a body turns further than the poses beside a gap say, or less far the other way.
ROUND = 30.0
LEGS = (0.1, 3.0)  # metres of a leg, of dolls and giants
# How notes begin of who goes round once more, and of what is expected to be off.
TURNS, DOUBTS = "flagged: it turns by", "flagged: joints are expected to be off by"


def sunk(finished: Clip, known: Observation, gap: Gap, first: int) -> list[str]:
    """A note where a foot goes through the floor, or else what is lower than all that is known nearby."""
    near, skeleton = round(feet.NEARBY * finished.fps), finished.skeleton
    lo, hi = max(gap.start - near, 0), min(gap.stop + near, len(finished))
    part, seen = finished.slice(lo, hi), known.slice(lo, hi)
    found = [feet.sunk(part, seen, gap.start - lo, gap.stop - lo), _deepest(part, seen, gap.start - lo, gap)]
    for depth, joint, frame in filter(None, found):
        if depth >= SUNK * feet.size(skeleton):
            where = f"{100 * depth:.0f} cm under the floor at frame {first + lo + frame}"
            return [f"flagged: {skeleton.names[joint]} is {where}"]
    return []


def _deepest(part: Clip, seen: Observation, start: int, gap: Gap) -> tuple[float, int, int] | None:
    """By how many metres the deepest joint of a gap that begins at frame `start` is under the floor, which
    joint, and at which frame; None without any. What a foot does `feet.sunk` tells."""
    deep, joints = floor.depth(part, seen)
    free = deep[start : start + len(gap)]
    if not free.size:
        return None
    frame, joint = np.unravel_index(int(free.argmax()), free.shape)
    return float(free[frame, joint]), joints[joint], start + int(frame)


def sized(skeleton: Skeleton) -> list[str]:
    """A note where a body is so large, or so small, that its unit is none of metres."""
    leg = find_mapping(skeleton).leg_length
    if not np.isfinite(leg) or LEGS[0] <= leg <= LEGS[1]:
        return []
    return [f"flagged: its legs are {leg:.3g} m long: is the unit right?"]


def others(skeleton: Skeleton, gap: Gap) -> list[str]:
    """Notes where a gap is one of a body, too, that networks do not fill."""
    return [
        f"the {count} joints of {name} are another body, which no network knows, and interpolated"
        for name, count in (bodies(skeleton).items() if gap.joints is None else ())
    ]


def bodies(skeleton: Skeleton) -> dict[str, int]:
    """What else has many joints in a file, and is no humanoid: by its roots, how many joints."""
    mapping = find_mapping(skeleton)
    mine = {skeleton.ancestors(joint)[-1] for joint in mapping.mapped[1] if skeleton.ancestors(joint)}
    mine.update(joint for joints in performers(skeleton)[1:] for joint in joints)
    counts = {root: int(skeleton.below[:, root].sum()) for root in skeleton.roots if root not in mine}
    return {skeleton.names[root]: n for root, n in counts.items() if n >= BODY and mapping.usable}


def wild(finished: Clip, known: Observation, gap: Gap, first: int) -> list[str]:
    """A note where a joint's velocity jumps by more than in hardly any motion, in a gap beside which nothing
    tells how the motion itself jumps; or beside it, at a lone key."""
    frames = np.arange(max(gap.start - 1, 1), min(gap.stop + 1, len(finished) - 1))
    if not frames.size:
        return []
    size = np.linalg.norm(seams.jumps(finished, known, frames), axis=-1) * finished.fps**2
    row, joint = np.unravel_index(int(size.argmax()), size.shape)
    if size[row, joint] <= jumps.SLACK * jumps.wild(finished.skeleton):
        return []
    where = f"{finished.skeleton.names[joint]} jumps at frame {first + int(frames[row])}"
    said = f"flagged: {where}, by {size[row, joint]:.0f} m/s^2"
    return [said + _helps(finished, gap, ". More frames, or a key near there, help")]


def _helps(finished: Clip, gap: Gap, what: str) -> str:
    """What would help; nothing of what comes next, whose end nobody can key."""
    return "" if gap.stop == len(finished) else what


def gliding(finished: Clip, known: Observation, gap: Gap) -> tuple[float, float | None] | None:
    """The share of a gap's frames in which the body travels, on no foot and in no free flight, and that of
    known frames around it, None where too few are; None for what is too short, has no two legs, or moves
    known ones."""
    fps, skeleton = finished.fps, finished.skeleton
    near = round(feet.NEARBY * fps)
    lo, hi = max(0, gap.start - near), min(len(finished), gap.stop + near)
    pairs, hips = feet.pairs(skeleton), hips_of(skeleton)
    if (
        len(pairs) < 2
        or gap.stop - gap.start < SHORTEST * fps
        or feet.told(finished, known, gap.start, gap.stop)
    ):
        return None
    part, told = finished.slice(lo, hi), known.slice(lo, hi)
    placed, seen = part.positions(), told.positions(skeleton)
    found = measures.glides(placed[:, pairs], placed[:, hips], fps, feet.size(skeleton))
    found &= ~hanging.flies(part, told)
    around = seen[:, [*pairs.ravel(), hips]].all(axis=1)
    usual = float(found[around].mean()) if around.sum() >= fps / 2 else None
    return float(found[gap.start - lo : gap.stop - lo].mean()), usual


def adrift(glide: tuple[float, float | None] | None, finished: Clip, gap: Gap) -> list[str]:
    """A note where a body glides: `glide` as from `gliding`."""
    if glide is None:
        return []
    share, usual = glide
    hips = finished.slice(gap.start, gap.stop).positions()[:, hips_of(finished.skeleton)]
    # Between lone keys its own pace alone tells whether it runs.
    running = measures.speed(hips, finished.fps).mean() > RUNS * feet.size(finished.skeleton)
    if share - (usual if usual is not None else AIRBORNE * running) <= GLIDES:
        return []
    said = f"flagged: it glides: in {100 * share:.0f} % of its frames the body travels and no foot stands"
    return [said if usual is None else f"{said} (around it in {100 * usual:.0f} %)"]


def skids(slide: float | None, finished: Clip, known: Observation, gap: Gap, first: int) -> list[str]:
    """Notes where feet slide (centimetres a second) far more than in the seconds around a gap, and where one
    drifts while it stands."""
    if slide is None:
        return []
    near, said = round(feet.NEARBY * finished.fps), []
    lo, hi = max(gap.start - near, 0), min(gap.stop + near, len(finished))
    part, seen = finished.slice(lo, hi), known.slice(lo, hi)
    whole = runs(seen.frames)
    slid = feet.measure_all(part, seen, [(a + 1, b - 1) for a, b in whole if b - a > near // 2])
    most = max((one for one, _ in slid), default=None)
    if skidding(slide, most, finished.skeleton) and len(gap) >= SLIDING * finished.fps:
        around = f", around the gap at {most:.0f} at most" if most is not None else ""
        said.append(f"flagged: feet slide at {slide:.0f} cm/s{around}")
    (way, joint, start, stop), *usual = feet.drifts(part, seen, [(gap.start - lo, gap.stop - lo), *whole])
    if way > max(DRIFTS * feet.size(finished.skeleton), 2 * max((one for one, *_ in usual), default=0.0)):
        name, frames = finished.skeleton.names[joint], f"{first + lo + start} to {first + lo + stop - 1}"
        said.append(f"flagged: {name} slides by {100 * way:.0f} cm while it stands, in frames {frames}")
    return said


def skidding(slide: float, around: float | None, skeleton: Skeleton) -> bool:
    """Whether feet slide far more, in centimetres a second, than they do `around`, if that is known."""
    least = feet.size(skeleton) * (SLIDES if around is not None else UNSEEN)
    return slide > max(SKIDS * (around or 0.0), least)


def hasty(finished: Clip, known: Observation, gap: Gap, first: int) -> list[str]:
    """A note where a body goes backwards, or much faster than around the gap, as nobody would: there is too
    little time for its way, or the end of it lies behind."""
    fps, size = finished.fps, feet.size(finished.skeleton)
    near = round(feet.NEARBY * fps)
    lo, hi = max(0, gap.start - near), min(len(finished), gap.stop + near)
    part = finished.slice(lo, hi)
    body = find_humanoid(part)
    if gap.joints is not None or not body.mapping.usable or hi - lo < 3:
        return []
    placed = body.positions(part)
    way = np.gradient(placed[:, 0], axis=0)[:, [0, 2]] * fps / size
    way = ndimage.gaussian_filter1d(way, EVEN * fps, axis=0, mode="nearest")
    pace = np.linalg.norm(way, axis=1)
    course = facing(placed)
    ahead = way[:, 0] * np.sin(course) + way[:, 1] * np.cos(course)
    back = np.where(ahead < -BACKWARDS * pace, pace, 0.0)
    inside = slice(gap.start - lo, gap.stop - lo)
    # Evened out, the frames beside the gap go half as it does.
    beside = grow(
        (np.arange(hi - lo) >= inside.start) & (np.arange(hi - lo) < inside.stop), round(3 * EVEN * fps)
    )
    seen = known.frames[lo:hi] & ~beside
    frame = inside.start + int(back[inside].argmax())
    if back[frame] > max(BACK, 1.2 * float(back[seen].max(initial=0.0))):
        said = (
            f"flagged: it goes backwards at up to {back[frame] * size:.1f} m/s (frame {first + lo + frame})"
        )
        return [said + _helps(finished, gap, ": more frames, or a key in which it has turned, help")]
    fastest, seen_pace = float(pace[inside].max()), float(pace[seen].max(initial=0.0))
    ends = gap.start == 0 or gap.stop == len(finished)
    if ends and (own := np.delete(placed[:, 0], np.r_[inside], axis=0)).shape[0] > 1:
        # What goes on at an end of the clip does so at the pace of the frames beside it.
        alone = ndimage.gaussian_filter1d(
            np.gradient(own, axis=0)[:, [0, 2]] * fps / size, EVEN * fps, axis=0, mode="nearest"
        )
        seen_pace = float(np.linalg.norm(alone, axis=1).max())
    mean = float(pace[inside].mean())
    told = seen.sum() >= fps / 2  # else keys are alone, and nobody goes around them
    usual = max(seen_pace if told else mean, SLOW)
    if fastest <= HURRIES * usual:
        return []
    said = f"flagged: it hurries: up to {fastest * size:.1f} m/s"
    said += f", where the motion around it goes at {seen_pace * size:.1f}" if told else ""
    if ends:
        return [said]
    if mean > HURRIES * usual / 2:
        return [f"{said}. With about {math.ceil(len(gap) * mean / usual)} frames it would not"]
    evenly = f", though it would take {mean * size:.1f} m/s to get there evenly"
    return [said + evenly + _helps(finished, gap, ". A key on its way says where it is by then")]


def whirling(finished: Clip, known: Observation, gap: Gap, first: int) -> list[str]:
    """A note where a joint turns faster than any does, or the body goes round once more than the poses beside
    a gap say."""
    near = round(feet.NEARBY * finished.fps)
    lo, hi = max(0, gap.start - near), min(gap.stop + near, len(finished))
    part, seen = finished.slice(lo, hi), known.slice(lo, hi)
    if found := anatomy.whirl(part, seen, gap.start - lo, gap.stop - lo):
        name = finished.skeleton.names[found.joint]
        usual = f", around the gap by {found.usual:.0f} at most" if found.usual else ""
        where = f"at frame {first + lo + found.frame}{usual}"
        said = f"flagged: {name} turns by {found.rate:.0f} degrees a second {where}"
        return [said + _helps(finished, gap, ": more frames, or a key there, help")]
    ends = gap.start - 1 - lo, gap.stop - lo
    if gap.joints is not None or ends[0] < 0 or ends[1] >= len(part):
        return []
    turned = np.degrees(anatomy.turning(part))
    way = float(turned[ends[1]] - turned[ends[0]])
    short = (way + 180) % 360 - 180
    # Half a turn is as far to the one side as to the other.
    if abs(way - short) < 180 or abs(abs(way) - abs(short)) < ROUND:
        return []
    left = way * find_humanoid(part).hand[0] > 0 if find_mapping(part.skeleton).usable else way > 0
    said = f"{TURNS} {abs(way):.0f} degrees to the {'left' if left else 'right'}"
    other = "" if way * short > 0 else " the other way"
    return [
        f"{said}, where the poses beside the gap are {abs(short):.0f} apart{other}: a key in between says "
        "which is meant"
    ]


def liveliness(finished: Clip, gap: Gap) -> float | None:
    """`measures.liveliness` of a gap."""
    second, hips = round(finished.fps), hips_of(finished.skeleton)
    lo, hi = max(0, gap.start - second), min(len(finished), gap.stop + second)
    # Without roots above the hips, which may stay where they are.
    body = np.flatnonzero(finished.skeleton.below[:, hips])
    placed = finished.slice(lo, hi).positions()[:, body]
    return measures.liveliness(placed, gap.start - lo, gap.stop - lo, finished.fps)


def dull(alive: float | None, gap: Gap, first: int, ahead: bool, method: str) -> list[str]:
    """A note where a body hardly moves: `alive` as from `liveliness`. What is `ahead` has no end to key."""
    if alive is None or alive >= DULL:
        return []
    if ahead:
        said = f"flagged: most of it moves {100 * alive:.0f} % as much as the motion before it"
        return [said if method.startswith("stmi-gan") else f"{said}: a mean of many possible motions"]
    return [
        f"flagged: the middle moves {100 * alive:.0f} % as much as the motion around it: a mean of many "
        f"possible motions. A key near frame {first + (gap.start + gap.stop) // 2} says which one is meant"
    ]


def idle(finished: Clip, known: Observation, gap: Gap, first: int) -> list[str]:
    """Notes of hands that stir on both sides of a long gap, where they are known, and rest in it."""
    fps, near, found = finished.fps, round(finished.fps), []
    if gap.joints is not None or len(gap) < RESTING * fps:
        return []
    mapping, placed = find_mapping(finished.skeleton), finished.positions()
    sides = slice(max(gap.start - near, 0), gap.start), slice(gap.stop, gap.stop + near)
    seen = known.positions(finished.skeleton)
    for side in ("Left", "Right"):
        arm, hand = mapping[f"{side}Arm"], mapping[f"{side}Hand"]
        if arm is None or hand is None:
            continue
        told = [seen[part][:, [arm, hand]] for part in sides]
        if not all(len(part) >= max(near / 2, 2) and part.all() for part in told):
            continue
        way = placed[:, hand] - placed[:, arm]
        before, inside, after = (
            float(np.linalg.norm(np.diff(part, axis=0), axis=1).mean()) * fps
            for part in (way[sides[0]], way[gap.start : gap.stop], way[sides[1]])
        )
        if min(before, after) > STIRRING * feet.size(finished.skeleton) and inside < min(before, after) / 2:
            said = f"flagged: {finished.skeleton.names[hand]} moves at {inside:.1f} m/s in it, beside it at"
            middle = first + (gap.start + gap.stop) // 2
            found.append(f"{said} {before:.1f} and {after:.1f}. A key near frame {middle} says what it does")
    return found


def doubtful(risk: np.ndarray | None, finished: Clip, gap: Gap, first: int) -> list[str]:
    """A note where joints are expected to be far off: `risk` is metres by frame of the gap."""
    if risk is None or risk.mean() <= DOUBT * feet.size(finished.skeleton):
        return []
    off = f"{100 * risk.mean():.0f} cm"
    said = f"{DOUBTS} {off}: nothing tells what happens here"
    worst = first + gap.start + int(risk.argmax())
    return [said + _helps(finished, gap, f". A key near frame {worst} helps")]


def never(known: Observation, gap: Gap, names: tuple[str, ...]) -> list[str]:
    """The joints of a gap of which nothing is known at any frame."""
    return [name for name in gap.joints or () if not known.rotation[:, names.index(name)].any()]


def rests(joints: list[str], method: str, skeleton: Skeleton) -> list[str]:
    """A note where nothing of some joints is `never` known; of a body, which method would know more."""
    if not joints:
        return []
    others = [] if no_humanoid(find_mapping(skeleton)) else registry.usable(("base", "small", "small-open"))
    tells = f". The method {others[0]} tells it from the other joints" if others else ""
    said = (
        f"flagged: nothing of {few(joints)} is known at any frame, and {method} has only the rest pose to say"
    )
    return [said + tells]


def scant(known: Observation, gap: Gap, fps: float) -> list[str]:
    """A note of a gap of the whole pose beside which too little is known for a network.

    Nothing where a side has a single frame, which is a key, or none at all; nor of short gaps.
    """
    # Of most joints: a joint that is missing all the time, or a part laid into a gap, makes no difference.
    holes = [(0, 0), *runs(known.rotation.mean(axis=1) < 0.5), (len(known.rotation),) * 2]
    at = next(i for i, (start, stop) in enumerate(holes) if start <= gap.start < stop)
    before, after = holes[at][0] - holes[at - 1][1], holes[at + 1][0] - holes[at][1]
    length = holes[at][1] - holes[at][0]
    enough = math.ceil(BESIDE * fps)
    if length <= enough or not 2 <= min(before, after) < enough:
        return []
    few = [f"{n} frames {side} it" for n, side in ((before, "before"), (after, "after")) if n < enough]
    return [
        f"only {' and '.join(few)} are known, and a gap of {length} needs {enough} on either side to be "
        "filled well: leave more around it, or give a key inside of it"
    ]
