"""Maps of the forces that a grasp resists, and sweeps over a command: stability paper, Figs 6, 8, 10 and 12."""

from __future__ import annotations

import textwrap
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Arc, Patch, Polygon, Wedge

from handfast.core.arrays import Array
from handfast.core.errors import kinds_checked
from handfast.pictures import sentences, words
from handfast.pictures.drawing import AMBER, BLUE, DPI, GREY, INK, MAROON, tidy
from handfast.pictures.words import num
from handfast.stability.studies.maps import Curve, MapAnswer, SweepAnswer

FILL = {BLUE: "#6c9fd6", MAROON: MAROON}  # far apart in lightness too, for print and colour-blind eyes
WEAK_COLOR = "#d0021b"
ARC_STYLES = {
    "enough": (INK, 1.2, "-"),
    "weak": (WEAK_COLOR, 4.5, "-"),
    "open": (AMBER, 3.0, ":"),
}  # arcs of the weight's circle
HOLE: dict[str, Any] = {"fc": "#ffffff", "ec": WEAK_COLOR, "hatch": "xxxx", "lw": 0.0}
OPEN_STYLE: dict[str, Any] = {"fc": "#bdbdbd", "ec": "#5c5c5c", "hatch": "////", "lw": 0.0}  # what is not decided
DOTTED_DIRECTIONS = 72  # directions; up to here each one is marked by a dot


# --- maps ---------------------------------------------------------------------------------------


@kinds_checked
def draw_map(
    answer: MapAnswer, *, limit: float | None = None, weight: float | None = None, ax: Axes | None = None
) -> Figure:
    """The resisted forces in a plane as a region: stability paper, Figs 6, 8 and 10.

    Blue is resisted with every actuator locked, maroon is what the preload adds. The radius in a
    direction is the largest resisted force; a direction in which every force is resisted reaches the
    edge. Smaller forces that slip are crossed out, if the map was asked for them. Directions
    that are not decided are hatched from what is known to hold to what may.

    Args:
        limit: half width of the picture [N]; by default chosen from the finite radii.
        weight: of the object [N], drawn as a circle. Where the grasp, with its preload if it has one,
            resists less, the circle is red and thick. A larger maximum does not say that the weight itself
            is held, as smaller forces may slip where larger ones do not: `check` tells.
        ax: axes of the caller's own figure to draw in, without key, facts and the picture of the contacts; their
            figure is returned.
    """
    radius = limit or max(_radius(answer), 1.25 * (weight or 0.0))
    own = ax is None
    if ax is None:
        ax = Figure(figsize=(8.0, 5.4), dpi=DPI).add_axes((0.085, 0.115, 0.575, 0.80))
    i, j = ("xyz".index(a) for a in answer.plane)
    d = answer.directions[:, [i, j]]
    ax.axhline(0, color=GREY, lw=0.8, zorder=1)
    ax.axvline(0, color=GREY, lw=0.8, zorder=1)
    if answer.preloaded is not None:
        _region(ax, d, answer.preloaded, radius, MAROON, 2)
    _region(ax, d, answer.passive, radius, BLUE, 3)
    if answer.preloaded is not None:  # where the preload takes resistance away, its outline shows it
        ax.add_patch(Polygon(_outline(d, answer.preloaded, radius), fill=False, ec=MAROON, lw=1.4, zorder=4))
    holed = sum([_holes(ax, d, curve, radius) for curve in answer.curves])
    open_ones = sum(_undecided(ax, d, curve, radius) for curve in answer.curves)
    if weight:
        _circle(ax, d, answer.curves[-1], weight)
    ax.set(xlim=(-radius, radius), ylim=(-radius, radius), aspect="equal")
    ax.set_xlabel(f"force along {answer.plane[0]} [N]")
    ax.set_ylabel(f"force along {answer.plane[1]} [N]")
    ax.set_title(f"Forces resisted in the {answer.plane} plane", loc="left", fontsize=12, color=INK)
    ax.grid(color="#e4e4e4", lw=0.6, zorder=0)
    tidy(ax)
    figure = ax.get_figure(root=True)
    assert figure is not None
    if own:
        beyond = _beyond(answer, d, radius)
        bottom = _map_key(figure, answer, weight, hatched=open_ones > 0, holed=holed > 0, beyond=beyond)
        _inset(figure, answer, (i, j), min(0.34, bottom - 0.135))
    return figure


