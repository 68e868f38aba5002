"""Fine-tuning on a user's own clips, from their folder to a method that fills with the new weights."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("torch")

from interpose.cli import main
from interpose.clip import Clip
from interpose.datasets.own import own_pack
from interpose.errors import FileError
from interpose.formats import load, save


@pytest.fixture
def takes(data, tmp_path, monkeypatch):  # type: ignore[no-untyped-def]
    """A folder with two takes and what else lies in such a folder."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "takes" / "day 1").mkdir(parents=True)
    clip = load(data / "cmu_walk.bvh")
    longer = np.r_[0 : len(clip), len(clip) - 2 : 0 : -1]  # to and fro
    save(clip.with_motion(clip.rotation[longer], clip.translation[longer]), tmp_path / "takes" / "a.bvh")
    shutil.copy(data / "cmu_run.bvh", tmp_path / "takes" / "day 1" / "run.bvh")
    (tmp_path / "takes" / "notes.txt").write_text("not a clip")
    (tmp_path / "takes" / "broken.bvh").write_text("HIERARCHY\n")
    return tmp_path / "takes"


def test_a_part_is_held_out_and_what_cannot_be_used_is_said(takes):
    said: list[str] = []
    pack = own_pack(takes, 56, said.append)
    assert [line.split(" (")[0] for line in said] == ["left out: broken.bvh"]
    frames = np.diff(pack.starts)
    assert pack.splits.tolist() == ["train", "validation"] * 2
    for whole in (frames[:2], frames[2:]):
        assert whole[1] == whole.sum() // 5
    # The same bones are one performer's.
    assert pack.performers.tolist() == ["0", "0", "1", "1"]


def test_of_many_takes_each_fifth_is_held_out(takes):
    clip = load(takes / "a.bvh")
    for number in range(5):
        save(clip.slice(number + 1, len(clip)), takes / f"z{number}.bvh")
    assert own_pack(takes, 56).splits.tolist() == ["train"] * 4 + ["validation"] + ["train"] * 2


def test_a_short_fifth_take_does_not_keep_the_others_from_being_used(takes):
    clip = load(takes / "a.bvh")
    for number in range(3):
        save(clip.slice(number, number + 40), takes / f"b{number}.bvh")
    save(clip.slice(1, len(clip)), takes / "z.bvh")
    assert own_pack(takes, 56).splits.tolist() == ["train", "validation"] * 6


def test_a_take_that_is_there_twice_is_not_learned_from_and_held_out(takes):
    """In another format, too, and under another name."""
    clip = load(takes / "a.bvh")
    for number in range(4):
        save(clip.slice(number + 1, len(clip)), takes / f"z{number}.bvh")
    once = own_pack(takes, 56)
    save(load(takes / "z3.bvh"), takes / "day 1" / "z3.npz")
    shutil.copy(takes / "a.bvh", takes / "z4.bvh")
    said: list[str] = []
    assert len(own_pack(takes, 56, said.append).names) == len(once.names)
    assert sum("once more" in line for line in said) == 2


def test_of_a_take_and_its_copy_zeros_may_differ_in_their_sign(takes):
    """As numbers of another format do that are rounded to them."""
    clip = load(takes / "a.bvh")
    still = np.repeat(clip.translation[:1], len(clip), axis=0)
    below = still - 1e-9 * (np.arange(len(clip)) > 0)[:, None, None]
    save(clip.with_motion(clip.rotation, still), takes / "still.npz")
    count = len(own_pack(takes, 56).names)
    save(clip.with_motion(clip.rotation, below), takes / "still again.npz")
    assert len(own_pack(takes, 56).names) == count


def test_a_take_that_is_walked_in_place_is_another_one(takes):
    clip, count = load(takes / "a.bvh"), len(own_pack(takes, 56).names)
    here = clip.with_motion(clip.rotation, np.repeat(clip.translation[:1], len(clip), axis=0))
    save(here, takes / "treadmill.bvh")
    assert len(own_pack(takes, 56).names) > count


