"""Internal forces, split into those that the hand's joints can change and those that they cannot.

Bicchi, *On the problem of decomposing grasp and manipulation forces in multiple whole-limb manipulation* (Robotics
and Autonomous Systems 1994) and *On the closure properties of robotic grasping* (IJRR 1995): contact forces are
c = -G_K w + E y + P z. The first term answers the load w through the weighted right inverse
G_K = K G^T (G K G^T)^-1 of the grasp map; E y are internal forces, which do not act on the object, that
displacements of the joints bring about; P z are the rest, passive preload that no joint can change: two contacts
on a palm, or more contacts than joints.

On them rest the robustness measures of Prattichizzo, Salisbury and Bicchi, *Contact and grasp robustness measures:
analysis and experiments* (Experimental Robotics IV, 1997). A contact force is d away
from where its contact slips, lifts or is pressed harder than allowed. A wrench of size |w| changes contact forces by
no more than sigma_max(G_K) |w|, so that none of this happens as long as |w| < d / sigma_max(G_K): the potential
contact robustness PCR, with the best of the internal forces that the hand controls. It is careful, for a grasp may
hold though some contacts slip. The potential grasp robustness PGR is therefore the best of it over all states of the
contacts: one may stick, or slide and transmit its normal force alone, or be lost, as long as the others hold the
object.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from handfast.core.arrays import Array
from handfast.measures.conic_program import ConicProgram, NotMeasured, solver
from handfast.measures.wrench_space import SINGULAR_SHARE
from handfast.model.grasp import Grasp

EIGENVALUE_SHARE = 1e-12  # the same of eigenvalues, which are squares
MIN_SINGULAR_VALUE = 1e-12  # and whatever is this small
STICKS, SLIDES, LOST = range(3)  # what a contact transmits: all, its normal force, nothing
MOST_CONTACTS = 8  # 3^8 states
CONTROL_SHARE = 1e-4  # so are the smallest ways in which joints change internal forces: files round a flat hand by more


@dataclass(frozen=True, eq=False)
class InternalForces:
    """The parts of contact forces, over the components that contacts transmit.

    Attributes:
        inverse: (n, 6) G_K, of the load in the scale of the grasp map; None if the contacts do not hold the object.
        controllable: (n, e) orthonormal basis of the internal forces that joints change.
        passive: (n, p) orthonormal basis of those that are orthogonal to them.
    """

    inverse: Array | None
    controllable: Array
    passive: Array

    @property
    def dimension(self) -> int:
        """Of all internal forces."""
        return self.controllable.shape[1] + self.passive.shape[1]


def span(columns: Array, least: float = SINGULAR_SHARE) -> Array:
    """(n, r) orthonormal basis of what columns (n, k) span; what is below a share of the largest is left out."""
    if not columns.size:
        return np.zeros((len(columns), 0))
    U, sizes, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(U[:, sizes > max(least * float(sizes.max(initial=0.0)), MIN_SINGULAR_VALUE)])


def null(rows: Array) -> Array:
    """(n, r) orthonormal basis of what rows (k, n) map to zero."""
    if not rows.size:
        return np.eye(rows.shape[1])
    _, sizes, V = np.linalg.svd(rows)
    return np.asarray(
        V[int((sizes > max(SINGULAR_SHARE * float(sizes.max(initial=0.0)), MIN_SINGULAR_VALUE)).sum()) :].T
    )


def internal_forces(grasp: Grasp, G: Array, transmitted: Array | None = None) -> InternalForces:
    """Split the contact forces of a grasp.

    Contacts have unit stiffness in all transmitted components; actuators and couplings are rigid, as in Handfast's
    model, and every actuator can be moved. Joints that nothing drives yield.

    Args:
        G: (6, 3m) grasp map in some scale.
        transmitted: (3m,) bool, which components of contact forces are transmitted; all unless given.
    """
    J, mech = grasp.J, grasp.mechanism
    if transmitted is not None:
        G, J = G[:, transmitted], J[transmitted]
    size = np.linalg.norm(G, axis=1, keepdims=True)
    size[size == 0] = 1.0
    G = G / size  # what is dependent does not hang on the unit of torques
    n = G.shape[1]
    movable = null(mech.A)  # joint motions that the couplings allow
    free = movable @ null(mech.R @ movable) if mech.a else movable
    yielding = span(J @ free) if grasp.l else np.zeros((n, 0))
    K = np.eye(n) - yielding @ yielding.T
    compliance = G @ K @ G.T
    sizes = np.linalg.eigvalsh(compliance)
    inverse = K @ G.T @ np.linalg.pinv(compliance, rcond=EIGENVALUE_SHARE, hermitian=True)
    holds = inverse / size.T if sizes[0] > EIGENVALUE_SHARE * sizes[-1] else None
    internal = null(G)
    moved = K @ J @ movable
    controllable = span(moved - inverse @ (G @ moved), CONTROL_SHARE)
    passive = internal @ null(controllable.T @ internal) if controllable.shape[1] else internal
    return InternalForces(holds, controllable, passive)


def contact_robustness(grasp: Grasp, G: Array, *, force: float = 1.0) -> float:
    """PCR [N] of a grasp: the largest wrench, in the scale of G, that surely neither slips nor lifts a contact.

    Args:
        G: (6, 3m) grasp map in some scale.
        force: [N] the largest normal force at each contact.

    Raises:
        NotMeasured: clarabel is not installed.
    """
    solver()
    return _robustness(grasp, _StateForces(grasp, G, (STICKS,) * grasp.m, force))


def grasp_robustness(grasp: Grasp, G: Array, *, force: float = 1.0) -> tuple[float, tuple[int, ...]]:
    """PGR [N] of a grasp and the states of its contacts (0 sticks, 1 slides, 2 is lost).

    Arguments and errors as of `contact_robustness`; `NotMeasured` also for more than 8 contacts. All 3^m states are
    considered; programs are solved in the order of what they can reach at best, until none can be better.
    """
    solver()
    if grasp.m > MOST_CONTACTS:
        raise NotMeasured(f"{grasp.m} contacts have too many states; {MOST_CONTACTS} are the most")
    choices = [s for s in product(range(3), repeat=grasp.m) if sum((3, 1, 0)[k] for k in s) >= 6]
    parts = [_StateForces(grasp, G, states, force) for states in choices]
    best, chosen = 0.0, (STICKS,) * grasp.m
    for part in sorted(parts, key=lambda p: -p.bound):
        if part.bound <= best * (1 + 1e-9):
            break
        value = _robustness(grasp, part)
        if value > best:
            best, chosen = value, part.states
    return best, chosen


class _StateForces:
    """The internal forces of one combination of states, and what its robustness can be at most."""

    def __init__(self, grasp: Grasp, G: Array, states: tuple[int, ...], force: float) -> None:
        self.states, self.force = states, force
        self.transmitted = np.array([(s == STICKS or (s == SLIDES and k == 0)) for s in states for k in range(3)])
        self.forces: InternalForces = internal_forces(grasp, G, self.transmitted)
        self.gain, self.bound = np.inf, 0.0
        if self.forces.inverse is not None and self.forces.controllable.shape[1]:
            self.gain = float(np.linalg.norm(self.forces.inverse, 2))
            sines = grasp.mu / np.hypot(1.0, grasp.mu)
            reach = [
                force * (sine / (1 + sine) if state == STICKS else 0.5)
                for sine, state in zip(sines, states, strict=True)
                if state != LOST
            ]
            self.bound = min(reach) / self.gain


def _robustness(grasp: Grasp, parts: _StateForces) -> float:
    """[N] the PCR of one combination of states."""
    if parts.bound <= 0.0:
        return 0.0
    E = np.zeros((3 * grasp.m, parts.forces.controllable.shape[1]))
    E[parts.transmitted] = parts.forces.controllable
    e = E.shape[1]
    p = ConicProgram(e + 1)  # y, d
    normals, rights = [], []
    for i, (mu, state) in enumerate(zip(grasp.mu, parts.states, strict=True)):
        if state == LOST:
            continue
        n, t = E[3 * i], E[3 * i + 1 : 3 * i + 3]
        normals += [np.r_[n, 1.0], np.r_[-n, 1.0]]  # d below what the limit leaves, and below the normal force
        rights += [parts.force, 0.0]
        if state == STICKS:  # sin c_n - cos |c_t| >= d, the distance from the cone
            length = np.hypot(1.0, mu)
            p.in_cone(np.vstack([np.r_[mu * n, -length], np.c_[t, np.zeros(2)]]))
    p.at_most(np.array(normals), np.array(rights))
    x = p.solve(np.r_[np.zeros(e), -1.0])
    return 0.0 if x is None else max(0.0, float(x[-1])) / parts.gain
