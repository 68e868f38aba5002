"""Settings that no run can do are refused before anything is trained."""

from __future__ import annotations

import pytest

pytest.importorskip("torch")

from interpose.cli.train import change
from interpose.errors import RequestError
from interpose.training.base import BaseSettings, train_base
from interpose.training.budget import Budget
from interpose.training.cae import CaeSettings
from interpose.training.cmib import CmibSettings
from interpose.training.seq2seq import Seq2SeqSettings
from interpose.training.stmi_gan import StmiGanSettings

RECIPES = (BaseSettings, CaeSettings, CmibSettings, Seq2SeqSettings, StmiGanSettings)


@pytest.mark.parametrize("recipe", RECIPES)
@pytest.mark.parametrize(
    "text", ["learning_rate=nan", "learning_rate=0", "average=2", "batch=0", "seed=-1", "every_seconds=inf"]
)
def test_what_no_recipe_can_do(recipe, text):
    name = text.partition("=")[0]
    with pytest.raises(RequestError, match=f"cannot train with {name}=") as error:
        change(recipe(), [text])
    assert error.value.fix.startswith(f"Write --set {name}={getattr(recipe(), name)}, ")


@pytest.mark.parametrize(
    ("recipe", "texts"),
    [
        (BaseSettings, ["dropout=1.5"]),
        (BaseSettings, ["shortest=50", "longest=20"]),
        (BaseSettings, ["mirror=2"]),
        (BaseSettings, ["position=-1"]),
        (BaseSettings, ["short=nan"]),
        (BaseSettings, ["context=0"]),
        (BaseSettings, ["context=200"]),
        (CaeSettings, ["gap=200"]),
        (CaeSettings, ["gap=119"]),
        (CaeSettings, ["length=2"]),
        (CaeSettings, ["curriculum=0"]),
        (CmibSettings, ["shortest=1"]),
        (CmibSettings, ["longest=161"]),
        (CmibSettings, ["anchors=0"]),
        (StmiGanSettings, ["every=0"]),
        (StmiGanSettings, ["tallest=3"]),
        (StmiGanSettings, ["lead=nan"]),
        (Seq2SeqSettings, ["units=0"]),
    ],
)
def test_what_a_recipe_cannot_do(recipe, texts):
    with pytest.raises(RequestError) as error:
        change(recipe(), texts)
    assert len(str(error.value).splitlines()) == 3


def test_ends_of_ranges_and_words():
    assert change(CaeSettings(), ["gap=118"]).gap == 118
    assert change(CaeSettings(), ["gap=200", "length=202"]).gap == 200
    assert change(BaseSettings(), ["short=-8", "average=1", "mirror=0"]).short == -8
    with pytest.raises(RequestError, match="quaternion, axis-angle, euler"):
        CmibSettings(representation="matrix")
    with pytest.raises(RequestError, match="192 wide"):
        BaseSettings(heads=7).network(("",))


def test_gaps_that_no_clip_has_room_for(walk_pack, tmp_path):
    settings = BaseSettings(width=24, layers=1, batch=2, shortest=1500, longest=2000)
    with pytest.raises(RequestError, match="cannot learn from gaps of 1500 frames"):
        train_base([walk_pack("lafan1", both=True)], tmp_path, Budget.parse("1steps"), settings, say=str)
