"""Make the bundled objects of the contact-region tasks: the scalpel, the teapot and the guitar.

    python docs/make_objects.py [FOLDER]

Writes `<name>.obj` (convex pieces) and `<name>.json` (`handfast/body/1`) to src/handfast/data/objects. What
is curved is described here by Bezier surfaces, so that `make_tasks.py` can place regions exactly on it.
"""

from __future__ import annotations

import json
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from handfast.model.bernstein import evaluate
from handfast.model.shape import Shape

Array = NDArray[np.float64]
OBJECTS = Path(__file__).parents[1] / "src" / "handfast" / "data" / "objects"
MM = 1e-3


# --- the scalpel -----------------------------------------------------------------------------------
# Own design, 160 mm: a flat chamfered handle and a straight-backed blade. Frame: origin in the middle of the
# handle's front part, x to the blade's tip, y to its back (the edge is at -y), z across its flat.
# [mm] half width (y), half thickness (z) and chamfer of the handle, its ends (x).
SCALPEL = {"y": 5.0, "z": 2.5, "chamfer": 1.0, "rear": -95.0, "front": 25.0}


def scalpel() -> list[Array]:
    """Convex pieces, vertices (n, 3) [mm]."""
    y, z, c = SCALPEL["y"], SCALPEL["z"], SCALPEL["chamfer"]
    rim = [(a * (y - e), b * (z - f)) for a in (-1, 1) for b in (-1, 1) for e, f in ((c, 0), (0, c))]
    handle = [(x, *p) for x in (SCALPEL["rear"], SCALPEL["front"]) for p in rim]
    neck = [(SCALPEL["front"], *p) for p in rim] + [(40.0, a, b) for a in (-2.5, 2.5) for b in (-0.75, 0.75)]
    back = [(x, y, b) for x, y in ((36.0, 2.5), (58.0, 2.5), (65.0, 0.0)) for b in (-0.25, 0.25)]
    edge = [(36.0, -3.0, 0.0), (44.0, -3.5, 0.0), (54.0, -3.2, 0.0), (61.0, -1.8, 0.0)]
    return [np.array(p) for p in (handle, neck, back + edge)]


# --- the Utah teapot -------------------------------------------------------------------------------
# Martin Newell's teapot (1975), its control points retyped; 45.5 mm per unit and y up as in the synthesis
# paper. Units and axes of the original in this table (z up, spout to +x). The surfaces of revolution repeat
# four quarter turns; in the original a quarter's inner control points stand at 0.56 of the radius, 0.5625 on
# the knob. Frame of the object: the original's axes turned so that y is up, origin on the axis in mid handle.
UNIT, MIDDLE = 45.5, 1.65  # [mm], [units] height of the origin
PROFILES = {  # (radius, height)
    "body": [(1.5, 2.4), (1.75, 1.875), (2.0, 1.35), (2.0, 0.9)],
    "belly": [(2.0, 0.9), (2.0, 0.45), (1.5, 0.225), (1.5, 0.15)],
    "bottom": [(1.5, 0.15), (1.5, 0.075), (1.425, 0.0), (0.0, 0.0)],
    "rim": [(1.4, 2.4), (1.3375, 2.53125), (1.4375, 2.53125), (1.5, 2.4)],
    "knob": [(0.0, 3.15), (0.8, 3.15), (0.0, 2.85), (0.2, 2.7)],
    "lid": [(0.2, 2.7), (0.4, 2.55), (1.3, 2.55), (1.3, 2.4)],
}
TUBES = {  # sections along the tube: (x, z) on one side of it, half width of the inner control points, (x, z) opposite
    "handle-top": [
        ((-1.6, 2.025), 0.3, (-1.5, 2.25)),
        ((-2.3, 2.025), 0.3, (-2.5, 2.25)),
        ((-2.7, 2.025), 0.3, (-3.0, 2.25)),
        ((-2.7, 1.8), 0.3, (-3.0, 1.8)),
    ],
    "handle-bottom": [
        ((-2.7, 1.8), 0.3, (-3.0, 1.8)),
        ((-2.7, 1.575), 0.3, (-3.0, 1.35)),
        ((-2.5, 1.125), 0.3, (-2.65, 0.9375)),
        ((-2.0, 0.9), 0.3, (-1.9, 0.6)),
    ],
    "spout": [
        ((1.7, 1.425), 0.66, (1.7, 0.6)),
        ((2.6, 1.425), 0.66, (3.1, 0.825)),
        ((2.3, 2.1), 0.25, (2.4, 2.025)),
        ((2.7, 2.4), 0.25, (3.3, 2.4)),
    ],
    "mouth": [
        ((2.7, 2.4), 0.25, (3.3, 2.4)),
        ((2.8, 2.475), 0.25, (3.525, 2.49375)),
        ((2.9, 2.475), 0.15, (3.45, 2.5125)),
        ((2.8, 2.4), 0.15, (3.2, 2.4)),
    ],
}


