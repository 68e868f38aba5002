"""STMI-GAN: the alignment, what is hidden, noise, what the branches see, and the graph that ships."""

from __future__ import annotations

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from interpose.geometry.ground import turn  # noqa: E402
from interpose.models.stmi_gan import (  # noqa: E402
    DENSE,
    PAPER,
    Discriminator,
    Frame,
    Generator,
    StmiGanConfig,
    curve,
    distances,
    drawable,
    settle,
)

SMALL = StmiGanConfig(frames=20, width=40, gates=1, blocks=2, channels=(4, 6))


@pytest.fixture(scope="module")
def generator():  # type: ignore[no-untyped-def]
    torch.manual_seed(0)
    model = Generator(SMALL).double().eval()
    # As if it had been trained: noise is injected, and blocks say something.
    with torch.no_grad():
        for name, value in model.named_parameters():
            if name.endswith("scale"):
                value.fill_(0.3)
            elif name.endswith("flat.weight"):
                value.normal_(std=0.3)
    return model


@pytest.fixture(scope="module")
def motion(walk):  # type: ignore[no-untyped-def]
    """(1, 20, 22, 3) a real walk, six frames of 30 fps apart."""
    return walk[:, :120:6]


@pytest.fixture(scope="module")
def forecast(motion):  # type: ignore[no-untyped-def]
    observed = torch.ones_like(motion, dtype=torch.bool)
    observed[:, 10:] = False
    return observed


def noise(model, batch=1, scale=1.0):  # type: ignore[no-untyped-def]
    config = model.config
    made = np.random.default_rng(1).standard_normal((batch, model.noises, config.rows, config.width))
    return torch.from_numpy(scale * made)


def test_alignment_is_undone_to_the_last_bit_of_a_micron(motion, forecast):
    frame = Frame.of(motion, forecast)
    aligned = frame.align(motion)
    assert torch.allclose(aligned[0, 0, 0], torch.zeros(3, dtype=aligned.dtype), atol=1e-12)
    assert torch.allclose(frame.undo(aligned), motion, atol=1e-9)


def test_the_answer_follows_turns_and_moves(generator, motion, forecast):
    z = noise(generator)
    answer = generator(motion, forecast, z)
    yaw, away = torch.tensor(1.1, dtype=motion.dtype), motion.new_tensor([3.0, 0.0, -2.0])
    moved = generator(turn(motion, yaw) + away, forecast, z)
    for one, other in zip(answer, moved):
        assert torch.allclose(turn(one, yaw) + away, other, atol=1e-7)


def test_what_is_hidden_has_no_influence(generator, motion, forecast):
    z = noise(generator)
    spoiled = torch.where(forecast, motion, 1e3 * torch.randn_like(motion))
    for one, other in zip(generator(motion, forecast, z), generator(spoiled, forecast, z)):
        assert torch.equal(one, other)


def test_where_no_pose_is_whole_what_is_known_still_counts(generator, motion):
    """Single coordinates: no first pose tells where the body is and faces."""
    observed = torch.rand(motion.shape, generator=torch.Generator().manual_seed(3)) < 0.3
    raw, completed = generator(motion, observed, noise(generator))
    assert torch.isfinite(raw).all()
    nothing = torch.zeros_like(observed)
    assert torch.isfinite(generator(motion, nothing, noise(generator))[1]).all()
    assert torch.equal(completed[observed.all(-1)], motion[observed.all(-1)])


def test_single_coordinates_follow_moves(generator, motion):
    observed = torch.rand(motion.shape, generator=torch.Generator().manual_seed(4)) < 0.5
    observed[:, 0] = True
    away = motion.new_tensor([3.0, 0.0, -2.0])
    one, other = (generator(some, observed, noise(generator))[0] for some in (motion, motion + away))
    assert torch.allclose(one + away, other, atol=1e-7)


def test_noise_makes_the_difference_and_grows_with_the_temperature(generator, motion, forecast):
    still = generator(motion, forecast, noise(generator, scale=0.0))[0]
    assert torch.equal(still, generator(motion, forecast, noise(generator, scale=0.0))[0])
    little, much = (
        (generator(motion, forecast, noise(generator, scale=s))[0] - still).norm() for s in (0.1, 1.0)
    )
    assert 0 < little < 0.3 * much


def test_a_new_network_injects_no_noise(motion, forecast):
    model = Generator(SMALL).double()
    one, other = (model(motion, forecast, noise(model, scale=s))[0] for s in (0.0, 1.0))
    assert torch.equal(one, other)


