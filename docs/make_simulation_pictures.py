"""Draw the simulation page's pictures: docs/img/simulation-*.png.

    python docs/make_simulation_pictures.py

Two strips, and what the agreement study counted, read from benchmarks/results/simulation_agreement.json.
"""

from __future__ import annotations

import json
from pathlib import Path

from matplotlib.figure import Figure

from benchmarks.simulation_agreement import LOADINGS, RESULTS, STATEMENT
from handfast import load_grasp, simulate
from handfast.core.files import write_bytes
from handfast.pictures.drawing import AMBER, BLUE, GREY, INK, MAROON, picture
from handfast.pictures.motion_picture import strip
from handfast.pictures.scene import moving_scene
from handfast.simulation.simulate import simulate_bodies

IMAGES = Path(__file__).parent / "img"
COUNTED = {
    "agree": ("agree", BLUE),
    "open": ("open", "#d9d9d9"),
    "said holds, slips": ("holds is said, slips", MAROON),
    "said holds, settles": ("holds is said, jumps and rests", "#c98aa0"),
    "said slips, holds": ("slips is said, holds", AMBER),
}


def agreement() -> Figure:
    """Shares of all simulated loads, of those that move little, and of those that are not fragile."""
    found = json.loads(RESULTS.read_text())["summary"]
    figure = Figure(figsize=(8, 3.8))
    ax = figure.add_axes((0.27, 0.16, 0.7, 0.66))
    parts = ("all", "moves little", "not fragile")
    rows = [f"{part}, {loading}" for part in parts for loading in (*LOADINGS, STATEMENT)]
    for k, name in enumerate(rows):
        row, left = found[name], 0.0
        for key, (_, color) in COUNTED.items():
            share = 100 * row.get(key, 0) / row["simulated"]
            ax.barh(-k, share, 0.7, left, color=color, edgecolor="white", linewidth=0.5)
            left += share
        ax.text(
            1.5, -k, f"{100 * row['agreement']:.1f} % of {row['simulated']}", va="center", fontsize=8, color="white"
        )
    ax.set_yticks([-k for k in range(len(rows))], rows, fontsize=8)
    ax.axvline(95, color=INK, lw=0.8, ls="--")
    ax.set_xlim(0, 100)
    ax.set_xlabel("% of simulated loads; dashed: the target of 95 %", fontsize=8, color=GREY)
    ax.tick_params(axis="x", labelsize=8)
    handles = [ax.barh(1, 0, color=color, label=label) for label, color in COUNTED.values()]
    figure.legend(handles=handles, loc="upper center", ncols=len(handles), fontsize=7.5, frameon=False)
    ax.set_ylim(-len(rows) + 0.4, 0.6)
    for side in ("top", "right"):
        ax.spines[side].set_visible(False)
    return figure


def main() -> None:
    """Make all pictures."""
    asked = (("fig1", [0, 2.4, 0], simulate, "fig1"), ("barrett-ball", [0, 0, 5.6], simulate_bodies, "ball"))
    for name, wrench, ask, file in asked:
        grasp = load_grasp(name)
        drawn = strip(ask(grasp, wrench), moving_scene(grasp)[0])
        write_bytes(IMAGES / f"simulation-{file}.png", picture(drawn), force=True)
    write_bytes(IMAGES / "simulation-agreement.png", picture(agreement(), "png", dpi=110), force=True)


if __name__ == "__main__":
    main()
