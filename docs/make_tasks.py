"""Make the nine bundled tasks: those of the synthesis paper's Table 2, with geometry of our own.

    python docs/make_tasks.py [FOLDER]

Writes `<object>-<task>.json` (`handfast/task/1`) to src/handfast/data/tasks. Run `make_objects.py` first: regions
on the objects are cut out of the surfaces that are described there.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from make_objects import BUTTON, EDGE, KEYS, MM, SCALPEL, Array, fret, half_tube, quarter, section

from handfast.model.bernstein import restrict
from handfast.model.region import Bezier

TASKS = Path(__file__).parents[1] / "src" / "handfast" / "data" / "tasks"
FINGERS = ("ring", "middle", "index", "thumb")


# --- regions on the hand: mm, link frames; each about 500 mm^2 --------------------------------------


def tip(finger: str) -> dict[str, Any]:
    """The pad of a fingertip, 60 degrees about its middle."""
    return {"link": f"{finger}_distal", "region": cap((20, 0, 0), 13, (0.14, 0, 0.99), 60)}


def end(finger: str) -> dict[str, Any]:
    """The end of a fingertip with which one presses, 70 degrees about a direction further to the tip."""
    return {"link": f"{finger}_distal", "region": cap((20, 0, 0), 13, (0.5, 0, 0.87), 70)}


def phalanx(finger: str) -> dict[str, Any]:
    """The palmar side of a middle phalanx: 110 degrees of its cylinder, as a cubic arc."""
    a, r = np.radians(55), 9.5
    k = 4 / 3 * np.tan(a / 2)  # the cubic Bezier arc through both ends and tangent there
    arc = [(-np.sin(a), np.cos(a)), (-np.sin(a) + k * np.cos(a), np.cos(a) + k * np.sin(a))]
    arc += [(-y, z) for y, z in reversed(arc)]
    points = np.array([[(x, r * y, r * z) for y, z in arc] for x in (3.0, 27.0)])
    return {"link": f"{finger}_middle", "region": patch(points, (0, 0, 1))}


def palm(y: tuple[float, float], z: tuple[float, float]) -> dict[str, Any]:
    """A rectangle of the palm's flat front."""
    points = np.array([[(3.0, a, b) for b in z] for a in y])
    return {"link": "palm", "region": patch(points, (1, 0, 0))}


def knuckle() -> dict[str, Any]:
    """The palmar side of the ball at the root of the index finger: its middle stays where it is."""
    return {"link": "palm", "region": cap((-4.3, 40.165, 145.43), 10, (0.9, 0.3, 0.3), 75)}


def cap(center: Any, radius: float, axis: Any, degrees: float) -> dict[str, Any]:
    center = [round(MM * c, 7) for c in center]
    return {
        "cap": {
            "center": center,
            "radius": round(MM * radius, 7),
            "axis": list(axis),
            "half_angle": round(np.radians(degrees), 4),
        }
    }


def patch(points: Array, outward: Any) -> dict[str, Any]:
    """A Bezier patch from control points [mm]; flipped if its normal would not agree with `outward`."""
    points = (MM * points).round(7)
    flip = bool(Bezier(points).normal(0.5, 0.5) @ np.array(outward, dtype=float) < 0)
    return {"bezier": points.tolist()} | ({"flip": True} if flip else {})


# --- regions on the objects: mm, object frames ------------------------------------------------------


def flat(side: float, x: tuple[float, float]) -> dict[str, Any]:
    """A flat side of the scalpel's handle, 7 mm wide; the side is the sign of z."""
    z = side * SCALPEL["z"]
    return patch(np.array([[(a, b, z) for b in (-3.5, 3.5)] for a in x]), (0, 0, side))


def narrow(side: float, x: tuple[float, float]) -> dict[str, Any]:
    """The back (+1) or the belly (-1) of the scalpel's handle, 2.8 mm wide."""
    y = side * SCALPEL["y"]
    return patch(np.array([[(a, y, b) for b in (-1.4, 1.4)] for a in x]), (0, side, 0))


def around(part: str, number: int, down: tuple[float, float], turn: tuple[float, float]) -> dict[str, Any]:
    """A part of the teapot's body or lid: ranges of the parameters down the profile and about the axis."""
    points = restrict(quarter(part, number), down, turn)
    middle = points.reshape(-1, 3).mean(axis=0) * [1, 0, 1]
    return patch(points, (0, -1, 0) if part == "bottom" else middle)


def handle(part: str, side: float, along: tuple[float, float], across: tuple[float, float]) -> dict[str, Any]:
    """A part of the teapot's handle; outward is away from the middle of its tube."""
    whole = half_tube(part, side)
    points = restrict(whole, along, across)
    tube = restrict(whole, along, (0.0, 1.0)).mean(axis=(0, 1)) * [1, 1, 0]
    return patch(points, points.mean(axis=(0, 1)) - tube)


