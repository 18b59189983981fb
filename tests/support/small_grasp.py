"""A grasp file of two contacts, three joints and a mechanism, all of whose numbers are dyadic: maps by hand are exact.

Contact 0, a soft finger, is at (1/2, 0, 0) with the normal z: t1 = z x x = y, t2 = z x y = -x. Contact 1 is at
(0, -1/4, 1/4) with the normal -x: t1 = -x x y = -z, t2 = -x x -z = -y.
"""

from __future__ import annotations

from typing import Any


def small_grasp() -> dict[str, Any]:
    """A new `handfast/grasp/1` object."""
    return {
        "schema": "handfast/grasp/1",
        "name": "small",
        "contacts": [
            {"position": [0.5, 0, 0], "normal": [0, 0, 1], "friction": 0.5, "torsion": 0.25, "link": "tip", "depth": 1},
            {"position": [0, -0.25, 0.25], "normal": [-1, 0, 0], "friction": 0.75},
        ],
        "joints": [
            {"name": "turn", "axis": [0, 0, 1], "origin": [0.5, -0.25, 0], "moves": [0], "friction": 0.25},
            {"name": "slide", "type": "prismatic", "axis": [0, 1, 0], "origin": [9, 9, 9], "moves": [0, 1]},
            {
                "name": "roll",
                "type": "revolute",
                "axis": [1, 0, 0],
                "origin": [0, 0, 0],
                "moves": [1],
                "torque": -0.5,
                "stop": "upper",
            },
        ],
        "mechanism": {
            "actuators": [
                {"name": "pull", "joints": {"turn": 2, "slide": -1}, "tendon": True},
                {"name": "push", "joints": {"roll": 0.5}},
                {"name": "back", "joints": {"roll": -4}, "backdrivable": True},
            ],
            "couplings": [{"slide": 3, "roll": -1}],
        },
        "preload": {"push": -0.75, "pull": 3},
        "mass": 2,
        "center_of_mass": [0, 0, 0],
        "provenance": None,
    }
