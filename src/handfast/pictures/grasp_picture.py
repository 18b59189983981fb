"""A grasp drawn from a few sides: contacts, friction cones, forces, motions, joints, and solids behind them.

Orthographic projections with the painter's algorithm: no 3-D toolkit, so what lies in front is in
front, every panel has the same scale, and arrows are never hidden by the solids.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Polygon

from handfast.core.arrays import Array
from handfast.core.transforms import normal_frame
from handfast.model.grasp import Grasp
from handfast.pictures.camera import View, views
from handfast.pictures.drawing import AMBER, ARROW_STYLE, BLUE, GREEN, GREY, HALO, INK, VIOLET, solids, windowed
from handfast.pictures.scene import Mesh, arrows, finger_lines, placed_joints
from handfast.stability.problem.witness import Witness

# joints that are named in place; columns of the key, and [inches] a line of it
NAMED, KEY_COLUMNS, KEY_LINE = 8, 3, 0.16
TRIAD = 0.05  # length of the object frame's axes in the corner, in half widths of the figure
ARROWS = {"forces": (BLUE, 6), "motions": (VIOLET, 5), "disturbance": (AMBER, 7)}  # colours, order of drawing
JOINT = 0.3  # half length of a joint axis, in grasp sizes


def draw_grasp(grasp: Grasp, witness: Witness | None = None, meshes: Sequence[Mesh] = (), count: int = 2) -> Figure:
    """The grasp from `count` sides, with the forces and virtual motions of a witness.

    Contact forces are those of the hand on the object. Motions are those of the object relative to the
    finger, at their own scale.
    """
    return _side_by_side([(grasp, meshes, view) for view in views(grasp, count)], witness)


def draw_grasps(found: Sequence[tuple[Grasp, Sequence[Mesh]]]) -> Figure:
    """Several grasps with their solids beside each other, on one scale, each numbered as its place from 0."""
    panels = []
    for k, (grasp, meshes) in enumerate(found):
        view = views(grasp, 2)[-1]
        panels.append((grasp, meshes, View(f"{k}, {view.title}", view.matrix)))
    return _side_by_side(panels, None)


def _side_by_side(panels: Sequence[tuple[Grasp, Sequence[Mesh], View]], witness: Witness | None) -> Figure:
    """Panels of one scale in a row, and the key below them."""
    count, grasp = len(panels), panels[0][0]
    figure = Figure(figsize=(8.0, 8.0), dpi=100)
    axes = [figure.add_axes((k / count + 0.005, 0, 1 / count - 0.01, 1)) for k in range(count)]
    seen = [_panel(ax, g, witness, meshes, view) for ax, (g, meshes, view) in zip(axes, panels, strict=True)]
    margin = 0.14 * grasp.size
    width = max(float(np.ptp(p[:, 0])) for p in seen) + 2 * margin
    height = max(float(np.ptp(p[:, 1])) for p in seen) + 2 * margin
    width = max(width, 0.75 * height, 1.5 * grasp.size)
    triad = TRIAD * count * width / 2
    headroom = 1.6 * triad  # above the drawing, for the object frame's axes
    height = max(height, 0.6 * width) + 2 * headroom
    names = [] if panels[0][1] else joint_key(grasp)
    legend = 0.78 + KEY_LINE * -(-len(names) // KEY_COLUMNS)  # [inches] below the panels
    panel = 8.0 / count * height / width
    figure.set_size_inches(8.0, panel + legend + 0.28)
    total = panel + legend + 0.28
    for k, (ax, (g, meshes, view), points) in enumerate(zip(axes, panels, seen, strict=True)):
        ax.set_position((k / count + 0.005, legend / total, 1 / count - 0.01, panel / total))
        middle = (points.min(0) + points.max(0)) / 2 + [0, headroom]
        _frame(ax, middle, np.array([width, height]) / 2, view, triad)
        if not meshes:
            _joint_labels(ax, g, view.matrix)
    foot: dict[str, Any] = {"loc": "lower center", "bbox_to_anchor": (0.5, (legend - 0.78) / total)}
    figure.legend(handles=_key(grasp, witness), ncols=3, frameon=False, fontsize=9, **foot)
    for k, text in enumerate(names):
        column, row = divmod(k, -(-len(names) // KEY_COLUMNS))
        figure.text(
            0.02 + column / KEY_COLUMNS,
            (legend - 0.8 - KEY_LINE * row) / total,
            text,
            va="top",
            fontsize=7.5,
            color=GREEN,
        )
    return figure


def draw_scene(meshes: Sequence[Mesh], grasp: Grasp, witness: Witness | None = None) -> Figure:
    """Hand and object from three sides with the grasp's contacts."""
    return draw_grasp(grasp, witness, meshes, count=3)


