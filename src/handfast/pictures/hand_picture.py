"""A hand to be seen: its colours and sides, the still picture, and the data of its page.

The page's script poses the links itself (`kinematics3d.js`), so that a slider needs nothing but the page: they are in
their own frames, with the joints that move them, regions, palm and object.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from typing import Any

import numpy as np
from matplotlib.colors import to_hex, to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.model.configuration import Configuration
from handfast.model.hand.coupling import drivers
from handfast.model.hand.hand import Link
from handfast.model.shape import Shape
from handfast.pictures.camera import ALONG, TILT, View, upright
from handfast.pictures.depth_buffer import PIXELS_PER_INCH, Facets, region_facets, side_by_side
from handfast.pictures.drawing import GREEN, GREY, INK, MESH_COLORS
from handfast.pictures.hand_facts import HandFacts, ShownHand
from handfast.pictures.scene import Mesh, coarse
from handfast.pictures.view3d import PART_COLORS, packed

TINTS = (  # of a finger's links, and of its regions
    ("#8fb3dd", "#1f5fb4"),
    ("#e9b27c", "#b85410"),
    ("#96c79f", "#1f7a44"),
    ("#c9addb", "#6f43a8"),
    ("#e0a3a3", "#a82f38"),
    ("#93cccc", "#157a7c"),
)
PALM_COLORS = (to_hex(tuple(MESH_COLORS["hand"])), "#3b444d")
HAND_TRIANGLES, OBJECT_TRIANGLES = 60_000, 40_000  # triangles in a page
MIN_TRIANGLES = 100  # triangles that a solid keeps
MARK_SIZE = 0.3  # of marks, in half diagonals of the hand
STILL_OF_HAND, STILL_OF_OBJECT = 8_000, 6_000  # triangles in a still picture
HAND_FIGURE_WIDTH, HAND_KEY_HEIGHT = 9.0, 0.75  # [inches] of the figure, and of the key below the panels
VIEW_MARGIN = 0.015  # [m] around what is seen
AXIS = 0.06  # half length of a joint axis, in the width of a panel


def draw_hand(shown: ShownHand, dense: int = PIXELS_PER_INCH) -> Figure:
    """The hand at its configuration from the side to which it closes, and from behind; with the object, if any.

    Links have the colour of their finger, regions are darker. Axes of joints that close are green.

    Args:
        dense: pixels in an inch, at which a figure of 9 inches is meant to be saved.
    """
    panel = _solids(shown)
    at_an_angle, _, behind, *_ = hand_sides(shown)
    seen = [(panel, view, _window(panel, view)) for view in (at_an_angle, behind)]
    figure, axes, wide = side_by_side(seen, (HAND_FIGURE_WIDTH, HAND_KEY_HEIGHT), (1.4, 0.6), dense)
    for ax, view in axes:
        _axes(ax, shown, view, AXIS * wide)
    key = _key(shown)
    figure.legend(handles=key, loc="lower center", ncols=min(len(key), 6), frameon=False, fontsize=9)
    return figure


def _solids(shown: ShownHand) -> list[Facets]:
    """Links, regions and the object, base frame."""
    facts, hand = shown.facts, shown.facts.hand
    poses, share = hand.link_poses(shown.q), triangle_share(facts, STILL_OF_HAND)
    found = []
    for i, (link, pose) in enumerate(zip(hand.links, poses, strict=True)):
        color = np.array(to_rgb(tint(facts, facts.finger[i])[0]))
        for mesh in link_meshes(link, share)[0]:
            vertices = mesh.vertices @ pose[:3, :3].T + pose[:3, 3]
            found.append(Facets(vertices[mesh.faces], color, True))
    for r in facts.regions or ():
        found.append(region_facets(r.region, poses[hand.link(r.link)], tint(facts, r.finger)[1]))
    if shown.body is not None:
        vertices, faces, _ = coarse(shown.body.vertices, shown.body.faces, STILL_OF_OBJECT)
        placed = vertices @ shown.pose[:3, :3].T + shown.pose[:3, 3]
        found.append(Facets(placed[faces], MESH_COLORS["object"], True))
    return found


def _window(panel: list[Facets], view: View) -> tuple[Array, Array]:
    """Corners (2,) of what is seen, with room around it."""
    corners = [f.corners.reshape(-1, 3) for f in panel] or [np.zeros((1, 3))]
    flat = np.vstack(corners) @ view.matrix[:2].T
    room = max(VIEW_MARGIN, 0.08 * float(np.ptp(flat, axis=0).max()))
    return flat.min(axis=0) - room, flat.max(axis=0) + room


def _axes(ax: Any, shown: ShownHand, view: View, half: float) -> None:
    """The joints' axes, over everything else."""
    hand = shown.facts.hand
    for axis, origin, closing in zip(*hand.joint_axes(shown.q), hand.closing, strict=True):
        ends = np.array([origin - half * axis, origin + half * axis]) @ view.matrix[:2].T
        ax.plot(*ends.T, color=GREEN if closing else GREY, lw=1.1, alpha=0.85, zorder=7)


