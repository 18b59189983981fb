"""Dexterity: how well the joints of a hand can move the object it holds, and how far they are from their limits.

Manipulability is the volume of what joint speeds of norm 1 achieve (Yoshikawa, Manipulability of robotic
mechanisms, IJRR 1985), for a finger that of its contact point, for a grasp that of the object (see Roa and
Suarez, Grasp quality measures: review and performance, Autonomous Robots 2015). Only those speeds count that
couplings allow and in which no joint moves that its limits fix.

The volume is taken in as many directions d as there can be: the independent speeds of the joints, at most 3
for a point, at most the rank of G for an object. So it vanishes where the configuration loses a direction, not
because a hand has few joints or two contacts cannot turn the object about their line; volumes of different d
do not compare.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import Any

import numpy as np

from handfast.core.arrays import Array, frozen
from handfast.model.grasp import Grasp
from handfast.model.hand.hand import Hand

RANK_TOLERANCE = 1e-9  # of the largest singular value


@dataclass(frozen=True, eq=False)
class Dexterity:
    """Terms to rank grasps by; larger is better in all.

    Attributes:
        singular_values: (d,) of the map from joint speeds to the object's motion, descending; see
            `object_singular_values`.
        fingers: (b,) manipulability of each contact's point, in [m] to the power of its d if all joints turn.
        from_limits: by joint that moves a contact: 0 at a limit, 1 midway, negative beyond; fixed joints not.
    """

    singular_values: Array
    fingers: Array
    from_limits: Mapping[str, float]

    @property
    def manipulability(self) -> float:
        """Product of the singular values; 0 if there are none."""
        return float(self.singular_values.prod()) if self.singular_values.size else 0.0

    @property
    def typical(self) -> float:
        """Geometric mean of the singular values, the d-th root of `manipulability`: comparable whatever d is.

        By so many of its sizes the object moves, or by so many radians it turns, where the joints turn by one.
        """
        d = self.singular_values.size
        return float(self.manipulability ** (1 / d)) if d else 0.0

    @property
    def smallest(self) -> float:
        """The smallest singular value: the slowest object motion at joint speeds of norm 1; 0 if there are none."""
        return float(self.singular_values.min(initial=np.inf)) if self.singular_values.size else 0.0

    @property
    def isotropy(self) -> float:
        """The smallest singular value by the largest, 1 if the object moves as fast in all directions."""
        largest = float(self.singular_values.max(initial=0.0))
        return self.smallest / largest if largest > 0 else 0.0

    @cached_property
    def least_from_limits(self) -> float:
        """The smallest of `from_limits`; 1 if there are none."""
        return min(self.from_limits.values(), default=1.0)

    @cached_property
    def mean_from_limits(self) -> float:
        """The mean of `from_limits`; 1 if there are none."""
        return float(np.mean(list(self.from_limits.values()))) if self.from_limits else 1.0

    def to_json(self) -> dict[str, Any]:
        return {
            "singular_values": self.singular_values.tolist(),
            "manipulability": self.manipulability,
            "isotropy": self.isotropy,
            "fingers": self.fingers.tolist(),
            "from_limits": dict(self.from_limits),
            "least_from_limits": self.least_from_limits,
            "mean_from_limits": self.mean_from_limits,
        }


def dexterity(hand: Hand, q: Array, links: Sequence[str], points: Array, grasp: Grasp) -> Dexterity:
    """The dexterity of a hand at q (l,) that touches an object.

    Args:
        links: the link of each contact.
        points: (b, 3) [m] the contacts, base frame.
        grasp: the grasp they make; joints of the hand whose limits fix them are taken as locked in it.

    Raises:
        InputError: an unknown link, a point too many or too few, a configuration of the wrong length.
    """
    at = frozen(points, (len(links), 3), "points")
    q = frozen(q, (hand.l,), "q")
    carriers = [hand.link(name) for name in links]
    fixed = [joint.name for joint in hand.joints if joint.lower == joint.upper]
    fingers = [finger_manipulability(hand, link, p, q) for link, p in zip(carriers, at, strict=True)]
    return Dexterity(
        object_singular_values(grasp, locked=fixed),
        frozen(fingers, (len(fingers),), "fingers"),
        MappingProxyType(distances_from_limits(hand, q, carriers)),
    )


def object_singular_values(grasp: Grasp, *, locked: Sequence[str] = ()) -> Array:
    """(d,) singular values of H = (G^T)^+ J, from joint speeds to the object's motion, descending.

    The object's motion is what fits the motions of the contact points best, which need not agree. It is taken
    about the contacts' middle, lengths in sizes of the grasp, so that neither units nor the object's frame
    matter. d = min(rank of G, independent joint speeds).

    Args:
        locked: names of joints that do not move, beside what the mechanism says; others are ignored.
    """
    size = grasp.size
    torques = (grasp.G[3:] - np.cross(grasp.middle, grasp.G[:3].T).T) / size
    G = np.vstack([grasp.G[:3], torques])
    length = np.array([size if joint.type == "prismatic" else 1.0 for joint in grasp.joints])
    still = [i for i, joint in enumerate(grasp.joints) if joint.name in locked]
    speeds = _free(np.vstack([grasp.mechanism.A * length, np.eye(grasp.l)[still]]))  # (l, k)
    H = np.linalg.pinv(G.T, rcond=RANK_TOLERANCE) @ (grasp.J * length / size) @ speeds
    return _largest(H, np.linalg.matrix_rank(G, tol=RANK_TOLERANCE * np.linalg.norm(G, 2)))


def finger_manipulability(hand: Hand, link: int, point: Array, q: Array) -> float:
    """sqrt(det(J J^T)) of a point (3,) [m], base frame, fixed to a link, where joint speeds span its directions.

    J (3, k) belongs to unit speeds of the joints between the base and the link; with fewer independent
    speeds than 3 it is sqrt(det(J^T J)) instead: the length or area that the point sweeps. 0 for a link
    that no joint moves.
    """
    chain = list(hand.moved_by(link))
    fixed = [j for j, joint in enumerate(hand.joints) if joint.lower == joint.upper]
    speeds = _free(np.vstack([hand.mechanism_at(q).A, np.eye(hand.l)[fixed]]))[chain]
    left, values, _ = np.linalg.svd(speeds, full_matrices=False)
    own = left[:, values > RANK_TOLERANCE]  # (|chain|, k) orthonormal: speeds of this finger alone
    found = _largest(hand.jacobian(link, point, q)[:, chain] @ own, 3)
    return float(found.prod()) if found.size else 0.0


def distances_from_limits(hand: Hand, q: Array, links: Sequence[int]) -> dict[str, float]:
    """1 - |2 q - (lower + upper)| / (upper - lower) of each joint that moves one of the links, by name.

    0 at a limit, 1 midway, negative beyond; joints that their limits fix are left out.
    """
    moving = sorted({j for link in links for j in hand.moved_by(link)})
    out = {}
    for j in moving:
        joint = hand.joints[j]
        if joint.lower < joint.upper:
            off = abs(2 * q[j] - (joint.lower + joint.upper))
            out[joint.name] = float(1 - off / (joint.upper - joint.lower))
    return out


def _free(A: Array) -> Array:
    """(l, k) orthonormal basis of the joint speeds with A qdot = 0."""
    if not A.shape[1]:
        return np.zeros((0, 0))
    _, values, rows = np.linalg.svd(np.vstack([A, np.zeros((1, A.shape[1]))]))
    rank = int((values > RANK_TOLERANCE * max(float(values.max()), RANK_TOLERANCE)).sum())
    return rows[rank:].T


def _largest(matrix: Array, most: int) -> Array:
    """(d,) the largest singular values of a matrix (n, k), d = min(most, k), zeros if it has no more."""
    d = min(int(most), matrix.shape[1])
    values = np.linalg.svd(matrix, compute_uv=False)[:d] if d else np.zeros(0)
    return frozen(values, (d,), "singular_values")