def _radius(answer: MapAnswer) -> float:
    """Room around the finite radii, but not for the few that shoot up beside an unbounded direction."""
    finite = np.concatenate([c.lower[np.logical_not(c.unbounded) & (c.lower > 0)] for c in answer.curves])
    return float(min(1.6 * finite.max(), 4 * np.median(finite))) if len(finite) else 1.0


def _outline(d: Array, curve: Curve, radius: float) -> Array:
    """(n, 2) the region's outline; unbounded directions end well outside the picture."""
    r = np.where(curve.unbounded, 4 * radius, np.nan_to_num(np.minimum(curve.lower, 4 * radius)))
    return r[:, None] * d


def _region(ax: Any, d: Array, curve: Curve, radius: float, color: str, order: int) -> None:
    outline = _outline(d, curve, radius)
    ax.add_patch(Polygon(outline, fc=FILL[color], ec=color, lw=0.8, zorder=order))
    if len(d) <= DOTTED_DIRECTIONS:
        inside = (np.abs(outline) <= radius).all(axis=1) & (np.linalg.norm(outline, axis=1) > 0.01 * radius)
        ax.plot(*outline[inside].T, "o", ms=3.2, mfc="white", mec=color, mew=0.9, zorder=order + 3)


def _sectors(d: Array) -> list[tuple[float, float]]:
    """From and to which angle [degrees] the picture shows each direction."""
    half = 180.0 / len(d)
    return [(float(a) - half, float(a) + half) for a in np.degrees(np.arctan2(d[:, 1], d[:, 0]))]


def _undecided(ax: Any, d: Array, curve: Curve, radius: float) -> int:
    """Hatch from what is resisted to what may be; returns how many of these can be seen."""
    seen = 0
    for k, (state, sector) in enumerate(zip(sentences.curve_states(curve), _sectors(d), strict=True)):
        if state != "open":
            continue
        low = float(np.nan_to_num(curve.lower[k]))
        high = float(min(np.nan_to_num(curve.upper[k], nan=np.inf, posinf=np.inf), 4 * radius))
        seen += low < 1.42 * radius
        ax.add_patch(Wedge((0, 0), high, *sector, width=high - low, alpha=0.75, zorder=5, **OPEN_STYLE))
    return seen


def _holes(ax: Any, d: Array, curve: Curve, radius: float) -> int:
    """Hatch the forces that slip though larger ones are resisted; returns how many of these can be seen."""
    seen = 0
    for sector, shown in zip(_sectors(d), curve.intervals, strict=False):
        for first, last in shown.holes if shown else ():
            high = min(last, 4 * radius)
            if first < high:
                seen += first < 1.42 * radius
                ax.add_patch(Wedge((0, 0), high, *sector, width=high - first, zorder=5, **HOLE))
    return seen


def _circle(ax: Any, d: Array, curve: Curve, weight: float) -> None:
    """The object's weight, arc by arc: is as much resisted in that direction?"""
    for (first, last), state in zip(_sectors(d), sentences.weight_states(curve, weight), strict=True):
        color, width, dash = ARC_STYLES[state]
        arc = Arc((0, 0), 2 * weight, 2 * weight, theta1=first, theta2=last)
        arc.set(color=color, lw=width, ls=dash, zorder=8)
        ax.add_patch(arc)


def _beyond(answer: MapAnswer, d: Array, radius: float) -> str:
    """What colour at the edge of the picture stands for; "" if there is none."""
    edge = radius / np.abs(d).max(axis=1)  # [N] along each direction
    unbounded = any(c.unbounded.any() for c in answer.curves)
    cut = any((~c.unbounded & (np.nan_to_num(c.lower) > edge)).any() for c in answer.curves)
    if cut:
        return "Colour to the edge: more than fits is resisted" + ", in some directions any force" * unbounded
    return "Colour to the edge: any force is resisted" if unbounded else ""


