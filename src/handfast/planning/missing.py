"""What is missing for a reason to discard a box of configurations: how nearly a proof that there is no grasp works.

The claims are those that were tried last on the box that it is half of: a box that is left was not looked at itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from handfast.core.arrays import Array
from handfast.proofs.discarded_boxes import Balance, Boxes, Collision
from handfast.proofs.posed_boxes import OBJECT_LINK, ContactBoxes, mean_value
from handfast.proofs.unbalanced import BoxBounds, nearness

ANGLE_LENGTH = 0.02  # [m] by which angles are compared with lengths


@dataclass(frozen=True)
class Missing:
    """For one reason, in one box.

    Attributes:
        reason: `contacts`, `balance`, `slips` or `collision`.
        about: of a collision the link and what it is in; else empty.
        missing: by how much it is missed. Of a collision, by which the link would have to be deeper, and of contacts,
            by which they would have to miss what is asked [m], directions times `ANGLE_LENGTH`; else a share of the
            work that the load could do at most on the twist that was tried, or of a contact's motion.
        near: 1 would discard the box, 0 does not even hold in its middle; between, the share of its sides to which it
            has to shrink, to first order.
    """

    reason: str
    about: tuple[str, ...]
    missing: float
    near: float

    @classmethod
    def of(cls, reason: str, about: tuple[str, ...], found: BoxBounds) -> Missing | None:
        """Of what is known of one box; None if nothing is."""
        missing, near = float(found.missing[0]), float(found.near[0])
        return cls(reason, about, missing, near) if np.isfinite(missing) else None

    def to_json(self) -> dict[str, Any]:
        """With its unit."""
        return asdict(self) | {"about": list(self.about), "unit": "m" if self.reason in IN_METRES else "1"}

    @property
    def words(self) -> str:
        """In one part of a list."""
        most = f"{1e3 * self.missing:.2g} mm" if self.reason in IN_METRES else f"{100 * self.missing:.2g} %"
        match self.reason:
            case "collision":
                said = f"{self.about[0]} {most} deeper in {self.about[1]}"
            case "contacts":
                said = f"contacts {most} farther from what is asked"
            case "balance":
                said = f"{most} more work of the load against contact forces"
            case _:
                said = f"{most} more work of the load against motors and contact forces"
        if self.near >= 1:
            return f"{said} (it is discarded once it is looked at)"
        return f"{said} ({f'or a box {self.near:.2g} times as wide' if self.near else 'its middle lacks it, too'})"


IN_METRES = ("contacts", "collision")


def of_balance(found: Balance, boxes: Boxes, claim: int) -> Missing | None:
    """Of a twist, or of one with motions of joints, in one box."""
    reason = "slips" if found.motions.moved[claim] else "balance"
    return Missing.of(reason, (), found.examined(boxes, np.array([claim])))


def of_collision(found: Collision, boxes: Boxes, claim: int, links: Sequence[str]) -> Missing | None:
    """Of a point of a link in another solid, in one box."""
    link, _, body, _ = found.which[claim].tolist()
    about = links[link], "the object" if body == OBJECT_LINK else links[body]
    return Missing.of("collision", about, found.examined(boxes, np.array([claim])))


def of_contacts(contacts: ContactBoxes, boxes: Boxes) -> Missing | None:
    """Of the condition that is nearest to a contradiction in a box; None if all are met, or nothing is known."""
    rows, here, away = boxes.over.rows, boxes.middle.rows.value, boxes.away
    least, most = mean_value(rows, here, away)[0][0], -mean_value(-rows, -here, away)[0][0]
    met = (rows.value.lo >= contacts.low)[0] & (rows.value.hi <= contacts.high)[0]
    below = contacts.low - most, contacts.low - here.hi[0]  # what is above 0 contradicts: over the box, in its middle
    above = least - contacts.high, here.lo[0] - contacts.high
    near = np.where(met, 0.0, [nearness(*below), nearness(*above)])
    short = np.where(met, np.inf, [-below[0] * units(contacts), -above[0] * units(contacts)])
    k = np.unravel_index(near.argmax() if near.any() else np.nan_to_num(short, nan=np.inf).argmin(), near.shape)
    return Missing("contacts", (), max(float(short[k]), 0.0), float(near[k])) if np.isfinite(short[k]) else None


def units(contacts: ContactBoxes) -> Array:
    """(C,) [m] by which what is missed of each condition counts: places as they are, directions times
    `ANGLE_LENGTH`."""
    return np.where(np.arange(len(contacts.low)) < 3 * (len(contacts.task.links) - 1), 1.0, ANGLE_LENGTH)
