"""Human3.6M in its two layouts, from small files made of a walk; its real files cannot be passed on."""

from __future__ import annotations

import pickle
import zipfile

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from interpose.datasets import build_pack, clips, h36m, trains_shipped_weights
from interpose.errors import FileError
from interpose.geometry import rotations
from interpose.skeletons import JOINTS, find_humanoid, find_mapping

FRAMES = 60
ARMS = ("Shoulder", "Arm", "ForeArm", "Hand")


def matrices(q: np.ndarray) -> np.ndarray:
    return Rotation.from_quat(np.roll(q, -1, axis=-1)).as_matrix()


@pytest.fixture(scope="module")
def walk(cmu_walk):  # type: ignore[no-untyped-def]
    """(F, 32, 3, 3) how joints are turned from the T-pose, and (F, 3) metres, the hips, in a real walk."""
    body = find_humanoid(cmu_walk)
    turned, root = body.rotations(cmu_walk)[:FRAMES], body.root(cmu_walk)[:FRAMES]
    alias = {"Spine1": "Spine2"}
    made = np.empty((FRAMES, 32, 3, 3))
    for joint, (name, parent) in enumerate(zip(h36m.NAMES, h36m.PARENTS)):
        canonical = alias.get(name, name)
        known = canonical in JOINTS
        made[:, joint] = matrices(turned[:, JOINTS.index(canonical)]) if known else made[:, parent]
    return made, root


@pytest.fixture(scope="module")
def angles(walk):  # type: ignore[no-untyped-def]
    """The walk as the 99 columns, and where its joints are, both by the letter of the published code.

    Matrices turn row vectors there; the root is told by its changes from frame to frame: the first is none.
    """
    turned, root = walk
    rows = np.empty((FRAMES, 32, 3, 3))  # row vectors: global, from the zero pose, in which arms point up
    for joint, name in enumerate(h36m.NAMES):
        side, up = name.startswith("Left") - name.startswith("Right"), np.eye(3)
        if any(joint == h36m.NAMES.index(s + a) for s in ("Left", "Right") for a in ARMS) or "Wrist" in name:
            up = Rotation.from_euler("z", -90 * side, degrees=True).as_matrix()
        rows[:, joint] = np.swapaxes(turned[:, joint] @ up, 1, 2)
    values = np.zeros((FRAMES, 99))
    for frame in range(FRAMES):
        before = max(frame - 1, 0)
        values[frame, :3] = rows[before, 0] @ (1000 * (root[frame] - root[before]))
        change = rows[frame, 0] @ rows[before, 0].T
        values[frame, 3:6] = Rotation.from_matrix(change).as_rotvec()
        for joint, parent in list(enumerate(h36m.PARENTS))[1:]:
            local = rows[frame, joint] @ rows[frame, parent].T
            values[frame, 3 + 3 * joint : 6 + 3 * joint] = Rotation.from_matrix(local).as_rotvec()
    return values, positions_of(values)


def positions_of(values: np.ndarray) -> np.ndarray:
    """(F, 32, 3) millimetres: frame by frame, joint by joint."""
    before, place, found = np.eye(3), np.zeros(3), np.empty((len(values), 32, 3))
    for frame, row in enumerate(values):
        place = place + row[:3] @ before
        turned = [Rotation.from_rotvec(row[3:6]).as_matrix() @ before]
        found[frame, 0] = place
        for joint, (_, parent, bone) in list(enumerate(h36m.TABLE))[1:]:
            found[frame, joint] = np.array(bone) @ turned[parent] + found[frame, parent]
            own = Rotation.from_rotvec(row[3 + 3 * joint : 6 + 3 * joint]).as_matrix()
            turned.append(own @ turned[parent])
        before = turned[0]
    return found


def write(path, values) -> None:  # type: ignore[no-untyped-def]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("".join(",".join(f"{value:.7f}" for value in row) + "\n" for row in values))


@pytest.fixture
def published(tmp_path, angles):  # type: ignore[no-untyped-def]
    for name in ("S1/walking_1", "S5/walkingdog_2", "S11/eating_1"):
        write(tmp_path / "h36m" / "h3.6m" / "dataset" / f"{name}.txt", angles[0])
    return tmp_path


