"""Several clips, and folders of them: each by itself, whatever becomes of the others."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest

from interpose.formats import load, save
from interpose.methods.classical import ZeroVelocity


@pytest.fixture
def takes(take):  # type: ignore[no-untyped-def]
    """A folder with two takes, one of which has a gap, and a damaged one."""
    folder = take.parent / "takes"
    folder.mkdir()
    shutil.copy(take, folder / "a.bvh")
    clip = load(take)
    rotation, translation = clip.rotation.copy(), clip.translation.copy()
    rotation[60:80], translation[60:80] = rotation[59], translation[59]
    save(clip.with_motion(rotation, translation), folder / "b.bvh")
    (folder / "c.bvh").write_text("HIERARCHY\n")
    (folder / "notes.txt").write_text("no clip")
    return folder


def test_a_folder_is_filled_file_by_file(run, takes):
    done = run("fill", "takes", "--method", "spline")
    assert done.code == 3, "one cannot be read"
    assert "nothing to fill in takes/a.bvh" in done.out
    assert "60:80 frozen" in done.out
    assert "c.bvh" in done.err
    assert "2 of 3 files done" in done.err
    assert sorted(path.name for path in takes.glob("*.filled.*")) == ["b.filled.bvh", "b.filled.json"]
    # What was made is no clip of the folder: nothing of it is filled once more.
    (takes / "c.bvh").unlink()
    again = run("fill", "takes", "--method", "spline")
    assert again.code == 2
    assert "--force" in again.err
    assert run("fill", "takes", "--method", "spline", "--force").code == 0
    assert not [*takes.glob("*.filled.filled.*")]


def test_several_files_are_done_and_found_by_programs(run, takes):
    done = run("scan", "takes/b.bvh", "takes/c.bvh", "takes/a.bvh", "takes/b.bvh", "--json")
    assert done.code == 3
    assert [one["input"] for one in done.json] == ["takes/b.bvh", "takes/c.bvh", "takes/a.bvh"]
    assert "c.bvh" in done.json[1]["error"]
    found = [[one["kind"] for one in done.json[at]["findings"]] for at in (0, 2)]
    assert ["frozen" in kinds for kinds in found] == [True, False]


def test_one_output_for_several_files_is_refused(run, takes):
    done = run("denoise", "takes/a.bvh", "takes/b.bvh", "-o", "out.bvh")
    assert done.code == 2
    assert "--output names one file" in done.err
    assert not [*takes.parent.glob("out*")]


def test_a_folder_without_clips_is_said(run, takes):
    (takes / "empty").mkdir()
    done = run("recover", "takes/empty")
    assert done.code == 3
    assert "no motion file in it" in done.err


def test_results_go_into_a_folder_and_folders_within_folders_are_looked_into(run, takes):
    (takes / "day").mkdir()
    (takes / "c.bvh").rename(takes / "day" / "c.bvh")
    shutil.copy(takes / "b.bvh", takes / "day" / "d.bvh")
    done = run("scan", "takes", "--json")
    names = ["takes/a.bvh", "takes/b.bvh", "takes/day/c.bvh", "takes/day/d.bvh"]
    assert [one["input"] for one in done.json] == names
    assert run("fill", "takes", "--method", "spline", "-o", "done/").code == 3
    done = takes.parent / "done"
    made = sorted(str(path.relative_to(done)) for path in done.rglob("*.*"))
    assert made == ["b.bvh", "b.json", "day/d.bvh", "day/d.json"]
    assert not [*takes.rglob("*.filled.*")]


def test_an_empty_folder_keeps_nobody_from_the_others(run, takes):
    (takes / "c.bvh").unlink()
    (takes.parent / "empty").mkdir()
    done = run("fill", "empty", "takes/b.bvh", "--method", "spline")
    assert done.code == 3
    assert "no motion file in it" in done.err
    assert (takes / "b.filled.bvh").exists()


def test_what_another_verb_restores_is_said_of_each_clip(run, takes):
    """Hips that stand still are no gap: `fill` leaves them, and says so by its exit code, too."""
    clip = load(takes / "a.bvh")
    translation = clip.translation.copy()
    translation[60:100] = translation[59]
    save(clip.with_motion(clip.rotation, translation), takes / "a.bvh", force=True)
    (takes / "c.bvh").unlink()
    done = run("fill", "takes", "--method", "spline", "--json")
    assert done.code == 4
    assert "hips that stand still, which `interpose recover` restores" in done.json[0]["left"]


def test_takes_of_one_name_in_two_folders_stay_apart(run, takes):
    (takes / "c.bvh").unlink()
    (takes / "a.bvh").unlink()
    (takes / "day").mkdir()
    shutil.copy(takes / "b.bvh", takes / "day" / "b.bvh")
    assert run("fill", "takes", "--method", "spline", "-o", "takes/done").code == 0
    made = sorted(str(path.relative_to(takes / "done")) for path in (takes / "done").rglob("*.bvh"))
    assert made == ["b.bvh", "day/b.bvh"]
    # What lies in the folder of results is none of the takes.
    assert run("fill", "takes", "--method", "spline", "-o", "takes/done", "--force").code == 0
    assert not (takes / "done" / "done").exists()
    done = run("fill", "takes/b.bvh", "takes/day/b.bvh", "-o", "flat")
    assert done.code == 2
    assert "two results would have one name" in done.err


def test_a_take_with_a_dot_in_its_name_is_a_take(run, takes):
    (takes / "c.bvh").rename(takes / "b.take2.bvh")
    done = run("scan", "takes", "--json")
    assert [one["input"] for one in done.json] == ["takes/a.bvh", "takes/b.bvh", "takes/b.take2.bvh"]


def test_what_nobody_foresaw_of_one_clip_keeps_nobody_from_the_others(run, takes, monkeypatch):
    """A method of somebody else that fails, and a folder that cannot be made."""
    (takes / "c.bvh").unlink()
    monkeypatch.setattr(ZeroVelocity, "complete", lambda *_: 1 / 0)
    done = run("fill", "takes", "--gap", "60:80", "--method", "zero-velocity", "--json")
    assert done.code == 2
    assert [one["input"] for one in done.json] == ["takes/a.bvh", "takes/b.bvh"]
    assert "the method zero-velocity does not work" in done.json[0]["error"]
    assert "ZeroDivisionError" in done.json[0]["why"]
    (takes.parent / "file").write_text("no folder")
    done = run("fill", "takes", "--gap", "60:80", "--method", "spline", "-o", "file/sub", "--json")
    assert [one["code"] for one in done.json] == [3, 3]
    assert len(done.err.splitlines()) == 7


def test_what_could_not_be_done_counts_before_what_was_left_open(run, takes):
    done = run("fill", "takes/b.bvh", "takes/c.bvh", "--gap", "60:80", "--method", "spline", "--max-gap", "9")
    assert done.code == 3


def test_reports_of_two_formats_of_a_take_do_not_meet(run, takes):
    save(load(takes / "b.bvh"), takes / "b.npz")
    done = run("fill", "takes/b.bvh", "takes/b.npz", "--gap", "60:80", "--method", "spline")
    assert done.code == 2
    assert "two results would have one name" in done.err
    assert run("scan", "takes/b.bvh", "takes/b.npz").code == 0


def test_one_clip_goes_into_a_folder_too(run, takes):
    (takes / "done").mkdir()
    assert run("fill", "takes/b.bvh", "--gap", "60:80", "--method", "spline", "-o", "takes/done").code == 0
    assert (takes / "done" / "b.bvh").exists()


def test_a_dry_run_knows_that_the_folder_will_be_made(run, take):
    """And makes none."""
    folder = take.parent / "takes"
    folder.mkdir()
    for name in ("a.bvh", "b.bvh"):
        (folder / name).write_bytes(take.read_bytes())
    done = run("fill", "takes", "--gap", "20:30", "-o", "new", "--dry-run")
    assert done.code == 0
    assert "That would end with" not in done.out
    assert not (take.parent / "new").exists()
    assert run("fill", "take.bvh", "--gap", "20:30", "-o", "new/x.bvh", "--dry-run").code == 2


@pytest.mark.skipif(os.name == "nt", reason="links need rights there")
def test_linked_folders_are_looked_into_once(run, take):
    folder, kept = take.parent / "takes", take.parent / "kept"
    for one in (folder, kept):
        one.mkdir()
    take.rename(kept / "a.bvh")
    (folder / "linked").symlink_to(kept)
    (kept / "round").symlink_to(folder)
    done = run("scan", "takes", "--json")
    assert [Path(one["input"]).parts for one in done.json] == [("takes", "linked", "a.bvh")]
