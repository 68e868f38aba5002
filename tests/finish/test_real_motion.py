"""The guarantees of every method that is here, the trained network included, on a walk, a run and a jump."""

from __future__ import annotations

import numpy as np
import pytest

from interpose import formats, tasks
from interpose.finish import feet, measures, seams
from interpose.methods import registry
from interpose.observation import Gap, Observation

METHODS = (*registry.names(), "auto")
GAPS = {"cmu_walk": Gap(60, 90), "cmu_run": Gap(14, 28), "cmu_jump": Gap(45, 75)}


@pytest.fixture(scope="module", params=GAPS)
def case(request, data):  # type: ignore[no-untyped-def]
    """A clip, its gap, what is observed, and its completion by each method (made when asked for)."""
    clip, gap, done = formats.load(data / f"{request.param}.bvh"), GAPS[request.param], {}

    def by(method):  # type: ignore[no-untyped-def]
        if method not in done:
            done[method] = tasks.fill(clip, [gap], method)
        return done[method]

    return clip, gap, Observation.from_gaps(clip, [gap]), by


@pytest.mark.parametrize("method", METHODS)
def test_observed_values_and_bones(case, method):
    clip, gap, _, by = case
    done = by(method).clip
    for part in (slice(0, gap.start), slice(gap.stop, None)):
        assert done.rotation[part].tobytes() == clip.rotation[part].tobytes()
        assert done.translation[part].tobytes() == clip.translation[part].tobytes()
    lengths = np.linalg.norm(clip.skeleton.rest_translation, axis=1)
    assert measures.bone_deviation(done.positions(), clip.skeleton.parents, lengths) < 1e-9


@pytest.mark.parametrize("method", METHODS)
def test_no_pop_at_seams_nor_inside(case, method):
    clip, gap, known, by = case
    done = by(method)
    (report,) = done.report.gaps
    limit = seams.limit(clip, known)
    jumps = measures.acceleration(done.clip.positions()).max(axis=1)  # row i belongs to frame i + 1
    own = np.delete(measures.acceleration(clip.positions()), slice(gap.start - 2, gap.stop), axis=0).max()
    assert max(jumps[gap.start - 2], jumps[gap.stop - 1]) <= limit
    assert jumps[gap.start - 1 : gap.stop - 1].max() <= max(8 * limit, 2 * own)
    assert report.peak == pytest.approx(100 * jumps[gap.start - 1 : gap.stop - 1].max())
    assert not any("flagged: the velocity" in note for note in report.notes)


@pytest.mark.parametrize("method", METHODS)
def test_feet_slide_no_more_than_real_ones_and_travel(case, method):
    clip, gap, known, by = case
    (report,) = by(method).report.gaps
    slide, travel = feet.measure(clip, known, gap.start, gap.stop)
    assert report.foot_slide <= max(1.3 * slide, 5.0, 0.25 * report.foot_slide_before)
    if method != "zero-velocity":
        assert report.foot_travel >= 0.6 * travel


def test_what_jumps_inside_a_gap_falls_back_by_name(case, speaking):
    """A network whose pose turns by a quarter within one frame, in the middle of the gap."""
    from interpose.finish import complete

    clip, gap, known, _ = case
    method, middle = speaking(clip, sigma=0.0), (gap.start + gap.stop) // 2
    hips = method.positions[middle:, :1]
    turned = (method.positions[middle:] - hips)[..., [2, 1, 0]] * [1.0, 1.0, -1.0] + hips
    back = np.clip((gap.stop - np.arange(middle, len(clip))) / (gap.stop - middle), 0, 1)[:, None, None]
    method.positions[middle:] += back * (turned - method.positions[middle:])
    (report,) = complete(clip, known, method).report.gaps
    assert report.method == "spline"
    assert "inside the gap" in report.notes[0]
    assert report.peak <= report.peak_limit
