"""interpose's own network: what it starts from, what stays known, the tasks, the recipe, and the method."""

from __future__ import annotations

import copy
import json
import logging
import shutil
from dataclasses import replace

import numpy as np
import pytest

torch = pytest.importorskip("torch")
onnx = pytest.importorskip("onnx")

from interpose import tasks  # noqa: E402
from interpose.errors import RequestError  # noqa: E402
from interpose.geometry import kinematics, rotations  # noqa: E402
from interpose.geometry.ground import turn  # noqa: E402
from interpose.methods import base as method  # noqa: E402
from interpose.methods import registry, weights  # noqa: E402
from interpose.methods.base import graph as graph_of  # noqa: E402
from interpose.methods.base.observed import COLUMNS, knowledge  # noqa: E402
from interpose.models.base import (  # noqa: E402
    CONFIGS,
    COUNT,
    FEET,
    Answer,
    Around,
    Base,
    BaseConfig,
    Motion,
    complete_columns,
    room,
)
from interpose.observation import Gap, Observation  # noqa: E402
from interpose.skeletons import JOINTS, PARENTS, find_mapping  # noqa: E402
from interpose.training import export, graphs  # noqa: E402
from interpose.training.base import (  # noqa: E402
    JUDGED,
    STANDS,
    TASKS,
    TYPICAL,
    BaseSettings,
    Losses,
    chosen,
    draw_task,
    relief,
    scatter,
    spoil,
    train_base,
    validate,
)
from interpose.training.budget import Budget  # noqa: E402
from interpose.training.export import export_base, narrowest  # noqa: E402
from interpose.training.loop import restore, shard_paths  # noqa: E402
from interpose.training.poses import Poses, labels_of  # noqa: E402

ALL = np.ones(COLUMNS, bool)
TINY = BaseConfig(("", "walk"), width=24, heads=2, layers=1, longest=140)


@pytest.fixture(scope="module")
def drawn(walk_pack):  # type: ignore[no-untyped-def]
    """Two windows of a walk, 40 frames long."""
    pack = walk_pack("lafan1", both=True)
    poses = Poses([pack], ("train",), labels_of([pack], ("train",)), 40, torch.device("cpu"))
    return poses.spread(2, 40)


@pytest.fixture(scope="module")
def given(drawn):  # type: ignore[no-untyped-def]
    """What the network is given of them, in float64: a gap of 20 frames."""
    local = kinematics.local_rotations(drawn.rotation.double(), PARENTS)
    known = torch.ones(2, 40, COUNT + 1, dtype=torch.float64)
    known[:, 10:30] = 0
    placed = drawn.positions().double()
    pins = torch.zeros(2, 40, COUNT, dtype=torch.bool)
    return [local, drawn.root.double(), known, placed, pins, drawn.label, drawn.bones.double()]


@pytest.fixture(scope="module")
def model():  # type: ignore[no-untyped-def]
    """As if it had been trained: it says something."""
    torch.manual_seed(1)
    made = Base(TINY).double().eval()
    with torch.no_grad():
        made.encoder.say.weight.normal_(std=0.05)
    return made


@pytest.fixture(scope="module")
def graph(model, tmp_path_factory):  # type: ignore[no-untyped-def]
    """The model as it is exported: what takes longer than all else here, so that one graph serves all."""
    path = tmp_path_factory.mktemp("graph") / "small.onnx"
    graphs.export_base_onnx(copy.deepcopy(model).float(), path)
    return path


@pytest.fixture
def weights_alone(monkeypatch):  # type: ignore[no-untyped-def]
    """Exports without graphs, for tests of what starts from weights, or of their cards."""

    def write(model, path):  # type: ignore[no-untyped-def]
        path.touch()
        graphs.save_weights(model, path)

    monkeypatch.setattr(export, "export_base_onnx", write)


def unled(local):  # type: ignore[no-untyped-def]
    """Of a motion of which nobody says where it goes and faces."""
    return local[:, 0, 1:] * np.nan, local[:, 0] * np.nan


def test_sizes():
    count = {name: sum(p.numel() for p in Base(config).parameters()) for name, config in CONFIGS.items()}
    assert 2e6 < count["small"] < 4e6
    assert 15e6 < count["base"] < 25e6


def test_a_network_that_has_grown_says_what_the_smaller_one_does(given, model):
    """To the last digits, with twice the units and blocks in between; then its units part."""
    grown = Base(replace(TINY, width=48, heads=4, layers=3)).double().eval()
    grown.grow(model)
    small, large = (net.complete(*given) for net in (model, grown))
    assert torch.allclose(small.motion.root, large.motion.root, atol=1e-6)
    assert rotations.angle(small.motion.local, large.motion.local).max() < 1e-5
    assert torch.allclose(small.risk, large.risk, atol=1e-6)
    large.motion.root.sum().backward()
    slope = grown.encoder.see.weight.grad
    assert not torch.allclose(slope[:24], slope[24:])
    assert grown.encoder.blocks[1].outer.weight.grad.any()
    for other in (replace(TINY, width=36, heads=3), replace(TINY, width=48)):
        with pytest.raises(RequestError, match="width 48 with 4 heads"):
            Base(other).grow(model)
    with pytest.raises(RequestError, match="cannot begin with another one"):
        Base(replace(TINY, width=48, heads=4, longest=TINY.longest + 1)).grow(model)


