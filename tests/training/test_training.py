"""Budgets, curricula, windows, and a short training run that learns, stops and goes on."""

from __future__ import annotations

import json
import os
import signal
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch")
onnx = pytest.importorskip("onnx")

from onnx import numpy_helper  # noqa: E402

from interpose.errors import FileError, RequestError  # noqa: E402
from interpose.methods import weights  # noqa: E402
from interpose.methods.cae import run  # noqa: E402
from interpose.models.cae import Infiller, to_image  # noqa: E402
from interpose.training import base, cae, export, loop  # noqa: E402
from interpose.training.budget import Budget  # noqa: E402
from interpose.training.cae import (  # noqa: E402
    NETWORKS,
    CaeSettings,
    bone_error,
    corrupt,
    curriculum_mean,
    disturb,
    fit_normaliser,
    predict_disturbed,
    train_cae,
)
from interpose.training.deconvolution import quicken  # noqa: E402
from interpose.training.export import export_cae  # noqa: E402
from interpose.training.loop import Settings, Trainer  # noqa: E402
from interpose.training.windows import Windows  # noqa: E402


@pytest.fixture(scope="module")
def pack(walk_pack):  # type: ignore[no-untyped-def]
    return walk_pack("cmu")


@pytest.mark.parametrize(
    ("text", "seconds", "steps"), [("90s", 90, None), ("25m", 1500, None), ("12steps", None, 12)]
)
def test_budgets(text, seconds, steps):
    budget = Budget.parse(text)
    assert (budget.seconds, budget.steps) == (seconds, steps)


@pytest.mark.parametrize("text", ["", "25", "m", "-3h", "0s", "3 weeks", "0.5steps"])
def test_budgets_that_are_none(text):
    with pytest.raises(RequestError, match="--budget 25m"):
        Budget.parse(text)


def test_curriculum_of_the_paper():
    """At 30 fps: 5 frames at first, never shorter again, 60 from epoch 69 of 200 on, in steps of 5."""
    means = [curriculum_mean(CaeSettings(), f) for f in np.linspace(0, 1, 400)]
    assert means[0] == 5
    assert means[-1] == 60
    assert all(a <= b for a, b in zip(means, means[1:]))
    assert sorted(set(np.round(means, 6))) == list(range(5, 65, 5))
    assert curriculum_mean(CaeSettings(), 0.34) < 60 == curriculum_mean(CaeSettings(), 0.346)


def test_corruption_mixes_gaps_and_joints():
    observed = corrupt(np.random.default_rng(0), CaeSettings(), 0.9, 400)
    whole_pose = (~observed).all(axis=2).any(axis=1)
    assert 0.6 < whole_pose.mean() < 0.8
    joints = (~observed[~whole_pose]).all(axis=1).sum(axis=1)
    assert set(joints) == {1, 2, 3}
    assert observed[~whole_pose][:, :, 0].all()


def test_a_fixed_gap_is_as_long_in_every_clip():
    observed = corrupt(np.random.default_rng(0), CaeSettings(gap=30), 0.1, 200)
    assert ((~observed).all(axis=2).sum(axis=1) == 30).all()
    assert ((~observed).any(axis=2).sum(axis=1) == 30).all()
    assert len(np.unique((~observed[..., 0]).argmax(axis=1))) > 50


def test_windows_are_real_motion_padded_with_the_last_pose(pack):
    windows = Windows([pack], ["train"], 500, torch.device("cpu"))
    positions = windows.draw(np.random.default_rng(0), 3, mirror=False)
    half = int(pack.starts[1])
    assert np.allclose(positions[0, :half], pack.positions()[:half], atol=1e-4)
    assert torch.equal(positions[0, half:], positions[0, half - 1 : half].expand(500 - half, -1, -1))


def test_splits_are_kept_apart(pack):
    assert Windows([pack], ["train"], 60, torch.device("cpu")).frames == pack.starts[1]
    with pytest.raises(RequestError, match="nothing to train on"):
        Windows([pack], ["test"], 60, torch.device("cpu"))


