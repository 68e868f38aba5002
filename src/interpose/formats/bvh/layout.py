"""From the channels of a BVH file to a clip's rotations and translations, and back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from interpose.formats import angles, place
from interpose.formats.bvh.header import Node
from interpose.geometry import rotations


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
        up: the axis that points up, "y", "z", ...
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
        return place.vectors_inside(offsets, self.unit, self.up)

    def decode(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(n, C) numbers to local rotations (n, J, 4) and translations (n, K, 3) in metres, Y up."""
        quaternion = angles.decode(values, self.orders, self.rotation_columns)
        padded = np.concatenate([values, np.zeros((len(values), 1))], axis=1)
        moved = np.take(padded, self.translation_columns.ravel(), axis=1).reshape(len(values), -1, 3)
        return place.rotations_inside(quaternion, self.up), self.vectors(moved + self.base)

    def positions(self, translation: np.ndarray) -> np.ndarray:
        """(n, K, 3) metres, Y up, to the position channels x, y, z in file units: decode backwards."""
        return place.vectors_in_file(translation, self.unit, self.up) - self.base


def make_layout(nodes: tuple[Node, ...], added: bool, unit: float, up: str) -> Layout:
    """The layout of a hierarchy. `added`: position channels are added to the OFFSET, roots' too."""
    orders, turns, places, translated, base = [], [], [], [], []
    first = 0
    for joint, node in enumerate(nodes):
        columns = {channel: first + i for i, channel in enumerate(node.channels or ())}
        first += len(columns)
        order = angles.joint_order([axis for kind, axis in columns if kind == "rotation"])
        orders.append(order)
        turns.append([columns.get(("rotation", axis), -1) for axis in order])
        moves = [columns.get(("position", axis), -1) for axis in rotations.AXES]
        if node.parent < 0 or max(moves) >= 0:
            translated.append(joint)
            places.append(moves)
            base.append([o if added or move < 0 else 0.0 for o, move in zip(node.offset, moves)])
    return Layout(
        tuple(orders), np.array(turns), tuple(translated), np.array(places), np.array(base), unit, up
    )
