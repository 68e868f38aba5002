"""From the channels of a BVH file to a clip's rotations and translations, and back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from interpose.formats.bvh.header import Node
from interpose.geometry import rotations

# Where the axes X, Y, Z of a file stand in a clip, and their signs. A file with Z up is turned by -90 degrees
# about X as a whole, rest pose included: exact in floating point, because it only moves numbers.
_INSIDE = {"y": ((0, 1, 2), (1.0, 1.0, 1.0)), "z": ((0, 2, 1), (1.0, -1.0, 1.0))}


@dataclass(frozen=True, eq=False)
class Layout:
    """Which column of a frame means what. J joints; K of them have a translation that can be animated.

    Attributes:
        orders: per joint its rotation order, such as "ZXY"; axes without a channel stand last.
        rotation_columns: (J, 3) column of each angle in that order, -1 where there is no channel.
        translated: indices of the K joints: the roots, and those with position channels.
        translation_columns: (K, 3) columns of x, y, z; -1 where there is no channel.
        base: (K, 3) file units: what is added to the channels.
        unit: metres per file unit.
        up: "y" or "z".
    """

    orders: tuple[str, ...]
    rotation_columns: np.ndarray
    translated: tuple[int, ...]
    translation_columns: np.ndarray
    base: np.ndarray
    unit: float
    up: str

    def vectors(self, offsets: np.ndarray) -> np.ndarray:
        """(..., 3) in file units and axes to metres, Y up."""
        place, sign = _INSIDE[self.up]
        inside = np.empty(np.shape(offsets))
        inside[..., place] = np.asarray(offsets) * sign
        return inside * self.unit

    def decode(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(n, C) numbers to local rotations (n, J, 4) and translations (n, K, 3) in metres, Y up.

        All joints in one batch, whatever their order: the product of three turns about coordinate axes in
        closed form (the same as rotations.from_euler, and a test says so).
        """
        frames, joints = len(values), len(self.orders)
        place, sign = _INSIDE[self.up]
        padded = np.concatenate([values, np.zeros((frames, 1))], axis=1)
        half = np.take(padded, self.rotation_columns.T.ravel(), axis=1).reshape(frames, 3, joints)
        half *= np.pi / 360.0
        (c1, c2, c3), (s1, s2, s3) = np.moveaxis(np.cos(half), 1, 0), np.moveaxis(np.sin(half), 1, 0)
        axes = np.array([[rotations.AXES.index(axis) for axis in order] for order in self.orders]).T
        # +1 where the order is a cyclic one (XYZ, YZX, ZXY)
        cyclic = np.where((axes[1] - axes[0]) % 3 == 1, 1.0, -1.0)
        c12, s12, s1c2, c1s2 = c1 * c2, cyclic * (s1 * s2), s1 * c2, cyclic * (c1 * s2)
        parts = s1c2 * c3 + c1s2 * s3, cyclic * (c1s2 * c3 - s1c2 * s3), s12 * c3 + c12 * s3
        quaternion = np.empty((frames, 4 * joints))
        quaternion[:, ::4] = c12 * c3 - s12 * s3
        column = 4 * np.arange(joints) + 1
        for axis, part in zip(axes, parts):
            quaternion[:, column + np.take(place, axis)] = part * np.take(sign, axis)

        moved = np.take(padded, self.translation_columns.ravel(), axis=1).reshape(frames, -1, 3) + self.base
        return quaternion.reshape(frames, joints, 4), self.vectors(moved)

    def positions(self, translation: np.ndarray) -> np.ndarray:
        """(n, K, 3) metres, Y up, to the position channels x, y, z in file units: decode backwards."""
        return self.in_file(translation) * _INSIDE[self.up][1] / self.unit - self.base

    def in_file(self, vectors: np.ndarray) -> np.ndarray:
        """(..., 3) things about the clip's axes in the order of the file's axes."""
        return vectors[..., _INSIDE[self.up][0]]

    def angles(self, rotation: np.ndarray, joints: np.ndarray) -> np.ndarray:
        """Rotations (n, J, 4) of the clip to Euler angles in degrees of some joints (n, len(joints), 3).

        Each joint in its own order, and in the file's axes.
        """
        place, sign = _INSIDE[self.up]
        turned = rotation[:, joints]
        turned[..., 1:] = turned[..., [1 + p for p in place]] * sign
        angles = np.empty((*turned.shape[:2], 3))
        orders = [self.orders[joint] for joint in joints]
        for order in set(orders):
            same = [i for i, other in enumerate(orders) if other == order]
            angles[:, same] = np.degrees(rotations.to_euler(turned[:, same], order))
        return angles


def make_layout(nodes: tuple[Node, ...], added: bool, unit: float, up: str) -> Layout:
    """The layout of a hierarchy. `added`: position channels are added to the OFFSET, roots' too."""
    orders, turns, places, translated, base = [], [], [], [], []
    first = 0
    for joint, node in enumerate(nodes):
        columns = {channel: first + i for i, channel in enumerate(node.channels or ())}
        first += len(columns)
        order = [axis for kind, axis in columns if kind == "rotation"]
        order += [axis for axis in rotations.AXES if axis not in order]
        orders.append("".join(order))
        turns.append([columns.get(("rotation", axis), -1) for axis in order])
        moves = [columns.get(("position", axis), -1) for axis in rotations.AXES]
        if node.parent < 0 or max(moves) >= 0:
            translated.append(joint)
            places.append(moves)
            base.append([o if added or move < 0 else 0.0 for o, move in zip(node.offset, moves)])
    return Layout(
        tuple(orders), np.array(turns), tuple(translated), np.array(places), np.array(base), unit, up
    )
