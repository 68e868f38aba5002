"""What an animator would send back: each fault is found in a real walk that was given it, and in no other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from interpose.evaluation import artefacts
from interpose.evaluation.artefacts import FEET, KINDS, TOES, Seen
from interpose.observation import Gap
from interpose.skeletons import JOINTS, find_humanoid

GAP = Gap(19, 110)


@pytest.fixture(scope="module")
def walk(cmu_walk):  # type: ignore[no-untyped-def]
    """People as they walk: steps in the gap."""
    truth = find_humanoid(cmu_walk).positions(cmu_walk)
    return Seen(truth.copy(), truth, cmu_walk.fps, GAP)


def counted(seen: Seen) -> dict[str, int]:
    return {kind: judge(seen)[0] for kind, judge in KINDS.items()}


def changed(seen: Seen, change) -> dict[str, int]:  # type: ignore[no-untyped-def]
    """What is found more than in the truth once the frames of the gap (n, 22, 3) have been changed."""
    motion = seen.motion.copy()
    change(motion[seen.inner])
    before, after = counted(seen), counted(replace(seen, motion=motion))
    return {kind: after[kind] - before[kind] for kind in KINDS if after[kind] != before[kind]}


def hump(n: int) -> np.ndarray:
    """(n, 1) from 0 to 1 and back, smoothly."""
    return np.asarray(np.sin(np.pi * np.arange(n) / (n - 1))[:, None] ** 2)


def test_people_do_nothing_of_it(walk):
    found = counted(walk)
    assert {kind: n for kind, n in found.items() if n} in ({}, {"gliding frames": found["gliding frames"]})
    assert artefacts.scuffs(walk)[1] >= 2, "there are steps to be judged"
    assert artefacts.freezes(walk)[1] == 1


def test_a_hand_that_jumps_is_a_snap(walk):
    def snap(part: np.ndarray) -> None:
        part[30, JOINTS.index("LeftHand")] += 0.10

    assert changed(walk, snap) == {"snaps": 1}


def test_toes_that_are_drawn_along_the_floor_scuff(walk):
    def drag(part: np.ndarray) -> None:
        part[:, TOES, 1] = np.minimum(part[:, TOES, 1], walk.truth[:, TOES, 1].min() + 0.01)

    assert changed(walk, drag)["scuffing steps"] >= 2


def test_hips_that_sink_squat(walk):
    def sink(part: np.ndarray) -> None:
        part[:, 0, 1] -= 0.2 * hump(len(part))[:, 0]

    assert changed(walk, sink) == {"squats": 1}


def test_a_foot_under_the_floor(walk):
    def sink(part: np.ndarray) -> None:
        part[:, FEET[0], 1] -= 0.2 * hump(len(part))[:, 0]

    assert changed(walk, sink)["feet under the floor"] == 1


def test_feet_that_float_along_drift_or_glide(walk):
    def float_along(part: np.ndarray) -> None:
        part[:, FEET] = part[:1, FEET] + (part[:, :1] - part[:1, :1]) * [1, 0, 1]

    assert changed(walk, float_along)["gliding frames"] > 30

    def drift(part: np.ndarray) -> None:
        part[:, FEET] = part[:1, FEET] * [1, 0, 1] + np.linspace([0, 0, 0], [0.3, 0, 0], len(part))[:, None]
        part[:, FEET, 1] = walk.truth[:, FEET, 1].min(axis=0)

    assert changed(walk, drift)["stances that drift"] == 1


def test_a_body_that_stays_as_it_is_has_frozen(walk):
    def freeze(part: np.ndarray) -> None:
        part[:] = part[30]

    assert changed(walk, freeze)["frozen"] == 1


def test_a_row_a_task_for_people_and_each_method(published, monkeypatch):
    monkeypatch.setattr(artefacts, "DATASETS", ("lafan1",))
    result = artefacts.run(published, ("linear", "spline"), most=1)
    assert list(result.counts) == list(artefacts.TASKS)
    table = result.table().splitlines()
    assert len(table) == 2 + 3 * len(artefacts.TASKS)
    glide = [result.share("2 s between two keys", "gliding frames", who) for who in ("spline", "people")]
    assert glide[0] > glide[1]
    assert result.to_dict()["found_of"]["gap of 1 s"]["snaps"]["linear"][1] == result.count == 1
    assert result.table() in str(result)
