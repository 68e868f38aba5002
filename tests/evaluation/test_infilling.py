"""Table 1 of Kaufmann et al. 2020 on small files, with networks to compare with."""

from __future__ import annotations

import json
import shutil

import pytest

from interpose.errors import FileError
from interpose.evaluation import infilling
from interpose.methods import weights


@pytest.fixture
def folders(tmp_path):  # type: ignore[no-untyped-def]
    """The installed weights twice, as if they had been trained for rows of their own."""
    card = weights.find("cae")
    trained = {
        "ours60": {"gap": 30},
        "again": {"gap": 30, "noise": 0.0},
        "l2": {"loss": "l2", "bones": 1.0, "noise": 0.3},
    }
    for name, how in trained.items():
        folder = tmp_path / name
        folder.mkdir()
        shutil.copy(card.onnx, folder)
        kept = {**card.to_dict(), "training": {**card.training, **how}}
        (folder / "cae.json").write_text(json.dumps(kept))
    return tmp_path


@pytest.fixture(autouse=True)
def alone(monkeypatch):  # type: ignore[no-untyped-def]
    monkeypatch.setattr(infilling, "DATASETS", ("lafan1",))


def test_networks_to_compare_with_are_rows_measured_like_the_installed_one(published, folders):
    cards = [weights.load(folders / name, "cae") for name in ("ours60", "again", "l2")]
    result = infilling.run(published, most=1, trained=cards)
    one, other, third = result.networks
    assert one == "cae (gaps of 1 s), true trajectory"
    assert other == f"cae (gaps of 1 s), {folders / 'again'}, true trajectory"
    assert third == "cae (curriculum, L2, bones 1, also on noise), true trajectory"
    for frames in infilling.GAPS:
        known = result.mean("all", "cae, true trajectory", frames)
        assert known is not None
        for row in result.networks:
            assert result.mean("all", row, frames) == pytest.approx(known, rel=1e-6)
    assert f"| {third} |" in result.table()
    assert f"{folders / 'l2'}." in str(result)
    assert result.to_dict()["networks"][third]["parameters"] == 4_703_425
    assert result.to_dict()["networks"][third]["splits"] == cards[2].training["splits"]


def test_a_folder_without_weights_is_one_error(tmp_path):
    with pytest.raises(FileError, match="no weights of cae"):
        weights.load(tmp_path, "cae")
