"""Two processes under torchrun learn what one does with the same total batch."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("torch")

STEPS = 20


def losses(packs: Path, out: Path, count: int) -> np.ndarray:
    """The loss of every step of a run with a total batch of 64, by so many processes."""
    run = ["-m", "torch.distributed.run", "--standalone", "--nproc-per-node", str(count), "-m", "--"]
    recipe = ["config=small", "width=24", "layers=1", "tasks=gap", "shortest=12", "longest=12"]
    recipe += ["batch=64", "context=1", "mirror=0", "learning_rate=.001", "every_seconds=0"]
    words = ["interpose", "train", "base", "--packs", packs, "--out", out, "--budget", f"{STEPS}steps"]
    done = subprocess.run(
        [sys.executable, *(run if count > 1 else ["-m"]), *map(str, words)]
        + [word for text in recipe for word in ("--set", text)],
        env={**os.environ, "OMP_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    log = [json.loads(line) for line in (out / "log.jsonl").read_text().splitlines()]
    assert [entry["step"] for entry in log] == list(range(1, STEPS + 1))
    assert json.loads((out / "settings.json").read_text())["processes"] == count
    return np.array([entry["loss"] for entry in log])


def test_two_processes_learn_what_one_does(walk_pack, tmp_path):
    (tmp_path / "packs").mkdir()
    walk_pack("lafan1", both=True).save(tmp_path / "packs" / "lafan1.npz")
    one, two = (losses(tmp_path / "packs", tmp_path / f"run{n}", n) for n in (1, 2))
    # They draw other windows of the same walk: the curves are alike, and both fall.
    means = [curve.reshape(4, -1).mean(axis=1) for curve in (one, two)]
    np.testing.assert_allclose(means[1], means[0], rtol=0.1)
    assert max(mean[-1] - mean[0] for mean in means) < 0
