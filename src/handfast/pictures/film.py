"""A simulation to look at: a strip of pictures and an animated GIF, drawn by us, the same bytes every time.

Hand and object move with the motion that was simulated, enlarged where it would not be seen.
"""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from scipy.spatial.transform import Rotation

from handfast.pictures.camera import View, views
from handfast.pictures.drawing import AMBER, ARROW, BLUE, GREY, INK, motion_and_load, solids, windowed
from handfast.pictures.scene import Mesh, applied

if TYPE_CHECKING:
    from handfast.core.arrays import Array
    from handfast.pictures.scene import MovingScene
    from handfast.simulation.result import SimulationResult

SEEN = 0.25  # [grasp sizes] to which the largest motion is enlarged
REACH = 0.8  # [grasp sizes] length of the largest force
FRAMES, PICTURES = 30, 6


def film(result: SimulationResult, scene: MovingScene | None = None, frames: int = FRAMES) -> bytes:
    """An animated GIF."""
    from PIL import Image

    pages = []
    for k in _moments(result, frames):
        figure = Figure(figsize=(4.4, 4.4), dpi=80)
        _frame(figure.add_axes((0, 0, 1, 0.9)), result, k, scene)
        drawn = io.BytesIO()
        figure.savefig(drawn, format="png", dpi=80)
        pages.append(Image.open(drawn).convert("P", palette=Image.Palette.ADAPTIVE, colors=64))
    out = io.BytesIO()
    pages[0].save(out, format="GIF", save_all=True, append_images=pages[1:], duration=120, loop=0)
    return out.getvalue()


def strip(result: SimulationResult, scene: MovingScene | None = None, pictures: int = PICTURES) -> Figure:
    """Pictures from the beginning to the end in a row; below them motion and load over time."""
    figure = Figure(figsize=(2.4 * pictures, 4.6), dpi=100)
    chosen = _moments(result, pictures)
    for n, k in enumerate(chosen):
        _frame(figure.add_axes((n / pictures, 0.46, 1 / pictures, 0.46)), result, k, scene)
    ax = motion_and_load(figure, (0.07, 0.11, 0.86, 0.27), (result.time, result.motion), result.load, chosen)
    ax.set_xlabel("time in the simulation [s]", fontsize=8)
    if result.onset is not None:
        at = result.time[int(np.argmax(result.load >= result.onset))]
        ax.axvline(at, color=GREY, lw=0.8, ls="--")
        ax.annotate(" slips", (at, 0.9), xycoords=("data", "axes fraction"), fontsize=8, color=INK)
    return figure


def enlargement(result: SimulationResult) -> float:
    """By how much the object's motion is enlarged: 1 where it is seen as it is."""
    size, most = result.grasp.size, float(result.motion.max())
    if most <= 0 or most > SEEN * size:
        return 1.0
    ten = float(10.0 ** np.floor(np.log10(SEEN * size / most)))
    return max(step * ten for step in (1, 2, 5) if step * ten * most <= SEEN * size)


def _moments(result: SimulationResult, count: int) -> list[int]:
    """Moments spread over the history; a slip goes fast, so that half of them follow the motion."""
    n = len(result.time)
    half = [round(x) for x in np.linspace(0, n - 1, count - count // 2)]
    travelled = np.maximum.accumulate(result.motion)
    ends = np.linspace(travelled[0], travelled[-1], count // 2 + 2)[1:-1]
    return sorted([*half, *(min(int(np.searchsorted(travelled, x)), n - 1) for x in ends)])


def _frame(ax: Any, result: SimulationResult, k: int, scene: MovingScene | None) -> None:
    """One moment: solids, contacts, their forces and the load."""
    grasp, size = result.grasp, result.grasp.size
    names = [grasp.joints[j].name for j in result.free]
    large = enlargement(result)
    turned = dict(zip(names, large * result.joints[k], strict=True))
    meshes = scene(turned) if scene else []
    view: View = views(grasp, 1)[0] if not meshes else View.of(-55.0, 28.0, "")
    V = view.matrix
    p = grasp.positions
    middle = p.mean(axis=0)
    turn = Rotation.from_rotvec(large * result.turn[k]).as_matrix()
    shift = large * result.shift[k]

    def moved(x: Array) -> Array:
        out: Array = middle + shift + (x - middle) @ turn.T
        return out

    shown = [Mesh(moved(m.vertices), m.faces, m.kind) if m.kind == "object" else m for m in meshes]
    corners = [c for m in meshes for c in solids(ax, [m], V, {"object": 0.0, "hand": 0.0})] if meshes else []
    for collection in list(ax.collections):
        collection.remove()
    solids(ax, shown, V)
    at = moved(p)
    if not meshes:
        ax.fill(*(at @ V[:2].T).T, fc="#efe6d3", ec="#cdbf9f", lw=0.8, ls="--", zorder=1)
    ax.plot(*(p @ V[:2].T).T, "o", ms=7, mfc="none", mec=GREY, zorder=6)
    ax.plot(*(at @ V[:2].T).T, "o", ms=4.5, color=INK, mec="white", mew=0.6, zorder=8)
    most = max(float(np.linalg.norm(result.forces, axis=2).max()), float(np.linalg.norm(result.wrench[:3])), 1e-300)
    for i, contact in enumerate(grasp.contacts):
        force = turn @ (contact.frame[:, 0] * result.forces[k, i, 0])
        _arrow(ax, at[i] @ V[:2].T, REACH * size / most * V[:2] @ force, BLUE)
    origin, w = applied(result.load[k] * result.wrench, middle, 2 * size)
    _arrow(ax, V[:2] @ (origin + shift), REACH * size / most * V[:2] @ w[:3], AMBER)
    seen = np.vstack([p @ V[:2].T, *corners])
    low, high = seen.min(axis=0) - 0.6 * size, seen.max(axis=0) + 0.6 * size
    windowed(ax, (low + high) / 2, float((high - low).max()) / 2)
    scale = f", motion × {large:g}" if large != 1 else ""
    ax.set_title(f"load {100 * result.load[k]:.0f} %, {1e3 * result.motion[k]:.2g} mm{scale}", fontsize=8)


def _arrow(ax: Any, at: Array, along: Array, color: str) -> None:
    if np.linalg.norm(along) > 0:
        style = ARROW | {"color": color, "lw": 1.6}
        ax.annotate("", at + along, at, arrowprops=style, zorder=7, annotation_clip=False)
