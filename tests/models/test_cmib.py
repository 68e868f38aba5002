"""CMIB: the paper's network, keys in and a whole motion out, losses, anchors, random paths, training."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from interpose.datasets import Pack  # noqa: E402
from interpose.datasets.pack import STEP  # noqa: E402
from interpose.geometry import rotations  # noqa: E402
from interpose.geometry.ground import turn  # noqa: E402
from interpose.models.cmib import Cmib, CmibConfig, between_keys, restore_bones  # noqa: E402
from interpose.skeletons import PARENTS, find_humanoid  # noqa: E402
from interpose.training.budget import Budget  # noqa: E402
from interpose.training.cmib import CmibSettings, Losses, draw_keys, train_cmib  # noqa: E402
from interpose.training.graphs import export_cmib_onnx  # noqa: E402
from interpose.training.loop import restore  # noqa: E402
from interpose.training.poses import Batch, Poses, labels_of, new_path, random_path  # noqa: E402


@pytest.fixture(scope="module")
def pack(cmu_walk):  # type: ignore[no-untyped-def]
    """A walk to train on and the same one to validate with."""
    body = find_humanoid(cmu_walk)
    turned = np.rint(rotations.log(body.rotations(cmu_walk)) / STEP).astype(np.int16)
    root = (body.root(cmu_walk) * body.scale).astype(np.float32)
    count = len(cmu_walk)
    return Pack(
        "lafan1",
        np.concatenate([turned, turned]),
        np.concatenate([root, root]),
        np.tile(body.bones * body.scale, (2, 1, 1)).astype(np.float32),
        np.tile(body.body, (2, 1, 1)).astype(np.float32),
        np.array([0, count, 2 * count]),
        np.array(["a", "b"]),
        np.array(["subject1", "subject4"]),
        np.array(["walk", "walk"]),
        np.array(["train", "validation"]),
    )


@pytest.fixture(scope="module")
def batch(pack):  # type: ignore[no-untyped-def]
    poses = Poses([pack], ["train"], ("", "walk"), 60, torch.device("cpu"))
    return poses.at(np.array([0, 0]), np.array([10, 80]), 60)


@pytest.fixture(scope="module")
def model():  # type: ignore[no-untyped-def]
    torch.manual_seed(0)
    return Cmib(CmibConfig(("", "walk"))).eval()


def keys_at(batch, *frames):  # type: ignore[no-untyped-def]
    keys = torch.zeros(batch.rotation.shape[:2], dtype=torch.bool)
    keys[:, list(frames)] = True
    return keys


def run(model, batch, keys):  # type: ignore[no-untyped-def]
    with torch.no_grad():
        return model(batch.positions(), batch.rotation, keys, batch.label, batch.bones.norm(dim=-1))[:2]


def test_the_paper_s_network():
    """154 numbers a frame, 7 heads, 8 layers, 2,048 inside: 726,598 parameters a layer."""
    model = Cmib(CmibConfig(("", "walk"), residual=False))
    assert model.config.width == 154
    layer = 4 * (154 * 154 + 154) + 2 * 154 * 2048 + 2048 + 154 + 4 * 154
    total = 8 * layer + 154 * 154 + 154 + 160 * 154 + 2 * 154
    assert sum(p.numel() for p in model.parameters()) == total


def test_windows_of_poses_are_real_motion(batch, cmu_walk):
    body = find_humanoid(cmu_walk)
    truth = body.positions(cmu_walk)[10:70] * body.scale
    placed = batch.positions()[0].numpy()
    assert np.linalg.norm(placed - truth, axis=-1).mean() < 2e-3
    assert ((batch.rotation[:, 1:] * batch.rotation[:, :-1]).sum(-1) > 0).all(), "continuous in time"


def test_interpolation_between_keys_and_anchors(batch):
    """Equations 2 and 3 by their definition, in both pieces."""
    keys = keys_at(batch, 0, 20, 59)
    positions = batch.positions()
    filled = between_keys(positions, keys)
    for start, stop in ((0, 20), (20, 59)):
        for t in (start, start + 7, stop):
            share = (t - start) / (stop - start)
            line = (1 - share) * positions[:, start] + share * positions[:, stop]
            assert torch.allclose(filled[:, t], line, atol=1e-5)
    turned = between_keys(batch.rotation, keys)
    middle = rotations.slerp(batch.rotation[:, 20], batch.rotation[:, 59], torch.tensor(10 / 39))
    assert rotations.angle(turned[:, 30], middle).max() < 1e-3


def test_bones_are_restored(batch):
    wrong = batch.positions() * 1.3 + 0.02 * torch.randn(2, 60, 22, 3)
    lengths = batch.bones.norm(dim=-1)
    fixed = restore_bones(wrong, lengths)
    above = [max(p, 0) for p in PARENTS]
    found = (fixed - fixed[..., above, :]).norm(dim=-1)[..., 1:]
    assert torch.allclose(found, lengths[:, None, 1:].expand_as(found), atol=1e-5)
    assert torch.equal(fixed[..., 0, :], wrong[..., 0, :])


@pytest.mark.parametrize("poison", [1e6, -3.0])
def test_only_keys_have_influence(model, batch, poison):
    keys = keys_at(batch, 0, 30, 59)
    dirty = Batch(batch.rotation.clone(), batch.root.clone(), batch.bones, batch.label)
    dirty.rotation[:, 5:25] = torch.tensor([0.1, 0.7, -0.7, 0.1])
    dirty.root[:, 5:25] = poison
    for a, b in zip(run(model, batch, keys), run(model, dirty, keys)):
        assert torch.equal(a, b)


def test_the_output_turns_and_moves_with_the_input(model, batch):
    keys, yaw = keys_at(batch, 0, 59), torch.tensor(1.2)
    way = torch.tensor([3.0, 0.0, -2.0])
    moved = Batch(
        rotations.multiply(rotations.about("Y", yaw), batch.rotation),
        turn(batch.root, yaw) + way,
        batch.bones,
        batch.label,
    )
    placed, turned = run(model, batch, keys)
    other, other_turned = run(model, moved, keys)
    assert torch.allclose(other, turn(placed, yaw) + way, atol=2e-3)
    assert rotations.angle(other_turned, rotations.multiply(rotations.about("Y", yaw), turned)).max() < 5e-3


def test_losses_vanish_for_the_truth(model, batch, monkeypatch):
    losses = Losses(model, CmibSettings())
    keys = keys_at(batch, 0, 59)
    whole = torch.ones_like(keys)
    assert min(float(part.detach()) for part in losses.parts(batch, keys)[1:]) > 0.01

    def perfect(frames, keys, label):  # type: ignore[no-untyped-def]
        return model.encoder.label(label), torch.cat([truth[..., :66], turned.flatten(2)], dim=2)

    frames, truth = (model.prepare(batch.positions(), batch.rotation, some)[0] for some in (keys, whole))
    # Of the two quaternions of a rotation the one on interpolation's side.
    turned = rotations.alike(*(some[..., 66:].unflatten(2, (22, 4)) for some in (truth, frames)))
    monkeypatch.setattr(model.encoder, "forward", perfect)
    assert max(float(part.detach()) for part in losses.parts(batch, keys)) < 1e-3


def test_losses_are_of_one_size_at_the_start(model, batch):
    """The paper's section 4.4, with its weights and positions in centimetres."""
    settings, keys = CmibSettings(), keys_at(batch, 0, 59)
    parts = Losses(model, settings).parts(batch, keys)[:3]
    semantic, position, rotation = (float(part.detach()) for part in parts)
    sizes = [settings.semantic * semantic, settings.position * position, settings.rotation * rotation]
    assert max(sizes) < 20 * min(sizes)