def test_what_interpose_made_is_no_take(takes):
    """What else lies beside a take, as the labels of Bandai-Namco's, is no report."""
    shutil.copy(takes / "a.bvh", takes / "a.filled.bvh")
    report = dict.fromkeys(("interpose", "method", "seed", "gaps", "open"))
    (takes / "a.filled.json").write_text(json.dumps(report))
    (takes / "a.json").write_text('{"label": "walk"}')
    said: list[str] = []
    names = own_pack(takes, 56, said.append).names
    assert "a.filled.bvh" not in names
    assert "a.bvh" in names
    assert any("interpose made it" in line for line in said)
    with pytest.raises(FileError, match="there is no folder"):
        own_pack(takes / "none", 56)


def test_takes_that_are_too_short_are_refused(takes):
    (takes / "a.bvh").unlink()
    with pytest.raises(FileError, match="too short"):
        own_pack(takes, 56)
    shutil.rmtree(takes / "day 1")
    with pytest.raises(FileError, match="no clips to learn from"):
        own_pack(takes, 56)


def test_weights_of_ones_own_are_made_judged_and_used(takes, data, capsys):
    words = ["--budget", "2steps", "--set", "batch=2", "--set", "longest=20"]
    assert main(["train", "--from", "small", "--data", str(takes), "--out", "mine", *words]) == 0
    told = capsys.readouterr().out
    assert "before" in told
    assert "30 frames" in told
    card = json.loads(Path("mine/small.json").read_text())
    assert [one["name"] for one in card["data"]] == ["lafan1", "bandai", "pfnn", "cmu", "own"]
    assert "your own clips" in card["licence"]
    assert card["training"]["earlier"][-1]["recipe"].startswith("interpose train base")
    assert card["training"]["recipe"].startswith("interpose train --from")
    assert card["training"]["steps"] == 2
    steps = [json.loads(line)["step"] for line in Path("mine/log.jsonl").read_text().splitlines()]
    assert max(steps) == 2  # what it began with was measured on other clips
    shutil.copy(data / "cmu_walk.bvh", "take.bvh")
    assert main(["fill", "take.bvh", "--gap", "60:80", "--method", "mine"]) == 0
    assert json.loads(Path("take.filled.json").read_text())["gaps"][0]["method"] == "mine"
    assert main(["fill", "take.bvh", "--gaps", "take.filled.json", "-o", "again.bvh"]) == 0
    assert Path("again.bvh").read_text() == Path("take.filled.bvh").read_text()
    capsys.readouterr()
    assert main(["train", "--data", str(takes), "--out", "mine", *words]) == 2
    assert "has weights already" in capsys.readouterr().err
    assert main(["train", "--from", "mine", "--data", str(takes), "--out", "mine", *words]) == 2
    assert "has weights already" in capsys.readouterr().err, "and once more they may be tuned"
    Path("mine/small.onnx").unlink()
    (takes / "a.bvh").rename(takes / "b.bvh")
    assert main(["train", "--data", str(takes), "--out", "mine", *words]) == 2
    assert "cannot go on" in capsys.readouterr().err
    assert main(["train", "--from", "cae", "--data", str(takes), "--out", "other"]) == 2
    assert "cannot be fine-tuned" in capsys.readouterr().err
    assert not Path("other").exists()


def test_weights_that_are_there_are_not_replaced(tmp_path, capsys):
    run, out = tmp_path / "run", tmp_path / "weights"
    run.mkdir()
    out.mkdir()
    for name in ("averaged.pt", "log.jsonl", "settings.json"):
        (run / name).touch()
    (out / "small.onnx").write_text("trained for hours")
    assert main(["export", "base", "--run", str(run), "--out", str(out)]) == 3
    assert "--force" in capsys.readouterr().err
    assert (out / "small.onnx").read_text() == "trained for hours"


def test_takes_of_one_rig_may_move_different_joints(takes):
    """As two programs export them: the root alone, or positions of every joint."""
    clip = load(takes / "a.bvh")
    clip = clip.slice(1, len(clip))
    everything = tuple(range(len(clip.skeleton)))
    save(Clip(clip.skeleton, clip.rotation, clip.local_translation(), clip.fps, everything), takes / "b.bvh")
    pack = own_pack(takes, 56)
    assert len(pack.splits) == 6
    assert np.allclose(pack.bones[0], pack.bones[2], atol=1e-4)
