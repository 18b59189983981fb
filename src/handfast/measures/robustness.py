"""Contact and grasp robustness: Prattichizzo, Salisbury and Bicchi, *Contact and grasp robustness measures:
analysis and experiments* (Experimental Robotics IV, 1997).

A contact force is d away from where its contact slips, lifts or is pressed harder than allowed. A wrench of size |w|
changes contact forces by no more than sigma_max(G_K) |w|, so that none of this happens as long as
|w| < d / sigma_max(G_K): the potential contact robustness PCR, with the best of the internal forces that the hand
controls. It is careful, for a grasp may hold though some contacts slip. The potential grasp robustness PGR is
therefore the best of it over all states of the contacts: one may stick, or slide and transmit its normal force
alone, or be lost, as long as the others hold the object.
"""

from __future__ import annotations

from itertools import product

import numpy as np

from handfast.core.arrays import Array
from handfast.measures.conic_program import ConicProgram, solver
from handfast.measures.internal_forces import InternalForces, internal_forces
from handfast.measures.not_measured import NotMeasured
from handfast.model.grasp import Grasp

STICKS, SLIDES, LOST = range(3)  # what a contact transmits: all, its normal force, nothing
MOST_CONTACTS = 8  # 3^8 states


def contact_robustness(grasp: Grasp, G: Array, *, force: float = 1.0) -> float:
    """PCR [N] of a grasp: the largest wrench, in the scale of G, that surely neither slips nor lifts a contact.

    Args:
        G: (6, 3m) grasp map in some scale.
        force: [N] the largest normal force at each contact.

    Raises:
        NotMeasured: clarabel is not installed.
    """
    solver()
    return _robustness(grasp, _StateForces(grasp, G, (STICKS,) * grasp.m, force))


def grasp_robustness(grasp: Grasp, G: Array, *, force: float = 1.0) -> tuple[float, tuple[int, ...]]:
    """PGR [N] of a grasp and the states of its contacts (0 sticks, 1 slides, 2 is lost).

    Arguments and errors as of `contact_robustness`; `NotMeasured` also for more than 8 contacts. All 3^m states are
    considered; programs are solved in the order of what they can reach at best, until none can be better.
    """
    solver()
    if grasp.m > MOST_CONTACTS:
        raise NotMeasured(f"{grasp.m} contacts have too many states; {MOST_CONTACTS} are the most")
    choices = [s for s in product(range(3), repeat=grasp.m) if sum((3, 1, 0)[k] for k in s) >= 6]
    parts = [_StateForces(grasp, G, states, force) for states in choices]
    best, chosen = 0.0, (STICKS,) * grasp.m
    for part in sorted(parts, key=lambda p: -p.bound):
        if part.bound <= best * (1 + 1e-9):
            break
        value = _robustness(grasp, part)
        if value > best:
            best, chosen = value, part.states
    return best, chosen


class _StateForces:
    """The internal forces of one combination of states, and what its robustness can be at most."""

    def __init__(self, grasp: Grasp, G: Array, states: tuple[int, ...], force: float) -> None:
        self.states, self.force = states, force
        self.transmitted = np.array([(s == STICKS or (s == SLIDES and k == 0)) for s in states for k in range(3)])
        self.forces: InternalForces = internal_forces(grasp, G, self.transmitted)
        self.gain, self.bound = np.inf, 0.0
        if self.forces.inverse is not None and self.forces.controllable.shape[1]:
            self.gain = float(np.linalg.norm(self.forces.inverse, 2))
            sines = grasp.mu / np.hypot(1.0, grasp.mu)
            reach = [
                force * (sine / (1 + sine) if state == STICKS else 0.5)
                for sine, state in zip(sines, states, strict=True)
                if state != LOST
            ]
            self.bound = min(reach) / self.gain


def _robustness(grasp: Grasp, parts: _StateForces) -> float:
    """[N] the PCR of one combination of states."""
    if parts.bound <= 0.0:
        return 0.0
    E = np.zeros((3 * grasp.m, parts.forces.controllable.shape[1]))
    E[parts.transmitted] = parts.forces.controllable
    e = E.shape[1]
    p = ConicProgram(e + 1)  # y, d
    normals, rights = [], []
    for i, (mu, state) in enumerate(zip(grasp.mu, parts.states, strict=True)):
        if state == LOST:
            continue
        n, t = E[3 * i], E[3 * i + 1 : 3 * i + 3]
        normals += [np.r_[n, 1.0], np.r_[-n, 1.0]]  # d below what the limit leaves, and below the normal force
        rights += [parts.force, 0.0]
        if state == STICKS:  # sin c_n - cos |c_t| >= d, the distance from the cone
            length = np.hypot(1.0, mu)
            p.in_cone(np.vstack([np.r_[mu * n, -length], np.c_[t, np.zeros(2)]]))
    p.at_most(np.array(normals), np.array(rights))
    x = p.solve(np.r_[np.zeros(e), -1.0])
    return 0.0 if x is None else max(0.0, float(x[-1])) / parts.gain
