"""Draws the pictures of docs/load-path.md: a squeeze that is kept, friction that stays, a path that ends at a hole.

python docs/make_load_path_pictures.py
"""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from handfast import Contact, Grasp, GraspJoint, check, load_grasp, maximum
from handfast.core.answer import Verdict
from handfast.stability.problem.settings import Settings

IMAGES = Path(__file__).parent / "img"
TOGETHER, AFTER = "#888888", "#1f5fa8"
WAYS = (("together", TOGETHER), ("preload-first", AFTER))


def jaw() -> Grasp:
    """A jaw on a slide presses an object against a wall with 1 N."""
    contacts = [Contact((-1, 0, 0), (1, 0, 0), 0.5), Contact((1, 0, 0), (-1, 0, 0), 0.5)]
    joints = [GraspJoint("jaw", (1, 0, 0), (-1, 0, 0), (0,), "prismatic")]
    return Grasp(contacts, joints, preload={"jaw": 1.0}, name="jaw")


def squeeze() -> None:
    """Normal forces of jaw and wall against a load (-s, s)."""
    figure, ax = plt.subplots(figsize=(6.0, 3.2))
    loads = np.linspace(0.0, 0.66, 23)
    for loading, color in WAYS:
        held = [(s, check(jaw(), [-s, s, 0], loading=loading)) for s in loads]
        shown = [(s, a.witness.state.c[::3]) for s, a in held if a.verdict is Verdict.HOLDS and a.witness]
        at, forces = np.array([s for s, _ in shown]), np.array([c for _, c in shown])
        for k, (name, style) in enumerate((("jaw", "-"), ("wall", "--"))):
            ax.plot(at, forces[:, k], style, color=color, label=f"{name}, {loading}")
        ax.plot(at[-1], forces[-1, 1], "x", color=color)
    ax.set_xlabel("load s (−1, 1) [N]")
    ax.set_ylabel("normal force [N]")
    ax.legend(frameon=False, fontsize=8)
    finish(figure, "load-path-squeeze.png")


def friction() -> None:
    """Share of its friction that each contact of barrett-pear needs in the squeeze, and as a load grows."""
    grasp = load_grasp("barrett-pear")
    figure, axes = plt.subplots(1, 2, figsize=(7.0, 3.0), sharey=True)
    top = 1.6
    for ax, (loading, color) in zip(axes, WAYS, strict=True):
        rows = []
        loads = np.linspace(0.0, top, 17)
        for s in loads:
            witness = check(grasp, [0, 0, s], loading=loading).witness
            assert witness is not None
            c = witness.state.c.reshape(-1, 3)
            pressed = c[:, 0] > 1e-6
            needed = np.hypot(c[:, 1], c[:, 2]) / np.where(pressed, grasp.mu * c[:, 0], 1.0)
            rows.append(np.where(pressed, needed, np.nan))
        ax.plot(loads, np.array(rows), color=color)
        ax.set_title(loading, fontsize=9)
        ax.set_xlabel("force along +z [N]")
    axes[0].set_ylabel("share of friction")
    finish(figure, "load-path-friction.png")


def hole() -> None:
    """Which forces along +y barrett-mug resists together, and where the path ends."""
    grasp = load_grasp("barrett-mug")
    both = maximum(grasp, [0, 1, 0], interval=True, settings=Settings(timeout=20.0))
    assert both.interval is not None
    end = maximum(grasp, [0, 1, 0], loading="preload-first")
    figure, ax = plt.subplots(figsize=(7.0, 1.8))
    ax.barh(1, both.lower, color=TOGETHER)
    for first, last in both.interval.holes:
        ax.barh(1, last - first, left=first, color="white", edgecolor=TOGETHER, hatch="////")
    ax.barh(0, end.lower, color=AFTER)
    ax.set_yticks([0, 1], ["preload-first", "together"])
    ax.set_xlabel("force along +y [N]")
    finish(figure, "load-path-hole.png")


def finish(figure: plt.Figure, name: str) -> None:
    for ax in figure.axes:
        ax.spines[["top", "right"]].set_visible(False)
    figure.savefig(IMAGES / name, dpi=110, bbox_inches="tight", metadata={"Software": "Handfast"})
    plt.close(figure)


if __name__ == "__main__":
    squeeze()
    friction()
    hole()
