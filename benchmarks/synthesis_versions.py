"""Two versions of synthesis against each other, turn by turn: what they find, what they exclude, processor time.

    git worktree add ../before REVISION
    python -m benchmarks.synthesis_versions ../before . [--seeds 25] [--rounds 5]

Both versions answer the same questions in turn, in processes of their own with caches of their own, one thread each;
who begins alternates. A ratio is that of two neighbouring turns, so that other work on the machine hits both alike.

- `first`: one configuration of each bundled task from each seed: verdict, starts used, candidates that were not
  proved, coordinates, dependent coordinates and radii of the proof;
- `many`: 20 configurations of each bundled task, which takes whole blocks of starts and steps along the set;
- `prover`: the bundled tasks made impossible in two ways (the last object region moved, the joints' ranges cut): how
  the search for a contradiction ends, its boxes, and the share that it has discarded after at most `NODES` boxes.

Adds to results/synthesis_versions.json and prints a Markdown table.
"""

from __future__ import annotations

import argparse
import importlib
import inspect
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

RESULTS = Path(__file__).parent / "results" / "synthesis_versions.json"
HERE = Path(__file__).parents[1]
GROUPS = ("first", "many", "prover")
MANY = 20  # configurations
NODES = 20_000
AWAY = (0.05, 0.3)  # [m]
CUT = (0.3, 0.9)  # [rad]


def questions(folder: Path) -> None:
    """Write the bundled tasks, and those that are impossible, where both versions can read them."""
    for file in sorted((HERE / "src" / "handfast" / "data" / "tasks").glob("*.json")):
        task = json.loads(file.read_text())
        (folder / file.name).write_text(json.dumps(task))
        limits = task["limits"]
        for angle in CUT:
            cut = {j: [lo, max(lo, hi - angle)] for j, (lo, hi) in limits.items()}
            (folder / f"cut-{angle}-{file.name}").write_text(json.dumps(task | {"limits": cut}))
        region = task["contacts"][-1]["object"]["region"]["bezier"]
        for distance in AWAY:
            moved = [[[x, y, z + distance] for x, y, z in row] for row in region]
            task["contacts"][-1]["object"]["region"]["bezier"] = moved
            (folder / f"away-{distance}-{file.name}").write_text(json.dumps(task))


class Answers:
    """What one version says, as JSON-able records; in a process of its own."""

    def __init__(self, folder: Path, seeds: int) -> None:
        source = Path(os.environ["PYTHONPATH"])  # another version may be installed: only the checkout's counts
        self.api = importlib.import_module("handfast")
        assert Path(self.api.__file__).is_relative_to(source)
        self.prover = importlib.import_module("handfast.synthesis.search.prover")
        self.problem = getattr(self.prover, "TaskProblem", None) or self.prover.Problem
        self.tasks = {f.stem: self._load(f) for f in sorted(folder.glob("*.json"))}
        self.bundled = {name: t for name, t in self.tasks.items() if not name.startswith(("cut-", "away-"))}
        self.seeds = seeds
        asked = inspect.signature(self.api.synthesize).parameters
        self.one = {"jobs" if "jobs" in asked else "workers": 1}

    def _load(self, file: Path) -> Any:
        try:
            return self.api.load_task(file)
        except self.api.InputError:
            return None  # limits that leave nothing

    def first(self) -> list[dict[str, Any]]:
        return [self._found(name, seed, 1) for name in self.bundled for seed in range(self.seeds)]

    def many(self) -> list[dict[str, Any]]:
        return [self._found(name, 0, MANY) for name in self.bundled]

    def _found(self, name: str, seed: int, count: int) -> dict[str, Any]:
        answer = self.api.synthesize(self.bundled[name], seed=seed, count=count, timeout=None, nodes=1, **self.one)
        proofs = [solution.existence for solution in answer.solutions]
        return {
            "question": f"{name}, seed {seed}, {count}",
            "told": [str(answer.verdict), str(answer.stop), answer.starts, answer.unproved],
            "dependent": [list(p.dependent) for p in proofs],
            "numbers": [[*p.coordinates.values(), *map(float, p.radii)] for p in proofs],
        }

    def prover_runs(self) -> list[dict[str, Any]]:
        rows = []
        for name, task in self.tasks.items():
            if name in self.bundled or task is None:
                continue
            try:
                prover = self.prover.Prover(self.problem.of(task), workers=1)
            except self.api.InputError:
                continue
            done = prover.run(nodes=NODES)
            told = [done.empty, done.by, done.nodes, done.pending, done.depth]
            numbers = [[done.discarded, done.smallest, done.largest]]
            rows.append({"question": name, "told": told, "dependent": [], "numbers": numbers})
        return rows

    def group(self, name: str) -> list[dict[str, Any]]:
        return {"first": self.first, "many": self.many, "prover": self.prover_runs}[name]()


