"""How close to the edge of what is possible the prover shows that nothing is.

    python -m benchmarks.prover [--tasks NAME ...] [--seconds 60] [--plants 10000]

Three families make a bundled task impossible: the last object region moved away from the others (m), every
joint's range cut at its upper end (rad), the last object region turned about its middle (rad). The edge of each
is sought by bisection with `STARTS` local searches a step; the prover is then asked beyond it, at the margins of
`MARGINS` from the largest down, until one is not proved within the time: `--seconds` of each of its `--workers`
processors, whatever else these have to do meanwhile. A margin that is measured from an edge
that the local searches found too early is in truth smaller, never larger.

Beside it, `--plants` boxes around certified configurations of the nine tasks, each put to every search:
one that is discarded would be a wrong proof. Results: benchmarks/results/prover.json, written after every case;
a case that is there already is not run again, an edge
that is there is not sought again.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.model.region import Bezier
from handfast.synthesis.search.boxes import SearchPart
from handfast.synthesis.search.prover import Disproof, Prover
from handfast.synthesis.search.starts import BLOCK, Starts
from handfast.synthesis.task import Task
from handfast.synthesis.task_file import load_task
from handfast.synthesis.task_problem import TaskProblem

RESULTS = Path(__file__).parent / "results" / "prover.json"
TASKS = ("scalpel-upholding", "teapot-service", "scalpel-incision")
ALL = (
    *("scalpel-upholding", "scalpel-handling", "scalpel-incision"),
    *("teapot-lid-lifting", "teapot-service", "teapot-transportation"),
    *("guitar-tuning", "guitar-playing", "guitar-holding"),
)
STARTS = 2048
FINE = {"away": 1e-4, "limits": 2e-3, "normals": 5e-3}  # of the edge [m, rad]
FARTHEST = {"away": 0.4, "limits": 1.5, "normals": np.pi}
MARGINS = {
    "away": (0.02, 0.01, 0.005, 0.002, 0.001),
    "limits": tuple(np.radians((10.0, 5.0, 2.0, 1.0))),
    "normals": tuple(np.radians((20.0, 10.0, 5.0, 2.0, 1.0))),
}


def with_region(task: Task, move: Callable[[Array], Array]) -> Task:
    """The task with the last object region's control points moved."""
    *others, last = task.contact_pairs
    assert isinstance(last.object, Bezier)
    return replace(
        task, contact_pairs=(*others, replace(last, object=Bezier(move(last.object.points), last.object.flip)))
    )


def middle(task: Task, k: int) -> Array:
    region = task.contact_pairs[k].object
    assert isinstance(region, Bezier)
    return region.at(0.5, 0.5)


def away(task: Task, distance: float) -> Task:
    """The last region moved on the line from the middle of the others through its own."""
    b = len(task.contact_pairs)
    line = middle(task, b - 1) - np.mean([middle(task, k) for k in range(b - 1)], axis=0)
    return with_region(task, lambda points: points + distance * line / np.linalg.norm(line))


def limits(task: Task, angle: float) -> Task:
    """Every joint that turns loses `angle` at its upper end."""
    joints = tuple(
        replace(j, upper=max(j.lower, j.upper - angle)) if j.type == "revolute" and j.upper > j.lower else j
        for j in task.hand.joints
    )
    return replace(task, hand=replace(task.hand, joints=joints))


def normals(task: Task, angle: float) -> Task:
    """The last region turned about its first parameter's direction at its middle."""
    from scipy.spatial.transform import Rotation

    region = task.contact_pairs[-1].object
    assert isinstance(region, Bezier)
    axis, center = region.at(0.5, 0.5, 1, 0), region.at(0.5, 0.5)
    R = Rotation.from_rotvec(angle * axis / np.linalg.norm(axis)).as_matrix()
    return with_region(task, lambda points: (points - center) @ R.T + center)


FAMILIES = {"away": away, "limits": limits, "normals": normals}


