"""What a grasp is to hold, as the options that `grasp` and `plan` share."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from tyro.conf import UseAppendAction, arg

from handfast.cli.options import Wrench
from handfast.core.errors import InputError

if TYPE_CHECKING:
    from handfast.model.body import Body
    from handfast.stability.problem.loads import Loads

Axis = Literal["x", "-x", "y", "-y", "z", "-z"]


@dataclass(kw_only=True)
class LoadsOptions:
    """Wrenches, each of which one preload has to hold."""

    up: Annotated[Axis | None, arg(metavar="AXIS")] = None
    """the object's axis that points up: its weight pulls the other way; by default along all six, one by one"""
    tilt: Annotated[tuple[str, float] | None, arg(metavar="AXIS DEG")] = None
    """tip the object about its axis x, y or z by up to DEG degrees from upright (--up, or z)"""
    wrench: UseAppendAction[tuple[Wrench, ...]] = ()
    """a load in place of the weight, or beside --up: force [N] and torque [N m] at the object's origin; repeatable"""
    loads: Annotated[Path | None, arg(metavar="FILE.json")] = None
    """a handfast/loads/1 file with more of them"""
    safety: Annotated[float, arg(metavar="FACTOR")] = 1.5
    """times every load is to be held: a grasp that holds its loads and no more lets go at the first disturbance"""

    def asked(self, body: Body) -> Loads:
        """All the loads that were asked for, without the factor of safety."""
        import numpy as np

        from handfast.stability.problem.loads import Loads, load_loads

        up = self.up or ("z" if self.tilt else None)
        found: list[Loads] = []
        if up:
            down = up[1:] if up.startswith("-") else f"-{up}"
            if self.tilt is None:
                found.append(Loads.gravity(body, down))
            else:
                axis, angle = self.tilt
                if axis not in ("x", "y", "z") or axis == up[-1]:
                    others = " or ".join(a for a in "xyz" if a != up[-1])
                    raise InputError(f"is about {axis}; {others} is needed, {up} points up", field="--tilt")
                sign = -1.0 if down.startswith("-") else 1.0
                vertical = sign * np.eye(3)["xyz".index(down[-1])]
                found.append(Loads.tilt(body, np.eye(3)["xyz".index(axis)], np.radians(angle), down=vertical))
        for k, w in enumerate(self.wrench):
            found.append(Loads.wrench(w, "wrench" if len(self.wrench) == 1 else f"wrench {k + 1}"))
        if self.loads:
            found.append(load_loads(self.loads))
        whole = found[0] if found else Loads.gravity(body)
        for more in found[1:]:
            whole += more
        return whole
