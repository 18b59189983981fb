"""Hands by name from collections of robot models that are installed beside this package: the file behind a name.

Nothing is downloaded here. What a collection has not put into its own cache is refused, with the command that does.
"""

from __future__ import annotations

import os
import re
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from handfast.core.errors import InputError, unknown_name

MENAGERIE = "menagerie:"
DESCRIPTION = re.compile(r"[a-z0-9_]+_description(:[A-Z0-9_]+)?")
EXTRA = "pip install 'handfast[hands]'"


def collected(name: str) -> Path | None:
    """The file that a name of a collection stands for; None for what is no such name.

    `menagerie:robot` and `menagerie:robot/file` are of the MuJoCo Menagerie: below the folder that the environment
    variable MENAGERIE_ROOT names, else in the cache of the package mujoco-menagerie. `..._description` is of the
    package robot_descriptions, in its cache; `..._description:MJCF_PATH_RIGHT` takes another of its paths.

    Raises:
        InputError: the package is not installed, there is no such robot or file, or it is not in the cache: what to
            run is said.
    """
    if name.startswith(MENAGERIE):
        return _of_menagerie(name)
    if DESCRIPTION.fullmatch(name) and not os.path.exists(name):
        return _of_descriptions(name)
    return None


def _of_menagerie(name: str) -> Path:
    robot, _, entry = name.removeprefix(MENAGERIE).partition("/")
    root = os.environ.get("MENAGERIE_ROOT")
    if root:
        folder, default = Path(root) / robot, ""
        if not robot or not folder.is_dir():
            known = sorted(p.name for p in Path(root).iterdir() if p.is_dir()) if os.path.isdir(root) else []
            raise unknown_name("robot", robot, known, field=f"MENAGERIE_ROOT={root}").at(name)
    else:
        folder, default = _menagerie_cache(name, robot)
    models = sorted(p.stem for p in folder.glob("*.xml"))
    if not entry:
        plain = [m for m in models if "scene" not in m and "mjx" not in m and "keyframe" not in m]
        entry = default if default in models else plain[0] if len(plain) == 1 else ""
        if not entry:
            problem = f"has several models; say which: {', '.join(f'{MENAGERIE}{robot}/{m}' for m in plain or models)}"
            raise InputError(problem, source=name)
    if entry.removesuffix(".xml") not in models:
        raise unknown_name("model", entry, models).at(name)
    return folder / f"{entry.removesuffix('.xml')}.xml"


def _menagerie_cache(name: str, robot: str) -> tuple[Path, str]:
    """The folder of a robot in the package's cache, and the name of its default model."""
    if find_spec("mujoco_menagerie") is None:
        right = f"{EXTRA}, or set MENAGERIE_ROOT to a copy of the Menagerie"
        raise InputError(f"needs the package mujoco-menagerie; {right}", source=name)
    import mujoco_menagerie

    known = mujoco_menagerie.names()
    if robot not in known:
        raise unknown_name("robot", robot, known).at(name)
    found: Any = mujoco_menagerie.get(robot)
    cache = mujoco_menagerie.Cache()
    if not cache.is_cached(found):
        run = f"python -c \"import mujoco_menagerie as m; m.prefetch(['{robot}'])\""
        raise InputError(f"is not in the cache of mujoco-menagerie; run {run}", source=name)
    return Path(cache.model_path(found)), Path(found.entry(found.default_model).file).stem


def _of_descriptions(name: str) -> Path:
    module, _, attribute = name.partition(":")
    if find_spec("robot_descriptions") is None:
        raise InputError(f"needs the package robot_descriptions; {EXTRA}", source=name)
    from robot_descriptions._descriptions import DESCRIPTIONS

    if module not in DESCRIPTIONS:
        hands = sorted(n for n, d in DESCRIPTIONS.items() if "end_effector" in d.tags)
        raise unknown_name("description", module, hands).at(name)
    paths = _without_network(module, name)
    kinds = [k for k in ("MJCF_PATH", "URDF_PATH") if k in paths]
    if attribute and attribute not in paths:
        raise unknown_name("path", attribute, sorted(paths)).at(name)
    if not attribute and not kinds:
        raise InputError("gives neither a URDF nor an MJCF file (a xacro file is not read)", source=name)
    return Path(paths[attribute or kinds[0]])


def _without_network(module: str, name: str) -> dict[str, str]:
    """The paths that a description's module names, imported while its package may clone nothing."""
    from importlib import import_module

    from robot_descriptions import _cache

    def cached(repository: str, commit: str | None = None) -> str:
        default = "~/.cache/robot_descriptions"
        cache = os.path.expanduser(os.environ.get("ROBOT_DESCRIPTIONS_CACHE", default))
        folder = _cache.REPOSITORIES[repository].cache_path
        place = os.path.join(cache, f"{folder}-{commit}/{folder}" if commit else folder)
        if not os.path.isdir(place):
            run = f"python -m robot_descriptions pull {module}"
            raise InputError(f"is not in the cache of robot_descriptions; run {run}", source=name)
        return place

    clone = _cache.clone_to_cache
    _cache.clone_to_cache = cached
    try:
        found = import_module(f"robot_descriptions.{module}")
    finally:
        _cache.clone_to_cache = clone
    return {k: v for k, v in vars(found).items() if k.startswith(("MJCF_PATH", "URDF_PATH")) and isinstance(v, str)}
