"""States over a whole range of magnitudes, and how far any of them is from the model.

An arc is a Bezier curve in the unknowns of `State` while the load goes along a straight line. What is linear in the
unknowns is a Bezier curve again, between its control values; products have control values of twice the degree. So the
residuals of (1) to (8) are bounded for all states of the arc at once, by arithmetic alone. What an arc claims is that:
every equation is missed by at most 1e-9 of load and commands, never of contact forces. That an exact state exists at
each of its magnitudes is not claimed. With two controls an arc is all convex combinations of two states.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cache
from math import comb

import numpy as np

from handfast.proofs.fields import Array, BadFile, Fields
from handfast.proofs.grasp import GraspData
from handfast.proofs.question import LARGEST, SMALLEST_PRELOAD, Question
from handfast.proofs.rational import dot, rationals, rounded
from handfast.proofs.states import State, reaction_ends, read_state
from handfast.proofs.tolerance import EPS, load_scale

DEGREE = 12  # at most
ULP = 2.0**-53
NEARBY = 1e5  # times the load: joints that move less lose less than 1e-9 of it in the rounding of a sum
ROUNDED = 16  # ulp of an entry of G and J, relative to the sum of absolute values behind it, and of what comes after


@dataclass(frozen=True, eq=False)
class Arc:
    """A state for every magnitude from `first` to `last`.

    Attributes:
        first, last: magnitudes, first < last.
        controls: at first + (last - first) t the state is sum of comb(k, i) t^i (1 - t)^(k - i) controls[i].

    Raises:
        BadFile: no range, too few or too many controls.
    """

    first: float
    last: float
    controls: tuple[State, ...]

    def __post_init__(self) -> None:
        if not 0 <= self.first < self.last < np.inf:
            raise BadFile(f"goes from {self.first:g} to {self.last:g}; a range of magnitudes is needed", "arc")
        if not 2 <= len(self.controls) <= DEGREE + 1:
            raise BadFile(f"has {len(self.controls)} controls; 2 to {DEGREE + 1} are possible", "arc")

    def table(self, name: str) -> Array:
        """(k+1, n) one of the unknowns, control by control."""
        return np.array([getattr(control, name) for control in self.controls])


def read_arc(f: Fields, q: Question) -> Arc:
    """The arc in an object of a file. Raises `BadFile`."""
    first, last = f.number("first", least=0.0), f.number("last")
    states = []
    for control in f.objects("controls"):
        states.append(read_state(control, q.grasp))
        control.done()
    f.done()
    try:
        return Arc(first, last, tuple(states))
    except BadFile as fault:
        raise BadFile(fault.problem, f.place) from None


def replayed(q: Question, arc: Arc) -> tuple[str, float]:
    """Why an arc does not show what it claims, "" if it does; and its residual, relative to the load."""
    residual = residual_bound(q, arc)
    if residual <= EPS:
        return "", residual
    return (
        f"states from {arc.first:.6g} to {arc.last:.6g} are off by {residual:.1e} of load and commands, above {EPS:g}",
        residual,
    )


def residual_bound(q: Question, arc: Arc) -> float:
    """At most how far any state of an arc is from the model, relative to the load; inf if a limit may be passed."""
    with np.errstate(all="ignore"):
        worst = float(np.max(list(residuals(q, arc).values()))) if _kept(q, arc) else np.inf
    return worst if np.isfinite(worst) else np.inf


def residuals(q: Question, arc: Arc) -> dict[str, float]:
    """At most what each of (1) to (8) is missed by in any state of an arc, relative to the least load on it.

    The load is w0 + s d, the commands are the grasp's. An arc that begins at rest without any load has multiples of
    its last state, whose relative residuals are the same.
    """
    g, k = q.grasp, len(arc.controls) - 1
    x = {f.name: arc.table(f.name) for f in fields(State)}
    s = arc.first + (arc.last - arc.first) * np.arange(k + 1)[:, None] / k
    w = q.wrench + s * q.direction
    none = [w[0], g.command, g.torque, g.friction, *(table[0] for table in x.values())]
    if k == 1 and not any(part.any() for part in none):
        x, w = {name: table[1:].repeat(2, axis=0) for name, table in x.items()}, w[1:].repeat(2, axis=0)
    return {name: float(np.max(part, initial=0.0)) for name, part in missed(g, w, x, q.eta, q.mdp).items()}


def missed(
    g: GraspData, w: Array, x: Mapping[str, Array], eta: float, mdp: bool, scale: float | None = None
) -> dict[str, Array]:
    """The same for controls, part by part: loads w (k+1, 6), and the unknowns of `State` by name, (k+1, ...) each.

    scale: [N] of the load, of a state alone; then its motions at the contacts are rational numbers, and what couplings,
    actuators and stops hold does not move at all, but for the rounding of a sum.
    """
    k, f_c = len(w) - 1, g.command
    F = least_scale(g, w) if scale is None else scale
    if not F > 0:
        return {"load": np.array([np.inf])}
    M, size = (table[:-1] for table in g.rows)
    motion = np.concatenate([x["r"], x["q"]], axis=1)
    soft = np.zeros((k + 1, g.m))
    soft[:, g.soft] = x["torsion"][:, g.soft] / g.lever[g.soft]
    phi = np.concatenate([x["c"], soft[:, g.soft], x["f"], x["coupling"], x["reaction"]], axis=1)
    d, noise = motion @ M.T, (ROUNDED + M.shape[1]) * ULP * (size @ np.abs(motion).max(axis=0))
    q = x["q"] * g.joint_arms
    if scale is not None:
        d = np.array([[rounded(dot(row, rationals(v))) for row in g.exact_rows[:-1]] for v in motion])
        noise = 4 * ULP * np.abs(d).max(axis=0)
        held = g.parts[2].start
        small = float(np.abs(q).max(initial=0.0)) <= NEARBY * scale  # else what is lost in a sum is no small force
        rounds = np.abs(d[:, held:]) <= small * 64 * ULP * (np.abs(motion) @ size[held:].T)
        d[:, held:], noise[held:] = np.where(rounds, 0.0, np.copysign(np.inf, d[:, held:])), 0.0
        q = np.where(x["q"] == 0, 0.0, np.copysign(np.inf, x["q"]))
    parts = g.parts
    D, C = d[:, parts[0]].reshape(k + 1, -1, 3), x["c"].reshape(k + 1, -1, 3)
    turned = np.zeros((k + 1, g.m))
    turned[:, g.soft] = d[:, parts[1]]
    c_n, d_n, mu = C[:, :, 0], D[:, :, 0], g.mu
    c_t = np.concatenate([C[:, :, 1:], soft[:, :, None]], axis=2)
    d_t = np.concatenate([D[:, :, 1:], turned[:, :, None]], axis=2)
    least_n, slow = c_n.min(axis=0), least_norm(d_t)
    fast = np.sqrt((d_t**2).sum(axis=2)).max(axis=0)
    speed, speed_off = _norm(d_t, slow)

    # (4), (17): closed, or open
    cos, sin = float(np.cos(eta)), float(np.sin(eta))
    gap, gap_off = cos * d_n + sin * speed, sin * speed_off
    closed = np.maximum(np.abs(c_n + gap).max(axis=0) + gap_off, -least_n)
    tangential = np.sqrt((c_t**2).sum(axis=2))
    opened = (np.abs(c_n) + tangential).max(axis=0) + np.maximum(0.0, gap_off - gap.min(axis=0))
    normal = np.minimum(closed, opened) + noise[parts[0]].reshape(-1, 3).sum(axis=1)

    # (5)
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
    aside = np.sqrt(sum(np.abs(part).max(axis=0) ** 2 for part in across))
    strength = mu * np.abs(c_n).max(axis=0)
    defect = np.hypot(np.abs(along).max(axis=0) + strength * speed_off, aside)
    defect = np.minimum(defect, (tangential.max(axis=0) + strength) * fast) / np.maximum(slow, F)

    # (8), in the sense of the command, motions and forces in newtons
    sense, arms = np.where(f_c < 0, -1.0, 1.0), g.actuator_arms
    t, e = sense * d[:, parts[2]] * arms, sense * (x["f"] - f_c) / arms
    resting = np.minimum(np.abs(t).max(axis=0), np.abs(e).max(axis=0))
    moving = np.maximum.reduce([-t.min(axis=0), -e.min(axis=0), resting])
    actuators = np.where((f_c != 0) | g.tendon, moving, np.abs(t).max(axis=0))
    actuators = np.where(g.backdrivable, np.abs(e).max(axis=0), actuators)

    missed = phi @ M + np.concatenate([w, np.broadcast_to(g.torque, (k + 1, g.l))], axis=1)  # (1), (2)
    rounding = (ROUNDED + len(M)) * ULP * (np.abs(phi).max(axis=0) @ size)
    if scale is not None and not len(g.soft):  # whose torsion over the lever is rounded
        missed = np.array([_sum(g, *one) for one in zip(phi, w, strict=True)])
        rounding = 4 * ULP * np.abs(missed).max(axis=0)
    torque = missed[:, 3:6] - np.cross(g.centroid, missed[:, :3])
    joints = np.abs(missed[:, 6:]).max(axis=0) + rounding[6:]
    point = np.abs(np.delete(x["torsion"], g.soft, axis=1)).max(initial=0.0)  # point contacts carry no torsion
    out = {
        "force": np.linalg.norm(missed[:, :3], axis=1).max() + rounding[:3].sum(),
        "torque": (np.linalg.norm(torque, axis=1).max() + rounding[3:6].sum()) / g.size + rounding[:3].sum(),
        "joints": joints / g.joint_units,
        "couplings": np.abs(d[:, parts[3]]).max(axis=0) + noise[parts[3]],
        "normal": normal,
        "cone": cone,
        "dissipation": defect if mdp else 0.0,
        "actuators": actuators,
        "reactions": _reactions(g, q, x["reaction"] / g.joint_arms),
        "torsion": np.inf if point > 0 else 0.0,
    }
    return {name: np.atleast_1d(value) / F for name, value in out.items()}


def _sum(g: GraspData, phi: Array, w: Array) -> list[float]:
    """(6 + l,) what forces phi (p,) under a load w (6,) miss (1) and (2) by, rounded once."""
    forces, given = rationals(phi), rationals(np.concatenate([w, g.torque]))
    columns = zip(*g.exact_rows[:-1], strict=True)
    return [rounded(dot(column, forces) + x) for column, x in zip(columns, given, strict=True)]


def least_scale(g: GraspData, w: Array) -> float:
    """[N] of commands and any load between the controls w (k+1, 6), the least; 0 where one may be none."""
    drives = load_scale(g, np.zeros(6)) if g.command.any() or g.torque.any() else 0.0
    torque = w[:, 3:] - np.cross(g.centroid, w[:, :3])
    return float(max(drives, least_norm(w[:, None, :3])[0], least_norm(torque[:, None])[0] / g.size))


def _reactions(g: GraspData, q: Array, reaction: Array) -> Array:
    """(l,) how far motions and reactions (k+1, l), both in newtons, are from the law of the joints' reactions.

    The whole arc rests, closes or opens, whichever is nearest.
    """
    lo, hi = (bound / g.joint_arms for bound in reaction_ends(g))
    outside = np.maximum(lo - reaction, reaction - hi).max(axis=0)
    rests = np.abs(q).max(axis=0)
    closes = np.maximum(-q.min(axis=0), (reaction - lo).max(axis=0))
    opens = np.maximum(q.max(axis=0), (hi - reaction).max(axis=0))
    return np.asarray(np.maximum(outside, np.minimum.reduce([rests, closes, opens])))


def _kept(q: Question, arc: Arc) -> bool:
    """Are the limits kept at every control, and so between them?"""
    f, c_n = arc.table("f"), arc.table("c")[:, 0::3]
    limit = np.array([q.torque_limits.get(name, np.inf) for name in q.grasp.actuators], dtype=float)
    w = q.wrench + arc.last * q.direction
    slack = EPS * load_scale(q.grasp, w)
    kept = (np.abs(f) <= limit + slack * q.grasp.actuator_arms).all() and c_n.max() <= q.force_limit + slack
    return bool(kept and q.goal in (LARGEST, SMALLEST_PRELOAD))


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
