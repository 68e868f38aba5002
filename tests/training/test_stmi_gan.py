"""STMI-GAN's recipe: what is hidden, what the losses count, and a run that learns, stops and goes on."""

from __future__ import annotations

import json

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from safetensors.torch import load_file  # noqa: E402

pytest.importorskip("onnx")

from interpose.errors import RequestError  # noqa: E402
from interpose.methods import weights  # noqa: E402
from interpose.methods.stmi_gan import StmiGan, run, run_both, run_long  # noqa: E402
from interpose.models.stmi_gan import PAPER, Discriminator, Generator  # noqa: E402
from interpose.skeletons import SIDES  # noqa: E402
from interpose.training import stmi_gan  # noqa: E402
from interpose.training.budget import Budget  # noqa: E402
from interpose.training.export import export_stmi_gan  # noqa: E402
from interpose.training.stmi_gan import (  # noqa: E402
    Game,
    Motions,
    StmiGanSettings,
    corrupt,
    draw,
    fit_normaliser,
    train_stmi_gan,
)
from interpose.training.windows import Windows  # noqa: E402


@pytest.fixture(scope="module")
def pack(walk_pack):  # type: ignore[no-untyped-def]
    return walk_pack("bandai", both=True)


@pytest.fixture(scope="module")
def windows(pack):  # type: ignore[no-untyped-def]
    return Windows([pack], ("train",), 120, torch.device("cpu"))


def game(windows, **changes):  # type: ignore[no-untyped-def]
    settings = StmiGanSettings(**{"config": "paper", **changes})
    torch.manual_seed(0)
    generator, discriminator = Generator(settings.network), Discriminator(settings.network)
    fit_normaliser(generator, discriminator, windows, settings)
    return Game(generator, discriminator, windows, settings, 4)


def test_what_is_hidden():
    rng = np.random.default_rng(0)
    known = corrupt(rng, StmiGanSettings(config="paper"), 400)
    assert known.shape == (400, 20, 22, 3)
    assert known[:, 0].all()
    ends = known[:, -1].all(axis=(1, 2))
    assert 0.4 < (~ends).mean() < 0.6  # forecasts
    assert not known[~ends][:, 10:].any()
    assert known[~ends][:, :10].all()
    others = known[ends]
    single = (others.any(axis=-1) != others.all(axis=-1)).any(axis=(1, 2))
    assert 0.15 < single.mean() < 0.35  # a fourth loses single coordinates
    assert 0.25 < others[:, 1:-1].mean() < 0.75


def test_short_beginnings_where_frames_are_dense():
    known = corrupt(np.random.default_rng(0), StmiGanSettings(config="dense"), 200)
    seen = known[~known[:, -1].all(axis=(1, 2))].all(axis=(2, 3)).sum(axis=1)
    assert 20 <= seen.min() < 30
    assert 70 < seen.max() <= 80


def test_joints_are_lost_all_along_or_for_a_while_where_frames_are_dense():
    for config, while_ in (("dense", 0.5), ("paper", 0.0)):
        known = corrupt(np.random.default_rng(0), StmiGanSettings(config=config), 400)[..., 1:-1, :, :]
        # Motions of which whole joints are lost, and others are known from one end to the other.
        held, lost = known.all(axis=(1, 3)), ~known.all(axis=(1, 3))
        some = held.any(axis=1) & lost.any(axis=1)
        along = np.array([(~one[:, gone]).all() for one, gone in zip(known[some], lost[some])])
        assert abs((~along).mean() - while_) < 0.15


def test_twenty_frames_of_four_seconds_one_of_each_block(windows):
    settings = StmiGanSettings(config="paper", tallest=1.0)
    motions = draw(np.random.default_rng(0), windows, settings, 3)
    assert motions.shape == (3, 20, 22, 3)
    small = draw(np.random.default_rng(0), windows, StmiGanSettings(config="paper"), 3)
    ratio = (small / motions)[..., 1].flatten(1)
    assert torch.allclose(ratio, ratio[:, :1], atol=1e-4)
    assert ((ratio[:, 0] > 0.7) & (ratio[:, 0] < 1.3)).all()