def test_the_starting_point_goes_on_as_the_motion_does():
    """Of a line it is that line, nearer to a cubic than lines; past the end a velocity dies away."""
    time = torch.arange(30.0, dtype=torch.float64)[None, :, None]
    known = torch.ones(1, 30, dtype=torch.bool)
    known[:, 10:20] = False
    line = 2.0 + 0.3 * time
    slow, soon = (torch.full((1, 1), rate, dtype=torch.float64) for rate in (1e-9, 0.5))
    around = Around.of(known, torch.float64)
    assert torch.allclose(complete_columns(line, known, around, slow), line)
    cubic = 0.001 * (time - 14.5) ** 3
    off = (complete_columns(cubic, known, around, slow) - cubic).abs().max()
    straight = (complete_columns(cubic, known, around, None) - cubic).abs().max()
    assert off < 0.4 * straight
    known[:, 10:] = False
    on = complete_columns(line, known, Around.of(known, torch.float64), soon)[0, 9:, 0].diff()
    assert on[0] > 0
    assert on[-1].abs() < 1e-3


def test_there_is_no_room_at_known_frames_and_all_of_it_far_away():
    known = torch.tensor([[1, 1, 0, 0, 0, 1, 0, 0], [1, 0, 1, 1, 1, 1, 1, 1], [0] * 8, [0.5] * 8])
    gap, short, nothing, noisy = room(known, Around.of(known > 0, torch.float32))
    assert (gap[known[0] == 1] == 0).all()
    assert gap[3] > gap[2] == gap[4] > short[1] > 0
    assert gap[7] > gap[6] > gap[2]
    assert (nothing == 1).all()
    assert (noisy == 0.5).all()


def test_a_new_network_is_its_starting_point_and_lone_keys_have_no_velocity(given):
    new = Base(TINY).double()
    answer = new.complete(*given)
    start = new.start(*given[:3], given[-1])
    assert torch.allclose(answer.motion.root, start.motion.root)
    assert rotations.angle(answer.motion.local, start.motion.local).max() < 1e-6
    lone = given[2].clone()
    lone[:, :9], lone[:, 31:] = 0, 0
    root = new.start(given[0], given[1], lone, given[-1]).motion.root
    share = torch.linspace(0, 1, 22, dtype=torch.float64)[:, None]
    assert torch.allclose(root[0, 9:31], given[1][0, 9] + share * (given[1][0, 30] - given[1][0, 9]))


def test_what_is_known_stays_and_what_is_not_has_no_influence(model, given):
    local, root, known, placed, pins, label, bones = given
    known = known.clone()
    known[:, 5:, 7] = 0  # a toe, and in the gap the place of the hips alone is known
    known[:, 10:30, COUNT] = 1
    answer = model.complete(local, root, known, placed, pins, label, bones).motion
    held = known[..., :COUNT] == 1
    assert torch.equal(answer.local[held], local[held])
    assert torch.equal(answer.root, root)
    spoiled = torch.where(held[..., None], local, torch.randn_like(local))
    again = model.complete(spoiled, root, known, torch.full_like(placed, 1e3), pins, label, bones)
    assert torch.equal(again.motion.local, answer.local)


def test_the_answer_follows_turns_and_moves(model, given):
    local, root, known, placed, pins, label, bones = given
    pins = pins.clone()
    pins[:, 15, 17] = True
    yaw, away = torch.tensor(1.3, dtype=torch.float64), root.new_tensor([4.0, 0.0, -2.0])
    answer = model.complete(local, root, known, placed, pins, label, bones).motion
    moved = local.clone()
    moved[:, :, 0] = rotations.multiply(rotations.about("Y", yaw), local[:, :, 0])
    other = model.complete(
        moved, turn(root, yaw) + away, known, turn(placed, yaw) + away, pins, label, bones
    ).motion
    assert torch.allclose(other.root, turn(answer.root, yaw) + away, atol=1e-7)
    assert rotations.angle(other.local[:, :, 1:], answer.local[:, :, 1:]).max() < 1e-5
    told = model.complete(local, root, known, placed, torch.zeros_like(pins), label, bones).motion
    assert not torch.allclose(told.root, answer.root), "pins are seen"


