"""Several clips, and folders of them: each by itself, whatever becomes of the others."""

from __future__ import annotations

import errno
import io
import os
import shutil
from pathlib import Path

import pytest

from interpose.cli.outputs import Outputs
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
    assert "is one file" in done.err
    assert not [*takes.parent.glob("out*")]


def test_a_folder_without_clips_is_said(run, takes):
    (takes / "empty").mkdir()
    done = run("recover", "takes/empty")
    assert done.code == 3
    assert "no motion file in it" in done.err


def test_links_to_nothing_and_closed_folders_are_not_left_out(run, takes, monkeypatch):
    (takes / "c.bvh").unlink()
    (takes / "d.bvh").symlink_to("nowhere.bvh")
    closed, look = takes / "closed", os.scandir
    closed.mkdir()

    def scandir(path):  # type: ignore[no-untyped-def]
        if Path(path) == Path("takes/closed"):
            raise PermissionError(errno.EACCES, "Permission denied", str(path))
        return look(path)

    monkeypatch.setattr(os, "scandir", scandir)
    done = run("scan", "takes", "--json")
    assert done.code == 3
    told = {Path(one["input"]).name: one for one in done.json}
    assert {*told} == {"a.bvh", "b.bvh", "closed", "d.bvh"}
    assert told["closed"]["why"] == "Permission denied"
    assert "link to nowhere.bvh" in told["d.bvh"]["why"]
    assert run("scan", "takes/closed", "--json").code == 3


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


def test_a_batch_goes_on_where_it_stopped(run, takes, monkeypatch):
    """The list, the code and the files are as if it had not been interrupted."""
    (takes / "c.bvh").unlink()
    for name in ("d.bvh", "e.bvh"):
        shutil.copy(takes / "b.bvh", takes / name)
    fill = ("fill", "takes", "--gap", "60:80", "--gap", "90:99", "--max-gap", "9", "--method", "spline")
    asked = 0

    def stopped(*_):  # type: ignore[no-untyped-def]
        nonlocal asked
        asked += 1
        if asked == 3:
            raise KeyboardInterrupt
        return True

    monkeypatch.setattr(Outputs, "told", stopped)
    first = run(*fill)
    assert first.code == 130
    assert "interrupted before 2" in first.err
    monkeypatch.undo()
    monkeypatch.chdir(takes.parent)
    before = {path: path.stat().st_mtime_ns for path in takes.glob("*.filled.*")}
    assert len(before) == 6
    (takes / "d.filled.bvh").unlink()  # as if it had not come so far
    (takes / "d.filled.json").unlink()
    again = run(*fill, "--skip-existing", "--json")
    assert again.code == 4, "one gap of each stays open"
    assert [one.get("skipped", False) for one in again.json] == [True, True, False, False]
    assert [one["code"] for one in again.json] == [4] * 4
    assert "2 skipped, as their results were there; 4 with something left open" in again.err
    assert "0 of 4 files done" in again.err, "those that are left open are none that are done"
    assert len([*takes.glob("*.filled.*")]) == 8
    for name in ("a.filled.bvh", "b.filled.json"):
        assert (takes / name).stat().st_mtime_ns == before[takes / name]
    assert run("fill", "takes/a.bvh", "--gap", "60:80", "--skip-existing").code == 4


def test_what_another_verb_or_nobody_knows_who_made_is_not_skipped(run, takes):
    (takes / "c.bvh").unlink()
    assert run("denoise", "takes", "-o", "done").code == 0
    done = run("fill", "takes", "--gap", "60:80", "--method", "spline", "-o", "done", "--skip-existing")
    assert done.code == 2
    assert "the file exists already" in done.err
    (takes.parent / "done" / "a.json").unlink()
    assert run("denoise", "takes/a.bvh", "-o", "done", "--skip-existing").code == 2
    refused = run("denoise", "takes", "-o", "done", "--skip-existing", "--force")
    assert refused.code == 2
    assert "--skip-existing does not go with --force" in refused.err


