"""A grasp of unlike numbers: every kind of joint, actuator and coupling in one."""

from __future__ import annotations

import numpy as np

from handfast.model.grasp import Contact, Grasp, GraspJoint
from handfast.model.mechanism import Mechanism

W = np.array([0.3, -0.7, 1.1, 0.02, -0.05, 0.01])


def hand(sign: float = 1.0) -> Grasp:
    """Three contacts of unlike friction; a motor on two joints, a locked one, a slack tendon, a coupling, a slide."""
    normals = ([-2 / 3, 2 / 3, 1 / 3], [6 / 7, -2 / 7, 3 / 7], [4 / 9, 4 / 9, -7 / 9])
    points = ([0.03, 0.01, -0.02], [-0.02, 0.04, 0.01], [0.005, -0.03, 0.02])
    contacts = [Contact(p, n, mu) for p, n, mu in zip(points, normals, (0.3, 0.7, 1.9), strict=True)]
    joints = [
        GraspJoint("a", [1 / 9, 4 / 9, 8 / 9], [0.05, -0.06, 0.01], (0, 1)),
        GraspJoint("b", [2 / 7, -6 / 7, 3 / 7], [-0.04, -0.05, 0.02], (1,)),
        GraspJoint("c", [2 / 11, 6 / 11, -9 / 11], [0.0, 0.0, 0.0], (2,), "prismatic"),
    ]
    R = np.array([[1.0, 0.5, 0.0], [0.0, 0.3, 0.2], [0.0, 0.7, -0.4]])
    mechanism = Mechanism(("m", "n", "t"), R, np.array([[0.4, 0.0, 1.0]]), (False, False, True))
    return Grasp(contacts, joints, mechanism, {"m": 0.4 * sign, "t": 0.15})