def test_only_what_is_visible_counts_with_a_discriminator_and_all_without(windows):
    for branches, counts in (("base", False), ("none", True)):
        play = game(windows, branches=branches, bones=0.0)
        truth = draw(np.random.default_rng(0), windows, play.settings, 2)
        observed = torch.ones_like(truth, dtype=torch.bool)
        observed[:, 10:] = False
        wrong = truth.clone()
        wrong[:, 10:] += 0.1
        right, off = (float(play.told(Motions(truth, observed, made, truth))) for made in (truth, wrong))
        assert right < 1e-3
        assert (off > 1.0) == counts


def test_bones_that_are_too_long_cost_everywhere(windows):
    play = game(windows)
    truth = draw(np.random.default_rng(0), windows, play.settings, 2)
    observed = torch.zeros_like(truth, dtype=torch.bool)
    assert float(play.told(Motions(truth, observed, 1.1 * truth, truth))) > 1.0
    moved = truth + torch.tensor([1.0, 0.0, 0.0])
    assert float(play.told(Motions(truth, observed, moved, truth))) < 0.01


def test_each_side_gains_by_what_is_worse_for_the_other(windows, monkeypatch):
    """A judge that takes motions for the data's by the sign of their coordinates."""

    class Judge:
        def __init__(self, right: float) -> None:
            self.right = right

        def seen(self, motion):  # type: ignore[no-untyped-def]
            return motion

        def __call__(self, motion):  # type: ignore[no-untyped-def]
            return self.right * motion.mean(dim=(1, 2, 3))

    play = game(windows, gamma=0.0, reconstruction=0.0, limbs=0.0, bones=0.0)
    shape = draw(np.random.default_rng(0), windows, play.settings, 2).shape
    ones = torch.ones(shape)
    motions = Motions(ones, ones.bool(), -ones, ones)
    monkeypatch.setattr(play, "play", lambda rng: motions)
    found = []
    for right in (5.0, -5.0):
        play.discriminator = Judge(right)
        rng = np.random.default_rng(0)
        with torch.no_grad():
            maker = float(play.loss(rng, 0.0))
        found.append((float(play.opponent_loss(rng, 0.0).detach()), maker))
    (judge_right, maker_right), (judge_wrong, maker_wrong) = found
    assert judge_right < 0.1 < judge_wrong
    assert maker_wrong < 1.0 < maker_right


def test_the_penalty_reaches_every_branch(windows):
    """R1 needs gradients of gradients: those of the penalty alone must move all branches."""
    play = game(windows, every=1)
    play.opponent_loss(np.random.default_rng(0), 0.0).backward()
    assert all(
        p.grad is not None and p.grad.abs().sum() > 0 for p in play.discriminator.branches.parameters()
    )
    assert all(p.grad is None for p in play.generator.parameters())


def test_the_discriminator_may_learn_alone_at_first(windows):
    play = game(windows, lead=0.1)
    rng = np.random.default_rng(0)
    play.opponent_loss(rng, 0.05).backward()
    assert not play.loss(rng, 0.05).requires_grad
    play.loss(rng, 0.1).backward()
    assert any(p.grad is not None and p.grad.any() for p in play.generator.parameters())


def test_an_optimiser_does_not_count_steps_in_which_nothing_is_learned(pack, tmp_path, monkeypatch):
    """Its first real steps would be many times too long."""
    tiny = stmi_gan.replace(PAPER, width=32, gates=1, blocks=1, channels=(4, 6))
    monkeypatch.setitem(stmi_gan.CONFIGS, "paper", tiny)
    settings = StmiGanSettings(config="paper", batch=2, lead=0.7)
    train_stmi_gan([pack], tmp_path, Budget.parse("5steps"), settings, say=lambda line: None)
    state = torch.load(tmp_path / "checkpoint.pt", weights_only=False)
    counts = [
        {float(one["step"]) for one in state[name]["state"].values()}
        for name in ("optimizer", "opponent_optimizer")
    ]
    assert counts == [{1.0}, {5.0}]


