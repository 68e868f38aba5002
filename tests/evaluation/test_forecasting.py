"""Table 1 of Hernandez Ruiz et al. 2019 on small files, with networks that are made up."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from interpose.errors import FileError, RequestError
from interpose.evaluation import forecasters, forecasting
from interpose.evaluation.forecasters import AHEAD, SEEN, Motions, upright
from interpose.evaluation.forecasting import Judge, Row
from interpose.methods.weights import Card
from interpose.skeletons.body import facing
from interpose.skeletons.humanoid import canonical_positions


@pytest.fixture(autouse=True)
def alone(monkeypatch):  # type: ignore[no-untyped-def]
    monkeypatch.setattr(forecasters, "DATASETS", ("lafan1",))


@pytest.fixture(scope="module")
def motions(published):  # type: ignore[no-untyped-def]
    """Two windows of a walk."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(forecasters, "DATASETS", ("lafan1",))
        return forecasters.read(published, "validation")


def card(method="stmi-gan", config="paper", branches=("base", "edm", "motion"), folder="w"):  # type: ignore[no-untyped-def]
    """Of weights that are not there."""
    fps, frames = (5.0, 20) if config == "paper" else (30.0, 120)
    training = {"parameters": 7, "device_hours": 0.5}
    if method == "stmi-gan":
        training |= {"config": config, "network": {"frames": frames, "branches": list(branches)}}
    return Card(
        method,
        method,
        "",
        "",
        [],
        [],
        [],
        fps if method == "stmi-gan" else 30.0,
        60,
        training,
        labels=["", "run", "walk"],
        path=Path(folder) / "w.json",
    )


def straight_on(wobble=0.0):  # type: ignore[no-untyped-def]
    """A network that goes on as the last two known frames do, with noise of so many metres; settled it is 25
    cm ahead."""
    asked = []

    def run(card, positions, observed, rng):  # type: ignore[no-untyped-def]
        asked.append(observed)
        known = int(observed[0, :, 0, 0].sum())
        step = positions[:, known - 1] - positions[:, known - 2]
        since = np.arange(1, positions.shape[1] - known + 1)[:, None, None]
        made = positions[:, [known - 1]] + since * step[:, None]
        made = made + wobble * rng.standard_normal(made.shape)
        whole = np.concatenate([positions[:, :known], made], axis=1)
        return whole, whole + np.array([0.0, 0.0, 0.25])

    return run, asked


def test_windows_are_motions_of_the_canonical_body(motions):
    assert motions.positions.shape == (2, SEEN + AHEAD, 22, 3)
    assert motions.labels == ("run", "run")
    placed = canonical_positions(motions.rotation[1], motions.positions[1, :, 0], motions.bones[1])
    assert np.abs(placed - motions.positions[1]).max() < 1e-6
    assert motions.seen.positions.shape[1] == motions.seen.rotation.shape[1] == SEEN
    fifths = forecasters.thin(np.arange(SEEN)[None], 30, 5)[0]
    assert fifths.tolist() == [5, 11, 17, 23, 29, 35, 41, 47, 53, 59], "the last frame is among them"


def test_the_truth_as_a_forecast_is_perfect_and_its_mirror_in_time_only_as_lively(motions):
    judge, perfect, backwards = Judge(motions, 5, [0, 1]), Row(lambda seen, seed: seen), Row(lambda s, n: s)
    last = motions.positions[:, SEEN - 1]
    for row, made in ((perfect, judge.truth), (backwards, judge.truth[:, ::-1])):
        judge.spectra(row, made, last)
        judge.distances(row, made)
    assert perfect.off == perfect.turned == [0.0] * 4
    assert perfect.shown == [(0.0, 1.0)] * 2
    assert perfect.frechet == pytest.approx(0.0, abs=1e-4)
    for figures in perfect.spectra.values():
        assert all(there == back == 0 for _, there, back in figures)
    # Spectra over the whole forecast do not see the direction of time, distances do.
    assert np.allclose(backwards.spectra["paper"][-1], perfect.spectra["paper"][-1], atol=1e-9)
    assert min(backwards.off) > 100


def test_poses_that_stay(motions):
    held = forecasters.zero_velocity(motions.seen, 0)
    assert held.shape == (2, AHEAD, 22, 3)
    assert (held == motions.positions[:, [SEEN - 1]]).all()
    mean = forecasters.mean_pose(motions)(motions.seen, 0)
    last = motions.positions[:, SEEN - 1]
    assert np.allclose(mean[:, 7, 0], last[:, 0]), "where the last pose is"
    assert np.allclose(facing(mean[:, 7]), facing(last)), "facing as it does"
    assert np.allclose(upright(mean)[0, 3], upright(mean)[1, 5])


