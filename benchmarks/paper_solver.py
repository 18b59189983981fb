"""The synthesis paper's solver on the authors' own tasks: boxes, their rate, the programs' share, the root's shrinking.

    python -m benchmarks.paper_solver [--task upholding] [--seconds 150] [--shared ../shared] [--state FOLDER]

Depth first on one thread, sigma = 0.1, lengths in millimetres as in the paper's Table 3, couplings on the angle,
the limits and pose bounds of the task file. Once to the letter (the sides of x in (29), monomials included, are
shrunk by programs, split and held against sigma) and once over the original variables q alone, where the
monomials follow by interval arithmetic. A box is counted when it is discarded, split or a solution box. For the
root box the sides of q after every pass are given as part of those before the first one: `mean_side` of them
all, `mean_by_kind` of link positions, axes, cosines and patch parameters.

The authors' figures beside it: solution in `paper_seconds` on `paper_cores` cores after `paper_boxes` boxes
(with cosines about the middle of the range for the couplings). `cpu_seconds` next to `seconds` says how much of
the core the run had.

Writes benchmarks/results/paper_solver.json after every run (it resumes where it was). With --state every search is
also saved, and goes on for another --seconds when the script is called again.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Sequence
from dataclasses import asdict
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.machine import describe
from handfast.core.branch import BranchAndPrune, BranchState, Split
from handfast.papers.box_shrinking import Over, PaperSolver, ShrinkingSettings, Statistics, SystemBox
from handfast.papers.canonical_equations import canonical
from handfast.papers.canonical_system import Canonical
from handfast.papers.region_exhibits import PRINTED_BOXES, PRINTED_TASKS
from handfast.synthesis.task_file import load_task

RESULTS = Path(__file__).parent / "results" / "paper_solver.json"
UNIT = 0.001
PAPER = {
    name.split("-")[1]: {"paper_seconds": PRINTED_TASKS[name].seconds, "paper_boxes": boxes}
    for name, boxes in PRINTED_BOXES.items()
}
CORES = "31 to 64"


def sides(system: Canonical, box: SystemBox) -> dict[str, Any]:
    """The sides of q in a box, as part of the root's."""
    root = system.upper - system.lower
    part = (box.sides[: system.n_v] / np.where(root > 0, root, 1.0))[root > 0]
    at = system.layout
    kinds = {
        "positions": at.position[1:].ravel(),
        "axes": at.axes[1:].ravel(),
        "cosines": np.array([limit.c for limit in at.limits]),
        "parameters": np.array([side.parameters for pair in at.sides for side in pair]).ravel(),
    }
    by_kind = {}
    for kind, k in kinds.items():
        k = k[root[k] > 0]
        by_kind[kind] = round(float((box.sides[k] / root[k]).mean()), 4)
    return {"mean_side": round(float(part.mean()), 4), "mean_by_kind": by_kind}


def run(file: Path, over: Over, seconds: float, saved: Path | None) -> dict[str, Any]:
    """One search of so many seconds, or the continuation of a saved one."""
    settings = ShrinkingSettings(over=over)
    system = canonical(load_task(file), unit=UNIT)
    solver = PaperSolver(system, settings)
    root: list[dict[str, Any]] = []
    spent, cpu = 0.0, time.process_time()
    search: BranchAndPrune[SystemBox] = BranchAndPrune(solver, [solver.root])
    if saved and saved.exists():
        data = json.loads(saved.read_text())
        search = BranchAndPrune.restored(solver, data["search"])
        solver.statistics, root, spent = Statistics(**data["statistics"]), data["root"], data["cpu_seconds"]
    begun = time.monotonic()
    state: BranchState[SystemBox] = search.state
    for state in search:
        if isinstance(state.outcome, Split) and state.nodes == state.outcome.nodes:  # the first box
            root.append(sides(system, whole(state.outcome.children)))
        if state.finals or time.monotonic() - begun > seconds:
            break
    s, x = solver.statistics, system.expanded
    spent += time.process_time() - cpu
    if saved:
        saved.parent.mkdir(parents=True, exist_ok=True)
        state_of = {"search": search.save(), "statistics": asdict(s), "root": root, "cpu_seconds": spent}
        saved.write_text(json.dumps(state_of))
    return {
        "task": file.stem,
        "settings": asdict(settings) | {"unit": UNIT, "order": str(search.order)},
        "n_v": system.n_v,
        "n_e": system.n_e,
        "n_x": x.n,
        "seconds": round(s.seconds, 1),
        "cpu_seconds": round(spent, 1),
        "boxes": s.boxes,
        "boxes_per_second": round(s.boxes_per_second, 4),
        "passes": s.passes,
        "seconds_per_pass": round(s.seconds / max(s.passes, 1), 2),
        "programs": s.programs,
        "milliseconds_per_program": round(1e3 * s.program_seconds / max(s.programs, 1), 2),
        "program_share": round(s.program_share, 3),
        "programs_that_prove_nothing": s.unproved,
        "discarded_share": state.discarded,
        "solution_boxes": len(state.finals),
        "pending": state.pending,
        "depth": state.depth,
        "root_passes": root,
        **PAPER[file.stem],
        "paper_cores": CORES,
    }


def whole(boxes: Sequence[SystemBox]) -> SystemBox:
    """The box that was bisected into these, or the only one."""
    return SystemBox(np.min([b.lower for b in boxes], axis=0), np.max([b.upper for b in boxes], axis=0))


def table(rows: list[dict[str, Any]]) -> str:
    """The runs as Markdown."""
    lines = [
        "| task | over | seconds | boxes | boxes/s | s/pass | ms/program | programs | root, mean side | solutions |",
        "|---|---|---:|---:|---:|---:|---:|---:|---:|---:|",
    ]
    for r in rows:
        cells = [r["task"], r["settings"]["over"], f"{r['seconds']:.0f}", r["boxes"], f"{r['boxes_per_second']:.3f}"]
        cells += [r["seconds_per_pass"], r["milliseconds_per_program"], f"{100 * r['program_share']:.0f} %"]
        cells += [f"{r['root_passes'][-1]['mean_side']:.3f}" if r["root_passes"] else "", r["solution_boxes"]]
        lines.append("| " + " | ".join(map(str, cells)) + " |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--task", action="append", choices=sorted(PAPER), help="default: upholding")
    parser.add_argument("--seconds", type=float, default=150.0, help="per run")
    parser.add_argument("--shared", type=Path, default=Path("../shared"), help="folder that holds tasks/")
    parser.add_argument("--state", type=Path, help="folder for saved searches")
    options = parser.parse_args()
    data = json.loads(RESULTS.read_text()) if RESULTS.exists() else {"machine": describe()}
    data["machine"]["packages"]["highspy"] = metadata.version("highspy")
    rows = data.setdefault("rows", [])
    for name in options.task or ["upholding"]:
        for over in Over:
            key = (name, str(over))
            old = [r for r in rows if (r["task"], r["settings"]["over"]) == key]
            if old and not options.state:
                continue
            saved = options.state / f"{name}-{over}.json" if options.state else None
            row = run(options.shared / "tasks" / f"{name}.json", over, options.seconds, saved)
            rows[:] = [r for r in rows if r not in old] + [row]
            RESULTS.write_text(json.dumps(data, indent=1) + "\n")
            print(json.dumps({k: v for k, v in row.items() if k != "root_passes"}), flush=True)
    print("\n" + table(rows))


if __name__ == "__main__":
    main()