def answer(folder: Path, seeds: int) -> None:
    """The process of one version: a group per line in, processor time [s] and records out."""
    answers = Answers(folder, seeds)
    compiling = answers.bundled[next(iter(answers.bundled))]
    answers.api.synthesize(compiling, count=2, **answers.one)
    answers.prover.Prover(answers.problem.of(compiling), workers=1).run(nodes=1)
    print("ready", flush=True)
    for line in sys.stdin:
        clock = time.process_time()
        rows = answers.group(line.strip())
        print(json.dumps({"seconds": time.process_time() - clock, "rows": rows}), flush=True)


class Version:
    """A checkout and the process that answers with it."""

    def __init__(self, checkout: Path, cache: Path, folder: Path, seeds: int) -> None:
        from benchmarks.machine import revision

        env = os.environ | {"PYTHONPATH": str(checkout / "src"), "NUMBA_CACHE_DIR": str(cache)}
        # by its path: a version before lacks this script, and must not import today's package
        command = [sys.executable, __file__, "--answer", str(folder), "--seeds", str(seeds)]
        pipe = subprocess.PIPE
        self.process = subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True, env=env, cwd=checkout)
        self.revision = revision(checkout)

    def line(self) -> str:
        assert self.process.stdout
        line = self.process.stdout.readline()
        if not line:
            raise SystemExit(f"{self.process.args}: ended; what it says is above")
        return line

    def ask(self, group: str) -> dict[str, Any]:
        assert self.process.stdin
        self.process.stdin.write(f"{group}\n")
        self.process.stdin.flush()
        return json.loads(self.line())


def compared(before: list[dict[str, Any]], after: list[dict[str, Any]]) -> dict[str, Any]:
    """How many records there are, how many are the same to the last bit, and where they differ."""
    assert [r["question"] for r in before] == [r["question"] for r in after]
    differ = [b["question"] for b, a in zip(before, after, strict=True) if b["told"] != a["told"]]
    chosen = [b["question"] for b, a in zip(before, after, strict=True) if b["dependent"] != a["dependent"]]
    largest = 0.0
    for b, a in zip(before, after, strict=True):
        if b["question"] in differ or b["question"] in chosen:
            continue
        for x, y in zip(b["numbers"], a["numbers"], strict=True):
            largest = max(largest, *(abs(u - v) for u, v in zip(x, y, strict=True)))
    same = sum(b == a for b, a in zip(before, after, strict=True))
    return {"records": len(after), "same": same, "told": differ, "dependent": chosen, "largest difference": largest}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("checkouts", nargs="*", type=Path, help="before and after")
    parser.add_argument("--seeds", type=int, default=25, help="of each bundled task")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--groups", nargs="+", choices=GROUPS, default=GROUPS)
    parser.add_argument("--dry", action="store_true", help="keep no results")
    parser.add_argument("--answer", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.answer:
        answer(options.answer, options.seeds)
        return
    if len(options.checkouts) != 2:
        parser.error("two checkouts are needed, before and after")
    rows: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "tasks"
        folder.mkdir()
        questions(folder)
        versions = [
            Version(c.resolve(), Path(place) / str(k), folder, options.seeds) for k, c in enumerate(options.checkouts)
        ]
        for version in versions:
            version.line()
        print("| questions | same to the last bit | told otherwise | largest difference | processor time | from | to |")
        print("|---|---:|---:|---:|---:|---:|---:|")
        for group in options.groups:
            ratios: list[float] = []
            said: list[dict[str, Any]] = [{}, {}]
            for turn in range(options.rounds):
                for k in (0, 1) if turn % 2 else (1, 0):
                    said[k] = versions[k].ask(group)
                ratios.append(said[1]["seconds"] / said[0]["seconds"])
            row = compared(said[0]["rows"], said[1]["rows"])
            rows.append({"group": group, **row, "seconds": [s["seconds"] for s in said], "ratios": ratios})
            cells = [statistics.median(ratios), min(ratios), max(ratios)]
            told = len({*row["told"], *row["dependent"]})
            print(
                f"| {group}: {row['records']} | {row['same']} | {told} | {row['largest difference']:.1e} | "
                + " | ".join(f"{x:.2f}" for x in cells)
                + " |"
            )
        revisions = [v.revision for v in versions]
        for version in versions:
            version.process.communicate()
    if options.dry:
        print(json.dumps(rows, indent=1))
        return
    from benchmarks.machine import describe

    kept = json.loads(RESULTS.read_text())["runs"] if RESULTS.exists() else []
    kept = [run for run in kept if run["revisions"] != revisions]
    kept.append({"machine": describe(), "revisions": revisions, "rows": rows})
    RESULTS.write_text(json.dumps({"runs": kept}, indent=1) + "\n")


if __name__ == "__main__":
    main()