@pytest.mark.parametrize(("config", "frames"), [("paper", 20), ("dense", 120)])
def test_inpainting_goes_on_from_itself_at_its_own_frame_rate(motions, monkeypatch, config, frames):
    """A body that is carried along evenly, by a network that goes straight on, ends up where it would."""
    run, asked = straight_on()
    monkeypatch.setattr(forecasters.stmi_gan, "run", run)
    monkeypatch.setattr(forecasters, "BATCH", 1)
    way = np.arange(SEEN + AHEAD)[:, None, None] * np.array([0.02, 0.0, 0.01])
    carried = Motions(motions.positions[:, :1] + way, motions.rotation, motions.bones, ("", ""), ("", ""))
    made = forecasters.inpainting(card(config=config))(carried.seen, 0)
    assert made.shape == (2, frames, 22, 3)
    assert np.allclose(made, forecasters.thin(carried.positions[:, SEEN:], 30, frames / 4))
    assert len(asked) == 4, "two windows after each other, one motion at once"
    assert all(one[:, : frames // 2].all() and not one[:, frames // 2 :].any() for one in asked)
    settled = forecasters.inpainting(card(config=config), settled=True)(carried.seen, 0)
    assert np.allclose((settled - made)[:, : frames // 2], [0.0, 0.0, 0.25])


def test_sequence_to_sequence_reads_two_seconds_and_then_its_own_poses(motions, monkeypatch):
    read = []

    def run(_, feed):  # type: ignore[no-untyped-def]
        read.append(feed)
        count = feed["state"] + 1
        made = np.zeros_like(feed["rotation"])
        made[..., 0] = count[:, :1]
        return made, count

    session = SimpleNamespace(run=run, get_inputs=lambda: [SimpleNamespace(shape=("n", 4))] * 3)
    monkeypatch.setattr(forecasters.weights, "session", lambda path: session)
    made = forecasters.seq2seq(card("seq2seq"))(motions.seen, 0)
    assert made.shape == (2, AHEAD, 22, 3)
    assert len(read) == SEEN + AHEAD - 1
    assert (read[0]["label"] == 1).all(), "told that they run"
    for frame in range(SEEN):
        assert np.allclose(read[frame]["rotation"], motions.rotation[:, frame], atol=1e-6)
    assert read[SEEN]["rotation"][0, 0, 0] == SEEN, "what it said after the last frame that is seen"
    assert np.allclose(made[:, :, 0], motions.positions[:, [SEEN - 1], 0]), "the hips stay"
    assert read[0]["state"].shape == (2, 4)


def test_labels_that_a_network_does_not_know_are_none(motions, monkeypatch):
    told = []

    def run(_, feed):  # type: ignore[no-untyped-def]
        told.append(feed["label"])
        return feed["rotation"], feed["state"]

    session = SimpleNamespace(run=run, get_inputs=lambda: [SimpleNamespace(shape=("n", 4))] * 3)
    monkeypatch.setattr(forecasters.weights, "session", lambda path: session)
    strange = Motions(motions.positions, motions.rotation, motions.bones, ("walk", "juggle"), ("", ""))
    made = forecasters.seq2seq(card("seq2seq"))(strange.seen, 0)
    assert told[0].tolist() == [2, 0]
    assert np.allclose(made, motions.positions[:, [SEEN - 1]], atol=1e-5), "the pose that it repeats"


def test_all_rows_with_the_paper_s_beside_them(published, monkeypatch):
    monkeypatch.setattr(forecasters.stmi_gan, "run", straight_on(0.001)[0])
    cards = [card(), card(branches=()), card(folder="again"), card(config="dense")]
    result = forecasting.run(published, trained=cards, samples=3)
    assert list(result.rows)[3:] == [
        "STMI-GAN, paper",
        "STMI-GAN, paper, settled",
        "NoGAN, paper",
        "STMI-GAN, paper, again",
        "STMI-GAN, paper, again, settled",
        "STMI-GAN, dense",
        "STMI-GAN, dense, settled",
    ]
    assert result.counts == {"lafan1": 2, "train": 2}
    data, still, _, ours, *_ = result.rows.values()
    for variant in forecasting.VARIANTS:
        assert all(entropy > 0.1 for entropy, _, _ in data.spectra[variant])
        assert all(s[0] < 0.1 * d[0] for s, d in zip(still.spectra[variant], data.spectra[variant]))
    assert still.off == sorted(still.off), "the longer, the farther"
    assert not still.spread
    assert 0.5 < ours.spread[0] < 5, "millimetres"
    assert ours.spread[-1] > max(ours.spread[:-1])
    table = result.table()
    assert table.count("0.68099") == 3, "the paper's figure beside each of its rows"
    assert "paper: PSEnt" in table
    words = [words for words, *_ in result.targets()]
    assert "STMI-GAN, paper: PSKL(GT, Gen) of NoGAN, paper to this, at worst" in words
    assert not any(w.startswith("STMI-GAN, dense") and "NoGAN" in w for w in words), "another network"
    assert not any("settled" in w for w in words), "the paper's targets are of what the network says"
    assert json.loads(json.dumps(result.to_dict()))["rows"]["NoGAN, paper"]["published"]
    assert "7 parameters, 0.50 h of training, again" in str(result)


def test_published_divergences_stand_under_their_own_headings():
    """The paper's code prints PSKL(Gen, GT) first: still forecasts are the further off the other way."""
    for kind in ("seq2seq", "NoGAN"):
        assert all(there > back for _, there, back in forecasting.published(kind))
    assert forecasting.published("seq2seq")[3] == (0.09333, 0.37605, 0.18692)
    assert forecasting.published("mean pose") == []


def test_networks_with_fewer_frames_than_are_measured_are_left_out(published, monkeypatch):
    monkeypatch.setattr(forecasters.stmi_gan, "run", straight_on()[0])
    result = forecasting.run(published, trained=[card(), card(config="dense")], rate=30, samples=2, most=1)
    assert list(result.rows)[3:] == ["STMI-GAN, dense", "STMI-GAN, dense, settled"]
    assert result.rows["STMI-GAN, dense"].spread == [0.0] * 5, "it used no noise"
    assert len(result.shown) == 1


def test_data_and_weights_that_are_not_there(published, tmp_path, monkeypatch):
    with pytest.raises(FileError, match="no weights that forecast"):
        forecasters.load([tmp_path])
    monkeypatch.setattr(forecasters, "AHEAD", 10_000)
    with pytest.raises(RequestError, match="nothing to measure with"):
        forecasters.read(published, "validation")
