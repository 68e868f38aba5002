"""From joint positions to the rotations of a skeleton: aim from the root outward, then refine.

Positions tell where bones point. They do not tell a bone's twist about itself, nor anything below the last
known joint: there the rotations that the clip already has (a classical completion) are kept.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import solveh_banded

from interpose.clip import Clip, Skeleton
from interpose.finish.hinges import Hinges
from interpose.finish.windows import ramp
from interpose.geometry import kinematics, rotations
from interpose.geometry.time import bending
from interpose.observation import Observation
from interpose.skeletons import JOINTS, find_mapping

# Bones of a body of usual size that are shorter than this (metres) point nowhere: CMU's hip joints, lower
# back and collars have no length.
NO_LENGTH = 0.01
# How strongly a fit is pulled towards the pose it starts from, and how strongly bones count that reach over a
# joint without length: only what the bones at the joint itself leave open should follow either.
PULL, FAR = 1e-4, 1e-3
# Sine of the bend below which a knee or elbow tells nothing of the twist above it; from the second on, all.
STRAIGHT, BENT = 0.1, 0.35
# Gauss-Newton: steps, frames at once, and damping in square metres (a bone's length squared is about 0.1) of
# a body of usual size.
STEPS, BLOCK, DAMPING = 3, 512, 2e-3
# See `formats.axes`.
Axes = Callable[[Clip], dict[int, np.ndarray]]


@dataclass(frozen=True)
class Bounds:
    """What joints do not do as a body moves towards positions.

    Attributes:
        hinges: what pulls knees and elbows back that turn otherwise than by bending.
        axes: of a clip the joints that turn about fewer than three axes, as `formats.axes`.
        held: (F, J) 0 to 1, how far each joint stays turned in the world as it is, whatever is above it does.
    """

    hinges: Hinges | None = None
    axes: Axes | None = None
    held: np.ndarray | None = None

    def at(self, frames: np.ndarray) -> Bounds:
        """Of some frames."""
        held = None if self.held is None else self.held[frames]
        return replace(self, hinges=self.hinges and self.hinges.at(frames), held=held)

    def to(self, weight: float) -> Bounds:
        """With hinges of another weight."""
        return replace(self, hinges=self.hinges and self.hinges.to(weight))


FREELY = Bounds()


def solve(clip: Clip, observation: Observation, joints: tuple[int, ...], positions: np.ndarray) -> Clip:
    """Rotations with which forward kinematics comes as near to `positions` as the clip's own bones allow.

    Args:
        clip: (F) frames whose unobserved values are a classical completion.
        observation: only what is unobserved here may move.
        joints: indices of the n joints whose positions are known, in any order.
        positions: (F, n, 3) global positions in metres.

    Returns:
        The clip with unobserved rotations of joints above a known one, and the translation that carries the
        topmost known joint, replaced. Each frame is solved for itself, by steps that are smooth in the
        positions, so that smooth positions give smooth rotations.
    """
    target = dict(zip(joints, np.moveaxis(np.asarray(positions, float), 1, 0)))
    clip = _carry(clip, observation, target)
    clip = _aim(clip, observation, target)
    parts = [
        refine(clip.slice(i, i + BLOCK), observation.slice(i, i + BLOCK), joints, positions[i : i + BLOCK])
        for i in range(0, len(clip), BLOCK)
    ]
    if not parts:
        return clip
    return clip.with_motion(
        np.concatenate([part.rotation for part in parts]),
        np.concatenate([part.translation for part in parts]),
    )


def _carriers(
    skeleton: Skeleton, translated: tuple[int, ...], known: Collection[int]
) -> dict[int, list[int]]:
    """Which animated translation carries which topmost known joints: {translated joint: [known joints]}."""
    carried: dict[int, list[int]] = {}
    for joint in sorted(known):
        above = skeleton.ancestors(joint)
        if not any(a in known for a in above):
            carrier = next((a for a in (joint, *above) if a in translated), None)
            if carrier is not None:
                carried.setdefault(carrier, []).append(joint)
    return carried


def _carry(clip: Clip, observation: Observation, target: dict[int, np.ndarray]) -> Clip:
    """Shift the root (or the hips below it) so that the topmost known joint lies where it should."""
    skeleton, translation = clip.skeleton, clip.translation.copy()
    turned, placed = clip.kinematics()
    for carrier, joints in _carriers(skeleton, clip.translated, target).items():
        shift = np.mean([target[j] - placed[:, j] for j in joints], axis=0)
        parent = skeleton.parents[carrier]
        if parent >= 0:
            shift = rotations.rotate(rotations.conjugate(turned[:, parent]), shift)
        free = ~observation.translation[:, carrier, None]
        translation[:, clip.translated.index(carrier)] += np.where(
            free, shift / skeleton.scale_above[carrier], 0.0
        )
    return clip.with_motion(clip.rotation, translation)


def _aims(skeleton: Skeleton, known: Collection[int]) -> dict[int, list[tuple[int, float]]]:
    """For each known joint the known joints it aims at, with weights: the next ones below it.

    Where the next one lies in the same place, the ones after it are aimed at too, but count only FAR.
    """
    bones = skeleton.rest_translation * skeleton.scale_above[:, None]
    _, placed = kinematics.forward(skeleton.rest_rotation, bones, skeleton.parents)
    least = NO_LENGTH * find_mapping(skeleton).size
    nearest = {j: next((a for a in skeleton.ancestors(j) if a in known), None) for j in known}
    aims: dict[int, list[tuple[int, float]]] = {j: [] for j in sorted(known)}

    def apart(a: int, b: int) -> bool:
        return float(np.linalg.norm(placed[a] - placed[b])) > least

    for joint in aims:
        above, weight = nearest[joint], 1.0
        while above is not None:
            if apart(joint, above):
                aims[above].append((joint, weight))
            over = nearest[above]
            if over is None or apart(above, over):
                break
            above, weight = over, FAR
    return aims


def _limbs(skeleton: Skeleton, known: Collection[int]) -> dict[int, tuple[int, int]]:
    """{thigh: (knee, ankle), upper arm: (elbow, wrist)}, where the skeleton has names and all are known."""
    found = dict(zip(JOINTS, find_mapping(skeleton).joints))
    limbs = {}
    for side in ("Left", "Right"):
        for names in (("UpLeg", "Leg", "Foot"), ("Arm", "ForeArm", "Hand")):
            chain = [found[side + name] for name in names]
            if all(joint in known for joint in chain):
                limbs[chain[0]] = (chain[1], chain[2])
    return limbs  # type: ignore[return-value]


def _aim(clip: Clip, observation: Observation, target: dict[int, np.ndarray]) -> Clip:
    """Turn each known joint, parents first, so that the known joints next below it come to their positions.

    Each aims from where forward kinematics has put it by then, so that errors do not pile up on the way.
    """
    skeleton, parents = clip.skeleton, clip.skeleton.parents
    aims, limbs = _aims(skeleton, target), _limbs(skeleton, target)
    rotation, bones = clip.rotation.copy(), clip.local_translation()
    turned, placed = np.empty_like(rotation), np.empty_like(bones)

    def down(start: int, stop: int) -> np.ndarray:
        """(F, 3) where `stop` lies from `start`, in the axes of `start`, by the rotations as they are."""
        vector, joint = bones[:, stop], parents[stop]
        while joint != start:
            vector = bones[:, joint] + rotations.rotate(rotation[:, joint], vector)
            joint = parents[joint]
        return vector

    for joint, parent in enumerate(parents):
        if parent < 0:
            turned[:, joint], placed[:, joint] = rotation[:, joint], bones[:, joint]
        else:
            turned[:, joint] = rotations.multiply(turned[:, parent], rotation[:, joint])
            placed[:, joint] = placed[:, parent] + rotations.rotate(turned[:, parent], bones[:, joint])
        free = ~observation.rotation[:, joint]
        if not aims.get(joint) or not free.any():
            continue
        reach = [rotations.rotate(turned[:, joint], down(joint, below)) for below, _ in aims[joint]]
        wanted = [target[below] - placed[:, joint] for below, _ in aims[joint]]
        if len(reach) == 1:
            turn = rotations.between(reach[0], wanted[0])
        else:
            turn = _fit(np.stack(reach, 1), np.stack(wanted, 1), np.array([w for _, w in aims[joint]]))
        if joint in limbs and aims[joint][0][0] == limbs[joint][0]:
            ankle = limbs[joint][1]
            aimed = rotations.multiply(turn, turned[:, joint])
            at_knee = placed[:, joint] + rotations.rotate(turn, reach[0])
            shin = rotations.rotate(aimed, down(joint, ankle)) - (at_knee - placed[:, joint])
            twist = _twist(at_knee - placed[:, joint], shin, target[ankle] - at_knee)
            turn = rotations.multiply(twist, turn)
        done = rotations.normalize(rotations.multiply(turn, turned[:, joint]))
        turned[:, joint] = np.where(free[:, None], done, turned[:, joint])
        local = done if parent < 0 else rotations.relative(turned[:, parent], done)
        rotation[:, joint] = np.where(free[:, None], local, rotation[:, joint])
    return clip.with_motion(rotation, clip.translation)


def _fit(reach: np.ndarray, wanted: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """The rotation (F, 4) that brings vectors (F, n, 3) nearest to `wanted`, pulled towards no rotation.

    Source: Kabsch 1976. The pull decides what the vectors leave open; a second round takes its bias away.
    """
    total = np.tile([1.0, 0, 0, 0], (len(reach), 1))
    for _ in range(2):
        size = (weights[:, None] * reach**2).sum(axis=(1, 2))
        # The pull: three axes that would like to stay where they are.
        stay = np.sqrt(PULL * size)[:, None, None] * np.eye(3)
        heavy = np.sqrt(weights)[:, None]
        turn = rotations.fit(
            np.concatenate([heavy * reach, stay], axis=1), np.concatenate([heavy * wanted, stay], axis=1)
        )
        reach = rotations.rotate(turn[:, None], reach)
        total = rotations.multiply(turn, total)
    return total


def _twist(axis: np.ndarray, bone: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """The turn (F, 4) about a thigh that brings its shin to the side where `wanted` bends (all (F, 3)).

    It fades out as either is straight, where there is no side, and as the sides become opposite, where the
    two ways round are equally long.
    """
    axis = rotations.normalize(axis)
    across = [v - (v * axis).sum(-1, keepdims=True) * axis for v in (bone, wanted)]
    sines = [
        np.linalg.norm(a, axis=-1) / np.maximum(np.linalg.norm(v, axis=-1), 1e-9)
        for a, v in zip(across, (bone, wanted))
    ]
    bend = np.minimum(*sines)
    angle = np.arctan2((rotations.cross(*across) * axis).sum(-1), (across[0] * across[1]).sum(-1))
    share = ramp((bend - STRAIGHT) / (BENT - STRAIGHT)) * ramp((np.pi - np.abs(angle)) / (np.pi / 4))
    return rotations.exp((share * angle)[:, None] * axis)


def refine(
    clip: Clip,
    observation: Observation,
    joints: tuple[int, ...],
    positions: np.ndarray,
    weights: np.ndarray | None = None,
    bounds: Bounds = FREELY,
) -> Clip:
    """A few damped Gauss-Newton steps on all joint angles at once, towards positions as in `solve`.

    Where bones differ from those in the positions, aiming leaves the whole difference at the end of a limb;
    this shares it out. Damping keeps what positions do not tell. `weights` (F, n), or (F, n, 3) by axis, says
    how much each position counts; default: all the same.
    """
    freedom = Freedom.of(clip, observation, joints, bounds)
    for _ in range(STEPS):
        normal, towards, frame = freedom.normal(clip, positions, weights)
        normal += DAMPING * np.eye(normal.shape[2])
        clip = freedom.moved(clip, np.linalg.solve(normal, towards)[..., 0] * freedom.free, frame)
    return clip


def refine_steadily(
    clip: Clip,
    observation: Observation,
    joints: tuple[int, ...],
    positions: np.ndarray,
    weights: np.ndarray,
    done: np.ndarray,
    steady: float,
    bounds: Bounds = FREELY,
) -> tuple[Clip, np.ndarray]:
    """As `refine`, of all frames together: what is done to the motion changes evenly over time.

    Args:
        clip, observation, joints, positions, weights, bounds: as in `refine`.
        done: (F, d) what has been done to the motion already, as it came from here; zeros (F, 1) at first.
        steady: how much the second differences of what is done count, squared, against metres squared.

    Returns:
        The clip, and what has been done to it by now.
    """
    freedom = Freedom.of(clip, observation, joints, bounds)
    frames, size = freedom.free.shape
    even = steady * bending(frames)
    for _ in range(STEPS):
        normal, towards, frame = freedom.normal(clip, positions, weights)
        bands = np.zeros((2 * size + 1, frames * size))
        for row in range(size):
            for column in range(row + 1):
                bands[row - column, column::size] = normal[:, row, column]
        bands[0] += DAMPING
        towards = towards[..., 0] - even[0][:, None] * done * freedom.free
        bands[0] += (even[0][:, None] * freedom.free**2).ravel()
        for apart in range(1, min(3, frames)):
            weight = even[apart, : frames - apart, None]
            both = freedom.free[apart:] * freedom.free[: frames - apart]
            bands[apart * size, : (frames - apart) * size] += (weight * both).ravel()
            towards[apart:] -= weight * done[: frames - apart] * freedom.free[apart:]
            towards[: frames - apart] -= weight * done[apart:] * freedom.free[: frames - apart]
        step = solveh_banded(bands, towards.ravel(), lower=True).reshape(frames, size) * freedom.free
        clip, done = freedom.moved(clip, step, frame), done + step
    return clip, done


@dataclass(frozen=True)
class Freedom:
    """How a body may move towards positions of some joints: by turning joints, and shifting what carries it.

    Attributes:
        known: the n joints.
        movable, carriers: the joints that may turn, and those that may shift.
        free: (F, d) 1 where they may, three columns for each.
        above: (n, movable) 1 where the known joint hangs below the one that may turn.
        by_shift: (3 n, 3 carriers) how much a shift of each carrier along each axis moves each known joint.
        size: of the body, 1 for the usual one: it moves as that one would.
        bounds: what joints do not do.
    """

    known: list[int]
    movable: list[int]
    carriers: list[int]
    free: np.ndarray
    above: np.ndarray
    by_shift: np.ndarray
    size: float
    bounds: Bounds

    @classmethod
    def of(cls, clip: Clip, observation: Observation, joints: tuple[int, ...], bounds: Bounds) -> Freedom:
        """Of what is not observed."""
        skeleton, known = clip.skeleton, list(joints)
        under = (skeleton.below & ~np.eye(len(skeleton), dtype=bool)).astype(float)
        movable = [j for j in sorted(joints) if under[known, j].any()]
        carriers = list(_carriers(skeleton, clip.translated, set(joints)))
        seen = [observation.rotation[:, movable], observation.translation[:, carriers]]
        free = (~np.repeat(np.concatenate(seen, axis=1), 3, axis=1)).astype(float)
        carried = skeleton.below[np.ix_(known, carriers)]
        by_shift = np.einsum("kc,ab->kacb", carried, np.eye(3)).reshape(3 * len(known), 3 * len(carriers))
        above, size = under[np.ix_(known, movable)], find_mapping(skeleton).size
        return cls(known, movable, carriers, free, above, by_shift, size, bounds)

    def _levers(self, clip: Clip, placed: np.ndarray) -> np.ndarray:
        """(F, n, movable, 3) from each joint that may turn to what its turns move of each known one: its own
        place, or that of a joint between them that stays turned as it is, and is `placed` (F, J, 3) there."""
        held, below = self.bounds.held, clip.skeleton.below
        moves = np.repeat(placed[:, self.known, None], len(self.movable), axis=2)
        # The topmost of several counts, and so is done last.
        for joint in [] if held is None else np.flatnonzero(held.any(axis=0))[::-1]:
            assert held is not None
            under = [row for row, one in enumerate(self.known) if one != joint and below[one, joint]]
            over = [column for column, one in enumerate(self.movable) if below[joint, one]]
            at = np.ix_(range(len(placed)), under, over)
            share = held[:, joint, None, None, None]
            moves[at] = (1 - share) * moves[at] + share * placed[:, joint, None, None]
        return np.asarray((moves - placed[:, None, self.movable]) * self.above[..., None])

    def normal(
        self, clip: Clip, positions: np.ndarray, weights: np.ndarray | None
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The normal equations (F, d, d) and (F, d, 1) of a step, and the global rotations of the clip."""
        turned, placed = clip.kinematics()
        frames = len(clip)
        lever = self._levers(clip, placed) / self.size
        x, y, z, o = lever[..., 0], lever[..., 1], lever[..., 2], np.zeros_like(lever[..., 0])
        # A small turn d about the axes of the world moves a point by d x lever: rows of that matrix.
        by_turn = np.stack([np.stack([o, z, -y], -1), np.stack([-z, o, x], -1), np.stack([y, -x, o], -1)], 2)
        by_turn = by_turn.reshape(frames, 3 * len(self.known), 3 * len(self.movable))
        by_shift = np.broadcast_to(self.by_shift, (frames, *self.by_shift.shape))
        for joint, about in self.bounds.axes(clip).items() if self.bounds.axes else ():
            if joint in self.movable:
                parent = clip.skeleton.parents[joint]
                world = about if parent < 0 else rotations.to_matrix(turned[:, parent]) @ about
                column = 3 * self.movable.index(joint)
                by_turn[..., column : column + 3] @= world @ np.swapaxes(world, -1, -2)
        jacobian = np.concatenate([by_turn, by_shift], axis=2) * self.free[:, None]
        miss = (positions - placed[:, self.known]).reshape(frames, -1, 1) / self.size
        if weights is None:
            weights = np.ones(positions.shape)
        axes = weights if weights.ndim == 3 else np.repeat(weights[..., None], 3, axis=2)
        heavy = axes.reshape(frames, 1, -1)
        transposed = np.swapaxes(jacobian, 1, 2) * heavy
        normal, towards = transposed @ jacobian, transposed @ miss
        for joint, stiff, pull in self.bounds.hinges.pulls(clip, turned) if self.bounds.hinges else ():
            if joint in self.movable:
                at = slice(3 * self.movable.index(joint), 3 * self.movable.index(joint) + 3)
                normal[:, at, at] += stiff
                towards[:, at, 0] += pull
        return normal, towards, turned

    def moved(self, clip: Clip, step: np.ndarray, turned: np.ndarray) -> Clip:
        """The clip a step (F, d) further; `turned` are its global rotations."""
        skeleton, frames = clip.skeleton, len(clip)
        slots = [clip.translated.index(c) for c in self.carriers]

        def to_parent(vectors: np.ndarray, of: list[int]) -> np.ndarray:
            """Vectors (F, n, 3) of the world in the axes of the parents of n joints."""
            parents = np.array([skeleton.parents[j] for j in of], int)
            inside = rotations.rotate(rotations.conjugate(turned[:, np.maximum(parents, 0)]), vectors)
            return np.where(parents[:, None] >= 0, inside, vectors)

        turns = 3 * len(self.movable)
        rotation, translation = clip.rotation.copy(), clip.translation.copy()
        # A turn in the world's axes before a joint's own rotation is one in its parent's axes.
        turn = to_parent(step[:, :turns].reshape(frames, -1, 3), self.movable)
        done = rotations.normalize(rotations.multiply(rotations.exp(turn), rotation[:, self.movable]))
        free = self.free[:, :turns:3, None] > 0
        rotation[:, self.movable] = np.where(free, done, rotation[:, self.movable])
        shift = self.size * to_parent(step[:, turns:].reshape(frames, -1, 3), self.carriers)
        translation[:, slots] += shift / skeleton.scale_above[self.carriers][:, None]
        done, held = clip.with_motion(rotation, translation), self.bounds.held
        for joint in [] if held is None else np.flatnonzero(held.any(axis=0)):
            assert held is not None
            now = done.kinematics()[0]
            off = rotations.log(rotations.multiply(turned[:, joint], rotations.conjugate(now[:, joint])))
            kept = rotations.multiply(rotations.exp(held[:, joint, None] * off), now[:, joint])
            above = skeleton.parents[joint]
            rotation = done.rotation.copy()
            rotation[:, joint] = kept if above < 0 else rotations.relative(now[:, above], kept)
            done = clip.with_motion(rotation, translation)
        return done


def solve_error(clip: Clip, joints: tuple[int, ...], positions: np.ndarray) -> np.ndarray:
    """(F,) mean distance in metres between forward kinematics and the positions (F, n, 3) of `joints`."""
    return np.linalg.norm(clip.positions()[:, list(joints)] - positions, axis=-1).mean(axis=1)
