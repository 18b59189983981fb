"""That no commands below a bound hold a load on its path, whatever its steps: of `torques` with the load after them.

A path is a chain of states, each with a larger share of the load (`path_steps`). Its last state alone bounds no
command: gearing that stands where the squeeze left it carries any load. But whatever moved stood still at last. Of
each actuator whose command is sought either it never moves; or there is a state of the path, at some share from 0 to 1
of the load, after the last step in which it moved: there its effort is its command, by (8), and it has closed as far
as at the end. So if a load is held on a path, these states exist together, state 0 being the last one and state k the
one of the k-th actuator that is sought:

- each is in equilibrium, (1), (2), with forces in their friction cones, under its share of the load (state 0: all);
- springs of contacts know the whole motion: c_n >= 0, c_n + d_n >= 0, and one of the two is 0;
- stops, tendons that nobody commands and locked gearing know it, too;
- of a commanded actuator efforts are never below its command, and it never opens.

That is linear but for the cones, of which tangents are cited, and for the cases: contacts that are open or closed in a
state, actuators that moved or did not. A certificate is a tree of cases with multipliers for each leaf; here they are
summed in rational arithmetic. Which way friction pushes, and what happens between these states, is left out: so a path
may need more than the bound. It is proved of states whose forces and motions are `STATE_REACH` times the load at most,
and gives way in (1), (2) and (3) by `DRIFT` of the load, which is what steps of a path may miss and hand on.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import count
from typing import Any

import numpy as np
from flint import fmpq

from handfast.proofs.fields import ZERO, Array, BadFile, Fields, Integers, not_zero, rational, refuse_unknown
from handfast.proofs.kinds import CONE_WIDENING
from handfast.proofs.question import Question
from handfast.proofs.states import State
from handfast.proofs.tolerance import MIN_FORCE_SCALE, drives, load_scale, travel

STATE_REACH = 1e6  # times the load: forces and motions of the states that a bound is proved of
DRIFT = 1e-5  # relative to the load: by how much states of a path may miss (1), (2), (3), all steps together
OPEN, CLOSED = LOCKED, MOVED = 0, 1
PATH_INFLATION = 1 + 1e-12  # rounds sums of bounds up
MAX_PATH_LEAVES, MAX_PATH_CASES = 100_000, 5_000_000  # the second of all nodes together
MAX_PATH_ENTRIES = 2_000_000  # of all rows together: 25 states of a hand of 24 joints have 30,000

Condition = tuple[int, int] | None  # a part and its case


@dataclass(frozen=True, eq=False)
class PathRow:
    """terms . x = right, or >= right, in all cases or where a part has one; `slack`: by how much it may be missed."""

    terms: dict[int, fmpq]
    right: fmpq
    equal: bool
    condition: Condition = None
    slack: float = 0.0


@dataclass(frozen=True, eq=False)
class PathCommands:
    """The commands that are sought on a path.

    Attributes:
        question: a check of the whole load from rest, as of a path; its commands of the actuators that are sought make
            no difference.
        senses: (a,) 1 or -1 of the actuators whose commands are sought, 0 of others.
        sums: is their sum made small, not the largest?
    """

    question: Question
    senses: Array
    sums: bool

    @cached_property
    def sought(self) -> Integers:
        """(k,) the actuators whose commands are sought."""
        return np.flatnonzero(self.senses)

    @property
    def states(self) -> int:
        """State 0 is the last one, the others those of the actuators."""
        return 1 + len(self.sought)

    @property
    def parts(self) -> int:
        """How many cases there are to decide: contacts, state by state, then actuators."""
        return self.states * self.question.grasp.m + len(self.sought)

    @cached_property
    def scale(self) -> float:
        """[N] of the load."""
        return load_scale(self.question.grasp, self.question.wrench)

    @property
    def known(self) -> bool:
        """Is there a load, and no uncertain normal, whose gaps know how far a contact slid?"""
        return bool(self.question.wrench.any()) and self.question.eta == 0 and self.scale > MIN_FORCE_SCALE

    def to_json(self) -> dict[str, Any]:
        """As files have it, beside the question."""
        names = self.question.grasp.actuators
        senses = {names[j]: int(self.senses[j]) for j in self.sought.tolist()}
        return {"senses": senses, "objective": "sum" if self.sums else "max"}

    @property
    def words(self) -> str:
        """Whose commands are sought, in which sense, and what of them is small."""
        return sought_words(**self.to_json())

    def cost(self, command: Array) -> float:
        """[N m or N] what commands (a,) are measured by."""
        sizes = np.abs(command[self.sought])
        return float(sizes.sum() if self.sums else sizes.max(initial=0.0))

    # --- the unknowns: r, q, c, twist, f, coupling, reaction of each state; shares of the load, efforts, the measure

    @cached_property
    def _sizes(self) -> list[int]:
        g = self.question.grasp
        return [6, g.l, 3 * g.m, len(g.soft), g.a, len(g.A), g.l]

    def at(self, state: int, kind: int, i: int = 0) -> int:
        """The column of an unknown of a state; kind: 0 to 6 as they stand there."""
        return state * sum(self._sizes) + sum(self._sizes[:kind]) + i

    def share(self, k: int) -> int:
        """The column of the share of the load in state k, from 1 on."""
        return self.at(self.states, 0) + k - 1

    def effort(self, k: int) -> int:
        """The column of the command of the k-th actuator, from 1 on, where the sum is sought."""
        return self.share(self.states) + k - 1

    @property
    def measure(self) -> int:
        """The column of what is to be small."""
        return self.effort(self.states)

    @property
    def n(self) -> int:
        """How many unknowns."""
        return self.measure + 1

    @cached_property
    def units(self) -> Array:
        """(n,) of each unknown what counts as much as a force of 1 N at a contact, or its motion."""
        g = self.question.grasp
        far = 1.0 + float(np.linalg.norm(g.centroid)) / g.size
        every = travel(g, np.vstack([np.eye(g.l), g.R]))
        joints, efforts = every[: g.l], every[g.l :]  # where forces that they balance press, whatever passes them on
        tied = np.array([(joints[a != 0] / np.abs(a[a != 0])).max(initial=0.0) for a in g.A])
        own = [np.full(3, far), np.full(3, 1 / g.size), 1 / g.joint_arms, np.ones(3 * g.m + len(g.soft))]
        own += [efforts, tied.reshape(-1), joints]
        arms = efforts[self.sought]
        of_all = [*own * self.states, np.ones(len(arms)), arms, [max(arms.max(initial=0.0), arms.sum() * self.sums)]]
        return np.concatenate([np.asarray(x, dtype=float) for x in of_all])

    @cached_property
    def reach(self) -> float:
        """[N] up to which forces and motions of the states a bound is proved: far above all that acts, wherever."""
        g = self.question.grasp
        given = load_scale(g, np.zeros(6)) if g.command.any() or g.torque.any() else 0.0
        return STATE_REACH * max(self.scale, drives(self.question), given)

    def size_of(self, states: Sequence[State]) -> float:
        """[N] of the forces of some states, and of their motions all together, the largest in `units`."""
        motions = np.sum([np.abs(x.motion) for x in states], axis=0)
        forces = [
            np.concatenate([x.c, np.zeros(len(self.question.grasp.soft)), x.f, x.coupling, x.reaction]) for x in states
        ]
        every = np.concatenate([motions, np.abs(forces).max(axis=0)])
        return float((every / self.units[: len(every)]).max())

    # --- the rows

    @property
    def entries(self) -> int:
        """How many entries the rows have, about."""
        g = self.question.grasp
        return self.states * (g.m * (6 + g.l) + g.l * (3 * g.m + 2 * g.a + 2 * len(g.A)))

    @cached_property
    def rows(self) -> list[PathRow]:
        """All but tangents of friction cones, in the order in which certificates number them."""
        out = [row for x in range(self.states) for row in self._of_state(x)]
        for k, j in enumerate(self.sought.tolist(), start=1):
            out += self._of_command(k, j)
        one, least = fmpq(1), self.measure
        if self.sums:
            efforts = {self.effort(k): fmpq(-1) for k in range(1, self.states)}
            out += [PathRow({least: one, **efforts}, ZERO, True)]
            out += [PathRow({column: one}, ZERO, False) for column in efforts]
        return [*out, PathRow({least: one}, ZERO, False)]

    def _of_state(self, x: int) -> list[PathRow]:
        """Equilibrium, springs, stops, gearing and limits in a state."""
        q, g = self.question, self.question.grasp
        maps, load = g.exact_table, [rational(w) for w in q.wrench]
        one, some = fmpq(1), DRIFT * self.scale
        touching = [self.at(x, 2, i) for i in range(3 * g.m)] + [self.at(x, 3, s) for s in range(len(g.soft))]
        motions = [self.at(x, 0, i) for i in range(6)] + [self.at(x, 1, j) for j in range(g.l)]
        out = []
        arm = g.size + float(np.linalg.norm(g.centroid))
        for i in range(6):
            terms = {c: maps[k, i] for k, c in enumerate(touching) if maps[k, i]}
            right = -load[i] if x == 0 else ZERO
            if x and load[i]:
                terms[self.share(x)] = load[i]
            out.append(PathRow(terms, right, True, None, some * (1.0 if i < 3 else arm)))
        back = [rational(f) if b else ZERO for f, b in zip(g.command.tolist(), g.backdrivable.tolist(), strict=True)]
        R, A = ([[rational(v) for v in row] for row in table.tolist()] for table in (g.R, g.A))
        for j in range(g.l):
            terms = {c: -maps[k, 6 + j] for k, c in enumerate(touching) if maps[k, 6 + j]}
            terms |= {self.at(x, 4, a): -row[j] for a, row in enumerate(R) if row[j] and not g.backdrivable[a]}
            terms |= {self.at(x, 5, k): -row[j] for k, row in enumerate(A) if row[j]}
            given = rational(g.torque[j]) + sum((row[j] * f for row, f in zip(R, back, strict=True)), ZERO)
            out.append(PathRow({**terms, self.at(x, 6, j): -one}, given, True, None, some * float(g.joint_units[j])))
        out += [PathRow(self._along(x, 1, row), ZERO, True) for row in A]
        for i in range(g.m):
            force, part = self.at(x, 2, 3 * i), x * g.m + i
            gap = {c: maps[3 * i, k] for k, c in enumerate(motions) if maps[3 * i, k]} | {force: one}
            out += [PathRow({force: one}, ZERO, False), PathRow(gap, ZERO, False, None, some)]
            its = [force, force + 1, force + 2]
            its += [self.at(x, 3, s) for s in np.flatnonzero(g.soft == i).tolist()]
            out += [PathRow({column: one}, ZERO, True, (part, OPEN)) for column in its]
            out.append(PathRow(gap, ZERO, True, (part, CLOSED), some))
            if q.force_limit < np.inf:
                out.append(PathRow({force: -one}, -rational(q.force_limit), False))
        for j in range(g.l):
            out += self._of_joint(x, j)
        for a, name in enumerate(g.actuators):
            effort, moved = self.at(x, 4, a), self._along(x, 1, R[a])
            if g.backdrivable[a]:
                continue
            limit = q.torque_limits.get(name, np.inf)
            if limit < np.inf:
                out += [PathRow({effort: s * one}, -rational(limit), False) for s in (1, -1)]
            if g.tendon[a]:
                out += [PathRow(moved, ZERO, False), PathRow({effort: one}, ZERO, False)]
            elif not self.senses[a]:
                out.append(PathRow(moved, ZERO, True))
        return out

    def _of_joint(self, x: int, j: int) -> list[PathRow]:
        """Friction within its range, which a stop widens; no joint moves into a stop."""
        g, one = self.question.grasp, fmpq(1)
        lower, upper = ((g.stop[j] == k) | (g.stop[j] == 3) for k in (1, 2))
        q, reaction, most = self.at(x, 1, j), self.at(x, 6, j), -rational(g.friction[j])
        if lower and upper:
            return [PathRow({q: one}, ZERO, True)]
        out = [PathRow({q: one if lower else -one}, ZERO, False)] if lower or upper else []
        out += [] if upper else [PathRow({reaction: one}, most, False)]
        return out if lower else [*out, PathRow({reaction: -one}, most, False)]

    def _of_command(self, k: int, j: int) -> list[PathRow]:
        """What joins state k to the others: the command is its effort there, and it closed as far as at the end."""
        g, sense, part = self.question.grasp, fmpq(int(self.senses[j])), self.states * self.question.grasp.m + k - 1
        R = [rational(v) for v in g.R[j].tolist()]
        own, moved = self.at(k, 4, j), (part, MOVED)

        def closed(x: int, sign: fmpq) -> dict[int, fmpq]:
            return {column: sign * sense * v for column, v in self._along(x, 1, R).items()}

        out = [PathRow(closed(k, fmpq(1)) | closed(0, fmpq(-1)), ZERO, True)]
        for x in range(self.states):
            if not g.tendon[j]:
                out += [
                    PathRow(closed(x, fmpq(1)), ZERO, False),
                    PathRow(closed(x, fmpq(1)), ZERO, True, (part, LOCKED)),
                ]
            if x != k:
                out.append(PathRow({self.at(x, 4, j): sense, own: -sense}, ZERO, False, moved))
            if x not in (0, k):
                out.append(PathRow(closed(0, fmpq(1)) | closed(x, fmpq(-1)), ZERO, False, moved))
        cost = self.effort(k) if self.sums else self.measure
        out += [PathRow({own: sense}, ZERO, False, moved), PathRow({cost: fmpq(1), own: -sense}, ZERO, False, moved)]
        share = self.share(k)
        return [*out, PathRow({share: fmpq(1)}, ZERO, False), PathRow({share: fmpq(-1)}, fmpq(-1), False)]

    def _along(self, x: int, kind: int, row: list[fmpq]) -> dict[int, fmpq]:
        return {self.at(x, kind, j): v for j, v in enumerate(row) if v}

    def tangent(self, x: int, i: int, along: Array) -> PathRow:
        """That friction of contact i in state x is in its cone: along . c_t <= mu c_n |along|; along (2,), or (3,)."""
        g = self.question.grasp
        half = 2.0 ** int(np.frexp(np.abs(along).max(initial=0.0))[1] - 1)  # squares of small numbers would be 0
        size = rational(g.mu[i]) * rational(half) * rational(float(np.linalg.norm(along / half)) * (1 + CONE_WIDENING))
        terms = {self.at(x, 2, 3 * i): size}
        columns = [self.at(x, 2, 3 * i + 1), self.at(x, 2, 3 * i + 2)]
        columns += [self.at(x, 3, s) for s in np.flatnonzero(g.soft == i).tolist()]
        return PathRow(
            terms | {c: -rational(u) for c, u in zip(columns, along.tolist(), strict=True) if u}, ZERO, False
        )

    # --- what multipliers show

    def shown(self, rows: list[PathRow], multipliers: list[float]) -> float:
        """A lower bound of the measure, from rows that hold and multipliers, not negative but of equalities.

        inf if the rows contradict each other, 0 if nothing is shown.
        """
        sums: dict[int, fmpq] = {}
        right, missed, reach = ZERO, ZERO, rational(self.reach)
        for row, y in zip(rows, multipliers, strict=True):
            exact = rational(y)
            for column, v in row.terms.items():
                sums[column] = sums.get(column, ZERO) + exact * v
            right += exact * row.right
            missed += abs(exact) * rational(row.slack)
        by = sums.pop(self.measure, ZERO)
        if by < 0:
            return 0.0
        for column, v in sums.items():
            if v:
                missed += abs(v) * reach * rational(self.units[column])
        left = right - missed * rational(PATH_INFLATION)
        if left <= 0:
            return 0.0
        return np.inf if by == 0 else float(not_zero(left / by)) * (1 - 1e-15)


@dataclass(frozen=True, eq=False)
class PathLeaf:
    """A case of the tree with its multipliers: of rows by number, and of tangents by state, contact and direction."""

    rows: tuple[tuple[int, float], ...]
    tangents: tuple[tuple[int, int, tuple[float, ...], float], ...]


@dataclass(frozen=True, eq=False)
class PathBound:
    """A tree of cases: `parent`, `part`, `case` (N,) of its nodes, the root's -1; the leaves in the order of nodes."""

    parent: tuple[int, ...]
    part: tuple[int, ...]
    case: tuple[int, ...]
    leaves: tuple[PathLeaf, ...]

    def to_json(self) -> dict[str, Any]:
        """As files have it."""
        leaves = [
            {"rows": [*map(list, x.rows)], "tangents": [[a, b, [*u], y] for a, b, u, y in x.tangents]}
            for x in self.leaves
        ]
        return {"parent": [*self.parent], "part": [*self.part], "case": [*self.case], "leaves": leaves}

    def lower(self, of: PathCommands) -> float:
        """The bound that all leaves show, in the question's own units; inf where they contradict. `BadFile`."""
        if of.entries > MAX_PATH_ENTRIES:
            raise BadFile(f"has more than {MAX_PATH_ENTRIES} entries in its rows", "bound")
        if not of.known:
            raise BadFile("is of no load, or of uncertain normals, for which no bound is proved", "bound")
        cases = self._cases(of)
        if len(cases) != len(self.leaves):
            raise BadFile(f"has {len(self.leaves)} leaves; its tree has {len(cases)}", "bound")
        every = of.rows
        pairs = enumerate(zip(cases, self.leaves, strict=True))
        return min(leaf_bound(of, every, c, leaf, f"bound.leaves[{k}]") for k, (c, leaf) in pairs)

    def _cases(self, of: PathCommands) -> list[dict[int, int]]:
        """Of each leaf the parts that are decided. `BadFile` for a tree that leaves out a case."""
        children: dict[int, list[int]] = {}
        cases: list[dict[int, int]] = []
        decided = 0
        for k, parent, part, case in zip(count(), self.parent, self.part, self.case, strict=False):
            if k == 0:
                if parent != -1:
                    raise BadFile("begins with no root", "bound.parent")
                cases.append({})
                continue
            if not (0 <= parent < k and 0 <= part < of.parts and case in (0, 1) and part not in cases[parent]):
                raise BadFile(f"node {k} is no case of an earlier one", "bound")
            children.setdefault(parent, []).append(k)
            cases.append(cases[parent] | {part: case})
            decided += len(cases[k])
            if decided > MAX_PATH_CASES:
                raise BadFile(f"decides more than {MAX_PATH_CASES} parts in all", "bound")
        for parent, two in children.items():
            if len(two) != 2 or self.part[two[0]] != self.part[two[1]] or self.case[two[0]] == self.case[two[1]]:
                raise BadFile(f"node {parent} does not have both cases of one part", "bound")
        return [c for k, c in enumerate(cases) if k not in children]


