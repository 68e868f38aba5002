"""The guarantees of DESIGN: each test would fail if its guarantee were broken, for every method."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from interpose import formats
from interpose.clip import Clip
from interpose.errors import RequestError
from interpose.finish import Provenance, arms, complete, guarantees, seams
from interpose.geometry import measures, rotations
from interpose.methods.classical import Linear, Spline, ZeroVelocity
from interpose.methods.protocol import Raw
from interpose.observation import Gap, Observation

ARM = ("LeftArm", "LeftForeArm", "LeftHand")


def gaps_of(clip: Clip, *ranges: tuple[int, int]) -> Observation:
    return Observation.from_gaps(clip, [Gap(start, stop) for start, stop in ranges])


def observations(clip: Clip) -> dict[str, Observation]:
    frames = len(clip)
    root = Observation.full(clip)
    root.translation[50:70, 0] = False
    keys = Observation.full(clip)
    keys.rotation[np.arange(frames) % 20 > 0] = False
    keys.translation[np.arange(frames) % 20 > 0, 0] = False
    rng = np.random.default_rng(3)
    drops = Observation.full(clip)
    drops.rotation[rng.random(drops.rotation.shape) < 0.002] = False
    return {
        "middle": gaps_of(clip, (45, 75)),
        "one frame": gaps_of(clip, (60, 61)),
        "two frames": gaps_of(clip, (60, 62)),
        "start": gaps_of(clip, (0, 20)),
        "end": gaps_of(clip, (100, frames)),
        "two with one frame between": gaps_of(clip, (40, 60), (61, 80)),
        "touching": Observation.from_gaps(clip, [Gap(40, 60), Gap(60, 80, ARM), Gap(70, 90, ("LeftUpLeg",))]),
        "arm": Observation.from_gaps(clip, [Gap(30, 90, ARM)]),
        "arm, all the time": Observation.from_gaps(clip, [Gap(0, frames, ARM)]),
        "root": root,
        "keys": keys,
        "drop-outs": drops,
        "nothing observed": gaps_of(clip, (0, frames)),
    }


CASES = (
    *("middle", "one frame", "two frames", "start", "end", "two with one frame between", "touching"),
    *("arm", "arm, all the time", "root", "keys", "drop-outs", "nothing observed"),
)


def bytes_of(clip: Clip) -> bytes:
    return clip.rotation.tobytes() + clip.translation.tobytes()


@pytest.fixture(scope="module", params=CASES)
def case(request, walk):
    """What is observed, and the completion by each method (made when asked for)."""
    known, done = observations(walk)[request.param], {}

    def by(make):
        if make not in done:
            done[make] = complete(walk, known, make(walk))
        return done[make]

    return known, by


def test_observed_values_and_bones_are_the_same(walk, make, case):
    known, by = case
    done = by(make)
    assert done.clip.rotation[known.rotation].tobytes() == walk.rotation[known.rotation].tobytes()
    seen = known.translation[:, list(walk.translated)]
    assert done.clip.translation[seen].tobytes() == walk.translation[seen].tobytes()
    lengths = np.linalg.norm(walk.skeleton.rest_translation, axis=1)
    assert measures.bone_deviation(done.clip.positions(), walk.skeleton.parents, lengths) < 1e-9
    assert np.allclose(np.linalg.norm(done.clip.rotation, axis=-1), 1, atol=1e-9)
    missing = ~(known.rotation & known.translation)
    assert ((done.provenance != Provenance.OBSERVED) == missing).all()
    told = np.zeros_like(done.provenance)
    for one in done.sources():
        start, stop = map(int, one["frames"].split(":"))
        joints = range(len(walk.skeleton))
        if one["joints"] is not None:
            joints = [walk.skeleton.index(name) for name in one["joints"]]
        told[start:stop, joints] = Provenance[one["source"].upper()]
    assert (told == done.provenance).all()


class File:
    """What a clip was read from."""

    def take(self, frames):
        return self


def test_nothing_leaks(walk, make, case):
    """Other values, huge ones and no numbers at all in unobserved places change no bit of the output."""
    known, by = case
    poisoned = replace(
        walk, rotation=walk.rotation.copy(), translation=walk.translation.copy(), source=File()
    )
    poison = np.random.default_rng(5).choice([np.nan, np.inf, 1e300, -3.0], len(walk))[:, None, None]
    poisoned.rotation[...] = np.where(known.rotation[..., None], walk.rotation, poison)
    moved = known.translation[:, list(walk.translated), None]
    poisoned.translation[...] = np.where(moved, walk.translation, poison)
    done, reference = complete(poisoned, known, make(walk)), by(make)
    assert bytes_of(done.clip) == bytes_of(reference.clip)
    assert done.report.to_dict() == reference.report.to_dict()
    assert (done.provenance == reference.provenance).all()


@pytest.mark.parametrize("start", [15, 40, 66, 82])
def test_no_pop_at_seams(walk, make, start):
    known = gaps_of(walk, (start, start + 24))
    done = complete(walk, known, make(walk))
    [report] = done.report.gaps
    limits = seams.limits(walk, known)
    jumps = measures.acceleration(done.clip.positions())[[start - 2, start + 23]]
    _, nearest = np.unravel_index((jumps / limits).argmax(), jumps.shape)
    assert report.seam_after == pytest.approx(100 * jumps[:, nearest].max())
    assert report.seam_limit == pytest.approx(100 * limits[nearest])
    assert (jumps <= limits).all()
    # Noise may put a foot into a shin, and interpolation drags feet along, which is said, too.
    told = (" cm into the ", "while it stands", guarantees.STEPPED)
    others = [note for note in report.notes if not any(part in note for part in told)]
    assert report.method == "spline" or not others


def test_limits_are_the_percentiles_of_observed_motion_only(walk):
    """A foot that lands may jump as it does elsewhere; what hardly jumps may as far as all joints."""
    known = gaps_of(walk, (40, 80))
    jumps = measures.acceleration(walk.positions())
    seen = np.concatenate([jumps[:38], jumps[80:]])
    each, pooled = np.percentile(seen, 95, axis=0), np.percentile(seen, 95)
    assert each.min() < pooled < each.max()
    assert seams.limits(walk, known) == pytest.approx(np.maximum(each, pooled), rel=1e-5)
    assert seams.limits(walk, gaps_of(walk, (0, 120))) is None


def test_spline_that_fits_stays_what_it_is(walk):
    """What already meets the guarantees is not touched, but for the feet."""
    known = Observation.from_gaps(walk, [Gap(40, 60, ARM)])
    done = complete(walk, known, Spline())
    assert done.report.gaps[0].notes == ()
    assert np.allclose(done.clip.rotation, done.raw.clip.rotation, atol=1e-12)


def test_a_network_is_met_in_value_and_velocity(walk, speaking):
    """3 cm to the side: unfinished it would jump by 3 cm; in the middle of the gap it keeps its opinion."""
    method = speaking(walk, sigma=0.0, bias=0.03)
    known = gaps_of(walk, (30, 90))
    done = complete(walk, known, method)
    [report] = done.report.gaps
    assert report.method == "speaking"
    assert report.model == "made up"
    assert report.drift == pytest.approx(12.0)
    assert report.seam_before > 2.5
    assert report.seam_after <= report.seam_limit
    assert report.solve_error < 0.1
    off = np.linalg.norm(done.clip.root - walk.root, axis=-1)
    assert off[30] < 0.003
    assert off[89] < 0.003
    assert off[60] > 0.025


class Aside(Linear):
    """Says rotations: the truth, but for an arm that is turned, and the whole body moved to the side."""

    name = "aside"

    def __init__(self, truth: Clip, turn: float, shift: float) -> None:
        self.truth, self.turn, self.shift = truth, turn, shift

    def complete(self, clip, observation, seed=None):  # type: ignore[no-untyped-def]
        rotation, arm = self.truth.rotation.copy(), clip.skeleton.index("LeftArm")
        off = rotations.about("Z", np.array(self.turn))
        rotation[:, arm] = rotations.multiply(rotation[:, arm], off)
        return Raw(clip.with_motion(rotation, self.truth.translation + np.array([self.shift, 0.0, 0.0])))


def test_so_is_one_that_says_rotations(walk):
    """The arm comes in the course of half a second, and is not torn aside in the first frame."""
    done = complete(walk, gaps_of(walk, (30, 90)), Aside(walk, turn=0.2, shift=0.1))
    [report] = done.report.gaps
    assert report.method == "aside"
    assert report.seam_after <= report.seam_limit
    turned = rotations.angle(done.clip.rotation, walk.rotation)[:, walk.skeleton.index("LeftArm")]
    off = np.linalg.norm(done.clip.root - walk.root, axis=-1)
    for away, most in ((turned, 0.2), (off, 0.1)):
        assert away[[30, 89]].max() < 0.03 * most
        assert np.diff(away[30:60]).max() < 0.08 * most
        assert away[60] == pytest.approx(most, rel=0.05)


def test_a_lost_method_falls_back_by_name(walk, speaking):
    known = gaps_of(walk, (20, 30), (60, 90))
    method = speaking(walk, sigma=0.0)
    method.positions[55:] += [0.0, 0.0, 2.0]
    first, second = complete(walk, known, method).report.gaps
    assert (first.method, second.method) == ("speaking", "spline")
    assert second.model is None
    assert "filled by spline" in second.notes[0]
    assert "cm away" in second.notes[0]
    clip = complete(walk, gaps_of(walk, (60, 90)), method).clip
    assert np.linalg.norm(clip.root - walk.root, axis=-1).max() < 0.5


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e200])
def test_positions_that_are_no_numbers_fall_back(walk, value, speaking):
    method = speaking(walk, sigma=0.0)
    method.positions[70, 3] = value
    done = complete(walk, gaps_of(walk, (20, 30), (60, 90)), method)
    first, second = done.report.gaps
    assert (first.method, second.method) == ("speaking", "spline")
    assert (done.provenance[60:90] == Provenance.FALLBACK).all()


def test_a_jump_in_value_is_no_fill(walk):
    """Holding the last pose while the body walks on cannot be eased: it is replaced, by name."""
    [report] = complete(walk, gaps_of(walk, (40, 80)), ZeroVelocity()).report.gaps
    assert report.method == "spline"
    assert report.seam_before > 10
    assert "filled by spline" in report.notes[0]


class Refusing(Linear):
    name = "refusing"

    def refuses(self, clip: Clip, gap: Gap) -> str | None:
        return "it is too long" if len(gap) > 15 else None


def test_refused_gaps_are_filled_by_the_fallback(walk):
    known = gaps_of(walk, (20, 30), (60, 90))
    first, second = complete(walk, known, Refusing()).report.gaps
    assert (first.method, second.method) == ("refusing", "spline")
    assert "too long" in second.notes[0]
    with pytest.raises(RequestError, match="too long"):
        complete(walk, known, Refusing(), fallback=Refusing())


class Trembling(Linear):
    """Jumps from frame to frame."""

    name = "trembling"

    def complete(self, clip, observation, seed=None):  # type: ignore[no-untyped-def]
        raw = super().complete(clip, observation, seed)
        turns = np.where(np.arange(len(clip)) % 2, 0.14, -0.14)[:, None]
        rotation = rotations.multiply(raw.clip.rotation, rotations.about("X", turns))
        return Raw(raw.clip.with_motion(rotation, raw.clip.translation))


def test_the_rest_pose_is_no_better_than_motion_that_jumps(walk):
    """Of joints that are never known the spline has only the rest pose; of others it has a motion."""
    for frames, method in (((0, len(walk)), "trembling"), ((60, 90), "spline")):
        seen = Observation.from_gaps(walk, [Gap(*frames, ("LeftUpLeg", "LeftLeg"))])
        gap = complete(walk, seen, Trembling()).report.gaps[0]
        assert gap.method == method
        assert "the velocity jumps" in " ".join(gap.notes)


class Waving(Linear):
    """The left arm turns to and fro from frame to frame, by so many radians, inside of frames 60 to 89."""

    def __init__(self, name: str, most: float) -> None:
        self.name, self.most = name, most

    def complete(self, clip, observation, seed=None):  # type: ignore[no-untyped-def]
        raw = super().complete(clip, observation, seed)
        frames, rotation = np.arange(60, 90), raw.clip.rotation.copy()
        arm = clip.skeleton.index("LeftArm")
        turn = rotations.about("Z", self.most * np.where(frames % 2, 1.0, -1.0))
        rotation[frames, arm] = rotations.multiply(rotation[frames, arm], turn)
        return Raw(raw.clip.with_motion(rotation, raw.clip.translation))


@pytest.mark.parametrize(("share", "method"), [(0.4, "other"), (0.8, "own"), (1.5, "own")])
def test_a_simpler_method_takes_over_where_it_jumps_clearly_less(walk, share, method, monkeypatch):
    """Who falls jumps with either: then there is no reason to lose the motion."""
    monkeypatch.setattr(arms, "arms", lambda skeleton: [])  # left as they are
    own, other = Waving("own", 0.2), Waving("other", 0.2 * share)
    [gap] = complete(walk, gaps_of(walk, (60, 90)), own, fallback=other).report.gaps
    assert gap.method == method


class Sure(Linear):
    """Where the body is 3 m away, and no foot stands, or all do."""

    name = "sure"

    def __init__(self, stands: float) -> None:
        self.stands = stands

    def complete(self, clip, observation, seed=None):  # type: ignore[no-untyped-def]
        away = super().complete(clip, observation, seed).clip
        away = away.with_motion(away.rotation, away.translation + 3.0)
        return Raw(away, stands=np.full((len(clip), 4), self.stands))


def test_what_a_method_says_of_feet_is_of_its_own_motion(walk):
    """The simpler method's feet stand where that one has them."""
    seen = gaps_of(walk, (40, 80))
    done = [complete(walk, seen, Sure(stands)) for stands in (0.0, 1.0, np.nan)]
    assert {one.report.gaps[0].method for one in done} == {"spline"}
    assert len({bytes_of(one.clip) for one in done}) == 1


