"""Draw the pictures of the pages on the tendon hand, the body on four feet and the fixture.

    PYTHONPATH=. python docs/make_bodies_pictures.py [--only tendon-hand four-feet fixture]

Writes docs/img/body-*.png from the bundled grasps and benchmarks/results/other_bodies.json.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from benchmarks.other_bodies import RESULTS, rough
from handfast import load_grasp
from handfast.core.arrays import Array
from handfast.core.files import write_bytes
from handfast.model.grasp import Grasp
from handfast.pictures.camera import View
from handfast.pictures.drawing import AMBER, BLUE, GREY, INK, MAROON, picture, solids
from handfast.pictures.scene import source_meshes

PALE = {BLUE: "#8db4e0", AMBER: "#f0c98a"}
IMAGES = Path(__file__).parent / "img"


def results() -> dict[str, Any]:
    return json.loads(RESULTS.read_text())  # type: ignore[no-any-return]


def scene(ax: Any, grasp: Grasp, view: View, arrow: float, label: tuple[float, float] | None = None) -> None:
    """The solids of a bundled grasp, its contacts and their normals."""
    meshes, notes = source_meshes(grasp)
    assert not notes, notes
    V = view.matrix
    seen = np.vstack(solids(ax, meshes, V))
    for i, c in enumerate(grasp.contacts):
        at, step = V[:2] @ c.position, arrow * V[:2] @ c.normal
        ax.annotate("", at, at - step, arrowprops={"arrowstyle": "-|>", "color": MAROON, "lw": 1.4}, zorder=6)
        ax.plot(*at, "o", ms=4.5, color=MAROON, mec="white", mew=0.7, zorder=7)
        side = -step / max(float(np.linalg.norm(step)), 0.4 * arrow)
        ax.text(*(at + 1.25 * arrow * side), str(i), fontsize=8.5, color=MAROON, ha="center", va="center", zorder=8)
    middle, half = (seen.min(0) + seen.max(0)) / 2, 0.55 * np.ptp(seen, axis=0)
    ax.set(xlim=middle[0] + np.array([-1, 1]) * half[0], ylim=middle[1] + np.array([-1, 1]) * half[1], aspect="equal")
    ax.axis("off")


def plain(ax: Any, x: str, y: str) -> None:
    for side in ("top", "right"):
        ax.spines[side].set_visible(False)
    ax.tick_params(labelsize=8, color=GREY)
    ax.set_xlabel(x, fontsize=9, color=INK)
    ax.set_ylabel(y, fontsize=9, color=INK)
    ax.axhline(0, color=GREY, lw=0.6, zorder=0)
    ax.axvline(0, color=GREY, lw=0.6, zorder=0)


def outline(found: dict[str, Any], key: str, plane: tuple[int, int], far: float) -> Array:
    """(n, 2) the ends of a map's directions; what has no end leaves the picture."""
    d = np.array(found["directions"])[:, plane]
    radius = np.array([far if r is None else min(r, far) for r in found[key]])
    return radius[:, None] * d


def forces(
    ax: Any,
    found: dict[str, Any],
    plane: tuple[int, int],
    limit: float,
    constant: str,
    passive: str = "passive, motors do not turn back",
) -> None:
    """A map: passive with the preload, and what constant commands balance."""
    ax.add_patch(Polygon(outline(found, "preloaded", plane, 20 * limit), fc=PALE[BLUE], ec=BLUE, lw=1.2))
    ring = outline(found, "constant", plane, 20 * limit)
    ax.add_patch(Polygon(ring, fc=PALE[AMBER], ec="none", zorder=3))
    ax.add_patch(Polygon(ring, fill=False, ec=AMBER, lw=1.4, zorder=4))
    ax.plot([], [], color=PALE[BLUE], lw=6, label=passive)
    ax.plot([], [], color=PALE[AMBER], lw=6, label=constant)
    names = "xyz"
    plain(ax, f"force along {names[plane[0]]} [N]", f"force along {names[plane[1]]} [N]")
    ax.set(xlim=(-limit, limit), ylim=(-limit, limit), aspect="equal")
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.13), frameon=False, fontsize=8.5, ncols=1)


def upright(azimuth: float, elevation: float) -> View:
    """A view with y upwards."""
    side = View.of(azimuth, elevation, "").matrix
    return View("", side @ np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]]))