def test_entries_have_the_standard_split(published):
    found = {entry.name: entry for entry in clips("h36m", published)}
    assert {name: (e.performer, e.label, e.split) for name, e in found.items()} == {
        "S1/walking_1": ("S1", "walking", "train"),
        "S5/walkingdog_2": ("S5", "walkingdog", "test"),
        "S11/eating_1": ("S11", "eating", "validation"),
    }
    assert found["S1/walking_1"].seconds() == FRAMES / 50
    assert not trains_shipped_weights("h36m")


def test_angles_are_those_of_the_published_kinematics(published, angles):
    clip = clips("h36m", published, "train")[0].load()
    assert (clip.fps, len(clip), clip.name) == (50.0, FRAMES, "S1/walking_1")
    placed, expected = clip.positions(), angles[1] / 1000
    expected[..., 1] -= expected[0, :, 1].min()  # the lowest joint of the first frame is on the floor
    np.testing.assert_allclose(placed, expected, atol=1e-5)
    for joint, (_, parent, bone) in list(enumerate(h36m.TABLE))[1:]:
        length = np.linalg.norm(placed[:, joint] - placed[:, parent], axis=-1)
        np.testing.assert_allclose(length, np.linalg.norm(bone) / 1000, atol=1e-9)
    # The walk itself, but for how it stood in the first frame: it gets as far, and bends its knees backwards.
    assert np.linalg.norm(np.diff(clip.root, axis=0), axis=1).sum() > 0.5
    assert not find_humanoid(clip).left_handed


def test_the_canonical_joints_are_found_by_name():
    mapping = find_mapping(h36m.SKELETON)
    assert mapping.usable
    assert mapping.missing == ("Spine1",)
    found = dict(zip(JOINTS, mapping.joints))
    assert [h36m.NAMES[found[j]] for j in ("Hips", "Spine2", "LeftToe", "RightForeArm", "Head")] == [
        "Hips", "Spine1", "LeftToe", "RightForeArm", "Head",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("spoil", "why"),
    [
        (lambda lines: [], "it is empty"),
        (lambda lines: [*lines[:3], lines[3].rsplit(",", 1)[0]], "line 4 has 98 numbers, not 99"),
        (lambda lines: [lines[0] + ",0"], "line 1 has 100 numbers, not 99"),
        (
            lambda lines: [lines[0], "nan," + lines[1].split(",", 1)[1]],
            "line 2 has a value that is not finite",
        ),
        (lambda lines: ["x" + lines[0]], "line 1 has something that is no number"),
        (lambda lines: ["ü" + lines[0]], "it is no text of numbers"),
    ],
)
def test_damaged_angles_are_refused(published, spoil, why):
    entry = clips("h36m", published, "train")[0]
    lines = entry.path.read_text().splitlines()[:5]
    entry.path.write_text("\n".join(spoil(lines)), encoding="utf-8")
    with pytest.raises(FileError) as error:
        entry.load()
    assert why in error.value.why
    assert error.value.what.endswith("walking_1.txt")
    assert error.value.fix


def test_packs_are_at_their_own_rate(published):
    lines = build_pack("h36m", published)
    assert set(lines.performers) == {"S1", "S11"}
    assert lines.seconds[0] == pytest.approx(FRAMES / 50, abs=1 / 30)


# ---- positions


@pytest.fixture
def points(walk):  # type: ignore[no-untyped-def]
    """(F, 32, 3) float32 metres, Z up: the walk on the data set's bones, in the T-pose along the axes."""
    turned, root = walk
    placed = np.empty((FRAMES, 32, 3))
    placed[:, 0] = root
    for joint, (name, parent, bone) in list(enumerate(h36m.TABLE))[1:]:
        side, bone = name.startswith("Left") - name.startswith("Right"), np.array(bone)
        if name.endswith(("Arm", "LeftHand", "RightHand", "WristEnd")):
            bone = np.array([side * np.linalg.norm(bone), 0, 0])
        placed[:, joint] = placed[:, parent] + turned[:, parent] @ bone / 1000
    x, y, z = np.moveaxis(placed, -1, 0)
    return np.stack([x, -z, y], axis=-1).astype(np.float32)


