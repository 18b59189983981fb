"""Bounds without a cap on motions, attacked: is there a witness of any motion above a certified bound?

    python -m benchmarks.no_cap [--count 1000] [--first 700000] [--limit 10] [--shared ../shared] [--collinear]

Fresh random grasps of 3 to 8 contacts (`grasps.random_case` with seeds that nothing was tuned on), in turn plain,
with a base load, torque limits, a force limit, uncertain normals, a coupling between two joints, a prismatic joint.
Each is asked for its maximum. Its upper bound is then attacked: `check` just and far above it, 2 s each, and Newton's
method from random states whose motions are spread over nine decades, the magnitude held above the bound. A witness
that `stability/problem/model` accepts there would be a contradiction, and so would SLIPS at the lower bound. With
--shared, the grasps of reference/cap-cases too. With --collinear, grasps of 2 to 4 contacts on one line instead.
Writes results/no_cap.json (no_cap_collinear.json) as it goes on, and goes on where it was stopped.
"""

from __future__ import annotations

import argparse
import json
import time
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.grasps import random_case
from benchmarks.machine import describe
from handfast.core.answer import Stop, Verdict
from handfast.core.arrays import Array
from handfast.model.grasp import Contact, Grasp, GraspJoint
from handfast.model.mechanism import Mechanism
from handfast.readers.grasp_file import load_grasp
from handfast.stability.answers.max_query import max_goal
from handfast.stability.problem import scaled_problem
from handfast.stability.problem.grasp_limits import GraspLimits
from handfast.stability.problem.settings import Settings
from handfast.stability.search.reduced import reduce
from handfast.stability.search.search import exact_solution
from handfast.stability.studies.questions import check, maximum

RESULTS = Path(__file__).parent / "results" / "no_cap.json"
SIZES = (3, 4, 5, 6, 7, 8)
KINDS = ("plain", "base load", "torque limits", "force limit", "eta", "coupling", "prismatic")
ABOVE = (1.001, 1.03, 1.3, 3.0)  # times the upper bound
STARTS = 40  # of Newton's method
ATTACK = 2.0  # [s] for a check above the bound


