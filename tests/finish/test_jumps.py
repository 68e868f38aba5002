"""How far velocities may jump inside of gaps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import interpose
from interpose import Gap, Observation
from interpose.clip import Clip
from interpose.finish import jumps, notes, seams
from interpose.finish.span import Span
from interpose.geometry import rotations


def with_a_sword(clip: Clip) -> Clip:
    """The clip with a blade of a metre in the right hand, across the forearm."""
    skeleton, hand = clip.skeleton, clip.skeleton.index("RightHand")
    longer = replace(
        skeleton,
        names=(*skeleton.names, "Sword"),
        parents=(*skeleton.parents, hand),
        rest_translation=np.append(skeleton.rest_translation, [[0.0, 0.0, 1.0]], axis=0),
        rest_rotation=np.append(skeleton.rest_rotation, [[1.0, 0, 0, 0]], axis=0),
        rest_scale=np.append(skeleton.rest_scale, 1.0),
    )
    still = np.broadcast_to([1.0, 0, 0, 0], (len(clip), 1, 4))
    rotation = np.append(clip.rotation, still, axis=1)
    return Clip(longer, rotation, clip.translation, clip.fps, clip.translated)


def test_what_is_held_in_a_hand_does_not_say_how_the_body_may_jump(cmu_walk):
    armed, count = with_a_sword(cmu_walk), len(cmu_walk.skeleton)
    most = []
    for clip in (cmu_walk, armed):
        known = Observation.full(clip)
        limits = seams.limits(clip, known)
        limits[:] = limits[:count].min()
        most.append(jumps.peak_limits(clip, known, limits))
    np.testing.assert_allclose(most[1][:count], most[0])
    assert most[1][-1] > 1.3 * most[0].max()


def test_who_stands_before_keys_does_not_say_how_he_walks_through_them(cmu_walk):
    """Ten still frames are no measure: networks' motion gave way to splines."""
    frames = [60] * 10 + list(range(60, 181))
    clip, keys = cmu_walk.take(frames), [9, 39, 69, 100, 130]
    done = interpose.between(clip, keys)
    assert {gap.method for gap in done.report.gaps} == {"base"}
    assert all(gap.seam_after <= gap.seam_limit for gap in done.report.gaps)
    # Where he stands velocities may jump as little as ever.
    assert done.report.gaps[0].seam_limit < 5
    off = np.linalg.norm(done.clip.positions() - clip.positions(), axis=-1).mean()
    spline = interpose.between(clip, keys, method="spline").clip
    assert off < 0.9 * np.linalg.norm(spline.positions() - clip.positions(), axis=-1).mean()


def test_a_moment_of_motion_does_not_say_how_far_velocities_may_jump(cmu_walk):
    """Inside of gaps: a second of it does."""
    known, calm = Observation.full(cmu_walk.slice(0, 40)), np.full(len(cmu_walk.skeleton), 1e-4)
    still = cmu_walk.take([60] * 40)
    for frames, most in ((10, jumps.wild(still.skeleton)), (40, jumps.SETS_OFF)):
        found = jumps.peak_limits(still.slice(0, frames), known.slice(0, frames), calm) * still.fps**2
        assert found == pytest.approx(most)
    assert jumps.wild(still.skeleton) > 1.5 * jumps.SETS_OFF


def test_what_jumps_at_a_lone_key_is_said_and_softened(cmu_walk):
    """Where no other frame is known nothing else tells."""
    gaps = [Gap(0, 60), Gap(61, len(cmu_walk))]
    known = Observation.from_gaps(cmu_walk, gaps)
    rotation = cmu_walk.rotation.copy()
    later = np.arange(1, 21)
    turn = rotations.about("X", 0.2 * later * np.exp(-later / 6))
    leg = cmu_walk.skeleton.index("LeftUpLeg")
    rotation[61:81, leg] = rotations.multiply(rotation[61:81, leg], turn)
    kinked = cmu_walk.with_motion(rotation, cmu_walk.translation)
    size = np.linalg.norm(seams.jumps(kinked, known, np.array([60])), axis=-1).max() * 900
    assert size > jumps.wild(cmu_walk.skeleton)
    assert "at frame 60" in notes.wild(kinked, known, gaps[0], 0)[0]
    assert "at frame 160" in notes.wild(kinked, known, gaps[1], 100)[0]
    for _ in range(3):
        for span in (Span(0, 60, "any"), Span(61, 120, "any")):
            jumps.soften(kinked, known, span, None, lambda clip: {})
    size = np.linalg.norm(seams.jumps(kinked, known, np.array([60])), axis=-1).max() * 900
    assert size < jumps.wild(cmu_walk.skeleton)


