"""States that hold to `tolerance.EPS` of the load: one alone, or one for each magnitude along a curve.

What is shown: an exact state of the model under another load and other joint torques, in which the motions at the
contacts differ as well, each by no more than `tolerance` allows. It is put together from the floats. Joints are
projected onto what couplings, locked actuators and stops hold, in rational numbers: these do not give way. Every
contact, actuator and law of a joint takes the mode that changes its forces least. How far its motions are from that is
what (3) gives way by; changes of forces, and what is missing in (1) and (2), are what load and torques differ by.

A curve is a Bezier curve in the unknowns of `State` while the load goes along a straight line. What is linear is one
again, between its control values; products have control values of twice the degree. So all of this is bounded for
every state of the curve at once. A state alone is a curve of two equal controls.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cache
from math import comb

import numpy as np
from flint import fmpq, fmpq_mat

from handfast.proofs.fields import Array, exact, floats, not_zero
from handfast.proofs.states import ContactMode, Modes, Part, Problem, State, reaction_ends, sense
from handfast.proofs.tolerance import EPS, UNIT_ROUNDOFF, WORK, motion_size

# what is allowed, and what is bounded, with room for the rounding of bounds
ALLOWED_SHARE, RESIDUAL_INFLATION = 1 - 1e-6, 1 + 1e-9


@dataclass(frozen=True, eq=False)
class Near:
    """What a curve of states misses.

    Attributes:
        missed: the most of it, relative to the load: EPS or less is shown. where: what that is.
        modes: of the states that are shown.
        forces, changed: [N] how far forces and motions at the contacts are from the floats at most.
        apart: [N] `tolerance.motion_size` of how far all motions are from them at most; motion: of the states.
    """

    missed: float
    where: str
    modes: Modes
    forces: float
    changed: float
    apart: float
    motion: float = np.inf

    @property
    def shown(self) -> bool:
        """Does it hold to the tolerance?"""
        return self.missed <= EPS * ALLOWED_SHARE


def near(p: Problem, x: State) -> Near:
    """A state alone, of the problem's load and magnitude."""
    return along(p, np.array([p.magnitude]), {f.name: getattr(x, f.name)[None] for f in fields(State)}, p.granted)


def along(p: Problem, s: Array, x: Mapping[str, Array], scale: float) -> Near:
    """A curve.

    Args:
        p: its grasp with commands, its laws and limits; the load is wrench + s along.
        s: (k+1,) controls of the magnitude. x: (k+1, n) those of the unknowns of `State`, by name.
        scale: [N] at most that of any load on the curve.
    """
    with np.errstate(all="ignore"):
        return _Curve(p, s, x, scale).shown()


