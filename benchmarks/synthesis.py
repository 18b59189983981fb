"""Time to the first certified configuration, beside the synthesis paper's Table 2.

    python -m benchmarks.synthesis [--runs 100] [--again NAME ...]

For each task one call of `synthesize` per seed, after start-up (compiled code loaded), on one core: from the loaded
task to the certified configuration with its proof. Found-but-unproved candidates are counted. A task of which
the first three calls find nothing is not asked again. Written after every task to results/synthesis.json, which
is also where it goes on: tasks that are there are left out unless named after --again.
"""

from __future__ import annotations

import argparse
import json
import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.machine import describe
from benchmarks.tasks import Others, published, tasks
from handfast.core.answer import Reach
from handfast.synthesis.query import synthesize
from handfast.synthesis.task import Task

RESULTS = Path(__file__).parent / "results" / "synthesis.json"
LIMIT = 60.0  # [s] of one call
TRIED = 3  # calls after which a task that none of them found is given up


def measure(task: Task, runs: int) -> dict[str, Any]:
    """One row."""
    synthesize(task)
    others = Others()
    seconds, starts, unproved, verdicts = [], [], 0, Counter[str]()
    for seed in range(runs):
        clock = time.perf_counter()
        answer = synthesize(task, seed=seed, timeout=LIMIT, jobs=1)
        took = time.perf_counter() - clock
        verdicts[str(answer.verdict)] += 1
        unproved += answer.unproved
        if answer.verdict is Reach.FOUND:
            seconds.append(took)
            starts.append(answer.starts)
        elif seed + 1 >= TRIED and not seconds:
            break
    row: dict[str, Any] = {"contacts": len(task.contact_pairs), "verdicts": dict(verdicts), "unproved": unproved}
    if seconds:
        row["ms"] = {
            "median": 1e3 * float(np.median(seconds)),
            "95 %": 1e3 * float(np.percentile(seconds, 95)),
            "worst": 1e3 * max(seconds),
        }
        row["starts"] = {"mean": float(np.mean(starts)), "worst": max(starts)}
    return row | {"busy": others.busy()}


def table(rows: dict[str, Any]) -> str:
    lines = ["| task | contacts | found | median [ms] | 95 % | worst | starts | unproved | paper, 64 cores [s] |"]
    lines.append("|---|---:|---:|---:|---:|---:|---:|---:|---:|")
    for name, r in rows.items():
        found, asked = r["verdicts"].get("found", 0), sum(r["verdicts"].values())
        times = [f"{r['ms'][k]:.1f}" for k in ("median", "95 %", "worst")] if "ms" in r else ["–"] * 3
        starts = f"{r['starts']['mean']:.2f}" if "starts" in r else "–"
        others = "" if found == asked else f" ({', '.join(v for v in r['verdicts'] if v != 'found')})"
        cells = [
            name,
            r["contacts"],
            f"{found} of {asked}{others}",
            *times,
            starts,
            r["unproved"],
            r["published"] or "",
        ]
        lines.append("| " + " | ".join(map(str, cells)) + " |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=100)
    parser.add_argument("--again", nargs="*", default=[], metavar="NAME")
    parser.add_argument("--out", type=Path, default=RESULTS)
    args = parser.parse_args()
    rows = json.loads(args.out.read_text())["tasks"] if args.out.exists() else {}
    for name, task in tasks().items():
        if name not in rows or name in args.again:
            rows[name] = measure(task, args.runs) | {"published": published(name)}
        ordered = {n: rows[n] for n in tasks() if n in rows}
        note = (
            "absolute times were taken while other processes ran" if any(r["busy"] for r in rows.values()) else "quiet"
        )
        data = {"machine": describe(), "load": note, "limit": LIMIT, "tasks": ordered}
        args.out.write_text(json.dumps(data, indent=1) + "\n")
    print(table(ordered))


if __name__ == "__main__":
    main()
