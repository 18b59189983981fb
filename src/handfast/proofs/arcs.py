"""States for whole ranges of magnitudes: all of them are resisted, exactly or to 1e-9 of load and commands.

An arc is a Bezier curve in the unknowns of a state while the load goes along a straight line. What is linear in the
unknowns is a Bezier curve again, and lies between its control values; products have control values of twice the
degree. So all of an arc is judged at once, in the modes of its middle: motions keep what is held at rest exactly (after
a correction, which is bounded) and every inequality of motions; forces differ from such as obey the laws exactly, for
these motions, by so much at most; with these (1) and (2) are missed by so much at most. That has to be within half of
`tolerance.slack`. Where loads are small beside commands no floats are so near: there one box contains an exact state
for each magnitude (`newton.Step`). A range that neither shows is halved. Where modes change, something is left over:
magnitudes whose load is within the other half of one that is shown hold as well.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from math import comb

import numpy as np

from handfast.proofs.existence import inequalities
from handfast.proofs.fields import Array, BadFile, Fields
from handfast.proofs.grasp import GraspData
from handfast.proofs.newton import NotShown, Step, System, rounding
from handfast.proofs.states import (
    ULP,
    Contact,
    Modes,
    Part,
    Problem,
    Rows,
    State,
    choices,
    modes_of,
    reaction_ends,
    read_state,
    sense,
)
from handfast.proofs.tolerance import EPS, about_centroid, load_scale

DEGREE = 12  # at most
PIECES = 100  # that are looked at


@dataclass(frozen=True, eq=False)
class Arc:
    """At first + (last - first) t the state is sum of comb(k, i) t^i (1 - t)^(k - i) controls[i].

    Attributes:
        first, last: magnitudes, 0 <= first < last.
        controls: motions (k + 1, 6 + l) and forces (k + 1, N + 1) of `GraspData.rows`.
    """

    first: float
    last: float
    motions: Array
    forces: Array

    @classmethod
    def of(cls, g: GraspData, first: float, last: float, controls: list[State]) -> Arc:
        """Through the controls' states."""
        forces = np.array([x.forces(g) for x in controls])
        return cls(first, last, np.array([x.motion for x in controls]), forces)

    @property
    def middle(self) -> tuple[Array, Array]:
        """Motions and forces at the middle of the range."""
        weights = np.array([comb(len(self.motions) - 1, i) for i in range(len(self.motions))]) / 2.0 ** (
            len(self.motions) - 1
        )
        return weights @ self.motions, weights @ self.forces

    def between(self, a: float, b: float) -> Arc:
        """The part from a to b: de Casteljau's algorithm, but for rounding."""
        end, begin = (b - self.first) / (self.last - self.first), (b - a) / (b - self.first)
        motions, forces = (_cut(_cut(x, end)[::-1], begin)[::-1] for x in (self.motions, self.forces))
        return Arc(a, b, motions, forces)


def _cut(controls: Array, t: float) -> Array:
    """(k + 1, n) controls of the part from 0 to t."""
    out, rest = [controls[0]], controls
    while len(rest) > 1:
        rest = (1.0 - t) * rest[:-1] + t * rest[1:]
        out.append(rest[0])
    return np.array(out)


def read_arc(f: Fields, g: GraspData) -> Arc:
    """The arc in an object of a file. `BadFile` if it is none."""
    first, last = f.number("first", least=0.0), f.number("last")
    controls = [_control(x, g) for x in f.objects("controls")]
    f.done()
    if not first < last:
        raise BadFile(f"goes from {first:g} to {last:g}; a range of magnitudes is needed", f.place)
    if not 2 <= len(controls) <= DEGREE + 1:
        raise BadFile(f"has {len(controls)} controls; 2 to {DEGREE + 1} are possible", f.place)
    return Arc.of(g, first, last, controls)


def _control(f: Fields, g: GraspData) -> State:
    x = read_state(f, g)
    f.done()
    return x


