"""Plant small faults in the code, package by package, and see which of them the package's own tests do not notice.

    python tools/mutation.py                         # all packages, one after the other, and the kernels
    python tools/mutation.py measures planning       # some
    python tools/mutation.py stability/problem/model.py      # one module, by the tests of its package
    python tools/mutation.py measures --survivors    # show what is alive, run nothing
    python tools/mutation.py measures --sample 30 --seed 1   # so many of each module, drawn at random
    python tools/mutation.py planning --budget 5     # what 5 s of tests do not notice counts as alive
    python tools/mutation.py kernels                 # faults in the compiled functions, see kernel_faults.py

`plant.py` says what is planted. One process collects the package's tests, and has seen which lines each of them
reaches. For each mutant it makes a fork, in which the mutated code takes the place of the function's, and which runs
the tests that reach these lines, the quickest within the budget, until one fails: first those that have found faults
of this function, the last first. Those whose tests take three times as long and 20 s more are out of time, and counted
apart.

What is known is kept in build/mutation, so that a run that was stopped goes on. A fault that was found is not tried
again while its function and the test that found it are the same, another while its function and all its tests are.
What came of the mutants that were drawn goes to benchmarks/results/mutation.json.

A package is a folder of src/handfast with the modules that are in it, not below it. Its tests are the files in the
folder of the same name in tests/, or in the folders below that, or in the next folder above that has some.
"""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import importlib
import inspect
import json
import mmap
import os
import random
import resource
import signal
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import kernel_faults
import pytest
from plant import Mutant, mutants

ROOT = Path(__file__).parents[1]
SOURCES = ROOT / "src" / "handfast"
WORK = ROOT / "build" / "mutation"
RESULTS = ROOT / "benchmarks" / "results" / "mutation.json"
# what compiles the kernels: it would be compiled with its mutants
NOT_MUTATED = ("core/compiled.py", "core/compiler.py")
# tests of a package that are in the folder of what makes the files that they ask about
ALSO = {
    "proofs": (
        "stability/answers/test_load_path.py",
        "stability/answers/test_path_torques.py",
        "planning/test_forged_grasps.py",
        "planning/test_joined_search.py",
    )
}
KERNELS = "kernels"
KILLED, ENDLESS, ALIVE = "killed", "out_of_time", "alive"
Reached = tuple[pytest.Item, float, dict[str, list[int]], str]  # seconds, lines of each source, what the file says
BUDGET = 10.0  # [s] of tests for a mutant
LONGEST = 6.0  # [s] of a test while it is looked at, which makes it slower; a test that takes longer is left out
ROOM = 8 << 30  # bytes that a mutant may ask for


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
            return (*(str(file.relative_to(ROOT / "tests")) for file in files), *ALSO.get(str(package), ()))
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
    parser.add_argument("--sample", type=int, metavar="N", help="try N mutants of a module, drawn at random")
    parser.add_argument("--seed", type=int, default=0, metavar="K", help="of the sample (default: 0)")
    parser.add_argument("--budget", type=float, default=BUDGET, metavar="S", help="seconds of tests for a mutant")
    args = parser.parse_args()
    for name in args.parts:
        if name != KERNELS and part_named(name) is None:
            parser.error(f"there is no package or module '{name}'; there are {', '.join(known)}")
    parts = {name: part_named(name) for name in args.parts}
    if args.survivors:
        for name, part in parts.items():
            for source in part.sources if part else (name,):
                print(*("\n".join(lines) for lines in _read(RESULTS)[source]["survivors"]), sep="\n")
        return 0
    by_tests: dict[tuple[str, ...], list[str]] = {}
    for part in parts.values():
        if part:
            by_tests.setdefault(part.tests, []).extend(part.sources)
        else:
            try_kernels(WORK / KERNELS, args.sample, args.seed)
    for tests, sources in by_tests.items():
        options = ["-n", "0", "-m", "", "-q", "-q", "--no-header", "--tb=native", "--capture=sys", "--disable-warnings"]
        options += [word for name in ("cacheprovider", "timeout", "faulthandler") for word in ("-p", f"no:{name}")]
        options += [f"{ROOT}/tests/{test}" for test in tests]
        os.environ["PROVE_ANEW"] = "1"  # see tests/conftest.py: what is kept of a proof would not notice a fault
        pytest.main(options, plugins=[Runner(sources, args.sample, args.seed, args.budget)])
    return 0


