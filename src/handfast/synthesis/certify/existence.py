"""Existence: the data that prove that a hand can take a hold, and their `handfast/existence/1` form.

A proof is a configuration in floats, which meets the contact equations but for rounding, and a box around
some of its coordinates. It claims: with every other coordinate frozen at its float, the box contains an
exact solution, and nowhere in the box is a limit, a patch's edge or a bound reached. `verify_existence`
decides whether that is so. Coordinates are named by labels:

    joint:NAME           value of a free joint (`free_joints`) [rad, m]
    position:0 .. 2      the object's origin in the palm frame [m]
    quaternion:0 .. 3    w, x, y, z of the object in the palm frame, of any length: R = matrix / |q|^2
    contact:K:s, :t      parameters of contact K (from 0) on its object region
    contact:K:u, :v      parameters on its hand region, if that is no cap

On a patch both parameters run from 0 to 1; on a cylinder's side too, over its angles and over its heights. On a
cap, s is the angle from the axis and t the angle around it: direction = cap.frame @ (sin s cos t, sin s sin t,
cos s) from the centre.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from handfast.core.arrays import Array, frozen
from handfast.core.files import Strict, validate
from handfast.model.hand.hand import Coupling, Hand
from handfast.synthesis.task import Task


@dataclass(frozen=True)
class ContactPoint:
    """Where a contact touches.

    Attributes:
        link: name of the hand link, as in the task.
        object: (s, t) on the object region.
        hand: (u, v) on the hand region; None on a cap, where the normal says the point.
    """

    link: str
    object: tuple[float, float]
    hand: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        for name in ("object", "hand"):
            value = getattr(self, name)
            if value is not None:
                first, second = frozen(value, (2,), f"contacts.{name}").tolist()
                object.__setattr__(self, name, (first, second))


@dataclass(frozen=True, eq=False)
class Existence:
    """A configuration in floats and the box in which an exact one is claimed.

    Attributes:
        joints: value of every free joint by name [rad, m].
        position: (3,) [m] of the object in the palm frame.
        quaternion: (4,) w, x, y, z of the object in the palm frame, not normalised.
        contacts: one for each contact of the task, in its order.
        dependent: labels of the coordinates that the equations determine, as many as there are equations.
        radii: (E,) half widths of the box in these coordinates, in their order and units.

    Raises:
        InputError: wrong shapes, NaN or infinity.
    """

    joints: Mapping[str, float]
    position: Array
    quaternion: Array
    contacts: tuple[ContactPoint, ...]
    dependent: tuple[str, ...]
    radii: Array

    def __post_init__(self) -> None:
        values = frozen(list(self.joints.values()), (len(self.joints),), "joints").tolist()
        object.__setattr__(self, "joints", MappingProxyType(dict(zip(self.joints, values, strict=True))))
        object.__setattr__(self, "position", frozen(self.position, (3,), "position"))
        object.__setattr__(self, "quaternion", frozen(self.quaternion, (4,), "quaternion"))
        object.__setattr__(self, "contacts", tuple(self.contacts))
        object.__setattr__(self, "dependent", tuple(self.dependent))
        object.__setattr__(self, "radii", frozen(self.radii, (len(self.dependent),), "radii"))

    @property
    def coordinates(self) -> dict[str, float]:
        """Every coordinate's float by its label."""
        out = {f"joint:{name}": value for name, value in self.joints.items()}
        out |= {f"position:{i}": float(x) for i, x in enumerate(self.position)}
        out |= {f"quaternion:{i}": float(x) for i, x in enumerate(self.quaternion)}
        for k, contact in enumerate(self.contacts):
            out |= dict(zip((f"contact:{k}:s", f"contact:{k}:t"), contact.object, strict=True))
            if contact.hand is not None:
                out |= dict(zip((f"contact:{k}:u", f"contact:{k}:v"), contact.hand, strict=True))
        return out


# --- which joints a proof speaks of -----------------------------------------------------------------


class ProofRefused(Exception):
    """Why a proof of existence is none."""


def driving_couplings(hand: Hand, joint: int) -> tuple[Coupling, ...]:
    """The couplings between a joint and the one that drives it in the end, nearest first; () if it is free."""
    tied = {c.joint: c for c in hand.couplings}
    path: list[Coupling] = []
    while joint in tied:
        path.append(tied[joint])
        joint = tied[joint].driver
    return tuple(path)


def moving_joints(task: Task) -> dict[int, tuple[Coupling, ...]]:
    """The joints that move some contact, and all that move with them, with what drives each (`driving_couplings`)."""
    path = {j: driving_couplings(task.hand, j) for j in range(task.hand.l)}
    driver = {j: p[-1].driver if p else j for j, p in path.items()}
    driving = {driver[j] for j in task.involved.tolist()} - {-1}
    return {j: path[j] for j in path if driver[j] in driving or j in task.involved}


def free_joints(task: Task) -> tuple[str, ...]:
    """Names of the joints that are coordinates: of `moving_joints` those that are free, by coupling and by limits."""
    joints = task.hand.joints
    free = [joints[j] for j, path in moving_joints(task).items() if not path]
    return tuple(joint.name for joint in free if joint.lower < joint.upper)


# --- the file's form --------------------------------------------------------------------------------

Two = tuple[float, float]
Numbers3 = Annotated[list[float], Field(min_length=3, max_length=3)]
Numbers4 = Annotated[list[float], Field(min_length=4, max_length=4)]


class ExistenceContactEntry(Strict):
    link: str
    object: Two
    hand: Two | None


class ExistenceEntry(Strict):
    """The object as it stands in files."""

    format: Literal["handfast/existence/1"] = Field(alias="schema")
    joints: dict[str, float]
    position: Numbers3
    quaternion: Numbers4
    contacts: list[ExistenceContactEntry]
    dependent: list[str]
    radii: list[float]


def existence_to_dict(proof: Existence) -> dict[str, Any]:
    """The proof as a `handfast/existence/1` object; numbers come back exactly."""
    return {
        "schema": "handfast/existence/1",
        "joints": dict(proof.joints),
        "position": proof.position.tolist(),
        "quaternion": proof.quaternion.tolist(),
        "contacts": [
            {"link": c.link, "object": list(c.object), "hand": None if c.hand is None else list(c.hand)}
            for c in proof.contacts
        ],
        "dependent": list(proof.dependent),
        "radii": proof.radii.tolist(),
    }


def existence_from_dict(data: Any) -> Existence:
    """The proof in a parsed object; raises `InputError` with field and fault."""
    entry = validate(ExistenceEntry, data)
    return Existence(
        joints=entry.joints,
        position=np.array(entry.position),
        quaternion=np.array(entry.quaternion),
        contacts=tuple(ContactPoint(c.link, c.object, c.hand) for c in entry.contacts),
        dependent=tuple(entry.dependent),
        radii=np.array(entry.radii),
    )
