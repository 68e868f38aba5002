"""What no body does is mended, or said: a walk, and methods that say something else of single joints."""

from __future__ import annotations

import numpy as np
import pytest
from tests.skeletons import rigs

import interpose
from interpose.finish import anatomy, complete
from interpose.geometry import rotations
from interpose.methods.classical import Linear, Spline
from interpose.methods.protocol import Raw
from interpose.observation import Gap, Observation
from interpose.skeletons import JOINTS, find_humanoid
from interpose.skeletons.humanoid import reflect

GAP = Gap(70, 110)
INSIDE = slice(GAP.start, GAP.stop)


class Turning:
    """A spline, but for one joint that turns by so many degrees about an axis, frame by frame of the gap."""

    name = "turning"

    def __init__(self, joint: str, axis: str, degrees: np.ndarray) -> None:
        self.joint, self.turn = joint, rotations.about(axis, np.radians(degrees))

    def refuses(self, clip, gap):
        return None

    def complete(self, clip, observation, seed=None):
        done = Spline().complete(clip, observation).clip
        body = find_humanoid(done)
        rotation, joint = done.rotation.copy(), done.skeleton.index(self.joint)
        # About an axis of the T-pose of the whole body.
        rest = body.rest.rotation[body.mapping.joints.index(joint)]
        own = rotations.multiply(rotations.conjugate(rest), rotations.multiply(self.turn, rest))
        rotation[INSIDE, joint] = rotations.multiply(rotation[INSIDE, joint], own)
        return Raw(done.with_motion(rotation, done.translation))


def filled(clip, method, **options):
    return complete(clip, Observation.from_gaps(clip, [GAP]), method, **options)


def hill(height):
    """From nothing to so many degrees, and back."""
    return height * np.sin(np.linspace(0, np.pi, len(GAP)))


def test_a_motion_with_a_knee_inside_out_is_not_taken(cmu_walk):
    """Where there is another one; a spline is no better, and the knee is told of."""
    (other,) = filled(cmu_walk, Turning("LeftLeg", "Y", hill(170)), fallback=Linear()).report.gaps
    assert other.method == "linear"
    assert "filled by linear instead: a knee turns inside out" in other.notes[0]
    (own,) = filled(cmu_walk, Turning("LeftLeg", "Y", hill(170))).report.gaps
    assert own.method == "turning"
    assert [note for note in own.notes if "flagged: a knee turns inside out" in note]
    (well,) = filled(cmu_walk, Turning("LeftLeg", "Y", hill(40)), fallback=Linear()).report.gaps
    assert (well.method, [note for note in well.notes if "knee" in note]) == ("turning", [])


@pytest.mark.parametrize("make", [lambda clip: clip, reflect])
def test_knees_do_not_bend_forwards(cmu_walk, make):
    method = Turning("LeftLeg", "X", -hill(100))
    raw = make(method.complete(cmu_walk, Observation.from_gaps(cmu_walk, [GAP])).clip)
    clip = make(cmu_walk)
    method.complete = lambda *_: Raw(raw)
    done = filled(clip, method)

    def bend(some):
        return anatomy.knees(find_humanoid(clip).rotations(some))[1][INSIDE, 0].min()

    assert bend(raw) < -20
    assert bend(done.clip) > -5
    assert done.report.gaps[0].method == "turning"


def test_a_knee_that_bends_backwards_is_said_to(cmu_walk):
    gap, shin = Gap(60, 90), cmu_walk.skeleton.index("LeftLeg")
    known = Observation.from_gaps(cmu_walk, [gap])
    assert anatomy.bent_back(cmu_walk, known, gap, 0) == []
    for back, said in ((4.0, []), (12.0, ["flagged: LeftLeg bends backwards by 12 degrees at frame 175"])):
        body = find_humanoid(cmu_walk)
        turned = body.rotations(cmu_walk)
        thigh, leg = (JOINTS.index(name) for name in ("LeftUpLeg", "LeftLeg"))
        turned[75, leg] = rotations.multiply(turned[75, thigh], rotations.about("X", np.radians(-back)))
        rotation = cmu_walk.rotation.copy()
        done = body.to_clip(turned, body.root(cmu_walk), cmu_walk)
        rotation[75, shin] = done.rotation[75, shin]
        bent = cmu_walk.with_motion(rotation, cmu_walk.translation)
        assert anatomy.bent_back(bent, known, gap, 100) == said


