"""Is equation (17) a bound? Its maximum beside those of grasps whose normals are really off, drawn at random.

    python -m benchmarks.sampled_maxima [--samples 100]

The stored grasps of real hands (`benchmarks/grasps.py`: Barrett and Allegro, 3 to 8 contacts, 48 of them), each asked
for the pull of that set. Twice: normals off by up to 2.5 degrees, which is what eta = 2.5 degrees is about; and
contacts by 1 mm, normals by 2.5 degrees, friction and commands by 10 %. Grasps whose own maximum is unbounded or not
decided are counted and left out. Writes results/sampled_maxima.json as it goes on, and goes on where it was stopped.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.grasps import cases
from benchmarks.machine import describe
from handfast.core.answer import Verdict
from handfast.stability.problem.settings import Settings
from handfast.stability.studies.questions import maximum
from handfast.stability.studies.sampled_maximum import Perturbation, sampled_maximum

RESULTS = Path(__file__).parent / "results" / "sampled_maxima.json"
ETA = float(np.radians(2.5))
BOUNDS = {"normals": Perturbation(normals=ETA), "all": Perturbation(1e-3, ETA, 0.1, 0.1)}
LIMIT = Settings(timeout=5.0, gap=1e-2, jobs=1)


def question(case: Any, samples: int) -> dict[str, Any]:
    """A grasp's own maximum, that of equation (17), and the samples' quantiles for each of the bounds."""
    own = maximum(case.grasp, case.direction, base=case.base, settings=LIMIT)
    if own.unbounded or own.verdict is not Verdict.HOLDS or not np.isfinite(own.upper):
        return {"contacts": case.contacts, "left_out": "unbounded" if own.unbounded else str(own.verdict)}
    row: dict[str, Any] = {"contacts": case.contacts}
    for name, bounds in BOUNDS.items():
        found = sampled_maximum(
            case.grasp, case.direction, bounds, samples=samples, base=case.base, settings=LIMIT, jobs=1
        )
        said = found.to_json()
        kept = ("nominal", "uncertain_normals", "quantiles", "below_nominal", "below_uncertain", "decided", "lower")
        row[name] = {k: said[k] for k in kept}
        row[name]["slips"] = int((found.values == 0).sum())
    return row


def summary(rows: dict[str, Any]) -> dict[str, Any]:
    """How often eta was on the safe side, and how far the samples went below what it witnesses."""
    out: dict[str, Any] = {"left out": sum("left_out" in r for r in rows.values())}
    for name in BOUNDS:
        kept = [r[name] for r in rows.values() if name in r and r[name]["decided"]]
        worst = np.array([least(r) for r in kept])
        eta = np.array([r["uncertain_normals"][0] for r in kept])
        own = np.array([r["nominal"][0] for r in kept])
        below = np.array([r["below_uncertain"] for r in kept])
        out[name] = {
            "grasps": len(kept),
            "eta's upper bound open": sum(r["uncertain_normals"][1] is None for r in kept),
            "every sample resists what eta says": int((below == 0).sum()),
            "more than 5 % of the samples below eta": int((below > 0.05).sum()),
            "half of the samples below eta": int((below >= 0.5).sum()),
            "some sample resists nothing": int((worst == 0).sum()),
            "eta within 1 % of the own maximum": int((eta > 0.99 * own).sum()),
            "share of samples below eta: least, median, most": spread(below),
            "worst sample / eta: least, median, most": spread(worst[eta > 0] / eta[eta > 0]),
            "worst sample / own maximum: least, median, most": spread(worst / own),
            "eta / own maximum: least, median, most": spread(eta / own),
        }
    return out


def least(found: dict[str, Any]) -> float:
    """What the worst sample resists."""
    return 0.0 if found["slips"] else float(found["quantiles"]["0"] or np.inf)


def spread(values: Any) -> list[float]:
    return [round(float(x), 3) for x in (values.min(), np.median(values), values.max())] if len(values) else []


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--samples", type=int, default=100)
    samples = parser.parse_args().samples
    data = json.loads(RESULTS.read_text()) if RESULTS.exists() else {"samples": samples, "rows": {}}
    for case in cases(("barrett", "allegro")):
        if case.name in data["rows"]:
            continue
        data["rows"][case.name] = question(case, data["samples"])
        data |= {"machine": describe(), "summary": summary(data["rows"])}
        RESULTS.write_text(json.dumps(data, indent=1) + "\n")
        print(case.name, flush=True)
    data["summary"] = summary(data["rows"])
    RESULTS.write_text(json.dumps(data, indent=1) + "\n")
    print(json.dumps(data["summary"], indent=1))


if __name__ == "__main__":
    main()