def leaf_bound(of: PathCommands, every: list[PathRow], case: dict[int, int], leaf: PathLeaf, place: str = "") -> float:
    """What a leaf shows in its case, as `PathCommands.shown`. `BadFile` for a row that does not hold there."""
    g, rows, y = of.question.grasp, [], []
    for k, multiplier in leaf.rows:
        if not 0 <= k < len(every):
            raise BadFile(f"has row {k}; there are {len(every)}", place)
        row = every[k]
        if row.condition is not None and case.get(row.condition[0]) != row.condition[1]:
            raise BadFile(f"row {k} does not hold in its case", place)
        if not (row.equal or multiplier >= 0):
            raise BadFile(f"row {k} has a negative multiplier", place)
        rows.append(row)
        y.append(multiplier)
    for x, i, along, multiplier in leaf.tangents:
        if not (0 <= x < of.states and 0 <= i < g.m and len(along) == 2 + (i in g.soft) and multiplier >= 0):
            raise BadFile("has a tangent of no contact, or with a negative multiplier", place)
        rows.append(of.tangent(x, i, np.array(along)))
        y.append(multiplier)
    return of.shown(rows, y)


def read_bound(f: Fields) -> PathBound:
    """The certificate in a parsed object. Raises `BadFile`."""
    parent, part, case = (_wholes(f.numbers(name, (-1,)), f.at(name)) for name in ("parent", "part", "case"))
    if not len(parent) == len(part) == len(case) or not 0 < len(parent) <= 2 * MAX_PATH_LEAVES:
        raise BadFile("has no tree", f.place)
    leaves = []
    for leaf in f.objects("leaves"):
        rows = leaf.numbers("rows", (-1, 2), []).reshape(-1, 2)
        which = _wholes(rows[:, 0], leaf.at("rows"))
        tangents = []
        for data, place in leaf.items("tangents"):
            names = "state", "contact", "along", "y"
            t = Fields(dict(zip(names, data, strict=False)) if isinstance(data, list) else data, place)
            x, i = t.whole("state"), t.whole("contact")
            tangents.append((x, i, tuple(t.numbers("along", (-1,)).tolist()), t.number("y")))
        leaf.done()
        leaves.append(PathLeaf(tuple(zip(which, rows[:, 1].tolist(), strict=True)), tuple(tangents)))
    f.done()
    return PathBound(parent, part, case, tuple(leaves))


