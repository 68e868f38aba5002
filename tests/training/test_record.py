"""What a run has on record: it goes on with that alone, and the card is made from it."""

from __future__ import annotations

import json
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("onnx")

from safetensors.torch import save_file  # noqa: E402

from interpose.cli import main  # noqa: E402
from interpose.errors import FileError, RequestError  # noqa: E402
from interpose.methods import weights  # noqa: E402
from interpose.models.base import Base, BaseConfig  # noqa: E402
from interpose.training import cae, export  # noqa: E402
from interpose.training.base import BaseSettings, train_base  # noqa: E402
from interpose.training.base import begin as begin_base  # noqa: E402
from interpose.training.budget import Budget  # noqa: E402
from interpose.training.cmib import CmibSettings, train_cmib  # noqa: E402
from interpose.training.loop import Settings, Trainer  # noqa: E402

START = weights.Card(
    "tiny", "small", "", "any use", [], [], [], 30.0, 60, training={"steps": 7}, path=Path("none/tiny.json")
)


@pytest.fixture
def train(tmp_path):  # type: ignore[no-untyped-def]
    """Trains one number in a folder, or goes on with it; the settings that are on record afterwards."""

    def go(steps, start=None, splits=("train",), **changes):  # type: ignore[no-untyped-def]
        model = torch.nn.Linear(1, 1)
        trainer = Trainer(
            model,
            lambda rng, fraction: model.weight.sum(),
            lambda averaged: {},
            tmp_path,
            Budget.parse(f"{steps}steps"),
            Settings(**changes),
            lambda line: None,
            data={"packs": ["cmu"], "splits": [*splits]},
        )
        trainer.go("", start)
        return json.loads((tmp_path / "settings.json").read_text())

    return go


def test_another_recipe_is_refused_and_the_one_on_record_stays(train, tmp_path):
    first = train(2)
    assert first["splits"] == ["train"]
    with pytest.raises(RequestError, match="cannot go on") as error:
        train(2, splits=("train", "validation"), learning_rate=0.5)
    assert "learning_rate=0.5, splits=train,validation" in error.value.what
    assert "learning_rate=0.001, splits=train" in error.value.why
    assert "--out" in error.value.fix
    assert json.loads((tmp_path / "settings.json").read_text()) == first
    assert train(1) == first, "nothing was left to do"
    # How often it tells, and how long it goes on, is no part of the recipe.
    assert train(4, every_seconds=1.0)["budget"] == "4 steps"


def test_older_records_say_less(train, tmp_path):
    """What the first part of such a run learned from is not known, and not said."""
    path = tmp_path / "settings.json"
    kept = train(1)
    path.write_text(json.dumps({n: v for n, v in kept.items() if n not in ("splits", "packs", "average")}))
    after = train(2, splits=("train", "validation"))
    assert "splits" not in after
    assert after["average"] == kept["average"]


def test_a_checkpoint_without_a_record_is_one_error(train, tmp_path):
    train(1)
    (tmp_path / "settings.json").write_text("{")
    with pytest.raises(FileError, match=r"settings\.json"):
        train(2)


def test_a_run_goes_on_from_where_it_began(train, tmp_path):
    """Else a card could tell of weights that had no part in it."""
    earlier = tmp_path / "earlier.json"
    earlier.write_text("{}")  # of a run that saved nothing
    train(1)
    assert not earlier.exists()
    with pytest.raises(RequestError, match="cannot go on from tiny"):
        train(2, START)
    (tmp_path / "checkpoint.pt").unlink()
    train(1, START)
    kept = earlier.read_text()
    train(2)
    train(3, START)
    assert earlier.read_text() == kept
    with pytest.raises(RequestError, match="began with other weights"):
        train(4, replace(START, training={"steps": 8}))
    assert earlier.read_text() == kept


def test_an_autoencoder_that_started_from_weights_goes_on_as_it_did(walk_pack, tmp_path):
    """At the end of its curriculum, though --start is not said again."""
    settings = cae.CaeSettings(length=64, batch=1)
    start = weights.find("cae")
    for steps, begin in (("1steps", start), ("2steps", None)):
        cae.train_cae([walk_pack("cmu")], tmp_path, Budget.parse(steps), settings, start=begin, say=str)
        kept = json.loads((tmp_path / "settings.json").read_text())
        assert (kept["first_gap"], kept["budget"]) == (settings.last_gap, f"{steps[0]} steps")


