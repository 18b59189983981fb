"""What acts on the joints of a hand besides its motors: stops, dry friction and springs."""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from typing import Annotated, Literal

import numpy as np

from handfast.core.arrays import Array, frozen
from handfast.core.errors import InputError, require_not_negative
from handfast.core.schema import OPEN_FIELD, InFiles, NullFor

LAWS = ("stops", "friction", "springs")
NO_STOPS = (-np.inf, np.inf)


@dataclass(frozen=True)
class JointLaw(InFiles):
    """What a joint, or a tendon, has besides its motor, in the sense of its own value.

    Attributes:
        friction: the largest torque or force of dry friction [N m, N]; 0 or more.
        stiffness: of a spring [N m/rad, N/m]; 0 or more.
        rest: the values between which the spring is slack, one value mostly.
        stops: the values beyond which something solid keeps the joint, infinite where nothing does. `Joint.lower` and
            `upper` say where it may be asked to go, which may be less.
    """

    friction: float = 0.0
    stiffness: float = 0.0
    rest: tuple[float, float] = (0.0, 0.0)
    stops: tuple[Annotated[float, NullFor(-np.inf)], Annotated[float, NullFor(np.inf)]] = field(
        default=NO_STOPS, metadata=OPEN_FIELD
    )

    def __post_init__(self) -> None:
        for name in ("friction", "stiffness"):
            value = float(getattr(self, name))
            require_not_negative(value, name)
            object.__setattr__(self, name, value)
        for name in ("rest", "stops"):
            low, high = (float(x) for x in getattr(self, name))
            if not low <= high or (name == "rest" and not np.isfinite([low, high]).all()):
                raise InputError(f"are {low:g} and {high:g}; two numbers, the lower one first, are needed", field=name)
            object.__setattr__(self, name, (low, high))

    @property
    def springs(self) -> bool:
        """Whether there is a spring."""
        return self.stiffness > 0

    @property
    def any(self) -> bool:
        """Whether there is anything at all."""
        return self != NO_LAW

    def torque(self, value: float) -> float:
        """What the spring does at a value [N m, N], towards its rest."""
        low, high = self.rest
        return self.stiffness * (low - value if value < low else min(high - value, 0.0))

    def stop(self, value: float, near: float) -> Literal["", "lower", "upper", "both"]:
        """The stops at which a joint stands, or past which it is, as `GraspJoint.stop`; within `near` counts."""
        low, high = value <= self.stops[0] + near, value >= self.stops[1] - near
        return "both" if low and high else "lower" if low else "upper" if high else ""

    def within(self, lower: float, upper: float) -> JointLaw:
        """For a joint of which somebody knows better where it can go: a stop between the limits is none."""
        stops = (
            self.stops[0] if lower >= self.stops[0] else -np.inf,
            self.stops[1] if upper <= self.stops[1] else np.inf,
        )
        return replace(self, stops=stops)

    def only(self, kept: frozenset[str]) -> JointLaw:
        """Without what is not among some of `LAWS`."""
        law = self if "stops" in kept else replace(self, stops=NO_STOPS)
        law = law if "friction" in kept else replace(law, friction=0.0)
        return law if "springs" in kept else replace(law, stiffness=0.0, rest=(0.0, 0.0))


NO_LAW = JointLaw()


@dataclass(frozen=True, eq=False)
class PassiveTendon:
    """A tendon over joints, whether or not a motor pulls it, that has friction, a spring or stops of its own.

    Attributes:
        name: of the tendon.
        row: (l,) its length per joint value [m/rad, or what the file counts]; its length is row @ q.
        law: of the tendon, in the sense in which it grows longer.
    """

    name: str
    row: Array
    law: JointLaw

    def __post_init__(self) -> None:
        object.__setattr__(self, "row", frozen(self.row, np.shape(self.row), f"{self.name}.row"))
        if not np.any(self.row):
            raise InputError("moves with no joint", field=f"tendon {self.name}")


def laws_named(text: str, field: str = "laws") -> frozenset[str]:
    """Which of `LAWS` are meant by "all", "none", or names with commas; `InputError` for another word."""
    words = [w for w in re.split(r"[,\s]+", text) if w]
    if words in (["all"], ["none"]):
        return frozenset(LAWS if words == ["all"] else ())
    for word in words:
        if word not in LAWS:
            right = f"all, none, or some of {', '.join(LAWS)} with commas between them"
            raise InputError(f"is '{text}'; {right}", field=field)
    if not words:
        raise InputError("is empty; none is the word for no law", field=field)
    return frozenset(words)
