"""Named problems with answers derived by hand, and a maker of exact solutions. Sources in the docstrings."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from handfast.core.arrays import Array
from handfast.model.grasp import Contact, Grasp, GraspJoint
from handfast.proofs.states import State
from handfast.stability.problem import model
from handfast.stability.problem.model import state_of

X, Y, Z = np.eye(3)


def pinch(mu: float = 0.5, arm: float = 0.1, torque: float = 0.1, offset: float = 0.0) -> Grasp:
    """Two fingertips on the x axis, +-30 mm, each `arm` above a joint that turns it inwards.

    Normal forces are torque / arm: the grasp resists 2 mu torque / arm along y or z, nothing along them
    without preload, and any force along x (a locked finger takes it). G has rank 5: no torque about x.
    """
    contacts = [
        Contact(np.array([0.03, offset / 2, 0]), -X, mu, "right"),
        Contact(np.array([-0.03, -offset / 2, 0]), X, mu, "left"),
    ]
    joints = [
        GraspJoint("right", Z, np.array([0.03, -arm, 0]), (0,)),
        GraspJoint("left", -Z, np.array([-0.03, -arm, 0]), (1,)),
    ]
    return Grasp(contacts, joints, preload={"right": torque, "left": torque}, name="pinch")


def nest(mu: float = 0.3) -> Grasp:
    """A fixture: three fixed frictional points below, 120 degrees apart, normals 30 degrees off vertical.

    Presses down (-z) are carried at any magnitude, pulls up (+z) not at all: nothing can pull.
    """
    contacts = []
    for k in range(3):
        a = 2 * np.pi * k / 3
        out = np.array([np.cos(a), np.sin(a), 0.0])
        contacts.append(Contact(0.05 * out, -np.sin(np.pi / 6) * out + np.cos(np.pi / 6) * Z, mu))
    return Grasp(contacts, name="nest")


def table(mu: float = 0.4, normals: int = 4) -> Grasp:
    """A box on a table: fixed contacts at the corners of a 100 mm square, normals +z.

    With a weight W in its middle it resists a push s along x in the plane of the contacts exactly for
    s <= mu W (Coulomb).
    """
    corners = [np.array([x, y, 0.0]) for x in (-0.05, 0.05) for y in (-0.05, 0.05)]
    return Grasp([Contact(c, Z, mu) for c in corners[:normals]], name="table")


def bell(shift: float = 0.0) -> Grasp:
    """Fig. 1 at contact level: two fingers, four contacts, mu = 1, preload 0.1 N m at the proximal joints.

    A tip slides when c_n (h - mu dx) = 0.1 N m with h = 93 mm, dx = 3 mm: c_n = 0.1 / 0.09 each, so
    2 * 0.1 / 0.09 = 2.2222 N along +y. `shift` [m] offsets the two tips along y.
    """
    s, c = np.sin(np.radians(35)), np.cos(np.radians(35))
    centre = np.array([0, 0.093, 0])
    contacts, joints = [], []
    for k, side in ((1, 1.0), (2, -1.0)):
        low = np.array([side * (0.075 + 0.05 * s - 0.01 * c), 0.05 * c + 0.01 * s, 0]) - centre
        tip = np.array([side * 0.078, side * shift / 2, 0])
        contacts.append(Contact(low, np.array([-side * c, s, 0]), 1.0, f"prox_{k}"))
        contacts.append(Contact(tip, -side * X, 1.0, f"tip_{k}"))
        joints.append(
            GraspJoint(f"prox_{k}", side * Z, np.array([side * 0.075, 0, 0]) - centre, (2 * k - 2, 2 * k - 1))
        )
    return Grasp(contacts, joints, preload={"prox_1": 0.1, "prox_2": 0.1}, name="bell")


def moved(g: Grasp, R: Array, shift: Array, order: list[int], length: float, force: float) -> Grasp:
    """Turned, shifted, its contacts in another order, in other units.

    A wrench (f, t) becomes force (R f, length (R t + shift x R f)).
    """
    at = {old: new for new, old in enumerate(order)}
    contacts = [
        replace(c, position=length * (R @ c.position + shift), normal=R @ c.normal)
        for c in (g.contacts[i] for i in order)
    ]
    joints = [
        replace(j, axis=R @ j.axis, origin=length * (R @ j.origin + shift), moves=tuple(at[i] for i in j.moves))
        for j in g.joints
    ]
    return Grasp(contacts, joints, g.mechanism, g.command * length * force, g.name)


@dataclass(frozen=True, eq=False)
class Solved:
    """A grasp, a disturbance and a state that solves (1)-(8) exactly, by construction."""

    grasp: Grasp
    wrench: Array
    state: State
    eta: float


def solved(seed: int, m: int = 3, eta: float = 0.0, stick: bool = True) -> Solved:
    """A random grasp with a known exact solution: choose motions, then read off what they cause.

    Contact 0 sticks if `stick`; the others slide or are open as the motion has it. Commands of moving
    joints are what they carry; locked ones carry anything. The disturbance is whatever balances.
    """
    rng = np.random.default_rng(seed)
    contacts = []
    for _ in range(m):
        out = rng.normal(size=3)
        out /= np.linalg.norm(out)
        tilt = -out + 0.3 * rng.normal(size=3)
        contacts.append(Contact(0.04 * out, tilt / np.linalg.norm(tilt), rng.uniform(0.2, 1.0)))
    joints = []
    for j in range(3):
        axis = rng.normal(size=3)
        moves = tuple(i for i in range(m) if i % 3 == j)
        joints.append(GraspJoint(f"j{j}", axis / np.linalg.norm(axis), 0.1 * rng.normal(size=3), moves))
    grasp = Grasp(contacts, joints)

    r = rng.normal(size=6) * np.array([1, 1, 1, 25, 25, 25])
    q = np.abs(rng.normal(size=3)) * 10
    moving = rng.random(3) < 0.6
    for _ in range(10):  # a joint that would carry a negative torque cannot be the one that moves
        q = np.where(moving, q, 0.0)
        if stick:  # the smallest change of r that keeps contact 0 from sliding
            rows = grasp.G[:, 1:3].T
            r = r - np.linalg.pinv(rows) @ (rows @ r - grasp.J[1:3] @ q)
        d = model.relative_motion(grasp, r, q)
        c = np.zeros((m, 3))
        c[:, 0] = model.spring_force(d, eta)
        for i, di in enumerate(d.reshape(-1, 3)):
            slide = np.linalg.norm(di[1:])
            if stick and i == 0:
                angle = rng.uniform(0, 2 * np.pi)
                c[i, 1:] = rng.uniform(0, 0.99) * grasp.mu[i] * c[i, 0] * np.array([np.cos(angle), np.sin(angle)])
            elif slide > 0:
                c[i, 1:] = -grasp.mu[i] * c[i, 0] * di[1:] / slide
        c = c.reshape(-1)
        tau = model.joint_torques(grasp, c)
        if (tau[moving] > 1e-6).all():
            break
        moving = moving & (tau > 1e-6)
    command = np.where(moving, tau, np.where((tau > 1e-6) & (rng.random(3) < 0.5), 0.7 * tau, 0.0))
    grasp = grasp.with_preload(command)
    return Solved(grasp, -grasp.G @ c, state_of(r, q, c, tau, np.zeros(0)), eta)