@pytest.mark.parametrize(
    "config",
    [
        CmibConfig(("", "walk")),
        CmibConfig(("", "walk"), residual=False),
        CmibConfig(("", "walk"), heads=6, representation="axis-angle"),
        CmibConfig(("", "walk"), heads=6, representation="euler"),
    ],
)
def test_keys_are_met_exactly_by_the_residual_and_the_paper_s_own_networks(batch, config):
    torch.manual_seed(1)
    model = Cmib(config).eval()
    torch.nn.init.normal_(model.encoder.last.weight, std=0.05)
    keys = keys_at(batch, 0, 20, 59)
    placed, turned = run(model, batch, keys)
    assert (placed - batch.positions())[keys].norm(dim=-1).max() < 1e-4
    assert rotations.angle(turned, batch.rotation)[keys].max() < 2e-3
    assert (placed - batch.positions())[~keys].norm(dim=-1).max() > 0.01


def test_an_untrained_residual_interpolates(model, batch):
    keys = keys_at(batch, 0, 59)
    hips = run(model, batch, keys)[0][:, :, 0]
    assert torch.allclose(hips, between_keys(batch.root[:, :, None], keys)[:, :, 0], atol=1e-4)


def test_keys_are_ends_and_shuffled_anchors():
    rng, settings = np.random.default_rng(0), CmibSettings()
    counts = []
    for _ in range(300):
        keys = draw_keys(rng, settings, 4, 40)
        assert keys[:, [0, -1]].all()
        assert (keys == keys[0]).all(), "one mini-batch, the same anchors"
        counts.append(int(keys[0].sum()) - 2)
    assert set(counts) == {0, 1, 2, 3}
    assert 0.4 < np.mean(np.array(counts) > 0) < 0.6


def test_random_paths_are_smooth_and_meet_both_ends():
    rng = np.random.default_rng(0)
    x = np.linspace(0, 4, 120)
    y = 0.1 * np.sin(x)
    paths = np.array([random_path(rng, x, y) for _ in range(40)])
    assert np.allclose(paths[:, 0], y[0], atol=1e-9)
    assert np.allclose(paths[:, -1], y[-1], atol=1e-9)
    assert paths[:, 60].std() > 0.3, "they differ in the middle"
    bend = np.abs(np.diff(paths, 2, axis=1)).max() / (x[1] - x[0]) ** 2
    assert bend < 20, "no jitter: the kernel's own curvature"
    assert random_path(rng, x[::-1], y) is None, "x must grow"


