"""Splits are obeyed, published layouts are read, packs keep test performers out."""

from __future__ import annotations

import shutil

import numpy as np
import pytest

from interpose.datasets import Pack, build_pack, clips, split_of
from interpose.datasets.pack import STEP
from interpose.errors import FileError, RequestError
from interpose.formats import load
from interpose.geometry import rotations
from interpose.skeletons import find_humanoid


@pytest.fixture
def published(tmp_path, data):  # type: ignore[no-untyped-def]
    """Empty-handed copies of the published layouts, all with the same small clip in them."""
    names = [
        "lafan1/bvh/walk1_subject1.bvh",
        "lafan1/bvh/run1_subject4.bvh",
        "lafan1/bvh/jumps1_subject5.bvh",
        "lafan1/cuts/dance2_subject1_turn.bvh",
        "lafan1/cuts/dance2_subject4_turn.bvh",
        "lafan1/cuts/dance2_subject5_turn.bvh",
        "bandai/Bandai-Namco-Research-Motiondataset-1/data/dataset-1_bow_normal_001.bvh",
        "bandai/Bandai-Namco-Research-Motiondataset-2/data/dataset-2_walk_normal_001.bvh",
        "bandai/Bandai-Namco-Research-Motiondataset-2/data/dataset-2_walk_youthful_001.bvh",
        "cmu/bvh/02/02_01.bvh",
        "cmu/bvh/08/08_01.bvh",
        "cmu/bvh/16/16_15.bvh",
    ]
    for name in names:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(data / "cmu_walk.bvh", tmp_path / name)
    return tmp_path


def test_splits_of_the_data_sets():
    assert split_of("lafan1", "subject5") == "test"
    assert split_of("lafan1", "subject4") == "validation"
    assert split_of("lafan1", "subject1") == "train"
    assert split_of("bandai", "dataset-2/masculine") == "test"
    assert split_of("bandai", "dataset-1/normal") == "train"
    assert {split_of("cmu", subject) for subject in ("16", "49")} == {"test"}
    assert split_of("cmu", "08") == "validation"
    assert split_of("hdm05", "tr") == "test"


def test_entries_know_performer_label_and_split(published):
    found = {entry.path.stem: entry for entry in clips("lafan1", published)}
    assert found["jumps1_subject5"].split == "test"
    assert found["jumps1_subject5"].label == "jumps"
    assert found["run1_subject4"].split == "validation"
    assert found["dance2_subject1_turn"].split == "train", "cuts only train"
    assert not {"dance2_subject4_turn", "dance2_subject5_turn"} & {*found}, "but nothing of who is judged"
    styles = {entry.performer: entry.split for entry in clips("bandai", published)}
    assert styles == {
        "dataset-1/normal": "train",
        "dataset-2/normal": "test",
        "dataset-2/youthful": "validation",
    }


def test_cmu_loses_its_rest_pose(published):
    entry = clips("cmu", published, "train")[0]
    assert len(entry.load()) == len(load(entry.path)) - 1
    assert entry.seconds() == pytest.approx(len(entry.load()) / entry.load().fps, rel=1e-4)


def test_files_of_other_names_are_none_of_a_data_set(published):
    folder = published / "bandai/Bandai-Namco-Research-Motiondataset-1/data"
    before = len(clips("bandai", published))
    shutil.copy(folder / "dataset-1_bow_normal_001.bvh", folder / "dataset-1_bow_normal_001_copy.bvh")
    assert len(clips("bandai", published)) == before
    (published / "hdm05").mkdir()
    for name in ("HDM_test.amc", "HDM_bd_walk_001_120.amc"):
        (published / "hdm05" / name).touch()
    assert [entry.performer for entry in clips("hdm05", published)] == ["bd"]


def test_pack_holds_positions_and_no_test_performer(published, tmp_path):
    pack = build_pack("cmu", published)
    assert set(pack.performers) == {"02", "08"}
    assert "test" not in pack.splits
    pack.save(tmp_path / "cmu.npz")
    again = Pack.load(tmp_path / "cmu.npz")
    clip = clips("cmu", published, "train")[0].load()
    body = find_humanoid(clip)
    packed = again.positions()[: again.starts[1]]
    assert np.linalg.norm(packed - body.as_canonical(clip), axis=-1).max() < 1e-3
    turned = rotations.exp(again.rotation[: again.starts[1]] * STEP)
    assert rotations.angle(turned, body.rotations(clip)).max() < 2e-4


def test_a_performer_on_two_skeletons_has_two_rest_poses(data, tmp_path):
    """CMU's trials lie there as BVH or as AMC, whose joints have other axes."""
    for path in ("bvh/02/02_01.bvh", "asf_amc/02/02_03.amc", "asf_amc/02/02.asf"):
        (tmp_path / "cmu" / path).parent.mkdir(parents=True, exist_ok=True)
    shutil.copy(data / "cmu_02_03.amc", tmp_path / "cmu/asf_amc/02/02_03.amc")
    shutil.copy(data / "cmu_02.asf", tmp_path / "cmu/asf_amc/02/02.asf")
    alone = build_pack("cmu", tmp_path)
    shutil.copy(data / "cmu_walk.bvh", tmp_path / "cmu/bvh/02/02_01.bvh")
    both = build_pack("cmu", tmp_path)
    row = both.names.tolist().index("02_03")
    part = slice(both.starts[row], both.starts[row + 1])
    assert np.array_equal(both.rotation[part], alone.rotation)
    assert np.array_equal(both.bones[row], alone.bones[0])


def test_what_is_not_there_is_said(tmp_path):
    with pytest.raises(FileError, match="no clips of lafan1"):
        clips("lafan1", tmp_path)
    with pytest.raises(RequestError, match="Did you mean lafan1"):
        clips("lafan", tmp_path)
    (tmp_path / "lafan1").mkdir()
    (tmp_path / "lafan1" / "walk1_subject1.bvh").touch()
    with pytest.raises(RequestError, match="unknown split: validate"):
        clips("lafan1", tmp_path, "validate")
    (tmp_path / "x.npz").write_bytes(b"no pack")
    with pytest.raises(FileError, match="cannot read the pack"):
        Pack.load(tmp_path / "x.npz")
    with (tmp_path / "y.npz").open("wb") as file:
        np.save(file, np.zeros(3))  # one array, and no archive of several
    with pytest.raises(FileError, match="cannot read the pack"):
        Pack.load(tmp_path / "y.npz")
