"""How close to the edge of what is possible the prover shows that nothing is.

    python -m benchmarks.prover [--tasks NAME ...] [--families NAME ...] [--directions 20 --axes 10]
        [--seconds 10] [--plants 10000]

A family makes a task impossible by more and more. Three are the same for every task: the last object region moved away
from the others (m), every joint's range cut at its upper end (rad), the last object region turned about its middle
(rad). The others are drawn by a fixed seed: an object region moved along a direction (`move 0` to `move 19`), and one
turned about an axis through its middle (`turn 0` to `turn 9`). The edge of each is sought by bisection with local
searches, from the configurations found so far and `STARTS` others a step; the prover is then asked beyond it, at the
smallest of the margins that is proved within the time, found by bisection: `--seconds` of each of its `--workers`
processors, whatever else these have to do meanwhile. A margin that is measured from an edge that the local searches
found too early is in truth smaller, never larger.

Tasks are the bundled ones and the authors' own files, where they are at hand. Beside it, `--plants` boxes around
certified configurations of the nine bundled tasks, each put to every search: one that is discarded would be a wrong
proof. Results: benchmarks/results/prover.json, written after every case; a case that is there already is not run
again, an edge that is there is not sought again. Prints how far each family comes, the worst first.
"""

from __future__ import annotations

import argparse
import json
import time
import zlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.tasks import AUTHORS, tasks
from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.model.region import Bezier
from handfast.synthesis.search.boxes import SearchPart
from handfast.synthesis.search.prover import Disproof, Prover
from handfast.synthesis.search.starts import START_BLOCK, Starts
from handfast.synthesis.task import Task
from handfast.synthesis.task_problem import TaskProblem

RESULTS = Path(__file__).parent / "results" / "prover.json"
SEED = 29
STARTS = 512
KEPT = 32  # configurations from which the search for those of the next amount begins
LENGTHS, ANGLES = (0.001, 0.002, 0.005, 0.01, 0.02), tuple(np.radians((1.0, 2.0, 5.0, 10.0, 20.0)))  # margins [m, rad]
FARTHEST = {"away": 0.4, "move": 0.4, "limits": 1.5, "normals": np.pi, "turn": np.pi}
FINE = {"away": 1e-4, "move": 1e-4, "limits": 2e-3, "normals": 5e-3, "turn": 2e-3}  # of the edge [m, rad]

Change = Callable[[float], Task]


def with_region(task: Task, k: int, move: Callable[[Array], Array]) -> Task:
    """The task with the control points of an object region moved."""
    pairs = list(task.contact_pairs)
    region = pairs[k].object
    assert isinstance(region, Bezier)
    pairs[k] = replace(pairs[k], object=Bezier(move(region.points), region.flip))
    return replace(task, contact_pairs=tuple(pairs))


def middle(task: Task, k: int, *order: int) -> Array:
    """Of an object region: the point there, or a derivative."""
    region = task.contact_pairs[k].object
    assert isinstance(region, Bezier)
    return region.at(0.5, 0.5, *order)


def shift(task: Task, k: int, along: Array, distance: float) -> Task:
    """Object region k moved along a direction."""
    return with_region(task, k, lambda points: points + distance * along / np.linalg.norm(along))


def turn(task: Task, k: int, axis: Array, angle: float) -> Task:
    """Object region k turned about an axis through its middle."""
    from scipy.spatial.transform import Rotation

    center = middle(task, k)
    R = Rotation.from_rotvec(angle * axis / np.linalg.norm(axis)).as_matrix()
    return with_region(task, k, lambda points: (points - center) @ R.T + center)


def limits(task: Task, angle: float) -> Task:
    """Every joint that turns loses `angle` at its upper end."""
    joints = tuple(
        replace(j, upper=max(j.lower, j.upper - angle)) if j.type == "revolute" and j.upper > j.lower else j
        for j in task.hand.joints
    )
    return replace(task, hand=replace(task.hand, joints=joints))


