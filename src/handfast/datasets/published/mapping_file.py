"""The `handfast/mapping/1` file: what published files leave unsaid about their hand; postures placed by it.

{"schema": "handfast/mapping/1", "layouts": ["dexgraspbench"], "link": "rh_palm",
 "offset": {"position": [0, 0, 0.034]}, "joints": ["rh_FFJ4", "rh_FFJ3"],
 "names": {"robot0:FFJ3": "rh_FFJ4"}, "values": {"rh_WRJ1": 0}, "closed": {"rh_FFJ3": 1.2}}
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import Field

from handfast.core import bundled
from handfast.core.arrays import Array
from handfast.core.errors import FaultsOf, InputError
from handfast.core.files import Finite, Strict, read_named, validate
from handfast.datasets.published.recorded import Joints, Posture, RecordedGrasp
from handfast.model.configuration import PoseFile
from handfast.model.hand.hand import Hand

MAPPING_KIND = "mappings"
MAX_LIMIT_EXCESS = 0.1  # [rad, m] further past a limit, the joints are others than the mapping says


class HandMapping(Strict):
    """The whole file.

    Attributes:
        layouts: for which layouts it is taken without being asked for.
        link: the hand's link whose pose `offset` gives; the base unless said.
        offset: of that link in the frame in which the file poses the hand.
        joints: the hand's joints in the order of the file's numbers, where it has no names.
        names: the hand's name of a joint, by the file's; one that is not here has the same name.
        reversed: joints of the hand that turn the other way than the file's do.
        values: of joints that the file says nothing about [rad, m].
        closed: where joints that the file says nothing about go when the hand closes [rad, m].
    """

    schema_: Literal["handfast/mapping/1"] = Field(alias="schema")
    layouts: list[str] = Field(default_factory=list)
    link: str | None = None
    offset: PoseFile = PoseFile()
    joints: list[str] | None = None
    names: dict[str, str] = Field(default_factory=dict)
    reversed: list[str] = Field(default_factory=list)
    values: dict[str, Finite] = Field(default_factory=dict)
    closed: dict[str, Finite] = Field(default_factory=dict)

    @property
    def mentioned(self) -> set[str]:
        """All joints of the hand that it names."""
        return {*(self.joints or ()), *self.names.values(), *self.reversed, *self.values, *self.closed}

    def fits(self, hand: Hand) -> bool:
        """Whether the hand has the link and all the joints."""
        known = self.link is None or self.link in hand.link_names
        return known and self.mentioned <= set(hand.joint_names)


def read_mapping(path: str | Path) -> HandMapping:
    """A mapping by path or bundled name, whatever the hand; `InputError` naming the first field that is wrong."""
    return read_named(MAPPING_KIND, path, "mapping", lambda data, _: validate(HandMapping, data))


def load_mapping(path: str | Path, hand: Hand) -> HandMapping:
    """A mapping by path or bundled name; `InputError` naming what the hand has not got."""
    found = read_mapping(path)
    with FaultsOf(path):
        twice = [n for i, n in enumerate(found.joints or ()) if n in (found.joints or ())[:i]]
        if twice:
            raise InputError(f"has '{twice[0]}' twice; each number of a file is one joint's", field="joints")
        if found.link is not None:
            hand.link(found.link)
        for joint in sorted(found.mentioned):
            hand.joint(joint, field="joints")
    return found


def mapping_for(layout: str, hand: Hand) -> tuple[str, HandMapping]:
    """The bundled mapping of a layout that fits a hand, with its name.

    Raises:
        InputError: none does, or several do; the line says what to give.
    """
    names = bundled.names(MAPPING_KIND)
    known = {n: read_mapping(n) for n in names}
    fitting = [n for n in names if layout in known[n].layouts and known[n].fits(hand)]
    if len(fitting) == 1:
        return fitting[0], known[fitting[0]]
    if fitting:
        raise InputError(f"could be read with {' or '.join(fitting)}; choose by --mapping NAME", source=hand.source)
    others = [n for n in names if layout in known[n].layouts]
    right = f"bundled for {layout}: {', '.join(others)}" if others else f"none is bundled for {layout}"
    problem = f"is no hand that a bundled mapping knows ({right}); say in a file which joint is which: --mapping FILE"
    raise InputError(problem, source=hand.source or hand.name)


# --- postures placed on the hand --------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class PlacedGrasp:
    """A grasp on a hand model.

    Attributes:
        q: (l,) configuration.
        pose: (4, 4) the object in the hand's base frame.
        squeeze: (l,) where the joints are to go; None if nobody says.
        pregrasp: (l,) where they come from.
        clipped: [rad, m] the most by which a joint was past its limit, where it now is.
    """

    q: Array
    pose: Array
    squeeze: Array | None
    pregrasp: Array | None
    clipped: float


def placed(hand: Hand, mapping: HandMapping, grasp: RecordedGrasp) -> PlacedGrasp:
    """A recorded grasp on the hand.

    Raises:
        InputError: numbers that are not as many as the mapping's joints, a joint that the hand has not got, a value
            more than `MAX_LIMIT_EXCESS` past its limit.
    """
    q, clipped = configuration(hand, mapping, grasp.grasp.joints)
    squeeze = _target(hand, mapping, grasp.squeeze, mapping.closed)
    return PlacedGrasp(
        q, object_pose(hand, mapping, grasp.grasp, q), squeeze, _target(hand, mapping, grasp.pregrasp), clipped
    )


def object_pose(hand: Hand, mapping: HandMapping, posture: Posture, q: Array) -> Array:
    """(4, 4) the object in the hand's base frame, from the frame in which the file poses the hand."""
    link = 0 if mapping.link is None else hand.link(mapping.link)
    in_base = hand.link_poses(q)[link]
    return in_base @ np.linalg.inv(posture.root @ mapping.offset.matrix)