def test_noisy_values_may_change(model, given):
    known = torch.full_like(given[2], 0.5)
    answer = model.complete(*given[:2], known, *given[3:]).motion
    assert not torch.allclose(answer.root, given[1])


def test_every_task_is_drawn_and_leaves_something_to_go_by():
    rng, settings = np.random.default_rng(0), BaseSettings()
    seen = [draw_task(rng, settings, 64) for _ in range(40)]
    gaps = [int((task.known[:, :, 0] == 0).sum(axis=1).max()) for task in seen]
    assert min(gaps) < 10 < max(gaps)
    for task in seen:
        assert task.known.shape[1] <= settings.longest + 2 * settings.context
        assert (task.known > 0).any(axis=(1, 2)).all()
        assert (task.known < 1).any(axis=(1, 2)).all()
    assert any(task.pins.any() for task in seen)
    assert any(task.noisy.any() for task in seen)
    alone = draw_task(rng, BaseSettings(tasks="gap"), 8).known
    assert (alone == alone[:1]).all()
    usual = [draw_task(rng, BaseSettings(tasks="gap", usual=1), 2).known[0, :, 0] for _ in range(20)]
    assert all(known[:10].all() and not known[10:-1].any() and known[-1] for known in usual)
    assert set(TASKS) == {"all", "parts", "gap"}
    assert TASKS["all"].keys() == TASKS["parts"].keys()
    assert all(sum(odds.values()) == pytest.approx(1) for odds in TASKS.values())


def test_a_width_that_heads_do_not_share(walk_pack):
    with pytest.raises(RequestError, match="cannot be 256 wide") as error:
        BaseSettings(width=256).network(("",))
    assert "width=258" in error.value.fix


def test_packs_by_name(walk_pack):
    packs = [walk_pack("lafan1"), walk_pack("cmu")]
    assert chosen(packs, "cmu") == packs[1:]
    assert chosen(packs, "") == packs
    with pytest.raises(RequestError, match="there is no pack of bandai"):
        chosen(packs, "bandai")


def test_clips_that_are_shorter_than_gaps_may_be(walk_pack, drawn, tmp_path, weights_alone):
    """As a user's own may all be: gaps are drawn that fit into them."""
    pack = walk_pack("lafan1", both=True)
    long_ones = BaseSettings(width=24, layers=1, batch=2, longest=2000, short=-8.0)
    train_base([pack], tmp_path, Budget.parse("2steps"), long_ones, say=lambda line: None)
    assert export_base(tmp_path, [pack], tmp_path / "weights", ["train"]).max_gap == 172, (
        "of 192 that it sees"
    )
    train_base([pack], tmp_path / "pace", Budget.parse("2steps"), replace(long_ones, pace=0.5), say=str)
    poses = Poses([pack], ("train",), ("",), 40, torch.device("cpu"))
    with pytest.raises(RequestError, match="no clip is long enough to learn from 2000 frames"):
        poses.draw(np.random.default_rng(0), 2, 2000)


@pytest.fixture(scope="module")
def trained(walk_pack, tmp_path_factory):  # type: ignore[no-untyped-def]
    """The card of a network that was trained for a moment, and what was said meanwhile."""
    folder, pack = tmp_path_factory.mktemp("run"), walk_pack("lafan1", both=True)
    settings = BaseSettings(width=24, layers=1, batch=4, longest=40, every_seconds=0.0)
    told: list[str] = []
    train_base([pack], folder, Budget.parse("4steps"), settings, say=told.append)
    train_base([pack], folder, Budget.parse("6steps"), settings, say=told.append)
    export_base(folder, [pack], folder / "weights", ["train"])
    return weights.load(folder / "weights", "small"), folder, told


def test_the_mean_with_what_a_run_started_from(trained, walk_pack, tmp_path, weights_alone):
    card, pack = trained[0], walk_pack("lafan1", both=True)
    settings = BaseSettings(width=24, layers=1, batch=4, longest=20, learning_rate=0.1)
    model = train_base([pack], tmp_path, Budget.parse("3steps"), settings, start=card, say=lambda line: None)
    made = export_base(tmp_path, [pack], tmp_path / "weights", ["train"], mean=card)
    before, after = Base(model.config), Base(model.config)
    restore(before, card.onnx)
    restore(after, tmp_path / "weights" / "small.onnx")
    apart = 0.0
    for name, value in after.state_dict().items():
        ends = before.state_dict()[name], model.state_dict()[name]
        apart = max(apart, float((ends[1] - ends[0]).abs().max()))
        assert torch.allclose(value, (ends[0] + ends[1]) / 2, atol=2e-3)
    assert apart > 0.02, "it has learned something"
    assert made.training["mean_with"].startswith("small of commit")
    assert made.max_gap == card.max_gap == 40, "of longer gaps it knows from before"
    log = json.loads((tmp_path / "weights" / "log.jsonl").read_text().splitlines()[-1])
    assert made.metrics["validation"]["gap5"] != log["gap5"], "measured anew"


