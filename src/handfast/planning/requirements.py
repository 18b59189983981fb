"""What grasps are to obey beside their loads."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from handfast.core.errors import InputError, unknown_name
from handfast.model.grasp import Grasp
from handfast.model.hand.hand import Hand
from handfast.stability.settings import Settings


@dataclass(frozen=True, eq=False, kw_only=True)
class Limits:
    """Within what a grasp has to hold.

    Attributes:
        command_limit: largest command [N m or N]; None where none was stated.
        torque_limits: actuator -> largest force of motor and gearing [N m or N].
        force_limit: largest normal force at any contact [N].
        eta: uncertainty of the contact normals [rad].
        settings: of each query about stability; None for the planner's own.
    """

    command_limit: float | None = None
    torque_limits: Mapping[str, float] | None = None
    force_limit: float | None = None
    eta: float = 0.0
    settings: Settings | None = None

    @property
    def of_a_load(self) -> dict[str, Any]:
        """What `check` and `hold` take of these."""
        return {"torque_limits": self.torque_limits, "force_limit": self.force_limit, "eta": self.eta}


@dataclass(frozen=True, eq=False, kw_only=True)
class Requirements(Limits):
    """The numbers of a question about grasps for a task.

    Attributes:
        friction: coefficient at every contact.
        actuators: that may be commanded.
    """

    friction: float
    actuators: tuple[str, ...]

    @classmethod
    def of(cls, limits: Limits, friction: float, actuators: Sequence[str]) -> Requirements:
        """These limits, with the friction and the actuators."""
        return cls(friction=friction, actuators=tuple(actuators), **vars(limits))

    def driven(self, grasp: Grasp) -> list[str]:
        """The actuators of a grasp that may be commanded; where none of those asked for moves it, all of its own."""
        own = grasp.mechanism.actuators
        return [n for n in self.actuators if n in own] or list(own)


def link_pairs(hand: Hand, ignored: Sequence[tuple[str, str]]) -> tuple[tuple[str, str], ...]:
    """Pairs of two links in an order of their own, each once and known to the hand; `InputError` otherwise."""
    for name in (name for pair in ignored for name in pair):
        if name not in hand.link_names:
            raise unknown_name("link", name, hand.link_names, field="ignored")
    for one, other in ignored:
        if one == other:
            raise InputError(f"has {one} with itself; two links are needed", field="ignored")
    return tuple(sorted({(min(pair), max(pair)) for pair in ignored}))
