"""What goes on in step: where in its stride a walk is, and where it heads without the sway of its steps."""

from __future__ import annotations

from importlib import resources
from types import SimpleNamespace

import numpy as np
import pytest

from interpose import tasks
from interpose.errors import RequestError
from interpose.formats import load
from interpose.geometry import rotations
from interpose.geometry.ground import turn
from interpose.observation.gait import cycles, in_step, legs, stride
from interpose.observation.timeline import Placement
from interpose.skeletons import find_humanoid
from interpose.tasks import stitching


@pytest.fixture(scope="module")
def walk():  # type: ignore[no-untyped-def]
    """Four strides straight on, of 41 frames each."""
    return load(resources.files("interpose") / "examples" / "walk.bvh")


@pytest.mark.parametrize("missing", [2, 9, 16, 20])
@pytest.mark.parametrize("moved", [(), (2.1, (4.0, 0.0, -3.0))])
def test_a_cut_walk_goes_on_when_it_did(walk, missing, moved):
    before, after = walk.slice(0, 90), Placement(*moved).of(walk.slice(90 + missing, len(walk)))
    found = in_step(find_humanoid(walk), before, after)
    assert found.frames(1) == pytest.approx(missing + 1, abs=2)
    assert found.frames(15) in range(15, 15 + 43)
    yaw = found.yaw + found.rate * (missing + 1) + (moved[0] if moved else 0.0)
    assert np.degrees(np.angle(np.exp(1j * yaw))) == pytest.approx(0, abs=4)


def test_a_loop_of_a_straight_walk_is_straight_and_slides_no_more_than_the_walk(walk):
    """The hips sway by 9 degrees from side to side with each step."""
    for start in (0, 10, 20, 30):
        done = tasks.stitch([walk.slice(start, start + 110)], loop=True)
        assert abs(np.degrees(done.loop.placement.yaw)) < 5
        assert done.report.gaps[0].foot_slide < 12


def test_what_does_not_walk_has_no_strides(cmu_walk):
    body = find_humanoid(cmu_walk)
    stands = cmu_walk.slice(50, 51)
    still = stands.with_motion(np.repeat(stands.rotation, 60, 0), np.repeat(stands.translation, 60, 0))
    assert stride(legs(body.positions(still), 30.0), 30.0) is None
    assert in_step(body, still, cmu_walk) is None
    assert in_step(body, stands, stands) is None


@pytest.mark.parametrize("side", [-1, 1])
def test_a_walk_in_a_circle_goes_on_along_it(walk, side):
    """The straight walk bent to one side, by a degree a frame, and cut: what follows heads as it did."""
    way = np.arange(len(walk))
    yaw = np.radians(side * way)
    turned, placed = walk.rotation.copy(), walk.translation.copy()
    turned[:, 0] = rotations.multiply(rotations.about("Y", yaw), turned[:, 0])
    steps = turn(np.diff(walk.root, axis=0) * [1.0, 0.0, 1.0], yaw[1:])
    placed[:, 0, [0, 2]] = walk.root[0, [0, 2]]
    placed[1:, 0, [0, 2]] += np.cumsum(steps, axis=0)[:, [0, 2]]
    circle = walk.with_motion(turned, placed)
    found = in_step(find_humanoid(circle), circle.slice(0, 90), circle.slice(100, len(circle)))
    assert np.degrees(found.rate) == pytest.approx(side, abs=0.2)
    yaw = found.yaw + found.rate * 11
    assert np.degrees(np.angle(np.exp(1j * yaw))) == pytest.approx(0, abs=6)


def test_who_stands_is_no_cycle_of_a_walk(walk):
    """Standing is more like itself than any stride."""
    at = np.concatenate([np.arange(90), np.full(60, 90)])
    rotation = rotations.multiply(
        walk.rotation[at],
        rotations.exp(np.random.default_rng(0).normal(0, 2e-3, (150, len(walk.skeleton), 3))),
    )
    found = tasks.cycle(walk.with_motion(rotation, walk.translation[at]))
    assert found.stop <= 92
    assert found.stop + found.frames - found.start == pytest.approx(41, abs=4)


