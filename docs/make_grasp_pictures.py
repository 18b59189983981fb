"""Draw the picture of a pour: a grasp of the bundled teapot task, and the weights that it holds.

    python docs/make_grasp_pictures.py

Asks `grasp_for` for three grasps that hold the pot from upright to tipped by 60 degrees (seed fixed), takes the best
one, and writes docs/img/grasp-pour.png: the pot upright and tipped, with the contact forces, and the map of forces at
its centre of mass with the weight.
"""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.image import imread

from handfast import Loads, Settings, force_map, grasp_for, load_body, load_task
from handfast.core.arrays import Array
from handfast.core.files import write_bytes
from handfast.pictures.drawing import AMBER, BLUE, picture, solids
from handfast.pictures.map_picture import draw_map
from handfast.pictures.scene import Mesh, scene_meshes
from handfast.planning.results.grasps import ProvedGrasp
from handfast.stability.problem.witness import Witness

IMAGE = Path(__file__).parent / "img" / "grasp-pour.png"
TIP = np.radians(-60)  # about z, the spout goes down
LENGTH = 0.06  # [m] of the arrow of the weight; the forces share its scale up to their longest, which is as long


def best() -> ProvedGrasp:
    """The grasp that is drawn."""
    body = load_body("teapot")
    loads = Loads.tilt(body, [0, 0, 1], TIP, down=[0, -1, 0])
    return grasp_for(load_task("teapot-service"), body, loads, count=3, timeout=300).grasps[0]


def panel(ax: Any, meshes: list[Mesh], witness: Witness, angle: float, middle: Array) -> None:
    """The hand and the pot tipped by an angle [rad] about z, seen from +z and a little from above."""
    c, s, e = np.cos(angle), np.sin(angle), np.radians(12)
    tipped = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    V = np.array([[1, 0, 0], [0, np.cos(e), -np.sin(e)], [0, np.sin(e), np.cos(e)]]) @ tipped
    seen = np.vstack(solids(ax, meshes, V, {"object": 0.75, "hand": 0.9}))
    longest = max(float(np.linalg.norm(f)) for f in witness.forces)
    arrows = [
        (p.position, LENGTH / longest * f, BLUE) for p, f in zip(witness.grasp.contacts, witness.forces, strict=True)
    ]
    force = witness.wrench[:3]
    arrows.append((middle, LENGTH * force / np.linalg.norm(force), AMBER))
    for at, step, color in arrows:
        style = {"arrowstyle": "-|>", "mutation_scale": 14, "color": color, "lw": 2.2, "shrinkA": 0, "shrinkB": 0}
        ax.annotate("", V[:2] @ (at + step), V[:2] @ at, arrowprops=style, zorder=5)
        ax.plot(*(V[:2] @ at), "o", ms=5, color=color, mec="white", mew=0.8, zorder=6)
    center, half = (seen.min(0) + seen.max(0)) / 2, 0.53 * np.ptp(seen, axis=0).max()
    ax.set(xlim=center[0] + np.array([-half, half]), ylim=center[1] + np.array([-half, half]), aspect="equal")
    ax.axis("off")


def main() -> None:
    g, body = best(), load_body("teapot")
    meshes = scene_meshes(g.solution.task.hand, g.q, body, g.pose)
    figure = Figure(figsize=(12.0, 4.6), dpi=100)
    for k, (check, angle, title) in enumerate(
        ((g.answer.checks[0], 0.0, "upright"), (g.answer.checks[-1], TIP, "poured"))
    ):
        ax = figure.add_axes((0.29 * k, 0.02, 0.28, 0.88))
        assert check.witness is not None
        panel(ax, meshes, check.witness, angle, body.center_of_mass)
        ax.set_title(title, fontsize=11)
    whole = force_map(g.grasp, "xy", steps=120, at=body.center_of_mass, settings=Settings(nodes=4000))
    drawn = picture(draw_map(whole, weight=9.81 * float(body.mass or 0)), "png", dpi=160)
    ax = figure.add_axes((0.585, 0.0, 0.41, 1.0))
    ax.imshow(imread(io.BytesIO(drawn)))
    ax.axis("off")
    write_bytes(IMAGE, picture(figure, "png", dpi=110), force=True)
    print(g.terms, g.answer.preload)


if __name__ == "__main__":
    main()
