"""Human3.6M (Ionescu et al. 2014) in the two layouts in which papers on forecasting use it, both at 50 Hz.

- Angles, `S1/walking_1.txt` (Jain et al. 2016, used by Martinez et al. 2017 and most since): 99 numbers a
  line, the root's translation in millimetres, then rotation vectors of 32 joints.
- Positions, `data_3d_h36m.npz` (Pavllo et al. 2019): `positions_3d`, a pickled dictionary of subjects of
  actions of (F, 32, 3) metres, Z up.

Facts from public code: the skeleton and the chain of rotations from forward_kinematics.py of Martinez et
al.'s human-motion-prediction, the root's columns from changeCoordinateSpace.m of Jain et al.'s RNNexp, the
positions from prepare_data_h36m.py of Pavllo et al.'s VideoPose3D.
"""

from __future__ import annotations

import pickle
import re
import zipfile
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from interpose.clip import Clip, Skeleton
from interpose.errors import FileError
from interpose.formats.npz import SIZE_LIMIT
from interpose.geometry import kinematics, rotations
from interpose.skeletons.canonical import BONES, JOINTS
from interpose.skeletons.rest import ELBOW

FPS = 50.0
POSITIONS = "data_3d_h36m.npz"
COLUMNS = 99
MILLIMETRE = 1e-3

# Name, parent, and bone in millimetres, in the parent's axes: X to the left, Y up, Z ahead. In the zero pose
# the arms point up.
TABLE = (
    ("Hips", -1, (0.0, 0.0, 0.0)),
    ("RightUpLeg", 0, (-132.948591, 0.0, 0.0)),
    ("RightLeg", 1, (0.0, -442.894612, 0.0)),
    ("RightFoot", 2, (0.0, -454.206447, 0.0)),
    ("RightToe", 3, (0.0, 0.0, 162.767078)),
    ("RightToeEnd", 4, (0.0, 0.0, 74.999437)),
    ("LeftUpLeg", 0, (132.948826, 0.0, 0.0)),
    ("LeftLeg", 6, (0.0, -442.894413, 0.0)),
    ("LeftFoot", 7, (0.0, -454.206590, 0.0)),
    ("LeftToe", 8, (0.0, 0.0, 162.767426)),
    ("LeftToeEnd", 9, (0.0, 0.0, 74.999948)),
    ("Spine", 0, (0.0, 0.1, 0.0)),
    ("Spine1", 11, (0.0, 233.383263, 0.0)),
    ("Neck", 12, (0.0, 257.077681, 0.0)),
    ("Head", 13, (0.0, 121.134938, 0.0)),
    ("HeadEnd", 14, (0.0, 115.002227, 0.0)),
    ("LeftShoulder", 12, (0.0, 257.077681, 0.0)),
    ("LeftArm", 16, (0.0, 151.034226, 0.0)),
    ("LeftForeArm", 17, (0.0, 278.882773, 0.0)),
    ("LeftHand", 18, (0.0, 251.733451, 0.0)),
    ("LeftHandThumb", 19, (0.0, 0.0, 0.0)),
    ("LeftThumbEnd", 20, (0.0, 0.0, 99.999627)),
    ("LeftWristEnd", 19, (0.0, 100.000188, 0.0)),
    ("LeftHandEnd", 22, (0.0, 0.0, 0.0)),
    ("RightShoulder", 12, (0.0, 257.077681, 0.0)),
    ("RightArm", 24, (0.0, 151.031437, 0.0)),
    ("RightForeArm", 25, (0.0, 278.892924, 0.0)),
    ("RightHand", 26, (0.0, 251.728680, 0.0)),
    ("RightHandThumb", 27, (0.0, 0.0, 0.0)),
    ("RightThumbEnd", 28, (0.0, 0.0, 99.999888)),
    ("RightWristEnd", 27, (0.0, 137.499922, 0.0)),
    ("RightHandEnd", 30, (0.0, 0.0, 0.0)),
)
NAMES = tuple(name for name, _, _ in TABLE)
PARENTS = tuple(parent for _, parent, _ in TABLE)
SKELETON = Skeleton(NAMES, PARENTS, np.array([bone for _, _, bone in TABLE]) * MILLIMETRE)

