"""What the cap on virtual motions costs: maxima of the random set within 1e3, 1e4, 1e5 and 1e6 force scales.

    python benchmarks/motion_cap.py

Many maxima are only approached as the virtual motion diverges, so a certified upper bound holds within the cap.
For every random grasp of 3 to 6 contacts with a finite maximum this asks again with other caps, at a gap of
1e-5, and writes results/motion_cap.json: how far the maximum lies below the one with the largest cap that was
answered. Prints a Markdown table.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from grasps import cases
from holdfast.answer import Stop
from holdfast.stability.queries import maximum
from holdfast.stability.settings import Settings
from machine import describe

RESULTS = Path(__file__).parent / "results" / "motion_cap.json"
CAPS = (1e2, 1e3, 1e4, 1e5, 1e6)
GAP = 1e-5


def main() -> None:
    rows = []
    for case in cases(("random",)):
        if case.contacts > 6:
            continue
        answers = {}
        for cap in CAPS:
            settings = Settings(gap=GAP, motion_cap=cap, time_limit=10.0)
            a = maximum(case.grasp, case.direction, base=case.base, settings=settings)
            d = None
            if a.witness is not None and not a.unbounded:
                r = a.witness.state.r[:3]
                d = float(np.abs(r).max() / max(np.abs(a.witness.state.c).max(), 1e-300))
            closed = a.stop is Stop.COMPLETE
            answers[f"{cap:g}"] = {"lower": a.lower, "closed": closed, "unbounded": a.unbounded, "motion": d}
        rows.append({"name": case.name, "contacts": case.contacts, "caps": answers})
        RESULTS.write_text(json.dumps({"machine": describe(), "gap": GAP, "rows": rows}, indent=1) + "\n")
    print("| cap | bounded and closed | unbounded | not closed in 10 s | lost to 1e5: median | 90 % | worst |")
    print("|---:|---:|---:|---:|---:|---:|---:|")
    for cap in CAPS:
        key = f"{cap:g}"
        lost = []
        for row in rows:
            here, there = row["caps"][key], row["caps"]["100000"]
            if here["closed"] and there["closed"] and not there["unbounded"] and not here["unbounded"]:
                lost.append(max(0.0, 1 - here["lower"] / there["lower"]) if there["lower"] > 0 else 0.0)
        closed = sum(r["caps"][key]["closed"] and not r["caps"][key]["unbounded"] for r in rows)
        far = sum(r["caps"][key]["unbounded"] for r in rows)
        late = sum(not r["caps"][key]["closed"] for r in rows)
        q = np.quantile(lost, (0.5, 0.9, 1.0))
        print(f"| {cap:g} | {closed} | {far} | {late} | {q[0]:.1e} | {q[1]:.1e} | {q[2]:.1e} |")


if __name__ == "__main__":
    main()
