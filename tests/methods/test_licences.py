"""Which weights may be used, and where they lie once they are installed."""

from __future__ import annotations

import tomllib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

import interpose
from interpose.cli import main
from interpose.errors import RequestError
from interpose.methods import auto, registry, weights
from interpose.observation import Gap

ROOT = Path(__file__).parents[2]
DATA = ROOT / "tests" / "data"


@pytest.fixture
def walk():
    return interpose.load(DATA / "cmu_walk.bvh")


def second(clip: interpose.Clip) -> Gap:
    """A gap of a second in the middle."""
    return Gap(len(clip) // 2, len(clip) // 2 + round(clip.fps))


def test_only_open_weights_where_that_is_asked_for(walk):
    """What chooses by itself chooses among them, and a method with others is refused."""
    gap = second(walk)
    arm = Gap(gap.start, gap.stop, ("LeftArm", "LeftForeArm"))
    assert auto.choose(walk, gap)[0].name == auto.choose(walk, arm)[0].name == "base"
    with interpose.license("open"):
        assert auto.choose(walk, gap, lone=2)[0].name == "small-open"
        # Shorter gaps than it is good at are the spline's: nothing to be said of that.
        method, why = auto.choose(walk, Gap(gap.start, gap.start + 2))
        assert (method.name, why) == ("spline", None)
        done = interpose.fill(walk, arm)
        assert (done.report.gaps[0].method, done.report.gaps[0].model) == ("small-open", "small-open")
        with pytest.raises(RequestError, match="base are not open") as refused:
            interpose.fill(walk, gap, method="base")
        assert "research" in refused.value.why
        assert "small-open or spline" in refused.value.fix
        with pytest.raises(RequestError, match="cae are not open"):
            interpose.fill(walk, gap, method=str(ROOT / "weights" / "cae"))
    assert auto.choose(walk, gap)[0].name == "base"


def test_the_licence_holds_in_all_threads_and_ends_with_whoever_asked(walk):
    gap = second(walk)

    def chosen() -> str:
        return auto.choose(walk, gap, lone=2)[0].name

    with interpose.license("open"), ThreadPoolExecutor(1) as others:
        assert others.submit(chosen).result() == "small-open"
        with interpose.license("any"):
            assert chosen() == "small-open", "who asks for less does not get more"
    assert chosen() == "base"


def test_unknown_licences_list_the_known_ones():
    with pytest.raises(RequestError, match="unknown licence: closed") as error, interpose.license("closed"):
        pass
    assert "any, open" in error.value.why


def test_a_command_line_asks_for_itself_alone(walk, tmp_path, capsys):
    gap = second(walk)
    take = ["fill", str(DATA / "cmu_walk.bvh"), "--gap", f"{gap.start}:{gap.stop}", "--dry-run"]
    take += ["--joints", "LeftArm"]
    assert main([*take, "--license", "open"]) == 0
    assert "small-open" in capsys.readouterr().out
    assert main([*take, "--license", "open", "--method", "cae"]) == 2
    assert "licence: research" in capsys.readouterr().err
    assert main(take) == 0
    assert "small-open" not in capsys.readouterr().out


@pytest.mark.parametrize("verb", ["fill", "between", "stitch", "recover", "denoise", "forecast"])
def test_every_verb_that_generates_explains_it(verb, capsys):
    main([verb, "--help"])
    said = " ".join(capsys.readouterr().out.replace("│", " ").split())
    assert "open to use only weights that may be used for anything" in said


@pytest.fixture
def wheel_alone(monkeypatch, tmp_path):
    """Open weights, inside of the package, and no others."""
    inside = tmp_path / "inside"
    inside.mkdir()
    (inside / "small-open").symlink_to(ROOT / "weights" / "small-open", target_is_directory=True)
    monkeypatch.setattr(weights, "FOLDERS", (tmp_path / "no checkout", inside))
    weights.cards.cache_clear()
    yield
    weights.cards.cache_clear()


def test_base_alone_is_asked_where_small_is_not_installed(walk, tmp_path, wheel_alone):
    """And what else lies beside the weights stops nobody."""
    (tmp_path / "inside" / "base").symlink_to(ROOT / "weights" / "base", target_is_directory=True)
    (tmp_path / "inside" / "mine").mkdir()
    (tmp_path / "inside" / "mine" / "log.json").write_text("{}")
    weights.cards.cache_clear()
    done = interpose.fill(walk, second(walk))
    assert [gap.method for gap in done.report.gaps] == ["base"]
    assert [told["name"] for told in done.report.gaps[0].weights] == ["base"]


def test_without_weights_for_research(walk, monkeypatch, tmp_path, wheel_alone):
    """Open weights stand in."""
    assert [card.name for card in weights.cards()] == ["small-open"]
    assert auto.choose(walk, second(walk), lone=2)[0].name == "small-open"
    with pytest.raises(RequestError, match="no weights for the method cae") as error:
        interpose.fill(walk, second(walk), method="cae")
    assert "pip install ./weights" in error.value.fix
    with pytest.raises(RequestError, match="unknown model: small") as error:
        weights.card("small")
    assert "pip install ./weights" in error.value.fix
    # Beside them the distribution for research, as a package that is only a folder.
    package = tmp_path / "site" / weights.RESEARCH
    package.mkdir(parents=True)
    (package / "cae").symlink_to(ROOT / "weights" / "cae", target_is_directory=True)
    monkeypatch.syspath_prepend(tmp_path / "site")
    weights.cards.cache_clear()
    assert [card.name for card in weights.cards()] == ["cae", "small-open"]
    with pytest.raises(RequestError, match="unknown model") as error:
        weights.card("other")
    assert "pip install" not in error.value.fix


def test_what_is_not_installed_is_said_of_models(capsys, wheel_alone):
    assert main(["models", "base"]) == 0
    assert "pip install ./weights" in capsys.readouterr().out
    assert main(["models", "spline"]) == 0
    assert "no trained weights" in capsys.readouterr().out
    main(["models", "auto"])
    assert "what measured best: small-open, and for gaps of less than 2" in capsys.readouterr().out


@pytest.mark.parametrize("options", [["--license", "open"], []])
def test_what_is_compared_where_nothing_is_named_is_what_may_be_used(options, request, tmp_path, capsys):
    if not options:
        request.getfixturevalue("wheel_alone")
    page = tmp_path / "page.html"
    take = [str(DATA / "cmu_walk.bvh"), "--gap", "60:70", "--joints", "LeftArm", "-o", str(page)]
    assert main(["compare", *take, *options]) == 0
    said = capsys.readouterr().out
    assert "small-open" in said
    assert "spline" in said
    assert "cae" not in said


@pytest.mark.parametrize("method", [[], ["--method", "spline"]])
def test_where_nothing_may_be_used_that_knows_actions_nothing_is_advised(method, capsys):
    keys = ["between", str(DATA / "cmu_walk.bvh"), "--keys", "0,30", "--action", "walk", *method]
    assert main([*keys, "--license", "open"]) == 2
    said = capsys.readouterr().err
    assert "no method knows actions whose weights are installed, and may be used" in said
    assert "Use" not in said
    forecast = ["forecast", str(DATA / "cmu_walk.bvh"), "--samples", "3", "--license", "open"]
    assert main(forecast) == 2
    assert "no method has more than one answer" in capsys.readouterr().err


def test_the_wheels_carry_what_their_licences_allow():
    """Open weights in the one, those for research in the other, and none in neither."""
    own, research = (
        tomllib.loads((folder / "pyproject.toml").read_text())["tool"]["hatch"]["build"]["targets"]["wheel"]
        for folder in (ROOT, ROOT / "weights")
    )
    held = {card.name: card for card in weights.cards()}
    inside = [Path(path).name for path in own["only-include"] if path.startswith("weights/")]
    assert all(held[name].open for name in inside)
    assert not any(held[name].open for name in research["only-include"])
    assert {*inside, *research["only-include"]} == {*held}
    assert all({one["name"] for one in held[name].data} == {"cmu"} for name in inside)
    assert registry.get(inside[0]).name == inside[0]