@pytest.fixture
def tuned(trained, walk_pack, tmp_path_factory, weights_alone):  # type: ignore[no-untyped-def]
    """Makes runs on CMU's data alone that started from some weights: from the folder of one to its card."""
    settings = BaseSettings(datasets="cmu", batch=2, longest=40)
    packs = [walk_pack("cmu", both=True)]

    def make(**start):  # type: ignore[no-untyped-def]
        run = tmp_path_factory.mktemp("run")
        train_base(packs, run, Budget.parse("1steps"), settings, start=replace(trained[0], **start), say=str)
        return run, lambda **more: export_base(run, packs, run / "weights", ["train"], **more)

    return make


def test_a_licence_only_gets_narrower(trained, tuned):
    """What learned from data for research stays for research, whatever it learns from afterwards."""
    run, write = tuned()
    card = write()
    assert card.licence == trained[0].licence
    assert not card.open
    assert (card.name, card.method) == ("small-cmu", "small")
    assert [one["name"] for one in card.data] == ["lafan1", "cmu"]
    # Of runs from before licences were kept their history tells it.
    kept = json.loads((run / "earlier.json").read_text())
    (run / "earlier.json").write_text(json.dumps({name: kept[name] for name in ("training", "auto")}))
    assert not write().open


def test_what_learned_from_cmu_alone_stays_open(tuned, trained):
    cmu = [{"name": "cmu", "licence": "", "clips": 100, "frames": 10**6}]
    free = {
        "licence": "any use: trained on CMU data alone",
        "data": cmu,
        "training": {**trained[0].training, "datasets": "cmu"},
    }
    run, write = tuned(**free)
    card = write()
    assert (card.name, card.licence, card.data) == ("small-open", free["licence"], cmu)
    kept = json.loads((run / "earlier.json").read_text())
    (run / "earlier.json").write_text(json.dumps({name: kept[name] for name in ("training", "auto")}))
    assert write().open, "its history says CMU all along"
    (run / "weights" / "small-open.onnx").unlink()
    mean = write(mean=trained[0])
    assert (mean.name, mean.licence) == ("small-cmu", trained[0].licence)
    assert [one["name"] for one in mean.data] == ["lafan1", "cmu"]


def test_licences_together():
    mine = "and what your own clips allow"
    assert narrowest(["any use: trained on CMU data alone", f"any use; {mine}"]) == (
        f"any use: trained on CMU data alone; {mine}"
    )
    assert narrowest([f"any use; {mine}", "research", f"any use; {mine}"]) == f"research; {mine}"


def test_a_run_goes_on_and_is_exported_whole(trained, given):
    card, folder, told = trained
    assert any("goes on at 67 %" in line for line in told)
    log = [json.loads(line) for line in (folder / "log.jsonl").read_text().splitlines()]
    assert log[-1]["step"] == 6
    assert all(np.isfinite(value) for entry in log for value in entry.values())
    assert card.licence.startswith("research")

    network = {**card.training["network"], "labels": tuple(card.labels)}
    model = Base(BaseConfig(**network))
    model.load_state_dict(torch.load(folder / "averaged.pt", weights_only=True))
    with torch.no_grad():
        for value in model.parameters():
            if value.numel() >= 1024:  # stored in 16 bits
                value.copy_(value.half())
        expected = model(*(v.float() if v.is_floating_point() else v for v in given))
    local, root, known, pinned, pins, _, bones = (v[0].numpy() for v in given)
    actions = (card.labels[int(given[5][0])], "")
    (said,) = graph_of.run(
        card, graph_of.Seen(local, root, known == 1, ALL, actions, bones, pinned, pins, *unled(local))
    )
    assert rotations.angle(said.local, expected[0][0].double().numpy()).max() < 1e-3
    assert np.allclose(said.root, expected[1][0], atol=1e-4)
    assert np.allclose(100 * said.expected, expected[3][0], rtol=1e-3)


def test_exports_name_no_packages_that_are_not_needed(tmp_path, caplog):
    """PyTorch's exporter looks for torchvision, and says so to whoever trains on their own clips."""
    size = {0: torch.export.Dim("frames", min=2, max=9)}
    with caplog.at_level(logging.NOTSET, logger="torch.onnx"):
        graphs._write_graph(
            torch.nn.Linear(2, 2), {"x": (torch.ones(3, 2), size)}, ["y"], tmp_path / "a.onnx"
        )
        assert not [one for one in caplog.records if one.name.startswith("torch.onnx")]