def tendon_hand() -> Figure:
    found = results()["tendon-block"]["map"]
    figure = Figure(figsize=(10.0, 5.0), dpi=100)
    scene(figure.add_axes((0.0, 0.02, 0.45, 0.9)), load_grasp("tendon-block"), upright(22, 14), 0.016)
    ax = figure.add_axes((0.53, 0.24, 0.44, 0.66))
    forces(ax, found, (0, 1), 40.0, "the same tensions held constant")
    figure.text(0.02, 0.945, "One tendon over two joints: three fingers, three motors", fontsize=12, color=INK)
    figure.text(0.53, 0.945, "Forces at the block's middle that are held", fontsize=12, color=INK)
    return figure


def fixture() -> Figure:
    found = results()["milling-fixture"]
    figure = Figure(figsize=(11.6, 4.6), dpi=100)
    scene(figure.add_axes((0.0, 0.0, 0.36, 0.92)), load_grasp("milling-fixture"), View.of(40, 32, ""), 0.016)
    for k, plane in enumerate(((0, 1), (0, 2))):
        ax = figure.add_axes((0.43 + 0.30 * k, 0.26, 0.25, 0.63))
        name = "xyz"[plane[0]] + "xyz"[plane[1]]
        forces(ax, found[name], plane, 3000.0, "clamps at constant pressure", "passive, clamps that do not give way")
        figure.text(0.40 + 0.30 * k, 0.945, f"Cutting forces in the {name} plane", fontsize=11.5, color=INK)
    figure.text(0.02, 0.945, "Six locators, three clamps", fontsize=12, color=INK)
    return figure


def support(ax: Any, found: dict[str, Any], grasp: Grasp, title: str) -> None:
    """A support region from above: rays from a point inside."""
    a = np.array(found["angles"])
    u = np.column_stack([np.cos(a), np.sin(a)])
    centre = np.array(found["centre"])
    wide = centre + np.array([r["classical"] for r in found["rays"]])[:, None] * u
    held = centre + np.array([r["passive"][0] for r in found["rays"]])[:, None] * u
    ax.add_patch(Polygon(wide, fc=PALE[AMBER], ec=AMBER, lw=1.2, label="classical: some forces balance"))
    ax.add_patch(Polygon(held, fc=PALE[BLUE], ec=BLUE, lw=1.4, label="passive"))
    feet = np.array(found["feet"])
    corners = feet[np.argsort(np.arctan2(*(feet - feet.mean(0)).T[::-1]))]
    ax.add_patch(Polygon(corners, fill=False, ec=INK, ls="--", lw=1.0, label="polygon of the feet"))
    for c in grasp.contacts:
        step = 0.11 * c.normal[:2]
        ax.annotate("", c.position[:2] + step, c.position[:2], arrowprops={"arrowstyle": "-|>", "color": MAROON})
        ax.plot(*c.position[:2], "o", ms=5, color=MAROON, mec="white", zorder=7)
    plain(ax, "centre of mass, x [m]", "y [m]")
    ax.set(xlim=(-0.5, 0.42), ylim=(-0.33, 0.33), aspect="equal")
    ax.set_title(title, fontsize=10, color=INK, loc="left")


def four_feet() -> Figure:
    found = results()["four-feet"]
    figure = Figure(figsize=(12.2, 4.2), dpi=100)
    scene(figure.add_axes((0.0, 0.05, 0.31, 0.85)), load_grasp("four-feet"), View.of(-62, 16, ""), 0.09)
    for k, (name, grasp) in enumerate((("step", load_grasp("four-feet")), ("rough", rough()))):
        ax = figure.add_axes((0.365 + 0.325 * k, 0.23, 0.30, 0.62))
        support(ax, found[name], grasp, {"step": "front feet against the riser", "rough": "four stones"}[name])
        if k == 0:
            ax.legend(loc="upper left", bbox_to_anchor=(0.1, -0.17), frameon=False, fontsize=8.5, ncols=3)
    figure.text(0.02, 0.93, "A body without joints on four feet", fontsize=12, color=INK)
    figure.text(0.365, 0.93, "Where its centre of mass may be, from above", fontsize=12, color=INK)
    return figure


FIGURES: dict[str, Callable[[], Figure]] = {"tendon-hand": tendon_hand, "four-feet": four_feet, "fixture": fixture}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="*", default=list(FIGURES), choices=list(FIGURES))
    for name in parser.parse_args().only:
        write_bytes(IMAGES / f"body-{name}.png", picture(FIGURES[name](), dpi=100), force=True)
        print(name, flush=True)


if __name__ == "__main__":
    main()
