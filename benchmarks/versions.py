"""Two versions of the engine against each other, turn by turn: processor time of maxima and their nodes; and whether
any of their answers contradict each other.

    git worktree add ../before REVISION
    python -m benchmarks.versions ../before . [--contacts 3 4 5 6 8] [--rounds 9] [--verify]
    python -m benchmarks.versions ../before . --fresh 1000 [--first SEED] [--limit 5]

Both versions answer the same questions in turn, in processes of their own with caches of their own, one thread each;
who begins alternates. The questions are made by the scripts of this checkout.

Without --fresh these are the random cases of the published set of each size. A ratio is that of two neighbouring
turns, so that other work on the machine hits both alike. Proofs are replayed only with --verify.

With --fresh so many questions are asked of fresh grasps of 3 to 8 contacts, each of one of `KINDS`: a maximum, with or
without a load besides; a check of a load of any size; the smallest commands of a load; one preload for two loads.
Proofs are replayed, `--limit` seconds each. Counted are answers that are equal to the last bit, those of which one
cannot be true, and questions that only one of the two decides. What differs is kept, question by question; the run is
saved as it goes.

Adds to results/versions.json and prints a Markdown table.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.grasps import Case, cases, presses, random_case
from benchmarks.machine import describe, revision
from benchmarks.users import contradictions, said, verdict_alone
from handfast import check, hold, maximum, torques
from handfast.stability.problem.loads import Loads
from handfast.stability.problem.settings import Settings

RESULTS = Path(__file__).parent / "results" / "versions.json"
HERE = Path(__file__).parents[1]
FIRST = 31_400_000  # seeds of fresh grasps from here on
SIZES = (3, 4, 5, 6, 7, 8)
OPEN = "undecided"


# --- questions ----------------------------------------------------------------------------------


def another(case: Case, rng: np.random.Generator) -> np.ndarray:
    """(6,) a load [N, N m] at the middle of the contacts, in any direction, 0.05 to 5 N."""
    force = rng.normal(size=3)
    force *= 10 ** rng.uniform(-1.3, 0.7) / np.linalg.norm(force)
    middle = case.grasp.positions.mean(axis=0)
    return np.r_[force, np.cross(middle, force) + 0.01 * np.linalg.norm(force) * rng.normal(size=3)]


def a_maximum(case: Case, rng: np.random.Generator, settings: Settings) -> Any:
    base = 0.2 * another(case, rng) if rng.random() < 0.5 else None
    return maximum(case.grasp, case.direction, base=base, settings=settings)


def preload_for_two(case: Case, rng: np.random.Generator, settings: Settings) -> Any:
    return hold(case.grasp, Loads.wrench(another(case, rng)) + Loads.wrench(another(case, rng), "b"), settings=settings)


KINDS: dict[str, Callable[[Case, np.random.Generator, Settings], Any]] = {
    "max": a_maximum,
    "check": lambda case, rng, settings: check(case.grasp, another(case, rng), settings=settings),
    "torques": lambda case, rng, settings: torques(case.grasp, another(case, rng), settings=settings),
    "hold": preload_for_two,
}


def fresh(first: int, count: int) -> Iterator[tuple[str, int, int]]:
    """Kind, contacts and seed of so many questions, on grasps whose preload presses."""
    seed, asked = first, 0
    while asked < count:
        m = SIZES[asked % len(SIZES)]
        if presses(random_case(m, seed).grasp):
            yield list(KINDS)[(asked // len(SIZES)) % len(KINDS)], m, seed
            asked += 1
        seed += 1


def answered(kind: str, m: int, seed: int, settings: Settings) -> list[Any]:
    """`[verdict, lower, upper]` of one question."""
    found = KINDS[kind](random_case(m, seed), np.random.default_rng([seed, m]), settings)
    return said(found)[0] if hasattr(found, "lower") else verdict_alone(found.verdict)


def answer(verify: bool, limit: float) -> None:
    """The process of one version: a question per line in, processor time [s] and what was answered out.

    A question is a number of contacts, whose cases are all asked, or kind, contacts and seed of a fresh one.
    """
    quick = Settings(gap=1e-3, timeout=20.0, jobs=1, verify=verify)
    chosen = cases(("random",))
    maximum(chosen[0].grasp, chosen[0].direction, settings=quick)  # loads the machine code
    print("ready", flush=True)
    for line in sys.stdin:
        question, clock = json.loads(line), time.process_time()
        if isinstance(question, int):
            some = [case for case in chosen if case.contacts == question]
            out: Any = sum(maximum(c.grasp, c.direction, base=c.base, settings=quick).nodes for c in some)
        else:
            out = answered(*question, Settings(timeout=limit, jobs=1))
        print(json.dumps([time.process_time() - clock, out]), flush=True)


class Version:
    """A checkout and the process that answers with it; the questions are those of this one."""

    def __init__(self, checkout: Path, cache: str, options: argparse.Namespace) -> None:
        paths = os.pathsep.join([str(checkout / "src"), str(HERE)])
        env = os.environ | {"PYTHONPATH": paths, "NUMBA_CACHE_DIR": cache}
        command = [sys.executable, "-m", "benchmarks.versions", "--answer", "--limit", str(options.limit)]
        command += ["--verify"][: int(options.verify)]
        pipe = subprocess.PIPE
        self.process = subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True, env=env, cwd=HERE)
        self._line()
        self.revision = revision(checkout)

    def _line(self) -> str:
        assert self.process.stdout
        line = self.process.stdout.readline()
        if not line:
            raise SystemExit(f"{self.process.args}: ended; what it says is above")
        return line

    def ask(self, question: Any) -> tuple[float, Any]:
        assert self.process.stdin
        self.process.stdin.write(f"{json.dumps(question)}\n")
        self.process.stdin.flush()
        seconds, out = json.loads(self._line())
        return float(seconds), out


# --- runs, and what is kept of them -------------------------------------------------------------


def by_size(versions: list[Version], options: argparse.Namespace) -> Iterator[list[dict[str, Any]]]:
    """Rows of all sizes that are done."""
    rows: list[dict[str, Any]] = []
    print("| contacts | nodes: before | after | processor time, after / before | from | to |")
    print("|---:|---:|---:|---:|---:|---:|")
    for contacts in options.contacts:
        ratios, nodes = [], [0, 0]
        for turn in range(options.rounds):
            seconds = [0.0, 0.0]
            for k in (0, 1) if turn % 2 else (1, 0):
                seconds[k], nodes[k] = versions[k].ask(contacts)
            ratios.append(seconds[1] / seconds[0])
        rows.append({"contacts": contacts, "nodes": nodes, "ratios": ratios})
        cells = [statistics.median(ratios), min(ratios), max(ratios)]
        print(f"| {contacts} | {nodes[0]:,} | {nodes[1]:,} | " + " | ".join(f"{x:.2f}" for x in cells) + " |")
        yield rows


def row(kind: str) -> dict[str, Any]:
    """Of a kind of question before any is asked."""
    counts = dict.fromkeys(("questions", "same", "contradictions", "open_before", "open_after"), 0)
    return {"kind": kind, **counts, "seconds": [0.0, 0.0], "differ": []}


def by_kind(versions: list[Version], options: argparse.Namespace) -> Iterator[list[dict[str, Any]]]:
    """Rows of all kinds, after every tenth question."""
    rows = {kind: row(kind) for kind in KINDS}
    for turn, (kind, m, seed) in enumerate(fresh(options.first, options.fresh)):
        answers: list[Any] = [None, None]
        here = rows[kind]
        for k in (0, 1) if turn % 2 else (1, 0):
            seconds, answers[k] = versions[k].ask([kind, m, seed])
            here["seconds"][k] += seconds
        contradicts = contradictions(answers[:1], answers[1:])
        here["questions"] += 1
        here["same"] += answers[0] == answers[1]
        here["contradictions"] += contradicts
        here["open_before"] += answers[0][0] == OPEN
        here["open_after"] += answers[1][0] == OPEN
        if answers[0] != answers[1]:
            differs = {"contacts": m, "seed": seed, "before": answers[0], "after": answers[1]}
            here["differ"].append(differs)
            if contradicts:
                print(kind, json.dumps(differs), flush=True)
        if turn % 10 == 9 or turn == options.fresh - 1:
            yield list(rows.values())
    print("| question | asked | equal to the last bit | contradictions | open: before | after | time, after / before |")
    print("|---|---:|---:|---:|---:|---:|---:|")
    for kind, r in ((kind, r) for kind, r in rows.items() if r["questions"]):
        cells = [r[k] for k in ("questions", "same", "contradictions", "open_before", "open_after")]
        print(f"| {kind} | " + " | ".join(f"{x:,}" for x in cells) + f" | {r['seconds'][1] / r['seconds'][0]:.2f} |")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("checkouts", nargs="*", type=Path, help="before and after")
    parser.add_argument("--contacts", nargs="+", type=int, default=[3, 4, 5, 6, 8])
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--verify", action="store_true", help="replay proofs before they are answered")
    parser.add_argument("--fresh", type=int, default=0, metavar="N", help="ask N questions of fresh grasps")
    parser.add_argument("--first", type=int, default=FIRST, metavar="SEED", help="seeds of fresh grasps from here on")
    parser.add_argument("--limit", type=float, default=5.0, metavar="S", help="of a question of a fresh grasp")
    parser.add_argument("--answer", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.answer:
        answer(options.verify, options.limit)
        return
    if len(options.checkouts) != 2:
        parser.error("two checkouts are needed, before and after")
    with tempfile.TemporaryDirectory() as first, tempfile.TemporaryDirectory() as second:
        versions = [Version(c.resolve(), d, options) for c, d in zip(options.checkouts, (first, second), strict=True)]
        run: dict[str, Any] = {"machine": describe(), "revisions": [v.revision for v in versions]}
        run |= {"fresh": options.fresh, "first": options.first} if options.fresh else {"verify": options.verify}
        runs = json.loads(RESULTS.read_text())["runs"]
        before = [r for r in runs if any(r.get(k) != v for k, v in run.items() if k != "machine")]
        for rows in (by_kind if options.fresh else by_size)(versions, options):
            RESULTS.write_text(json.dumps({"runs": [*before, run | {"rows": rows}]}, indent=1) + "\n")
        for version in versions:
            version.process.communicate()


if __name__ == "__main__":
    main()
