"""How motors move joints: the two matrices R and A between actuators, couplings and joints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from handfast.core.arrays import Array, frozen
from handfast.core.errors import InputError, kinds_checked, unknown_name

MIN_COEFFICIENT = 1e-50  # below it a coefficient is none: its square vanishes


@dataclass(frozen=True, eq=False)
class Mechanism:
    """Actuators and couplings of a hand.

    Actuator displacements are t = R q with forces f, rigid couplings hold A q = 0 with free
    multipliers, so that joint torques are tau = R^T f + A^T lambda. R = I and no A is the hand of
    the stability paper (one motor per joint, section III). A joint that is in no actuator and in no
    coupling swings freely.

    Attributes:
        actuators: names, length a.
        R: (a, l) actuator displacement per joint motion.
        A: (k, l) rigid couplings, A q = 0; may have no rows.
        tendon: length a; a tendon can only pull (f >= 0) and goes slack when its finger closes by itself.
        backdrivable: length a; such a motor gives what it is commanded and no more, whichever way it is turned:
            f = f_c, and t is free. Without command it swings freely. None unless given.
    """

    actuators: tuple[str, ...]
    R: Array
    A: Array
    tendon: tuple[bool, ...]
    backdrivable: tuple[bool, ...] = ()

    def __post_init__(self) -> None:
        l = np.shape(self.R)[1] if np.ndim(self.R) == 2 else 0
        object.__setattr__(self, "actuators", tuple(self.actuators))
        object.__setattr__(self, "R", frozen(self.R, (len(self.actuators), l), "mechanism.R"))
        k = len(self.A)
        object.__setattr__(self, "A", frozen(self.A, (k, l), "mechanism.A"))
        object.__setattr__(self, "tendon", tuple(bool(b) for b in self.tendon))
        if len(self.tendon) != len(self.actuators):
            raise InputError("needs one value per actuator", field="mechanism.tendon")
        given = tuple(bool(b) for b in self.backdrivable)
        object.__setattr__(self, "backdrivable", given or (False,) * len(self.actuators))
        if len(self.backdrivable) != len(self.actuators):
            raise InputError("needs one value per actuator", field="mechanism.backdrivable")
        for name, pulls, turns in zip(self.actuators, self.tendon, self.backdrivable, strict=True):
            if pulls and turns:
                problem = f"'{name}' is a tendon and backdrivable; leave tendon out, its command is all it pulls with"
                raise InputError(problem, field="mechanism.backdrivable")
        twice = sorted({n for n in self.actuators if self.actuators.count(n) > 1})
        if twice:
            raise InputError(f"actuator '{twice[0]}' is defined twice", field="mechanism.actuators")
        for name, row in zip(self.actuators, self.R, strict=True):
            if np.abs(row).max(initial=0.0) < MIN_COEFFICIENT:
                raise InputError(f"actuator '{name}' moves no joint", field="mechanism.actuators")
        for i, row in enumerate(self.A):
            if np.abs(row).max(initial=0.0) < MIN_COEFFICIENT:
                raise InputError("ties no joint", field=f"mechanism.couplings[{i}]")

    @property
    def a(self) -> int:
        """Number of actuators."""
        return len(self.actuators)

    @classmethod
    def direct(cls, joints: Sequence[str]) -> Mechanism:
        """One motor per joint, named like the joint: R = I, no couplings."""
        l = len(joints)
        return cls(tuple(joints), np.eye(l), np.zeros((0, l)), (False,) * l)

    @kinds_checked
    def commands(self, preload: Mapping[str, float] | None, *, field: str = "preload") -> Array:
        """The commanded forces f_c (a,) from actuator names; absent actuators are 0, that is locked.

        Raises `InputError` for an unknown actuator (the known ones are listed), a value that is not
        finite, or a tendon commanded to push.
        """
        f = np.zeros(self.a)
        for name, value in (preload or {}).items():
            if name not in self.actuators:
                raise unknown_name("actuator", name, self.actuators, field=field)
            if not np.isfinite(value):
                raise InputError(f"is {value}; a finite torque or force is needed", field=f"{field}.{name}")
            i = self.actuators.index(name)
            if self.tendon[i] and value < 0:
                raise InputError(f"is {value}; a tendon can only pull, give 0 or more", field=f"{field}.{name}")
            f[i] = value
        f.flags.writeable = False
        return f