@pytest.mark.parametrize("ahead", [False, True])
@pytest.mark.parametrize("which", ["spline", "speaking"])
def test_what_a_simpler_method_says_is_finished_like_any_word(walk, data, speaking, which, ahead):
    """Knees bend as they do, bodies come down, and what speaks positions is heard: as if it was asked."""
    clip, known = walk, gaps_of(walk, (40, 80))
    if ahead:  # in the air, at the end of what is known of a jump
        jump = formats.load(data / "cmu_jump.bvh").slice(1, 30)
        clip = jump.take([*range(29), *[28] * 30])
        known = gaps_of(clip, (29, 59))
    fallback = Spline() if which == "spline" else speaking(clip, sigma=0.02)
    asked, fell = complete(clip, known, fallback), complete(clip, known, Sure(np.nan), fallback=fallback)
    assert {gap.method for gap in fell.report.gaps} == {fallback.name}
    np.testing.assert_allclose(fell.clip.positions(), asked.clip.positions(), atol=2e-3)


class Torn(Spline):
    """The body is 15 cm higher in frame 75 alone."""

    name = "torn"

    def complete(self, clip, observation, seed=None):  # type: ignore[no-untyped-def]
        done = super().complete(clip, observation, seed).clip
        lift = np.where(np.arange(len(clip)) == 75, 0.15, 0.0)[:, None, None] * [0.0, 1.0, 0.0]
        return Raw(done.with_motion(done.rotation, done.translation + lift))


