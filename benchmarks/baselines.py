"""Older methods beside certified answers: friction pyramids (linear complementarity) and the scheme in turns.

    python -m benchmarks.baselines [--count 150] [--bundled] [--finer]

Random grasps of 3 to 5 contacts (`grasps.random_case`, seeds of their own) are asked for the largest pull; loads at
0.5, 0.9, 1.1 and 2 times its bound (1 and 10 times a unit force where there is none) are then asked of every method, if
the engine's own check of them is decided. With the bundled grasps, the six directions along the axes take the place of
the case's own. A verdict is *false* if it contradicts the engine's, which a witness or a certificate proves. Friction's
angle to the direction against the slip is written for every contact that slides under load, and the share of all work
that friction feeds in rather than takes. Written to results/baselines.json. `--finer` asks again, with 48 edges and a
hundredth of the inertia, of what 16 edges falsely called SLIPS, and with 16 edges for other solutions of the same
problem, by random covering vectors.
"""

from __future__ import annotations

import argparse
import json
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.grasps import random_case
from benchmarks.machine import describe
from handfast.core.answer import Verdict
from handfast.core.arrays import Array
from handfast.core.bundled import names
from handfast.model.grasp import Grasp
from handfast.papers.baselines import BaselineState, pyramid_step, turn_scheme
from handfast.readers.grasp_file import load_grasp
from handfast.stability.problem import model
from handfast.stability.problem.settings import Settings
from handfast.stability.studies.questions import check, maximum

RESULTS = Path(__file__).parent / "results" / "baselines.json"
SIZES = (3, 4, 5)
FIRST_SEED = 1_800_000
SHARES = (0.5, 0.9, 1.1, 2.0)
UNBOUNDED = (1.0, 10.0)
STARTS = 12  # random covering vectors
METHODS: dict[str, Callable[[Grasp, Array], BaselineState]] = {
    "pyramid, 4 edges": lambda g, w: pyramid_step(g, w, edges=4),
    "pyramid, 8 edges": lambda g, w: pyramid_step(g, w, edges=8),
    "pyramid, 16 edges": lambda g, w: pyramid_step(g, w, edges=16),
    "turns, 8 edges": lambda g, w: turn_scheme(g, w, edges=8, timeout=10.0),
}


def questions(count: int, bundled: bool) -> Iterator[tuple[str, Grasp, Array]]:
    """Name, grasp and direction (6,)."""
    if bundled:
        for name in names("grasps"):
            if load_grasp(name).has_laws:  # which the older methods do not know
                continue
            for axis in range(3):
                for sign in (1.0, -1.0):
                    yield f"{name} {'+' if sign > 0 else '-'}{'xyz'[axis]}", load_grasp(name), sign * np.eye(6)[axis]
        return
    for k in range(count):
        case = random_case(SIZES[k % len(SIZES)], FIRST_SEED + k)
        yield f"random {k}", case.grasp, case.direction


def asked(name: str, grasp: Grasp, direction: Array) -> list[dict[str, Any]]:
    """What each method says of each load, beside the engine."""
    settings = Settings(timeout=5.0)
    top = maximum(grasp, direction, settings=settings)
    bounded = np.isfinite(top.upper) and top.upper > 0
    out = []
    for s in [share * top.upper for share in SHARES] if bounded else UNBOUNDED:
        w = s * direction
        truth = check(grasp, w, settings=settings).verdict
        if truth is Verdict.UNDECIDED:
            continue
        row: dict[str, Any] = {"grasp": name, "contacts": grasp.m, "force": s, "engine": str(truth)}
        row["methods"] = {method: answered(method, grasp, w) for method in METHODS}
        out.append(row)
    return out


