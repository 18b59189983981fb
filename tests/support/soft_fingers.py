"""Grasps with soft fingers whose answers are derived by hand, and random ones."""

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


def random_grasp(rng: np.random.Generator) -> Grasp:
    """Two to four contacts around an object, soft and hard ones, some on joints that squeeze or are locked."""
    contacts, joints = [], []
    for i in range(int(rng.integers(2, 5))):
        n = _unit(rng)
        p = -0.03 * n + 0.008 * rng.normal(size=3)
        n = n + 0.3 * rng.normal(size=3)
        torsion = float(rng.choice([0.0, 0.001, 0.004, 0.015]))
        contacts.append(Contact(p, n / np.linalg.norm(n), float(rng.uniform(0.2, 1)), f"link {i}", torsion=torsion))
        if rng.random() < 0.75:
            axis, origin = _unit(rng), p + 0.05 * rng.normal(size=3)
            closes = np.cross(axis, p - origin) @ n > 0
            joints.append(GraspJoint(f"joint {i}", axis if closes else -axis, origin, (i,)))
    commands = {joint.name: float(rng.uniform(0.05, 0.5)) for joint in joints if rng.random() < 0.7}
    return Grasp(contacts, joints, preload=commands)


def random_load(rng: np.random.Generator) -> np.ndarray:
    """(6,) about one newton and three centinewton metres."""
    return np.asarray(rng.normal(size=6) * np.r_[1, 1, 1, 0.03, 0.03, 0.03])


def _unit(rng: np.random.Generator) -> np.ndarray:
    x = rng.normal(size=3)
    return np.asarray(x / np.linalg.norm(x))
