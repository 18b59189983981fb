"""The picture of a grasp's measures: what chosen forces could balance and what it resists, direction by direction."""

from __future__ import annotations

import io
import textwrap
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.image import imread
from matplotlib.patches import Patch

from handfast.core.arrays import Array
from handfast.measures.catalogue import PASSIVE
from handfast.measures.measuring import MeasuredValue, Measures
from handfast.model.grasp import Grasp
from handfast.pictures import words
from handfast.pictures.camera import views
from handfast.pictures.drawing import AMBER, ARROW_STYLE, BLUE, INK, tidy
from handfast.pictures.grasp_picture import draw_grasp
from handfast.pictures.scene import Mesh
from handfast.pictures.words import num

MIN_BAR = 0.006  # of the axis: a bar of nothing is still to be seen
UNDER: dict[str, Any] = {"fontsize": 8.5, "color": INK, "ha": "center", "va": "bottom"}
OPEN_BAR: dict[str, Any] = {"fc": "#d9d9d9", "hatch": "////", "lw": 0, "zorder": 3}


def draw_measures(found: Measures, meshes: Sequence[Mesh] = ()) -> Figure:
    """A grasp, its measures, and twelve directions as bars.

    Blue: the largest force or torque (divided by the characteristic length) that the grasp resists passively, with
    its commands. Orange: the largest that forces of the stated size at the contacts could balance if somebody chose
    them. Bars that end in an arrow have no end.

    Args:
        found: of `measure`; without passive maxima, or without clarabel, the bars that are missing are left out.
        meshes: hand and object, see `handfast.pictures.scene.scene_meshes`.
    """
    from handfast.pictures.drawing import picture

    figure = Figure(figsize=(11.0, 6.2), dpi=100)
    left = figure.add_axes((0.01, 0.40, 0.37, 0.50))
    if meshes:
        drawn = picture(draw_grasp(found.grasp, None, meshes, count=1), "png", dpi=150)
        left.imshow(imread(io.BytesIO(drawn)))
    else:
        _sketch(left, found.grasp)
    left.axis("off")
    _table(figure, found)
    ax = figure.add_axes((0.50, 0.11, 0.47, 0.79))
    _bars(ax, found)
    figure.text(0.02, 0.955, found.grasp.name, fontsize=13, color=INK, weight="bold")
    about = f"{words.grasp_text(found.grasp)}; preload {words.preload_text(found.grasp)}"
    figure.text(0.02, 0.945, textwrap.fill(about, 72), fontsize=7.8, color=INK, va="top")
    return figure


def _sketch(ax: Any, grasp: Grasp) -> None:
    """The contacts with their normals and numbers."""
    view = views(grasp, 1)[0]
    V = view.matrix[:2]
    p, n = 1e3 * grasp.positions @ V.T, np.array([c.normal for c in grasp.contacts]) @ V.T
    reach = 0.5 * max(float(np.ptp(p, axis=0).max()), 1.0)
    if grasp.m > 2:
        d = p - p.mean(axis=0)
        ax.fill(*p[np.argsort(np.arctan2(d[:, 1], d[:, 0]))].T, color="#f3ead8", zorder=1)
    arrows: dict[str, Any] = {"angles": "xy", "scale_units": "xy", "scale": 1, "width": 0.008}
    ax.quiver(*p.T, *(0.4 * reach * n).T, color=INK, zorder=3, **arrows)
    ax.plot(*p.T, "o", ms=6, color=BLUE, mec="white", zorder=4)
    for i, (at, way) in enumerate(zip(p, n, strict=True)):
        ax.text(*(at - 0.15 * reach * way), str(i), fontsize=9, color=INK, ha="center", va="center")
    middle, half = (p.max(0) + p.min(0)) / 2, np.array([-1.4, 1.4]) * reach
    ax.set(xlim=middle[0] + half, ylim=middle[1] + half, aspect="equal")
    ax.text(0.5, 0.03, f"contacts and normals, {view.title}", transform=ax.transAxes, **UNDER)


