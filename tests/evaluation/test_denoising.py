"""The bench of denoising on a small data set: every row is measured, and noise falls."""

from __future__ import annotations

from interpose.evaluation import denoising


def test_the_error_falls_in_every_row(published, monkeypatch):
    monkeypatch.setattr(denoising, "DATASETS", ("lafan1",))
    result = denoising.run(published, most=1)
    assert result.counts == {"lafan1": 1, "all": 1}
    for row in denoising.ROWS:
        before, after = result.figures("all", row)[:, 0]
        assert after < (0.2 if row == "clean" else 0.7 * before), row
    assert str(result).count("| clean |") == 2
    assert result.to_dict()["errors"]["all"]["sigma 1.0"]["after"]["mean"] > 0
    again = denoising.run(published, most=1)
    assert again.to_dict() == result.to_dict()