def key(side: float, face: float, number: int = 0) -> dict[str, Any]:
    """A flat face of a tuning key's button, 8 mm by 8 mm."""
    x, (y0, y1), z = KEYS[number], BUTTON["y"], BUTTON["at"] + face * BUTTON["z"]
    y = side * (y0 + y1) / 2
    return patch(np.array([[(x + a, y + b, z) for b in (-4.0, 4.0)] for a in (-4.0, 4.0)]), (0, 0, face))


def fingerboard(x: tuple[float, float], y: tuple[float, float]) -> dict[str, Any]:
    """A rectangle of the fingerboard."""
    return patch(np.array([[(a, b, 0.0) for b in y] for a in x]), (0, 0, 1))


def edge(side: float, x: tuple[float, float]) -> dict[str, Any]:
    """The edge of the fingerboard, 5 mm high; the side is the sign of y."""
    points = [[(a, side * section(a)[0], b) for b in (-EDGE + 0.5, -0.5)] for a in x]
    return patch(np.array(points), (0, side, 0))


def back(x: tuple[float, float], degrees: tuple[float, float]) -> dict[str, Any]:
    """The back of the neck between two angles about its middle line (0 the middle, 90 the edge at +y)."""
    lo, hi = np.radians(degrees)
    k = 4 / 3 * np.tan((hi - lo) / 4)
    arc = [(np.sin(lo), np.cos(lo)), (np.sin(lo) + k * np.cos(lo), np.cos(lo) - k * np.sin(lo))]
    arc += [(np.sin(hi) - k * np.cos(hi), np.cos(hi) + k * np.sin(hi)), (np.sin(hi), np.cos(hi))]
    points = []
    for a in x:
        w, d = section(a)
        points.append([(a, w * s, -EDGE - (d - EDGE) * c) for s, c in arc])
    return patch(np.array(points), (0, 0, -1))


# --- the tasks -------------------------------------------------------------------------------------


def task(thing: str, contacts: list[Any], unused: dict[str, Any], pose: dict[str, Any]) -> dict[str, Any]:
    """A task: contacts as pairs of regions, angles [degrees] of the fingers that do not take part."""
    limits: dict[str, list[float]] = {}
    for finger in FINGERS:
        if finger == "thumb":
            limits["thumb_base"] = [0, 0] if finger in unused else [0, 90]
        ranges = {"abduction": [-15, 15], "proximal": [-4, 75], "middle": [4, 75], "distal": [4, 75]}
        if finger in unused:
            spread, first, bent = unused[finger]
            ranges = {"abduction": [spread] * 2, "proximal": [first] * 2, "middle": [bent] * 2, "distal": [bent] * 2}
        limits |= {f"{finger}_{part}": r for part, r in ranges.items()}
    return {
        "schema": "handfast/task/1",
        "hand": "schunk-sah",
        "object": thing,
        "limits": {name: np.radians(r).round(6).tolist() for name, r in limits.items()},
        "pose": pose,
        "contacts": [{"hand": h, "object": {"region": o}} for h, o in contacts],
    }


def axis(**bounds: tuple[float, float]) -> list[list[float]]:
    """Bounds on an axis of the object by palm axis."""
    return [list(bounds.get(a, (-1.0, 1.0))) for a in "xyz"]


STRAIGHT, BENT, FIST = (0, 0, 4), (0, 40, 40), (0, 70, 70)