def quarter(part: str, number: int) -> Array:
    """(4, 4, 3) [mm] control points of a quarter of a surface of revolution.

    Rows run down the profile, columns about the axis from `number` quarter turns past +x, towards -z first.
    """
    k = 0.5625 if part == "knob" else 0.56
    points = np.array([[(r, 0.0, h), (r, -k * r, h), (k * r, -r, h), (0.0, -r, h)] for r, h in PROFILES[part]])
    if part == "knob":  # only the ring that the original has at 0.8 is this much rounder
        r, h = PROFILES[part][3]
        points[3] = [(r, 0.0, h), (r, -0.56 * r, h), (0.56 * r, -r, h), (0.0, -r, h)]
    c, s = round(np.cos(-number * np.pi / 2)), round(np.sin(-number * np.pi / 2))
    return placed(points @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]).T)


def half_tube(part: str, side: float) -> Array:
    """(4, 4, 3) [mm] control points of half of a tube; rows along it, columns from the table's first side on.

    `side` is the sign of z, object frame.
    """
    rows = [
        [(x0, 0, z0), (x0, -side * w, z0), (x1, -side * w, z1), (x1, 0, z1)] for (x0, z0), w, (x1, z1) in TUBES[part]
    ]
    return placed(np.array(rows))


def placed(points: Array) -> Array:
    """Points (..., 3) of the original [units] in the object frame [mm]."""
    x, y, z = np.moveaxis(points, -1, 0)
    return UNIT * np.stack([x, z - MIDDLE, -y], axis=-1)


def teapot() -> list[Array]:
    """Convex pieces, vertices (n, 3) [mm]: slices where the surface is hollow, the handle open in the middle."""
    whole = [turned("rim", 0, 1), turned("body", 0, 1), turned("belly", 0, 0.55)]
    foot = [turned("belly", 0.85, 1), turned("bottom", 0, 1)]
    pieces = [np.vstack(whole), turned("belly", 0.55, 0.7), turned("belly", 0.7, 0.85), np.vstack(foot)]
    cuts = {"lid": [0, 0.12, 0.24, 0.36, 1], "knob": [0, 0.45, 0.54, 0.63, 0.72, 0.86, 1]}
    pieces += [turned(part, *ends, quarter_steps=9) for part, at in cuts.items() for ends in pairwise(at)]
    for part, slices in (("handle-top", 12), ("handle-bottom", 10), ("spout", 7), ("mouth", 2)):
        last = 0.5 if part == "mouth" else 1.0  # the rest of the mouth turns inwards
        pieces += [np.vstack(pair) for pair in pairwise(ring(part, u) for u in np.linspace(0, last, slices + 1))]
    return pieces


def turned(part: str, start: float, end: float, quarter_steps: int = 15) -> Array:
    """(n, 3) [mm] points of a surface of revolution between two parameters of its profile."""
    down = max(4, round((30 if part == "knob" else 10) * (end - start)))
    u, v = np.meshgrid(np.linspace(start, end, down), np.arange(quarter_steps) / quarter_steps, indexing="ij")
    return np.vstack([evaluate(quarter(part, k), u, v).reshape(-1, 3) for k in range(4)])


def ring(part: str, u: float) -> Array:
    """(n, 3) [mm] the cross-section of a tube at a parameter along it."""
    v = np.linspace(0, 1, 13 if part.startswith("handle") else 7)
    return np.vstack([evaluate(half_tube(part, side), np.full(len(v), u), v) for side in (1.0, -1.0)])


# --- the guitar ------------------------------------------------------------------------------------
# Own design, the neck of a folk guitar with its headstock, and a plain body. Frame: origin in the middle of
# the nut on the fingerboard, x to the headstock, y along the nut, z out of the fingerboard; strings and frets
# are left out. [mm] sections of the neck: x, half width, depth; below the fingerboard's edge the back is half
# an ellipse.
SCALE = 650.0  # length of the strings
EDGE = 6.0  # height of the fingerboard's edge
NECK = ((8.0, 23.0, 20.0), (-330.0, 28.0, 23.5))
KEYS = (48.0, 88.0, 128.0)  # x of the tuning keys' shafts, on both sides
BUTTON = {"x": 10.0, "y": (52.0, 68.0), "z": 3.5, "chamfer": 2.5, "at": -10.0}  # half sizes; middle height


