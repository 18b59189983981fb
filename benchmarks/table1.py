"""Table I of the stability paper on our fig9: sectors against value and time, full and refined, both variants.

    python -m benchmarks.table1 [--solver scip] [--solver gurobi] [--limit 120]

The largest force along -y that fig9 resists with 0.1 N m at every proximal joint. "Full" puts all sectors
at the finest level at once, "refined" is Algorithm 1; eta is 0 or 2.5 degrees, (19) as printed with its
erratum. Every program is solved to the end, no early stop, in one run, full and refined in turn. A cell that
was not finished within the limit keeps its status and its bound. Values are what the relaxation of that
resolution allows, an upper bound of the exact maximum; the last rows give the exact bracket.

Writes benchmarks/results/table1.json after every cell (it resumes where it was) and prints a Markdown table.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.machine import describe
from handfast.papers import mixed_integer_solvers
from handfast.papers.stability_tables import DOWN, ETAS, SECTOR_LEVELS, resolution_cell
from handfast.readers.grasp_file import load_grasp
from handfast.stability.problem.grasp_limits import GraspLimits
from handfast.stability.problem.settings import Settings
from handfast.stability.studies.questions import maximum

RESULTS = Path(__file__).parent / "results" / "table1.json"


def exact(eta: float, limit: float) -> dict[str, Any]:
    """The bracket that `handfast max` gives: witnessed and certified."""
    settings = Settings(gap=1e-3, timeout=limit)
    a = maximum(load_grasp("fig9"), DOWN, limits=GraspLimits(eta=np.radians(eta)), settings=settings)
    return {
        "solver": None,
        "sectors": None,
        "method": "exact",
        "eta": eta,
        "status": str(a.stop),
        "lower": a.lower,
        "upper": a.upper,
        "seconds": a.seconds,
        "nodes": a.nodes,
        "residual": a.witness.residuals.worst if a.witness else None,
    }


def table(rows: list[dict[str, Any]], solver: str) -> str:
    """The rows of one solver as Markdown, laid out like Table I."""
    lines = [
        "| sectors | max [N] | full [s] | refined [s] | max, eta 2.5 [N] | full [s] | refined [s] |",
        "|---:|---:|---:|---:|---:|---:|---:|",
    ]

    def seconds(row: dict[str, Any] | None) -> str:
        if row is None:
            return ""
        return f"{row['seconds']:.2f}" if row["status"] == "finished" else str(row["status"])

    for q in SECTOR_LEVELS:
        out = [str(4 * 2**q)]
        for eta in ETAS:
            found = {
                r["method"]: r for r in rows if r["solver"] == solver and r["eta"] == eta and r["sectors"] == 4 * 2**q
            }
            values = [r["value"] for r in found.values() if r.get("value")]
            out += [f"{min(values):.5f}" if values else "", seconds(found.get("full")), seconds(found.get("refined"))]
        lines.append("| " + " | ".join(out) + " |")
    for r in rows:
        if r["method"] == "exact":
            lines.append(f"\nexact, eta {r['eta']}: {r['lower']:.5f} to {r['upper']:.5f} N in {r['seconds']:.1f} s")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--solver", action="append", choices=mixed_integer_solvers.SOLVERS, help="scip and gurobi if installed"
    )
    parser.add_argument("--limit", type=float, default=120.0, help="seconds per cell")
    options = parser.parse_args()
    solvers = options.solver or [s for s in mixed_integer_solvers.SOLVERS if mixed_integer_solvers.available(s)]
    data = json.loads(RESULTS.read_text()) if RESULTS.exists() else {"machine": describe(), "limit": options.limit}
    rows = data.setdefault("rows", [])
    seen = {(r["solver"], r["sectors"], r["method"], r["eta"]) for r in rows}
    # as the paper does, stop at the first full resolution that is not finished: twice the sectors are no faster
    gave_up = {(r["solver"], "full", r["eta"]) for r in rows if r["method"] == "full" and r["status"] != "finished"}
    for q in SECTOR_LEVELS:
        for eta in ETAS:
            for full in (True, False):
                for solver in solvers:
                    key = (solver, 4 * 2**q, "full" if full else "refined", eta)
                    if key in seen:
                        continue
                    if full and (solver, "full", eta) in gave_up:
                        continue
                    row = resolution_cell(solver, q, full, eta, options.limit)
                    rows.append(row)
                    if full and row["status"] != "finished":
                        gave_up.add((solver, "full", eta))
                    RESULTS.write_text(json.dumps(data, indent=1) + "\n")
                    print(json.dumps(row), flush=True)
    for eta in ETAS:
        if (None, "exact", eta) not in {key[1:] for key in seen}:
            rows.append(exact(eta, options.limit))
            RESULTS.write_text(json.dumps(data, indent=1) + "\n")
    for solver in solvers:
        print(f"\n{solver}\n\n{table(rows, solver)}")


if __name__ == "__main__":
    main()
