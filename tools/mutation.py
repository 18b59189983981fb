"""Plant small faults in the code on which every proof rests, and see which of them no test notices.

    python tools/mutation.py                     # all parts, one after the other
    python tools/mutation.py model contacts      # some
    python tools/mutation.py model --survivors   # show what is alive, run nothing
    python tools/mutation.py model --fresh       # forget what is known about it
    python tools/mutation.py model --sample 300  # no more than these, drawn at random, the same ones each time
    python tools/mutation.py model --sample 300 --seed 1  # others

mutmut plants the faults (mutants) and runs, for each, the tests that reach the function. A part has a folder of its
own in build/mutation, where mutmut keeps what it found: a run that was stopped goes on from there, a changed function
is mutated anew, and whenever a test of the part has changed all that was alive is tried again. Scores and survivors
go to benchmarks/results/mutation.json; docs/testing.md says which of them are equivalent to the original.

Not counted, alive or dead: mutants that change nothing but words of a message, and `strict` of zip, which only
guards against lists of unequal lengths. Not planted: faults outside functions, in properties and in functions
with other decorators, compiled ones among them (a mutmut mutant is chosen while Python runs).
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

from mutmut.mutation.data import SourceFileMutationData
from mutmut.stats import status_by_exit_code

ROOT = Path(__file__).parents[1]
WORK = ROOT / "build" / "mutation"
RESULTS = ROOT / "benchmarks" / "results" / "mutation.json"
COPIED = ("src", "tests", "benchmarks", "tools", "pyproject.toml", "README.md")
DEAD = {"killed", "timeout", "segfault", "suspicious"}
UNKNOWN = "not checked"


@dataclass(frozen=True)
class Part:
    """Files of src/handfast whose mutants are tried together, and the files of tests/ that concern them.

    `without` names tests among these that ask what a fresh Python imports: mutated files import mutmut.
    """

    sources: tuple[str, ...]
    tests: tuple[str, ...]
    without: tuple[str, ...] = ()


CHECKER = ("checker", "claim", "farkas", "leaf_systems", "exact_rows", "leaf_rows", "certificate")
PARTS = {
    "model": Part(("stability/model.py",), ("stability/test_model.py", "stability/test_residual_scales.py")),
    "contacts": Part(("geometry/contacts.py",), ("geometry/test_contacts.py",)),
    "synthesis-interval": Part(("proofs/intervals.py",), ("proofs/test_intervals.py", "proofs/test_derivatives.py")),
    "synthesis-checker": Part(
        tuple(f"proofs/{name}.py" for name in ("chains", "contact_equations", "regions")),
        ("proofs/test_chains.py", "proofs/test_configurations.py", "proofs/test_cylinder_side_proofs.py"),
    ),
    "synthesis-verify": Part(
        ("proofs/configurations.py",), ("proofs/test_configuration_reports.py", "proofs/test_configurations.py")
    ),
    "synthesis-none": Part(("proofs/impossibility.py",), ("proofs/test_impossibility.py",)),
    "synthesis-claims": Part(
        ("proofs/synthesis.py", "proofs/tasks.py"),
        ("proofs/test_synthesis.py", "proofs/test_tasks.py"),
        ("proofs/test_synthesis.py::test_nothing_but_proofs_numpy_and_flint_is_needed",),
    ),
    "grasp-file": Part(("model/grasp_file.py",), ("model/test_grasp_file.py",)),
    "urdf": Part(("model/hand/urdf.py",), ("model/test_urdf.py", "model/test_hand.py")),
    "mjcf": Part(("model/hand/mjcf.py",), ("model/test_mjcf.py", "model/test_hand.py")),
    # others of its tests take a minute for each mutant that is alive: the score is what those without them kill
    "stability-checker": Part(
        tuple(f"stability/certify/{name}.py" for name in CHECKER),
        (
            "stability/certify/test_claim.py",
            "stability/certify/test_leaf_margins.py",
            "stability/certify/test_leaf_rows.py",
            "stability/certify/test_leaf_systems.py",
            "stability/certify/test_systems_of_certificates.py",
            "stability/certify/test_proved_margins.py",
            "stability/certify/test_exact_rows.py",
            "stability/certify/test_legal_rows.py",
            "stability/certify/test_certificate.py",
            "stability/certify/test_checker_faults.py",
            "stability/certify/test_certificate_file.py",
            "stability/test_first_version.py",
        ),
    ),
}


def main() -> int:
    words = (__doc__ or "").splitlines()[0]
    parser = argparse.ArgumentParser(description=words)
    parser.add_argument("parts", nargs="*", default=list(PARTS), metavar="part", help=", ".join(PARTS))
    parser.add_argument("--survivors", action="store_true", help="show what is alive, run nothing")
    parser.add_argument("--fresh", action="store_true", help="forget what is known")
    parser.add_argument("--sample", type=int, metavar="N", help="try only N mutants, drawn at random")
    parser.add_argument("--seed", type=int, default=0, metavar="K", help="of the sample (default: 0)")
    args = parser.parse_args()
    for name in args.parts:
        if name not in PARTS:
            parser.error(f"there is no part '{name}'; there are {', '.join(PARTS)}")
    for name in args.parts:
        part, folder = PARTS[name], WORK / name
        if args.survivors:
            if not (folder / "mutants").is_dir():
                parser.error(f"{name} was not run yet")
            print(*(m.diff for m in mutants(part, folder) if m.counts and not m.dead and m.status != UNKNOWN), sep="\n")
            continue
        if args.fresh and folder.is_dir():
            shutil.rmtree(folder)
        prepare(part, folder)
        chosen = sample(part, folder, args.sample, args.seed) if args.sample else None
        # mutmut runs all that it is told by name, what it knows already too
        waiting = [m.name for m in mutants(part, folder) if m.name in (chosen or ()) and m.status == UNKNOWN]
        if waiting or chosen is None:
            run(folder, waiting or None)
        found = [m for m in mutants(part, folder) if chosen is None or m.name in chosen]
        write(name, part, found)
        counted = [m for m in found if m.counts]
        print(f"{name}: {sum(m.dead for m in counted)} of {len(counted)} killed", flush=True)
    return 0


def prepare(part: Part, folder: Path) -> None:
    """Bring a part's folder up to date with the repository, and let what tests might kill now be tried again."""
    folder.mkdir(parents=True, exist_ok=True)
    mutated = {str(Path("src") / "handfast" / source) for source in part.sources}
    for target in (folder, folder / "mutants"):
        for name in COPIED:
            for file in sorted((ROOT / name).rglob("*")) if (ROOT / name).is_dir() else [ROOT / name]:
                inside = str(file.relative_to(ROOT))
                # mutmut makes the mutated files itself, and numba's machine code belongs to one path
                if file.is_dir() or "__pycache__" in file.parts or (target != folder and inside in mutated):
                    continue
                copy = target / inside
                if not copy.exists() or copy.read_bytes() != file.read_bytes():
                    copy.parent.mkdir(parents=True, exist_ok=True)
                    shutil.copy2(file, copy)
    shared = folder / "shared"
    if not shared.exists() and (ROOT.parent / "shared").is_dir():
        shared.symlink_to(ROOT.parent / "shared")
    tests = [f"tests/{name}" for name in part.tests if (ROOT / "tests" / name).exists()]
    lists = {
        "source_paths": ["src"],
        "only_mutate": sorted(mutated),
        "pytest_add_cli_args": ["-n", "0", "-p", "no:cacheprovider", "-p", "quick_first"]
        + [word for test in part.without for word in ("--deselect", f"tests/{test}")],
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


def sample(part: Part, folder: Path, size: int, seed: int) -> list[str]:
    """Some mutants that count. mutmut plants them all before it finds that there is none of this name."""
    run(folder, ["none"], check=False)
    names = sorted(m.name for m in mutants(part, folder) if m.counts)
    return random.Random(seed).sample(names, min(size, len(names)))


def run(folder: Path, names: Sequence[str] | None = None, check: bool = True) -> None:
    """mutmut on what is not known yet, or on these, in one process: others may be at work."""
    inherited = os.environ.get("PYTHONPATH", "").split(os.pathsep)
    ours = [str(folder / "mutants" / name) for name in ("src", "tools")]
    paths = [*ours, *(p for p in inherited if p and Path(p).resolve() != ROOT / "src")]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(paths)}
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
        if isinstance(node.func, ast.Name) and node.func.id in ("InputError", "BadCertificate", "ClaimRefused"):
            node = Words().visit(node)
        if isinstance(node.func, ast.Name) and node.func.id == "zip":
            node.keywords = []
        return self.generic_visit(node)


class Words(ast.NodeTransformer):
    """Takes out text."""

    def visit_Constant(self, node: ast.Constant) -> ast.AST:
        return ast.Constant("") if isinstance(node.value, str) else node


def write(name: str, part: Part, found: list[Mutant]) -> None:
    """Score and survivors of a part, beside those of the others."""
    data: dict[str, Any] = json.loads(RESULTS.read_text("utf-8")) if RESULTS.exists() else {}
    counted = [m for m in found if m.counts]
    dead = sum(m.dead for m in counted)
    data[name] = {
        "sources": list(part.sources),
        "tests": list(part.tests),
        "mutants": len(counted),
        "killed": dead,
        "score": round(dead / len(counted), 4) if counted else None,
        "by_status": dict(Counter(m.status for m in counted)),
        "words_only": len(found) - len(counted),
        "survivors": [m.diff.splitlines() for m in counted if not m.dead],
    }
    RESULTS.write_text(json.dumps({k: data[k] for k in PARTS if k in data}, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
