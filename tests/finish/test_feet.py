"""Planted feet stay planted, and moving feet move."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from interpose.clip import Clip
from interpose.finish import complete, feet, guarantees, notes
from interpose.formats import load
from interpose.geometry import measures, rotations
from interpose.geometry.time import runs
from interpose.observation import Gap, Observation

STARTS = range(12, 90, 13)


def gaps_of(clip: Clip, *ranges: tuple[int, int]) -> Observation:
    return Observation.from_gaps(clip, [Gap(start, stop) for start, stop in ranges])


def both(walk, start, speaking, **kwargs):
    known = gaps_of(walk, (start, start + 30))
    [report] = complete(walk, known, speaking(walk, **kwargs)).report.gaps
    true_slide, true_travel = feet.measure(walk, known, start, start + 30)
    return report, true_slide, true_travel


@pytest.mark.parametrize("kwargs", [{"sigma": 0.02}, {"sigma": 0.03, "bias": 0.03, "scale": 1.03}])
def test_feet_slide_little_more_than_the_truth_and_travel_as_far(walk, speaking, kwargs):
    found = [both(walk, start, speaking, **kwargs) for start in STARTS]
    slide = np.mean([report.foot_slide for report, _, _ in found])
    before = np.mean([report.foot_slide_before for report, _, _ in found])
    travel = np.mean([report.foot_travel for report, _, _ in found])
    assert slide < before
    assert slide <= 1.2 * np.mean([true for _, true, _ in found])
    assert 0.8 < travel / np.mean([true for _, _, true in found]) < 1.25


def test_a_sliding_stance_is_held_where_it_is_observed(walk, speaking):
    """Everything drifts forward by 6 cm over the gap: the foot that stands through its start must not."""
    known = gaps_of(walk, (45, 75))
    joints = feet.ends(walk.skeleton)
    positions = walk.positions()[:, joints]
    planted = (measures.speed(positions, walk.fps) < 0.1) & (
        positions[..., 1] < positions[..., 1].min(axis=0) + 0.03
    )
    method = speaking(walk, sigma=0.0)
    method.positions += np.clip((np.arange(120) - 45) / 30, 0, 1)[:, None, None] * [0.0, 0.0, 0.06]
    done = complete(walk, known, method)
    loose = [(k, run) for k in range(4) for run in runs(planted[:, k]) if 45 <= run[0] < run[1] <= 70]
    through = [(k, run) for k in range(4) for run in runs(planted[:, k]) if run[0] < 45 < run[1] - 6]
    assert loose or through
    for k, (start, stop) in loose + through:
        track = done.clip.positions()[max(start, 45) : min(stop, 75), joints[k]][:, [0, 2]]
        assert np.ptp(track, axis=0).max() < 0.02


def test_a_method_that_knows_better_says_which_feet_stand(walk):
    """Feet that drift with all else are held, but for those of which it says that they do not stand."""
    known = gaps_of(walk, (45, 75))
    drift = np.clip((np.arange(120) - 45) / 30, 0, 1)[:, None, None] * [0.0, 0.0, 0.06]
    slid = walk.with_motion(walk.rotation, walk.translation + drift)
    stands = np.full((120, 4), np.nan)
    held = feet.plant(slid, known, (45, 75), stands=stands)
    assert np.abs(held.rotation - slid.rotation).max() > 1e-3
    stands[:, 2:] = 0.1
    told = feet.plant(slid, known, (45, 75), stands=stands)
    left, right = (
        [leg.thigh, leg.knee, leg.ankle] for leg in sorted(feet.legs(walk.skeleton), key=lambda leg: leg.side)
    )
    assert told.rotation[:, left].tobytes() == held.rotation[:, left].tobytes()
    shifts = [
        np.abs(one.positions() - slid.positions())[..., [0, 2]].max(axis=(0, 2)) for one in (held, told)
    ]
    assert shifts[0][right[2]] > 0.02
    assert shifts[1][right[2]] < 0.01


def test_feet_do_not_sink(walk, speaking):
    method = speaking(walk, sigma=0.0)
    method.positions[:, :, 1] -= 0.04 * np.sin(np.clip((np.arange(120) - 35) / 50, 0, 1) * np.pi)[:, None]
    known = gaps_of(walk, (35, 85))
    done = complete(walk, known, method)
    joints = feet.ends(walk.skeleton)
    positions, truth = done.clip.positions()[:, joints], walk.positions()[:, joints]
    lowest = truth[..., 1].min(axis=0)
    assert (positions[40:80, :, 1] - lowest).min() > -0.02


def test_a_partly_observed_leg_is_left_alone(walk, speaking):
    known = Observation.from_gaps(walk, [Gap(45, 75, ("LeftLeg",))])
    done = complete(walk, known, speaking(walk, sigma=0.03))
    assert done.clip.rotation[known.rotation].tobytes() == walk.rotation[known.rotation].tobytes()
    window = feet.plant(done.clip, known, (45, 75))
    assert window.rotation.tobytes() == done.clip.rotation.tobytes()


def test_reach_never_stretches_and_keeps_the_foot(walk):
    leg = feet.legs(walk.skeleton)[0]
    turned, placed = walk.kinematics()
    goal = placed[:, [leg.ankle, leg.toe]] + [0.05, 0.08, -0.04]
    bent = walk.with_motion(
        feet.reach(walk.skeleton, leg, walk.rotation, turned, placed, goal), walk.translation
    )
    assert np.abs(bent.positions()[:, leg.ankle] - goal[:, 0]).max() < 0.012
    assert np.allclose(bent.kinematics()[0][:, leg.ankle], turned[:, leg.ankle], atol=1e-6)
    far = goal - np.array([0.0, 1.0, 0.0])
    straight = walk.with_motion(
        feet.reach(walk.skeleton, leg, walk.rotation, turned, placed, far), walk.translation
    ).positions()
    way, wanted = straight[:, leg.ankle] - straight[:, leg.thigh], far[:, 0] - placed[:, leg.thigh]
    cosine = (way * wanted).sum(-1) / np.linalg.norm(way, axis=-1) / np.linalg.norm(wanted, axis=-1)
    assert cosine.min() > 0.9999


@pytest.mark.parametrize("up", [True, False])
def test_floors_need_not_be_flat(up):
    """A step inside the gap, wherever it is; a foot above it rests on one of the sides, and what differs by
    little is one floor that rises."""
    step = np.where(np.arange(120) < 70, 0.1, 0.4)
    above = step + 0.2 * np.sin(np.linspace(0, np.pi, 120))
    sinking = step - 0.015
    little = np.where(np.arange(120) < 70, 0.1, 0.16)
    heights = np.stack([step, above, sinking, little], axis=1)[:: 1 if up else -1]
    positions = np.stack([np.zeros_like(heights), heights, np.zeros_like(heights)], -1)[:, :, None]
    known = np.ones((120, 4, 1), bool)
    known[40:80] = False
    floor = feet.local_floor(positions, known, 30.0)[..., 0]
    np.testing.assert_allclose(floor[:, 0], heights[:, 0])
    assert (floor[40:80, 1] <= heights[40:80, 1] + 0.021).all()
    assert set(np.round(floor[:, 1], 1)) == {0.1, 0.4}
    np.testing.assert_allclose(floor[:, 2], heights[:, 2], atol=1e-9)
    assert (np.abs(np.diff(floor[:, 3])) < 0.002).all()


def test_nobody_stands_on_air_beside_a_step(walk):
    """Feet that the motion puts on the ground before a step of 40 cm are not lifted half way to it."""
    raised = walk.translation.copy()
    half = len(walk) // 2
    raised[half:, 0, 1] += 0.4
    clip = walk.with_motion(walk.rotation, raised)
    known = Observation.from_gaps(clip, [Gap(half - 20, half + 20)])
    held = feet.plant(clip, known, (half - 20, half + 20))
    joints = feet.pairs(clip.skeleton).ravel()
    off = held.positions()[:, joints, 1] - clip.positions()[:, joints, 1]
    assert np.abs(off[: half - 5]).max() < 0.05
    assert np.abs(off[half + 5 :]).max() < 0.05


@pytest.mark.parametrize("shown", [10, 1])
def test_a_foot_in_the_air_tells_nothing_of_the_floor(walk, shown):
    """Of a few known frames in which it is on its way: it rests where the other one does."""
    joints = feet.pairs(walk.skeleton)
    placed, whole = walk.positions()[:, joints], np.ones((len(walk), 2, 2), bool)
    true = feet.local_floor(placed, whole, walk.fps)[60]
    moving = measures.speed(placed, walk.fps).min(axis=2) > 0.8
    swings = [run for leg in (0, 1) for run in runs(moving[:, leg]) if run[1] - run[0] >= 10]
    assert swings
    for start, _ in swings:
        known = np.zeros_like(whole)
        known[start : start + shown] = True
        floor = feet.local_floor(placed, known, walk.fps)[start + shown // 2]
        assert np.abs(floor - true).max() < 0.03


def test_a_leg_that_is_never_known_stands_where_the_other_does(walk):
    """And a foot that goes through the floor is named with its frame."""
    leg = [walk.skeleton.index("Left" + part) for part in ("UpLeg", "Leg", "Foot", "ToeBase")]
    known = Observation.from_gaps(walk, [Gap(0, len(walk), tuple(walk.skeleton.names[j] for j in leg))])
    positions = walk.positions()
    joints = feet.pairs(walk.skeleton)
    floor = feet.local_floor(positions[:, joints], known.positions(walk.skeleton)[:, joints], walk.fps)
    assert np.array_equal(floor[:, 0], floor[:, 1])
    assert feet.sunk(walk, known, 0, len(walk))[0] < 0.03
    rotation = walk.rotation.copy()
    rotation[40, leg[1]] = rotations.identity()
    rotation[40, leg[2]] = rotations.multiply(rotation[40, leg[2]], rotations.about("X", np.array(1.2)))
    depth, joint, frame = feet.sunk(walk.with_motion(rotation, walk.translation), known, 0, len(walk))
    assert depth > 0.05
    assert (walk.skeleton.names[joint], frame) == ("LeftToeBase", 40)


def test_measures_of_feet():
    still = np.zeros((31, 1, 3))
    assert measures.foot_slide(still, 30.0) == 0
    assert measures.foot_travel(still) == 0
    moving = still.copy()
    moving[:, 0, 0] = np.arange(31) / 30
    assert measures.foot_slide(moving, 30.0, np.zeros(1)) == pytest.approx(100.0)
    assert measures.foot_travel(moving) == pytest.approx(1.0)
    raised = moving + np.array([0.0, 0.0125, 0.0])
    assert measures.foot_slide(raised, 30.0, np.zeros(1)) == pytest.approx(100 * (2 - 2**0.5))
    assert measures.foot_slide(moving + np.array([0.0, 0.03, 0.0]), 30.0, np.zeros(1)) == 0


def test_stances_are_stiller_by_a_measure_that_lifting_cannot_better(walk, speaking, monkeypatch):
    """Slide falls when feet are raised; the speed of feet that stand in the truth does not."""
    known = gaps_of(walk, (40, 80))
    joints = feet.ends(walk.skeleton)
    truth = walk.positions()[:, joints]
    planted = (measures.speed(truth, walk.fps) < 0.15) & (truth[..., 1] < truth[..., 1].min(axis=0) + 0.03)
    planted[:40] = planted[80:] = False
    sliding = truth + np.linspace(0, 1.0, len(walk))[:, None, None] * [1.0, 0.0, 0.0]
    raised = sliding + np.array([0.0, 0.03, 0.0])
    low = truth[..., 1].min(axis=0)
    assert measures.foot_slide(raised, walk.fps, low) < 0.5 * measures.foot_slide(sliding, walk.fps, low)
    assert measures.stance_speed(raised, planted, walk.fps) == measures.stance_speed(
        sliding, planted, walk.fps
    )

    held = complete(walk, known, speaking(walk, sigma=0.03)).clip.positions()[:, joints]
    monkeypatch.setattr(feet, "plant", lambda clip, *_, **__: clip)
    loose = complete(walk, known, speaking(walk, sigma=0.03)).clip.positions()[:, joints]
    still, moving = (measures.stance_speed(p, planted, walk.fps) for p in (held, loose))
    assert still < 0.8 * moving


def test_a_foot_lets_go_before_its_leg_is_straight(cmu_walk):
    """Held until the leg is straight, its knee would snap when the foot leaves."""
    leg = feet.legs(cmu_walk.skeleton)[0]
    placed = np.repeat(cmu_walk.positions()[[64]], 60, axis=0)
    length = sum(
        np.linalg.norm(placed[0, b] - placed[0, a]) for a, b in ((leg.thigh, leg.knee), (leg.knee, leg.ankle))
    )
    down = np.array([0.0, -1.0, 0.0])
    shift = np.zeros((60, 2, 3))
    # As far as half a leg is nothing to it; at frame 40 more than all of it is asked for.
    shift[:, :] = (placed[0, leg.thigh] + 0.5 * length * down - placed[0, leg.ankle])[None, None]
    shift[40, :] = placed[0, leg.thigh] + 1.1 * length * down - placed[0, leg.ankle]
    share = feet._let_go(leg, placed, shift, 5.0)
    assert share[40] < 0.01
    np.testing.assert_allclose(share[[0, 20, 59]], 1.0, atol=1e-6)
    assert np.abs(np.diff(share)).max() < 0.5


def test_a_leg_that_pushes_off_lifts_its_heel_for_its_toe_to_stay(cmu_walk):
    """As long as the hips are beyond the toe: the foot stays as long as it is, the knee as bent as it was."""
    placed = cmu_walk.positions()
    for leg in feet.legs(cmu_walk.skeleton):
        hip, ankle, toe = (placed[:, joint] for joint in (leg.thigh, *leg.foot))
        on = ((hip - toe) * (toe - ankle) * [1, 0, 1]).sum(axis=1)
        back = np.where(np.arange(3) == 1, 0.0, ankle - toe)
        back *= 0.06 / np.linalg.norm(back, axis=1, keepdims=True)
        shift = np.stack([back, back], axis=1)
        up = feet._heel_up(leg, placed, shift)
        now, goal, stays = ankle + shift[:, 0], ankle + shift[:, 0] + up, toe + shift[:, 1]
        np.testing.assert_allclose(*(np.linalg.norm(some - stays, axis=1) for some in (goal, now)), atol=1e-9)
        assert np.abs(up[on < -0.02]).max() < 1e-9, "heels land first"
        pushes = on > 0.02
        asked, less, own = (np.linalg.norm(some - hip, axis=1)[pushes] for some in (now, goal, ankle))
        further = asked > own + 0.02
        assert further.sum() >= 10
        np.testing.assert_allclose(less[further], own[further], atol=0.01)
        assert (up[pushes][further, 1] > 0).all()
        np.testing.assert_allclose(feet._heel_up(leg, placed, 0 * shift), 0.0, atol=1e-9)


def test_a_foot_that_swivels_is_not_led_through_itself(walk):
    """Who turns half round on the spot in a second, without a step: ankle and toe stand at both ends, and
    straight ways from there to there cross."""
    ankles = walk.positions()[:, [leg.ankle for leg in feet.legs(walk.skeleton)]]
    frames = np.full(61, np.linalg.norm(ankles[:, 0] - ankles[:, 1], axis=-1).argmin())
    share = np.clip((np.arange(61) - 15) / 30, 0, 1)
    about = np.zeros((61, 3))
    about[:, 1] = np.pi * 0.99 * share**2 * (3 - 2 * share)
    still = walk.with_motion(walk.rotation[frames], walk.translation[frames])
    centre = still.positions()[0, feet.ends(walk.skeleton)].mean(axis=0) * [1.0, 0.0, 1.0]
    spun = still.with_motion(still.rotation.copy(), still.translation.copy())
    spun.rotation[:, 0] = rotations.multiply(rotations.exp(about), still.rotation[:, 0])
    spun.translation[:, 0] = rotations.rotate(rotations.exp(about), still.translation[:, 0] - centre) + centre
    held = feet.plant(spun, gaps_of(spun, (1, 60)), (1, 60)).positions()
    for leg in feet.legs(walk.skeleton):
        ahead = (held[:, leg.toe] - held[:, leg.ankle])[:, [2, 0]]
        turned = np.degrees(np.diff(np.unwrap(np.arctan2(ahead[:, 1], ahead[:, 0]))))
        assert np.abs(turned).max() < 25.0


def contact(start: int, stop: int, off: float, tied: tuple[bool, bool] = (False, False)) -> feet.Contact:
    return feet.Contact(start, stop, start, stop - 1, np.tile([off, 0.0, 0.0], (60, 1)), tied)


def test_a_foot_does_not_leap_from_one_contact_to_the_next():
    first, near, far, later = (
        contact(10, 30, 0.1),
        contact(31, 40, 0.13),
        contact(31, 40, 0.4),
        contact(45, 55, 0.4),
    )
    tied = contact(31, 40, 0.4, (False, True))
    for second, kept in ((near, [first, near]), (far, [first]), (later, [first, later]), (tied, [tied])):
        assert feet._apart([first, second], 30.0) == kept


def test_ankle_and_toe_are_held_as_one_foot():
    """The toe stands from observed frames on and glides away from there by 30 cm; in the midst of it the
    ankle is slow, too: held where it is by then it would go back and forth by a quarter of a metre."""
    glide = np.zeros((90, 2, 3))
    glide[:, :, 2] = np.interp(np.arange(90), [20, 60], [0.0, 0.3])[:, None]
    glide[:, 1, 2] += 0.15
    planted = np.zeros((90, 2), bool)
    planted[5:60, 1] = planted[35:45, 0] = True
    movable = np.arange(90) >= 10
    feet_held = glide + feet._hold(
        glide, planted, measures.speed(glide, 30.0) < feet.STILL, movable, 30.0, 4.5
    )
    np.testing.assert_allclose(feet_held[10:47, 1, 2], 0.15, atol=0.01)
    apart = np.linalg.norm(feet_held[:, 1] - feet_held[:, 0], axis=-1)
    assert np.abs(apart - 0.15).max() < 0.11
    # Those of one foot may differ by what a foot turns by.
    for off, kept in ((0.08, [1, 1]), (0.2, [0, 1])):
        ankle, toe = contact(20, 30, 0.0), contact(10, 50, off)
        assert [len(held) for held in feet._in_one([[ankle], [toe]])] == kept


@pytest.mark.parametrize("seam", [0, 20])
def test_a_long_way_to_where_a_foot_is_held_takes_longer(seam):
    """30 cm, for a foot that slides towards where it stands in known frames after the gap."""
    glide = np.zeros((100, 2, 3))
    glide[:, :, 2] = np.interp(np.arange(100), [20, 80], [0.3, 0.0])[:, None]
    planted = np.zeros((100, 2), bool)
    planted[20:] = True
    movable = (np.arange(100) >= seam) & (np.arange(100) < 80)
    shift = feet._hold(glide, planted, measures.speed(glide, 30.0) < feet.STILL, movable, 30.0, 4.5)
    np.testing.assert_allclose((glide + shift)[45:, :, 2], 0.0, atol=0.01)
    assert not shift[:seam].any()
    assert np.abs(np.diff(shift[..., 2], axis=0)).max() * 30 < 2.2 * feet.RUSH


def test_a_contact_of_one_frame_is_none(walk):
    """A method that doubts whether feet stand from frame 55 on, but for one frame: that one changes nothing
    (it made feet leave at once)."""
    known, drift = gaps_of(walk, (45, 75)), np.clip((np.arange(120) - 45) / 30, 0, 1)[:, None, None]
    slid = walk.with_motion(walk.rotation, walk.translation + drift * [0.0, 0.0, 0.06])
    stands = np.full((120, 4), 0.9)
    stands[55:] = 0.1
    without = feet.plant(slid, known, (45, 75), stands=stands)
    stands[56] = 0.9
    assert feet.plant(slid, known, (45, 75), stands=stands).rotation.tobytes() == without.rotation.tobytes()


@pytest.mark.parametrize("sure", [True, False])
def test_a_foot_that_surely_stands_at_a_lone_key_stands_there_before(walk, sure):
    """It comes to the key at .4 m/s, which has no speed of its own: held where the key has it, and not where
    it is in the mean, if the method is sure that it stands."""
    pose = walk.slice(64, 65)
    glide = np.zeros((41, 1, 3))
    glide[:, 0, 2] = np.interp(np.arange(41), [33, 40], [-0.4 * 7 / 30, 0.0])
    clip = pose.with_motion(
        np.repeat(pose.rotation, 41, axis=0), np.repeat(pose.translation, 41, axis=0) + glide
    )
    known = Observation.from_gaps(clip, [Gap(0, 40)])
    held = feet.plant(clip, known, (0, 40), stands=np.full((41, 4), 0.95 if sure else 0.6))
    [low, _] = sorted(feet.legs(clip.skeleton), key=lambda leg: clip.positions()[0, leg.toe, 1])
    off = np.abs((held.positions() - held.positions()[40])[30:40, low.toe, 2]).max()
    assert off < 0.01 if sure else off > 0.03


def test_one_foot_is_held_if_the_other_one_is_better_off_as_it_is(walk, speaking, monkeypatch):
    """Both were left to slide where holding them made the two slide more."""
    known, held = gaps_of(walk, (40, 80)), feet.plant

    def worse(clip, *rest, only=None, **options):
        done = held(clip, *rest, only=only, **options)
        if only != 0:
            return done
        shaken = np.where(known.frames, 0.0, 0.1 * (np.arange(len(clip)) % 2))
        return done.with_motion(done.rotation, done.translation + shaken[:, None, None] * [1.0, 0.0, 0.0])

    monkeypatch.setattr(feet, "plant", worse)
    one = complete(walk, known, speaking(walk, sigma=0.03)).clip
    monkeypatch.setattr(feet, "plant", lambda clip, *_, **__: clip)
    none = complete(walk, known, speaking(walk, sigma=0.03)).clip
    moved = np.abs(one.rotation - none.rotation).max(axis=(0, 2))
    left, right = feet.legs(walk.skeleton)
    assert moved[left.thigh] < 1e-4 < 1e-2 < moved[right.thigh]


def test_a_foot_is_held_more_softly_where_its_leg_jumps_further_than_legs_do(walk, monkeypatch):
    """Though it does not jump as far as it may in any gap: firmly held, a thigh is torn aside for a frame."""
    known, held = gaps_of(walk, (40, 80)), feet.plant
    leg, anything = feet.legs(walk.skeleton)[0], np.full(len(walk.skeleton), 1.0)
    usual = guarantees._usual(walk, known, anything)
    jumps = [
        measures.acceleration(walk.positions()[:, side.knee])[:38].max() for side in feet.legs(walk.skeleton)
    ]
    assert usual[leg.knee] >= max(*jumps, guarantees.STEADY / walk.fps**2) > usual[leg.knee] - 5 / walk.fps**2
    assert np.isinf(usual[0])
    tried = {}

    def tearing(clip, seen, span, blend, *rest, **options):
        done = held(clip, seen, span, blend, *rest, **options)
        rotation = done.rotation.copy()
        aside = rotations.exp(np.array([0.05 if blend == feet.BLENDS[0] else 0.001, 0.0, 0.0]))
        rotation[60, leg.thigh] = rotations.multiply(rotation[60, leg.thigh], aside)
        tried[blend] = done.with_motion(rotation, done.translation)
        return tried[blend]

    monkeypatch.setattr(feet, "plant", tearing)
    monkeypatch.setattr(feet, "measure", lambda *_: (1.0, 1.0))
    assert guarantees._hold(walk, known, (40, 80), 0, anything, usual, None) is tried[feet.BLENDS[1]]
    assert list(tried) == list(feet.BLENDS[:2])
    tried.clear()
    guarantees._hold(walk, known, (40, 80), 0, anything, anything, None)
    assert list(tried) == [feet.BLENDS[0]], "where legs jump as far nearby it is held firmly"


def test_a_leg_that_jumps_anyway_is_held_firmly_where_that_adds_next_to_nothing(walk, monkeypatch):
    """Of a walk of Bandai-Namco a foot drifted by 13 cm, for two per cent less of a jump of its own."""
    known, leg = gaps_of(walk, (40, 80)), feet.legs(walk.skeleton)[0]
    anything, tried, more = np.full(len(walk.skeleton), 1.0), [], [0.0]

    def turned(angle):
        rotation = walk.rotation.copy()
        rotation[60, leg.thigh] = rotations.multiply(
            rotation[60, leg.thigh], rotations.exp(np.array([angle, 0.0, 0.0]))
        )
        return walk.with_motion(rotation, walk.translation)

    def adding(clip, seen, span, blend, *rest, **options):
        tried.append(blend)
        return turned(0.3 + (more[0] if blend == feet.BLENDS[0] else 0.0))

    monkeypatch.setattr(feet, "plant", adding)
    monkeypatch.setattr(feet, "measure", lambda *_: (1.0, 1.0))
    usual = guarantees._usual(walk, known, anything)
    for more[0], blends in ((0.01, 1), (0.1, 2)):
        tried.clear()
        guarantees._hold(turned(0.3), known, (40, 80), 0, anything, usual, None)
        assert tried == list(feet.BLENDS[:blends])


def test_feet_that_have_taken_steps_are_not_held_where_legs_would_jump_for_it(walk, monkeypatch):
    known, leg = gaps_of(walk, (40, 80)), feet.legs(walk.skeleton)[0]
    anything = np.full(len(walk.skeleton), 1.0)
    rotation = walk.rotation.copy()
    rotation[60, leg.thigh] = rotations.multiply(
        rotation[60, leg.thigh], rotations.exp(np.array([0.3, 0, 0]))
    )
    torn = walk.with_motion(rotation, walk.translation)
    monkeypatch.setattr(feet, "plant", lambda *_, **__: torn)
    monkeypatch.setattr(feet, "measure", lambda *_: (1.0, 1.0))
    asked = (walk, known, (40, 80), 0, anything, guarantees._usual(walk, known, anything), None)
    assert guarantees._hold(*asked) is torn
    assert guarantees._hold(*asked, anyway=False) is walk


def test_feet_that_are_dragged_through_a_gap_step_as_they_do_beside_it(walk):
    known, gap = gaps_of(walk, (35, 90)), slice(35, 90)
    turned, placed = walk.kinematics()
    rotation, dragged = walk.rotation.copy(), placed[:, feet.pairs(walk.skeleton)]
    lowest = dragged[..., 1].min(axis=0)
    dragged[..., 1] = np.minimum(dragged[..., 1], lowest + 0.01)
    for number, leg in enumerate(feet.legs(walk.skeleton)):
        parts = (some[gap] for some in (rotation, turned, placed, dragged[:, number]))
        rotation[gap] = feet.reach(walk.skeleton, leg, *parts)
    low = walk.with_motion(rotation, walk.translation)
    toes = [leg.toe for leg in feet.legs(walk.skeleton)]
    done = feet.plant(low, known, (35, 90), stands=np.full((120, 4), np.nan))
    before, after = ((one.positions()[gap, toes, 1] - lowest[:, 1]).max() for one in (low, done))
    assert before < 0.035 < 0.06 < after


def test_a_stance_between_two_low_steps_is_one():
    """A foot that shuffles on at .8 m/s, stands half a second, and shuffles on: never fast, never high."""
    speed = np.repeat([0.8, 0.0, 0.8], [25, 15, 25]) / 30
    positions = np.zeros((66, 1, 3))
    positions[1:, 0, 2] = np.cumsum(speed)
    planted = feet.contacts(positions, np.zeros((66, 1)), 30.0)[:, 0]
    assert planted[27:39].all()
    assert not planted[:22].any()
    assert not planted[44:].any()


def test_a_foot_that_drifts_while_it_stands_is_told(walk):
    """One of them, by 20 cm in a second, of a body that stands: no foot slides fast."""
    pose = walk.slice(0, 1)
    clip = walk.with_motion(
        np.repeat(pose.rotation, len(walk), axis=0), np.repeat(pose.translation, len(walk), axis=0)
    )
    whole, gap = Observation.full(clip), (45, 75)
    assert feet.drifts(clip, whole, [gap])[0][0] == 0
    moved = clip.translation.copy()
    moved[:, 0, 2] += np.clip((np.arange(len(walk)) - 45) / 30, 0, 1) * 0.2
    drifting = clip.with_motion(clip.rotation, moved)
    [(way, joint, start, stop)] = feet.drifts(drifting, whole, [gap])
    assert way == pytest.approx(0.2, abs=0.02)
    assert joint in feet.ends(walk.skeleton)
    assert (start, stop) == gap
    known = gaps_of(drifting, gap)
    slide = feet.measure(drifting, known, *gap)[0]
    said = notes.skids(slide, drifting, known, Gap(*gap), 100)
    assert f"slides by {100 * way:.0f} cm while it stands, in frames 145 to 174" in said[-1]
    assert notes.skids(0.0, clip, known, Gap(*gap), 0) == []


@pytest.mark.parametrize("slide", [28.0, 32.0])
def test_feet_that_slide_fast_are_told_where_nothing_tells_what_is_usual(walk, slide):
    """A game's cycle is shorter than a second."""
    clip = walk.slice(20, 60)
    known = gaps_of(clip, (10, 36))
    said = [note for note in notes.skids(slide, clip, known, Gap(10, 36), 0) if "cm/s" in note]
    assert said == [f"flagged: feet slide at {slide:.0f} cm/s"] * (slide > 30)


