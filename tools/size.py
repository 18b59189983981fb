"""How large the package is, in the numbers of the table in docs/architecture.md.

python tools/size.py
"""

from __future__ import annotations

import ast
import importlib.metadata as installed
from collections.abc import Iterable
from pathlib import Path

from packaging.requirements import Requirement

SOURCES = Path(__file__).parents[1] / "src" / "handfast"
MANY = 8  # parameters
SMALL = 60  # lines


def parameters(function: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    """Of a function, without self or cls."""
    a = function.args
    named = [x.arg for x in (*a.posonlyargs, *a.args)]
    owned = int(named[:1] in (["self"], ["cls"]))
    return len(named) + len(a.kwonlyargs) + (a.vararg is not None) + (a.kwarg is not None) - owned


def counted(texts: Iterable[str]) -> dict[str, int]:
    """Files, lines, functions with more than `MANY` parameters, uses of `Any`, files below `SMALL` lines."""
    out = dict.fromkeys(("files", "lines", "functions with more than 8 parameters", "Any", "files below 60 lines"), 0)
    for text in texts:
        lines = text.count("\n")
        nodes = list(ast.walk(ast.parse(text)))
        functions = [n for n in nodes if isinstance(n, ast.FunctionDef | ast.AsyncFunctionDef)]
        many = sum(parameters(f) > MANY for f in functions)
        any_ = sum(isinstance(n, ast.Name) and n.id == "Any" for n in nodes)
        for name, value in zip(out, (1, lines, many, any_, int(0 < lines < SMALL)), strict=True):
            out[name] += value
    return out


def shared_constants(sources: Path) -> int:
    """Names of constants that files of more than one package define."""
    packages: dict[str, set[str]] = {}
    for path in sources.rglob("*.py"):
        for node in ast.parse(path.read_text("utf-8")).body:
            if isinstance(node, ast.Assign | ast.AnnAssign):
                targets = node.targets if isinstance(node, ast.Assign) else [node.target]
                for name in (n.id for t in targets for n in ast.walk(t) if isinstance(n, ast.Name) and n.id.isupper()):
                    packages.setdefault(name, set()).add(path.relative_to(sources).parts[0])
    return sum(len(some) > 1 for some in packages.values())


def megabytes(package: str) -> float:
    """[MB] of what a package needs to run, as it is installed here, without bytecode and without itself."""
    sizes: dict[str, int] = {}
    left = [package]
    while left:
        name = left.pop().lower().replace("_", "-")
        if name in sizes:
            continue
        found = installed.distribution(name)
        paths = [Path(str(p.locate())) for p in found.files or [] if p.suffix != ".pyc"]
        sizes[name] = sum(p.stat().st_size for p in paths if p.exists()) if name != package else 0
        needed = map(Requirement, found.requires or [])
        left += [r.name for r in needed if r.marker is None or r.marker.evaluate({"extra": ""})]
    return sum(sizes.values()) / 1e6


if __name__ == "__main__":
    import handfast

    shown: dict[str, object] = dict(counted(p.read_text("utf-8") for p in SOURCES.rglob("*.py")))
    shown |= {"public names": len(handfast.__all__), "packages at run time [MB]": round(megabytes("handfast"))}
    shown["names of constants in more than one package"] = shared_constants(SOURCES)
    for what, count in shown.items():
        print(f"{what:45} {count}")