def _panel(ax: Any, grasp: Grasp, witness: Witness | None, meshes: Sequence[Mesh], view: View) -> Array:
    """Draw one side; returns the points that it has to show."""
    V = view.matrix
    size = grasp.size
    points = solids(ax, meshes, V)
    p = grasp.positions
    points.append(p @ V[:2].T)
    if not meshes:
        points += [_skeleton(ax, grasp, V), _hull(ax, p @ V[:2].T)]
    points.append(_joints(ax, grasp, V))
    for i, c in enumerate(grasp.contacts):
        _cone(ax, p[i], c.normal, c.friction, 0.38 * size, V)
        if witness is None:
            _arrow(ax, p[i], 0.38 * size * c.normal, V, INK, 3, size=size)
    ax.plot(*(p @ V[:2].T).T, "o", ms=5.5, color=INK, mec="white", mew=0.8, zorder=8)
    if witness is not None:
        points.append(_forces(ax, grasp, witness, V))
    for i in range(grasp.m):
        _label(ax, *_number_place(grasp, i, V), str(i), INK, 8.5, bold=True)
    return np.vstack(points)


def _number_place(grasp: Grasp, i: int, V: Array) -> tuple[float, float]:
    """Where the number of a contact stands: behind it, out of its normal's way."""
    out = -V[:2] @ grasp.contacts[i].normal
    x, y = V[:2] @ grasp.positions[i] + 0.09 * grasp.size * (out if np.linalg.norm(out) > 0.3 else np.array([0.0, 1.0]))
    return float(x), float(y)


def _skeleton(ax: Any, grasp: Grasp, V: Array) -> Array:
    """Lines from joint to joint to contact."""
    seen = [line @ V[:2].T for line in finger_lines(grasp)]
    for line in seen:
        ax.plot(*line.T, color="#c2c8cf", lw=5, solid_capstyle="round", zorder=1.5)
    return np.vstack(seen)


def _hull(ax: Any, p: Array) -> Array:
    """A faint outline where the object must be."""
    from scipy.spatial import ConvexHull, QhullError

    with suppress(QhullError, ValueError):  # all in a line
        outline = p[ConvexHull(p).vertices]
        ax.add_patch(Polygon(outline, fc="#efe6d3", ec="#cdbf9f", lw=0.8, ls="--", zorder=1))
    return p


def _cone(ax: Any, at: Array, n: Array, mu: float, height: float, V: Array) -> None:
    """The outline of the friction cone."""
    from scipy.spatial import ConvexHull

    _, t1, t2 = normal_frame(n).T
    angle = np.linspace(0, 2 * np.pi, 49)[:-1]
    rim = at + height * (n + min(mu, 1.5) * (np.outer(np.cos(angle), t1) + np.outer(np.sin(angle), t2)))
    flat = np.vstack([at, rim]) @ V[:2].T
    if mu > 1e-3:
        style: dict[str, Any] = {"fc": GREEN, "alpha": 0.13, "ec": "none", "zorder": 2}
        ax.add_patch(Polygon(flat[ConvexHull(flat, qhull_options="QJ").vertices], **style))
    ax.plot(*np.array([at, at + height * n]).dot(V[:2].T).T, color=GREEN, lw=0.8, ls=":", zorder=2.5)


def _forces(ax: Any, grasp: Grasp, witness: Witness, V: Array) -> Array:
    """Contact forces, virtual motions and the disturbance; returns the ends of what the panel has to show."""
    ends = [np.zeros((0, 2))]
    for a in arrows(grasp, witness.wrench, witness):
        color, order = ARROWS[a.kind]
        for share in (1.0, 0.8)[: a.heads]:
            end = _arrow(ax, a.at, share * a.step, V, color, order, size=grasp.size, thin=a.kind == "motions")
        if a.kind != "motions":
            ends.append(np.array([end, V[:2] @ a.at]))
    return np.vstack(ends)


def _arrow(
    ax: Any, start: Array, step: Array, V: Array, color: str, order: float, *, size: float, thin: bool = False
) -> Array:
    a, b = V[:2] @ start, V[:2] @ (start + step)
    seen = float(np.linalg.norm(b - a))
    if seen < 0.03 * np.linalg.norm(step):  # along the line of sight
        ax.plot(*a, "o" if V[2] @ step > 0 else "x", ms=9, mfc="none", mec=color, mew=1.8, zorder=order)
        return b
    small = min(1.0, seen / (0.25 * size))  # a short arrow gets a small head, or it would point backwards
    head = max(2.0, (9 if thin else 14) * small)
    width = (1.3 if thin else 2.4) * max(small, 0.5)
    ax.annotate("", b, a, zorder=order, arrowprops=ARROW_STYLE | {"mutation_scale": head, "color": color, "lw": width})
    return b


