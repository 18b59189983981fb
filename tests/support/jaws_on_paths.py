"""A jaw that presses an object against a wall: what a path of its load comes to is known by hand."""

from __future__ import annotations

from typing import Any

import numpy as np

from handfast import Contact, Grasp, GraspJoint, Mechanism

FIRST = "preload-first"

MOTOR = Mechanism(("jaw",), np.eye(1), np.zeros((0, 1)), (False,), (True,))  # backdrivable


def jaw(mechanism: Mechanism | None = None, **joint: Any) -> Grasp:
    """A jaw on a slide, at -1 on the x axis, presses an object against a wall at +1; mu = 0.5."""
    contacts = [Contact((-1, 0, 0), (1, 0, 0), 0.5), Contact((1, 0, 0), (-1, 0, 0), 0.5)]
    joints = [GraspJoint("jaw", (1, 0, 0), (-1, 0, 0), (0,), "prismatic", **joint)]
    return Grasp(contacts, joints, mechanism, {"jaw": 1.0}, "jaw")


def padded(mechanism: Mechanism | None = None, **joint: Any) -> Grasp:
    """The same with three contacts on each side, which hold the object where the others have let go of it."""
    around = [(np.cos(a), np.sin(a)) for a in (0.3, 2.4, 4.5)]
    contacts = [Contact((x, y, z), (-x, 0, 0), 0.5) for x in (-1, 1) for y, z in around]
    joints = [GraspJoint("jaw", (1, 0, 0), (-1, 0, 0), (0, 1, 2), "prismatic", **joint)]
    return Grasp(contacts, joints, mechanism, {(mechanism or MOTOR).actuators[0]: 1.0}, "padded jaw")
