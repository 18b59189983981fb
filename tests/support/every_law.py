"""A grasp with every law, of which no number is like another: rows 0 to 8 are of contacts, 9 and 10 of actuators, 11 of
a coupling, 12 to 15 of joints.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from handfast.model.grasp import Contact, Grasp, GraspJoint
from handfast.model.mechanism import Mechanism
from handfast.proofs.grasp import StartData
from handfast.proofs.states import Problem
from tests.support.exact_states import problem


def every_law(gaps: Any = (0.0, 0.0, 0.0), stop: float = 0.0, slack: float = 0.0, **asked: Any) -> Problem:
    """Three contacts; a motor with -3 N, geared by 4, a tendon that nobody commands; joints "rubs", with a friction of
    0.5 N, "stopped", 2 m from what it moves, with a lower stop and 0.5 N m, "free", and "both", which stands at stops.

    A step from where contacts were `gaps` apart, the joint `stop` [rad] off its stop, the tendon `slack`.
    """
    contacts = [Contact([0, 0, 0], [0, 0, 1], 0.5) for _ in range(3)]
    joints = [
        GraspJoint("rubs", [1, 0, 0], [0, 0, 0], (0,), "prismatic", friction=0.5),
        GraspJoint("stopped", [0, 1, 0], [0, -2, 0], (1,), "revolute", stop="lower", friction=0.5),
        GraspJoint("free", [1, 0, 0], [0, 0, 0], (), "prismatic"),
        GraspJoint("both", [1, 0, 0], [0, 0, 0], (), "prismatic", stop="both"),
    ]
    gearing = np.array([[4.0, 0, 0, 0], [0, 0, 1, 0]])
    mechanism = Mechanism(("motor", "tendon"), gearing, np.array([[1.0, 0, -2, 0]]), (False, True))
    p = problem(Grasp(contacts, joints, mechanism, {"motor": -3.0}), [0, 0, -1.0], limits={"motor": 6.0}, **asked)
    start = StartData(np.array(gaps), np.array([0, stop, 0, 0]), np.array([0, slack]))
    object.__setattr__(p, "grasp", p.grasp.with_start(start).with_command(p.command))
    return p
