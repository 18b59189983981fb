"""A task drawn: the hand, the object, the regions that are to touch and, for an answer, where they do.

Orthographic, in the palm frame, from the sides from which most of the contacts can be seen. Surfaces are drawn
with a depth buffer: where hand, object and regions touch, painting whole facets from far to near goes wrong.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patheffects import withStroke

from handfast.core.arrays import Array
from handfast.model.region import Region
from handfast.pictures.camera import LEVEL, View, in_view
from handfast.pictures.drawing import GREY, INK, SOLID
from handfast.readers.load_body import load_body
from handfast.synthesis.task import Task

HAND_REGION, OBJECT_REGION = "#1f5fb4", "#d0530c"
AROUND = {
    0: "from the front",
    45: "from the front, thumb's side",
    90: "from the thumb's side",
    135: "from behind, thumb's side",
    180: "from behind",
    225: "from behind, far side",
    270: "from the far side",
    315: "from the front, far side",
}
ABOVE = {-25: ", from below", 15: "", 50: ", from above"}
APART = (View.of(28.0, 20.0, "regions on the hand"), View.of(28.0, 30.0, "regions on the object"))
SECOND = 0.8  # cosine between the two directions of view, at most
GRID = 12  # facets along each side of a region
LIFT = 6e-4  # [m] by which a region is drawn above its surface
LIGHT = np.array([0.25, 0.35, 0.9]) / np.linalg.norm([0.25, 0.35, 0.9])
SHADES = 12  # between the darkest and the lightest: few, so that the file stays small
FINE = 2  # pixels drawn for each pixel shown, along each side
DENSE = 150  # pixels shown in an inch
WIDTH, FOOT = 8.0, 0.8  # [inches] of the figure, and of the key below the panels


class Drawable(Protocol):
    """An answer.

    Attributes:
        q: (l,) every joint.
        pose: (4, 4) of the object in the palm frame.
        points: (b, 3) [m] contacts, palm frame.
        normals: (b, 3) the hand's outward unit normals there, palm frame.
    """

    @property
    def q(self) -> Array: ...
    @property
    def pose(self) -> Array: ...
    @property
    def points(self) -> Array: ...
    @property
    def normals(self) -> Array: ...


@dataclass(frozen=True, eq=False)
class Facets:
    """Triangles (n, 3, 3) [m], wound outwards, of one colour (3,); `solid`: they hide what is behind them."""

    corners: Array
    color: Array
    solid: bool


def draw_task(task: Task, solution: Drawable | None = None) -> Figure:
    """The hand on the object from two sides, with the contacts of a solution.

    Without one: the hand in the middle of its joint limits with its regions, and beside it the object with
    those that they are to touch. Objects longer than the hand are cut off at the edge of the picture.

    Raises:
        InputError: the object's file cannot be read.
    """
    if solution is None:
        panels = [_hand(task, task.hand.limits.mean(axis=1)), _object(task, np.eye(4))]
        sides: Sequence[View] = APART
    else:
        both = _hand(task, np.asarray(solution.q)) + _object(task, np.asarray(solution.pose))
        panels, sides = [both, both], clearest(both, solution)
    windows = [_window(panel, view, solution) for panel, view in zip(panels, sides, strict=True)]
    wide, high = np.max([upper - lower for lower, upper in windows], axis=0)
    wide = max(wide, high / 1.3)
    size = np.array([wide, max(high, 0.8 * wide)])
    tall = WIDTH / 2 * size[1] / size[0]
    total = tall + FOOT
    figure = Figure(figsize=(WIDTH, total), dpi=100)
    for k, (panel, view, window) in enumerate(zip(panels, sides, windows, strict=True)):
        ax = figure.add_axes((k / 2, FOOT / total, 0.5, tall / total))
        middle = (window[0] + window[1]) / 2
        low, high = middle - size / 2, middle + size / 2
        pixels = (round(DENSE * tall) * FINE, round(DENSE * WIDTH / 2) * FINE)
        image = rendered(panel, view, low, high, pixels)
        ax.imshow(thinned(image), extent=(low[0], high[0], low[1], high[1]), interpolation="nearest")
        if solution is not None:
            _contacts(ax, solution, view, 0.1 * size[0])
        framed(ax, low, high, view)
    figure.legend(handles=_key(solution), loc="lower center", ncols=5, frameon=False, fontsize=9)
    links = ",  ".join(f"{k}: {t.link}" for k, t in enumerate(task.contact_pairs))
    where: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": 9, "color": INK}
    figure.text(0.5, (FOOT - 0.28) / total, "   ".join(t for t in (task.name, links) if t), **where)
    return figure


# --- what there is to see ----------------------------------------------------------------------------


def _hand(task: Task, q: Array) -> list[Facets]:
    """The hand's shapes and regions at q (l,), palm frame."""
    poses = task.hand.link_poses(q)
    found = []
    for link, pose in zip(task.hand.links, poses, strict=True):
        for shape in link.shapes:
            vertices, faces = shape.placed(pose).triangles()
            found.append(Facets(vertices[faces], SOLID["hand"], True))
    for pair, link_index in zip(task.contact_pairs, task.links, strict=True):
        found.append(region_facets(pair.hand, poses[link_index], HAND_REGION))
    return found


