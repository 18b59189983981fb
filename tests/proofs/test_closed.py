"""The package is closed: it imports itself, numpy, python-flint and the standard library, and needs nothing else."""

from __future__ import annotations

import ast
import json
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

import flint
import numpy as np
import pytest

from handfast.model.grasp import Grasp
from handfast.proofs import certificate
from handfast.stability.problem.loads import Loads
from handfast.stability.problem.settings import Settings
from handfast.stability.studies.questions import check, hold, maximum, torques
from tests.stability.search.test_supremum import cup
from tests.support.problems import bell, pinch, table

PACKAGE = Path(__file__).parents[2] / "src" / "handfast" / "proofs"
FILES = sorted(PACKAGE.rglob("*.py"))
MODULES = sorted(path.stem for path in FILES if not path.stem.startswith("__"))
SELF, LIBRARIES = "handfast.proofs", {"numpy", "flint"}
LOADERS = {"importlib", "runpy", "imp", "pkgutil", "zipimport", "pickle", "marshal", "ctypes", "subprocess"}


# --- what is written in it


def imported(tree: ast.AST) -> list[str]:
    """All modules that are imported somewhere in a file, in functions too."""
    out = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            out += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            out.append("." * node.level + (node.module or ""))
    return out


def is_open(module: str) -> bool:
    """Is it neither of the package, nor numpy, python-flint or the standard library, or one that loads others?"""
    top = module.split(".")[0]
    if module == SELF or module.startswith(f"{SELF}."):
        return False
    return top not in LIBRARIES and (top not in sys.stdlib_module_names or top in LOADERS)


def test_what_counts_as_open() -> None:
    lazy = ast.parse("def f():\n    from scipy.linalg import lu\n    import json, handfast.model\n    from . import x")
    assert imported(lazy) == ["scipy.linalg", "json", "handfast.model", "."]
    assert [m for m in imported(lazy) if is_open(m)] == ["scipy.linalg", "handfast.model", "."]
    assert is_open("handfast.proofsandmore")
    assert is_open("importlib.util")
    assert not is_open("handfast.proofs.grasp")
    assert not is_open("collections.abc")


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_imports(path: Path) -> None:
    tree = ast.parse(path.read_text("utf-8"))
    assert [module for module in imported(tree) if is_open(module)] == []
    called = {node.func.id for node in ast.walk(tree) if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)}
    assert called.isdisjoint({"__import__", "eval", "exec", "compile"})


# --- what it needs