def test_a_full_disk_leaves_no_half_of_a_result(run, takes, monkeypatch):
    """Nor a clip without its report, which no later run would replace."""

    def full(path, *_, **__):  # type: ignore[no-untyped-def]
        path.touch()
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "write_text", full)
    done = run("denoise", "takes/a.bvh")
    assert done.code == 3
    assert "a.denoised.json" in done.err
    assert "No space left" in done.err
    assert sorted(path.name for path in takes.iterdir()) == ["a.bvh", "b.bvh", "c.bvh", "notes.txt"]


def test_a_long_name_is_no_hindrance(run, takes):
    """255 bytes are what most file systems take, and 250 are needed here."""
    name = "a" * 237
    (takes / "a.bvh").rename(takes / f"{name}.bvh")
    assert run("denoise", f"takes/{name}.bvh").code == 0
    assert (takes / f"{name}.denoised.json").exists()


@pytest.mark.skipif(os.name == "nt", reason="links need rights there")
def test_a_linked_clip_keeps_no_other_from_its_result(run, takes):
    (takes / "c.bvh").unlink()
    (takes / "linked.bvh").symlink_to(takes / "a.bvh")
    assert run("denoise", "takes", "takes/a.bvh", "-o", "done").code == 0
    made = sorted(path.name for path in (takes.parent / "done").glob("*.bvh"))
    assert made == ["a.bvh", "b.bvh", "linked.bvh"]


def test_who_reads_along_may_stop(run, takes, monkeypatch):
    def stopped(*_):  # type: ignore[no-untyped-def]
        raise BrokenPipeError

    monkeypatch.setattr("interpose.cli.scan.describe", stopped)
    monkeypatch.setattr("interpose.cli.os.dup2", lambda *_: None)
    monkeypatch.setattr("sys.stdout.fileno", lambda: 1, raising=False)
    done = run("scan", "takes")
    assert done.code == 0
    assert "foreseen" not in done.err


def test_two_processes_may_meet(run, takes, monkeypatch):
    """What another one has written meanwhile is skipped, as what was there before."""
    assert run("denoise", "takes/a.bvh", "-o", "other.bvh").code == 0
    check = Outputs.check

    def meanwhile(self, *given, **named):  # type: ignore[no-untyped-def]
        for suffix in (".bvh", ".json"):
            shutil.copy(takes.parent / f"other{suffix}", self.clip.with_suffix(suffix))
        check(self, *given, **named)

    monkeypatch.setattr(Outputs, "check", meanwhile)
    assert run("denoise", "takes/a.bvh", "takes/b.bvh").code == 2
    for made in takes.glob("*.denoised.*"):
        made.unlink()
    done = run("denoise", "takes/a.bvh", "takes/b.bvh", "--skip-existing")
    assert done.code == 0
    assert "0 of 2 files done; 2 skipped" in done.err


def test_a_file_that_looks_like_an_option_is_one(run, takes):
    (takes / "a.bvh").rename(takes.parent / "-a.bvh")
    assert "Write ./-a.bvh for the file." in run("scan", "-a.bvh").err
    assert run("scan", "./-a.bvh").code == 0


def test_a_log_in_a_narrow_encoding_takes_any_name(run, takes, monkeypatch):
    (takes / "a.bvh").rename(takes / "\u65e5\u672c \u00fc.bvh")
    log = io.TextIOWrapper(io.BytesIO(), encoding="cp1252")
    monkeypatch.setattr("sys.stdout", log)
    done = run("denoise", "takes/\u65e5\u672c \u00fc.bvh")
    assert done.code == 0
    assert b"\\u65e5\\u672c \xfc.denoised.bvh" in log.buffer.getvalue()  # type: ignore[attr-defined]


def test_a_rig_that_is_no_file_of_a_known_format_says_so(run, takes):
    for rig in ("rig", "takes"):
        done = run("convert", "takes", "new", "--onto", rig)
        assert done.code in (2, 3)
        assert "should have foreseen" not in done.err
        assert rig in done.err