def test_a_hand_that_is_lost_all_along_makes_no_lone_keys_of_other_seams(cmu_walk):
    arm = ("RightArm", "RightForeArm", "RightHand")
    alone, beside = (
        interpose.fill(cmu_walk, [Gap(90, 130, arm), *more], method="linear").report.gaps
        for more in ((), (Gap(60, 160, ("LeftHand",)),))
    )
    seam = next(gap for gap in beside if gap.start == 90)
    assert seam.seam_limit == pytest.approx(alone[0].seam_limit, rel=0.2)
    assert seam.seam_after <= jumps.SLACK * seam.seam_limit
    seen = Observation.from_gaps(
        cmu_walk, [Gap(90, 130, arm), Gap(131, 140, arm), Gap(60, 160, ("LeftHand",))]
    )
    lone = seams.lone(cmu_walk, seen, np.array([89, 130]))
    hands = [cmu_walk.skeleton.index(side + "Hand") for side in ("Right", "Left")]
    assert lone[:, hands].tolist() == [[False, False], [True, False]]


def test_an_arm_that_whips_back_is_seen_among_frames_that_jitter(cmu_walk):
    """At 120 fps what markers jitter by is far more of a jump, from frame to frame, than what an arm does."""
    clip = interpose.resample(cmu_walk, 120)
    known = Observation.from_gaps(clip, [Gap(100, 160)])
    jitter = np.random.default_rng(0).normal(scale=0.01, size=clip.translation.shape)
    noisy = clip.with_motion(
        clip.rotation, clip.translation + np.where(known.frames[:, None, None], jitter, 0)
    )
    limits = seams.limits(noisy, known)
    bounds, span = jumps.Bounds.of(noisy, known, limits), Span(100, 160, "any")
    assert jumps.whips(noisy, known, span, bounds, 0)[0][0] <= jumps.SLACK

    arm, away = clip.skeleton.index("LeftArm"), np.abs(np.arange(len(clip)) - 130)
    turned = rotations.about("Y", 1.2 * np.clip(1 - away / 8, 0, 1))
    rotation = noisy.rotation.copy()
    rotation[:, arm] = rotations.multiply(rotation[:, arm], turned)
    whips = noisy.with_motion(rotation, noisy.translation)
    assert jumps.excess(whips, known, span, bounds, 0)[0] <= jumps.SLACK, (
        "by the frame it is no more than that"
    )
    ((excess, words, frame),) = jumps.whips(whips, known, span, bounds, 0)
    assert excess > jumps.SLACK
    assert "over 4 frames" in words
    assert abs(frame - 130) <= 4


def test_a_whip_is_not_blamed_on_what_jitters_from_frame_to_frame(cmu_walk):
    """Over as many frames as the hand takes to whip the elbow, which is known, hardly jumps."""
    clip = interpose.resample(cmu_walk, 120)
    known = Observation.from_gaps(clip, [Gap(100, 160, ("LeftForeArm", "LeftHand"))])
    jitter = np.random.default_rng(0).normal(scale=0.0005, size=clip.translation.shape)
    elbow, away = clip.skeleton.index("LeftForeArm"), np.abs(np.arange(len(clip)) - 130)
    rotation = clip.rotation.copy()
    bent = rotations.about("Y", np.clip((5 - away) / 3, 0, 1))
    rotation[:, elbow] = rotations.multiply(rotation[:, elbow], bent)
    whips = clip.with_motion(rotation, clip.translation + jitter)
    bounds = jumps.Bounds.of(whips, known, seams.limits(whips, known))
    ((excess, words, _),) = jumps.whips(whips, known, Span(100, 160, "any"), bounds, 0)
    assert excess > jumps.SLACK
    assert "LeftHand" in words or "Index" in words or "Thumb" in words
    assert "hangs" not in words


def test_what_jumps_as_what_carries_it_is_not_blamed_for_it(cmu_walk):
    """A knee that is lost while the hip, which is known, jumps by 30 cm and back."""
    translation = cmu_walk.translation.copy()
    translation[80:83, 0, 1] += 0.3
    jolted, knee = cmu_walk.with_motion(cmu_walk.rotation, translation), ("LeftLeg", "LeftFoot")

    def flags(clip):
        (gap,) = interpose.fill(clip, [Gap(60, 100, knee)]).report.gaps
        return [note for note in gap.notes if "velocity jumps" in note]

    (told,) = flags(jolted)
    assert told.endswith("there")
    assert "; LeftLeg, from which it hangs, and which is measured, jumps" in told
    assert not flags(cmu_walk)