def _joints(ax: Any, grasp: Grasp, V: Array) -> Array:
    """Joint axes as dashed lines, or as rings where they point at the viewer; returns their lower ends."""
    ends = []
    for j in placed_joints(grasp):
        at, step = V[:2] @ j.origin, JOINT * grasp.size * V[:2] @ j.axis
        if np.linalg.norm(step) < 0.1 * JOINT * grasp.size:
            ax.plot(*at, "o", ms=10, mfc="white", mec=GREEN, mew=1.5, zorder=4)
            ax.plot(*at, "o" if V[2] @ j.axis > 0 else "x", ms=4, color=GREEN, zorder=4)
        else:
            ax.plot(*np.array([at - step, at + step]).T, color=GREEN, lw=1.4, ls=(0, (5, 2)), zorder=4)
        ends.append(at - [0.0, abs(step[1]) + 0.12 * grasp.size])
    return np.array(ends).reshape(-1, 2)


def joint_key(grasp: Grasp) -> list[str]:
    """What stands for names of joints: nothing for a few, which are written beside their axes, else 'j0 NAME', ..."""
    joints = placed_joints(grasp)
    return [f"j{k} {j.name}" for k, j in enumerate(joints)] if len(joints) > NAMED else []


def _joint_labels(ax: Any, grasp: Grasp, V: Array) -> None:
    """Names of joints, or their numbers of `joint_key`, below the joints; moved down where they would overlap."""
    (x0, x1), y0 = ax.get_xlim(), ax.get_ylim()[0]
    inches = ax.get_position().width * ax.figure.get_size_inches()[0]
    wide, high = (x1 - x0) * 0.058 / inches, (x1 - x0) * 0.15 / inches  # of a letter, of a line
    joints = placed_joints(grasp)
    put = [(*_number_place(grasp, i, V), wide) for i in range(grasp.m)]  # x, y, half as wide
    texts = [key.split()[0] for key in joint_key(grasp)] or [j.name for j in joints]
    for j, text in sorted(zip(joints, texts, strict=True), key=lambda x: -float(V[1] @ x[0].origin)):
        half = 0.5 * wide * len(text)
        x = min(max(float(V[0] @ j.origin), x0 + half), x1 - half)
        y = float(V[1] @ j.origin) - abs(JOINT * grasp.size * float(V[1] @ j.axis)) - 1.1 * high
        while any(abs(x - a) < half + c and abs(y - b) < high for a, b, c in put) and y > y0:
            y -= 0.25 * high
        y = max(y, y0 + 0.6 * high)
        put.append((x, y, half))
        _label(ax, x, y, text, GREEN, 7.5)


def _label(ax: Any, x: float, y: float, text: str, color: str, size: float, *, bold: bool = False) -> None:
    style: dict[str, Any] = {"color": color, "ha": "center", "va": "center", "path_effects": HALO, "zorder": 9}
    ax.text(x, y, text, fontsize=size, weight="bold" if bold else "normal", **style)


def _frame(ax: Any, middle: Array, half: Array, view: View, length: float) -> None:
    """Limits, no axes, and the object frame's directions in the corner."""
    low, high = windowed(ax, middle, half)
    ax.set_title(view.title, fontsize=9.5, color=INK, pad=2)
    corner = np.array([low[0] + 1.6 * length, high[1] - 1.6 * length])
    for k, name in enumerate("xyz"):
        step = length * view.matrix[:2, k]
        if np.linalg.norm(step) > 0.15 * length:
            ax.annotate(
                "", corner + step, corner, arrowprops=ARROW_STYLE | {"color": GREY, "lw": 1, "mutation_scale": 7}
            )
            ax.text(*(corner + 1.5 * step), name, fontsize=8, color=INK, ha="center", va="center")


def _key(grasp: Grasp, witness: Witness | None) -> list[Any]:
    entries: list[Any] = [
        Line2D([], [], ls="", marker="o", color=INK, ms=5.5, label="contact"),
        Patch(fc=GREEN, alpha=0.2, label="friction cone"),
    ]
    if grasp.l:
        entries.append(Line2D([], [], color=GREEN, lw=1.4, ls=(0, (5, 2)), label="joint axis"))
    if witness is None:
        return [*entries, Line2D([], [], color=INK, lw=2.4, label="contact normal")]
    entries.append(Line2D([], [], color=BLUE, lw=2.4, label="force of the hand"))
    if witness.wrench.any():
        label = "disturbance (two heads: torque)" if witness.wrench[3:].any() else "disturbance"
        entries.append(Line2D([], [], color=AMBER, lw=2.4, label=label))
    entries.append(Line2D([], [], color=VIOLET, lw=1.3, label="virtual motion, not to scale"))
    return entries
