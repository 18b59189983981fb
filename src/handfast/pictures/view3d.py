"""The report's view in three dimensions: hand, object, contacts, and the forces under a chosen load.

The geometry goes into the page as base64, the rest as JSON; small scripts draw it with plain WebGL.
Nothing is fetched, and where there is no WebGL a sentence points at the pictures.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from importlib import resources
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.colors import to_hex
from scipy.spatial.transform import Rotation

from handfast.pictures.drawing import AMBER, BLUE, GREEN, GREY, INK, SOLID, VIOLET
from handfast.pictures.scene import View, applied, placed_joints, views

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from handfast.core.arrays import Array
    from handfast.model.grasp import Grasp
    from handfast.pictures.scene import Mesh
    from handfast.stability.witness import Witness

BONE = "#c2c8cf"  # fingers as rods, where there are no solids
COLORS = {
    "hand": to_hex(tuple(SOLID["hand"])),
    "object": to_hex(tuple(SOLID["object"])),
    "ink": INK,
    "bone": BONE,
    "cone": GREEN,
    "axes": GREY,
    "force": BLUE,
    "motion": VIOLET,
    "load": AMBER,
}
TILT = Rotation.from_euler("yx", [-25.0, 22.0], degrees=True).as_matrix()  # of the first view, out of the flat one
PROGRAM = (
    "shapes3d.js",
    "stage3d.js",
    "controls3d.js",
    "view3d.js",
)  # one script: each uses the names of those before it
OPACITY = 0.45  # of the object at first; contacts and forces lie inside it
WIDE = 1 << 16  # vertices that two bytes can no longer count
SWITCHES = {  # name: (label, on at first with forces, without)
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


@dataclass(frozen=True, eq=False)
class ShownLoad:
    """One entry of the selector.

    Attributes:
        title: the question.
        said: its answer in a sentence.
        wrench: (6,) the disturbance [N, N m], object frame; None if it is not known.
        witness: the equilibrium under it; None if none was found.
    """

    title: str
    said: str
    wrench: Array | None
    witness: Witness | None


def view(grasp: Grasp, loads: Sequence[ShownLoad] = (), meshes: Sequence[Mesh] = ()) -> str:
    """The figure as HTML, with its switches, its data and its program."""
    data = scene(grasp, loads, meshes)
    text = json.dumps(data, separators=(",", ":")).replace("<", "\\u003c")  # no name can end the script
    folder = resources.files("handfast.pictures") / "browser"
    program = "\n".join((folder / name).read_text("utf-8") for name in PROGRAM)
    return (
        f'<figure class="view3d"><div class="controls">{_controls(loads, data["sides"])}</div>'
        '<div class="stage"><canvas tabindex="0" aria-label="The grasp in three dimensions"></canvas>'
        '<div class="labels"></div></div><p class="said"></p>'
        '<p class="fallback">Here the grasp can be turned and looked at from all sides, in a browser that runs '
        "scripts and has WebGL; the pictures below need neither.</p>"
        f"<figcaption>{_caption(loads)}</figcaption>"
        f'<script type="application/json">{text}</script>'
        f"<script>(() => {{\n'use strict';\n{program}}})();</script></figure>"
    )


def scene(grasp: Grasp, loads: Sequence[ShownLoad] = (), meshes: Sequence[Mesh] = ()) -> dict[str, Any]:
    """What the figure shows, as JSON: SI units, object frame.

    Keys: `solids` (by kind, see `packed`), `contacts`, `joints`, `fingers` (joint to joint to contact, where
    there are no solids), `loads` (`title`, `said`, `wrench`, `drawn`: where and as what, `forces`, `motions`),
    `sides` to look from, `size` of the grasp, `box` around all that is to be seen, `colors`.
    """
    kinds = [k for k in ("hand", "object") if any(m.kind == k for m in meshes)]
    solids = {k: packed([m for m in meshes if m.kind == k]) for k in kinds}
    points = [m.vertices for m in meshes] or [np.array([j.origin for j in grasp.joints]).reshape(-1, 3)]
    p = np.vstack([*points, *([c.position, c.position + 0.5 * grasp.size * c.normal] for c in grasp.contacts)])
    flat, _, *others = views(grasp, 4)
    pulls = next((x.wrench[:3] for x in loads if x.wrench is not None and np.any(x.wrench[:3])), None)
    standing = [] if pulls is None else [View("first load pulls down", TILT @ upright(flat.matrix, -pulls))]
    sides = (*standing, View("at an angle", TILT @ flat.matrix), flat, *others)
    return {
        "solids": solids,
        "contacts": [
            {"position": _short(c.position), "normal": _short(c.normal), "friction": c.friction, "link": c.link}
            for c in grasp.contacts
        ],
        "joints": [{"name": j.name, "origin": _short(j.origin), "axis": _short(j.axis)} for j in placed_joints(grasp)],
        "fingers": [] if "hand" in solids else _fingers(grasp),
        "loads": [_load(load, grasp) for load in loads],
        "sides": [{"title": v.title, "matrix": _short(v.matrix)} for v in sides],
        "size": grasp.size,
        "box": [_short(p.min(axis=0)), _short(p.max(axis=0))],
        "colors": COLORS,
    }


def upright(matrix: Array, up: Array) -> Array:
    """(3, 3) rows right, up, towards the viewer: the view nearest to another in which `up` (3,) points up."""
    up = up / np.linalg.norm(up)
    back = max((b - (b @ up) * up for b in (matrix[2], matrix[1], matrix[0])), key=lambda b: round(float(b @ b), 3))
    back /= np.linalg.norm(back)
    return np.array([np.cross(up, back), up, back])


def packed(meshes: Sequence[Mesh]) -> dict[str, Any]:
    """Triangle meshes as one, equal vertices merged: base64 of little-endian numbers.

    Keys: `vertices` float32 (n, 3) [m]; `faces` uint16 (k, 3), or uint32 if `wide`.
    """
    starts = np.cumsum([0] + [len(m.vertices) for m in meshes])
    vertices = np.vstack([m.vertices for m in meshes]).astype("<f4") + np.float32(0)  # no -0
    faces = np.vstack([np.asarray(m.faces) + start for m, start in zip(meshes, starts, strict=False)])
    unique, inverse = np.unique(vertices, axis=0, return_inverse=True)
    wide = len(unique) >= WIDE
    faces = inverse.reshape(-1)[faces].astype("<u4" if wide else "<u2")
    return {"vertices": _base64(unique), "faces": _base64(faces), "wide": wide}


def _load(load: ShownLoad, grasp: Grasp) -> dict[str, Any]:
    w, drawn = load.witness, None
    if load.wrench is not None:
        center = grasp.positions.mean(axis=0)
        at, about = applied(load.wrench, center, 2 * grasp.size)
        drawn = {"at": _short(at), "wrench": _short(about)}
    return {
        "title": load.title,
        "said": load.said,
        "wrench": None if load.wrench is None else _short(load.wrench),
        "drawn": drawn,
        "forces": None if w is None else [_short(f) for f in w.forces],
        "motions": None if w is None else [_short(d) for d in w.motions],
    }


def _fingers(grasp: Grasp) -> list[list[list[float]]]:
    """Per contact the points from joint to joint to it, in the order in which they move each other."""
    lines = []
    for i, c in enumerate(grasp.contacts):
        chain = [j for j in grasp.joints if i in j.moves]
        chain.sort(key=lambda j: (-len(j.moves), -float(np.linalg.norm(j.origin - c.position))))
        lines.append([_short(p) for p in (*(j.origin for j in chain), c.position)])
    return lines


def _controls(loads: Sequence[ShownLoad], sides: Sequence[dict[str, Any]]) -> str:
    def select(name: str, label: str, options: Sequence[str], chosen: int, *, hidden: bool = False) -> str:
        rows = "".join(
            f'<option value="{i}"{" selected" if i == chosen else ""}>{escape(o)}</option>'
            for i, o in enumerate(options)
        )
        style = " hidden" if hidden else ""
        return f'<label{style}>{label} <select name="{name}" autocomplete="off">{rows}</select></label>'

    forces = any(load.witness for load in loads)
    first = next((i for i, load in enumerate(loads) if load.witness), 0)
    parts = [
        select("load", "load", [load.title for load in loads], first, hidden=len(loads) < 2),
        select("side", "", [side["title"] for side in sides], 0),
        f'<label>object <input type="range" name="opacity" min="0" max="1" step="0.05" value="{OPACITY}" '
        'autocomplete="off"></label>',
    ]
    for name, (label, with_forces, without) in SWITCHES.items():
        on = " checked" if (with_forces if forces else without) else ""
        parts.append(f'<label><input type="checkbox" name="{name}"{on} autocomplete="off">{label}</label>')
    return "".join([*parts, '<button type="button" name="reset">reset</button>'])


def _caption(loads: Sequence[ShownLoad]) -> str:
    key = [("force", "force of the hand on the object"), ("load", "disturbance (two heads: moment)")]
    entries = [*(key if loads else []), ("cone", "friction cone, joint axis"), ("ink", "contact, normal")]
    marks = "".join(f'<span class="mark" style="background:{COLORS[name]}"></span>{text} ' for name, text in entries)
    return (
        f"{marks}<br>Drag to turn, with Shift (or two fingers) to shift; click and scroll, or pinch, to zoom; "
        "double-click to begin again."
    )


def _short(a: Array) -> list[float]:
    """Numbers to seven digits, which is what the drawing has."""
    return [float(f"{x:.7g}") + 0.0 for x in np.ravel(a)]


def _base64(a: NDArray[Any]) -> str:
    return base64.b64encode(np.ascontiguousarray(a).tobytes()).decode("ascii")