def fret(n: int) -> float:
    """[mm] x of a fret."""
    return SCALE * (2 ** (-n / 12) - 1)


def section(x: float) -> tuple[float, float]:
    """[mm] half width and depth of the neck at x."""
    (x0, w0, d0), (x1, w1, d1) = NECK
    t = (x - x0) / (x1 - x0)
    return w0 + t * (w1 - w0), d0 + t * (d1 - d0)


def guitar() -> list[Array]:
    """Convex pieces, vertices (n, 3) [mm]."""
    rims = []
    for x, w, d in NECK:
        a = np.linspace(0, np.pi, 33)
        back = np.column_stack([np.full(33, x), w * np.cos(a), -EDGE - (d - EDGE) * np.sin(a)])
        rims.append(np.vstack([[(x, w, 0), (x, -w, 0)], back]))
    pieces = [np.vstack(rims)]
    pieces.append(box((5, 160), (-36, 36), (-17, -3)))  # headstock
    for x in KEYS:
        for side in (-1.0, 1.0):
            pieces.append(box((x - 3, x + 3), (side * 35, side * 53), (BUTTON["at"] - 3, BUTTON["at"] + 3)))
            pieces.append(button(x, side))
    for x, radius, wide in ((-430.0, 115.0, 145.0), (-660.0, 155.0, 200.0)):  # upper and lower bout
        a = np.linspace(0, 2 * np.pi, 48, endpoint=False)
        outline = np.column_stack([x + radius * np.cos(a), wide * np.sin(a)])
        pieces.append(np.vstack([np.column_stack([outline, np.full(48, z)]) for z in (-95.0, -4.0)]))
    pieces.append(box((-560, -480), (-118, 118), (-95, -4)))  # waist
    pieces.append(box((-345, -300), (-27, 27), (-80, -6)))  # heel
    return pieces


def button(x: float, side: float) -> Array:
    """(n, 3) [mm] the button of a tuning key: a slab with chamfered edges, flat faces to +z and -z."""
    c, (y0, y1) = BUTTON["chamfer"], BUTTON["y"]
    half = BUTTON["x"]
    inner = [(x + a * (half - c), side * y, b) for a in (-1, 1) for y in (y0 + c, y1 - c) for b in (-1, 1)]
    faces = [(p, q, BUTTON["at"] + b * BUTTON["z"]) for p, q, b in inner]
    outer = [(half, c), (half - c, 0)]
    rim = [(x + a * u, side * y, BUTTON["at"]) for a in (-1, 1) for u, e in outer for y in (y0 + e, y1 - e)]
    return np.array(faces + rim)


def box(x: tuple[float, float], y: tuple[float, float], z: tuple[float, float]) -> Array:
    """(8, 3) corners."""
    return np.array([(a, b, c) for a in x for b in y for c in z])


# --- files -----------------------------------------------------------------------------------------

OBJECTS_MADE = {
    # name: pieces, mass [kg], friction, what it is
    "scalpel": (scalpel, 0.04, 0.5, "a scalpel, x to the tip of its blade"),
    "teapot": (teapot, 0.9, 0.5, "the Utah teapot at 45.5 mm per unit, y up, spout to +x"),
    "guitar": (guitar, 1.8, 0.5, "a guitar, origin in the middle of the nut, x to the headstock"),
}


def write(folder: Path, name: str) -> None:
    """Both files of an object."""
    made, mass, friction, what = OBJECTS_MADE[name]
    lines, first = [f"# Handfast: {what}; convex pieces, metres"], 1
    for n, points in enumerate(made()):
        hull = Shape.hull((MM * points).round(6))
        lines.append(f"o piece_{n}")
        lines += ["v " + " ".join(f"{c:.6f}".rstrip("0").rstrip(".") for c in v) for v in hull.vertices]
        lines += ["f " + " ".join(str(first + i) for i in f) for f in hull.faces.tolist()]
        first += len(hull.vertices)
    (folder / f"{name}.obj").write_text("\n".join(lines) + "\n")
    data = {"schema": "handfast/body/1", "name": name, "mesh": f"{name}.obj", "mass": mass, "friction": friction}
    (folder / f"{name}.json").write_text(json.dumps(data, indent=2) + "\n")


def main() -> None:
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else OBJECTS
    for name in OBJECTS_MADE:
        write(folder, name)
        print(name, (folder / f"{name}.obj").stat().st_size, "bytes")


if __name__ == "__main__":
    main()
