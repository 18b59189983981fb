"""A state of the model as arrays, the equations (1) to (8) with all laws, and the modes in which they are smooth.

Everything that moves or carries is a row of `GraspData.rows` M: contact forces and motions, torsions of soft fingers,
actuators, couplings, reactions of joints. A row's motion is d = M (r, q), and the forces phi of all rows are in balance
with the load, M^T phi + L = 0: that is (1) and (2). What is left are laws between d and phi, row by row. In fixed modes
each row is *held* (its motion is 0), its force is *unknown*, or given, or follows from the motion of its contact:

    open     c = 0, d^_n > 0              touches  c = 0, d_n = 0
    sticks   c_n = -d^_n, d_t = 0         slides   c_n = -d^_n, c_t = -mu c_n d_t / |d_t|         (4) to (7), (17)
    locked   t = 0                        rests    t = 0, f beyond its command                   (8)
    moves    f = f_c, t > 0               at its command or limit: t = 0, f is given

and likewise the reactions of joints. In a step of a load's path these are motions of the step; d^_n, t of tendons that
nobody commands, and q of joints that had left their stop are whole motions, with `GraspData.start` added: where such a
row is held, its motion goes back by what it had come. Without the maximum dissipation principle the friction of a
closed contact is unknown and nothing is held. Symbols and signs are those of the paper; see docs/model.md.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from math import hypot
from typing import Any

import numpy as np
from flint import fmpq

from handfast.proofs.fields import Array, BadFile, Fields, Integers, Mask, rational, rounded
from handfast.proofs.grasp import GraspData, StartData
from handfast.proofs.question import Question
from handfast.proofs.tolerance import UNIT_ROUNDOFF, load_scale, motion_size, size_of

Numbers = Callable[[Any], Any]  # from floats to arrays of floats, balls or rational numbers

NO_ROW = np.zeros(1)
ZERO_TOLERANCE = 1e-9  # relative to the forces that act: motions and forces that may be none


@dataclass(frozen=True, eq=False)
class State:
    """Motions r (6,), q (l,); forces c (3m,), f (a,), multipliers coupling (k,), reaction (l,), torsion (m,)."""

    r: Array
    q: Array
    c: Array
    f: Array
    coupling: Array
    reaction: Array
    torsion: Array

    @cached_property
    def motion(self) -> Array:
        """(6 + l,) r and q."""
        return np.concatenate([self.r, self.q])

    def forces(self, g: GraspData) -> Array:
        """(N + 1,) forces of `GraspData.rows`."""
        twist = self.torsion[g.soft] / g.lever[g.soft]
        return np.concatenate([self.c, twist, self.f, self.coupling, self.reaction, NO_ROW])

    @classmethod
    def of(cls, g: GraspData, motion: Array, forces: Array) -> State:
        """From r and q, and the forces of `GraspData.rows`."""
        contacts, soft, actuators, couplings, joints = g.parts
        torsion = np.zeros(g.m)
        torsion[g.soft] = g.lever[g.soft] * forces[soft]
        return cls(
            motion[:6], motion[6:], forces[contacts], forces[actuators], forces[couplings], forces[joints], torsion
        )


def read_state(f: Fields, g: GraspData) -> State:
    """The state among the fields of a witness or a control of an arc. `BadFile` if lengths are others."""
    sizes = {"r": 6, "q": g.l, "c": 3 * g.m, "f": g.a, "coupling": len(g.A)}
    own = {"reaction": g.l, "torsion": g.m}  # only where there are any
    out = {name: f.numbers(name, (n,)) for name, n in sizes.items()}
    out |= {name: f.numbers(name, (n,), [0.0] * n) for name, n in own.items()}
    if out["torsion"][g.lever == 0].any():
        raise BadFile("is not 0 at a point contact", f.at("torsion"))
    return State(**out)


@dataclass(frozen=True, eq=False)
class Problem:
    """What a state has to solve: the load is wrench + magnitude along.

    Attributes:
        along (6,): None where there is no magnitude; else it is an unknown of the proof.
        cos, sin: of the uncertainty of the normals, as they were rounded.
        torque_limit: (a,) of |f|, inf where there is none. force_limit: of every normal force.
    """

    grasp: GraspData
    wrench: Array
    along: Array | None = None
    magnitude: float = 0.0
    cos: float = 1.0
    sin: float = 0.0
    mdp: bool = True
    torque_limit: Array = field(default_factory=lambda: np.zeros(0))
    force_limit: float = np.inf

    @classmethod
    def of(
        cls, q: Question, command: Array, base: Array, along: Array | None = None, magnitude: float = 0.0
    ) -> Problem:
        """That of a question under commands: the load is base, or base + magnitude along."""
        limits = np.array([q.torque_limits.get(name, np.inf) for name in q.grasp.actuators], dtype=float)
        cos, sin = float(np.cos(q.eta)), float(np.sin(q.eta))
        g = q.grasp.with_command(command)
        return cls(g, base, along, magnitude, cos, sin, q.mdp, limits, q.force_limit)

    @cached_property
    def load(self) -> Array:
        """(6,) rounded."""
        return self.wrench if self.along is None else np.asarray(self.wrench + self.magnitude * self.along)

    @property
    def command(self) -> Array:
        """(a,) of the grasp."""
        return self.grasp.command

    @cached_property
    def limit(self) -> Array:
        """(a,) of |f|."""
        return self.torque_limit if len(self.torque_limit) else np.full(self.grasp.a, np.inf)

    @cached_property
    def scale(self) -> float:
        """[N] `load_scale`."""
        return load_scale(self.grasp, self.load)

    @property
    def granted(self) -> float:
        """[N] of which a state may miss a share; 0 where base and direction cancel.

        Proofs that no state exists add up the scales of both, which is less than the commands may be.
        """
        return 0.0 if self.wrench.any() and not size_of(self.grasp, self.load) else self.scale


def came_from(p: Problem, x: State) -> tuple[StartData, StartData, float]:
    """Where a state of a step came to: what the next one starts from; by how much that may differ; how far it is moved.

    The springs of contacts that are not open by their motions are where their forces are. Differences are those of
    rounding; a stop or a tendon that is nearer is there, which the third number [N] tells.
    """
    g, (M, size) = p.grasp, p.grasp.rows
    largest = np.maximum(size @ np.abs(x.motion), motion_size(g, x.motion) * g.row_units)
    d, off = M @ x.motion, 8 * len(M) * UNIT_ROUNDOFF * largest
    rows, (_, _, actuators, _, joints) = g.contact_rows, g.parts
    opened = g.gaps + p.cos * d[rows[:, 0]] + p.sin * np.sqrt((d[rows[:, 1:]] ** 2).sum(axis=1))
    gaps = np.where(opened > 0, opened, -x.c[::3])  # of what is open the force is rounding
    stops = np.abs(g.stops_left) + g.stop_side * d[joints]
    slack = np.where(g.tendon & (g.command == 0), g.slack + d[actuators], 0.0)
    near = [(y, y <= off[at], g.row_units[at]) for y, at in ((stops, joints), (slack, actuators))]
    moved = max(float((np.abs(y) / unit)[its].max(initial=0.0)) for y, its, unit in near)
    stops, slack = (np.where(its, 0.0, y) for y, its, _ in near)
    room = StartData(off[rows].sum(axis=1), 2 * off[joints], 2 * off[actuators])
    return StartData(gaps, stops, slack), room, moved


class ContactMode:
    """The mode of a contact: plain integers, which numpy compares with arrays five times as fast as an `IntEnum`."""

    OPEN = 0
    TOUCHES = 1
    STICKS = 2
    SLIDES = 3
    RUBS = 4  # closed, without the maximum dissipation principle
    LEANS = 5  # likewise, at the edge of the friction cone: c_t is in proportion to c_n


class Part:
    """The mode of an actuator, or of a joint's reaction."""

    LOCKED = 0  # held, any force
    RESTS = 1  # held, a force beyond its command, or between its ends
    MOVES = 2  # an actuator moves in its own sense; a joint closes
    OPENS = 3  # a joint opens
    LOW = 4  # held, at its command; at the lower end of the reaction
    HIGH = 5  # held, at its upper limit; at the upper end
    LOWEST = 6  # held, at the negative of its limit
    FREE = 7  # moves either way: a backdrivable motor, a joint without a law
    BACK = 8  # held where its stop is, which it had left before the step, and which carries beyond its friction


