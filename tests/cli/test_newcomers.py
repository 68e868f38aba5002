"""Help, version, demo, models, doctor, and the researchers' verbs as far as they go without data."""

from __future__ import annotations

import itertools
import json
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import interpose
import interpose.cli
from interpose.formats import load
from interpose.methods import weights

SOURCE = Path(interpose.__file__).parents[1]


VERBS = [verb for verbs in interpose.cli.VERBS.values() for verb in verbs]
HEAVY = "{'torch', 'onnxruntime', 'scipy', 'numpy', 'matplotlib', 'cyclopts', 'rich'}"


def imported_by(tokens: list[str], cwd: Path) -> tuple[str, set[str]]:
    """What a call prints, and which of HEAVY it imports, in a process of its own."""
    code = (
        f"import sys; sys.path.insert(0, {str(SOURCE)!r})\n"
        "from interpose.cli import main\n"
        f"assert main({tokens!r}) == 0\n"
        f"print(*({HEAVY} & set(sys.modules)), file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=cwd)
    assert done.returncode == 0, done.stderr
    return done.stdout, set(done.stderr.split())


def test_help_imports_nothing_heavy(tmp_path):
    """What makes `interpose --help` start at once: nothing but the standard library is imported."""
    out, imported = imported_by(["--help"], tmp_path)
    assert imported == set()
    assert {"scan", "fill", "recover", "convert", "demo", "models", "doctor", "bench"} <= set(VERBS)
    for verb in VERBS:
        assert f"\n  {verb} " in out
    assert max(map(len, out.splitlines())) <= 85


def test_the_help_of_a_verb_imports_only_the_parser(tmp_path):
    _, imported = imported_by(["fill", "--help"], tmp_path)
    assert imported <= {"cyclopts", "rich"}


def test_without_arguments_help_is_shown(run):
    assert run().out == run("--help").out == run("-h").out


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_explains_itself(run, verb):
    done = run(verb, "--help")
    assert done.code == 0
    assert f"Usage: interpose {verb}" in done.out
    assert len(done.out.splitlines()) > 6


@pytest.mark.parametrize("verb", ["fill", "convert", "scan", "stitch"])
def test_help_flows_to_the_width_of_the_terminal(run, verb):
    """No line of a paragraph is shorter than it must be, and none is too long."""
    lines = [line.rstrip() for line in run(verb, "--help").out.splitlines()]
    assert max(map(len, lines)) <= 80
    prose = [one if one[:1].isalpha() and not one.endswith(":") else "" for one in lines]
    assert all(len(a) + 1 + len(b.split()[0]) > 80 for a, b in itertools.pairwise(prose) if a and b)


def test_the_help_of_fill_shows_how(run):
    out = run("fill", "--help").out
    assert "interpose fill take.bvh --gap 120:160" in out
    for option in (
        "--joints",
        "--gaps",
        "--max-gap",
        "--only-gap",
        "--dry-run",
        "--player",
        "--force",
        "--unit",
        "--up",
    ):
        assert option in out
    assert "--no-json" not in out
    assert "--empty" not in out


def test_version(run):
    project = tomllib.loads((SOURCE.parent / "pyproject.toml").read_text())["project"]
    assert interpose.__version__ == project["version"]
    assert run("--version").out == f"interpose {interpose.__version__}\n"


def test_demo(run, tmp_path):
    for _ in range(2):  # it owns its folder
        done = run("demo", "--out", "here")
        assert done.code == 0, done.err
    files = {path.name for path in (tmp_path / "here").iterdir()}
    assert files == {"walk.bvh", "walk.filled.bvh", "strip.svg", "player.html"}
    clip, filled = load(tmp_path / "here/walk.bvh"), load(tmp_path / "here/walk.filled.bvh")
    changed = (clip.rotation != filled.rotation).any(axis=(1, 2))
    assert changed[66:96].all()
    assert changed.sum() == 30
    for word in (
        "truth",
        "linear interpolation",
        "filled (",
        "mocap.cs.cmu.edu",
        "player.html",
        "interpose fill",
    ):
        assert word in done.out


def test_demo_of_a_rig_with_fingers(run, tmp_path):
    done = run("demo", "fingers", "--out", "here")
    assert done.code == 0
    assert "65 joints" in done.out
    assert "filled (base)" in done.out
    assert (tmp_path / "here" / "fingers.filled.bvh").stat().st_size > 100_000


def test_demo_needs_a_folder(run, tmp_path):
    (tmp_path / "demo").write_text("a file")
    done = run("demo")
    assert done.code == 3
    assert "--out" in done.err


def test_models(run):
    done = run("models")
    assert done.code == 0
    for method in ("auto", "linear", "spline", "zero-velocity"):
        assert method in done.out
    listed = run("models", "--json").json
    for card in listed["models"]:
        assert card["licence"]
        assert card["name"] in done.out
        assert run("models", card["name"], "--json").json == card
        assert card["licence"] in run("models", card["name"]).out
        assert Path(card["file"]).suffix == ".onnx"
        assert Path(card["file"]).is_file()
    missing = run("models", "gpt")
    assert missing.code == 2
    assert "unknown model: gpt" in missing.err


def test_doctor_finds_nothing_wrong(run):
    done = run("doctor")
    assert done.code == 0, done.out
    assert "PROBLEM" not in done.out
    assert run("doctor", "--json").json["ok"] is True


def test_doctor_says_what_to_do(run, monkeypatch):
    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    done = run("doctor")
    assert done.code == 2
    assert "PROBLEM network runtime" in done.out
    assert "pip install" in done.out
    assert "Traceback" not in done.out


@pytest.mark.parametrize("command", [["train", "cae", "--out", "x"], ["export", "cae", "--run", "x"]])
def test_without_torch_the_error_names_the_extra(run, monkeypatch, command):
    for name in [name for name in sys.modules if name.startswith(("interpose.training", "interpose.models"))]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "torch", None)
    done = run(*command)
    assert done.code == 2
    assert "pip install 'interpose[train]'" in done.err
    assert len(done.err.splitlines()) == 3