def possible(task: Task) -> bool:
    """Did local searches find a certified configuration?"""
    try:
        starts = Starts(TaskProblem.of(task), 0)
    except InputError:
        return False
    return any(starts.run(1) for _ in range(STARTS // BLOCK))


def edge(task: Task, family: str) -> float | None:
    """The least amount at which local searches find nothing any more; None if they always do."""
    low, high = 0.0, None
    step = FARTHEST[family] / 16
    while high is None:
        if low + step > FARTHEST[family]:
            return None
        if possible(FAMILIES[family](task, low + step)):
            low += step
        else:
            high = low + step
    while high - low > FINE[family]:
        half = (low + high) / 2
        low, high = (half, high) if possible(FAMILIES[family](task, half)) else (low, half)
    return high


def measure(name: str, family: str, at: float | None, seconds: float, cores: int) -> list[dict]:
    """Rows of a family from its edge on, from the largest margin down to the first that is not proved."""
    task = load_task(name)
    base = {"task": name, "contacts": len(task.contact_pairs), "family": family, "edge": at}
    if at is None:
        return [base | {"margin": None, "proved": None, "note": "possible as far as tried"}]
    rows = []
    for margin in MARGINS[family]:
        try:
            problem = TaskProblem.of(FAMILIES[family](task, at + margin))
        except InputError as fault:
            rows.append(base | {"margin": margin, "proved": None, "note": str(fault)})
            continue
        prover = Prover(problem, workers=cores)
        prover.compile()
        clock, processors = time.perf_counter(), time.process_time()

        def stop(_: Disproof, end: float = processors + seconds * cores) -> None:
            if time.process_time() > end:
                raise KeyboardInterrupt

        done = prover.run(on_progress=stop)
        rows.append(
            base
            | {"margin": float(margin), "proved": done.empty, "by": done.by, "seconds": time.perf_counter() - clock}
            | {"processor_seconds": time.process_time() - processors}
            | {"nodes": done.nodes, "discarded": done.discarded, "pending": done.pending}
        )
        print(rows[-1], flush=True)
        if not done.empty:
            break
    return rows


def plants(count: int) -> dict:
    """Boxes of all sizes around certified configurations, put to every set of contacts."""
    tried = lost = 0
    for number, name in enumerate(ALL):
        problem = TaskProblem.of(load_task(name))
        prover, rng = Prover(problem, workers=1), np.random.default_rng(number)
        starts, wanted = Starts(problem, number), -(-count // len(ALL))
        found: list[Array] = []
        while len(found) < -(-wanted // 4):
            found += [c.x for c in starts.run()]
        for n in range(wanted):
            x, size = found[n // 4], float(10 ** rng.uniform(-4, 0.3))
            tried += 1
            for domain in prover.domains.values():
                y, use = domain.coordinates(x), domain.concern
                root = next(p.box for p in domain.roots if ((p.box[:, 0] <= y) & (y <= p.box[:, 1]))[domain.use].all())
                lower = np.maximum(root[:, 0], y - size * rng.random(problem.n))
                box = np.column_stack([lower, np.minimum(root[:, 1], y + size * rng.random(problem.n))])
                left = getattr(domain.examine(SearchPart(box, 1.0), budget=30), "children", ())
                if not any(((p.box[use, 0] <= y[use]) & (y[use] <= p.box[use, 1])).all() for p in left):
                    lost += 1
        print(name, tried, lost, flush=True)
    return {"boxes": tried, "lost": lost}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tasks", nargs="*", default=list(TASKS))
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--plants", type=int, default=10_000)
    asked = parser.parse_args()
    kept = json.loads(RESULTS.read_text("utf-8")) if RESULTS.exists() else {"edges": {}, "rows": [], "plants": None}

    def write() -> None:
        kept["settings"] = {"seconds": asked.seconds, "workers": asked.workers, "starts": STARTS}
        RESULTS.write_text(json.dumps(kept, indent=1) + "\n", "utf-8")

    if asked.plants and (kept["plants"] or {}).get("boxes", 0) < asked.plants:
        kept["plants"] = plants(asked.plants)
        write()
    done = {(r["task"], r["family"]) for r in kept["rows"]}
    for name in asked.tasks:
        for family in FAMILIES:
            if (name, family) not in done:
                if f"{name} {family}" not in kept["edges"]:
                    kept["edges"][f"{name} {family}"] = edge(load_task(name), family)
                at = kept["edges"][f"{name} {family}"]
                kept["rows"] += measure(name, family, at, asked.seconds, asked.workers)
                write()


if __name__ == "__main__":
    main()
