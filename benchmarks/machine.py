"""What a benchmark ran on: cores and versions, nothing that names a machine."""

from __future__ import annotations

import os
import platform
import subprocess
from importlib import metadata
from pathlib import Path
from typing import Any

PACKAGES = ("handfast", "numpy", "scipy", "mujoco", "pyscipopt", "gurobipy")


def describe() -> dict[str, Any]:
    """Processor architecture, cores, Python and package versions."""
    versions = {}
    for package in PACKAGES:
        try:
            versions[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            versions[package] = None
    return {
        "architecture": platform.machine(),
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        "packages": versions,
    }


def revision(checkout: Path) -> str:
    """Of a checkout, by git; whether anything in it is changed since."""
    git = ["git", "-C", str(checkout), "describe", "--always", "--dirty"]
    return subprocess.run(git, capture_output=True, text=True, check=True).stdout.strip()