def root_of(hand: Hand, mapping: HandMapping, q: Array, pose: Array) -> Array:
    """(4, 4) the frame in which a file poses the hand, in the object's frame: the inverse of `object_pose`."""
    link = 0 if mapping.link is None else hand.link(mapping.link)
    return np.linalg.inv(pose) @ hand.link_poses(q)[link] @ np.linalg.inv(mapping.offset.matrix)


def configuration(hand: Hand, mapping: HandMapping, joints: Joints) -> tuple[Array, float]:
    """(l,) configuration from a file's joints, and by how much the worst of them was past its limit."""
    values = dict(mapping.values) | _named(mapping, joints)
    worst = 0.0
    for name, value in values.items():
        lower, upper = hand.limits[hand.joint(name)]
        past = max(float(lower) - value, value - float(upper), 0.0)
        if past > MAX_LIMIT_EXCESS:
            problem = f"is {value:.4g}; the limits are [{lower:.4g}, {upper:.4g}]: is it the right hand and mapping?"
            raise InputError(problem, field=name)
        worst = max(worst, past)
        values[name] = float(np.clip(value, lower, upper))
    return hand.configuration(values), worst


def _named(mapping: HandMapping, joints: Joints) -> dict[str, float]:
    if isinstance(joints, Mapping):
        named: dict[str, float] = {}
        for name, value in joints.items():
            ours = mapping.names.get(name, name)
            if ours in named:
                raise InputError(f"'{ours}' has two values of the file: mapped from '{name}', and from another name")
            named[ours] = value
        return turned(mapping, named)
    order = mapping.joints
    if order is None:
        problem = f"has {len(joints)} joint values without names; the mapping's `joints` have to say their order"
        raise InputError(problem, field="joints")
    if len(order) != len(joints):
        raise InputError(f"has {len(joints)} joint values; the mapping names {len(order)}", field="joints")
    return turned(mapping, dict(zip(order, np.asarray(joints).tolist(), strict=True)))


def turned(mapping: HandMapping, values: Mapping[str, float]) -> dict[str, float]:
    """Values by the hand's names with the sense of the hand in place of the file's, or the other way round."""
    return {name: -value if name in mapping.reversed else value for name, value in values.items()}


def _target(
    hand: Hand, mapping: HandMapping, posture: Posture | None, otherwise: Mapping[str, float] | None = None
) -> Array | None:
    """(l,) where joints are to go, values past a limit at it: a motor's target may well be."""
    if posture is None and not otherwise:
        return None
    values = dict(mapping.values) | dict(otherwise or {}) | _named(mapping, posture.joints if posture else {})
    lower, upper = hand.limits.T
    bounded = {n: float(np.clip(v, lower[hand.joint(n)], upper[hand.joint(n)])) for n, v in values.items()}
    return hand.configuration(bounded)
