"""Two versions of the engine against each other, turn by turn: processor time of maxima and their nodes.

    git worktree add ../before REVISION
    python -m benchmarks.versions ../before . [--contacts 3 4 5 6 8] [--rounds 9] [--verify]

Both versions answer the random cases of the published set of each size in turn, in processes of their own with
caches of their own, one thread each; who begins alternates. A ratio is that of two neighbouring turns, so that
other work on the machine hits both alike. Proofs are replayed only with --verify, by versions that do. Adds to
results/versions.json and prints a Markdown table.
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
from pathlib import Path
from typing import Any

from benchmarks.machine import describe, revision

RESULTS = Path(__file__).parent / "results" / "versions.json"


def answer(verify: bool) -> None:
    """The process of one version: a number of contacts per line in, processor time [s] and nodes out."""
    from dataclasses import fields

    from benchmarks.grasps import Case, cases
    from handfast import maximum
    from handfast.stability.problem.settings import Settings

    replay: dict[str, Any] = {"verify": verify} if "verify" in {f.name for f in fields(Settings)} else {}
    settings = Settings(gap=1e-3, timeout=20.0, jobs=1, **replay)

    def ask(case: Case) -> int:
        return maximum(case.grasp, case.direction, base=case.base, settings=settings).nodes

    chosen = cases(("random",))
    ask(chosen[0])  # compile
    print("ready", flush=True)
    for line in sys.stdin:
        clock = time.process_time()
        nodes = sum(ask(case) for case in chosen if case.contacts == int(line))
        print(time.process_time() - clock, nodes, flush=True)


class Version:
    """A checkout and the process that answers with it."""

    def __init__(self, checkout: Path, cache: str, verify: bool) -> None:
        env = os.environ | {"PYTHONPATH": str(checkout / "src"), "NUMBA_CACHE_DIR": cache}
        package = (checkout / "benchmarks" / "__init__.py").exists()  # else of a version whose benchmarks are scripts
        script = ["-m", "benchmarks.versions"] if package else ["benchmarks/versions.py"]
        command = [sys.executable, *script, "--answer", *["--verify"][: int(verify)]]
        pipe = subprocess.PIPE
        self.process = subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True, env=env, cwd=checkout)
        self._line()
        self.revision = revision(checkout)

    def _line(self) -> str:
        assert self.process.stdout
        line = self.process.stdout.readline()
        if not line:
            raise SystemExit(f"{self.process.args}: ended; what it says is above")
        return line

    def ask(self, contacts: int) -> tuple[float, int]:
        assert self.process.stdin
        self.process.stdin.write(f"{contacts}\n")
        self.process.stdin.flush()
        seconds, nodes = self._line().split()
        return float(seconds), int(nodes)


def same(run: dict[str, Any], revisions: list[str], verify: bool) -> bool:
    """Is it a run of these versions, asked in this way?"""
    return run["revisions"] == revisions and run.get("verify", False) == verify


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("checkouts", nargs="*", type=Path, help="before and after")
    parser.add_argument("--contacts", nargs="+", type=int, default=[3, 4, 5, 6, 8])
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--verify", action="store_true", help="replay proofs before they are answered")
    parser.add_argument("--answer", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.answer:
        answer(options.verify)
        return
    if len(options.checkouts) != 2:
        parser.error("two checkouts are needed, before and after")
    rows: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as first, tempfile.TemporaryDirectory() as second:
        versions = [
            Version(c.resolve(), d, options.verify) for c, d in zip(options.checkouts, (first, second), strict=True)
        ]
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
        revisions = [v.revision for v in versions]
        for version in versions:
            version.process.communicate()
    kept = [run for run in json.loads(RESULTS.read_text())["runs"] if not same(run, revisions, options.verify)]
    kept.append({"machine": describe(), "revisions": revisions, "verify": options.verify, "rows": rows})
    RESULTS.write_text(json.dumps({"runs": kept}, indent=1) + "\n")


if __name__ == "__main__":
    main()
