"""Table 3 of Hernandez Ruiz et al. 2019 on small files: what is hidden stays hidden, and what is measured."""

from __future__ import annotations

import numpy as np
import pytest

from interpose.errors import RequestError
from interpose.evaluation import occlusion
from interpose.methods import weights

FRAMES = occlusion.SECONDS * occlusion.FPS


@pytest.fixture(autouse=True)
def alone(monkeypatch):  # type: ignore[no-untyped-def]
    monkeypatch.setattr(occlusion, "DATASETS", ("lafan1",))


@pytest.fixture(scope="module")
def spied(published):  # type: ignore[no-untyped-def]
    """The results by way to draw, and what a row of its own was shown."""
    shown: list[tuple[np.ndarray, np.ndarray]] = []

    def spy(positions, known):  # type: ignore[no-untyped-def]
        shown.append((positions, known))
        return positions + 1.0

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(occlusion, "DATASETS", ("lafan1",))
        results = {
            drawn: occlusion.run(published, drawn=drawn, rate=30, most=1, networks={"spy": spy})
            for drawn in occlusion.PROBLEMS
        }
    return results, shown


def test_rows_see_nothing_that_is_hidden(spied):
    _, shown = spied
    assert len(shown) == 10
    for positions, known in shown:
        assert positions.shape == known.shape == (FRAMES, 22, 3)
        assert known[[0, -1]].all()
        assert (positions[~known] == 0).all()


def test_every_problem_is_measured_in_every_row(spied):
    results, _ = spied
    for drawn, result in results.items():
        assert result.rows == ("linear", "kalman", "cae", "spy")
        assert list(result.errors["all"]) == list(occlusion.PROBLEMS[drawn])
        entry = result.to_dict()
        for problem in occlusion.PROBLEMS[drawn]:
            assert entry["errors"]["lafan1"][problem]["linear"]["ratio"] == 1
            assert 0 < entry["errors"]["all"][problem]["kalman"]["mean"] < 2000
        assert "paper: linear, LR-Kalman, NoGAN, STMI-GAN" in result.table()
        assert "1 windows, validation" in str(result)


def test_how_much_is_hidden(spied):
    results, _ = spied
    hidden = {drawn: result.to_dict()["hidden"] for drawn, result in results.items()}
    assert hidden["exact"][occlusion.JOINTS_GONE] == pytest.approx(18 / 22)
    assert hidden["exact"][occlusion.FRAMES_GONE] == pytest.approx(94 / 118)
    assert hidden["exact"][occlusion.NOISY] == pytest.approx(1 - 0.2**3, abs=0.005), "joints that lose any"
    assert hidden["code"][occlusion.FRAMES_GONE] == pytest.approx(1 - np.exp(-0.8), abs=0.08)
    assert hidden["code"][occlusion.NOISY] == pytest.approx(0.8, abs=0.03)


def test_only_hidden_coordinates_count(spied):
    """The row is a metre off in each coordinate. All of a hidden joint count, but for noise, where what is
    known of it stays."""
    result = spied[0]["exact"]
    assert result.mean("all", occlusion.NOISY, "spy") < 1.8 * 1000
    positions = np.arange(FRAMES * 66, dtype=float).reshape(FRAMES, 22, 3)
    known = np.zeros(positions.shape, bool)
    known[[0, -1]] = True
    assert np.allclose(occlusion.linear(positions * known, known), positions), "a straight line is met"


def test_the_order_of_the_table(spied):
    """On a walk: lines suit frames and coordinates, and what the visible joints tell suits lost joints."""
    result = spied[0]["exact"]
    assert result.ratio("all", occlusion.JOINTS_GONE, "kalman") < 0.7
    assert result.ratio("all", occlusion.FRAMES_GONE, "kalman") == pytest.approx(1, abs=0.1)
    assert result.mean("all", occlusion.FRAMES_GONE, "linear") < 50


def test_the_same_is_hidden_every_time(published, spied):
    again = occlusion.run(published, rate=30, most=1)
    before = spied[0]["exact"].to_dict()["errors"]["all"]
    for problem, rows in again.to_dict()["errors"]["all"].items():
        for row, figures in rows.items():
            assert figures == before[problem][row]


def test_as_few_frames_as_in_the_paper(published):
    """The installed network sees them frame by frame; what knows 30 a second alone is no row."""
    card = weights.find("stmi-gan")
    rows = occlusion.networks([card], 5)
    with pytest.raises(RequestError, match="20 frames, and windows have 120") as error:
        occlusion.networks([card], 30)
    assert "--fps 5" in error.value.fix
    result = occlusion.run(published, most=1, networks=rows)
    assert result.rows == ("linear", "kalman", "STMI-GAN, paper", "STMI-GAN, paper, as users get it")
    assert result.to_dict()["rate"] == 5
    assert result.to_dict()["hidden"][occlusion.FRAMES_GONE] == pytest.approx(14 / 18)
    assert result.ratio("all", occlusion.JOINTS_GONE, "STMI-GAN, paper") < 0.7


def test_other_ways_to_draw_are_refused(published):
    with pytest.raises(RequestError, match="unknown way to draw"):
        occlusion.run(published, drawn="half", most=1)