def test_where_a_spline_leads_is_said_of_the_motion_that_stays(walk):
    """Be it the method's own or the simpler one's."""
    known, says = gaps_of(walk, (60, 90)), "a spline leads over frames 7"
    for done in (complete(walk, known, Torn()), complete(walk, known, Sure(np.nan), fallback=Torn())):
        assert any(note.startswith(says) for note in done.report.gaps[0].notes)
    done = complete(walk, known, Torn(), fallback=Sure(np.nan))
    assert any(note.startswith(says) for note in done.report.gaps[0].notes)


def test_a_method_is_asked_once(walk):
    class Counting(Spline):
        name, asked = "counting", 0

        def complete(self, clip, observation, seed=None):  # type: ignore[no-untyped-def]
            Counting.asked += 1
            return super().complete(clip, observation, seed)

    complete(walk, gaps_of(walk, (40, 80)), Refusing(), fallback=Counting())
    assert Counting.asked == 1


class Nodding(Linear):
    """The neck turns by a third of a turn, of which nothing is known."""

    name = "nodding"

    def complete(self, clip, observation, seed=None):  # type: ignore[no-untyped-def]
        raw = super().complete(clip, observation, seed)
        neck, rotation = clip.skeleton.index("Neck"), raw.clip.rotation.copy()
        rotation[:, neck] = rotations.about("X", 2.0 * np.sin(np.arange(len(clip)) / 40))
        return Raw(raw.clip.with_motion(rotation, raw.clip.translation))


