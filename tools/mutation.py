"""Plant small faults in the code, package by package, and see which of them the package's own tests do not notice.

    python tools/mutation.py                         # all packages, one after the other, and the kernels
    python tools/mutation.py measures planning       # some
    python tools/mutation.py stability/problem/model.py      # one module, by the tests of its package
    python tools/mutation.py measures --survivors    # show what is alive, run nothing
    python tools/mutation.py measures --fresh        # forget what is known about it
    python tools/mutation.py measures --sample 300   # no more than these, drawn at random, the same ones each time
    python tools/mutation.py measures --sample 300 --seed 1  # others
    python tools/mutation.py planning --quick 2      # by tests that take 2 s at most: the others could only kill more
    python tools/mutation.py kernels                 # faults in the compiled functions, see kernel_faults.py

mutmut plants the faults (mutants) and runs, for each, the tests that reach the function. A part has a folder of its
own in build/mutation, where mutmut keeps what it found: a run that was stopped goes on from there, a changed function
is mutated anew, and whenever a test of the part has changed all that was alive is tried again. Scores and survivors
go to benchmarks/results/mutation.json; docs/testing.md says which of them are equivalent to the original.

A package is a folder of src/handfast with the modules that are in it, not below it. Its tests are the files in the
folder of the same name in tests/, or in the folders below that, or in the next folder above that has some.

Not counted, alive or dead: mutants that change nothing but words of a message, and `strict` of zip, which only
guards against lists of unequal lengths. Not planted: faults outside functions, in properties and in functions
with other decorators, compiled ones among them (a mutmut mutant is chosen while Python runs): those of the kernels are
in `kernel_faults.py`.
"""

from __future__ import annotations

import argparse
import ast
import hashlib
import json
import os
import random
import shutil
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from difflib import unified_diff
from pathlib import Path
from typing import Any

import kernel_faults
from mutmut.mutation.data import SourceFileMutationData
from mutmut.stats import status_by_exit_code
from quick_first import LONGEST

ROOT = Path(__file__).parents[1]
SOURCES = ROOT / "src" / "handfast"
WORK = ROOT / "build" / "mutation"
RESULTS = ROOT / "benchmarks" / "results" / "mutation.json"
COPIED = ("src", "tests", "benchmarks", "docs", "tools", "pyproject.toml", "README.md", "CHANGELOG.md", "mkdocs.yml")
DEAD = {"killed", "timeout", "segfault", "suspicious"}
UNKNOWN = "not checked"
# their texts are words of messages
TOLD = ("InputError", "BadCertificate", "ClaimRefused", "NotMeasured", "frozen", "BadFile", "Refused", "refuse")


# mutated files import mutmut: left out are tests that ask what a fresh Python imports
WITHOUT = ("proofs/test_closed.py", "proofs/test_synthesis.py")
# what compiles the kernels: it would be compiled with its mutants
NOT_MUTATED = ("core/compiled.py", "core/compiler.py")
KERNELS = "kernels"


@dataclass(frozen=True)
class Part:
    """Files of src/handfast whose mutants are tried together, and the files of tests/ that judge them."""

    sources: tuple[str, ...]
    tests: tuple[str, ...]


def packages() -> dict[str, Part]:
    """Each package by its path, but for kernels and the modules beside all packages, which have no tests alone."""
    found = {}
    for folder in sorted(p for p in SOURCES.rglob("*") if p.is_dir() and p.name != "kernel"):
        name = folder.relative_to(SOURCES)
        files = sorted(str(name / file.name) for file in folder.glob("*.py"))
        sources = tuple(f for f in files if f not in NOT_MUTATED and not f.endswith("__init__.py"))
        if sources:
            found[str(name)] = Part(sources, tests_of(name))
    return found


def tests_of(package: Path) -> tuple[str, ...]:
    """The files with tests of a package, in tests/."""
    for folder in (package, *package.parents):
        beside = ROOT / "tests" / folder
        files = sorted(beside.glob("test_*.py")) or sorted(beside.rglob("test_*.py"))
        if files:
            return tuple(str(file.relative_to(ROOT / "tests")) for file in files)
    raise SystemExit(f"{package} has no tests")


def part_named(name: str) -> Part | None:
    """A package, or a single module of one."""
    known = packages()
    if name in known:
        return known[name]
    part = known.get(str(Path(name).parent))
    return Part((name,), part.tests) if part and name in part.sources else None