def test_weights_beside_the_graph(model, graph, given, tmp_path, monkeypatch):
    """In 16 bits and in files that are not too large; training goes on from them, or else from the graph.

    A graph whose weights take several files reads them, instead of holding them once more.
    """
    one, said, sizes = copy.deepcopy(model).float(), [], []
    for size, files in ((graphs.SHARD, 1), (20_000, 3)):
        path = tmp_path / str(files) / "small.onnx"
        path.parent.mkdir()
        monkeypatch.setattr(graphs, "SHARD", size)
        for part in (graph, *shard_paths(graph)):
            shutil.copy(part, path.parent)
        if files > 1:
            graphs.save_weights(one, path)
        shards = shard_paths(path)
        assert len(shards) == files
        assert all(shard.stat().st_size < size + 10_000 for shard in shards)
        sizes.append(path.stat().st_size)
        local, root, known, pinned, pins, _, bones = (v[0].numpy() for v in given)
        said += graph_of.run(
            of(path),
            graph_of.Seen(local, root, known == 1, ALL, ("", ""), bones, pinned, pins, *unled(local)),
        )
        for exact in (False, True) if files == 1 else (False,):
            again = Base(TINY)
            restore(again, path)
            for mine, theirs in zip(again.state_dict().values(), one.state_dict().values()):
                # The graph has small values whole.
                whole = exact and theirs.numel() < 1024
                assert torch.equal(mine, theirs if whole else theirs.half().float())
            if files == 1:
                shards[0].unlink(missing_ok=True)
    assert np.array_equal(said[0].local, said[1].local)
    assert sizes[1] < sizes[0] - 40_000


def test_a_graph_is_written_anew_from_the_weights_beside_it(trained, tmp_path):
    folder = tmp_path / "small"
    shutil.copytree(trained[0].path.parent, folder)
    card = weights.load(folder, "small")
    before, kept = onnx.load(card.onnx), [one.read_bytes() for one in shard_paths(card.onnx)]
    card.onnx.write_bytes(b"damaged")
    export.rewrite(card)
    after = onnx.load(card.onnx)
    assert after.graph.node == before.graph.node
    for one, other in zip(after.graph.initializer, before.graph.initializer):
        # The graph of the run itself has small ones whole.
        values = onnx.numpy_helper.to_array(one), onnx.numpy_helper.to_array(other)
        np.testing.assert_allclose(*values, rtol=1e-3, atol=1e-6)
    assert [one.read_bytes() for one in shard_paths(card.onnx)] == kept
    with pytest.raises(RequestError, match="of another kind"):
        export.rewrite(weights.find("cae"))


def test_it_completes_clips(trained, cmu_walk, monkeypatch):
    """Gaps, joints of the whole clip, and forecasts that are longer than it can see."""
    small = method.Base("small", trained=trained[0])
    monkeypatch.setattr(registry, "get", lambda name: small)
    done = tasks.fill(cmu_walk, [Gap(60, 80)], "small")
    assert done.report.gaps[0].model == "small"
    left = np.r_[0:60, 80 : len(cmu_walk)]
    assert np.array_equal(done.clip.rotation[left], cmu_walk.rotation[left])
    lost = tasks.recover(cmu_walk, ["LeftArm", "LeftForeArm"], method="small")
    others = [j for j, name in enumerate(cmu_walk.skeleton.names) if name not in ("LeftArm", "LeftForeArm")]
    assert np.array_equal(lost.clip.rotation[:, others], cmu_walk.rotation[:, others])
    assert len(tasks.forecast(cmu_walk, 150, method="small").clip) == len(cmu_walk) + 150
    assert tasks.fill(cmu_walk, [Gap(50, 100)], "small").report.gaps[0].model == "small"
    assert small.for_action("walk").action == "walk"
    with pytest.raises(RequestError, match="unknown action"):
        small.for_action("fly")


def of(path):  # type: ignore[no-untyped-def]
    """The card of a graph."""
    labels, joints = ["", "walk"], list(JOINTS)
    card = weights.Card(path.stem, "small", "", "", [], [], joints, 30.0, 120, labels=labels)
    return replace(card, path=path.with_suffix(".json"))


