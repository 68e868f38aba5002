"""The paper's network, the image of a motion, the way back to a trajectory, and the exported graph."""

from __future__ import annotations

import copy
import math

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from interpose.geometry.ground import turn  # noqa: E402
from interpose.methods.cae import LENGTH, run, run_long, starts  # noqa: E402
from interpose.models.cae import Autoencoder, Infiller, integrate, settle, to_image  # noqa: E402
from interpose.models.keys import neighbours  # noqa: E402
from interpose.models.vanilla import Vanilla  # noqa: E402
from interpose.skeletons import JOINTS, SIDES  # noqa: E402
from interpose.training.deconvolution import quicken  # noqa: E402
from interpose.training.graphs import export_cae_onnx  # noqa: E402


@pytest.fixture(scope="module")
def model():  # type: ignore[no-untyped-def]
    """A network with random weights whose output is of the size of real rows."""
    torch.manual_seed(3)
    model = Infiller()
    model.std.fill_(0.3)
    return model.eval()


def test_the_paper_s_parameter_count():
    assert sum(p.numel() for p in Autoencoder().parameters()) == 4_703_425


@pytest.mark.parametrize("frames", [97, 120, 128, 240])
def test_any_length_comes_back(frames):
    with torch.no_grad():
        assert Autoencoder()(torch.zeros(1, 1, 69, frames)).shape == (1, 1, 69, frames)


def test_bottleneck_of_the_paper():
    """A clip of 69 x 240 is squeezed into 3 x 8 x 256 (section 3.2)."""
    shapes = []
    network = Autoencoder()
    network.decoder[0][0].register_forward_pre_hook(lambda module, given: shapes.append(given[0].shape))
    with torch.no_grad():
        network(torch.zeros(1, 1, 69, 240))
    assert shapes == [(1, 256, 3, 8)]


def test_image_does_not_depend_on_place_heading_or_floor(walk, gap):
    image = to_image(walk, gap)
    moved = turn(walk, torch.tensor(1.1, dtype=walk.dtype)) + torch.tensor([3.0, 0.7, -2.0], dtype=walk.dtype)
    other = to_image(moved, gap)
    assert torch.allclose(image.rows, other.rows, atol=1e-9)
    assert torch.equal(image.known, other.known)


def test_image_of_the_mirrored_body_is_the_mirrored_image(walk, gap):
    mirrored = walk[:, :, list(SIDES)] * torch.tensor([-1.0, 1, 1], dtype=walk.dtype)
    rows, other = to_image(walk, gap).rows, to_image(mirrored, gap).rows
    body = rows[:, :66].unflatten(1, (22, 3))[:, list(SIDES)] * torch.tensor([-1.0, 1, 1])[:, None]
    assert torch.allclose(body.flatten(1, 2), other[:, :66], atol=1e-9)
    assert torch.allclose(rows[:, 66:] * torch.tensor([-1.0, 1, -1])[:, None], other[:, 66:], atol=1e-9)


def test_what_is_known_of_the_image(walk, gap):
    """Body rows outside the gap; movement only where the frame before is observed, too."""
    known = to_image(walk, gap).known[0]
    frames = np.arange(walk.shape[1])
    inside = (frames >= 50) & (frames < 80)
    assert np.array_equal(known[0].numpy(), ~inside)
    assert np.array_equal(known[66].numpy(), ~inside & (frames != 80) & (frames != 0))


def moves_of(image):  # type: ignore[no-untyped-def]
    return image.rows[:, 66:].transpose(1, 2)


@pytest.mark.parametrize("correct", [False, True])
def test_true_movement_walks_the_true_way(walk, gap, correct):
    """With the true movement summed up, the trajectory comes out true, and nothing is left to correct."""
    image = to_image(walk, gap)
    root, yaw = integrate(moves_of(image), image, correct)
    assert torch.allclose(root, image.root, atol=1e-6)
    assert torch.allclose(torch.cos(yaw - image.yaw), torch.ones_like(yaw), atol=1e-9)


