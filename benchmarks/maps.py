"""Maps of 360 directions: one by one, together, and on all cores.

    python -m benchmarks.maps

Four contacts: the paper's fig1 and fig7 and two random grasps, the curve with the preload in the xy plane, gap
1e-3. Writes results/maps.json and prints a Markdown table.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.grasps import random_case
from benchmarks.machine import describe
from handfast.core.parallel import default_jobs
from handfast.readers.grasp_file import load_grasp
from handfast.stability.problem.settings import Settings
from handfast.stability.studies.batch import max_many
from handfast.stability.studies.questions import maximum

RESULTS = Path(__file__).parent / "results" / "maps.json"
STEPS = 360
QUICK = Settings(verify=False)  # as maps are drawn


def timed(run: Callable[[], Any]) -> tuple[float, float, Any]:
    """Wall and processor time [s], and what came out."""
    wall, cpu = time.perf_counter(), time.process_time()
    out = run()
    return time.perf_counter() - wall, time.process_time() - cpu, out


def main() -> None:
    angles = 2 * np.pi * np.arange(STEPS) / STEPS
    circle = np.column_stack([np.cos(angles), np.sin(angles), *np.zeros((4, STEPS))])
    grasps = [load_grasp("fig1"), load_grasp("fig7"), random_case(4, 4).grasp, random_case(4, 22).grasp]
    maximum(grasps[0], circle[0])
    rows = []
    jobs = default_jobs()
    print(f"| grasp | one by one | together | their processor time | {jobs} cores | nodes | undecided |")
    print("|---|---:|---:|---:|---:|---:|---:|")
    for grasp in grasps:
        alone = timed(lambda g=grasp: [maximum(g, d, settings=QUICK) for d in circle])
        one = timed(lambda g=grasp: max_many(g, circle, settings=QUICK, jobs=1))
        many = timed(lambda g=grasp: max_many(g, circle, settings=QUICK, jobs=jobs))  # as `force_map` asks
        open_ = int((many[2].stop != "complete").sum())
        nodes = [sum(a.nodes for a in alone[2]), int(one[2].nodes.sum())]
        rows.append({"grasp": grasp.name, "alone": alone[:2], "one": one[:2], "many": many[:2], "jobs": jobs,
                     "nodes": nodes, "undecided": open_})  # fmt: skip
        times = " | ".join(f"{t:.2f} s" for t in (alone[0], one[0], one[1], many[0]))
        print(f"| {grasp.name} | {times} | {nodes[1]} | {open_} |")
    RESULTS.write_text(json.dumps({"machine": describe(), "steps": STEPS, "rows": rows}, indent=1) + "\n")


if __name__ == "__main__":
    main()
