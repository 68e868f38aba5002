"""Pins: joints that are to be at a place, or to be turned, at some frames of a gap.

The motion is changed as little as that takes: what a pin is off by comes and goes smoothly between the frames
around it, and all joints that are free share it, feet and the other pins last.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from itertools import chain, repeat

import numpy as np
import scipy

from interpose.clip import Clip, Skeleton, numbers
from interpose.errors import RequestError, is_number
from interpose.finish import feet
from interpose.finish.hinges import Hinges
from interpose.finish.solve import BLOCK, Axes, Bounds, refine, refine_steadily
from interpose.finish.windows import envelope, ramp, spread
from interpose.geometry import rotations
from interpose.geometry.ground import FLOOR
from interpose.geometry.time import runs
from interpose.methods.bodies import no_humanoid
from interpose.observation import Observation, Pin
from interpose.skeletons import PARENTS, find_mapping
from interpose.skeletons.mapping import TRUNK

# How much the place of every other joint counts beside a pin, round by round: first all give way together,
# then the pins alone decide; and how many times more those of feet do.
SHARES, FEET = (3e-2, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6), 30.0
# How many square metres a radian counts, beside another joint's place, by which a knee or an elbow turns
# otherwise than it bends: thighs and upper arms turn instead. From 1 on elbows jump that a hand brings near.
HINGED = 0.3
# Radians by which a joint that is known to be turned is turned otherwise than a pin says.
TURNED = 0.01
# Of how a pinned hand turns about its forearm, or a pinned head in all, the share that forearm or neck does.
ALSO = 0.5
# Radians by which hips are turned while feet stay where they are; beyond, they go along.
FEET_TURN = np.radians(60.0)
# Seconds over which a joint slows down to a place that it is to hold while the body goes on.
LEAD = 0.3
# Metres over the floor by which a trunk is pinned elsewhere from which on the whole body goes along, and by
# twice as much all the way: below, its feet stay where they stand.
ALONG = 0.3
# Metres that a pin is approached by in a round, and the shortest such step; what counts as nearer; and rounds
# after those at most.
STEP, SHORT, STILL, ROUNDS = 0.25, 0.005, 1e-6, 40
# Rounds in which all frames together come to where they are wanted: longer steps where it is further.
AT_MOST = 20
# How much second differences of what is done count, squared, against metres squared, where all frames are
# solved together; and up to how many frames are.
STEADY, TOGETHER = 1.0, 2000


def asked(clip: Clip, observation: Observation, first: int = 0) -> tuple[Pin, ...]:
    """What pins ask for, `merged`: a joint that is held over a key is known there, as it is to be.

    `first` is the number by which errors call the first frame.

    Raises RequestError for pins of joints or frames that are not there, of values that are known and other
    ones, or that say nothing.
    """
    found: list[Pin] = []
    placed = observation.positions(clip.skeleton)
    turned = _turned(clip.skeleton, observation)
    for pin in observation.pins:
        joint, frames = clip.skeleton.index(pin.joint), np.asarray(pin.frames)
        if frames.ndim != 1 or frames.size == 0 or frames.dtype.kind not in "iu":
            raise RequestError(
                f"the pin of {pin.joint} does not fit",
                "its frames must be a list of whole numbers, one or more",
                f'Write Pin("{pin.joint}", [130], [[0.3, 1.4, 0.2]]).',
            )
        if not (is_number(pin.tolerance) and pin.tolerance > 0):
            raise RequestError(
                f"the pin of {pin.joint} does not fit",
                f"its tolerance must be above zero, and is {pin.tolerance}",
                "It is how far the joint may miss, in metres.",
            )
        if pin.position is None and pin.orientation is None:
            raise RequestError(
                f"the pin of {pin.joint} says nothing",
                "it has neither a position nor an orientation",
                "Give one of them, a row for each frame.",
            )
        for value, width in ((pin.position, 3), (pin.orientation, 4)):
            rows = None if value is None else numbers(value, f"the pin of {pin.joint}")
            if rows is not None and not (rows.shape == (len(frames), width) and np.isfinite(rows).all()):
                raise RequestError(
                    f"the pin of {pin.joint} does not fit",
                    f"{len(frames)} frames need as many rows of {width} finite numbers",
                    "Positions are x, y, z in metres, orientations quaternions w, x, y, z.",
                )
        outside = (frames < 0) | (frames >= len(clip))
        if outside.any():
            raise RequestError(
                f"there is no frame {first + frames[outside][0]} for the pin of {pin.joint}",
                f"the clip has {len(clip)} frames, counted from {first}",
                "Pin frames inside of a gap.",
            )
        if pin.orientation is not None and np.linalg.norm(pin.orientation, axis=1).min() < 1e-6:
            raise RequestError(
                f"the pin of {pin.joint} does not fit",
                "a quaternion of it is zero",
                "No turn is 1, 0, 0, 0.",
            )
        # It is the joint itself that turns: where it is to is known only if all above it is.
        known = {"position": placed, "orientation": turned | observation.rotation}
        tells = {"position": placed, "orientation": turned}
        here = clip.take(frames).kinematics()
        for kind, seen in known.items():
            if (values := getattr(pin, kind)) is None:
                continue
            told = seen[frames, joint]
            if kind == "position":
                other = np.linalg.norm(here[1][:, joint] - values, axis=1) > pin.tolerance
            else:
                other = rotations.angle(here[0][:, joint], rotations.normalize(np.asarray(values))) > TURNED
            if (wrong := told & (other | ~tells[kind][frames, joint])).any():
                raise RequestError(
                    f"{pin.joint} cannot be pinned at frame {first + frames[wrong][0]}",
                    "where it is, or how it is turned, follows from what is observed, which comes back "
                    "unchanged",
                    "Pin frames inside of a gap, of joints that are missing in it or hang on one that is.",
                )
            if not told.all():
                rows = np.asarray(values)[~told]
                found.append(Pin(pin.joint, frames[~told], tolerance=pin.tolerance, **{kind: rows}))
    places: dict[tuple[str, int], np.ndarray] = {}
    turns: dict[tuple[str, int], np.ndarray] = {}
    for pin in observation.pins:
        for frame, turn in zip(pin.frames, () if pin.orientation is None else pin.orientation):
            other = turns.setdefault((pin.joint, int(frame)), np.asarray(turn))
            if (
                angle := float(rotations.angle(*map(rotations.normalize, (np.asarray(turn), other))))
            ) > TURNED:
                raise RequestError(
                    f"{pin.joint} is pinned to two turns at frame {first + frame}",
                    f"they are {np.degrees(angle):.0f} degrees apart, and it can be turned by one of them",
                    "Leave one of the pins out.",
                )
        for frame, place in zip(pin.frames, () if pin.position is None else pin.position):
            other = places.setdefault((pin.joint, int(frame)), np.asarray(place))
            if (apart := float(np.linalg.norm(place - other))) > pin.tolerance:
                raise RequestError(
                    f"{pin.joint} is pinned to two places at frame {first + frame}",
                    f"they are {100 * apart:.1f} cm apart, and it can be at one of them",
                    "Leave one of the pins out.",
                )
    return merged(found)


def merged(pins: Iterable[Pin]) -> tuple[Pin, ...]:
    """A pin of places, and one of orientations, for each joint; of a frame that is pinned twice the last."""
    found: dict[tuple[str, str], tuple[dict[int, np.ndarray], float]] = {}
    for pin in pins:
        for kind in ("position", "orientation"):
            if (values := getattr(pin, kind)) is not None:
                rows, tolerance = found.get((pin.joint, kind), ({}, np.inf))
                rows |= {int(frame): np.asarray(value) for frame, value in zip(pin.frames, values)}
                found[pin.joint, kind] = (rows, min(tolerance, pin.tolerance))
    return tuple(
        Pin(
            joint,
            np.array(sorted(rows)),
            tolerance=least,
            **{kind: np.array([rows[f] for f in sorted(rows)])},
        )
        for (joint, kind), (rows, least) in found.items()
    )


def meet(
    clip: Clip,
    known: Observation,
    pins: tuple[Pin, ...],
    down: np.ndarray | None = None,
    axes: Axes | None = None,
) -> Clip:
    """The clip with its pins met, as far as its bones reach.

    Args:
        clip: (F) complete.
        known: what may not be changed.
        pins: as `asked`.
        down: (F, n) metres by which `feet.ends` are to be lower, as far as pins are met nevertheless.
        axes: those about which some joints turn alone, as `formats.axes`.
    """
    if down is None:
        down = np.zeros((len(clip), len(feet.ends(clip.skeleton))))
    for (start, stop), (lo, hi), edges in _gaps(known):
        if some := [one for pin in pins if len((one := pin.slice(lo, hi)).frames)]:
            part = _meet(clip.slice(lo, hi), known.slice(lo, hi), some, edges, down[lo:hi], axes)
            rotation, translation = clip.rotation.copy(), clip.translation.copy()
            rotation[start:stop] = part.rotation[start - lo : stop - lo]
            translation[start:stop] = part.translation[start - lo : stop - lo]
            clip = clip.with_motion(rotation, translation)
    return clip


def ways(clip: Clip, known: Observation, pins: tuple[Pin, ...]) -> tuple[Pin, ...]:
    """Pins at all frames of the gaps in which there are some: the ways of the clip's joints by their places.

    Arguments as in `meet`.
    """
    placed, found = clip.positions(), []
    for pin in (pin for pin in pins if pin.position is not None):
        joint = clip.skeleton.index(pin.joint)
        for (start, stop), (lo, hi), edges in _gaps(known):
            if len((one := pin.slice(lo, hi)).frames):
                way = placed[lo:hi, joint]
                way = way + _between(hi - lo, one.frames, one.position - way[one.frames], edges, clip.fps)
                found.append(Pin(pin.joint, np.arange(start, stop), way[start - lo : stop - lo]))
    return tuple(found)


def left_open(clip: Clip, known: Observation, pins: tuple[Pin, ...]) -> np.ndarray:
    """(F,) 0 to 1, how far it is as open as without pins where joints are whose places are not known: of one
    that is pinned it is not, and of those next to it half as much. Arguments as in `meet`."""
    rows, joints = find_mapping(clip.skeleton).mapped
    unknown = ~known.positions(clip.skeleton)[:, list(joints)]
    left = np.ones(unknown.shape)
    for pin in pins:
        joint = clip.skeleton.index(pin.joint)
        if pin.position is None or joint not in joints:
            continue
        row, near = rows[joints.index(joint)], _near(len(clip), pin, clip.fps)
        for column, one in enumerate(rows):
            told = near * (1.0 if one == row else 0.5 * (PARENTS[one] == row or PARENTS[row] == one))
            left[:, column] = np.minimum(left[:, column], 1 - told)
    count = unknown.sum(axis=1)
    return np.where(count > 0, (left * unknown).sum(axis=1) / np.maximum(count, 1), 1.0)


def _near(frames: int, pin: Pin, fps: float) -> np.ndarray:
    """(F,) 1 at the frames of a pin, and a third of a second away nothing."""
    apart = np.abs(np.arange(frames)[:, None] - pin.frames).min(axis=1)
    return np.asarray(ramp(1 - apart / max(LEAD * fps, 2.0)))


def missed(clip: Clip, pins: tuple[Pin, ...]) -> Iterator[tuple[Pin, int, float]]:
    """Each pin with a position at each of its frames, and by how many metres the joint misses it there."""
    placed = clip.positions()
    for pin in pins:
        if pin.position is not None:
            off = np.linalg.norm(placed[pin.frames, clip.skeleton.index(pin.joint)] - pin.position, axis=1)
            for frame, distance in zip(pin.frames, off):
                yield pin, int(frame), float(distance)


def misturned(clip: Clip, pins: tuple[Pin, ...]) -> Iterator[tuple[Pin, int, float]]:
    """Each pin with an orientation at each of its frames, and by how many radians the joint is turned
    otherwise there."""
    turned = clip.kinematics()[0]
    for pin in pins:
        if pin.orientation is not None:
            off = rotations.angle(turned[pin.frames, clip.skeleton.index(pin.joint)], pin.orientation)
            for frame, angle in zip(pin.frames, off):
                yield pin, int(frame), float(angle)


def _gaps(known: Observation) -> Iterator[tuple[tuple[int, int], tuple[int, int], list[int]]]:
    """Of each gap the frames from start to before stop, those with the ones beside it, and which of these are
    its edges, of which nothing can change."""
    for start, stop in runs(~known.frames):
        lo, hi = max(0, start - 1), min(len(known.frames), stop + 1)
        yield (start, stop), (lo, hi), [frame - lo for frame in (start - 1, stop) if lo <= frame < hi]


def hovering(clip: Clip, known: Observation, standing: Clip) -> np.ndarray:
    """(F, n) metres by which `feet.ends` are higher than in another motion, where they stand in both.

    A network that is told where a hand is to be lifts the whole body a little, both feet off the floor. None
    is to come lower than where it rests.
    """
    ends, pairs, grown = feet.ends(clip.skeleton), feet.pairs(clip.skeleton), feet.size(clip.skeleton)
    high = np.zeros((len(clip), len(ends)))
    if not ends:
        return high
    placed, seen = standing.positions() / grown, known.positions(clip.skeleton)
    floors = feet.local_floor(placed[:, pairs], seen[:, pairs], clip.fps).reshape(len(clip), -1)
    floor = floors[:, [pairs.ravel().tolist().index(end) for end in ends]]
    now = clip.positions()[:, ends] / grown
    stands = feet.contacts(placed[:, ends], floor, clip.fps) & feet.contacts(now, floor, clip.fps)
    above = grown * np.maximum(now[..., 1] - floor, 0.0)
    off = np.where(stands & ~seen[:, ends], grown * (now[..., 1] - placed[:, ends, 1]), 0.0)
    for start, stop in runs(~known.frames):
        inside = np.zeros(len(clip), bool)
        inside[start:stop] = True
        fade = np.prod(envelope(inside, over := max(2.0, LEAD * clip.fps)), axis=0)
        for row, column in enumerate(off.T):
            high[:, row] += fade * spread(np.where(inside, np.maximum(column, 0.0), 0.0), over)
    return np.minimum(high, above)


def _meet(
    clip: Clip, known: Observation, pins: list[Pin], edges: list[int], down: np.ndarray, axes: Axes | None
) -> Clip:
    placed = [pin for pin in pins if pin.position is not None]
    # Those above first: they turn what hangs on them.
    turned = [pin for pin in pins if pin.orientation is not None]
    turned.sort(key=lambda pin: clip.skeleton.index(pin.joint))
    fixed = {clip.skeleton.index(pin.joint) for pin in turned}
    if placed:
        clip, down = _place(clip, known, placed, edges, down, axes), np.zeros_like(down)
    stays = _staying(clip, turned, placed)

    def all_turned(some: Clip) -> Clip:
        for pin in turned:
            some = _turn(some, known, pin, edges, fixed)
        return some

    clip = all_turned(clip)
    if not (turned and (placed or stays)):
        return clip
    # Turning a joint moves what hangs on it: that comes to its place once more, and what is turned stays so.
    # Feet give way where a pin asks for it: that one comes last.
    held = _held(clip, known, turned)
    for there in filter(None, (placed + stays, placed if stays else [])):
        clip, down = all_turned(_place(clip, known, there, edges, down, axes, held)), np.zeros_like(down)
    return clip


def _staying(clip: Clip, turned: list[Pin], placed: list[Pin]) -> list[Pin]:
    """Pins of feet where they are, if hips that they hang on are to be turned by less than FEET_TURN."""
    skeleton, (now, at) = clip.skeleton, clip.kinematics()
    pinned, found = {skeleton.index(pin.joint) for pin in placed}, []
    for leg in feet.legs(skeleton):
        above = [pin for pin in turned if skeleton.index(pin.joint) in skeleton.ancestors(leg.ankle)]
        off = [rotations.angle(now[pin.frames, skeleton.index(pin.joint)], pin.orientation) for pin in above]
        # A shin or a foot that is turned is to take its toes along, and a foot goes where its ankle does.
        joints = {leg.thigh, leg.knee, *leg.foot}
        if not above or joints & {skeleton.index(pin.joint) for pin in turned} or pinned & {*leg.foot}:
            continue
        if np.concatenate(off).max() < FEET_TURN:
            frames = np.arange(len(clip))
            found += [Pin(skeleton.names[foot], frames, at[:, foot]) for foot in dict.fromkeys(leg.foot)]
    return found


def _held(clip: Clip, known: Observation, pins: list[Pin]) -> np.ndarray:
    """(F, J) how far joints stay turned as they are, to 1 where a pin says how."""
    held = np.zeros(known.rotation.shape)
    for pin in pins:
        joint = clip.skeleton.index(pin.joint)
        held[:, joint] = np.maximum(held[:, joint], _near(len(clip), pin, clip.fps))
    return np.where(known.rotation, 0.0, held)


def _place(
    clip: Clip,
    known: Observation,
    pins: list[Pin],
    edges: list[int],
    down: np.ndarray,
    axes: Axes | None,
    held: np.ndarray | None = None,
) -> Clip:
    """Bring joints to their places by turning all that is free, frame by frame."""
    skeleton = clip.skeleton
    pinned = [skeleton.index(pin.joint) for pin in pins]
    mapping = find_mapping(skeleton)
    body = range(len(skeleton)) if no_humanoid(mapping) else mapping.mapped[1]
    joints = tuple(dict.fromkeys([*body, *pinned]))
    start = clip.positions()
    wanted, off = start[:, joints].copy(), np.zeros((len(clip), len(joints)))
    # A foot goes where its ankle does, or its toe.
    along = {a: b for pair in feet.pairs(skeleton).tolist() for a, b in (pair, pair[::-1])}
    for pin, joint in zip(pins, pinned):
        change = _between(
            len(clip), np.asarray(pin.frames), pin.position - start[pin.frames, joint], edges, clip.fps
        )
        wanted[:, joints.index(joint)] += change
        off[:, joints.index(joint)] += np.abs(change).max(axis=1)
        other = along.get(joint, joint)
        if other not in pinned and other in joints:
            wanted[:, joints.index(other)] += change
    # All of a body goes along whose hips, or head, are pinned far away, as after an end that nothing follows.
    leads = [mapping[name] for name in TRUNK if mapping[name] in pinned and mapping[name] in joints]
    for lead in leads[:1]:
        assert lead is not None
        shift = (wanted - start[:, joints])[:, joints.index(lead)] * FLOOR.values
        shift *= ramp(np.linalg.norm(shift, axis=1).max() / (ALONG * feet.size(skeleton)) - 1)
        for row, joint in enumerate(joints):
            if not {joint, along.get(joint)} & {*pinned}:
                wanted[:, row] += shift
                off[:, row] += np.abs(shift).max(axis=1)
    # The body comes down with its feet; not what is pinned, nor a foot that goes along with that.
    lower = dict(zip(feet.ends(skeleton), down.T))
    for row, joint in enumerate(joints):
        if not {joint, along.get(joint)} & {*pinned}:
            by = lower.get(joint, down.max(axis=1, initial=0.0))
            wanted[:, row, 1] -= by
            off[:, row] += by
    moved = np.flatnonzero(off.max(axis=1) > 1e-6)
    if not moved.size:
        return clip
    rows = [joints.index(joint) for joint in pinned]
    heavy = [joints.index(joint) for joint in feet.ends(skeleton) if joint in joints]
    done, bounds = clip, Bounds(Hinges.of(clip), axes, held)
    if len(clip) <= TOGETHER:
        done = _steadily(clip, known, joints, start[:, joints], wanted, rows, heavy, bounds)
    rotation, translation = done.rotation.copy(), done.translation.copy()
    for i in range(0, len(moved), BLOCK):
        at = moved[i : i + BLOCK]
        part = done.take(at)
        seen = Observation(known.rotation[at], known.translation[at])
        rotation[at], translation[at] = _approach(part, seen, joints, wanted[at], rows, heavy, bounds.at(at))
    return clip.with_motion(rotation, translation)


def _steadily(
    clip: Clip,
    known: Observation,
    joints: tuple[int, ...],
    start: np.ndarray,
    wanted: np.ndarray,
    rows: list[int],
    heavy: list[int],
    bounds: Bounds,
) -> Clip:
    """The joints in `rows` near to where they are wanted (F, n, 3), not at `start`, all frames together.

    Solved each for itself, frames differ in what the pins leave open: where an elbow points, and how far a
    head makes room.
    """
    led, done = clip, np.zeros((len(clip), 1))
    count = min(AT_MOST, int(np.ceil(np.linalg.norm(wanted - start, axis=-1).max() / STEP)))
    for step, share in [*((k / count, SHARES[0]) for k in range(1, count)), *((1.0, s) for s in SHARES)]:
        weights = np.full(wanted.shape[:2], share)
        weights[:, heavy] *= FEET
        weights[:, rows] = 1.0
        goal = start + step * (wanted - start)
        steady, bent = STEADY * share / SHARES[0], bounds.to(HINGED * share)
        led, done = refine_steadily(led, known, joints, goal, weights, done, steady, bent)
    off = [np.linalg.norm(wanted[:, rows] - p[:, rows]).sum() for p in (start, led.positions()[:, joints])]
    return led if off[1] < off[0] else clip  # what is out of reach may swing


def _approach(
    clip: Clip,
    known: Observation,
    joints: tuple[int, ...],
    wanted: np.ndarray,
    rows: list[int],
    heavy: list[int],
    bounds: Bounds,
) -> tuple[np.ndarray, np.ndarray]:
    """Rotations and translations with which the joints in `rows` come to where they are wanted (F, n, 3).

    In steps, each frame for itself: all the way at once joints would turn past what is far away, and swing
    about what is out of reach. Steps that come no nearer are taken back, and shorter ones tried.
    """

    def off(some: Clip) -> np.ndarray:
        return np.asarray(wanted[:, rows] - some.positions()[:, [joints[row] for row in rows]])

    left = off(clip)
    step = np.full(len(clip), STEP)
    for share in chain(SHARES, repeat(SHARES[-1], ROUNDS)):
        far = np.linalg.norm(left, axis=-1)
        if share == SHARES[-1] and ((far.max(axis=1) < STILL) | (step < SHORT)).all():
            break
        goal = wanted.copy()
        goal[:, rows] -= left * np.maximum(1 - step[:, None] / np.maximum(far, 1e-9), 0.0)[..., None]
        weights = np.full((len(clip), len(joints)), share)
        weights[:, heavy] *= FEET
        weights[:, rows] = 1.0
        tried = refine(clip, known, joints, goal, weights, bounds.to(HINGED * share))
        there = off(tried)
        nearer = np.linalg.norm(there, axis=-1).sum(axis=1) < far.sum(axis=1) - STILL
        left = np.where(nearer[:, None, None], there, left)
        step = np.where(nearer, step, step / 2)
        clip = clip.with_motion(
            np.where(nearer[:, None, None], tried.rotation, clip.rotation),
            np.where(nearer[:, None, None], tried.translation, clip.translation),
        )
    return clip.rotation, clip.translation


def _turn(clip: Clip, known: Observation, pin: Pin, edges: list[int], fixed: Collection[int]) -> Clip:
    """Turn a joint as a pin says, where its own rotation is free; those that are `fixed` are pinned, too."""
    joint = clip.skeleton.index(pin.joint)
    turned, _ = clip.kinematics()
    off = _unrolled(
        rotations.log(rotations.multiply(pin.orientation, rotations.conjugate(turned[pin.frames, joint])))
    )
    change = _between(len(clip), np.asarray(pin.frames), off, edges, clip.fps)
    free = ~known.rotation[:, joint, None]
    if clip.skeleton.parents[joint] not in fixed:
        clip = _also_turned(clip, known, joint, np.where(free, change, 0.0))
    done, parent = rotations.multiply(rotations.exp(change), turned[:, joint]), clip.skeleton.parents[joint]
    if parent >= 0:
        done = rotations.relative(clip.kinematics()[0][:, parent], done)
    rotation = clip.rotation.copy()
    rotation[:, joint] = np.where(free, done, rotation[:, joint])
    return clip.with_motion(rotation, clip.translation)


def _also_turned(clip: Clip, known: Observation, joint: int, change: np.ndarray) -> Clip:
    """The clip with a forearm, where it is free, turned about itself by its share of how its hand is to turn,
    rotation vectors (F, 3), or a neck by its share of how the head is: a wrist, or a head, alone would turn
    further than any. The hand stays where it is."""
    skeleton, mapping = clip.skeleton, find_mapping(clip.skeleton)
    above = skeleton.parents[joint]
    arms = [(mapping[side + "Hand"], mapping[side + "ForeArm"]) for side in ("Left", "Right")]
    if above < 0 or (joint, above) not in (*arms, (mapping["Head"], mapping["Neck"])):
        return clip
    turned, placed = clip.kinematics()
    if (joint, above) in arms:
        bone = placed[:, joint] - placed[:, above]
        bone = bone / np.maximum(np.linalg.norm(bone, axis=1, keepdims=True), 1e-9)
        change = (change * bone).sum(axis=1, keepdims=True) * bone
    shared = rotations.multiply(rotations.exp(ALSO * change), turned[:, above])
    if skeleton.parents[above] >= 0:
        shared = rotations.relative(turned[:, skeleton.parents[above]], shared)
    rotation = clip.rotation.copy()
    rotation[:, above] = np.where(known.rotation[:, above, None], rotation[:, above], shared)
    return clip.with_motion(rotation, clip.translation)


def _unrolled(turns: np.ndarray) -> np.ndarray:
    """The same turns as rotation vectors (n, 3), each by as many whole turns more as bring it nearest to the
    one before: past half a turn they would go all the way back."""
    done = turns.copy()
    for k in range(1, len(done)):
        if angle := float(np.linalg.norm(turns[k])):
            axis = turns[k] / angle
            done[k] += 2 * np.pi * np.round((done[k - 1] @ axis - angle) / (2 * np.pi)) * axis
    return done


def _between(frames: int, at: np.ndarray, values: np.ndarray, edges: list[int], fps: float) -> np.ndarray:
    """(F, n) through values (k, n) at some frames, nothing at the edges, smooth and hardly further off.

    At an end that is no edge, as where a clip ends within the gap, the value holds. What holds a place while
    the body goes on changes from frame to frame: it is come to, and left, at that velocity.
    """
    # With a second one beyond it an edge is left and reached at rest.
    beyond = [edge + (1 if edge > at.max() else -1) for edge in edges]
    knots = np.concatenate([at, edges, beyond]).astype(int)
    points = np.concatenate([values, np.zeros((2 * len(edges), values.shape[1]))])
    knots, first = np.unique(knots, return_index=True)
    points = points[first]
    if len(knots) == 1:
        return np.repeat(points, frames, axis=0)
    way = scipy.interpolate.PchipInterpolator(knots, points)
    done = np.asarray(way(np.clip(np.arange(frames), knots[0], knots[-1])))
    apart = np.diff(knots)
    for k in range(1, len(knots) - 1):
        before, after = apart[k - 1], apart[k]
        if (before == 1) == (after == 1):
            continue
        # From the frames that are held to one side, over some on the other.
        side, room, other = (-1, before, points[k + 1]) if after == 1 else (1, after, points[k - 1])
        over = min(float(room), max(LEAD * fps, 2.0))
        steps = np.arange(1, int(np.ceil(over)))
        share = (steps / over)[:, None]
        # Over and above the slope that is there: a cubic of Hermite.
        slope = points[k] - other - side * way(knots[k], 1)
        done[knots[k] + side * steps] += share * (1 - share) ** 2 * over * slope
    return done


def _turned(skeleton: Skeleton, observation: Observation) -> np.ndarray:
    """(F, J) True where a joint's global rotation follows from what is known."""
    known = observation.rotation.copy()
    for joint, parent in enumerate(skeleton.parents):
        if parent >= 0:
            known[:, joint] &= known[:, parent]
    return known