def test_weights_that_are_asked_beside_others_count_to_their_share(graph, given, tmp_path, monkeypatch):
    """And an action that they do not know is none to them; what is known stays exactly."""
    monkeypatch.setattr(graph_of, "CALMER", 0.0)  # what is drawn at random snaps, all of it
    cards = []
    for seed in (1, 2):
        other = onnx.load(graph)
        (labels,) = (one for one in other.graph.initializer if one.name == "encoder.label.weight")
        drawn = np.random.default_rng(seed).normal(size=labels.dims).astype(np.float32)
        labels.CopyFrom(onnx.numpy_helper.from_array(drawn, labels.name))
        onnx.save(other, tmp_path / f"{seed}.onnx")
        cards.append(of(tmp_path / f"{seed}.onnx"))
    one, two = cards[0], replace(cards[1], labels=["", "run"])
    local, root, known, pinned, pins, _, bones = (v[0].numpy() for v in given)
    seen = graph_of.Seen(local, root, known == 1, ALL, ("walk", "walk"), bones, pinned, pins, *unled(local))
    hole = slice(10, 30)
    both, first = (graph_of.agreed(graph_of.ask(cards, seen, hole), hole) for cards in ([one, two], [one]))
    second = graph_of.agreed(graph_of.ask([two], replace(seen, actions=("", "")), hole), hole)
    assert np.abs(first.root - second.root).max() > 1e-3
    share = graph_of.BESIDE
    assert np.allclose(both.root, (1 - share) * first.root + share * second.root)
    assert np.allclose(both.expected, (1 - share) * first.expected + share * second.expected)
    apart = rotations.angle(first.local, second.local)
    # A mean of quaternions is none of angles, but by little.
    assert np.allclose(rotations.angle(both.local, first.local), share * apart, atol=0.02 * apart.max())
    assert np.allclose(
        rotations.angle(both.local, second.local), (1 - share) * apart, atol=0.02 * apart.max()
    )


def test_the_mirror_image_is_completed_as_the_mirror_image(graph, given):
    """Also where the two disagree; what is known of half a pose stays exactly."""
    local, root, known, pinned, pins, _, bones = (v[0].numpy() for v in given)
    known = known == 1
    known[12:20, 5:9] = True
    pins = pins.copy()
    pins[15, 17] = True
    seen, card = (
        graph_of.Seen(local, root, known, ALL, ("walk", ""), bones, pinned, pins, *unled(local)),
        of(graph),
    )
    once, image = graph_of.run(card, seen)[0], graph_of.run(card, seen.mirrored())[0]
    assert np.abs(once.root - image.root * [-1, 1, 1]).max() > 1e-3  # by itself it is not
    for limit in (np.pi, 0.0):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(graph_of, "AGREE", limit)
            said, other = (
                graph_of.mean(*graph_of.run_both(card, one), slice(0, 40)) for one in (seen, seen.mirrored())
            )
        back = seen.mirrored()
        back.local, back.root = other.local, other.root
        back = back.mirrored()
        assert np.abs(said.root - back.root).max() < 1e-5
        assert rotations.angle(said.local, back.local).max() < 1e-3
        assert np.allclose(said.stands, other.stands[:, [2, 3, 0, 1]], atol=1e-5)
        kept = rotations.angle(said.local, seen.local)[known[:, :-1]]
        assert kept.max() < 1e-3


def test_knowledge_of_canonical_rotations(cmu_walk):
    mapping = find_mapping(cmu_walk.skeleton)
    seen = Observation.from_gaps(cmu_walk, [Gap(5, 9, ("LeftForeArm",)), Gap(20, 22)])
    known = knowledge(seen, mapping)
    row = mapping.joints.index(cmu_walk.skeleton.index("LeftForeArm"))
    assert not known[5:9, row].any()
    assert known[5:9, np.arange(COUNT + 1) != row].all()
    assert not known[20:22][:, [*mapping.mapped[0], COUNT]].any()
    assert known[22:].all()


def test_losses_are_of_what_is_wrong(drawn):
    """Nothing for the truth; each grows with what it is about; the risk is least at the error itself."""
    local = kinematics.local_rotations(drawn.rotation, PARENTS)
    known = torch.ones(2, 40, COUNT + 1)
    known[:, 10:30] = 0
    placed, losses = drawn.positions(), Losses(BaseSettings())

    def parts(shift=0.0, turned=0.0, risk=0.0, contact=0.0):  # type: ignore[no-untyped-def]
        angle = torch.full((2, 40, COUNT, 1), turned) * torch.tensor([0.0, 0.0, 1.0])
        time = torch.arange(40.0)[:, None] * torch.tensor([1.0, 0.0, 0.0])
        motion = Motion(rotations.multiply(local, rotations.exp(angle)), drawn.root + shift * time)
        stands = (placed[:, :, list(FEET)].diff(dim=1).norm(dim=-1) < STANDS).float()
        said = torch.nn.functional.pad(contact * (2 * stands - 1), (0, 0, 1, 0))
        answer = Answer(motion, said, torch.full((2, 40), risk))
        found = losses.parts(answer, drawn.rotation, placed, known, drawn.bones, torch.eye(3).expand(2, 3, 3))
        return {name: float(value) for name, value in found.items()}

    true = parts()
    assert max(true[name] for name in ("position", "rotation", "velocity")) < 1e-5
    for name in ("position", "velocity", "slide"):
        assert parts(shift=0.02)[name] > parts(shift=0.01)[name] > true[name] + 1e-4, name
    assert parts(turned=0.2)["rotation"] > parts(turned=0.1)["rotation"] > 0.01
    assert parts(contact=5.0)["contact"] < true["contact"] < parts(contact=-5.0)["contact"]
    off = (parts(shift=0.001)["position"]) / 1.5  # of joints, and half as much of the hips
    best = float(np.log(100 * off))
    least = parts(shift=0.001, risk=best)["risk"]
    assert least < parts(shift=0.001, risk=best - 1)["risk"]
    assert least < parts(shift=0.001, risk=best + 1)["risk"]


