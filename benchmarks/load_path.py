"""First the squeeze, then the load: do answers along a path agree with a dynamics engine better than the paper's?

    python -m benchmarks.load_path [--hands FOLDER] [--shared ../shared] [--seconds 3600]

Asks the questions of `benchmarks.simulation_agreement` again, at the same loads, with `loading="preload-first"`, and
holds the answers against the engine's stored outcomes with the commands first. In turn one question where the paper's
answers contradict the engine, and one where none does, each in a fixed shuffled order, those that are not fragile
first; both are counted apart, as they are no sample of all. Also the processor time of each path beside that of a
check of the same load. Writes results/load_path.json as it goes on, and goes on where it was stopped.
"""

from __future__ import annotations

import argparse
import json
import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import simulation_agreement as study
from benchmarks.agreement_grasps import questions
from benchmarks.closed_grasps import ClosedHands, add_folders
from benchmarks.machine import describe
from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.model.grasp import Grasp
from handfast.stability.answers import check
from handfast.stability.answers.check_query import CheckAnswer
from handfast.stability.answers.load_path import LoadPath
from handfast.stability.problem.settings import Loading, Settings

RESULTS = Path(__file__).parent / "results" / "load_path.json"
LIMIT = Settings(timeout=20.0)
FIRST: Loading = "preload-first"


def rows_of(question: dict[str, Any]) -> list[dict[str, Any]]:
    """The simulations of a stored question with the commands first."""
    return [row for row in question["rows"] if row["loading"] == FIRST]


def contradicted(question: dict[str, Any]) -> bool:
    """Does any of the paper's answers say otherwise than the engine, with the commands first?"""
    return any(study.outcome(row).startswith("said") for row in rows_of(question))


def timed(grasp: Grasp, wrench: Array, loading: Loading) -> tuple[CheckAnswer, float]:
    """An answer, and its processor time [s]."""
    begun = time.process_time()
    answer = check(grasp, wrench, loading=loading, settings=LIMIT)
    return answer, round(time.process_time() - begun, 4)


def answered(grasp: Grasp, most: Array, question: dict[str, Any]) -> list[dict[str, Any]]:
    """What the path says at each load that was simulated; most: (6,) the paper's maximum."""
    out = []
    for row in rows_of(question):
        answer, seconds = timed(grasp, row["share"] * most, FIRST)
        _, together = timed(grasp, row["share"] * most, "together")
        path = answer.path
        assert isinstance(path, LoadPath)
        own = {"said": str(answer.verdict), "by_steps": path.by_steps, "other_choice": path.other_choice}
        own |= {"proved": answer.verify().ok, "seconds": seconds, "seconds together": together}
        out.append({"share": row["share"], "ending": row["ending"], "paper": row["said"]} | own)
    return out


def order(stored: dict[str, dict[str, Any]]) -> list[str]:
    """Names of questions in which they are asked."""
    rng = np.random.default_rng(30)
    out: list[str] = []
    for firm in (True, False):
        alike = [n for n, q in stored.items() if q.get("maximum") and (not q["fragile"]) == firm]
        rng.shuffle(alike)
        parts = [[n for n in alike if contradicted(stored[n]) == bad] for bad in (True, False)]
        for k in range(max(map(len, parts))):
            out += [part[k] for part in parts if k < len(part)]
    return out


def summary(asked: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """Counts by what the paper's answers did, and the times of paths over those of checks."""
    out: dict[str, Any] = {}
    for name, bad, firm in (
        (f"{f}, {b}", b, f) for f in ("not fragile", "fragile") for b in ("contradicted", "others")
    ):
        chosen = [
            q for q in asked.values() if (q["contradicted"], q["fragile"]) == (bad == "contradicted", firm == "fragile")
        ]
        rows = [row for q in chosen for row in q["rows"]]
        counts = {
            said: dict(sorted(Counter(study.outcome({"ending": r["ending"], "said": r[said]}) for r in rows).items()))
            for said in ("paper", "said")
        }
        out[name] = {"questions": len(chosen), "loads": len(rows), "paper": counts["paper"], "path": counts["said"]}
    rows = [row for q in asked.values() for row in q["rows"]]
    if rows:
        times = np.array([[row["seconds"], row["seconds together"]] for row in rows])
        out["path over check"] = {
            "sum": round(float(times[:, 0].sum() / times[:, 1].sum()), 2),
            "median": round(float(np.median(times[:, 0] / times[:, 1])), 2),
        }
        out["proved"] = sum(row["proved"] for row in rows)
        out["loads"] = len(rows)
        out["depends on the choice of a state"] = sum(
            row["other_choice"] not in (None, *row["by_steps"].values()) for row in rows
        )
    return out


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add_folders(parser)
    parser.add_argument("--seconds", type=float, default=3600.0, help="stop after the question at which this is over")
    parser.add_argument("--results", type=Path, default=RESULTS)
    args = parser.parse_args()
    begun = time.monotonic()
    data = json.loads(args.results.read_text()) if args.results.exists() else {"questions": {}}
    stored = json.loads(study.RESULTS.read_text())["questions"]
    known = {q.name: q for q in questions(ClosedHands(args.hands, args.shared)) if not q.missing}
    for name in order(stored):
        if name in data["questions"] or name not in known:
            continue
        if time.monotonic() - begun > args.seconds:
            break
        try:
            grasp, direction = known[name].made()
        except InputError:
            continue
        rows = answered(grasp, stored[name]["maximum"] * direction, stored[name])
        about = {"family": stored[name]["family"], "contradicted": contradicted(stored[name])}
        data["questions"][name] = about | {"fragile": bool(stored[name]["fragile"]), "rows": rows}
        data |= {"machine": describe(), "summary": summary(data["questions"])}
        study.save(data, args.results)
    print(json.dumps(summary(data["questions"]), indent=1), flush=True)


if __name__ == "__main__":
    main()
