"""The graphs that are shipped, in the runtime of browsers: the same file gives the same motion."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from interpose.geometry import kinematics
from interpose.methods import weights
from interpose.methods.bodies import observed_body
from interpose.observation import Observation
from interpose.skeletons import PARENTS

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
    done = subprocess.run(
        ["node", "run.mjs", str(graph)],
        input=json.dumps(told),
        cwd=FOLDER,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return {name: np.reshape(one["data"], one["dims"]) for name, one in json.loads(done.stdout).items()}


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
