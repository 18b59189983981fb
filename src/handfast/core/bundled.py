"""How files are named: what comes with the package (grasps, hands, objects, configurations, tasks, regions of hands) by
its name, others by their paths."""

from __future__ import annotations

import json
import os
from importlib import resources
from pathlib import Path
from typing import Any

from handfast.core.errors import InputError, nearest

BUNDLED_KINDS = ("grasps", "hands", "objects", "configurations", "tasks", "hand_regions")


def folder(kind: str) -> Path:
    """Where the bundled files of a kind are."""
    return Path(str(resources.files("handfast"))) / "data" / kind


def names(kind: str) -> list[str]:
    """Names of the bundled things of a kind."""
    if not folder(kind).is_dir():
        return []
    files = [f for f in folder(kind).iterdir() if f.is_file() and not f.name.startswith((".", "_"))]
    return sorted({f.stem for f in files})


def resolve(kind: str, name: str) -> str:
    """The path behind a bundled name; anything else is returned as it is, a path for the loader to judge.

    A name without ending that is neither a file nor bundled is an `InputError` that lists the bundled ones, and says
    so where the name is that of something else, such as a hand where a grasp is needed.
    """
    for file in sorted(folder(kind).glob(f"{name}.*")) if name in names(kind) else []:
        return str(file)
    if not os.path.exists(name) and not Path(name).suffix:
        known, what = names(kind), _singular(kind)
        listed = f"bundled: {', '.join(known) or 'none'}"
        others = [other for other in BUNDLED_KINDS if name in names(other)]
        if others:
            problem = f"is a bundled {_singular(others[0])}; a {what} is needed; {listed}"
        else:
            problem = f"no such file, and no bundled {what} of that name; {listed}{nearest(name, known)}"
        raise InputError(problem, source=name)
    return name


def _singular(kind: str) -> str:
    return kind.removesuffix("s").replace("_", " ")


def read(kind: str, name: str) -> dict[str, Any]:
    """A bundled JSON file as it is, {} if it is something else."""
    file = Path(resolve(kind, name))
    return json.loads(file.read_text("utf-8")) if file.suffix == ".json" else {}


def relative_path(path: str | Path, folder: str | Path) -> str:
    """How a file in `folder` names another one, with "/"; as it is named where that is on another drive."""
    try:
        return Path(os.path.relpath(path, folder)).as_posix()
    except ValueError:
        return Path(path).as_posix()
