"""What all still pictures share: colours, shaded solids, and how a figure is saved.

No global state: figures are made without pyplot, and `picture` renders the same bytes every time.
"""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke

from handfast.core.arrays import Array
from handfast.pictures.scene import Mesh

BLUE, MAROON, GREY, INK = "#2f6db3", "#8c1d40", "#9a9a9a", "#2b2b2b"
AMBER, GREEN, VIOLET = "#d98200", "#2c7d4f", "#7a5cc4"
MESH_COLORS = {"object": np.array([0.87, 0.78, 0.62]), "hand": np.array([0.62, 0.67, 0.73])}
MESH_OPACITY = {"object": 0.55, "hand": 0.9}
DPI = 100
ARROW_STYLE: dict[str, Any] = {"arrowstyle": "-|>", "shrinkA": 0, "shrinkB": 0}
HALO = [withStroke(linewidth=2.5, foreground="white")]  # around text over a picture


def picture(figure: Figure, ending: str = "png", *, dpi: int = DPI) -> bytes:
    """The figure as PNG or SVG, the same bytes for the same figure."""
    data = io.BytesIO()
    kept: dict[str, Any] = {"Software": "Handfast"}
    if ending == "svg":
        kept = {"Date": None, "Creator": "Handfast"}
    with rc_context({"svg.hashsalt": "handfast"}):
        figure.savefig(data, format=ending, metadata=kept, dpi=dpi)
    return data.getvalue()


def data_uri(figure: Figure, ending: str = "png", *, dpi: int = DPI) -> str:
    """The figure as the address of an image, for pages that work offline."""
    kind = {"svg": "svg+xml", "png": "png"}[ending]
    return f"data:image/{kind};base64,{base64.b64encode(picture(figure, ending, dpi=dpi)).decode('ascii')}"


def tidy(ax: Any, size: float | None = None) -> None:
    """Axes of a plot: left and below alone, in grey; `size` [points] of the numbers."""
    for side in ("top", "right"):
        ax.spines[side].set_visible(False)
    for side in ("left", "bottom"):
        ax.spines[side].set_color(GREY)
    ax.tick_params(color=GREY, labelcolor=INK, labelsize=size or 10)


def windowed(ax: Any, middle: Array, half: Array | float) -> tuple[Array, Array]:
    """Limits about a middle (2,), one scale, no axes; returns the corners (2,)."""
    low, high = middle - half, middle + half
    ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
    ax.axis("off")
    return low, high


def solids(ax: Any, meshes: Sequence[Mesh], V: Array) -> list[Array]:
    """Triangles, far ones first, shaded by how far they face the viewer; returns the corners of what they cover.

    Args:
        V: (3, 3) rows right, up, towards the viewer.
    """
    corners, colors = [], []
    for mesh in meshes:
        triangles = mesh.vertices[mesh.faces] @ V.T
        normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        length = np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
        light = 0.62 + 0.38 * np.abs(normal / length @ np.array([0.25, 0.35, 0.9]))
        shade = np.clip(light[:, None] * MESH_COLORS[mesh.kind], 0, 1)
        corners.append(triangles)
        colors.append(np.hstack([shade, np.full((len(shade), 1), MESH_OPACITY[mesh.kind])]))
    if not corners:
        return []
    triangles, color = np.vstack(corners), np.vstack(colors)
    order = np.argsort(triangles[:, :, 2].mean(axis=1))
    drawn = PolyCollection(list(triangles[order][:, :, :2]), fc=color[order], ec="none", zorder=1, rasterized=True)
    ax.add_collection(drawn)
    flat = triangles[:, :, :2].reshape(-1, 2)
    return [np.array([flat.min(0), flat.max(0)])]