def test_only_the_rest_pose_is_said_to_be_it(walk):
    known = Observation.from_gaps(walk, [Gap(0, len(walk), ("Neck",))])
    told = [" ".join(complete(walk, known, method).report.gaps[0].notes) for method in (Linear(), Nodding())]
    assert ["only the rest pose" in notes for notes in told] == [True, False]


def test_in_a_brief_gap_feet_are_held_however_legs_jump_elsewhere(walk, speaking, monkeypatch):
    """Where they jumped nowhere, say: in a longer one legs that would are left alone."""
    slides = {}
    for patched in (False, True):
        for length in (8, 20):
            known = gaps_of(walk, (55, 55 + length))
            (gap,) = complete(walk, known, speaking(walk, sigma=0.08)).report.gaps
            slides[patched, length] = gap.foot_slide
        monkeypatch.setattr(guarantees, "_usual", lambda clip, known, peak: np.full(len(peak), 1e-9))
    assert slides[True, 8] == slides[False, 8]
    assert slides[True, 20] > slides[False, 20]


class Kicking(Linear):
    """The right leg turns by two radians from frame 105 on."""

    name = "kicking"

    def complete(self, clip, observation, seed=None):  # type: ignore[no-untyped-def]
        raw = super().complete(clip, observation, seed)
        leg, rotation = clip.skeleton.index("RightUpLeg"), raw.clip.rotation.copy()
        rotation[105:, leg] = rotations.multiply(rotation[105:, leg], rotations.about("X", np.array(2.0)))
        return Raw(raw.clip.with_motion(rotation, raw.clip.translation))


