"""Holden's network in Kaufmann's table 1: its size, its way back from pairs of frames, contacts of feet."""

from __future__ import annotations

import math

import pytest

torch = pytest.importorskip("torch")

from interpose.models.cae import to_image  # noqa: E402
from interpose.models.holden import FEET, STILL, Holden, HoldenInfiller, contacts  # noqa: E402
from interpose.skeletons import JOINTS  # noqa: E402


def test_the_paper_s_parameter_count():
    assert sum(p.numel() for p in Holden().parameters()) == 934_729


@pytest.mark.parametrize("training", [False, True])
@pytest.mark.parametrize("frames", [2, 97, 120, 240])
def test_any_length_comes_back(frames, training):
    with torch.no_grad():
        assert Holden().train(training)(torch.randn(2, 1, 73, frames)).shape == (2, 1, 73, frames)


def test_a_value_goes_to_one_of_two_frames_in_training_and_to_both_in_use():
    network = Holden()
    x = torch.arange(1.0, 4001.0).reshape(1, 2, 2000)
    pairs = network.train().unpool(x).unflatten(-1, (-1, 2))
    assert torch.equal(pairs.amax(dim=-1), x)
    assert torch.equal(pairs.amin(dim=-1), torch.zeros_like(x))
    assert 0.45 < float((pairs[..., 0] > 0).float().mean()) < 0.55
    assert torch.equal(network.eval().unpool(x), (x / 2).repeat_interleave(2, dim=-1))


def test_in_use_nothing_is_left_to_chance():
    network, image = Holden().eval(), torch.randn(1, 1, 73, 60)
    with torch.no_grad():
        assert torch.equal(network(image), network(image))


def test_feet_that_walk_stand_in_turns(walk):
    image = to_image(walk, torch.ones(walk.shape[:-1], dtype=torch.bool))
    down, seen = contacts(image)
    feet = walk[0][:, [JOINTS.index(name) for name in FEET]]
    still = (torch.diff(feet, dim=0).norm(dim=-1) < STILL) & (feet[1:, :, 1] - image.floor < 0.1875)
    low = feet[1:, :, 1] - image.floor < torch.tensor(list(FEET.values()))
    assert torch.equal(down[0, :, 1:].T.bool(), still & low)
    left, right = down[0, :2].amax(dim=0), down[0, 2:].amax(dim=0)
    assert all(0.3 < float(side.mean()) < 0.9 for side in (left, right))
    assert float((left + right > 0).double().mean()) > 0.9, "someone who walks always stands on a foot"
    assert not seen[..., 0].any()
    assert seen[..., 1:].all()


def test_a_contact_is_known_where_both_its_frames_are(walk, gap):
    _, seen = contacts(to_image(walk, gap))
    assert torch.equal(
        seen[0, 0].nonzero().flatten(), torch.cat([torch.arange(1, 50), torch.arange(81, 128)])
    )


def test_nothing_leaks_through_contacts(walk, gap):
    torch.manual_seed(0)
    model = HoldenInfiller().eval()
    poisoned = torch.where(gap[..., None], walk, torch.tensor(math.nan, dtype=walk.dtype)).float()
    with torch.no_grad():
        for one, other in zip(model(walk.float(), gap), model(poisoned, gap)):
            assert torch.equal(one, other)
