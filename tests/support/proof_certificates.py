"""Certificates written by hand: two walls across from each other hold no weight, as nothing presses them together."""

from __future__ import annotations

import numpy as np

from handfast.proofs.certificate import Certificate
from handfast.proofs.kinds import CLOSED, OPEN, TURN_DIRECTIONS, Row
from handfast.proofs.question import Question
from tests.support.proof_states import contact, question

UP = TURN_DIRECTIONS // 4  # the direction of +c_t2, which is -y at both walls
NODES = [(-1, 0, 0, 0, 0), (0, 0, OPEN, 0, 0), (0, 0, CLOSED, 0, 0), (2, 1, OPEN, 0, 0), (2, 1, CLOSED, 0, 0)]
MU = 0.5
ALONE = [[(Row.TANGENT, 1, UP, 0, 1.0)], [(Row.TANGENT, 0, UP, 0, 1.0)]]
# contact 0 is open: c_n1 = 0, so contact 1 has no friction; multipliers of the balances follow from all rows
LEAVES = [
    [*ALONE[0], (Row.TANGENT, 0, UP, 0, 1.0), (Row.CN_DOWN, 0, 0, 0, 2 * MU)],
    [*ALONE[1], (Row.TANGENT, 1, UP, 0, 1.0), (Row.CN_DOWN, 1, 0, 0, 2 * MU)],
    [  # both are closed: c_n0 + c_n1 = -(d_n0 + d_n1) = 0, so neither has
        (Row.TANGENT, 0, UP, 0, 1.0),
        (Row.TANGENT, 1, UP, 0, 1.0),
        (Row.GAP_DOWN, 0, 0, 0, MU),
        (Row.GAP_DOWN, 1, 0, 0, MU),
    ],
]
SHORT = [*ALONE, LEAVES[2]]


def walls(
    size: float = 1.0, force: float = 1.0, tilt: float = 0.0, at: tuple[float, float, float] = (0, 0, 0)
) -> Question:
    """At -size and size along x about a point, normals to each other but for a tilt [rad]; force [N] along y there."""
    p = np.array(at, dtype=float)
    left, right = (
        contact(p - np.array([size, 0, 0]), [1, 0, 0], MU),
        contact(p + np.array([size, 0, 0]), [-np.cos(tilt), -np.sin(tilt), 0], MU),
    )
    return question([left, right], [0, force, 0, *np.cross(p, [0, force, 0])])


def arrays(nodes=NODES, leaves=LEAVES):
    """What `Certificate` is made of, but for question and scalar."""
    parent, part, state, left, right = np.array(nodes).T
    kind, index, a, b, y = np.array([row for leaf in leaves for row in leaf]).T
    start = np.cumsum([0, *(len(leaf) for leaf in leaves)])
    tree = {"parent": parent, "part": part, "state": state, "left": left, "right": right}
    return tree | {"start": start, "kind": kind, "index": index, "a": a, "b": b, "multiplier": y}


def proof(q: Question | None = None, nodes=NODES, leaves=LEAVES, **changed) -> Certificate:
    """That the walls hold nothing, or with changed arrays."""
    return Certificate(q or walls(), None, **(arrays(nodes, leaves) | changed))
