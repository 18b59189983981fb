"""The report's view in three dimensions: hand, object, contacts, and the forces under a chosen load.

The geometry goes into the page as base64, the rest as JSON; small scripts draw it with plain WebGL.
Nothing is fetched, and where there is no WebGL a sentence points at the pictures.
"""

from __future__ import annotations

import base64
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.colors import to_hex
from numpy.typing import NDArray

from handfast.core.arrays import Array
from handfast.model.grasp import Grasp
from handfast.pictures import page_parts
from handfast.pictures.camera import ALONG, TILT, View, around, clearest, upright, views
from handfast.pictures.drawing import AMBER, BLUE, GREEN, GREY, INK, MESH_COLORS, VIOLET
from handfast.pictures.scene import DrawnScene, Mesh, ShownLoad, arrows, coarse, finger_lines, placed_joints, triangles

ROD_COLOR = "#c2c8cf"  # fingers as rods, where there are no solids
PART_COLORS = {
    "hand": to_hex(tuple(MESH_COLORS["hand"])),
    "object": to_hex(tuple(MESH_COLORS["object"])),
    "ink": INK,
    "bone": ROD_COLOR,
    "cone": GREEN,
    "axes": GREY,
    "force": BLUE,
    "motion": VIOLET,
    "load": AMBER,
}
VIEW_SCRIPTS = ("shapes3d.js", "stage3d.js", "controls3d.js", "view3d.js")
SHADOW = 300  # triangles of a shape that may hide contacts from view
SHORT_INDICES = 1 << 16  # vertices that two bytes can no longer count
VIEW_SWITCHES = {  # name: (label, on at first with forces, without)
    "hand": ("hand", True, True),
    "cones": ("friction cones", True, True),
    "normals": ("normals", False, True),
    "forces": ("forces", True, True),
    "disturbance": ("disturbance", True, True),
    "motions": ("virtual motions", False, False),
    "joints": ("joint axes", True, True),
    "axes": ("object frame", True, True),
    "numbers": ("numbers", True, True),
    "names": ("names", False, False),
    "perspective": ("perspective", True, True),
}
OF_LOADS = ("forces", "disturbance", "motions")  # switches that show nothing where nothing was asked


def view(shown: DrawnScene) -> str:
    """The figure as HTML, with its switches, its data and its program."""
    instead = "Here the grasp can be turned and looked at from all sides"
    caption = f"<figcaption>{_caption(any(g.loads for g in shown.grasps))}</figcaption>"
    return page_parts.view3d(scene_json(shown), VIEW_SCRIPTS, (_controls(shown), "", instead, caption))


def scene_json(shown: DrawnScene) -> dict[str, Any]:
    """What the figure shows, as JSON: SI units, object frame.

    Keys: `solids` (`kind`, `frame`: the link's place in `poses`, or null, `solid`: see `packed`), `grasps`, `size`,
    `box` around all that is to be seen, `colors`. Of a grasp: `title`, `said`, `box`, `contacts`, `joints`, `fingers`
    (joint to joint to contact, where there are no solids), `poses` of links (rows of [R t]), `loads` (`title`,
    `said`, `wrench`, `arrows`), `sides` to look from.
    """
    groups: dict[tuple[str, int | None], list[Mesh]] = {}
    for m in shown.meshes:
        groups.setdefault((m.kind, m.link), []).append(m)
    solids = [{"kind": kind, "frame": link, "solid": packed(ms)} for (kind, link), ms in groups.items()]
    known = any(m.kind == "hand" for m in shown.meshes)
    grasps = [_grasp(shown, k, with_fingers=not known) for k in range(len(shown.grasps))]
    corners = np.array([g["box"] for g in grasps])
    return {
        "solids": solids,
        "grasps": grasps,
        "size": shown.grasps[0].grasp.size,
        "box": [_short(corners[:, 0].min(axis=0)), _short(corners[:, 1].max(axis=0))],
        "colors": PART_COLORS,
    }


