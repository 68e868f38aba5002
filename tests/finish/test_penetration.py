"""A body that goes into itself is measured and said."""

from __future__ import annotations

import numpy as np
import pytest

from interpose.finish import complete, penetration
from interpose.finish.penetration import LIMIT, deepest, depths, segment_distance
from interpose.geometry import rotations
from interpose.methods import registry
from interpose.observation import Gap, Observation
from interpose.skeletons import find_mapping


def test_distances_of_segments_against_a_search():
    rng = np.random.default_rng(0)
    p, q, r, s = rng.normal(size=(4, 50, 3))
    s[0], q[1] = r[0], p[1]  # a point
    s[2] = r[2] + 2 * (q[2] - p[2])  # parallel
    share = np.linspace(0, 1, 201)[:, None]
    for i, found in enumerate(segment_distance(p, q, r, s)):
        one, other = p[i] + share * (q[i] - p[i]), r[i] + share * (s[i] - r[i])
        slow = np.linalg.norm(one[:, None] - other, axis=-1).min()
        assert slow - 0.02 < found <= slow + 1e-9


@pytest.fixture
def through(cmu_walk):  # type: ignore[no-untyped-def]
    """The left arm swings through the trunk in frames 60 to 79; a function makes it so on any clip."""

    def make(clip):  # type: ignore[no-untyped-def]
        joint = find_mapping(clip.skeleton)
        turned, placed = clip.kinematics()
        rotation = clip.rotation.copy()
        arm, hand, spine = (joint[n] for n in ("LeftArm", "LeftHand", "Spine1"))
        turn = rotations.between(placed[:, hand] - placed[:, arm], placed[:, spine] - placed[:, arm])
        above = turned[:, clip.skeleton.parents[arm]]
        turn = rotations.multiply(rotations.conjugate(above), rotations.multiply(turn, above))
        rotation[60:80, arm] = rotations.multiply(turn, rotation[:, arm])[60:80]
        return clip.with_motion(rotation, clip.translation)

    return make


def test_an_arm_through_the_trunk_is_said_and_real_motion_is_not(cmu_walk, through):
    assert deepest(cmu_walk, 20, 180)[1] == ""
    depth, words = deepest(through(cmu_walk), 50, 90)
    assert depth > LIMIT
    assert "left forearm" in words
    assert "into the trunk at frame" in words
    assert 60 <= int(words.split()[-1]) < 80
    window = through(cmu_walk).slice(40, 100)
    assert deepest(window, 10, 50, first=40)[1] == words
    assert deepest(through(cmu_walk), 70, 78)[1] == "", "as deep in the frames beside it"


@pytest.mark.parametrize(("seconds", "said"), [(1.3, False), (3.0, True)])
def test_what_is_as_deep_within_two_seconds_beside_is_no_news(cmu_walk, through, seconds, said):
    """A body that is stout there is stout here; what happens later tells nothing of it."""
    back = np.r_[0:209, 207:0:-1]
    clip = through(cmu_walk.with_motion(cmu_walk.rotation[back], cmu_walk.translation[back]))
    later = round(80 + seconds * clip.fps)
    rotation = clip.rotation.copy()
    rotation[later : later + 20] = clip.rotation[60:80]
    words = deepest(clip.with_motion(rotation, clip.translation), 50, 85)[1]
    assert bool(words) == said


def test_depth_turns_and_scales_with_the_body(cmu_walk, through):
    clip = through(cmu_walk)
    before = depths(clip.skeleton, clip.positions())[1]
    turn = rotations.about("Y", np.array(1.0))
    turned = depths(clip.skeleton, rotations.rotate(turn, clip.positions()) + 3.0)[1]
    assert np.allclose(before, turned, atol=1e-9)


def test_the_report_says_it(cmu_walk, through, monkeypatch):
    spline = registry.get("spline")
    seen = Observation.from_gaps(cmu_walk, [Gap(50, 90)])
    report = complete(cmu_walk, seen, spline).report.gaps[0]
    assert report.penetration is not None
    assert not any("into the" in note for note in report.notes)

    class Through:
        name = "through"
        refuses = spline.refuses

        def complete(self, clip, observation, seed=None):  # type: ignore[no-untyped-def]
            raw = spline.complete(clip, observation, seed)
            return type(raw)(through(raw.clip))

    monkeypatch.setattr(penetration, "LIMIT", 0.03)
    report = complete(cmu_walk, seen, Through(), fallback=Through()).report.gaps[0]
    assert report.penetration > 4
    assert any("into the trunk" in note for note in report.notes)
