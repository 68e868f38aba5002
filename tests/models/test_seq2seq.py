"""The residual sequence-to-sequence network: what it sees of a pose, and how it goes on."""

from __future__ import annotations

import pytest

torch = pytest.importorskip("torch")

from interpose.geometry import rotations  # noqa: E402
from interpose.models.seq2seq import Seq2Seq, Seq2SeqConfig, from_values, to_values  # noqa: E402
from interpose.skeletons import find_humanoid  # noqa: E402

CONFIG = Seq2SeqConfig(("", "run", "walk"), units=32)


@pytest.fixture(scope="module")
def turned(cmu_walk):  # type: ignore[no-untyped-def]
    """(2, 30, 22, 4) canonical rotations of two pieces of a real walk."""
    body = find_humanoid(cmu_walk)
    return torch.tensor(body.rotations(cmu_walk)[:60].reshape(2, 30, 22, 4), dtype=torch.float32)


@pytest.fixture
def model(turned):  # type: ignore[no-untyped-def]
    torch.manual_seed(0)
    model = Seq2Seq(CONFIG).eval()
    model.standardise(to_values(turned).flatten(0, 1))
    return model


def test_the_paper_s_network():
    """One layer of 1,024 gated recurrent units for 65 values and the actions, and a linear layer back."""
    units, values, actions = 1024, 65, 2
    gates = 3 * (units * (values + actions) + units * units + 2 * units)
    assert sum(p.numel() for p in Seq2Seq(Seq2SeqConfig(CONFIG.labels)).parameters()) == (
        gates + units * values + values
    )


def test_values_are_poses_whichever_way_they_face(turned):
    values = to_values(turned)
    assert rotations.angle(from_values(values, turned), turned).max() < 1e-5
    away = rotations.multiply(rotations.about("Y", torch.tensor(2.0)), turned)
    assert torch.allclose(to_values(away), values, atol=1e-5)
    # What a network says of any values is a pose that faces the same way.
    said = from_values(values + 0.3 * torch.randn_like(values), turned)
    assert rotations.angle(from_values(to_values(said), turned), said).max() < 1e-4
    assert rotations.angle(from_values(values, away), away).max() < 1e-5


def test_a_pose_stays_where_nothing_is_said(model, turned):
    """The residual connection: a network that knows nothing holds the last pose."""
    with torch.no_grad():
        seen = model.normalised(turned)
        held = model.go_on(seen, torch.tensor([1, 2]), 8)
    assert torch.equal(held, seen[:, -1:].expand_as(held))


def test_each_pose_goes_on_from_the_network_s_own_one(model, turned):
    """Frame by frame, as the graph is run, and all at once, as it is trained; the heading is held."""
    torch.nn.init.normal_(model.step.weight, std=0.2)
    label, state = torch.tensor([1, 2]), torch.zeros(2, CONFIG.units)
    with torch.no_grad():
        made = model.go_on(model.normalised(turned), label, 8)
        for frame in range(29):
            _, state = model(turned[:, frame], label, state)
        pose = turned[:, -1]
        for frame in range(8):
            pose, state = model(pose, label, state)
            expected = from_values(made[:, frame] * model.std + model.mean, turned[:, -1])
            assert rotations.angle(pose, expected).max() < 1e-3
    assert rotations.angle(pose, turned[:, -1]).max() > 0.05, "it moves"


def test_actions_matter_and_no_action_is_none_of_them(model, turned):
    torch.nn.init.normal_(model.step.weight, std=0.2)
    with torch.no_grad():
        seen = model.normalised(turned[:1]).expand(3, -1, -1)
        none, run, walk = model.go_on(seen, torch.tensor([0, 1, 2]), 4)
    assert (run - walk).abs().max() > 1e-3
    assert not model.action(torch.tensor([0])).any()
    assert (none - run).abs().max() > 1e-3
