"""One step of a slow motion: the equations of the stability model over a small motion, and a drag beside them.

The unknown x is the motion of the object and of the joints during the step. It minimises

    x' D x / (2 h)  -  b' x  +  sum of k/2 max(0, p - n x)^2  +  sum of mu c |t x|  +  x' S x / 2  +  sum of F |j x|

over the motions that couplings and locked actuators allow: drag, load and commands, contact springs that were pressed
in by p and are moved apart by n x, friction, springs of joints and their dry friction F. Gearings and joint stops are
springs that are a hundred times as stiff and push one way. The minimum balances all forces: normal forces are
c = k max(0, p - n x), friction has the size mu c against the sliding, or less where nothing slides. The c that friction
is made of is that of the solution itself, which is found by repetition. So without drag (h without end) and with p = 0
these are equations (1) to (8) of the stability paper; with p from the step before they are their increments, and drag
takes up what nothing balances.

All in scaled units: lengths by the grasp's size, forces by the largest in play.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from handfast.core.arrays import Array

STICK_MOTION = 3e-7  # [grasp sizes] motion over which a contact that sticks takes up its friction
# repetitions of the normal forces in friction; their change [force units] that is none
FRICTION_ROUNDS, FRICTION_CHANGE = 12, 1e-4
DRAG_NEWTON_STEPS, NEWTON_RESIDUAL = 60, 1e-9  # Newton steps; forces [force units] that are taken for balanced
MIN_NEWTON_SHARE = 1e-14  # share of a Newton step that still may help


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
        elastic: (n, n) S; nothing unless given.
        joints: (f, n) j, the motion of each joint that rubs; dry: (f,) F.
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
    elastic: Array | None = None
    joints: Array | None = None
    dry: Array | None = None

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
    for k in range(FRICTION_ROUNDS):
        x = _least(p, h, x, p.friction * c)
        now = p.pressure(x)
        change = float(np.abs(now - c).max(initial=0.0))
        c = now if k < 3 else (now + c) / 2  # where friction and pressure drive each other round, the mean is nearer
        if change < FRICTION_CHANGE:
            break
    return x, c


def _least(p: StepProblem, h: float, x: Array, bound: Array) -> Array:
    """The x of least energy for given bounds (m,) of friction: Newton's method, its steps halved until they help."""
    rubs = bound > 0
    flat, b = p.tangent[rubs].reshape(-1, len(x)), bound[rubs]
    if p.joints is not None and p.dry is not None:  # a joint rubs as a contact does that slides along one line
        alone = np.stack([p.joints, np.zeros_like(p.joints)], axis=1).reshape(-1, len(x))
        flat, b = np.vstack([flat, alone]), np.r_[b, p.dry]
    value = _energy(p, h, x, flat, b)
    for _ in range(DRAG_NEWTON_STEPS):
        slope, curve = _slope(p, h, x, flat, b)
        if np.abs(slope).max() < NEWTON_RESIDUAL:
            break
        step = np.linalg.solve(curve, -slope)
        gain = 1e-4 * float(slope @ step)
        share = 1.0
        new = _energy(p, h, x + step, flat, b)
        while new > value + share * gain and share > MIN_NEWTON_SHARE:
            share /= 2
            new = _energy(p, h, x + share * step, flat, b)
        if share <= MIN_NEWTON_SHARE:
            break
        x, value = x + share * step, new
    return x


def _energy(p: StepProblem, h: float, x: Array, flat: Array, bound: Array) -> float:
    """What is minimised. flat: (2 k, n) tangents of k contacts and joints that rub; bound: (k,) their friction."""
    pressed = np.maximum(0.0, p.depth - p.normal @ x)
    beyond = np.maximum(0.0, p.stops @ x - p.room)
    springs = p.stiffness / 2 * (pressed @ pressed) + p.stop_stiffness / 2 * (beyond @ beyond)
    slid = (flat @ x).reshape(-1, 2)
    far = np.sqrt((slid * slid).sum(axis=1))
    rubbed = bound @ np.where(far > STICK_MOTION, far - STICK_MOTION / 2, far * far / (2 * STICK_MOTION))
    bent = 0.0 if p.elastic is None else float(x @ p.elastic @ x) / 2
    return float((p.drag / (2 * h) * x - p.push) @ x + springs + rubbed) + bent


def _slope(p: StepProblem, h: float, x: Array, flat: Array, bound: Array) -> tuple[Array, Array]:
    """Slope (n,) and curvature (n, n) of the energy."""
    slope, curve = p.drag / h * x - p.push, np.diag(p.drag / h)
    if p.elastic is not None:
        slope, curve = slope + p.elastic @ x, curve + p.elastic
    for rows, over, stiffness in (
        (-p.normal, p.depth - p.normal @ x, p.stiffness),
        (p.stops, p.stops @ x - p.room, p.stop_stiffness),
    ):
        A = rows[over > 0]
        slope = slope + stiffness * (over[over > 0] @ A)
        curve = curve + stiffness * A.T @ A
    slid = (flat @ x).reshape(-1, 2)
    far = np.sqrt((slid * slid).sum(axis=1))
    length = np.maximum(far, STICK_MOTION)
    along = slid / length[:, None]
    slope = slope + flat.T @ (bound[:, None] * along).ravel()
    slides = (far > STICK_MOTION)[:, None, None]
    across = np.eye(2) - np.where(slides, along[:, :, None] * along[:, None, :], 0.0)
    weighted = (across * (bound / length)[:, None, None]) @ flat.reshape(len(bound), 2, len(x))
    return slope, curve + flat.T @ weighted.reshape(flat.shape)