def question(k: int, first: int, sizes: tuple[int, ...] = SIZES) -> tuple[str, Grasp, Array, dict[str, Any]]:
    """Kind, grasp, direction and options of the k-th question."""
    kind, m, seed = KINDS[k % len(KINDS)], sizes[(k // len(KINDS)) % len(sizes)], first + k
    case, rng = random_case(m, seed), np.random.default_rng(seed)
    grasp, options = case.grasp, {}
    names = grasp.mechanism.actuators
    if kind == "base load":
        options = {"base": rng.uniform(0.05, 0.5) * random_case(m, seed + 10**6).direction}
    elif kind == "torque limits":
        options = {"limits": GraspLimits(torque_limits={n: float(rng.uniform(0.2, 1.0)) for n in names[:3]})}
    elif kind == "force limit":
        options = {"limits": GraspLimits(force_limit=float(rng.uniform(5.0, 50.0)))}
    elif kind == "eta":
        options = {"limits": GraspLimits(float(np.radians(rng.uniform(0.5, 3.0))))}
    elif kind == "coupling":  # the last joint follows the one before it at a third
        A = np.zeros((1, grasp.l))
        A[0, -1], A[0, -2] = 1.0, -1.0 / 3.0
        mechanism = Mechanism(names[:-1], grasp.mechanism.R[:-1], A, grasp.mechanism.tendon[:-1])
        grasp = Grasp(
            grasp.contacts, grasp.joints, mechanism, {n: v for n, v in grasp.preload.items() if n in names[:-1]}
        )
    elif kind == "prismatic":
        joints = list(grasp.joints)
        joints[0] = replace(joints[0], type="prismatic", axis=grasp.contacts[joints[0].moves[0]].normal)
        grasp = Grasp(
            grasp.contacts, joints, grasp.mechanism, {joints[0].name: 2.0} | dict(list(grasp.preload.items())[1:])
        )
    return kind, grasp, case.direction, options


def collinear(k: int, first: int) -> tuple[str, Grasp, Array, dict[str, Any]]:
    """Contacts on one line, through the origin and along an axis or not; a force on it, which turns nothing about it.

    Two fingers squeeze along the line, or all press across it from both sides, each with two joints, of which one is
    commanded.
    """
    m, rng = 2 + k % 3, np.random.default_rng([first + k, 4])
    kind = ("squeezed", "across")[k // 3 % 2]
    frame = np.linalg.qr(rng.normal(size=(3, 3)))[0] if k // 6 % 2 else np.eye(3)
    along, side, across = frame.T
    places = np.sort(rng.uniform(-0.04, 0.04, m)) + np.linspace(-0.02, 0.02, m)
    middle = rng.normal(0, 0.03, 3) if k // 12 % 2 else np.zeros(3)
    contacts, joints, preload, mu = [], [], {}, float(rng.uniform(0.4, 1.0))
    for i, place in enumerate(places.tolist()):
        normal = side * (1 if i % 2 else -1)
        if kind == "squeezed" and i in (0, m - 1):
            normal = along * (-1 if i else 1)
        position = middle + place * along
        contacts.append(Contact(position, normal, mu, f"finger_{i}"))
        axis = np.cross(normal, across if abs(normal @ across) < 0.5 else side)
        for j, lever in enumerate((0.06, 0.03)):  # a positive motion presses
            origin = position - lever * np.cross(normal, axis) - 0.01 * normal
            joints.append(GraspJoint(f"finger_{i}_{j}", axis, origin, (i,)))
        preload[f"finger_{i}_0"] = float(rng.uniform(0.05, 0.15))
    force = rng.normal(size=3)
    force /= np.linalg.norm(force)
    at = middle + float(rng.uniform(*places[[0, -1]])) * along
    return f"{kind} {m}", Grasp(contacts, joints, preload=preload), np.r_[force, np.cross(at, force)], {}


def attacked(
    grasp: Grasp, direction: Array, options: dict[str, Any], bounds: tuple[float, float], seed: int
) -> list[str]:
    """What contradicts the bounds: SLIPS at the lower one; above the upper one checks that hold, Newton's witnesses."""
    found, (lower, upper) = [], bounds
    rest = {name: v for name, v in options.items() if name != "base"}
    base = options.get("base", np.zeros(6))
    if np.isfinite(lower) and lower > 0:
        below = check(grasp, base + lower * direction, settings=Settings(timeout=ATTACK), **rest)
        if below.verdict is Verdict.SLIPS:
            found.append("check slips at the lower bound")
    if not np.isfinite(upper):
        return found
    for factor in ABOVE:
        s = upper * factor if upper > 0 else factor * 1e-3
        answer = check(grasp, base + s * direction, settings=Settings(timeout=ATTACK), **rest)
        if answer.verdict is Verdict.HOLDS:
            found.append(f"check holds at {factor:g} times the bound")
    p = scaled_problem.build(grasp, base, direction, **rest)
    goal = max_goal(p)
    if upper > 0 and p.f_c.any():
        r, rng = reduce(p, goal), np.random.default_rng(seed)
        nu = r.M.shape[1]
        for _ in range(STARTS):
            s = upper / p.direction_scale * (1 + 10 ** rng.uniform(-4, 1))
            held = -s if "scalar" in r.names[0] and r.hi[0] == 0 else 1 / s
            z = rng.standard_normal(len(r.cost))
            z[:nu] *= 10 ** rng.uniform(0, 9)
            z[nu:] *= 10 ** rng.uniform(-1, 2)
            near = replace(r, lo=np.r_[held, r.lo[1:]])
            y = exact_solution(near, z, hold=True)
            if y is not None and r.witness(r.point(y)).valid:
                found.append(f"a state at {s * p.direction_scale / upper:.6g} times the bound")
    return found


def ask(
    name: str, kind: str, grasp: Grasp, direction: Array, options: dict[str, Any], seed: int, limit: float
) -> dict[str, Any]:
    """One question and the attack on its answer."""
    start = time.perf_counter()
    a = maximum(grasp, direction, settings=Settings(timeout=limit), **options)
    seconds = time.perf_counter() - start
    bounded = bool(np.isfinite(a.upper))
    return {
        "name": name,
        "kind": kind,
        "contacts": grasp.m,
        "verdict": str(a.verdict),
        "stop": str(a.stop),
        "lower": a.lower,
        "upper": a.upper if bounded else None,
        "unbounded": a.unbounded,
        "limit": a.limit.value if a.limit else None,
        "verified": a.verified,
        "motion_cap": a.proof.cap if a.proof else None,
        "nodes": a.nodes,
        "seconds": round(seconds, 3),
        "contradictions": attacked(grasp, direction, options, (a.lower, a.upper), seed),
    }


def wide(row: dict[str, Any]) -> bool:
    """Is there a gap above 1e-3?"""
    if row["unbounded"] or row["verdict"] == "slips":
        return False
    return row["upper"] is None or row["upper"] - row["lower"] > 1.001e-3 * max(row["lower"], 1e-12)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--first", type=int, default=700_000)
    parser.add_argument("--limit", type=float, default=10.0, help="[s] per question")
    parser.add_argument("--shared", type=Path, default=None)
    parser.add_argument("--collinear", action="store_true", help="contacts on one line instead")
    parser.add_argument("--out", type=Path, default=None)
    args = parser.parse_args()
    args.out = args.out or (RESULTS.with_stem("no_cap_collinear") if args.collinear else RESULTS)
    draw = collinear if args.collinear else question
    rows: list[dict[str, Any]] = json.loads(args.out.read_text())["rows"] if args.out.exists() else []
    done = {row["name"] for row in rows}

    def save() -> None:
        kinds = sorted({row["kind"] for row in rows})
        summary = {
            kind: {
                "asked": sum(r["kind"] == kind for r in rows),
                "bounded": sum(r["kind"] == kind and r["upper"] is not None for r in rows),
                "only approached": sum(r["kind"] == kind and r["limit"] is not None for r in rows),
                "gap above 1e-3": sum(r["kind"] == kind and wide(r) for r in rows),
                "within a cap only": sum(r["kind"] == kind and r["motion_cap"] is not None for r in rows),
                "contradictions": sum(len(r["contradictions"]) for r in rows if r["kind"] == kind),
            }
            for kind in kinds
        }
        data = {
            "machine": describe(),
            "first seed": args.first,
            "limit": args.limit,
            "asked": len(rows),
            "stops": Counter(r["stop"] for r in rows),
            "summary": summary,
            "wide": [r["name"] for r in rows if wide(r)],
            "contradicted": [r["name"] for r in rows if r["contradictions"]],
            "rows": rows,
        }
        part = args.out.with_suffix(".part")
        part.write_text(json.dumps(data, indent=1) + "\n")
        part.replace(args.out)

    if args.shared:
        folder = args.shared / "reference" / "cap-cases"
        for entry in json.loads((folder / "index.json").read_text()):
            if entry["grasp"] not in done:
                grasp = load_grasp(folder / entry["grasp"])
                rows.append(ask(entry["grasp"], "shared", grasp, np.array(entry["direction"]), {}, 0, args.limit))
    for k in range(args.count):
        name = f"{args.first + k}"
        if name in done:
            continue
        kind, grasp, direction, options = draw(k, args.first)
        rows.append(ask(name, kind, grasp, direction, options, args.first + k, args.limit))
        last = rows[-1]
        if last["contradictions"] or wide(last) or last["stop"] != Stop.COMPLETE:
            print(
                json.dumps(
                    {key: last[key] for key in ("name", "kind", "contacts", "stop", "lower", "upper", "contradictions")}
                )
            )
        if k % 20 == 19:
            save()
    save()
    print(json.dumps(json.loads(args.out.read_text())["summary"], indent=1))


if __name__ == "__main__":
    main()