def try_kernels(folder: Path, size: int | None, seed: int) -> None:
    """Try faults of kernels and write what came of them."""
    found = kernel_faults.run(folder, size, seed)
    alive = [[f.name, *f"-{f.old}\n+{f.new}".splitlines()] for f, killed in found if not killed]
    counts = {"killed": len(found) - len(alive), "faults": len(found), "known": len(kernel_faults.FAULTS)}
    _write(RESULTS, _read(RESULTS) | {KERNELS: counts | {"survivors": alive}})
    print(f"{KERNELS}: {counts['killed']} of {counts['faults']} killed", flush=True)


# --- in the process that has collected the tests --------------------------------------------------


class Runner:
    """A plugin of pytest that runs tests for mutants instead of all tests once."""

    def __init__(self, sources: list[str], size: int | None, seed: int, budget: float) -> None:
        self.sources, self.size, self.seed, self.budget = sources, size, seed, budget
        self.finders: dict[str, list[pytest.Item]] = {}  # of each function's faults, the last first

    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        """Try the mutants of each source."""
        reached, texts = self.reached(session), {_text(item) for item in session.items}
        for source in self.sources:
            found, kept, ends = list(mutants(SOURCES / source)), WORK / f"{source}.json", []
            self.finders.clear()
            known = _read(kept)
            random.Random(self.seed).shuffle(found)
            for mutant in found[: self.size]:
                tests, seconds, says = self.judges(mutant, source, reached)
                name, finders = f"{mutant.name} {mutant.digest}", self.finders.setdefault(mutant.function, [])
                if name not in known or (known[name][1] != says and known[name][2] not in texts):
                    end = _tried(mutant, source, finders, tests, seconds)
                    known[name] = [end, says, _text(finders[0]) if end == KILLED else ""]
                    _write(kept, known)
                ends.append(known[name][0])
            alive = sorted([m.name, *m.diff()] for m, end in zip(found, ends, strict=False) if end == ALIVE)
            how: dict[str, Any] = {"seed": self.seed, "budget": self.budget, "mutants": len(found), "tried": len(ends)}
            how |= {end: ends.count(end) for end in (KILLED, ENDLESS)} | {"survivors": alive}
            _write(RESULTS, _read(RESULTS) | {source: how})
            print(f"{source}: {how[KILLED]} of {how['tried']} killed", file=sys.__stdout__, flush=True)
        return True

    def judges(self, mutant: Mutant, source: str, reached: list[Reached]) -> tuple[list[pytest.Item], float, str]:
        """The tests that reach what is changed, the quickest first; their seconds; a name of all this."""
        (first, last), total = mutant.lines, 0.0
        tests: list[pytest.Item] = []
        says = f"{mutant.name} {mutant.digest} "
        for item, seconds, lines, text in reached:
            if any(first <= n <= last for n in lines.get(source, ())):
                total += seconds
                if tests and total > self.budget:
                    break
                tests.append(item)
                says += f"{item.nodeid} {text}"
        return tests, total, hashlib.sha256(says.encode()).hexdigest()

    def reached(self, session: pytest.Session) -> list[Reached]:
        """The tests that pass, the quickest first, with what they reach."""
        every = [s for part in packages().values() if set(self.sources) & set(part.sources) for s in part.sources]
        texts = hashlib.sha256(b"".join((SOURCES / source).read_bytes() for source in every)).hexdigest()
        found = []
        for path in dict.fromkeys(item.path for item in session.items):
            text = hashlib.sha256(path.read_bytes()).hexdigest()
            kept = WORK / "reached" / f"{path.relative_to(ROOT / 'tests')}.json"
            items = [item for item in session.items if item.path == path]
            if _read(kept).get("of") != [texts, text]:
                _forked(partial(_traced, items, set(every), kept, [texts, text]), 600.0)
            tests = _read(kept)["tests"]
            found += [(item, *tests[item.nodeid], text) for item in items if item.nodeid in tests]
        return sorted(found, key=lambda each: each[1])