@dataclass(frozen=True, eq=False)
class Modes:
    """Modes of contacts (m,), actuators (a,) and joints' reactions (l,); `full` (m,): the normal force is the limit."""

    contact: Integers
    full: Mask
    actuator: Integers
    joint: Integers

    @cached_property
    def closed(self) -> Mask:
        """(m,) which contacts press."""
        return np.asarray(self.contact >= ContactMode.STICKS)

    def words(self, g: GraspData) -> dict[str, str]:
        """By contact, actuator and joint."""
        out = {f"contact {i}": _word(ContactMode, k) for i, k in enumerate(self.contact)}
        out |= {name: _word(Part, k) for name, k in zip(g.actuators, self.actuator, strict=True)}
        laws = zip(g.joints, self.joint, strict=True)
        return out | {f"reaction of {name}": _word(Part, k) for name, k in laws if k != Part.FREE}


def _word(kind: type, number: int) -> str:
    return next(name.lower() for name, k in vars(kind).items() if name.isupper() and k == number)


def reaction_ends(g: GraspData) -> tuple[Array, Array]:
    """(l,) each: between which a joint carries at rest; infinite where a stop carries. See docs/joint-laws.md."""
    lower, upper = g.stops
    return np.where(upper, -np.inf, -g.friction), np.where(lower, np.inf, g.friction)