def _key(shown: ShownHand) -> list[Any]:
    facts = shown.facts
    entries: list[Any] = [Patch(fc=tint(facts, f)[0], label=f) for f in facts.fingers]
    entries.append(Patch(fc=PALM_COLORS[0], label="palm"))
    if facts.regions is not None:
        entries.append(Patch(fc=INK, label="regions: darker"))
    if shown.body is not None:
        entries.append(Patch(fc=tuple(MESH_COLORS["object"]), label="object"))
    entries.append(Line2D([], [], color=GREEN, lw=1.1, label="axis of a joint that closes"))
    if not np.all(facts.hand.closing):
        entries.append(Line2D([], [], color=GREY, lw=1.1, label="other joint"))
    return entries


# --- of the page ---


def tint(facts: HandFacts, finger: str) -> tuple[str, str]:
    """The colours of a finger's links and of its regions."""
    names = facts.fingers
    return TINTS[names.index(finger) % len(TINTS)] if finger in names else PALM_COLORS


def link_meshes(link: Link, share: float = 1.0) -> tuple[list[Mesh], float]:
    """A link's shapes, link frame, with a share of their triangles; and the size of what is lost by that [m]."""
    found, lost = [], 0.0
    for shape in link.shapes:
        vertices, faces = shape.triangles()
        if share < 1:
            vertices, faces, cell = coarse(vertices, faces, max(MIN_TRIANGLES, int(share * len(faces))))
            lost = max(lost, cell)
            if cell:
                with suppress(InputError):  # so thin that nothing but a plane is left: as it is then
                    vertices, faces = Shape.hull(vertices).triangles()
        found.append(Mesh(vertices, faces, "hand"))
    return found, lost


def triangle_share(facts: HandFacts, most: int) -> float:
    """The share of the hand's triangles that is within `most`."""
    count = sum(len(s.triangles()[1]) for link in facts.hand.links for s in link.shapes)
    return min(1.0, most / max(count, 1))


def hand_scene(shown: ShownHand) -> tuple[dict[str, Any], list[str]]:
    """The page's data as JSON, SI units, and sentences about what is drawn coarser than it is.

    Keys: `links` (`name`, `parent`, `pose`, `joints`, `color`, `solid` in the link frame), `joints`, `loops` (the pins
    that close them) and `dependent` (joints that follow from these), `q`, `opened` and `shut` (the hand at the ends of
    closing), `regions`, `palm`, `object`, `configuration` (a file without its joints), `sides`, `size`, `box`,
    `colors`. A pose is the rows of [R t], 12 numbers.
    """
    facts, hand, palm = shown.facts, shown.facts.hand, shown.facts.palm
    share = triangle_share(facts, HAND_TRIANGLES)
    links, points, lost = [], [np.zeros((1, 3))], 0.0
    for i, (link, pose) in enumerate(zip(hand.links, hand.link_poses(shown.q), strict=True)):
        meshes, cell = link_meshes(link, share)
        lost = max(lost, cell)
        points += [m.vertices @ pose[:3, :3].T + pose[:3, 3] for m in meshes]
        entry = {"name": link.name, "parent": link.parent, "pose": _rows(link.pose), "joints": list(link.joints)}
        solid = packed(meshes) if meshes else None
        links.append(entry | {"color": tint(facts, facts.finger[i])[0], "solid": solid})
    notes = [_coarser("The hand's shapes are", lost)] if lost else []
    if palm:
        points.append(palm.center[None])
    reach = np.vstack(points)
    size = MARK_SIZE * float(np.linalg.norm(np.ptp(reach, axis=0))) / 2
    thing = None
    if shown.body is not None:
        vertices, faces, cell = coarse(shown.body.vertices, shown.body.faces, OBJECT_TRIANGLES)
        thing = {"solid": packed([Mesh(vertices, faces, "object")]), "pose": _rows(shown.pose)}
        notes += [_coarser("The object is", cell)] if cell else []
        reach = np.vstack([reach, vertices @ shown.pose[:3, :3].T + shown.pose[:3, 3]])
    return {
        "links": links,
        "joints": _joints(facts),
        "loops": [
            {"first": p.first, "second": p.second, "on_first": _exact(p.on_first), "on_second": _exact(p.on_second)}
            for p in hand.loops
        ],
        "dependent": list(hand.dependent),
        "q": _exact(shown.q),
        "opened": _exact(palm.opened if palm else shown.q),
        "shut": _exact(palm.closed if palm else shown.q),
        "regions": _regions(facts),
        "palm": palm and {"center": _exact(palm.center), "axis": _exact(palm.axis)},
        "object": thing,
        "configuration": _configuration(shown),
        "sides": [{"title": v.title, "matrix": _exact(v.matrix)} for v in hand_sides(shown)],
        "size": size or 0.01,
        "box": [_exact(reach.min(axis=0)), _exact(reach.max(axis=0))],
        "colors": PART_COLORS,
    }, notes