def main() -> int:
    words = (__doc__ or "").splitlines()[0]
    parser = argparse.ArgumentParser(description=words)
    known = [*packages(), KERNELS]
    parser.add_argument("parts", nargs="*", default=known, metavar="part", help=", ".join(known))
    parser.add_argument("--survivors", action="store_true", help="show what is alive, run nothing")
    parser.add_argument("--fresh", action="store_true", help="forget what is known")
    parser.add_argument("--sample", type=int, metavar="N", help="try only N mutants, drawn at random")
    parser.add_argument("--seed", type=int, default=0, metavar="K", help="of the sample (default: 0)")
    parser.add_argument("--quick", type=float, metavar="S", help="leave out tests that take longer than S seconds")
    args = parser.parse_args()
    for name in args.parts:
        if name != KERNELS and part_named(name) is None:
            parser.error(f"there is no package or module '{name}'; there are {', '.join(known)}")
    for name in args.parts:
        folder = WORK / name.replace("/", ".")
        if args.fresh and not args.survivors and folder.is_dir():
            shutil.rmtree(folder)
        if name == KERNELS:
            try_kernels(folder, args.sample, args.seed, args.survivors)
            continue
        part = part_named(name)
        assert part
        if args.survivors:
            if not (folder / "mutants").is_dir():
                parser.error(f"{name} was not run yet")
            print(*(m.diff for m in mutants(part, folder) if m.counts and not m.dead and m.status != UNKNOWN), sep="\n")
            continue
        prepare(part, folder)
        chosen = sample(part, folder, args.sample, args.seed, args.quick) if args.sample else None
        # mutmut runs all that it is told by name, what it knows already too
        waiting = [m.name for m in mutants(part, folder) if m.name in (chosen or ()) and m.status == UNKNOWN]
        if waiting or chosen is None:
            run(folder, waiting or None, quick=args.quick)
        found = [m for m in mutants(part, folder) if chosen is None or m.name in chosen]
        counted = [m for m in found if m.counts]
        how = {"sample": args.sample, "seed": args.seed if args.sample else None, "longest_test": args.quick}
        write(name, described(part, found) | how)
        print(f"{name}: {sum(m.dead for m in counted)} of {len(counted)} killed", flush=True)
    return 0


def try_kernels(folder: Path, size: int | None, seed: int, survivors: bool) -> None:
    """Try faults of kernels and write what came of them, or show those that are alive."""
    found = kernel_faults.run(folder, size, seed, only_known=survivors)
    alive = [f"{f.name}\n-{f.old}\n+{f.new}" for f, killed in found if not killed]
    if survivors:
        print(*alive, sep="\n")
        return
    entry = {"killed": len(found) - len(alive), "faults": len(found), "known": len(kernel_faults.FAULTS)}
    write(KERNELS, entry | {"survivors": [text.splitlines() for text in alive]})
    print(f"{KERNELS}: {entry['killed']} of {entry['faults']} killed", flush=True)


def prepare(part: Part, folder: Path) -> None:
    """Bring a part's folder up to date with the repository, and let what tests might kill now be tried again."""
    folder.mkdir(parents=True, exist_ok=True)
    mutated = {str(Path("src") / "handfast" / source) for source in part.sources}
    kernel_faults.copy(COPIED, folder)
    kernel_faults.copy(COPIED, folder / "mutants", without=frozenset(mutated))  # mutmut makes these itself
    shared = folder / "shared"
    if not shared.exists() and (ROOT.parent / "shared").is_dir():
        shared.symlink_to(ROOT.parent / "shared")
    tests = [f"tests/{name}" for name in part.tests]
    lists = {
        "source_paths": ["src"],
        "only_mutate": sorted(mutated),
        "pytest_add_cli_args": ["-n", "0", "-p", "no:cacheprovider", "-p", "quick_first"]
        + [word for test in WITHOUT for word in ("--deselect", f"tests/{test}")],
        "pytest_add_cli_args_test_selection": tests,
    }
    text = "".join(f"{key} =\n" + "".join(f"    {v}\n" for v in values) for key, values in lists.items())
    text += "use_git_change_detection = false\ntrack_dependencies = false\n"
    (folder / "setup.cfg").write_text(f"[mutmut]\n{text}", encoding="utf-8")

    digest = hashlib.sha256(b"".join((ROOT / test).read_bytes() for test in tests)).hexdigest()
    known = folder / "tests.sha256"
    if not known.exists() or known.read_text() != digest:
        (folder / "mutants" / "mutmut-stats.json").unlink(missing_ok=True)
        for data in records(part, folder):
            codes = data.exit_code_by_key
            data.exit_code_by_key = {k: v if status_by_exit_code[v] in DEAD else None for k, v in codes.items()}
            (folder / data.meta_path).write_text(
                json.dumps(
                    {
                        "exit_code_by_key": data.exit_code_by_key,
                        "hash_by_function_name": data.hash_by_function_name,
                        "type_check_error_by_key": data.type_check_error_by_key,
                        "durations_by_key": data.durations_by_key,
                        "estimated_durations_by_key": data.estimated_time_of_tests_by_mutant,
                    }
                )
            )
        known.write_text(digest)