# The two layouts spell some actions differently.
ACTIONS = {"photo": "takingphoto", "walkdog": "walkingdog", "walktogether": "walkingtogether"}


def find(folder: Path) -> Iterator[tuple[Path, str, str, str]]:
    """The trials below a folder: file, subject ("S5"), action ("walking") and name ("S5/walking_1").

    Where both layouts are there the positions are taken: the same trials, with their place in the room.
    """
    if (folder / POSITIONS).is_file():
        trials = [(folder / POSITIONS, name) for name in sorted(_positions(folder / POSITIONS))]
    else:
        paths = sorted(folder.glob("**/S*/*.txt"))
        trials = [(path, f"{path.parent.name}/{path.stem}") for path in paths]
    for path, name in trials:
        if match := re.fullmatch(r"(S\d+)/([A-Za-z]+)[ _]?\d*", name):
            action = match[2].lower()
            yield path, match[1], ACTIONS.get(action, action), name


def load(path: Path, name: str) -> Clip:
    """A trial that `find` has found. Raises FileError when its file is damaged."""
    if path.name == POSITIONS:
        return _from_positions(_positions(path)[name], name)
    return _from_angles(_angles(path), name)


def seconds(path: Path, name: str) -> float:
    """How long a trial is, without reading its motion where that takes time."""
    if path.name == POSITIONS:
        return len(_positions(path)[name]) / FPS
    return path.read_bytes().count(b"\n") / FPS


# ---- angles


def _angles(path: Path) -> np.ndarray:
    """(F, 99) the numbers of a text file."""
    what, fix = f"cannot read {path}", "Unpack it again: docs/data.md says how the files of Human3.6M look."
    try:
        lines = path.read_text(encoding="ascii").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise FileError(what, f"it is no text of numbers ({error})", fix) from None
    if not lines:
        raise FileError(what, "it is empty", fix)
    frames = []
    for number, line in enumerate(lines, 1):
        words = line.split(",")
        if len(words) != COLUMNS:
            raise FileError(what, f"line {number} has {len(words)} numbers, not {COLUMNS}", fix)
        try:
            frames.append(np.array(words, float))
        except ValueError:
            raise FileError(what, f"line {number} has something that is no number", fix) from None
        if not np.isfinite(frames[-1]).all():
            raise FileError(what, f"line {number} has a value that is not finite", fix)
    return np.array(frames)


def _from_angles(values: np.ndarray, name: str) -> Clip:
    """The clip that 99 columns describe.

    Their matrices turn row vectors: the other way round than their rotation vectors say. The root's columns
    tell how it moves and turns from one frame to the next, in its own axes of the frame before. How it stood
    in the first frame is lost: here it is upright there, faces along Z, and the lowest joint is on the floor.

    (Martinez et al.'s code adds a joint's angles to its bone, as if they were millimetres: a slip, which
    would stretch bones by up to 3 mm, and is left out.)
    """
    turned = rotations.exp(-values[:, 3:].reshape(len(values), len(TABLE), 3))
    moved = values[:, :3] * MILLIMETRE
    root = np.zeros_like(moved)
    before = rotations.identity()
    for frame, turn in enumerate(turned[:, 0].copy()):
        root[frame] = root[max(frame - 1, 0)] + rotations.rotate(before, moved[frame])
        before = turned[frame, 0] = rotations.normalize(rotations.multiply(before, turn))
    clip = Clip(SKELETON, turned, root[:, None], FPS, name=name)
    clip.translation[..., 1] -= clip.slice(0, 1).positions()[..., 1].min()
    return clip


# ---- positions


