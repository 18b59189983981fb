"""The figures of the stability paper, made again on its grasps as they are rebuilt here."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Patch, Polygon
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from handfast.core import bundled
from handfast.core.answer import uninterrupted
from handfast.core.arrays import Array
from handfast.model.configuration import Configuration
from handfast.model.grasp import Grasp
from handfast.papers import algorithm1, stability_tables
from handfast.papers.algorithm1 import RefinementSettings
from handfast.papers.exhibits import MakingOptions
from handfast.papers.friction_relaxation import Discretisation, Edges
from handfast.papers.mixed_integer_solvers import installed
from handfast.pictures.camera import views
from handfast.pictures.drawing import BLUE, GREY, INK, MAROON, solids
from handfast.pictures.grasp_picture import draw_grasp
from handfast.pictures.map_picture import OPEN_STYLE, draw_map, draw_sweep
from handfast.pictures.scene import Mesh, scene_meshes
from handfast.readers.configuration_file import load_configuration
from handfast.readers.grasp_file import load_grasp
from handfast.readers.load_body import load_body
from handfast.readers.load_hand import load_hand
from handfast.stability.problem.grasp_limits import GraspLimits
from handfast.stability.problem.settings import Settings
from handfast.stability.studies.maps import sweep
from handfast.stability.studies.questions import check, force_map

HELD_WRENCH = np.array([0, 2.2, 0, 0, 0, 0])  # Fig. 5: 2.2 N along +y
UNHELD = np.array([0, 1.0, 0, 0, 0, 0])  # section VII-A: 1 N along +y, without preload
MAP_DIRECTIONS = 360  # directions of a map, as in the paper
FIGURE_COMMANDS = 21  # of Fig. 12
FORCE_Z, MOMENT_X = np.eye(6)[[2, 3]]
FIGURE_SECTORS = 2048  # of Fig. 5: sectors of less than a degree
TWELVE_GRASPS = tuple(f"barrett-{name}" for name in stability_tables.TWELVE_OBJECTS)


def placed(name: str) -> tuple[Grasp, list[Mesh]]:
    """A bundled grasp, and its hand and object as meshes."""
    configuration: Configuration = load_configuration(name)
    hand, q = configuration.applied(load_hand(configuration.hand or ""))
    body = load_body(configuration.object or "")
    return load_grasp(name), scene_meshes(hand, q, body, configuration.pose)


def scene(_: MakingOptions, name: str) -> Figure:
    """Figs 1, 7, 9, 11: the bundled hand and object from three sides."""
    grasp, meshes = placed(name)
    return draw_grasp(grasp, None, meshes, count=3)


def fig2(_: MakingOptions) -> Figure:
    """The friction cone, and the pyramid of eight sectors about it with its edges, over one contact plane."""
    edges = Discretisation.full(1).edges()
    angle = np.linspace(0, 2 * np.pi, 100)
    circle = np.vstack([np.cos(angle), np.sin(angle)])
    figure = Figure(figsize=(7.0, 3.6))
    for k, (rim, title) in enumerate(((circle, "exact cone (5)"), (edges.D, "edges D, (9)"))):
        ax: Any = figure.add_subplot(1, 2, k + 1, projection="3d")
        closed = np.column_stack([rim, rim[:, 0]])
        sides = [[(0, 0, 0), (*a, 1), (*b, 1)] for a, b in zip(closed.T[:-1], closed.T[1:], strict=True)]
        ax.add_collection3d(Poly3DCollection(sides, fc=BLUE, alpha=0.25, ec="none" if k == 0 else BLUE, lw=0.6))
        ax.plot(*circle, np.ones(circle.shape[1]), color=INK, lw=1.2)
        if k:
            for d in edges.D.T:
                ax.quiver(0, 0, 1, *d, 0, color=INK, arrow_length_ratio=0.12, lw=1.0)
        ax.set(xlim=(-1, 1), ylim=(-1, 1), zlim=(0, 1))
        ax.set_box_aspect((1, 1, 0.8), zoom=1.1)
        ax.set_title(title, fontsize=10, color=INK)
        ax.set_axis_off()
    return figure


def fig3(_: MakingOptions) -> Figure:
    """Three steps of refinement: where friction may lie while the contact slides in the first quadrant, and at rest."""
    q = 2
    sectors = Discretisation.coarse(q)
    figure = Figure(figsize=(9.0, 3.3))
    for k in range(3):
        ax = figure.add_subplot(1, 3, k + 1)
        _sectors(ax, sectors, f"step {k + 1}")
        active = next(s for s in sectors.sectors if s.start <= 0.08 < s.start + s.width)
        if k < 2:
            sectors = sectors.refined(active)
    return figure


def _sectors(ax: Any, sectors: Discretisation, title: str) -> None:
    """The edges of one contact, the region (15) of sliding friction in each sector, and the exact circle."""
    edges: Edges = sectors.edges()
    for a, b in zip(edges.chain[:-1], edges.chain[1:], strict=True):
        (x, y), lengths = (edges.D[:, a], edges.D[:, b]), (edges.length[a], edges.length[b])
        sliding = np.array([x / lengths[0], x, y, y / lengths[1]])  # e^T beta <= 1 <= f^T beta, mu c_n = 1
        ax.add_patch(Polygon(np.array([np.zeros(2), x, y]), fc=MAROON, alpha=0.15, ec="none"))
        ax.add_patch(Polygon(sliding, fc=MAROON, alpha=0.6, ec="none"))
    for d in edges.D.T:
        ax.plot([0, d[0]], [0, d[1]], color=INK, lw=0.7)
    ax.add_patch(Circle((0, 0), 1.0, fill=False, ec=BLUE, lw=1.3))
    reach = 1.05 * float(np.abs(edges.D).max())
    ax.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal")
    ax.set_axis_off()
    ax.set_title(title, fontsize=10, color=INK)


def fig4(options: MakingOptions) -> Figure:
    """1 N along +y without any preload, if friction need not oppose the motion: held by forces that create energy."""
    grasp, meshes = placed("fig1")
    bare = grasp.with_preload(None)
    answer = uninterrupted(check(bare, UNHELD, mdp=False, settings=Settings(timeout=options.timeout)))
    return draw_grasp(bare, answer.witness, meshes, count=2)


def fig5(options: MakingOptions) -> Figure:
    """Algorithm 1 under 2.2 N along +y: the sectors of each contact at its last step, and the contact forces."""
    grasp, meshes = placed("fig1")
    settings = RefinementSettings(
        options.solver or installed(), FIGURE_SECTORS, timeout=10 * options.timeout, as_printed=True
    )
    answer, steps = algorithm1.check(grasp, HELD_WRENCH, settings=settings)
    figure = draw_grasp(grasp, uninterrupted(answer).witness, meshes, count=3)
    width, height = figure.get_size_inches()
    above, total = 2.2, height + 2.2  # [inches]
    figure.set_size_inches(width, total)
    for ax in figure.axes:
        x, y, w, h = ax.get_position().bounds
        ax.set_position((x, y * height / total, w, h * height / total))
    for i, sectors in enumerate(steps[-1].sectors):
        ax = figure.add_axes((i / grasp.m, 1 - 0.92 * above / total, 1 / grasp.m, 0.75 * above / total))
        _sectors(ax, sectors, f"contact {i}: {len(sectors.sectors)} sectors")
    return figure


def force_maps(options: MakingOptions, name: str, *etas: float) -> Figure:
    """Figs 6, 8, 10: forces in the xy plane, without preload (blue) and with it (maroon), a panel for each eta [°]."""
    asked: dict[str, Any] = {"steps": options.steps or MAP_DIRECTIONS, "settings": Settings(timeout=options.timeout)}
    limits = [GraspLimits(np.radians(eta)) for eta in etas]
    maps = [uninterrupted(force_map(load_grasp(name), "xy", limits=each, **asked)) for each in limits]
    if len(maps) == 1:
        return draw_map(maps[0])
    figure = Figure(figsize=(5.2 * len(maps), 5.2))
    for k, (eta, answer) in enumerate(zip(etas, maps, strict=True)):
        ax = figure.add_subplot(1, len(maps), k + 1)
        draw_map(answer, ax=ax)
        ax.set_title(f"normals off by up to {eta:g}°", loc="left", fontsize=11, color=INK)
    ends: list[Patch] = [Polygon([(0, 0)], fc=BLUE, alpha=0.6), Polygon([(0, 0)], fc=MAROON)]
    words = ["resisted without preload", "added by the preload"]
    if any(patch.get_hatch() == OPEN_STYLE["hatch"] for ax in figure.axes for patch in ax.patches):
        ends, words = [*ends, Patch(**OPEN_STYLE)], [*words, "not decided"]
    figure.legend(ends, words, ncols=3, loc="lower center", frameon=False)
    figure.subplots_adjust(0.07, 0.15, 0.98, 0.93)
    return figure


def fig12(options: MakingOptions) -> Figure:
    """The largest force along z and torque about x over the command of finger 3."""
    commands: Array = np.linspace(0, 0.1, options.steps or FIGURE_COMMANDS)
    settings = Settings(timeout=options.timeout)
    answer = sweep(load_grasp("fig11"), "finger_3_prox", commands, [FORCE_Z, MOMENT_X], settings=settings)
    return draw_sweep(uninterrupted(answer))


def fig13(_: MakingOptions) -> Figure:
    """The twelve bundled grasps of the Barrett hand that stand for the paper's."""
    figure = Figure(figsize=(9.0, 6.4))
    known = bundled.names("grasps")
    for k, name in enumerate(n for n in TWELVE_GRASPS if n in known):
        grasp, meshes = placed(name)
        ax = figure.add_subplot(3, 4, k + 1)
        corners = np.vstack(solids(ax, meshes, views(grasp, 1)[0].matrix))
        low, high = corners[:, :2].min(axis=0), corners[:, :2].max(axis=0)
        middle, half = (low + high) / 2, 0.52 * float((high - low).max())
        ax.set(xlim=middle[0] + np.array([-half, half]), ylim=middle[1] + np.array([-half, half]), aspect="equal")
        ax.set_axis_off()
        ax.set_title(f"{name.removeprefix('barrett-')}, {grasp.m} contacts", fontsize=9, color=GREY)
    figure.subplots_adjust(0.01, 0.01, 0.99, 0.95, 0.02, 0.12)
    return figure