@pytest.fixture(scope="session")
def alone(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with numpy, python-flint and a copy of the package: `handfast` is a namespace there."""
    folder = tmp_path_factory.mktemp("alone")
    shutil.copytree(PACKAGE, folder / "handfast" / "proofs", ignore=shutil.ignore_patterns("__pycache__"))
    for library, own in ((np, "numpy.libs"), (flint, "python_flint.libs")):
        place = Path(library.__file__).parent
        (folder / place.name).symlink_to(place)
        if (place.parent / own).is_dir():  # shared libraries that belong to it
            (folder / own).symlink_to(place.parent / own)
    return folder


def python(alone: Path, code: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run code where nothing but the standard library and that folder can be imported."""
    begin = f"import sys\nsys.path.append({str(alone)!r})\nsys.dont_write_bytecode = True\n"
    command = [sys.executable, "-I", "-S", "-c", begin + code, *arguments]
    return subprocess.run(command, capture_output=True, text=True, cwd=alone, timeout=240, check=False)


IMPORT_ALL = """
import importlib, json, pkgutil
import handfast.proofs
found = {}
for module in pkgutil.iter_modules(handfast.proofs.__path__, "handfast.proofs."):
    try:
        importlib.import_module(module.name)
        found[module.name] = ""
    except ImportError as fault:
        found[module.name] = str(fault)
file = getattr(sys.modules["handfast"], "__file__", None)
loaded = [name for name, module in sys.modules.items() if getattr(module, "__file__", None)]
print(json.dumps({"found": found, "loaded": loaded, "handfast": file}))
"""


@pytest.fixture(scope="session")
def loaded(alone: Path) -> dict:
    """What importing every module of the package did."""
    done = python(alone, IMPORT_ALL)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_nothing_else_is_there(alone: Path) -> None:
    for other in ("scipy", "numba", "handfast.model", "handfast.core", "pytest"):
        done = python(alone, f"import {other}")
        assert done.returncode == 1
        assert f"No module named '{other}'" in done.stderr


@pytest.mark.parametrize("module", [*MODULES, "__main__"])
def test_modules_are_imported(module: str, loaded: dict) -> None:
    assert loaded["found"].get(f"{SELF}.{module}", "was not found") == ""


def test_nothing_else_was_loaded(loaded: dict) -> None:
    assert loaded["handfast"] is None  # a namespace: nothing of the rest of the project runs
    open_modules = [name for name in loaded["loaded"] if is_open(name) and name.split(".")[0] not in LOADERS]
    assert open_modules == []
    assert f"{SELF}.grasp" in loaded["loaded"]


# --- what it proves there, a saved answer of each kind


X, Y, DOWN, TWIST = np.eye(6)[0], np.eye(6)[1], -np.eye(6)[2], np.eye(6)[5]


class Saved(Protocol):
    """An answer with its proof."""

    def save(self, path: Path) -> None: ...


def saved(answer: Callable[[], Saved]) -> Callable[[Path], Path]:
    """Asks, and saves the answer in a folder."""

    def made(folder: Path) -> Path:
        answer().save(folder / "answer.json")
        return folder / "answer.json"

    return made


def certificate_file(folder: Path) -> Path:
    """The certificate of an answer, alone."""
    answer = check(bell(), 2.3 * Y)
    question = answer.posed.to_json()
    assert answer.certificate is not None
    data = certificate.file_to_dict(answer.certificate, question)
    (folder / "certificate.json").write_text(json.dumps(data))
    return folder / "certificate.json"


def not_attained() -> Saved:
    """A weight in a conical cup: the torque that it resists is only approached."""
    answer = maximum(Grasp(cup(1.2, 0.05, 0.3)), TWIST, base=5.0 * DOWN, settings=Settings(gap=1e-4))
    assert not answer.attained
    return answer


def not_yet(folder: Path) -> Path | None:
    """A kind of which none is saved here yet."""
    return None


KINDS: dict[str, Callable[[Path], Path | None]] = {  # each saves one in a folder, and returns the file or the folder
    "check that holds": saved(lambda: check(bell(), 2.2 * Y)),
    "check that slips": saved(lambda: check(bell(), 2.3 * Y)),
    "smallest preload": saved(lambda: maximum(bell(), Y)),
    "largest magnitude": saved(lambda: maximum(table(), X, base=10 * DOWN)),
    "largest magnitude that is not attained": saved(not_attained),
    "unbounded": saved(lambda: maximum(pinch(), X)),
    "interval of magnitudes": saved(lambda: maximum(pinch(), Y, interval=True)),
    "smallest commands": saved(lambda: torques(bell(), Y)),
    "smallest sum of commands": saved(lambda: torques(bell(), Y, objective="sum")),
    "no commands suffice": saved(lambda: torques(pinch().with_friction(0.0), Y)),
    "hold": saved(lambda: hold(pinch(), Loads(("along y", "against y"), np.array([0.5 * Y, -0.4 * Y])))),
    "certificate": certificate_file,
    "contacts that are taken": not_yet,
    "contacts that cannot be taken": not_yet,
    "grasp that was found": not_yet,
    "plan": not_yet,
}


@pytest.mark.parametrize("kind", KINDS)
def test_saved_answers_are_proved(kind: str, alone: Path, tmp_path: Path) -> None:
    path = KINDS[kind](tmp_path)
    if path is None:
        pytest.skip(f"none of the kind '{kind}' can be saved yet")
    run = "import runpy\nrunpy.run_module('handfast.proofs', run_name='__main__', alter_sys=True)"
    done = python(alone, run, str(path))
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.splitlines()[-1] == "PROVED"
