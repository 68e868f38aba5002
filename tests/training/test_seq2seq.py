"""The sequence-to-sequence recipe: a short run that learns, stops and goes on, and its graph."""

from __future__ import annotations

import json

import numpy as np
import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("onnx")

from interpose.geometry import rotations  # noqa: E402
from interpose.methods import weights  # noqa: E402
from interpose.training.budget import Budget  # noqa: E402
from interpose.training.export import export_seq2seq  # noqa: E402
from interpose.training.poses import Poses  # noqa: E402
from interpose.training.seq2seq import Seq2SeqSettings, train_seq2seq  # noqa: E402

SETTINGS = Seq2SeqSettings(batch=8, seen=12, foretold=6, units=64, average=0.5, learning_rate=5e-3)


@pytest.fixture(scope="module")
def pack(walk_pack):  # type: ignore[no-untyped-def]
    return walk_pack("lafan1", both=True)


@pytest.fixture(scope="module")
def trained(pack, tmp_path_factory):  # type: ignore[no-untyped-def]
    """The folder of a run that was interrupted, its averaged model, and what it told."""
    folder, lines = tmp_path_factory.mktemp("run"), []
    train_seq2seq([pack], folder, Budget.parse("12steps"), SETTINGS, say=lines.append)
    model = train_seq2seq([pack], folder, Budget.parse("24steps"), SETTINGS, say=lines.append)
    return folder, model, lines


def test_it_learns_to_go_on_better_than_by_holding_the_pose(pack, trained):
    folder, model, lines = trained
    batch = Poses([pack], ["train"], ("", "walk"), 18, torch.device("cpu")).spread(8, 18)
    with torch.no_grad():
        values = model.normalised(batch.rotation)
        made = model.go_on(values[:, :12], batch.label, 6)
    wrong, held = ((one - values[:, 12:]).square().mean() for one in (made, values[:, 11:12]))
    assert wrong < 0.8 * held
    log = [json.loads(line) for line in (folder / "log.jsonl").read_text().splitlines()]
    assert log[-1]["step"] == 24
    assert {"degrees15", "ratio120", "moves"} <= log[-1].keys()
    assert any("goes on at 50 %" in line for line in lines)


def test_the_graph_goes_on_as_the_network_does(pack, trained, tmp_path):
    """Exported with two motions, run with three; weights have 16 bits."""
    folder, model, _ = trained
    written = export_seq2seq(folder, [pack], tmp_path, ["train"])
    card = weights.load(tmp_path, "seq2seq")
    assert card == written
    assert card.labels == ["", "walk"]
    assert card.training["parameters"] == sum(p.numel() for p in model.parameters())
    batch = Poses([pack], ["train"], card.labels, 3, torch.device("cpu")).spread(3, 3)
    state = torch.randn(3, model.config.units)
    turned, label = batch.rotation[:, 0], torch.tensor([1, 0, 1])
    with torch.no_grad():
        expected = model(turned, label, state)
    feed = {"rotation": turned.numpy(), "label": label.numpy(), "state": state.numpy()}
    there, after = weights.session(card.onnx).run(None, feed)
    assert rotations.angle(torch.from_numpy(there), expected[0]).max() < 2e-3
    assert np.abs(after - expected[1].numpy()).max() < 2e-3