def _wholes(values: Array, place: str) -> tuple[int, ...]:
    if (values % 1).any():
        raise BadFile("has a number that is not whole", place)
    return tuple(int(x) for x in values)


def sought_words(senses: Mapping[str, float], objective: str) -> str:
    """'+jaw, -other (max)', of `sought` as files have it."""
    each = ", ".join(f"{'+' if sense > 0 else '-'}{name}" for name, sense in senses.items())
    return f"{each or 'no actuator'} ({objective})"


def read_sought(f: Fields, q: Question) -> PathCommands:
    """What is sought, `sought` of a file: names of actuators with their senses, and the measure. Raises `BadFile`."""
    g, senses = q.grasp, np.zeros(q.grasp.a)
    for name, sense in f.named("senses").items():
        refuse_unknown(name, g.actuators, "actuator", f.at("senses"))
        j = g.actuators.index(name)
        if sense not in (1, -1) or g.backdrivable[j] or (g.tendon[j] and sense < 0):
            raise BadFile("is no sense of a command that can be sought; 1 or -1 is", f.at(f"senses.{name}"))
        senses[j] = sense
    for j in np.flatnonzero((senses == 0) & (g.command != 0) & ~g.backdrivable).tolist():
        raise BadFile(
            f"leaves out '{g.actuators[j]}', which is commanded; what is not sought is locked", f.at("senses")
        )
    sums = f.text("objective", among=("max", "sum")) == "sum"
    f.done()
    return PathCommands(q, senses, sums)
