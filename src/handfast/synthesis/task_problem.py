"""Problem: a task in minimal coordinates.

Coordinates x, in this order: the free joints (those that move a contact, neither driven by another joint nor
fixed by equal limits), the object's position (3), its unnormalised quaternion (4; w, x, y, z), and for
each contact the parameters s, t of the object region and, if the hand region is no cap, u, v of that one.

Equations, 3 or 5 a contact. A cap on the hand rolls: its centre lies at the distance of its radius from the
object region, along the region's normal, so that points coincide and normals oppose (15), (16) whatever
the direction,

    p_k + R_k c = p + R (o + r n)(s, t)                                                     three,

and any other region on the hand is tangent to the region with coinciding points,

    p_k + R_k h(u, v) = p + R o(s, t),   R_k m . R o_s = 0,   R_k m . R o_t = 0              five.

No equation is redundant, so the solutions have the dimension that the paper's d predicts. Inequalities:
the contact lies within the cap's cone (or the patch normals oppose), the object's axes lie within the
pose bounds. Bounds of x: joint limits (those of mimic joints carried over), pose and [0, 1].
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from handfast.core.arrays import Array
from handfast.model.hand.coupling import driver_ranges, drivers
from handfast.model.hand.hand import Hand
from handfast.synthesis.flat import chains_of, regions_of
from handfast.synthesis.task import Task
from handfast.synthesis.task_groups import Coordinates, Flat


@dataclass(frozen=True, eq=False)
class TaskProblem:
    """A task in minimal coordinates.

    Attributes:
        task: as given.
        free: (nj,) hand joint of each joint coordinate.
        labels: n names, "joint:<name>", "position:0", "quaternion:3", "contact:1:s".
        unit: [m], a power of two: one unit of length in `flat`.
        flat: the arrays for the kernels.
        equations: number of equations.
    """

    task: Task
    free: tuple[int, ...]
    labels: tuple[str, ...]
    unit: float
    flat: Flat
    equations: int

    @classmethod
    def of(cls, task: Task) -> TaskProblem:
        """The problem of a task.

        Raises:
            InputError: joints whose limits and couplings leave nothing, by name.
        """
        hand = task.hand
        follows = drivers(hand)
        ranges = driver_ranges(hand, task.involved.tolist())
        lower, upper = np.array([ranges.get(j, (0.0, 0.0)) for j in range(hand.l)]).T
        driving = sorted({follows[j][0] for j in task.involved.tolist() if follows[j][0] >= 0})
        free = tuple(j for j in driving if lower[j] < upper[j])
        reach = [_reach(hand, link) + t.hand.outermost for link, t in zip(task.links, task.contact_pairs, strict=True)]
        unit = float(2.0 ** np.round(np.log2(max(max(reach), 1e-6))))
        # no contact lets the origin be farther from the palm than it is from the region beyond the hand's reach
        far = min(r + t.object.outermost for r, t in zip(reach, task.contact_pairs, strict=True)) * (1 + 1e-9)
        position = np.clip(task.pose.position, -far, far) / unit
        labels = [f"joint:{hand.joint_names[j]}" for j in free]
        labels += [f"position:{i}" for i in range(3)] + [f"quaternion:{i}" for i in range(4)]
        per = [unit if hand.joints[j].type == "prismatic" else 1.0 for j in free]
        box = [(lower[j] / p, upper[j] / p) for j, p in zip(free, per, strict=True)]
        box += [(lo, hi) for lo, hi in position] + [(-2.0, 2.0)] * 4
        params, rows, row = [], [], 0
        for k, t in enumerate(task.contact_pairs):
            params.append(len(labels))
            rows.append(row)
            names = "st" if t.hand.ball else "stuv"
            labels += [f"contact:{k}:{name}" for name in names]
            box += t.object.search_bounds.tolist() + ([] if t.hand.ball else t.hand.search_bounds.tolist())
            row += 3 if t.hand.ball else 5
        bounds = np.array(box)
        coordinates = Coordinates(
            row=np.array(rows, dtype=np.intp),
            parameter=np.array(params, dtype=np.intp),
            axes=np.array(task.pose.axes.reshape(9, 2)),
            lower=bounds[:, 0].copy(),
            upper=bounds[:, 1].copy(),
        )
        flat = Flat(chains_of(task, free, lower, unit), regions_of(task, unit), coordinates)
        return cls(task, free, tuple(labels), unit, flat, row)

    @property
    def n(self) -> int:
        """Number of coordinates."""
        return len(self.labels)

    @cached_property
    def lengths(self) -> Array:
        """(n,) [m] for coordinates that are lengths, 1 for the others: x times this is in SI units."""
        prismatic = {f"joint:{j.name}" for j in self.task.hand.joints if j.type == "prismatic"}
        return np.array([self.unit if v in prismatic or v.startswith("position") else 1.0 for v in self.labels])


def _reach(hand: Hand, link: int) -> float:
    """[m] no point that the link's frame origin can reach lies farther from the palm's origin."""
    reach = 0.0
    while link >= 0:
        joints = [hand.joints[j] for j in hand.links[link].joints]
        reach += float(np.linalg.norm(hand.links[link].pose[:3, 3]))
        for j in joints:
            travel = max(abs(j.lower), abs(j.upper)) if j.type == "prismatic" else 2 * np.linalg.norm(j.anchor)
            reach += float(travel)
        link = hand.links[link].parent
    return reach