def test_a_joint_that_whirls_goes_the_short_way(cmu_walk):
    degrees = 360.0 * np.clip((np.arange(len(GAP)) - 18) / 4, 0, 1)
    done = filled(cmu_walk, Turning("RightHand", "Y", degrees))
    joint = done.clip.skeleton.index("RightHand")
    turned = done.clip.rotation[:, joint]
    rate = np.degrees(rotations.angle(turned[1:], turned[:-1])) * cmu_walk.fps
    assert rate[GAP.start - 1 : GAP.stop].max() < 1500
    assert not [note for note in done.report.gaps[0].notes if "degrees a second" in note]
    others = np.arange(len(cmu_walk.skeleton)) != joint
    plain = filled(cmu_walk, Spline()).clip
    np.testing.assert_allclose(done.clip.rotation[:, others], plain.rotation[:, others], atol=1e-6)


@pytest.mark.parametrize(("joint", "most"), [("Head", 640), ("Spine1", 280), ("RightUpLeg", 900)])
def test_a_trunk_turns_slower_than_a_hand(cmu_walk, joint, most):
    """Seventy degrees there and back in four frames, which a hand may."""
    there = 70.0 * np.interp(np.arange(len(GAP)), [16, 18, 20], [0, 1, 0])
    rates = []
    for method in (Turning(joint, "Y", there), Turning("RightHand", "Y", there)):
        clip = filled(cmu_walk, method).clip
        turned = clip.rotation[:, clip.skeleton.index(method.joint)]
        rates.append(np.degrees(rotations.angle(turned[1:], turned[:-1]))[INSIDE].max() * cmu_walk.fps)
    assert rates[0] < most < 1000 < rates[1]


def twice_round():
    """Nothing to 720 degrees, as smoothly as can be."""
    share = np.linspace(0, 1, len(GAP))
    return 720 * share**2 * (3 - 2 * share)


def about_the_vertical(clip, degrees):
    """The clip with the body turned by so many degrees (F,) more, about the vertical through the hips."""
    body, turn = find_humanoid(clip), rotations.about("Y", np.radians(degrees))
    return body.to_clip(rotations.multiply(turn[:, None], body.rotations(clip)), body.root(clip), clip)


@pytest.mark.parametrize("make", [lambda clip: clip, reflect])
@pytest.mark.parametrize("lone", [False, True])
def test_a_body_that_spins_takes_its_time(cmu_walk, make, lone):
    """Hips stay where they are, and joints against them; nothing outside of the gap changes."""
    clip = make(about_the_vertical(cmu_walk, 100 * np.clip((np.arange(len(cmu_walk)) - 86) / 3, 0, 1)))
    gaps = [GAP, Gap(0, GAP.start - 1), Gap(GAP.stop + 1, len(clip))][: 3 if lone else 1]
    known = Observation.from_gaps(clip, gaps)
    done = anatomy.unspun(clip, known)

    def fastest(some):
        return np.degrees(np.abs(np.diff(anatomy.turning(some)))).max() * clip.fps

    assert fastest(clip) > 900
    assert fastest(done) < 320
    np.testing.assert_allclose(done.root, clip.root, atol=1e-9)
    hips = clip.skeleton.index("Hips")
    others = [joint for joint in range(len(clip.skeleton)) if joint != hips]
    np.testing.assert_allclose(done.rotation[:, others], clip.rotation[:, others], atol=1e-6)
    outside = np.ones(len(clip), bool)
    outside[INSIDE] = False
    assert (done.rotation[outside] == clip.rotation[outside]).all()
    assert fastest(filled(clip, Spline()).clip) < 320, "nothing is known of the truth within the gap"