def test_training_moves_all_weights_writes_a_log_and_goes_on(pack, tmp_path):
    settings = CaeSettings(length=32, batch=4, every_seconds=0.0, first_gap=4, last_gap=4, sigma=1)
    lines: list[str] = []
    train_cae([pack], tmp_path, Budget.parse("3steps"), settings, say=lines.append)
    model = train_cae([pack], tmp_path, Budget.parse("6steps"), settings, say=lines.append)
    log = [json.loads(line) for line in (tmp_path / "log.jsonl").read_text().splitlines()]
    assert log[-1]["step"] == 6
    assert log[-1]["fraction"] == 1
    assert any("goes on at 50 %" in line for line in lines)
    torch.manual_seed(settings.seed)
    start = Infiller().network.state_dict()
    moved = [float((now - start[name]).abs().max()) for name, now in model.network.state_dict().items()]
    assert min(moved) > 1e-5, "every weight has learned something"
    assert torch.isfinite(torch.cat([p.flatten() for p in model.parameters()])).all()


@pytest.mark.parametrize("network", ["vanilla", "holden"])
def test_networks_to_compare_with_learn_and_are_exported_by_the_same_recipe(pack, tmp_path, network):
    settings = CaeSettings(
        length=64, batch=2, every_seconds=0.0, network=network, gap=20, loss="l2", bones=0.5
    )
    model = train_cae([pack], tmp_path, Budget.parse("2steps"), settings, say=lambda line: None)
    torch.manual_seed(settings.seed)
    start = NETWORKS[network]().network.state_dict()
    moved = [float((now - start[name]).abs().max()) for name, now in model.network.state_dict().items()]
    assert min(moved) > 1e-5, "every weight has learned something"

    written = export_cae(tmp_path, [pack], tmp_path / "out", ["train"])
    card = weights.load(tmp_path / "out", "cae")
    assert card == written
    assert (card.name, card.training["network"], card.max_gap) == (network, network, 40)
    assert card.training["parameters"] == sum(p.numel() for p in model.parameters())
    for parameter in model.parameters():
        if parameter.numel() >= 1024:
            parameter.data = parameter.data.half().float()
    for frames in (97, 120, 131):
        positions = torch.from_numpy(pack.positions()[None, :frames]).float()
        observed = torch.ones(positions.shape[:-1], dtype=torch.bool)
        observed[:, 40:70] = False
        with torch.no_grad():
            theirs = [out.numpy() for out in model(positions, observed)]
        mine = run(card.onnx, positions.numpy().astype(float), observed.numpy())
        assert all(np.abs(a - b).max() < 1e-4 for a, b in zip(mine, theirs))


def test_one_folder_holds_one_network(pack, tmp_path):
    (tmp_path / "settings.json").write_text(json.dumps({"network": "vanilla"}))
    (tmp_path / "log.jsonl").touch()
    (tmp_path / "cae.onnx").touch()
    with pytest.raises(RequestError, match=r"cae\.onnx is in there"):
        export_cae(tmp_path, [pack], tmp_path, ["train"])


@pytest.mark.parametrize(("name", "choices"), [("network", "cae, vanilla, holden"), ("loss", "l1, l2")])
def test_networks_and_losses_that_there_are_not(name, choices):
    with pytest.raises(RequestError, match=choices):
        CaeSettings(**{name: "gan"})


def test_bones_of_the_right_length_cost_nothing(pack):
    windows, rng = Windows([pack], ["train"], 60, torch.device("cpu")), np.random.default_rng(0)
    model = Infiller()
    fit_normaliser(model, windows, rng)
    positions = windows.draw(rng, 2)
    truth = model.normalised(to_image(positions, torch.ones_like(positions[..., 0], dtype=torch.bool)))[0]
    assert float(bone_error(model, truth, truth)) == 0
    # Twice as large, without the normaliser's mean: every bone is too long by its length.
    larger = (2 * (truth * model.std + model.mean) - model.mean) / model.std
    length = np.linalg.norm(pack.body[0, 1:], axis=-1).mean()
    assert float(bone_error(model, larger, truth) * model.std[3:66].mean()) == pytest.approx(length, rel=1e-3)


