"""Bad input: three lines on stderr, the right exit code, nothing written, no traceback."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import interpose.cli
from interpose.cli import main
from interpose.errors import FileError


def three_lines(err: str) -> list[str]:
    lines = err.rstrip("\n").split("\n")
    assert len(lines) == 3, err
    assert lines[0].startswith("error: ")
    assert all(line.startswith("  ") and line.strip() for line in lines[1:])
    return lines


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--gap", "80:60"], "80:60"),
        (["--gap", "60:60"], "60:60"),
        (["--gap", "100:200"], "163 frames"),
        (["--gap", "-5:20"], "-5:20"),
        (["--gap", "60-80"], "Write 120:160"),
        (["--gap", "60:80", "--joints", "LeftArn"], "Did you mean LeftArm"),
        (["--gap", "60:80", "--joints", ","], "--joints"),
        (["--joints", "leftarm"], "Did you mean LeftArm"),
        (["--gap", "60:80", "--method", "splin"], "spline"),
        (["--gap", "60:80", "--method", "foo"], "auto, "),
        (["--gap", "60:80", "--max-gap", "0"], "--max-gap"),
        (["--gap", "60:80", "--max-gap", "many"], "a number of frames"),
        (["--gap", "60:80", "--only-gap", "7"], "7"),
        (["--gap", "60:80", "--only-gap", "1.5"], "a whole number"),
        (["--gap", "60:80", "--seed", "1.5"], "a whole number"),
        (["--gap", "60:80", "-o", "out.fbx"], ".bvh"),
        (["--gap", "60:80", "-o", "no/such/out.bvh"], "no/such"),
        (["--gap", "60:80", "-o", "out"], ".bvh"),
        (["--gap", "60:80", "--unit", "furlong"], "inch"),
        (["--gap", "60:80", "--up", "w"], "up axis"),
        (["--gap", "60:80", "--gab", "1"], "Did you mean --gap"),
        (["--gap"], "--gap"),
    ],
)
def test_wrong_usage(run, take, options, says):
    done = run("fill", "take.bvh", *options)
    assert done.code == 2
    assert says in done.err
    assert "Traceback" not in done.err
    assert done.out == ""
    three_lines(done.err)
    assert [path.name for path in take.parent.iterdir()] == ["take.bvh"]


@pytest.mark.parametrize(
    ("options", "says"), [(["--frames", "abc"], "--frames 120:160"), (["--method", "foo"], "auto, ")]
)
def test_wrong_usage_of_recover(run, take, options, says):
    done = run("recover", "take.bvh", "--joints", "LeftArm", *options)
    assert done.code == 2
    assert says in done.err
    assert "--gap" not in done.err
    three_lines(done.err)


@pytest.mark.parametrize("verb", ["scan", "fill", "recover", "convert"])
def test_an_input_is_asked_for(run, verb):
    done = run(verb)
    assert done.code == 2
    assert "missing" in three_lines(done.err)[0]
    assert f"interpose {verb} --help" in done.err


@pytest.mark.parametrize(
    ("words", "meant"),
    [("fil take.bvh", "fill"), ("bench lafan2", "lafan1"), ("train bsae --out run", "base")],
)
def test_a_verb_that_does_not_exist(run, words, meant):
    """Also in place of the verb of one that does something without any, as `train` does."""
    done = run(*words.split())
    assert done.code == 2
    assert f"Did you mean {meant}" in three_lines(done.err)[2]


def damaged(take: Path, kind: str) -> None:
    text = take.read_text()
    lines = text.splitlines(keepends=True)
    damage = {
        "truncated": text[: len(text) // 2],
        "too many frames": text.replace("Frames: 163", "Frames: 170"),
        "short line": "".join([*lines[:-3], "1 2 3\n", *lines[-2:]]),
        "word": "".join([*lines[:-3], lines[-3].replace(" ", " oops ", 1), *lines[-2:]]),
        "nan": "".join([*lines[:-3], "nan" + lines[-3][lines[-3].index(" ") :], *lines[-2:]]),
        "zero frame time": text.replace("Frame Time: .0333333", "Frame Time: 0"),
        "no bones": "\n".join("OFFSET 0 0 0" if "OFFSET" in line else line for line in text.splitlines()),
        "empty": "",
        "text": "Dear Sir or Madam\n",
    }
    take.write_text(damage[kind])


@pytest.mark.parametrize(
    "kind",
    [
        "truncated",
        "too many frames",
        "short line",
        "word",
        "nan",
        "zero frame time",
        "no bones",
        "empty",
        "text",
    ],
)
def test_damaged_files(run, take, kind):
    damaged(take, kind)
    for command in (["scan", "take.bvh"], ["fill", "take.bvh", "--gap", "60:80"]):
        done = run(*command)
        assert done.code == 3, done.err
        assert "take.bvh" in three_lines(done.err)[0]
    assert [path.name for path in take.parent.iterdir()] == ["take.bvh"]


def test_files_that_are_none(run, tmp_path):
    (tmp_path / "folder.bvh").mkdir()
    (tmp_path / "binary.bvh").write_bytes(bytes(range(256)) * 40)
    (tmp_path / "binary.npz").write_bytes(bytes(range(256)) * 40)
    for name in ("folder.bvh", "binary.bvh", "binary.npz", "missing.bvh"):
        done = run("scan", name)
        assert done.code == 3
        assert name in three_lines(done.err)[0]
    done = run("scan", "foldr.bvh")
    assert "Did you mean folder.bvh" in done.err


@pytest.mark.parametrize(
    ("text", "code"),
    [("{", 3), ('{"gap": []}', 3), ('[{"frames": "9"}]', 3), ("[]", 2), ('[{"frames": "150:200"}]', 2)],
)
def test_bad_gap_files(run, take, text, code):
    take.with_name("gaps.json").write_text(text)
    done = run("fill", "take.bvh", "--gaps", "gaps.json")
    assert done.code == code
    three_lines(done.err)
    assert not take.with_name("take.filled.bvh").exists()


def test_joints_do_not_go_with_a_file_of_gaps(run, take):
    take.with_name("gaps.json").write_text('[{"frames": "20:30"}]')
    done = run("fill", "take.bvh", "--gaps", "gaps.json", "--joints", "LeftArm")
    assert done.code == 2
    assert "--gaps" in three_lines(done.err)[0]


def break_loading(monkeypatch: pytest.MonkeyPatch, error: BaseException) -> None:
    def load(*args: object, **options: object) -> None:
        raise error

    monkeypatch.setattr("interpose.formats.load", load)


def test_faults_of_the_program_show_no_traceback(run, take, monkeypatch):
    break_loading(monkeypatch, KeyError("left"))
    done = run("scan", "take.bvh")
    assert done.code == 1
    assert "--debug" in three_lines(done.err)[2]


def test_debug_shows_where_an_error_comes_from(run, take, monkeypatch):
    """And the error itself, with the exit code that it has without."""
    break_loading(monkeypatch, FileError("what", "why", "fix"))
    plain = run("scan", "take.bvh")
    told = run("scan", "take.bvh", "--debug")
    monkeypatch.setenv("INTERPOSE_DEBUG", "1")
    for done in (told, run("scan", "take.bvh")):
        assert done.code == plain.code == 3
        assert done.err.startswith("Traceback")
        assert done.err.endswith(plain.err)


def test_memory_that_runs_out_is_the_machine_s_fault(run, take, monkeypatch):
    break_loading(monkeypatch, MemoryError("Unable to allocate 745. GiB"))
    done = run("scan", "take.bvh")
    assert done.code == 3
    assert "not enough memory" in three_lines(done.err)[0]


@pytest.mark.parametrize("stream", ["1", "2"])
def test_who_has_no_output_gets_the_result_and_the_exit_code(take, stream):
    command = f'"$0" -m interpose fill take.bvh --gap 30:50 --method spline -o a.bvh {stream}>&-'
    assert subprocess.run(["sh", "-c", command, sys.executable], cwd=take.parent).returncode == 0
    assert (take.parent / "a.bvh").exists()
    command = f'"$0" -m interpose scan nothing.bvh {stream}>&-'
    assert subprocess.run(["sh", "-c", command, sys.executable], cwd=take.parent).returncode == 3


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_an_interrupt_is_quiet_and_leaves_nothing(run, take, monkeypatch, number, code):
    """Where an interrupt raises KeyboardInterrupt, as in a terminal."""

    def interrupted(*args: object) -> None:
        args[1].write(b"half of it")  # type: ignore[attr-defined]
        signal.raise_signal(number)

    before = signal.signal(signal.SIGINT, signal.default_int_handler)

    from interpose.formats import FORMATS

    monkeypatch.setitem(FORMATS, ".bvh", FORMATS[".bvh"]._replace(write=interrupted))
    try:
        done = run("fill", "take.bvh", "--gap", "60:80", "--method", "linear")
    finally:
        signal.signal(signal.SIGINT, before)
    assert done.code == code
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL, "as before"
    assert done.err == ""
    assert [path.name for path in take.parent.iterdir()] == ["take.bvh"]


def start(
    *tokens: str, cwd: Path, how: tuple[str, ...] = ("-m", "interpose"), **options: object
) -> subprocess.Popen:
    source = str(Path(interpose.cli.__file__).parents[2])
    path = os.pathsep.join([source, os.environ.get("PYTHONPATH", "")])
    return subprocess.Popen(
        [sys.executable, *how, *tokens],
        cwd=cwd,
        env=os.environ | {"PYTHONPATH": path},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        **options,  # type: ignore[call-overload]
    )


@pytest.mark.parametrize(
    "command",
    [
        ["scan", "take.bvh"],
        ["scan", "take.bvh", "--json"],
        ["fill", "take.bvh", "--gap", "60:70"],
        ["fill", "--help"],
    ],
)
def test_a_broken_pipe_is_quiet(take, command):
    process = start(*command, cwd=take.parent)
    assert process.stdout is not None
    process.stdout.close()
    assert process.stderr is not None
    assert process.stderr.read() == ""
    assert process.wait() == 0


WAITS = """
import runpy, sys, time
from interpose import tasks

