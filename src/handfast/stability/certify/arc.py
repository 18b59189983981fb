"""States of the model over a whole range of magnitudes, and how far any of them is from solving it.

An arc is a Bezier curve in the unknowns of `State` while the disturbance goes along a straight line. What is linear in
the unknowns is a Bezier curve again, between its control values; products have control values of twice the degree.
So the residuals of `model.residuals` are bounded for all states of the arc at once, by arithmetic alone. With two
controls an arc is all convex combinations of two states.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cache
from math import comb

import numpy as np

from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.model.grasp import Grasp
from handfast.stability import model
from handfast.stability.certify.certificate import Question
from handfast.stability.exact_sums import Sums
from handfast.stability.model import Residuals, State

DEGREE = 12  # at most
ALLOWED = 1e-9  # relative to the force scale: how far a limit may be exceeded


@dataclass(frozen=True, eq=False)
class Arc:
    """A state for every magnitude from `first` to `last`.

    Attributes:
        first, last: magnitudes, first < last.
        controls: at first + (last - first) t the state is sum of comb(k, i) t^i (1 - t)^(k - i) controls[i].

    Raises:
        InputError: no range, too few or too many controls.
    """

    first: float
    last: float
    controls: tuple[State, ...]

    def __post_init__(self) -> None:
        if not 0 <= self.first < self.last < np.inf:
            raise InputError(f"goes from {self.first:g} to {self.last:g}; a range of magnitudes is needed", field="arc")
        if not 2 <= len(self.controls) <= DEGREE + 1:
            raise InputError(f"has {len(self.controls)} controls; 2 to {DEGREE + 1} are possible", field="arc")

    def state(self, s: float) -> State:
        """The state at a magnitude."""
        weights = bernstein(len(self.controls) - 1, np.array([(s - self.first) / (self.last - self.first)]))[0]
        return State(*(weights @ self.table(f.name) for f in fields(State)))

    def table(self, name: str) -> Array:
        """(k+1, n) one of the unknowns, control by control."""
        return np.array([getattr(control, name) for control in self.controls])


def bernstein(k: int, t: Array) -> Array:
    """(n, k+1) the Bernstein polynomials of degree k at t (n,)."""
    i, t = np.arange(k + 1), t[:, None]
    out: Array = np.array([comb(k, j) for j in range(k + 1)]) * t**i * (1 - t) ** (k - i)
    return out


def nodes(k: int) -> Array:
    """(k+1,) points in [0, 1] at which a polynomial of degree k is fixed, both ends among them."""
    out: Array = (1 - np.cos(np.pi * np.arange(k + 1) / k)) / 2
    return out


@cache
def controls_of(k: int) -> Array:
    """(k+1, k+1) from the values at the `nodes` to the control values."""
    out: Array = np.asarray(np.linalg.inv(bernstein(k, nodes(k))), dtype=float)
    out[0], out[-1] = np.eye(k + 1)[0], np.eye(k + 1)[-1]
    return out


def residual_bound(q: Question, arc: Arc) -> float:
    """At most how far any state of an arc is from the model: the worst of `residuals`; inf if a limit may be passed."""
    with np.errstate(all="ignore"):
        worst = [getattr(residuals(q, arc), f.name) for f in fields(Residuals)]
        out = float(np.max([*worst, _beyond(q, arc)]))  # a NaN stays one
    return out if np.isfinite(out) else np.inf


def residuals(q: Question, arc: Arc) -> Residuals:
    """At most what `model.residuals` says of any state of an arc, equation by equation; inf or NaN if nothing is known.

    The disturbance is w0 + s d, the commands are the grasp's. Force and moment scales are taken at their least on the
    arc; the middle of the contact forces, which moments are about, moves along it by a bounded distance.
    """
    g, f_c, k = q.grasp, q.grasp.command, len(arc.controls) - 1
    r, joints, c, f, coupling, reaction, torsion = (arc.table(field.name) for field in fields(State))
    s = arc.first + (arc.last - arc.first) * np.arange(k + 1)[:, None] / k
    direction = np.zeros(6) if q.direction is None else q.direction
    w = q.wrench + s * direction
    given = f_c[None], g.given_torques[None], g.joint_friction[None]
    if k == 1 and not any(a[0].any() for a in (w, *given, r, joints, c, f, coupling, reaction, torsion)):
        # multiples of one state under multiples of one disturbance: relative residuals are those of the last
        return model.residuals(g, w[1], arc.controls[1], eta=q.eta, mdp=q.mdp)

    C = c.reshape(k + 1, -1, 3)
    F = float(np.max([*least_norm(C), *least_norm(w[:, None, :3])]))
    if not F > 0:
        return Residuals(*[np.inf] * len(fields(Residuals)))
    joint_arms, arms = model.joint_arms(g), model.actuator_arms(g)
    sums = [model.linear_sums(g, w_k, x, F, joint_arms, arms) for w_k, x in zip(w, arc.controls, strict=True)]
    D = np.stack([x.d for x in sums]).reshape(k + 1, -1, 3)
    c_n, d_n, mu = C[:, :, 0], D[:, :, 0], g.mu
    c_t = np.stack([model.friction(g, *x) for x in zip(c, torsion, strict=True)])
    d_t = np.stack([model.sliding(g, x.d, x.twist) for x in sums])
    least_n = c_n.min(axis=0)
    slow, fast = least_norm(d_t), np.sqrt((d_t**2).sum(axis=2)).max(axis=0)
    speed, speed_off = _norm(d_t, slow)

    # (4), (17): closed, or open
    cos, sin = np.cos(q.eta), np.sin(q.eta)
    gap, gap_off = cos * d_n + sin * speed, sin * speed_off
    closed = np.maximum(np.abs(c_n + gap).max(axis=0) + gap_off, -least_n)
    opened = np.abs(c_n).max(axis=0) + np.maximum(0.0, gap_off - gap.min(axis=0))
    normal = np.minimum(closed, opened)

    # (5)
    tangential = np.sqrt((c_t**2).sum(axis=2))
    squares = product(c_t, c_t).sum(axis=2) - mu**2 * product(c_n, c_n)
    over, negative = np.maximum(squares.max(axis=0), 0.0), mu * np.maximum(-least_n, 0.0)
    root = np.sqrt(over + negative**2) + negative
    strong = mu * least_n
    ratio = np.where(strong > 0, over / np.where(strong > 0, strong, 1.0), np.inf)
    cone = np.minimum(np.minimum((tangential - mu * c_n).max(axis=0), root), ratio)

    # (6), (7): c_t |d_t| + mu c_n d_t along d_t and across; small anyway where either is small
    along = product(c_t, d_t).sum(axis=2) + mu * product(c_n, speed)
    turns = ((0, 1), (1, 2), (2, 0))
    across = [product(c_t[:, :, i], d_t[:, :, j]) - product(c_t[:, :, j], d_t[:, :, i]) for i, j in turns]
    aside = np.sqrt(sum(np.abs(x).max(axis=0) ** 2 for x in across))
    strength = mu * np.abs(c_n).max(axis=0)
    defect = np.hypot(np.abs(along).max(axis=0) + strength * speed_off, aside)
    defect = np.minimum(defect, (tangential.max(axis=0) + strength) * fast) / np.maximum(slow, F)

    # (8), in the sense of the command, motions and forces in newtons
    sense = np.where(f_c < 0, -1.0, 1.0)
    t = sense * np.stack([x.t for x in sums]) * arms
    e = sense * (f - f_c) / arms
    resting = np.minimum(np.abs(t).max(axis=0), np.abs(e).max(axis=0))
    moving = np.maximum.reduce([-t.min(axis=0), -e.min(axis=0), resting])
    actuators = np.where(model.commanded(g), moving, np.abs(t).max(axis=0))
    actuators = np.where(g.mechanism.backdrivable, np.abs(e).max(axis=0), actuators)

    A = g.mechanism.A
    tied = np.abs(np.stack([x.couplings for x in sums])).max(axis=0)
    slip = tied[:, None] * np.divide(joint_arms, np.abs(A), out=np.zeros(A.shape), where=A != 0)

    forces, joint = _balances(q, w, c, torsion, sums, F)
    idle = np.delete(np.abs(torsion), g.soft, axis=1).max(initial=0.0)  # point contacts carry no torsion
    if idle > 0:
        return Residuals(*[np.inf] * len(fields(Residuals)))
    return Residuals(
        object_balance=forces,
        joint_balance=joint,
        couplings=float(slip.max(initial=0.0)) / F,
        normal=float(normal.max(initial=0.0)) / F,
        cone=float(cone.max(initial=0.0)) / F,
        dissipation=float(defect.max(initial=0.0)) / F if q.mdp else 0.0,
        actuators=float(actuators.max(initial=0.0)) / F,
        reactions=float(_reactions(g, joints * joint_arms, reaction / joint_arms, joint_arms).max(initial=0.0)) / F,
    )


def _reactions(g: Grasp, q: Array, reaction: Array, arms: Array) -> Array:
    """(l,) how far motions and reactions (k+1, l), both in newtons, are from the law of the joints' reactions.

    The whole arc rests, closes or opens, whichever is nearest.
    """
    lo, hi = (bound / arms for bound in model.reaction_range(g))
    outside = np.maximum(lo - reaction, reaction - hi).max(axis=0)
    rests = np.abs(q).max(axis=0)
    closes = np.maximum(-q.min(axis=0), (reaction - lo).max(axis=0))
    opens = np.maximum(q.max(axis=0), (hi - reaction).max(axis=0))
    return np.maximum(outside, np.minimum.reduce([rests, closes, opens]))


def _balances(q: Question, w: Array, c: Array, torsion: Array, sums: list[Sums], F: float) -> tuple[float, float]:
    """(1) and (2), relative to the least that acts on the arc; controls as rows."""
    g = q.grasp
    missing = np.stack([x.object for x in sums])
    C = c.reshape(len(c), -1, 3)
    middle, strays = _middle(g.positions, C)
    moment = missing[:, 3:] - np.cross(middle, missing[:, :3])
    most = np.linalg.norm(missing[:, :3], axis=1).max()
    forces = np.einsum("mij,kmj->kmi", np.array([k.frame for k in g.contacts]), C)
    moments = least_norm(np.cross(g.positions - middle, forces)) - strays * np.linalg.norm(C, axis=2).max(axis=0)
    load = least_norm((w[:, 3:] - np.cross(middle, w[:, :3]))[:, None])[0]
    load -= strays * np.linalg.norm(w[:, :3], axis=1).max()
    scale = np.max([*moments, load, F * g.spacing])

    loaded = C.any(axis=(0, 2))
    J, R = np.where(np.repeat(loaded, 3)[:, None], g.J, 0.0), g.mechanism.R
    unbalanced = np.abs(np.stack([x.joints for x in sums])).max(axis=0)
    terms = np.abs(J.T) @ _least(c) + np.abs(R.T) @ np.abs(g.command) + np.abs(g.given_torques)
    if len(g.soft):
        terms = terms + np.abs(g.twist_jacobian.T) @ _least(torsion[:, g.soft] / g.levers)
    torque = np.maximum.reduce(
        [terms, F * np.sqrt((J * J).sum(axis=0)), model.idle_torque(g, model.joint_arms(g), F, scale)]
    )
    turned = (np.linalg.norm(moment, axis=1).max() + strays * most) / scale
    joint = (unbalanced / np.where(unbalanced > 0, np.maximum(torque, 1e-300), 1.0)).max(initial=0.0)
    return float(np.maximum(most / F, turned)), float(joint)


def _middle(p: Array, C: Array) -> tuple[Array, float]:
    """A middle of the contact forces C (k+1, m, 3) at p (m, 3), and how far at most it is from that of any state [m].

    Each position has a share in the middle, between bounds that follow from those of the lengths of all forces.
    """
    least, most = least_norm(C), np.linalg.norm(C, axis=2).max(axis=0)
    if not most.any():
        return np.asarray(p.mean(axis=0)), 0.0
    share = (least + most) / (least + most).sum()
    middle = share @ p
    others_least, others_most = least.sum() - least, most.sum() - most
    low = least / np.where(least > 0, least + others_most, 1.0)
    high = most / np.where(most > 0, most + others_least, 1.0)
    stray = np.maximum(share - low, high - share)
    return middle, float(stray @ np.linalg.norm(p - middle, axis=1))


def _beyond(q: Question, arc: Arc) -> float:
    """0 if the limits are kept at every control, and so between them; else inf."""
    c, f = arc.table("c"), arc.table("f")
    slack = ALLOWED * float(least_norm(c.reshape(len(c), -1, 3)).max(initial=0.0))
    limit = np.array([q.torque_limits.get(name, np.inf) for name in q.grasp.mechanism.actuators])
    most = np.inf if q.force_limit is None else q.force_limit
    kept = (np.abs(f) <= limit + slack * model.actuator_arms(q.grasp)).all()
    return 0.0 if kept and c[:, 0::3].max(initial=0.0) <= most + slack else np.inf


# --- bounds of Bezier curves from their control values ---------------------------------------------


@cache
def _weights(k: int) -> Array:
    """(2k+1, k+1, k+1): control values of a product from those of its factors."""
    out = np.zeros((2 * k + 1, k + 1, k + 1))
    for i in range(k + 1):
        for j in range(k + 1):
            out[i + j, i, j] = comb(k, i) * comb(k, j) / comb(2 * k, i + j)
    return out


def product(a: Array, b: Array) -> Array:
    """(2k+1, ...) control values of the product of two curves with control values a, b (k+1, ...)."""
    out: Array = np.einsum("hij,i...,j...->h...", _weights(len(a) - 1), a, b)
    return out


def least_norm(a: Array) -> Array:
    """(n,) no more than the length of n vectors anywhere on curves with control values a (k+1, n, dim)."""
    mean = a.mean(axis=0)
    size = np.sqrt((mean**2).sum(axis=1, keepdims=True))
    unit = mean / np.where(size > 0, size, 1.0)
    out: Array = np.maximum((a * unit).sum(axis=2).min(axis=0), 0.0)
    return out


def _least(a: Array) -> Array:
    """(n,) no more than the absolute value of n numbers anywhere on curves with control values a (k+1, n)."""
    out: Array = np.maximum.reduce([a.min(axis=0), -a.max(axis=0), np.zeros(a.shape[1])])
    return out


def _norm(a: Array, least: Array) -> tuple[Array, Array]:
    """The length of vectors a (k+1, n, 2) as (k+1, n) control values, and (n,) how far off these are at most.

    least: (n,) no more than the length. A polynomial through some values of the length, judged by its square.
    """
    k = len(a) - 1
    length = np.sqrt((np.einsum("hi,inj->hnj", bernstein(k, nodes(k)), a) ** 2).sum(axis=2))
    out = controls_of(k) @ length
    square = np.abs(product(a, a).sum(axis=2) - product(out, out)).max(axis=0)
    low = out.min(axis=0)
    below = np.maximum(-low, 0.0)
    off = np.sqrt(square + below**2) + below
    return out, np.minimum(off, np.where(low > 0, square / np.where(low > 0, low + least, 1.0), np.inf))