def test_drift_is_spread_smoothly_and_gone_at_the_end(walk, gap):
    image = to_image(walk, gap)
    moves = moves_of(image) + torch.tensor([0.004, 0.0, 0.01])
    root, _ = integrate(moves, image, correct=False)
    fixed, straight = integrate(moves, image, correct=True)
    assert (root - image.root).norm(dim=-1)[0, 79] > 0.1
    step = image.root[0, 80] - fixed[0, 79]
    true = image.root[0, 80] - image.root[0, 79]
    assert (step - true).norm() < 0.02
    assert abs(float(straight[0, 79] - image.yaw[0, 79])) < 0.03
    outside = torch.ones(walk.shape[1], dtype=torch.bool)
    outside[50:80] = False
    assert torch.equal(fixed[0, outside], image.root[0, outside])


@pytest.mark.parametrize("hole", [slice(0, 30), slice(100, 128)])
def test_open_ends_are_walked_from_the_one_side_there_is(walk, hole):
    observed = torch.ones(walk.shape[:-1], dtype=torch.bool)
    observed[:, hole] = False
    image = to_image(walk, observed)
    root, _ = integrate(moves_of(image), image, correct=True)
    assert torch.allclose(root[:, 2:], image.root[:, 2:], atol=1e-6)


def test_what_is_always_wrong_by_as_much_is_set_right(walk, gap):
    """A constant error of poses and velocities shows at the gap's edges, and is gone from inside as well."""
    image = to_image(walk, gap)
    rows = (
        image.rows
        + torch.linspace(-0.1, 0.1, 69, dtype=walk.dtype)[:, None] * (torch.arange(69) < 68)[:, None]
    )
    assert torch.allclose(settle(rows, image)[..., 1:], image.rows[..., 1:], atol=1e-6)


def test_known_rows_are_taken_as_observed_and_met_without_a_jump(walk, gap):
    image = to_image(walk, gap)
    slow = torch.sin(torch.linspace(0, 6, walk.shape[1], dtype=walk.dtype)) * 0.3
    settled = settle(image.rows + slow, image)
    assert torch.equal(settled[image.known], image.rows[image.known])
    jump = torch.diff(settled - image.rows, n=2, dim=-1)[:, :66, 48:81].abs().max()
    assert jump < 0.015, "metres a frame squared, of an error of 30 cm"


def test_a_joint_that_is_never_observed_keeps_the_network_s_word(walk):
    observed = torch.ones(walk.shape[:-1], dtype=torch.bool)
    observed[:, :, JOINTS.index("LeftHand")] = False
    image = to_image(walk, observed)
    rows = torch.randn_like(image.rows)
    hand = slice(3 * JOINTS.index("LeftHand"), 3 * JOINTS.index("LeftHand") + 3)
    assert torch.equal(settle(rows, image)[:, hand], rows[:, hand])


def test_neighbours_by_hand():
    placed = torch.tensor([[False, True, False, False, True, False]])
    last, first = neighbours(placed)
    assert last.tolist() == [[1, 1, 1, 1, 4, 4]]
    assert first.tolist() == [[1, 1, 4, 4, 4, 4]]
    assert [n.tolist() for n in neighbours(torch.zeros(1, 3, dtype=torch.bool))] == [[[0, 0, 0]], [[0, 0, 0]]]


@pytest.mark.parametrize("poison", [1e3, -5.0, math.nan])
def test_nothing_leaks(model, walk, gap, poison):
    positions = walk.float()
    poisoned = torch.where(gap[..., None], positions, torch.tensor(poison))
    with torch.no_grad():
        for one, other in zip(model(positions, gap), model(poisoned, gap)):
            assert torch.equal(one, other)


def test_single_joints_leak_nothing_either(model, walk):
    observed = torch.ones(walk.shape[:-1], dtype=torch.bool)
    observed[:, :, [JOINTS.index("LeftUpLeg"), JOINTS.index("RightHand")]] = False
    positions = walk.float()
    poisoned = torch.where(observed[..., None], positions, torch.tensor(7.0))
    with torch.no_grad():
        assert torch.equal(model(positions, observed)[2], model(poisoned, observed)[2])


def test_completion_turns_and_moves_with_the_input(model, walk, gap):
    positions = walk.float()
    moved = turn(positions, torch.tensor(0.8)) + torch.tensor([1.0, 0.2, -0.5])
    with torch.no_grad():
        here, there = model(positions, gap)[2], model(moved, gap)[2]
    assert torch.allclose(turn(here, torch.tensor(0.8)) + torch.tensor([1.0, 0.2, -0.5]), there, atol=1e-4)


