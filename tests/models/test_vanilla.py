"""The plain autoencoder of table 1 in Kaufmann et al. 2020."""

from __future__ import annotations

import pytest

torch = pytest.importorskip("torch")

from interpose.models.vanilla import Vanilla  # noqa: E402


def test_the_paper_s_parameter_count():
    assert sum(p.numel() for p in Vanilla().parameters()) == 3_136_643


@pytest.mark.parametrize("frames", [2, 97, 120, 240])
def test_any_length_comes_back(frames):
    with torch.no_grad():
        assert Vanilla()(torch.randn(2, 1, 69, frames)).shape == (2, 1, 69, frames)


def test_each_row_is_read_and_written_where_it_belongs():
    """With layers that pass everything on, the image comes back as it was."""
    network = Vanilla(channels=())
    image = torch.randn(2, 1, 69, 9)
    assert torch.equal(network(image), image)


def test_frames_are_halved_five_times_and_rows_twice():
    shapes = []
    network = Vanilla()
    network.decoder[0].register_forward_pre_hook(lambda module, given: shapes.append(given[0].shape))
    with torch.no_grad():
        network(torch.zeros(1, 1, 69, 240))
    assert shapes == [(1, 512, 7, 8)]