@pytest.mark.parametrize(("length", "said"), [(1, 0), (4, 0), (8, 1)])
def test_between_keys_that_follow_each_other_at_once_no_foot_slides(walk, length, said):
    """Of every second frame of a walk the truth, too, may be at 70 cm/s."""
    gap = Gap(60, 60 + length)
    found = notes.skids(80.0, walk, gaps_of(walk, (gap.start, gap.stop)), gap, 0)
    assert sum("feet slide" in note for note in found) == said


@pytest.mark.parametrize("size", [0.4, 1.0, 3.0])
def test_what_is_said_of_slides_and_errors_does_not_depend_on_how_large_a_body_is(walk, size):
    skeleton = replace(walk.skeleton, rest_translation=walk.skeleton.rest_translation * size)
    clip = replace(walk, skeleton=skeleton, translation=walk.translation * size, source=None)
    known, gap = gaps_of(clip, (75, 120)), Gap(75, 120)
    leg = feet.size(clip.skeleton)

    def told(slide: float, risk: float) -> int:
        expected = np.full(len(gap), risk * leg)
        return len(notes.skids(slide * leg, clip, known, gap, 0)) + len(
            notes.doubtful(expected, clip, gap, 0)
        )

    assert told(60.0, 0.16) == 2
    assert told(10.0, 0.14) == 0


def test_who_stands_all_the_while_does_not_sink(data):
    """As far as a leg that is nearly straight allows."""
    pose = load(data / "cmu_jump.bvh").take(np.zeros(90, int))
    low = np.zeros((90, 1, 3))
    low[30:60, 0, 1] = 0.012 * np.sin(np.pi * np.linspace(0, 1, 32)[1:-1]) ** 2
    sunk = pose.with_motion(pose.rotation, pose.translation - low)
    held = feet.plant(sunk, gaps_of(pose, (30, 60)), (30, 60), stands=np.ones((90, 4)))
    off = (held.positions() - pose.positions())[:, feet.ends(pose.skeleton), 1]
    assert np.abs(off).max() < 0.005
