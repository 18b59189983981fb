"""The proofs of leaves without any bound on motions or forces: multipliers that cancel every unknown exactly.

A leaf's case and the equations of the model say, of the unknowns x (`rows.Columns`),

    F x >= b,   E x = h.

The leaf is empty if there are y (>= 0 where a row is an inequality) and v with y F + v E = 0 and y b + v h > 0, less
what E x = h may be missed by. A sum that is only nearly 0 proves nothing, as motions have no bound. A certificate has
y as rounded numbers, and v follows from it by least squares. Multipliers w = (y, v) near them cancel exactly:

- The rows that a leaf uses leave out one combination of them, w itself. So all but one of these rows, the *basis*, are
  as many as there are independent columns, and its multipliers follow from the one that is kept: a square system B.
  Where X is its inverse but for rounding, |B X - 1| < 1 shows that the solution exists and how near it is.
- Efforts of actuators with a joint of their own are put in from that joint's equation (`Equations.solved`), which makes
  systems smaller: the multiplier of the equation follows from those of the rows, exactly but for bounded rounding.
- Columns depend on each other by structure: two fingertips that stick do not keep an object from turning about the line
  through them. If all rows that a leaf uses have rank k at most (`LeafSystems._most_ranks`), and there are more than k,
  any rows and columns of numbers are put beside B, so that its rank k may be filled up to a whole square. That this has
  an inverse shows that the rank is k; the multipliers of what was added to the rows are then 0, as the right side is a
  sum of rows that a leaf uses. Where all rows may be independent nothing follows: these may contradict nothing.
- What floating point does not show is solved in rational arithmetic (`exact_margin`), in columns that elimination finds
  to be independent. Mostly all others cancel exactly, too. Where columns depend on each other only but for rounding
  (points on a circle, parallel walls), what is left in the others is multiplied by a motion, or by a force of a
  contact, which is no larger than its motion. The margin then allows for motions up to a *cap* only, see
  `Equations.reach`. Once one leaf has a cap, floating point does for all that it shows up to there, or far above all
  forces in play (`tolerance.ENOUGH_CAP`).

All of F, b, E, h but grasp map and Jacobian are floating-point numbers taken as they are, see `rows.row_values`.
Rounding is bounded from above: a sum of k products is wrong by at most k ulp of the sum of sizes, and `error` is four
times that and more.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise

import numpy as np
from flint import fmpq_mat

from handfast.proofs.cases import BadCertificate
from handfast.proofs.equations import ENTRY_ROUNDING, Equations, RightSide, power_near
from handfast.proofs.fields import ZERO, Array, Integers, Mask, dot, not_zero, product, rational, rationals, rounded
from handfast.proofs.grasp import GraspData
from handfast.proofs.structural_rank import as_bits, fewer_columns, fewer_rows, fewest_lines
from handfast.proofs.tolerance import UNIT_ROUNDOFF, left_behind

# relative: multipliers below the first are taken for 0, as they are most often rounding of a solver; where that shows
# nothing, those below the second
WEIGHT_CUTOFFS = (1e-11, 1e-13)
# of scaled rows: pivots that are smaller do not count; where that shows nothing
PIVOT_TOLERANCE, COARSE_PIVOTS = 1e-9, (1e-6, 1e-4)
SUM_INFLATION = 1 + 1e-9  # rounds sums of bounds up
LOST = 1e-300  # more than underflow takes of a sum: multipliers are scaled, the largest of a leaf is about 1
FARTHEST_CAP = 1e300  # [N] as good as any, and not inf
GROUP_COST = 1e5  # what a group of systems costs, as padding of n systems from side a to b costs n (b^3 - a^3)


class Late(Exception):
    """It was to end before."""


def in_time(until: float) -> None:
    """Raises `Late` once it is after `until` [s] of `time.monotonic`."""
    if time.monotonic() > until:
        raise Late


@dataclass(frozen=True, eq=False)
class CitedRows:
    """Rows of leaves, one after the other.

    Attributes:
        value, right: (U, n+3m+a+1+s), (U,) of `rows.row_values`, each row once. which: (R,) which of these it is.
        either: (R,) bool, multipliers may have any sign.
        y: (R,) multipliers, not negative.
        start: (L+1,) leaf i has the rows start[i] to start[i+1].
        zero: (L, n) bool, unknowns that are 0, see `rows.zeros`.
        first: (R,) bool, rows that the scalar is not below its first end.
        energy: (R,) bool, balances of energy.
    """

    value: Array
    right: Array
    which: Integers
    either: Mask
    y: Array
    start: Integers
    zero: Mask
    first: Mask
    energy: Mask


class LeafSystems:
    """Some leaves with scaled rows and unknowns.

    Attributes:
        F: (U, n) rows, with efforts put in, see `Equations.solved`; put_in: (U, k) these equations in each row.
        E: (p, n) the others.
        y, v: (R,), (L, p) multipliers of scaled rows.
        touches: (U, n) bool: unknowns that the rows know. which: (R,) of `CitedRows`.
        used, used_E: (R,), (L, p) bool: rows that count, and touch an unknown that is not 0.
        alive: (L, n) bool: unknowns that they touch.
        more: (2, L) rows and columns of any numbers that a square system has besides.
    """

    def __init__(self, equations: Equations, side: RightSide, rows: CitedRows, until: float) -> None:
        q, n, self.until = equations, equations.columns.n, until
        self.equations, self.side, self.rows = equations, side, rows
        self.count = np.diff(rows.start)
        self.some, self.begin = self.count > 0, rows.start[:-1][self.count > 0]
        self.leaf = np.repeat(np.arange(len(self.count)), self.count)
        motions = slice(0, equations.columns.motions)
        d, Z, Z_size = rows.value[:, n:], q.Z * q.scale, q.Z_size * q.scale
        self.F = rows.value[:, :n] * q.scale
        size = np.abs(self.F)
        self.F[:, motions] += product(d, Z[:, motions])
        size[:, motions] += product(np.abs(d), Z_size[:, motions])
        solved, at = q.solved
        E, E_size = q.E * q.scale / q.unit[:, None], q.E_size * q.scale / q.unit[:, None]
        if ((q.E_size > 0) & (E_size == 0)).any() or ((q.Z_size > 0) & (Z_size == 0)).any():
            raise BadCertificate("the grasp has numbers that are too small beside each other")
        self.put_in = -self.F[:, at] / E[solved, at]
        self.F += product(self.put_in, E[solved])
        size += product(np.abs(self.put_in), E_size[solved])
        for x in (self.F, size, E, E_size):
            x[:, at] = 0.0
        E[solved], E_size[solved] = 0.0, 0.0
        most = size.max(axis=1, initial=0.0)
        self.unit = power_near(most)
        self.F /= self.unit[:, None]
        self.put_in /= self.unit[:, None]
        self.largest, self.size = most / self.unit, size / self.unit[:, None]
        self.E, self.E_size, self.E_touches, self.E_largest = E, E_size, E_size > 0, E_size.max(axis=1, initial=0.0)
        self.which = rows.which
        self.b, self.h = rows.right / self.unit, side.h / q.unit
        terms = int(self.count.max(initial=0)) + sum(q.E.shape) + len(q.Z)
        self.error = ENTRY_ROUNDING + 4 * terms * UNIT_ROUNDOFF

        self.touches, stated = size > 0, rows.y * self.unit[self.which]
        self.stated = stated / power_near(self._top(stated))[self.leaf]  # in a file they may be so small that all is 0
        self.rest = rest = self._weighed(self.stated)
        v = -product(rest, q.inverse)
        alone = self.count == 0  # the equilibrium contradicts itself
        self.own_h = self.h.copy()
        self.own_h[solved] = 0.0
        v[alone] = self.own_h - (q.inverse.T @ (self.E.T @ self.own_h))
        self.stated_v = v - product(rest + product(v, self.E), q.inverse)  # once more for what rounding left
        self._use(self.stated_v, WEIGHT_CUTOFFS[0])

    def _use(self, v: Array, negligible: float = WEIGHT_CUTOFFS[1]) -> None:
        """Take v (L, p) as the multipliers of equalities, and those that are not negligible as what is used.

        What it says of those that are `solved` is rounding: theirs follow from the rows.
        """
        v = v.copy()
        v[:, self.equations.solved[0]] = 0.0
        closed, size = ~self.rows.zero, np.abs(v)
        E_touches = self.E_touches.astype(float)
        self.top = np.maximum(self._top(self.stated), size.max(axis=1, initial=0.0))
        self.y = np.where(self.stated > negligible * self.top[self.leaf], self.stated, 0.0)
        touches = self.touches[self.which]
        self.used = (self.y > 0) & (touches & closed[self.leaf]).any(axis=1)
        counts = size > negligible * self.top[:, None]
        self.used_E, self.v = counts & (product(closed.astype(float), E_touches.T) > 0), np.where(counts, v, 0.0)
        self.alive = np.zeros_like(closed)
        if len(self.y):
            self.alive[self.some] = np.logical_or.reduceat(touches & self.used[:, None], self.begin)
        self.alive = (self.alive | (product(self.used_E.astype(float), E_touches) > 0)) & closed

    def _solve_again(self, leaves: Integers, least: float) -> None:
        """Multipliers of the equalities of leaves for the unknowns that are not 0 in them alone."""
        E = self.E * ~self.rows.zero[leaves][:, None]
        inverse, v = np.linalg.pinv(E, rcond=least), self.v.copy()
        rest = (self.rest[leaves] * ~self.rows.zero[leaves])[:, None]
        v[leaves] = -(rest @ inverse)[:, 0]
        alone = self.count[leaves] == 0
        whole = self.own_h - ((self.own_h @ E)[:, None] @ inverse)[:, 0]
        v[leaves[alone]] = whole[alone]
        self._use(v)

    def _summed(self, x: Array) -> Array:
        """(L, ...) sums over the rows of each leaf."""
        out = np.zeros((len(self.count), *x.shape[1:]), dtype=x.dtype)
        if len(x):
            out[self.some] = np.add.reduceat(x, self.begin, axis=0)
        return out

    def _weighed(self, y: Array) -> Array:
        """(L, n) of each leaf, its rows times y (R,)."""
        rows = self.F[self.which]
        rows *= y[:, None]
        return self._summed(rows)

    def _top(self, x: Array) -> Array:
        """(L,) the largest of the rows of each leaf."""
        out = np.zeros(len(self.count))
        if len(x):
            out[self.some] = np.maximum.reduceat(x, self.begin)
        return out

    # --- which rows and columns make the square system

    def proved(self) -> Array:
        """(L,) y b + v h less the slack, relative to its terms, in floating point; positive is a proof.

        Raises:
            Late: until [s] of `time.monotonic` is over.
        """
        L = len(self.count)
        self._begin()
        self._leave_out_one()
        many = self._summed(self.used.astype(np.int64)) + self.used_E.sum(axis=1)
        alive = self.alive.sum(axis=1)
        square = (many - 1 == alive) | (alive == 0)
        ragged = np.flatnonzero(~square)
        rank = many - 1  # no less than the rank of what is used; all but one of the rows, where nothing better is known
        rank[ragged] = self._most_ranks(ragged).sum(axis=1)
        self.more[:, ragged] = alive[ragged] - rank[ragged], many[ragged] - 1 - rank[ragged]
        squares = self._squares(np.flatnonzero(square | (rank < many)))
        left = np.ones(L, dtype=bool)
        for each in squares:
            left[each.leaves] = ~each.regular
        some = np.flatnonzero(left)
        if len(some):
            counted = self._most_ranks(some, by_entries=True).sum(axis=1)
            better = counted < np.minimum(many, rank)[some]
            some, rank = some[better], counted[better]
            self.more[:, some] = alive[some] - rank, many[some] - 1 - rank
            squares += self._squares(some)
        return self._enclosed(squares)[0]

    def more_exactly(self, margins: Array, cap: float, enough: float = np.inf) -> tuple[Array, Array]:
        """(L,) margins, of `proved` where that shows something; (L,) [N] the caps that they need, or inf.

        In independent rows and columns. Floating point does not know what is 0 in the others, and shows a leaf up to a
        cap. Where another leaf needs a cap, that will do if it is no lower, or enough: all hold up to the least.

        Args:
            margins: of `proved`.
            cap: [N] that leaves elsewhere need; inf if they need none.
            enough: [N] a cap that is as good as any, where there has to be one.

        Raises:
            Late: until [s] of `time.monotonic` is over.
        """
        margins, caps = margins.copy(), np.full(len(margins), np.inf)
        self._use(self.stated_v)
        self._begin()
        by_floats, tried = np.zeros(len(margins), dtype=bool), set[bytes]()
        for least in (PIVOT_TOLERANCE, *COARSE_PIVOTS):
            failed = np.flatnonzero(~(margins > 0))
            if not len(failed):
                break
            if least > PIVOT_TOLERANCE:
                self._solve_again(failed, least)
            self._choose(failed[self.alive[failed].any(axis=1)], least)
            chosen = self._summed(self.basis.astype(np.int64)) + self.basis_E.sum(axis=1)
            found = self._enclosed(self._squares(failed[(chosen == self.columns.sum(axis=1))[failed]]))
            margins[failed], caps[failed] = (x[failed] for x in found)
            by_floats |= found[0] > 0
            for k in failed[~(margins[failed] > 0) & (caps[failed] > 0)].tolist():
                in_time(self.until)
                if (asked := self._asked(k)) not in tried:
                    margins[k], caps[k] = exact_margin(self, k)
                tried.add(asked)
        gap, some = left_behind(self.equations.grasp), np.flatnonzero(by_floats)
        cap = min(cap, float(caps[~by_floats & (margins > 0)].min(initial=np.inf)))
        for k in some[np.argsort(caps[some], kind="stable")].tolist():
            if caps[k] < max(cap if cap == np.inf else min(cap, enough), gap):
                in_time(self.until)
                exact = exact_margin(self, k)
                if exact[0] > 0:
                    margins[k], caps[k] = exact
            cap = min(cap, caps[k])
        margins = np.where(caps < gap, -np.inf, margins)
        return margins, np.where(margins > 0, caps, np.inf)

    def _begin(self) -> None:
        """Without a choice: all rows that count, and all unknowns that they touch."""
        self.basis, self.basis_E, self.columns = self.used.copy(), self.used_E.copy(), self.alive.copy()
        self.more = np.zeros((2, len(self.count)), dtype=np.int64)

    def _asked(self, leaf: int) -> bytes:
        """What `exact_margin` depends on, of one leaf."""
        own = slice(self.rows.start[leaf], self.rows.start[leaf + 1])
        y = np.where(self.basis[own] & (self.y[own] > 0), -1.0, self.y[own])
        v = np.where(self.basis_E[leaf], np.inf, self.v[leaf])
        return b"".join(x.tobytes() for x in (np.array([leaf]), y, v, self.columns[leaf]))

    def _squares(self, leaves: Integers) -> list[Square]:
        """The square systems of leaves."""
        side, out = self.columns.sum(axis=1) + self.more[1], []
        for chosen in _groups(leaves, side):
            in_time(self.until)
            out.append(Square(self, chosen, side[chosen]))
        return out

    def _leave_out_one(self) -> None:
        """Of each leaf's basis, the row with the largest multiplier."""
        of_y, of_v = np.where(self.used, self.y, -1.0), np.where(self.used_E, np.abs(self.v), -1.0)
        most, place = self._top(of_y), of_v.argmax(axis=1)
        in_E = of_v[np.arange(len(place)), place] > np.where(self.count > 0, most, -1.0)
        self.basis_E[np.flatnonzero(in_E), place[in_E]] = False
        rows = np.flatnonzero(self.used & (of_y == most[self.leaf]) & ~in_E[self.leaf])
        self.basis[rows[np.unique(self.leaf[rows], return_index=True)[1]]] = False

    def _choose(self, leaves: Integers, least: float) -> None:
        """Independent rows and columns of leaves, by elimination; pivots are larger than `least`.

        Equations come first, then inequalities with large multipliers, which may change most; last the row with the
        largest of all, which the others leave over.
        """
        R, p = len(self.which), len(self.E)
        for chosen in _groups(leaves, self.count):
            index, there = self.places(chosen, self.used, self.used_E)
            place = np.clip(index - R, 0, p - 1)
            size = np.where(
                index < R, np.append(self.y, 0.0)[np.minimum(index, R)], np.abs(self.v[chosen[:, None], place])
            )
            size = np.where(there, size, -1.0)
            free = np.append(self.rows.either, np.ones(p + 1, dtype=bool))[index] & there
            last = size == size.max(axis=1)[:, None]
            order = np.argsort(np.where(last, 1.0, np.where(free, -np.inf, -size)), axis=1, kind="stable")
            index, there = np.take_along_axis(index, order, axis=1), np.take_along_axis(there, order, axis=1)
            rows, columns = _pivots(self.every[self.row_of[index], :-1] * self.alive[chosen][:, None], least)
            for k, leaf in enumerate(chosen.tolist()):
                in_time(self.until)
                mine = index[k][rows[k] & there[k]]
                self.basis[self.rows.start[leaf] : self.rows.start[leaf + 1]], self.basis_E[leaf] = False, False
                self.basis[mine[mine < R]], self.basis_E[leaf, mine[mine >= R] - R] = True, True
                self.columns[leaf] = columns[k]

    def _most_ranks(self, leaves: Integers, by_entries: bool = False) -> Integers:
        """(C, 2) no less than the ranks of what leaves use in motions, and in the other unknowns.

        By counting rows and columns, and by what is so of any points:

        - If rows know the object's motion by two contacts alone, none of them knows its turning about the line through
          both; if by one, none knows any turning about it.
        - If there are no other forces than those of two contacts, or of one, the six wrench equations say nothing of
          torques about these.
        - Forces of contacts that only the wrench equations touch have no higher rank than there are such, 6 at most;
          those of two contacts 5.
        - Joints of which the rows know only how they move one contact have no higher rank than its Jacobian: 2 where
          their axes are parallel, as those of a finger mostly are, see `_of_one_contact`.

        by_entries: by the least number of rows and columns that hold all entries, `fewest_lines`, which takes longer.
        Rows and columns of which some combinations are 0 are then replaced by as many fewer that touch what any of them
        touches, and equations of joints with an unknown that nothing else touches are counted apart.
        """
        q, at, g = self.equations, self.equations.columns, self.equations.grasp
        own = np.repeat(np.arange(len(leaves)), self.count[leaves])
        place = np.arange(len(own)) - np.repeat(np.cumsum(self.count[leaves]) - self.count[leaves], self.count[leaves])
        place += self.rows.start[leaves][own]
        own, place = own[self.used[place]], place[self.used[place]]
        which, ends = self.which[place], np.searchsorted(own, np.arange(len(leaves) + 1))
        some = ends[:-1] < ends[1:]
        values, touches = self.rows.value[which] != 0, self.touches[which]
        alive, used_E = self.alive[leaves], self.used_E[leaves]

        def of_leaf(rows: Mask) -> Integers:
            """(C, ...) how many of the used rows."""
            total = np.zeros((len(leaves), *rows.shape[1:]), dtype=np.int64)
            if len(rows):
                total[some] = np.add.reduceat(rows, ends[:-1][some], axis=0, dtype=np.int64)
            return total

        def by_contact(columns: Mask) -> Mask:
            return columns[:, 0::3] | columns[:, 1::3] | columns[:, 2::3]

        by = of_leaf(by_contact(values[:, at.n : at.n + 3 * g.m])) > 0
        turning = values[:, at.n + len(q.Z) - len(g.soft) :].any(axis=1) | values[:, at.r].any(axis=1)
        turns = np.where(alive[:, at.r].all(axis=1) & (of_leaf(turning) == 0), _turns(g, by), 0)
        pressed = by_contact(alive[:, at.c])
        forces = np.zeros(at.n, dtype=bool)
        forces[at.c] = True
        other = (alive & self.E_touches[:6].any(axis=0) & ~forces).any(axis=1)
        torques = np.where(used_E[:, :6].all(axis=1) & ~other, _turns(g, pressed), 0)
        motions = np.arange(at.n) < at.motions
        joints: list[tuple[Mask, Integers]] = []
        if q.dependent_joints:
            others = product(values[:, at.n + 3 * g.m :].astype(float), self._of_others) > 0
            at_once = (of_leaf(values[:, : at.n] | others) > 0) | (product(used_E.astype(float), self.E_touches) > 0)
            joints = self._of_one_contact(alive & ~at_once, by)
        apart = np.zeros_like(used_E)
        if by_entries:
            alone = alive & ~motions & (of_leaf(touches) + product(used_E.astype(float), self.E_touches) == 1)
            apart = used_E & (np.arange(len(self.E)) >= 6) & (product(alone.astype(float), self.E_touches.T) > 0)
        of_E = by_contact(product((used_E & ~apart)[:, 6:].astype(float), self.E_touches[6:, at.c]) > 0)
        bare = pressed & ~of_E & (of_leaf(by_contact(touches[:, at.c])) == 0)
        of_bare = (alive[:, at.c] & np.repeat(bare, 3, axis=1)).sum(axis=1)
        most = np.minimum(used_E[:, :6].sum(axis=1), np.where(bare.sum(axis=1) == 2, 5, 6))
        lost = np.maximum(of_bare - most, 0)
        if not by_entries:
            counted = []
            still = turns + sum(fewer for _, fewer in joints)
            for block, fewer, fewer_of_E in ((motions, still, 0), (~motions, lost, torques)):
                unknowns = alive & block
                rows = of_leaf((touches & unknowns[own]).any(axis=1)) - fewer_of_E
                rows += (used_E & (product(unknowns.astype(float), self.E_touches.T) > 0)).sum(axis=1)
                counted.append(np.minimum(rows, unknowns.sum(axis=1) - fewer))
            return np.column_stack(counted).astype(np.int64)
        bare_columns = np.zeros_like(alive)
        bare_columns[:, at.c] = alive[:, at.c] & np.repeat(bare, 3, axis=1)
        object_motion = np.zeros_like(alive)
        object_motion[:, at.r] = alive[:, at.r]
        joined = [(object_motion, turns), (bare_columns, lost), *joints]
        return self._most_by_entries(leaves, own, which, apart, joined, torques)

    @cached_property
    def _of_others(self) -> Array:
        """(a+1+s, n) 1.0 where what is no motion of a contact (actuators, work, soft fingers) knows an unknown."""
        return (self.equations.Z_size[3 * self.equations.grasp.m :] > 0).astype(float)

    def _of_one_contact(self, alive: Mask, by: Mask) -> list[tuple[Mask, Integers]]:
        """Joints that rows know by a contact alone: (C, n) which; (C,) by how much its Jacobian's rank is lower.

        alive: (C, n) unknowns that are known by motions of contacts alone. by: (C, m) of which contacts.
        """
        q, out = self.equations, []
        alone = alive & (by.astype(float) @ q.moved == 1) & ~(q.E_size[q.solved[0]] > 0).any(axis=0)
        for contact, joints in q.dependent_joints:
            mine = alone & joints & by[:, contact, None]
            bits = as_bits(mine)
            some = {b: tuple(np.flatnonzero(mine[bits.index(b)]).tolist()) for b in set(bits)}
            fewer = {b: len(columns) - q.rank_at(contact, columns) for b, columns in some.items()}
            out.append((mine, np.array([fewer[b] for b in bits])))
        return out

    def _most_by_entries(
        self,
        leaves: Integers,
        own: Integers,
        which: Integers,
        apart: Mask,
        joined: list[tuple[Mask, Integers]],
        torques: Integers,
    ) -> Integers:
        """The same by entries.

        own, which: of the used rows, the leaf and which of `CitedRows` it is. apart: (C, p) equations that are counted
        apart. joined: of disjoint unknowns (C, n), by how much their rank is below their number (C,). torques: (C,)
        the same of the wrench equations.
        """
        alive, used_E = self.alive[leaves], self.used_E[leaves]
        known, equalities = as_bits(self.touches), as_bits(self.E_touches)
        motions = np.arange(self.equations.columns.n) < self.equations.columns.motions
        blocks = [as_bits(alive & motions), as_bits(alive & ~motions)]
        sets = [(as_bits(alive & unknowns), fewer) for unknowns, fewer in joined]
        ends = np.searchsorted(own, np.arange(len(leaves) + 1))
        out = np.zeros((len(leaves), 2), dtype=np.int64)
        for k in range(len(leaves)):
            in_time(self.until)
            rows = [known[i] for i in which[ends[k] : ends[k + 1]]]
            wrench = [equalities[i] for i in np.flatnonzero(used_E[k, :6])]
            others = [equalities[6 + i] for i in np.flatnonzero((used_E[k] & ~apart[k])[6:])]
            every = [*fewer_rows(wrench, int(torques[k])), *others, *rows]
            lines = [equalities[i] for i in np.flatnonzero(apart[k])]
            for block, some in enumerate(blocks):
                pattern = [row & some[k] for row in every]
                for unknowns, fewer in sets:
                    pattern = fewer_columns(pattern, unknowns[k], int(fewer[k]))
                out[k, block] = fewest_lines(pattern) + sum(row & some[k] > 0 for row in lines)
        return out

    def places(self, chosen: Integers, rows: Mask, equalities: Mask, width: int | None = None) -> tuple[Integers, Mask]:
        """(C, K) where in (F, E, 0) some rows (R,) and equalities (L, p) of leaves stand; and which are there."""
        R, p, counts = len(self.which), len(self.E), self.count[chosen]
        place = self.rows.start[chosen][:, None] + np.arange(int(counts.max(initial=0)))
        inside = place < self.rows.start[chosen + 1][:, None]
        there = np.concatenate([np.append(rows, False)[np.where(inside, place, R)], equalities[chosen]], axis=1)
        index = np.concatenate([place, np.broadcast_to(R + np.arange(p), (len(chosen), p))], axis=1)
        out = _compact(there, index, int(there.sum(axis=1).max(initial=0)) if width is None else width, R + p)
        return out, out < R + p

    # --- their solutions

    @cached_property
    def every(self) -> Array:
        """(U+p+1, n+1) F and E, with one more row and column of zeros."""
        return np.pad(np.concatenate([self.F, self.E]), ((0, 1), (0, 1)))

    @cached_property
    def row_of(self) -> Integers:
        """(R+p+1,) the row of `every` that each of (F, E, 0) is, leaf by leaf."""
        return np.append(self.which, len(self.F) + np.arange(len(self.E) + 1))

    def _enclosed(self, squares: list[Square]) -> tuple[Array, Array]:
        """(L,) margins by the square systems, -inf where these show nothing; (L,) [N] caps, for columns they lack.

        Where no multipliers near a leaf's will do, the cap is 0.
        """
        L, R, p = len(self.count), len(self.which), len(self.E)
        either, put_in, b = self.rows.either, self.put_in[self.which], self.b[self.which]
        w = np.concatenate([self.y, self.v.ravel(), [0.0]])
        rest = self.rest + product(self.v, self.E)
        for square in squares:
            w[square.places] -= square.solution(rest)
        y, v = w[:R], w[R:-1].reshape(L, p)
        rest = self._weighed(y) + product(v, self.E)
        sizes = self._summed(np.abs(y) * self.largest[self.which]) + np.abs(v) @ self.E_largest
        bound = self.error * sizes * SUM_INFLATION + LOST
        change, sound = np.zeros(len(w)), np.zeros(L, dtype=bool)
        for square in squares:
            change[square.places], sound[square.leaves] = square.bound(np.abs(rest) + bound[:, None])
        change_y, change_v = change[:R], change[R:-1].reshape(L, p)

        below, surely = (self._summed(((x < 0) & ~either).astype(np.int64)) for x in (y - change_y, y + change_y))
        good, never = sound & (below == 0), sound & (surely > 0)
        unit, solved, size = self.equations.unit, self.equations.solved[0], np.abs(v)
        size_in = np.abs(put_in)
        v[:, solved], size[:, solved] = self._summed(y[:, None] * put_in), self._summed(np.abs(y)[:, None] * size_in)
        change_v[:, solved] = self._summed(change_y[:, None] * size_in) + self.error * size[:, solved]
        terms = self._summed(np.abs(y * b)) + size @ np.abs(self.h)
        value = self._summed(y * b) + v @ self.h - self.error * terms
        value -= (self._summed(change_y * np.abs(b)) + change_v @ np.abs(self.h)) * SUM_INFLATION
        motions = self.rows.value[:, self.equations.columns.n + self.equations.of_contacts][self.which]
        row_unit = self.unit[self.which]
        pairs = ((y, motions), (change_y + 16 * UNIT_ROUNDOFF * np.abs(y) * self.count[self.leaf], np.abs(motions)))
        z = [self._summed((x / row_unit)[:, None] * each) for x, each in pairs]
        slack, grows = self.side.costs(self.equations, v / unit, change_v / unit, *z)
        first = self.rows.first
        pushes = self._summed(np.where(first, y - change_y, 0.0) / row_unit) * (1 - 1e-9)
        energy = self._summed(np.where(self.rows.energy, np.abs(y) + change_y, 0.0) / row_unit) * self.side.energy
        value -= (slack + energy) * SUM_INFLATION + self.side.grown(grows, pushes) + LOST
        margins = np.where(terms > 0, value / np.maximum(terms, 1e-300), -np.inf)
        others, caps = self.alive & ~self.columns, np.full(L, np.inf)
        if others.any():
            off = self._summed(change_y[:, None] * self.size[self.which]) + product(change_v, self.E_size)
            off = (bound[:, None] + off) * SUM_INFLATION
            rest, off = (np.where(others, x, 0.0) / self.equations.scale for x in (rest, off))
            weight = 2 * self.equations.reach(rest, off) + LOST
            caps = np.where(others.any(axis=1), value / weight * (1 - 1e-9), np.inf)
            unbounded = others & ~self.equations.reached
            never |= sound & (unbounded & (np.abs(rest) > off)).any(axis=1)
            good &= ~unbounded.any(axis=1)
        margins = np.where(good & np.isfinite(margins), margins, -np.inf)
        return margins, np.where(never, 0.0, np.where(margins > 0, caps, np.inf))


