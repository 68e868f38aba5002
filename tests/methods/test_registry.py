"""Methods by name, our own and those of other packages."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from importlib.metadata import EntryPoint
from pathlib import Path

import numpy as np
import pytest

import interpose
from interpose.errors import FileError, RequestError
from interpose.finish import complete
from interpose.methods import classical, registry, weights
from interpose.observation import Gap, Observation


@pytest.fixture
def offer(monkeypatch: pytest.MonkeyPatch):
    """Pretends that other packages offer these methods."""

    def pretend(**methods: str) -> None:
        found = [EntryPoint(name, value, registry.GROUP) for name, value in methods.items()]
        monkeypatch.setattr(registry, "entry_points", lambda group: found)
        registry._named.cache_clear()

    yield pretend
    registry._named.cache_clear()


def test_every_name_gives_a_method_of_that_name():
    for name, kind in (("zero-velocity", classical.ZeroVelocity), ("linear", classical.Linear)):
        assert isinstance(registry.get(name), kind)
        assert registry.get(name).name == name
    assert {"zero-velocity", "linear", "spline"} <= set(registry.names())


def test_unknown_names_list_the_known_ones():
    with pytest.raises(RequestError, match="unknown method: splin") as error:
        registry.get("splin")
    assert "zero-velocity" in error.value.why
    assert "Did you mean spline" in error.value.fix


class Other(classical.Linear):
    name = "other"


class Mute:
    """A method that misses a part."""

    name = "mute"
    complete = classical.Linear.complete


def test_methods_of_other_packages(offer):
    offer(other=f"{__name__}:Other", linear="nowhere:Bad", broken="nowhere:Bad")
    assert registry.names()[-2:] == ("broken", "other")
    assert isinstance(registry.get("other"), Other)
    assert isinstance(registry.get("linear"), classical.Linear)
    with pytest.raises(RequestError, match="broken cannot be loaded"):
        registry.get("broken")


def test_methods_of_other_packages_that_are_none_say_what_they_lack(offer):
    offer(mute=f"{__name__}:Mute", alias=f"{__name__}:Other")
    with pytest.raises(RequestError, match="mute cannot be loaded") as error:
        registry.get("mute")
    assert "has no refuses" in error.value.why
    with pytest.raises(RequestError, match="alias cannot be loaded") as error:
        registry.get("alias")  # its report would name another method, which nobody could repeat
    assert "its name is other" in error.value.why
    assert len(str(error.value).splitlines()) == 3


def test_an_object_is_a_method_in_all_that_fills(cmu_walk):
    """One's own network, or whatever it is, with all that comes after; it is called by its name."""

    class Mine(classical.Linear):
        name = "mine"

    mine, line = Mine(), "linear"
    for ask in (
        lambda method: interpose.fill(cmu_walk, "40:60", method=method),
        lambda method: interpose.between(cmu_walk, [30, 60], method=method),
        lambda method: interpose.stitch([cmu_walk, cmu_walk], 12, method=method),
        lambda method: interpose.forecast(cmu_walk, 12, method=method),
    ):
        own, reference = ask(mine), ask(line)
        assert np.array_equal(own.clip.rotation, reference.clip.rotation)
        assert "mine" in str(own.report)
        assert "linear" not in str(own.report)
    assert interpose.fill(cmu_walk, "40:60", method=mine).report.to_dict()["method"] == "mine"
    with pytest.raises(RequestError, match="cannot use a Half as a method\nit has no name and no refuses"):
        interpose.fill(cmu_walk, "40:60", method=type("Half", (), {"complete": None})())
    with pytest.raises(RequestError, match=r"Give Mine\(\)"):
        interpose.fill(cmu_walk, "40:60", method=Mine)


def test_listing_methods_loads_no_network():
    code = (
        "import sys; from interpose.methods import registry; registry.names(); registry.get('spline'); "
        "print([name for name in ('torch', 'onnxruntime') if name in sys.modules])"
    )
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert said.stdout.strip() == "[]"


def test_weights_by_name_or_by_folder(tmp_path):
    card = weights.card("cae")
    assert card.name == "cae"
    assert weights.card(str(card.path.parent)) == card
    with pytest.raises(RequestError, match="is no model") as error:
        weights.card(str(tmp_path))
    assert "has none" in error.value.why
    with pytest.raises(RequestError, match="unknown model"):
        weights.card("nowhere")


def test_a_path_is_no_name_of_a_method():
    with pytest.raises(RequestError, match="no folder base") as error:
        registry.get(Path("base"))
    assert 'Give the text "base"' in error.value.fix


def copied(name: str, folder: Path) -> Path:
    """Installed weights in a folder of somebody's own."""
    card = weights.card(name)
    folder.mkdir(exist_ok=True)
    for path in (card.path, card.onnx):
        shutil.copy(path, folder / f"mine{path.suffix}")
    return folder


@pytest.mark.parametrize("name", ["cae", "cmib", "small"])
def test_a_folder_of_weights_is_a_method_of_that_name(name, tmp_path, cmu_walk):
    """Only so does a report that names it bring the same weights again."""
    folder = copied(name, tmp_path / "mine")
    method = registry.get(str(folder))
    assert method.name == str(folder)
    done = complete(cmu_walk, Observation.from_gaps(cmu_walk, [Gap(60, 90)]), method)
    assert [gap.method for gap in done.report.gaps] == [str(folder)]


def test_weights_that_were_written_anew_are_read_anew(tmp_path, cmu_walk):
    said = []
    for name in ("small", "small-open"):
        folder = copied(name, tmp_path / "mine")
        os.utime(folder / "mine.onnx", ns=(len(said), len(said)))
        said.append(interpose.fill(cmu_walk, (80, 110), method=str(folder)).clip)
    assert not np.array_equal(said[0].rotation, said[1].rotation)


def test_damaged_weights_are_the_fault_of_the_file(tmp_path, cmu_walk):
    folder = copied("small-open", tmp_path / "mine")
    (folder / "mine.onnx").write_bytes(b"no graph")
    with pytest.raises(FileError, match="cannot read the network"):
        interpose.fill(cmu_walk, (80, 110), method=str(folder))
    card = folder / "mine.json"
    card.write_text(card.read_text().replace('"method": "small-open"', '"method": "linear"'))
    with pytest.raises(RequestError, match="is no model"):
        registry.get(str(folder))


def test_a_method_that_cannot_be_loaded_is_no_reason_for_others_to_fail(offer):
    offer(broken="nowhere:Bad", auto="interpose.methods.classical:Linear")
    assert "auto" not in registry.names()
    with pytest.raises(RequestError, match="has no temperature") as error:
        registry.told("small", temperature=2.0)
    assert "stmi-gan" in error.value.fix