def _table(figure: Figure, found: Measures) -> None:
    """The values in two columns."""
    rows = [v for v in found.values if v.measure.key != PASSIVE and v.value is not None]
    half = (len(rows) + 1) // 2
    for k, v in enumerate(rows):
        x, y = (0.02, 0.215)[k // half], 0.375 - 0.033 * (k % half)
        figure.text(x, y, v.measure.name, fontsize=7.8, color=INK)
        figure.text(x + 0.185, y, _text(v), fontsize=7.8, color=INK, ha="right", weight="bold")


def _text(v: MeasuredValue) -> str:
    if isinstance(v.value, bool) or v.value is None:
        return "yes" if v.value else "no"
    return num(v.value, 3)


def _bars(ax: Any, found: Measures) -> None:
    """The twelve directions, forces above torques."""
    names = found.scale.axes()[0]
    series: list[tuple[Array, Array, str, str]] = []
    if found.passive is not None:
        series.append((found.passive.lower, found.passive.upper, BLUE, "resisted passively, with its commands"))
    if found.chosen is not None:
        label = f"balanced by chosen forces of up to {num(found.force_limit)} N"
        series.append((found.chosen, found.chosen, AMBER, label))
    finite = np.concatenate([low[np.isfinite(low)] for low, *_ in series] or [np.ones(1)])
    reach = 1.15 * float(min(finite.max(initial=0.0), 6 * np.median(finite) if len(finite) else 1.0) or 1.0)
    rows = np.arange(len(names)) + 0.6 * (np.arange(len(names)) >= 6)
    height = 0.8 / max(len(series), 1)
    for k, (lower, upper, color, _) in enumerate(series):
        at = rows + (k - (len(series) - 1) / 2) * height
        low, high = np.minimum(lower, reach), np.minimum(upper, reach)
        ax.barh(at, np.maximum(low, MIN_BAR * reach), height * 0.9, color=color, zorder=3)
        ax.barh(at, np.where(upper > 1.02 * lower, high - low, 0.0), height * 0.9, left=low, ec=color, **OPEN_BAR)
        for y, x, x_most in zip(at, lower, upper, strict=True):
            _number(ax, y, (float(x), float(x_most)), reach, color)
    ax.set_yticks(rows, [n.replace("-", "−") for n in names])
    ax.set(xlim=(0, reach), ylim=(rows[-1] + 0.6, -0.6))
    ax.set_xlabel(f"force [N], or torque divided by {num(1e3 * found.scale.length)} mm [N]", color=INK)
    tidy(ax, 8.5)
    keys: list[Any] = [Patch(fc=color, label=label) for _, _, color, label in series]
    if found.passive is not None and (found.passive.upper > 1.02 * found.passive.lower).any():
        keys.append(Patch(ec=BLUE, label="not decided", **OPEN_BAR))
    place: dict[str, Any] = {"loc": "lower left", "bbox_to_anchor": (-0.02, 1.0), "ncols": 2 if len(keys) > 2 else 1}
    ax.legend(handles=keys, frameon=False, fontsize=8.5, **place)


def _number(ax: Any, y: float, bounds: tuple[float, float], reach: float, color: str) -> None:
    """What a bar shows, and an arrow if it goes on beyond the picture."""
    x, most = bounds
    end = min(x, reach)
    if x > reach:
        ax.annotate(
            "",
            (1.035 * reach, y),
            (reach, y),
            annotation_clip=False,
            arrowprops=ARROW_STYLE | {"color": color, "lw": 1.5},
        )
    inside = end > 0.85 * reach
    style: dict[str, Any] = {"ha": "right", "color": "white"} if inside else {"ha": "left", "color": INK}
    text = "any" if np.isinf(x) else num(x, 3)
    if most > 1.02 * x:
        text += " or more"
        style |= {} if inside else {"bbox": {"fc": "white", "ec": "none", "pad": 0.6}}
    ax.text(end + (-0.01 if inside else 0.012) * reach, y, text, va="center", fontsize=7, zorder=4, **style)