class Square:
    """The bases of some leaves, B d = -r: as many rows as columns, padded with 1.

    Attributes:
        leaves: (C,). places: (C, N) where their multipliers stand among those of all rows and equalities.
        columns: (C, N), of a residual with one more column, for padding. regular: (C,) bool: it is shown that there
            is an inverse.
    """

    def __init__(self, systems: LeafSystems, leaves: Integers, sides: Integers) -> None:
        R, (p, n), side = len(systems.which), systems.E.shape, int(sides.max(initial=0))
        self.leaves = leaves
        index, there = systems.places(leaves, systems.basis, systems.basis_E, side)
        self.columns = _compact(systems.columns[leaves], np.arange(n), side, n)
        row = systems.row_of[index]
        B = systems.every.take(row[:, :, None] * (n + 1) + self.columns[:, None, :])
        diagonal, some = np.arange(side), np.flatnonzero(systems.more[:, leaves].any(axis=0))
        inside = diagonal < sides[some, None]
        added = (~there[some][:, :, None] | (self.columns[some] == n)[:, None]) & inside[:, :, None] & inside[:, None]
        B[some] += np.where(added, _any_numbers(side), 0.0)
        B[:, diagonal, diagonal] += diagonal >= sides[:, None]
        end = R + len(systems.count) * p
        self.places = np.where(index < R, index, np.where(there, index + leaves[:, None] * p, end))
        self.X = X = _inverse(B)
        self._sizes, ones, off = np.abs(X), np.ones(side), product(B, X)
        off[:, diagonal, diagonal] -= 1.0
        np.abs(off, out=off)
        largest = np.maximum(np.concatenate([systems.largest, systems.E_largest, [1.0]]), 1.0)[row]
        rounding = systems.error * largest * (self._sizes @ ones).sum(axis=1)[:, None] * SUM_INFLATION
        self._rows = (off @ ones * SUM_INFLATION + rounding).max(axis=1, initial=0.0)
        self._columns = ones @ off * SUM_INFLATION + rounding.max(axis=1, initial=0.0)[:, None]
        self.regular = self._rows < 0.5

    def _of(self, residual: Array) -> Array:
        """(C, 1, N) a residual (L, n) in the columns of the systems."""
        wide = np.concatenate([residual, np.zeros((len(residual), 1))], axis=1)
        return wide[self.leaves[:, None], self.columns][:, None]

    def solution(self, residual: Array) -> Array:
        """(C, N) d that B maps to a residual (L, n), but for rounding."""
        found = (self._of(residual) @ self.X)[:, 0]
        return np.where(self.regular[:, None], found, 0.0)

    def bound(self, residual: Array) -> tuple[Array, Mask]:
        """(C, N) upper bounds on the d that B maps to a residual, exactly, of at most this size; (C,) do they exist?

        With B X = 1 + D, d B = r: d = r X - d D, hence |d|_1 <= |r X|_1 / (1 - the largest row sum of |D|).
        """
        at_most = (self._of(residual) @ self._sizes)[:, 0] * SUM_INFLATION
        whole = at_most.sum(axis=1) / np.maximum(1.0 - self._rows, 1e-300) * SUM_INFLATION
        return np.where(
            self.regular[:, None], at_most + whole[:, None] * self._columns * SUM_INFLATION, 0.0
        ), self.regular


