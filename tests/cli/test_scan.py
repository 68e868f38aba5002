"""interpose scan: what it says to do next."""

from __future__ import annotations

import json

import numpy as np
import pytest
from tests.skeletons.rigs import twice

from interpose.formats import load, save
from interpose.geometry import rotations
from interpose.observation.finding import Finding


@pytest.mark.parametrize(
    ("part", "said"),
    [
        (slice(0, 6), "--gap 0:6 fills anew what is before the first jump"),
        (slice(150, None), "--gap 150:163 fills anew what follows the first jump"),
        (slice(100, None), "--gap 91:109 leads over the first jump"),
    ],
)
def test_what_jumps_near_an_end_is_lost_there(run, take, part, said):
    """The frame at the very end would be known to be wrong."""
    clip = load(take)
    translation = clip.translation.copy()
    translation[part] += np.array([1.0, 0, 0.5])
    save(clip.with_motion(clip.rotation, translation), take.with_name("jumps.bvh"))
    assert said in run("scan", "jumps.bvh").out


def test_what_interpose_filled_is_not_called_splined(run, take, monkeypatch):
    """By the report beside the file, and those of its inputs; of any other file it is said."""
    from interpose.observation import scan as looks

    found = looks.Finding("splined", None, 61, 90, "made up")
    take.with_name("done").mkdir()
    monkeypatch.setattr(looks, "scan", lambda clip: [found])
    assert run("fill", "take.bvh", "--gap", "60:90", "--method", "spline").code == 0
    done = run("scan", "take.filled.bvh")
    assert "filled by interpose, as the report beside it says: 60:90" in done.out
    assert "nothing looks missing" in done.out
    assert run("recover", "take.filled.bvh", "--joints", "LeftArm", "--frames", "120:140").code == 0
    done = run("scan", "take.filled.recovered.bvh", "--json").json
    assert (done["filled"], done["findings"]) == (["60:90", "120:140"], [])
    assert (
        run(
            "recover", "take.filled.bvh", "--joints", "LeftArm", "--frames", "120:140", "-o", "done/x.bvh"
        ).code
        == 0
    )
    assert run("scan", "done/x.bvh", "--json").json["filled"] == ["60:90", "120:140"]
    assert run("fill", "take.bvh", "--gap", "60:90", "--method", "spline", "-o", "done/take.bvh").code == 0
    assert run("scan", "done/take.bvh", "--json").json["filled"] == ["60:90"]
    assert "splined" in run("scan", "take.bvh").out
    report = json.loads(take.with_name("take.filled.json").read_text())
    for odd in ("", "..", "/", "a\0.bvh", 3, None, ["take.bvh"], "nowhere/x.bvh"):
        take.with_name("take.filled.json").write_text(json.dumps(report | {"input": odd}))
        done = run("scan", "take.filled.bvh", "--json")
        assert (done.code, done.json["filled"]) == (0, ["60:90"])
    take.with_name("take.filled.json").write_text("{")
    assert "splined" in run("scan", "take.filled.bvh").out


def test_what_is_stuck_once_the_rest_moves_is_told_of(run, take, monkeypatch):
    """Else `fill` would send whoever comes from `recover` back to it."""
    from interpose.observation import scan as module

    clip = load(take)
    rotation, arm = clip.rotation.copy(), clip.skeleton.index("LeftArm")
    rotation[60:64, arm] = rotations.multiply(rotation[60:64, arm], rotations.about("X", np.array(1.5)))
    save(clip.with_motion(rotation, clip.translation), take.with_name("odd.bvh"))
    stuck = Finding("frozen body", ("Hips", "Spine"), 20, 31)
    monkeypatch.setattr(module, "scan", lambda clip: [stuck])
    done = run("recover", "odd.bvh")
    assert done.code == 4
    assert "Stuck, now that the rest moves: Hips, Spine 20:31" in done.out
    assert "interpose recover odd.recovered.bvh, once more" in done.out


def test_another_body_is_said_to_be_one(run, take):
    """And each is looked at."""
    save(twice(load(take)), take.with_name("two.bvh"))
    first = load(take).skeleton.names[0]
    assert f"2 bodies, each by itself: {first}, B_{first}" in run("scan", "two.bvh").out
    assert "bodies" not in run("scan", take.name).out
    alone = run("scan", "two.bvh", "--root", f"B_{first}").out
    assert f"that of B_{first} alone is looked at" in alone
