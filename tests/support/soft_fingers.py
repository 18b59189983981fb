"""Grasps with soft fingers whose answers are derived by hand."""

from __future__ import annotations

import numpy as np

from handfast.model.grasp import Contact, Grasp, GraspJoint
from handfast.model.mechanism import Mechanism

MU, TORSION, SQUEEZE = 0.5, 0.004, 10.0  # friction, torsional friction [m], what the slide presses with [N]


def coin(torsion: float = TORSION, mu: float = MU, half: float = 1e-3, squeeze: float = SQUEEZE) -> Grasp:
    """A coin in the xy plane between two fingers on its axis; the upper one is pressed down along the axis.

    Each contact carries N = `squeeze` where nothing else loads it. By hand, with the friction of each in the ellipsoid
    |c_t|^2 / mu^2 + tau^2 / mu_tau^2 <= N^2: a torque about z is held up to 2 mu_tau N, a force along x up to 2 mu N,
    and s (F, T) at once up to s = 1 / sqrt((F / (2 mu N))^2 + (T / (2 mu_tau N))^2).
    """
    contacts = [
        Contact([0, 0, half], [0, 0, -1], mu, "above", torsion=torsion),
        Contact([0, 0, -half], [0, 0, 1], mu, "below", torsion=torsion),
    ]
    slide = GraspJoint("slide", np.array([0.0, 0, -1]), np.zeros(3), (0,), "prismatic")
    return Grasp(contacts, [slide], preload={"slide": squeeze}, name="coin")


def spindle(friction: float = 0.0, torsion: float = TORSION) -> Grasp:
    """The coin, whose lower finger stands on a joint that turns about its normal and has no motor but a free one.

    The joint carries its own dry friction [N m] and nothing else, so that the lower contact has at most that.
    """
    g = coin(torsion)
    turn = GraspJoint("turn", np.array([0.0, 0, 1]), np.zeros(3), (1,), friction=friction)
    mech = Mechanism(("slide", "turn"), np.eye(2), np.zeros((0, 2)), (False, False), (False, True))
    return Grasp(g.contacts, [*g.joints, turn], mech, {"slide": SQUEEZE}, "spindle")