def test_clips_that_are_too_short_to_learn_from_are_counted(walk_pack):
    pack = replace(walk_pack("cmu"), starts=np.array([0, 180, 209]), splits=np.array(["train", "train"]))
    told = [Poses([pack], ("train",), ("",), longest, torch.device("cpu")).told for longest in (29, 30)]
    assert told == ["209 frames of train", "180 frames of train (1 clip of less than 30 frames left out)"]


def test_motions_are_shown_faster_and_slower(walk_pack):
    """The same poses on the same way, at another pace: who walks gets as much further, or less far."""
    poses = Poses([walk_pack("cmu")], ("train",), ("",), 30, torch.device("cpu"))

    def paces(pace: float) -> np.ndarray:
        found = []
        for seed in range(12):
            drawn = poses.draw(np.random.default_rng(seed), 64, 40, False, pace)
            assert drawn.rotation.shape == (64, 40, COUNT, 4)
            assert torch.allclose(drawn.rotation.norm(dim=-1), torch.ones(()), atol=1e-5)
            found.append(float((drawn.root[:, -1] - drawn.root[:, 0]).norm(dim=-1).mean()))
        return np.array(found)

    same, other = paces(0.0), paces(0.3)
    assert np.ptp(same) < 0.15 * same.mean()
    assert same.mean() / 1.35 < other.min() < 0.9 * same.mean()
    assert 1.1 * same.mean() < other.max() < 1.35 * same.mean()


def test_joints_of_a_pose_count_each_by_itself_or_together(drawn):
    """One that is far off counts more than all that are off a little, where they count together."""
    known = torch.ones(2, 40, COUNT + 1)
    known[:, 10:30] = 0
    placed = drawn.positions()
    answer = Answer(
        Motion(kinematics.local_rotations(drawn.rotation, PARENTS), drawn.root),
        torch.zeros(2, 40, len(FEET)),
        torch.zeros(2, 40),
    )
    one, all_alike = placed.clone(), placed.clone()
    one[:, :, 5, 0] += 0.22
    all_alike[..., 0] += 0.01
    all_alike[:, :, 0] = placed[:, :, 0]  # the hips count apart
    off = {}
    for together in (0, 1):
        losses = Losses(BaseSettings(together=together))
        for name, truth in (("one", one), ("all", all_alike)):
            said = losses.parts(
                answer, drawn.rotation, truth, known, drawn.bones, torch.eye(3).expand(2, 3, 3)
            )
            off[name, together] = float(said["position"])
    assert off["one", 0] == pytest.approx(0.01, abs=1e-4)
    assert off["all", 0] == pytest.approx(off["all", 1], rel=0.05)
    assert off["one", 1] == pytest.approx(0.22 / np.sqrt(COUNT), abs=1e-3)


def test_joints_count_along_the_axes_of_the_body_as_they_are_scattered(drawn, walk_pack):
    """Who walks is further from the middle of the way along it than across it; and so wherever it leads."""
    counts = scatter(Poses([walk_pack("cmu")], ("train",), ("",), 30, torch.device("cpu")))
    assert counts.shape == (COUNT, 3)
    assert counts.square().mean().item() == pytest.approx(1)
    assert (counts[:, 0] > 2 * counts[:, 2]).all()
    known = torch.ones(2, 40, COUNT + 1)
    known[:, 10:30] = 0
    placed, losses = drawn.positions(), Losses(BaseSettings(), counts)
    motion = Motion(kinematics.local_rotations(drawn.rotation, PARENTS), drawn.root)
    answer = Answer(motion, torch.zeros(2, 40, len(FEET)), torch.zeros(2, 40))

    def off(way: list[float], away: torch.Tensor) -> float:
        """How wrong it is where the truth lies a centimetre along the axes of the body, but for the hips."""
        truth = placed + 0.01 * torch.tensor(way) @ away.T
        truth[:, :, 0] = placed[:, :, 0]
        found = losses.parts(answer, drawn.rotation, truth, known, drawn.bones, away.expand(2, 3, 3))
        return float(found["position"])

    for yaw in (0.0, 1.0):
        away = rotations.to_matrix(rotations.about("Y", torch.tensor(yaw)))
        for axis, way in enumerate(np.eye(3).tolist()):
            wanted = 0.01 * float(counts[1:, axis].sum()) / COUNT
            assert off(way, away) == pytest.approx(wanted, rel=1e-2), (yaw, axis)