def test_who_does_nothing_but_stand_goes_round(walk):
    """Any pose is like any other, and half of how far they are from their mean is nothing."""
    time = np.arange(120)[:, None] / 30
    sway = 0.02 * np.sin(2.1 * time + np.arange(len(walk.skeleton))) + 0.004 * time
    rotation = rotations.multiply(walk.rotation[[90] * 120], rotations.exp(sway[..., None] * [1.0, 0.0, 0.0]))
    found = tasks.cycle(walk.with_motion(rotation, walk.translation[[90] * 120]))
    assert found.stop + found.frames - found.start > 60


def test_who_stands_and_then_walks_off_stands_to_go_round(walk):
    """No part of the walk comes back, and the rest hardly moves."""
    at = np.concatenate([np.full(100, 5), np.arange(5, 20)])
    with pytest.raises(RequestError):  # a second of it is no idle
        tasks.cycle(walk.with_motion(walk.rotation[at[70:]], walk.translation[at[70:]]))
    time = np.arange(len(at))[:, None] / 30
    sway = 0.02 * np.sin(2.1 * time + np.arange(len(walk.skeleton)))
    rotation = rotations.multiply(walk.rotation[at], rotations.exp(sway[..., None] * [1.0, 0.0, 0.0]))
    found = tasks.cycle(walk.with_motion(rotation, walk.translation[at]))
    assert found.stop <= 103
    assert found.stop + found.frames - found.start > 60


def test_of_ways_to_go_round_the_first_one_counts_that_closes_well(walk, monkeypatch):
    """Where all are flagged, the one in which feet slide least."""
    found = cycles(find_humanoid(walk), walk)
    assert len(found) > 2
    assert [apart for *_, apart in found] == sorted(apart for *_, apart in found)
    assert len({(start, stop) for start, stop, _ in found}) == len(found)

    def closing(slides: list[float], flagged: int):
        reports = iter(
            SimpleNamespace(foot_slide=slide, gliding=0.0, notes=("flagged: feet slide",) * (i < flagged))
            for i, slide in enumerate(slides)
        )
        return lambda *_, **__: SimpleNamespace(report=SimpleNamespace(gaps=[next(reports)]))

    still = np.zeros(len(walk.skeleton))
    monkeypatch.setattr(stitching, "_jumps", lambda *_: still)
    for slides, flagged, chosen in (([9.0, 9.0, 9.0], 0, 0), ([50.0, 9.0, 5.0], 1, 1)):
        monkeypatch.setattr(stitching, "stitch", closing(slides, flagged))
        assert tasks.cycle(walk).start == found[chosen][0]
    # A hand that is elsewhere snaps in a way back that nothing is flagged of.
    hand = still.copy()
    hand[walk.skeleton.index("LeftHand")] = 1.0
    jumps = iter([hand, *[still] * 9])
    monkeypatch.setattr(stitching, "stitch", closing([9.0] * 9, 0))
    monkeypatch.setattr(stitching, "_jumps", lambda *_: next(jumps))
    assert tasks.cycle(walk).start == found[1][0]
    monkeypatch.setattr(stitching, "_jumps", lambda *_: still)
    # In a way back that is too short to be asked about feet may skid all the same: the next is calm.
    slides = [50.0 if k < len(found) else 9.0 for k in range(2 * len(found))]
    monkeypatch.setattr(stitching, "stitch", closing(slides, 0))
    assert tasks.cycle(walk).frames > tasks.stitching.BRIDGES[0] * walk.fps + 1
    # Those that follow may slide as the walk does.
    monkeypatch.setattr(stitching, "skidding", lambda *_: False)
    slides = [50.0, 40.0, 60.0, 70.0, 80.0][: len(found)]
    every = [*slides, *(slide + 30.0 for slide in slides), *(slide + 20.0 for slide in slides)]
    monkeypatch.setattr(stitching, "stitch", closing(every, len(every)))
    assert tasks.cycle(walk).start == found[1][0]
    # A longer way back, in which a foot may step, where something is flagged in each of the shortest.
    monkeypatch.setattr(stitching, "stitch", closing(every, len(found)))
    longer = tasks.cycle(walk)
    assert longer.start == found[0][0]
    assert longer.frames > tasks.stitching.BRIDGES[0] * walk.fps + 1