MADE: dict[str, Callable[[], dict[str, Any]]] = {
    # Held up crosswise between two fingertips, the blade away from the other fingers.
    "scalpel-upholding": lambda: task(
        "scalpel",
        [(tip("index"), flat(1, (-14, -2))), (tip("thumb"), flat(-1, (-14, -2)))],
        {"ring": FIST, "middle": FIST},
        {"x_axis": axis(y=(0.6, 1.0))},
    ),
    # Between middle finger and thumb, the rear of the handle on the root of the index finger.
    "scalpel-handling": lambda: task(
        "scalpel",
        [
            (tip("middle"), flat(1, (-8, 24))),
            (tip("thumb"), flat(-1, (-8, 24))),
            (knuckle(), flat(1, (-94, -40))),
        ],
        {"ring": BENT, "index": (-10, -4, 4)},
        {"x_axis": axis(z=(0.2, 1.0))},
    ),
    # As a pencil: the same with the end of the index finger on the back, which presses on the edge.
    "scalpel-incision": lambda: task(
        "scalpel",
        [
            (tip("middle"), flat(1, (-30, 24))),
            (end("index"), narrow(1, (-5, 24))),
            (tip("thumb"), flat(-1, (-30, 24))),
            (knuckle(), flat(1, (-94, -32))),
        ],
        {"ring": BENT},
        {"x_axis": axis(z=(0.2, 1.0))},
    ),
    # By the knob, from above.
    "teapot-lid-lifting": lambda: task(
        "teapot",
        [
            (tip("index"), around("knob", 0, (0.2, 0.45), (0.3, 0.7))),
            (tip("thumb"), around("knob", 2, (0.2, 0.45), (0.3, 0.7))),
        ],
        {"ring": FIST, "middle": FIST},
        {"y_axis": axis(z=(-1.0, -0.5))},
    ),
    # By the handle, upright: the thumb on top, the middle finger below and nearer to the body, so that both bear the
    # weight beside the handle, and the index finger's middle phalanx at the side.
    "teapot-service": lambda: task(
        "teapot",
        [
            (tip("middle"), handle("handle-bottom", 1, (0.45, 0.92), (0.5, 1.0))),
            (phalanx("index"), handle("handle-top", 1, (0.4, 1.0), (0.2, 0.7))),
            (tip("thumb"), handle("handle-top", -1, (0.4, 0.9), (0.55, 1.0))),
        ],
        {"ring": FIST},
        {"x_axis": axis(x=(0.6, 1.0)), "y_axis": axis(y=(0.6, 1.0))},
    ),
    # Standing on the palm, three fingers around it; on a point beyond the middle of its base, so that it leans on them.
    "teapot-transportation": lambda: task(
        "teapot",
        [
            (palm((-12, 12), (12, 36)), around("bottom", 2, (0.5, 0.9), (0.6, 1.0))),
            (tip("index"), around("body", 1, (0.3, 1.0), (0.1, 0.4))),
            (tip("middle"), around("body", 0, (0.3, 1.0), (0.88, 1.0))),
            (tip("ring"), around("body", 0, (0.3, 1.0), (0.6, 0.9))),
        ],
        {"thumb": (0, 0, 4)},
        {"y_axis": axis(x=(0.7, 1.0))},
    ),
    # A key between two fingertips, from the side of the headstock.
    "guitar-tuning": lambda: task(
        "guitar",
        [(tip("index"), key(1, 1)), (tip("thumb"), key(1, -1))],
        {"ring": FIST, "middle": FIST},
        {"y_axis": axis(z=(-1.0, -0.75))},
    ),
    # Second string behind the first fret, fourth string behind the second one, the thumb anywhere behind.
    "guitar-playing": lambda: task(
        "guitar",
        [
            (tip("index"), fingerboard((fret(1) + 3, fret(1) + 13), (7.0, 15.0))),
            (tip("middle"), fingerboard((fret(2) + 3, fret(2) + 13), (-8.0, 0.0))),
            (tip("thumb"), back((-110, 0), (-60, 60))),
        ],
        {"ring": STRAIGHT},
        {"x_axis": axis(y=(0.7, 1.0)), "z_axis": axis(z=(0.0, 1.0))},
    ),
    # Carried by the neck, which lies along the hand: its back on the palm and in two straight fingers, the
    # thumb across the front, the body beyond the fingertips.
    "guitar-holding": lambda: task(
        "guitar",
        [
            (palm((8, 32), (90, 114)), back((-90, -10), (-60, 60))),
            (tip("thumb"), fingerboard((-170, -70), (-15, 15))),
            (tip("index"), back((-230, -110), (0, 80))),
            (tip("middle"), back((-230, -110), (-80, 0))),
        ],
        {"ring": STRAIGHT},
        {"x_axis": axis(z=(-1.0, -0.7)), "z_axis": axis(x=(0.7, 1.0))},
    ),
}


def main() -> None:
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else TASKS
    folder.mkdir(parents=True, exist_ok=True)
    for name, made in MADE.items():
        (folder / f"{name}.json").write_text(dumped(made()))


def dumped(data: dict[str, Any]) -> str:
    """JSON with one row of control points, or one joint, a line."""
    lines = json.dumps(data, indent=1)
    compact = json.JSONEncoder().encode
    holes: dict[str, str] = {}

    def marked(value: Any, deep: int = 0) -> Any:
        short = isinstance(value, list) and len(compact(value)) < 110
        if short or not isinstance(value, (dict, list)):
            holes[f"@{len(holes)}@"] = compact(value)
            return f"@{len(holes) - 1}@"
        if isinstance(value, dict):
            return {k: marked(v, deep + 1) for k, v in value.items()}
        return [marked(v, deep + 1) for v in value]

    lines = json.dumps(marked(data), indent=1)
    for hole, text in holes.items():
        lines = lines.replace(f'"{hole}"', text)
    return lines + "\n"


if __name__ == "__main__":
    main()
