"""One step of a slow motion: the equations of the stability model over a small motion, and a drag beside them.

The unknown x is the motion of the object and of the joints during the step. It minimises

    x' D x / (2 h)  -  b' x  +  sum of k/2 max(0, p - n x)^2  +  sum of mu c |t x|

over the motions that couplings and locked actuators allow: drag, load and commands, contact springs that were pressed
in by p and are moved apart by n x, and friction. Gearings and joint stops are springs that are a hundred times as stiff
and push one way. The minimum balances all forces: normal forces are c = k max(0, p - n x), friction has the size mu c
against the sliding, or less where nothing slides. The c that friction is made of is that of the solution itself, which
is found by repetition. So without drag (h without end) and with p = 0 these are equations (1) to (8) of the stability
paper; with p from the step before they are their increments, and drag takes up what nothing balances.

All in scaled units: lengths by the grasp's size, forces by the largest in play.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from handfast.core.arrays import Array

STICK = 3e-7  # [grasp sizes] motion over which a contact that sticks takes up its friction
ROUNDS, SETTLED = 12, 1e-4  # repetitions of the normal forces in friction; their change [force units] that is none
MOST, EXACT = 60, 1e-9  # Newton steps; forces [force units] that are taken for balanced


@dataclass(frozen=True, eq=False)
class StepProblem:
    """What acts during a step; x has n components.

    Attributes:
        drag: (n,) of each component.
        push: (n,) forces on x: load and commands.
        normal: (m, n) how a motion parts the surfaces at each contact.
        tangent: (m, 2, n) how it slides them.
        depth: (m,) p.
        stiffness: k.
        friction: (m,) mu.
        stops: (s, n) motion towards each stop; a stop pushes back once stops x is above `room`.
        room: (s,) negative if it is passed already.
        stop_stiffness: of the stops.
    """

    drag: Array
    push: Array
    normal: Array
    tangent: Array
    depth: Array
    stiffness: float
    friction: Array
    stops: Array
    room: Array
    stop_stiffness: float

    def pressure(self, x: Array) -> Array:
        """(m,) normal forces after a motion."""
        out: Array = self.stiffness * np.maximum(0.0, self.depth - self.normal @ x)
        return out


def drag_step(p: StepProblem, h: float, start: Array, pressure: Array) -> tuple[Array, Array]:
    """The motion x (n,) in a step of duration h, and the normal forces (m,) in friction at its end.

    Args:
        start: (n,) a guess.
        pressure: (m,) a guess of the normal forces.
    """
    x, c = start, pressure
    for k in range(ROUNDS):
        x = _least(p, h, x, p.friction * c)
        now = p.pressure(x)
        change = float(np.abs(now - c).max(initial=0.0))
        c = now if k < 3 else (now + c) / 2  # where friction and pressure drive each other round, the mean is nearer
        if change < SETTLED:
            break
    return x, c


def _least(p: StepProblem, h: float, x: Array, bound: Array) -> Array:
    """The x of least energy for given bounds (m,) of friction: Newton's method, its steps halved until they help."""
    value, slope, curve = _energy(p, h, x, bound)
    for _ in range(MOST):
        if np.abs(slope).max() < EXACT:
            break
        step = np.linalg.solve(curve, -slope)
        gain = float(slope @ step)
        share = 1.0
        while True:
            tried = x + share * step
            new, new_slope, new_curve = _energy(p, h, tried, bound)
            if new <= value + 1e-4 * share * gain or share < 1e-14:
                break
            share /= 2
        if share < 1e-14:
            break
        x, value, slope, curve = tried, new, new_slope, new_curve
    return x


def _energy(p: StepProblem, h: float, x: Array, bound: Array) -> tuple[float, Array, Array]:
    """The energy, its slope (n,) and its curvature (n, n)."""
    dragged = p.drag / h * x
    value = float(x @ dragged) / 2 - float(p.push @ x)
    slope, curve = dragged - p.push, np.diag(p.drag / h)
    pressed = np.maximum(0.0, p.depth - p.normal @ x)
    N = p.normal[pressed > 0]
    value += p.stiffness / 2 * float(pressed @ pressed)
    slope = slope - p.stiffness * (p.normal.T @ pressed)
    curve = curve + p.stiffness * N.T @ N
    beyond = np.maximum(0.0, p.stops @ x - p.room)
    S = p.stops[beyond > 0]
    value += p.stop_stiffness / 2 * float(beyond @ beyond)
    slope = slope + p.stop_stiffness * (p.stops.T @ beyond)
    curve = curve + p.stop_stiffness * S.T @ S
    rubs = bound > 0
    if rubs.any():
        T, b = p.tangent[rubs], bound[rubs]
        slid = T @ x
        far = np.sqrt((slid * slid).sum(axis=1))
        sliding = far > STICK
        length = np.where(sliding, far, STICK)
        value += float((b * np.where(sliding, far - STICK / 2, far**2 / (2 * STICK))).sum())
        along = slid / length[:, None]
        flat = T.reshape(-1, T.shape[2])
        slope = slope + flat.T @ (b[:, None] * along).ravel()
        across = np.eye(2) - np.where(sliding[:, None, None], along[:, :, None] * along[:, None, :], 0.0)
        weighted = np.einsum("i,ijk,ikn->ijn", b / length, across, T).reshape(-1, T.shape[2])
        curve = curve + flat.T @ weighted
    return value, slope, curve
