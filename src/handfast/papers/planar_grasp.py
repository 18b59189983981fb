"""A grasp in the plane with immobile fingers, and the spatial grasp that it is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from flint import fmpq

from handfast.core.arrays import Array, frozen
from handfast.core.errors import InputError
from handfast.model.grasp import UNIT_TOLERANCE, Contact, Grasp
from handfast.proofs.fields import rational

Vector = tuple[fmpq, fmpq, fmpq]


@dataclass(frozen=True, eq=False)
class PlanarContact:
    """A point contact with friction in the plane.

    Attributes:
        position: (2,) [m], object frame.
        normal: (2,) unit, object frame, pointing into the object; taken as the numbers that it has, not normalised.
        friction: coefficient mu >= 0.
    """

    position: Array
    normal: Array
    friction: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "position", frozen(self.position, (2,), "position"))
        object.__setattr__(self, "normal", frozen(self.normal, (2,), "normal"))
        length, mu = float(np.hypot(*self.normal)), float(self.friction)
        if abs(length - 1.0) > UNIT_TOLERANCE:
            raise InputError(f"has length {length:.6g}; a unit vector is needed", field="normal")
        if not np.isfinite(mu) or mu < 0:
            raise InputError(f"is {mu}; a friction coefficient is 0 or more", field="friction")
        object.__setattr__(self, "friction", mu)

    @property
    def rows(self) -> tuple[Vector, Vector]:
        """Exact rows N, T: with the motion x = (v_x, v_y, turn) of the object, d_n = N x and d_t = T x.

        They are the unit forces' load (f_x, f_y, torque) on the object, too. The tangent is the normal turned by 90
        degrees to the left.
        """
        x, y = (rational(v) for v in self.position)
        a, b = (rational(v) for v in self.normal)
        return (a, b, x * b - y * a), (-b, a, x * a + y * b)


@dataclass(frozen=True, eq=False)
class PlanarGrasp:
    """Contacts with immobile fingers in the plane z = 0.

    Loads are (f_x, f_y, torque) on the object [N, N, N m], the torque about the object's origin.

    Raises:
        InputError: no contacts.
    """

    contacts: tuple[PlanarContact, ...]

    def __init__(self, contacts: Sequence[PlanarContact]) -> None:
        if not contacts:
            raise InputError("is empty; a grasp needs at least one contact", field="contacts")
        object.__setattr__(self, "contacts", tuple(contacts))

    @classmethod
    def of(cls, grasp: Grasp) -> PlanarGrasp:
        """The planar grasp that a spatial one is.

        Raises:
            InputError: a contact that is not in the plane z = 0, a normal that leaves it, or a joint that may move.
        """
        grasp.refuse_soft_fingers("a planar grasp")
        for i, c in enumerate(grasp.contacts):
            if c.position[2] != 0 or c.normal[2] != 0:
                raise InputError("is not in the plane z = 0; a planar grasp is needed", field=f"contacts[{i}]")
        mech = grasp.mechanism
        fixed = np.linalg.matrix_rank(np.vstack([mech.R, mech.A])) == grasp.l if grasp.l else True
        if grasp.command.any() or any(mech.tendon) or any(mech.backdrivable) or not fixed:
            raise InputError("may move; every joint has to be locked, without a command", field="joints")
        return cls([PlanarContact(c.position[:2], c.normal[:2], c.friction) for c in grasp.contacts])

    def spatial(self, name: str = "planar") -> Grasp:
        """The same contacts in space, without joints."""
        return Grasp(
            [Contact(np.r_[c.position, 0.0], np.r_[c.normal, 0.0], c.friction) for c in self.contacts], name=name
        )

    @staticmethod
    def spatial_load(load: Sequence[float] | Array) -> Array:
        """(6,) of a load (3,)."""
        fx, fy, torque = (float(v) for v in load)
        return np.array([fx, fy, 0, 0, 0, torque])
