"""What the checker's bounds of rounding are tried on: systems of a few numbers, and questions of unlike numbers."""

from __future__ import annotations

from typing import Any

import numpy as np

from handfast.model.grasp import Contact, Grasp, GraspJoint
from handfast.model.mechanism import Mechanism
from handfast.stability.certify.certificate import Question
from handfast.stability.certify.leaf_systems import LeafSystems
from handfast.stability.goal import (
    LARGEST,
    SMALLEST_LARGEST_COMMAND,
    SMALLEST_PRELOAD,
    SMALLEST_SUM_OF_COMMANDS,
)

W = np.array([0.3, -0.7, 1.1, 0.02, -0.05, 0.01])
D = np.array([-0.2, 0.4, 0.9, 0.03, 0.07, -0.06])


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


BOTH = ("m", "n")
QUESTIONS = {
    "check": (Question(hand(), wrench=W), None),
    "turned": (Question(hand(-1.0), wrench=W, eta=0.3), None),
    "preload": (Question(hand(), SMALLEST_PRELOAD, direction=D), (0.1, 0.7)),
    "preload with eta": (Question(hand(-1.0), SMALLEST_PRELOAD, direction=D, eta=0.1), (0.1, 0.7)),
    "largest": (Question(hand(), LARGEST, W, D, force_limit=3.0, torque_limits={"n": 0.9}), (-0.4, 0.6)),
    "max": (Question(hand(-1.0), SMALLEST_LARGEST_COMMAND, W, driven=BOTH), (0.2, 0.5)),
    "sum": (Question(hand(), SMALLEST_SUM_OF_COMMANDS, W, driven=BOTH, eta=0.2), (0.2, 0.5)),
}
REFERENCES = np.array([[0.3, 0.7, 1.3, 0.9], [1.1, 0.1, 0.45, 2.3]])


def leaf(B: Any, w: Any, b: Any, *, size: Any = None, error: float = 1e-3, ends: Any = (0.0, 0.0), **more: Any):
    """One leaf whose multipliers w cancel B nearly. Its first rows are inequalities, `equalities` of them are none."""
    B, count = np.array(B, dtype=float), len(w)
    given = {"free": [True] * count, "slack": [0.0] * count, "growth": [0.0] * count, "first": [False] * count}
    given |= {"unit": [1.0] * count, "closed": [True] * B.shape[1]} | {"equalities": 0} | more
    index = np.arange(count - given.pop("equalities"))[None]
    arrays = {name: np.array(value)[None] for name, value in given.items()}
    size = np.abs(B) if size is None else np.array(size, dtype=float)
    return LeafSystems(
        B=B[None], size=size[None], w=np.array(w, dtype=float)[None], b=np.array(b, dtype=float)[None], index=index,
        ends=ends, error=error, **arrays,
    )  # fmt: skip