def hand_sides(shown: ShownHand) -> list[View]:
    """Directions to look along: with the palm's approach upwards from the side that closes, from behind, the axes."""
    facts, hand = shown.facts, shown.facts.hand
    up = facts.palm.axis if facts.palm else np.array([0.0, 0.0, 1.0])
    poses = hand.link_poses(shown.q)
    flat = [s.placed(p).centroid for k, p in zip(hand.links, poses, strict=True) for s in k.shapes]
    spread = np.array(flat or np.zeros((1, 3)))
    spread = spread - spread.mean(axis=0)
    right = np.linalg.svd(spread - np.outer(spread @ up, up))[2][0]
    right = right - (right @ up) * up
    if np.linalg.norm(right) < 1e-6:  # all in a line
        right = upright(np.eye(3), up)[0]
    right = right / np.linalg.norm(right)
    normals = [poses[hand.link(r.link)][:3, :3] @ r.middle[1] for r in facts.regions or ()]
    back = np.cross(right, up)
    if sum(float(n @ back) for n in normals) < 0:
        right, back = -right, -back
    front = np.array([right, up, back])
    behind = np.array([-right, up, -back])
    named = [View("palm side, at an angle", TILT @ front), View("palm side", front), View("from behind", TILT @ behind)]
    return [*named, *ALONG.values()]


def _joints(facts: HandFacts) -> list[dict[str, Any]]:
    hand, follow = facts.hand, drivers(facts.hand)
    return [
        {
            "name": j.name,
            "type": j.type,
            "axis": _exact(j.axis),
            "anchor": _exact(j.anchor),
            "lower": j.lower,
            "upper": j.upper,
            "ref": j.ref,
            "closing": int(hand.closing[k]),
            "follows": None if follow[k][0] == k else dict(zip(("driver", "ratio", "offset"), follow[k], strict=True)),
        }
        for k, j in enumerate(hand.joints)
    ]


def _regions(facts: HandFacts) -> list[dict[str, Any]]:
    found = []
    for r in facts.regions or ():
        color = tint(facts, r.finger)[1]
        corners = region_facets(r.region, np.eye(4), color).corners
        mesh = Mesh(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3), "hand")
        where = {"link": facts.hand.link(r.link), "middle": _exact(r.middle[0])}
        found.append({"name": r.name, "color": color, "solid": packed([mesh])} | where)
    return found


def _configuration(shown: ShownHand) -> dict[str, Any]:
    """A `handfast/configuration/1` object; the page puts the joints in."""
    hand = shown.facts.hand
    file = Configuration.of(hand, shown.q, shown.pose, hand=hand.source or None)
    left_out = {"joints"} if shown.body is not None else {"joints", "object_pose"}
    return file.model_dump(by_alias=True, exclude_none=True, mode="json", exclude=left_out)


def _coarser(what: str, cell: float) -> str:
    return f"{what} drawn with fewer triangles: details below {1e3 * cell:.1f} mm are lost in the picture alone."


def _rows(pose: Array) -> list[float]:
    return _exact(pose[:3])


def _exact(a: Array | Sequence[float]) -> list[float]:
    """Numbers to twelve digits: poses are multiplied along a chain."""
    return [float(f"{x:.12g}") + 0.0 for x in np.ravel(a)]