@pytest.mark.parametrize("changes", [{"branches": "base,sound"}, {"config": "large"}, {"lead": 1.0}])
def test_settings_that_are_none(changes):
    with pytest.raises(RequestError, match=r"base, edm, motion|paper|0 to 0\.9"):
        StmiGanSettings(**changes)


def test_a_run_learns_stops_and_goes_on(pack, tmp_path, monkeypatch):
    """The discriminator and its optimiser are kept, too; what comes out is a graph that says the same."""
    tiny = stmi_gan.replace(PAPER, together=2, width=32, gates=1, blocks=1, channels=(4, 6))
    monkeypatch.setitem(stmi_gan.CONFIGS, "paper", tiny)
    settings = StmiGanSettings(config="paper", batch=4, every_seconds=0.0)
    told: list[str] = []
    train_stmi_gan([pack], tmp_path, Budget.parse("6steps"), settings, say=told.append)
    state = torch.load(tmp_path / "checkpoint.pt", weights_only=False)
    assert state["steps"] == 6
    assert state["opponent_optimizer"]["state"]
    told.clear()
    model = train_stmi_gan([pack], tmp_path, Budget.parse("9steps"), settings, say=told.append)
    assert any("goes on at 67 %" in line for line in told)
    log = [json.loads(line) for line in (tmp_path / "log.jsonl").read_text().splitlines()]
    assert log[-1]["step"] == 9
    assert all(np.isfinite(value) for entry in log for value in entry.values())

    export_stmi_gan(tmp_path, [pack], tmp_path / "weights", ["train"])
    card = weights.load(tmp_path / "weights", "stmi-gan")
    judge = torch.load(tmp_path / "checkpoint.pt", weights_only=False)["opponent"]
    for name, value in load_file(tmp_path / "weights" / "discriminator.safetensors").items():
        assert torch.allclose(value.float(), judge[name], rtol=1e-3, atol=1e-3)
    told.clear()
    train_stmi_gan([pack], tmp_path / "on", Budget.parse("1steps"), settings, start=card, say=told.append)
    assert "goes on with the discriminator of stmi-gan" in told
    rng = np.random.default_rng(2)
    positions = draw(rng, Windows([pack], ("train",), 120, torch.device("cpu")), settings, 2).numpy()
    observed = rng.random((2, 20, 22, 3)) < 0.7
    observed[:, 0] = True
    raw, completed = run(card, positions, observed)
    still = torch.zeros(2, model.noises, 10, 32)
    with torch.no_grad():
        for value in model.parameters():
            if value.numel() >= 1024:  # stored in 16 bits
                value.copy_(value.half())
        expected = model(torch.from_numpy(positions), torch.from_numpy(observed), still)
    assert np.allclose(raw, expected[0], atol=1e-4)
    assert np.allclose(completed, expected[1], atol=1e-4)

    # Lost joints are restored alike on either side.
    def across(values: np.ndarray) -> np.ndarray:
        return values[:, :, list(SIDES)] * [-1, 1, 1]

    for one, image in zip(
        run_both(card, positions, observed), run_both(card, across(positions), observed[:, :, list(SIDES)])
    ):
        assert np.allclose(one, across(image), atol=1e-5)
    whole = observed.all(axis=-1)
    assert np.allclose(run_both(card, positions, observed)[1][whole], positions[whole], atol=1e-5)

    # Forecasts go on past the window; what is known stays.
    motion, seen = positions[0].repeat(3, axis=0).astype(float), np.ones((60, 22), bool)
    seen[25:] = False
    _, _, longer = run_long(card, motion, seen, np.random.default_rng(0), 1.0)
    assert np.array_equal(longer[:25], motion[:25])
    assert np.isfinite(longer).all()
    spoiled = np.where(seen[..., None], motion, 77.0)
    assert np.array_equal(longer, run_long(card, spoiled, seen, np.random.default_rng(0), 1.0)[2])
    assert StmiGan(card).at(0.5).temperature == 0.5
