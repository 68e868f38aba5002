"""CMIB as a method: which keys belong to one pass, what it refuses, and that its motion follows the input."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from interpose import tasks
from interpose.errors import RequestError
from interpose.geometry import rotations
from interpose.methods import auto, cmib, registry, weights
from interpose.methods.bodies import observed_body
from interpose.methods.cmib import passes
from interpose.observation import Gap, Observation
from interpose.resampling import resample


def keys_of(text: str, longest: float = 131) -> list[list[int]]:
    return passes(np.array([c == "o" for c in text]), longest)


def test_gaps_that_share_a_lone_key_are_one_motion():
    assert keys_of("oo...oo") == [[1, 5]]
    assert keys_of("o..o..o") == [[0, 3, 6]]
    assert keys_of("o..oo..o") == [[0, 3], [4, 7]]
    assert keys_of("..o..o..") == [[2, 5]], "open ends are nobody's"
    assert keys_of("ooo") == keys_of("...") == []


def test_a_pass_has_no_more_anchors_or_frames_than_in_training():
    assert keys_of("o." * 6 + "o") == [[0, 2, 4, 6, 8], [8, 10, 12]]
    assert keys_of("o...o...o", longest=8) == [[0, 4], [4, 8]]
    assert keys_of("o...o...o", longest=9) == [[0, 4, 8]]


def test_methods_without_actions_say_so():
    with pytest.raises(RequestError, match="spline knows no actions"):
        registry.told("spline", "walk")


def test_it_refuses_what_it_cannot_do(cmu_walk):
    method, last = registry.get("cmib"), len(cmu_walk)
    for gap, why in (
        (Gap(0, 5), "both sides"),
        (Gap(last - 5, last), "both sides"),
        (Gap(3, 9, ("LeftArm",)), "whole poses"),
    ):
        assert why in method.refuses(cmu_walk, gap)
    assert method.refuses(cmu_walk, Gap(3, 9)) is None


def test_raw_motion_meets_the_keys(cmu_walk):
    seen = Observation.from_gaps(cmu_walk, [Gap(11, 40), Gap(41, 80)])
    raw = registry.get("cmib").complete(cmu_walk, seen)
    keys = [10, 40, 80]
    assert rotations.angle(raw.clip.rotation[keys], cmu_walk.rotation[keys]).max() < 1e-6
    beside = np.linalg.norm(raw.clip.root[[11, 39, 41]] - cmu_walk.root[[10, 40, 40]], axis=-1)
    assert beside.max() < 0.1


def test_the_motion_turns_with_the_clip_and_the_action_matters(cmu_walk):
    turn = rotations.about("Y", np.array(2.0))
    rotation = cmu_walk.rotation.copy()
    rotation[:, 0] = rotations.multiply(turn, rotation[:, 0])
    turned = cmu_walk.with_motion(rotation, rotations.rotate(turn, cmu_walk.translation))
    keys = (20, 50, 90)
    done = tasks.between(cmu_walk, keys, "walk").clip.positions()
    other = tasks.between(turned, keys, "walk").clip.positions()
    assert np.abs(rotations.rotate(turn, done) - other).max() < 5e-3
    seen = Observation.from_gaps(cmu_walk, [Gap(21, 50)])
    said = [registry.told("cmib", name).complete(cmu_walk, seen).clip for name in ("walk", "ground")]
    assert np.abs(said[0].positions() - said[1].positions())[21:50].max() > 1e-4


def test_keys_that_contradict_the_action_are_told(cmu_walk):
    """The same walk, four times as far in the same time: nobody walks so."""
    far = cmu_walk.with_motion(cmu_walk.rotation, cmu_walk.translation * [4.0, 1.0, 4.0])
    seen = Observation.from_gaps(cmu_walk, [Gap(21, 50)])

    def remarks(clip, action):  # type: ignore[no-untyped-def]
        return registry.told("cmib", action).complete(clip, seen).notes["remarks"]

    assert remarks(cmu_walk, "walk") == {}
    assert "contradict" in remarks(far, "walk")["21:50"][0]
    assert remarks(far, "") == {}


def test_keys_closer_than_the_grid_do_not_take_each_other_s_place(cmu_walk, monkeypatch):
    """At 120 fps keys 10 and 12 fall on one frame of the network's: the first key is the one that it gets."""
    given = {}

    def run(path, positions, rotation, keys, *rest):  # type: ignore[no-untyped-def]
        given["hips"], given["keys"] = positions[:, 0], keys
        return ran(path, positions, rotation, keys, *rest)

    ran = cmib.run
    monkeypatch.setattr(cmib, "run", run)
    clip = resample(cmu_walk, 120)
    seen = Observation.from_gaps(clip, [Gap(11, 12), Gap(13, 26)])
    said = registry.get("cmib").complete(clip, seen).clip
    assert given["keys"].sum() == 2
    way = np.linalg.norm(np.diff(given["hips"][[0, -1]], axis=0))
    true = np.linalg.norm(clip.root[26] - clip.root[10])
    body = observed_body(clip, seen)
    assert way == pytest.approx(true * body.scale, rel=1e-3)
    assert np.linalg.norm(said.root[13:26] - clip.root[13:26], axis=-1).max() < 0.1


def test_the_motion_goes_through_keys_that_do_not_lie_on_its_grid(cmu_walk):
    """At 120 fps three frames of four do not: it went there half a frame of its own too early or late."""
    fast = resample(cmu_walk, 120.0, smooth=True)

    def jump(key: int) -> float:
        seen = Observation.from_gaps(fast, [Gap(81, key), Gap(key + 1, 240)])
        hips = registry.get("cmib").complete(fast, seen).clip.root[key - 2 : key + 3]
        return float(np.linalg.norm(np.diff(hips, n=2, axis=0), axis=-1).max())

    for off in (1, 2, 3):
        assert jump(160 + off) < 2 * jump(160) + 1e-4


@pytest.mark.parametrize("fps", [29.9994, 30.0, 30.0003])
def test_the_last_digits_of_a_frame_rate_make_no_gap_too_long(cmu_walk, fps):
    clip = replace(resample(cmu_walk, 60.0), fps=fps)
    cmib, cae = registry.get("cmib"), registry.get("cae")
    assert cmib.refuses(clip, Gap(2, 2 + cmib.card.max_gap)) is None
    assert "129 it can fill" in cmib.refuses(clip, Gap(2, 3 + cmib.card.max_gap))
    assert cae.refuses(clip, Gap(2, 2 + cae.card.max_gap)) is None
    assert auto.choose(clip, Gap(60, 60 + weights.find("base").auto["from_gap"]))[0].name == "base"


def test_of_few_frames_a_second_the_way_to_the_keys_counts_too(cmu_walk):
    """Three frames at .75 fps are 120 of its own, and the four steps from key to key 160."""
    slow = replace(cmu_walk.slice(0, 12), fps=0.75)
    refused = [registry.get("cmib").refuses(slow, Gap(4, 4 + length)) for length in (2, 3)]
    assert refused[0] is None
    assert "159 frames at 30 fps are more than the 129" in refused[1]
    assert [gap.method for gap in tasks.fill(slow, [Gap(4, 7)], "cmib").report.gaps] != ["cmib"]