def test_a_jump_is_told_of_the_gap_that_it_is_in(walk):
    """An arm that is lost before it, and for a while together with the leg, has nothing to do with it."""
    known = Observation.from_gaps(walk, [Gap(60, 90, ("LeftArm",)), Gap(80, 120, ("RightUpLeg",))])
    gaps = complete(walk, known, Kicking()).report.gaps
    assert [(gap.start, gap.stop) for gap in gaps] == [(60, 80), (80, 90), (90, 120)]
    assert [any("velocities jumped" in note for note in gap.notes) for gap in gaps] == [False, False, True]


def test_what_is_missing_all_the_while_has_no_seam(walk):
    """At frame 90 the arm is known again; the leg is not, and its jump there is none of the arm's."""
    known = Observation.from_gaps(walk, [Gap(60, 90, ("LeftArm",)), Gap(80, 120, ("RightUpLeg",))])
    at, names = np.array([90]), walk.skeleton.names
    every, own = (np.linalg.norm(of(walk, known, at), axis=-1)[0] for of in (seams.jumps, seams.seam_jumps))
    assert every[names.index("RightFoot")] > 0 == own[names.index("RightFoot")]
    assert every[names.index("LeftHand")] == own[names.index("LeftHand")] > 0


def test_an_observation_of_another_clip_is_refused(walk):
    with pytest.raises(RequestError, match="does not fit"):
        complete(walk, gaps_of(walk.slice(0, 60), (10, 20)), Linear())


@pytest.mark.parametrize("which", ["middle", "arm", "keys", "start", "touching"])
def test_a_turned_and_shifted_clip_gives_the_same_result(walk, make, which):
    known = observations(walk)[which]
    turn, shift = rotations.about("Y", np.array(1.1)), np.array([3.0, 0.0, -7.0])
    rotation = walk.rotation.copy()
    rotation[:, 0] = rotations.multiply(turn, rotation[:, 0])
    moved = walk.with_motion(rotation, rotations.rotate(turn, walk.translation) + shift)
    here, there = make(walk), make(moved)
    if here.name == "speaking":
        there.positions = rotations.rotate(turn, here.positions) + shift
    here, there = complete(walk, known, here), complete(moved, known, there)
    expected = rotations.rotate(turn, here.clip.positions()) + shift
    assert np.allclose(there.clip.positions(), expected, atol=1e-6)


def test_same_input_same_bytes(walk, make):
    known = gaps_of(walk, (20, 30), (45, 75))
    once, again = (complete(walk, known, make(walk), seed=1) for _ in range(2))
    assert bytes_of(once.clip) == bytes_of(again.clip)
    assert json.dumps(once.report.to_dict()) == json.dumps(again.report.to_dict())


@pytest.mark.parametrize(("frames", "gap"), [(1, (0, 1)), (2, (0, 1)), (2, (1, 2)), (2, (0, 2))])
def test_clips_of_one_and_two_frames(walk, make, frames, gap):
    short = walk.slice(0, frames)
    known = gaps_of(short, gap)
    done = complete(short, known, make(short))
    assert len(done.clip) == frames
    assert done.clip.rotation[known.rotation].tobytes() == short.rotation[known.rotation].tobytes()


