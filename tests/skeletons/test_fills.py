"""The network fills any humanoid on its own skeleton, and what is untouched is written back as it was."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.skeletons import rigs

from interpose import formats, tasks
from interpose.finish import feet
from interpose.geometry import rotations
from interpose.observation import Gap, Observation
from interpose.resampling import resample
from interpose.skeletons import JOINTS, find_humanoid

GAP = Gap(60, 90)


@pytest.mark.parametrize("rig", rigs.RIGS)
def test_filled_and_written_back(cmu_walk, rig, tmp_path):
    clip, _ = rigs.build(rig, cmu_walk)
    formats.save(clip, tmp_path / "take.bvh")
    take = formats.load(tmp_path / "take.bvh")
    done = tasks.fill(take, [GAP], "cae")
    (report,) = done.report.gaps
    assert report.method == "cae", report
    formats.save(done.clip, tmp_path / "filled.bvh")
    before, after = ((tmp_path / name).read_text().splitlines() for name in ("take.bvh", "filled.bvh"))
    changed = [i for i, (a, b) in enumerate(zip(before, after, strict=True)) if a != b]
    first = before.index(next(line for line in before if line.startswith("Frame Time"))) + 1
    assert changed == list(range(first + GAP.start, first + GAP.stop))
    size = find_humanoid(take).scale
    wrong = np.linalg.norm(done.clip.positions() - take.positions(), axis=-1)[GAP.start : GAP.stop].mean()
    assert wrong * size < 0.06, "metres of a grown body"
    assert report.seam_after <= report.seam_limit


def test_fingers_and_faces_go_on_smoothly(cmu_walk):
    """What the network does not know is carried along: no faster than it is elsewhere."""
    clip, expected = rigs.build("mixamo", cmu_walk)
    done = tasks.fill(clip, [GAP], "cae").clip
    known = set(expected.values())
    extra = [j for j, name in enumerate(clip.skeleton.names) if name not in known]
    assert len(extra) > 30
    speed = rotations.angle(done.rotation[1:, extra], done.rotation[:-1, extra])
    elsewhere = np.delete(speed, slice(GAP.start - 1, GAP.stop), axis=0).max()
    assert speed[GAP.start - 1 : GAP.stop].max() < 2 * elsewhere + 1e-3


def _rescaled(clip, factors, size):  # type: ignore[no-untyped-def]
    """The same motion by a body with other bones, on the same floor: {part of a name: factor}."""
    bones = clip.skeleton.rest_translation * size
    for joint, name in enumerate(clip.skeleton.names):
        for part, factor in factors.items():
            if name.endswith(part):
                bones[joint] *= factor
    made = replace(
        clip,
        skeleton=replace(clip.skeleton, rest_translation=bones),
        translation=clip.translation * size,
        source=None,
    )
    soles = [clip.skeleton.index(name) for name in ("LeftToeBase", "RightToeBase")]
    floor = np.percentile(clip.positions()[:, soles, 1].min(axis=1), 5) * size
    lift = made.positions()[:, soles, 1].min(axis=1) - clip.positions()[:, soles, 1].min(axis=1) * size
    made.translation[:, 0, 1] -= np.median(lift)
    return made, floor


@pytest.mark.parametrize(
    ("factors", "size"),
    [
        ({}, 0.5),
        ({}, 1.6),
        ({"Arm": 1.4, "ForeArm": 1.4, "Hand": 1.4}, 1.0),
        ({"Leg": 0.85, "Foot": 0.85}, 1.0),
        ({"Leg": 1.2, "Foot": 1.2, "Spine": 0.8}, 1.0),
    ],
    ids=["child", "giant", "long arms", "short legs", "long legs"],
)
def test_other_proportions_neither_slide_nor_float(cmu_walk, factors, size):
    clip, floor = _rescaled(cmu_walk, factors, size)
    known = Observation.from_gaps(clip, [GAP])
    done = tasks.fill(clip, [GAP], "cae")
    (report,) = done.report.gaps
    assert report.method == "cae", report
    slide, travel = feet.measure(clip, known, GAP.start, GAP.stop)
    assert report.foot_slide <= max(1.2 * slide, 5.0 * size)
    assert report.foot_travel >= 0.7 * travel
    joints = feet.ends(clip.skeleton)
    true, filled = (c.positions()[GAP.start : GAP.stop, joints, 1].min(axis=1) for c in (clip, done.clip))
    assert np.abs(filled - true).max() < 0.05 * size, "the lowest joint stays near its height"
    assert filled.min() > min(floor, true.min()) - 0.03 * size


@pytest.mark.parametrize("height", [-3.0, 12.0])
def test_floors_that_are_not_at_zero(cmu_walk, height):
    moved = cmu_walk.with_motion(cmu_walk.rotation, cmu_walk.translation + np.array([0, height, 0]))
    one, other = (tasks.fill(clip, [GAP], "cae").clip for clip in (cmu_walk, moved))
    assert np.abs(other.positions() - one.positions() - [0, height, 0]).max() < 1e-3


@pytest.mark.parametrize("fps", [24, 48, 90, 240])
def test_any_frame_rate_keeps_what_is_beside_the_gap(cmu_walk, fps):
    clip = resample(cmu_walk, fps)
    shaken = clip.with_motion(clip.rotation.copy(), clip.translation)
    shaken.rotation[::2, 5] = rotations.multiply(
        shaken.rotation[::2, 5], rotations.exp(np.array([0.01, 0, 0]))
    )
    start, stop = round(2 * fps), round(3 * fps)
    done = tasks.fill(shaken, [Gap(start, stop)], "cae")
    assert done.report.gaps[0].method == "cae"
    assert done.clip.fps == fps
    for part in (slice(0, start), slice(stop, None)):
        assert done.clip.rotation[part].tobytes() == shaken.rotation[part].tobytes()
    wrong = np.linalg.norm(done.clip.positions() - clip.positions(), axis=-1)[start:stop]
    assert wrong.mean() < 0.06


@pytest.mark.parametrize("method", ["small", "cae"])
def test_a_key_counts_wherever_it_lies_between_the_networks_frames(cmu_walk, method):
    """At 120 fps three of four frames are none of a network's."""
    clip = resample(cmu_walk, 120)
    errors = []
    for key in (300, 301, 302, 303):
        done = tasks.fill(clip, [Gap(240, key), Gap(key + 1, 360)], method)
        assert {gap.method for gap in done.report.gaps} == {method}
        off = np.linalg.norm(done.clip.positions() - clip.positions(), axis=-1)
        errors.append(100 * off[240:360].mean())
    assert max(errors) < 1.3 * min(errors), errors


def test_a_gap_begins_without_a_step_between_the_networks_frames(cmu_walk):
    """Where the last known frame is none of its, what it says of the next one fits to it all the same."""
    clip = resample(cmu_walk, 120)
    for start in (240, 241, 242, 243):
        done = tasks.fill(clip, [Gap(start, start + 100)], "small").clip
        jump = np.linalg.norm(np.diff(done.positions(), 2, axis=0), axis=-1).max(axis=1)
        assert jump[start - 2 : start + 1].max() < 2 * np.percentile(jump, 95)


def test_a_guessed_skeleton_is_filled_as_a_named_one(cmu_walk):
    clip, _ = rigs.build("smpl", cmu_walk)
    nameless = replace(clip, skeleton=replace(clip.skeleton, names=tuple(f"b{j}" for j in range(24))))
    one, other = (tasks.fill(c, [GAP], "cae") for c in (clip, nameless))
    assert other.report.gaps[0].method == "cae"
    assert np.linalg.norm(one.clip.positions() - other.clip.positions(), axis=-1).max() < 0.05
    assert len(JOINTS) == 22