def _map_key(
    figure: Figure, answer: MapAnswer, weight: float | None, *, hatched: bool, holed: bool, beyond: str
) -> float:
    """What the colours mean and the facts of the map; returns where they end in the figure."""
    entries: list[Any] = [Patch(fc=FILL[BLUE], label="resisted with no preload")]
    if answer.preloaded is not None:
        entries.append(Patch(fc=MAROON, label="added by the preload"))
    if hatched:
        entries.append(Patch(label="not decided", **OPEN_STYLE))
    if holed:
        entries.append(Patch(label="slips, though more is resisted", **HOLE))
    if len(answer.directions) <= DOTTED_DIRECTIONS:
        few = Line2D([], [], ls="", marker="o", ms=4, mfc="white", mec=INK, label="computed direction")
        entries.append(few)
    if weight:
        labels = {"enough": f"weight of {num(weight)} N", "weak": "less is resisted there"}
        labels["open"] = "weight: not decided"
        held = {"enough", *sentences.weight_states(answer.curves[-1], weight)}
        for state, (color, width, dash) in ARC_STYLES.items():
            if state in held:
                entries.append(Line2D([], [], color=color, lw=width, ls=dash, label=labels[state]))
    place: dict[str, Any] = {"loc": "upper left", "bbox_to_anchor": (0.675, 0.93)}
    figure.legend(handles=entries, frameon=False, fontsize=9.5, **place)
    facts = [f"Preload {words.preload_text(answer.grasp)}", words.grasp_text(answer.grasp)]
    eta = num(float(np.degrees(answer.eta)))
    facts.append(f"Normals off by up to {eta}°" if answer.eta else "Normals taken as exact")
    if answer.terms.along_paths:
        facts.append("First the squeeze, then the load: ends of paths")
    if beyond:
        facts.append(beyond)
    if answer.at.any():
        facts.append(f"Forces act {words.place_text(answer.at)}")
    if weight:
        facts.append(sentences.weight_sentence(answer.curves[-1], weight))
    lines = [line for f in [answer.grasp.name, *facts] for line in textwrap.wrap(f, 38)][:11]
    top = 0.93 - 0.048 * len(entries) - 0.03
    figure.text(0.685, top, "\n".join(lines), va="top", fontsize=8.5, color=INK, linespacing=1.45)
    return top - 0.033 * len(lines)


def _inset(figure: Figure, answer: MapAnswer, axes: tuple[int, int], height: float) -> None:
    """The contacts in the plane with their normals, and where the forces act: which way the picture lies."""
    grasp, plane = answer.grasp, answer.plane
    ax = figure.add_axes((0.735, 0.085, 0.235, height))
    p = 1e3 * grasp.positions[:, axes]
    n = np.array([c.normal for c in grasp.contacts])[:, axes]
    at = 1e3 * answer.at[list(axes)]
    p0 = np.vstack([p, np.zeros((1, 2)), at])
    middle, half = (p0.max(0) + p0.min(0)) / 2, 0.5 * max(float(np.ptp(p0, axis=0).max()), 1.0)
    arrows: dict[str, Any] = {"angles": "xy", "scale_units": "xy", "scale": 1, "width": 0.014}
    ax.quiver(*p.T, *(0.45 * half * n).T, color=INK, zorder=3, **arrows)
    ax.plot(*p.T, "o", ms=5, color=INK, zorder=4)
    ax.plot(0, 0, "+", ms=8, mew=1.4, color=GREY)
    if answer.at.any():
        ax.plot(*at, "x", ms=7, mew=2.0, color=AMBER, zorder=5)
    ax.set(xlim=middle[0] + np.array([-1.35, 1.35]) * half, ylim=middle[1] + np.array([-1.35, 1.35]) * half)
    ax.set_aspect("equal")
    ax.set_xlabel(f"{plane[0]} [mm]", fontsize=8, labelpad=1)
    ax.set_ylabel(f"{plane[1]} [mm]", fontsize=8, labelpad=0)
    ax.tick_params(labelsize=7)
    ax.locator_params(nbins=4)
    title = "contacts; × force" if answer.at.any() else "contacts and normals"
    ax.set_title(title, fontsize=8.5, loc="left", color=INK, pad=4)
    tidy(ax)