def two_labels(walk_pack):  # type: ignore[no-untyped-def]
    """A pack whose labels the weights below know in another order than sorted."""
    return replace(walk_pack("lafan1", both=True), labels=np.array(["bow", "walk"]))


def kept_at_each_step(recipe, pack, folder, settings, start, name):  # type: ignore[no-untyped-def]
    """What is on record of the network, as the run starts, goes on, and goes on with --start said again."""
    for number, begin in enumerate((start, None, start), 1):
        budget = Budget.parse(f"{number}steps")
        recipe([pack], folder, budget, settings, ("train", "validation"), begin, say=str)
        yield json.loads((folder / "settings.json").read_text())[name]


def test_labels_and_wires_stay_as_they_are(walk_pack, tmp_path):
    """No weight of the checkpoint tells which row is whose, nor how it is wired."""
    network = BaseConfig(("", "walk", "bow"), width=24, heads=2, layers=1, near=False)
    save_file(Base(network).state_dict(), tmp_path / "tiny.safetensors")
    training = {"config": "small", "network": {**asdict(network), "labels": None}}
    start = replace(START, labels=["", "walk", "bow"], training=training, path=tmp_path / "tiny.json")
    settings = BaseSettings(batch=2, longest=20, near=0)
    steps = kept_at_each_step(train_base, two_labels(walk_pack), tmp_path / "run", settings, start, "network")
    for kept in steps:
        assert (kept["labels"], kept["near"], kept["heads"]) == (["", "walk", "bow"], False, 2)


def test_labels_of_cmib_stay_in_their_order(walk_pack, tmp_path):
    pack = two_labels(walk_pack)
    settings, start = CmibSettings(batch=2, shortest=10, longest=122), weights.find("cmib")
    assert start.labels.index("walk") > 1
    for kept in kept_at_each_step(train_cmib, pack, tmp_path, settings, start, "config"):
        assert kept["labels"][: len(start.labels)] == start.labels


def test_data_with_more_labels_does_not_change_those_of_a_run_that_goes_on(walk_pack, tmp_path):
    settings = BaseSettings(width=24, layers=1, batch=2, longest=20)
    for steps, pack in (("1steps", walk_pack("lafan1", both=True)), ("2steps", two_labels(walk_pack))):
        model = train_base([pack], tmp_path, Budget.parse(steps), settings, say=str)
        assert model.config.labels == ("", "walk")


