"""A thousand planar grasps: what an exact oracle that knows nothing of the engine says, and what the engine says.

    python -m benchmarks.planar [--count 1000] [--first 0] [--limit 10] [--intervals]

Grasps of 3 to 8 contacts with immobile fingers in the plane z = 0, in turn on an ellipse with normals that lean, on the
sides of a polygon (parallel normals, opposite contacts), and on a coarse grid with few directions and friction
coefficients (contacts on one line, at one place, planes of motions that coincide). Half of the base loads are what some
motion resists, the others are random, as are all directions; none was chosen by its answer. `planar_ranges` says
exactly which magnitudes are resisted. The engine is asked for the maximum of the spatial grasp, and for checks just
inside and just outside of every end of every range, a relative `NEAR` away, or far out where there is none. It is
contradicted if an exact range has an end outside of its bounds, or a check another verdict; UNDECIDED contradicts
nothing and is counted. Neither does a HOLDS where a load that differs by less than `MISSED` is resisted exactly, for
that is as near as a witness has to come: two contacts resist loads of a thin fan only, which rounded numbers miss. Nor
does a SLIPS or a bound that is said of motions up to a cap, if the oracle's state of least motion moves farther.
Results are written every 50 grasps to results/planar.json; a run goes on where it was stopped. `--intervals` goes on
with what `maximum(..., interval=True)` shows of smaller magnitudes, for all grasps with a hole and every tenth other
one: magnitudes that it shows resisted have to lie in the exact ranges, and its holes outside of them.
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
from handfast.core.answer import Verdict
from handfast.core.arrays import Array
from handfast.papers.planar_oracle import (
    PlanarContact,
    PlanarGrasp,
    PlanarRanges,
    planar_check,
    planar_least_motion,
    planar_ranges,
)
from handfast.proofs.fields import rational, rounded
from handfast.stability.answers.answer import Answer
from handfast.stability.problem.settings import Settings
from handfast.stability.studies.questions import check, maximum

RESULTS = Path(__file__).parent / "results" / "planar.json"
SIZES = (3, 4, 5, 6, 7, 8)
KINDS = ("ellipse", "polygon", "grid")
NEAR = 1e-4  # relative: how far from an end of a range it is asked
ROUNDING = 1e-6  # relative: a witness is off by 1e-9, its magnitude by more
MISSED = 1e-9  # relative: how far a witness may be off
FAR = 1e3  # times the loads at hand, where a range has no end
SIDES = [(1.0, 0.0), (0.6, 0.8), (0.0, 1.0), (-0.8, 0.6), (-1.0, 0.0), (-0.6, -0.8), (0.0, -1.0)]


def question(k: int) -> tuple[str, PlanarGrasp, Array, Array]:
    """Kind, grasp, base load and direction (3,) [N, N, N m] of the k-th question."""
    rng = np.random.default_rng([18, k])
    kind, m = KINDS[k % len(KINDS)], SIZES[(k // len(KINDS)) % len(SIZES)]
    reach = rng.uniform(0.3, 1.0)
    grasp = PlanarGrasp([contact(kind, reach, rng) for _ in range(m)])
    long = np.array([1.0, 1.0, 0.03])  # a torque is as large as a force at 3 cm
    direction = rng.normal(size=3) * long
    base = rng.normal(size=3) * long * 5.0
    if rng.random() < 0.5:
        base = resisted(grasp, rng)
    if kind == "grid":
        direction = rng.integers(-2, 3, 3) * np.array([1.0, 1.0, 0.01])
        direction = direction if direction.any() else np.array([0.0, -1.0, 0.0])
    return kind, grasp, base, direction


def contact(kind: str, reach: float, rng: np.random.Generator) -> PlanarContact:
    """One contact of a few centimetres' object; reach: the share of its outline that is touched."""
    if kind == "ellipse":
        angle, axes = reach * rng.uniform(0, 2 * np.pi), np.array([0.05, 0.03])
        position = axes * [np.cos(angle), np.sin(angle)]
        inwards = np.arctan2(*(-position / axes**2)[::-1]) + rng.normal(scale=0.1)
        return PlanarContact(position, [np.cos(inwards), np.sin(inwards)], float(rng.uniform(0.1, 1.0)))
    if kind == "polygon":
        side = int(6 * reach * rng.random()) * np.pi / 3
        n = np.array([np.cos(side), np.sin(side)])
        along = rng.uniform(-0.02, 0.02) * np.array([-n[1], n[0]])
        return PlanarContact(-0.04 * n + along, n, float(rng.uniform(0.1, 1.0)))
    position = rng.integers(-2, 3, 2) * 0.01
    side = SIDES[int(len(SIDES) * reach * rng.random())]
    return PlanarContact(position, side, float(rng.choice([0.0, 0.25, 0.5, 0.75])))