def unproved(p: Problem, arc: Arc) -> list[tuple[float, float]]:
    """Ranges of the arc's magnitudes of which nothing is proved; none if all of them are resisted.

    p: its load is wrench + magnitude along.
    """
    if is_homogeneous(p) and not arc.motions[0].any() and not arc.forces[0].any() and arc.first == 0:
        # multiples of a state solve the model under multiples of its load
        last = Arc(arc.last, arc.last, arc.motions[-1:], arc.forces[-1:])
        return [] if _resisted(p, last) else [(arc.first, arc.last)]
    todo, left, looked = [(arc.first, arc.last)], [], 0
    while todo:
        a, b = todo.pop()
        looked += 1
        if looked <= PIECES and _resisted(p, arc if (a, b) == (arc.first, arc.last) else arc.between(a, b)):
            continue
        m = a + (b - a) / 2
        if looked > PIECES or b - a <= _narrow(p, a) / 4 or not a < m < b:
            left.append((a, b))
        else:
            todo += [(m, b), (a, m)]
    joined: list[tuple[float, float]] = []
    for a, b in sorted(left):
        if joined and a <= joined[-1][1]:
            joined[-1] = joined[-1][0], b
        else:
            joined.append((a, b))
    # beside what is left something is shown
    return [(a, b) for a, b in joined if b - a > _narrow(p, a) or (a == arc.first and b == arc.last)]


def is_homogeneous(p: Problem) -> bool:
    """Does nothing act whose size is given, so that multiples of states are states?"""
    g = p.grasp
    acts = p.wrench.any() or g.command.any() or g.torque.any() or g.friction.any() or p.drive is not None
    return not acts


def _narrow(p: Problem, s: float) -> float:
    """By how much magnitudes near s may differ, so that their loads differ by half of `EPS` of the load."""
    along = p.along if p.along is not None else np.zeros(6)
    load = p.wrench + s * along
    return EPS / 2 * load_scale(p.grasp, load) / load_scale(p.grasp, along) if load.any() else 0.0


def _resisted(p: Problem, arc: Arc) -> bool:
    """Is every magnitude of an arc resisted, to half of `EPS`, or exactly?"""
    g = p.grasp
    here, v, phi = replace(p, magnitude=(arc.first + arc.last) / 2), *arc.middle
    modes = modes_of(g, {name: kinds[0] for name, kinds in choices(here, State.of(g, v, phi)).items()})
    try:
        return _follows(here, modes, arc) or _exactly(here, modes, arc)
    except NotShown:
        return False


def _exactly(p: Problem, modes: Modes, arc: Arc) -> bool:
    """Is there one box for all magnitudes? Raises `NotShown`."""
    width = arc.last - arc.first
    v, phi = arc.middle
    if not width > 0:
        return False
    turns, grows = ((x[-1] - x[0]) / width for x in (arc.motions, arc.forces))
    system = System.of(p, modes, State.of(p.grasp, v, phi), True, False)
    box = system.box(Step(turns, grows, width / 2 * (1 + 1e-12)))
    return inequalities(p, modes, box) >= 0


def _follows(p: Problem, modes: Modes, arc: Arc) -> bool:
    """Do all of the arc's states hold but for half of the slack? Raises `NotShown`."""
    g, k = p.grasp, len(arc.motions)
    (M, size), unit = g.rows, k * rounding(p)
    system = System.of(p, modes, State.of(g, *arc.middle), False, False)
    C, v = system.inverse, arc.motions
    d, d_off = v @ M.T, unit * (np.abs(v) @ size.T).max(axis=0)
    held = np.concatenate([np.abs(d[:, system.kept]).max(axis=0) + d_off[system.kept], np.zeros(len(system.full))])
    error = np.abs(system.A @ C - np.eye(len(held))) + unit * (system.A_size @ np.abs(C))
    if len(system.full) or (len(held) and not error.sum(axis=1).max() <= 0.5):
        return False
    moved = np.abs(M @ C) + unit * (size @ np.abs(C))
    d_off = d_off + moved @ np.full(len(held), 2.0 * held.max(initial=0.0))
    d, d_off = np.where(system.rows.held, 0.0, d), np.where(system.rows.held, 0.0, d_off)
    if not _turns_right(p, modes, d, d_off):
        return False
    off = _off_laws(p, modes, system.rows, d, d_off, arc.forces)
    return bool(np.isfinite(off).all()) and _balanced(p, arc, off, unit)


