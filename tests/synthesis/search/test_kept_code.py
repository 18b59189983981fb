"""Where numba may keep what it compiles of the synthesis kernel."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.places import ROOT

NUMBA = """
import sys
sys.path.insert(0, sys.argv[1])
from pathlib import Path
from numba import config
config.CACHE_DIR = sys.argv[2]
from handfast.synthesis.search.kernel import balls, local_search
print(local_search.find.stats.cache_path, balls.add.stats.cache_path)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="modes of files are POSIX's")
def test_numba_keeps_code_only_where_nobody_else_can_write(tmp_path: Path) -> None:
    def kept(folder: str) -> str:
        source = str(ROOT / "src")
        run = [sys.executable, "-c", NUMBA, source, folder]
        return subprocess.run(run, capture_output=True, text=True, check=True, cwd=tmp_path).stdout

    safe, open_ = tmp_path / "safe", tmp_path / "open"
    safe.mkdir()
    assert kept(str(safe)).count(str(safe)) == 2
    assert kept("here").split() == ["None", "None"]
    assert kept("").count("__pycache__") == 2
    kept(str(open_))
    for folder in open_.iterdir():
        folder.chmod(0o777)
    assert kept(str(open_)).split() == ["None", "None"]