def resisted(grasp: PlanarGrasp, rng: np.random.Generator) -> Array:
    """A load that some random motion resists, of a few newtons."""
    motion = rng.normal(size=3) * [1.0, 1.0, 30.0]
    load = np.zeros(3)
    for c in grasp.contacts:
        N, T = (np.array([rounded(v) for v in row]) for row in c.rows)
        cn = max(0.0, -float(N @ motion))
        load -= cn * (N - np.sign(T @ motion) * c.friction * T)
    size = float(np.hypot(*load[:2]))
    return load * (5.0 / size if size > 0 else 1.0)


def magnitudes(exact: PlanarRanges, unit: float) -> list[float]:
    """Where to ask: on both sides of every end, far out if there is none, in the middle of nothing."""
    out = []
    for lo, hi in exact.shown:
        for end in (lo, hi):
            if end:
                off = NEAR * max(end, unit)
                out += [end - off, end + off]
        if hi is None:
            out.append(FAR * unit)
    return [s for s in out if s >= 0] or [unit]


def compared(k: int, limit: float) -> dict[str, Any]:
    """Both answers to one question, and whatever contradicts."""
    kind, grasp, base, direction = question(k)
    clock = time.perf_counter()
    exact = planar_ranges(grasp, direction, base)
    seconds = time.perf_counter() - clock
    top = exact.maximum
    proper = exact.state is None or (
        top is not None
        and exact.state.solves(grasp, [rational(b) + top * rational(d) for b, d in zip(base, direction, strict=True)])
    )
    odd: list[str] = [] if proper else ["the oracle's own state solves nothing"]
    counts: Counter[str] = Counter()
    spatial, settings = grasp.spatial(), Settings(timeout=limit)
    w, d = grasp.spatial_load(base), grasp.spatial_load(direction)

    found = maximum(spatial, d, base=w, settings=settings)
    largest = np.inf if exact.unbounded else rounded(top) if top is not None else None
    counts[f"maximum {found.verdict}"] += 1
    counts["unbounded"] += found.unbounded
    if cap_of(found) is not None:
        counts["maximum within a motion cap"] += 1
    held = found.lower if found.verdict is Verdict.HOLDS else -np.inf
    slack = ROUNDING * max(abs(found.lower), 1.0)
    above = held > -np.inf and not exact.unbounded and (largest is None or held > largest + slack)
    if above and nearly(grasp, base + held * direction):
        counts["maximum held by rounding alone"] += 1
    elif above:
        odd.append(f"maximum: a state at {found.lower:.9g}, the oracle ends at {largest}")
    below = largest is not None and not found.unbounded and found.upper < largest - slack
    if below and beyond(grasp, base + (found.upper + slack) * direction, cap_of(found), direction):
        counts["bound up to its motion cap, which the only states above exceed"] += 1
    elif below:
        odd.append(f"maximum: nothing above {found.upper:.9g}, cap {cap_of(found)}; the oracle ends at {largest}")

    for s in magnitudes(exact, float(np.linalg.norm(base) / np.linalg.norm(direction))):
        holds = exact.holds(s)
        answer = check(spatial, w + s * d, settings=settings)
        counts[f"check {answer.verdict}"] += 1
        if cap_of(answer) is not None:
            counts["check within a motion cap"] += 1
        wrong = Verdict.SLIPS if holds else Verdict.HOLDS
        if answer.verdict is wrong is Verdict.HOLDS and nearly(grasp, base + s * direction):
            counts["check held by rounding alone"] += 1
        elif answer.verdict is wrong is Verdict.SLIPS and beyond(grasp, base + s * direction, cap_of(answer)):
            counts["check slips up to its motion cap, which the only states exceed"] += 1
        elif answer.verdict is wrong:
            odd.append(f"check at {s:.9g}: {answer.verdict}, cap {cap_of(answer)}; ranges {exact.shown}")
    return {
        "k": k,
        "kind": kind,
        "contacts": len(grasp.contacts),
        "ranges": [[lo, hi] for lo, hi in exact.shown],
        "programs": exact.programs,
        "oracle seconds": round(seconds, 4),
        "engine": [found.lower, None if found.unbounded or not np.isfinite(found.upper) else found.upper],
        "counts": dict(counts),
        "contradictions": odd,
    }


def nearly(grasp: PlanarGrasp, load: Array) -> bool:
    """Is a load exactly resisted that differs by no more than a witness may miss?"""
    size = MISSED * float(np.hypot(*load[:2]) + abs(load[2]) / 0.03)
    return planar_check(grasp, load, within=[size, size, 0.03 * size]) is not None