def test_a_folder_is_converted_into_a_folder(run, takes):
    (takes / "day").mkdir()
    (takes / "b.bvh").rename(takes / "day" / "b.bvh")
    done = run("convert", "takes", "half", "--fps", "15", "--drop-repeated")
    assert done.code == 3, "one cannot be read"
    assert "2 of 3 files done; 1 could not be done: takes/c.bvh" in done.err
    made = takes.parent / "half"
    assert sorted(str(path.relative_to(made)) for path in made.rglob("*.*")) == ["a.bvh", "day/b.bvh"]
    assert load(made / "day" / "b.bvh").fps == 15
    (takes / "c.bvh").unlink()
    assert run("convert", "takes", "half").code == 2, "nothing is overwritten"
    (made / "a.bvh").unlink()
    again = run("convert", "takes", "half", "--fps", "15", "--skip-existing")
    assert again.code == 0
    assert "1 of 2 files done; 1 skipped" in again.err
    assert run("convert", "takes", "other", "--to", "npz").code == 0
    assert (takes.parent / "other" / "day" / "b.npz").exists()
    assert run("convert", "takes/a.bvh", "other").code == 0, "one clip goes into a folder, too"
    assert run("convert", "takes/a.bvh", "-o", "c.npz").code == 0, "as other verbs say it"
    assert run("convert", "takes/a.bvh", "-o", "c.npz").code == 2
    assert (takes.parent / "other" / "a.bvh").exists()
    assert "does not apply to one file" in run("convert", "takes/a.bvh", "a.npz", "--to", "npz").err


def test_what_a_batch_has_made_is_not_taken_for_more(run, takes):
    """As takes/*.bvh names it when the batch goes on."""
    (takes / "c.bvh").unlink()
    for _ in range(2):
        named = sorted(takes.glob("*.bvh"))
        assert run("denoise", *named, "--skip-existing").code == 0
    assert sorted(path.name for path in takes.glob("*.bvh")) == [
        "a.bvh",
        "a.denoised.bvh",
        "b.bvh",
        "b.denoised.bvh",
    ]


def test_what_a_folder_was_converted_to_is_told_as_json(run, take, tmp_path):
    (tmp_path / "takes").mkdir()
    take.rename(tmp_path / "takes" / "a.bvh")
    (tmp_path / "takes" / "b.bvh").write_text("nothing")
    done = run("convert", "takes", "half", "--fps", "15", "--drop-repeated", "--json")
    assert done.code == 3
    good, bad = done.json
    assert good["input"] == str(Path("takes", "a.bvh"))
    assert (good["frames"], good["code"], good["dropped"]) == (163, 0, 0)
    made = load(good["wrote"]["file"])
    assert (good["wrote"]["frames"], good["wrote"]["fps"]) == (len(made), 15) == (82, 15)
    assert good["wrote"]["joints"] == len(made.skeleton)
    assert bad["code"] == 3
    assert {"error", "why", "fix"} <= set(bad)
    again = run("convert", "takes", "half", "--fps", "15", "--skip-existing", "--json").json
    assert again[0] == {"input": good["input"], "skipped": True, "code": 0}
    alone = run("convert", good["input"], "a.npz", "--json").json
    assert alone["wrote"] == {"file": "a.npz", "frames": 163, "fps": 30.0, "joints": good["joints"]}


def test_no_folder_is_left_where_nothing_was_made(run, takes):
    assert run("fill", "takes", "-o", "made/here", "--gap", "900:1000").code == 3
    assert not Path("made").exists()
    assert (
        run(
            "fill", "takes/a.bvh", "takes/b.bvh", "-o", "made/here", "--gap", "60:80", "--method", "spline"
        ).code
        == 0
    )
    assert sorted(path.name for path in Path("made/here").glob("*.bvh")) == ["a.bvh", "b.bvh"]