def steadily(clip, rate, frames):
    """The clip with a body that turns about the vertical at so many degrees a second more, in some frames."""
    turns = np.zeros(len(clip))
    turns[frames] = rate / clip.fps
    return about_the_vertical(clip, np.cumsum(turns))


def test_who_turns_fast_where_it_is_seen_may_do_so_where_it_is_not(cmu_walk):
    clip = steadily(cmu_walk, 800.0, slice(None))
    assert anatomy.unspun(clip, Observation.from_gaps(clip, [GAP])) is clip


def test_nothing_tells_at_an_end_of_a_clip_which_way_to_turn(cmu_walk):
    for gap in (Gap(0, 40), Gap(90, len(cmu_walk))):
        clip = steadily(cmu_walk, 800.0, slice(gap.start + 10, gap.stop - 10))
        assert anatomy.unspun(clip, Observation.from_gaps(clip, [gap])) is clip


@pytest.mark.parametrize("hand", [False, True])
def test_a_body_may_turn_faster_amid_motion_than_between_lone_keys(cmu_walk, hand):
    """Whatever else is lost: it is the hips whose motion tells."""
    # The walk itself turns there by 120 degrees a second, the other way.
    clip = steadily(cmu_walk, -480.0, slice(GAP.start + 10, GAP.stop - 10))
    beside = [Gap(0, GAP.start - 1), Gap(GAP.stop + 1, len(clip))]
    lost = [Gap(0, len(clip), ("LeftHand",))] * hand
    assert anatomy.unspun(clip, Observation.from_gaps(clip, [GAP, *lost])) is clip
    done = anatomy.unspun(clip, Observation.from_gaps(clip, [GAP, *beside, *lost]))
    assert done is not clip


def test_what_is_evened_keeps_its_ends():
    """However often it is slowed: else its ends would take the speed of its middle. Degrees a second."""
    rate = np.repeat([50.0, 460.0, 50.0], [15, 25, 15]) / 30
    yaw = np.concatenate([[0.0], np.cumsum(rate)])
    even = anatomy._evened(yaw, 300 / 30, 30.0, (50 / 30, 50 / 30))
    done = 30 * np.diff(even)
    assert even[[0, -1]] == pytest.approx(yaw[[0, -1]])
    assert done.max() < 350
    assert done[[0, -1]].max() < 110
    # What has no time to be slowed is left.
    hurried = np.arange(30) * 600.0 / 30
    assert (anatomy._evened(hurried, 300 / 30, 30.0, (0.0, 0.0)) == hurried).all()


def test_a_body_that_spins_too_often_is_said_to(cmu_walk):
    """It is not mended: which way it is to go only another key tells."""
    done = filled(cmu_walk, Turning("Hips", "Y", twice_round()))
    assert [note for note in done.report.gaps[0].notes if "Hips turns by" in note]
    done = filled(cmu_walk, Turning("Hips", "Y", np.linspace(0, 360, len(GAP))))
    assert [note for note in done.report.gaps[0].notes if "which is meant" in note]
    assert not [note for note in filled(cmu_walk, Spline()).report.gaps[0].notes if "turn" in note]


def test_joints_that_never_turn_stay_as_they_are(cmu_walk):
    """Toes of some rigs, and what hangs between hips and thighs."""
    rotation = cmu_walk.rotation.copy()
    toe, shoulder = (cmu_walk.skeleton.index(name) for name in ("LeftToeBase", "LeftShoulder"))
    rotation[:, [toe, shoulder]] = rotation[0, [toe, shoulder]]
    clip = cmu_walk.with_motion(rotation, cmu_walk.translation)
    done = filled(clip, Turning("LeftToeBase", "X", hill(40)))
    np.testing.assert_allclose(
        done.clip.rotation[:, [toe, shoulder]], rotation[:, [toe, shoulder]], atol=1e-6
    )
    moves = filled(cmu_walk, Turning("LeftToeBase", "X", hill(40))).clip.rotation[INSIDE, toe]
    assert np.abs(moves - rotation[INSIDE, toe]).max() > 0.1