def test_a_batch_is_as_hard_as_its_starting_point_is_wrong(drawn):
    placed, known = drawn.positions(), torch.ones(2, 40, COUNT + 1)
    known[:, 10:30] = 0
    begun = placed.clone()
    begun[:, 10:30, :, 1] += 2 * TYPICAL
    begun[:, :10] += 9.0  # what is known does not count
    assert relief(begun, placed, known).item() == pytest.approx(2, abs=0.02)
    assert 0 < relief(placed, placed, known).item() < 0.02


def test_noise_is_in_what_is_noisy_alone(drawn):
    given = Motion(kinematics.local_rotations(drawn.rotation, PARENTS), drawn.root)
    noisy = spoil(given, torch.tensor([True, False]), 0.06, 3)
    moved, turned = (noisy.root - given.root).abs(), rotations.angle(noisy.local, given.local)
    assert moved[0].mean() > 1e-5
    assert turned[0].mean() > 10 * turned[1].max()
    assert moved[1].max() == 0


def test_straight_lines_are_as_good_as_straight_lines(walk_pack):
    """What validation compares with: a network that says nothing, and starts from lines."""
    pack = walk_pack("lafan1", both=True)
    poses = Poses([pack], ("train",), labels_of([pack], ("train",)), 60, torch.device("cpu"))
    batch = poses.spread(2, JUDGED)
    plain = Base(BaseConfig(("", "walk"), width=24, heads=2, layers=1, velocities=False))
    figures = validate(plain.eval(), batch)
    for gap in (5, 15, 30, 45):
        assert figures[f"ratio{gap}"] == pytest.approx(1, abs=1e-4)
        assert figures[f"turn_ratio{gap}"] == pytest.approx(1, abs=1e-3)
    with torch.no_grad():
        plain.encoder.say.bias[6 * COUNT] = 0.1  # its hips are 10 cm aside
    assert validate(plain, batch)["ratio15"] > 1.05


def test_a_run_that_starts_from_weights_is_wired_like_them(walk_pack, tmp_path, weights_alone):
    pack = walk_pack("lafan1", both=True)
    wired = BaseSettings(width=24, layers=1, batch=2, longest=40, near=0, velocities=0, every_seconds=1e9)
    train_base([pack], tmp_path / "first", Budget.parse("1steps"), wired)
    export_base(tmp_path / "first", [pack], tmp_path / "weights", ["train"])
    card = weights.load(tmp_path / "weights", "small")
    plain = BaseSettings(batch=2, longest=40, every_seconds=1e9)
    with pytest.raises(RequestError, match="cannot begin with small and velocities=1"):
        train_base([pack], tmp_path / "second", Budget.parse("1steps"), plain, start=card)
    plain = replace(plain, near=0, velocities=0)
    train_base([pack], tmp_path / "second", Budget.parse("1steps"), plain, start=card)
    network = json.loads((tmp_path / "second" / "settings.json").read_text())["network"]
    assert (network["width"], network["layers"], network["near"], network["velocities"]) == (
        24,
        1,
        False,
        False,
    )


def test_a_run_on_more_data_learns_their_labels_too(walk_pack, tmp_path, weights_alone):
    tiny = BaseSettings(width=24, layers=1, batch=2, longest=40, labelled=1, every_seconds=1e9)
    packs = [walk_pack("lafan1", both=True)]
    train_base(packs, tmp_path / "first", Budget.parse("3steps"), tiny)
    export_base(tmp_path / "first", packs, tmp_path / "weights", ["train"])
    card = weights.load(tmp_path / "weights", "small")
    packs.append(replace(walk_pack("bandai", both=True), labels=np.array(["bow", "bow"])))
    model = train_base(packs, tmp_path / "second", Budget.parse("3steps"), tiny, start=card)
    assert model.config.labels == ("", "walk", "bow")
    assert model.encoder.label.weight[2].any()


def test_a_run_for_a_wider_network_begins_with_the_one_it_starts_from(walk_pack, tmp_path, weights_alone):
    pack = walk_pack("lafan1", both=True)
    first = BaseSettings(width=24, layers=1, batch=2, longest=40, near=0, every_seconds=1e9)
    train_base([pack], tmp_path / "first", Budget.parse("1steps"), first)
    export_base(tmp_path / "first", [pack], tmp_path / "weights", ["train"])
    card = weights.load(tmp_path / "weights", "small")
    wider = replace(first, width=48, heads=12, layers=2, learning_rate=1e-9)
    train_base([pack], tmp_path / "second", Budget.parse("1steps"), wider, start=card)
    settings = json.loads((tmp_path / "second" / "settings.json").read_text())
    assert [settings["network"][name] for name in ("width", "heads", "layers", "near")] == [48, 12, 2, False]
    before, after = (
        json.loads((tmp_path / name / "log.jsonl").read_text().splitlines()[-1])["gap15"]
        for name in ("first", "second")
    )
    assert after == pytest.approx(before, rel=1e-3)
