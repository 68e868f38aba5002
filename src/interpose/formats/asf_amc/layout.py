"""From the numbers of a motion file to a clip's rotations and translations, and back.

A bone becomes the joint at its start, under the bone's name, with the bone's own rotation; its end is where
its children start. All of this was checked against the BVH form of the same CMU trials (docs/data.md).

- "rx ry rz" are turns about fixed axes, the first one first: the product Rz Ry Rx. `axis` gives these axes
  as a rotation C in the same way, so that a bone's local rotation is C R C^-1, and identity in the rest pose.
- tx, ty, tz move a bone's start along the same axes, l its end along its direction.
- The root's preset position P and orientation O place everything: rotation O R, translation P + O T.

The signs and the order are Schafer's and Vicon's (see asf.py); where those are silent (l; whether the preset
of the root comes before or after its motion: in all known files it is zero) the above is this module's
reading.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from interpose.formats import angles, place
from interpose.formats.asf_amc.asf import Asf, Bone
from interpose.geometry import kinematics, rotations


@dataclass(frozen=True, eq=False)
class Layout:
    """Which column of a frame means what. J joints, one a bone; K of them have a translation.

    Attributes:
        orders: per joint its rotation order as a product: "ZYX" for "rx ry rz".
        rotation_columns: (J, 3) column of each angle in that order, -1 where there is none.
        before, after: (J, 4) the constant rotations around a joint's own: local = before R after.
        translated: indices of the K joints: the root, and those that degrees of freedom move.
        base: (K, 3) file units and axes: translations when all numbers are zero.
        moving: (T,) columns that move something.
        gains: (T, K, 3) how the translations change with each of these.
        degrees: (C,) what a number is multiplied with to give degrees; 1 where it is no angle.
        unit: metres per file unit.
        up: the axis that points up, "y", "z", ...
    """

    orders: tuple[str, ...]
    rotation_columns: np.ndarray
    before: np.ndarray
    after: np.ndarray
    translated: tuple[int, ...]
    base: np.ndarray
    moving: np.ndarray
    gains: np.ndarray
    degrees: np.ndarray
    unit: float
    up: str

    def decode(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(n, C) numbers to local rotations (n, J, 4) and translations (n, K, 3) in metres, Y up."""
        turned = angles.decode(self.scaled(values), self.orders, self.rotation_columns)
        turned = rotations.multiply(rotations.multiply(self.before, turned), self.after)
        # Term by term: the same sum for any number of frames, so that what did not change compares equal.
        moved = np.tile(self.base, (len(values), 1, 1))
        for column, gain in zip(self.moving, self.gains):
            moved += values[:, column, None, None] * gain
        return place.rotations_inside(turned, self.up), place.vectors_inside(moved, self.unit, self.up)

    def scaled(self, values: np.ndarray) -> np.ndarray:
        """The numbers with angles in degrees."""
        return values * self.degrees

    def unscaled(self, values: np.ndarray) -> np.ndarray:
        """`scaled` backwards."""
        return values / self.degrees

    def own_rotations(self, rotation: np.ndarray) -> np.ndarray:
        """The clip's rotations (n, J, 4) about each joint's own axes: what its angles stand for."""
        turned = place.rotations_in_file(rotation, self.up)
        return rotations.multiply(rotations.relative(self.before, turned), rotations.conjugate(self.after))

    def reachable(
        self, rotation: np.ndarray, turned: np.ndarray, parents: tuple[int, ...]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Rotations (n, J, 4) about the joints' own axes that their degrees of freedom can make.

        Each joint that is `turned` (n, J) comes as near as it can to the orientation that it has in the clip,
        so that it makes up for what the joints above it could not do. Also returns how far each stays off,
        (n, J) degrees.
        """
        wanted = place.rotations_in_file(rotation, self.up)
        aims = kinematics.global_rotations(wanted, parents)
        made, own = np.empty(aims.shape), self.own_rotations(rotation)
        for joint, parent in enumerate(parents):
            above = made[:, parent] if parent >= 0 else rotations.identity(len(made))
            before, after = self.before[joint], self.after[joint]
            count = int((self.rotation_columns[joint] >= 0).sum())
            if turned[:, joint].any():
                local = rotations.relative(above, aims[:, joint])
                inner = rotations.relative(before, local)
                inner = rotations.multiply(inner, rotations.conjugate(after))
                euler, _ = angles.nearest(inner, self.orders[joint], count)
                nearest = rotations.from_euler(np.radians(euler), self.orders[joint])
                own[:, joint] = np.where(turned[:, joint, None], nearest, own[:, joint])
            local = rotations.multiply(rotations.multiply(before, own[:, joint]), after)
            made[:, joint] = rotations.multiply(above, local)
        return own, np.where(turned, np.degrees(rotations.angle(made, aims)), 0.0)

    def held(self, rotation: np.ndarray, parents: tuple[int, ...]) -> np.ndarray:
        """The clip's rotations (n, J, 4) that a file holds when these are written."""
        own, _ = self.reachable(rotation, np.ones(rotation.shape[:2], bool), parents)
        turned = rotations.multiply(rotations.multiply(self.before, own), self.after)
        return place.rotations_inside(turned, self.up)

    def axes(self, rotation: np.ndarray) -> dict[int, np.ndarray]:
        """The axes about which joints turn that have fewer than three, (n, 3, k) unit vectors in the axes of
        the joint's parent, where the clip's rotations are (n, J, 4)."""
        found, own = {}, self.own_rotations(rotation)
        for joint, (order, columns) in enumerate(zip(self.orders, self.rotation_columns)):
            if (count := int((columns >= 0).sum())) == 3:
                continue
            turns, _ = angles.nearest(own[:, joint], order, count)
            above, about = (
                np.tile(self.before[joint], (len(rotation), 1)),
                np.empty((len(rotation), count, 3)),
            )
            for k, axis in enumerate(order[:count]):
                unit = np.eye(3)[rotations.AXES.index(axis)]
                about[:, k] = rotations.rotate(above, unit)
                above = rotations.multiply(above, rotations.exp(np.radians(turns[:, k, None]) * unit))
            found[joint] = np.swapaxes(place.vectors_inside(about, 1.0, self.up), -1, -2)
        return found

    def moved(self, values: np.ndarray, translation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The numbers (n, T) in the columns `moving` that give translations (n, K, 3) in metres, Y up.

        Of all that do, those nearest to the ones in `values` (n, C). Also returns how far each joint's
        translation stays off, (n, K) metres: what no degree of freedom can do.
        """
        wanted = place.vectors_in_file(translation, self.unit, self.up) - self.base
        old = values[:, self.moving]
        flat = self.gains.reshape(len(self.gains), -1)
        new = old + (wanted.reshape(len(values), -1) - old @ flat) @ np.linalg.pinv(flat)
        off = wanted - (new @ flat).reshape(wanted.shape)
        return new, np.linalg.norm(off, axis=-1) * self.unit


def bone_ends(asf: Asf) -> np.ndarray:
    """(J, 3) in file units and axes: from the start of each bone to its end in the rest pose."""
    return np.array([_direction(bone) * bone.length for bone in asf.bones])


def bone_vectors(asf: Asf) -> np.ndarray:
    """(J, 3) in file units and axes: from the start of each joint's parent to its own in the rest pose."""
    ends = bone_ends(asf)
    rest = np.array([ends[bone.parent] if bone.parent >= 0 else np.zeros(3) for bone in asf.bones])
    rest[0] = asf.position
    return rest


def make_layout(asf: Asf, columns: dict[tuple[int, str], int], degrees: bool) -> Layout:
    """The layout of a motion in file units, Y up.

    Args:
        asf: the skeleton.
        columns: the column of each degree of freedom, by joint and token; those that the motion lacks are
            zero.
        degrees: whether the motion's angles are in degrees.
    """
    orders, turns = [], []
    frames = np.array([_axes(bone, asf.degrees) for bone in asf.bones])
    for joint, bone in enumerate(asf.bones):
        has = [token for token in bone.dof if token[0] == "r" and (joint, token) in columns]
        order = angles.joint_order([token[1].upper() for token in reversed(has)])
        orders.append(order)
        turns.append([columns.get((joint, "r" + axis.lower()), -1) for axis in order])

    # What each degree of freedom moves: pairs of joint and vector.
    effects: dict[int, list[tuple[int, np.ndarray]]] = {}
    for (joint, token), column in columns.items():
        if token[0] == "t":
            along = rotations.rotate(frames[joint], np.eye(3)["xyz".index(token[1])])
            effects[column] = [(joint, along)]
        elif token == "l":
            below = [child for child, bone in enumerate(asf.bones) if bone.parent == joint]
            effects[column] = [(child, _direction(asf.bones[joint])) for child in below]
    effects = {column: moved for column, moved in sorted(effects.items()) if moved}
    translated = sorted({0} | {joint for moved in effects.values() for joint, _ in moved})
    gains = np.zeros((len(effects), len(translated), 3))
    for row, moved in enumerate(effects.values()):
        for joint, along in moved:
            gains[row, translated.index(joint)] = along

    scale = np.ones(len(columns))
    if not degrees:
        scale[[column for (_, token), column in columns.items() if token[0] == "r"]] = np.degrees(1.0)
    still = np.array(turns).max(axis=1) < 0
    still[0] = False
    before = np.where(still[:, None], rotations.identity(len(frames)), frames)  # exactly, not up to rounding
    after = rotations.conjugate(before)
    after[0] = rotations.identity()
    return Layout(
        tuple(orders),
        np.array(turns),
        before,
        after,
        tuple(translated),
        bone_vectors(asf)[translated],
        np.array(list(effects), int),
        gains,
        scale,
        1.0,
        "y",
    )


def _axes(bone: Bone, degrees: bool) -> np.ndarray:
    """(4,) the axes of a bone's degrees of freedom, as a rotation of the global ones."""
    turns = np.radians(bone.axis) if degrees else np.array(bone.axis)
    return rotations.from_euler(turns[::-1], bone.order[::-1])


def _direction(bone: Bone) -> np.ndarray:
    """(3,) the unit vector along a bone; zero for the root and for points."""
    return rotations.normalize(np.array(bone.direction))