@dataclass(frozen=True, eq=False)
class Rows:
    """The laws of all rows in some modes, (N + 1,) each: held, unknown, given forces.

    at: the motions of those that are held: 0 but for what had come away before a step; exact: as rational numbers.
    """

    held: Mask
    unknown: Mask
    given: Array
    at: Array
    exact: Array

    @classmethod
    def of(cls, p: Problem, modes: Modes) -> Rows:
        g, n = p.grasp, len(p.grasp.rows[0])
        held, unknown = np.zeros(n, dtype=bool), np.zeros(n, dtype=bool)
        given = np.zeros(n)
        held[p.grasp.contact_rows[modes.contact == ContactMode.TOUCHES, 0]] = True
        sticks = modes.contact == ContactMode.STICKS
        held[p.grasp.contact_rows[sticks, 1:]] = True
        rubs = (sticks | (modes.contact == ContactMode.RUBS)) & (g.mu > 0)
        unknown[p.grasp.contact_rows[rubs, 1:]] = True
        _, _, actuators, couplings, joints = g.parts
        k = modes.actuator
        held[actuators] = (k != Part.MOVES) & (k != Part.FREE)
        unknown[actuators] = (k == Part.LOCKED) | (k == Part.RESTS)
        high, lowest = k == Part.HIGH, k == Part.LOWEST
        at_command = ~unknown[actuators] & ~high & ~lowest
        given[actuators] = np.where(at_command, g.command, 0.0)
        given[actuators][high], given[actuators][lowest] = p.limit[high], -p.limit[lowest]
        held[couplings] = unknown[couplings] = True
        k, (lo, hi) = modes.joint, reaction_ends(g)
        held[joints] = (k != Part.MOVES) & (k != Part.OPENS) & (k != Part.FREE)
        unknown[joints] = (k == Part.LOCKED) | (k == Part.RESTS) | (k == Part.BACK)
        low, high = (k == Part.MOVES) | (k == Part.LOW), (k == Part.OPENS) | (k == Part.HIGH)
        given[joints] = np.where(low, lo, np.where(high, hi, 0.0))
        held[-1] = unknown[-1] = False
        at, exact = np.zeros(n), np.zeros(n, dtype=object)
        for row, came in (_come_back(p, modes) if g.start is not None else {}).items():
            at[row], exact[row] = rounded(came), came
        return cls(held, unknown, given, at, exact)


