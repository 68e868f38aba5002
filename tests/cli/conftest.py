"""The command line called in this process: quick, and its output is caught."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from interpose.cli import main

EXAMPLE = Path(__file__).parents[2] / "src" / "interpose" / "examples" / "walk.bvh"


@dataclass
class Run:
    """What a call of the command line did."""

    code: int
    out: str
    err: str

    @property
    def json(self) -> Any:
        return json.loads(self.out)


@pytest.fixture
def run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Callable[..., Run]:
    """run("fill", "take.bvh", ...) in an empty folder."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("INTERPOSE_DEBUG", raising=False)

    def call(*tokens: str | Path) -> Run:
        code = main([str(token) for token in tokens])
        caught = capsys.readouterr()
        return Run(code, caught.out, caught.err)

    return call


@pytest.fixture
def take(tmp_path: Path) -> Path:
    """A real clip of 163 frames in the current folder, as take.bvh."""
    path = tmp_path / "take.bvh"
    shutil.copy(EXAMPLE, path)
    return path
