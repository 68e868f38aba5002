"""Table 2 of Kaufmann et al. 2020 on a small file: what networks are given, and how answers are counted."""

from __future__ import annotations

import json

import numpy as np
import pytest

from interpose.cli import main
from interpose.evaluation import noise
from interpose.methods import cae, weights


@pytest.fixture(autouse=True)
def small(monkeypatch):  # type: ignore[no-untyped-def]
    """One data set, and batches that divide nothing."""
    monkeypatch.setattr(noise, "DATASETS", ("lafan1",))
    monkeypatch.setattr(noise, "BATCH", 2)


def perfect(positions, added, kept):  # type: ignore[no-untyped-def]
    return noise.in_body_frame(positions)


def credulous(positions, added, kept):  # type: ignore[no-untyped-def]
    return noise.in_body_frame(positions) + added


def test_noise_and_lost_joints_are_those_of_the_paper(published):
    given = []

    def network(positions, added, kept):  # type: ignore[no-untyped-def]
        given.append((added, kept))
        return credulous(positions, added, kept)

    networks = {"perfect": perfect, "credulous": network}
    result = noise.run(published, networks, {})
    assert result.windows == 3, "418 frames, all windows of 120"
    for column, (sigma, lost) in noise.COLUMNS.items():
        added, kept = map(np.concatenate, zip(*given[list(noise.COLUMNS).index(column) :: 4]))
        assert added.std() == pytest.approx(sigma, rel=0.02)
        assert (~kept[..., 1:]).mean() == pytest.approx(lost, abs=0.01)
        assert kept[..., 0].all(), "the hips stay"
        assert result.mean("perfect", column) == (0.0, 0.0)
        # The length of a vector of three normal deviates.
        assert result.mean("credulous", column)[0] == pytest.approx(
            100 * sigma * np.sqrt(8 / np.pi), rel=0.02
        )
    for column in ("sigma 1.0", "sigma 1.5"):
        assert result.mean(noise.INPUT, column) == pytest.approx(result.mean("credulous", column))
    assert 0 < result.mean(noise.INPUT, "p .3")[0] < result.mean(noise.INPUT, "p .5")[0] < 2
    assert "| paper: CAE | 5.8 | 7.8 | 3.1 | 4.0 |" in str(result)


def test_windows_are_drawn_alike_every_time(published):
    def drawn(most):  # type: ignore[no-untyped-def]
        seen = []

        def network(positions, added, kept):  # type: ignore[no-untyped-def]
            seen.append(positions)
            return perfect(positions, added, kept)

        result = noise.run(published, {"network": network}, {}, most=most)
        return result.to_dict(), np.concatenate(seen[:: len(noise.COLUMNS)])

    (first, one), (second, same), (_, more) = drawn(2), drawn(2), drawn(3)
    assert first == second
    assert first["windows"] == 2
    assert np.array_equal(one, same)
    assert np.array_equal(more[:2], one)
    assert not np.array_equal(one[0], one[1])


def test_the_command_runs_the_installed_network_and_others(published, tmp_path, capsys):
    pytest.importorskip("torch")
    card, folder = weights.find("cae"), tmp_path / "noisy"
    folder.mkdir()
    (folder / "cae.onnx").symlink_to(card.onnx)
    how = {**card.to_dict(), "training": {**card.training, "noise": 0.3}}
    (folder / "cae.json").write_text(json.dumps(how))
    given = ["--data", str(published), "--most", "1", "--weights", str(folder)]
    assert main(["bench", "noise", *given, "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    errors, networks = said["errors"], said["networks"]
    assert list(errors) == [noise.INPUT, "cae (curriculum)", "cae (curriculum, also on noise)"]
    ours, again = errors["cae (curriculum)"], errors["cae (curriculum, also on noise)"]
    assert ours == again
    assert ours["p .3"]["mean"] < ours["p .5"]["mean"] < 10
    assert ours["sigma 1.0"]["mean"] < ours["sigma 1.5"]["mean"]
    assert networks["cae (curriculum)"]["splits"] == card.training["splits"]


def test_what_is_run_is_the_network_that_users_run(published):
    torch_side = pytest.importorskip("interpose.training.cae")
    card = weights.find("cae")
    seen = []

    def network(positions, added, kept):  # type: ignore[no-untyped-def]
        seen.append(positions)
        return perfect(positions, added, kept)

    noise.run(published, {"network": network}, {}, most=1)
    positions = seen[0]
    whole = np.ones(positions.shape[:-1], bool)
    theirs = cae.run(card.onnx, positions, whole)[0]
    ours = torch_side.reconstruct(torch_side.trained(card), positions, np.zeros_like(positions), whole)
    assert np.abs(ours - theirs).max() < 1e-4
    assert np.abs(ours - noise.in_body_frame(positions)).mean() < 0.05
