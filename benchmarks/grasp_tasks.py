"""From regions to grasps on the bundled tasks: how many, how long, and what became of the other starts.

    python -m benchmarks.grasp_tasks [--count 3] [--timeout 60] [--seeds 3] [--jobs 2] [--only NAME] [--print]

Each task is asked for `count` grasps that differ, collide with nothing (1 mm let pass) and hold their loads under one
preload: a scalpel and a guitar their weight from all six axis directions, `teapot-service` while it pours (upright to
60 degrees, seven orientations), the other teapots upright. The tasks of two contacts are in too: points hold no torque
about the line between them, so that no weight whose centre is off that line can be held; none is expected. The clock
starts after compilation. Every answer is then replayed from its file by the checkers, clearances are measured anew by
a fresh scene.

Writes benchmarks/results/grasp_tasks.json after every run (it resumes where it was) and prints a Markdown table.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.machine import describe
from handfast import (
    Body,
    Loads,
    Verdict,
    check,
    grasp_for,
    load_body,
    load_grasp,
    load_task,
    save_grasp,
    verify,
)
from handfast.core import bundled
from handfast.geometry.collision import Collisions
from handfast.geometry.scene import Scene
from handfast.planning.evaluation.evaluator import requests
from handfast.planning.results.grasps import Grasps
from handfast.planning.search import Journal

RESULTS = Path(__file__).parent / "results" / "grasp_tasks.json"


def loads_of(name: str, body: Body) -> Loads:
    """What a bundled task's grasp is to hold."""
    if name == "teapot-service":
        return Loads.tilt(body, [0, 0, 1], np.radians(-60), down=[0, -1, 0])
    return Loads.gravity(body, "-y") if name.startswith("teapot") else Loads.gravity(body)


def run(name: str, seed: int, options: argparse.Namespace) -> dict[str, Any]:
    """One question."""
    task = load_task(name)
    body = load_body(str(task.object))
    loads, first = loads_of(name, body), []
    begin = time.monotonic()
    answer = grasp_for(
        task,
        body,
        loads,
        count=options.count,
        seed=seed,
        timeout=options.timeout,
        jobs=options.jobs,
        journal=Journal(lambda so_far: first.append((time.monotonic(), len(so_far.grasps)))),
    )
    warm = time.monotonic() - begin - answer.seconds  # compilation and loading
    earliest = next((t - begin - warm for t, n in first if n), None)
    return {
        "task": name,
        "seed": seed,
        "loads": len(loads),
        "found": len(answer.grasps),
        "repaired": sum(g.repaired for g in answer.grasps),
        "first": earliest,
        "seconds": answer.seconds,
        "stop": str(answer.stop),
        "judged": answer.evaluated,
        "fates": answer.noted["fates"],
        "command": [g.command for g in answer.grasps],
        "spare_friction": [g.friction_margin for g in answer.grasps],
        "from_limits": [g.terms["from_limits"] for g in answer.grasps],
    } | checked(answer)


def checked(answer: Grasps) -> dict[str, Any]:
    """The answer checked from its files alone, and its clearances by a scene of its own."""
    proved, same, deepest = 0, 0, 0.0
    with tempfile.TemporaryDirectory() as folder:
        if answer.grasps:
            answer.save(f"{folder}/grasps.json")
            done = verify(f"{folder}/grasps.json")
            wholes = [done, done.part("geometry")]  # what is proved of each grasp, and what was measured anew
            names = [f"grasp {k}" for k in range(1, len(answer.grasps) + 1)]
            proved = sum(all(part.name != name or part.ok for w in wholes if w for part in w.parts) for name in names)
        for k, g in enumerate(answer.grasps):
            save_grasp(g.grasp, f"{folder}/{k}.json")
            alone = load_grasp(f"{folder}/{k}.json")
            same += all(check(alone, w).verdict is Verdict.HOLDS for w in answer.loads.wrenches)
            c = Collisions(Scene(answer.task.hand, answer.body)).clearances(g.q, g.pose, requests(g.solution))
            deepest = max(deepest, -min(c.least_to_object, c.least_at_contacts, c.least_between))
    return {"proved": proved, "same": same, "deepest_mm": 1e3 * deepest}


def table(rows: list[dict[str, Any]]) -> str:
    """A line for each task, over its seeds."""
    heads = [
        "task",
        "loads",
        "found",
        "first [s]",
        "all [s]",
        "repaired",
        "proved from the file",
        "deepest overlap [mm]",
    ]
    heads += ["starts that penetrate", "meet themselves", "curve in", "cannot balance", "slip"]
    lines = ["| " + " | ".join(heads) + " |", "|" + " --- |" * len(heads)]
    for name in dict.fromkeys(r["task"] for r in rows):
        own = [r for r in rows if r["task"] == name]
        found, fates = sum(r["found"] for r in own), {k: sum(r["fates"][k] for r in own) for k in own[0]["fates"]}
        total = max(sum(fates.values()), 1)
        first = [r["first"] for r in own if r["first"] is not None]
        shares = [f"{100 * fates[k] / total:.0f} %" for k in ("object", "itself", "curved", "unbalanced", "slips")]
        lines.append(
            f"| {name} | {own[0]['loads']} | {found} in {len(own)} runs | "
            + (f"{np.median(first):.1f}" if first else "–")
            + f" | {np.median([r['seconds'] for r in own]):.1f} | {sum(r['repaired'] for r in own)} | "
            f"{sum(min(r['proved'], r['same']) for r in own)} | {max(r['deepest_mm'] for r in own):.2f} | "
            + " | ".join(shares)
            + " |"
        )
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--count", type=int, default=3)
    parser.add_argument("--timeout", type=float, default=60.0)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--only", default="")
    parser.add_argument("--print", action="store_true", dest="show")
    options = parser.parse_args()
    data = json.loads(RESULTS.read_text("utf-8")) if RESULTS.exists() else {"rows": []}
    done = {(r["task"], r["seed"]) for r in data["rows"]}
    for seed in range(options.seeds):
        for name in bundled.names("tasks"):
            if options.show or (name, seed) in done or options.only not in name:
                continue
            data["rows"].append(run(name, seed, options))
            data |= {"count": options.count, "timeout": options.timeout, "jobs": options.jobs, "machine": describe()}
            RESULTS.write_text(json.dumps(data, indent=1) + "\n", "utf-8")
            r = data["rows"][-1]
            print(name, seed, r["found"], r["first"], r["seconds"], r["fates"], flush=True)
    print(table(data["rows"]))


if __name__ == "__main__":
    main()
