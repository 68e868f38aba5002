"""What repeats itself around a gap repeats itself in it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from interpose.clip import Clip, Skeleton
from interpose.finish import complete
from interpose.geometry import rotations
from interpose.methods import registry, repeating
from interpose.methods.repeating import Motion
from interpose.observation import Gap, Observation, Pin
from interpose.resampling import resample
from interpose.skeletons import BONES, JOINTS, PARENTS

FRAMES, HOLE, BACK = 240, (100, 145), slice(None, None, -1)


def walking(period: float | np.ndarray = 31.0, turns: float = 0.0) -> Motion:
    """Arms and legs that swing to and fro, in so many frames (which may change: (F,)), of a body that goes
    ahead, and turns by so many radians a frame."""
    time = np.arange(FRAMES)
    phase = 2 * np.pi * np.cumsum(np.broadcast_to(1 / np.asarray(period), FRAMES))
    local = np.tile(rotations.identity(len(JOINTS)), (FRAMES, 1, 1))
    for name, axis, swing, late in (
        ("LeftArm", "Z", 0.5, 0.0),
        ("LeftForeArm", "Y", 0.2, 0.4),
        ("RightArm", "Z", 0.5, np.pi),
        ("LeftUpLeg", "X", 0.4, np.pi),
        ("RightUpLeg", "X", 0.4, 0.0),
        ("RightLeg", "X", 0.3, 0.3),
    ):
        local[:, JOINTS.index(name)] = rotations.about(axis, swing * np.sin(phase + late))
    yaw = turns * time
    local[:, 0] = rotations.about("Y", yaw)
    ahead = np.stack([np.sin(yaw), np.zeros(FRAMES), np.cos(yaw)], axis=1)
    root = np.cumsum(0.04 * ahead, axis=0)
    root[:, 1] = 0.9
    return Motion(local, root)


def known(hole: tuple[int, int] = HOLE) -> np.ndarray:
    told = np.ones((FRAMES, 23), bool)
    told[slice(*hole)] = False
    return told


def frozen(motion: Motion, hole: tuple[int, int] = HOLE) -> Motion:
    """What a network says that knows nothing: limbs hang in the hole, and the body goes its way."""
    local = motion.local.copy()
    local[slice(*hole), 1:] = rotations.identity(len(JOINTS) - 1)
    return Motion(local, motion.root.copy())


def off(one: Motion, other: Motion, names: str, hole: tuple[int, int] = HOLE) -> float:
    rows = [row for row, name in enumerate(JOINTS) if names in name]
    return float(rotations.angle(one.local[slice(*hole), rows], other.local[slice(*hole), rows]).mean())


@pytest.mark.parametrize("turns", [0.0, 0.01])
def test_arms_and_legs_swing_on(turns):
    truth = walking(turns=turns)
    said = frozen(truth)
    done, _ = repeating.carried_on(truth, known(), said, BONES)
    # The network's word counts for the rest.
    for names, part in (("Arm", repeating.ARMS[0]), ("Leg", repeating.BODY)):
        assert off(done, truth, names) < (1.05 - part.share) * off(said, truth, names)
    assert np.allclose(done.root, said.root), "between known sides the way is the network's"
    outside = known().all(axis=1)
    assert (done.local[outside] == said.local[outside]).all()


@pytest.mark.parametrize("first", [False, True])
def test_an_arm_that_is_held_goes_on_so_where_nothing_follows(first):
    """On the back, say: networks let it hang. One that moved may do anything."""
    truth, hole = walking(), (0, 90) if first else (FRAMES - 90, FRAMES)
    arm = [JOINTS.index("Right" + name) for name in ("Arm", "ForeArm", "Hand")]
    truth.local[:, arm] = rotations.about("Z", np.array(0.9))
    said = frozen(truth, hole)
    said.local[slice(*hole), arm] = rotations.identity()
    done, _ = repeating.carried_on(truth, known(hole=hole), said, BONES)
    inner = (hole[0], hole[1] - repeating.RESTING) if first else (hole[0] + repeating.RESTING, hole[1])
    assert rotations.angle(done.local[slice(*inner), arm], truth.local[0, arm]).max() < 1e-6
    truth.local[:, arm[0]] = rotations.about("Z", 0.9 + 0.01 * np.arange(FRAMES))
    done, _ = repeating.carried_on(truth, known(hole=hole), said, BONES)
    assert rotations.angle(done.local[slice(*inner), arm], rotations.identity()).max() < 1e-6


def test_in_short_holes_the_network_counts_for_more():
    truth, hole = walking(), (100, 105)
    said = frozen(truth, hole)
    done, _ = repeating.carried_on(truth, known(hole=hole), said, BONES)
    left = 1 - repeating.ARMS[0].share * 5 / repeating.WHOLE
    assert off(done, truth, "Arm", hole) == pytest.approx(left * off(said, truth, "Arm", hole), rel=0.05)


def test_a_rhythm_that_quickens_fits_both_sides():
    truth = walking(np.interp(np.arange(FRAMES), [90, 150], [34.0, 31.0]))
    rhythm = repeating.find(
        *(truth.local[part].reshape(-1, 88) for part in (slice(100), slice(145, None))), 45, 0.9
    )
    assert rhythm is not None
    assert [rhythm.before, rhythm.after] == pytest.approx([34, 31], abs=0.5)
    assert rhythm.inside == pytest.approx(32.5, abs=0.7)
    said = frozen(truth)
    done, periods = repeating.carried_on(truth, known(), said, BONES)
    assert periods == {HOLE: ("what repeats itself", pytest.approx(rhythm.inside, abs=0.5))}
    assert off(done, truth, "Arm") < 0.3 * off(said, truth, "Arm")


def test_who_has_just_raised_his_arm_waves_on():
    """The whole second before he waved does not repeat itself; what is nearest does."""
    truth = walking()
    arms = [row for row, name in enumerate(JOINTS) if "Arm" in name]
    truth.local[:45, arms] = truth.local[45:46, arms]
    raised = rotations.about("Z", np.interp(np.arange(FRAMES), [0, 45], [-1.5, 0.0]))
    truth.local[:, arms[0]] = rotations.multiply(raised, truth.local[:, arms[0]])
    said = frozen(truth)
    done, _ = repeating.carried_on(truth, known(), said, BONES)
    assert off(done, truth, "Arm") < 0.3 * off(said, truth, "Arm")


def test_what_does_not_repeat_itself_is_the_networks():
    rng = np.random.default_rng(0)
    wander = walking()
    wander.local[:, 1:] = rotations.exp(
        np.cumsum(0.05 * rng.normal(size=(FRAMES, len(JOINTS) - 1, 3)), axis=0)
    )
    still = walking()
    still.local[:, 1:] = rotations.identity(len(JOINTS) - 1)
    uneven = Motion(np.concatenate([walking(31.0).local[:120], walking(45.0).local[120:]]), walking().root)
    for seen in (wander, still, uneven):
        said = frozen(seen)
        done, periods = repeating.carried_on(seen, known(), said, BONES)
        assert not periods
        assert (done.local == said.local).all()
        assert (done.root == said.root).all()


def test_part_of_a_pose_and_what_lies_beside_it_are_left_alone():
    truth, some = walking(), known()
    said = frozen(truth)
    some[120:125, 5] = True
    beside = known()
    beside[95:100, 5] = False
    for told in (some, beside):
        done, periods = repeating.carried_on(truth, told, said, BONES)
        assert not periods
        assert (done.local == said.local).all()


def test_nothing_unknown_is_looked_at():
    truth = walking()
    said = frozen(truth)
    done, _ = repeating.carried_on(truth, known(), said, BONES)
    other = Motion(truth.local.copy(), truth.root.copy())
    other.local[slice(*HOLE)] = rotations.identity(len(JOINTS))
    other.root[slice(*HOLE)] = 1e3
    again, _ = repeating.carried_on(other, known(), said, BONES)
    assert (again.local == done.local).all()
    assert (again.root == done.root).all()


@pytest.mark.parametrize("turns", [0.0, 0.02, 0.12])
def test_who_walks_out_of_a_clip_walks_on(turns):
    """Where the network lets him stand; ever more as he did. Seen from elsewhere it is the same."""
    truth, hole = walking(turns=turns), (180, 240)
    said = frozen(truth, hole)
    said.root[180:] = truth.root[179]
    said.local[180:, 0] = truth.local[179, 0]
    done, _ = repeating.carried_on(truth, known(hole=hole), said, BONES)
    pace = np.linalg.norm(np.diff(done.root[179:], axis=0), axis=1) / 0.04
    assert pace[0] == pytest.approx(repeating.BODY.share, abs=0.02)
    assert np.allclose(pace[repeating.ALONE :], 1.0, atol=0.05)
    spun = rotations.angle(done.local[180:, 0], done.local[179:-1, 0])
    assert spun.max() < max(2 * turns, 0.01), "also who spins"
    turned = rotations.about("Y", np.array([2.0]))

    def elsewhere(motion: Motion) -> Motion:
        local = motion.local.copy()
        local[:, 0] = rotations.multiply(turned, local[:, 0])
        return Motion(local, rotations.rotate(turned, motion.root))

    there, _ = repeating.carried_on(elsewhere(truth), known(hole=hole), elsewhere(said), BONES)
    assert np.allclose(there.root, elsewhere(done).root, atol=1e-9)
    assert rotations.angle(there.local, elsewhere(done).local).max() < 1e-6


def test_who_climbs_a_little_does_not_climb_for_ever():
    truth, hole = walking(), (140, 240)
    truth.root[:, 1] += 0.001 * np.arange(FRAMES)
    said = frozen(truth, hole)
    said.root[140:, 1] = truth.root[139, 1]
    done, _ = repeating.carried_on(truth, known(hole=hole), said, BONES)
    assert np.ptp(done.root[140:, 1]) < 1e-9
    assert np.ptp(done.root[140:, 2]) > 3.0


@pytest.mark.parametrize("short", [46, 55])
def test_both_ways_repetitions_are_found_alike(short):
    truth = walking()
    for length in range(30, 61, 3):
        hole = (120, 120 + length)
        part = truth.part(slice(120 - short, None))
        told = known(hole=hole)[120 - short :]
        said = frozen(part, (short, short + length))
        forth, found = repeating.carried_on(part, told, said, BONES)
        back, again = repeating.carried_on(part.part(BACK), told[::-1], said.part(BACK), BONES)
        assert len(found) == len(again) == 1, length
        assert rotations.angle(forth.local, back.local[::-1]).max() < 1e-6


def test_the_body_tells_how_long_a_repetition_takes():
    quick, truth = walking(15.5), walking()
    arm = JOINTS.index("RightArm")
    truth.local[:, arm] = quick.local[:, arm]
    _, periods = repeating.carried_on(truth, known(), frozen(truth), BONES)
    assert periods == {HOLE: ("what repeats itself", pytest.approx(31, abs=0.5))}


def test_what_comes_before_a_clip_is_what_goes_on_backwards():
    truth, hole = walking(), (180, 240)
    said, told = frozen(truth, hole), known(hole=hole)
    done, _ = repeating.carried_on(truth, told, said, BONES)
    before, _ = repeating.carried_on(truth.part(BACK), told[::-1], said.part(BACK), BONES)
    assert (before.local == done.local[::-1]).all()
    assert (before.root == done.root[::-1]).all()
    assert off(done, truth, "Arm", hole) < 0.25 * off(said, truth, "Arm", hole)


def test_fills_of_what_repeats_itself_go_on_and_say_so(monkeypatch):
    """At twice the network's frame rate, on a skeleton of which one joint of the spine is missing."""
    spine = JOINTS.index("Spine1")
    kept = [row for row in range(len(JOINTS)) if row != spine]
    above = [spine - 1 if PARENTS[row] == spine else PARENTS[row] for row in kept]
    bones = BONES[kept] * (np.arange(len(kept)) > 0)[:, None]
    parents = tuple(kept.index(row) if row >= 0 else -1 for row in above)
    skeleton = Skeleton(tuple(JOINTS[row] for row in kept), parents, bones)
    motion = walking()
    clip = resample(Clip(skeleton, motion.local[:, kept], motion.root[:, None], 30.0), 60.0)
    known = Observation.from_gaps(clip, [Gap(200, 290)])
    done = complete(clip, known, registry.get("small"))
    assert "what repeats itself every 1.0 s goes on in it" in done.report.gaps[0].notes
    pin = Pin("Hips", (289,), ((0.0, 0.9, 20.0),))
    pinned = complete(clip, replace(known, pins=(pin,)), registry.get("small"))
    assert not any("repeats itself" in note for note in pinned.report.gaps[0].notes)
    monkeypatch.setattr(repeating, "carried_on", lambda seen, told, said, bones: (said, {}))
    alone = complete(clip, known, registry.get("small"))
    assert not any("repeats itself" in note for note in alone.report.gaps[0].notes)
    hand = skeleton.index("LeftHand")
    ours, theirs = (
        np.linalg.norm((one.clip.positions() - clip.positions())[200:290, hand], axis=-1).mean()
        for one in (done, alone)
    )
    assert ours < 0.6 * theirs