class _Curve:
    """The controls in the modes that are shown.

    Attributes:
        c, twist, f, reaction: (k+1, m, 3), (k+1, m), (k+1, a), (k+1, l) forces; those that a mode gives are put in.
        c_off, f_off, reaction_off: (m,), (a,), (l,) by how much forces change besides, anywhere on the curve.
        q: rational joint motions, control by control. slip: (m,) [N] how far (3) gives way.
        faults: what is missed, by name, relative to the load.
    """

    def __init__(self, p: Problem, s: Array, x: Mapping[str, Array], scale: float) -> None:
        self.p, self.g, self.s, self.x, self.F = p, p.grasp, s, x, scale
        self.faults: dict[str, float] = {}
        g, soft = self.g, self.g.soft
        self.twist = np.zeros((len(s), g.m))
        self.twist[:, soft] = x["torsion"][:, soft] / g.lever[soft]
        if np.delete(x["torsion"], soft, axis=1).any():
            self.faults["torsion of a point contact"] = np.inf
        self.c = x["c"].reshape(len(s), g.m, 3).copy()
        self.f, self.reaction = x["f"].copy(), x["reaction"].copy()
        given = exact(x["q"])
        self._actuators(given)
        self._joints(given)
        self._project(given)
        self.v = np.hstack([exact(x["r"]), self.q])
        self._contacts()

    def _fault(self, name: str, missed: Array | float, names: Sequence[str] = ()) -> None:
        """Note what is missed [N], the largest."""
        worst = np.atleast_1d(np.asarray(missed, dtype=float))
        if worst.size:
            k = int(np.argmax(worst))
            name, size = name.format(names[k] if names else k), float(worst[k]) / self.F
            self.faults[name] = max(self.faults.get(name, 0.0), size if np.isfinite(size) else np.inf)

    # --- actuators and laws of joints

    def _actuators(self, q: Array) -> None:
        p, g = self.p, self.g
        turns = sense(p) * self._motions(g.parts[2], q, g.slack)
        beyond = sense(p) * (self.f - p.command)
        off = np.abs(beyond).max(axis=0) / g.actuator_arms
        commanded = ((p.command != 0) | g.tendon) & ~g.backdrivable
        moves = commanded & (off <= EPS * self.F) & (turns.min(axis=0) >= 0) & turns.any(axis=0)
        self.actuator = np.select([g.backdrivable, moves, commanded], [Part.FREE, Part.MOVES, Part.RESTS], Part.LOCKED)
        given = moves | g.backdrivable
        self._fault("actuator '{}', which moves, off its command", np.where(given, off, 0.0), g.actuators)
        self.f = np.where(given, p.command, self.f)
        over = np.maximum(np.abs(self.f).max(axis=0) - p.limit, 0.0)
        self._fault("the limit of actuator '{}'", np.where(given & (over > 0), np.inf, 0.0), g.actuators)
        short = np.where(commanded & ~given, np.maximum(-beyond.min(axis=0), 0.0), 0.0)
        self.f_off = np.where(given, 0.0, np.maximum(over, short))
        out_of_reach = commanded & ~given & (np.abs(p.command) > p.limit)
        self._fault("the limit of actuator '{}'", np.where(out_of_reach, np.inf, 0.0), g.actuators)

    def _joints(self, q: Array) -> None:
        g = self.g
        (lo, hi), turns = reaction_ends(g), self._motions(g.parts[4], q)
        at_low, at_high = (np.abs(self.reaction - end).max(axis=0) <= EPS * self.F * g.joint_arms for end in (lo, hi))
        side, left = np.sign(g.stops_left), self._motions(g.parts[4], q, g.stops_left)
        none, some = lo == hi, turns.any(axis=0)
        near_stop = np.abs(left).max(axis=0) <= EPS * self.F / g.joint_arms
        back = (side != 0) & near_stop & ((side * self.reaction).min(axis=0) > g.friction - EPS * self.F * g.joint_arms)
        lo, hi = np.where(back & (side > 0), g.friction, lo), np.where(back & (side < 0), -g.friction, hi)
        lo, hi = np.where(back & (side < 0), -np.inf, lo), np.where(back & (side > 0), np.inf, hi)
        closes = at_low & (turns.min(axis=0) >= 0) & some & ~none & ~back
        opens = at_high & (turns.max(axis=0) <= 0) & some & ~none & ~closes & ~back
        kinds = [Part.BACK, Part.FREE, Part.MOVES, Part.OPENS]
        self.joint = np.select([back, none, closes, opens], kinds, Part.RESTS)
        given = np.where(opens, hi, lo)
        fixed = (none & ~back) | closes | opens
        outside = np.maximum(np.maximum(lo - self.reaction, self.reaction - hi).max(axis=0), 0.0)
        off = np.where(fixed, np.abs(self.reaction - given).max(axis=0), outside)
        self._fault("the reaction of joint '{}' off its law", off / g.joint_arms, g.joints)
        self.reaction = np.where(fixed, given, self.reaction)
        self.reaction_off = np.where(fixed, 0.0, outside)

    def _project(self, q: Array) -> None:
        """Onto what is held; what moves has to keep its sense."""
        p, g = self.p, self.g
        _, _, actuators, couplings, joints = g.parts
        held = [actuators.start + k for k in np.flatnonzero(np.isin(self.actuator, (Part.LOCKED, Part.RESTS)))]
        held += [*range(couplings.start, couplings.stop)]
        held += [joints.start + k for k in np.flatnonzero((self.joint == Part.RESTS) | (self.joint == Part.BACK))]
        rows, units = g.exact_table[held][:, 6:], exact(1.0 / g.joint_arms)
        before = np.concatenate([np.zeros(actuators.start), g.slack, np.zeros(joints.start - actuators.stop)])
        before = np.concatenate([before, np.where(self.joint == Part.BACK, g.stops_left, 0.0)])
        q_held = _projected(q, rows, units, exact(-before[held]))
        if q_held is None:
            self.faults["what stops and tendons hold"] = np.inf
        self.q = q if q_held is None else q_held
        past = np.where(g.stops_left != 0, np.sign(g.stops_left) * self._motions(joints, self.q, g.stops_left), 0.0)
        self._fault("the stop of joint '{}'", np.where(past.min(axis=0) < 0, np.inf, 0.0), g.joints)
        turns = sense(p) * self._motions(actuators, self.q, g.slack)
        back = np.where((self.actuator == Part.MOVES) & (turns.min(axis=0) < 0), np.inf, 0.0)
        self._fault("the sense of actuator '{}'", back, g.actuators)
        turns = np.where(self.joint == Part.OPENS, -1.0, 1.0) * self._motions(joints, self.q)
        back = np.where(np.isin(self.joint, (Part.MOVES, Part.OPENS)) & (turns.min(axis=0) < 0), np.inf, 0.0)
        self._fault("the sense of joint '{}'", back, g.joints)

    def _motions(self, part: slice, q: Array, before: Array | float = 0.0) -> Array:
        """(k+1, n) of rows that know joints alone, rounded once; what is not 0 stays so; before: (n,) to be added."""
        return floats(self._of_rows(q, self.g.exact_table[part][:, 6:]) + exact(before), not_zero)

    @staticmethod
    def _of_rows(v: Array, rows: Array) -> Array:
        """(k+1, n) v (k+1, j) times each of some rows (n, j)."""
        if not rows.size or not (v != 0).any():
            return np.full((len(v), len(rows)), fmpq(0))
        return np.array((fmpq_mat(v.tolist()) * fmpq_mat(rows.tolist()).transpose()).tolist(), dtype=object)

    # --- contacts

    def _contacts(self) -> None:
        """The mode of each contact, (m,) how far its motion gives way, and how much its force changes besides."""
        p, g, mu = self.p, self.g, self.g.mu
        rows = g.parts[1].stop
        of_contacts = self._of_rows(self.v, g.exact_table[:rows])
        d = floats(of_contacts)
        d_n, c_n = d[:, : 3 * g.m : 3], self.c[:, :, 0]
        D = np.append(d, np.zeros((len(d), 1)), axis=1)[:, np.minimum(g.contact_rows[:, 1:], rows)]
        closing = exact(c_n) + exact(p.cos) * of_contacts[:, : 3 * g.m : 3] + exact(g.gaps)
        press = floats(closing)  # c_n + cos d_n, from where it was before
        c_t = np.concatenate([self.c[:, :, 1:], self.twist[:, :, None]], axis=2)
        tangential, size = (np.sqrt((x**2).sum(axis=2)) for x in (c_t, D))
        slow, fast, strength = least_norm(D), size.max(axis=0), mu * np.abs(c_n).max(axis=0)
        speed, speed_off = _norm(D, slow)
        rounding = 8 * UNIT_ROUNDOFF * (p.sin * (speed_off + np.abs(speed).max(axis=0)))
        gap, gap_off = g.gaps + p.cos * d_n + p.sin * speed, p.sin * speed_off + rounding
        gap_off_open = gap_off + 8 * UNIT_ROUNDOFF * (np.abs(d_n).max(axis=0) + np.abs(g.gaps))

        # (5): how far c_t is outside of the cone; (6), (7): c_t |d_t| + mu c_n d_t, along d_t and across
        edge = 4 * UNIT_ROUNDOFF * (tangential + mu * np.abs(c_n))
        squares = product(c_t, c_t).sum(axis=2) - mu**2 * product(c_n, c_n)
        over = np.maximum(squares.max(axis=0), 0.0) + 8 * UNIT_ROUNDOFF * strength * tangential.max(axis=0)
        ratio = np.where(mu * c_n.min(axis=0) > 0, over / (mu * c_n.min(axis=0)), np.inf)
        outside = np.minimum(_positive((tangential - mu * c_n + edge).max(axis=0)), ratio)
        along_d = product(c_t, D).sum(axis=2) + mu * product(c_n, speed)
        turns = ((0, 1), (1, 2), (2, 0))
        across = [product(c_t[:, :, i], D[:, :, j]) - product(c_t[:, :, j], D[:, :, i]) for i, j in turns]
        aside = np.sqrt(sum(np.abs(part).max(axis=0) ** 2 for part in across))
        defect = np.hypot(np.abs(along_d).max(axis=0) + strength * speed_off, aside)
        defect += 32 * UNIT_ROUNDOFF * (tangential.max(axis=0) + strength) * fast
        clipped = _positive(np.maximum(-c_n.min(axis=0), c_n.max(axis=0) - p.force_limit))
        inside = (1 + mu) * clipped + np.where(mu > 0, outside, tangential.max(axis=0))
        turned = (1 + mu) * clipped + np.where(mu > 0, defect / slow, tangential.max(axis=0))
        least = least_norm(c_t)
        radial = (np.abs(squares).max(axis=0) + 16 * UNIT_ROUNDOFF * strength * tangential.max(axis=0)) / least
        drawn = (defect + radial * fast) / least
        slides = np.abs(press + p.sin * speed).max(axis=0) + gap_off + clipped
        slips = [  # modes, by how much forces change for them, and motions at the contact
            (
                ContactMode.OPEN,
                np.hypot(np.abs(c_n), tangential).max(axis=0),
                _positive((gap_off_open - gap).max(axis=0)),
            ),
            (ContactMode.STICKS, inside, np.hypot(np.abs(press).max(axis=0) + clipped, fast)),
        ]
        if p.mdp:  # friction is turned to the motion, or the motion to the friction
            stretched = (1 + mu) * clipped + radial
            slips += [(ContactMode.SLIDES, turned, slides), (ContactMode.SLIDES, stretched, np.hypot(slides, drawn))]
        else:
            slips += [(ContactMode.RUBS, inside, slides)]
        changes, gives = (np.array([option[i] for option in slips]) * RESIDUAL_INFLATION for i in (1, 2))
        changes, gives = (np.where(np.isfinite(x), x, np.inf) for x in (changes, gives / p.cos))
        cost = np.where(gives <= EPS * self.F * ALLOWED_SHARE, changes, np.inf)
        cost = np.where(np.isfinite(cost).any(axis=0), cost, changes + gives)
        best, every = cost.argmin(axis=0), np.arange(g.m)
        self.contact = np.array([int(option[0]) for option in slips])[best]
        self.c_off, self.slip = changes[best, every], gives[best, every]
        self.forces = float(self.c_off.max())
        self._fault("the law of contact {}", self.slip)
        opens = self.contact == ContactMode.OPEN
        self.c[:, opens], self.twist[:, opens], self.c_off[opens] = 0.0, 0.0, 0.0
        bare = (mu == 0) & ~opens
        self.c[:, bare, 1:], self.c_off[bare] = 0.0, RESIDUAL_INFLATION * clipped[bare]

    # --- balance

    def shown(self) -> Near:
        """With what (1), (2) and the balance of energy miss, about the contacts' centroid."""
        p, g, F = self.p, self.g, self.F
        soft = self.twist[:, g.soft]
        phi = np.concatenate([self.c.reshape(len(self.c), -1), soft, self.f, self.x["coupling"], self.reaction], axis=1)
        center, v = exact(g.centroid), self.v
        total = self._of_rows(exact(phi), g.exact_table[:-1].T) + exact(np.r_[p.wrench, g.torque])
        if p.along is not None:
            total[:, :6] += exact(self.s)[:, None] * exact(p.along)
        total[:, 3:6] -= np.cross(center, total[:, :3])
        off, moved = floats(total), floats(np.hstack([v[:, :3] + np.cross(v[:, 3:6], center), v[:, 3:]]))
        arms, J = g.force_arms
        joints = self.c_off @ J + self.f_off @ np.abs(g.R) + self.reaction_off + np.abs(off[:, 6:]).max(axis=0)
        length = lambda x: np.sqrt((x**2).sum(axis=1)).max()  # noqa: E731
        force = self.c_off.sum() + length(off[:, :3])
        torque = self.c_off @ arms + length(off[:, 3:6])
        work = force * length(moved[:, :3]) + torque * length(moved[:, 3:6]) + joints @ np.abs(moved[:, 6:]).max(axis=0)
        self._fault("(1), forces", force * RESIDUAL_INFLATION)
        self._fault("(1), torques", torque * RESIDUAL_INFLATION / g.size)
        self._fault("(2) of joint '{}'", joints * RESIDUAL_INFLATION / g.joint_units, g.joints)
        if p.mdp:  # without the dissipation principle no proof cites the balance of energy
            self._fault("the work of what (1) and (2) miss", work * RESIDUAL_INFLATION / F * (EPS / WORK))
        where = max(self.faults, key=lambda name: self.faults[name])
        modes = Modes(self.contact, np.zeros(g.m, dtype=bool), self.actuator, self.joint)
        projected = floats(self.q) - self.x["q"]
        at_contacts = np.abs(projected @ g.rows[0][:, 6:].T) / g.told_units
        changed = max(float(self.slip.max()), float(at_contacts.max(initial=0.0)))
        apart = motion_size(g, np.hstack([np.zeros((len(projected), 6)), projected]))
        return Near(self.faults[where], where, modes, self.forces, changed, apart, motion_size(g, floats(v)))


def _projected(q: Array, rows: Array, units: Array, at: Array) -> Array | None:
    """The points nearest to each q, coordinates over units, at which all rows (n, l) are `at`; None if none is."""
    if not rows.size or ((q @ rows.T) == at).all():
        return q
    n = len(units)
    basis, rank = fmpq_mat(np.hstack([rows * units, at[:, None]]).tolist()).rref()
    if rank and all(basis[rank - 1, j] == 0 for j in range(n)):
        return None
    H = fmpq_mat([[basis[i, j] for j in range(n)] for i in range(rank)])
    ends = fmpq_mat([[basis[i, n]] for i in range(rank)])
    gram, out = H * H.transpose(), []
    for y in q:
        z = fmpq_mat((y / units)[:, None].tolist())
        z -= H.transpose() * gram.solve(H * z - ends)
        out.append(units * np.array(z.entries(), dtype=object))
    return np.array(out)


def _positive(x: Array) -> Array:
    return np.maximum(x, 0.0)


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
