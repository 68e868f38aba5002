"""Rigs of game engines: a root above the hips that stays where it is, or goes along."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d
from tests.skeletons import rigs
from tests.skeletons.rigs import TARGET, under_root

import interpose
from interpose.geometry import rotations
from interpose.geometry.ground import turn
from interpose.observation.timeline import Placement, lay, plausible_length
from interpose.skeletons import find_humanoid
from interpose.skeletons.carrier import carriers, hips_of, moved


@pytest.fixture(scope="module", params=[False, True], ids=["stays", "goes"])
def rigged(request, cmu_walk):  # type: ignore[no-untyped-def]
    return under_root(cmu_walk, request.param)


def test_the_rig_is_the_same_motion(cmu_walk, rigged):
    own = [j for j in range(len(rigged.skeleton)) if j not in (0, TARGET)]
    assert np.allclose(rigged.positions()[:, own], cmu_walk.positions(), atol=1e-9)
    assert hips_of(rigged.skeleton) == 1


def test_what_carries_the_motion(cmu_walk):
    assert carriers(cmu_walk) == [0]
    assert carriers(under_root(cmu_walk, True)) == [0]
    assert carriers(under_root(cmu_walk, False)) == [1, TARGET]
    # Of one pose nobody knows: the root does not move.
    assert carriers(under_root(cmu_walk, True).slice(5, 6))[0] == 1


def test_moving_what_carries_it_moves_the_body_as_one(rigged):
    turned, placed = rigged.kinematics()
    yaw = rotations.about("y", np.full(len(rigged), 0.6))
    there = moved(
        rigged,
        {j: (rotations.multiply(yaw, turned[:, j]), turn(placed[:, j], 0.6) + 1.0) for j in carriers(rigged)},
    )
    wanted = turn(placed, np.array(0.6)) + 1.0
    body = slice(1, None)
    assert np.allclose(there.positions()[:, body], wanted[:, body], atol=1e-9)
    still = 0 not in carriers(rigged)
    assert np.allclose(there.positions()[:, 0], placed[:, 0] if still else wanted[:, 0], atol=1e-9)


@pytest.mark.parametrize("method", ["small", "cae", "spline"])
def test_a_root_that_goes_along_does_so_in_a_gap(cmu_walk, method):
    """It was a spline's, up to 10 cm beside hips that a network moved."""
    rigged = under_root(cmu_walk, True)
    aside = np.ptp((rigged.positions()[:, 1] - rigged.root)[:, [0, 2]], axis=0).max()
    assert aside < 1e-6
    done, same = (interpose.fill(clip, (60, 110), method=method).clip for clip in (rigged, cmu_walk))
    assert np.abs((done.positions()[:, 1] - done.root)[:, [0, 2]]).max() < 0.005
    assert np.abs(done.positions()[:, 1] - same.root).max() < 0.03


def test_a_root_that_goes_along_more_smoothly_stays_as_near(cmu_walk):
    rigged = under_root(cmu_walk, True)
    turned, placed = rigged.kinematics()
    loose = moved(rigged, {0: (turned[:, 0], gaussian_filter1d(placed[:, 0], 12, axis=0))})
    loose = moved(loose, {1: (turned[:, 1], placed[:, 1])})
    assert np.allclose(loose.positions()[:, 1], rigged.positions()[:, 1])

    def apart(clip):  # type: ignore[no-untyped-def]
        return np.linalg.norm((clip.positions()[:, 1] - clip.root)[:, [0, 2]], axis=1).max()

    assert apart(interpose.fill(loose, (50, 130), method="small").clip) < apart(loose) + 0.01


def test_a_root_that_stays_does_so_in_a_gap(cmu_walk):
    rigged = under_root(cmu_walk, False)
    done = interpose.fill(rigged, (60, 110), method="small").clip
    assert np.ptp(done.root, axis=0).max() < 1e-6