def test_a_share_of_clips_is_noisy_or_loses_joints():
    settings = CaeSettings(length=60, noise=0.3)
    chosen, noise, kept = disturb(np.random.default_rng(0), settings, 1000)
    sigma, lost = noise.std(axis=(1, 2, 3)), (~kept[:, :, 1:]).mean(axis=(1, 2))
    noisy, gone = sigma > 0, lost > 0
    assert chosen.mean() == pytest.approx(0.3, abs=0.05)
    assert np.array_equal(noisy | gone, chosen)
    assert not (noisy & gone).any()
    assert noisy.sum() == pytest.approx(gone.sum(), rel=0.3)
    assert sigma.max() == pytest.approx(1.5 * 0.0625, rel=0.05)
    assert sigma[noisy].mean() == pytest.approx(0.75 * 0.0625, rel=0.1)
    assert lost.max() == pytest.approx(0.5, abs=0.05)
    assert lost[gone].mean() == pytest.approx(0.25, abs=0.03)
    assert kept[:, :, 0].all()


def test_a_disturbed_image_has_noisy_positions_and_a_clean_trajectory(pack):
    windows, rng = Windows([pack], ["train"], 60, torch.device("cpu")), np.random.default_rng(0)
    model = Infiller()
    fit_normaliser(model, windows, rng)
    positions = windows.draw(rng, 2)
    image = to_image(positions, torch.ones_like(positions[..., 0], dtype=torch.bool))
    noise = torch.from_numpy(rng.normal(0, 0.1, positions.shape)).float()
    kept = torch.from_numpy(rng.random(positions.shape[:-1]) > 0.4)
    whole, silent = torch.ones_like(kept), torch.zeros_like(noise)
    with torch.no_grad():
        assert torch.equal(predict_disturbed(model, image, silent, whole), model.predict(image))
        shifted = to_image(positions, whole)
        shifted.rows[:, :66] += noise.flatten(2).transpose(1, 2)
        assert torch.allclose(
            predict_disturbed(model, image, noise, whole), model.predict(shifted), atol=1e-5
        )
        # Nothing is seen of a lost joint: neither where it is, nor its noise.
        lost = predict_disturbed(model, image, silent, kept)
        assert torch.equal(predict_disturbed(model, image, noise * ~kept[..., None], kept), lost)
        assert not torch.allclose(lost, model.predict(image), atol=1e-3)


class Echo(torch.nn.Module):
    """A network that believes what it is shown."""

    def __init__(self) -> None:
        super().__init__()
        self.scale = torch.nn.Parameter(torch.ones(1))

    def forward(self, image):  # type: ignore[no-untyped-def]
        return image * self.scale


def test_training_on_noise_asks_for_the_clean_clip(pack, tmp_path, monkeypatch):
    """An echo is wrong by the noise, and by it alone: no gap is left, and the answer is the clean clip."""

    def worst(rng, settings, batch):  # type: ignore[no-untyped-def]
        shape = (batch, settings.length, 22)
        return np.ones(batch, bool), np.full((*shape, 3), 0.1, np.float32), np.ones(shape, bool)

    monkeypatch.setitem(NETWORKS, "echo", lambda: Infiller(Echo()))
    monkeypatch.setattr(cae, "disturb", worst)
    settings = CaeSettings(
        length=60, batch=4, gap=30, network="echo", noise=0.5, learning_rate=1e-9, every_seconds=0.0
    )
    model = train_cae([pack], tmp_path, Budget.parse("1steps"), settings, say=lambda line: None)
    log = json.loads((tmp_path / "log.jsonl").read_text())
    assert log["loss"] == pytest.approx(float((0.1 / model.std[:66]).sum()) / 69, rel=0.02)


