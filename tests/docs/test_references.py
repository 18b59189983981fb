"""What pages name exists: files, folders, modules and their names, tests."""

from __future__ import annotations

import ast
import importlib
import importlib.util
import re
from functools import cache
from pathlib import Path

import pytest

from tests.support.places import ROOT

PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
PACKAGE = ROOT / "src" / "handfast"
PLACES = (ROOT, ROOT / "src", PACKAGE, ROOT / "docs", ROOT / "tests")  # what paths in pages are relative to
TREES = [ROOT / name for name in ("src", "tests", "docs", "benchmarks", "tools")]
ROOMS = {p.name for p in PACKAGE.iterdir() if p.is_dir() and p.name not in ("data", "__pycache__")}
FENCED = re.compile(r"^```.*?^```$", re.MULTILINE | re.DOTALL)


@cache
def quoted(page: Path) -> tuple[str, ...]:
    """What stands between backticks, outside of blocks of code."""
    text = FENCED.sub("", page.read_text("utf-8"))
    return tuple(dict.fromkeys(re.findall(r"`([^`\n]+)`", text)))


def files(page: Path) -> list[str]:
    """Paths of Python files, and of anything in a folder of the repository."""
    found = [re.split(r"[:#\s]", said)[0] for said in quoted(page)]
    first = {p.name for p in ROOT.iterdir()} | ROOMS
    named = [x for x in found if re.fullmatch(r"[\w.*/{},-]+", x) and "…" not in x]
    return [
        x
        for x in named
        if x.endswith(".py") or ("/" in x and x.split("/")[0] in first and not x.startswith("handfast/"))
    ]


def exists(path: str) -> bool:
    """As a file or folder whose path ends so, or as several: `a/{b,c}.py`, `a/*.json`."""
    parts = [part.rstrip("/") for part in expanded(path)]
    return all(
        any(next(place.glob(p), None) for place in PLACES) or any(next(t.rglob(p), None) for t in TREES) for p in parts
    )


def expanded(path: str) -> list[str]:
    found = re.search(r"\{([^}]*)\}", path)
    if not found:
        return [path]
    return [x for one in found[1].split(",") for x in expanded(path.replace(found[0], one, 1))]


def modules(page: Path) -> list[str]:
    """Dotted names that begin with the package or with one of its folders."""
    names = [re.split(r"[(\[\s]", said)[0] for said in quoted(page)]
    dotted = [
        n for n in names if re.fullmatch(r"[a-z_]\w*(\.\w+)+", n) and not n.endswith((".py", ".json", ".html", ".md"))
    ]
    return [n for n in dotted if n.split(".")[0] in ROOMS | {"handfast", "benchmarks"}]


def resolves(name: str) -> bool:
    """As a module, or as a name in one."""
    parts = name.split(".")
    parts = parts if parts[0] in ("handfast", "benchmarks") else ["handfast", *parts]
    for k in range(len(parts), 0, -1):
        module = ".".join(parts[:k])
        try:
            found = importlib.util.find_spec(module) is not None
        except ModuleNotFoundError:  # its parent is no package
            found = False
        if found:
            there: object = importlib.import_module(module) if k < len(parts) else None
            return k == len(parts) or _has(there, parts[k:])
    return False


def _has(there: object, names: list[str]) -> bool:
    for name in names:
        fields = getattr(there, "__dataclass_fields__", {}) | getattr(there, "__annotations__", {})
        if not hasattr(there, name):
            return name in fields
        there = getattr(there, name)
    return True


@cache
def known_tests() -> frozenset[str]:
    """Names of test files, without their ending, and of the tests in them."""
    found = set()
    for file in (ROOT / "tests").rglob("test_*.py"):
        names = [x.name for x in ast.walk(ast.parse(file.read_text("utf-8"))) if isinstance(x, ast.FunctionDef)]
        found |= {file.stem, *names}
    return frozenset(found)


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.stem)
def test_what_a_page_names_exists(page: Path) -> None:
    missing = [path for path in files(page) if not exists(path)]
    missing += [name for name in modules(page) if not resolves(name)]
    missing += [said for said in quoted(page) if re.fullmatch(r"test_\w+", said) and said not in known_tests()]
    assert not missing


def test_what_does_not_exist_is_found() -> None:
    assert not exists("src/handfast/stability/no_such_file.py")
    assert not exists("no_such_file.py")
    assert exists("stability/*.py")
    assert exists("tests/{docs,cli}")
    assert resolves("handfast.cli.app.COMMAND_CLASSES")
    assert resolves("core.errors.InputError.at")
    assert not resolves("handfast.cli.app.NOTHING")
    assert not resolves("stability.nothing")
    assert "test_what_does_not_exist_is_found" in known_tests()
