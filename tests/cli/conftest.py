"""The folder in which a command runs."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.support.program import planar


@pytest.fixture
def grasp(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """The name of the grasp file of `planar` in a new current folder."""
    monkeypatch.chdir(tmp_path)
    Path("grasp.json").write_text(json.dumps(planar()))
    return "grasp.json"
