"""Joints of another clip inside of a gap: the arm of a jump in a walk."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import interpose
from interpose.geometry import measures, rotations
from interpose.observation import Gap, Observation, Part
from interpose.observation.part import lay
from interpose.skeletons.humanoid import reflect

ARM = ("RightArm", "RightForeArm", "RightHand")


@pytest.fixture
def part(data):  # type: ignore[no-untyped-def]
    return Part(interpose.load(data / "cmu_jump.bvh"), 40, 48, 85, ARM)


def turned_there(clip, part):  # type: ignore[no-untyped-def]
    joints = [clip.skeleton.index(name) for name in part.joints]
    return clip.rotation[part.at : part.at + part.stop - part.start, joints]


@pytest.mark.parametrize("method", ["spline", "cae", "cmib"])
def test_the_arm_is_the_other_s_and_the_body_the_method_s(cmu_walk, part, method):
    done = interpose.fill(cmu_walk, "75:105", method=method, parts=part)
    given = part.clip.rotation[40:48, [part.clip.skeleton.index(name) for name in ARM]]
    assert turned_there(done.clip, part).tobytes() == given.tobytes()
    outside = np.r_[0:75, 105:209]
    assert done.clip.rotation[outside].tobytes() == cmu_walk.rotation[outside].tobytes()
    plain = interpose.fill(cmu_walk, "75:105", method=method)
    joints = [i for i, name in enumerate(cmu_walk.skeleton.names) if not name.startswith(("Right", "RThumb"))]
    if {gap.method for gap in done.report.gaps} == {method}:
        # Feet are held once more, on a body that hardly differs.
        assert rotations.angle(done.clip.rotation, plain.clip.rotation)[:, joints].max() < 0.1
    hand = cmu_walk.skeleton.index("RightHand")
    jumps = measures.acceleration(done.clip.positions()[:, hand])[73:106]
    own = measures.acceleration(part.clip.positions()[:, part.clip.skeleton.index("RightHand")])
    assert jumps.max() < 1.5 * own.max(), "no harder than the other clip's arm itself"


def test_on_a_body_that_is_known_the_arm_points_where_it_did(cmu_walk, part):
    """As seen from where the hips face; here of a body that leans, and faces elsewhere."""
    lean = rotations.multiply(rotations.about("Y", np.array(2.0)), rotations.about("Z", np.array(0.4)))
    rotation = cmu_walk.rotation.copy()
    rotation[:, 0] = rotations.multiply(lean, rotation[:, 0])
    leaning = cmu_walk.with_motion(rotation, cmu_walk.translation)
    done = interpose.fill(leaning, [Gap(75, 105, ARM)], parts=part).clip

    def aims(clip, frames):
        turned = clip.slice(*frames).kinematics()[0]
        faces = rotations.twist_about(turned[:, 0], np.array([0.0, 1.0, 0.0]))
        arm = turned[:, [clip.skeleton.index(name) for name in ARM]]
        return rotations.multiply(rotations.conjugate(faces)[:, None], arm)

    apart = rotations.angle(aims(done, (85, 93)), aims(part.clip, (40, 48)))
    assert apart.max() < 0.02  # the T-pose, since which hips are turned, is nearly the zero pose
    others = [i for i, name in enumerate(cmu_walk.skeleton.names) if name not in ARM]
    assert done.rotation[:, others].tobytes() == leaning.rotation[:, others].tobytes()


@pytest.mark.parametrize("over", [0.4, 3.0])
def test_hips_that_rest_on_their_side_face_as_others_do(cmu_walk, part, over):
    """As LAFAN1's, of which to lean is to turn about the vertical; and an arm does not whip where a body
    rolls over, as it would by the line of the hips."""
    side = rotations.about("Z", np.array(2.1))

    def reframed(clip):  # type: ignore[no-untyped-def]
        rotation = clip.rotation.copy()
        rotation[:, 0] = rotations.multiply(rotation[:, 0], side)
        below = [joint for joint, parent in enumerate(clip.skeleton.parents) if parent == 0]
        rotation[:, below] = rotations.multiply(rotations.conjugate(side), rotation[:, below])
        rest = clip.skeleton.rest_translation.copy()
        rest[below] = rotations.rotate(rotations.conjugate(side), rest[below])
        turned = clip.skeleton.rest_rotation.copy()
        turned[0] = side
        turned[below] = rotations.conjugate(side)
        skeleton = replace(clip.skeleton, rest_translation=rest, rest_rotation=turned)
        return replace(clip, skeleton=skeleton, rotation=rotation, source=None)

    roll = rotations.about("Z", over * np.linspace(0, 1, len(cmu_walk)) ** 2)
    rotation = cmu_walk.rotation.copy()
    rotation[:, 0] = rotations.multiply(roll, rotation[:, 0])
    rolling = cmu_walk.with_motion(rotation, cmu_walk.translation)
    aims = []
    for change in (lambda clip: clip, reframed):
        one = replace(part, clip=change(part.clip))
        done = interpose.fill(change(rolling), [Gap(75, 105, ARM)], parts=one).clip
        aims.append(done.kinematics()[0][85:93, done.skeleton.index("RightArm")])
    assert rotations.angle(*aims).max() < 1e-6
    own = part.clip.kinematics()[0][40:48, part.clip.skeleton.index("RightArm")]
    assert np.diff(aims[0], axis=0).max() < 2 * np.abs(np.diff(own, axis=0)).max() + 0.05


def test_shoulder_blades_stay_in_their_sockets(cmu_walk, part):
    """A blade that took up how the two trunks differ would leave it; the arm still points where it did."""
    joints = ("RightShoulder", *ARM)
    lean = rotations.multiply(cmu_walk.rotation[:, 0], rotations.about("Z", np.array(0.4)))
    rotation = cmu_walk.rotation.copy()
    rotation[:, 0] = lean
    leaning = cmu_walk.with_motion(rotation, cmu_walk.translation)
    done = interpose.fill(leaning, [Gap(75, 105, joints)], parts=replace(part, joints=joints)).clip
    other, mine = part.clip, done.skeleton
    blade = [clip.skeleton.index("RightShoulder") for clip in (other, done)]
    assert rotations.angle(done.rotation[85:93, blade[1]], other.rotation[40:48, blade[0]]).max() < 1e-9
    plain = interpose.fill(leaning, [Gap(75, 105, ARM)], parts=part).clip
    arm = mine.index("RightArm")
    turned = [clip.slice(85, 93).kinematics()[0][:, arm] for clip in (done, plain)]
    assert rotations.angle(*turned).max() < 1e-6


def test_what_the_gap_hid_has_no_influence(cmu_walk, part):
    rotation = cmu_walk.rotation.copy()
    rotation[75:105] = [0.5, -0.5, 0.5, 0.5]
    poisoned = cmu_walk.with_motion(rotation, cmu_walk.translation)
    one, other = (interpose.fill(clip, "75:105", parts=[part]).clip for clip in (cmu_walk, poisoned))
    assert one.rotation.tobytes() == other.rotation.tobytes()


def test_parts_that_do_not_fit_are_refused(cmu_walk, part):
    seen = Observation.from_gaps(cmu_walk, [Gap(75, 105)])
    other = part.clip
    legs = other.skeleton.rest_translation.copy()
    legs[other.skeleton.index("RightHand")] = [0.0, 0.3, 0.0]
    bent = replace(other, skeleton=replace(other.skeleton, rest_translation=legs))
    for wrong, why in (
        (replace(part, at=70), "do not lie in a gap"),
        (replace(part, at=100), "do not lie in a gap"),
        (replace(part, at=205), "do not lie in a gap"),
        (replace(part, stop=500), "no frames 40:500"),
        (replace(part, start=48), "no frames 48:48"),
        (replace(part, joints=("RightWing",)), "RightWing"),
        (replace(part, clip=replace(other, fps=60.0)), "different frame rates"),
        (replace(part, clip=bent), "RightForeArm rests differently"),
    ):
        with pytest.raises(interpose.RequestError, match=why):
            lay(cmu_walk, seen, [wrong])


def test_a_body_stands_anew_on_a_leg_that_is_laid_on_it(cmu_walk, data):
    """Be it the thigh and the knee alone: they move the foot."""
    part = Part(interpose.load(data / "cmu_jump.bvh"), 60, 68, 76, ("LeftUpLeg", "LeftLeg"))
    reports = interpose.fill(cmu_walk, (60, 100), method="small", parts=part).report.gaps
    assert max(gap.foot_slide or 0.0 for gap in reports) < 32
    assert not any("slide" in note for gap in reports for note in gap.notes)


def test_a_part_of_a_mirror_image_points_as_its_original_does(cmu_walk):
    """Left-handed axes are those of the mirror image: there bodies turn the other way."""
    turn = rotations.about("Y", np.array(1.2))
    rotation = cmu_walk.rotation.copy()
    rotation[:, 0] = rotations.multiply(turn, rotation[:, 0])
    other = cmu_walk.with_motion(rotation, cmu_walk.translation)
    arm = ("LeftArm", "LeftForeArm", "LeftHand")

    def laid(clip, other):  # type: ignore[no-untyped-def]
        part = Part(other, 100, 130, 60, arm)
        return interpose.fill(clip, [Gap(55, 95, arm)], method="spline", parts=[part]).clip.positions()

    there = laid(reflect(cmu_walk), reflect(other)) * [-1.0, 1.0, 1.0]
    assert np.abs(there - laid(cmu_walk, other)).max() < 1e-6


def test_two_parts_give_no_joint_twice_and_lie_in_any_order(cmu_walk, data):
    """Also where the one begins with frames that lead on from what is known."""
    jump, gap = interpose.load(data / "cmu_jump.bvh"), [Gap(85, 145, ARM)]
    two = [Part(jump, 40, 70, 85, ARM), Part(jump, 0, 6, 85, ARM)]
    for parts in (two, two[::-1]):
        with pytest.raises(interpose.RequestError, match="two poses of Right"):
            interpose.fill(cmu_walk, gap, parts=parts)
    two = [Part(jump, 40, 70, 85, ARM), Part(jump, 10, 30, 115, ARM)]
    one, other = (interpose.fill(cmu_walk, gap, parts=parts).clip for parts in (two, two[::-1]))
    assert np.array_equal(one.rotation, other.rotation)


def test_a_part_beside_known_frames_is_led_to_and_from(cmu_walk, data):
    """As long as the gap it is laid in, it would pop at both ends, and no gap would be left to tell of it."""
    jump, hand = interpose.load(data / "cmu_jump.bvh"), cmu_walk.skeleton.index("RightHand")
    pasted = cmu_walk.rotation.copy()
    joints = [cmu_walk.skeleton.index(name) for name in ARM]
    pasted[85:115, joints] = jump.rotation[40:70, joints]

    def pops(clip):
        return measures.acceleration(clip.positions()[:, hand])[82:118].max()

    done = interpose.fill(cmu_walk, [Gap(85, 115, ARM)], parts=Part(jump, 40, 70, 85, ARM))
    assert [(gap.start, gap.stop) for gap in done.report.gaps] == [(85, 91), (109, 115)]
    assert pops(done.clip) < 0.4 * pops(cmu_walk.with_motion(pasted, cmu_walk.translation))
    two = [Part(jump, 40, 70, 85, ARM), Part(jump, 10, 40, 115, ARM)]
    done = interpose.fill(cmu_walk, [Gap(75, 155, ARM)], parts=two)
    assert [(gap.start, gap.stop) for gap in done.report.gaps] == [(75, 85), (115, 121), (145, 155)]