def _object(task: Task, pose: Array) -> list[Facets]:
    """The object, if the task names one, and its regions at a pose (4, 4)."""
    found = []
    if task.object is not None:
        body = load_body(task.object)
        vertices = body.vertices @ pose[:3, :3].T + pose[:3, 3]
        found.append(Facets(vertices[body.faces], SOLID["object"], True))
    return found + [region_facets(pair.object, pose, OBJECT_REGION) for pair in task.contact_pairs]


def region_facets(region: Region, pose: Array, color: str) -> Facets:
    """A region a little above its surface, wound to its outward normal."""
    lower, upper = region.bounds.T
    first, second = np.linspace(lower, upper, GRID + 1).T
    u, v = np.meshgrid(first, second, indexing="ij")
    points, normals = region.at(u, v), region.outward(u, v)
    grid, normals = (points + LIFT * normals) @ pose[:3, :3].T + pose[:3, 3], normals @ pose[:3, :3].T
    a, b, c, d = grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]
    corners = np.concatenate([np.stack(t, axis=2).reshape(-1, 3, 3) for t in ((a, b, c), (a, c, d))])
    outward = np.tile(normals[:-1, :-1].reshape(-1, 3), (2, 1))
    wrong = np.einsum("ij,ij->i", _normals(corners), outward) < 0
    corners[wrong] = corners[wrong][:, ::-1]
    return Facets(corners, np.array(to_rgb(color)), False)


# --- from where it is seen -----------------------------------------------------------------------------


def clearest(panel: Sequence[Facets], solution: Drawable) -> tuple[View, View]:
    """The direction from which most contacts can be seen past hand and object, and the next best one far from it."""
    points, normals = np.asarray(solution.points), np.asarray(solution.normals)
    beside = np.concatenate([points - 1e-3 * normals, points + 1e-3 * normals])  # just outside of each surface
    solids = np.concatenate([f.corners for f in panel if f.solid])
    found = []
    for up, said in ABOVE.items():
        for turn, title in AROUND.items():
            view = View.of(float(turn), float(up), title + said)
            found.append((in_view(view, beside, normals, solids) - LEVEL * (up != 15), view))
    found.sort(key=lambda f: -f[0])
    first = found[0][1]
    return first, next(v for _, v in found if v.matrix[2] @ first.matrix[2] <= SECOND)


