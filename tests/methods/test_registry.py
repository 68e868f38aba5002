"""Methods by name, our own and those of other packages."""

from __future__ import annotations

import subprocess
import sys
from importlib.metadata import EntryPoint

import pytest

from interpose.errors import RequestError
from interpose.methods import classical, registry, weights


@pytest.fixture
def offer(monkeypatch: pytest.MonkeyPatch):
    """Pretends that other packages offer these methods."""

    def pretend(**methods: str) -> None:
        found = [EntryPoint(name, value, registry.GROUP) for name, value in methods.items()]
        monkeypatch.setattr(registry, "entry_points", lambda group: found)
        registry.get.cache_clear()

    yield pretend
    registry.get.cache_clear()


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


def test_methods_of_other_packages(offer):
    offer(other="interpose.methods.classical:Linear", linear="nowhere:Bad", broken="nowhere:Bad")
    assert registry.names()[-2:] == ("broken", "other")
    assert isinstance(registry.get("other"), classical.Linear)
    assert isinstance(registry.get("linear"), classical.Linear)
    with pytest.raises(RequestError, match="broken cannot be loaded"):
        registry.get("broken")


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
    with pytest.raises(RequestError, match="unknown model"):
        weights.card(str(tmp_path))