def test_positions_come_back_with_limbs_that_are_hinges(tmp_path, points, walk):
    held = {"S1": {"Walking 1": points}, "S5": {"WalkDog": points[:5]}, "S11": {"Photo 1": points[:5]}}
    (tmp_path / "h36m").mkdir()
    np.savez_compressed(tmp_path / "h36m" / h36m.POSITIONS, positions_3d=held)
    found = {e.name: (e.performer, e.label, e.split) for e in clips("h36m", tmp_path)}
    assert found == {
        "S1/Walking 1": ("S1", "walking", "train"),
        "S5/WalkDog": ("S5", "walkingdog", "test"),
        "S11/Photo 1": ("S11", "takingphoto", "validation"),
    }
    entry = clips("h36m", tmp_path, "train")[0]
    clip = entry.load()
    assert entry.seconds() == FRAMES / 50
    x, y, z = np.moveaxis(points.astype(float), -1, 0)
    np.testing.assert_allclose(clip.positions(), np.stack([x, z, -y], axis=-1), atol=2e-4)
    body = find_humanoid(clip)
    assert (body.rest.how, body.rest.pose, body.left_handed) == ("zero pose", "T", False)
    # Twists are not in positions: they come back nearly, and without jumps.
    turned = body.rotations(clip)
    for name, least in (
        ("Hips", 10),
        ("LeftUpLeg", 5),
        ("RightLeg", 5),
        ("LeftArm", 15),
        ("RightForeArm", 15),
    ):
        truth = rotations.from_matrix(walk[0][:, h36m.NAMES.index(name)])
        own = turned[:, JOINTS.index(name)]
        assert np.degrees(rotations.angle(own, truth)).mean() < least, name
        steps = [np.degrees(rotations.angle(q[1:], q[:-1])).max() for q in (own, truth)]
        assert steps[0] < steps[1] + 1, name


class Hostile:
    def __reduce__(self):  # type: ignore[no-untyped-def]
        return (exec, ("raise SystemExit('executed')",))


@pytest.mark.parametrize(
    ("held", "why"),
    [
        (Hostile(), "builtins.exec"),
        ({"S1": {"Walking": Hostile()}}, "builtins.exec"),
        ({"S1": {"Walking": np.zeros((3, 17, 3), np.float32)}}, "not frames of 32 joints"),
        ({"S1": {"Walking": np.zeros((0, 32, 3), np.float32)}}, "not frames of 32 joints"),
        ({"S1": {"Walking": np.full((3, 32, 3), np.nan, np.float32)}}, "not finite"),
        ({"S1": {"Walking": np.zeros((3, 32, 3), np.complex64)}}, "an array of c8"),
        ({"S1": {"Walking": "text"}}, "damaged"),
        ([1, 2], "damaged"),
    ],
)
def test_pickles_hold_arrays_and_nothing_else(tmp_path, held, why):
    (tmp_path / "h36m").mkdir()
    packed = np.empty((), object)
    packed[()] = held
    np.savez(tmp_path / "h36m" / h36m.POSITIONS, positions_3d=packed)
    with pytest.raises(FileError) as error:
        clips("h36m", tmp_path)
    assert why in error.value.why
    assert error.value.fix


@pytest.mark.parametrize("protocol", [2, 3, 4])
def test_pickles_of_every_age_are_read(tmp_path, points, protocol):
    """Files of old and new versions of NumPy differ in the protocol."""
    packed = np.empty((), object)
    packed[()] = {"S1": {"Walking": points, "Eating": np.asfortranarray(points)}}
    path = tmp_path / h36m.POSITIONS
    with zipfile.ZipFile(path, "w") as archive, archive.open("positions_3d.npy", "w") as file:
        np.lib.format.write_array_header_1_0(file, {"descr": "|O", "fortran_order": False, "shape": ()})
        pickle.dump(packed, file, protocol=protocol)
    for _, _, _, name in h36m.find(tmp_path):
        np.testing.assert_allclose(h36m.load(path, name).root[:, 1], points[:, 0, 2], atol=1e-7)


def test_a_truncated_file_of_positions_is_refused(tmp_path, points):
    path = tmp_path / "h36m" / h36m.POSITIONS
    path.parent.mkdir()
    np.savez(path, positions_3d={"S1": {"Walking": points}})
    path.write_bytes(path.read_bytes()[:-200])
    with pytest.raises(FileError, match="damaged"):
        clips("h36m", tmp_path)
    np.savez(path, something_else=np.zeros(3))
    with pytest.raises(FileError, match="positions_3d"):
        clips("h36m", tmp_path)