def _grasp(shown: DrawnScene, k: int, *, with_fingers: bool) -> dict[str, Any]:
    g = shown.grasps[k]
    grasp = g.grasp
    points = [m.vertices for m in shown.meshes_of(k)] or [np.array([j.origin for j in grasp.joints])]
    points += [np.array([c.position, c.position + 0.5 * grasp.size * c.normal]) for c in grasp.contacts]
    p = np.vstack([x.reshape(-1, 3) for x in points])
    return {
        "box": [_short(p.min(axis=0)), _short(p.max(axis=0))],
        "title": g.title,
        "said": g.said,
        "contacts": [
            {"position": _short(c.position), "normal": _short(c.normal), "friction": c.friction, "link": c.link}
            for c in grasp.contacts
        ],
        "joints": [{"name": j.name, "origin": _short(j.origin), "axis": _short(j.axis)} for j in placed_joints(grasp)],
        "fingers": [[_short(p) for p in line] for line in finger_lines(grasp)] if with_fingers else [],
        "poses": [_short(T[:3]) for T in g.poses],
        "loads": [_load(load, grasp) for load in g.loads],
        "sides": [{"title": v.title, "matrix": _short(v.matrix)} for v in sides(shown, k)],
    }


def sides(shown: DrawnScene, k: int) -> list[View]:
    """Where a grasp is looked at from: first where most of its contacts can be seen, the first load pulling down."""
    grasp = shown.grasps[k].grasp
    loads = (x.wrench[:3] for x in shown.grasps[k].loads if x.wrench is not None)
    pull = next((w for w in loads if np.any(w)), None)
    up = np.array([0.0, 0.0, 1.0]) if pull is None else -pull
    hand = [Mesh(*coarse(m.vertices, m.faces, SHADOW)[:2], m.kind) for m in shown.meshes_of(k) if m.kind == "hand"]
    first = View("contacts in view", clearest(around(up), grasp, triangles(hand)).matrix)
    flat = views(grasp, 1)[0].matrix
    standing = View("first load pulls down", TILT @ upright(flat, up))
    tilted = View("at an angle", TILT @ flat)
    return [first, tilted if pull is None else standing, *ALONG.values()]


def packed(meshes: Sequence[Mesh]) -> dict[str, Any]:
    """Triangle meshes as one, equal vertices merged: base64 of little-endian numbers.

    Keys: `vertices` float32 (n, 3) [m]; `faces` uint16 (k, 3), or uint32 if `wide`.
    """
    starts = np.cumsum([0] + [len(m.vertices) for m in meshes])
    vertices = np.vstack([m.vertices for m in meshes]).astype("<f4") + np.float32(0)  # no -0
    faces = np.vstack([np.asarray(m.faces) + start for m, start in zip(meshes, starts, strict=False)])
    unique, inverse = np.unique(vertices, axis=0, return_inverse=True)
    wide = len(unique) >= SHORT_INDICES
    faces = inverse.reshape(-1)[faces].astype("<u4" if wide else "<u2")
    return {"vertices": _base64(unique), "faces": _base64(faces), "wide": wide}


def _load(load: ShownLoad, grasp: Grasp) -> dict[str, Any]:
    drawn = arrows(grasp, load.wrench, load.witness)
    return {
        "title": load.title,
        "said": load.said,
        "wrench": None if load.wrench is None else _short(load.wrench),
        "arrows": [{"kind": a.kind, "at": _short(a.at), "step": _short(a.step), "heads": a.heads} for a in drawn],
    }


def _controls(shown: DrawnScene) -> str:
    loads = shown.grasps[0].loads
    forces = any(load.witness for load in loads)
    first = next((i for i, load in enumerate(loads) if load.witness), 0)
    boxes = {
        name: (label, with_forces if forces else without)
        for name, (label, with_forces, without) in VIEW_SWITCHES.items()
    }
    return (
        page_parts.select("grasp", "grasp", [g.title for g in shown.grasps], steps=True)
        + page_parts.select("load", "load", [load.title for load in loads], first, steps=True)
        + page_parts.select("side", "", [v.title for v in sides(shown, 0)])
        + page_parts.switches(boxes, thing=True, hidden=() if loads else OF_LOADS)
    )


def _caption(loaded: bool) -> str:
    key = [("force", "force of the hand on the object"), ("load", "disturbance (two heads: torque)")]
    entries = [*(key if loaded else []), ("cone", "friction cone, joint axis")]
    marks = "".join(page_parts.mark(PART_COLORS[name], text) for name, text in entries)
    marks += page_parts.mark("var(--ink)", "contact, normal")
    return f"{marks}<br>{page_parts.TURNING}"


def _short(a: Array) -> list[float]:
    """Numbers to seven digits, which is what the drawing has."""
    return [float(f"{x:.7g}") + 0.0 for x in np.ravel(a)]


def _base64(a: NDArray[Any]) -> str:
    return base64.b64encode(np.ascontiguousarray(a).tobytes()).decode("ascii")
