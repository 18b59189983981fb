"""Finds motions of object and joints together on which a load does more work than motors within their limits can.

For a box of configurations: a linear program in the object's twist and the joints' motions, by what is so in the
middle of the box. A force on the edge of a friction cone, with the torsion of a soft finger, is one row: the work that
it does. How a row changes over the
box is taken to first order, from differences. The force that does least work, and the corner of the box at which that
is least, hang on the motions: these are added until none is worse. What is largest is the margin of all rows.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import linprog

from handfast.core.arrays import Array
from handfast.planning.filters.balance import rim
from handfast.proofs.chains import joint_rates
from handfast.proofs.discarded_boxes import Boxes
from handfast.proofs.fields import Integers
from handfast.proofs.intervals import Interval
from handfast.proofs.motors import Motors
from handfast.proofs.posed_boxes import ContactBoxes
from handfast.proofs.unbalanced import Motions, Placements

FIRST_CONE_EDGES = 8  # of each friction cone, to begin with
MOTION_ROUNDS = 8  # in which forces and corners of the box are added
MARGIN_TOLERANCE = 1e-3  # relative: a margin that falls by less is not worked on
MIN_MARGIN = 1e-7  # margin, relative to the load: below it there is none
NO_LINE = -1


class VirtualMotions:
    """Of all contacts of a task.

    Attributes:
        free: whether any joint moves against limited forces alone.
    """

    def __init__(self, contacts: ContactBoxes, motors: Motors, placements: Placements) -> None:
        self.contacts, self.motors, self.placements = contacts, motors, placements
        task, hand = contacts.task, contacts.task.hand
        l = len(hand.joints)
        leads = [j for j in task.moving if not hand.driving(j)]
        moves = joint_rates(hand, np.eye(l)[leads]).mid  # (L, l)
        endless = (np.abs(moves @ motors.rows[np.isinf(motors.limits)].T) > 0).any(axis=1)
        endless |= (moves[:, motors.sprung] != 0).any(axis=1)
        limited = np.isfinite(motors.limits).any()
        self.leads = np.array(leads, dtype=np.int64)[~endless if limited else np.zeros(len(leads), dtype=bool)]
        self.moves = joint_rates(hand, np.eye(l)[self.leads]).mid
        self.free = bool(len(self.leads))
        drive = contacts.sides.drive.joints
        carried = [{j for i in hand.path(link) for j in hand.links[i].joints} for link in task.links]
        self.moved = [j for j in drive if self.moves[:, j].any() and any(j in its for its in carried)]
        self.carries = np.array([[j in its for j in self.moved] for its in carried])  # (K, moved)
        self.turning = hand.revolute[self.moved]
        its = np.isfinite(motors.limits) & (np.abs(self.moves @ motors.rows.T) > 0).any(axis=0)
        # (L, m) what costs work, and whether only in one sense
        rows = self.moves @ motors.rows[its].T * motors.limits[its]
        rubs = self.moves * motors.friction
        self.costs = np.hstack([rows, rubs[:, rubs.any(axis=0)]])
        self.pulls = np.r_[motors.tendon[its], np.zeros(self.costs.shape[1] - its.sum(), dtype=bool)]

    def propose(self, boxes: Boxes, hits: Array) -> tuple[Motions, Integers]:
        """Motions, and for which of N boxes; hits: (k,) how often each load refuted a box."""
        N, n, _ = boxes.box.shape
        half = np.ptp(boxes.box, axis=2) / 2
        steps = np.vstack([np.zeros(n), np.eye(n), -np.eye(n)])
        at = boxes.box.mean(axis=2)[:, None] + steps * half[:, None]
        center, size, works = self._works(at.reshape(-1, n), np.repeat(boxes.charts, len(steps)), N)
        works = works.reshape(N, len(steps), *works.shape[1:])  # (N, steps, K, 3 or 4, 6 + L)
        middle, slope = works[:, 0], (works[:, 1 : n + 1] - works[:, n + 1 :]) / 2
        low, high = self._senses(boxes)
        order, loads = np.argsort(-hits, kind="stable"), self.placements.loads
        weights, twists, joints, which = [], [], [], []
        first = self._edges(
            np.tile(rim(FIRST_CONE_EDGES, soft=self.placements.torsion > 0), (self.placements.count, 1, 1))
        )
        for k in range(N):
            best, chosen, z = MIN_MARGIN, -1, np.zeros(0)
            rows = [first @ middle[k]]
            for load in order.tolist():
                found, x = self._program(loads[load], center[k], size[k], rows, low[k], high[k])
                if found > best:
                    best, chosen, z = found, load, x
            if chosen < 0:
                continue
            for _ in range(MOTION_ROUNDS):
                edges = np.concatenate([first, self._edges(self._worst(middle[k] @ z)[:, None])], axis=1)
                change = edges @ slope[k]  # (n, K, M, 6 + L)
                rows.append(edges @ middle[k] - (np.sign(change @ z)[..., None] * change).sum(axis=0))
                before = best
                best, z = self._program(loads[chosen], center[k], size[k], rows, low[k], high[k])
                if best <= MIN_MARGIN or best >= before * (1 - MARGIN_TOLERANCE):
                    break
            if best <= MIN_MARGIN:
                continue
            turn = z[3:6] / size[k]
            twists.append(np.r_[z[:3] - np.cross(turn, center[k]), turn])
            own = np.zeros(len(self.motors.friction))
            own[self.leads] = z[6:]
            joints.append(np.where(np.abs(own) > 1e-12 * np.abs(z).max(), own, 0.0))
            weights.append(np.eye(len(loads))[chosen])
            which.append(k)
        pairs = np.full((len(which), 2), NO_LINE)
        if not which:
            return Motions(np.zeros((0, len(loads))), pairs, np.zeros((0, 6))), np.zeros(0, dtype=np.int64)
        return Motions(np.array(weights), pairs, np.array(twists), np.array(joints)), np.array(which)

    @property
    def _coefficients(self) -> Array:
        """(2,) of friction along two tangents, (3,) with that of torsion."""
        mu, torsion = self.placements.friction, self.placements.torsion
        return np.array([mu, mu, torsion] if torsion else [mu, mu])

    def _worst(self, u: Array) -> Array:
        """(K, 3) on the rim of the cones the force that does least work on motions (K, 3 or 4) along its parts."""
        against = -u[:, 1:] * self._coefficients
        size = np.linalg.norm(against, axis=1, keepdims=True)
        out = np.where(size > 0, against / np.where(size > 0, size, 1.0), np.eye(against.shape[1])[0])
        return np.pad(out, ((0, 0), (0, 3 - out.shape[1])))

    def _edges(self, rims: Array) -> Array:
        """(K, M, 3 or 4) forces with a normal part of 1, and torsions, on the rim of the cones at (K, M, 3)."""
        own = self._coefficients
        return np.concatenate([np.ones((*rims.shape[:2], 1)), own * rims[..., : len(own)]], axis=2)

    def _works(self, x: Array, charts: Integers, N: int) -> tuple[Array, Array, Array]:
        """Centres and sizes of the contacts of N boxes; (S, K, 3 or 4, 6 + L) the works of forces of 1 at (S, n).

        Along the normal and two tangents, which differ little at points of one box, the first of which is its middle;
        of soft fingers of a unit torque about the normal besides.
        """
        posed = self.contacts.at(Interval.of(x), charts, 0)
        surface = self.contacts.sides.object.at(Interval.of(x))
        p, normals = surface.point.value.mid, -surface.normal.value.mid
        its, each = np.arange(N) * (len(x) // N), np.repeat(np.arange(N), len(x) // N)
        center = p[its].mean(axis=1)
        size = np.maximum(np.linalg.norm(p[its] - center[:, None], axis=2).max(axis=1), 1e-9)
        first = np.cross(normals, np.eye(3)[np.abs(normals[its]).argmin(axis=2)][each])
        first /= np.linalg.norm(first, axis=2, keepdims=True)
        forces = np.stack([normals, first, np.cross(normals, first)], axis=2)  # (S, K, 3, 3)
        arms = (p - center[each][:, None]) / size[each][:, None, None]
        axes = self.contacts.axes(posed, self.moved)
        speed, turn = np.zeros((2, len(x), p.shape[1], len(self.moved), 3))
        for m, (j, turning) in enumerate(zip(self.moved, self.turning.tolist(), strict=True)):
            along, point = (a.value.mid[:, None] for a in axes[j])
            speed[:, :, m] = np.cross(along, p - point) if turning else np.broadcast_to(along, p.shape)
            turn[:, :, m] = along * turning
        own = self.moves[:, self.moved]
        by_leads, turned = (np.einsum("skmx,lm->sklx", a * self.carries[..., None], own) for a in (speed, turn))
        of_joints = -np.einsum("skex,sklx->skel", forces, by_leads)
        works = np.concatenate([forces, np.cross(arms[:, :, None], forces), of_joints], axis=3)
        if self.placements.torsion:
            about = normals / size[each][:, None, None]
            spins = np.concatenate([0 * about, about, -np.einsum("skx,sklx->skl", normals, turned)], axis=2)
            works = np.concatenate([works, spins[:, :, None]], axis=2)
        return center, size, works

    def _senses(self, boxes: Boxes) -> tuple[Array, Array]:
        """(N, L) bounds of the leads' motions: a stop, on which a joint may lean, resists without a limit."""
        N, hand = len(boxes.box), self.contacts.task.hand
        ends = np.tile(hand.limits, (N, 1, 1))
        value = boxes.over.joints.value
        ends[:, list(self.contacts.sides.drive.joints)] = np.stack([value.lo, value.hi], axis=2)
        at_low, at_high = ends[..., 0] <= self.motors.stops[:, 0], ends[..., 1] >= self.motors.stops[:, 1]
        low, high = np.full((2, N, len(self.leads)), np.inf) * [[[-1]], [[1]]]
        for k, moves in enumerate(self.moves):
            # virtual motions against which a stop pushes are those away from it, with the sign turned
            up = (at_low & (moves < 0)) | (at_high & (moves > 0))
            down = (at_low & (moves > 0)) | (at_high & (moves < 0))
            high[up.any(axis=1), k] = 0.0
            low[down.any(axis=1), k] = 0.0
        return low, high

    def _program(
        self, load: Array, center: Array, size: float, rows: list[Array], low: Array, high: Array
    ) -> tuple[float, Array]:
        """The largest margin of rows (K, M, 6 + L), and (6 + L,) the motions; none if there are none."""
        own = np.r_[load[:3], (load[3:] - np.cross(center, load[:3])) / size]
        length = max(float(np.linalg.norm(own)), 1e-300)
        contact = np.concatenate([np.repeat(np.arange(len(some)), some.shape[1]) for some in rows])
        table = np.vstack([some.reshape(-1, some.shape[2]) for some in rows])
        limits, bounded = self.placements.force_limits, np.flatnonzero(self.placements.limited)
        m, b, d = self.costs.shape[1], len(bounded), table.shape[1]
        short = (contact[:, None] == bounded).astype(float)
        # variables: motions, work of each cost, shortfall at each limited contact, margin
        free = ~short.any(axis=1)[:, None]
        at_contacts = np.hstack([-table, np.zeros((len(table), m)), -short, free.astype(float)])
        costs = self.costs.T / length
        against = np.hstack([np.zeros((m, 6)), -costs, -np.eye(m), np.zeros((m, b + 1))])
        with_ = np.hstack([np.zeros((m, 6)), costs, -np.eye(m), np.zeros((m, b + 1))])[~self.pulls]
        works = np.r_[-own / length, np.zeros(d - 6), np.ones(m), limits[bounded] / length, 1.0]
        table = np.vstack([at_contacts, against, with_, works])
        ends = [(-1.0, 1.0)] * 6 + list(zip(low.tolist(), high.tolist(), strict=True))
        ends += [(0.0, None)] * (m + b) + [(None, 1.0)]
        cost = np.r_[np.zeros(table.shape[1] - 1), -1.0]
        done = linprog(cost, A_ub=table, b_ub=np.zeros(len(table)), bounds=ends, method="highs")
        return (float(-done.fun), done.x[:d]) if done.status == 0 else (-np.inf, np.zeros(0))
