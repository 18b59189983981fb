"""Loads: the wrenches that one grasp has to hold, each with a name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np
from pydantic import Field

from handfast.core.arrays import Array, frozen
from handfast.core.errors import InputError, kinds_checked
from handfast.core.files import Six, Strict, read_json, validate
from handfast.core.presented import Presented

if TYPE_CHECKING:
    from handfast.model.body import Body

LOAD_AXES = ("+x", "-x", "+y", "-y", "+z", "-z")


@dataclass(frozen=True, eq=False)
class Weight:
    """What makes a load of an object's weight.

    Attributes:
        along: (3,) in which gravity pulls, object axes, any length.
        g: [m/s^2].
        factor: of safety.
    """

    along: Array
    g: float
    factor: float = 1.0

    def wrench(self, mass: float, center_of_mass: Array) -> Array:
        """(6,) [N, N m] at the object's origin, of a mass [kg] at its centre (3,) [m]; raises as `body.weight`."""
        from handfast.model.body import weight

        return self.factor * weight(mass, center_of_mass, self.along, self.g)


@dataclass(frozen=True, eq=False)
class Loads(Presented):
    """Wrenches on the object, one at a time. Object frame, at its origin.

    Attributes:
        names: k, unique, for reports.
        wrenches: (k, 6) force [N] and torque [N m].
        weights: k, where each comes from; None for a wrench that was given as such. Unless given, all of them.

    Raises:
        InputError: none at all, a name twice, a wrench that is not finite.
    """

    names: tuple[str, ...]
    wrenches: Array
    weights: tuple[Weight | None, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "names", tuple(self.names))
        object.__setattr__(self, "weights", tuple(self.weights) or (None,) * len(self.names))
        if not self.names:
            raise InputError("are empty; at least one is needed", field="loads")
        twice = [n for i, n in enumerate(self.names) if n in self.names[:i]]
        if twice:
            raise InputError(f"has '{twice[0]}' twice", field="loads")
        object.__setattr__(self, "wrenches", frozen(self.wrenches, (len(self.names), 6), "loads"))

    @classmethod
    def _of_weight(cls, body: Body, names: Sequence[str], along: Sequence[Array], g: float) -> Loads:
        wrenches = np.array([body.gravity_wrench(v, g) for v in along]).reshape(-1, 6)
        return cls(tuple(names), wrenches, tuple(Weight(frozen(v, (3,), "gravity"), g) for v in along))

    @classmethod
    def wrench(cls, wrench: Sequence[float] | Array, name: str = "wrench") -> Loads:
        """A single wrench (6,) [N, N m], or (3,) a force at the origin."""
        try:
            given = np.asarray(wrench, dtype=float)
        except (TypeError, ValueError):
            raise InputError(
                f"is {wrench!r}; six numbers are needed, or three for a force alone", field="wrench"
            ) from None
        whole = np.concatenate([given, np.zeros(3)]) if given.shape == (3,) else given
        return cls((name,), whole[None])

    @classmethod
    @kinds_checked
    def gravity(cls, body: Body, directions: str | Sequence[str] | Array = "all", g: float = 9.81) -> Loads:
        """The object's weight at its centre of mass, gravity pulling along each of some directions.

        Args:
            directions: "all", the axes of the object both ways; names of axes such as "-z"; or vectors (n, 3)
                of any length, object axes. Six directions stand for all of them; more are a longer (n, 3).
            g: [m/s^2].

        Raises:
            InputError: the mass is unknown, a direction of another name, or zero.
        """
        if isinstance(directions, str):
            directions = LOAD_AXES if directions == "all" else [directions]
        if not hasattr(directions, "__iter__"):
            raise InputError(
                f"is {directions}; all, {', '.join(LOAD_AXES)} or vectors (n, 3) are needed", field="directions"
            )
        names, vectors = [], []
        for k, d in enumerate(directions):
            names.append(f"gravity {_axis_name(d)}" if isinstance(d, str) else f"gravity {k}")
            vectors.append(_axis(d) if isinstance(d, str) else np.asarray(d, dtype=float))
        return cls._of_weight(body, names, vectors, g)

    @classmethod
    @kinds_checked
    def tilt(
        cls,
        body: Body,
        axis: Sequence[float] | Array,
        angle: float,
        steps: int = 7,
        down: Sequence[float] | Array = (0.0, 0.0, -1.0),
        g: float = 9.81,
    ) -> Loads:
        """The weight while the object is tipped: from upright to `angle` [rad] about an axis of the object.

        Args:
            axis: (3,) about which the object turns, object axes, any length; gravity turns the other way.
            steps: orientations, both ends included.
            down: (3,) where gravity pulls while the object is upright, object axes.
        """
        from scipy.spatial.transform import Rotation

        k = frozen(axis, (3,), "axis")
        if np.linalg.norm(k) < 1e-12:
            raise InputError("is zero; give the axis about which the object is tipped", field="axis")
        if steps < 1:
            raise InputError(f"is {steps}; at least 1 orientation is needed", field="steps")
        k = k / np.linalg.norm(k)
        angles = np.linspace(0.0, angle, steps) if steps > 1 else np.array([angle])
        names = tuple(f"tipped {np.degrees(a):.4g}°" for a in angles)
        return cls._of_weight(body, names, [Rotation.from_rotvec(-a * k).apply(down) for a in angles], g)

    @kinds_checked
    def scaled(self, factor: float) -> Loads:
        """The same loads, larger by a safety factor."""
        if not (np.isfinite(factor) and factor > 0):
            raise InputError(f"is {factor:g}; a positive number is needed", field="safety")
        if factor == 1:
            return self
        weights = [w and replace(w, factor=factor * w.factor) for w in self.weights]
        return Loads(self.names, factor * self.wrenches, tuple(weights))

    @property
    def by_name(self) -> dict[str, list[float]]:
        """Each wrench under its name, as JSON-able data."""
        return dict(zip(self.names, self.wrenches.tolist(), strict=True))

    def __add__(self, other: Loads) -> Loads:
        wrenches = np.vstack([self.wrenches, other.wrenches])
        return Loads(self.names + other.names, wrenches, self.weights + other.weights)

    def __len__(self) -> int:
        return len(self.names)


def _axis_name(name: str) -> str:
    return name if name[:1] in "+-" else f"+{name}"


def _axis(name: str) -> Array:
    """(3,) unit vector of a direction such as "-z" or "x"."""
    if _axis_name(name) not in LOAD_AXES:
        raise InputError(f"is '{name}'; all, {', '.join(LOAD_AXES)} or a vector is needed", field="gravity")
    sign = -1.0 if name[0] == "-" else 1.0
    return sign * np.eye(3)["xyz".index(name[-1])]


# --- files of loads -----------------------------------------------------------------------------


class LoadsFile(Strict):
    """The whole file: force [N] and torque [N m] at the object's origin, object frame, by name."""

    format: Literal["handfast/loads/1"] = Field(alias="schema")
    loads: dict[str, Six]


def load_loads(path: str | Path) -> Loads:
    """Read a loads file.

    Raises:
        InputError: one line with file, field and fault.
    """
    try:
        entry = validate(LoadsFile, read_json(path, "handfast/loads/1"))
        return Loads(tuple(entry.loads), np.array(list(entry.loads.values())).reshape(-1, 6))
    except InputError as fault:
        raise fault.at(str(path)) from None
