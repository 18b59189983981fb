"""Cost as the work grows: contacts of a grasp, grasps of a batch, processes, workers of a cluster.

    python -m benchmarks.growth [--largest 1000] [--rows 200] [--only contacts grasps workers]

The largest pull of random grasps (`grasps.random_case`, seeds from `FIRST` on), proofs not replayed:

- `contacts`: one by one, `EACH` grasps of each size, `wrapped` from nine contacts on, `LIMIT` s each: processor time;
- `grasps`: of three contacts in one call of `max_many`, in one process and in two: processor and wall time. From
  `DIFFERENT` grasps on the same ones are made anew, so that nothing of them is known;
- `workers`: of one `handfast label` of `--rows` rows, by the clock, start included: with one process, with two, and
  with two workers of a Dask cluster on this machine.

Results are kept in results/growth.json; `docs/make_growth_picture.py` draws them.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import tempfile
import time
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.batches import timed
from benchmarks.grasps import Case, presses, random_case
from benchmarks.label import command, dask, lines
from benchmarks.machine import describe
from handfast import max_many, maximum
from handfast.stability.problem.settings import Settings

RESULTS = Path(__file__).parent / "results" / "growth.json"
FIRST = 9_100_000  # seeds from here on
CONTACTS = range(3, 16)
EACH, LIMIT = 4, 3.0
DIFFERENT = 200
QUICK = Settings(verify=False, jobs=1, timeout=LIMIT)


def drawn(m: int, count: int) -> list[Case]:
    """The first cases whose preload presses."""
    out, seed = list[Case](), FIRST
    while len(out) < count:
        case = random_case(m, seed, wrapped=m >= 9)
        if presses(case.grasp):
            out.append(case)
        seed += 1
    return out


def by_contacts(m: int) -> dict[str, Any]:
    """Processor time [ms] of maxima, and how many of them were stopped."""
    found = [timed(partial(maximum, c.grasp, c.direction, settings=QUICK)) for c in drawn(m, EACH)]
    spent = [1e3 * s for _, s in found]
    stopped = sum(str(answer.stop) != "complete" for answer, _ in found)
    return {"contacts": m, "ms": spent, "nodes": [a.nodes for a, _ in found], "stopped": stopped}


def by_grasps(count: int, jobs: int) -> dict[str, Any]:
    """Seconds of one call, by the clock and of this process and the children that ended."""
    some = drawn(3, min(count, DIFFERENT))
    cases = [random_case(3, int(some[k % len(some)].name.split()[-1])) for k in range(count)]
    W = np.array([c.direction for c in cases])[:, None]
    start, before = time.monotonic(), os.times()
    max_many([c.grasp for c in cases], W, settings=QUICK, jobs=jobs)
    after = os.times()
    return {
        "grasps": count,
        "jobs": jobs,
        "wall": time.monotonic() - start,
        "processor": sum(after[:4]) - sum(before[:4]),
    }


def by_workers(rows: int) -> list[dict[str, Any]]:
    """Seconds of a table of labels by the clock, with one process, two, and two workers of a cluster."""
    out = []
    with tempfile.TemporaryDirectory() as folder, dask(2) as (address, _):
        data = Path(folder) / "data.jsonl"
        data.write_text("\n".join(lines(rows)) + "\n")
        for name, how in (("1", ("--jobs", "1")), ("2", ("--jobs", "2")), ("Dask, 2", ("--scheduler", address))):
            start = time.monotonic()
            table = Path(folder) / f"{len(out)}.jsonl"
            subprocess.run(command(data, table, *how), check=True, stdout=subprocess.DEVNULL)
            out.append({"workers": name, "rows": rows, "wall": time.monotonic() - start})
    return out


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--largest", type=int, default=1_000, help="grasps of the largest batch")
    parser.add_argument("--rows", type=int, default=200, help="labels for each kind of workers")
    parts = ("contacts", "grasps", "workers")
    parser.add_argument("--only", nargs="+", default=parts, choices=parts)
    options = parser.parse_args()
    data: dict[str, Any] = json.loads(RESULTS.read_text()) if RESULTS.exists() else {}
    data |= {"machine": describe()} | {part: [] for part in options.only}
    by_contacts(3)  # loads the machine code

    def kept(part: str, rows: list[dict[str, Any]]) -> None:
        data[part].extend(rows)
        RESULTS.write_text(json.dumps(data, indent=1) + "\n")
        for row in rows:
            print(part, {k: v for k, v in row.items() if k != "nodes"}, flush=True)

    for m in CONTACTS if "contacts" in options.only else ():
        kept("contacts", [by_contacts(m)])
    count = 10
    while count <= options.largest and "grasps" in options.only:
        for jobs in (1, 2):
            kept("grasps", [by_grasps(count, jobs)])
        count *= 10
    if "workers" in options.only:
        kept("workers", by_workers(options.rows))


if __name__ == "__main__":
    main()