def test_splits_are_told_once(walk_pack, tmp_path, capsys, monkeypatch):
    """The line that `train` ends with makes a card that names them."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(export, "export_base_onnx", lambda model, path: path.touch())
    (tmp_path / "packs").mkdir()
    walk_pack("lafan1", both=True).save(tmp_path / "packs" / "lafan1.npz")
    words = ["train", "base", "--out", "run", "--splits", "train,validation", "--budget", "1steps"]
    for text in ("width=24", "layers=1", "batch=2", "longest=20"):
        words += ["--set", text]
    assert main(words) == 0
    line = next(line for line in capsys.readouterr().out.splitlines() if line.startswith("Next: "))
    command = line.split()[2:]
    assert "--splits" not in command
    assert main(command) == 0
    card = json.loads((tmp_path / "run" / "weights" / "small.json").read_text())
    assert card["training"]["splits"] == ["train", "validation"]
    assert card["data"][0]["clips"] == 2
    assert main([*command, "--force", "--splits", "train"]) == 2
    assert "train,validation on record" in capsys.readouterr().err
    # Of an older run both are told again, as they were.
    path = tmp_path / "run" / "settings.json"
    kept = json.loads(path.read_text())
    path.write_text(json.dumps({n: v for n, v in kept.items() if n not in ("splits", "packs", "held")}))
    assert main(words) == 0
    assert "--splits train,validation" in capsys.readouterr().out
    assert main([*command, "--force", "--splits", "train"]) == 0
    card = json.loads((tmp_path / "run" / "weights" / "small.json").read_text())
    assert card["training"]["splits"] == ["train"]


def test_packs_that_were_not_trained_on_are_not_named(walk_pack, tmp_path, monkeypatch):
    """Nor can a run on all of them pass for one on those that are free."""
    monkeypatch.setattr(export, "export_cae_onnx", lambda model, path: path.touch())
    packs = [walk_pack("lafan1"), walk_pack("cmu")]
    cae.train_cae(packs[1:], tmp_path, Budget.parse("1steps"), cae.CaeSettings(length=64, batch=1), say=str)
    card = export.export_cae(tmp_path, packs, tmp_path / "weights")
    assert [one["name"] for one in card.data] == ["cmu"]
    with pytest.raises(RequestError, match="there is no pack of cmu"):
        export.export_cae(tmp_path, packs[:1], tmp_path / "weights")


def test_packs_of_the_same_name_that_hold_something_else_are_refused(walk_pack, tmp_path, monkeypatch):
    """The card would tell of data that the run never saw."""
    monkeypatch.setattr(export, "export_cae_onnx", lambda model, path: path.touch())
    pack, budget = walk_pack("cmu"), Budget.parse("1steps")
    cae.train_cae([pack], tmp_path, budget, cae.CaeSettings(length=64, batch=1), say=str)
    fewer = replace(pack, starts=pack.starts - (np.arange(len(pack.starts)) == 1))
    with pytest.raises(RequestError, match="not trained on this pack of cmu"):
        export.export_cae(tmp_path, [fewer], tmp_path / "weights")
    with pytest.raises(RequestError, match="cannot go on"):
        cae.train_cae([fewer], tmp_path, Budget.parse("2steps"), cae.CaeSettings(length=64, batch=1), say=str)
    assert export.export_cae(tmp_path, [pack], tmp_path / "weights").data[0]["clips"] == 1


def test_a_run_that_gets_lost_ends_and_what_it_had_saved_stays(tmp_path):
    model, steps = torch.nn.Linear(1, 1), iter(range(9))
    trainer = Trainer(
        model,
        lambda rng, fraction: model.weight.sum() * (float("nan") if next(steps) > 1 else 1.0),
        lambda averaged: {},
        tmp_path,
        Budget.parse("5steps"),
        Settings(every_seconds=0.0),
        lambda line: None,
    )
    with pytest.raises(RequestError, match="got lost") as error:
        trainer.go("")
    assert "learning_rate" in error.value.fix
    kept = torch.load(tmp_path / "averaged.pt", weights_only=True)
    assert all(value.isfinite().all() for value in kept.values())
    assert "NaN" not in (tmp_path / "log.jsonl").read_text()


def test_a_second_run_in_a_folder_is_refused_while_the_first_goes_on(tmp_path):
    model, told = torch.nn.Linear(1, 1), []

    def trainer(loss):  # type: ignore[no-untyped-def]
        settings, budget = Settings(), Budget.parse("1steps")
        return Trainer(model, loss, lambda averaged: {}, tmp_path, budget, settings, told.append)

    def meanwhile(rng, fraction):  # type: ignore[no-untyped-def]
        with pytest.raises(RequestError, match="another run is training there"):
            trainer(lambda rng, fraction: model.weight.sum()).go("second")
        return model.weight.sum()

    trainer(meanwhile).go("first")
    assert "second" not in told
    trainer(meanwhile).go("third")  # the first has ended
    assert "third" in told


def test_a_run_that_is_through_writes_its_average_again_where_it_is_lost(train, tmp_path):
    train(2)
    whole = torch.load(tmp_path / "averaged.pt", weights_only=True)
    (tmp_path / "averaged.pt").unlink()
    train(2)
    again = torch.load(tmp_path / "averaged.pt", weights_only=True)
    assert all(torch.equal(again[name], whole[name]) for name in whole)


@pytest.mark.parametrize("changes", [{"velocities": 0}, {"layers": 5}])
def test_weights_are_not_said_to_be_wired_otherwise(changes):
    small = weights.find("small")
    with pytest.raises(RequestError, match=f"cannot begin with small and {next(iter(changes))}"):
        begin_base(BaseSettings(**changes), tuple(small.labels), small)
    assert begin_base(BaseSettings(), tuple(small.labels), small).config.layers == 6


def test_a_log_whose_last_line_is_cut_off_is_read(walk_pack, tmp_path, monkeypatch):
    monkeypatch.setattr(export, "export_cae_onnx", lambda model, path: path.touch())
    pack, settings = walk_pack("cmu"), cae.CaeSettings(length=64, batch=1, every_seconds=0.0)
    cae.train_cae([pack], tmp_path, Budget.parse("2steps"), settings, say=str)
    with (tmp_path / "log.jsonl").open("a") as log:
        log.write('{"step": 3, "lo')
    assert export.export_cae(tmp_path, [pack], tmp_path / "weights").training["steps"] == 2
    whole = (tmp_path / "averaged.pt").read_bytes()
    (tmp_path / "averaged.pt").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(FileError, match="cannot export"):
        export.export_cae(tmp_path, [pack], tmp_path / "weights")