class _Array:
    """Stands in for numpy.ndarray while a pickle is read: only plain floats, or a list of objects."""

    def __init__(self, *_: Any) -> None:
        self.content: Any = None

    def __setstate__(self, state: tuple[Any, ...]) -> None:
        _, shape, kind, by_columns, content = state
        if kind.name == "O8" and isinstance(content, list):
            self.content = content
        elif kind.name in ("f4", "f8") and isinstance(content, bytes):
            values = np.frombuffer(content, kind.order + kind.name)
            self.content = values.reshape(shape, order="F" if by_columns else "C")
        else:
            raise ValueError(f"an array of {kind.name}")


class _Kind:
    """Stands in for numpy.dtype."""

    def __init__(self, name: str, *_: Any) -> None:
        self.name, self.order = name, "|"

    def __setstate__(self, state: tuple[Any, ...]) -> None:
        self.order = state[1]


class _Bytes:
    """Stands in for _codecs.encode, as which old pickles write bytes."""

    def __new__(cls, text: str, _: str) -> bytes:  # type: ignore[misc]
        return text.encode("latin1")


_MADE = {
    ("numpy.core.multiarray", "_reconstruct"): _Array,
    ("numpy._core.multiarray", "_reconstruct"): _Array,
    ("numpy", "ndarray"): None,  # which class _reconstruct should make
    ("numpy", "dtype"): _Kind,
    ("_codecs", "encode"): _Bytes,
}


class _Unpickler(pickle.Unpickler):
    """Makes dictionaries, texts and arrays of floats, and nothing else: a pickle may hold any program."""

    def find_class(self, module: str, name: str) -> Any:
        try:
            return _MADE[module, name]
        except KeyError:
            raise pickle.UnpicklingError(f"it asks for {module}.{name}, which is no array") from None


@lru_cache(maxsize=1)
def _positions(path: Path) -> dict[str, np.ndarray]:
    """{"S1/Walking 1": (F, 32, 3) float32 metres, Z up}, all trials of the file."""
    what = f"cannot read {path} as positions of Human3.6M"
    fix = "Make it again with prepare_data_h36m.py of VideoPose3D: docs/data.md."
    try:
        with zipfile.ZipFile(path) as archive:
            if sum(member.file_size for member in archive.infolist()) > SIZE_LIMIT:
                raise ValueError(f"unpacked it is larger than {SIZE_LIMIT >> 30} GiB")
            with archive.open("positions_3d.npy") as file:
                version = np.lib.format.read_magic(file)
                headers = np.lib.format.read_array_header_1_0, np.lib.format.read_array_header_2_0
                headers[version[0] - 1](file)
                (subjects,) = _Unpickler(file).load().content
        trials = {
            f"{subject}/{action}": held.content
            for subject, actions in subjects.items()
            for action, held in actions.items()
        }
    except (
        Exception
    ) as error:  # zipfile, NumPy and pickle raise whatever a damaged file makes them stumble over
        detail = (str(error) or type(error).__name__).splitlines()[0]
        raise FileError(what, f"it is damaged or no such file ({detail})", fix) from None
    for name, points in trials.items():
        if not isinstance(points, np.ndarray) or points.shape[1:] != (len(TABLE), 3) or not len(points):
            shape = getattr(points, "shape", "no array")
            raise FileError(what, f"{name} is {shape}, not frames of {len(TABLE)} joints", fix)
        if not np.isfinite(points).all():
            raise FileError(what, f"{name} has values that are not finite", fix)
    return trials


X, Y, Z = np.eye(3)
# What each joint's bone leads to, and where that points in the T-pose. Joints that are not here turn with the
# one above.
ENDS = {"Spine": ("Spine1", Y), "Spine1": ("Neck", Y), "Neck": ("Head", Y), "Head": ("HeadEnd", Y)} | {
    side + joint: (side + end, way)
    for side, out in (("Left", X), ("Right", -X))
    for joint, end, way in (
        *(("UpLeg", "Leg", -Y), ("Leg", "Foot", -Y), ("Foot", "Toe", BONES[JOINTS.index("LeftToe")])),
        *(("Toe", "ToeEnd", Z), ("Shoulder", "Arm", out), ("Arm", "ForeArm", out), ("ForeArm", "Hand", out)),
        *(("Hand", "WristEnd", out), ("HandThumb", "ThumbEnd", Z)),
    )
}
# Where the other joints that have a bone lie.
BESIDE = {"LeftUpLeg": X, "RightUpLeg": -X, "Spine": Y, "LeftShoulder": Y, "RightShoulder": Y}
HINGES = {"LeftUpLeg": X, "RightUpLeg": X, "LeftArm": ELBOW, "RightArm": -ELBOW}
STRAIGHT = 0.1  # sine of the bend of a knee or elbow from which on its plane tells the twist of the limb