def test_the_plain_recipe_draws_no_noise(pack, tmp_path, monkeypatch):
    """Its batches are those that it always drew."""
    monkeypatch.setattr(cae, "disturb", lambda *given: pytest.fail("noise was drawn"))
    drawn = []
    monkeypatch.setattr(cae, "to_image", lambda *given: drawn.append(given) or to_image(*given))
    settings = CaeSettings(length=32, batch=3)
    train_cae([pack], tmp_path, Budget.parse("1steps"), settings, say=lambda line: None)
    rng = np.random.default_rng([settings.seed, 0])
    windows = Windows([pack], ["train"], 32, torch.device("cpu"))
    positions, observed = next(given for given in drawn if len(given[0]) == 3)
    assert torch.equal(positions, windows.draw(rng, 3))
    assert np.array_equal(observed.numpy(), corrupt(rng, settings, 0.0, 3))


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_run_that_is_stopped_saves_the_step_that_it_was_at(pack, tmp_path, monkeypatch, number):
    """And once it is over signals do again what they did before, beginning with this one."""

    class Ended(BaseException):
        pass

    def end(number, frame):  # type: ignore[no-untyped-def]
        raise Ended

    drawn = []

    def draw(self, *args):  # type: ignore[no-untyped-def]
        drawn.append(args)
        if len(drawn) == 4:  # the first fits the normaliser
            os.kill(os.getpid(), number)
        return windows_draw(self, *args)

    windows_draw = Windows.draw
    before = signal.signal(number, end)
    try:
        monkeypatch.setattr(Windows, "draw", draw)
        monkeypatch.setattr(cae, "fit_normaliser", lambda *args: drawn.append(args))
        with pytest.raises(Ended):
            train_cae([pack], tmp_path, Budget.parse("50steps"), CaeSettings(length=32, batch=2), say=str)
        assert signal.getsignal(number) is end
    finally:
        signal.signal(number, before)
    assert torch.load(tmp_path / "checkpoint.pt", weights_only=False)["steps"] == 3
    assert json.loads((tmp_path / "log.jsonl").read_text().splitlines()[-1])["step"] == 3


def test_a_damaged_checkpoint_is_one_error(pack, tmp_path):
    (tmp_path / "checkpoint.pt").write_bytes(b"PK not really")
    (tmp_path / "settings.json").write_text("{}")
    with pytest.raises(FileError, match="cannot go on"):
        train_cae([pack], tmp_path, Budget.parse("1steps"), CaeSettings(length=32, batch=2))


def test_a_run_that_starts_anew_has_a_log_of_its_own(pack, tmp_path):
    (tmp_path / "log.jsonl").write_text('{"step": 7, "hours": 1.0, "fraction": 0.9}\n')
    train_cae([pack], tmp_path, Budget.parse("1steps"), CaeSettings(length=32, batch=2), say=str)
    steps = [json.loads(line)["step"] for line in (tmp_path / "log.jsonl").read_text().splitlines()]
    assert 7 not in steps


def test_a_disk_that_is_full_is_one_error(pack, tmp_path, monkeypatch):
    def full(what, path):  # type: ignore[no-untyped-def]
        Path(path).write_bytes(b"half")
        raise RuntimeError("[enforce fail at inline_container.cc:672] . unexpected pos")

    monkeypatch.setattr(torch, "save", full)
    with pytest.raises(FileError, match="room"):
        train_cae([pack], tmp_path, Budget.parse("1steps"), CaeSettings(length=32, batch=2), say=str)
    assert not list(tmp_path.glob("*.new"))


def test_weights_of_another_kind_are_refused(pack, tmp_path):
    cae_card = weights.find("cae")
    with pytest.raises(RequestError, match="of another kind"):
        base.begin(base.BaseSettings(), ("",), cae_card)
    with pytest.raises(RequestError, match="config=base"):
        base.begin(base.BaseSettings(config="small"), ("",), weights.find("base"))
    (tmp_path / "checkpoint.pt").touch()
    (tmp_path / "settings.json").write_text('{"network": "cae"}')
    with pytest.raises(FileError, match="another recipe"):
        loop.recorded(tmp_path, "network")


def test_a_run_from_shipped_weights_begins_with_them_and_keeps_their_history(pack, tmp_path, monkeypatch):
    monkeypatch.setattr(export, "export_cae_onnx", lambda model, path: path.touch())  # the card counts here
    card = weights.find("cae")
    settings = CaeSettings(length=64, batch=1, learning_rate=1e-9, every_seconds=0.0)
    model = train_cae([pack], tmp_path, Budget.parse("2steps"), settings, start=card)
    held = {one.name.removesuffix(".half"): one for one in onnx.load(card.onnx).graph.initializer}
    for name, value in model.state_dict().items():
        shipped = numpy_helper.to_array(held[name]).astype(np.float32)
        assert np.allclose(value, shipped, atol=1e-6), name
    history = json.loads((tmp_path / "earlier.json").read_text())["training"]
    assert history[-1]["budget"] == card.training["budget"]
    new = export_cae(tmp_path, [pack], tmp_path / "out", ["train"])
    assert new.training["steps"] == card.training["steps"] + 2
    assert new.training["earlier"] == history
    assert new.auto == card.auto, "thresholds stay as measured on performers that were held out then"
    log = [json.loads(line) for line in (tmp_path / "out" / "log.jsonl").read_text().splitlines()]
    assert [entry["step"] for entry in log] == sorted(entry["step"] for entry in log)