def changed(name: str, task: Task, family: str) -> Change:
    """What a family does to a task by a distance [m] or an angle [rad]; drawn ones follow from name and family."""
    last = len(task.contact_pairs) - 1
    match family.split():
        case ["limits"]:
            return lambda by: limits(task, by)
        case ["away"]:
            line = middle(task, last) - np.mean([middle(task, k) for k in range(last)], axis=0)
            return lambda by: shift(task, last, line, by)
        case ["normals"]:
            return lambda by: turn(task, last, middle(task, last, 1, 0), by)
        case [kind, number]:
            rng = np.random.default_rng([SEED, zlib.crc32(f"{name} {kind}".encode()), int(number)])
            k, along = int(rng.integers(last + 1)), rng.standard_normal(3)
            move = shift if kind == "move" else turn
            return lambda by: move(task, k, along, by)
    raise ValueError(family)


def known(task: Task, near: Array) -> Array:
    """(k, n) certified configurations of a task: local searches from those of another one (m, n), then random ones."""
    try:
        starts = Starts(TaskProblem.of(task), 0)
    except InputError:
        return near[:0]
    rng = np.random.default_rng(SEED)
    around = [near, *(near + 10.0**-power * rng.standard_normal(near.shape) for power in (3, 2, 1))]
    found = starts.near(np.concatenate(around), KEPT) if len(near) else []
    for _ in range(STARTS // START_BLOCK):
        found += [] if found else starts.run(KEPT)
    return np.array([c.x for c in found]).reshape(-1, starts.problem.n)


def edge(change: Change, kind: str) -> float | None:
    """The least amount at which local searches find nothing any more; None if they always do."""
    low, high, step = 0.0, FARTHEST[kind], FARTHEST[kind] / 16
    here = known(change(0.0), np.zeros((0, TaskProblem.of(change(0.0)).n)))
    while high - low > FINE[kind]:
        at = low + step if high == FARTHEST[kind] else (low + high) / 2
        if at > FARTHEST[kind]:
            return None
        there = known(change(at), here)
        low, high, here = (at, high, there) if len(there) else (low, at, here)
    return high if high < FARTHEST[kind] else None


def measure(change: Change, base: dict, at: float | None, seconds: float, cores: int) -> list[dict]:
    """Rows of a family beyond its edge: at the smallest margin, the largest, and between them by bisection."""
    if at is None:
        return [base | {"margin": None, "proved": None, "note": "possible as far as tried"}]
    margins = LENGTHS if lengthwise(base["family"]) else ANGLES
    base = base | {"limit": seconds * cores}
    rows = [beyond(change(at + margins[0]), base | {"margin": margins[0]}, seconds * cores, cores)]
    low, high = 0, len(margins)  # not proved, proved
    while not rows[0]["proved"] and high - low > 1:
        k = high - 1 if high == len(margins) else (low + high) // 2
        rows.append(beyond(change(at + margins[k]), base | {"margin": margins[k]}, seconds * cores, cores))
        if high == len(margins) and not rows[-1]["proved"]:
            break
        low, high = (low, k) if rows[-1]["proved"] else (k, high)
    return rows


def beyond(task: Task, base: dict, limit: float, cores: int) -> dict:
    """What the prover says of a task within so much processor time [s]."""
    try:
        problem = TaskProblem.of(task)
    except InputError as fault:
        return base | {"proved": None, "note": str(fault)}
    prover = Prover(problem, workers=cores)
    prover.compile()
    clock, processors = time.perf_counter(), time.process_time()

    def stop(_: Disproof, end: float = processors + limit) -> None:
        if time.process_time() > end:
            raise KeyboardInterrupt

    done = prover.run(on_progress=stop)
    row = (
        base
        | {"margin": float(base["margin"]), "proved": done.empty, "by": done.by, "seconds": time.perf_counter() - clock}
        | {"processor_seconds": time.process_time() - processors}
        | {"nodes": done.nodes, "discarded": done.discarded, "pending": done.pending}
    )
    print(row, flush=True)
    return row


def plants(count: int) -> dict:
    """Boxes of all sizes around certified configurations, put to every set of contacts."""
    tried = lost = 0
    bundled = {name: task for name, task in tasks().items() if " " not in name}
    for number, (name, task) in enumerate(bundled.items()):
        problem = TaskProblem.of(task)
        prover, rng = Prover(problem, workers=1), np.random.default_rng(number)
        starts, wanted = Starts(problem, number), -(-count // len(bundled))
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


def smallest(rows: list[dict]) -> dict[tuple[str, str], dict | None]:
    """Of each task and family that has an edge: the row of the smallest margin that is proved, None if none is."""
    out: dict[tuple[str, str], dict | None] = {}
    for row in sorted(rows, key=lambda r: -(r["margin"] or 0.0)):
        if row["margin"] is not None:
            case = row["task"], row["family"]
            out[case] = row if row["proved"] else out.get(case)
    return out


def lengthwise(family: str) -> bool:
    """Are its amounts lengths, and not angles?"""
    return family.split()[0] in ("away", "move")


def report(rows: list[dict]) -> None:
    """The smallest margin that is proved in each case, the worst first, then how many drawn cases come how far."""

    def far(case: tuple[str, str]) -> tuple[float, float]:
        """Margin, as part of the largest one, and processor time; infinite if none is proved."""
        row = cases[case]
        most = LENGTHS[-1] if lengthwise(case[1]) else ANGLES[-1]
        return (row["margin"] / most, row["processor_seconds"]) if row else (np.inf, np.inf)

    def size(family: str, amount: float) -> str:
        return f"{1e3 * amount:.4g} mm" if lengthwise(family) else f"{np.degrees(amount):.4g}°"

    cases, edges = smallest(rows), {(r["task"], r["family"]): r["edge"] for r in rows}
    print("| task | made impossible by | edge | margin proved | boxes | processor time [s] | by |")
    print("|---|---|---:|---:|---:|---:|---|")
    for case in sorted(cases, key=far, reverse=True):
        (name, family), row = case, cases[case]
        told = "none | | |"
        if row:
            told = f"{size(family, row['margin'])} | {row['nodes']:,} | {row['processor_seconds']:.2f} | {row['by']}"
        print(f"| {name} | {family} | {size(family, edges[case])} | {told} |")
    for kind, margins in (("move", LENGTHS), ("turn", ANGLES)):
        drawn: dict[str, list[float]] = {}  # of each task the smallest margins; infinite if none is proved
        for (name, family), row in cases.items():
            if family.split()[0] == kind:
                drawn.setdefault(name, []).append(row["margin"] if row else np.inf)
        if drawn:
            print(f"\n| task, {kind} | drawn | {' | '.join(f'proved at {size(kind, x)}' for x in margins)} |")
            print("|---|" + "---:|" * (len(margins) + 1))
        for name, its in sorted(drawn.items(), key=lambda one: -np.isinf(one[1]).sum()):
            at = [sum(x <= margin * (1 + 1e-9) for x in its) for margin in margins]
            print(f"| {name} | {len(its)} | {' | '.join(map(str, at))} |")


def main() -> None:
    known_tasks = tasks()
    if not AUTHORS.is_dir():
        print(f"the authors' own tasks are not at hand ({AUTHORS}): bundled ones alone")
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tasks", nargs="*", default=list(known_tasks))
    parser.add_argument("--families", nargs="*", default=["away", "limits", "normals"])
    parser.add_argument("--directions", type=int, default=20)
    parser.add_argument("--axes", type=int, default=10)
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--plants", type=int, default=10_000)
    parser.add_argument("--results", type=Path, default=RESULTS)
    asked = parser.parse_args()
    path = asked.results
    kept = json.loads(path.read_text("utf-8")) if path.exists() else {"edges": {}, "rows": [], "plants": None}

    def write() -> None:
        kept["settings"] = {"seconds": asked.seconds, "workers": asked.workers, "starts": STARTS}
        path.write_text(json.dumps(kept, indent=1) + "\n", "utf-8")

    if asked.plants and (kept["plants"] or {}).get("boxes", 0) < asked.plants:
        kept["plants"] = plants(asked.plants)
        write()
    done = {(r["task"], r["family"]) for r in kept["rows"]}
    drawn = [*(f"move {i}" for i in range(asked.directions)), *(f"turn {i}" for i in range(asked.axes))]
    for family in [*asked.families, *drawn]:
        for name in asked.tasks:
            task = known_tasks[name]
            if (name, family) in done:
                continue
            change, key = changed(name, task, family), f"{name} {family}"
            if key not in kept["edges"]:
                kept["edges"][key] = edge(change, family.split()[0])
            base = {"task": name, "contacts": len(task.contact_pairs), "family": family, "edge": kept["edges"][key]}
            kept["rows"] += measure(change, base, kept["edges"][key], asked.seconds, asked.workers)
            write()
    report(kept["rows"])


if __name__ == "__main__":
    main()