def test_a_root_on_the_floor_that_turns_stays_upright_and_on_it(cmu_walk):
    """About the vertical, by half a turn and back; its own axes are those of a program with Z up."""
    rigged = under_root(cmu_walk, True)
    turned, placed = rigged.kinematics()
    lying = rotations.about("X", np.array(-np.pi / 2))
    yaw = rotations.about("Y", 1.5 * np.sin(np.arange(len(rigged)) / 15))
    led = moved(rigged, {0: (rotations.multiply(yaw, lying), placed[:, 0] * [1.0, 0.0, 1.0])})
    led = moved(led, {1: (turned[:, 1], placed[:, 1])})
    done = interpose.fill(led, (60, 90), method="small").clip
    there, at = done.kinematics()
    up = rotations.rotate(there[:, 0], np.broadcast_to([0.0, 0.0, 1.0], (len(done), 3)))
    assert np.abs(up - [0.0, 1.0, 0.0]).max() < 1e-6
    assert np.abs(at[:, 0, 1]).max() < 1e-9


def yaws(clip):  # type: ignore[no-untyped-def]
    """(2, F) degrees about the vertical by which root and hips are turned since the first frame."""
    turned = clip.kinematics()[0]
    since = rotations.multiply(turned[:, :2], rotations.conjugate(turned[0, :2]))
    return np.degrees(np.unwrap(2 * np.arctan2(since[..., 2], since[..., 0]), axis=0)).T


def apart(clip):  # type: ignore[no-untyped-def]
    """(F,) degrees by which root and hips face elsewhere."""
    root, hips = yaws(clip)
    return np.abs((root - hips + 180) % 360 - 180)


@pytest.fixture(scope="module")
def led(cmu_walk):  # type: ignore[no-untyped-def]
    """A walk whose root, on the floor, turns along with the hips and more smoothly; own axes with Z up."""
    rigged = under_root(cmu_walk, True)
    turned, placed = rigged.kinematics()
    yaw = rotations.about("Y", np.radians(gaussian_filter1d(yaws(rigged)[1], 6)))
    led = moved(rigged, {0: (rotations.multiply(yaw, turned[:, 0]), placed[:, 0])})
    return moved(led, {1: (turned[:, 1], placed[:, 1])})


@pytest.mark.parametrize("gap", [(40, 120), (60, 170), (100, 209)])
def test_a_root_that_turns_along_does_so_in_a_gap(cmu_walk, led, gap):
    """It turned the other way round, up to 178 degrees from where the hips faced."""
    done, same = (interpose.fill(clip, gap, method="small").clip for clip in (led, cmu_walk))
    assert np.ptp(yaws(done)[1][slice(*gap)]) > 20, "there is a turn"
    assert apart(done).max() < apart(led).max() + 3
    turns = [np.abs(np.diff(yaws(clip)[0], 2)).max() for clip in (done, led)]
    assert turns[0] < 2 * turns[1], "as smoothly"
    body = [1, *range(TARGET + 1, len(led.skeleton))]
    assert np.abs(done.positions()[:, body] - same.positions()).max() < 0.05
    seen = np.setdiff1d(np.arange(len(led)), np.arange(*gap))
    assert done.rotation[seen].tobytes() == led.rotation[seen].tobytes()
    assert np.abs(done.root[:, 1]).max() < 1e-9


def test_who_is_brought_onto_a_rig_whose_root_turns_along_turns_it_along(cmu_walk, led):
    """It was turned as in the mean, however the body was."""
    done = interpose.retarget(cmu_walk, led.slice(0, 90))
    assert np.ptp(yaws(done)[0]) > 150
    assert apart(done).max() < apart(led).max() + 3
    without = interpose.retarget(cmu_walk, under_root(cmu_walk, True).slice(0, 90))
    body = [1, *range(TARGET + 1, len(led.skeleton))]
    assert np.allclose(done.positions()[:, body], without.positions()[:, body], atol=1e-9)
    assert np.ptp(without.rotation[:, 0], axis=0).max() < 1e-9, "it did not turn there"