def _window(panel: Sequence[Facets], view: View, solution: Drawable | None) -> tuple[Array, Array]:
    """Corners (2,) of what has to be seen: the hand and the contacts, or the object about its regions."""
    hand = [f.corners for f in panel if f.color is SOLID["hand"]]
    seen = [c.reshape(-1, 3) for c in (hand or [f.corners for f in panel if not f.solid])]
    if solution is not None:
        seen.append(np.asarray(solution.points))
    flat = np.vstack(seen) @ view.matrix[:2].T
    low, high = flat.min(axis=0), flat.max(axis=0)
    room = 0.02 if hand else max(0.04, 0.4 * float((high - low).max()))
    return low - room, high + room


# --- the picture ---------------------------------------------------------------------------------------


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
        for corner, bright in zip(corners, 0.62 + 0.38 * light, strict=True):
            _fill(image, depth, corner, np.minimum(bright * part.color, 1.0))
    return image[::-1]


def _fill(image: Array, depth: Array, corner: Array, color: Array) -> None:
    """Draw a triangle (3, 3), in pixels and depth, where it is nearer than what is there."""
    (x0, y0), (x1, y1) = np.ceil(corner[:, :2].min(axis=0)), np.floor(corner[:, :2].max(axis=0))
    x0, y0 = max(int(x0), 0), max(int(y0), 0)
    x1, y1 = min(int(x1), image.shape[1] - 1), min(int(y1), image.shape[0] - 1)
    if x0 > x1 or y0 > y1:
        return
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
    rows, columns = (n // FINE for n in image.shape[:2])
    return image.reshape(rows, FINE, columns, FINE, 3).mean(axis=(1, 3))


def _normals(corners: Array) -> Array:
    """(n, 3) unit normals of triangles; zero for slivers."""
    n = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return n / np.maximum(np.linalg.norm(n, axis=1, keepdims=True), 1e-30)


def _contacts(ax: Any, solution: Drawable, view: View, length: float) -> None:
    """Points with the hand's normals and numbers, over everything else."""
    halo = [withStroke(linewidth=2.5, foreground="white")]
    text = {"fontsize": 9, "weight": "bold", "ha": "center", "va": "center", "color": INK, "zorder": 9}
    for k, (point, normal) in enumerate(zip(solution.points, solution.normals, strict=True)):
        at, tip = view.matrix[:2] @ point, view.matrix[:2] @ (point + length * np.asarray(normal))
        ax.plot(*np.array([at, tip]).T, color=INK, lw=1.8, zorder=7, path_effects=halo)
        ax.plot(*at, "o", ms=5.5, color=INK, mec="white", mew=0.9, zorder=8)
        long = float(np.linalg.norm(tip - at))
        beside = at + (0.5 * length * (at - tip) / long if long > 0.3 * length else np.array([0.0, 0.5 * length]))
        ax.text(*beside, str(k), path_effects=halo, **text)


def framed(ax: Any, low: Array, high: Array, view: View) -> None:
    """Limits, no axes, a title and a scale."""
    ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
    ax.axis("off")
    halo = [withStroke(linewidth=2.5, foreground="white")]
    style = {"ha": "center", "color": INK, "path_effects": halo, "zorder": 9}
    ax.text((low[0] + high[0]) / 2, high[1] - 0.015 * (high[1] - low[1]), view.title, va="top", fontsize=9.5, **style)
    x, y = low + 0.04 * (high - low)
    ax.plot([x, x + 0.05], [y, y], color=GREY, lw=2, zorder=9, solid_capstyle="butt", path_effects=halo)
    ax.text(x + 0.025, y + 0.012 * (high[1] - low[1]), "50 mm", fontsize=8, **style)


def _key(solution: Drawable | None) -> list[Any]:
    entries: list[Any] = [
        Patch(fc=SOLID["hand"], label="hand"),
        Patch(fc=SOLID["object"], label="object"),
        Patch(fc=HAND_REGION, label="region of the hand"),
        Patch(fc=OBJECT_REGION, label="region of the object"),
    ]
    if solution is not None:
        line: dict[str, Any] = {"color": INK, "lw": 1.8, "marker": "o", "ms": 5}
        entries.append(Line2D([], [], label="contact, normal of the hand", **line))
    return entries
