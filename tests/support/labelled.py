"""Datasets for the tests of labels: small grasps with answers by hand, and the ways in which rows are broken."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from tests.support.program import planar

MASS = 0.2  # [kg]


def fixture(friction: float = 0.5) -> dict[str, Any]:
    """Four contacts below an object: holds any weight from above, nothing from below; no joints."""
    corners = [(x, y) for x in (-0.03, 0.03) for y in (-0.03, 0.03)]
    contacts = [{"position": [x, y, 0.0], "normal": [0, 0, 1], "friction": friction} for x, y in corners]
    about = {"mass": MASS, "center_of_mass": [0, 0, 0]}
    return {"schema": "handfast/grasp/1", "name": "table", "contacts": contacts} | about


def heavy() -> dict[str, Any]:
    """The planar grasp with the mass of its object."""
    return planar() | {"name": "two fingers", "mass": MASS, "center_of_mass": [0, 0, 0]}


def broken_rows() -> dict[str, tuple[str, str]]:
    """Ten rows that are broken: the line, and part of the reason that it has to be given."""
    good = heavy()
    first = good["contacts"][0]

    def contact(**changed: Any) -> str:
        return json.dumps(good | {"contacts": [first | changed, *good["contacts"][1:]]})

    many = [first | {"position": [0.001 * k, 0.0, 0.0]} for k in range(90)]
    return {
        "cut short": (json.dumps(good)[:100], "is not valid JSON"),
        "empty": ("", "is empty"),
        "NaN": (json.dumps(good).replace("1.0", "NaN", 1), "contains NaN"),
        "friction": (contact(friction=-0.5), "contacts[0].friction: is -0.5"),
        "zero normal": (contact(normal=[0, 0, 0]), "contacts[0].normal: is zero"),
        "long normal": (contact(normal=[0, 0, 2]), "contacts[0].normal: has length 2"),
        "no contacts": (json.dumps(good | {"contacts": []}), "contacts"),
        "unknown field": (json.dumps(good | {"colour": 1}), "colour: is not a known field"),
        "moves": (json.dumps(good | {"joints": [good["joints"][0] | {"moves": [99]}, good["joints"][1]]}), "moves"),
        "too many": (json.dumps(good | {"contacts": many}), "contacts"),
    }


def write_lines(path: Path, *lines: Any) -> Path:
    """JSON lines; texts as they are."""
    path.write_text("".join((x if isinstance(x, str) else json.dumps(x)) + "\n" for x in lines), "utf-8")
    return path