@pytest.fixture(scope="module")
def graph(model, tmp_path_factory):  # type: ignore[no-untyped-def]
    """The exported graph, and the same network with its weights rounded to the 16 bits of the file."""
    pytest.importorskip("onnxscript")
    path = tmp_path_factory.mktemp("onnx") / "cae.onnx"
    export_cae_onnx(model, path)
    for parameter in model.parameters():
        if parameter.numel() >= 1024:
            parameter.data = parameter.data.half().float()
    return path, model


@pytest.mark.parametrize("frames", [97, 100, 113, 128, 129])
def test_graph_agrees_with_torch_at_odd_lengths(graph, walk, frames):
    path, model = graph
    positions = torch.cat([walk, walk], dim=1)[:, :frames].float()
    observed = torch.ones(positions.shape[:-1], dtype=torch.bool)
    observed[:, 40:70] = False
    with torch.no_grad():
        theirs = [out.numpy() for out in model(positions, observed)]
    mine = run(path, positions.numpy().astype(float), observed.numpy())
    assert all(np.abs(a - b).max() < 1e-4 for a, b in zip(mine, theirs))


def test_graph_tells_nothing_of_the_machine_that_made_it(graph):
    content = graph[0].read_bytes()
    assert b"stack_trace" not in content
    assert b".py" not in content


def test_graph_takes_several_clips_at_once(graph, walk):
    path, _ = graph
    positions = np.concatenate([walk[:, :64].numpy(), walk[:, 40:104].numpy()])
    observed = np.ones(positions.shape[:-1], bool)
    observed[:, 20:40] = False
    together = run(path, positions, observed)[2]
    alone = run(path, positions[1:], observed[1:])[2]
    assert np.abs(together[1:] - alone).max() < 1e-5


@pytest.mark.parametrize("kind", [Autoencoder, Vanilla])
def test_quick_deconvolution_is_the_same_deconvolution(kind):
    torch.manual_seed(0)
    network, other = kind(), kind()
    other.load_state_dict(network.state_dict())
    quicken(other)
    image = torch.randn(2, 1, 69, 64)
    outputs, gradients = [], []
    for one in (network, other):
        with torch.autocast("cpu", torch.bfloat16):
            out = one(image).float()
        out.abs().mean().backward()
        outputs.append(out)
        gradients.append(torch.cat([p.grad.flatten() for p in one.parameters()]))
    scale = outputs[0].abs().mean()
    assert (outputs[0] - outputs[1]).abs().mean() < 0.03 * scale
    cosine = torch.nn.functional.cosine_similarity(gradients[0], gradients[1], dim=0)
    assert cosine > 0.99


def test_a_copy_of_a_quick_network_has_weights_of_its_own():
    """As the averaged weights have, which training measures."""
    torch.manual_seed(0)
    network = Autoencoder()
    quicken(network)
    copied, image = copy.deepcopy(network), torch.randn(1, 1, 69, 32)
    with torch.no_grad():
        before = copied(image)
        for parameter in network.parameters():
            parameter.zero_()
        assert torch.equal(copied(image), before)


def test_windows_lie_around_what_is_missing():
    complete = np.ones(1000, bool)
    complete[[*range(300, 330), *range(990, 1000)]] = False
    assert starts(complete).tolist() == [315 - LENGTH // 2, 1000 - LENGTH]
    complete[400:800] = False
    covered = np.zeros(1000, bool)
    for start in starts(complete):
        covered[start : start + LENGTH] = True
    assert covered[~complete].all()
    assert starts(np.ones(1000, bool)).tolist() == []


def test_a_long_motion_is_completed_window_by_window(graph, walk):
    """One gap of a long motion is what its window says; observed poses come back, wherever a window is."""
    path, _ = graph
    there = walk[0].numpy()
    motion = np.concatenate([there, there[::-1], there])
    observed = np.ones(motion.shape[:-1], bool)
    observed[200:230] = False
    whole = run_long(path, motion, observed)[2]
    part = slice(215 - LENGTH // 2, 215 + LENGTH // 2)
    alone = run(path, motion[None, part], observed[None, part])[2][0]
    assert np.abs(whole[part] - alone).max() < 1e-6
    assert np.abs((whole - motion)[observed]).max() < 1e-4