# --- sweeps -------------------------------------------------------------------------------------

STYLES = [(BLUE, "-", "o"), (MAROON, "--", "s"), ("#c98a12", "-.", "^"), ("#3f8f6b", ":", "D")]


@kinds_checked
def draw_sweep(answer: SweepAnswer) -> Figure:
    """The largest resisted disturbances over one actuator's command, as in Fig. 12.

    Forces have the left axis, torques the right one. Bounds that have not met are a band.
    """
    figure = Figure(figsize=(8.0, 5.0), dpi=DPI)
    ax = figure.add_axes((0.10, 0.22, 0.79, 0.68))
    units = [words.magnitude(d)[1] for d in answer.directions]
    axes = {unit: ax if k == 0 else ax.twinx() for k, unit in enumerate(dict.fromkeys(units))}
    handles = []
    tops: dict[str, float] = {}
    endless: list[str] = []
    for k, (curve, d) in enumerate(zip(answer.curves, answer.directions, strict=True)):
        color, dash, marker = STYLES[k % len(STYLES)]
        factor, unit = words.magnitude(d)
        low = np.where(curve.unbounded, np.nan, factor * curve.lower)
        known = np.isfinite(curve.upper) & np.logical_not(curve.unbounded)
        high = np.where(known, factor * np.where(known, curve.upper, 0.0), np.nan)
        label = words.direction_text(d)
        style: dict[str, Any] = {"color": color, "ls": dash, "marker": marker, "ms": 4.5, "lw": 1.8}
        axes[unit].fill_between(answer.values, low, high, color=color, alpha=0.25, lw=0)
        handles += axes[unit].plot(answer.values, low, label=f"{label} [{unit}]", **style)
        tops[unit] = max([tops.get(unit, 0.0), *low[np.isfinite(low)], *high[np.isfinite(high)]])
        if curve.unbounded.any():
            endless.append(f"{label}: any size at {np.count_nonzero(curve.unbounded)} of {len(low)} commands")
    for n, (unit, axis) in enumerate(axes.items()):
        mine = [STYLES[k % len(STYLES)][0] for k, u in enumerate(units) if u == unit]
        color = mine[0] if len(mine) == 1 else INK
        kind = {"N": "largest force resisted [N]", "N·m": "largest torque resisted [N·m]"}
        axis.set_ylabel(kind.get(unit, f"largest multiple resisted ({unit})"), color=color)
        axis.set_ylim(0, 1.08 * tops[unit] if tops[unit] > 0 else 1.0)
        tidy(axis)
        axis.tick_params(axis="y", labelcolor=color)
        if n:
            axis.spines["right"].set_visible(True)
            axis.spines["right"].set_color(GREY)
            axis.spines["left"].set_visible(False)
    name = answer.actuator
    ax.set_xlabel(f"command of {name} [{words.actuator_unit(answer.grasp, name)}]")
    ax.set_xlim(float(answer.values.min()), float(answer.values.max()))
    ax.grid(color="#e4e4e4", lw=0.6)
    title = f"{answer.grasp.name}: resistance over the command of {name}"
    ax.set_title("\n".join(textwrap.wrap(title, 76)), loc="left", fontsize=12, color=INK)
    place: dict[str, Any] = {"loc": "lower center", "bbox_to_anchor": (0.5, 0.02)}
    figure.legend(handles=handles, ncols=2, frameon=False, fontsize=9.5, **place)
    if endless:
        ax.text(0.01, 0.98, "\n".join(endless), transform=ax.transAxes, va="top", fontsize=8.5, color=INK)
    return figure
