"""Who lies, crawls or falls stays on the floor, and nothing else is changed by it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.skeletons.rigs import under_root

from interpose import fill
from interpose.finish import complete, feet, floor
from interpose.formats import load
from interpose.geometry import measures, rotations
from interpose.geometry.ground import turn
from interpose.methods.protocol import Raw
from interpose.observation import Gap, Observation

GAP = Gap(70, 110)


class Said:
    """A method that says a given motion."""

    name = "said"

    def __init__(self, clip):
        self.clip = clip

    def refuses(self, clip, gap):
        return None

    def complete(self, clip, observation, seed=None):
        return Raw(self.clip)


@pytest.fixture
def lying(cmu_walk):
    """A body that lies still on its front."""
    rotation = np.broadcast_to(cmu_walk.rotation[60], cmu_walk.rotation.shape).copy()
    rotation[:, 0] = rotations.multiply(rotations.about("X", np.array(np.pi / 2)), rotation[:, 0])
    return cmu_walk.with_motion(rotation, np.zeros_like(cmu_walk.translation))


def sunk(clip, by=0.12):
    """The same, under the floor in the middle of the gap."""
    time = np.arange(len(clip))
    wave = np.clip((time - GAP.start + 1) / 20, 0, 1) * np.clip((GAP.stop - time) / 20, 0, 1)
    translation = clip.translation.copy()
    translation[:, 0, 1] -= by * np.sin(np.pi / 2 * wave) ** 2
    return clip.with_motion(clip.rotation, translation)


def test_a_body_under_the_floor_is_lifted_smoothly_with_its_bones_and_all_that_is_known(lying):
    seen, said = Observation.from_gaps(lying, [GAP]), sunk(lying)
    done = complete(lying, seen, Said(said))
    inside = slice(GAP.start, GAP.stop)
    before, after = (floor.depth(one, seen)[0][inside].max() for one in (said, done.clip))
    assert before > 0.11
    assert after < 0.03
    assert not any("under the floor" in note for note in done.report.gaps[0].notes)
    assert done.report.gaps[0].method == "said"
    for at in (slice(0, GAP.start), slice(GAP.stop, None)):
        assert done.clip.rotation[at].tobytes() == lying.rotation[at].tobytes()
    jumps = [measures.acceleration(one.positions())[inside].max() for one in (said, done.clip)]
    assert jumps[1] < jumps[0] + 0.005
    # As little as it takes: what was above the floor is where it was but for what hangs on the rest.
    moved = np.linalg.norm(done.clip.positions() - said.positions(), axis=-1)[inside]
    assert moved.max() < 0.15


def test_who_is_above_the_floor_is_not_touched(lying, cmu_walk):
    for clip in (lying, cmu_walk):
        seen = Observation.from_gaps(clip, [GAP])
        assert floor.lifted(clip, seen, (GAP.start, GAP.stop)) is clip


def test_feet_of_who_stands_tell_the_floor_where_enough_is_known(cmu_walk):
    """Two keys may both be in the air; three are not."""
    seen, low = Observation.from_gaps(cmu_walk, [GAP]), sunk(cmu_walk)
    before, last = Gap(0, GAP.start - 1), len(cmu_walk)
    keys = Observation.from_gaps(cmu_walk, [before, GAP, Gap(GAP.stop + 1, last)])
    more = Observation.from_gaps(cmu_walk, [before, GAP, Gap(GAP.stop + 1, 140), Gap(141, last)])
    deepest = []
    for known in (seen, keys, more):
        deep, joints = floor.depth(low, known)
        ends = [joints.index(joint) for joint in feet.ends(cmu_walk.skeleton)]
        deepest.append(deep[GAP.start : GAP.stop, ends].max())
    assert deepest[0] > 0.08
    assert deepest[1] <= 0
    assert deepest[2] > 0.08


def test_toes_go_no_lower_than_toes_are_known_to(lying):
    """Though another joint lies 8 cm deeper: knees on which a body kneels may be under the floor."""
    toe = lying.skeleton.index("RightToeBase")
    heights = lying.positions()[0, :, 1]
    assert heights[toe] - heights.min() == pytest.approx(0.08, abs=0.01)
    deep, joints = floor.depth(sunk(lying, 0.3), Observation.from_gaps(lying, [GAP]))
    assert deep[:, joints.index(toe)].max() == pytest.approx(0.3, abs=1e-3)


@pytest.mark.parametrize(("length", "held"), [(0.17, False), (0.6, True)])
def test_fingers_stay_above_the_floor_with_the_hand_and_what_a_hand_holds_does_as_it_likes(
    lying, length, held
):
    skeleton = lying.skeleton
    hand, finger = skeleton.index("LeftHand"), skeleton.index("LeftHandIndex1")
    bones = skeleton.rest_translation.copy()
    bones[finger] *= length / np.linalg.norm(bones[finger])
    lying = replace(lying, skeleton=replace(skeleton, rest_translation=bones), source=None)
    # In the middle of the gap the hand bends down, and its finger into the floor.
    turned, placed = lying.kinematics()
    down = rotations.between(placed[0, finger] - placed[0, hand], np.array([0.0, -1.0, 0.0]))
    share = np.zeros(len(lying))
    share[GAP.start : GAP.stop] = np.sin(np.linspace(0, np.pi, len(GAP))) ** 2
    rotation, above = lying.rotation.copy(), turned[:, skeleton.parents[hand]]
    bent = rotations.multiply(rotations.slerp(rotations.identity(), down, share), turned[:, hand])
    rotation[:, hand] = rotations.multiply(rotations.conjugate(above), bent)
    said, seen = lying.with_motion(rotation, lying.translation), Observation.from_gaps(lying, [GAP])
    assert placed[..., 1].min() - said.positions()[:, finger, 1].min() > 0.06
    done = floor.lifted(said, seen, (GAP.start, GAP.stop))
    if held:
        assert done is said
        return
    after = done.positions()
    assert placed[..., 1].min() - after[:, finger, 1].min() < 0.03
    assert np.linalg.norm(after[:, hand] - said.positions()[:, hand], axis=-1).max() < 0.12
    notes = complete(lying, seen, Said(said)).report.gaps[0].notes
    assert not any("under the floor" in note for note in notes)


def test_where_the_floor_is_and_which_way_a_body_faces_makes_no_difference(lying):
    def elsewhere(clip):
        rotation, translation = clip.rotation.copy(), turn(clip.translation, np.array(1.0))
        translation += [3.0, 1.5, 2.0]
        rotation[:, 0] = rotations.multiply(rotations.about("Y", np.array(1.0)), rotation[:, 0])
        return clip.with_motion(rotation, translation)

    seen, span = Observation.from_gaps(lying, [GAP]), (GAP.start, GAP.stop)
    here = floor.lifted(sunk(lying), seen, span)
    there = floor.lifted(elsewhere(sunk(lying)), seen, span)
    np.testing.assert_allclose(there.positions(), elsewhere(here).positions(), atol=1e-6)


def test_an_upper_body_stands_at_height_0_or_tells_no_floor(cmu_walk):
    """Of legs that are lost all along: the lowest joint that is known is the hips."""
    legs = tuple(name for name in cmu_walk.skeleton.names if "Leg" in name or "Foot" in name or "Toe" in name)
    seen = Observation.from_gaps(cmu_walk, [Gap(0, len(cmu_walk), legs)])
    whole, low, high = (0, len(cmu_walk)), np.array([0.0, -0.12, 0.0]), np.array([0.0, 1.0, 0.0])
    assert floor.lifted(cmu_walk, seen, whole) is cmu_walk
    under, above = (
        cmu_walk.with_motion(cmu_walk.rotation, cmu_walk.translation + way) for way in (low, high)
    )
    assert under.positions()[..., 1].min() < -0.1
    assert floor.lifted(under, seen, whole).positions()[..., 1].min() > -0.03
    # Who is upstairs may be anywhere.
    far = cmu_walk.with_motion(cmu_walk.rotation, cmu_walk.translation + 10 * low)
    assert floor.lifted(above, seen, whole) is above
    assert floor.lifted(far, seen, whole) is far


def test_where_little_is_free_a_body_is_lifted_until_it_is_out_of_the_floor(lying):
    """Hips may turn and nothing else: one lift of what is held by all else is too little."""
    seen, span = Observation.full(lying), (GAP.start, GAP.stop)
    seen.rotation[slice(*span), 0] = False
    time = np.arange(len(lying))
    wave = np.clip((time - GAP.start + 1) / 20, 0, 1) * np.clip((GAP.stop - time) / 20, 0, 1)
    rotation = lying.rotation.copy()
    tilt = rotations.about("X", -0.8 * np.sin(np.pi / 2 * wave) ** 2)
    rotation[:, 0] = rotations.multiply(tilt, rotation[:, 0])
    low = lying.with_motion(rotation, lying.translation)
    once = floor.higher(low, seen, *_asked(low, seen))
    deep = [floor.depth(one, seen)[0].max() for one in (low, once, floor.lifted(low, seen, span))]
    assert deep[0] > 0.4
    assert deep[1] > 0.1
    assert deep[2] < 0.07


def _asked(clip, seen):
    deep, joints = floor.depth(clip, seen)
    return joints, np.maximum(deep - floor.SINK, 0.0)


@pytest.mark.parametrize("rooted", [False, True])
@pytest.mark.parametrize(("name", "gap", "most"), [("cmu_walk", (80, 130), 3.6), ("cmu_jump", (40, 80), 3.0)])
def test_a_pose_that_is_known_but_for_its_hips_turn_faces_as_the_body_does(data, name, gap, most, rooted):
    clip = load(data / f"{name}.bvh")
    clip = under_root(clip, goes=False) if rooted else clip
    done = fill(clip, [Gap(*gap, ("Hips",))], method="small-open").clip
    inside = slice(*gap)
    off = 100 * np.linalg.norm(done.positions() - clip.positions(), axis=-1)[inside]
    assert off.mean() < most, "it was 3.7 and 5.0 when the pose was laid on hips of another"
    feet_of = feet.ends(clip.skeleton)
    assert done.positions()[inside][:, feet_of, 1].min() > clip.positions()[:, feet_of, 1].min() - 0.03


def test_poses_of_one_jump_are_no_three(cmu_walk):
    """Seven frames in the air, one after another, tell no floor."""
    low = sunk(cmu_walk)
    seen = Observation.from_gaps(cmu_walk, [Gap(0, GAP.start - 4), GAP, Gap(GAP.stop + 4, len(cmu_walk))])
    deep, joints = floor.depth(low, seen)
    ends = [joints.index(joint) for joint in feet.ends(cmu_walk.skeleton)]
    assert deep[GAP.start : GAP.stop, ends].max() <= 0