def _turns_right(p: Problem, modes: Modes, d: Array, d_off: Array) -> bool:
    """Do all motions have the senses of their modes?"""
    g = p.grasp
    _, _, actuators, _, joints = g.parts
    normals = g.contact_rows[modes.contact == Contact.OPEN, 0]
    turned, q = d[:, actuators] * sense(p), d[:, joints]
    parts = (
        d[:, normals].min(axis=0) - d_off[normals],
        (turned.min(axis=0) - d_off[actuators])[modes.actuator == Part.MOVES],
        (q.min(axis=0) - d_off[joints])[modes.joint == Part.MOVES],
        (-q.max(axis=0) - d_off[joints])[modes.joint == Part.OPENS],
    )
    return all((x >= 0).all() for x in parts)


def _off_laws(p: Problem, modes: Modes, rows: Rows, d: Array, d_off: Array, phi: Array) -> Array:
    """(N + 1,) how far forces are at most from such as obey the laws for the motions; inf if nothing is known."""
    g = p.grasp
    off = np.where(rows.unknown, 0.0, np.abs(phi - rows.given).max(axis=0))
    for i in np.flatnonzero(modes.closed):
        T = g.contact_rows[i]
        off[T] = _off_contact(p, g.mu[i], int(modes.contact[i]), d[:, T], d_off[T], phi[:, T])
    off[-1] = 0.0
    _, _, actuators, _, joints = g.parts
    f, (lo, hi), rests = phi[:, actuators], reaction_ends(g), modes.joint == Part.RESTS
    short = (sense(p) * (p.command - f)).max(axis=0)
    off[actuators] += np.where(modes.actuator == Part.RESTS, np.maximum(short, 0.0), 0.0)
    over = np.abs(f).max(axis=0) - p.limit
    off[actuators] += np.where(
        rows.unknown[actuators], np.maximum(over, 0.0), np.where(np.abs(p.command) > p.limit, np.inf, 0.0)
    )
    outside = np.maximum(lo - phi[:, joints].min(axis=0), phi[:, joints].max(axis=0) - hi)
    off[joints] += np.where(rests, np.maximum(outside, 0.0), 0.0)
    return off


