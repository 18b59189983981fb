"""What "to 1e-9 of load and commands" means, for proofs that a state exists and for proofs that none does.

A state holds so if it solves the model exactly under a load w' and with joint torques tau' that differ from the given
ones by at most this: |dw_force| <= EPS F, |dw_torque| <= EPS F size about the contacts' centroid, |dtau_j| <= EPS F
times `GraspData.joint_units`; and the work of these differences along its motions is at most WORK F^2. F is the scale
of the load alone. Contact forces, however large, grant nothing. Proofs that no state exists give way in (1), (2) and
the balance of energy by at least as much, so that there is no question of which both can be proved.
"""

from __future__ import annotations

from math import hypot

import numpy as np

from handfast.proofs.fields import Array
from handfast.proofs.grasp import GraspData

EPS = 1e-9
WORK = 1e-6
LEAST = 1e-100  # [N] nothing is proved of smaller scales: roundings of their products are not in proportion
TOO_SMALL = f"the load and the commands are below {LEAST:g} N, where rounding is not bounded"


def about_centroid(g: GraspData, w: Array) -> Array:
    """(3,) torque of a wrench (6,) about the contacts' centroid."""
    (x, y, z), (a, b, c) = g.centroid.tolist(), w[:3].tolist()
    return np.asarray(w[3:] - np.array([y * c - z * b, z * a - x * c, x * b - y * a]))


def load_scale(g: GraspData, w: Array) -> float:
    """[N] of a load w (6,): its force, or its torque about the contacts' centroid over `size`, whichever is larger.

    Without a load: the largest command or given torque as a force, each joint's over `joint_units`; 1 if none acts.
    As a norm of w it is at most the sum of the scales of the parts of w.
    """
    torque = about_centroid(g, w)
    scale = max(hypot(*w[:3].tolist()), hypot(*torque.tolist()) / g.size)
    if scale == 0 and g.l:
        drives = np.abs(g.R.T * g.command) / g.joint_units[:, None]
        scale = max(float(drives.max(initial=0.0)), float((np.abs(g.torque) / g.joint_units).max()))
    return scale or 1.0


def slack(g: GraspData, scale: float) -> Array:
    """(6 + l,) by which (1), forces and torques about the contacts' centroid, and (2), by joint, may be missed."""
    return EPS * scale * np.r_[1.0, 1.0, 1.0, g.size * np.ones(3), g.joint_units]