@pytest.mark.parametrize("config", [PAPER, DENSE], ids=["paper", "dense"])
def test_a_new_network_says_what_it_knows(config):
    """Of frames that are whole, and of single coordinates; of the rest the pose that it begins with."""
    model, pose = Generator(config), torch.linspace(-1, 1, 66).view(22, 3)
    model.begin(pose)
    rows, together = config.rows, config.together
    with torch.no_grad():
        x, known = torch.randn(4, rows, 22, 3), torch.rand(4, rows, 22, 3) < 0.7
        seen = known.repeat_interleave(together, dim=1)
        if together > 1:
            seen &= torch.arange(config.frames)[:, None, None] % together != 1  # a few tell as much as all
        frames = x.repeat_interleave(together, dim=1)
        said = model.aligned(frames, seen, noise(model, batch=4).float())
    given = torch.where(known, x, pose)
    said = said.unflatten(1, (rows, together)).mean(dim=2)
    assert np.corrcoef(said.flatten(), given.flatten())[0, 1] > 0.85


def test_what_curves_can_draw_of_a_motion_is_what_they_draw_and_all_that_is_slow():
    """So that a discriminator compares like with like."""
    rng, bring, draw = np.random.default_rng(0), drawable(10, 6).values, curve(10, 6).values
    drawn = draw @ rng.standard_normal((10, 3))
    assert np.allclose(bring @ drawn, drawn)
    frames = np.arange(60)
    slow, fast = np.sin(frames / 20), np.sin(frames * 2.0)
    assert np.abs(bring @ slow - slow).max() < 0.01
    assert np.abs(bring @ fast).max() < 0.6


def test_curves_go_straight_on_and_through_the_middles_of_rows():
    weights = curve(20, 5).values
    frames = np.arange(100.0)
    assert np.allclose(weights @ (5 * np.arange(20) + 2.0), frames), "a line is a line, past its ends, too"
    assert np.allclose(weights[2::5], np.eye(20))


def test_a_dense_network_begins_with_what_one_of_single_frames_says():
    single, dense = Generator(PAPER).eval(), Generator(DENSE).eval()
    dense.grow(single)
    x, known = torch.randn(2, 20, 22, 3), torch.rand(2, 20, 22, 3) < 0.7
    seen = known.repeat_interleave(6, dim=1)
    seen &= torch.arange(120)[:, None, None] % 6 != 1  # a few frames of a row tell as much as all
    with torch.no_grad():
        said = dense.aligned(x.repeat_interleave(6, dim=1), seen, noise(dense, batch=2).float())
        alone = single.aligned(x, known, noise(single, batch=2).float())
    along = (curve(20, 6).beside(alone) @ alone.flatten(2)).unflatten(2, (22, 3))
    assert torch.allclose(said, along, atol=1e-4)


@pytest.mark.parametrize("config", [PAPER, DENSE], ids=["paper", "dense"])
def test_configurations(config):
    model = Generator(config)
    shape = (1, config.frames, 22, 3)
    with torch.no_grad():
        raw, _ = model(torch.randn(shape), torch.rand(shape) < 0.5, noise(model).float())
        assert raw.shape == shape
        judge = Discriminator(config)
        assert judge(judge.seen(torch.randn(3, *shape[1:]))).shape == (3,)
    # 20 frames of 4 s, or 120.
    assert config.frames / config.fps == 4.0


def test_settling_meets_what_is_known_and_keeps_the_way(motion):
    """Without a jump: the answer is off by as much just inside of a hole as at its edge."""
    observed = torch.ones(motion.shape[:-1], dtype=torch.bool)
    observed[:, 8:14] = False
    off = motion.new_tensor([0.3, 0.1, -0.2])
    assert torch.allclose(settle(motion + off, motion, observed), motion, atol=1e-12)
    observed[:, 8:] = False
    assert torch.allclose(settle(motion + off, motion, observed), motion, atol=1e-12)
    lost = torch.ones_like(observed)
    lost[..., 7] = False
    settled = settle(motion + off, motion, lost)
    assert torch.equal(settled[..., :7, :], motion[..., :7, :])


def test_distances_are_the_same_from_everywhere(motion):
    assert distances(motion).shape[-1] == 22 * 21 // 2
    moved = turn(motion, torch.tensor(0.7, dtype=motion.dtype)) + 5.0
    assert torch.allclose(distances(moved), distances(motion), atol=1e-6)
    assert torch.allclose(distances(motion)[0, 0, 0], (motion[0, 0, 0] - motion[0, 0, 1]).norm(), atol=1e-6)


def test_branches_see_what_they_are_named_after(motion):
    judge = Discriminator(SMALL).double()
    moved = motion + 1.0
    here, there = judge.seen(motion), judge.seen(moved)
    assert not torch.allclose(here["base"], there["base"])
    assert torch.allclose(here["edm"], there["edm"], atol=1e-6)
    assert torch.allclose(here["motion"], there["motion"], atol=1e-6)
    back = judge.seen(motion.flip(1))
    assert torch.allclose(back["edm"].flip(1), here["edm"])
    assert torch.allclose(-back["motion"].flip(1), here["motion"])