def _off_contact(p: Problem, mu: float, kind: int, d: Array, d_off: Array, c: Array) -> Array:
    """(4,) the same of a contact that presses; d, c: (k, 4)."""
    strays, aside = float(np.linalg.norm(d_off[1:])), d[:, 1:]
    speed = least_norm(aside) - strays
    normal = float(np.abs(c[:, 0] + p.cos * d[:, 0]).max()) + p.cos * d_off[0]
    if p.sin and kind != Contact.STICKS:
        rest = -(c[:, 0] + p.cos * d[:, 0])
        squares = product(rest, rest) - p.sin**2 * product(aside, aside).sum(axis=1)
        if speed <= 0 or rest.min() < 0:
            return np.full(4, np.inf)
        normal = float(np.abs(squares).max()) / (p.sin * speed) + p.cos * d_off[0] + p.sin * strays
    least = float(c[:, 0].min()) - normal
    if least < 0 or c[:, 0].max() + normal > p.force_limit:
        return np.full(4, np.inf)
    rubs = np.sqrt((c[:, 1:] ** 2).sum(axis=1))
    if mu == 0:
        return np.array([normal, *[rubs.max()] * 3])
    if kind != Contact.SLIDES:
        return np.array([normal, *[max(0.0, float((rubs - mu * c[:, 0]).max()) + mu * normal)] * 3])
    if speed <= 0 or not product(c[:, 1:], aside).sum(axis=1).max() < 0:
        return np.full(4, np.inf)
    squares = product(c[:, 1:], c[:, 1:]).sum(axis=1) - mu**2 * product(c[:, 0], c[:, 0])
    strong = least_norm(c[:, 1:]) + mu * float(c[:, 0].min())
    turns = ((0, 1), (1, 2), (2, 0))
    across = [product(c[:, 1 + i], aside[:, j]) - product(c[:, 1 + j], aside[:, i]) for i, j in turns]
    crossed = float(np.linalg.norm([np.abs(x).max() for x in across]))
    rounded = 64 * len(c) * ULP * float(rubs.max())
    tangent = float(np.abs(squares).max()) / strong + (1.5 * crossed + 2.0 * strays * float(rubs.max())) / speed
    return np.array([normal, *[tangent + mu * normal + rounded] * 3])


def _balanced(p: Problem, arc: Arc, off: Array, unit: float) -> bool:
    """Are (1) and (2) missed by no more than half of the slack, with forces that differ from the arc's by `off`?"""
    g, k, (M, size) = p.grasp, len(arc.forces), p.grasp.rows
    along = np.zeros(6) if p.along is None else p.along
    w = p.wrench + np.linspace(arc.first, arc.last, k)[:, None] * along
    missing = arc.forces @ M + np.concatenate([w, np.tile(g.torque, (k, 1))], axis=1)
    sums = np.abs(arc.forces).max(axis=0) @ size
    sums[:6] += np.abs(p.wrench) + arc.last * np.abs(along)
    wide = unit * (sums + np.concatenate([np.zeros(6), np.abs(g.torque)])) + off @ size
    moment = np.array([about_centroid(g, x[:6]) for x in missing])
    arm = np.abs(g.centroid)[[1, 2, 0, 2, 0, 1]].reshape(2, 3)
    moment_off = wide[3:6] + arm[0] * wide[:3][[2, 0, 1]] + arm[1] * wide[:3][[1, 2, 0]]
    most = (
        EPS
        / 2
        * (1 - 1e-6)
        * max(least_norm(w[:, :3]), least_norm(np.array([about_centroid(g, x) for x in w])) / g.size)
    )
    return bool(
        np.linalg.norm(np.abs(missing[:, :3]).max(axis=0) + wide[:3]) <= most
        and np.linalg.norm(np.abs(moment).max(axis=0) + moment_off) <= most * g.size
        and (np.abs(missing[:, 6:]).max(axis=0) + wide[6:] <= most * g.joint_units).all()
    )


# --- bounds of Bezier curves from their control values ---------------------------------------------


@cache
def _weights(k: int) -> Array:
    """(2k + 1, k + 1, k + 1): control values of a product from those of its factors."""
    out = np.zeros((2 * k + 1, k + 1, k + 1))
    for i in range(k + 1):
        for j in range(k + 1):
            out[i + j, i, j] = comb(k, i) * comb(k, j) / comb(2 * k, i + j)
    return out


def product(a: Array, b: Array) -> Array:
    """(2k + 1, ...) control values of the product of two curves with control values a, b (k + 1, ...)."""
    return np.asarray(np.einsum("hij,i...,j...->h...", _weights(len(a) - 1), a, b))


def least_norm(a: Array) -> float:
    """No more than the length of a vector anywhere on a curve with control values a (k + 1, dim)."""
    mean = a.mean(axis=0)
    length = float(np.linalg.norm(mean))
    return max(0.0, float((a @ mean).min()) / length * (1 - 1e-12)) if length > 0 else 0.0
