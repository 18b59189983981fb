"""Does a dynamics engine agree? Bundled grasps in the six axis directions, below and above their certified maxima.

    python -m benchmarks.simulation_agreement [--grasps fig1 barrett-ball ...]

Every bundled grasp whose maximum along an axis is bounded is simulated at fixed shares of it, once with the commands
first and the load after them, once with both growing together. What Handfast says at each share is asked by `check`, so
that a hole counts as one. A question is fragile if the equilibrium of least motion at 0.9 of the maximum moves by more
than FRAGILE times what its most loaded contact gives way. Undecided and ill-posed simulations are counted apart, as
agreement never.
Writes results/simulation_agreement.json as it goes on, and goes on where it was stopped.
"""

from __future__ import annotations

import argparse
import json
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.machine import describe
from handfast.core import bundled
from handfast.core.answer import Verdict
from handfast.core.arrays import Array
from handfast.model.grasp import Grasp
from handfast.model.grasp_file import load_grasp
from handfast.simulation.ending import Ending
from handfast.simulation.loaded_twin import simulate
from handfast.stability import scaled_problem
from handfast.stability.least_motion import least_motion
from handfast.stability.queries import check, maximum
from handfast.stability.settings import Settings

RESULTS = Path(__file__).parent / "results" / "simulation_agreement.json"
SHARES = (0.5, 0.8, 0.9, 1.1, 1.25, 1.5)
LOADINGS = ("preload-first", "together")
FRAGILE = 50.0  # times the largest normal force: the least motion at 0.9 of the maximum, both in newtons
LIMIT = Settings(time_limit=20.0)


def axes() -> dict[str, Array]:
    """Forces along the six directions of the object's axes."""
    return {f"{s}{a}": np.eye(6)[k] * (1 if s == "+" else -1) for k, a in enumerate("xyz") for s in "+-"}


def question(grasp: Grasp, direction: Array) -> dict[str, Any]:
    """The maximum along a direction, whether it is fragile, and all simulations of it."""
    most = maximum(grasp, direction, settings=LIMIT)
    if most.unbounded or most.verdict is not Verdict.HOLDS or not most.lower:
        return {"maximum": None}
    largest = float(most.lower)
    at = 0.9 * largest * direction
    witness = check(grasp, at, settings=LIMIT).witness
    motion = None
    if witness is not None:
        least = least_motion(scaled_problem.build(grasp, at), witness)
        motion = float(least.largest_motion / least.state.c[::3].max())
    rows = []
    for share in SHARES:
        wrench = share * largest * direction
        said = str(check(grasp, wrench, settings=LIMIT).verdict)
        for loading in LOADINGS:
            found = simulate(grasp, wrench, loading=loading, ramp=6.0)
            rate = found.rate / grasp.size
            rows.append(
                {"share": share, "loading": loading, "said": said, "ending": str(found.ending), "rate": rate}
                | {"onset": None if found.onset is None else share * found.onset}
            )
    return {"maximum": largest, "motion": motion, "rows": rows}


def summary(questions: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """Counts by loading, of all answers and of those that are not fragile."""
    out: dict[str, Any] = {}
    for loading in LOADINGS:
        for name in ("all", "not fragile"):
            counts: Counter[str] = Counter()
            for q in questions.values():
                fragile = q.get("motion") is None or q["motion"] > FRAGILE
                if q["maximum"] is None or (name != "all" and fragile):
                    continue
                counts.update(outcome(r) for r in q["rows"] if r["loading"] == loading)
            out[f"{loading}, {name}"] = dict(sorted(counts.items()))
    return out


def outcome(row: dict[str, Any]) -> str:
    """'agree', or what disagrees: 'said holds, slips'; a grasp that slipped before it came to rest did slip."""
    ending = Ending(row["ending"])
    if ending in (Ending.UNDECIDED, Ending.ILL_POSED) or row["said"] == str(Verdict.UNDECIDED):
        return "open"
    held = ending is Ending.HOLDS
    if held == (row["said"] == str(Verdict.HOLDS)):
        return "agree"
    return f"said {row['said']}, {row['ending']}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--grasps", nargs="*", default=bundled.names("grasps"))
    names = parser.parse_args().grasps
    data = json.loads(RESULTS.read_text()) if RESULTS.exists() else {"questions": {}}
    for name in names:
        for axis, direction in axes().items():
            if f"{name} {axis}" in data["questions"]:
                continue
            data["questions"][f"{name} {axis}"] = question(load_grasp(name), direction)
            data |= {"machine": describe(), "fragile": FRAGILE, "summary": summary(data["questions"])}
            RESULTS.write_text(json.dumps(data, indent=1) + "\n")
        print(name, json.dumps(data.get("summary", {})), flush=True)


if __name__ == "__main__":
    main()
