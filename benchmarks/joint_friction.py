"""What dry friction of joints costs a question: nodes and processor time by the number of joints that rub.

    python -m benchmarks.joint_friction [--count 20] [--limit 10]

Random grasps of 3 to 5 contacts, a finger of three joints behind each contact. The first joint's motor squeezes, the
others are locked, but for 0, 1, 2, 4 and 8 of them, as far as there are so many, that have no motor and rub: friction
that is no part of anything else, and has a joint and two tendons of its own in the search. The load is the largest one
along a direction, proofs not replayed. Writes results/joint_friction.json and prints a Markdown table of medians.
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.grasps import Quadric, Sketch, pull
from benchmarks.machine import describe
from handfast.core.answer import Stop
from handfast.core.arrays import Array
from handfast.model.grasp import Grasp
from handfast.model.mechanism import Mechanism
from handfast.stability.problem.settings import Settings
from handfast.stability.studies.questions import maximum

RESULTS = Path(__file__).parent / "results" / "joint_friction.json"
SIZES, RUBBING, FIRST_SEED = (3, 4, 5), (0, 1, 2, 4, 8), 3_100_000
LEAST, MOST = 0.3, 1.0  # [N m] of friction: next to commands of 0.05 to 0.15, most of it holds


def drawn(m: int, seed: int) -> tuple[Grasp, Array, Array]:
    """A grasp with m fingers, a direction (6,), and friction for each of its joints (3 m,)."""
    rng = np.random.default_rng([m, seed])
    sketch = Sketch(rng, Quadric.drawn(rng), rng.uniform(0.3, 0.8))
    turn = rng.uniform(0, 2 * np.pi)
    for f in range(m):
        sketch.finger(f"finger_{f}", turn + 2 * np.pi * f / m + 0.2 * rng.normal(), 1, 3, (-0.5, -0.1))
    grasp = sketch.grasp(f"rubbing {m} {seed}")
    return grasp, pull(rng, grasp, np.array([0, 0, 1.0])), rng.uniform(LEAST, MOST, grasp.l)


def rubbing(grasp: Grasp, friction: Array, count: int, rng: np.random.Generator) -> Grasp:
    """The grasp with friction in place of the motors of as many of its locked joints."""
    locked = [i for i, joint in enumerate(grasp.joints) if joint.name not in grasp.preload]
    chosen = rng.permutation(locked)[:count]
    joints = [replace(j, friction=friction[i]) if i in chosen else j for i, j in enumerate(grasp.joints)]
    kept = np.setdiff1d(np.arange(grasp.l), chosen)
    names = tuple(grasp.joints[i].name for i in kept)
    motors = Mechanism(names, np.eye(grasp.l)[kept], np.zeros((0, grasp.l)), (False,) * len(kept))
    return Grasp(grasp.contacts, joints, motors, grasp.preload, grasp.name)


def asked(grasp: Grasp, direction: Array, limit: float) -> dict[str, Any]:
    """One maximum: nodes and processor time, the quicker of two runs."""
    seconds = []
    for _ in range(2):
        start = time.process_time()
        found = maximum(grasp, direction, settings=Settings(timeout=limit, verify=False, jobs=1))
        seconds.append(time.process_time() - start)
    ended = found.stop is Stop.COMPLETE
    return {"seconds": min(seconds), "nodes": found.nodes, "ended": ended, "verdict": str(found.verdict)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--limit", type=float, default=10.0)
    options = parser.parse_args()
    rows = []
    for m in SIZES:
        for k in range(options.count):
            grasp, direction, friction = drawn(m, FIRST_SEED + k)
            for count in (n for n in RUBBING if n <= 2 * m):
                some = rubbing(grasp, friction, count, np.random.default_rng([m, k, 1]))
                rows.append({"contacts": m, "rubbing": count, **asked(some, direction, options.limit)})
    RESULTS.write_text(json.dumps({"machine": describe(), "count": options.count, "rows": rows}, indent=1) + "\n")
    print("| contacts | joints that rub | nodes, median | mean | processor time, median | longest | not ended | hold |")
    print("|---:|---:|---:|---:|---:|---:|---:|---:|")
    for m in SIZES:
        for count in RUBBING:
            some = [r for r in rows if (r["contacts"], r["rubbing"]) == (m, count)]
            if some:
                nodes, seconds = (statistics.median(r[key] for r in some) for key in ("nodes", "seconds"))
                most, open_ = max(r["seconds"] for r in some), sum(not r["ended"] for r in some)
                holds = sum(r["verdict"] == "holds" for r in some)
                mean = statistics.fmean(r["nodes"] for r in some)
                cells = f"{nodes:.0f} | {mean:.0f} | {1e3 * seconds:.1f} ms | {1e3 * most:.0f} ms | {open_} | {holds}"
                print(f"| {m} | {count} | {cells} |")


if __name__ == "__main__":
    main()
