"""A grasp as it might really be: contacts, friction and commands off by no more than stated bounds, drawn at random."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.core.transforms import normal_frame
from handfast.model.grasp import Contact, Grasp

STEEPEST = np.pi / 2  # [rad] a normal that is off by more points out of the object
PARTS = ("positions", "normals", "friction", "command")  # each with random numbers of its own


@dataclass(frozen=True)
class Perturbation:
    """How far a grasp may be from its file; 0 is exact.

    Every contact and every actuator is off by itself, all in the same sample. All densities are uniform.

    Attributes:
        positions: [m] radius of the ball about each contact in which it may be.
        normals: [rad] half angle of the cone about each normal in which it may be.
        friction: share of each contact's coefficient by which that may be larger or smaller, 0 to 1.
        command: share of each commanded force or torque by which that may be larger or smaller, below 1.

    Raises:
        InputError: a bound that is negative, not finite or too large, or all of them 0.
    """

    positions: float = 0.0
    normals: float = 0.0
    friction: float = 0.0
    command: float = 0.0

    def __post_init__(self) -> None:
        for name, most in (("positions", np.inf), ("normals", STEEPEST), ("friction", 1.0), ("command", 1.0)):
            value = getattr(self, name)
            if not (np.isfinite(value) and 0 <= value <= most) or (name == "command" and value == most):
                right = {"positions": "0 m or more", "normals": "0 to 90 degrees", "friction": "a share from 0 to 1"}
                text = right.get(name, "a share from 0 to below 1, so that no command is lost")
                raise InputError(f"is {value:g}; {text} is needed", field=name)
        if not any(getattr(self, f.name) for f in fields(self)):
            raise InputError("are all 0; give at least one of positions, normals, friction and command", field="bounds")

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
