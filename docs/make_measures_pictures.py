"""Draw the pictures of the pages on measures.

    PYTHONPATH=. python docs/make_measures_pictures.py [--only NAME ...]

Writes docs/img/measures-*.png: a bundled grasp, the cases of docs/measures-disagree.md, and the rank correlations of
benchmarks/results/measures.json.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from benchmarks.measures import RESULTS, decided
from handfast import Settings, load_body, load_configuration, load_grasp, load_hand, measure
from handfast.core.files import write_bytes
from handfast.measures.catalogue import CATALOGUE
from handfast.model.grasp import Grasp
from handfast.pictures.drawing import AMBER, BLUE, GREY, INK, picture
from handfast.pictures.measures_picture import draw_measures
from handfast.pictures.scene import scene_meshes

IMAGES = Path(__file__).parent / "img"
TITLES = {"largest_wrench": "largest wrench"}
PLOTTED = ("epsilon_l1", "epsilon_linf", "largest_wrench", "pgr", "isotropy", "tdg")
PATIENT = Settings(nodes=6000, gap=1e-2, verify=False)
ALIKE = {f"finger_{k}_prox": 0.1 for k in (1, 2, 3)}  # [N m]


def drawn(grasp: Grasp, configuration: str, edges: int = 8) -> Figure:
    """A grasp's measures beside hand and object."""
    placed = load_configuration(configuration)
    hand, q = placed.applied(load_hand(placed.hand or ""))
    meshes = scene_meshes(hand, q, load_body(placed.object or ""), placed.pose)
    return draw_measures(measure(grasp, edges=edges, settings=PATIENT), meshes)


CASES: dict[str, Callable[[], Figure]] = {
    "can": lambda: drawn(load_grasp("barrett-can"), "barrett-can"),
    "unpressed": lambda: drawn(load_grasp("fig11"), "fig11"),
    "hurting": lambda: drawn(load_grasp("fig11").with_preload(ALIKE), "fig11"),
    "locked": lambda: drawn(load_grasp("fig1").with_preload(None), "fig1"),
    "smooth": lambda: drawn(load_grasp("barrett-can").with_friction(0.3), "barrett-can"),
    "wedged": lambda: drawn(load_grasp("barrett-dumbbell").with_preload(None), "barrett-dumbbell"),
    "wrapped": lambda: drawn(load_grasp("barrett-bottle"), "barrett-bottle"),
}  # fmt: skip


def correlations() -> Figure:
    """Each measure's rank correlation with the worst passive maximum, and six of them grasp by grasp."""
    data: dict[str, Any] = json.loads(RESULTS.read_text())
    found = data["summary"]["measures"]
    names = {m.key: m.name for m in CATALOGUE}
    order = sorted((k for k in found if found[k]["all"] is not None), key=lambda k: found[k]["all"])
    figure = Figure(figsize=(12.0, 6.4), dpi=100)
    ax = figure.add_axes((0.17, 0.11, 0.26, 0.78))
    values = [found[k]["all"] for k in order]
    ax.barh(range(len(order)), values, color=[BLUE if v > 0 else AMBER for v in values], height=0.7)
    for y, v in enumerate(values):
        text = f"{v:.2f}".replace("-", "−")
        ax.text(max(v, 0) + 0.02, y, text, va="center", fontsize=8, color=INK)
    others = [found[k]["unmatched"] for k in order]
    ax.plot(others, range(len(order)), "D", ms=5, color=AMBER, mec="white", label="with commands at random", zorder=3)
    ax.legend(loc="lower right", frameon=False, fontsize=8.5)
    ax.set_yticks(range(len(order)), [names[k] for k in order], fontsize=8.5, color=INK)
    ax.set(xlim=(min(-0.15, min(values) - 0.05), 1.0))
    ax.axvline(0, color=GREY, lw=0.8)
    ax.set_xlabel(
        "Spearman's rank correlation with the\nworst passive maximum (better with more: +)", fontsize=9, color=INK
    )
    for side in ("top", "right", "left"):
        ax.spines[side].set_visible(False)
    rows = [r for r in data["rows"] if "measures" in r and decided(r["worst"])]
    y = np.array([r["worst"][0] for r in rows])
    for k, key in enumerate(PLOTTED):
        panel = figure.add_axes((0.50 + 0.17 * (k % 3), 0.57 - 0.46 * (k // 3), 0.135, 0.32))
        x = np.array([r["measures"].get(key, np.nan) for r in rows], dtype=float)
        panel.plot(x, np.maximum(y, 1e-2), ".", ms=3, color=BLUE, alpha=0.5)
        panel.set_yscale("log")
        panel.set_title(f"{TITLES.get(key, names[key])}: {found[key]['all']:.2f}", fontsize=8.5, color=INK, loc="left")
        panel.tick_params(labelsize=7, color=GREY)
        panel.set_ylim(8e-3, None)
        if k % 3 == 0:
            panel.set_ylabel("worst passive maximum [N]", fontsize=8, color=INK)
        for side in ("top", "right"):
            panel.spines[side].set_visible(False)
    title = f"What measures say of {len(rows)} random grasps, and what the grasps resist"
    figure.text(0.02, 0.945, title, fontsize=13, color=INK)
    return figure


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="*", default=[])
    asked = parser.parse_args()
    for name, make in {**CASES, "correlations": correlations}.items():
        if not asked.only or name in asked.only:
            write_bytes(IMAGES / f"measures-{name}.png", picture(make(), "png", dpi=100), force=True)
            print(name, flush=True)


if __name__ == "__main__":
    main()
