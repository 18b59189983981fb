"""What contact forces could do if a controller chose them: second-order cone programs.

Forces inside the exact friction cones, in equilibrium with the load. Nothing says that these forces arise: joints
are taken to supply whatever the contact forces ask of them, within torque limits if there are any.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from handfast.core.arrays import Array
from handfast.core.errors import InputError, unknown_name
from handfast.measures.conic_program import ConicProgram
from handfast.model.grasp import Grasp


def check_limits(grasp: Grasp, torque_limits: Mapping[str, float]) -> None:
    """Raise `InputError` for an actuator that there is not, or a limit that is not above 0."""
    for name, limit in torque_limits.items():
        if name not in grasp.mechanism.actuators:
            raise unknown_name("actuator", name, grasp.mechanism.actuators, field="torque_limits")
        if not limit > 0:
            raise InputError(f"is {limit:g}; a limit above 0 is needed", field=f"torque_limits.{name}")


def _program(grasp: Grasp, more: int, torque_limits: Mapping[str, float] | None) -> ConicProgram:
    """Contact forces (3m) inside their cones, `more` other unknowns, then actuator and coupling forces if limited."""
    m, mech = grasp.m, grasp.mechanism
    limits = dict(torque_limits or {})
    behind = mech.a + len(mech.A) if limits else 0
    p = ConicProgram(3 * m + more + behind)
    for i, mu in enumerate(grasp.mu):
        rows = np.zeros((3, p.n))
        rows[:, 3 * i : 3 * i + 3] = np.diag([mu, 1.0, 1.0])
        p.in_cone(rows)
        p.at_most(-np.eye(p.n)[3 * i : 3 * i + 1], np.zeros(1))  # a cone without friction says nothing of it
    if limits:
        zero = np.zeros((grasp.l, more))
        p.equal(np.hstack([grasp.J.T, zero, -mech.R.T, -mech.A.T]), np.zeros(grasp.l))
        check_limits(grasp, limits)
        for name, limit in limits.items():
            row = np.zeros((1, p.n))
            row[0, 3 * m + more + mech.actuators.index(name)] = 1.0
            p.at_most(np.vstack([row, -row]), np.full(2, float(limit)))
    return p


def largest_wrench(
    grasp: Grasp,
    G: Array,
    direction: Array,
    *,
    force: float = 1.0,
    torque_limits: Mapping[str, float] | None = None,
) -> float:
    """The largest multiple of a wrench that chosen contact forces balance.

    Li, Hsu and Sastry (1989) and Han, Trinkle and Li (*Grasp analysis as linear matrix inequality problems*, IEEE
    T-RA 2000) pose it; here as a second-order cone program.

    Args:
        G: (6, 3m) grasp map in some scale, `direction` (6,) in the same.
        force: [N] the largest normal force at each contact.
        torque_limits: largest force or torque of actuators, by name.

    Raises:
        InputError: an unknown actuator or a limit that is not above 0.
        NotMeasured: clarabel is not installed, or gives up.
    """
    m = grasp.m
    p = _program(grasp, 1, torque_limits)
    behind = np.zeros((6, p.n - 3 * m - 1))
    p.equal(np.hstack([G, direction[:, None], behind]), np.zeros(6))
    normals = np.zeros((m, p.n))
    normals[np.arange(m), 3 * np.arange(m)] = 1.0
    p.at_most(normals, np.full(m, force))
    cost = np.zeros(p.n)
    cost[3 * m] = -1.0
    x = p.solve(cost)  # there is one, for no forces balance no wrench
    return 0.0 if x is None else max(0.0, float(x[3 * m]))


def smallest_forces(
    grasp: Grasp, G: Array, wrench: Array, *, torque_limits: Mapping[str, float] | None = None
) -> float:
    """The least [N] that the largest contact force can be when chosen forces balance a wrench; inf if none do.

    Boyd and Wegbreit, *Fast computation of optimal contact forces* (IEEE T-RO 2007), their problem (4): minimise
    the largest |c_i|. Arguments and errors as of `largest_wrench`.
    """
    m = grasp.m
    p = _program(grasp, 1, torque_limits)
    behind = np.zeros((6, p.n - 3 * m))
    p.equal(np.hstack([G, behind]), -wrench)
    for i in range(m):
        rows = np.zeros((4, p.n))
        rows[0, 3 * m] = 1.0
        rows[1:, 3 * i : 3 * i + 3] = np.eye(3)
        p.in_cone(rows)
    cost = np.zeros(p.n)
    cost[3 * m] = 1.0
    x = p.solve(cost)
    return np.inf if x is None else float(x[3 * m])