def _come_back(p: Problem, modes: Modes) -> dict[int, fmpq]:
    """Motions of held rows that had come away before the step, by row, but for those that are 0."""
    g = p.grasp
    _, _, actuators, _, joints = g.parts
    out = {int(g.contact_rows[i, 0]): -rational(g.gaps[i]) / rational(p.cos) for i in np.flatnonzero(g.gaps)}
    out = {k: x for k, x in out.items() if modes.contact[k // 3] == ContactMode.TOUCHES}
    k = modes.actuator
    at_rest = (k == Part.RESTS) | (k == Part.LOW) | (k == Part.HIGH) | (k == Part.LOWEST)
    pulls = at_rest & (g.slack != 0)
    out |= {actuators.start + int(j): -rational(g.slack[j]) for j in np.flatnonzero(pulls)}
    back = np.flatnonzero(modes.joint == Part.BACK)
    return out | {joints.start + int(j): -rational(g.stops_left[j]) for j in back}


def sense(p: Problem) -> Array:
    """(a,) in which actuators are commanded; 1 where they are not."""
    return np.where(p.grasp.command < 0, -1.0, 1.0)


def acting(p: Problem, x: State) -> float:
    """[N] the largest force that acts: the load's scale, or a contact force."""
    return max(p.scale, float(np.sqrt((x.c.reshape(-1, 3) ** 2).sum(axis=1)).max()))


def choices(p: Problem, x: State) -> dict[str, list[tuple[int, bool]]]:
    """Modes that a state may have, the likeliest first, by `Modes` field and number ("contact 3"); see `modes_of`."""
    g = p.grasp
    M, size = p.grasp.rows
    phi, d, act = x.forces(g), M @ x.motion, acting(p, x)
    coarse = 8 * len(M) * UNIT_ROUNDOFF * (size @ np.abs(x.motion))
    none_d, none_f = (
        np.maximum(ZERO_TOLERANCE * act * p.grasp.row_units, coarse),
        ZERO_TOLERANCE * act / p.grasp.row_units,
    )
    out = {}
    rows = g.contact_rows
    own = (g.mu, g.gaps, d[rows], phi[rows], none_d[rows].max(axis=1), none_f[rows[:, 0]])
    of_contacts = (x.tolist() for x in own)
    for i, values in enumerate(zip(*of_contacts, strict=True)):
        out[f"contact {i}"] = _contact(p, *values)
    _, _, actuators, _, joints = (range(s.start, s.stop) for s in g.parts)
    d, phi, none_d, none_f = d.tolist(), phi.tolist(), none_d.tolist(), none_f.tolist()
    slack, left = g.slack.tolist(), g.stops_left.tolist()
    for j, k in enumerate(actuators):
        e, t = sense(p)[j] * (phi[k] - p.command[j]), sense(p)[j] * d[k] + slack[j]
        full = [Part.HIGH if phi[k] > 0 else Part.LOWEST] * bool(p.limit[j] - abs(phi[k]) < none_f[k])
        if g.backdrivable[j]:
            kinds = [Part.FREE]
        elif p.command[j] == 0 and not g.tendon[j]:
            kinds = [*full, Part.LOCKED]
        else:
            rests, moves = e > none_f[k], t > none_d[k]
            turns = t / none_d[k] > e / none_f[k]
            kinds = [Part.MOVES] if moves and (turns or not rests) else [*full, Part.RESTS] if rests else [Part.LOW]
            other = (Part.LOW, Part.MOVES, Part.RESTS) if turns else (Part.LOW, Part.RESTS, Part.MOVES)
            kinds += [x for x in other if x not in kinds]
        out[f"actuator {j}"] = [(x, False) for x in kinds]
    lo, hi = reaction_ends(g)
    for j, k in enumerate(joints):
        t, over, under, near, still = d[k], phi[k] - lo[j], hi[j] - phi[k], none_f[k], none_d[k]
        if lo[j] == hi[j] and left[j]:
            kinds = [Part.BACK, Part.FREE] if abs(t + left[j]) <= still else [Part.FREE, Part.BACK]
        elif lo[j] == hi[j]:
            kinds = [Part.FREE]
        elif not np.isfinite(over) and not np.isfinite(under):
            kinds = [Part.LOCKED]
        else:
            ends = [Part.LOW] * bool(over < near) + [Part.HIGH] * bool(under < near)
            ways = [Part.MOVES] * bool(over < near and t > 0) + [Part.OPENS] * bool(under < near and t < 0)
            kinds = [*ways, Part.RESTS, *ends] if abs(t) > still else [*ends, Part.RESTS, *ways]
            if left[j]:  # it leads back to the stop that it had left, or is there
                kinds = [Part.BACK, *kinds] if abs(t + left[j]) <= still else [*kinds, Part.BACK]
        out[f"joint {j}"] = [(x, False) for x in kinds]
    return out


def _contact(
    p: Problem, mu: float, before: float, d: list[float], phi: list[float], none_d: float, none_f: float
) -> list[tuple[int, bool]]:
    """Modes of one contact from its gap before, d_n, d_t, turning and their forces, with what may be none of them."""
    slides, rubs = hypot(*d[1:]), hypot(*phi[1:])
    gap = before + p.cos * d[0] + p.sin * slides
    if phi[0] <= none_f:
        near, still = abs(gap) <= none_d, slides <= none_d
        shut = [ContactMode.TOUCHES] if near else []
        if near and gap < 0:  # it presses by as little
            shut += [ContactMode.STICKS, ContactMode.SLIDES] if still else [ContactMode.SLIDES]
        shut += [
            x for x in (ContactMode.OPEN, ContactMode.TOUCHES, ContactMode.STICKS, ContactMode.SLIDES) if x not in shut
        ]
        return [(k, False) for k in (shut if near else shut[:2])]
    still = slides <= none_d
    if not p.mdp:
        kinds = [ContactMode.LEANS] if mu > 0 and mu * phi[0] - rubs <= none_f else []
        kinds = [ContactMode.STICKS, *kinds, ContactMode.RUBS] if still and p.sin else [*kinds, ContactMode.RUBS]
    elif mu == 0:
        kinds = [ContactMode.STICKS, ContactMode.SLIDES] if still and p.sin else [ContactMode.SLIDES]
    else:
        along = -sum(x * y for x, y in zip(phi[1:], d[1:], strict=True)) > 0.99 * slides * rubs and slides > 0
        inside = mu * phi[0] - rubs > none_f
        kinds = [ContactMode.SLIDES, ContactMode.STICKS]
        kinds = kinds[::-1] if still and (inside or not along) else kinds
        kinds = kinds if still or not inside else kinds[:1]
    full = abs(p.force_limit - phi[0]) <= none_f
    return [(k, full) for k in kinds] + ([(k, False) for k in kinds] if full else [])


def modes_of(g: GraspData, chosen: dict[str, tuple[int, bool]]) -> Modes:
    """One of the modes of each part, by name as in `choices`."""
    values = list(chosen.values())
    kinds = np.array([k for k, _ in values], dtype=np.int64)
    full = np.array([full for _, full in values], dtype=bool)
    m, a = g.m, g.a
    return Modes(kinds[:m], full[:m], kinds[m : m + a], kinds[m + a :])


@dataclass(frozen=True, eq=False)
class Laws:
    """Forces of the contacts that press, from their motions, with their derivatives.

    Attributes:
        rows: (n, 4) of `GraspData.contact_rows`. force: (n, 4). K: (n, 4, 4) of force by motion.
        speed: (n,) |d_t|, where the direction of sliding counts; else inf. rub: (n,) mu where it slides, else 0.
        lean: (n, 3) c_t over c_n of those that lean, else 0.
    """

    rows: Integers
    force: Array
    K: Array
    speed: Array
    rub: Array
    lean: Array

    @classmethod
    def of(
        cls, p: Problem, modes: Modes, d: Array, phi: Array, number: Numbers = np.array, smooth: bool = True
    ) -> Laws:
        """d, phi: (N + 1,) motions, and printed forces as floats, the last 0.

        number: makes floats what d is made of. smooth: with what is not linear in d; else that is left out.
        """
        closed = np.flatnonzero(modes.closed)
        rows, kinds = p.grasp.contact_rows[closed], modes.contact[closed]
        D, n = d[rows], len(closed)
        rub = np.where((kinds == ContactMode.SLIDES) & smooth, p.grasp.mu[closed], 0.0)
        turns = np.flatnonzero((rub > 0) | ((kinds != ContactMode.STICKS) & (p.sin != 0) & smooth))
        lean = np.zeros((n, 3))
        for k in np.flatnonzero(kinds == ContactMode.LEANS):
            c, mu = phi[rows[k]], p.grasp.mu[closed[k]]
            size = max(c[0], np.sqrt(c[1:] @ c[1:]) / mu)
            lean[k] = c[1:] / size * (1 - 1e-12) if size > 0 else 0.0
        cos, sin, gaps, by_speed, leans = (number(x) for x in (p.cos, p.sin, p.grasp.gaps[closed], rub, lean))
        u, speed, normal = number(np.zeros((n, 3))), np.full(n, np.inf, D.dtype), -(gaps + cos * D[:, 0])
        if len(turns):
            speed[turns] = np.sqrt((D[turns, 1:] ** 2).sum(axis=1))
            u[turns] = D[turns, 1:] / np.where(speed[turns] > 0, speed[turns], np.inf)[:, None]
            normal[turns] -= sin * speed[turns]
        by_d, K, force = np.empty((n, 4), D.dtype), np.empty((n, 4, 4), D.dtype), np.empty((n, 4), D.dtype)
        by_d[:, 0], by_d[:, 1:] = -cos, -sin * u
        share = leans - by_speed[:, None] * u
        K[:, 0], K[:, 1:] = by_d, share[:, :, None] * by_d[:, None]
        force[:, 0], force[:, 1:] = normal, normal[:, None] * share
        slides = (rub > 0).nonzero()[0]
        if len(slides):
            with np.errstate(divide="ignore", invalid="ignore"):
                turned = by_speed[slides] * normal[slides] / speed[slides]
                own = u[slides]
                K[slides, 1:, 1:] -= turned[:, None, None] * (number(np.eye(3)) - own[:, :, None] * own[:, None])
        return cls(rows, force, K, speed, rub, lean)

    def rounding(self, p: Problem, d: Array) -> Array:
        """(n,) of the forces at these motions, at most."""
        D = np.abs(d[self.rows])
        gaps = np.abs(p.grasp.gaps[self.rows[:, 0] // 3])
        return 16 * UNIT_ROUNDOFF * (gaps + D[:, 0] + p.sin * D[:, 1:].sum(axis=1) + np.abs(self.force).sum(axis=1))

    def change(self, p: Problem, reach: Array) -> Array:
        """(n,) by which an entry of K changes at most for motions that differ by up to `reach` (n,); inf if unknown."""
        share = np.divide(reach, self.speed, out=np.ones(len(reach)), where=self.speed > 0)
        ok = share < 0.5
        share = np.where(ok, share, 0.0)
        turn = 1.001 * share / (1.0 - share)  # of the direction of sliding
        apart = np.where(np.isfinite(self.speed), self.speed, 1.0) * (1.0 - share)
        normal = np.abs(self.force[:, 0])
        strong = (1.01 * reach + normal * (2.0 * turn + share)) / np.where(ok, apart, 1.0)
        out = p.sin * turn * (1.0 + np.abs(self.lean).sum(axis=1)) + self.rub * (1.01 * turn + p.sin * turn + strong)
        return np.where(ok, 1.001 * np.where(np.isfinite(self.speed), out, 0.0), np.inf)
