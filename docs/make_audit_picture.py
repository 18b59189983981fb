"""Draw the picture of docs/dataset-audit.md from benchmarks/results/dataset_audit.json.

    PYTHONPATH=. python docs/make_audit_picture.py

Writes docs/img/dataset-audit.png: who passes and who holds, and ROC curves of the margin and of each classical measure.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from benchmarks.audit_summary import MEASURES, OURS, goodness, roc
from benchmarks.dataset_audit import RESULTS
from handfast.core.files import write_bytes
from handfast.measures.catalogue import CATALOGUE
from handfast.pictures.drawing import AMBER, BLUE, GREEN, GREY, INK, MAROON, VIOLET, picture

IMAGE = Path(__file__).parent / "img" / "dataset-audit.png"
SETS = {"bundled": "The bundled grasps, contacts simulated", "DexGraspBench": "DexGraspBench's example, its own test"}
NAMES = {m.key: m.name for m in CATALOGUE} | {OURS: "passive margin", "largest_wrench": "largest wrench"}
DRAWN = {OURS: BLUE, "epsilon_l1": AMBER, "largest_wrench": MAROON, "tdg": VIOLET, "isotropy": GREEN}


def curves(ax: Any, rows: list[dict[str, Any]], title: str) -> None:
    """ROC curves; measures that are not named are grey."""
    sure = [r for r in rows if "measures" in r and r["passes"]["own"] is not None]
    passed = np.array([bool(r["passes"]["own"]) for r in sure])
    for key in (*(k for k in MEASURES if k not in DRAWN), *reversed(DRAWN)):
        false, true, area = roc(goodness(sure, key), passed)
        style = {"color": DRAWN.get(key, "#c9c9c9"), "lw": 2.4 if key == OURS else 1.4 if key in DRAWN else 0.9}
        ax.plot(false, true, label=f"{NAMES[key]}: {area:.2f}" if key in DRAWN else None, **style)
    ax.plot([0, 1], [0, 1], color=GREY, lw=0.8, ls=":")
    handles, labels = ax.get_legend_handles_labels()
    ax.legend(handles[::-1], labels[::-1], loc="lower right", frameon=False, fontsize=8)
    ax.set(xlim=(-0.01, 1.01), ylim=(-0.01, 1.01), aspect="equal")
    ax.set_title(f"{title}\n{passed.sum()} of {len(sure)} pass", fontsize=9.5, color=INK, loc="left")
    ax.set_xlabel("share of failing grasps taken in", fontsize=8.5, color=INK)
    ax.set_ylabel("share of passing grasps taken in", fontsize=8.5, color=INK)
    ax.tick_params(labelsize=7.5, color=GREY)
    for side in ("top", "right"):
        ax.spines[side].set_visible(False)


def areas(ax: Any, found: dict[str, Any]) -> None:
    """Areas under all curves, with 5 % to 95 % over bootstrap samples."""
    keys = [OURS, *MEASURES]
    order = sorted(keys, key=lambda k: found["bundled"]["summary"]["area"][k][0])
    for name, color, shift in (("bundled", BLUE, -0.16), ("DexGraspBench", AMBER, 0.16)):
        for y, key in enumerate(order):
            area = found[name]["summary"]["area"][key]
            if area is None:
                continue
            ax.plot(area[1:], [y + shift] * 2, color=color, lw=1.4, alpha=0.7)
            ax.plot(area[0], y + shift, "o", ms=4.5, color=color, label=name if y == 0 else None)
    ax.set_yticks(range(len(order)), [NAMES[k] for k in order], fontsize=8, color=INK)
    ax.axvline(0.5, color=GREY, lw=0.8, ls=":")
    ax.set_xlim(0, 1)
    ax.tick_params(axis="x", labelsize=7.5, color=GREY)
    ax.set_title("Area under the curve", fontsize=9.5, color=INK, loc="left")
    ax.legend(loc="upper left", bbox_to_anchor=(-0.1, -0.06), ncols=2, frameon=False, fontsize=8)
    for side in ("top", "right", "left"):
        ax.spines[side].set_visible(False)


def main() -> None:
    found = json.loads(RESULTS.read_text())
    figure = Figure(figsize=(12.4, 4.4), dpi=100)
    for k, (name, title) in enumerate(SETS.items()):
        curves(figure.add_axes((0.05 + 0.305 * k, 0.13, 0.26, 0.70)), found[name]["rows"], title)
    areas(figure.add_axes((0.79, 0.13, 0.20, 0.70)), found)
    write_bytes(IMAGE, picture(figure, "png", dpi=100), force=True)


if __name__ == "__main__":
    main()
