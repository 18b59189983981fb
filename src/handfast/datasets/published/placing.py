"""A recorded posture on a hand model: its joints in the model's order, and the object in the frame of its base."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.datasets.published.mapping_file import HandMapping
from handfast.datasets.published.recorded import Joints, Posture, RecordedGrasp
from handfast.model.hand.hand import Hand

BEYOND = 0.1  # [rad, m] further past a limit, the joints are others than the mapping says


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
            more than `BEYOND` past its limit.
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


def configuration(
    hand: Hand, mapping: HandMapping, joints: Joints, otherwise: Mapping[str, float] | None = None
) -> tuple[Array, float]:
    """(l,) configuration from a file's joints, and by how much the worst of them was past its limit.

    Args:
        otherwise: of joints that the file does not say, beside the mapping's `values`.
    """
    values = dict(mapping.values) | dict(otherwise or {}) | _named(mapping, joints)
    worst = 0.0
    for name, value in values.items():
        lower, upper = hand.limits[hand.joint(name)]
        past = max(float(lower) - value, value - float(upper), 0.0)
        if past > BEYOND:
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
