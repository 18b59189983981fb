"""The largest multiple of the loads that `grasp --best margin` finds, beside the bound that no placement reaches.

    python -m benchmarks.best_margin [--part found|bound] [--task NAME] [--seconds 40] [--boxes 1500] [--print]

The bundled tasks of three and four contacts, friction 0.5, the object's weight from six sides and downwards alone,
normal forces up to `LIMIT` times the weight at each contact. No factor of safety.

- *found*: the best grasp within so many seconds, replayed.
- *bound*: the bound after so many boxes, replayed, and what forces alone reach at a placement that was met.

Writes benchmarks/results/best_margin.json after every row and prints a Markdown table.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.machine import describe
from benchmarks.no_grasp import MORE
from handfast import Loads, grasp_for, load_body, load_task
from handfast.planning.load_bound import LoadBound
from handfast.planning.question import PlanLimits
from handfast.proofs.fields import Fields
from handfast.proofs.tasks import read_task
from handfast.proofs.unbalanced import replay_unbalanced
from handfast.synthesis.embedded_task import task_to_dict

RESULTS = Path(__file__).parent / "results" / "best_margin.json"
LIMIT = 10.0  # times the weight
FRICTION = 0.5
WAYS = {"six sides": "all", "down": "-z"}


def found(name: str, way: str, options: argparse.Namespace) -> dict[str, Any]:
    """The best grasp of a task."""
    task = load_task(name)
    body = load_body(str(task.object))
    loads = Loads.gravity(body, WAYS[way])
    limits = PlanLimits(force_limit=LIMIT * float(np.linalg.norm(loads.wrenches[0, :3])))
    how: dict[str, Any] = {"best": "margin", "timeout": options.seconds, "limits": limits, "friction": FRICTION}
    answer = grasp_for(task, body, loads, jobs=1, **how)
    strength = answer.grasps[0].strength if answer.grasps else None
    row: dict[str, Any] = {"verdict": str(answer.verdict), "factor": strength.factor if strength else None}
    return row | {"judged": answer.evaluated, "replayed": answer.verify().ok if answer.grasps else None}


def bound(name: str, way: str, options: argparse.Namespace) -> dict[str, Any]:
    """What no placement of the contacts of a task reaches."""
    task = load_task(name)
    body = load_body(str(task.object))
    loads, begin = Loads.gravity(body, WAYS[way]), time.process_time()
    limit = LIMIT * float(np.linalg.norm(loads.wrenches[0, :3]))
    search = LoadBound(task, loads, FRICTION, center=body.center_of_mass, force_limits=limit)
    search.run(options.boxes)
    took, proof = time.process_time() - begin, json.loads(json.dumps(search.to_json()))
    factor, begin = proof.pop("factor"), time.process_time()
    regions, wrenches = read_task(task_to_dict(task)).on_object, {k: np.array(w) for k, w in loads.by_name.items()}
    done = replay_unbalanced(regions, wrenches, FRICTION, limit, None, Fields(proof), factor)
    row = {"factor": factor, "reached": search.reached, "boxes": search.boxes, "seconds": took, "replayed": done.ok}
    return row | {"replay": time.process_time() - begin}


def show(rows: dict[str, Any]) -> None:
    """Markdown."""
    print("| task, contacts, weight | found | forces alone reach | bound | bound over found |\n|---|---|---|---|---|")
    for key, row in rows.items():
        f, b = row.get("found", {}), row.get("bound", {})
        held, most = f.get("factor"), b.get("factor")
        ratio = f"{most / held:.2f}" if held and most else ""
        numbers = [f"{x:.3g}" if x else "none" for x in (held, b.get("reached"), most)]
        print(f"| {key} | {' | '.join(numbers)} | {ratio} |")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--part", choices=("found", "bound"))
    parser.add_argument("--task", choices=MORE)
    parser.add_argument("--seconds", type=float, default=40.0)
    parser.add_argument("--boxes", type=int, default=1500)
    parser.add_argument("--print", action="store_true", dest="only_print")
    options = parser.parse_args()
    results = json.loads(RESULTS.read_text("utf-8")) if RESULTS.exists() else {"rows": {}}
    for part, ask in (("found", found), ("bound", bound)):
        if options.only_print or options.part not in (None, part):
            continue
        for name in [options.task] if options.task else MORE:
            for way in WAYS:
                key = f"{name}, {len(load_task(name).contact_pairs)}, {way}"
                made = ask(name, way, options)
                results = json.loads(RESULTS.read_text("utf-8")) if RESULTS.exists() else results
                results["rows"].setdefault(key, {})[part] = made
                results |= {"machine": describe(), "asked": {"seconds": options.seconds, "boxes": options.boxes}}
                RESULTS.write_text(json.dumps(results, indent=1) + "\n", "utf-8")
    show(results["rows"])


if __name__ == "__main__":
    main()