def _text(item: pytest.Item) -> str:
    """A test's name, and what its function says."""
    text = inspect.getsource(item.function) if isinstance(item, pytest.Function) else ""
    return f"{item.nodeid} {hashlib.sha256(text.encode()).hexdigest()[:12]}"


def _module(source: str) -> str:
    return f"handfast.{source[:-3].replace('/', '.')}"


def _traced(items: list[pytest.Item], sources: set[str], kept: Path, of: list[str]) -> bool:
    """Runs tests of a file and writes down which lines each of them reaches, and its seconds."""
    names = {str(SOURCES / source): source for source in sources}
    lines: dict[str, set[int]] = {}
    begun, found = 0.0, {}

    def called(frame: Any, event: str, _: Any) -> Any:
        source = names.get(frame.f_code.co_filename)
        if source is None:
            return None
        if event == "call":
            if time.process_time() > begun + LONGEST:
                raise TimeoutError
            lines.setdefault(source, set())
        elif event == "line":
            lines[source].add(frame.f_lineno)
        return called

    modules = [importlib.import_module(_module(source)) for source in sources]
    remembered = [x.cache_clear for module in modules for x in vars(module).values() if hasattr(x, "cache_clear")]
    for item, after in zip(items, [*items[1:], None], strict=True):
        lines.clear()
        for forget in remembered:
            forget()
        begun, failed = time.process_time(), item.session.testsfailed
        sys.settrace(called)
        item.config.hook.pytest_runtest_protocol(item=item, nextitem=after)
        sys.settrace(None)
        if item.session.testsfailed == failed:
            found[item.nodeid] = (time.process_time() - begun, {s: sorted(n) for s, n in lines.items()})
    _write(kept, {"of": of, "tests": found})
    return True


def _tried(mutant: Mutant, source: str, finders: list[pytest.Item], tests: list[pytest.Item], seconds: float) -> str:
    """How the tests of a mutant end; the one that finds it becomes the first of the finders."""
    tests = sorted(tests, key=lambda item: finders.index(item) if item in finders else len(finders))
    place = mmap.mmap(-1, 8)  # shared with the fork: the test that is run
    function: Any = importlib.import_module(_module(source))
    for part in mutant.function.split("."):
        function = vars(function)[part]
    for inner in ("fget", "func", "__func__", "__wrapped__"):  # without what decorates it, or remembers its values
        getattr(function, "cache_clear", lambda: None)()
        function = getattr(function, inner, function)

    def passes() -> bool:
        for k, (item, after) in enumerate(zip(tests, [*tests[1:], None], strict=True)):
            place[:] = k.to_bytes(8, "little")
            item.config.hook.pytest_runtest_protocol(item=item, nextitem=after)
            if item.session.testsfailed:
                return False
        return True

    own, function.__code__ = function.__code__, mutant.code()
    try:
        end = _forked(passes, 3 * seconds + 20) if tests else ALIVE
    finally:
        function.__code__ = own
    if end == KILLED:
        finder = tests[int.from_bytes(place[:], "little")]
        finders[:] = [finder, *(item for item in finders if item is not finder)]
    return end


def _forked(passes: Callable[[], bool], seconds: float) -> str:
    """How a call ends in a fork of this process: that says that it passes, does not end, or neither."""
    sys.stdout.flush()
    process = os.fork()
    if process:
        status = os.waitpid(process, 0)[1]
        late = os.WIFSIGNALED(status) and os.WTERMSIG(status) in (signal.SIGPROF, signal.SIGALRM)
        return ENDLESS if late else KILLED if status else ALIVE
    passed = False
    with contextlib.suppress(BaseException):
        silent = os.open(os.devnull, os.O_RDWR)
        for stream in (1, 2):
            os.dup2(silent, stream)
        for kind in (signal.SIGPROF, signal.SIGALRM):
            signal.signal(kind, signal.SIG_DFL)
        signal.setitimer(signal.ITIMER_PROF, seconds)
        signal.alarm(int(10 * seconds + 60))
        resource.setrlimit(resource.RLIMIT_AS, (ROOM, ROOM))
        passed = passes()
    os._exit(0 if passed else 1)


def _read(file: Path) -> dict[str, Any]:
    return json.loads(file.read_text("utf-8")) if file.exists() else {}


def _write(file: Path, data: dict[str, Any]) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(json.dumps(dict(sorted(data.items())), indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
