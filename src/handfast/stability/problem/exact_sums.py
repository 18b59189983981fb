"""The linear equations of the model without rounding: for states whose numbers are so large that it would matter."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from handfast.core.arrays import Array
from handfast.model.grasp import Grasp

if TYPE_CHECKING:
    from flint import fmpq

    from handfast.proofs.states import State


@dataclass(frozen=True, eq=False)
class Sums:
    """The linear equations at a state.

    Attributes:
        object: (6,) G c + w of (1). joints: (l,) of (2), with all that carries. couplings: (k,) A q.
        d: (3m,) of (3). t: (a,) R q of (8). twist: (s,) turning about the normals of soft
            fingers times their levers.
    """

    object: Array
    joints: Array
    couplings: Array
    d: Array
    t: Array
    twist: Array


def exact_contacts(grasp: Grasp) -> Iterator[tuple[list[fmpq], list[list[fmpq]], dict[int, list[fmpq]]]]:
    """Of each contact its position, the three directions of its frame, and its velocity by joint that moves it.

    Rational, from the positions, axes and contact frames as they are: columns of the grasp map and of the Jacobian.
    """
    from handfast.proofs.fields import cross, rational

    for i, contact in enumerate(grasp.contacts):
        p = [rational(x) for x in contact.position]
        frame = [[rational(x) for x in column] for column in contact.frame.T]
        speeds = {}
        for j, joint in enumerate(grasp.joints):
            if i not in joint.moves:
                continue
            speeds[j] = [rational(x) for x in joint.axis]
            if joint.type != "prismatic":
                arm = [x - rational(o) for x, o in zip(p, joint.origin, strict=True)]
                speeds[j] = cross(speeds[j], arm)
        yield p, frame, speeds


def exact_sums(grasp: Grasp, w: Array, state: State) -> Sums:
    """Rational; each sum is rounded once, at its end."""
    from flint import fmpq

    from handfast.proofs.fields import cross, rational, rounded

    r_, q_, c_, f_, lambda_, load = (
        [rational(x) for x in v] for v in (state.r, state.q, state.c, state.f, state.coupling, w)
    )
    R, A = ([[rational(x) for x in row] for row in a] for a in (grasp.mechanism.R, grasp.mechanism.A))
    zero, l = fmpq(0), grasp.l
    balance, torques, d = list(load), [zero] * l, []
    twist: list[fmpq] = []
    turned = {int(i): rational(state.torsion[i]) for i in grasp.soft}
    for i, (p, frame, speeds) in enumerate(exact_contacts(grasp)):
        point = [x + y for x, y in zip(r_[:3], cross(r_[3:], p), strict=True)]
        force = [sum((c_[3 * i + k] * frame[k][x] for k in range(3)), zero) for x in range(3)]
        balance = [x + y for x, y in zip(balance, [*force, *cross(p, force)], strict=True)]
        for j, speed in speeds.items():
            point = [x - q_[j] * v for x, v in zip(point, speed, strict=True)]
            torques[j] += sum((x * v for x, v in zip(force, speed, strict=True)), zero)
        d += [sum((x * v for x, v in zip(direction, point, strict=True)), zero) for direction in frame]
        if i not in turned:
            continue
        turning = list(r_[3:])
        balance[3:] = [x + turned[i] * n for x, n in zip(balance[3:], frame[0], strict=True)]
        for j in speeds:
            if grasp.joints[j].type == "prismatic":
                continue
            axis = [rational(x) for x in grasp.joints[j].axis]
            turning = [x - q_[j] * v for x, v in zip(turning, axis, strict=True)]
            torques[j] += turned[i] * sum((x * n for x, n in zip(axis, frame[0], strict=True)), zero)
        lever = rational(grasp.levers[len(twist)])
        twist.append(lever * sum((x * n for x, n in zip(turning, frame[0], strict=True)), zero))
    for rows, values in ((R, f_), (A, lambda_)):
        for row, value in zip(rows, values, strict=True):
            torques = [x - a * value for x, a in zip(torques, row, strict=True)]
    if grasp.has_laws:
        for own in (grasp.given_torques, state.reaction):
            torques = [x - rational(y) for x, y in zip(torques, own, strict=True)]
    t = [sum((a * x for a, x in zip(row, q_, strict=True)), zero) for row in R]
    tied = [sum((a * x for a, x in zip(row, q_, strict=True)), zero) for row in A]
    return Sums(*(np.array([rounded(x) for x in v], dtype=float) for v in (balance, torques, tied, d, t, twist)))
