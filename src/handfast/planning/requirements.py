"""What grasps for a task are to obey, beside the task itself and the loads."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from handfast.model.grasp import Grasp


@dataclass(frozen=True, eq=False)
class Asked:
    """The numbers of a question.

    Attributes:
        friction: coefficient at every contact.
        actuators: that may be commanded.
        eta: uncertainty of the contact normals [rad].
        torque_limits: actuator -> largest force of motor and gearing [N m or N].
        force_limit: largest normal force at any contact [N].
        command_limit: largest command [N m or N]; None where none was stated.
    """

    friction: float
    actuators: tuple[str, ...]
    eta: float = 0.0
    torque_limits: Mapping[str, float] = field(default_factory=dict)
    force_limit: float | None = None
    command_limit: float | None = None

    def driven(self, grasp: Grasp) -> list[str]:
        """The actuators of a grasp that may be commanded; where none of those asked for moves it, all of its own."""
        own = grasp.mechanism.actuators
        return [n for n in self.actuators if n in own] or list(own)
