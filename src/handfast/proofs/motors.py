"""What drives and holds the joints of a hand, and how much work it can do at most on a motion of them.

Motors have limits; a tendon only pulls. Gearing without a limit, springs and passive tendons can do any work, and so
can a stop on a motion away from it. Dry friction does no more than itself times the motion.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from handfast.proofs.fields import Array, BadFile, Fields, Mask, number, refuse_unknown
from handfast.proofs.intervals import Interval
from handfast.proofs.tasks import TaskData

STOP_ANGLE = 1e-3  # [rad] a joint this near to its stop stands at it: its fingertip, 0.1 m away, is within 0.1 mm
STOP_TRAVEL = 1e-4  # [m] the same of a slide; both are less than the gap across which surfaces still touch
STOP_INFLATION = 1 + 1e-9  # over the rounding of a value that is compared with a stop


@dataclass(frozen=True, eq=False)
class Motors:
    """What drives and holds a hand's l joints.

    Attributes:
        rows: (a, l) of each actuator, how it moves with the joints. tendon: (a,) which only pull.
        limits: (a,) of each actuator the largest force with its gearing [N m, N]; inf for none.
        friction: (l,) dry friction of the joints [N m, N].
        sprung: (l,) which joints springs or passive tendons push in both senses.
        stops: (l, 2) up to which value the lower stop pushes a joint upwards, and from which on the upper one pushes it
            downwards [rad, m]: a little before where they are. Infinite where there is none.
    """

    rows: Array
    tendon: Mask
    limits: Array
    friction: Array
    sprung: Mask
    stops: Array

    @classmethod
    def read(
        cls, f: Fields, task: TaskData, torque_limits: Mapping[str, float], command_limit: float = np.inf
    ) -> Motors:
        """The `motors` of a grasps file. A motor that can be turned back gives what it is commanded, and no more."""
        names = task.hand.joints
        rows, tendon, most = [], [], []
        for part in f.objects("actuators"):
            name, moved = part.text("name"), part.named("joints")
            for joint in moved:
                refuse_unknown(joint, names, "joint", part.at("joints"))
            rows.append([moved.get(joint, 0.0) for joint in names])
            tendon.append(part.flag("tendon", False))
            commanded = command_limit if part.flag("backdrivable", False) else np.inf
            most.append(min(torque_limits.get(name, np.inf), commanded))
        friction, sprung = np.zeros(len(names)), np.zeros(len(names), dtype=bool)
        stops = np.tile([-np.inf, np.inf], (len(names), 1))
        if f.has("laws"):
            laws = f.object("laws")
            for joint in laws.names():
                refuse_unknown(joint, names, "joint", laws.place)
                j, law = names.index(joint), laws.object(joint)
                friction[j] = law.number("friction", 0.0, least=0.0)
                sprung[j] = law.number("stiffness", 0.0) != 0
                near = STOP_ANGLE if task.hand.revolute[j] else STOP_TRAVEL
                for k, (end, sense) in enumerate(zip(_stops(law), (1, -1), strict=True)):
                    if end is not None:
                        stops[j, k] = end + sense * (near + abs(end) * (STOP_INFLATION - 1)) * STOP_INFLATION
        if f.has("tendons"):
            tendons = f.object("tendons")
            for name in tendons.names():
                for joint in tendons.object(name).named("joints"):
                    refuse_unknown(joint, names, "joint", tendons.place)
                    sprung[names.index(joint)] = True
        table = np.array(rows).reshape(len(rows), len(names))
        return cls(table, np.array(tendon, dtype=bool), np.array(most, dtype=float), friction, sprung, stops)

    def work(self, rates: Interval, joints: Interval) -> Array:
        """(N,) the most that they can do on motions (N, l) of the joints at values (N, l); inf if that has no limit.

        An entry of `rates` that is exactly 0 is no motion.
        """
        moved = (rates.ends != 0).any(axis=2)  # (N, l)
        at_low, at_high = joints.lo <= self.stops[:, 0], joints.hi >= self.stops[:, 1]
        free = moved & (self.sprung | (at_low & (rates.hi > 0)) | (at_high & (rates.lo < 0)))
        endless, total = free.any(axis=1), (Interval.of(rates.mag) * self.friction).sum()
        for row, tendon, limit in zip(self.rows, self.tendon.tolist(), self.limits.tolist(), strict=True):
            its = np.flatnonzero(row)
            own = (rates[:, its] * row[its]).sum()
            by = np.where(moved[:, its].any(axis=1), np.maximum(own.hi, 0.0) if tendon else own.mag, 0.0)
            if np.isfinite(limit):
                total = total + Interval.of(by) * limit
            else:
                endless |= by != 0
        return np.where(endless, np.inf, total.hi)


def _stops(law: Fields) -> list[float | None]:
    """[rad, m] where the lower and the upper stop of a joint are; None where there is none."""
    ends = law.take("stops", None)
    if ends is None:
        return [None, None]
    if not isinstance(ends, list | tuple) or len(ends) != 2:
        raise BadFile(f"is {ends!r}; the lower and the upper one are needed, null for none", law.at("stops"))
    return [None if end is None else number(end, law.at("stops")) for end in ends]
