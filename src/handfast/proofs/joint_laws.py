"""The laws of joints as tendons and given torques: the equivalent of a grasp that certificates speak of.

A joint with friction F, a given torque g and a stop carries tau = (R^T f + A^T lambda)_j + g + rho, with its reaction
rho in [-F, F] (without end on the side where a stop carries), rho = -F where q > 0 and F where q < 0. The equivalent
has given torques alone, and rows of actuators without command that can only pull (*tendons*: t >= 0, f >= 0, t f = 0).
Each step replaces a law by one that allows the same pairs of motion and torque; proofs are in docs/joint-laws.md.

- *Given torques*, and R^T f_c of backdrivable motors, are constants; these motors have no row.
- A *stop* is a tendon: t = -q at the upper one, t = q at the lower one. A joint at both is tied: a row of A.
- *Friction* where a tendon, a stop or a commanded motor lets the joint move in one sense s only: the torque -s F.
- *Friction* otherwise: a joint u that touches nothing (a *slider*), with the tendons u and u - weights . q and the
  torque -2 F on it, so that both forces add up to 2 F; and the torque F weights on the joints.
- *Joints that are tied* to each other rigidly and may move have one friction, of the weighted sum of their motions.
- Friction of a joint that is held rigidly does nothing.
- In a step of a load's path friction knows the step's motion, stops and tendons that nobody commands the whole one, t
  and `slack` together; those that have slack let a joint move both ways.

Actuators with a largest force, passive reaction included, are no part of these mergers. All of it is exact: sums of
torques are rational numbers, and weights times F are the frictions of the joints without any rounding (`shared`).
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from flint import fmpq

from handfast.proofs.fields import Array, BadFile, Integers, Mask, dot, not_zero, rational, rationals
from handfast.proofs.grasp import GraspData


@dataclass(frozen=True, eq=False)
class Equivalent:
    """What stands for a grasp with laws of joints; without laws its own mechanism.

    Attributes:
        sliders: s', joints that are added behind the grasp's; they touch nothing.
        kept: (a0,) actuators of the grasp that are its first rows: all that are not backdrivable.
        R, A: (a', l + s'), (k', l + s'). tendon: (a',) bool. command: (a',) f_c.
        torque: (l + s',) that is given, rounded once. exact: the same as rational numbers.
        drives: is anything given that may put energy in, as springs and backdrivable motors do? Friction only takes.
        held: (l,) bool, joints that are held rigidly.
        slack: (a',) by how much t of tendons and stops was above 0 before the step.
    """

    sliders: int
    kept: Integers
    R: Array
    A: Array
    tendon: Mask
    command: Array
    torque: Array
    exact: list[fmpq]
    drives: bool
    held: Mask
    slack: Array


def equivalent_of(g: GraspData, sought: Mask | None, limited: Collection[str]) -> Equivalent:
    """The equivalent of a grasp.

    Args:
        g: with its commands.
        sought: (a,) bool, actuators whose commands are sought, in the sense of the grasp's; the others that are not
            backdrivable are then locked. None if none are.
        limited: names of actuators with a largest force.

    Raises:
        BadFile: a backdrivable motor whose command is sought.
    """
    back = g.backdrivable
    if sought is not None and (sought & back).any():
        name = g.actuators[int(np.flatnonzero(sought & back)[0])]
        raise BadFile(f"has '{name}', which is backdrivable: its command is given, not sought", "driven")
    command = g.command if sought is None else np.where(sought | back, g.command, 0.0)
    kept, drives = np.flatnonzero(~back), bool(g.torque.any() or g.command[back].any())
    if not g.has_laws:
        held = np.zeros(g.l, dtype=bool)
        return Equivalent(0, kept, g.R, g.A, g.tendon, command, g.torque, rationals(g.torque), drives, held, g.slack)
    R, f_c = g.R[kept], command[kept]
    free = np.array([g.actuators[i] not in limited for i in kept], dtype=bool)
    pulls = g.tendon[kept] & (g.slack[kept] == 0)
    one_sided = ((f_c != 0) | pulls | (False if sought is None else sought[kept])) & free
    locked = ~((f_c != 0) | g.tendon[kept] | (False if sought is None else sought[kept])) & free
    lower, upper = g.stops
    both = lower & upper
    lower, upper = lower | (g.stops_left > 0), upper | (g.stops_left < 0)
    held, groups = _ties(g.l, [*g.A, *R[locked]], both)
    stops = [(j, 1.0 if lower[j] else -1.0) for j in range(g.l) if lower[j] != upper[j] and not held[j]]

    alone = _rows_of_one_joint(R[one_sided], f_c[one_sided], held)
    reaction, sliders = np.zeros(g.l), []
    for rates in groups:
        rubs = [j for j in rates if g.friction[j] > 0]
        if not rubs:
            continue
        along = np.zeros(g.l)
        along[rubs] = g.friction[rubs] * np.sign([rates[j] for j in rubs])
        sense = _sense(rates, stops, alone, g.stops_left)
        reaction += -sense * along if sense else along
        if not sense:
            sliders.append(shared(along))
    exact = given_torques(g.torque, g.R[back], g.command[back], reaction)
    exact += [rational(-2 * total) for _, total in sliders]
    return _assembled(g, f_c, stops, sliders, exact, drives, held)


def _ties(l: int, rows: list[Array], both: Mask) -> tuple[Mask, list[dict[int, float]]]:
    """(l,) bool which joints are held rigidly; the others in groups that move alike, each joint with its sense."""
    held, found = both.copy(), True
    while found:  # what is tied to nothing but held joints is held
        found = False
        for row in rows:
            rest = np.flatnonzero((row != 0) & ~held)
            if len(rest) == 1:
                held[rest] = found = True
    groups = {j: {j: 1.0} for j in range(l) if not held[j]}
    for row in rows:
        two = np.flatnonzero((row != 0) & ~held).tolist()
        if len(two) != 2 or groups[two[0]] is groups[two[1]]:
            continue
        first, second = groups[two[0]], groups[two[1]]
        rate = -np.sign(row[two]).prod() * first[two[0]] * second[two[1]]  # q_b = rate q_a, but for its size
        first.update({j: rate * x for j, x in second.items()})
        groups.update(dict.fromkeys(second, first))
    return held, list({id(group): group for group in groups.values()}.values())


def _rows_of_one_joint(R: Array, f_c: Array, held: Mask) -> list[tuple[int, float]]:
    """Of rows (., l) with commands that move one joint: which, and the only sense in which it moves."""
    moved = (R != 0) & ~held
    rows = np.flatnonzero(moved.sum(axis=1) == 1)
    joints = moved[rows].argmax(axis=1)
    senses = np.where(f_c[rows] < 0, -1.0, 1.0) * np.sign(R[rows, joints])
    return list(zip(joints.tolist(), senses.tolist(), strict=True))


def _sense(
    rates: dict[int, float], stops: list[tuple[int, float]], alone: list[tuple[int, float]], left: Array
) -> float:
    """In which sense of the group's rate alone, +1 or -1, a row of one of its joints lets it move; 0 if in both.

    alone: see `_rows_of_one_joint`. left: (l,) joints that had left their stop.
    """
    for j, sign in stops:
        if j in rates and not left[j]:
            return float(sign * np.sign(rates[j]))
    return next((float(sense * np.sign(rates[j])) for j, sense in alone if j in rates), 0.0)


def given_torques(torque: Array, R: Array, command: Array, reaction: Array) -> list[fmpq]:
    """(l,) the torques that are given to joints, of commands (a,) behind R (a, l), and what friction adds, exactly."""
    columns = [dot(rationals(column), rationals(command)) for column in R.T]
    return [x + y + z for x, y, z in zip(rationals(torque), columns, rationals(reaction), strict=True)]


def shared(along: Array) -> tuple[Array, float]:
    """Frictions with their senses (l,) as weights times F, exactly: the weights, at most 1 together, and F.

    F is the friction of a joint that rubs alone; of several the power of two that is not below their sum.
    """
    rubs = along[along != 0].tolist()
    if len(rubs) == 1:
        return np.sign(along), abs(rubs[0])
    fraction, exponent = math.frexp(math.fsum(map(abs, rubs)))
    total = math.ldexp(1.0, exponent - (fraction == 0.5))
    return along / total, total


def _assembled(
    g: GraspData,
    f_c: Array,
    stops: list[tuple[int, float]],
    sliders: list[tuple[Array, float]],
    exact: list[fmpq],
    drives: bool,
    held: Mask,
) -> Equivalent:
    lower, upper = g.stops
    tied, kept = np.flatnonzero(lower & upper), np.flatnonzero(~g.backdrivable)
    own = len(kept)
    l, rows = g.l + len(sliders), own + len(stops) + 2 * len(sliders)
    R, A = np.zeros((rows, l)), np.zeros((len(g.A) + len(tied), l))
    R[:own, : g.l], A[: len(g.A), : g.l] = g.R[kept], g.A
    A[len(g.A) + np.arange(len(tied)), tied] = 1.0
    for k, (j, sign) in enumerate(stops, start=own):
        R[k, j] = sign
    for n, (weights, _) in enumerate(sliders):
        first = own + len(stops) + 2 * n
        R[first : first + 2, g.l + n], R[first + 1, : g.l] = 1.0, -weights
    more = np.ones(rows - own, dtype=bool)
    return Equivalent(
        len(sliders),
        kept,
        R,
        A,
        np.concatenate([g.tendon[kept], more]),
        np.concatenate([f_c, np.zeros(rows - own)]),
        np.array([not_zero(x) for x in exact]),
        exact,
        drives,
        held,
        np.concatenate([g.slack[kept], [abs(g.stops_left[j]) for j, _ in stops], np.zeros(2 * len(sliders))]),
    )
