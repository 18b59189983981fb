"""Study: a tree search with compiled programs against Algorithm 1. Not part of the package; needs numba.

    python benchmarks/engine_study/run.py [--peer scip|gurobi] [--peer-limit 60] [--grasps 10]

Largest disturbance of the paper's grasps and of random ones (3 to 6 contacts, seeds fixed), gap 1e-3, one
run side by side. Homogeneous maxima only: no limits, no base load, exact normals, no certificates. Writes
benchmarks/results/engine_study.json after every case and prints a Markdown table. What it is for: to know
node counts, where the time goes and what goes wrong, before the engine is written.
"""

from __future__ import annotations

import argparse
import json
import statistics
import sys
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
from tree import search

from holdfast.grasp import Contact, Grasp, GraspJoint
from holdfast.grasp_file import load_grasp
from holdfast.stability import problem
from holdfast.stability.queries import maximum
from holdfast.stability.settings import Settings
from machine import describe

RESULTS = Path(__file__).parents[1] / "results" / "engine_study.json"
PAPER = {
    "fig1 +y": ("fig1", [0, 1, 0]),
    "fig1-coupled +y": ("fig1-coupled", [0, 1, 0]),
    "fig7 +y": ("fig7", [0, 1, 0]),
    "fig9 -y": ("fig9", [0, -1, 0]),
    "fig9 +y": ("fig9", [0, 1, 0]),
    "fig11 +z": ("fig11", [0, 0, 1]),
}


def random_case(m: int, seed: int) -> tuple[Grasp, np.ndarray]:
    """m contacts on an ellipsoid, three fingers of two joints that press them, and a random wrench."""
    rng = np.random.default_rng([m, seed])
    axes = np.array([0.03, 0.04, 0.05])
    contacts = []
    for _ in range(m):
        u = rng.normal(size=3)
        point = axes * u / np.linalg.norm(u)
        inward = -point / axes**2
        contacts.append(Contact(point, inward / np.linalg.norm(inward), 0.5))
    joints = []
    for f in range(3):
        moves = [i for i in range(m) if i % 3 == f]
        tip = contacts[moves[0]]
        base = np.array([0, 0, -0.1]) + 0.03 * rng.normal(size=3)
        axis = np.cross(tip.position - base, tip.normal)
        axis /= np.linalg.norm(axis)
        middle = (base + tip.position) / 2 + 0.01 * rng.normal(size=3)
        joints.append(GraspJoint(f"prox_{f}", axis, base, tuple(moves)))
        joints.append(GraspJoint(f"dist_{f}", axis, middle, (moves[0],)))
    d = rng.normal(size=6) * np.r_[1, 1, 1, 0.03, 0.03, 0.03]
    grasp = Grasp(contacts, joints, preload={f"prox_{f}": 0.1 for f in range(3)}, name=f"random {m} {seed}")
    return grasp, d / np.linalg.norm(d[:3])


def compare(name: str, grasp: Grasp, d: np.ndarray, peer: str, peer_limit: float) -> dict[str, Any]:
    """One case on both."""
    p = problem.build(grasp, np.zeros(6), d)
    ours = search(p)
    theirs = maximum(grasp, d, settings=Settings(solver=peer, time_limit=peer_limit)) if peer_limit > 0 else None
    row: dict[str, Any] = {
        "name": name,
        "contacts": grasp.m,
        "magnitude": ours.magnitude,
        "finished": ours.finished,
        "nodes": ours.nodes,
        "newtons": ours.newtons,
        "unresolved": ours.unresolved,
        "restarts": ours.restarts,
        "seconds": ours.seconds,
    }
    if theirs is not None:
        upper = None if theirs.unbounded or not np.isfinite(theirs.upper) else theirs.upper
        row["peer"] = {
            "lower": theirs.lower,
            "upper": upper,
            "unbounded": theirs.unbounded,
            "stop": str(theirs.stop),
            "seconds": theirs.seconds,
        }
        # a contradiction: a witness above the peer's bound, or a finished search below the peer's witness
        above = upper is not None and ours.magnitude > upper * (1 + 1e-6)
        below = ours.finished and not ours.unresolved and ours.magnitude * (1 + 2e-3) < theirs.lower
        row["contradiction"] = bool(above or below)
    return row


def table(rows: list[dict[str, Any]]) -> str:
    """Medians by number of contacts (random cases) and the paper's grasps one by one."""
    lines = [
        "| cases | nodes | programs [ms] | Newton [ms] | all [ms] | peer [s] | peer / ours |",
        "|---|---:|---:|---:|---:|---:|---:|",
    ]
    groups: dict[str, list[dict[str, Any]]] = {}
    for r in rows:
        groups.setdefault(r["name"] if not r["name"].startswith("random") else f"{r['contacts']} random", []).append(r)
    for name, group in groups.items():

        def median(get: Any, group: list[dict[str, Any]] = group) -> float:
            return statistics.median(get(r) for r in group)

        ms = [1e3 * median(lambda r, k=k: r["seconds"][k]) for k in ("programs", "newton", "all")]
        peers = [r for r in group if "peer" in r]
        peer = statistics.median(r["peer"]["seconds"] for r in peers) if peers else float("nan")
        ratio = statistics.median(r["peer"]["seconds"] / r["seconds"]["all"] for r in peers) if peers else float("nan")
        numbers = " | ".join(f"{x:.0f}" for x in ms)
        lines.append(f"| {name} | {median(lambda r: r['nodes']):.0f} | {numbers} | {peer:.2f} | {ratio:.1f} |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--peer", default="scip", choices=["scip", "gurobi"])
    parser.add_argument("--peer-limit", type=float, default=60.0, help="seconds; 0 leaves the peer out")
    parser.add_argument("--grasps", type=int, default=10, help="random grasps that resist something, per contact count")
    options = parser.parse_args()
    search(problem.build(load_grasp("fig11"), np.zeros(6), np.array([0, 0, 1.0, 0, 0, 0])))  # compile
    data: dict[str, Any] = {"machine": describe(), "peer": options.peer, "peer_limit": options.peer_limit, "rows": []}

    def keep(row: dict[str, Any]) -> None:
        data["rows"].append(row)
        RESULTS.write_text(json.dumps(data, indent=1) + "\n")
        print(json.dumps(row), flush=True)

    for name, (grasp, force) in PAPER.items():
        keep(compare(name, load_grasp(grasp), np.r_[force, 0, 0, 0].astype(float), options.peer, options.peer_limit))
    for m in (3, 4, 5, 6):
        found = 0
        for seed in range(1000):
            if found == options.grasps:
                break
            grasp, d = random_case(m, seed)
            if search(problem.build(grasp, np.zeros(6), d), limit=20.0).magnitude == 0:
                continue  # resists nothing, and both say so in a moment
            found += 1
            limit = options.peer_limit if m <= 5 else 0.0
            keep(compare(f"random {m} {seed}", grasp, d, options.peer, limit))
    print(f"\n{table(data['rows'])}")
    print(f"\ncontradictions: {sum(bool(r.get('contradiction')) for r in data['rows'])}")


if __name__ == "__main__":
    main()