def answered(method: str, grasp: Grasp, w: Array) -> dict[str, Any]:
    """What a method says of a load: verdict, turns, errors of friction, share of work that it feeds in."""
    found = METHODS[method](grasp, w)
    said: dict[str, Any] = {"verdict": str(found.verdict), "turns": found.turns}
    if found.state is not None:
        errors = np.degrees(found.friction_errors[np.isfinite(found.friction_errors)])
        energy = model.energy(grasp, w, found.state)
        total = energy.stored + float(np.abs(energy.friction).sum())
        said["errors"] = np.round(errors, 1).tolist()
        said["fed in"] = round(energy.created / total, 4) if total > 0 else 0.0
    return said


def summary(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Of every method: verdicts beside the engine's, and errors of friction in what it says holds."""
    out: dict[str, Any] = {}
    for method in METHODS:
        counts: Counter[str] = Counter()
        errors: list[float] = []
        fed: list[float] = []
        for row in rows:
            said = row["methods"][method]
            right = said["verdict"] == row["engine"]
            kind = "right" if right else "undecided" if said["verdict"] == "undecided" else f"false {said['verdict']}"
            counts[kind] += 1
            counts[f"of {row['engine']}"] += 1
            if said["verdict"] == "holds":
                errors += said["errors"]
                fed.append(said["fed in"])
        out[method] = dict(sorted(counts.items())) | {
            "friction error [deg]": {
                "median": float(np.median(errors)) if errors else None,
                "95 %": float(np.percentile(errors, 95)) if errors else None,
                "worst": max(errors, default=None),
            },
            "states that feed work in": int(np.sum(np.array(fed) > 1e-3)),
            "states": len(fed),
        }
    return out


def finer(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Of random grasps that hold and slip with 16 edges: finer, other solutions, motions of the engine's states."""
    counts: Counter[str] = Counter()
    motions = []
    for row in rows:
        if row["engine"] != "holds" or row["methods"]["pyramid, 16 edges"]["verdict"] != "slips":
            continue
        k = int(row["grasp"].removeprefix("random "))
        case = random_case(SIZES[k % len(SIZES)], FIRST_SEED + k)
        w = row["force"] * case.direction
        fine = pyramid_step(case.grasp, w, edges=48, inertia=1e-9).verdict is Verdict.HOLDS
        others = (pyramid_step(case.grasp, w, edges=16, seed=seed).verdict for seed in range(STARTS))
        other = Verdict.HOLDS in others
        counts["asked"] += 1
        counts["hold with 48 edges and less inertia"] += fine
        counts["hold in another solution"] += other
        counts["hold in neither way"] += not (fine or other)
        witness = check(case.grasp, w).witness
        if witness is not None:
            motions.append(witness.largest_motion / model.force_scale(w, witness.state.c))
    return dict(counts) | {"median motion of witnesses [force scales]": float(np.median(motions))}


def write(data: dict[str, Any], path: Path) -> None:
    """A line for each load."""
    path.write_text(json.dumps(data, separators=(",", ":")).replace('{"grasp"', '\n{"grasp"') + "\n")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=150)
    parser.add_argument("--bundled", action="store_true", help="bundled grasps instead of random ones")
    parser.add_argument("--finer", action="store_true", help="only ask again what 16 edges falsely called SLIPS")
    parser.add_argument("--out", type=Path, default=RESULTS)
    args = parser.parse_args()
    part = "bundled" if args.bundled else "random"
    data = json.loads(args.out.read_text()) if args.out.exists() else {}
    rows: list[dict[str, Any]] = []
    if args.finer:
        data["random"]["finer"] = finer(data["random"]["rows"])
        write(data, args.out)
        print(data["random"]["finer"])
        return
    for n, question in enumerate(questions(args.count, args.bundled)):
        rows += asked(*question)
        if n % 20 == 19:
            print(n + 1, {m: v.get("right") for m, v in summary(rows).items()}, flush=True)
    data |= {"machine": describe(), part: {"summary": summary(rows), "rows": rows}}
    write(data, args.out)
    print(json.dumps(summary(rows), indent=1))


if __name__ == "__main__":
    main()
