"""Draw the pictures of the page on robustness by sampling.

    PYTHONPATH=. python docs/make_robustness_picture.py

Writes docs/img/robust-study.png from benchmarks/results/sampled_maxima.json, and docs/img/robust-egg.png.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from benchmarks.sampled_maxima import BOUNDS, RESULTS, least
from handfast import load_grasp
from handfast.core.files import write_bytes
from handfast.pictures.drawing import BLUE, GREY, INK, MAROON, picture
from handfast.pictures.sampled_picture import draw_sampled
from handfast.stability.studies.sampled_maximum import sampled_maximum

IMAGES = Path(__file__).parent / "img"
TITLES = {"normals": "normals off by 2.5°", "all": "and contacts by 1 mm, friction and commands by 10 %"}
END = 1.8  # times the own maximum, where the picture ends


def study() -> Figure:
    """Each grasp a column: its samples' quantiles over its own maximum, and what equation (17) witnesses."""
    rows: dict[str, Any] = {n: r for n, r in json.loads(RESULTS.read_text())["rows"].items() if "left_out" not in r}
    figure = Figure(figsize=(10.0, 5.0), dpi=100)
    axes = figure.subplots(1, 2, sharey=True)
    figure.subplots_adjust(left=0.07, right=0.99, top=0.84, bottom=0.12, wspace=0.04)
    order = sorted(rows, key=lambda n: rows[n]["normals"]["uncertain_normals"][0] / rows[n]["normals"]["nominal"][0])
    for ax, name in zip(axes, BOUNDS, strict=True):
        for x, grasp in enumerate(order):
            found = rows[grasp][name]
            own = found["nominal"][0]
            q = {k: END if v is None else v / own for k, v in found["quantiles"].items()}
            ax.plot([x, x], [least(found) / own, min(q["0.95"], END)], color=BLUE, lw=1.2)
            ax.plot([x, x], [q["0.25"], min(q["0.75"], END)], color=BLUE, lw=4.5, solid_capstyle="butt")
            ax.plot([x - 0.35, x + 0.35], [found["uncertain_normals"][0] / own] * 2, color=MAROON, lw=2)
        ax.axhline(1, color=GREY, lw=0.8, zorder=0)
        ax.set(ylim=(0, END), xticks=[], xlim=(-1, len(order)))
        ax.set_xlabel(f"{len(order)} grasps", fontsize=9, color=INK)
        ax.set_title(TITLES[name], loc="left", fontsize=9.5, color=INK)
        for side in ("top", "right"):
            ax.spines[side].set_visible(False)
        ax.tick_params(labelsize=8)
    axes[0].set_ylabel("resisted, over what the grasp itself resists", fontsize=9)
    figure.text(
        0.07, 0.935, "Grasps that are a little off, and what equation (17) says of them", fontsize=12, color=INK
    )
    key = "blue: samples, from the worst to 95 %, thick from 25 to 75 %; maroon: eta = 2.5°"
    figure.text(0.07, 0.02, key, fontsize=8.5, color=INK)
    return figure


def main() -> None:
    write_bytes(IMAGES / "robust-study.png", picture(study()), force=True)
    found = sampled_maximum(load_grasp("barrett-egg"), [0, 0, 1], BOUNDS["all"], samples=200)
    write_bytes(IMAGES / "robust-egg.png", picture(draw_sampled(found)), force=True)
    print(np.round([found.nominal.lower, found.quantiles[0.0], found.below_uncertain], 3))


if __name__ == "__main__":
    main()
