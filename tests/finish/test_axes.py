"""Joints that turn about one axis."""

import numpy as np
import pytest

import interpose
from interpose.finish.axes import Axes
from interpose.geometry import rotations
from interpose.observation import Gap, Observation

HINGES = {"Leg", "ToeBase", "ForeArm"}
INSIDE = slice(60, 120)


def off_axis(clip, joint: int, true) -> float:
    """Degrees by which a joint turns about any axis but that of the true motion."""
    zero = rotations.conjugate(true.rotation[:1, joint])
    turns = rotations.log(rotations.multiply(true.rotation[:, joint], zero))
    axis = np.linalg.svd(turns)[2][0]
    turn = rotations.multiply(clip.rotation[:, joint], zero)
    return float(np.degrees(rotations.angle(rotations.twist_about(turn, axis), turn).max()))


@pytest.fixture
def known(cmu_walk) -> Observation:
    return Observation.from_gaps(cmu_walk, [Gap(INSIDE.start, INSIDE.stop)])


def test_found_in_what_is_known(cmu_walk, known):
    """Those that CMU's files turn about one axis, and no other; as few poses as ten tell."""
    names = cmu_walk.skeleton.names
    single = Axes.of(cmu_walk, known, None).single
    assert {names[joint].removeprefix("Left").removeprefix("Right") for joint in single} <= HINGES
    assert {"LeftLeg", "RightLeg", "LeftForeArm", "RightForeArm"} <= {names[joint] for joint in single}
    assert not Axes.of(cmu_walk, Observation.from_gaps(cmu_walk, [Gap(9, len(cmu_walk))]), None).single


def test_held_where_it_is_missing(cmu_walk):
    done = interpose.fill(cmu_walk, [Gap(INSIDE.start, INSIDE.stop)]).clip
    for joint in Axes.of(cmu_walk, Observation.from_gaps(cmu_walk, []), None).single:
        assert off_axis(done, joint, cmu_walk) < 0.01, cmu_walk.skeleton.names[joint]


def test_what_hangs_from_it_stays(cmu_walk, known):
    """Where the thigh is free the ankle is where it was, but for what the leg is longer, and the foot is
    turned as it was; where it is known it stays."""
    knee, thigh, foot = (cmu_walk.skeleton.index(name) for name in ("LeftLeg", "LeftUpLeg", "LeftFoot"))
    bent = cmu_walk.rotation.copy()
    aside = rotations.exp(np.radians([0.0, 3.0, 4.0]))
    bent[INSIDE, knee] = rotations.multiply(bent[INSIDE, knee], aside)
    motion = cmu_walk.with_motion(bent, cmu_walk.translation)
    axes = Axes.of(cmu_walk, known, None)

    free = axes.held(motion, known)
    assert off_axis(free, knee, cmu_walk) < 1e-3 < off_axis(motion, knee, cmu_walk)
    moved = np.linalg.norm((free.positions() - motion.positions())[INSIDE, foot], axis=-1)
    assert moved.max() < 0.005
    turned = rotations.angle(free.kinematics()[0], motion.kinematics()[0])[:, foot]
    assert turned.max() < 1e-6

    rotation = known.rotation.copy()
    rotation[:, thigh] = True
    kept = axes.held(motion, Observation(rotation, known.translation))
    np.testing.assert_allclose(kept.rotation[:, thigh], motion.rotation[:, thigh], atol=1e-12)
    assert off_axis(kept, knee, cmu_walk) < 1e-3
    assert np.linalg.norm((kept.positions() - motion.positions())[INSIDE, foot], axis=-1).max() > 0.005
