"""The graphs that are shipped, in the runtime of browsers: the same file gives the same motion."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import interpose
from interpose.cli import main
from interpose.geometry import kinematics, rotations
from interpose.methods import weights
from interpose.methods.base.graph import Seen, run
from interpose.methods.bodies import observed_body
from interpose.observation import Observation
from interpose.skeletons import PARENTS, find_humanoid

FOLDER = Path(__file__).parents[1] / "node"

pytestmark = pytest.mark.skipif(
    not shutil.which("node") or not (FOLDER / "node_modules").is_dir(),
    reason="needs Node, and `npm ci` in tests/node",
)


def in_a_browser(graph: Path, feed: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """What onnxruntime-web makes of it, in Node."""
    told = {
        name: {"type": str(value.dtype), "dims": value.shape, "data": value.ravel().tolist()}
        for name, value in feed.items()
    }
    return {name: np.reshape(one["data"], one["dims"]) for name, one in node("run.mjs", graph, told).items()}


def node(script: str, graph: Path, told: Any) -> Any:
    """What a script of the folder `node` prints, given a graph and JSON."""
    done = subprocess.run(
        ["node", script, str(graph)],
        input=json.dumps(told),
        cwd=FOLDER,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_small_says_the_same_in_a_browser(cmu_walk):
    body = observed_body(cmu_walk, Observation.full(cmu_walk))
    part = cmu_walk.slice(60, 111)
    known = np.ones((1, 51, len(PARENTS) + 1), np.float32)
    known[:, 10:40] = 0
    feed = {
        "local": kinematics.local_rotations(body.rotations(part), PARENTS)[None],
        "root": body.root(part)[None] * body.scale,
        "known": known,
        "pinned": np.zeros((1, 51, len(PARENTS), 3)),
        "pins": np.zeros((1, 51, len(PARENTS)), bool),
        "label": np.zeros(1, np.int64),
        "bones": body.bones[None] * body.scale,
    }
    feed = {name: value.astype(np.float32) if value.dtype == float else value for name, value in feed.items()}
    graph = weights.find("small").onnx
    session = weights.session(graph)
    names = [one.name for one in session.get_outputs()]
    here, there = dict(zip(names, session.run(names, feed))), in_a_browser(graph, feed)
    assert set(there) == set(names)
    for name in names:
        np.testing.assert_allclose(there[name], here[name], rtol=1e-3, atol=1e-3)
    assert graph.stat().st_size < 8e6


def test_the_javascript_of_the_docs_fills_a_character_as_python_does(cmu_walk, tmp_path, capsys):
    clip = interpose.resample(cmu_walk, 30)
    interpose.save(clip, tmp_path / "walk.bvh")
    (tmp_path / "map.json").write_text(json.dumps({"joints": {"LeftToe": ""}}))
    assert main(["skeleton", str(tmp_path / "walk.bvh"), "--map", str(tmp_path / "map.json"), "--json"]) == 0
    rig = json.loads(capsys.readouterr().out)
    assert rig["missing"] == ["LeftToe"]
    clip = interpose.load(tmp_path / "walk.bvh", roles={"LeftToe": ""})
    body, part = find_humanoid(clip), clip.slice(10, 50)
    turned, placed = part.kinematics()
    hips = clip.skeleton.index(rig["mapping"]["Hips"])
    frames: list[Any] = [
        {"turned": dict(zip(clip.skeleton.names, now.tolist())), "hips": place[hips].tolist()}
        for now, place in zip(turned, placed)
    ]
    frames[12:30] = [None] * 18
    card = weights.find("small")
    said = node("fill.mjs", card.onnx, {"rig": rig, "frames": frames, "start": 12, "stop": 30})

    known = np.ones((40, len(PARENTS) + 1))
    known[12:30] = 0
    known[:, [row for row, joint in enumerate(body.mapping.joints) if joint is None]] = 1
    local = kinematics.local_rotations(body.rotations(part), PARENTS)
    nothing = np.zeros((40, len(PARENTS), 3))
    seen = Seen(
        local,
        body.root(part) * body.scale,
        known,
        np.ones(len(PARENTS) + 1, bool),
        ("", ""),
        body.bones * body.scale,
        nothing,
        nothing[..., 0] > 0,
        nothing[:, 0] * np.nan,
        local[:, 0] * np.nan,
    )
    (answer,) = run(card, seen)
    expected = body.to_clip(
        kinematics.global_rotations(answer.local, PARENTS), answer.root / body.scale, part
    )
    own, there = expected.kinematics()
    for i, frame in enumerate(said):
        for joint, turn in frame["turned"].items():
            off = rotations.angle(np.array(turn), own[12 + i, clip.skeleton.index(joint)])
            assert off < 2e-3
        np.testing.assert_allclose(frame["hips"], there[12 + i, hips], atol=1e-3)
        np.testing.assert_allclose(frame["contact"], answer.stands[12 + i], atol=1e-3)
        assert frame["error"] == pytest.approx(answer.expected[12 + i] / body.scale, abs=1e-3)