def test_a_root_that_turns_along_does_so_on_the_way_to_another_clip(led):
    done = interpose.stitch([led.slice(0, 80), led.slice(120, 200)], method="small")
    assert apart(done.clip).max() < apart(led).max() + 3


def test_a_path_leads_the_hips(rigged, cmu_walk):
    gap, middle = (140, 190), 165
    point = cmu_walk.root[middle, [0, 2]] + [0.4, 0.2]
    done = interpose.fill(rigged, gap, method="spline", path={middle: point})
    same = interpose.fill(cmu_walk, gap, method="spline", path={middle: point})
    hips = done.clip.positions()[:, 1]
    assert np.linalg.norm(hips[middle, [0, 2]] - point) < 0.01
    # About as well as without a root above: the finish sees other joints that move.
    assert np.abs(hips - same.clip.root).max() < 0.03
    assert done.report.gaps[0].path < 1
    if 0 not in carriers(rigged):
        assert np.ptp(done.clip.translation[:, 0], axis=0).max() < 1e-4, "the root stays"


def test_lengths_and_courses_go_by_the_hips(rigged, cmu_walk):
    assert plausible_length(rigged, 20, rigged, 80) == plausible_length(cmu_walk, 20, cmu_walk, 80)
    lines = [lay([clip.slice(10, 65), clip.slice(140, 200)]) for clip in (rigged, cmu_walk)]
    assert lines[0].gaps == lines[1].gaps
    one, other = (line.laid[1].placement for line in lines)
    assert one.yaw == pytest.approx(other.yaw, abs=1e-6)
    assert np.allclose(lines[0].clip.positions()[:, 1], lines[1].clip.root, atol=1e-6)
    if 0 not in carriers(rigged):
        assert np.ptp(lines[0].clip.translation[:, 0], axis=0).max() < 1e-9


def test_hips_whose_place_is_known_rest_nowhere(cmu_walk):
    """Takes of Bandai-Namco's rig have their first hips as its OFFSET: it says nothing of the body."""
    one, other = (under_root(cmu_walk.slice(*span), False) for span in ((0, 60), (100, 160)))
    rest = other.skeleton.rest_translation.copy()
    rest[1] = [0.7, -0.3, 0.5]
    other = replace(other, skeleton=replace(other.skeleton, rest_translation=rest))
    line = lay([one, other])
    assert line.laid[1].scale == 1
    assert lay([one, under_root(cmu_walk.slice(100, 160), False)]).laid[1].placement == line.laid[1].placement


def test_a_placement_alone_moves_roots(rigged):
    placement = Placement(0.7, (1.0, 0.0, -2.0))
    assert np.allclose(placement.of(rigged).positions(), placement.at(rigged.positions()), atol=1e-9)


@pytest.mark.parametrize("aside", [0.0, 0.1])
def test_a_root_turns_for_hips_that_never_turn_against_it(cmu_walk, data, aside):
    """3ds Max's Biped: in a gap, and where another motion is brought onto it, though the hips hang aside."""
    biped, _ = rigs.build("biped", cmu_walk)
    pelvis = biped.skeleton.index("Bip01_Pelvis")
    rest = biped.skeleton.rest_translation.copy()
    rest[pelvis] = [0.0, aside, 0.1 * aside]
    biped = replace(biped, skeleton=replace(biped.skeleton, rest_translation=rest))
    filled = interpose.fill(biped, (60, 100), method="small").clip
    brought = interpose.retarget(interpose.load(data / "cmu_jump.bvh"), biped)
    for made in (filled, brought):
        assert rotations.angle(made.rotation[:, pelvis], biped.rotation[0, pelvis]).max() < 1e-6
        assert rotations.angle(made.rotation[:, 0], made.rotation[0, 0]).max() > 0.1
    body = find_humanoid(biped)
    off = np.linalg.norm(body.positions(filled) - body.positions(biped), axis=-1)
    assert off[60:100].mean() < 0.06
    steps = np.linalg.norm(np.diff(filled.positions()[58:102], 2, axis=0), axis=-1)
    assert steps.max() < 0.04
