"""What a step of a load's path remembers of the state before it: how far springs, stops and tendons have come."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Annotated

import numpy as np

from handfast.core.arrays import Array, frozen
from handfast.core.errors import InputError
from handfast.core.schema import InFiles, Numbers


@dataclass(frozen=True, eq=False)
class Start(InFiles):
    """The state that a step starts from, as far as the step needs it; see docs/load-path.md.

    Friction and commanded gearing know what moves in the step alone. Springs, stops and tendons that nobody commands
    know the whole motion: these are its parts from before. Motions are virtual, at unit stiffness, as in
    `handfast.stability.problem.model`.

    Attributes:
        gaps: (m,) [N] of the contacts along their normals; negative where a spring is pressed, by its force.
        stops: (l,) motion of each joint away from the stop at which it stood, 0 or more; 0 without one.
        slack: (a,) motion of each tendon that nobody commands, 0 or more; 0 for other actuators.

    Raises:
        InputError: a number that is not finite, a negative way from a stop or slack.
    """

    gaps: Annotated[Array, Numbers(None)]
    stops: Annotated[Array, Numbers(None)]
    slack: Annotated[Array, Numbers(None)]

    def __post_init__(self) -> None:
        for f in fields(self):
            value = np.asarray(getattr(self, f.name), dtype=float)
            object.__setattr__(self, f.name, frozen(value, value.shape, f.name))
        for name in ("stops", "slack"):
            if (getattr(self, name) < 0).any():
                raise InputError(f"has {getattr(self, name).min():g}; 0 or more is needed", field=name)

    def times(self, s: float) -> Start:
        """All of it times s > 0: with load and commands times s, so are the states of the step."""
        return Start(*(s * getattr(self, f.name) for f in fields(self)))
