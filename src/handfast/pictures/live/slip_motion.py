"""How the object goes when it slips, exaggerated: a motion to look at, which nothing else rests on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls
from scipy.spatial.transform import Rotation

from handfast.core.arrays import Array
from handfast.model.grasp import Grasp
from handfast.stability.answers import MaxAnswer

TRAVEL = 0.6  # of the grasp's size, that the farthest contact goes
PERIOD = 2.4  # [s] of one repetition
REST = 0.25  # of it, at the end, in which the object stays
SMALL = 1e-9


@dataclass(frozen=True, eq=False)
class SlipMotion:
    """A motion of the object about its origin.

    Attributes:
        twist: (6,) translation [m] and rotation [rad] at its end.
        why: where it comes from, in a few words.
    """

    twist: Array
    why: str

    def pose(self, seconds: float) -> tuple[Array, Array]:
        """Position (3,) [m] and rotation (3, 3) of the object after this time, over and over again."""
        phase = min((seconds / PERIOD % 1.0) / (1 - REST), 1.0)
        share = phase * phase * (3 - 2 * phase)
        return share * self.twist[:3], Rotation.from_rotvec(share * self.twist[3:]).as_matrix()


def slip_motion(grasp: Grasp, wrench: Array, most: MaxAnswer | None) -> SlipMotion | None:
    """The motion of the equilibrium at the largest load of this direction, or else the way out that is free.

    Args:
        wrench: (6,) the load that is not resisted.
        most: the largest load in its direction, if it is known.
    """
    if most is not None and most.found is not None and most.lower > 0:
        found = _sized(grasp, most.found.state.r)  # that of least motion hardly goes where it slips
        if found is not None:
            return SlipMotion(found, "as it moves under the largest load that is resisted, enlarged")
    found = _sized(grasp, escape(grasp, wrench))
    return None if found is None else SlipMotion(found, "the way out along which no contact is pressed")


def escape(grasp: Grasp, wrench: Array) -> Array:
    """(6,) motion nearest to a load's own direction that presses no contact: fingers stand still, nothing rubs.

    The load's projection onto the cone of motions that separate, or slide on, every contact: the remainder of the load
    after the normal forces of least squares, lengths in grasp sizes.
    """
    scale = np.r_[np.ones(3), np.full(3, 1 / grasp.size)]
    normals = scale[:, None] * grasp.G[:, ::3]
    load = scale * wrench
    length = float(np.linalg.norm(load))
    if length < SMALL:
        return np.zeros(6)
    forces, left = nnls(normals, -load / length)
    return scale * (load / length + normals @ forces) if left > SMALL else np.zeros(6)


def _sized(grasp: Grasp, r: Array) -> Array | None:
    """A motion scaled so that the farthest contact goes `TRAVEL`; None if there is none."""
    moved = r[:3] + np.cross(r[3:], grasp.positions)
    farthest = float(np.linalg.norm(moved, axis=1).max())
    size = float(np.linalg.norm(r[:3]) + grasp.size * np.linalg.norm(r[3:]))
    if not size > SMALL * max(1.0, grasp.size):
        return None
    return TRAVEL * grasp.size / max(farthest, 0.2 * size) * r
