"""Second-order cone programs, by clarabel, and what contact forces could do if a controller chose them.

Chosen forces are inside the exact friction cones, in equilibrium with the load. Nothing says that these forces arise:
joints are taken to supply whatever the contact forces ask of them, within torque limits if there are any.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from handfast.core.arrays import Array
from handfast.core.errors import InputError, unknown_name
from handfast.model.grasp import Grasp


class NotMeasured(Exception):
    """A measure is not to be had here: what computes it is not installed, or the grasp is too large for it.

    Its text is one line that says why and what would help.
    """


CONIC_TOLERANCE = 1e-9


@dataclass
class ConicProgram:
    """Minimise half x^T P x + cost @ x with linear rows and second-order cones, over x of `n` numbers."""

    n: int
    _parts: dict[str, list[tuple[Array, Array]]] = field(
        default_factory=lambda: {"equal": [], "most": [], "cone": []}, init=False
    )

    def equal(self, rows: Array, right: Array) -> None:
        """rows @ x = right."""
        self._parts["equal"].append((rows, right))

    def at_most(self, rows: Array, right: Array) -> None:
        """rows @ x <= right."""
        self._parts["most"].append((rows, right))

    def in_cone(self, rows: Array) -> None:
        """rows @ x is in the second-order cone: its first number is at least the length of the rest."""
        self._parts["cone"].append((-rows, np.zeros(len(rows))))

    def solve(self, cost: Array, quadratic: Array | None = None) -> Array | None:
        """(n,) the solution; None if nothing meets all rows and cones.

        Raises:
            NotMeasured: clarabel is not installed, or gives up.
        """
        clarabel = solver()
        from scipy.sparse import csc_matrix

        parts = [(kind, *part) for kind, some in self._parts.items() for part in some]
        kinds = {"equal": clarabel.ZeroConeT, "most": clarabel.NonnegativeConeT, "cone": clarabel.SecondOrderConeT}
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = CONIC_TOLERANCE
        P = csc_matrix((self.n, self.n)) if quadratic is None else csc_matrix(np.triu(quadratic))
        rows = csc_matrix(np.vstack([rows for _, rows, _ in parts]))
        right = np.concatenate([right for _, _, right in parts])
        cones = [kinds[kind](len(b)) for kind, _, b in parts]
        found = clarabel.DefaultSolver(P, cost, rows, right, cones, settings).solve()
        status = str(found.status)
        if status in ("Solved", "AlmostSolved"):
            return np.array(found.x)
        if status in ("PrimalInfeasible", "AlmostPrimalInfeasible"):
            return None
        raise NotMeasured(f"the solver of its program gave up ({status})")


def solver() -> Any:
    """The module clarabel; `NotMeasured` if it is not installed."""
    try:
        import clarabel
    except ImportError:
        raise NotMeasured("needs clarabel: pip install 'handfast[measures]'") from None
    return clarabel


# --- chosen forces ---


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
