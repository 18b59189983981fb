"""Where the engine's time goes: the random cases of the published set, processor time of each part.

    python -m benchmarks.profile

For 3 to 8 contacts: scaling and reduction, the compiled kernel, judging the witness and the rest; and in the
kernel nodes, exchanges of the simplex and Newton attempts. Medians over the cases, each the fastest of three
runs. Writes results/profile.json and prints a Markdown table.
"""

from __future__ import annotations

import json
import statistics
import time
from pathlib import Path
from typing import Any

from benchmarks.grasps import Case, cases
from benchmarks.machine import describe
from handfast.stability.answers.max_query import max_goal
from handfast.stability.problem import scaled_problem
from handfast.stability.search import arrays
from handfast.stability.search.reduced import reduce
from handfast.stability.search.search import Search

RESULTS = Path(__file__).parent / "results" / "profile.json"
LIMIT = 10.0  # [s]


def once(case: Case) -> dict[str, Any]:
    """One maximum by hand, part by part [s]."""
    clock = [time.thread_time()]

    def lap() -> float:
        clock.append(time.thread_time())
        return clock[-1] - clock[-2]

    p = scaled_problem.build(case.grasp, case.base, case.direction)
    scaled = lap()
    r = reduce(p, max_goal(p))
    reduced = lap()
    search = Search(r, gap=1e-3, time_limit=LIMIT)
    for _ in search:
        pass
    searched = lap()
    if search.z is not None:
        assert r.witness(r.point(search.z)).valid
    judged = lap()
    return {
        "scale": scaled,
        "reduce": reduced,
        "search": searched,
        "judge": judged,
        "nodes": search.nodes,
        "exchanges": int(search.counts[arrays.EXCHANGES]),
        "newtons": int(search.counts[arrays.NEWTONS]),
        "restarts": int(search.counts[arrays.RESTARTS]),
        "unknowns": len(r.cost),
    }


def main() -> None:
    chosen = cases(("random",))
    once(chosen[0])
    rows = []
    for case in chosen:
        runs = [once(case) for _ in range(3)]
        best = min(runs, key=lambda row: row["search"])
        rows.append({"name": case.name, "contacts": case.contacts, **best})
    RESULTS.write_text(json.dumps({"machine": describe(), "rows": rows}, indent=1) + "\n")
    print("| contacts | unknowns | scale, reduce, judge | search | nodes | exchanges | Newton | us a node |")
    print("|---:|---:|---:|---:|---:|---:|---:|---:|")
    for m in sorted({row["contacts"] for row in rows}):
        some = [row for row in rows if row["contacts"] == m]

        def median(key: str, some: list[dict[str, Any]] = some) -> float:
            return statistics.median(row[key] for row in some)

        python = statistics.median(row["scale"] + row["reduce"] + row["judge"] for row in some)
        nodes = sum(row["nodes"] for row in some)
        a_node = 1e6 * sum(row["search"] for row in some) / nodes
        per = [sum(row[key] for row in some) / nodes for key in ("exchanges", "newtons")]
        print(
            f"| {m} | {median('unknowns'):.0f} | {1e3 * python:.2f} ms | {1e3 * median('search'):.1f} ms | "
            f"{median('nodes'):.0f} | {per[0]:.1f} a node | {per[1]:.2f} a node | {a_node:.0f} |"
        )


if __name__ == "__main__":
    main()