def test_what_never_turns_nearby_and_does_elsewhere_turns_in_a_gap(cmu_walk):
    """All of the take is asked: of a neck that is held still for some seconds around the gap, say."""
    neck, frames = cmu_walk.skeleton.index("Neck"), [*range(209), *range(209)]
    clip = cmu_walk.take(frames)
    clip.rotation[10:200, neck] = clip.rotation[10, neck]

    class Nodding(Spline):
        name = "nodding"

        def complete(self, clip, observation, seed=None):
            done = super().complete(clip, observation, seed).clip
            free = ~observation.rotation[:, neck]
            nod = np.radians(20) * np.sin(np.linspace(0, np.pi, free.sum())) ** 2
            done.rotation[free, neck] = rotations.multiply(
                done.rotation[free, neck], rotations.about("X", nod)
            )
            return Raw(done)

    done = interpose.fill(clip, GAP, method=Nodding()).clip
    assert np.ptp(done.rotation[INSIDE, neck], axis=0).max() > 0.1


def test_hips_that_their_root_turns_are_not_at_rest(cmu_walk):
    """3ds Max's Biped turns its root, and the pelvis below never against it: what a network says of how the
    body turns was thrown away, and fills erred by 1.6 times as much."""
    plain, biped = (rigs.build(name, cmu_walk)[0] for name in ("mixamo", "biped"))
    pelvis = biped.skeleton.index("Bip01_Pelvis")
    assert np.ptp(biped.rotation[:, pelvis], axis=0).max() < 1e-9
    still = anatomy.still(biped, Observation.full(biped))
    assert not still[[0, pelvis]].any()
    off = []
    for clip in (plain, biped):
        body = find_humanoid(clip)
        done = interpose.fill(clip, (60, 100), method="small").clip
        apart = body.positions(done) - body.positions(clip)
        off.append(np.linalg.norm(apart, axis=-1)[60:100].mean())
    assert off[1] < 1.3 * off[0]


def test_what_never_turns_is_not_at_rest_where_nothing_of_it_is_known(cmu_walk):
    """In the middle of a gap that is longer than what is looked at once: there a method says it."""
    toe = cmu_walk.skeleton.index("LeftToeBase")
    long = cmu_walk.take([*range(209), *range(207, -1, -1)])
    long = long.joined([long, long, long, long])
    long.rotation[:, toe] = rotations.exp(np.array([0.6, 0.0, 0.0]))
    still = anatomy.still(long, Observation.full(long))
    assert still[toe]
    window = Observation.from_gaps(long, [Gap(0, len(long), ("LeftToeBase",))])
    assert not anatomy.locked(window, still).rotation[:, toe].any()
    assert anatomy.locked(Observation.full(long), still).rotation[:, toe].all()


def test_a_joint_of_which_nothing_else_is_known_keeps_the_motion_that_a_method_gives_it(cmu_walk):
    """In less than two seconds a spline over all of it would be the rest pose, which does not whirl."""
    clip = cmu_walk.slice(40, 62)
    known = Observation.from_gaps(clip, [Gap(0, 22, ("Spine",))])
    spine = clip.skeleton.index("Spine")
    degrees = np.where(np.arange(22) < 11, 0.0, 120.0)
    turned = rotations.multiply(clip.rotation[:, spine], rotations.about("X", np.radians(degrees)))

    class Stepping(Spline):
        def complete(self, clip, observation, seed=None):
            done = super().complete(clip, observation, seed).clip
            done.rotation[:, spine] = turned
            return Raw(done)

    done = complete(clip, known, Stepping()).clip
    assert rotations.angle(done.rotation[[2, 20], spine], turned[[2, 20]]).max() < 0.1


def test_nobody_is_told_to_key_what_comes_next(cmu_walk):
    """A body that spins at the end of a clip, where a forecast goes on, and within it."""
    method = Turning("Hips", "Y", twice_round())
    inside, ahead = (filled(clip, method) for clip in (cmu_walk, cmu_walk.slice(0, GAP.stop)))
    said = [
        [note for note in done.report.gaps[0].notes if "Hips turns by" in note] for done in (inside, ahead)
    ]
    assert [note[0].endswith("help") for note in said] == [True, False]