def test_nothing_missing_is_no_work(walk, make):
    done = complete(walk, Observation.full(walk), make(walk))
    assert done.clip is walk
    assert done.report.gaps == []
    assert not done.provenance.any()
    assert str(done.report) == "nothing is missing"


def test_motion_that_is_observed_is_no_seam(walk):
    """A missing wrist while the observed legs step hard must not be blamed for their jump."""
    feet = [walk.skeleton.index(n) for n in ("LeftUpLeg", "RightUpLeg")]
    shaken = walk.with_motion(walk.rotation.copy(), walk.translation)
    shaken.rotation[49:52, feet] = rotations.multiply(
        shaken.rotation[49:52, feet], rotations.exp(np.array([0.5, 0, 0]))
    )
    known = Observation.from_gaps(shaken, [Gap(50, 60, ("LeftHand",))])
    [report] = complete(shaken, known, Linear()).report.gaps
    assert report.method == "linear"
    assert report.notes == ()


def test_a_method_sees_no_unobserved_value_and_no_file(walk):
    class Spy(Linear):
        def complete(self, clip: Clip, observation: Observation, seed: int | None = None) -> Raw:
            self.seen = clip
            return super().complete(clip, observation, seed)

    spy, known = Spy(), gaps_of(walk, (45, 75))
    complete(replace(walk, source=File()), known, spy)
    assert spy.seen.source is None
    assert np.abs(spy.seen.root[45:75] - walk.root[45:75]).max() > 1e-3
    assert np.array_equal(spy.seen.root[75:], walk.root[75:])


def test_report_is_plain_and_readable(walk, speaking):
    done = complete(walk, gaps_of(walk, (45, 75)), speaking(walk))
    [report] = done.report.gaps
    plain = json.loads(json.dumps(done.report.to_dict()))
    assert plain["gaps"][0]["start"] == 45
    assert plain["gaps"][0]["method"] == "speaking"
    assert plain["gaps"][0]["joints"] is None
    text = str(done.report)
    assert "gap 45:75" in text
    assert "speaking (made up)" in text
    assert f"{report.foot_slide:.1f} cm/s" in text


def beside(clip: Clip, speaking, before: int, after: int, length: int = 40) -> str:
    """What the report of a network says of what is known beside a gap."""
    part = clip.slice(0, before + length + after)
    done = complete(part, gaps_of(part, (before, before + length)), speaking(part, sigma=0.0))
    [report] = done.report.gaps
    return " ".join(note for note in report.notes if "on either side" in note)


@pytest.mark.parametrize(("before", "after"), [(2, 40), (40, 2), (2, 3), (2, 2)])
def test_little_beside_a_gap_is_told(walk, speaking, before, after):
    said = beside(walk, speaking, before, after)
    few = [f"{n} frames {side} it" for n, side in ((before, "before"), (after, "after")) if n < 3]
    assert f"only {' and '.join(few)} are known" in said
    assert "a gap of 40 needs 3 on either side" in said


def test_enough_beside_a_gap_keys_and_open_ends_are_not_told(walk, speaking):
    for before, after in ((40, 40), (3, 3), (1, 40), (1, 1), (40, 1), (0, 40), (0, 2)):
        assert beside(walk, speaking, before, after) == ""
    assert beside(walk, speaking, 2, 40, length=3) == "", "too short to matter"
    known = gaps_of(walk, (20, 60), (62, 100))
    [report, _] = complete(walk, known, Spline()).report.gaps
    assert not any("on either side" in note for note in report.notes), "two frames are enough for a spline"


def test_other_gaps_end_what_is_known_and_lost_joints_do_not(walk, speaking):
    known = gaps_of(walk, (20, 60), (62, 100))
    known.rotation[:, walk.skeleton.index("LeftHand")] = False
    told = {
        (gap.start, gap.joints): note
        for gap in complete(walk, known, speaking(walk, sigma=0.0)).report.gaps
        for note in gap.notes
        if "on either side" in note
    }
    assert set(told) == {(20, None), (62, None)}
    assert "only 2 frames after it are known, and a gap of 40 " in told[20, None]
    assert "only 2 frames before it are known, and a gap of 38 " in told[62, None]


def test_short_seeds_of_a_stitched_clip_are_told(walk):
    from interpose import tasks

    short, long = walk.slice(0, 2), walk.slice(40, 80)
    first, second = tasks.stitch([long, short, long], 30).report.gaps
    assert "only 2 frames after it are known" in " ".join(first.notes)
    assert "only 2 frames before it are known" in " ".join(second.notes)
