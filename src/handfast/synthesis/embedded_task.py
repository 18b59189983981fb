"""A task with everything that it refers to, as one JSON object: the file that carries it needs no other.

Unlike a `handfast/task/1` file it holds the hand itself (links, joints with the task's limits, couplings), and
pose bounds of any kind. `fingerprint` tells two tasks apart.
"""

from __future__ import annotations

import hashlib
import json
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.core.files import Finite, Strict, Vector, validate
from handfast.model.hand.hand import Coupling, Hand, Joint, Link, direct_mechanism
from handfast.readers.region_file import RegionEntry, region_to_dict
from handfast.synthesis.task import ContactPair, PoseBounds, Task

Row = tuple[Finite, Finite, Finite, Finite]
End = Finite | None  # null: no bound
Ends = tuple[tuple[End, End], tuple[End, End], tuple[End, End]]
Index = Annotated[int, Field(ge=-1)]


class EmbeddedLinkEntry(Strict):
    """`pose`: (4, 4) in the parent's frame."""

    name: str
    parent: Index
    pose: tuple[Row, Row, Row, Row]
    joints: list[Index]


class EmbeddedJointEntry(Strict):
    """`limits` are those of the task."""

    name: str
    type: Literal["revolute", "prismatic"]
    axis: Vector
    anchor: Vector
    limits: tuple[Finite, Finite]
    ref: Finite


class CouplingLine(Strict):
    """q[joint] = ratio * q[driver] + offset; indices into the joints, -1 for none."""

    joint: Index
    leader: Index  # the driver, by the name that files of this schema have for it
    ratio: Finite
    offset: Finite


class EmbeddedHandEntry(Strict):
    """The kinematics alone: no shapes, no motors. `source`: what it was loaded from, for the record."""

    name: str
    source: str
    links: list[EmbeddedLinkEntry]
    joints: list[EmbeddedJointEntry]
    couplings: list[CouplingLine]

    def hand(self) -> Hand:
        """The hand; `InputError` with the field of what is wrong."""
        l, n = len(self.joints), len(self.links)
        joints = tuple(
            Joint(j.name, j.type, np.array(j.axis), np.array(j.anchor), *j.limits, j.ref) for j in self.joints
        )
        for i, link in enumerate(self.links):
            if not link.parent < i or (link.parent < 0) != (i == 0) or any(not 0 <= j < l for j in link.joints):
                raise InputError(
                    f"has a parent or joints that do not exist ({n} links, {l} joints)", field=f"links[{i}]"
                )
        for i, c in enumerate(self.couplings):
            if not 0 <= c.joint < l or c.leader >= l:
                raise InputError(f"ties joints that do not exist ({l} joints)", field=f"couplings[{i}]")
        links = tuple(Link(k.name, k.parent, np.array(k.pose), tuple(k.joints)) for k in self.links)
        couplings = tuple(Coupling(c.joint, c.leader, c.ratio, c.offset) for c in self.couplings)
        mechanism = direct_mechanism([joint.name for joint in joints], couplings)
        return Hand(self.name, links, joints, mechanism, couplings, np.zeros(l), source=self.source)


class ContactPairEntry(Strict):
    link: str
    hand: RegionEntry
    object: RegionEntry


class BoundsEntry(Strict):
    """As `PoseBounds`; null where there is no bound."""

    position: Ends
    axes: tuple[Ends, Ends, Ends]

    def bounds(self) -> PoseBounds:
        free = PoseBounds.none()
        return PoseBounds(_filled(self.position, free.position), _filled(self.axes, free.axes))


class EmbeddedTask(Strict):
    """The whole object."""

    name: str
    object: str | None
    hand: EmbeddedHandEntry
    contacts: list[ContactPairEntry]
    pose: BoundsEntry


def task_to_dict(task: Task) -> dict[str, Any]:
    """The task as a JSON object; numbers come back exactly."""
    hand = task.hand
    return {
        "name": task.name,
        "object": task.object,
        "hand": {
            "name": hand.name,
            "source": hand.source,
            "links": [
                {"name": k.name, "parent": k.parent, "pose": np.asarray(k.pose).tolist(), "joints": list(k.joints)}
                for k in hand.links
            ],
            "joints": [
                {
                    "name": j.name,
                    "type": j.type,
                    "axis": j.axis.tolist(),
                    "anchor": j.anchor.tolist(),
                    "limits": [j.lower, j.upper],
                    "ref": j.ref,
                }
                for j in hand.joints
            ],
            "couplings": [
                {"joint": c.joint, "leader": c.driver, "ratio": c.ratio, "offset": c.offset} for c in hand.couplings
            ],
        },
        "contacts": [
            {
                "link": t.link,
                "hand": region_to_dict(t.hand) | {"flip": t.hand.flip},
                "object": region_to_dict(t.object) | {"flip": t.object.flip},
            }
            for t in task.contact_pairs
        ],
        "pose": {
            "position": _ends(task.pose.position, -np.inf, np.inf),
            "axes": [_ends(axis, -1.0, 1.0) for axis in task.pose.axes],
        },
    }


def task_from_dict(data: Any) -> Task:
    """The task in a parsed object; raises `InputError` with field and fault."""
    entry = validate(EmbeddedTask, data)
    try:
        hand = entry.hand.hand()
    except InputError as fault:
        raise fault.within("hand") from None
    pairs = tuple(
        ContactPair(
            c.link, c.hand.region(f"contacts[{k}].hand", False), c.object.region(f"contacts[{k}].object", False)
        )
        for k, c in enumerate(entry.contacts)
    )
    return Task.of(hand, pairs, pose=entry.pose.bounds(), object=entry.object, name=entry.name)


def fingerprint(data: dict[str, Any]) -> str:
    """What tells two tasks apart, of `task_to_dict`'s object: not names or paths, but every number."""
    hand = {key: data["hand"][key] for key in ("links", "joints", "couplings")}
    said = {"hand": hand, "contacts": data["contacts"], "pose": data["pose"]}
    return digest(said)


def sealed(data: dict[str, Any]) -> dict[str, Any]:
    """The object with its checksum."""
    return data | {"checksum": digest(data)}


def refuse_broken(data: dict[str, Any]) -> None:
    """`InputError` if an object does not have the checksum that it names, or names none."""
    if "checksum" not in data:
        raise InputError("is missing: the file is not as it was written", field="checksum")
    if digest({key: value for key, value in data.items() if key != "checksum"}) != data["checksum"]:
        raise InputError("does not fit: the file was changed after it was written", field="checksum")


def digest(data: Any) -> str:
    """SHA-256 of a JSON object, whatever its layout."""
    text = json.dumps(data, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode("utf-8")).hexdigest()


def _ends(bounds: Array, lowest: float, highest: float) -> list[list[float | None]]:
    return [[None if lo <= lowest else float(lo), None if hi >= highest else float(hi)] for lo, hi in bounds]


def _filled(ends: Any, free: Array) -> Array:
    """Bounds with what `free` has where there are none."""
    given = np.array(ends, dtype=float)  # null becomes NaN
    return np.where(np.isnan(given), free, given)
