"""A task drawn: the hand, the object, the regions that are to touch and, for an answer, where they do.

Orthographic, in the palm frame, from the sides from which most of the contacts can be seen. Surfaces are drawn
with a depth buffer: where hand, object and regions touch, painting whole facets from far to near goes wrong.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from handfast.core.arrays import Array
from handfast.pictures.camera import STEEP_PENALTY, View, in_view
from handfast.pictures.depth_buffer import Facets, region_facets, side_by_side
from handfast.pictures.drawing import HALO, INK, MESH_COLORS
from handfast.readers.load_body import load_body
from handfast.synthesis.task import Task

HAND_REGION, OBJECT_REGION = "#1f5fb4", "#d0530c"
AZIMUTH_TEXTS = {
    0: "from the front",
    45: "from the front, thumb's side",
    90: "from the thumb's side",
    135: "from behind, thumb's side",
    180: "from behind",
    225: "from behind, far side",
    270: "from the far side",
    315: "from the front, far side",
}
ELEVATION_TEXTS = {-25: ", from below", 15: "", 50: ", from above"}
REGION_VIEWS = (View.of(28.0, 20.0, "regions on the hand"), View.of(28.0, 30.0, "regions on the object"))
SECOND = 0.8  # cosine between the two directions of view, at most
TASK_FIGURE_WIDTH, TASK_KEY_HEIGHT = 8.0, 0.8  # [inches] of the figure, and of the key below the panels


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


def draw_task(task: Task, solution: Drawable | None = None) -> Figure:
    """The hand on the object from two sides, with the contacts of a solution.

    Without one: the hand in the middle of its joint limits with its regions, and beside it the object with
    those that they are to touch. Objects longer than the hand are cut off at the edge of the picture.

    Raises:
        InputError: the object's file cannot be read.
    """
    if solution is None:
        panels = [_hand(task, task.hand.limits.mean(axis=1)), _object(task, np.eye(4))]
        sides: Sequence[View] = REGION_VIEWS
    else:
        both = _hand(task, np.asarray(solution.q)) + _object(task, np.asarray(solution.pose))
        panels, sides = [both, both], clearest(both, solution)
    seen = [(p, view, _window(p, view, solution)) for p, view in zip(panels, sides, strict=True)]
    figure, axes, wide = side_by_side(seen, (TASK_FIGURE_WIDTH, TASK_KEY_HEIGHT), (1.3, 0.8))
    if solution is not None:
        for ax, view in axes:
            _contacts(ax, solution, view, 0.1 * wide)
    figure.legend(handles=_key(solution), loc="lower center", ncols=5, frameon=False, fontsize=9)
    links = ",  ".join(f"{k}: {t.link}" for k, t in enumerate(task.contact_pairs))
    where: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": 9, "color": INK}
    figure.text(
        0.5,
        (TASK_KEY_HEIGHT - 0.28) / figure.get_size_inches()[1],
        "   ".join(t for t in (task.name, links) if t),
        **where,
    )
    return figure


# --- what there is to see ----------------------------------------------------------------------------


def _hand(task: Task, q: Array) -> list[Facets]:
    """The hand's shapes and regions at q (l,), palm frame."""
    poses = task.hand.link_poses(q)
    found = []
    for link, pose in zip(task.hand.links, poses, strict=True):
        for shape in link.shapes:
            vertices, faces = shape.placed(pose).triangles()
            found.append(Facets(vertices[faces], MESH_COLORS["hand"], True))
    for pair, link_index in zip(task.contact_pairs, task.links, strict=True):
        found.append(region_facets(pair.hand, poses[link_index], HAND_REGION))
    return found


def _object(task: Task, pose: Array) -> list[Facets]:
    """The object, if the task names one, and its regions at a pose (4, 4)."""
    found = []
    if task.object is not None:
        body = load_body(task.object)
        vertices = body.vertices @ pose[:3, :3].T + pose[:3, 3]
        found.append(Facets(vertices[body.faces], MESH_COLORS["object"], True))
    return found + [region_facets(pair.object, pose, OBJECT_REGION) for pair in task.contact_pairs]


# --- from where it is seen -----------------------------------------------------------------------------


def clearest(panel: Sequence[Facets], solution: Drawable) -> tuple[View, View]:
    """The direction from which most contacts can be seen past hand and object, and the next best one far from it."""
    points, normals = np.asarray(solution.points), np.asarray(solution.normals)
    beside = np.concatenate([points - 1e-3 * normals, points + 1e-3 * normals])  # just outside of each surface
    solids = np.concatenate([f.corners for f in panel if f.solid])
    found = []
    for up, said in ELEVATION_TEXTS.items():
        for turn, title in AZIMUTH_TEXTS.items():
            view = View.of(float(turn), float(up), title + said)
            found.append((in_view(view, beside, normals, solids) - STEEP_PENALTY * (up != 15), view))
    found.sort(key=lambda f: -f[0])
    first = found[0][1]
    return first, next(v for _, v in found if v.matrix[2] @ first.matrix[2] <= SECOND)


def _window(panel: Sequence[Facets], view: View, solution: Drawable | None) -> tuple[Array, Array]:
    """Corners (2,) of what has to be seen: the hand and the contacts, or the object about its regions."""
    hand = [f.corners for f in panel if f.color is MESH_COLORS["hand"]]
    seen = [c.reshape(-1, 3) for c in (hand or [f.corners for f in panel if not f.solid])]
    if solution is not None:
        seen.append(np.asarray(solution.points))
    flat = np.vstack(seen) @ view.matrix[:2].T
    low, high = flat.min(axis=0), flat.max(axis=0)
    room = 0.02 if hand else max(0.04, 0.4 * float((high - low).max()))
    return low - room, high + room


def _contacts(ax: Any, solution: Drawable, view: View, length: float) -> None:
    """Points with the hand's normals and numbers, over everything else."""
    text = {"fontsize": 9, "weight": "bold", "ha": "center", "va": "center", "color": INK, "zorder": 9}
    for k, (point, normal) in enumerate(zip(solution.points, solution.normals, strict=True)):
        at, tip = view.matrix[:2] @ point, view.matrix[:2] @ (point + length * np.asarray(normal))
        ax.plot(*np.array([at, tip]).T, color=INK, lw=1.8, zorder=7, path_effects=HALO)
        ax.plot(*at, "o", ms=5.5, color=INK, mec="white", mew=0.9, zorder=8)
        long = float(np.linalg.norm(tip - at))
        beside = at + (0.5 * length * (at - tip) / long if long > 0.3 * length else np.array([0.0, 0.5 * length]))
        ax.text(*beside, str(k), path_effects=HALO, **text)


def _key(solution: Drawable | None) -> list[Any]:
    entries: list[Any] = [
        Patch(fc=MESH_COLORS["hand"], label="hand"),
        Patch(fc=MESH_COLORS["object"], label="object"),
        Patch(fc=HAND_REGION, label="region of the hand"),
        Patch(fc=OBJECT_REGION, label="region of the object"),
    ]
    if solution is not None:
        line: dict[str, Any] = {"color": INK, "lw": 1.8, "marker": "o", "ms": 5}
        entries.append(Line2D([], [], label="contact, normal of the hand", **line))
    return entries
