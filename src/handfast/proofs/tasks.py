"""A synthesis task as plain arrays, read from what a `handfast/synthesis/1` or `handfast/grasps/1` file embeds.

The file holds every number that the equations need: where links and joints stand, couplings, limits, the regions to
touch, bounds of the object's pose. That these are the numbers of a hand that the file names is not proved here.

A joint of a new kind has its name in `JOINT_KINDS`, its motion in `chains`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from handfast.proofs.fields import (
    ZERO,
    Array,
    BadFile,
    Fields,
    Mask,
    number,
    numbers,
    rational,
    rationals,
    refuse_unknown,
    texts,
)
from handfast.proofs.regions import RegionData, read_region

JOINT_KINDS = "revolute", "prismatic"
MAX_TASK_PARTS = 1000  # links, joints, contacts at most
# [rad], or of `TaskData.size`: by which the value that is said of a joint may miss what it has to be
JOINT_VALUE_TOLERANCE = 1e-9


@dataclass(frozen=True)
class CouplingData:
    """A joint is at ratio * q[driver] + offset; driver -1: at the offset."""

    driver: int
    ratio: float
    offset: float


@dataclass(frozen=True)
class LinkData:
    """A link: its parent (-1: it is the base), and the joints between them, in order."""

    name: str
    parent: int
    joints: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class HandData:
    """Links and joints of a hand.

    Attributes:
        links: the base first, parents before children. poses: (n, 4, 4) in the parent's frame, joints at `ref`.
        joints: (l,) names. revolute: (l,) bool; else prismatic. axes, anchors: (l, 3) in the frame of the link that
            the joint moves. limits: (l, 2) [rad, m]. ref: (l,) the value at which the link stands at its pose.
        couplings: by joint.
    """

    links: tuple[LinkData, ...]
    poses: Array
    joints: tuple[str, ...]
    revolute: Mask
    axes: Array
    anchors: Array
    limits: Array
    ref: Array
    couplings: Mapping[int, CouplingData]

    def link(self, name: str, field: str) -> int:
        """Index of a link; `BadFile` if there is none of this name."""
        names = [link.name for link in self.links]
        refuse_unknown(name, names, "link", field)
        return names.index(name)

    def path(self, link: int) -> list[int]:
        """The links from the base to this one."""
        out = [link]
        while self.links[out[-1]].parent >= 0:
            out.append(self.links[out[-1]].parent)
        return out[::-1]

    def driving(self, joint: int) -> tuple[CouplingData, ...]:
        """The couplings between a joint and the one that drives it in the end, nearest first; () if it is free."""
        out: list[CouplingData] = []
        while joint in self.couplings:
            out.append(self.couplings[joint])
            joint = out[-1].driver
        return tuple(out)


@dataclass(frozen=True, eq=False)
class TaskData:
    """Which regions of a hand are to touch which regions of an object, and what bounds the object's pose.

    Attributes:
        links: (K,) indices of the links that touch. on_hand, on_object: (K,) regions in link and object frame.
        position: (3, 2) [m] bounds of the object's origin in the palm frame, infinite where there is none.
        axes: (3, 3, 2): axes[k, i] bounds component i of the object's axis k there, which is R[i, k].
    """

    hand: HandData
    links: tuple[int, ...]
    on_hand: tuple[RegionData, ...]
    on_object: tuple[RegionData, ...]
    position: Array
    axes: Array

    @cached_property
    def moving(self) -> dict[int, tuple[CouplingData, ...]]:
        """The joints that move some contact, and all that move with them, with what drives each."""
        passed = {j for end in self.links for i in self.hand.path(end) for j in self.hand.links[i].joints}
        path = {j: self.hand.driving(j) for j in range(len(self.hand.joints))}
        driver = {j: p[-1].driver if p else j for j, p in path.items()}
        driving = {driver[j] for j in passed} - {-1}
        return {j: path[j] for j in path if driver[j] in driving or j in passed}

    @cached_property
    def free(self) -> tuple[int, ...]:
        """The joints that are coordinates: of `moving` those that are free, by coupling and by limits."""
        limits = self.hand.limits
        return tuple(j for j, path in self.moving.items() if not path and limits[j, 0] < limits[j, 1])

    @cached_property
    def size(self) -> float:
        """[m] of the object, as its regions tell: how far they are apart, and what they span."""
        return float(np.linalg.norm(np.ptp(np.concatenate([region.places for region in self.on_object]), axis=0)))

    def tolerance(self, joint: int) -> float:
        """[rad, m] by which the value that is said of a joint may miss what it has to be."""
        return JOINT_VALUE_TOLERANCE * (1.0 if self.hand.revolute[joint] else self.size)

    def part(self, contacts: Sequence[int]) -> TaskData:
        """The task of some of the contacts alone."""
        on_hand, on_object = (tuple(those[k] for k in contacts) for those in (self.on_hand, self.on_object))
        return replace(self, links=tuple(self.links[k] for k in contacts), on_hand=on_hand, on_object=on_object)

    def misplaced(self, joints: Mapping[str, float], proved: Mapping[str, float]) -> str:
        """Which of all joints is not where it is proved, breaks a limit or a coupling; '' if none."""
        hand = self.hand
        if joints.keys() != set(hand.joints):
            return f"the joints are {', '.join(hand.joints)}"
        q = {name: rational(value) for name, value in joints.items()}
        for j, name in enumerate(hand.joints):
            off = rational(self.tolerance(j))
            if name in proved and not abs(q[name] - rational(proved[name])) <= off:
                return f"{name} is not at the value that is proved"
            lower, upper = rationals(hand.limits[j].tolist())
            if not lower - off <= q[name] <= upper + off:
                return f"{name} is beyond its limits"
            if (c := hand.couplings.get(j)) is not None:
                driver = q[hand.joints[c.driver]] if c.driver >= 0 else ZERO
                if not abs(q[name] - rational(c.ratio) * driver - rational(c.offset)) <= off:
                    return f"{name} does not follow its coupling"
        return ""


def read_task(data: Any, place: str = "task") -> TaskData:
    """The task in a parsed object; `BadFile` with the field and what is wrong."""
    f = Fields(data, place)
    f.text("name")
    if f.has("object"):
        f.text("object")
    hand = _hand(f.object("hand"))
    links, on_hand, on_object = [], [], []
    for contact in f.objects("contacts"):
        links.append(hand.link(contact.text("link"), contact.at("link")))
        on_hand.append(read_region(contact.object("hand")))
        on_object.append(read_region(contact.object("object")))
        contact.done()
    if not 0 < len(links) <= MAX_TASK_PARTS:
        raise BadFile(f"has {len(links)} entries; 1 to {MAX_TASK_PARTS} are possible", f.at("contacts"))
    position, axes = _pose(f.object("pose"))
    f.done()
    return TaskData(hand, tuple(links), tuple(on_hand), tuple(on_object), position, axes)


def _hand(f: Fields) -> HandData:
    f.text("name")
    f.text("source")
    links = f.table("links", ("name", "parent", "pose", "joints"))
    joints = f.table("joints", ("name", "type", "axis", "anchor", "limits", "ref"))
    names = {kind: texts(those["name"], f.at(kind)) for kind, those in (("links", links), ("joints", joints))}
    for kind, its in names.items():
        if len(its) > MAX_TASK_PARTS or len(set(its)) < len(its):
            raise BadFile(f"has a name twice, or more than {MAX_TASK_PARTS}", f.at(kind))
    for i, parent in enumerate(links["parent"]):
        if type(parent) is not int or not -1 <= parent < i or (parent < 0) != (i == 0):
            raise BadFile(
                f"is {parent!r}; an earlier link is needed, -1 for the first alone", f"{f.at('links')}[{i}].parent"
            )
    carried = [tuple(its) if isinstance(its, list) else (None,) for its in links["joints"]]
    passed = [j for its in carried for j in its]
    if any(type(j) is not int or not 0 <= j < len(names["joints"]) for j in passed) or len(set(passed)) < len(passed):
        raise BadFile("have joints that do not exist, or a joint twice", f.at("links"))
    if not names["links"] or not all(kind in JOINT_KINDS for kind in joints["type"]):
        raise BadFile(f"has no link, or a joint that is not {' or '.join(JOINT_KINDS)}", f.place)
    poses = _stacked(links["pose"], (4, 4), f"{f.at('links')}[].pose")
    if (poses[:, 3] != [0.0, 0.0, 0.0, 1.0]).any():
        raise BadFile("has no 0, 0, 0, 1 as last row", f"{f.at('links')}[].pose")
    shapes: dict[str, tuple[int, ...]] = {"axis": (3,), "anchor": (3,), "limits": (2,), "ref": ()}
    of = {name: _stacked(joints[name], shape, f"{f.at('joints')}[].{name}") for name, shape in shapes.items()}
    if not of["axis"].any(axis=1).all():
        raise BadFile("is zero; a direction is needed", f"{f.at('joints')}[].axis")
    for name, ends in zip(names["joints"], of["limits"].tolist(), strict=True):
        _ordered(ends[0], ends[1], f"{f.at('joints')}.{name}.limits")
    couplings = _couplings(f, len(names["joints"]))
    f.done()
    turning = np.array([kind == "revolute" for kind in joints["type"]], dtype=bool)
    each = (LinkData(*link) for link in zip(names["links"], links["parent"], carried, strict=True))
    axes, anchors, limits, ref = of.values()
    return HandData(tuple(each), poses, names["joints"], turning, axes, anchors, limits, ref, couplings)


def _stacked(rows: list[Any], shape: tuple[int, ...], field: str) -> Array:
    """(n, ...) numbers of this shape for each of n links or joints."""
    out = numbers(rows, (-1, *shape), field)
    if len(out) != len(rows):  # `numbers` takes empty lists for none
        raise BadFile(f"is empty; {' x '.join(map(str, shape)) or 'single'} numbers are needed", field)
    return out


def _couplings(f: Fields, l: int) -> dict[int, CouplingData]:
    out: dict[int, CouplingData] = {}
    for part in f.objects("couplings"):
        joint, driver = part.whole("joint"), part.whole("leader", least=-1)
        if not (joint < l and driver < l) or joint in out:
            raise BadFile("ties a joint that does not exist, or one for the second time", part.place)
        out[joint] = CouplingData(driver, part.number("ratio"), part.number("offset"))
        part.done()
    for start in out:
        j = start
        for _ in out:
            j = out[j].driver if j in out else -1
        if j in out:
            raise BadFile("tie a joint to itself, directly or through others", f.at("couplings"))
    return out


def _pose(f: Fields) -> tuple[Array, Array]:
    position = _ends(f.take("position"), np.inf, f.at("position"))
    axes = f.take("axes")
    if not isinstance(axes, list) or len(axes) != 3:
        raise BadFile("is no list of three", f.at("axes"))
    out = np.array([_ends(axis, 1.0, f"{f.at('axes')}[{k}]") for k, axis in enumerate(axes)])
    f.done()
    return position, out


def _ends(data: Any, far: float, field: str) -> Array:
    """(3, 2) bounds; null is none, which is -far and far."""
    if not isinstance(data, list) or len(data) != 3 or not all(isinstance(e, list) and len(e) == 2 for e in data):
        raise BadFile("is no list of three pairs of a lower and an upper end", field)
    out = [[end if x is None else number(x, field) for x, end in zip(e, (-far, far), strict=True)] for e in data]
    for lo, hi in out:
        _ordered(lo, hi, field)
    return np.array(out)


def _ordered(lo: float, hi: float, field: str) -> None:
    if not lo <= hi:
        raise BadFile(f"is [{lo:g}, {hi:g}]; the lower one comes first", field)