def test_a_new_path_keeps_ends_height_and_pose(batch):
    fresh = new_path(np.random.default_rng(3), batch, np.array([True, False]))
    assert torch.equal(fresh.root[1], batch.root[1])
    if torch.equal(fresh.root[0], batch.root[0]):
        pytest.fail("the walk of the fixture must be monotonic")
    assert torch.allclose(fresh.root[0, [0, -1]], batch.root[0, [0, -1]], atol=1e-5)
    assert torch.equal(fresh.root[0, :, 1], batch.root[0, :, 1])
    local = [
        rotations.multiply(rotations.conjugate(b.rotation[0, :, :1]), b.rotation[0]) for b in (batch, fresh)
    ]
    assert rotations.angle(*local).max() < 2e-3, "turned as a whole"
    step, old = (np.diff(b.root[0].numpy(), axis=0) for b in (fresh, batch))
    way, before = (np.arctan2(s[20:40, 0], s[20:40, 2]) for s in (step, old))
    facing = rotations.multiply(fresh.rotation[0, 20:40, 0], rotations.conjugate(batch.rotation[0, 20:40, 0]))
    turned = 2 * np.arctan2(*facing.numpy()[:, [2, 0]].T)
    assert np.abs(np.angle(np.exp(1j * (way - before - turned)))).mean() < 0.1


def test_labels_of_the_training_clips_only(pack):
    assert labels_of([pack], ["train"]) == ("", "walk")


def test_training_learns_writes_figures_and_goes_on(pack, tmp_path):
    settings = CmibSettings(batch=4, shortest=10, longest=122, every_seconds=0.0)
    lines: list[str] = []
    train_cmib([pack], tmp_path, Budget.parse("3steps"), settings, say=lines.append)
    train_cmib([pack], tmp_path, Budget.parse("5steps"), settings, say=lines.append)
    log = [json.loads(line) for line in (tmp_path / "log.jsonl").read_text().splitlines()]
    assert log[-1]["step"] == 5
    assert {"gap30", "ratio60", "degrees120", "labels_apart"} <= log[-1].keys()
    assert any("goes on at 60 %" in line for line in lines)
    config = json.loads((tmp_path / "settings.json").read_text())["config"]
    assert config["labels"] == ["", "walk"]


def test_the_graph_agrees_with_torch_at_other_sizes_and_training_goes_on_from_it(batch, tmp_path):
    """Exported at 40 frames and two clips, run at 33 frames and one; weights come back within 16 bits.

    What the graph says, in 8 bits, is off by less than a twentieth of what the network adds.
    """
    import onnxruntime

    torch.manual_seed(2)
    config = CmibConfig(("", "walk"), layers=2, inner=64)
    model = Cmib(config).eval()
    torch.nn.init.normal_(model.encoder.last.weight, std=0.05)
    torch.nn.init.normal_(model.encoder.apart)
    path = tmp_path / "cmib.onnx"
    export_cmib_onnx(model, path)
    again = Cmib(config).eval()
    restore(again, path)
    for name, value in model.state_dict().items():
        assert torch.allclose(again.state_dict()[name], value, rtol=1e-3, atol=1e-3), name
    torch.manual_seed(3)
    grown = Cmib(replace(config, labels=("", "walk", "run")))
    began = grown.encoder.label.weight[2].clone()
    restore(grown, path)
    assert torch.equal(grown.encoder.label.weight[:2], again.encoder.label.weight)
    assert torch.equal(grown.encoder.label.weight[2], began), "of a label that is new"
    short = Batch(batch.rotation[:1, :33], batch.root[:1, :33], batch.bones[:1], batch.label[:1])
    keys = keys_at(short, 0, 11, 32)
    feed = {
        "positions": short.positions().numpy(),
        "rotation": short.rotation.numpy(),
        "keys": keys.numpy(),
        "label": short.label.numpy(),
        "bones": short.bones.norm(dim=-1).numpy(),
    }
    placed, turned, missed = onnxruntime.InferenceSession(str(path)).run(None, feed)
    expected, expected_turned = run(again, short, keys)
    assert (missed[0, [0, 11, 32]] > 0).all()
    assert (missed > 0).sum() == 3, "at keys only"
    torch.nn.init.zeros_(again.encoder.last.weight)
    nothing, nothing_turned = run(again, short, keys)
    assert np.abs(placed - expected.numpy()).max() < 0.05 * (expected - nothing).abs().max()
    off = rotations.angle(torch.from_numpy(turned), expected_turned)
    assert off.max() < 0.05 * rotations.angle(expected_turned, nothing_turned).max()