def _turns(g: GraspData, which: Mask) -> Integers:
    """(L,) by how many turns all of some contacts (L, m) stay in place: 3 of one point, 1 of two that are apart."""
    m, count = g.m, which.sum(axis=1)
    ends = g.positions[which.argmax(axis=1)], g.positions[m - 1 - which[:, ::-1].argmax(axis=1)]
    apart = (ends[0] != ends[1]).any(axis=1)
    return np.where(count == 1, 3, np.where((count == 2) & apart, 1, 0))


@lru_cache(maxsize=128)
def _any_numbers(n: int) -> Array:
    """(n, n) from -1 to 1, rows and columns that depend on nothing."""
    return np.asarray(np.cos(np.arange(n * n).reshape(n, n) ** 2.0))


def _groups(leaves: Integers, size: Integers) -> list[Integers]:
    """Leaves of like size together, so that little is wasted on padding: a group costs time, too."""
    leaves = leaves[np.argsort(size[leaves], kind="stable")]
    sizes, first = np.unique(size[leaves], return_index=True)
    begin, ends = 0, [0]
    for k in range(1, len(sizes)):
        if (first[k] - begin) * (sizes[k] ** 3 - sizes[k - 1] ** 3) > GROUP_COST:
            begin = int(first[k])
            ends.append(begin)
    return [leaves[k:end] for k, end in pairwise([*ends, len(leaves)]) if k < end]


