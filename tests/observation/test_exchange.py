"""Limbs that were taken for each other: found, and put back to the last bit."""

from __future__ import annotations

import numpy as np
import pytest

from interpose import formats, tasks
from interpose.observation.exchange import Flip, exchanges, put_back
from interpose.observation.scan import scan, to_gaps

LEG, ARM = ("UpLeg", "Leg", "Foot", "ToeBase"), ("Shoulder", "Arm", "ForeArm", "Hand")


def swapped(clip, parts, *ranges):
    left, right = ([clip.skeleton.index(side + part) for part in parts] for side in ("Left", "Right"))
    rotation = clip.rotation.copy()
    for start, stop in ranges:
        rotation[start:stop, left + right] = clip.rotation[start:stop, right + left]
    return clip.with_motion(rotation, clip.translation)


@pytest.mark.parametrize("parts", [LEG, ARM])
@pytest.mark.parametrize("ranges", [[(60, 65)], [(80, 104)], [(60, 75), (120, 170)]])
def test_limbs_are_found_and_put_back_exactly(cmu_walk, parts, ranges):
    clip = cmu_walk.slice(1, 209)
    odd = swapped(clip, parts, *ranges)
    found = exchanges(odd)
    assert [(one.start, one.stop) for one in found] == ranges
    assert put_back(odd, found).rotation.tobytes() == clip.rotation.tobytes()
    said = [one for one in scan(odd) if one.kind == "exchanged"]
    assert [(one.start, one.stop) for one in said] == ranges
    assert to_gaps(said) == []


def test_recover_puts_them_back_and_says_so(cmu_walk):
    clip = cmu_walk.slice(1, 209)
    done = tasks.recover(swapped(clip, LEG, (80, 104)))
    others = {one.joint for one in done.report.moments}
    kept = [joint for joint, name in enumerate(clip.skeleton.names) if name not in others]
    assert np.array_equal(done.clip.rotation[:, kept], clip.rotation[:, kept])
    assert {one.joint for one in done.report.exchanged} == {
        s + part for s in ("Left", "Right") for part in LEG
    }
    assert all(one.frames == ("80:104",) for one in done.report.exchanged)
    assert "80:104" in str(done.report)
    assert (done.provenance[80:104, clip.skeleton.index("LeftLeg")] > 0).all()


def test_denoise_puts_them_back_and_says_so(cmu_walk):
    clip = cmu_walk.slice(1, 209)
    odd = swapped(clip, LEG, (80, 104))
    done = tasks.denoise(odd, frames=(50, 150))
    off = np.linalg.norm(done.clip.positions() - clip.positions(), axis=-1)
    assert off.max() < 0.03
    assert {at for one in done.report.exchanged for at in one.frames} == {"80:104"}
    assert "put back" in str(done.report)
    assert tasks.denoise(odd, 0).clip.rotation.tobytes() == odd.rotation.tobytes()


@pytest.mark.parametrize("name", ["cmu_walk.bvh", "cmu_run.bvh", "cmu_jump.bvh"])
def test_nothing_is_exchanged_in_real_clips(data, name):
    assert exchanges(formats.load(data / name)) == []


def test_what_changes_sides_for_good_is_left(cmu_walk):
    """Of one change alone nobody knows which side of it is the wrong one."""
    clip = cmu_walk.slice(1, 209)
    assert exchanges(swapped(clip, LEG, (100, len(clip)))) == []


@pytest.mark.parametrize(
    "limb", [("RightUpLeg", "RightLeg", "RightFoot"), ("LeftArm", "LeftForeArm", "LeftHand")]
)
@pytest.mark.parametrize("part", [(60, 64), (90, 150)])
def test_a_knee_that_bends_the_other_way_is_found_and_turned_back(cmu_walk, limb, part):
    """Ankle and foot are where they were: what interpolates the thigh alone throws them about."""
    clip = cmu_walk.slice(1, 209)
    joints = tuple(clip.skeleton.index(name) for name in limb)
    odd = put_back(clip, [Flip(*part, joints)])
    off = np.abs(odd.positions() - clip.positions())
    assert off[:, joints[2]].max() < 1e-9
    assert off[part[0] : part[1], joints[1]].max() > 0.02
    (found,) = exchanges(odd)
    assert (found.start, found.stop, found.kind) == (*part, "flipped")
    done = tasks.recover(odd)
    assert np.abs(done.clip.positions() - clip.positions())[:, joints].max() < 1e-9
    (said,) = [one for one in scan(odd) if one.kind == "flipped"]
    assert said.joints == (limb[0], limb[2])