def sample(part: Part, folder: Path, size: int, seed: int, quick: float | None) -> list[str]:
    """Some mutants that count. mutmut plants them all before it finds that there is none of this name."""
    run(folder, ["none"], check=False, quick=quick)
    names = sorted(m.name for m in mutants(part, folder) if m.counts)
    return random.Random(seed).sample(names, min(size, len(names)))


def run(folder: Path, names: Sequence[str] | None = None, check: bool = True, quick: float | None = None) -> None:
    """mutmut on what is not known yet, or on these, in one process: others may be at work."""
    inherited = os.environ.get("PYTHONPATH", "").split(os.pathsep)
    ours = [str(folder / "mutants" / name) for name in ("src", "tools")]
    paths = [*ours, *(p for p in inherited if p and Path(p).resolve() != ROOT / "src")]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(paths)}
    if quick is not None:
        environment[LONGEST] = str(quick)
    command = [sys.executable, "-m", "mutmut", "run", "--max-children", "1", *(names or ())]
    with (folder / "log.txt").open("w") as log:
        failed = subprocess.run(command, cwd=folder, env=environment, stdout=log, stderr=log).returncode
    if failed and check:
        raise SystemExit(f"mutmut failed; see {folder / 'log.txt'}")


# --- what came of it ----------------------------------------------------------------------------


@dataclass(frozen=True)
class Mutant:
    """name: mutmut's. status: mutmut's. diff: of the function's lines. counts: whether it is a fault to be found."""

    name: str
    source: str
    status: str
    diff: str
    counts: bool

    @property
    def dead(self) -> bool:
        return self.status in DEAD


def records(part: Part, folder: Path) -> Iterator[SourceFileMutationData]:
    """mutmut's notes of each mutated file."""
    for source in part.sources:
        data = SourceFileMutationData(path=Path("src") / "handfast" / source)
        data.meta_path = folder / data.meta_path
        if data.meta_path.exists():
            data.load()
            yield data


def mutants(part: Part, folder: Path) -> Iterator[Mutant]:
    """All of a part as far as it was run."""
    for data in records(part, folder):
        tree = ast.parse((folder / "mutants" / data.path).read_text("utf-8"))
        functions = {n.name: n for n in ast.walk(tree) if isinstance(n, ast.FunctionDef) and "__mutmut_" in n.name}
        originals: dict[str, tuple[list[str], str]] = {}
        for key, code in data.exit_code_by_key.items():
            name = key.rpartition(".")[2]
            original = name.partition("__mutmut_")[0] + "__mutmut_orig"
            if original not in originals:
                originals[original] = _said(functions[original])
            (before, counted), (after, counts) = originals[original], _said(functions[name])
            diff = unified_diff(before, after, n=0, lineterm="")
            changed = "\n".join(line for line in list(diff)[2:] if not line.startswith("@@"))
            yield Mutant(key, str(data.path), status_by_exit_code[code], f"{key}\n{changed}", counts != counted)


def _said(function: ast.FunctionDef) -> tuple[list[str], str]:
    """A function's lines, whatever its name is, and all that counts of it."""
    function.name = "f"
    return ast.unparse(function).splitlines(), ast.dump(Silent().visit(function))


class Silent(ast.NodeTransformer):
    """Takes out what does not count: the words of messages and `strict` of zip."""

    def visit_Raise(self, node: ast.Raise) -> ast.AST:
        return Words().visit(node)

    def visit_JoinedStr(self, node: ast.JoinedStr) -> ast.AST:
        return Words().visit(node)

    def visit_Call(self, node: ast.Call) -> ast.AST:
        if isinstance(node.func, ast.Name) and node.func.id in TOLD:
            node = Words().visit(node)
        if isinstance(node.func, ast.Name) and node.func.id == "zip":
            node.keywords = []
        return self.generic_visit(node)


class Words(ast.NodeTransformer):
    """Takes out text."""

    def visit_Constant(self, node: ast.Constant) -> ast.AST:
        return ast.Constant("") if isinstance(node.value, str) else node


def described(part: Part, found: list[Mutant]) -> dict[str, Any]:
    """Score and survivors of a part."""
    counted = [m for m in found if m.counts]
    dead = sum(m.dead for m in counted)
    return {
        "sources": list(part.sources),
        "tests": list(part.tests),
        "mutants": len(counted),
        "killed": dead,
        "score": round(dead / len(counted), 4) if counted else None,
        "by_status": dict(Counter(m.status for m in counted)),
        "words_only": len(found) - len(counted),
        "survivors": [m.diff.splitlines() for m in counted if not m.dead],
    }


def write(name: str, entry: dict[str, Any]) -> None:
    """What came of a part, beside the others."""
    data: dict[str, Any] = json.loads(RESULTS.read_text("utf-8")) if RESULTS.exists() else {}
    RESULTS.write_text(json.dumps(dict(sorted((data | {name: entry}).items())), indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