def test_settings_of_a_recipe_are_changed_by_name(run):
    pytest.importorskip("torch")
    done = run("train", "cmib", "--out", "x", "--set", "augment=0")
    assert done.code == 2
    assert "unknown setting: augment" in done.err
    assert "Did you mean augmented" in done.err
    done = run("train", "cmib", "--out", "x", "--set", "augmented=0", "--set", "batch=many")
    assert "cannot set batch to 'many'" in done.err
    done = run("train", "cae", "--out", "x", "--set", "network=gan")
    assert done.code == 2
    assert "cae, vanilla, holden" in done.err


def test_own_weights_are_not_named_like_a_method(run, take):
    """`--method small` would go on to take the installed one."""
    pytest.importorskip("torch")
    done = run("train", "--from", "small", "--data", ".", "--out", "small")
    assert done.code == 2
    assert "small is the name of a method" in done.err
    card = weights.card("cae")
    Path("cae").mkdir()
    for path in (card.path, card.onnx):
        shutil.copy(path, Path("cae") / path.name)
    assert "it is not clear what cae is" in run("fill", take, "--gap", "60:90", "--method", "cae").err
    assert run("fill", take, "--gap", "60:90", "--method", "./cae").code == 0


def test_networks_are_not_trained_on_test_performers(run, tmp_path):
    pytest.importorskip("torch")
    done = run("train", "cae", "--out", "x", "--splits", "train,test")
    assert done.code == 2
    assert "never on test" in done.err


def test_data_that_is_not_there(run, tmp_path):
    done = run("data", "info", "--data", "nowhere")
    assert done.code == 3
    assert len(done.err.splitlines()) == 3
    (tmp_path / "empty").mkdir()
    counted = run("data", "info", "--data", str(tmp_path / "empty"), "--json").json
    assert counted["sets"]["cmu"]["clips"] == 0
    done = run("data", "pack", "cmu", "--data", "nowhere")
    assert done.code == 3
    assert len(done.err.splitlines()) == 3
    assert run("data", "pack", "cm").code == 2
    assert run("bench", "infilling", "--data", "nowhere").code == 3
    done = run("bench", "infilling", "--weights", "nowhere")
    assert done.code == 3
    assert "interpose export cae" in done.err
    assert len(done.err.splitlines()) == 3


def test_json_is_the_only_output(run, take):
    json.loads(run("scan", "take.bvh", "--json").out)
    json.loads(run("data", "info", "--data", str(take.parent), "--json").out)


def test_a_method_without_weights_has_no_card_but_an_answer(run):
    done = run("models", "spline")
    assert done.code == 0
    assert "no trained weights" in done.out
    assert run("models", "cubic").code == 2
