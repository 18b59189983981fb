"""Make the pictures of the page on older methods: docs/img/baselines-*.png.

    python docs/make_baseline_pictures.py [--only NAME ...]

`baselines-verdicts` and `baselines-directions` draw the numbers of benchmarks/results/baselines.json.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from make_pictures import beside
from matplotlib.figure import Figure

from handfast import Contact, Grasp, Verdict, check, load_grasp
from handfast.papers.baselines import pyramid_step, turn_scheme
from handfast.pictures.drawing import AMBER, BLUE, GREY, INK, MAROON, picture
from handfast.pictures.grasp_picture import draw_grasp
from handfast.stability.problem.witness import Witness

IMAGES = Path(__file__).parent / "img"
RESULTS = Path(__file__).parent.parent / "benchmarks" / "results" / "baselines.json"
EDGES = {4: MAROON, 8: AMBER, 16: BLUE}
KINDS = {"right": "#6c9fd6", "undecided": "#d9d9d9", "false slips": AMBER, "false holds": MAROON}
MU, WEIGHT = 0.4, 10.0


def tripod() -> Grasp:
    """A block on three points of a table, 120 degrees apart."""
    angles = 2 * np.pi * np.arange(3) / 3
    return Grasp([Contact(0.05 * np.array([np.cos(a), np.sin(a), 0.0]), np.array([0, 0, 1.0]), MU) for a in angles])


def push(size: float, angle: float) -> np.ndarray:
    return np.array([size * np.cos(angle), size * np.sin(angle), -WEIGHT, 0, 0, 0])


def table() -> Figure:
    """Left the largest push that pyramids hold, right how far friction is from the direction against the slip."""
    figure = Figure(figsize=(10.0, 4.4))
    left, right = figure.add_axes((0.06, 0.13, 0.36, 0.78)), figure.add_axes((0.53, 0.13, 0.44, 0.78))
    block = tripod()
    around = np.linspace(0, 2 * np.pi, 361)
    left.plot(MU * WEIGHT * np.cos(around), MU * WEIGHT * np.sin(around), color=INK, lw=1.5, label="the friction cone")
    for edges, colour in EDGES.items():
        angles = np.linspace(0, 2 * np.pi, 4 * edges + 1)
        reach = np.array([largest(block, angle, edges) for angle in angles])
        left.plot(reach * np.cos(angles), reach * np.sin(angles), color=colour, lw=1.5, label=f"{edges} edges")
        slips, errors = [], []
        for angle in np.radians(np.arange(0.0, 180.1, 0.5)):
            found = pyramid_step(block, push(2.5 * MU * WEIGHT, angle), edges=edges)
            assert found.state is not None
            slips.append(np.degrees(np.arctan2(found.state.r[1], found.state.r[0])))
            errors.append(np.degrees(np.nanmax(found.friction_errors)))
        order = np.argsort(slips)
        right.plot(np.array(slips)[order], np.array(errors)[order], color=colour, lw=1.5, label=f"{edges} edges")
    left.set(aspect="equal", xlabel="push along x [N]", ylabel="push along y [N]")
    left.set_title("Largest push held under 10 N, mu = 0.4", loc="left", fontsize=11, color=INK)
    left.legend(loc="center", frameon=False, fontsize=9)
    right.set(xlabel="direction of the slip [degrees]", ylabel="friction's error [degrees]", ylim=(0, 50))
    right.set_xlim(0, 180)
    right.set_xticks(range(0, 181, 30))
    right.set_title("Angle between friction and the direction against the slip", loc="left", fontsize=11, color=INK)
    right.legend(loc="upper right", frameon=False, fontsize=9, ncols=3)
    tidy(left, right)
    return figure


def largest(block: Grasp, angle: float, edges: int) -> float:
    """[N] the largest push in a direction that the step calls HOLDS, by bisection."""
    low, high = 0.0, 1.5 * MU * WEIGHT
    for _ in range(9):
        middle = (low + high) / 2
        held = pyramid_step(block, push(middle, angle), edges=edges).verdict is Verdict.HOLDS
        low, high = (middle, high) if held else (low, middle)
    return low


def verdicts() -> Figure:
    """Of every method: how many verdicts are right, how many contradict a proof."""
    data = json.loads(RESULTS.read_text())
    figure = Figure(figsize=(10.0, 3.9))
    for k, part in enumerate(("random", "bundled")):
        ax = figure.add_axes((0.14 + 0.44 * k, 0.27, 0.40, 0.60))
        summary = data[part]["summary"]
        for row, said in enumerate(summary.values()):
            total, start = len(data[part]["rows"]), 0.0
            for kind, colour in KINDS.items():
                share = 100 * said.get(kind, 0) / total
                ax.barh(row, share, left=start, color=colour, height=0.62, label=kind if row == 0 else None)
                if share >= 4:
                    white = colour in (MAROON, AMBER)
                    words = f"{said[kind]}"
                    ax.text(start + share / 2, row, words, ha="center", va="center", fontsize=9,
                            color="white" if white else INK)  # fmt: skip
                start += share
        ax.set_yticks(range(len(summary)), list(summary) if k == 0 else [""] * len(summary))
        ax.invert_yaxis()
        ax.set(xlim=(0, 100), xlabel=f"% of {len(data[part]['rows'])} loads")
        ax.set_title(f"{part} grasps", loc="left", fontsize=11, color=INK)
        tidy(ax)
        if k == 0:
            handles, labels = ax.get_legend_handles_labels()
            figure.legend(handles, labels, loc="lower center", ncols=4, frameon=False, fontsize=9)
    return figure


def directions() -> Figure:
    """The share of sliding contacts whose friction is off by more than an angle, in states that are called HOLDS."""
    data = json.loads(RESULTS.read_text())["random"]["rows"]
    figure = Figure(figsize=(7.0, 4.0))
    ax = figure.add_axes((0.10, 0.14, 0.87, 0.77))
    colours = dict(zip(data[0]["methods"], [*EDGES.values(), INK], strict=True))
    for method, colour in colours.items():
        said = [row["methods"][method] for row in data]
        errors = np.sort([e for s in said if s["verdict"] == "holds" for e in s["errors"]])
        ax.step(errors, 100 * (1 - np.arange(1, len(errors) + 1) / len(errors)), color=colour, lw=1.5, label=method)
    ax.axvline(90, color=GREY, lw=0.8)
    ax.text(92, 96, "friction pushes along the slip", fontsize=9, color=GREY, va="top")
    ax.set(xlim=(0, 180), ylim=(0, 100), xlabel="friction's error [degrees]", ylabel="% of sliding contacts beyond it")
    ax.set_xticks(range(0, 181, 30))
    ax.legend(loc="upper right", bbox_to_anchor=(1.0, 0.9), frameon=False, fontsize=9)
    ax.set_title(
        "Error of friction's direction, random grasps that are said to hold", loc="left", fontsize=11, color=INK
    )
    tidy(ax)
    return figure


def turns() -> bytes:
    """Fig. 1 under 1 N: left as the scheme in turns balances it, right as it is."""
    grasp, w = load_grasp("fig1"), np.array([0, 1.0, 0, 0, 0, 0])
    found = turn_scheme(grasp, w)
    assert found.state is not None
    wrong = Witness(grasp, w, found.state, 0.0, False)
    return beside(draw_grasp(grasp, wrong, count=1), draw_grasp(grasp, check(grasp, w).witness, count=1), 800)


def tidy(*axes: Any) -> None:
    for ax in axes:
        ax.spines[["top", "right"]].set_visible(False)
        ax.tick_params(colors=INK, labelsize=9)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="*", default=[])
    asked = parser.parse_args()
    pictures: dict[str, Callable[[], Any]] = {
        "baselines-table": table,
        "baselines-verdicts": verdicts,
        "baselines-directions": directions,
        "baselines-turns": turns,
    }
    for name, draw in pictures.items():
        if not asked.only or name in asked.only:
            drawn = draw()
            (IMAGES / f"{name}.png").write_bytes(drawn if isinstance(drawn, bytes) else picture(drawn, "png"))
            print(f"{name}.png", flush=True)


if __name__ == "__main__":
    main()
