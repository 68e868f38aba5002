"""Figure 5 of Kaufmann et al. 2020 on a small file: lengths of bones as networks say them."""

from __future__ import annotations

import json
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from interpose.cli import main
from interpose.evaluation import bones
from interpose.methods import weights
from interpose.methods.cae import run as run_network

SVG = "{http://www.w3.org/2000/svg}"


@pytest.fixture(autouse=True)
def small(monkeypatch):  # type: ignore[no-untyped-def]
    monkeypatch.setattr(bones, "DATASETS", ("lafan1",))


@pytest.mark.parametrize("larger", [1.0, 1.1])
def test_lengths_are_those_of_the_bones_and_the_truth_is_known(published, monkeypatch, larger):
    def network(path, positions, observed):  # type: ignore[no-untyped-def]
        assert observed.all(), "pure reconstruction"
        return larger * positions, positions, positions

    monkeypatch.setattr(bones.cae, "run", network)
    result = bones.run(published, [weights.find("cae")])
    assert result.windows == {"lafan1": 3}
    (row,) = result.cards
    for box, truth in zip(result.wrong(row), bones.TRUTH):
        for value in vars(box).values():
            assert value == pytest.approx((larger - 1) * truth, abs=1e-6)


def test_the_command_draws_a_box_for_each_bone_and_network(published, tmp_path, capsys, monkeypatch):
    card, folder = weights.find("cae"), tmp_path / "other"
    folder.mkdir()
    (folder / "holden.onnx").symlink_to(card.onnx)
    how = {**card.to_dict(), "name": "holden", "training": {**card.training, "gap": 30}}
    (folder / "holden.json").write_text(json.dumps(how))

    def network(path, positions, observed):  # type: ignore[no-untyped-def]
        body, *others = run_network(card.onnx, positions, observed)
        return (1.05 * body if path != card.onnx else body), *others

    monkeypatch.setattr(bones.cae, "run", network)
    picture = tmp_path / "bones.svg"
    given = ["--data", str(published), "--most", "1", "--weights", str(folder), "--plot", str(picture)]
    assert main(["bench", "bones", *given, "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert list(said["length_minus_truth"]) == ["cae (curriculum)", "holden (gaps of 1 s)"]
    for bone, truth in said["truth"].items():
        ours, other = (boxes[bone] for boxes in said["length_minus_truth"].values())
        assert abs(ours["median"]) < 3
        assert other["median"] - ours["median"] == pytest.approx(0.05 * (truth + ours["median"]))
    groups = [g for g in ET.parse(picture).iter(SVG + "g") if g.get("class") == "series"]
    assert [g.find(SVG + "title").text for g in groups] == list(said["length_minus_truth"])
    assert [len(g.findall(SVG + "rect")) for g in groups] == [6, 6]
    assert np.isclose(said["truth"]["thigh"], 43.5, atol=0.05)