def test_a_run_from_shipped_weights_does_not_draw_what_they_were_trained_on_again(
    pack, tmp_path, monkeypatch
):
    """Though its seed is the same."""
    drawn: list[torch.Tensor] = []
    monkeypatch.setattr(cae, "fit_normaliser", lambda *args: None)

    def draw(self, *args):  # type: ignore[no-untyped-def]
        drawn.append(windows_draw(self, *args))
        return drawn[-1]

    windows_draw = Windows.draw
    monkeypatch.setattr(Windows, "draw", draw)
    settings = CaeSettings(length=64, batch=2, learning_rate=1e-9)
    for folder, start in (("new", None), ("on", weights.find("cae"))):
        train_cae([pack], tmp_path / folder, Budget.parse("1steps"), settings, start=start, say=str)
    first, other = drawn[0], drawn[len(drawn) // 2]
    assert first.shape == other.shape
    assert not torch.equal(first, other)


def test_gradients_of_narrow_deconvolutions_do_not_depend_on_what_lies_in_memory():
    """With images of two columns torch's own strided convolution in bfloat16 reads what it should not."""
    torch.manual_seed(0)
    layer = torch.nn.ConvTranspose2d(64, 64, 3, 2, 1, 1)
    x, found = torch.randn(4, 64, 5, 1), []
    for quick in (False, True):
        image = x.clone().requires_grad_()
        if quick:
            quicken(torch.nn.Sequential(layer))
        junk = [torch.full((2**n,), float("nan"), dtype=torch.bfloat16) for n in range(4, 21)]
        del junk
        with torch.autocast("cpu", torch.bfloat16, enabled=quick):
            layer(image).float().square().mean().backward()
        found.append(image.grad)
    assert torch.allclose(found[0], found[1], atol=0.02 * float(found[0].abs().max()))


def test_the_rate_warms_up_and_falls_and_the_average_follows(pack, tmp_path):
    """Half a cosine over the budget; the average of what the weights were, of the last ones most."""
    model = torch.nn.Linear(1, 1, bias=False)
    torch.nn.init.zeros_(model.weight)
    rates, held = [], []

    def loss(rng, fraction):  # type: ignore[no-untyped-def]
        rates.append(trainer.optimizer.param_groups[0]["lr"])
        held.append(float(model.weight.detach()))
        return -model.weight.sum()

    settings = Settings(learning_rate=0.5, warm_up=0.1, average=0.9, every_seconds=1e9)
    optimizer = lambda some: torch.optim.SGD(some, 0.5)  # noqa: E731
    budget = Budget.parse("100steps")
    trainer = Trainer(
        model, loss, lambda averaged: {}, tmp_path, budget, settings, lambda line: None, optimizer=optimizer
    )
    averaged = trainer.run()
    assert rates[0] < 0.01
    assert rates[5] == pytest.approx(0.5 * 0.5 * 0.5 * (1 + np.cos(0.05 * np.pi)))
    assert rates[50] == pytest.approx(0.25)
    assert rates[99] < 0.001
    steps = np.diff([*held, float(model.weight.detach())])
    np.testing.assert_allclose(steps, rates, rtol=1e-3, atol=1e-5)
    mean = 0.0
    for step, value in enumerate([*held[1:], float(model.weight.detach())], 1):
        keep = min(0.9, (1 + step) / (10 + step))
        mean = keep * mean + (1 - keep) * value
    assert float(averaged.weight) == pytest.approx(mean, rel=1e-4)


def test_a_warm_up_that_is_none():
    with pytest.raises(RequestError, match="cannot warm up"):
        Settings(warm_up=0.0)


def test_a_failure_leaves_ctrl_c_as_it_was(pack, tmp_path):
    def loss(rng, fraction):  # type: ignore[no-untyped-def]
        raise ArithmeticError

    before = signal.getsignal(signal.SIGINT)
    model = torch.nn.Linear(1, 1)
    run = Trainer(model, loss, lambda m: {}, tmp_path, Budget.parse("1steps"), Settings(), lambda line: None)
    with pytest.raises(ArithmeticError):
        run.run()
    assert signal.getsignal(signal.SIGINT) is before
