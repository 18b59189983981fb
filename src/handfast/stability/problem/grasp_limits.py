"""What limits the forces of a grasp beside the model: its actuators, its contacts, and how well normals are known."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from handfast.core.arrays import Array
from handfast.core.errors import InputError, refuse_other_kinds
from handfast.model.grasp import Grasp
from handfast.proofs.constants import MAX_ETA
from handfast.stability.problem.settings import Loading


@dataclass(frozen=True)
class GraspLimits:
    """Within what a grasp has to resist a load; each query takes it as `limits=`.

    Attributes:
        eta: uncertainty of the contact normals [rad], 0 <= eta < 45 degrees: section VI of the stability paper, (17).
        torque_limits: actuator -> largest |f| of motor and gearing together [N m or N], passive reaction included.
        force_limit: largest normal force at any contact [N]; None for none.

    Raises:
        InputError: eta out of range, a limit that is not positive.
    """

    eta: float = 0.0
    torque_limits: Mapping[str, float] = field(default_factory=dict)
    force_limit: float | None = None

    def __post_init__(self) -> None:
        refuse_other_kinds(self)
        if not 0 <= self.eta < MAX_ETA:
            raise InputError(f"is {np.degrees(self.eta):g} degrees; 0 to 45 is possible", field="eta")
        if self.force_limit is not None and not self.force_limit > 0:
            raise InputError(f"is {self.force_limit:g}; a largest normal force is positive", field="force limit")
        for name, limit in self.torque_limits.items():
            if not limit > 0:
                raise InputError(f"is {limit:g}; a limit is positive", field=f"torque limit.{name}")

    @property
    def limits_forces(self) -> bool:
        """Is any force limited, so that states are no multiples of each other?"""
        return bool(self.torque_limits) or bool(np.isfinite(self.largest_normal_force))

    @property
    def largest_normal_force(self) -> float:
        """[N] inf for none."""
        return np.inf if self.force_limit is None else self.force_limit

    def largest_forces(self, grasp: Grasp) -> Array:
        """(a,) [N m or N] the largest |f| of each actuator; inf where there is no limit. `InputError`: unknown name."""
        f_max = np.full(grasp.mechanism.a, np.inf)
        for name, limit in self.torque_limits.items():
            i = int(np.flatnonzero(grasp.mechanism.commands({name: 1.0}, field="torque limit"))[0])
            f_max[i] = limit
        return f_max

    def check_backdrivable(self, grasp: Grasp) -> None:
        """Refuse a limit that a backdrivable motor's command is beyond: such a motor has nothing but its command."""
        for i in np.flatnonzero(grasp.mechanism.backdrivable):
            name, command = grasp.mechanism.actuators[i], abs(grasp.command[i])
            limit = self.torque_limits.get(name, np.inf)
            if command > limit:
                problem = f"is {limit:g}; '{name}' is backdrivable and gives its command, {command:g}"
                raise InputError(problem, field=f"torque limit.{name}")

    def to_json(self) -> dict[str, Any]:
        """As questions in files have it; eta in radians."""
        return {
            "eta": float(self.eta),
            "torque_limits": {name: float(limit) for name, limit in self.torque_limits.items()},
            "force_limit": None if self.force_limit is None else float(self.force_limit),
        }


NO_LIMITS = GraspLimits()


@dataclass(frozen=True)
class AskedWith:
    """With what numbers in a file were asked for: limits, mdp and loading of `check`, relative gap of `Settings`."""

    limits: GraspLimits = NO_LIMITS
    mdp: bool = True
    gap: float = 1e-3
    loading: Loading = "together"

    @property
    def along_paths(self) -> bool:
        """Do loads come after the commands?"""
        return self.loading != "together"

    def to_json(self) -> dict[str, Any]:
        """As files of answers have it beside the grasp."""
        of_paths = {"loading": self.loading} if self.along_paths else {}
        return self.limits.to_json() | {"mdp": self.mdp, "gap": self.gap} | of_paths
