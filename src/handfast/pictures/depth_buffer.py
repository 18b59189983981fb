"""Solids and regions drawn with a depth buffer, as panels of a figure.

Where hand, object and regions touch, painting whole facets from far to near goes wrong.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from handfast.core.arrays import Array
from handfast.model.region import Region
from handfast.pictures.camera import View
from handfast.pictures.drawing import GREY, HALO, INK

REGION_FACETS = 12  # facets along each side of a region
LIFT = 6e-4  # [m] by which a region is drawn above its surface
LIGHT = np.array([0.25, 0.35, 0.9]) / np.linalg.norm([0.25, 0.35, 0.9])
SHADES = 12  # between the darkest and the lightest: few, so that the file stays small
OVERSAMPLING = 2  # pixels drawn for each pixel shown, along each side
PIXELS_PER_INCH = 150  # pixels shown in an inch


@dataclass(frozen=True, eq=False)
class Facets:
    """Triangles (n, 3, 3) [m], wound outwards, of one colour (3,); `solid`: they hide what is behind them."""

    corners: Array
    color: Array
    solid: bool


def region_facets(region: Region, pose: Array, color: str) -> Facets:
    """A region a little above its surface, wound to its outward normal."""
    lower, upper = region.bounds.T
    first, second = np.linspace(lower, upper, REGION_FACETS + 1).T
    u, v = np.meshgrid(first, second, indexing="ij")
    points, normals = region.at(u, v), region.outward(u, v)
    grid, normals = (points + LIFT * normals) @ pose[:3, :3].T + pose[:3, 3], normals @ pose[:3, :3].T
    a, b, c, d = grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]
    corners = np.concatenate([np.stack(t, axis=2).reshape(-1, 3, 3) for t in ((a, b, c), (a, c, d))])
    outward = np.tile(normals[:-1, :-1].reshape(-1, 3), (2, 1))
    wrong = np.einsum("ij,ij->i", _normals(corners), outward) < 0
    corners[wrong] = corners[wrong][:, ::-1]
    return Facets(corners, np.array(to_rgb(color)), False)


def side_by_side(
    panels: Sequence[tuple[Sequence[Facets], View, tuple[Array, Array]]],
    page: tuple[float, float],
    shape: tuple[float, float],
    dense: int = PIXELS_PER_INCH,
) -> tuple[Figure, list[tuple[Axes, View]], float]:
    """A figure with rendered panels in a row on one scale, its axes, and the width of a panel [m].

    Args:
        panels: facets, a view, and the corners (2,) [m] of the window that has to be seen.
        page: [inches] width of the figure, and height of the foot below the panels.
        shape: most and least height of a window over its width.
        dense: pixels in an inch at which the figure is meant to be saved.
    """
    (width, foot), (most, least), count = page, shape, len(panels)
    wide, high = np.max([upper - lower for _, _, (lower, upper) in panels], axis=0)
    wide = max(wide, high / most)
    size = np.array([wide, max(high, least * wide)])
    tall = width / count * size[1] / size[0]
    figure, axes = Figure(figsize=(width, tall + foot), dpi=100), []
    for k, (facets, view, window) in enumerate(panels):
        ax = figure.add_axes((k / count, foot / (tall + foot), 1 / count, tall / (tall + foot)))
        low, high = ((window[0] + window[1]) + s * size for s in (-1, 1))
        low, high = low / 2, high / 2
        image = rendered(
            facets, view, low, high, (round(dense * tall) * OVERSAMPLING, round(dense * width / count) * OVERSAMPLING)
        )
        ax.imshow(thinned(image), extent=(low[0], high[0], low[1], high[1]), interpolation="nearest")
        framed(ax, low, high, view)
        axes.append((ax, view))
    return figure, axes, float(size[0])


def framed(ax: Any, low: Array, high: Array, view: View) -> None:
    """Limits, no axes, a title and a scale."""
    ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
    ax.axis("off")
    style = {"ha": "center", "color": INK, "path_effects": HALO, "zorder": 9}
    ax.text((low[0] + high[0]) / 2, high[1] - 0.015 * (high[1] - low[1]), view.title, va="top", fontsize=9.5, **style)
    x, y = low + 0.04 * (high - low)
    ax.plot([x, x + 0.05], [y, y], color=GREY, lw=2, zorder=9, solid_capstyle="butt", path_effects=HALO)
    ax.text(x + 0.025, y + 0.012 * (high[1] - low[1]), "50 mm", fontsize=8, **style)


def rendered(panel: Sequence[Facets], view: View, low: Array, high: Array, shape: tuple[int, int]) -> Array:
    """(rows, columns, 3) the surfaces that face the viewer, shaded, on white; the first row is the top one.

    `low` and `high` (2,) [m] are the corners of the window in the plane of the picture.
    """
    rows, columns = shape
    image, depth = np.ones((rows, columns, 3)), np.full((rows, columns), -np.inf)
    scale = np.array([columns, rows]) / (high - low)
    for part in panel:
        corners = part.corners @ view.matrix.T
        flat = corners[..., :2]
        inside = ((flat.max(axis=1) > low) & (flat.min(axis=1) < high)).all(axis=1)
        corners = corners[inside & (_normals(corners)[:, 2] > 1e-6)]
        light = np.round(SHADES * np.clip(_normals(corners) @ LIGHT, 0, 1)) / SHADES
        corners[..., :2] = (corners[..., :2] - low) * scale - 0.5  # pixels, their centres at whole numbers
        first = np.maximum(np.ceil(corners[..., :2].min(axis=1)), 0).astype(int)
        last = np.minimum(np.floor(corners[..., :2].max(axis=1)), [columns - 1, rows - 1]).astype(int)
        colors = np.minimum((0.62 + 0.38 * light)[:, None] * part.color, 1.0)
        for k in np.flatnonzero((first <= last).all(axis=1)):  # those with a pixel's centre in the box about them
            _fill(image, depth, corners[k], colors[k], first[k].tolist(), last[k].tolist())
    return image[::-1]


def _fill(image: Array, depth: Array, corner: Array, color: Array, first: list[int], last: list[int]) -> None:
    """Draw a triangle (3, 3), in pixels and depth, where it is nearer than what is there, from a pixel to another."""
    (x0, y0), (x1, y1) = first, last
    (ax, ay, az), (bx, by, bz), (cx, cy, cz) = corner.tolist()
    twice = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
    x, y = np.arange(x0, x1 + 1)[None, :], np.arange(y0, y1 + 1)[:, None]
    b = ((x - ax) * (cy - ay) - (cx - ax) * (y - ay)) / twice
    c = ((bx - ax) * (y - ay) - (x - ax) * (by - ay)) / twice
    z = az + b * (bz - az) + c * (cz - az)
    nearest = depth[y0 : y1 + 1, x0 : x1 + 1]
    seen = (b >= -1e-9) & (c >= -1e-9) & (b + c <= 1 + 1e-9) & (z > nearest)
    nearest[seen] = z[seen]
    image[y0 : y1 + 1, x0 : x1 + 1][seen] = color


def thinned(image: Array) -> Array:
    """Each FINE x FINE pixels as one."""
    rows, columns = (n // OVERSAMPLING for n in image.shape[:2])
    return image.reshape(rows, OVERSAMPLING, columns, OVERSAMPLING, 3).mean(axis=(1, 3))


def _normals(corners: Array) -> Array:
    """(n, 3) unit normals of triangles; zero for slivers."""
    n = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return n / np.maximum(np.linalg.norm(n, axis=1, keepdims=True), 1e-30)