def beyond(grasp: PlanarGrasp, load: Array, cap: float | None, along: Array | None = None) -> bool:
    """Do all states that resist the load, or any farther along, move farther than the cap at some contact?"""
    state = planar_least_motion(grasp, load, along=along)
    if cap is None or state is None:
        return False
    moved = [abs(sum(a * b for a, b in zip(row, state.motion, strict=True))) for c in grasp.contacts for row in c.rows]
    return rounded(sum(moved)) > 2 * len(moved) * cap


def cap_of(answer: Answer) -> float | None:
    """[N] the largest virtual motion that a SLIPS or a bound is proved for; None if for all."""
    cap: float | None = answer.to_json()["motion_cap"]
    return cap


def interval(row: dict[str, Any], limit: float) -> dict[str, Any] | None:
    """What the engine shows of smaller magnitudes, and whatever contradicts; None if it has nothing to show."""
    _, grasp, base, direction = question(row["k"])
    w, d = grasp.spatial_load(base), grasp.spatial_load(direction)
    found = maximum(grasp.spatial(), d, base=w, interval=True, settings=Settings(timeout=limit)).interval
    if found is None:
        return None
    unit = float(np.linalg.norm(base) / np.linalg.norm(direction))
    ranges = [(lo, np.inf if hi is None else hi) for lo, hi in row["ranges"]]
    odd = []
    for arc in found.arcs:
        slack = ROUNDING * max(arc.last, unit)
        if not any(lo - slack <= arc.first and arc.last <= hi + slack for lo, hi in ranges):
            odd.append(f"resisted from {arc.first:.9g} to {arc.last:.9g}; ranges {ranges}")
    for first, last in found.holes:
        slack = ROUNDING * max(last, unit)
        if any(max(lo, first) + slack < min(hi, last) - slack for lo, hi in ranges):
            odd.append(f"hole from {first:.9g} to {last:.9g}; ranges {ranges}")
    return {"k": row["k"], "holes": len(found.holes), "unproved": len(found.unproved), "contradictions": odd}


def summary(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """What the page says."""
    counts: Counter[str] = Counter()
    for row in rows:
        counts.update(row["counts"])
    kinds: Counter[str] = Counter()
    for row in rows:
        ranges = row["ranges"]
        kinds["nothing" if not ranges else "unbounded" if ranges[-1][1] is None else "bounded"] += 1
        kinds["with a hole"] += len(ranges) > 1
    by_size = {}
    for m in SIZES:
        those = [r for r in rows if r["contacts"] == m]
        if those:
            by_size[m] = {
                "grasps": len(those),
                "programs": float(np.median([r["programs"] for r in those])),
                "oracle seconds": float(np.median([r["oracle seconds"] for r in those])),
            }
    wrong = [r["k"] for r in rows if r["contradictions"]]
    return {"grasps": len(rows), "oracle": dict(kinds), "engine": dict(counts), "sizes": by_size, "contradicted": wrong}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--limit", type=float, default=10.0, help="[s] for a question to the engine")
    parser.add_argument("--intervals", action="store_true", help="ask about smaller magnitudes, too")
    parser.add_argument("--out", type=Path, default=RESULTS)
    args = parser.parse_args()
    data = json.loads(args.out.read_text()) if args.out.exists() else {"rows": []}
    rows, shown = data["rows"], data.get("intervals")
    done = {row["k"] for row in rows}

    def save() -> None:
        rows.sort(key=lambda row: row["k"])
        text = ",\n".join("  " + json.dumps(row) for row in rows)
        said = {"machine": describe(), "near": NEAR, "summary": summary(rows), "intervals": shown}
        head = json.dumps(said, indent=1)
        args.out.write_text(head[:-2] + ',\n "rows": [\n' + text + "\n ]\n}\n")

    for k in range(args.first, args.first + args.count):
        if k in done:
            continue
        rows.append(compared(k, args.limit))
        if rows[-1]["contradictions"]:
            print(k, rows[-1]["contradictions"], flush=True)
        if len(rows) % 50 == 0:
            save()
            print(len(rows), summary(rows)["engine"], flush=True)
    if args.intervals:
        those = [row for row in rows if len(row["ranges"]) > 1 or row["k"] % 10 == 0]
        found = [said for row in those if (said := interval(row, args.limit)) is not None]
        shown = {
            "asked": len(those),
            "shown": len(found),
            "holes": sum(said["holes"] for said in found),
            "grasps with holes": sum(len(row["ranges"]) > 1 for row in those),
            "with unproved ranges": sum(said["unproved"] > 0 for said in found),
            "contradicted": [said for said in found if said["contradictions"]],
        }
    save()
    print(json.dumps(summary(rows) | {"intervals": shown}, indent=1))


if __name__ == "__main__":
    main()
