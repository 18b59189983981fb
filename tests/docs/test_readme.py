"""The README's first screen: what it is, one picture, and the two commands that .ci/run runs."""

from __future__ import annotations

import os
import re

from handfast import __version__
from tests.support.places import ROOT

README = (ROOT / "README.md").read_text("utf-8")
MAIN_JOB = "python3 -m venv .venv && .venv/bin/pip install . && .venv/bin/handfast demo"
TESTS = "python3 -m venv .venv && .venv/bin/pip install -e '.[dev]' && .venv/bin/pytest"


def test_set_up_is_two_commands() -> None:
    assert [c.strip() for c in re.findall(r"```bash\n(.*?)```", README, re.DOTALL)] == [MAIN_JOB, TESTS]


def test_ci_runs_exactly_these() -> None:
    script = (ROOT / ".ci" / "run").read_text("utf-8").splitlines()
    assert script.index(MAIN_JOB) < script.index(TESTS)
    assert "set -euo pipefail" in script
    assert os.access(ROOT / ".ci" / "run", os.X_OK)


def test_first_screen() -> None:
    screen = README.split("## In Python")[0]
    assert len(re.findall(r"!\[", screen)) == 1
    assert len(screen.splitlines()) < 40


def test_demo_output_is_ignored() -> None:
    assert "/handfast-demo/" in (ROOT / ".gitignore").read_text("utf-8")


def test_changelog_has_this_version() -> None:
    assert f"## [{__version__}]" in (ROOT / "CHANGELOG.md").read_text("utf-8")


def test_python_example_is_short() -> None:
    code = re.search(r"## In Python\n\n```python\n(.*?)```", README, re.DOTALL)
    assert code
    assert len(code[1].strip().splitlines()) <= 10
