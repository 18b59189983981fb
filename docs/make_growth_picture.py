"""Draw how cost grows with contacts, grasps and processes: docs/img/growth.png, of benchmarks/results/growth.json.

python docs/make_growth_picture.py
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from handfast.core.files import write_bytes
from handfast.pictures.drawing import picture

DOCS = Path(__file__).parent


def main() -> None:
    """Make the picture."""
    data = json.loads((DOCS.parent / "benchmarks" / "results" / "growth.json").read_text())
    figure = Figure(figsize=(9, 3.4), layout="constrained")
    left, right = figure.subplots(1, 2)
    for row in data["contacts"]:
        left.plot([row["contacts"]] * len(row["ms"]), row["ms"], "o", color="C0", alpha=0.4, markersize=4)
    medians = [np.median(row["ms"]) for row in data["contacts"]]
    left.plot([row["contacts"] for row in data["contacts"]], medians, color="C0", label="median")
    left.set(yscale="log", xlabel="contacts", ylabel="largest pull, processor time [ms]")
    for jobs, color in ((1, "C0"), (2, "C1")):
        some = [row for row in data["grasps"] if row["jobs"] == jobs]
        count = np.array([row["grasps"] for row in some])
        each = [1e3 * row["wall"] / row["grasps"] for row in some]
        right.plot(count, each, "o-", color=color, label=f"{jobs} process{'es' * (jobs > 1)}, by the clock")
        if jobs == 1:  # those of others that still run are not counted
            spent = [1e3 * row["processor"] / row["grasps"] for row in some]
            right.plot(count, spent, "o--", color=color, label=f"{jobs} process, of the processor")
    right.set(xscale="log", yscale="log", xlabel="grasps of three contacts in one call", ylabel="time of a grasp [ms]")
    for axes in (left, right):
        axes.legend(frameon=False)
    write_bytes(DOCS / "img" / "growth.png", picture(figure, "png", dpi=100), force=True)


if __name__ == "__main__":
    main()