def wait(*args, **kwargs):
    open("waits", "w").close()
    time.sleep(100)

tasks.fill = wait
sys.argv[0] = "interpose"
runpy.run_module("interpose", run_name="__main__")
"""


@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
def test_control_c_in_a_process(tmp_path, data):
    """Interrupted while it works."""
    shutil.copy(data / "cmu_walk.bvh", tmp_path / "take.bvh")
    # A shell that runs the tests in the background has them ignore Ctrl-C, and so all that they start.
    heard = lambda: signal.signal(signal.SIGINT, signal.SIG_DFL)  # noqa: E731
    words = ("take.bvh", "--gap", "10:20")
    process = start("fill", *words, cwd=tmp_path, how=("-c", WAITS), preexec_fn=heard)
    while not (tmp_path / "waits").exists() and process.poll() is None:
        time.sleep(0.02)
    # Once more if it was just where Python ignores exceptions, as in a callback of the garbage collector.
    for _ in range(3):
        process.send_signal(signal.SIGINT)
        try:
            out, err = process.communicate(timeout=20)
            break
        except subprocess.TimeoutExpired:
            continue
    assert process.returncode == 130
    assert (out, err) == ("", "")


def test_what_is_no_file_is_not_waited_for(tmp_path, capsys, monkeypatch, data):
    """A pipe of a name in the way, or devices that never end."""
    monkeypatch.chdir(tmp_path)
    shutil.copy(data / "cmu_walk.bvh", "a.bvh")
    os.mkfifo("o.json")
    assert main(["fill", "a.bvh", "--gap", "10:20", "--method", "spline", "-o", "o.bvh", "--force"]) == 2
    assert main(["skeleton", "a.bvh", "--save-map", "o.json", "--force"]) == 2
    assert main(["fill", "a.bvh", "--gaps", "/dev/zero"]) == 3
    assert main(["skeleton", "a.bvh", "--map", "/dev/zero"]) == 3
    assert "no regular file" in capsys.readouterr().err


def test_links_to_nothing_are_not_replaced(tmp_path, capsys, monkeypatch, data):
    monkeypatch.chdir(tmp_path)
    shutil.copy(data / "cmu_walk.bvh", "a.bvh")
    os.symlink("nowhere.bvh", "o.bvh")
    assert main(["fill", "a.bvh", "--gap", "10:20", "--method", "spline", "-o", "o.bvh"]) == 2
    assert "exists already" in capsys.readouterr().err
    assert os.path.islink("o.bvh")


def test_names_in_files_tell_terminals_nothing(tmp_path, capsys, data):
    text = (data / "cmu_walk.bvh").read_text().replace("ROOT Hips", "ROOT Hi\x1b[2Jps")
    (tmp_path / "a.bvh").write_text(text)
    assert main(["skeleton", str(tmp_path / "a.bvh")]) == 0
    assert main(["fill", str(tmp_path / "a.bvh"), "--gap", "10:20", "--joints", "Nose"]) == 2
    told = capsys.readouterr()
    assert "\x1b[2J" not in told.out + told.err
    assert "Hi\ufffd[2Jps" in told.out