def _from_positions(points: np.ndarray, name: str) -> Clip:
    """The clip whose joints are at points (F, 32, 3), Z up, on a skeleton whose zero pose is the T-pose.

    Bones have their median length; those of the data set do not change. Positions do not say how they are
    twisted: knees and elbows are taken for hinges, palms and the lines of hips and shoulders tell the rest.
    """
    points = np.asarray(points, float)[..., [0, 2, 1]] * [1.0, 1.0, -1.0]
    away = points - points[:, np.maximum(PARENTS, 0)]
    towards = np.zeros((len(TABLE), 3))
    for joint, way in (BESIDE | dict(ENDS.values())).items():
        towards[NAMES.index(joint)] = rotations.normalize(way)
    bones = towards * np.median(np.linalg.norm(away, axis=-1), axis=0)[:, None]
    local = kinematics.local_rotations(_turned(points), PARENTS)
    return Clip(Skeleton(NAMES, PARENTS, bones), local, points[:, :1], FPS, name=name)


def _turned(points: np.ndarray) -> np.ndarray:
    """(F, 32, 4) how joints at points (F, 32, 3) are turned from the T-pose, about the axes of the world."""

    def way(start: str, end: str) -> np.ndarray:
        return points[:, NAMES.index(end)] - points[:, NAMES.index(start)]

    turned = np.tile(rotations.identity(), (len(points), len(TABLE), 1))
    hips = _aim(turned[:, 0], X, way("RightUpLeg", "LeftUpLeg"))
    turned[:, 0] = _roll(hips, X, Y, way("Hips", "Spine1"))
    for joint, (name, parent) in enumerate(zip(NAMES, PARENTS)):
        if parent < 0:
            continue
        turn = turned[:, parent]
        if name in ENDS:
            end, bone = ENDS[name]
            turn = _aim(turn, bone, way(name, end))
        if name == "Spine1":
            turn = _roll(turn, bone, X, way("RightArm", "LeftArm"))
        elif name in ("LeftHand", "RightHand"):
            turn = _roll(turn, bone, Z, way(name, name.replace("Hand", "ThumbEnd")))
        elif name in HINGES:
            upper, lower = (rotations.normalize(w) for w in (way(name, end), way(end, ENDS[end][0])))
            stays = rotations.rotate(turn, HINGES[name])
            turn = _roll(turn, bone, HINGES[name], np.cross(upper, lower) + STRAIGHT * stays)
        turned[:, joint] = turn
    return turned


def _aim(turned: np.ndarray, bone: np.ndarray, way: np.ndarray) -> np.ndarray:
    """Rotations (F, 4), turned the short way so that a bone (3,) points along `way` (F, 3)."""
    return rotations.multiply(rotations.between(rotations.rotate(turned, bone), way), turned)


def _roll(turned: np.ndarray, bone: np.ndarray, side: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Rotations (F, 4), turned about a bone (3,) so that its `side` (3,) is nearest to `wanted` (F, 3)."""
    axis = rotations.normalize(rotations.rotate(turned, bone))
    own = rotations.rotate(turned, side)
    own, wanted = (v - (v * axis).sum(-1, keepdims=True) * axis for v in (own, wanted))
    angle = np.arctan2((np.cross(own, wanted) * axis).sum(-1), (own * wanted).sum(-1))
    return rotations.multiply(rotations.exp(angle[:, None] * axis), turned)
