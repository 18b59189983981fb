"""A grasp as it might really be: contacts, friction and commands off by no more than stated bounds, drawn at random."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from numbers import Real
from typing import Any

import numpy as np

from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.core.transforms import normal_frame
from handfast.model.grasp import Contact, Grasp
from handfast.stability.problem.grasp_limits import MAX_ETA

BOUNDS = {  # what is too large, and what is right
    "positions": (np.inf, "0 m or more"),
    "normals": (MAX_ETA, "0 to below 45 degrees, as for eta,"),
    "friction": (np.nextafter(1.0, 2.0), "a share from 0 to 1"),
    "command": (1.0, "a share from 0 to below 1, so that no command is lost"),
}
PARTS = ("positions", "normals", "friction", "command")  # each with random numbers of its own


@dataclass(frozen=True)
class Perturbation:
    """How far a grasp may be from its file; 0 is exact.

    Every contact and every actuator is off by itself, all in the same sample. All densities are uniform.

    Attributes:
        positions: [m] radius of the ball about each contact in which it may be.
        normals: [rad] half angle of the cone about each normal in which it may be, below 45 degrees.
        friction: share of each contact's coefficient by which that may be larger or smaller, 0 to 1.
        command: share of each commanded force or torque by which that may be larger or smaller, below 1.

    Raises:
        InputError: a bound that is no number, negative, not finite or too large, or all of them 0.
    """

    positions: float = 0.0
    normals: float = 0.0
    friction: float = 0.0
    command: float = 0.0

    def __post_init__(self) -> None:
        for name, (least_too_large, right) in BOUNDS.items():
            given = getattr(self, name)
            value = float(given) if isinstance(given, Real) else np.nan
            if not (np.isfinite(value) and 0 <= value < least_too_large):
                shown = f"{value:g}" if isinstance(given, Real) else repr(given)
                raise InputError(f"is {shown}; {right} is needed", field=name)
        if not any(getattr(self, f.name) for f in fields(self)):
            raise InputError("are all 0; give at least one of positions, normals, friction and command", field="bounds")

    def leaves(self, grasp: Grasp) -> bool:
        """Is every sample the grasp itself, for want of commands or friction to be off?"""
        rubs, driven = self.friction and grasp.mu.any(), self.command and grasp.command.any()
        return not (self.positions or self.normals or rubs or driven)

    def sample(self, grasp: Grasp, seed: int, number: int) -> Grasp:
        """The sample of this number: the same for the same seed, however many there are and whatever else varies."""
        draws = {part: np.random.default_rng([seed, number, k]) for k, part in enumerate(PARTS)}
        off = self.positions * _in_ball(draws["positions"], grasp.m)
        tilts = _in_cone(draws["normals"], grasp.m, self.normals)
        mu = grasp.mu * (1 + self.friction * draws["friction"].uniform(-1, 1, grasp.m))
        factors = 1 + self.command * draws["command"].uniform(-1, 1, grasp.mechanism.a)
        contacts = [
            _moved(c, p, tilt, f) for c, p, tilt, f in zip(grasp.contacts, off, tilts, mu.tolist(), strict=True)
        ]
        return Grasp(contacts, grasp.joints, grasp.mechanism, grasp.command * factors, grasp.name)

    def to_json(self) -> dict[str, Any]:
        """The bounds by name, in SI units."""
        return {part: float(getattr(self, part)) for part in PARTS}


def _moved(contact: Contact, off: Array, tilt: Array, friction: float) -> Contact:
    normal = normal_frame(contact.normal) @ tilt
    torsion = contact.torsion * friction / contact.friction if contact.torsion else 0.0
    return replace(contact, position=contact.position + off, normal=normal, friction=friction, torsion=torsion)


def _in_ball(rng: np.random.Generator, n: int) -> Array:
    """(n, 3) uniform in the unit ball."""
    x = rng.normal(size=(n, 3))
    out: Array = x / np.linalg.norm(x, axis=1)[:, None] * rng.uniform(size=n)[:, None] ** (1 / 3)
    return out


def _in_cone(rng: np.random.Generator, n: int, angle: float) -> Array:
    """(n, 3) unit vectors, uniform by area within an angle [rad] of the first axis."""
    cos = 1 - (1 - np.cos(angle)) * rng.uniform(size=n)
    around, sin = rng.uniform(0, 2 * np.pi, n), np.sqrt(np.maximum(0.0, 1 - cos**2))
    return np.column_stack([cos, sin * np.cos(around), sin * np.sin(around)])