def _compact(there: Mask, values: Integers, width: int, nothing: int) -> Integers:
    """(C, width) those of the values (C, K) or (K,) that are there, in each row in their order, then `nothing`."""
    i, j = np.nonzero(there)
    count = there.sum(axis=1)
    out = np.full((len(there), width), nothing)
    place = np.arange(len(i)) - np.repeat(np.cumsum(count) - count, count)
    within = place < width
    i, j, place = i[within], j[within], place[within]
    out[i, place] = values[j] if values.ndim == 1 else values[i, j]
    return out


def _inverse(B: Array) -> Array:
    """Of each matrix (C, N, N); 0 where there is none."""
    try:
        return np.asarray(np.linalg.inv(B), dtype=np.float64)
    except np.linalg.LinAlgError:  # some of them are singular
        out, good = np.zeros(B.shape), np.linalg.slogdet(B)[0] != 0
        if not good.all():
            out[good] = _inverse(B[good])
        return out


def _pivots(B: Array, least: float) -> tuple[Mask, Mask]:
    """(C, K) rows of matrices (C, K, n) that those before leave a pivot above `least`; (C, n) the pivots' columns."""
    B = B.copy()
    C, K, n = B.shape
    rows, columns, every = np.zeros((C, K), dtype=bool), np.zeros((C, n), dtype=bool), np.arange(C)
    for i in range(K):
        row = B[:, i]
        j = np.abs(row).argmax(axis=1)
        pivot = row[every, j]
        real = np.abs(pivot) > least
        rows[:, i], columns[every, j] = real, columns[every, j] | real
        row = row * (real / np.where(real, pivot, 1.0))[:, None]
        rest = B[:, i + 1 :]
        rest -= rest[every, :, j][:, :, None] * row[:, None]
        rest[every, :, j] = np.where(real[:, None], 0.0, rest[every, :, j])
    return rows, columns


