"""Internal forces, split into those that the hand's joints can change and those that they cannot.

Bicchi, *On the problem of decomposing grasp and manipulation forces in multiple whole-limb manipulation* (Robotics
and Autonomous Systems 1994) and *On the closure properties of robotic grasping* (IJRR 1995): contact forces are
c = -G_K w + E y + P z. The first term answers the load w through the weighted right inverse
G_K = K G^T (G K G^T)^-1 of the grasp map; E y are internal forces, which do not act on the object, that
displacements of the joints bring about; P z are the rest, passive preload that no joint can change: two contacts
on a palm, or more contacts than joints.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from handfast.core.arrays import Array
from handfast.model.grasp import Grasp

FLAT = 1e-9  # singular values below this share of the largest are none
SINGULAR = 1e-12  # the same of eigenvalues, which are squares
ROUNDING = 1e-12  # and whatever is this small
WEAK = 1e-4  # so are the smallest ways in which joints change internal forces: files round a flat hand by more


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


def span(columns: Array, least: float = FLAT) -> Array:
    """(n, r) orthonormal basis of what columns (n, k) span; what is below a share of the largest is left out."""
    if not columns.size:
        return np.zeros((len(columns), 0))
    U, sizes, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(U[:, sizes > max(least * float(sizes.max(initial=0.0)), ROUNDING)])


def null(rows: Array) -> Array:
    """(n, r) orthonormal basis of what rows (k, n) map to zero."""
    if not rows.size:
        return np.eye(rows.shape[1])
    _, sizes, V = np.linalg.svd(rows)
    return np.asarray(V[int((sizes > max(FLAT * float(sizes.max(initial=0.0)), ROUNDING)).sum()) :].T)


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
    inverse = K @ G.T @ np.linalg.pinv(compliance, rcond=SINGULAR, hermitian=True)
    holds = inverse / size.T if sizes[0] > SINGULAR * sizes[-1] else None
    internal = null(G)
    moved = K @ J @ movable
    controllable = span(moved - inverse @ (G @ moved), WEAK)
    passive = internal @ null(controllable.T @ internal) if controllable.shape[1] else internal
    return InternalForces(holds, controllable, passive)