# --- in rational arithmetic, where rounding does not show it

UNBOUNDED_RANGE = -np.inf, np.inf


def exact_margin(systems: LeafSystems, leaf: int) -> tuple[float, float]:
    """y b + v h less the slack, relative, of multipliers that cancel exactly and are near a leaf's; -inf if none are.

    The multipliers of the basis are solved for in the chosen columns; then all others have to cancel as well. What does
    not makes the second number: [N] the cap on motions that leaves half of the margin; inf where all cancels.
    """
    s, q = systems, systems.equations
    own = np.arange(s.rows.start[leaf], s.rows.start[leaf + 1])
    own = own[s.y[own] > 0]  # those that touch no unknown but such as are 0 count by their right side
    row = s.which[own]
    solved, at = (x[(s.put_in[row] != 0).any(axis=0)] for x in q.solved)
    basis_E, chosen, alive = s.basis_E[leaf].copy(), s.columns[leaf].copy(), s.alive[leaf].copy()
    basis_E[solved], chosen[at], alive[at] = True, True, True
    ties = np.flatnonzero((s.v[leaf] != 0) | basis_E)
    known = (q.E_size[ties] > 0).any(axis=0) | (s.rows.value[row, : len(alive)] != 0).any(axis=0)
    if (known & ~s.rows.zero[leaf] & ~(chosen | alive)).any():
        return UNBOUNDED_RANGE  # what is not looked at need not cancel
    y, v = s.y[own] / s.unit[row], s.v[leaf, ties] / q.unit[ties]
    in_basis = np.concatenate([s.basis[own], basis_E[ties]])
    basis, others = np.flatnonzero(in_basis).tolist(), np.flatnonzero(~in_basis).tolist()
    if len(basis) != chosen.sum() or not (np.isfinite(y).all() and np.isfinite(v).all()):
        return UNBOUNDED_RANGE
    kept, rest = (q.exact_rows(s.rows.value[row], ties, np.flatnonzero(x)) for x in (chosen, alive & ~chosen))
    w = rationals(np.concatenate([y, v]))
    if basis:
        missing = [[-dot((w[j] for j in others), (kept[j][i] for j in others))] for i in range(len(basis))]
        try:
            found = fmpq_mat([kept[j] for j in basis]).transpose().solve(fmpq_mat(missing))
        except ZeroDivisionError:  # singular
            return UNBOUNDED_RANGE
        for place, j in enumerate(basis):
            w[j] = found[place, 0]
    free = np.concatenate([s.rows.either[own], np.ones(len(ties), dtype=bool)])
    if any(x < 0 for x, any_sign in zip(w, free, strict=True) if not any_sign):
        return UNBOUNDED_RANGE
    left = np.zeros(len(alive))
    left[alive & ~chosen] = [not_zero(dot(w, column)) for column in zip(*rest, strict=True)]
    if left[~q.reached].any():
        return UNBOUNDED_RANGE

    right = [*rationals(s.rows.right[row]), *(s.side.exact[k] for k in ties)]
    terms = [x * b for x, b in zip(w, right, strict=True)]
    size = sum((abs(x) for x in terms), ZERO)
    if size == 0:
        return UNBOUNDED_RANGE
    near = np.array([rounded(x) for x in w])
    multipliers, of_rows = np.zeros((1, len(s.E))), near[: len(own)]
    multipliers[0, ties] = near[len(own) :]
    motions = s.rows.value[row][:, q.columns.n + q.of_contacts]
    z, z_size = of_rows @ motions, np.abs(of_rows) @ np.abs(motions)
    slack, grows = s.side.costs(q, multipliers, np.zeros_like(multipliers), z[None], 1e-13 * z_size[None])
    pushes, energy = (of_rows @ which[own] for which in (s.rows.first, s.rows.energy))
    cost = (slack[0] + energy * s.side.energy) * (1 + 1e-9) + s.side.grown(grows, np.array([pushes * (1 - 1e-9)]))[0]
    cost += LOST
    if not np.isfinite(cost):
        return UNBOUNDED_RANGE
    value = sum(terms, ZERO) - rational(cost)
    weight = 2 * float(q.reach(left[None], np.abs(left)[None] * 1e-9)[0]) + LOST
    most = min(max(rounded(value), 0.0), FARTHEST_CAP)
    return rounded(value / size), (min(most / weight, FARTHEST_CAP) if left.any() else np.inf)
